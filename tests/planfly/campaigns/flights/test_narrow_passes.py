"""Narrow passes, by plain sums: a missile beside a straight track, and findings with little room."""

from typing import Any

import pytest

from logs.verdict.findings import Finding, make_finding
from logs.verdict.places import Place
from planfly.campaigns.flights.narrow_passes import NarrowPass, narrow_passes
from tests.synthetic import fly_path, make_setup

MISSILE = {"name": "Alfa", "north_m": 1000.0, "amsl_m": 300.0, "kill_radius_m": 500.0, "kill_scale_m": 200.0}
LEG = Place("leg", 1)


def passed_beside(away: float, *findings: Finding) -> tuple[NarrowPass, ...]:
    """Of a straight track this far outside a missile's sphere, m."""
    setup = make_setup([[0, 0, 300], [0, 2000, 300]], threats=[MISSILE | {"east_m": 500.0 + away}])
    return narrow_passes(findings, setup.scenario, fly_path(setup))


@pytest.mark.parametrize(("away", "room"), [(2.5, 0.25), (9.9, 0.99)])
def test_a_missile_passed_within_ten_metres(away: float, room: float) -> None:
    ((rule, place, share),) = passed_beside(away)
    assert (rule, place) == ("threat", Place("missile", 0, name="Alfa"))
    assert share == pytest.approx(room, abs=1e-4)


def test_a_missile_further_off_or_entered_is_none() -> None:
    assert passed_beside(10.1) == ()
    entered = make_finding("threat", Place("missile", 0, name="Alfa"), ok=False, reason="", margin=-3.0)
    assert passed_beside(-5.0, entered) == ()


def finding(rule: str, margin: float | None, *, ok: bool | None = True, **other: Any) -> Finding:
    return make_finding(rule, LEG, ok=ok, reason="", margin=margin, **other)


@pytest.mark.parametrize(
    ("rule", "margin", "tolerance", "room"),
    [
        # A degree of slope, ten metres of clearance.
        ("slope", 0.25, 0.0, 0.25),
        ("slope", 0.99, None, 0.99),
        ("clearance", 2.5, None, 0.25),
        # The tolerance is room, too.
        ("slope", -0.25, 0.5, 0.25),
        # What passes beyond its limit.
        ("slope", -2.0, 0.5, 0.0),
    ],
)
def test_room_is_that_to_the_limit_with_its_tolerance(
    rule: str, margin: float, tolerance: float | None, room: float
) -> None:
    ((found, place, share),) = passed_beside(99.0, finding(rule, margin, tolerance=tolerance))
    assert (found, place, share) == (rule, LEG, pytest.approx(room))


@pytest.mark.parametrize(
    "wide",
    [
        finding("slope", 1.0),
        finding("slope", 0.9, tolerance=0.1),
        finding("clearance", 10.0),
        finding("slope", None),
        finding("slope", 0.2, ok=None),
        # A count, or a time, is no distance.
        finding("turn", 0.2),
    ],
)
def test_what_has_more_room_or_no_number_is_none(wide: Finding) -> None:
    assert passed_beside(99.0, wide) == ()


def test_of_several_checks_at_a_place_the_least_counts_and_one_that_fails_counts_for_all() -> None:
    two = [finding("slope", margin, check=check) for margin, check in ((0.3, "a"), (0.1, "b"))]
    assert passed_beside(99.0, *two) == (("slope", LEG, 0.1),)
    assert passed_beside(99.0, *reversed(two)) == (("slope", LEG, 0.1),)
    assert passed_beside(99.0, *two, finding("slope", -1.0, ok=False, check="c")) == ()
