"""A frame of the exchange: the controls as asked, one step of JSBSim, and what the autopilot is told of it."""

import json
import math
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.dynamics.fdm import Fdm
from flight.guidance.fly_by_path import waypoint_records
from flight.guidance.gains import load_gains
from flight.mission.items import Home
from flight.real_autopilot.json_physics import ServoPacket
from flight.real_autopilot.lockstep import LOOK_FRAMES, Lockstep
from flight.real_autopilot.servo_map import load_servo_map
from flight.real_autopilot.start_rail import rail_end
from flight.simulation.workspace import Workspace
from tests.setups import setup_maker

AEROSONDE = load_aircraft("aerosonde")
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
        self.lockstep = Lockstep(self.port, servos, self.fdm, self.space, HOME, self.look)  # type: ignore[arg-type]  # a port by hand

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
        lockstep.hold(rail)
    right, wrong = told
    assert np.subtract(wrong["position"], right["position"]) == pytest.approx([1.0, 2.0, -3.0], abs=1e-3)
    assert np.subtract(wrong["velocity"], right["velocity"]) == pytest.approx([0.1, 0.2, -0.3], abs=1e-3)
    lockstep.step()
    assert told[-1]["position"] == pytest.approx([1.0, 2.0 + 24.7 / 120.0, -103.0], abs=0.02)
    assert told[-1]["velocity"] == pytest.approx([0.1, math.sqrt(609.0) + 0.2, -0.3], abs=0.02)


def test_a_look_is_taken_every_tenth_of_a_second(exchange: Exchange) -> None:
    for _ in range(3 * LOOK_FRAMES):
        exchange.lockstep.serve()
    assert exchange.looks == 3
    assert exchange.lockstep.time == pytest.approx(0.3)
