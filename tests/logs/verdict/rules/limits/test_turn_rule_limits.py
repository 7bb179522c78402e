"""Turns just inside and just outside each limit, their truth by plain sums."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures import turns
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.measures.turns import TurnMeasure, measure_turn
from logs.verdict.rules.turn_rule import turn_findings
from tests.logs.verdict.judging import ROUTE, judge, of, waypoint
from tests.logs.verdict.unsure_aircraft import with_guessed_bank
from tests.synthetic import bank_radius, bump, edited, fly_path, make_setup, waypoint_stations


def corner(turn_deg: float, run: float = 2000.0) -> list[list[float]]:
    turn = math.radians(turn_deg)
    return [[0, 0, 300], [0, run, 300], [run * math.sin(turn), run + run * math.cos(turn), 300]]


@pytest.mark.parametrize(("turn", "ok"), [(60.009, True), (60.011, False)])
def test_the_scenarios_angle_is_kept_to_a_hundredth_of_a_degree(turn: float, ok: bool) -> None:
    setup = make_setup(corner(turn), limits={"max_turn_deg": 60.0})
    assert of(judge_geometry(setup), "turn", waypoint(1)).ok is ok


@pytest.mark.parametrize(("run", "judged"), [(0.45, False), (0.55, True)])
def test_a_leg_of_half_a_metre_has_a_course(run: float, judged: bool) -> None:
    setup = make_setup([[0, 0, 300], [0, 1000, 300], [0, 1000 + run, 305], [0, 2000, 305]])
    assert (of(judge_geometry(setup), "turn", waypoint(1)).ok is not None) is judged


@pytest.mark.parametrize(("bank", "ok"), [(34.6, True), (35.4, False)])
def test_bank_held_for_a_second_may_be_five_degrees_beyond_the_limit(setup: FlightSetup, bank: float, ok: bool) -> None:
    track = fly_path(setup)
    attitude = track.attitude.copy()
    middle = float(waypoint_stations(setup)[1]) / 25.0
    attitude[np.abs(track.time - middle) < 1.0, 0] = math.radians(bank)
    verdict = judge(setup, edited(track, attitude=attitude), envelope=False)
    assert of(verdict, "turn", waypoint(1)).ok is ok


@pytest.mark.parametrize(
    ("turbulence", "sigma", "offset", "ok"),
    [
        ("light", 0.77, 1.42, True),
        ("light", 0.77, 1.62, False),
        ("moderate", 1.54, 1.92, True),
        ("moderate", 1.54, 2.12, False),
    ],
)
def test_gusts_may_keep_a_turn_from_settling(turbulence: str, sigma: float, offset: float, ok: bool) -> None:
    """1 m in calm air, 0.5 or 1 m more; sigma: the gusts' standard deviation (m/s), which widens the planned arcs."""
    gusty = make_setup(ROUTE, wind={"turbulence": turbulence})
    wide = bank_radius(25.0 + sigma)
    next_turn = float(waypoint_stations(gusty, wide)[2]) - wide * math.pi / 8
    track = fly_path(gusty, radius=wide, across=bump(next_turn - 12.0, offset, 200.0))
    assert of(judge(gusty, track, envelope=False), "turn", waypoint(1)).ok is ok


def judged(setup: FlightSetup, measure: TurnMeasure, monkeypatch: pytest.MonkeyPatch) -> Finding:
    """The finding of waypoint 1, however it was flown, by flown evidence alone."""
    requirements = route_requirements(setup, envelope=False)
    aligned = align_track(requirements, fly_path(setup))
    monkeypatch.setattr(turns, "measure_turn", lambda *_: measure)
    return turn_findings(requirements, aligned)[0]


@pytest.mark.parametrize(
    ("turbulence", "nav", "off", "tolerance"),
    [
        ("none", "perfect", 0.0, 0.6),
        ("light", "perfect", 0.77, 0.8),
        ("moderate", "perfect", 1.54, 1.0),
        # Three standard deviations of 1.5 m.
        ("none", "gnss", 0.0, 0.6 + 4.5),
    ],
)
def test_a_turn_may_pass_its_waypoint_a_little_closer_than_the_bank_limits_arc(
    turbulence: str, nav: str, off: float, tolerance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 120 degrees the arc passes at R (1 / cos 60 - 1) = R, and a hundredth of that counts as closer."""
    setup = replace(make_setup(corner(120.0), wind={"turbulence": turbulence}), nav=nav)
    radius = bank_radius(25.0 + off)
    least = radius - 0.01 * radius - tolerance
    for spare, ok in ((0.1, True), (-0.1, False)):
        measure = TurnMeasure(min_distance=least + spare, is_complete=True)
        assert judged(setup, measure, monkeypatch).ok is ok


@pytest.mark.parametrize(("radii", "said"), [(9.8, True), (10.2, False)])
def test_a_nearly_straight_flight_has_no_radius_to_tell(
    radii: float, said: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    measure = TurnMeasure(radius=radii * bank_radius(), is_complete=True)
    assert ("radius" in judged(make_setup(corner(60.0)), measure, monkeypatch).reason) is said


@pytest.mark.parametrize(("degrees", "ok"), [(60.15, True), (60.25, False)])
def test_a_flown_angle_is_beyond_the_limit_where_it_is_beyond_its_tolerance(
    degrees: float, ok: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = make_setup(corner(50.0), limits={"max_turn_deg": 60.0})
    measure = TurnMeasure(angle=math.radians(degrees), tolerance=math.radians(0.2), is_complete=True)
    assert judged(setup, measure, monkeypatch).ok is ok


@pytest.mark.parametrize(("circles", "ok"), [(0, True), (1, False)])
def test_no_full_circle_is_flown_at_a_corner(circles: int, ok: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    assert judged(make_setup(corner(60.0)), TurnMeasure(full_circles=circles, is_complete=True), monkeypatch).ok is ok


@pytest.mark.parametrize(("seconds", "seen"), [(9.0, True), (11.0, False)])
def test_a_turn_is_watched_for_ten_seconds_after_its_arc(seconds: float, seen: bool) -> None:
    """A right turn, and a metre to the left of the next leg that long after it."""
    setup = make_setup(corner(60.0))
    arc_ends = float(waypoint_stations(setup)[1]) + 0.5 * bank_radius() * math.radians(60.0)
    requirements = route_requirements(setup)
    aligned = align_track(requirements, fly_path(setup, across=bump(arc_ends + 25.0 * seconds, -1.0, 4.0)))
    assert aligned is not None
    overshoot = measure_turn(requirements, aligned, 1).overshoot
    assert overshoot == pytest.approx(1.0 if seen else 0.0, abs=0.1)


@pytest.mark.parametrize(("spare", "ok"), [(0.05, None), (-0.05, False)])
def test_a_guessed_bank_limit_leaves_turns_open_that_fit_with_60_degrees(spare: float, ok: bool | None) -> None:
    """A turn of 90 degrees between two legs as long as the radius at 60 degrees of bank."""
    length = bank_radius(bank_deg=60.0) + spare
    setup = make_setup([[0, 0, 300], [0, length, 300], [length, length, 300]])
    assert of(judge_geometry(setup), "turn", waypoint(1)).ok is False
    item = of(judge_geometry(with_guessed_bank(setup)), "turn", waypoint(1))
    assert (item.ok, item.check) == (ok, "unknown aircraft" if ok is None else "")
    assert "the aircraft's bank limit of 30° (a guess: state --bank)" in item.reason
    whats = [change.what for one in item.suggestions for change in one]
    assert ("stated bank" in whats) is (ok is None)
