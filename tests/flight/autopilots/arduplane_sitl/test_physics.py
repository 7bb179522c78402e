"""The packets of ArduPilot's JSON physics interface: what is read, what is written, and positions on its sphere."""

import json
import math
import re
import socket
import struct
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import aircraft_names, load_aircraft
from flight.autopilots.arduplane_sitl import physics
from flight.autopilots.arduplane_sitl.physics import (
    JsonLockstep,
    PhysicsPort,
    ServoPacket,
    encode_motion,
    parse_servo_packet,
)
from flight.autopilots.sitl.exchange import (
    METRES_PER_DEGREE,
    POLL_INTERVAL_FRAMES,
    PUSH_ACCELERATION_MPS2,
    BodyMotion,
    RailEnd,
    motion_on_rail,
    offset_on_sphere,
    rail_end,
)
from flight.autopilots.sitl.servos import ServoOutput, load_servo_map
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import steady_flight
from flight.guidance.gains import load_gains
from flight.guidance.path import waypoint_records
from flight.mission.items import Home
from flight.simulation.tick import Workspace
from tests.setups import setup_maker
from world.errors import FlightError
from world.running_clock import RunningClock

MOTION = BodyMotion(
    12.5, 0.01, -0.02, 0.03, 0.5, -0.25, -9.8, 100.25, -200.5, -30.125, 0.1, -0.05, 1.5, 24.0, -3.5, 0.75, 25.5
)


@pytest.mark.parametrize(("magic", "count"), [(18458, 16), (29569, 32)])
def test_a_packet_holds_its_frame_and_its_outputs(magic: int, count: int) -> None:
    data = magic.to_bytes(2, "little") + (120).to_bytes(2, "little") + (70_000).to_bytes(4, "little")
    data += b"".join((1000 + k).to_bytes(2, "little") for k in range(count))
    packet = parse_servo_packet(data)
    assert (packet.frame, packet.pulses) == (70_000, tuple(range(1000, 1000 + count)))


@pytest.mark.parametrize(
    "data",
    [b"", b"\x1a", struct.pack("<HHI16H", 4711, 120, 1, *[0] * 16), struct.pack("<HHI15H", 18458, 120, 1, *[0] * 15)],
)
def test_any_other_packet_is_of_another_version(data: bytes) -> None:
    with pytest.raises(
        FlightError, match=r"uses another version of the physics interface: a packet of .* allowed: 18458"
    ):
        parse_servo_packet(data)


def test_an_answer_is_one_json_object_between_line_ends() -> None:
    data = encode_motion(MOTION)
    assert data[:1] + data[-1:] == b"\n\n"
    assert data.count(b"\n") == 2
    # The autopilot looks for keys and brackets as text.
    assert b" " not in data
    assert json.loads(data) == {
        "timestamp": 12.5,
        "imu": {"gyro": [0.01, -0.02, 0.03], "accel_body": [0.5, -0.25, -9.8]},
        "position": [100.25, -200.5, -30.125],
        "attitude": [0.1, -0.05, 1.5],
        "velocity": [24.0, -3.5, 0.75],
        "airspeed": 25.5,
    }


def test_an_answer_has_the_battery_where_there_is_one() -> None:
    data = encode_motion(MOTION, (44.4, 12.3456))
    assert json.loads(data)["battery"] == {"voltage": 44.4, "current": 12.3456}
    assert json.loads(data)["airspeed"] == 25.5
    assert b" " not in data
    assert data.count(b"\n") == 2


def test_small_numbers_keep_their_form() -> None:
    assert re.search(rb"\de", encode_motion(BodyMotion(*[1e-9] * 17))) is None


def test_a_degree_is_as_long_as_on_ardupilots_sphere() -> None:
    lat, lon = math.radians(36.5), math.radians(-84.0)
    north, east = offset_on_sphere(lat + math.radians(1.0), lon, lat, lon)
    assert (north, east) == pytest.approx((METRES_PER_DEGREE, 0.0))
    # East at the latitude half way.
    north, east = offset_on_sphere(lat + math.radians(1.0), lon + math.radians(1.0), lat, lon)
    assert (north, east) == pytest.approx((111318.845, 111318.845 * math.cos(math.radians(37.0))))


