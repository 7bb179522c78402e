"""The slope rule on synthetic flights, passing and failing."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from aircraft.envelope import Envelope
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.rules.slope_rule import slope_findings
from tests.logs.verdict.judging import failing, judge, leg, of
from tests.mission_lines import setup_of, wp
from tests.synthetic import (
    Profile,
    bank_radius,
    edited,
    envelope,
    fly_path,
    make_setup,
)


def hill(slope_deg: float, run: float = 2000.0) -> list[list[float]]:
    top = 300.0 + run * math.tan(math.radians(slope_deg))
    return [[0, 0, 300], [0, 1000, 300], [0, 1000 + run, top], [0, 2500 + run, top]]


@pytest.mark.parametrize(("slope", "ok"), [(13.2, True), (14.2, False), (-7.3, True), (-8.3, False)])
def test_the_envelope_limits_a_slope(slope: float, ok: bool) -> None:
    setup = make_setup([[e, n, u + 400] for e, n, u in hill(slope)])
    for verdict in (judge(setup, fly_path(setup)), judge_geometry(setup)):
        item = of(verdict, "slope", leg(1))
        assert item.ok is ok
        assert item.limit == pytest.approx(13.7 if slope > 0 else -7.8)
        assert item.limit_source == "aircraft"
        assert item.margin == pytest.approx(abs(item.limit or 0.0) - abs(slope), abs=0.1)


def test_a_steep_leg_is_explained() -> None:
    setup = make_setup(hill(18.3, 1400.0))
    verdict = judge(setup, fly_path(setup))
    assert verdict.summary.startswith("not flyable: slope on leg 1, to item 2 (18.3° > 13.7°)")
    reason = of(verdict, "slope", leg(1)).reason
    assert reason.startswith(
        "leg 1 climbs at 18.3° for 1.4 km; the aircraft's limit is 13.7° at 25 m/s and 763 m AMSL, in calm air"
    )


def test_wind_flattens_the_limit_and_is_named() -> None:
    # 10 m/s behind: tan = 25 sin 13.7 / (25 cos 13.7 + 10), 9.9 degrees; design document: about 10.0.
    setup = make_setup(hill(11.0), wind={"speed_mps": 10.0, "from_deg": 180.0})
    item = of(judge_geometry(setup), "slope", leg(1))
    wanted = math.degrees(math.atan2(25 * math.sin(math.radians(13.7)), 25 * math.cos(math.radians(13.7)) + 10))
    assert item.limit == pytest.approx(wanted, abs=0.01)
    assert re.search(r"the aircraft's limit is 9\.8° at .*, with 10 m/s tailwind", item.reason)
    assert not judge_geometry(make_setup(hill(14.0), wind={"speed_mps": 8.0, "from_deg": 0.0})).summary.count("slope")


def test_the_scenario_limits_a_slope_if_it_is_tighter() -> None:
    setup = make_setup(hill(9.0), limits={"max_climb_deg": 8.0})
    item = of(judge(setup, fly_path(setup)), "slope", leg(1))
    assert (item.ok, item.limit, item.limit_source) == (False, 8.0, "scenario")


def test_a_steep_leg_flown_shallow_fails_both_ways() -> None:
    setup = make_setup(hill(12.0))
    lost = math.tan(math.radians(12.0)) - math.tan(math.radians(9.0))
    verdict = judge(setup, fly_path(setup, up=lambda s: -lost * np.clip(s - 1000.0, 0.0, 2000.0)), envelope=False)
    assert of(verdict, "slope", leg(1)).flown == pytest.approx(9.0, abs=0.05)
    assert ("slope", leg(1)) in failing(verdict)
    assert "instead of +12.0°" in of(verdict, "slope", leg(1)).reason


@pytest.mark.parametrize(
    ("pushed", "slowed", "run", "ok"),
    [
        (0.5, -2.0, 2000.0, False),
        (0.5, -0.5, 2000.0, True),
        (0.0, -2.0, 2000.0, True),
        (0.5, -2.0, 60.0, True),
        (-0.7, 2.0, 2000.0, False),
    ],
)
def test_saturated_throttle_with_the_speed_off(pushed: float, slowed: float, run: float, ok: bool) -> None:
    setup = make_setup(hill(6.0))

    def profile(value: float) -> Profile:
        return lambda s: value * ((s > 1400.0) & (s < 1400.0 + run))

    track = fly_path(setup, throttle=profile(pushed), airspeed=profile(slowed))
    assert (("slope", leg(1)) not in failing(judge(setup, track, envelope=False))) is ok


def test_speed_that_the_air_took_is_not_held_against_the_slope() -> None:
    setup = make_setup(hill(6.0))
    track = fly_path(setup, throttle=lambda s: 0.0 * s + 0.5, airspeed=lambda s: -2.0 * (s > 1400.0))
    wind = np.zeros((len(track), 3), dtype=np.float32)
    assert ("slope", leg(1)) in failing(judge(setup, edited(track, wind=wind), envelope=False))
    # Air that sinks at 1 m/s costs g w / V = 0.4 m/s each second.
    wind[:, 2] = -1.0
    assert ("slope", leg(1)) not in failing(judge(setup, edited(track, wind=wind), envelope=False))
    wind[:, 2] = 1.0
    assert ("slope", leg(1)) in failing(judge(setup, edited(track, wind=wind), envelope=False))


def test_a_short_leg_is_measured_over_four_seconds() -> None:
    setup = make_setup([[0, 0, 300], [0, 1000, 300], [0, 1150, 310], [0, 2500, 310]])
    item = of(judge(setup, fly_path(setup)), "slope", leg(1))
    assert item.ok
    assert "short leg" in item.method
    assert item.flown == pytest.approx(math.degrees(math.atan2(10, 150)), abs=1.0)


def test_a_leg_around_a_loiter_has_its_number_in_the_texts() -> None:
    """Two corners of the circle come before the steep leg: its index is not the number that people count."""
    circle = wp(0, 2500, command=18, p="1 0 200 0")
    setup = setup_of(wp(0, 500), circle, wp(2500, 2500), wp(2500, 3500, 600))
    found = [item for item in judge_geometry(setup).findings if item.rule == "slope" and item.ok is False]
    (steep,) = [item for item in found if item.place.to_item == 4]
    assert steep.place.number == 2
    assert steep.place.index is not None
    assert steep.place.index > 2
    assert steep.reason.startswith("leg 2 climbs at 26.6° for 1.0 km")


def test_a_big_corner_in_a_steep_descent_is_steeper_than_its_legs() -> None:
    """-7 degrees on both legs fit the aircraft's -7.7; the arc of a 120 degree corner between them does not."""

    def corner(turn_deg: float, slope_deg: float) -> list[list[float]]:
        drop = -2000.0 * math.tan(math.radians(slope_deg))
        turn = math.radians(turn_deg)
        east, north = 2000.0 * math.sin(turn), 2000.0 + 2000.0 * math.cos(turn)
        return [[0.0, 0.0, 1500.0], [0.0, 2000.0, 1500.0 - drop], [east, north, 1500.0 - 2.0 * drop]]

    sharp = of(judge_geometry(make_setup(corner(120.0, -7.0))), "slope", leg(0))
    assert sharp.ok is False
    assert "the arc at waypoint 1" in sharp.reason
    assert judge_geometry(make_setup(corner(30.0, -7.0))).flyable
    assert judge_geometry(make_setup(corner(120.0, -4.0))).flyable


