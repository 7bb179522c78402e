"""ArduPlane's legs above ground, by the arithmetic of `Plane::lookahead_adjustment` and `AP_Terrain::lookahead`."""

import math

import numpy as np
import pytest

from flight.autopilots.arduplane.law import update_height_demand, update_terrain_lookahead
from flight.simulation.tick import WORKSPACE
from tests.flight.autopilots.arduplane.laws import flying, memory, parameters, record, waypoints
from world.frames import fit_polymap
from world.kernels import Record

DT = 0.1


def asked(own: Record, north: float, up: float, above: float = 100.0, **values: float) -> float:
    """Return the altitude that a leg of 1,000 m to a height above ground asks for, m AMSL."""
    (b,) = waypoints((0, 1000, 0), follows_terrain=True, above_ground=above)
    update_height_demand(flying(0.0, north, up), b, parameters(**values), own, DT)
    return float(own.altitude_demand_in)


def begun(from_above: float, offset: float = 0.0) -> Record:
    """Return the memory of a leg that began at a height above ground (m), over ground of 400 m."""
    return memory(terrain_altitude=400.0, terrain_leg=1, from_height_above_terrain=from_above, altitude_offset=offset)


def test_the_height_above_ground_is_held_wherever_the_ground_is() -> None:
    own = begun(100.0)
    assert asked(own, 100.0, 500.0) == 500.0
    own.terrain_altitude = 437.0
    assert asked(own, 500.0, 500.0) == 537.0
    own.lookahead_rise = 12.5
    assert asked(own, 600.0, 500.0) == 549.5


@pytest.mark.parametrize(
    ("from_above", "north", "expected"),
    # Half of the way from 90 to 100 m, a quarter of the way from 60 to 100 m; before and past the leg its ends'.
    [(90.0, 500.0, 495.0), (60.0, 250.0, 470.0), (60.0, -50.0, 460.0), (60.0, 1001.0, 500.0)],
)
def test_the_height_above_ground_changes_evenly_however_little_it_changes(
    from_above: float, north: float, expected: float
) -> None:
    """`Plane::set_target_altitude_proportion_terrain` reads no ALT_SLOPE_MIN, no CLIMB_SLOPE_HGT and no threshold."""
    assert asked(begun(from_above), north, 700.0) == pytest.approx(expected)


def test_a_descent_leaves_out_what_it_descends_of_the_rise_ahead() -> None:
    own = begun(100.0, -40.0)
    own.lookahead_rise = 50.0
    # Halfway down from 100 to 60 m above ground, and 50 - 40 m of the rise.
    assert asked(own, 500.0, 480.0, 60.0) == pytest.approx(400.0 + 80.0 + 10.0)
    own.lookahead_rise = 39.0
    assert asked(own, 500.0, 480.0, 60.0) == pytest.approx(480.0)


def test_before_the_ground_at_its_begin_is_known_a_leg_keeps_the_demand() -> None:
    own = memory(terrain_altitude=400.0, altitude_demand_in=512.0)
    assert asked(own, 0.0, 500.0) == 512.0


def looked(heights: np.ndarray, above: float = 100.0, **values: float) -> Record:
    """Look ahead from the middle of the south end of a raster of 10 m pixels along a leg of 1,000 m north."""
    own = memory(time_to_update=0.0, is_initialised=True)
    work = record(WORKSPACE)
    work.estimated = flying(0.0, 0.0, 500.0)
    work.place.ground = float(heights[0, 1])
    work.timing.dt = 1.0 / 60.0
    span = [[-2000.0, 2000.0], [-2000.0, 2000.0]]
    to_pixel = fit_polymap(lambda east, north: (1.0 + east / 1000.0, north / 10.0), span, 1e-6)
    work.pixel_map = to_pixel.record
    way = waypoints((0, 0, 0), (0, 1000, 0), follows_terrain=True, above_ground=above)
    update_terrain_lookahead(work, heights.astype(np.float32), way, parameters(**values), own)
    return own