def test_an_offset_crosses_the_180th_meridian() -> None:
    _, east = offset_on_sphere(0.0, math.radians(-179.9), 0.0, math.radians(179.9))
    assert east == pytest.approx(0.2 * METRES_PER_DEGREE)


# ----------------------------------------------------------------------
# The physics' end of the exchange: frames in order, the same frame told again, silence and other versions named.


def packet(frame: int) -> bytes:
    return struct.pack("<HHI16H", 18458, 120, frame, *[1500] * 16)


@pytest.fixture
def port() -> Iterator[PhysicsPort]:
    opened = PhysicsPort()
    yield opened
    opened.close()


@pytest.fixture
def autopilot(port: PhysicsPort) -> Iterator[socket.socket]:
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.connect(("127.0.0.1", port.port))
    opened.settimeout(60.0)
    yield opened
    opened.close()


class Looks:
    """A program that is looked at, and a clock that goes on by a quarter of a second with each look, leaps beside."""

    def __init__(self, leaps: dict[int, float] | None = None) -> None:
        self.now, self.count, self._leaps = 100.0, 0, leaps or {}

    def __call__(self) -> None:
        self.count += 1
        self.now += 0.25 + self._leaps.get(self.count, 0.0)


@pytest.fixture
def looked_at(port: PhysicsPort, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Looks]:
    def begin(silence: float, leaps: dict[int, float] | None = None) -> Looks:
        looks = Looks(leaps)
        monkeypatch.setattr(physics, "SILENCE_TIMEOUT_S", silence)
        port.check_program, port._clock = looks, RunningClock(lambda: looks.now)
        looks.now += 0.1  # since the port was opened
        return looks

    return begin


def test_frames_are_taken_in_order_and_answered_to_their_sender(port: PhysicsPort, autopilot: socket.socket) -> None:
    for frame in (0, 1, 5):
        autopilot.send(packet(frame))
        assert port.receive().frame == frame
        port.answer(b"answer %d" % frame)
        assert autopilot.recv(100) == b"answer %d" % frame


def test_a_frame_that_is_asked_for_again_is_told_again_and_no_frame(
    port: PhysicsPort, autopilot: socket.socket, looked_at: Callable[..., Looks]
) -> None:
    looks = looked_at(10.0)
    autopilot.send(packet(3))
    port.receive()
    port.answer(b"the third")
    looks.now += 0.15
    for frame in (3, 3, 4):
        autopilot.send(packet(frame))
    assert port.receive().frame == 4
    assert [autopilot.recv(100) for _ in range(3)] == [b"the third"] * 3


def test_what_was_asked_before_the_answer_came_has_had_it(
    port: PhysicsPort, autopilot: socket.socket, looked_at: Callable[..., Looks]
) -> None:
    looked_at(10.0)
    port.check_program = lambda: None
    for frame in (3, 3, 3):
        autopilot.send(packet(frame))
    port.receive()
    port.answer(b"the third")
    autopilot.send(packet(4))
    assert port.receive().frame == 4
    port.answer(b"the fourth")
    assert [autopilot.recv(100) for _ in range(2)] == [b"the third", b"the fourth"]


def test_a_frame_that_was_before_is_a_new_beginning(port: PhysicsPort, autopilot: socket.socket) -> None:
    autopilot.send(packet(3))
    port.receive()
    autopilot.send(packet(2))
    with pytest.raises(FlightError, match="restarted in the air: frame 2 after frame 3"):
        port.receive()


def test_silence_ends_the_wait_and_not_sooner(port: PhysicsPort, looked_at: Callable[..., Looks]) -> None:
    looks = looked_at(0.6)
    with pytest.raises(FlightError, match="sent no outputs for 1 s; the flight is ended"):
        port.receive()
    # At 0, 0.25, 0.5 and 0.75 s.
    assert looks.count == 4


