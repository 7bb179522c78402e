"""The verdict as a whole, on synthetic flights whose numbers are known, and on tracks that are none."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import make_finding
from logs.verdict.judge_flight import _disagreements, judge_flight, judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.places import FLIGHT, Disagreement, Place
from logs.verdict.rules.registry import RULES, run_rules
from logs.verdict.verdict import verdict_json
from tests.logs.verdict.judging import ROUTE, SILENT_ON_WAYPOINTS, failing, judge, leg, of, waypoint
from tests.soak import scaled
from tests.synthetic import (
    copied,
    edited,
    fly_path,
    make_setup,
)


def test_a_clean_flight_is_flyable_and_every_rule_speaks(setup: FlightSetup, track: Track) -> None:
    verdict = judge(setup, track)
    assert verdict.flyable
    assert verdict.complete
    assert verdict.lines[:2] == ("flyable", f"Start: {setup.route.started}")
    assert {item.rule for item in verdict.findings} == set(RULES) - SILENT_ON_WAYPOINTS
    assert all(item.ok for item in verdict.findings)
    assert len([item for item in verdict.findings if item.rule == "turn"]) == 3
    assert len([item for item in verdict.findings if item.rule == "slope"]) == 4


def test_route_requirements_that_are_known_are_not_computed_again(
    setup: FlightSetup, track: Track, monkeypatch: pytest.MonkeyPatch
) -> None:
    requirements, flown, drawn = route_requirements(setup), judge(setup, track), judge_geometry(setup)
    for module in ("judge_flight", "judge_geometry"):
        monkeypatch.setattr(f"logs.verdict.{module}.route_requirements", None)
    assert judge_flight(setup, track, "completed", requirements=requirements) == flown
    assert judge_geometry(setup, requirements) == drawn


def test_flown_angles_and_slopes_are_the_planned_ones(setup: FlightSetup, track: Track) -> None:
    verdict = judge(setup, track)
    for item in verdict.findings:
        if item.rule == "turn":
            assert item.flown == pytest.approx(item.planned, abs=0.01)
        if item.rule == "slope":
            assert item.flown == pytest.approx(item.planned, abs=0.05)
    assert of(verdict, "turn", waypoint(3)).planned == pytest.approx(math.degrees(math.atan2(2000, 500)))
    assert of(verdict, "energy").flown == pytest.approx(300.0 * track.time[-1] / 3600.0, rel=1e-6)


def test_wind_does_not_bend_what_is_measured() -> None:
    setup = make_setup(ROUTE, wind={"speed_mps": 10.0, "from_deg": 220.0})
    # The turn's radius is of the ground speed downwind.
    requirements = route_requirements(setup)
    track = fly_path(setup, radius=[float(r) for r in requirements.radius[1:-1]])
    verdict = judge(setup, track)
    assert verdict.flyable, verdict.summary
    for item in verdict.findings:
        if item.rule == "turn":
            assert item.flown == pytest.approx(item.planned, abs=0.02)
        if item.rule == "slope":
            assert item.flown == pytest.approx(item.planned, abs=0.1)


@pytest.mark.parametrize("column", ["leg", "cross_track", "height_error", "clearance", "speed_command", "commands"])
def test_what_guidance_says_of_itself_changes_nothing(setup: FlightSetup, track: Track, column: str) -> None:
    rubbish = np.full_like(getattr(track, column), 77)
    assert verdict_json(judge(setup, edited(track, **{column: rubbish}))) == verdict_json(judge(setup, track))


@pytest.mark.parametrize(
    ("shift", "expected"),
    [
        ((40.0, 0.0, 0.0), ("waypoint", waypoint(0))),
        ((0.0, 0.0, -290.0), ("clearance", leg(0))),
        ((0.0, 0.0, 5000.0), ("bounds", FLIGHT)),
    ],
)
def test_moving_the_track_changes_the_verdict(
    setup: FlightSetup, track: Track, shift: tuple[float, float, float], expected: tuple[str, Place]
) -> None:
    verdict = judge(setup, edited(track, position=track.position + np.array(shift)))
    assert not verdict.flyable
    assert expected in failing(verdict)


# Any track at all


SPOILERS: list[Callable[[dict[str, Any]], None]] = [
    lambda c: c["position"].__setitem__(slice(100, 200), np.nan),
    lambda c: c["position"].__setitem__(slice(None), np.nan),
    lambda c: c["position"].__setitem__(slice(50, None), 1e300),
    lambda c: c["time"].__setitem__(slice(None), 0.0),
    lambda c: c["time"].__imul__(-1.0),
    lambda c: c["time"].__setitem__(slice(10, None), np.inf),
    lambda c: c["airspeed"].__setitem__(slice(None), np.inf),
    lambda c: c["attitude"].__setitem__(slice(None), np.nan),
    lambda c: c["velocity"].__setitem__(slice(None), -1e30),
    lambda c: c["energy"].__setitem__(slice(None), np.nan),
    lambda c: c["position"].__setitem__(slice(None), 0.0),
    lambda c: c["leg"].__setitem__(slice(None), -5),
]


@pytest.mark.parametrize("spoil", SPOILERS)
def test_garbage_is_judged_and_never_flyable(
    setup: FlightSetup, track: Track, spoil: Callable[[dict[str, Any]], None]
) -> None:
    columns = copied(track)
    spoil(columns)
    verdict = judge(setup, Track(**columns))
    assert verdict.flyable is (spoil is SPOILERS[-1])


@pytest.mark.parametrize("rows", [0, 1, 2, 3, 10, 70])
def test_very_short_tracks(setup: FlightSetup, track: Track, rows: int) -> None:
    verdict = judge(setup, track.rows(0, rows))
    assert not verdict.complete
    assert not verdict.flyable


def test_two_rows_far_apart_say_nothing_of_a_slope() -> None:
    setup = make_setup(ROUTE)
    columns = copied(fly_path(setup, rate=5.0))
    columns["time"][:211] = 0.0
    # One row at 0 s is left of the first leg, and one at 42 s.
    judge(setup, Track(**columns).rows(0, 212))


@settings(max_examples=scaled(30, 12), deadline=None)
@given(st.data())
def test_random_cuts_and_holes_never_raise(data: st.DataObject) -> None:
    setup = make_setup(ROUTE)
    track = fly_path(setup, rate=5.0)
    columns = copied(track)
    for _ in range(data.draw(st.integers(0, 4))):
        name = data.draw(
            st.sampled_from(["time", "position", "velocity", "attitude", "airspeed", "controls", "current"])
        )
        start = data.draw(st.integers(0, len(track) - 1))
        value = data.draw(st.sampled_from([math.nan, math.inf, -math.inf, 0.0, 1e30, -3.0]))
        columns[name][start : start + data.draw(st.integers(1, 400))] = value
    first = data.draw(st.integers(0, len(track)))
    judge(setup, Track(**columns).rows(first, data.draw(st.integers(first, len(track)))))


@settings(max_examples=scaled(25, 10), deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-80.0, 80.0), st.floats(500.0, 2500.0), st.floats(-6.0, 10.0)), min_size=1, max_size=6
    ),
    st.floats(0.0, 360.0),
)
def test_routes_inside_every_limit_are_flyable_on_both_levels(
    legs: list[tuple[float, float, float]], course: float
) -> None:
    points = [[0.0, 0.0, 1500.0]]
    heading = math.radians(course)
    for turn, run, slope in [(0.0, 800.0, 0.0), *legs]:
        heading += math.radians(turn)
        east, north, up = points[-1]
        climb = run * math.tan(math.radians(slope))
        points.append([east + run * math.sin(heading), north + run * math.cos(heading), up + climb])
    setup = make_setup(points)
    verdict = judge(setup, fly_path(setup, rate=20.0, blend=60.0))
    assert verdict.flyable, verdict.summary
    assert judge_geometry(setup).flyable


def test_what_a_flight_cannot_change_is_judged_once_for_flight_and_geometry(setup: FlightSetup) -> None:
    """A go-around is flown by a point mass from the planned glide: of all rules it costs the most."""
    of_flight = [make_finding(rule, FLIGHT, ok=False, reason="as flown") for rule in ("go_around", "turn")]
    requirements = route_requirements(setup)
    found = run_rules(requirements, None, geometric=True, flight_findings=of_flight)
    assert [item for item in found if item.reason == "as flown"] == of_flight[:1]
    assert len(found) == len(run_rules(requirements, None, geometric=True)) + 1


def test_a_landing_by_geometry_is_compared_with_the_flown_touchdown() -> None:
    """Geometry judges the glide from the items, a flight the touchdown; a flown landing without one is compared."""
    place = Place("waypoint", 2, item=3)
    landing, touchdown = (
        make_finding(rule, place, ok=rule != "landing", reason="") for rule in ("landing", "touchdown")
    )
    (found,) = _disagreements("geometry", [landing], [touchdown])
    assert found == Disagreement("landing", place, "geometry", there=False, here=True)
    assert _disagreements("geometry", [landing], [replace(touchdown, ok=False)]) == ()
    assert _disagreements("geometry", [landing], [landing]) == ()
