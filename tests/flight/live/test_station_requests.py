"""Requests of stations: each has its own message rates."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.flight.live.fake_vehicle import HEARTBEAT, FakeVehicle, command


def test_rates_that_a_station_asks_for_are_its_own(fake: FakeVehicle) -> None:
    fake.send(HEARTBEAT)
    fake.send(HEARTBEAT, port=6)
    fake.send(command(511, 30.0, 1e5), mavlink.MAVLink_request_data_stream_message(1, 1, 11, 2, 1))
    one, two = (fake.link.peers[("127.0.0.1", port)].periods for port in (5, 6))
    assert (one["ATTITUDE"], one["VFR_HUD"]) == (0.1, 0.5)
    assert (two["ATTITUDE"], two["VFR_HUD"]) == (1 / 30, 0.1)
    fake.send(command(511, 30.0, -1.0), command(511, 32.0, float("nan")), command(511, 74.0, 1.0))
    assert (one["ATTITUDE"], one["VFR_HUD"]) == (None, 0.02)