def test_a_sleeping_laptop_is_no_silence(port: PhysicsPort, looked_at: Callable[..., Looks]) -> None:
    """Its clock leaps by an hour in the middle of a wait: the program, which slept too, is still waited for."""
    looks = looked_at(1.6, {2: 3600.0})
    with pytest.raises(FlightError, match="sent no outputs"):
        port.receive()
    # The leap counts as one second: at 0, 0.25, 1.25, 1.5 and 1.75 s.
    assert looks.count == 5


def test_the_same_question_without_end_is_no_understanding(
    port: PhysicsPort, autopilot: socket.socket, looked_at: Callable[..., Looks]
) -> None:
    looked_at(0.5)
    autopilot.send(packet(7))
    port.receive()
    port.answer(b"what it does not understand")
    for _ in range(5):
        autopilot.send(packet(7))
    with pytest.raises(FlightError, match="does not understand planfly's answers: it requested frame 7 again"):
        port.receive()


def test_a_wait_watches_the_program(port: PhysicsPort) -> None:
    def gone() -> None:
        raise FlightError("ended")

    port.check_program = gone
    with pytest.raises(FlightError, match="ended"):
        port.receive()


# ----------------------------------------------------------------------
# Servos as an aircraft's folder has them: pulses to controls, and the parameters that make the outputs these.

AEROSONDE = load_aircraft("aerosonde")
GOOD = """
[aileron]
output = 1
pulse_us = [1100, 1500, 1900]
value_deg = [-20.0, 0.0, 20.0]
[elevator]
output = 2
pulse_us = [1000, 1400, 2000]
value_deg = [10.0, 0.0, -15.0]
[throttle]
output = 5
pulse_us = [1000, 2000]
value = [0.0, 1.0]
[rudder]
output = 32
pulse_us = [1100, 1900]
value_deg = [30.0, -30.0]
"""


def write(folder: Path, text: str) -> Path:
    (folder / "ardupilot.toml").write_text(text, encoding="utf-8")
    return folder


def test_pulses_move_the_controls_linearly_between_the_knots_and_no_further() -> None:
    output = ServoOutput(2, (1000.0, 1400.0, 2000.0), (0.2, 0.0, -0.3))
    pulses = (900, 1000, 1200, 1400, 1700, 2000, 2100)
    assert [output.value(pulse) for pulse in pulses] == pytest.approx([0.2, 0.2, 0.1, 0.0, -0.15, -0.3, -0.3])
    # No pulse leaves a servo at rest.
    assert output.value(0) == 0.0
    assert output.center_pulse == 1400.0


def test_the_controls_come_from_their_outputs(tmp_path: Path) -> None:
    servos = load_servo_map(replace(AEROSONDE, folder=write(tmp_path, GOOD)))
    pulses = [0] * 32
    pulses[0], pulses[1], pulses[4], pulses[31] = 1900, 2000, 1250, 1900
    assert servos.commands(pulses) == pytest.approx((math.radians(-15), math.radians(20), math.radians(-30), 0.25))
    assert {name: value for name, value in servos.parameters().items() if name.startswith("SERVO2_")} == {
        "SERVO2_FUNCTION": 19.0,
        "SERVO2_MIN": 1000.0,
        "SERVO2_MAX": 2000.0,
        "SERVO2_TRIM": 1400.0,
    }
    assert servos.parameters()["SERVO5_TRIM"] == 1000.0
    assert servos.parameters()["SERVO32_FUNCTION"] == 21.0


