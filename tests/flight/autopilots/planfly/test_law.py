"""The guidance core in one tick: signs of the commands, limits, and the end of the path."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aircraft.catalog import Aircraft
from flight.autopilots.planfly.law import guide
from flight.dynamics.state import COMMANDS, STATE
from flight.guidance.gains import Gains, load_gains
from flight.guidance.inner_loops import GUIDANCE_MEMORY
from flight.guidance.navigation_error import MOTION
from flight.guidance.path import fly_by_path, waypoint_records
from flight.simulation.setup import FlightSetup
from tests.setups import MakeSetup
from world.kernels import Record


class Tick:
    """One call of the core on a straight level path to the north at 500 m."""

    def __init__(self, setup: FlightSetup, gains: Gains) -> None:
        self.path = fly_by_path(setup.route, setup.limits)
        # Laid out as the compiled tick has them, so that its compiled form serves here, too.
        way = self.path.pieces, self.path.nodes, waypoint_records(setup.route)
        self.way = [np.repeat(records, 2)[::2] for records in way]
        self.gains = gains.record()
        self.memory: Record = np.zeros(1, GUIDANCE_MEMORY)[0]
        self.memory.last_airspeed, self.memory.max_bank = -1.0, math.radians(33.0)
        self.memory.trim_throttle, self.memory.trim_elevator = 0.5, -0.1

    def __call__(
        self, east: float = 0.0, up: float = 500.0, north: float = 1000.0, course: float = 0.0, **state: float
    ) -> Record:
        values: Record = np.zeros(1, STATE)[0]
        values.airspeed, values.load_factor = 25.0, 1.0
        for name, value in state.items():
            setattr(values, name, value)
        estimated: Record = np.zeros(1, MOTION)[0]
        estimated.east, estimated.north, estimated.up = east, north, up
        estimated.velocity_east, estimated.velocity_north = 25.0 * math.sin(course), 25.0 * math.cos(course)
        commands: Record = np.zeros(1, COMMANDS)[0]
        guide(
            values,
            estimated,
            *self.way,
            self.gains,
            self.memory,
            commands,
            1 / 60,
        )
        return commands


@pytest.fixture
def tick(make_setup: MakeSetup, aerosonde: Aircraft) -> Tick:
    return Tick(make_setup([[0, 0, 500], [0, 3000, 500], [3000, 3000, 500]]), load_gains(aerosonde))


def test_on_the_path_nothing_is_asked(tick: Tick) -> None:
    commands = tick()
    assert [commands.aileron, commands.rudder] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert commands.elevator == pytest.approx(-0.1, abs=1e-12)
    assert commands.throttle == pytest.approx(0.5)
    memory = tick.memory
    assert [memory.leg, memory.cross_track, memory.height_error, memory.is_finished] == [0, 0.0, 0.0, False]
    assert tick.memory.distance == 1000.0


def test_which_way_the_controls_move(tick: Tick) -> None:
    # A positive aileron command rolls to the right, a positive elevator command pitches down.
    right, left = tick(east=30.0), tick(east=-30.0)
    assert right.aileron < 0.0 < left.aileron
    assert tick(course=0.2).aileron < 0.0 < tick(course=-0.2).aileron
    assert tick(up=505.0).elevator > tick().elevator > tick(up=495.0).elevator
    assert tick(airspeed=22.0).throttle > tick().throttle > tick(airspeed=28.0).throttle
    assert tick(pitch_rate=0.3).elevator > tick().elevator  # damping
    assert tick(roll_rate=0.3).aileron < 0.0


@given(
    st.floats(-3000.0, 3000.0),
    st.floats(100.0, 900.0),
    st.floats(-3.2, 3.2),
    st.floats(5.0, 60.0),
    st.floats(-1.3, 1.3),
)
def test_commands_stay_sane_from_anywhere(
    make_setup: MakeSetup, aerosonde: Aircraft, east: float, up: float, course: float, speed: float, roll: float
) -> None:
    one = Tick(make_setup([[0, 0, 500], [0, 3000, 500], [3000, 3000, 500]]), load_gains(aerosonde))
    for _ in range(3):
        commands = one(east=east, up=up, course=course, airspeed=speed, roll=roll)
    assert np.isfinite(commands.tolist()).all()
    assert 0.0 <= commands.throttle <= 1.0
    assert np.isfinite(one.memory.tolist()).all()


def test_far_away_it_flies_towards_the_path_not_at_a_right_angle(tick: Tick) -> None:
    # 1 km to the right and on course to the left at the steepest intercept, no bank is asked for.
    angle = tick.gains.intercept
    assert abs(tick(east=1000.0, course=-angle, yaw=-angle).aileron) < 0.02
    assert tick(east=1000.0, course=0.0).aileron < -0.05


def test_end_of_the_path(tick: Tick) -> None:
    tick(north=2999.0)
    assert tick.memory.leg in (0, 1)
    tick(east=1500.0, north=3000.0, course=math.pi / 2)
    assert [tick.memory.leg, tick.memory.is_finished] == [1, False]
    tick(east=3000.1, north=3000.0, course=math.pi / 2)
    assert [tick.memory.leg, tick.memory.is_finished] == [1, True]


# ----------------------------------------------------------------------
# How far the nose may be turned from the course.

SIDES = pytest.mark.parametrize("side", [1.0, -1.0])


class Nose:
    """The bank and the sideslip, deg, that one tick asks for with the nose so many degrees to the right of the course.

    The roll model has no limits here, so that a tick takes it from rest by frequency^2 x bank x dt^2.
    """

    def __init__(self, setup: FlightSetup, gains: Gains) -> None:
        self.setup = setup
        self.gains = replace(gains, roll_rate_max=1e6, roll_acceleration_max=1e6)

    def __call__(self, nose: float, east: float, course: float) -> tuple[float, float]:
        one = Tick(self.setup, self.gains)
        one(east=east, course=math.radians(course), yaw=math.radians(nose))
        bank = one.memory.bank / (self.gains.roll_frequency / 60.0) ** 2
        return math.degrees(bank), math.degrees(one.memory.sideslip)


@pytest.fixture
def asked(make_setup: MakeSetup, aerosonde: Aircraft) -> Nose:
    return Nose(make_setup([[0, 0, 500], [0, 3000, 500], [3000, 3000, 500]]), load_gains(aerosonde))


@SIDES
@pytest.mark.parametrize(
    ("nose", "bank"),
    [
        # All of the 33 degrees against the wind until the nose is 33 / 4 = 8.25 degrees short of 80...
        (60.0, 33.0),
        (71.0, 33.0),
        # ... then 4 degrees of bank for each degree, and as much back beyond it...
        (75.0, 20.0),
        (80.0, 0.0),
        (85.0, -20.0),
        # ... as far as 33 degrees, and the same where the nose is almost straight back.
        (89.0, -33.0),
        (169.0, -33.0),
        (175.0, -33.0),
    ],
)
def test_the_nose_is_not_turned_past_the_wind(asked: Nose, side: float, nose: float, bank: float) -> None:
    """Blown aside and back, 20 m from the path, it points into the wind and waits, and does not go round."""
    assert asked(-side * nose, side * 20.0, side * 100.0)[0] == pytest.approx(-side * bank, abs=1e-9)


@SIDES
@pytest.mark.parametrize("nose", [75.0, 82.0, 88.0, 95.0])
def test_a_nose_that_is_turned_back_is_turned_back_with_all_the_bank(asked: Nose, side: float, nose: float) -> None:
    # The path is to the left, and the nose is too far to the right.
    assert asked(side * nose, side * 20.0, side * 100.0)[0] == pytest.approx(-side * 33.0)


@SIDES
def test_bank_and_skid_change_smoothly_as_the_nose_turns_away(asked: Nose, side: float) -> None:
    step = 0.1
    way = np.array([asked(-side * nose, side * 20.0, side * 100.0) for nose in np.arange(40.0, 179.0, step)])
    # From all the bank and the whole skid of 3 degrees to one side to all the bank to the other, without a skid.
    assert way[0] == pytest.approx([-side * 33.0, side * 3.0])
    assert way[-1] == pytest.approx([side * 33.0, 0.0])
    bank, skid = np.abs(np.diff(way, axis=0)).max(axis=0)
    assert bank == pytest.approx(4.0 * step)
    # The skid is worth 17.87 m/s^2 a rad. Where it is less than whole, the tangent of the wanted bank is at most tan 33
    # + 3 degrees x 17.87 / 9.81 = 0.745, and its square plus 1 is 1.555: 9.81 / 17.87 x 1.555 x 0.4 degrees = 0.3415.
    assert skid < 0.342
