"""The workspace's views are its record's own memory, and its parts are what it was given."""

import math
from typing import Any

import numpy as np
import pytest

from flight.autopilots.planfly.law import planfly_tick
from flight.guidance.inner_loops import GUIDANCE_MEMORY
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.guidance.navigation_error import MOTION
from flight.guidance.path import NODE, PIECE, FlyByPath
from flight.simulation.tick import (
    BLOCK_TICKS,
    COMPLETED,
    END_BATTERY_EMPTY,
    END_MISSED_ROUTE,
    END_OVERBANK,
    END_TIPPED_OVER,
    ENDS,
    GROUND,
    MISSED_ROUTE_DISTANCE_M,
    NO_MOTOR,
    NOT_A_NUMBER,
    OUTPUT,
    READ_FIELDS,
    STALLED,
    Workspace,
    update_end_loiter,
    update_rtl_loiter,
)
from flight.simulation.track import AILERON, ELEVATOR, RUDDER, THROTTLE
from tests.flight.simulation.hand_made import (
    GAINS,
    HEIGHT,
    LENGTH,
    RADIUS,
    level_ground,
    linear_map,
    make_workspace,
    north_at,
)
from tests.flight.simulation.hand_made import (
    GROUND as GROUND_AMSL,
)
from world.frames import polymap
from world.kernels import Record, field_names


@pytest.fixture
def space() -> Workspace:
    return make_workspace()


def test_readings_are_the_state_by_name(space: Workspace) -> None:
    assert len(READ_FIELDS) == 22
    assert not {"time", "wind_north", "wind_east", "wind_down"} & set(READ_FIELDS)
    space.readings[:] = np.arange(22)
    assert [space.record.state[name] for name in READ_FIELDS] == list(range(22))
    space.record.state.airspeed = -5.0
    assert space.readings[READ_FIELDS.index("airspeed")] == -5.0


def test_output_is_what_is_set_by_name(space: Workspace) -> None:
    names = field_names(OUTPUT)
    wanted = ("elevator", "aileron", "rudder", "throttle", "gust_north", "gust_east", "gust_down", "ground")
    assert names == wanted
    for k, name in enumerate(names):
        space.record.output[name] = 3.0 + k
    assert space.output.tolist() == [3.0 + k for k in range(len(names))]


def test_counters_noise_and_rows_share_memory_with_the_record(space: Workspace) -> None:
    for view in (
        space.readings,
        space.output,
        space.ticks_flown,
        space.rows_filled,
        space.turbulence,
        space.navigation,
    ):
        assert np.shares_memory(view, space.array)
    assert np.shares_memory(space.rows, space.array)
    space.record.timing.tick, space.record.timing.row = 7, 3
    assert (space.ticks_flown.tolist(), space.rows_filled.tolist()) == ([7], [3])
    space.ticks_flown[0] = 8
    assert space.record.timing.tick == 8
    space.turbulence[2], space.navigation[2] = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
    drawn = space.record.noise[2]
    assert (drawn.turbulence.tolist(), drawn.navigation.tolist()) == ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0])
    space.record.rows[5].airspeed = 26.0
    assert space.rows["airspeed"][5] == 26.0
    assert len(space.rows) == len(space.turbulence) == len(space.navigation) == BLOCK_TICKS


def test_views_of_one_field_do_not_reach_into_another(space: Workspace) -> None:
    space.readings[:] = 9.0
    assert all(space.record.state[name] == 0.0 for name in ("time", "wind_north", "wind_east", "wind_down"))
    space.output[:] = 9.0
    assert all(value == 1.0 for value in space.record.scale_positive.tolist())


def test_gains_are_the_aircrafts(space: Workspace) -> None:
    assert space.record.gains.reference_airspeed == 25.0
    assert space.record.gains.roll_frequency == GAINS.roll_frequency == 5.0


