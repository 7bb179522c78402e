"""Time and exposure inside missiles and radars, exact at any rate of rows."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.places import FLIGHT
from logs.verdict.rules.threat_rule import threat_findings
from tests.logs.verdict.judging import bare, failing, judge, missile, of, radar
from tests.synthetic import (
    bump,
    fly_path,
    make_setup,
)

MISSILE = {
    "name": "Alfa",
    "east_m": 300.0,
    "north_m": 1000.0,
    "amsl_m": 300.0,
    "kill_radius_m": 500.0,
    "kill_scale_m": 200.0,
    "detection_radius_m": 700.0,
    "detection_scale_m": 400.0,
}


@pytest.mark.parametrize("rate", [60.0, 30.0, 2.0])
def test_time_and_exposure_inside_a_threat_are_exact(rate: float) -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [0, 4000, 300]], threats=[MISSILE])
    verdict = judge(setup, fly_path(setup, rate=rate))
    item = of(verdict, "threat", missile("Alfa"))
    # A chord 300 m from the centre of a 500 m sphere is 800 m long.
    assert item.ok is False
    assert item.flown == pytest.approx(800.0 / 25.0, abs=1e-3)
    assert item.planned == pytest.approx(800.0 / 25.0, abs=1e-6)
    h, s = 300.0, 400.0
    exposure = 2 * (s / (2 * h**2 * (h**2 + s**2)) + math.atan(s / h) / (2 * h**3)) * 200.0**4 / 25.0
    assert f"weighted by distance: {exposure:.3g} s" in item.reason
    seen = of(verdict, "threat", radar("Alfa"))
    assert seen.ok is True
    assert seen.limit is None
    assert seen.flown == pytest.approx(2 * math.sqrt(700.0**2 - 300.0**2) / 25.0, abs=1e-3)
    assert "missile Alfa (32.0 s inside its range)" in verdict.summary


def test_threats_out_of_reach_give_one_finding() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300]], threats=[MISSILE | {"east_m": 1300.0}])
    items = [item for item in judge(setup, fly_path(setup)).findings if item.rule == "threat"]
    assert [(item.place, item.ok) for item in items] == [(FLIGHT, True)]
    assert (
        items[0].reason == "the missile sphere of the only threat is not entered; the nearest, Alfa, stays 800 m away"
    )
    spotter = {key: value for key, value in MISSILE.items() if "kill" not in key} | {"east_m": 1300.0}
    (item,) = (
        one
        for one in judge_geometry(make_setup([[0, 0, 300], [0, 2000, 300]], threats=[spotter])).findings
        if one.rule == "threat"
    )
    assert item.reason == "the only threat is a radar"


def test_a_flight_into_a_sphere_that_the_plan_avoids_fails() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300]], threats=[MISSILE | {"east_m": 510.0}])
    assert judge_geometry(setup).flyable
    verdict = judge(setup, fly_path(setup, across=bump(1000.0, 14.0, 60.0)))
    assert ("threat", missile("Alfa")) in failing(verdict)


@pytest.mark.parametrize(("nav", "away", "luck"), [("gnss", 4.4, True), ("gnss", 4.6, False), ("perfect", 0.4, False)])
def test_a_sphere_missed_by_less_than_navigation_may_be_off_is_luck(nav: Any, away: float, luck: bool) -> None:
    """Three standard deviations of 1.5 m."""
    made = make_setup([[0, 0, 300], [0, 2000, 300]], threats=[MISSILE | {"east_m": 500.0 + away}])
    setup = replace(made, nav=nav)
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        assert verdict.flyable
        assert (
            f"passes {away:.1f} m outside a missile's range, less than the navigation error" in verdict.headline
        ) is luck
        item = of(verdict, "threat", FLIGHT)
        facts = {fact.what: fact.value for fact in item.facts}
        assert facts["nearest"] == pytest.approx(away, abs=1e-3)
        assert facts.get("navigation error") == (4.5 if nav == "gnss" else None)
        assert f"the nearest, Alfa, stays {away:.1f} m away" in item.reason
        assert (f"or {away - 4.5:.1f} m after the navigation error of 4.5 m is subtracted" in item.reason) is (
            nav == "gnss"
        )


@pytest.mark.parametrize("planned", [0.48, -0.44])
def test_a_narrow_miss_is_warned_of_whether_the_plan_enters_the_sphere_or_not(planned: float) -> None:
    """The flight is displaced from the planned line by a constant distance, to 0.53 m outside."""
    made = make_setup([[0, 0, 300], [0, 2000, 300]], threats=[MISSILE | {"east_m": 500.0 + planned}])
    setup, away = replace(made, nav="gnss"), 0.53
    verdict = judge(setup, fly_path(setup, across=lambda along: np.full_like(along, planned - away)))
    assert verdict.flyable
    assert "passes 0.5 m outside a missile's range, less than the navigation error" in verdict.headline
    found = [item.nearest_distance for item in verdict.findings if item.rule == "threat" and item.place.kind != "radar"]
    # The sphere itself has a finding if the plan enters it.
    assert found == pytest.approx([away] * (1 if planned > 0.0 else 2), abs=1e-3)


def test_a_plan_inside_a_sphere_that_was_not_flown_is_not_judged() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300]], threats=[MISSILE])
    items = [item for item in threat_findings(route_requirements(setup), None) if item.place.kind != "radar"]
    assert [(bare(item.place), item.ok, item.nearest_distance) for item in items] == [(missile("Alfa"), None, None)]


@pytest.mark.parametrize(("aside", "ok"), [(499.9, False), (500.1, True)])
def test_a_sphere_is_as_large_as_it_is(aside: float, ok: bool) -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300]], threats=[MISSILE | {"east_m": aside}])
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        assert verdict.flyable is ok
