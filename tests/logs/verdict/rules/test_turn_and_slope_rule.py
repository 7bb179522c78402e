"""The turn and slope rules on synthetic flights, passing and failing."""

import math

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track, join_tracks
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.track_alignment import lay_track
from logs.verdict.measures.turns import measure_turn
from tests.logs.verdict.judging import ROUTE, failing, judge, of
from tests.synthetic import (
    Profile,
    bank_radius,
    bump,
    copied,
    edited,
    fly_path,
    make_setup,
    waypoint_stations,
)


@pytest.fixture(scope="module")
def setup() -> FlightSetup:
    return make_setup(ROUTE)


@pytest.fixture(scope="module")
def track(setup: FlightSetup) -> Track:
    return fly_path(setup)


def zigzag(turn_deg: float, leg: float, legs: int = 4) -> list[list[float]]:
    points, course = [[0.0, 0.0, 300.0], [0.0, 1200.0, 300.0]], 0.0
    for k in range(legs):
        course += math.radians(turn_deg) * (-1) ** k
        run = leg if k + 1 < legs else 1200.0
        east, north, up = points[-1]
        points.append([east + run * math.sin(course), north + run * math.cos(course), up])
    return points


def test_the_aircraft_limits_a_turn_by_its_legs() -> None:
    # 131 m legs at 25 m/s and 30 degrees of bank: the design document's 61 degrees for a row of equal turns; where they
    # go to and fro, the roll from one bank into the other takes 10.5 m more.
    assert failing(judge_geometry(make_setup(zigzag(60.0, 139.0)))) == set()
    wrong = failing(judge_geometry(make_setup(zigzag(63.0, 131.0))))
    assert wrong == {("turn", f"waypoint {k}") for k in (1, 2, 3, 4)}
    assert of(judge_geometry(make_setup(zigzag(60.0, 139.0))), "turn", "waypoint 2").limit_source == "aircraft"


def test_only_the_greedy_one_of_two_turns_is_at_fault() -> None:
    # Waypoint 1 needs 29 m, waypoint 2 needs 190 m of the 200 m between them.
    points = np.array(zigzag(30.0, 200.0, 1))
    for turn, run in ((150.0, 1500.0),):
        course = math.radians(30.0 + turn)
        points[-1, :2] = points[1, :2] + 200.0 * np.array([math.sin(math.radians(30.0)), math.cos(math.radians(30.0))])
        step = run * np.array([math.sin(course), math.cos(course)])
        points = np.vstack([points, [*(points[-1, :2] + step), 300.0]])
    assert failing(judge_geometry(make_setup(points))) == {("turn", "waypoint 2")}


def test_the_scenario_limits_a_turn_if_it_is_tighter(setup: FlightSetup) -> None:
    tight = make_setup(ROUTE, limits={"max_turn_deg": 60.0})
    item = of(judge(tight, fly_path(tight)), "turn", "waypoint 3")
    assert (item.ok, item.limit, item.limit_source) == (False, 60.0, "scenario")
    assert item.margin == pytest.approx(60.0 - math.degrees(math.atan2(2000, 500)), abs=0.01)
    assert of(judge(tight, fly_path(tight)), "turn", "waypoint 1").ok


def test_a_planned_turn_beyond_the_aircraft_fails_however_it_was_flown() -> None:
    setup = make_setup(zigzag(70.0, 131.0))
    verdict = judge(setup, fly_path(setup, radius=80.0, rate=60.0))
    assert ("turn", "waypoint 2") in failing(verdict)
    assert "takes" in of(verdict, "turn", "waypoint 2").reason


def test_flown_evidence_alone_fails_a_turn() -> None:
    setup = make_setup(zigzag(70.0, 131.0))
    verdict = judge(setup, fly_path(setup, radius=80.0), envelope=False)
    # A radius of 80 m at 25 m/s is 38.5 degrees of bank.
    assert ("turn", "waypoint 2") in failing(verdict)
    assert "bank 38" in of(verdict, "turn", "waypoint 2").reason
    assert of(verdict, "turn", "waypoint 2").limit_source == "none"


@pytest.mark.parametrize(("height", "ok"), [(-3.0, True), (-12.0, False), (8.0, True)])
def test_overshoot(setup: FlightSetup, height: float, ok: bool) -> None:
    # Waypoint 1 turns right, so its outside is the left; 60 m after its arc, long before the next turn.
    after = float(waypoint_stations(setup)[1]) + bank_radius() * math.pi / 8 + 60.0
    track = fly_path(setup, across=bump(after, height, 25.0))
    item = of(judge(setup, track), "turn", "waypoint 1")
    assert item.ok is ok
    shape = route_demands(setup)
    flown = lay_track(shape, track)
    assert flown is not None
    assert measure_turn(shape, flown, 1).overshoot == pytest.approx(max(0.0, -height), abs=0.1)