def corner(turn_deg: float, slopes_deg: tuple[float, float]) -> np.ndarray:
    turn = math.radians(turn_deg)
    first, second = (2000.0 * math.tan(math.radians(slope)) for slope in slopes_deg)
    east, north = 2000.0 * math.sin(turn), 2000.0 + 2000.0 * math.cos(turn)
    return np.array([[0.0, 0.0, 1500.0], [0.0, 2000.0, 1500.0 + first], [east, north, 1500.0 + first + second]])


def test_a_headline_names_a_steep_leg_before_the_arc_that_it_makes_steep() -> None:
    """Leg 0 descends 6 degrees, which the aircraft can; the arc to leg 1, which descends 20 degrees, is too steep."""
    verdict = judge_geometry(make_setup(corner(60.0, (-6.0, -20.0))))
    assert of(verdict, "slope", leg(0)).brief == "the arc at waypoint 1"
    assert verdict.headline.startswith("not flyable: slope on leg 1, to item 2 (-20° < ")
    assert "slope on leg 0, to item 1 (the arc at waypoint 1)" in verdict.headline


def test_the_arc_and_both_legs_are_named() -> None:
    item = of(judge_geometry(make_setup(corner(120.0, (-7.0, -6.0)))), "slope", leg(0))
    turn = math.radians(120.0)
    tangent = bank_radius() * math.tan(0.5 * turn)
    # The heights at the arc's ends over its own length.
    steep = math.atan(tangent * (math.tan(math.radians(7.0)) + math.tan(math.radians(6.0))) / (bank_radius() * turn))
    length = bank_radius() * turn
    arc_slope = f"{math.degrees(steep):.1f}° for {length:.0f} m"
    asks = f"the arc at waypoint 1 (item 1) descends at {arc_slope}; the aircraft can fly at most"
    assert item.reason.startswith(asks)
    assert item.brief == "the arc at waypoint 1"
    assert "steeper than legs 0 and 1 (7.0° and 6.0°)" in item.reason
    missing = (math.tan(steep) - math.tan(math.radians(7.8))) * length
    assert f"the aircraft can fly at most 7.8° there, and would end {missing:.0f} m above the arc's end" in item.reason


