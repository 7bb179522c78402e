"""Parameters: read by number or name; PFLY_FORCE and those of the law that flies can be set, within their ranges."""

import math
from collections.abc import Mapping

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.arming import ACCEPTED, DENIED
from flight.live.flight_process import (
    DivertFlight,
    FlightDiverted,
    FlightEnded,
    JudgeMission,
    LoiterCenter,
    StartFlight,
    send_event,
)
from flight.live.mission_server import MissionType
from flight.live.station_requests import FORCE, Parameters, vehicle_parameters
from flight.live.telemetry import AUTO, GUIDED, LOITER, PAUSED, RTL
from tests.flight.live.fake_vehicle import HEARTBEAT, FakeVehicle, command
from tests.stations import item
from world.errors import ParameterError


@pytest.fixture
def parameters() -> Parameters:
    return vehicle_parameters(
        airspeed=25.0, min_airspeed=18.0, max_airspeed=31.0, max_bank_deg=30.0, system=1, speed=2.0
    )


def test_each_is_found_by_number_and_by_name(parameters: Parameters) -> None:
    names = [entry.name for entry in parameters.entries]
    assert names == sorted(names)
    for number, name in enumerate(names):
        assert parameters.find(name.encode() + b"\0" * (16 - len(name)), -1) == number
        assert parameters.find(b"", number) == number
        message = parameters.message(number)
        assert (message.param_index, message.param_count) == (number, len(names))
    assert parameters.find(b"NO_SUCH", -1) is None
    assert parameters.find(b"", len(names)) is None


@pytest.mark.parametrize("value", [-1.0, 2.0, math.nan, math.inf])
def test_a_value_out_of_range_is_refused(parameters: Parameters, value: float) -> None:
    number, problem = parameters.set(FORCE.encode(), value)
    assert number is not None
    assert "allowed 0..1" in problem
    assert parameters[FORCE] == 0.0


def test_only_force_can_be_set(parameters: Parameters) -> None:
    for entry in list(parameters.entries):
        _, problem = parameters.set(entry.name.encode(), 1.0)
        assert bool(problem) == (entry.name != FORCE)
    assert parameters[FORCE] == 1.0
    assert parameters.set(b"NO_SUCH", 1.0) == (None, "NO_SUCH: no such parameter")


# ----------------------------------------------------------------------
# Requests of stations: each has its own message rates; what the vehicle is not flown by is refused at once.


def test_rates_that_a_station_asks_for_are_its_own(fake: FakeVehicle) -> None:
    fake.send(HEARTBEAT)
    fake.send(HEARTBEAT, port=6)
    fake.send(command(511, 30.0, 1e5), mavlink.MAVLink_request_data_stream_message(1, 1, 11, 2, 1))
    one, two = (fake.link.peers[("127.0.0.1", port)].periods for port in (5, 6))
    assert (one["ATTITUDE"], one["VFR_HUD"]) == (0.1, 0.5)
    assert (two["ATTITUDE"], two["VFR_HUD"]) == (1 / 30, 0.1)
    fake.send(command(511, 30.0, -1.0), command(511, 32.0, float("nan")), command(511, 74.0, 1.0))
    assert (one["ATTITUDE"], one["VFR_HUD"]) == (None, 0.02)


def sent(fake: FakeVehicle) -> list[object]:
    """What goes out from now on, as it is sent."""
    out: list[object] = []
    fake.link.send = lambda message, peer: out.append(message)
    return out


def results(out: list[object], number: int) -> list[int]:
    return [m.result for m in out if m.get_type() == "COMMAND_ACK" and m.command == number]


@pytest.mark.parametrize(
    ("number", "word"),
    [
        (178, "speed change"),
        (34, "orbit"),
        (186, "altitude change"),
        (22, "take-off"),
        (21, "land"),
    ],
)
def test_what_the_vehicle_is_not_flown_by_is_refused_at_once(fake: FakeVehicle, number: int, word: str) -> None:
    fake.send(HEARTBEAT)
    out = sent(fake)
    fake.send(command(number))
    assert results(out, number) == [mavlink.MAV_RESULT_UNSUPPORTED]
    assert next(m.text for m in out if m.get_type() == "STATUSTEXT").startswith(word)


def test_a_guided_target_is_refused_in_words(fake: FakeVehicle) -> None:
    """SET_POSITION_TARGET_GLOBAL_INT has no answer of its own."""
    fake.send(HEARTBEAT)
    out = sent(fake)
    target = mavlink.MAVLink_set_position_target_global_int_message(
        0, 1, 1, 6, 0, 460_000_000, 80_000_000, 150.0, *[0.0] * 8
    )
    for _ in range(20):
        fake.send(target)
    texts = [m.text for m in out if m.get_type() == "STATUSTEXT"]
    assert texts[0].startswith("target refused")
    assert sum(text.startswith("target") for text in texts) == 1, "a stream of targets is answered once"