def test_an_overshoot_within_the_arc_is_seen(setup: FlightSetup) -> None:
    middle = float(waypoint_stations(setup)[3])
    verdict = judge(setup, fly_path(setup, across=bump(middle, -8.0, 25.0)))
    assert "overshoots its arc by 8 m" in of(verdict, "turn", "waypoint 3").reason


@pytest.mark.parametrize(("offset", "ok"), [(0.6, True), (-0.6, True), (1.6, False), (-1.6, False)])
def test_a_turn_is_settled_before_the_next(setup: FlightSetup, offset: float, ok: bool) -> None:
    next_turn = float(waypoint_stations(setup)[2]) - bank_radius() * math.pi / 8
    track = fly_path(setup, across=bump(next_turn - 12.0, offset, 200.0))
    assert of(judge(setup, track), "turn", "waypoint 1").ok is ok
    gusty = make_setup(ROUTE, wind={"turbulence": "moderate"})
    # A standard deviation of the gusts, 1.54 m/s, widens the arcs that are planned in them.
    wide = bank_radius(26.54)
    next_turn = float(waypoint_stations(gusty, wide)[2]) - wide * math.pi / 8
    track = fly_path(gusty, radius=wide, across=bump(next_turn - 12.0, offset, 200.0))
    assert of(judge(gusty, track), "turn", "waypoint 1").ok


def test_a_circle_beside_a_leg_is_not_the_leg(setup: FlightSetup, track: Track) -> None:
    k = int(np.searchsorted(track.position[:, 1], 2600.0))
    columns = copied(track)
    ticks = int(2 * math.pi * 110.0 / 25.0 * 60.0)
    angle = np.linspace(0.0, 2 * math.pi, ticks, endpoint=False)
    circle = {name: np.repeat(column[k : k + 1], ticks, axis=0) for name, column in columns.items()}
    step = columns["position"][k + 1] - columns["position"][k]
    along = step / np.linalg.norm(step)
    right = np.array([along[1], -along[0], 0.0])
    circle["position"] = columns["position"][k] + 110.0 * (
        np.outer(np.sin(angle), along) + np.outer(1 - np.cos(angle), right)
    )
    circle["velocity"] = 25.0 * (np.outer(np.cos(angle), along) + np.outer(np.sin(angle), right))
    circle["time"] = columns["time"][k] + np.arange(ticks) / 60.0
    late = {name: column[k:].copy() for name, column in columns.items()}
    late["time"] += ticks / 60.0
    first = {name: column[:k] for name, column in columns.items()}
    looped = join_tracks([Track(**first), Track(**circle), Track(**late)])
    assert "left leg 1 by 220 m" in of(judge(setup, looped), "completion").reason


def test_short_legs_name_their_method() -> None:
    setup = make_setup(zigzag(40.0, 220.0))
    item = of(judge(setup, fly_path(setup)), "turn", "waypoint 2")
    assert item.ok
    assert item.method == "course change over the turn"
    assert item.flown == pytest.approx(40.0, abs=0.5)
    assert item.tolerance is not None
    assert item.tolerance >= 1.0


def test_fly_over_waypoints_are_flown_over(setup: FlightSetup, track: Track) -> None:
    over = make_setup(ROUTE, fly_over=(3,))
    # The fly-by cuts waypoint 3 by 30 m: good for a fly-by, a miss for a fly-over.
    assert ("waypoint", "waypoint 3") in failing(judge(over, track))
    assert of(judge(over, track), "waypoint", "waypoint 3").limit == pytest.approx(10.0)


# Slopes


def hill(slope_deg: float, run: float = 2000.0) -> list[list[float]]:
    top = 300.0 + run * math.tan(math.radians(slope_deg))
    return [[0, 0, 300], [0, 1000, 300], [0, 1000 + run, top], [0, 2500 + run, top]]


@pytest.mark.parametrize(("slope", "ok"), [(13.2, True), (14.2, False), (-7.3, True), (-8.3, False)])
def test_the_envelope_limits_a_slope(slope: float, ok: bool) -> None:
    setup = make_setup([[e, n, u + 400] for e, n, u in hill(slope)])
    for verdict in (judge(setup, fly_path(setup)), judge_geometry(setup)):
        item = of(verdict, "slope", "leg 1")
        assert item.ok is ok
        assert item.limit == pytest.approx(13.7 if slope > 0 else -7.8)
        assert item.limit_source == "aircraft"
        assert item.margin == pytest.approx(abs(item.limit or 0.0) - abs(slope), abs=0.1)


def test_a_steep_leg_is_explained() -> None:
    setup = make_setup(hill(18.3, 1400.0))
    verdict = judge(setup, fly_path(setup))
    assert verdict.summary.startswith("not flyable: slope on leg 1 (18.3° > 13.7°)")
    reason = of(verdict, "slope", "leg 1").reason
    assert reason.startswith("leg 1 climbs 18.3° for 1.4 km; at 25 m/s and 763 m the aircraft can 13.7° in calm air")