def test_the_path_table_holds_each_part_and_how_many_there_are() -> None:
    pieces, nodes, waypoints = np.zeros(2, PIECE), np.zeros(3, NODE), np.zeros(4, WAYPOINT)
    pieces["length"], nodes["altitude"], waypoints["airspeed"] = (1, 2), (3, 4, 5), (6, 7, 8, 9)
    space = Workspace(GAINS, FlyByPath(pieces, nodes, 3.0), waypoints)
    settings = space.record.settings
    assert (settings.pieces, settings.nodes, settings.waypoints) == (2, 3, 4)
    assert len(space.path) == 4
    assert space.path["piece"]["length"].tolist() == [1.0, 2.0, 0.0, 0.0]
    assert space.path["node"]["altitude"].tolist() == [3.0, 4.0, 5.0, 0.0]
    assert space.path["waypoint"]["airspeed"].tolist() == [6.0, 7.0, 8.0, 9.0]


def test_copies_of_maps_answer_as_the_maps(space: Workspace) -> None:
    curved = linear_map((5.0, 2.0, -3.0), (-1.0, 0.5, 4.0), 10.0)
    for name in ("position_map", "north_map", "pixel_map"):
        setattr(space.record, name, curved.record)
        for x, y in ((0.0, 0.0), (3.0, -7.0), (-10.0, 10.0)):
            got = polymap(getattr(space.record, name), x, y)
            assert got == polymap(curved.record, x, y)
            assert got == pytest.approx((5.0 + 2.0 * x - 3.0 * y, -1.0 + 0.5 * x + 4.0 * y))


# ----------------------------------------------------------------------
# One tick with hand-set readings: each way that a flight ends, and what the tick leaves for JSBSim and the track.

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
    return planfly_tick(space.block, level_ground())


def ticked(readings: dict[str, float] | None = None, **settings: Any) -> Workspace:
    """The workspace after one tick.  settings: of its record, by name."""
    space = make_workspace()
    for name, value in settings.items():
        setattr(space.record, name, value)
    read(space, **(readings or {}))
    assert planfly_tick(space.block, level_ground()) == 0
    return space


def test_steady_flight_goes_on() -> None:
    assert status_of() == 0
    assert 0 not in ENDS


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", READ_FIELDS)
def test_a_reading_that_is_no_number_ends_the_flight(name: str, value: float) -> None:
    space = make_workspace()
    read(space, **{name: value})
    assert planfly_tick(space.block, level_ground()) == NOT_A_NUMBER
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
        ({"roll": math.radians(75.01)}, END_OVERBANK),
        ({"roll": -math.radians(74.99)}, 0),
        ({"roll": -math.radians(75.01)}, END_OVERBANK),
        ({"airspeed": 14.0}, 0),
        ({"airspeed": 13.999}, STALLED),
        ({"north": LENGTH - 0.01}, 0),
        ({"north": LENGTH + 0.01}, COMPLETED),
        ({"north": LENGTH + 0.01, "east": 99.9}, COMPLETED),
        ({"north": LENGTH + 0.01, "east": 100.1}, END_MISSED_ROUTE),
        ({"north": LENGTH + 0.01, "east": -99.9}, COMPLETED),
        ({"north": LENGTH + 0.01, "east": -100.1}, END_MISSED_ROUTE),
        ({"north": LENGTH + 0.01, "up": HEIGHT + 99.9}, COMPLETED),
        ({"north": LENGTH + 0.01, "up": HEIGHT + 100.1}, END_MISSED_ROUTE),
        ({"north": LENGTH + 0.01, "up": HEIGHT - 99.9}, COMPLETED),
        ({"north": LENGTH + 0.01, "up": HEIGHT - 100.1}, END_MISSED_ROUTE),
        # Far from a path whose end is ahead, a flight goes on.
        ({"east": 300.0, "up": HEIGHT + 300.0}, 0),
    ],
)
def test_a_flight_ends_just_beyond_each_limit_and_not_just_within(readings: dict[str, float], status: int) -> None:
    assert status_of(**readings) == status


def test_the_last_row_shows_how_the_flight_ended() -> None:
    space = make_workspace()
    read(space, up=GROUND_AMSL - 3.0)
    assert planfly_tick(space.block, level_ground()) == GROUND
    assert int(space.rows_filled[0]) == 1
    assert space.rows[0].clearance == pytest.approx(-3.0)