def test_its_suggestion_passes() -> None:
    points = corner(120.0, (-7.0, -6.0))
    item = of(judge_geometry(make_setup(points)), "slope", leg(0))
    (suggestion,) = item.suggestions
    assert [change.place for change in suggestion] == [leg(0), leg(1)]
    for k, change in enumerate(suggestion):
        points[k + 1 :, 2] += change.wanted - (points[k + 1, 2] - points[k, 2])
    assert of(judge_geometry(make_setup(points)), "slope", leg(0)).ok is True


def test_a_narrower_envelope_is_not_the_scenario(setup: FlightSetup) -> None:
    weak = replace(setup, limits=replace(setup.limits, envelope=envelope(climb_deg=1.5)))
    item = of(judge(weak, fly_path(weak)), "slope", leg(1))
    assert (item.ok, item.limit_source) == (False, "aircraft")


def stairs(rise: float, run: float, count: int = 1, between: float = 5.0) -> np.ndarray:
    """Level, then so many steps of a rise over a run with level pieces between them, then level."""
    points = [[0.0, 0.0, 300.0], [0.0, 1500.0, 300.0]]
    for k in range(count):
        _, north, up = points[-1]
        points.append([0.0, north + run, up + rise])
        if k + 1 < count:
            points.append([0.0, north + run + between, up + rise])
    return np.array([*points, [0.0, points[-1][1] + 1500.0, points[-1][2]]])


@pytest.mark.parametrize(("rise", "ok"), [(6.0, True), (9.9, True), (-9.9, True), (10.1, False), (-10.1, False)])
def test_a_step_is_flown_within_its_own_height(rise: float, ok: bool) -> None:
    setup = make_setup(stairs(rise, 12.0))
    item = of(judge_geometry(setup), "slope", leg(1))
    assert item.ok is ok
    assert item.planned is not None
    assert abs(item.planned) > 25.0
    assert (f"a step of {abs(rise):.1f} m" in item.reason) is ok
    assert of(judge(setup, fly_path(setup)), "slope", leg(1)).ok is ok


@pytest.mark.parametrize(
    ("autopilot", "rise", "run", "slope"),
    [
        # 40 m down on the spot and 10 m down on a leg of 1 km: 50 m on 1 km.
        (ArduPlane(ArduPilotParameters.defaults()), -40.0, 1000.0, math.degrees(math.atan2(-50.0, 1000.0))),
        # 50 m on 350 m are 8.1 degrees, and 7.8 can be flown.
        (ArduPlane(ArduPilotParameters.defaults()), -40.0, 350.0, None),
        # 40 m up on the spot and 10 m down: without a flight open, because the aircraft is below the leg.
        (ArduPlane(ArduPilotParameters.defaults()), 40.0, 1000.0, math.degrees(math.atan2(30.0, 1000.0))),
        # 110 m on 350 m are 17 degrees.
        (ArduPlane(ArduPilotParameters.defaults()), 120.0, 350.0, None),
        # PX4 holds there outside NAV_FW_ALT_RAD.
        (Px4(Px4Parameters.defaults()).with_parameters(NAV_FW_ALT_RAD=39.0), -40.0, 1000.0, None),
        (Px4(Px4Parameters.defaults()).with_parameters(NAV_FW_ALT_RAD=41.0), -40.0, 1000.0, -2.8624),
        (PlanflyGuidance(), -40.0, 1000.0, None),
    ],
)
def test_a_vertical_leg_is_flown_on_the_next_leg(
    autopilot: Autopilot, rise: float, run: float, slope: float | None
) -> None:
    up = 300.0 + rise
    points = [[0, 0, 300], [0, 1000, 300], [0, 1000.1, up], [0, 1000.1 + run, up - 10.0], [0, 3000 + run, up - 10.0]]
    setup = replace(make_setup(points), autopilot=autopilot)
    for verdict, is_open in ((judge_geometry(setup), rise > 0.0), (judge(setup, fly_path(setup)), False)):
        item = of(verdict, "slope", leg(1))
        assert item.ok is (False if slope is None else None if is_open else True)
        vertical = math.copysign(math.degrees(math.atan2(abs(rise), 0.1)), rise)
        assert item.planned == pytest.approx(vertical if slope is None else slope, abs=0.01)
        if slope is not None:
            assert item.margin is not None
            # The margin is the distance to the limit, which is in the slope's direction.
            assert item.limit == pytest.approx(slope + math.copysign(item.margin, slope), abs=0.01)


