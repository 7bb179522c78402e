"""One tick with hand-set readings: each way that a flight ends, and what the tick leaves for JSBSim and the track."""

import math
from typing import Any

import numpy as np
import pytest

from flight.simulation.tick import BANKED, COMPLETED, EMPTY, ENDS, FAR, GROUND, MISSED, NOT_A_NUMBER, STALLED, tick
from flight.simulation.track import AILERON, ELEVATOR, RUDDER, THROTTLE
from flight.simulation.workspace import OUTPUT, READ_FIELDS, Workspace
from tests.flight.simulation.hand_made import (
    GROUND as GROUND_AMSL,
)
from tests.flight.simulation.hand_made import (
    HEIGHT,
    LENGTH,
    RADIUS,
    level_ground,
    make_workspace,
    north_at,
)
from world.kernels import field_names

DT = 1.0 / 60.0


def read(space: Workspace, east: float = 0.0, north: float = 1000.0, up: float = HEIGHT, **changes: float) -> None:
    """Fill the readings with steady flight to the north at this position, but for the changes."""
    values = dict.fromkeys(READ_FIELDS, 0.0) | {
        "latitude": north / RADIUS,
        "longitude": east / RADIUS,
        "amsl": up,
        "velocity_north": 25.0,
        "airspeed": 25.0,
        "load_factor": 1.0,
    }
    space.readings[:] = list((values | changes).values())


def status_of(**readings: float) -> int:
    space = make_workspace()
    read(space, **readings)
    return tick(space.array, space.path, level_ground())


def ticked(readings: dict[str, float] | None = None, **settings: Any) -> Workspace:
    """The workspace after one tick.  settings: of its record, by name."""
    space = make_workspace()
    for name, value in settings.items():
        setattr(space.record, name, value)
    read(space, **(readings or {}))
    assert tick(space.array, space.path, level_ground()) == 0
    return space


def test_steady_flight_goes_on() -> None:
    assert status_of() == 0
    assert 0 not in ENDS


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", READ_FIELDS)
def test_a_reading_that_is_no_number_ends_the_flight(name: str, value: float) -> None:
    space = make_workspace()
    read(space, **{name: value})
    assert tick(space.array, space.path, level_ground()) == NOT_A_NUMBER
    # Nothing of it gets into the track, what is flown with, or guidance's memory.
    assert (int(space.rows_filled[0]), int(space.ticks_flown[0])) == (0, 0)
    assert np.isfinite(space.output).all()
    assert np.isfinite(space.record.memory.tolist()).all()


@pytest.mark.parametrize(
    ("readings", "status"),
    [
        ({"up": GROUND_AMSL + 0.01}, 0),
        ({"up": GROUND_AMSL}, GROUND),
        ({"up": GROUND_AMSL - 0.01}, GROUND),
        ({"roll": math.radians(74.99)}, 0),
        ({"roll": math.radians(75.01)}, BANKED),
        ({"roll": -math.radians(74.99)}, 0),
        ({"roll": -math.radians(75.01)}, BANKED),
        ({"airspeed": 14.0}, 0),
        ({"airspeed": 13.999}, STALLED),
        ({"north": LENGTH - 0.01}, 0),
        ({"north": LENGTH + 0.01}, COMPLETED),
        ({"north": LENGTH + 0.01, "east": 99.9}, COMPLETED),
        ({"north": LENGTH + 0.01, "east": 100.1}, MISSED),
        ({"north": LENGTH + 0.01, "east": -99.9}, COMPLETED),
        ({"north": LENGTH + 0.01, "east": -100.1}, MISSED),
        ({"north": LENGTH + 0.01, "up": HEIGHT + 99.9}, COMPLETED),
        ({"north": LENGTH + 0.01, "up": HEIGHT + 100.1}, MISSED),
        ({"north": LENGTH + 0.01, "up": HEIGHT - 99.9}, COMPLETED),
        ({"north": LENGTH + 0.01, "up": HEIGHT - 100.1}, MISSED),
        # Far from a path whose end is ahead, a flight goes on.
        ({"east": 300.0, "up": HEIGHT + 300.0}, 0),
    ],
)
def test_a_flight_ends_just_beyond_each_limit_and_not_just_within(readings: dict[str, float], status: int) -> None:
    assert status_of(**readings) == status


def test_the_last_row_shows_how_the_flight_ended() -> None:
    space = make_workspace()
    read(space, up=GROUND_AMSL - 3.0)
    assert tick(space.array, space.path, level_ground()) == GROUND
    assert int(space.rows_filled[0]) == 1
    assert space.rows[0].clearance == pytest.approx(-3.0)


def test_each_end_is_told_apart_by_people() -> None:
    assert set(ENDS) == {COMPLETED, NOT_A_NUMBER, GROUND, BANKED, STALLED, MISSED, EMPTY}
    assert len(set(ENDS.values())) == 7
    assert "75 degrees" in ENDS[BANKED]
    assert f"{FAR:.0f} m" in ENDS[MISSED]


def test_unknown_ground_ends_nothing_and_the_last_known_one_stays() -> None:
    space = make_workspace()
    read(space, up=50.0)
    nowhere = level_ground(math.nan)
    assert tick(space.array, space.path, nowhere) == 0
    assert math.isnan(space.rows[0].clearance)
    assert space.record.output.ground == GROUND_AMSL


