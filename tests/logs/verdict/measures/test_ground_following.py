"""Legs that follow the ground: what they demand, and what of it an aircraft can fly, by arithmetic on one step."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import GROUND_FOLLOWING_ERROR, Finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.ground_following import demanded_altitudes, follows_ground, steepest_ground
from logs.verdict.measures.route_requirements import route_requirements
from tests.logs.verdict.judging import judge, leg, of
from tests.synthetic import CALM_CLIMB, fly_path, make_setup
from world.arrays import Floats
from world.terrain import make_gridded_terrain

# North of the lower edge of the step, m.
LOWER_EDGE_NORTH_M = 1500.0
# North of its upper edge, m: 16.7 degrees for a step of 150 m.
UPPER_EDGE_NORTH_M = 2000.0


def ground(north: Floats, step: float) -> Floats:
    return np.interp(north, [LOWER_EDGE_NORTH_M, UPPER_EDGE_NORTH_M], [400.0, 400.0 + step])


def over_step(step: float = 150.0) -> FlightSetup:
    """A leg of 3 km that keeps 100 m above ground, which steps up by ``step`` (m) from 500 to 1000 m along it."""
    axis = np.arange(-3000.0, 9001.0, 100.0)
    heights = np.broadcast_to(ground(axis, step)[:, None], (len(axis), len(axis)))
    terrain = make_gridded_terrain(np.array(heights), axis, axis, source="", sha256="", datum="")
    high = 500.0 + step
    setup = make_setup([[0, 0, 500], [0, 1000, 500], [0, 4000, high], [0, 5500, high]], ground=terrain)
    return replace(setup, route=setup.route.with_fields(above_ground=[math.nan, math.nan, 100.0, math.nan]))


def flown(setup: FlightSetup, step: float = 150.0, share: float = 0.0) -> Track:
    """A flight along the straight line between the waypoints, or by a share on the demanded altitude."""
    return fly_path(
        setup,
        up=lambda s: (
            share
            * np.where(
                (s > 1000.0) & (s < 4000.0), ground(s, step) + 100.0 - (500.0 + step * (s - 1000.0) / 3000.0), 0.0
            )
        ),
    )


def test_the_demand_is_the_ground_and_a_height_that_changes_evenly() -> None:
    setup = over_step()
    setup = replace(setup, route=setup.route.with_fields(above_ground=[math.nan, math.nan, 130.0, math.nan]))
    requirements = route_requirements(setup)
    assert [follows_ground(requirements, k) for k in range(3)] == [False, True, False]
    places = np.array([[0.0, 1000.0, 0.0], [0.0, 1750.0, 0.0], [0.0, 4000.0, 0.0], [0.0, 20_000.0, 0.0]])
    # From 100 to 130 m, a quarter of it after 750 of 3000 m, over ground of 400, 475 and 550 m.
    assert demanded_altitudes(requirements, 1, places)[:3] == pytest.approx([500.0, 582.5, 680.0], abs=0.01)
    assert math.isnan(demanded_altitudes(requirements, 1, places)[3])


def test_the_excess_is_the_height_that_the_limit_leaves() -> None:
    requirements = route_requirements(over_step())
    steep = steepest_ground(requirements, 1, math.radians(5.0))
    assert steep is not None
    assert (math.degrees(steep.slope), steep.length) == pytest.approx((16.70, 500.0), abs=0.01)
    assert steep.excess == pytest.approx(150.0 - 500.0 * math.tan(math.radians(5.0)), abs=0.01)
    assert steepest_ground(requirements, 1, math.radians(16.71)) is None
    assert steepest_ground(requirements, 1, math.inf) is None
    # Where the ground falls, the aircraft is only higher than the leg demands.
    assert steepest_ground(route_requirements(over_step(-150.0)), 1, math.radians(5.0)) is None


def slope_of(setup: FlightSetup, track: Track | None = None) -> Finding:
    return of(judge_geometry(setup) if track is None else judge(setup, track), "slope", leg(1))


# Of a step within 500 m an aircraft that climbs 13.7 degrees leaves what exceeds 121.9 m; 10 m of it are negligible.
@pytest.mark.parametrize(("step", "ok"), [(131.0, True), (133.0, False)])
@pytest.mark.parametrize("is_flown", [True, False])
def test_ground_that_is_too_steep_fails_the_leg_that_follows_it(step: float, ok: bool, is_flown: bool) -> None:
    setup = over_step(step)
    item = slope_of(setup, flown(setup, step) if is_flown else None)
    assert item.ok is ok
    if not ok:
        assert (item.planned, item.limit) == pytest.approx((math.degrees(math.atan(0.266)), CALM_CLIMB), abs=0.01)
        assert item.reason.startswith("leg 1 follows ground that rises at 14.9° for 500 m; ")
        assert "the aircraft would fly up to 11 m too low over the ground" in item.reason


@pytest.mark.parametrize(("start_height", "step", "ok"), [(100.0, -900.0, True), (1000.0, 0.0, False)])
def test_a_steep_descent_fails_only_by_the_missions_own_heights(start_height: float, step: float, ok: bool) -> None:
    """900 m in 3 km are 16.7 degrees, more than this aircraft descends: by falling ground, or onto level ground."""
    setup = over_step(step)
    points = setup.route.points["position"].copy()
    points[:2, 2] = 400.0 + start_height
    points[2:, 2] = 500.0 + step
    finding = slope_of(replace(setup, route=setup.route.with_fields(position=points)))
    assert (finding.ok, finding.planned) == (ok, pytest.approx(-16.7, abs=0.01))
    assert ("the ground falls at 16.7° on average" in finding.reason) is ok


@pytest.mark.parametrize(("share", "ok"), [(0.92, True), (0.87, False), (0.0, False)])
def test_a_flight_decides_by_the_height_that_it_missed(share: float, ok: bool) -> None:
    """The straight line is 100 m below the demand where the step ends: 8 m of it are tolerated, 13 m are not."""
    setup = over_step()
    item = slope_of(setup, flown(setup, share=share))
    assert item.ok is ok
    errors = {fact.what: fact.value for fact in item.facts}
    assert errors[GROUND_FOLLOWING_ERROR] == pytest.approx((share - 1.0) * 100.0, abs=0.3)


def test_the_autopilots_climb_limit_is_named_where_it_is_lower() -> None:
    """2 m/s of 25.7 m/s true airspeed (25 m/s EAS at 575 m AMSL) are 4.5 degrees, which leave 111 of 150 m."""
    law = ArduPlane(ArduPilotParameters.defaults()).with_parameters(TECS_CLMB_MAX=2.0)
    setup = replace(over_step(), autopilot=law)
    item = slope_of(setup, flown(setup))
    assert (
        "TECS_CLMB_MAX 2 m/s allows only a climb of 4.5°, so the aircraft would fly up to 111 m too low over the ground"
        in (item.reason)
    )


@pytest.mark.parametrize(("step", "side"), [(60.0, "below"), (-150.0, "above")])
def test_a_large_miss_of_a_leg_that_passes_is_in_the_first_line(step: float, side: str) -> None:
    """The line climbs a third of the step where the step ends; above ground that falls away, no height is a fault."""
    setup = over_step(step)
    verdict = judge(setup, flown(setup, step))
    assert slope_of(setup, flown(setup, step)).ok
    missed = f"; leg 1 (to item 2) flown up to {abs(step) / 1.5:.0f} m {side} its height above ground"
    assert missed in verdict.headline
    assert "its height above ground" not in judge(setup, flown(setup, step, share=0.8)).headline