def test_a_staircase_is_as_high_as_its_stairs_together() -> None:
    # Two steps of 6 m within 29 m climb 22 degrees; 200 m apart, 3 degrees.
    assert failing(judge_geometry(make_setup(stairs(6.0, 12.0, 2)))) == {("slope", leg(1)), ("slope", leg(3))}
    assert judge_geometry(make_setup(stairs(6.0, 12.0, 2, between=200.0))).flyable


@pytest.mark.parametrize(("high", "short"), [(10.4, False), (-9.6, True)])
def test_a_height_off_the_leg_is_told_and_no_fault(high: float, short: bool) -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [0, 4000, 300]])
    track = fly_path(setup, up=lambda s: high * np.exp(-0.5 * ((s - 3000.0) / 300.0) ** 2))
    item = of(judge(setup, track), "slope", leg(1))
    assert item.ok
    assert {fact.what: fact.value for fact in item.facts}["height error"] == pytest.approx(high, abs=0.01)
    # The error is stated once: with its side if it is beyond the 10 m that are looked for.
    told = [" m of the leg" in item.reason, " m above the leg" in item.reason]
    assert told == ([False, True] if high > 10.0 else [True, False])
    # Without the aircraft's limits it shows one: 10 m.
    assert of(judge(setup, track, envelope=False), "slope", leg(1)).ok is short


@pytest.mark.parametrize(("off", "ok"), [(0.55, True), (0.75, False)])
def test_a_slope_off_the_plan_is_told(off: float, ok: bool) -> None:
    """Half a degree, and 0.1 degrees of what a fit in calm air cannot resolve."""
    setup = make_setup(hill(6.0))
    lost = math.tan(math.radians(6.0)) - math.tan(math.radians(6.0 - off))
    track = fly_path(setup, up=lambda s: -lost * (np.clip(s - 1000.0, 0.0, 2000.0) - 1000.0))
    item = of(judge(setup, track), "slope", leg(1))
    assert item.ok
    assert {fact.what: fact.value for fact in item.facts}["slope error"] == pytest.approx(-off, abs=0.02)
    bare = of(judge(setup, track, envelope=False), "slope", leg(1))
    assert ("instead of" not in bare.reason) is ok


def test_throttle_at_a_limit_is_told() -> None:
    setup = make_setup(hill(6.0))

    def there(s: np.ndarray) -> np.ndarray:
        return (s > 1400.0) & (s < 2900.0)

    track = fly_path(setup, throttle=lambda s: 0.5 * there(s), airspeed=lambda s: -2.0 * there(s))
    item = of(judge(setup, track), "slope", leg(1))
    facts = {fact.what: fact.value for fact in item.facts}
    # 1,500 m at 23 m/s.
    assert facts["throttle at full"] == pytest.approx(1500.0 / 23.0, abs=0.5)
    assert facts["too slow"] == pytest.approx(2.0, abs=0.1)


def unsure(climb_sd: float = 3.0, descent_sd: float = 1.0) -> Envelope:
    """The synthetic aircraft, made from a data sheet: 13.7 degrees up and 7.8 down, give or take."""
    return replace(
        envelope(), source="a data sheet", climb_sd=math.radians(climb_sd), descent_sd=math.radians(descent_sd)
    )


