"""The turn rule on synthetic flights, passing and failing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.measures.turns import TurnMeasure, measure_turn
from logs.verdict.places import Place
from logs.verdict.rules.turn_rule import _unflown_turn_text
from tests.logs.verdict.judging import ROUTE, failing, judge, of, waypoint
from tests.synthetic import (
    bank_radius,
    bump,
    fly_path,
    make_setup,
    waypoint_stations,
)


def zigzag(turn_deg: float, leg: float, legs: int = 4) -> list[list[float]]:
    points, course = [[0.0, 0.0, 300.0], [0.0, 1200.0, 300.0]], 0.0
    for k in range(legs):
        course += math.radians(turn_deg) * (-1) ** k
        run = leg if k + 1 < legs else 1200.0
        east, north, up = points[-1]
        points.append([east + run * math.sin(course), north + run * math.cos(course), up])
    return points


def test_the_aircraft_limits_a_turn_by_its_legs() -> None:
    # 131 m legs at 25 m/s and 30 degrees of bank hold a row of equal turns of 61 degrees: 2 R tan(theta/2) = 130 m.
    # Where the turns go to and fro, the roll from one bank into the other takes 10.5 m more.
    assert failing(judge_geometry(make_setup(zigzag(60.0, 139.0)))) == set()
    wrong = failing(judge_geometry(make_setup(zigzag(63.0, 131.0))))
    assert wrong == {("turn", waypoint(k)) for k in (1, 2, 3, 4)}
    assert of(judge_geometry(make_setup(zigzag(60.0, 139.0))), "turn", waypoint(2)).limit_source == "aircraft"


def test_only_the_greedy_one_of_two_turns_is_at_fault() -> None:
    # Waypoint 1 needs 29 m, waypoint 2 needs 190 m of the 200 m between them.
    points = np.array(zigzag(30.0, 200.0, 1))
    for turn, run in ((150.0, 1500.0),):
        course = math.radians(30.0 + turn)
        points[-1, :2] = points[1, :2] + 200.0 * np.array([math.sin(math.radians(30.0)), math.cos(math.radians(30.0))])
        step = run * np.array([math.sin(course), math.cos(course)])
        points = np.vstack([points, [*(points[-1, :2] + step), 300.0]])
    assert failing(judge_geometry(make_setup(points))) == {("turn", waypoint(2))}


def test_the_scenario_limits_a_turn_if_it_is_tighter(setup: FlightSetup) -> None:
    tight = make_setup(ROUTE, limits={"max_turn_deg": 60.0})
    item = of(judge(tight, fly_path(tight)), "turn", waypoint(3))
    assert (item.ok, item.limit, item.limit_source) == (False, 60.0, "scenario")
    assert item.margin == pytest.approx(60.0 - math.degrees(math.atan2(2000, 500)), abs=0.01)
    assert of(judge(tight, fly_path(tight)), "turn", waypoint(1)).ok


def test_a_planned_turn_beyond_the_aircraft_fails_however_it_was_flown() -> None:
    setup = make_setup(zigzag(70.0, 131.0))
    verdict = judge(setup, fly_path(setup, radius=80.0, rate=60.0))
    assert ("turn", waypoint(2)) in failing(verdict)
    assert "takes" in of(verdict, "turn", waypoint(2)).reason


def test_flown_evidence_alone_fails_a_turn() -> None:
    setup = make_setup(zigzag(70.0, 131.0))
    verdict = judge(setup, fly_path(setup, radius=80.0), envelope=False)
    # A radius of 80 m at 25 m/s is 38.5 degrees of bank.
    assert ("turn", waypoint(2)) in failing(verdict)
    assert "bank 38" in of(verdict, "turn", waypoint(2)).reason
    assert of(verdict, "turn", waypoint(2)).limit_source == "none"


def fact(item: Finding, what: str) -> float:
    (found,) = [one.value for one in item.facts if one.what == what]
    return found


@pytest.mark.parametrize(("height", "ok"), [(-4.8, True), (-5.2, False), (8.0, True)])
def test_overshoot(setup: FlightSetup, height: float, ok: bool) -> None:
    """Told, and no fault; it shows a limit only where those of the aircraft are left out."""
    # Waypoint 1 turns right, so its outside is the left; 60 m after its arc, long before the next turn.
    after = float(waypoint_stations(setup)[1]) + bank_radius() * math.pi / 8 + 60.0
    track = fly_path(setup, across=bump(after, height, 25.0))
    item = of(judge(setup, track), "turn", waypoint(1))
    assert item.ok
    assert fact(item, "overshoot") == pytest.approx(max(0.0, -height), abs=0.1)
    # Stated once: as a measure, or as what is beyond the limit.
    told = [f"overshoot {max(0.0, -height):.1f} m" in item.reason, "overshoots its arc by 5.2 m" in item.reason]
    assert told == [ok, not ok]
    assert of(judge(setup, track, envelope=False), "turn", waypoint(1)).ok is ok
    requirements = route_requirements(setup)
    flown = align_track(requirements, track)
    assert flown is not None
    assert measure_turn(requirements, flown, 1).overshoot == pytest.approx(max(0.0, -height), abs=0.1)


def test_an_overshoot_within_the_arc_is_seen(setup: FlightSetup) -> None:
    middle = float(waypoint_stations(setup)[3])
    verdict = judge(setup, fly_path(setup, across=bump(middle, -8.0, 25.0)))
    assert of(verdict, "turn", waypoint(3)).ok
    assert "overshoots its arc by 8 m" in of(verdict, "turn", waypoint(3)).reason


@pytest.mark.parametrize(("offset", "ok"), [(0.9, True), (-0.9, True), (1.15, False), (-1.15, False)])
def test_a_turn_is_settled_before_the_next(setup: FlightSetup, offset: float, ok: bool) -> None:
    next_turn = float(waypoint_stations(setup)[2]) - bank_radius() * math.pi / 8
    track = fly_path(setup, across=bump(next_turn - 12.0, offset, 200.0))
    item = of(judge(setup, track), "turn", waypoint(1))
    assert item.ok
    assert fact(item, "settled") == pytest.approx(abs(offset), abs=0.05)
    assert of(judge(setup, track, envelope=False), "turn", waypoint(1)).ok is ok
    gusty = make_setup(ROUTE, wind={"turbulence": "moderate"})
    # A standard deviation of the gusts, 1.54 m/s, widens the arcs that are planned in them.
    wide = bank_radius(26.54)
    next_turn = float(waypoint_stations(gusty, wide)[2]) - wide * math.pi / 8
    track = fly_path(gusty, radius=wide, across=bump(next_turn - 12.0, offset, 200.0))
    assert of(judge(gusty, track, envelope=False), "turn", waypoint(1)).ok


def sidestep(aside: float) -> list[list[float]]:
    """Right angles to the right and back, this far apart, in a straight line of 2 km."""
    return [[0, 0, 300], [0, 1000, 300], [aside, 1000, 300], [aside, 2000, 300]]


@pytest.mark.parametrize(
    ("aside", "corridor", "ok"),
    # The straight way past both passes them by half the sidestep; a quarter of the corridor is near enough.
    [(5.0, 30.0, True), (14.9, 30.0, True), (15.2, 30.0, False), (39.5, 80.0, True), (40.5, 80.0, False)],
)
def test_a_jog_that_the_corridor_has_room_for(aside: float, corridor: float, ok: bool) -> None:
    setup = make_setup(sidestep(aside), limits={"corridor_m": corridor})
    verdict = judge_geometry(setup)
    assert [of(verdict, "turn", waypoint(k)).ok for k in (1, 2)] == [ok, ok]
    if ok:
        assert (
            "a negligible kink: a flyable path without this waypoint passes it at"
            in of(verdict, "turn", waypoint(1)).reason
        )


def test_a_corner_between_short_legs_is_no_jog_where_the_way_without_it_turns_as_sharply() -> None:
    # A hairpin 5 m wide: without either of its right angles the way turns back on itself at the other.
    setup = make_setup([[0, 0, 300], [0, 1000, 300], [5, 1000, 300], [5, 20, 300]])
    assert ("turn", waypoint(1)) in failing(judge_geometry(setup))


def test_short_legs_name_their_method() -> None:
    setup = make_setup(zigzag(40.0, 220.0))
    item = of(judge(setup, fly_path(setup)), "turn", waypoint(2))
    assert item.ok
    assert item.method == "course change over the turn"
    assert item.flown == pytest.approx(40.0, abs=0.5)


def test_the_margin_and_the_compared_value_are_those_of_the_planned_turn() -> None:
    """The aircraft swings through more than the turn's limit, but is judged by the turn that the mission asks for."""
    setup = make_setup(zigzag(40.0, 220.0), limits={"max_turn_deg": 41.0})
    track = fly_path(setup)
    stretched = replace(track, position=track.position * np.array([1.2, 1.0, 1.0]))
    item = of(judge(setup, stretched), "turn", waypoint(2))
    assert item.ok
    assert item.flown is not None
    assert item.flown > 41.5
    assert (item.value, item.margin) == (pytest.approx(40.0), pytest.approx(1.0))