def ended(memory: Record, away: float, up: float, ticks: int = 1, turning: float = 10.0, **target: float) -> bool:
    """Whether a return is over after some seconds in a circle about the origin, which is its target, 400 m up.

    away: m from it.  turning: degrees a second.
    """
    motion, b = np.zeros(1, MOTION)[0], np.zeros(1, WAYPOINT)[0]
    motion.up, b.up = up, 400.0
    for name, value in target.items():
        setattr(b, name, value)
    for k in range(ticks):
        motion.east = away * math.sin(math.radians(turning * k))
        motion.north = away * math.cos(math.radians(turning * k))
        update_rtl_loiter(motion, b, memory, 1.0)
    return bool(memory.is_finished)


def fresh() -> Record:
    """The memory at the begin of a flight."""
    memory: Record = np.zeros(1, GUIDANCE_MEMORY)[0]
    return memory


def test_a_return_ends_a_minute_after_it_came_to_its_circle_and_height() -> None:
    assert not ended(fresh(), 299.0, 400.0, 60)
    assert ended(fresh(), 299.0, 400.0, 61)
    # Too far away, too high, too low: it has not begun.  1.3 radii of a wide circle are near enough.
    for away, up in ((301.0, 400.0), (0.0, 420.5), (0.0, 379.5)):
        assert not ended(fresh(), away, up, 400)
    assert ended(fresh(), 519.0, 400.0, 61, loiter_radius=-400.0)


def test_a_mission_that_ends_in_a_circle_ends_once_its_course_has_turned_once_and_a_quarter() -> None:
    for turning in (10.1, -10.1):
        motion, memory = np.zeros(1, MOTION)[0], fresh()
        for second in range(46):
            assert not memory.is_finished, second
            motion.velocity_east = 25.0 * math.sin(math.radians(170.0 + turning * second))
            motion.velocity_north = 25.0 * math.cos(math.radians(170.0 + turning * second))
            update_end_loiter(motion, memory, 1.0)
        # 450 degrees at 10.1 a second, from the second in which it came there.
        assert memory.is_finished
        assert memory.is_in_rtl


def test_a_return_ends_no_sooner_than_it_was_all_around_its_circle() -> None:
    # 2 degrees a second: once around after 180 s, the first of which is the one in which it comes there.
    assert not ended(fresh(), 500.0, 400.0, 180, 2.0, loiter_radius=500.0)
    assert ended(fresh(), 500.0, 400.0, 182, 2.0, loiter_radius=500.0)
    assert ended(fresh(), 500.0, 400.0, 182, -2.0, loiter_radius=-500.0)
    assert not ended(fresh(), 1500.0, 400.0, 450, 0.8, loiter_radius=1500.0)
    assert ended(fresh(), 1500.0, 400.0, 452, 0.8, loiter_radius=1500.0)
    # It never gets around: given up after five times 2 pi 500 m at 10 m/s, 1,571 s; 400 m up it is 4 % wider.
    assert not ended(fresh(), 500.0, 400.0, 1571, 0.0, loiter_radius=500.0)
    assert ended(fresh(), 500.0, 400.0, 1660, 0.0, loiter_radius=500.0)


def test_a_return_has_no_cross_track_error_because_it_follows_no_line() -> None:
    memory = fresh()
    memory.cross_track = 155.0
    ended(memory, 5000.0, 400.0, 1)
    assert math.isnan(memory.cross_track)
    assert memory.is_in_rtl


def test_a_return_does_not_miss_the_end_of_a_path_that_it_need_not_follow() -> None:
    for returning, status in ((False, END_MISSED_ROUTE), (True, COMPLETED)):
        space = make_workspace()
        space.record.memory.is_in_rtl = returning
        read(space, north=LENGTH + 0.01, east=300.0, up=HEIGHT + 300.0)
        assert planfly_tick(space.block, level_ground()) == status


def test_each_end_is_told_apart_by_people() -> None:
    assert set(ENDS) == {
        COMPLETED,
        NOT_A_NUMBER,
        GROUND,
        END_OVERBANK,
        STALLED,
        END_MISSED_ROUTE,
        END_BATTERY_EMPTY,
        NO_MOTOR,
        END_TIPPED_OVER,
    }
    assert len(set(ENDS.values())) == 9
    assert "75 degrees" in ENDS[END_OVERBANK]
    assert f"{MISSED_ROUTE_DISTANCE_M:.0f} m" in ENDS[END_MISSED_ROUTE]


