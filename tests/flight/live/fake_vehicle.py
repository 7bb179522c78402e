"""A vehicle whose datagrams and flying process are the test's, and the messages that are sent to it."""

import multiprocessing

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.flight_process import JudgeMission, MissionJudged, send_event
from flight.live.link import SIGNING_EPOCH_S, Access, Link
from flight.live.station_requests import vehicle_parameters
from flight.live.telemetry import Snapshot
from flight.live.vehicle import Standby, Vehicle
from flight.mission.items import Home

LOCAL = Access(("127.0.0.1", 0), (("127.0.0.1", 9),))
HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
KEY = bytes(range(32))
WALL = SIGNING_EPOCH_S + 3e8


def packed(message: object, system: int = 255, seq: int = 0) -> bytes:
    mav = mavlink.MAVLink(None, system, 190)
    mav.seq = seq
    return message.pack(mav)


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


class FakeVehicle:
    """A vehicle whose datagrams and flying process are the test's."""

    def __init__(self) -> None:
        self.link = Link(LOCAL)
        ours, self.flight = multiprocessing.Pipe()
        home = Home(46.0, 8.0, 400.0)
        snapshot = Snapshot(time=0.0, lat_deg=46.0, lon_deg=8.0, amsl=500.0, height=100.0)
        parameters = vehicle_parameters(
            airspeed=25.0, min_airspeed=18.0, max_airspeed=30.0, max_bank_deg=30.0, system=1, speed=1.0
        )
        self.shown: list[str] = []
        self.flyable = True
        self.vehicle = Vehicle(self.link, lambda: ours, parameters, Standby(snapshot, home), 200.0, 14.8, self.show)
        self.orders: list[object] = []

    def show(self, text: str) -> None:
        self.shown = [*self.shown[-99:], text]

    def send(self, *messages: object, port: int = 5, system: int = 255) -> None:
        self.feed([packed(message, system) for message in messages], port)

    def feed(self, datagrams: list[bytes], port: int = 5) -> None:
        found = [one for data in datagrams for one in self.link.decode_datagram(data, ("127.0.0.1", port))]
        self.link.receive = lambda: found  # the one place where bytes come in
        for message, peer in found:
            self.vehicle._handle_message(message, peer, self.vehicle._clock())
        del self.link.receive
        self.turn()

    def turn(self) -> None:
        """Answer the vehicle's orders as a flying process would, and give it its turn."""
        while self.flight.poll():
            order = self.flight.recv()
            self.orders = [*self.orders[-99:], order]
            if isinstance(order, JudgeMission):
                snapshot = self.vehicle.status.snapshot
                home = order.mission.home
                send_event(self.flight, MissionJudged(order.number, True, self.flyable, (), home, (1, 2), snapshot))
        self.vehicle.step(0.0)

    def upload(self, items: list[object], port: int = 5) -> None:
        self.send(HEARTBEAT, mavlink.MAVLink_mission_count_message(1, 1, len(items), 0), *items, port=port)
        self.turn()

    def close(self) -> None:
        self.link.close()
        self.flight.close()


def command(number: int, *values: float) -> object:
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, *values, *[0.0] * (7 - len(values)))
