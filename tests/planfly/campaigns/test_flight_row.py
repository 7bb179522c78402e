"""Every rule has a scale, and those without a distance are rules."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flight.simulation.track import TRACK_ROW, as_track
from logs.recording.reader import read_log
from logs.verdict.findings import GROUND_PATH, UNKNOWN_AIRCRAFT, UNKNOWN_PATH, Fact, Finding, make_finding
from logs.verdict.places import Place
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.verdict import Verdict
from planfly.campaigns.campaign_base import CampaignBase, open_campaign
from planfly.campaigns.dispersions import default_dispersions, parse_dispersions
from planfly.campaigns.flight_row import (
    STATION_COUNT,
    MarginalPass,
    MinimumMargin,
    clearance_profile,
    find_marginal_passes,
    find_minimum_margins,
    find_unjudged_rules,
    fly_one,
    list_failed_findings,
    make_lost_row,
    scale_margin,
    waypoint_crossings,
)
from planfly.campaigns.tables import is_same_flight
from planfly.workflow.open_flight import open_flight
from planfly.workflow.pipeline import fly_and_judge
from tests.planfly.campaigns.made_campaigns import write_short
from tests.setups import route_along
from tests.synthetic import fly_path, make_setup
from world.scenario import with_threats

CHECKS = (GROUND_PATH, UNKNOWN_AIRCRAFT)

# ----------------------------------------------------------------------
# Narrow passes, by plain sums: a missile beside a straight track, and findings with little margin.

MISSILE = {"name": "Alfa", "north_m": 1000.0, "amsl_m": 300.0, "kill_radius_m": 500.0, "kill_scale_m": 200.0}
LEG = Place("leg", 1)


def passed_beside(away: float, *findings: Finding) -> tuple[MarginalPass, ...]:
    """Of a straight track this far outside a missile's sphere, m."""
    setup = make_setup([[0, 0, 300], [0, 2000, 300]], threats=[MISSILE | {"east_m": 500.0 + away}])
    return find_marginal_passes(findings, setup.scenario, fly_path(setup))


@pytest.mark.parametrize(("away", "left"), [(2.5, 0.25), (9.9, 0.99)])
def test_a_missile_passed_within_ten_metres(away: float, left: float) -> None:
    ((rule, place, share),) = passed_beside(away)
    assert (rule, place) == ("threat", Place("missile", 0, name="Alfa"))
    assert share == pytest.approx(left, abs=1e-4)


def test_a_missile_further_off_or_entered_is_none() -> None:
    assert passed_beside(10.1) == ()
    entered = make_finding("threat", Place("missile", 0, name="Alfa"), ok=False, reason="", margin=-3.0)
    assert passed_beside(-5.0, entered) == ()


def threat_finding(place: Place, distance: float, time_inside: float = 0.0) -> Finding:
    """Outside a missile's sphere by a distance, m, negative inside, where a flight stays for a time, s."""
    facts = [Fact("nearest", distance, "m")]
    return make_finding("threat", place, ok=distance > 0.0, reason="", margin=-time_inside, unit="s", facts=facts)


def test_flights_are_ranked_by_the_distance_from_a_missile() -> None:
    """A long visit to the edge of a sphere counts less than a short one that goes deeper."""
    alfa, bravo, other = (Place("missile", k, name=name) for k, name in enumerate(("Alfa", "Bravo", "Charlie")))
    inside = (threat_finding(alfa, -0.5, 9.0), threat_finding(bravo, -5.24, 2.0), threat_finding(other, 3.0))
    seen = make_finding("threat", Place("radar", 0, name="Alfa"), ok=True, reason="", unit="s")
    assert find_minimum_margins((*inside, seen)) == (("threat", MinimumMargin(-5.24, "m", bravo)),)
    assert find_minimum_margins((threat_finding(Place("flight"), 4.0), seen))[0][1].value == 4.0
    # Only radars, or no threats at all.
    assert find_minimum_margins((make_finding("threat", Place("flight"), ok=True, reason="", margin=0.0), seen)) == ()
    assert scale_margin("threat", MinimumMargin(-5.24, "m", bravo)) == pytest.approx(-0.524)


def finding(rule: str, margin: float | None, *, ok: bool | None = True, **other: Any) -> Finding:
    return make_finding(rule, LEG, ok=ok, reason="", margin=margin, **other)