def test_wind_flattens_the_limit_and_is_named() -> None:
    # 10 m/s behind: tan = 25 sin 13.7 / (25 cos 13.7 + 10), 9.9 degrees; design document: about 10.0.
    setup = make_setup(hill(11.0), wind={"speed_mps": 10.0, "from_deg": 180.0})
    item = of(judge_geometry(setup), "slope", "leg 1")
    wanted = math.degrees(math.atan2(25 * math.sin(math.radians(13.7)), 25 * math.cos(math.radians(13.7)) + 10))
    assert item.limit == pytest.approx(wanted, abs=0.01)
    assert "13.7° in calm air but 9.8° in this 10 m/s tailwind" in item.reason
    assert not judge_geometry(make_setup(hill(14.0), wind={"speed_mps": 8.0, "from_deg": 0.0})).summary.count("slope")


def test_the_scenario_limits_a_slope_if_it_is_tighter() -> None:
    setup = make_setup(hill(9.0), limits={"max_climb_deg": 8.0})
    item = of(judge(setup, fly_path(setup)), "slope", "leg 1")
    assert (item.ok, item.limit, item.limit_source) == (False, 8.0, "scenario")


def test_a_steep_leg_flown_shallow_fails_both_ways() -> None:
    setup = make_setup(hill(12.0))
    lost = math.tan(math.radians(12.0)) - math.tan(math.radians(9.0))
    verdict = judge(setup, fly_path(setup, up=lambda s: -lost * np.clip(s - 1000.0, 0.0, 2000.0)), envelope=False)
    assert of(verdict, "slope", "leg 1").flown == pytest.approx(9.0, abs=0.05)
    assert ("slope", "leg 1") in failing(verdict)
    assert "instead of +12.0°" in of(verdict, "slope", "leg 1").reason


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
    assert (("slope", "leg 1") not in failing(judge(setup, track, envelope=False))) is ok


def test_speed_that_the_air_took_is_not_held_against_the_slope() -> None:
    setup = make_setup(hill(6.0))
    track = fly_path(setup, throttle=lambda s: 0.0 * s + 0.5, airspeed=lambda s: -2.0 * (s > 1400.0))
    wind = np.zeros((len(track), 3), dtype=np.float32)
    assert ("slope", "leg 1") in failing(judge(setup, edited(track, wind=wind), envelope=False))
    # Air that sinks at 1 m/s costs g w / V = 0.4 m/s each second.
    wind[:, 2] = -1.0
    assert ("slope", "leg 1") not in failing(judge(setup, edited(track, wind=wind), envelope=False))
    wind[:, 2] = 1.0
    assert ("slope", "leg 1") in failing(judge(setup, edited(track, wind=wind), envelope=False))


def test_a_wide_blend_between_steep_slopes_is_no_miss() -> None:
    # From falling to climbing in a 100 degree turn the fly-by path passes 20 m above the waypoint.
    setup = make_setup([[0, 0, 900], [0, 1500, 750], [1500, 1235, 980]])
    assert judge(setup, fly_path(setup)).flyable
    low = fly_path(setup, up=bump(float(waypoint_stations(setup)[1]), -25.0, 60.0))
    assert ("waypoint", "waypoint 1") in failing(judge(setup, low))


def test_a_short_leg_is_measured_over_four_seconds() -> None:
    setup = make_setup([[0, 0, 300], [0, 1000, 300], [0, 1150, 310], [0, 2500, 310]])
    item = of(judge(setup, fly_path(setup)), "slope", "leg 1")
    assert item.ok
    assert "short leg" in item.method
    assert item.flown == pytest.approx(math.degrees(math.atan2(10, 150)), abs=1.0)


def test_a_big_corner_in_a_steep_descent_is_steeper_than_its_legs() -> None:
    """-7 degrees on both legs fit the aircraft's -7.7; the arc of a 120 degree corner between them does not."""

    def corner(turn_deg: float, slope_deg: float) -> list[list[float]]:
        drop = -2000.0 * math.tan(math.radians(slope_deg))
        turn = math.radians(turn_deg)
        east, north = 2000.0 * math.sin(turn), 2000.0 + 2000.0 * math.cos(turn)
        return [[0.0, 0.0, 1500.0], [0.0, 2000.0, 1500.0 - drop], [east, north, 1500.0 - 2.0 * drop]]

    sharp = of(judge_geometry(make_setup(corner(120.0, -7.0))), "slope", "leg 0")
    assert sharp.ok is False
    assert "the arc at waypoint 1" in sharp.reason
    assert judge_geometry(make_setup(corner(30.0, -7.0))).flyable
    assert judge_geometry(make_setup(corner(120.0, -4.0))).flyable
