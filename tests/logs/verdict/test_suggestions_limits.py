"""How much beyond what just passes a suggestion asks for."""

import math

import numpy as np
import pytest

from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.path_moves import planned_moves
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.zone_visits import DEPTH_PRECISION
from logs.verdict.rules import registry
from logs.verdict.suggestions import _smallest_shift
from tests.logs.verdict.judging import leg, missile, of, suggested
from tests.synthetic import make_scenario, make_setup
from world.airspace.zone_kernels import zone_records
from world.airspace.zones import Zone, make_polygon


def climb(degrees: float, run: float = 4000.0) -> Finding:
    rise = run * math.tan(math.radians(degrees))
    points = [[0, 0, 300], [0, 2000, 300], [0, 2000 + run, 300 + rise], [0, 4000 + run, 300 + rise]]
    return of(judge_geometry(make_setup(points)), "slope", leg(1))


def quantities(item: Finding) -> set[str]:
    return {change.what for suggestion in item.suggestions for change in suggestion}


def test_a_gentler_slope_is_a_tenth_of_a_degree_below_the_limit() -> None:
    """The aircraft climbs 13.7 degrees at 25 m/s."""
    item = climb(16.0)
    assert suggested(item, "rise").wanted == math.floor(4000.0 * math.tan(math.radians(13.6)))
    rise = 4000.0 * math.tan(math.radians(16.0))
    assert suggested(item, "length").wanted == math.ceil(rise / math.tan(math.radians(13.6)))


@pytest.mark.parametrize(("run", "worth"), [(4.2, True), (4.0, False)])
def test_a_rise_of_less_than_a_metre_is_not_worth_suggesting(run: float, worth: bool) -> None:
    """At 13.6 degrees 4.13 m of leg rise by a metre."""
    item = climb(math.degrees(math.atan2(15.0, run)), run)
    assert item.ok is False
    assert ("rise" in quantities(item)) is worth


@pytest.mark.parametrize(
    ("degrees", "speed"),
    # The made envelope climbs 15.7 degrees at 20 m/s and 0.4 less for each m/s more, 16.7 at 15 and 0.2 less.
    [(14.2, 23.5), (14.25, 23.0), (15.98, 18.0), (16.2, None)],
)
def test_a_speed_is_asked_for_in_halves_and_a_tenth_above_the_slowest(degrees: float, speed: float | None) -> None:
    """Level flight begins at 16 m/s: 17.6, so 18."""
    item = climb(degrees)
    if speed is None:
        assert "airspeed" not in quantities(item)
    else:
        assert suggested(item, "airspeed").wanted == speed


@pytest.mark.parametrize(("depth", "further"), [(40.3, 41.0), (40.6, 42.0)])
def test_a_missile_is_to_be_passed_a_metre_further_off_than_it_reaches(depth: float, further: float) -> None:
    straight = [[0, 0, 300], [0, 6000, 300]]
    threat = {"name": "battery", "north_m": 3000.0, "amsl_m": 300.0, "kill_radius_m": 500.0, "kill_scale_m": 100.0}
    scenario = make_scenario(straight, threats=[threat | {"east_m": 500.0 - depth}])
    item = of(judge_geometry(make_setup(straight, scenario=scenario)), "threat", missile("battery"))
    assert suggested(item, "distance").wanted == further


@pytest.mark.parametrize("speed", [15.5, 33.0])
def test_a_level_speed_is_three_per_cent_within_the_envelope(speed: float) -> None:
    """16 to 32 m/s: from 16.48 to 31.04, in tenths."""
    item = of(judge_geometry(make_setup([[0, 0, 300], [0, 6000, 300]], airspeed=speed)), "speed", leg(0))
    change = suggested(item, "airspeed")
    assert (change.wanted, change.most) == (16.5, 31.0)


@pytest.mark.parametrize(("limit", "has_suggestions"), [(3, True), (2, False)])
def test_no_suggestions_for_more_findings_than_one_change_can_mend(
    limit: int, has_suggestions: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three legs climb at 16 degrees, and the aircraft at 13.7."""
    monkeypatch.setattr(registry, "MAX_SUGGESTED_FINDINGS", limit)
    rise = 4000.0 * math.tan(math.radians(16.0))
    verdict = judge_geometry(make_setup([[0, 4000 * k, 300 + rise * k] for k in range(4)]))
    slopes = [of(verdict, "slope", leg(k)) for k in range(3)]
    assert [item.ok for item in verdict.findings].count(False) == 3
    assert [bool(item.suggestions) for item in slopes] == [has_suggestions] * 3


@pytest.mark.parametrize(("trials", "is_found"), [(40, True), (41, False)])
def test_a_shift_past_a_zone_is_found_in_forty_trials(trials: int, is_found: bool) -> None:
    """A path 100 m inside a zone, parallel to an edge that is nearly parallel to the shift.

    A shift by the depth leaves 1 - sin(angle) of it, so that trial k has 100 m (1 - sin(angle))^(k - 1): more than
    `DEPTH_PRECISION` up to trial ``trials`` - 1, and less from trial ``trials`` on.
    """
    left = (DEPTH_PRECISION / 100.0) ** (1.0 / (trials - 1.5))
    angle = math.asin(1.0 - left)
    along, outward = np.array([math.cos(angle), math.sin(angle)]), np.array([math.sin(angle), -math.cos(angle)])
    ends = [5000.0 * along, 5000.0 * along - 3000.0 * outward, -5000.0 * along - 3000.0 * outward, -5000.0 * along]
    zone = Zone("edge", "exclusion", make_polygon([[(float(east), float(north)) for east, north in ends]]))
    line = [[*(distance * along - 100.0 * outward), 300.0] for distance in (-500.0, 500.0)]
    moves = planned_moves(route_requirements(make_setup(line)))
    shift = _smallest_shift(moves, zone_records([zone]), None, "east", 1.0, math.inf)
    expected = sum(100.0 * left**k for k in range(trials - 1)) if is_found else None
    assert shift == (None if expected is None else pytest.approx(expected, abs=0.01))