def test_a_slope_within_what_is_not_known_is_undecided() -> None:
    # 13.7 less 1.645 x 3 is 8.8 degrees.
    setup = make_setup([[e, n, u + 400] for e, n, u in hill(10.0)], table=unsure())
    for verdict in (judge(setup, fly_path(setup)), judge_geometry(setup)):
        item = of(verdict, "slope", leg(1))
        assert (item.ok, item.check) == (None, "unknown aircraft")
        assert item.reason.startswith("climbs at 10.0°; the limit according to a data sheet is 13.7° ± 3.0°")
        # Over 20 s the gusts of 15 s average out, and the speed has settled for 15 of them.
        told = [(change.what, change.wanted, change.unit) for one in item.suggestions for change in one]
        assert told == [("full throttle", 20.0, "s")]
        assert (verdict.flyable, verdict.undecided, verdict.complete) == (False, True, True)
        assert verdict.headline == (
            "not judged in full: slope on leg 1 (to item 2) is too close to the limit to judge, because the"
            " aircraft's limits are uncertain; the aircraft's model is from a data sheet"
        )
        assert verdict.levels[0].undecided


def test_a_suggested_slope_follows_from_what_the_reason_says_of_the_data_sheet() -> None:
    """13.7 less 1.645 x 3 is 8.8 degrees; a suggestion stays 0.1 degrees below."""
    setup = make_setup([[e, n, u + 400] for e, n, u in hill(16.0)], table=unsure())
    item = of(judge_geometry(setup), "slope", leg(1))
    assert item.ok is False
    assert ", in calm air; with the uncertainty of a data sheet (± 3.0°) only 8.8° is certain" in item.reason
    certain = make_setup([[e, n, u + 400] for e, n, u in hill(16.0)])
    assert "certain" not in of(judge_geometry(certain), "slope", leg(1)).reason


def test_an_uncertain_slope_that_was_not_flown_is_undecided() -> None:
    setup = make_setup([[e, n, u + 400] for e, n, u in hill(10.0)], table=unsure())
    # The flight ends halfway along leg 0.
    item = of(judge(setup, fly_path(setup, stop=500.0)), "slope", leg(1))
    assert (item.ok, item.check, item.flown) == (None, "unknown aircraft", None)
    assert item.reason.endswith("the flight did not reach its end")
    # The flight reaches the last waypoint, but no row belongs to leg 1.
    requirements = route_requirements(setup)
    aligned = align_track(requirements, fly_path(setup))
    assert aligned is not None
    legs = np.where(aligned.track.leg == 1, 0, aligned.track.leg)
    item = slope_findings(requirements, replace(aligned, track=replace(aligned.track, leg=legs)))[1]
    assert (item.ok, item.check, item.method) == (None, "unknown aircraft", "not flown")
    assert item.reason.endswith("the leg was not flown to its end")


def test_what_is_sure_of_an_unsure_aircraft_is_judged() -> None:
    for slope, ok in ((8.0, True), (14.5, False), (-6.0, True), (-8.5, False)):
        setup = make_setup([[e, n, u + 400] for e, n, u in hill(slope)], table=unsure())
        verdict = judge_geometry(setup)
        assert of(verdict, "slope", leg(1)).ok is ok
        assert verdict.flyable is ok
        assert verdict.headline.endswith("; the aircraft's model is from a data sheet")
        assert not verdict.undecided


def test_a_guessed_climb_is_settled_by_stating_it_first() -> None:
    setup = make_setup([[e, n, u + 400] for e, n, u in hill(10.0)], table=replace(unsure(), climb_guessed=True))
    item = of(judge_geometry(setup), "slope", leg(1))
    assert [[change.what for change in one] for one in item.suggestions] == [["stated climb"], ["full throttle"]]
    assert item.suggestion.startswith("state the climb of the aircraft at full throttle: planfly aircraft --new")
    # A descent has no option.
    down = make_setup([[e, n, u + 400] for e, n, u in hill(-6.5)], table=replace(unsure(), climb_guessed=True))
    suggestions = of(judge_geometry(down), "slope", leg(1)).suggestions
    assert [change.what for one in suggestions for change in one] == ["no throttle"]


def test_a_scenarios_tighter_limit_does_not_make_the_aircraft_known() -> None:
    # 8.8 degrees are sure of 13.7; the scenario allows 11.
    for slope, ok in ((8.0, True), (10.0, None), (11.5, False)):
        way = [[e, n, u + 400] for e, n, u in hill(slope)]
        verdict = judge_geometry(make_setup(way, table=unsure(), limits={"max_climb_deg": 11.0}))
        item = of(verdict, "slope", leg(1))
        assert (item.ok, item.limit_source) == (ok, "scenario")
        assert item.limit == pytest.approx(11.0)
        assert item.check == ("unknown aircraft" if ok is None else "")
        assert verdict.undecided is (ok is None)
        if ok is None:
            # What the aircraft can, not what the scenario allows.
            assert "the limit according to a data sheet is 13.7° ± 3.0°" in item.reason