def raster(*hills: tuple[float, float]) -> np.ndarray:
    """Ground at 300 m but for heights at places north (m), (rows, 3)."""
    made = np.full((300, 3), 300.0)
    for north, up in hills:
        made[int(north / 10.0)] = up
    return made


@pytest.mark.parametrize(
    ("north", "up", "rise"),
    [
        # Half of 5 m/s at 25 m/s climbs 0.1: 400 m on, it has climbed 40 m.
        (400.0, 380.0, 40.0),
        (1000.0, 420.0, 20.0),
        (400.0, 330.0, 0.0),
        # Neither beyond the waypoint, nor between two places of TERRAIN_SPACING.
        (1100.0, 900.0, 0.0),
        (450.0, 900.0, 0.0),
    ],
)
def test_the_rise_ahead_is_beyond_half_of_the_greatest_climb(north: float, up: float, rise: float) -> None:
    own = looked(raster((north, up)))
    assert own.terrain_altitude == 300.0
    assert own.lookahead_rise == pytest.approx(rise, abs=0.01)


def test_how_far_and_how_often_it_looks_are_parameters() -> None:
    hill = raster((800.0, 500.0))
    assert looked(hill).lookahead_rise == pytest.approx(120.0, abs=0.01)
    assert looked(hill, TERRAIN_LOOKAHD=600.0).lookahead_rise == 0.0
    assert looked(hill, TERRAIN_LOOKAHD=0.0).lookahead_rise == 0.0
    assert looked(raster((450.0, 500.0)), TERRAIN_SPACING=50.0).lookahead_rise == pytest.approx(155.0, abs=0.01)
    assert looked(hill, TECS_CLMB_MAX=10.0).lookahead_rise == pytest.approx(40.0, abs=0.01)


def test_ground_that_is_not_known_changes_nothing() -> None:
    assert looked(raster((300.0, math.nan), (400.0, 380.0))).lookahead_rise == pytest.approx(40.0, abs=0.01)


@pytest.mark.parametrize(
    ("up", "above", "offset"),
    # From the aircraft's height, 500 m less 300 m of ground; a change of less than ALT_SLOPE_MIN, 15 m, counts as none.
    [(500.0, 100.0, -100.0), (500.0, 186.0, 0.0), (500.0, 185.0, -15.0), (500.0, 215.0, 15.0)],
)
def test_a_leg_begins_at_the_height_of_its_waypoint_above_the_ground_there(
    up: float, above: float, offset: float
) -> None:
    own = looked(raster(), above)
    # The waypoint is at 500 m, the ground at 300 m.
    assert (own.terrain_leg, own.from_height_above_terrain) == (1, 200.0)
    assert own.altitude_offset == pytest.approx(offset)


@pytest.mark.parametrize(
    ("from_up", "item_height", "to_up", "expected"),
    [
        # From 250 m above ground of 526 m down to 421 m AMSL: no more than 421, from the first moment.
        (776.0, 250.0, 421.0, 421.0),
        # A climb from 50 m above ground of 300 m: the slope, halfway up.
        (350.0, 50.0, 450.0, 400.0),
        # By the sea, 120 m above ground of 5 m down to 60 m: the slope from 120 m on.
        (125.0, 120.0, 60.0, 92.5),
        # From an item that is not above terrain.
        (776.0, 0.0, 421.0, 598.5),
    ],
)
def test_a_leg_from_an_item_above_terrain_compares_its_height_with_an_altitude(
    from_up: float, item_height: float, to_up: float, expected: float
) -> None:
    """`Plane::constrain_target_altitude_location` reads the numbers of both ends, whatever their frames."""
    own = memory(from_up=from_up, from_item_height=item_height)
    (b,) = waypoints((0, 1000, to_up))
    update_height_demand(flying(0.0, 500.0, expected), b, parameters(), own, DT)
    assert own.altitude_demand_in == pytest.approx(expected)
