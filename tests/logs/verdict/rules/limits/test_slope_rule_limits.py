"""Slopes just inside and just outside each limit, their truth by plain sums."""

import math
from dataclasses import replace

import pytest

from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_requirements import route_requirements, steep_arc
from logs.verdict.measures.slopes import Ability, LegFit, SlopeMeasure
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.rules import slope_rule
from logs.verdict.rules.slope_rule import slope_findings
from tests.logs.verdict.judging import leg, of
from tests.synthetic import bank_radius, envelope, fly_path, make_setup


def hill(slope_deg: float, run: float = 2000.0) -> list[list[float]]:
    top = 500.0 + run * math.tan(math.radians(slope_deg))
    return [[0, 0, 500], [0, 1000, 500], [0, 1000 + run, top], [0, 2500 + run, top]]


@pytest.mark.parametrize(("slope", "ok"), [(8.009, True), (8.011, False), (-5.009, True), (-5.011, False)])
def test_the_scenarios_slope_is_kept_to_a_hundredth_of_a_degree(slope: float, ok: bool) -> None:
    setup = make_setup(hill(slope), limits={"max_climb_deg": 8.0, "max_dive_deg": 5.0})
    assert of(judge_geometry(setup), "slope", leg(1)).ok is ok


@pytest.mark.parametrize(("slope", "ok"), [(0.47, True), (0.53, False)])
def test_a_level_leg_at_a_speed_that_cannot_be_flown_fails_by_its_speed(slope: float, ok: bool) -> None:
    """At 34 m/s the aircraft sinks at full throttle; half a degree counts as level."""
    setup = make_setup(hill(slope), airspeed=34.0)
    verdict = judge_geometry(setup)
    assert of(verdict, "slope", leg(1)).ok is ok
    assert of(verdict, "speed", leg(1)).ok is False


@pytest.mark.parametrize(("wind", "calm"), [(0.45, True), (0.55, False)])
def test_half_a_metre_a_second_is_calm_air(wind: float, calm: bool) -> None:
    setup = make_setup(hill(16.0), wind={"speed_mps": wind, "from_deg": 180.0})
    reason = of(judge_geometry(setup), "slope", leg(1)).reason
    assert reason.endswith("in calm air") is calm


def judged(measure: SlopeMeasure, monkeypatch: pytest.MonkeyPatch, slope: float = 6.0, **world: object) -> Finding:
    """The finding of a climb, however it was flown, by flown evidence alone."""
    setup: FlightSetup = make_setup(hill(slope), **world)
    requirements = route_requirements(setup, envelope=False)
    aligned = align_track(requirements, fly_path(setup))
    monkeypatch.setattr(slope_rule, "measure_slope", lambda *_: measure)
    return slope_findings(requirements, aligned)[1]