@pytest.mark.parametrize(
    ("rule", "margin", "tolerance", "left"),
    [
        # A degree of slope, ten metres of clearance.
        ("slope", 0.25, 0.0, 0.25),
        ("slope", 0.99, None, 0.99),
        ("clearance", 2.5, None, 0.25),
        # What a person would call a noticeable difference: half of 10 m, 50 Wh, 10 degrees of bank and 1 m/s.
        *(
            (rule, 5.0, None, 0.5)
            for rule in ("corridor", "waypoint", "height", "loiter", "fence", "bounds", "departure")
        ),
        ("energy", 25.0, None, 0.5),
        ("speed", 0.5, None, 0.5),
        ("stall", 0.5, None, 0.5),
        # The tolerance counts as margin, too.
        ("slope", -0.25, 0.5, 0.25),
    ],
)
def test_the_margin_is_that_to_the_limit_with_its_tolerance(
    rule: str, margin: float, tolerance: float | None, left: float
) -> None:
    ((found, place, share),) = passed_beside(99.0, finding(rule, margin, tolerance=tolerance))
    assert (found, place, share) == (rule, LEG, pytest.approx(left))


@pytest.mark.parametrize(
    "wide",
    [
        finding("slope", 1.0),
        finding("slope", 0.9, tolerance=0.1),
        # What passes beyond its limit passes by other evidence.
        finding("slope", -2.0, tolerance=0.5),
        finding("clearance", 10.0),
        finding("slope", None),
        finding("slope", 0.2, ok=None),
        # A count, or a time, is no distance.
        finding("turn", 0.2),
    ],
)
def test_what_has_more_margin_or_no_number_is_none(wide: Finding) -> None:
    assert passed_beside(99.0, wide) == ()


def test_of_several_checks_at_a_place_the_least_counts_and_one_that_fails_counts_for_all() -> None:
    two = [finding("slope", margin, check=check) for margin, check in ((0.3, "a"), (0.1, "b"))]
    assert passed_beside(99.0, *two) == (("slope", LEG, 0.1),)
    assert passed_beside(99.0, *reversed(two)) == (("slope", LEG, 0.1),)
    assert passed_beside(99.0, *two, finding("slope", -1.0, ok=False, check="c")) == ()


# ----------------------------------------------------------------------
# Clearance and crossings of a track, by plain sums.

# North for 300 m, then east for 300 m.
ROUTE = route_along([[0.0, 0.0, 100.0], [0.0, 300.0, 100.0], [300.0, 300.0, 100.0]], 25.0)


def flown(points: list[tuple[float, float, float]], legs: list[int], clearance: list[float]) -> object:
    rows = np.zeros(len(points), TRACK_ROW)
    rows["position"], rows["leg"], rows["clearance"] = points, legs, clearance
    return as_track(rows)


def test_the_profile_has_the_least_of_each_piece() -> None:
    track = flown(
        [(0.0, 1.0, 100.0), (0.0, 1.5, 100.0), (5.0, 150.0, 100.0), (299.0, 300.0, 100.0)], [0, 0, 0, 1], [9, 8, 7, 6]
    )
    profile = clearance_profile(ROUTE, track)
    # Pieces of 600 / STATIONS = 4 m.
    assert STATION_COUNT == 150
    assert (profile[0], profile[37], profile[149]) == (8.0, 7.0, 6.0)
    assert np.isnan(profile).sum() == STATION_COUNT - 3


def test_crossings_are_right_of_and_above() -> None:
    track = flown([(2.0, 0.0, 101.0), (4.0, 296.0, 97.0), (300.0, 295.0, 100.0)], [0, 0, 1], [1, 1, 1])
    crossings = waypoint_crossings(ROUTE, track)
    # At the first, right of north is east; at the corner the mean course is north-east: (4, -4) is 4 sqrt 2 right.
    assert crossings[0] == pytest.approx((2.0, 1.0))
    assert crossings[1] == pytest.approx((4.0 * 2.0**0.5, -3.0), abs=1e-5)
    # Right of east is south.
    assert crossings[2] == pytest.approx((5.0, 0.0), abs=1e-5)


def test_a_loiter_is_crossed_once_however_many_corners_it_has() -> None:
    corners = [[0.0, 300.0, 100.0], [50.0, 350.0, 100.0], [100.0, 300.0, 100.0], [600.0, 300.0, 100.0]]
    route = route_along([[0.0, 0.0, 100.0], *corners], 25.0)
    loiter = route.with_fields(item=np.array([1, 2, 2, 2, 3]), stop=np.array([0, 1, 1, 1, 2]))
    track = flown([(0.0, 0.0, 100.0), (0.0, 296.0, 97.0), (600.0, 295.0, 100.0)], [0, 0, 3], [1, 1, 1])
    crossings = waypoint_crossings(loiter, track)
    assert crossings.shape == (3, 2)
    assert crossings[2] == pytest.approx((5.0, 0.0), abs=1e-5)