def test_a_row_holds_the_readings_under_their_names() -> None:
    numbers = {name: 0.01 * (k + 1) for k, name in enumerate(READ_FIELDS) if k > 5}
    space = ticked({"east": 30.0, "velocity_east": 3.0, "velocity_down": -2.0} | numbers | {"airspeed": 26.0})
    row = space.rows[0]
    assert row.position.tolist() == pytest.approx([30.0, 1000.0, HEIGHT])
    assert row.velocity.tolist() == pytest.approx([3.0, 25.0, 2.0])
    for k, names in {
        "attitude": ("roll", "pitch", "yaw"),
        "rates": ("roll_rate", "pitch_rate", "yaw_rate"),
        "flow": ("alpha", "beta"),
    }.items():
        assert getattr(row, k).tolist() == pytest.approx([numbers[name] for name in names])
    for column, name in ((ELEVATOR, "elevator"), (AILERON, "aileron"), (RUDDER, "rudder"), (THROTTLE, "throttle")):
        assert row.controls[column] == pytest.approx(numbers[name])
        assert row.commands[column] == space.record.commands[name]
    assert (row.airspeed, row.load_factor, row.current) == (26.0, numbers["load_factor"], numbers["current"])
    assert (row.leg, row.cross_track, row.height_error, row.speed_command) == pytest.approx((0, 30.0, 0.0, 25.0))
    assert row.clearance == pytest.approx(HEIGHT - GROUND_AMSL)


def test_time_and_energy_add_up_tick_by_tick() -> None:
    space = make_workspace()
    for k in range(3):
        read(space, north=1000.0 + k, power=720.0)
        assert tick(space.array, space.path, level_ground()) == 0
    assert space.rows["time"][:3] == pytest.approx([0.0, DT, 2.0 * DT])
    # 720 W are 0.2 Wh a second.
    assert space.rows["energy"][:3] == pytest.approx([0.2 * DT, 0.4 * DT, 0.6 * DT])
    assert (int(space.ticks_flown[0]), int(space.rows_filled[0])) == (3, 3)


def test_a_flight_ends_when_all_that_it_carries_is_used() -> None:
    # 720 W are 0.2 Wh a second: of this battery three ticks use all, and two do not.
    space = make_workspace()
    space.record.settings.battery = 0.2 * 2.5 * DT
    statuses = []
    for k in range(3):
        read(space, north=1000.0 + k, power=720.0)
        statuses.append(tick(space.array, space.path, level_ground()))
    assert statuses == [0, 0, EMPTY]


def test_readings_come_to_si_by_their_factors() -> None:
    space = make_workspace()
    space.record.state_factors.airspeed, space.record.state_factors.roll = 0.3048, 2.0
    read(space, airspeed=100.0, roll=0.1)
    assert tick(space.array, space.path, level_ground()) == 0
    assert space.rows[0].airspeed == pytest.approx(30.48)
    assert space.rows[0].attitude[0] == pytest.approx(0.2)


@pytest.mark.parametrize("name", field_names(OUTPUT))
def test_outputs_are_scaled_each_by_its_own_factor_above_and_below_zero(name: str) -> None:
    def outputs(*, above: float, below: float) -> dict[str, float]:
        space = make_workspace()
        space.record.wind.speed, space.record.wind.cos, space.record.wind.sin = 5.0, -0.6, 0.8
        space.record.air.gust_down, space.record.memory.trim_throttle = -0.5, 0.6
        space.record.scale_above[name], space.record.scale_below[name] = above, below
        read(space, roll=0.2, up=HEIGHT + 3.0, pitch_rate=0.1)
        tick(space.array, space.path, level_ground())
        return {key: float(space.record.output[key]) for key in field_names(OUTPUT)}

    plain, scaled = outputs(above=1.0, below=1.0), outputs(above=3.0, below=7.0)
    factor = 3.0 if plain[name] > 0.0 else 7.0
    assert plain[name] != 0.0
    assert scaled == plain | {name: factor * plain[name]}


def test_the_wind_blows_where_it_goes_and_the_next_row_shows_it() -> None:
    space = make_workspace()
    # 5 m/s at 400 m and 0.02 m/s more a metre: 7 m/s at 500 m, to the map course with cosine 0.6 and sine 0.8.
    space.record.wind = (5.0, 0.6, 0.8, 0.02, 400.0, 0.0)
    for _ in range(2):
        read(space)
        assert tick(space.array, space.path, level_ground()) == 0
    output = space.record.output
    assert (output.gust_north, output.gust_east, output.gust_down) == pytest.approx((4.2, 5.6, 0.0))
    assert space.rows[1].wind.tolist() == pytest.approx([5.6, 4.2, 0.0])


def test_where_true_north_is_the_maps_east_all_is_turned() -> None:
    space = make_workspace()
    space.record.north_map = north_at(math.pi / 2).record
    space.record.wind = (7.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    for _ in range(2):
        read(space, velocity_east=3.0, yaw=0.1)
        assert tick(space.array, space.path, level_ground()) == 0
    row = space.rows[1]
    # True north 25 and east 3 are the map's east and south; a true heading of 0.1 is a map course of 90 degrees more.
    assert row.velocity.tolist() == pytest.approx([25.0, -3.0, 0.0])
    assert row.attitude[2] == pytest.approx(0.1 + math.pi / 2)
    # Wind to the map's north blows to the true west.
    assert (space.record.output.gust_north, space.record.output.gust_east) == pytest.approx((0.0, -7.0), abs=1e-12)
    assert row.wind.tolist() == pytest.approx([0.0, 7.0, 0.0], abs=1e-12)


def test_a_flight_goes_on_across_the_180th_meridian() -> None:
    space = make_workspace()
    space.record.settings.middle = math.pi
    read(space, longitude=-math.pi + 1e-4)
    tick(space.array, space.path, level_ground(math.nan))
    assert space.rows[0].position[0] == pytest.approx(RADIUS * (math.pi + 1e-4))
