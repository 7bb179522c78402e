"""What the slope rule tells of a leg: climbs and dives by turns, their limits in wind, and throttle at a limit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from logs.verdict.findings import Finding
from logs.verdict.headline_phrases import excess_phrase
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.slopes import Ability, LegFit, SlopeMeasure
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.presentation import number_texts
from logs.verdict.rules import slope_rule
from logs.verdict.rules.slope_rule import slope_findings
from tests.logs.verdict.judging import leg, of
from tests.synthetic import fly_path, make_setup


def hill(slope_deg: float, run: float = 2000.0) -> list[list[float]]:
    top = 900.0 + run * math.tan(math.radians(slope_deg))
    return [[0, 0, 900], [0, 1000, 900], [0, 1000 + run, top], [0, 2500 + run, top]]


def judged(
    measure: SlopeMeasure,
    monkeypatch: pytest.MonkeyPatch,
    slope: float,
    *,
    envelope: bool = False,
    **world: object,
) -> Finding:
    """The finding of a leg of this slope (degrees) that is measured so."""
    setup = make_setup(hill(slope), **world)
    requirements = route_requirements(setup, envelope=envelope)
    monkeypatch.setattr(slope_rule, "measure_slope", lambda *_: measure)
    return slope_findings(requirements, align_track(requirements, fly_path(setup, rate=5.0)))[1]


@pytest.mark.parametrize(("seconds", "told"), [(0.9, False), (1.1, True)])
@pytest.mark.parametrize("limit", ["full", "idle"])
def test_throttle_at_a_limit_is_told_from_a_second_on(
    limit: str, seconds: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    measure = SlopeMeasure(**{f"{limit}_throttle_time": seconds}, is_finished=True)
    item = judged(measure, monkeypatch, 5.0, envelope=True)
    assert (f"{limit} throttle for 1 s" in item.reason) is told
    assert {fact.what: fact.value for fact in item.facts}[f"throttle at {limit}"] == seconds


@pytest.mark.parametrize(("planned", "limit"), [(7.9, 8.0), (-4.9, 5.0)])
@pytest.mark.parametrize(("beyond", "ok"), [(0.09, True), (0.11, False)])
def test_a_slope_as_flown_is_within_the_limit_of_its_own_direction(
    planned: float, limit: float, beyond: float, ok: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And a tenth of a degree that its fit may be off."""
    flown = math.copysign(limit + beyond, planned)
    fit = LegFit(math.radians(flown), math.radians(0.1), 1500.0, is_fitted=True)
    limits = {"max_climb_deg": 8.0, "max_dive_deg": 5.0}
    item = judged(SlopeMeasure(slope=fit, is_finished=True), monkeypatch, planned, limits=limits)
    assert item.ok is ok
    assert (item.flown, item.limit) == (pytest.approx(flown), math.copysign(limit, planned))
    if not ok:
        told = f"flown at {flown:+.1f}°, steeper than the limit of {limit:.1f}° with its tolerance of 0.1°"
        assert item.reason.startswith(told)
        assert item.margin == pytest.approx(-beyond)