ITEMS = [item(k, 460_000_000, 80_000_000 + 50_000 * k, 100.0) for k in range(5)]


def test_a_mission_starts_at_the_item_that_a_station_sets(fake: FakeVehicle) -> None:
    """It is judged anew as what is flown, with the items' own numbers; a new upload begins at its first item."""
    fake.upload(ITEMS)
    assert [one.seq for one in fake.orders[-1].mission.items] == [1, 2, 3, 4]
    out = sent(fake)
    fake.send(mavlink.MAVLink_mission_set_current_message(1, 1, 3))
    assert next(m.seq for m in out if m.get_type() == "MISSION_CURRENT") == 3
    assert isinstance(fake.orders[-1], JudgeMission)
    assert [one.seq for one in fake.orders[-1].mission.items] == [3, 4]
    fake.turn()
    assert fake.vehicle.status.current == 3
    assert len(fake.vehicle.server.lists[MissionType.MISSION]) == 5
    for number, result in ((0, 0), (4, 2), (5, 2)):
        fake.send(command(224, number))
        assert results(out, 224)[-1] == result, "the last item alone is no way, and there is no fifth"
    fake.turn()
    assert [one.seq for one in fake.orders[-1].mission.items] == [1, 2, 3, 4]
    fake.send(command(224, 2.0))
    fake.turn()
    fake.upload(ITEMS)
    assert [one.seq for one in fake.orders[-1].mission.items] == [1, 2, 3, 4]


def test_after_a_flight_from_an_item_the_whole_mission_is_flown_again(fake: FakeVehicle) -> None:
    fake.upload(ITEMS)
    fake.send(command(224, 3.0))
    fake.turn()
    fake.send(command(400, 1.0), command(176, 1.0, 10.0))
    assert fake.vehicle.arming.flying
    assert isinstance(fake.orders[-1], StartFlight)
    send_event(fake.flight, FlightEnded("completed"))
    fake.vehicle.step(0.1)
    fake.turn()
    fake.turn()
    assert [one.seq for one in fake.orders[-1].mission.items] == [1, 2, 3, 4]


def test_a_refused_item_is_met_with_silence_by_message_and_with_a_result_by_command(fake: FakeVehicle) -> None:
    """MAVSDK sends MISSION_SET_CURRENT again, without end, at each MISSION_CURRENT of another item."""
    fake.upload(ITEMS)
    (peer,) = fake.link.peers.values()
    out = sent(fake)
    before = fake.vehicle._clock()
    fake.send(mavlink.MAVLink_mission_set_current_message(1, 1, 9))
    assert not [m for m in out if m.get_type() == "MISSION_CURRENT"]
    assert 2.9 < peer.due["MISSION_CURRENT"] - before < 4.0
    assert any(m.get_type() == "STATUSTEXT" and m.text.startswith("item 9 refused: the mission has no") for m in out)
    fake.send(command(224, 9.0))
    assert results(out, 224) == [mavlink.MAV_RESULT_DENIED]


# ----------------------------------------------------------------------
# In flight: other ways are flown, and what the law flies with stays as it is.


@pytest.fixture
def in_flight(fake: FakeVehicle) -> FakeVehicle:
    fake.upload(ITEMS)
    fake.send(command(400, 1.0), command(176, 1.0, 10.0))
    assert isinstance(fake.orders[-1], StartFlight)
    return fake


def diverted(fake: FakeVehicle) -> DivertFlight:
    fake.turn()
    assert isinstance(fake.orders[-1], DivertFlight)
    return fake.orders[-1]


@pytest.mark.parametrize(("asked", "mode"), [(command(20), RTL), (command(17), LOITER), (command(193, 0.0), LOITER)])
def test_a_command_is_a_mode_by_another_name(in_flight: FakeVehicle, asked: object, mode: int) -> None:
    in_flight.send(asked)
    found = diverted(in_flight)
    assert (found.mode, math.isnan(found.center.lat_deg)) == (mode, True)
    send_event(in_flight.flight, FlightDiverted(mode, ""))
    in_flight.turn()
    assert in_flight.vehicle.status.mission_state == PAUSED