@pytest.mark.parametrize("name", aircraft_names())
def test_full_pulses_are_the_aircrafts_full_throws(name: str) -> None:
    aircraft = load_aircraft(name)
    servos = load_servo_map(aircraft)
    elevator, *full = servos.commands([1900, 1900, 2000, 1900])
    # More is: roll right, nose up, full throttle, nose right; a trailing edge down and a yaw to the left are positive.
    assert full == pytest.approx([aircraft.max_aileron, -aircraft.max_rudder, 1.0])
    middle, *rest = servos.commands([1500, 1500, 1000, 1500])
    assert rest == pytest.approx([0.0, 0.0, 0.0])
    # The elevator moves by as much about the place where level flight at cruise has it.
    level = steady_flight(Fdm(aircraft), aircraft.airspeed, 500.0)
    assert level is not None
    assert middle == pytest.approx(level.elevator, abs=math.radians(0.1))
    assert elevator - middle == pytest.approx(-aircraft.max_elevator)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            ("[rudder]", "[flaps]"),
            "tables aileron, elevator, flaps, throttle: expected the tables elevator, aileron, rudder, throttle$",
        ),
        (("output = 5", "output = 0"), "throttle.output = 0: allowed 1..32"),
        (("output = 5", "output = true"), "throttle.output = True: allowed 1..32"),
        (
            ("[1000, 1400, 2000]", "[1000, 2000, 1400]"),
            "elevator.pulse_us = .*: expected increasing numbers, as many as in value_deg",
        ),
        (
            ("[1000, 1400, 2000]", "[1000, 1400]"),
            "elevator.pulse_us = .*: expected increasing numbers, as many as in value_deg",
        ),
        (("[1000, 1400, 2000]", "[1000]"), "elevator.pulse_us = .*: expected two finite numbers or more"),
        (("value = [0.0, 1.0]", "value = [0.0, nan]"), "throttle.value = .*: expected two finite numbers or more"),
        (("value = [0.0", "value_deg = [0.0"), "throttle: expected keys output, pulse_us and value"),
        (("[aileron]", "[aileron"), "ardupilot.toml: .*line"),
    ],
)
def test_a_bad_file_is_one_line(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    folder = write(tmp_path, GOOD.replace(*change))
    with pytest.raises(FlightError, match=said):
        load_servo_map(replace(AEROSONDE, folder=folder))


def test_an_aircraft_without_the_file_says_what_it_is_for(tmp_path: Path) -> None:
    with pytest.raises(FlightError, match=r"ardupilot.toml: .*; the autopilot's program needs this file, which states"):
        load_servo_map(replace(AEROSONDE, folder=tmp_path))


# ----------------------------------------------------------------------
# The rail in the air: what the sensors of an aircraft that is held, and then pushed, would measure.

GRAVITY = 9.80665
LAT, LON = math.radians(46.0), math.radians(8.0)
# East at 20 m/s over the ground, in 5 m/s of head wind from the east, nose up by 3 degrees.
END = RailEnd(LAT, LON, 500.0, 0.0, math.radians(3.0), math.pi / 2.0, math.pi / 2.0, 20.0, 0.0, -5.0)
ORIGIN = (LAT, LON, 400.0)


def test_at_rest_it_measures_the_force_that_holds_it() -> None:
    motion = motion_on_rail(END, 7.0, 0.0, ORIGIN)
    assert motion.time == 7.0
    assert (motion.roll_rate, motion.pitch_rate, motion.yaw_rate) == (0.0, 0.0, 0.0)
    # Up: backwards is the nose's part of it.
    assert (motion.force_x, motion.force_y, motion.force_z) == pytest.approx(
        (GRAVITY * math.sin(math.radians(3.0)), 0.0, -GRAVITY * math.cos(math.radians(3.0)))
    )
    assert (motion.velocity_north, motion.velocity_east, motion.velocity_down) == (0.0, 0.0, 0.0)
    # The wind alone.
    assert motion.airspeed == 5.0
    # Behind its end by v^2 / 2 a, and 100 m above the origin.
    assert (motion.north, motion.east, motion.down) == pytest.approx((0.0, -40.0, -100.0), abs=0.2)


def test_a_banked_hold_shares_the_force_between_the_axes() -> None:
    rolled = RailEnd(LAT, LON, 500.0, math.radians(30.0), 0.0, 1.0, 1.0, 20.0, 0.0, 0.0)
    motion = motion_on_rail(rolled, 0.0, 0.0, ORIGIN)
    # The right wing is down: what holds it up points to its left side.
    assert (motion.force_x, motion.force_y, motion.force_z) == pytest.approx(
        (0.0, -0.5 * GRAVITY, -GRAVITY * math.cos(math.radians(30.0))), abs=1e-9
    )


def test_a_push_is_felt_seen_and_adds_up() -> None:
    assert END.push_time == 20.0 / PUSH_ACCELERATION_MPS2
    half = motion_on_rail(END, 0.0, 2.0, ORIGIN)
    assert half.velocity_east == pytest.approx(10.0)
    assert half.airspeed == pytest.approx(15.0)
    # PUSH_ACCELERATION_MPS2 along the nose, but for its rise.
    rise = math.radians(3.0)
    assert half.force_x == pytest.approx(PUSH_ACCELERATION_MPS2 * math.cos(rise) + GRAVITY * math.sin(rise))
    # 0.5 a t^2 from the beginning.
    begin = motion_on_rail(END, 0.0, 0.0, ORIGIN)
    assert half.east - begin.east == pytest.approx(0.5 * PUSH_ACCELERATION_MPS2 * 4.0, rel=2e-3)


def test_at_its_end_it_is_the_trimmed_flight_and_no_push() -> None:
    for late in (0.0, 3.0):
        motion = motion_on_rail(END, 0.0, END.push_time + late, ORIGIN)
        assert (motion.north, motion.east, motion.velocity_east) == pytest.approx((0.0, 0.0, 20.0), abs=1e-6)
        assert motion.airspeed == pytest.approx(25.0)
        assert motion.force_x == pytest.approx(GRAVITY * math.sin(math.radians(3.0)))


# ----------------------------------------------------------------------
# A frame of the exchange: the controls as asked, one step of JSBSim, and what the autopilot is told of it.

HOME = Home(46.0, 8.0, 400.0)


class Port:
    """Asks for the same pulses each frame, and keeps what it is told."""

    def __init__(self) -> None:
        self.pulses = [1500] * 16
        self.frame = 0
        self.told: list[dict[str, Any]] = []

    def receive(self) -> ServoPacket:
        self.frame += 1
        return ServoPacket(self.frame, tuple(self.pulses))

    def answer(self, data: bytes) -> None:
        self.told.append(json.loads(data))


class Exchange:
    """A trimmed Aerosonde 100 m over home, heading east at 25 m/s in 4 m/s of wind from the north."""

    def __init__(self) -> None:
        setup = setup_maker(AEROSONDE)(np.array([[0.0, 0.0, 500.0], [900.0, 0.0, 500.0]]))
        self.space = Workspace(load_gains(AEROSONDE), setup.path, waypoint_records(setup.route))
        self.fdm = Fdm(AEROSONDE)
        self.trim = self.fdm.start(46.0, 8.0, 500.0, math.pi / 2.0, 25.0, 0.0, (-4.0, 0.0, 0.0))
        self.port, self.looks = Port(), 0
        servos = load_servo_map(AEROSONDE)
        self.lockstep = JsonLockstep(self.port, servos, self.fdm, self.space, HOME, self.look)  # type: ignore[arg-type]  # a port by hand

    def look(self) -> None:
        self.looks += 1


@pytest.fixture
def exchange() -> Exchange:
    return Exchange()


def test_a_step_tells_the_motion_of_a_trimmed_flight(exchange: Exchange) -> None:
    exchange.fdm.write(exchange.trim.commands())
    exchange.lockstep.step()
    (told,) = exchange.port.told
    assert told["timestamp"] == pytest.approx(1.0 / 120.0, abs=1e-6)
    assert told["airspeed"] == pytest.approx(25.0, abs=1e-3)
    # Square to the wind: sqrt(25^2 - 4^2) over the ground.
    assert told["velocity"] == pytest.approx([0.0, math.sqrt(609.0), 0.0], abs=0.01)
    assert told["position"] == pytest.approx([0.0, math.sqrt(609.0) / 120.0, -100.0], abs=0.02)
    # Nothing accelerates: what is felt is what holds it up, along the body's axes.
    roll, pitch, yaw = told["attitude"]
    up = 9.8 * np.array([math.sin(pitch), -math.sin(roll) * math.cos(pitch), -math.cos(roll) * math.cos(pitch)])
    assert told["imu"]["accel_body"] == pytest.approx(up.tolist(), abs=0.03)
    # Into the wind from the left.
    assert yaw == pytest.approx(math.pi / 2.0 - math.asin(4.0 / 25.0), abs=1e-3)


def test_the_batterys_volts_and_amperes_are_told(exchange: Exchange) -> None:
    exchange.lockstep.step_on_rail(rail_end(exchange.fdm.read(), (-4.0, 0.0, 0.0)))
    exchange.fdm.write(exchange.trim.commands())
    exchange.lockstep.step()
    resting, flying = (told["battery"] for told in exchange.port.told)
    assert resting == {"voltage": 44.4, "current": 0.0}
    assert flying["voltage"] == 44.4
    # The book's drag at 25 m/s takes some 190 W of thrust; propeller and motor lose half of what they get.
    assert 200.0 < 44.4 * flying["current"] < 500.0
    assert 44.4 * flying["current"] == pytest.approx(float(exchange.fdm.read().power), rel=1e-3)


def test_a_loop_flies_on_the_controls_that_are_asked_for(exchange: Exchange) -> None:
    ticks: list[float] = []

    def tick() -> int:
        ticks.append(float(exchange.space.commands[1]))
        return 0

    exchange.port.pulses[:4] = 1700, 1500, 1775, 1500
    loop = exchange.lockstep.make_loop(tick, 2, gusts=False, ground=False)
    assert loop(10) == 0
    # 200 of 400 microseconds are half the ailerons' throw, and roll it to the right.
    assert ticks == pytest.approx([math.radians(15.0)] * 10)
    assert len(exchange.port.told) == 20
    assert exchange.port.told[-1]["attitude"][0] > 0.05
    assert exchange.fdm.read().aileron == pytest.approx(math.radians(15.0), abs=0.02)


def test_a_status_ends_the_loop_before_the_step(exchange: Exchange) -> None:
    loop = exchange.lockstep.make_loop(lambda: 3, 2, gusts=False, ground=False)
    assert loop(10) == 3
    assert exchange.port.told == []


def test_wind_and_ground_are_set_as_the_tick_has_them(exchange: Exchange) -> None:
    def tick() -> int:
        exchange.space.output[4:] = 10.0, 20.0, -5.0, 300.0
        return 0

    exchange.lockstep.make_loop(tick, 2, gusts=True, ground=True)(1)
    state = exchange.fdm.read()
    foot = 0.3048
    assert (state.wind_north, state.wind_east, state.wind_down) == pytest.approx(
        (10.0 * foot - 4.0, 20.0 * foot, -5.0 * foot), abs=1e-6
    )
    assert exchange.fdm.height() == pytest.approx(500.0 - 300.0 * foot, abs=0.5)


def test_satellites_mistake_what_is_told_on_the_rail_and_off_it(exchange: Exchange) -> None:
    rail = rail_end(exchange.fdm.read(), (-4.0, 0.0, 0.0))
    lockstep, told = exchange.lockstep, exchange.port.told
    for error in ((0.0,) * 6, (1.0, 2.0, 3.0, 0.1, 0.2, 0.3)):
        lockstep.error = error
        lockstep.step_on_rail(rail)
    right, wrong = told
    assert np.subtract(wrong["position"], right["position"]) == pytest.approx([1.0, 2.0, -3.0], abs=1e-3)
    assert np.subtract(wrong["velocity"], right["velocity"]) == pytest.approx([0.1, 0.2, -0.3], abs=1e-3)
    lockstep.step()
    assert told[-1]["position"] == pytest.approx([1.0, 2.0 + 24.7 / 120.0, -103.0], abs=0.02)
    assert told[-1]["velocity"] == pytest.approx([0.1, math.sqrt(609.0) + 0.2, -0.3], abs=0.02)


def test_a_look_is_taken_every_tenth_of_a_second(exchange: Exchange) -> None:
    for _ in range(3 * POLL_INTERVAL_FRAMES):
        exchange.lockstep.answer_frame()
    assert exchange.looks == 3
    assert exchange.lockstep.time == pytest.approx(0.3)