def test_unknown_ground_ends_nothing_and_the_last_known_one_stays() -> None:
    space = make_workspace()
    read(space, up=50.0)
    nowhere = level_ground(math.nan)
    assert planfly_tick(space.block, nowhere) == 0
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
        assert planfly_tick(space.block, level_ground()) == 0
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
        statuses.append(planfly_tick(space.block, level_ground()))
    assert statuses == [0, 0, END_BATTERY_EMPTY]


def test_readings_come_to_si_by_their_factors() -> None:
    space = make_workspace()
    space.record.state_factors.airspeed, space.record.state_factors.roll = 0.3048, 2.0
    read(space, airspeed=100.0, roll=0.1)
    assert planfly_tick(space.block, level_ground()) == 0
    assert space.rows[0].airspeed == pytest.approx(30.48)
    assert space.rows[0].attitude[0] == pytest.approx(0.2)


@pytest.mark.parametrize("name", field_names(OUTPUT))
def test_outputs_are_scaled_each_by_its_own_factor_above_and_below_zero(name: str) -> None:
    def outputs(*, above: float, below: float) -> dict[str, float]:
        space = make_workspace()
        space.record.wind.speed, space.record.wind.cos, space.record.wind.sin = 5.0, -0.6, 0.8
        space.record.air.gust_down, space.record.memory.trim_throttle = -0.5, 0.6
        space.record.scale_positive[name], space.record.scale_negative[name] = above, below
        read(space, roll=0.2, up=HEIGHT + 3.0, pitch_rate=0.1)
        planfly_tick(space.block, level_ground())
        return {key: float(space.record.output[key]) for key in field_names(OUTPUT)}

    plain, scaled = outputs(above=1.0, below=1.0), outputs(above=3.0, below=7.0)
    factor = 3.0 if plain[name] > 0.0 else 7.0
    assert plain[name] != 0.0
    assert scaled == plain | {name: factor * plain[name]}


def test_the_wind_blows_where_it_goes_and_the_next_row_shows_it() -> None:
    space = make_workspace()
    # 5 m/s at 400 m and 0.02 m/s more a metre: 7 m/s at 500 m, to the map course with cosine 0.6 and sine 0.8.
    space.record.wind = (5.0, 0.6, 0.8, 0.02, 400.0, 0.0, 0.0)
    for _ in range(2):
        read(space)
        assert planfly_tick(space.block, level_ground()) == 0
    output = space.record.output
    assert (output.gust_north, output.gust_east, output.gust_down) == pytest.approx((4.2, 5.6, 0.0))
    assert space.rows[1].wind.tolist() == pytest.approx([5.6, 4.2, 0.0])


def test_where_true_north_is_the_maps_east_all_is_turned() -> None:
    space = make_workspace()
    space.record.north_map = north_at(math.pi / 2).record
    space.record.wind = (7.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for _ in range(2):
        read(space, velocity_east=3.0, yaw=0.1)
        assert planfly_tick(space.block, level_ground()) == 0
    row = space.rows[1]
    # True north 25 and east 3 are the map's east and south; a true heading of 0.1 is a map course of 90 degrees more.
    assert row.velocity.tolist() == pytest.approx([25.0, -3.0, 0.0])
    assert row.attitude[2] == pytest.approx(0.1 + math.pi / 2)
    # Wind to the map's north blows to the true west.
    assert (space.record.output.gust_north, space.record.output.gust_east) == pytest.approx((0.0, -7.0), abs=1e-12)
    assert row.wind.tolist() == pytest.approx([0.0, 7.0, 0.0], abs=1e-12)


def test_a_flight_goes_on_across_the_180th_meridian() -> None:
    space = make_workspace()
    space.record.settings.center_longitude = math.pi
    read(space, longitude=-math.pi + 1e-4)
    planfly_tick(space.block, level_ground(math.nan))
    assert space.rows[0].position[0] == pytest.approx(RADIUS * (math.pi + 1e-4))