def test_a_leg_that_the_autopilot_left_at_once_is_the_reason_that_is_given() -> None:
    """The leg of 40 m between two corners is active for a second, or not at all; or the flight ends before it."""
    short = make_setup(zigzag(60.0, 40.0))
    requirements, track = route_requirements(short), fly_path(short)
    start = len(track) // 2

    def why(seconds: float, last: int) -> str:
        leg = np.select([track.time < track.time[start], track.time < track.time[start] + seconds], [1, 2], last)
        return _unflown_turn_text(requirements, 2, TurnMeasure(), align_track(requirements, replace(track, leg=leg)))

    counts = "the leg is 40 m long, and a waypoint counts as reached within"
    assert f"{short.autopilot.title} flew leg 2 (to item 3) for only 1.0 s: {counts}" in why(1.0, 3)
    assert f"flew leg 2 (to item 3) for only 0.0 s: {counts}" in why(0.0, 3)
    assert why(0.0, 1) == "the flight did not get past it"


def test_straight_on_does_not_fail_for_a_neighbour_that_leaves_no_room() -> None:
    """15 m behind a corner of 66 degrees the way bends back by 0.01: no room is needed for that."""
    points, course = [[0.0, 0.0, 300.0], [0.0, 1200.0, 300.0]], 0.0
    for turn, run in ((66.0, 15.0), (-0.01, 1200.0)):
        course += math.radians(turn)
        east, north, up = points[-1]
        points.append([east + run * math.sin(course), north + run * math.cos(course), up])
    assert route_requirements(make_setup(points)).turn_limit[2] < 0.0
    findings = judge_geometry(make_setup(points))
    assert of(findings, "turn", waypoint(2)).ok is True
    assert of(findings, "turn", waypoint(1)).ok is False


def test_no_leg_is_to_be_more_than_ten_times_as_long() -> None:
    """A climb of 500 m on a leg of 150 m takes some 2 km, 14 times as much; one on a leg of 300 m is told so."""
    for run, told in ((150.0, False), (300.0, True)):
        points = [[0.0, 0.0, 300.0], [0.0, 1200.0, 300.0], [0.0, 1200.0 + run, 800.0], [0.0, 3000.0, 800.0]]
        item = of(judge_geometry(make_setup(points)), "slope", Place("leg", 1))
        assert item.ok is False
        assert any(change.what == "length" for changes in item.suggestions for change in changes) == told