@pytest.mark.parametrize(
    ("error", "short", "ok"),
    [(9.8, False, True), (-10.2, False, False), (10.2, True, True), (-14.8, True, True), (15.2, True, False)],
)
def test_a_height_is_ten_metres_off_or_fifteen_on_a_short_leg(
    error: float, short: bool, ok: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert judged(SlopeMeasure(height_error=error, is_short=short, is_finished=True), monkeypatch).ok is ok


@pytest.mark.parametrize(("off", "ok"), [(0.58, True), (0.62, False), (-0.58, True), (-0.62, False)])
def test_a_fitted_slope_is_half_a_degree_off_beside_its_tolerance(
    off: float, ok: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = LegFit(math.radians(6.0 + off), math.radians(0.1), 1500.0, is_fitted=True)
    assert judged(SlopeMeasure(slope=fit, is_finished=True), monkeypatch).ok is ok
    rough = LegFit(math.radians(6.0 + off), math.radians(0.1), 80.0, is_fitted=False)
    assert judged(SlopeMeasure(slope=rough, is_finished=True), monkeypatch).ok is True


@pytest.mark.parametrize(
    ("turbulence", "most"), [("none", 1.0), ("light", 1.0 + 0.15 * 7.7), ("moderate", 1.0 + 0.15 * 15.4)]
)
def test_speed_lost_at_full_throttle_is_a_metre_a_second_and_a_gust(
    turbulence: str, most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """W20 is 7.7 and 15.4 m/s (MIL-F-8785C); the gust along the track 0.15 of it."""
    for off, ok in ((most - 0.05, True), (most + 0.05, False)):
        slow = SlopeMeasure(full_throttle_time=6.0, speed_loss=off, is_finished=True)
        fast = SlopeMeasure(idle_throttle_time=6.0, speed_gain=off, is_finished=True)
        for measure in (slow, fast):
            assert judged(measure, monkeypatch, wind={"turbulence": turbulence}).ok is ok


@pytest.mark.parametrize(("seconds", "ok"), [(4.9, True), (5.1, False)])
def test_throttle_at_a_limit_counts_after_five_seconds(
    seconds: float, ok: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert judged(SlopeMeasure(full_throttle_time=seconds, speed_loss=2.0, is_finished=True), monkeypatch).ok is ok


@pytest.mark.parametrize(("short", "ok"), [(0.23, True), (0.27, False)])
def test_an_ability_may_fall_short_by_a_tenth_of_a_degree_and_three_standard_errors(
    short: float, ok: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = Ability(math.radians(6.0 - short), math.radians(0.05), 20.0)
    assert judged(SlopeMeasure(ability=shown, is_finished=True), monkeypatch).ok is ok


@pytest.mark.parametrize(("slope", "ok"), [(0.48, True), (0.52, False)])
def test_a_level_leg_asks_for_no_ability(slope: float, ok: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    weak = SlopeMeasure(ability=Ability(math.radians(-1.0), math.radians(0.05), 20.0), is_finished=True)
    assert judged(weak, monkeypatch, slope=slope).ok is ok


@pytest.mark.parametrize(("lost", "steep"), [(0.97, False), (1.03, True)])
def test_an_arc_may_take_a_metre_a_second_of_speed(lost: float, steep: bool) -> None:
    """A corner of 120 degrees: both tangents, 2 R tan 60, are joined by an arc of R 2 pi / 3, so much steeper.

    Of its height g dh / V is taken from the speed, as far as the aircraft cannot sink: 7.8 degrees.
    """
    turn, radius = math.radians(120.0), bank_radius()
    arc = radius * turn
    steeper = 2.0 * radius * math.tan(0.5 * turn) / arc
    slope = (lost * 25.0 / (9.80665 * arc) + math.tan(math.radians(7.8))) / steeper
    drop = 2000.0 * slope
    points = [
        [0.0, 0.0, 1500.0],
        [0.0, 2000.0, 1500.0 - drop],
        [2000.0 * math.sin(turn), 2000.0 + 2000.0 * math.cos(turn), 1500.0 - 2.0 * drop],
    ]
    assert (steep_arc(route_requirements(make_setup(points)), 0) is not None) is steep


@pytest.mark.parametrize(
    ("missing", "is_finished", "ok"),
    [(3.0, True, True), (3.0, False, False), (9.8, True, True), (10.2, True, False)],
)
def test_a_flown_arc_may_take_ten_metres_of_height(
    missing: float, is_finished: bool, ok: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By geometry all of them fail: 2.6 m are 1 m/s at 25 m/s.  The legs are within 7.8 degrees."""
    turn = math.radians(120.0)
    arc = bank_radius() * turn
    steeper = 2.0 * bank_radius() * math.tan(0.5 * turn) / arc
    drop = 2000.0 * (missing / arc + math.tan(math.radians(7.8))) / steeper
    points = [
        [0.0, 0.0, 1500.0],
        [0.0, 2000.0, 1500.0 - drop],
        [2000.0 * math.sin(turn), 2000.0 + 2000.0 * math.cos(turn), 1500.0 - 2.0 * drop],
    ]
    setup = make_setup(points)
    requirements = route_requirements(setup)
    assert slope_findings(requirements, None, geometric=True)[0].ok is False
    monkeypatch.setattr(slope_rule, "measure_slope", lambda *_: SlopeMeasure(is_finished=is_finished))
    item = slope_findings(requirements, align_track(requirements, fly_path(setup)))[0]
    assert item.ok is ok
    assert (f"the arc at waypoint 1 (item 1) misses its height by only {missing:.1f} m" in item.reason) is ok


@pytest.mark.parametrize(("slope", "ok"), [(8.71, True), (8.82, None), (-6.10, True), (-6.21, None)])
def test_a_slope_is_decided_up_to_1_645_deviations_from_the_limit(slope: float, ok: bool | None) -> None:
    """13.7 less 1.645 x 3 is 8.765 degrees of climb; 7.8 less 1.645 x 1 is 6.155 of descent."""
    table = replace(envelope(), source="a data sheet", climb_sd=math.radians(3.0), descent_sd=math.radians(1.0))
    assert of(judge_geometry(make_setup(hill(slope), table=table)), "slope", leg(1)).ok is ok