def test_what_was_not_reached_has_no_crossing() -> None:
    crossings = waypoint_crossings(ROUTE, flown([(0.0, 0.0, 100.0), (0.0, 100.0, 100.0)], [0, 0], [1, 1]))
    assert np.isfinite(crossings[0]).all()
    assert np.isnan(crossings[1]).all()


# ----------------------------------------------------------------------
# One flight of a campaign: the same as ``planfly fly`` in its wind, and of its index alone.


def test_a_flight_is_that_of_fly_in_the_same_wind(base: CampaignBase, tmp_path: Path) -> None:
    """Where wind alone varies, opening the mission in that wind with that seed flies the same."""
    wind_only = '[wind_speed]\ndistribution = "norm"\nscale = 2.0\nsource = "x"'
    varied = replace(base, dispersions=parse_dispersions(wind_only, "x"))
    row = fly_one(varied, 3)
    mission, scenario = write_short(tmp_path)
    own = base.scenario.wind
    speed = own.speed + row.draw.values["wind_speed"]
    wind = (speed, math.degrees(own.from_course))
    opened = open_flight(mission, {"scenario": scenario, "seed": row.draw.seed, "wind": wind})
    flown = fly_and_judge(opened)
    assert speed != own.speed
    assert (row.outcome == "flyable") is flown.verdict.flyable
    assert row.duration == float(flown.track.time[-1])
    assert dict(row.margins) == dict(find_minimum_margins(flown.verdict.findings))
    assert len(row.margins) > 5


@pytest.mark.parametrize("radius", [200.0, 290.0, 400.0])
def test_the_distance_to_a_missile_is_that_of_the_logged_positions(
    base: CampaignBase, radius: float, tmp_path: Path
) -> None:
    """A missile 300 m beside the first leg, which its sphere nearly reaches, or covers in part; and a radar."""
    start, end = base.nominal_setup().route.positions[:2, :2]
    step = (end - start) / np.hypot(*(end - start))
    place = 0.5 * (start + end) + 300.0 * np.array([-step[1], step[0]])
    threats: list[dict[str, Any]] = [
        {"east_m": float(place[0]), "north_m": float(place[1]), "kill_radius_m": radius, "height_m": 100.0},
        {"east_m": float(place[0]), "north_m": float(place[1]), "detection_radius_m": 900.0},
    ]
    watched = replace(base, scenario=with_threats(base.scenario, threats, "threats"))
    row = fly_one(watched, 0, log=tmp_path / "a.mcap")
    position = read_log(tmp_path / "a.mcap").track.position
    centre = watched.scenario.threats.position[-2]
    assert row.missile_distance == pytest.approx(
        float(np.linalg.norm(position - centre, axis=1).min()) - radius, abs=0.5
    )
    margin = dict(row.margins)["threat"]
    assert (margin.value, margin.unit) == (row.missile_distance, "m")
    without = fly_one(base, 0)
    assert (without.missile_distance, "threat" in dict(without.margins)) == (None, False)


def test_the_same_index_gives_the_same_flight_and_log(base: CampaignBase, tmp_path: Path) -> None:
    first = fly_one(base, 2, log=tmp_path / "a.mcap")
    fly_one(base, 1)
    again = fly_one(base, 2, log=tmp_path / "b.mcap")
    assert is_same_flight(first, again)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    assert not is_same_flight(first, fly_one(base, 1))


def test_the_draw_shows_in_the_flight(base: CampaignBase) -> None:
    heavy = '[start_up]\ndistribution = "uniform"\nloc = 9.0\nscale = 0.001\nsource = "x"'
    row = fly_one(replace(base, dispersions=parse_dispersions(heavy, "x")), 0)
    margin = dict(row.margins)["clearance"].value
    level = fly_one(replace(base, dispersions=parse_dispersions(heavy.replace("9.0", "-9.0"), "x")), 0)
    # Below the mission's 80 m above ground by 9 m, where 60 are required: 11 are left, and a little for gusts.
    low = dict(level.margins)["clearance"].value
    assert low is not None
    assert margin is not None
    assert 9.0 < low < 12.0 < margin


def test_a_flight_that_failed_nothing_but_is_not_whole_names_completion() -> None:
    verdict = Verdict((), flyable=False, complete=False, lines=("x",), level="flown")
    assert list_failed_findings(verdict) == (("completion", Place("flight")),)
    finding = make_finding("turn", Place("waypoint", 1), ok=False, reason="x")
    assert list_failed_findings(replace(verdict, findings=(finding,))) == (("turn", Place("waypoint", 1)),)