def test_a_reposition_names_a_place_and_what_it_leaves_out_is_that_of_here(in_flight: FakeVehicle) -> None:
    out = sent(in_flight)
    nan = math.nan
    # Frame 3 is a height over home; 2147483647 stands for no longitude.
    in_flight.send(
        mavlink.MAVLink_command_int_message(1, 1, 3, 192, 0, 0, -1, 1, 120, nan, 460_050_000, 80_100_000, 90.0)
    )
    assert diverted(in_flight).center == LoiterCenter(46.005, 8.01, 90.0, 3, 120.0)
    assert diverted(in_flight).mode == GUIDED
    in_flight.send(command(192, -1.0, 1.0, nan, nan, nan, nan, 640.0))
    place = diverted(in_flight).center
    assert (math.isnan(place.lat_deg), math.isnan(place.lon_deg), place.alt, place.radius) == (True, True, 640.0, 0.0)
    before = len(in_flight.orders)
    in_flight.send(command(192, -1.0, 1.0, 0.0, nan, 95.0, 8.0, 640.0))
    assert results(out, 192) == [ACCEPTED, ACCEPTED, DENIED]
    assert len(in_flight.orders) == before


def test_the_mission_goes_on_at_the_item_that_it_was_on_or_that_a_station_sets(in_flight: FakeVehicle) -> None:
    out = sent(in_flight)
    in_flight.vehicle.status.current = 2
    in_flight.send(command(20))
    in_flight.send(command(176, 1.0, AUTO))
    assert [one.seq for one in diverted(in_flight).mission.items] == [2, 3, 4]
    # Beside the mission an item is chosen for later; on it, it is flown to at once, the last one too.
    in_flight.send(command(176, 1.0, LOITER), command(224, 3.0))
    assert diverted(in_flight).mode == LOITER
    in_flight.send(command(176, 1.0, AUTO))
    assert [one.seq for one in diverted(in_flight).mission.items] == [3, 4]
    in_flight.send(mavlink.MAVLink_mission_set_current_message(1, 1, 4))
    assert [one.seq for one in diverted(in_flight).mission.items] == [4]
    assert results(out, 224) == [ACCEPTED]


def test_a_way_that_cannot_be_flown_leaves_it_in_its_mode(in_flight: FakeVehicle) -> None:
    out = sent(in_flight)
    in_flight.send(command(20))
    send_event(in_flight.flight, FlightDiverted(AUTO, "no way there"))
    in_flight.turn()
    assert in_flight.vehicle.arming.mode == AUTO
    assert "RTL refused: no way there" in [m.text for m in out if m.get_type() == "STATUSTEXT"]


def flown(stated: Mapping[str, float]) -> dict[str, float]:
    """A law that flies with two parameters, of which one is stated elsewhere."""
    if stated.get("WP_RADIUS", 90.0) < 1.0:
        raise ParameterError("WP_RADIUS: 0.5: allowed 1..32767")
    return {"WP_RADIUS": 90.0, "THR_MIN": 0.0} | stated | {"AIRSPEED_CRUISE": 25.0}


def test_parameters_that_fly_are_set_on_the_ground_and_the_mission_is_judged_anew(fake: FakeVehicle) -> None:
    fake.vehicle.requests.parameters = fake.vehicle._parameters = parameters_of_a_law()
    fake.upload(ITEMS)
    out = sent(fake)

    def setting(name: bytes, value: float) -> tuple[float, str]:
        fake.send(mavlink.MAVLink_param_set_message(1, 1, name, value, 9))
        fake.turn()
        values = [m.param_value for m in out if m.get_type() == "PARAM_VALUE"]
        # A text travels in pieces of 50 characters.
        texts = [m.text for m in out if m.get_type() == "STATUSTEXT"]
        out.clear()
        return values[-1], "".join(texts)

    # 70.3 as it travels: the number that was typed is flown with.
    assert setting(b"WP_RADIUS", 70.3)[0] == pytest.approx(70.3)
    assert isinstance(fake.orders[-1], JudgeMission)
    assert fake.orders[-1].parameters == (("WP_RADIUS", 70.3),)
    judged = len(fake.orders)
    assert setting(b"WP_RADIUS", 0.5) == (pytest.approx(70.3), "WP_RADIUS: 0.5: allowed 1..32767; the value stays 70.3")
    assert setting(b"WP_RADIUS", math.nan)[1] == "WP_RADIUS nan: expected a finite number; the value stays 70.3"
    assert setting(b"AIRSPEED_CRUISE", 22.0)[1].startswith("AIRSPEED_CRUISE is fixed by the aircraft or")
    assert len(fake.orders) == judged
    fake.send(command(400, 1.0), command(176, 1.0, 10.0))
    value, text = setting(b"THR_MIN", 5.0)
    assert (value, "THR_MIN 5: refused, because parameters are fixed during a flight" in text) == (0.0, True)


def parameters_of_a_law() -> Parameters:
    return vehicle_parameters(
        airspeed=25.0,
        min_airspeed=18.0,
        max_airspeed=31.0,
        max_bank_deg=30.0,
        system=1,
        speed=2.0,
        autopilot_values=flown,
    )