@pytest.mark.parametrize("flown", [-5.3, -5.8])
def test_a_leg_that_is_planned_too_steeply_has_one_value_and_one_limit(
    flown: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """5.6 degrees of 5 are planned: the reason, the headline and the report's table compare them, also of a flight.

    Its fit may be off by half a degree, which is no tolerance of the plan.
    """
    fit = LegFit(math.radians(flown), math.radians(0.5), 1500.0, is_fitted=True)
    item = judged(SlopeMeasure(slope=fit, is_finished=True), monkeypatch, -5.6, limits={"max_dive_deg": 5.0})
    assert (item.ok, item.planned, item.flown) == (False, pytest.approx(-5.6), pytest.approx(flown))
    assert item.reason.startswith("leg 1 descends at 5.6° for 2.0 km; the scenario allows 5.0°")
    assert (item.value, item.effective_limit) == (pytest.approx(-5.6), pytest.approx(-5.01))
    assert excess_phrase("slope", item) == "slope on leg 1, to item 2 (-5.6° < -5.01°)"
    row = number_texts(item)
    assert (row.planned, row.limit, row.margin) == ("−5.60", "≥\u00a0−5.01", "−0.59")


@pytest.mark.parametrize(
    ("slope", "shown", "at", "ok"),
    [
        (5.0, 7.0, "full", True),  # slow at full throttle in a climb that it can exceed: sinking air
        (5.0, 5.2, "full", False),
        (5.0, 7.0, "idle", False),
        (-5.0, 7.0, "idle", True),
        (-5.0, 5.2, "idle", False),
        (-5.0, 7.0, "full", False),
    ],
)
def test_air_takes_speed_where_the_aircraft_showed_more_than_the_leg_asks(
    slope: float, shown: float, at: str, ok: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By more than three standard errors of a tenth of a degree, at the throttle limit of that direction."""
    ability = Ability(math.radians(shown), math.radians(0.1), 20.0)
    off = {"speed_loss": 2.0} if at == "full" else {"speed_gain": 2.0}
    measure = SlopeMeasure(**{f"{at}_throttle_time": 8.0}, **off, ability=ability, is_finished=True)
    item = judged(measure, monkeypatch, slope)
    assert item.ok is ok
    if not ok:
        way = "slow" if at == "full" else "fast"
        assert f"{at} throttle for 8 s and 2.0 m/s too {way}" in item.reason


@pytest.mark.parametrize(("slope", "what"), [(6.0, "full throttle: the aircraft can climb"), (-6.0, "")])
def test_an_ability_too_small_is_told_with_its_direction(
    slope: float, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = Ability(math.radians(4.0), math.radians(0.05), 20.0)
    for envelope in (True, False):
        item = judged(SlopeMeasure(ability=shown, is_finished=True), monkeypatch, slope, envelope=envelope)
        assert item.ok is False
        wanted = what or "idle throttle: the aircraft can sink"
        # The flown slope, which gusts and a gain of airspeed make steeper, stands next to it.
        air_text = "over the ground in the mean wind, without gusts, vertical wind or a change of airspeed"
        text = f"measured over 20 s at {wanted} at most 4.0° at 25 m/s here, {air_text}; the leg needs 6.0°"
        assert text in item.reason


@pytest.mark.parametrize(("shortfall", "limit", "ok"), [(2.0, 75.0, None), (1.5, 75.0, False), (2.0, 100.0, False)])
def test_a_climb_that_only_the_models_shortfall_lacks_is_undecided(
    shortfall: float, limit: float, ok: bool | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """6 degrees less the 4 that are shown are 2, of which the tolerance of the rule covers less than half."""
    shown = Ability(math.radians(4.0), math.radians(0.05), 20.0)
    monkeypatch.setattr(slope_rule, "measure_slope", lambda *_: SlopeMeasure(ability=shown, is_finished=True))
    setup = make_setup(hill(6.0))
    autopilot = ArduPlane(ArduPilotParameters.defaults()).with_parameters(THR_MAX=limit)
    envelope = replace(setup.envelope, source="a data sheet", climb_shortfall=math.radians(shortfall))
    setup = replace(setup, autopilot=autopilot, limits=replace(setup.limits, envelope=envelope))
    requirements = route_requirements(setup, envelope=True)
    item = slope_findings(requirements, align_track(requirements, fly_path(setup, rate=5.0)))[1]
    assert (item.ok, item.check) == (ok, "unknown aircraft" if ok is None else "")
    assert ("climbs 4.0° at THR_MAX 75 %, but up to 6.0° was stated for it" in item.reason) is (ok is None)


def test_what_the_leg_needs_is_said_once_after_all_that_is_too_little(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = Ability(math.radians(4.0), math.radians(0.05), 20.0)
    measure = SlopeMeasure(ability=shown, height_error=-20.0, is_finished=True)
    monkeypatch.setattr(slope_rule, "measure_slope", lambda *_: measure)
    autopilot = ArduPlane(ArduPilotParameters.defaults()).with_parameters(TECS_CLMB_MAX=2.0, AIRSPEED_MAX=30.0)
    setup = replace(make_setup(hill(6.0)), autopilot=autopilot)
    requirements = route_requirements(setup, envelope=True)
    reason = slope_findings(requirements, align_track(requirements, fly_path(setup, rate=5.0)))[1].reason
    assert "the aircraft can climb at most 4.0°" in reason
    assert "TECS_CLMB_MAX 2 m/s allows only a climb of 4.4° at 26.3 m/s; the leg needs 6.0°" in reason
    assert reason.count("the leg needs") == 1


def test_height_above_and_below_the_leg(monkeypatch: pytest.MonkeyPatch) -> None:
    for error, side in ((12.0, "above"), (-12.0, "below")):
        item = judged(SlopeMeasure(height_error=error, is_finished=True), monkeypatch, 3.0)
        assert f"12 m {side} the leg" in item.reason
        assert item.ok is False


def test_a_leg_not_flown_to_its_end_is_not_judged_unless_it_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert judged(SlopeMeasure(), monkeypatch, 3.0, envelope=True).ok is None
    assert judged(SlopeMeasure(), monkeypatch, 20.0, envelope=True).ok is False


@pytest.mark.parametrize(
    ("slope", "from_deg", "blows"),
    [
        (16.0, 180.0, "10 m/s tailwind"),
        (-9.0, 180.0, "10 m/s tailwind"),
        (25.0, 0.0, "10 m/s headwind"),
        (-15.0, 0.0, "10 m/s headwind"),
        (16.0, 270.0, "10 m/s crosswind"),
        # 10 sin 3 deg = 0.5234 and 10 sin 2 deg = 0.349 m/s of crosswind: the latter is calm air.
        (16.0, 183.0, "10.0 m/s tailwind and 0.5 m/s crosswind"),
        (16.0, 182.0, "10 m/s tailwind"),
        (16.0, 230.0, "6.4 m/s tailwind and 7.7 m/s crosswind"),
        (25.0, 50.0, "6.4 m/s headwind and 7.7 m/s crosswind"),
    ],
)
def test_the_wind_on_a_steep_leg_is_named_with_its_limit(slope: float, from_deg: float, blows: str) -> None:
    """tan = 25 sin c / (sqrt((25 cos c)^2 - cross^2) + tail), c the angle in calm air: 13.7 degrees up, 7.8 down."""
    setup = make_setup(hill(slope), wind={"speed_mps": 10.0, "from_deg": from_deg})
    item = of(judge_geometry(setup), "slope", leg(1))
    calm = math.radians(13.7 if slope > 0.0 else 7.8)
    tail, cross = -10.0 * math.cos(math.radians(from_deg)), 10.0 * math.sin(math.radians(from_deg))
    level = math.sqrt((25.0 * math.cos(calm)) ** 2 - cross**2) + tail
    limit = math.degrees(math.atan2(25.0 * math.sin(calm), level))
    assert abs(item.limit or 0.0) == pytest.approx(limit, abs=0.01)
    asks = (
        f"leg 1 {'climbs' if slope > 0.0 else 'descends'} at {abs(slope):.1f}° for 2.0 km; the aircraft's limit"
        f" is {limit:.1f}° at 25 m/s"
    )
    assert item.reason.startswith(asks)
    assert item.reason.endswith(f"with {blows}")


@pytest.mark.parametrize(("run", "said"), [(999.0, "for 999 m;"), (1000.0, "for 1.0 km;")])
def test_a_kilometre_is_said_in_kilometres(run: float, said: str) -> None:
    assert said in of(judge_geometry(make_setup(hill(20.0, run))), "slope", leg(1)).reason


def test_a_leg_straight_up_says_its_height() -> None:
    points = [[0, 0, 300], [0, 1500, 300], [0, 1500.45, 360], [0, 3000, 360]]
    reason = of(judge_geometry(make_setup(points)), "slope", leg(1)).reason
    assert reason.startswith("leg 1 climbs 60 m vertically")


@pytest.mark.parametrize(
    ("law", "limit", "throttle"),
    [
        (ArduPlane(ArduPilotParameters.defaults()).with_parameters(THR_MAX=75.0), "THR_MAX 75 %", 0.75),
        (
            Px4(Px4Parameters.defaults("1.17")).with_parameters(FW_THR_MAX=0.7, FW_AIRSPD_MAX=30.0),
            "FW_THR_MAX 0.7",
            0.7,
        ),
    ],
)
def test_the_autopilots_throttle_limit_is_named_where_it_limits_the_climb(
    law: Autopilot, limit: str, throttle: float
) -> None:
    setup = replace(make_setup(hill(5.0)), autopilot=law)
    requirements = route_requirements(setup, envelope=True)

    def flown(shortfall_deg: float, throttle: float) -> Finding:
        """The climb of 5 degrees, flown for 1500 m at a slope that falls short of it, at this throttle."""
        lost = math.tan(math.radians(5.0)) - math.tan(math.radians(5.0 - shortfall_deg))
        track = fly_path(
            setup,
            up=lambda s: -lost * np.clip(s - 1200.0, 0.0, 1500.0),
            throttle=lambda s: (throttle - 0.6) * ((s > 1200.0) & (s < 2700.0)),
            airspeed=lambda s: 0.5 * np.sin(s / 100.0),
        )
        return slope_findings(requirements, align_track(requirements, track))[1]

    short = flown(2.0, throttle)
    assert short.ok is False
    assert f"at {limit}: the aircraft can climb at most 3." in short.reason
    assert f"throttle at its limit {limit} for 60 s" in short.reason
    # Two hundredths below the limit the throttle shows nothing of it.
    assert flown(2.0, throttle - 0.02).ok
    assert flown(0.0, throttle).ok


def test_a_climb_into_a_wind_as_strong_as_the_airspeed_makes_no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 25 m/s, a climb at 13.7 degrees leaves 24.3 m/s forward; level flight has 0.2 m/s over the ground."""
    headwind = {"speed_mps": 24.8, "from_deg": 0.0}
    words = "no progress over the ground: 0.2 m/s in 24.8 m/s of headwind"
    verdict = judge_geometry(make_setup(hill(3.0), wind=headwind))
    item = of(verdict, "slope", leg(1))
    assert (item.ok, item.limit) == (False, 0.0)
    assert item.reason.startswith(f"{words}; leg 1 climbs at 3.0° for 2.0 km at 25 m/s")
    assert verdict.headline.startswith(f"not flyable: slope on leg 1, to item 2 ({words})")
    measure = SlopeMeasure(slope=LegFit(math.radians(2.0), 0.0, 900.0, is_fitted=True))
    assert f"flown at +2.0°, {words}" in judged(measure, monkeypatch, 0.0, envelope=True, wind=headwind).reason
    # 25 cos 13.7 = 24.29 m/s are as much as a headwind of 24.2 m/s leaves.
    assert "no progress" not in judge_geometry(make_setup(hill(3.0), wind=headwind | {"speed_mps": 24.2})).summary
    diagonal = {"speed_mps": 24.9, "from_deg": 10.0}
    slanting = of(judge_geometry(make_setup(hill(3.0), wind=diagonal)), "slope", leg(1))
    assert "no progress over the ground: 0.1 m/s in 24.5 m/s of headwind and 4.3 m/s of crosswind" in slanting.reason


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("law", "name"),
    [
        (ArduPlane(ArduPilotParameters.defaults()), "TECS_{}_MAX"),
        (Px4(Px4Parameters.defaults("1.17")), "FW_T_{}_R_SP"),
    ],
)
def test_the_autopilots_rate_limit_fails_a_leg_that_it_misses(law: Autopilot, name: str, sign: float) -> None:
    """Of 25 m/s EAS, 26.2 m/s true at 987 m AMSL and 26.0 at 813 m, 2 m/s are 4.4 degrees and 3 m/s are 6.6.

    The standard atmosphere's density there is 0.909 and 0.924 of that at sea level.
    """
    name, speed = name.format("CLMB" if sign > 0.0 else "SINK"), "26.2" if sign > 0.0 else "26.0"

    def judged_with(rate: float, lost: float) -> Finding:
        """The leg of 5 degrees, flown for 1500 m so that it ends this much (m) short."""
        autopilot = law.with_parameters(**{name: rate, "FW_AIRSPD_MAX" if "FW" in name else "AIRSPEED_MAX": 30.0})
        setup = replace(make_setup(hill(sign * 5.0)), autopilot=autopilot)
        track = fly_path(setup, up=lambda s: -sign * lost * np.clip((s - 1200.0) / 1500.0, 0.0, 1.0))
        requirements = route_requirements(setup, envelope=True)
        return slope_findings(requirements, align_track(requirements, track))[1]

    short = judged_with(2.0, 20.0)
    assert short.ok is False
    assert f"{name} 2 m/s allows only a {'climb' if sign > 0.0 else 'descent'} of 4.4° at {speed} m/s" in short.reason
    # The headline names the leg by the limit, before what the flight showed and the arc at its end.
    assert short.brief == f"{short.reason.partition('; the leg needs 5.0°')[0]}; the leg needs 5.0°"
    assert judged_with(2.0, 8.0).ok  # within 10 m of the leg
    assert judged_with(2.0, -20.0).ok  # it does not fall short of the leg
    assert judged_with(3.0, 20.0).ok  # the limit does not explain it