def test_a_flight_that_is_not_judged_in_full_names_what_is_not_judged() -> None:
    verdict = Verdict((), flyable=False, complete=True, lines=("x",), level="flown", unjudged="x")
    item = make_finding("mission", Place("mission", 0, item=3), ok=None, reason="x", check=UNKNOWN_PATH)
    known = make_finding("slope", Place("leg", 1), ok=None, reason="nothing to judge")
    assert list_failed_findings(replace(verdict, findings=(known, item))) == (("mission", Place("mission", 0, item=3)),)


def test_a_way_from_the_ground_that_is_left_open_counts_for_no_flight() -> None:
    ways = [make_finding("climbout", Place("waypoint", 0), ok=None, reason="x", check=check) for check in CHECKS]
    verdict = Verdict((ways[0],), flyable=False, complete=True, lines=("x",), level="flown", unjudged="x")
    assert verdict.flies
    assert list_failed_findings(verdict) == ()
    for other in (
        replace(verdict, findings=tuple(ways)),
        replace(verdict, findings=(ways[0], make_finding("turn", Place("waypoint", 1), ok=False, reason="x"))),
        replace(verdict, complete=False),
    ):
        assert not other.flies
        assert list_failed_findings(other)
    # Only what it does not count for is named.
    both = replace(
        verdict, findings=(ways[0], make_finding("slope", Place("leg", 1), ok=None, reason="x", check=CHECKS[1]))
    )
    assert list_failed_findings(both) == (("slope", Place("leg", 1)),)


def test_a_flight_names_what_it_does_not_judge_unless_it_fails() -> None:
    """As the verdict's summary does; a finding that leaves the verdict undecided is named with its reason, too."""
    setup = make_setup([[0, 0, 500], [0, 3000, 500]])
    takeoff = make_finding("takeoff", Place("waypoint", 0), ok=None, reason="why")
    slope = make_finding("slope", Place("leg", 0), ok=None, reason="unsure", check=UNKNOWN_AIRCRAFT)
    verdict = Verdict((takeoff, slope), flyable=False, complete=True, lines=(), level="flown", unjudged="x")
    titles = ("takeoff", f"{RULE_WORDS['takeoff'].title} (why)"), ("slope", "slopes (unsure)")
    assert find_unjudged_rules(verdict, setup) == titles
    flyable = replace(verdict, findings=(takeoff,), flyable=True, unjudged="")
    assert find_unjudged_rules(flyable, setup) == titles[:1]
    failed = make_finding("turn", Place("waypoint", 1), ok=False, reason="x")
    assert find_unjudged_rules(replace(verdict, findings=(takeoff, failed)), setup) == ()


def test_a_flight_that_only_an_open_setting_leaves_undecided_is_no_failure(tmp_path: Path) -> None:
    """COM_FLT_TIME_MAX may end the mission, which is not judged."""
    mission, scenario = write_short(tmp_path)
    params = tmp_path / "a.params"
    params.write_text("# Stack: PX4 Pro\n1\t1\tCOM_FLT_TIME_MAX\t500\t6\n1\t1\tMIS_TKO_LAND_REQ\t0\t6\n")
    scenario.write_text(
        scenario.read_text().replace('autopilot = "planfly"', f'autopilot = "px4"\nparams = "{params}"')
    )
    px4_base = open_campaign(str(mission), default_dispersions(), {"scenario": scenario, "seed": 1})
    row = fly_one(px4_base, 0)
    assert (row.outcome, row.failures) == ("undecided", ())
    assert row.undecided_text == "mission (COM_FLT_TIME_MAX 500 may end the mission, which is not judged)"


def test_an_empty_battery_has_nothing_left(base: CampaignBase) -> None:
    empty = fly_one(replace(base, uav=replace(base.uav, battery=6.0)), 0)
    assert (empty.outcome, empty.energy_left) == ("not flyable", 0.0)


def test_a_lost_flight_keeps_its_draw(base: CampaignBase) -> None:
    assert make_lost_row(base, 4, "died").draw == fly_one(base, 4).draw


@pytest.mark.parametrize(("corridor", "energy"), [(-6.0, -25.0), (-6.0, -35.0), (6.0, 25.0), (6.0, 35.0)])
def test_ten_metres_of_a_corridor_are_as_far_as_50_wh(base: CampaignBase, corridor: float, energy: float) -> None:
    findings = (finding("corridor", corridor, ok=corridor > 0.0), finding("energy", energy, ok=energy > 0.0))
    row = replace(make_lost_row(base, 0, ""), margins=find_minimum_margins(findings))
    assert row.closeness == pytest.approx(min(corridor / 10.0, energy / 50.0))