@pytest.mark.parametrize("from_deg", [0.0, 180.0])
def test_the_deviation_that_is_told_is_over_the_ground_as_the_limit_is(from_deg: float) -> None:
    """From tan g = V sin a / (V cos a + w), w = 10 m/s: the limit less 1.645 deviations is what is certain."""
    wind = {"speed_mps": 10.0, "from_deg": from_deg}
    tail = -10.0 * math.cos(math.radians(from_deg))

    def over_ground(air_deg: float) -> float:
        angle = math.radians(air_deg)
        return math.degrees(math.atan2(25.0 * math.sin(angle), 25.0 * math.cos(angle) + tail))

    limit, certain = over_ground(13.7), over_ground(13.7 - 1.645 * 3.0)
    slope = 0.5 * (limit + certain)
    setup = make_setup([[e, n, u + 400] for e, n, u in hill(slope)], table=unsure(), wind=wind)
    reason = of(judge_geometry(setup), "slope", leg(1)).reason
    assert f"is {limit:.1f}° ± {(limit - certain) / 1.645:.1f}°, so only {certain:.1f}° is certain" in reason


def test_the_deviation_that_is_told_is_the_aircrafts() -> None:
    # 13.7 less 1.645 x 9 is below 0, where what is sure stops; the deviation does not.
    setup = make_setup([[e, n, u + 400] for e, n, u in hill(10.0)], table=unsure(climb_sd=9.0))
    item = of(judge_geometry(setup), "slope", leg(1))
    assert item.ok is None
    assert "13.7° ± 9.0°" in item.reason


def test_a_glide_would_tell_of_a_descent() -> None:
    setup = make_setup([[e, n, u + 400] for e, n, u in hill(-6.5)], table=unsure())
    item = of(judge_geometry(setup), "slope", leg(1))
    assert item.ok is None
    assert [change.what for one in item.suggestions for change in one] == ["no throttle"]


def test_a_failure_comes_before_what_is_open() -> None:
    way = hill(10.0)
    high = [[e, n, u + 400] for e, n, u in way] + [[0, 5000, way[-1][2] + 400], [0, 5300, way[-1][2] + 900]]
    verdict = judge_geometry(make_setup(high, table=unsure()))
    assert verdict.headline.startswith("not flyable: slope on leg 4")
    assert not verdict.undecided


def test_what_is_sure_goes_with_the_wind() -> None:
    # 13.7 - 1.645 x 3 = 8.765 degrees to the air: in 10 m/s of headwind tan = 25 sin / (25 cos - 10), 14.5 degrees.
    air = math.radians(13.7 - 1.645 * 3.0)
    sure = math.degrees(math.atan2(25.0 * math.sin(air), 25.0 * math.cos(air) - 10.0))
    assert 14.4 < sure < 14.6
    for slope, ok in ((sure - 0.05, True), (sure + 0.05, None)):
        way = [[e, n, u + 400] for e, n, u in hill(slope)]
        setup = make_setup(way, table=unsure(), wind={"speed_mps": 10.0, "from_deg": 0.0})
        assert of(judge_geometry(setup), "slope", leg(1)).ok is ok


@pytest.mark.parametrize("slope", [14.5, -8.5])
def test_a_suggestion_passes_with_what_is_sure_of_an_unsure_aircraft(slope: float) -> None:
    """Within 13.7 less 1.645 x 3 degrees up, or 7.8 less 1.645 x 1 down: 8.8 and 6.2."""
    setup = make_setup([[e, n, u + 400] for e, n, u in hill(slope)], table=unsure())
    item = of(judge_geometry(setup), "slope", leg(1))
    [rise] = [change.wanted for one in item.suggestions for change in one if change.what == "rise"]
    assert abs(rise) <= 2000.0 * math.tan(math.radians(8.8 if slope > 0.0 else 6.2))
    gentle_slope = math.degrees(math.atan(rise / 2000.0))
    gentler = judge_geometry(make_setup([[e, n, u + 400] for e, n, u in hill(gentle_slope)], table=unsure()))
    assert of(gentler, "slope", leg(1)).ok
