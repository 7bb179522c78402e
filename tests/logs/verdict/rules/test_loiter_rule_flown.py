"""Loiters as they are flown, and which of a circle's findings are told: the worst of each rule, one of its corners."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding, make_finding
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack, align_track
from logs.verdict.places import Place
from logs.verdict.rules.loiter_rule import LoiterCircle, loiter_circles, merge_loiter_findings
from tests.logs.verdict.judging import judge, of
from tests.mission_lines import setup_of, wp
from tests.synthetic import fly_path

# Waypoints 2 km before and 2.5 km beside a loiter's middle.
MIDDLE = np.array([0.0, 2500.0])
# Where a flight goes wider, m along the path.
WIDER_FROM = 3500.0


def loiter(radius: float = 200.0, turns: int = 2) -> FlightSetup:
    return setup_of(wp(0, 500), wp(0, 2500, command=18, p=f"{turns} 0 {radius:g} 0"), wp(2500, 2500))


def laid(
    setup: FlightSetup, wider: float = 0.0, stop: float | None = None, begins: float = WIDER_FROM
) -> tuple[RouteRequirements, AlignedTrack, LoiterCircle]:
    """The setup's route and its flight, this much to the outside (m) from a distance along the path on (m)."""
    requirements = route_requirements(setup)
    side = math.copysign(1.0, requirements.turns[1])
    track = fly_path(
        setup,
        radius=[float(radius) for radius in requirements.radius[1:-1]],
        across=lambda s: -side * wider * (s > begins),
        stop=stop,
        rate=20.0,
    )
    aligned = align_track(requirements, track)
    assert aligned is not None
    (circle,) = loiter_circles(requirements)
    return requirements, aligned, circle


@pytest.mark.parametrize("radius", [200.0, -200.0, 120.0])
def test_a_circle_is_joined_and_left_on_tangents(radius: float) -> None:
    """Whole turns, and what the tangents from 2 km before and to 2.5 km beside it are apart."""
    (circle,) = loiter_circles(route_requirements(loiter(radius)))
    joined, left = math.asin(abs(radius) / 2000.0), math.asin(abs(radius) / 2500.0)
    # Clockwise it is left towards the east after a quarter of a turn more, the other way round after three.
    quarter = 0.25 if radius > 0.0 else 0.75
    assert circle.laps == pytest.approx(2.0 + quarter + (joined + left) / (2.0 * math.pi), abs=1e-4)
    assert circle.center == pytest.approx(MIDDLE, abs=0.01)
    assert circle.radius == abs(radius)


def test_two_circles_are_two() -> None:
    lines = (wp(0, 500), wp(0, 2500, command=18, p="1 0 200 0"), wp(1500, 2500, command=18, p="1 0 -150 0"))
    requirements = route_requirements(setup_of(*lines, wp(2500, 4500)))
    first, second = loiter_circles(requirements)
    assert (first.radius, second.radius, second.first) == (200.0, 150.0, first.last + 1)
    assert first.center == pytest.approx(MIDDLE, abs=0.02)
    assert second.center == pytest.approx([1500.0, 2500.0], abs=0.02)


@pytest.mark.parametrize("wider", [0.0, 5.0, -4.0])
def test_the_radius_as_flown_is_told(wider: float) -> None:
    """Some way around it the flight goes wider; it joins the circle on a tangent of 1,990 m."""
    setup = loiter()
    requirements, aligned, circle = laid(setup, wider)
    item = of(judge(setup, aligned.track), "loiter")
    way = 2.0 * math.pi * 200.0 * circle.laps
    share = (math.sqrt(2000.0**2 - 200.0**2) + way - WIDER_FROM) / way
    assert item.flown == pytest.approx(200.0 + share * wider, abs=0.05)
    assert item.planned == 200.0
    low, high = (float(word) for word in item.reason.split("flown at ")[1].split(" m")[0].split(" to "))
    assert low == pytest.approx(200.0 + min(wider, 0.0), abs=0.06)
    assert high == pytest.approx(200.0 + max(wider, 0.0), abs=0.06)
    # The item states 2 laps; the path to the next waypoint leads farther around the circle.
    assert f"2 laps planned ({circle.laps:.1f} laps from joining to leaving), with a radius of 200 m" in item.reason
    assert item.margin == pytest.approx(200.0 - float(requirements.min_radius[circle.first : circle.last + 1].max()))


@pytest.mark.parametrize(("mean", "told"), [(259.0, False), (261.0, True)])
def test_a_circle_flown_more_than_a_quarter_and_10_m_wider_is_told(mean: float, told: bool) -> None:
    """Of ArduPlane, which is on its circle once it flies around: 200 m may be flown with 260."""
    setup = replace(loiter(), autopilot=ArduPlane(ArduPilotParameters.defaults()))
    _, aligned, _ = laid(setup, mean - 200.0, begins=1000.0)
    item = of(judge(setup, aligned.track), "loiter")
    assert item.flown == pytest.approx(mean, abs=0.9)
    assert (f"flown with a mean radius of {mean:.0f} m; at most 260 m" in item.reason) is told


def finding(rule: str, place: Place, ok: bool | None, margin: float | None) -> Finding:
    return make_finding(rule, place, ok=ok, reason=f"{rule} {margin}", margin=margin)


@pytest.mark.parametrize(
    ("outcomes", "told"),
    [
        ([(True, 5.0), (True, 3.0), (True, 9.0)], 1),
        ([(True, 5.0), (None, 30.0), (True, 9.0)], 1),
        ([(None, -5.0), (None, 30.0), (False, -1.0)], 2),
        ([(False, -9.0), (False, -1.0), (None, -20.0)], 0),
        ([(True, -1.0), (True, 3.0), (True, None)], 0),
    ],
)
@pytest.mark.parametrize("rule", ["slope", "speed", "clearance", "corridor"])
def test_the_worst_of_a_circles_legs_is_told(
    rule: str, outcomes: list[tuple[bool | None, float | None]], told: int
) -> None:
    """A failed one before one that was not judged before a passed one; of these the least margin."""
    requirements = route_requirements(loiter())
    (circle,) = loiter_circles(requirements)
    legs = [Place("leg", circle.first + k) for k in (0, 2, circle.last - circle.first - 1)]
    mine = [finding(rule, place, *outcome) for place, outcome in zip(legs, outcomes, strict=True)]
    beside = [finding(rule, Place("leg", k), True, 0.0) for k in (circle.first - 1, circle.last)]
    other = finding("energy", Place("leg", circle.first), True, 0.0)
    folded = merge_loiter_findings(requirements, None, [*mine, *beside, other])
    reason = f"{mine[told].reason}; the worst of the circle's 3 legs"
    assert folded == (replace(mine[told], reason=reason), *beside, other)
    # One alone is as it was.
    assert merge_loiter_findings(requirements, None, [mine[0], *beside]) == (mine[0], *beside)


@pytest.mark.parametrize("outcomes", [(True, None, None), (None, True, None), (True, None, False)])
def test_legs_of_a_px4_loiter_that_were_not_flown_are_not_judged(outcomes: tuple[bool | None, ...]) -> None:
    """PX4 may leave the circle before its other legs; for ArduPlane, an unjudged leg comes before a passed one."""
    setup = loiter()
    by_px4 = replace(setup, autopilot=Px4(Px4Parameters.defaults()))
    requirements = route_requirements(by_px4)
    (circle,) = loiter_circles(requirements)
    legs = [Place("leg", circle.first + k) for k in range(3)]
    mine = [finding("slope", place, ok, 5.0) for place, ok in zip(legs, outcomes, strict=True)]
    merged = merge_loiter_findings(requirements, None, mine)
    assert [one.ok for one in merged] == [False not in outcomes]
    by_ardupilot = merge_loiter_findings(route_requirements(setup), None, mine)
    assert [one.ok for one in by_ardupilot] == [False if False in outcomes else None]


@pytest.mark.parametrize(
    ("outcomes", "ok"), [((True, True), True), ((True, None), None), ((False, None), False), ((None, None), None)]
)
def test_a_loiters_corners_are_one_finding(outcomes: tuple[bool | None, bool | None], ok: bool | None) -> None:
    setup = loiter()
    requirements, aligned, circle = laid(setup)
    corners = [requirements.waypoint_place(circle.first), requirements.waypoint_place(circle.last)]
    at = [finding("turn", corners[0], outcomes[0], 1.0), finding("waypoint", corners[1], outcomes[1], 1.0)]
    outside = finding("waypoint", requirements.waypoint_place(circle.last + 1), True, 1.0)
    (one, rest) = merge_loiter_findings(requirements, aligned, [at[0], outside, at[1]])
    assert rest is outside
    assert (one.rule, one.place, one.ok) == ("loiter", corners[0], ok)
    assert ("a part of the circle was not flown" in one.reason) is (ok is None)


@pytest.mark.parametrize(("missing", "ok"), [(0.47, True), (0.53, None)])
def test_half_a_lap_less_than_drawn_is_whole(missing: float, ok: bool | None) -> None:
    """Of ArduPlane, of which a corner was not judged: so much of a lap was flown outside the circle, at 280 m."""
    setup = replace(loiter(), autopilot=ArduPlane(ArduPilotParameters.defaults()))
    requirements, aligned, circle = laid(setup)
    offsets = aligned.track.position[:, :2] - circle.center
    first = int(aligned.rows[circle.first]) + 100
    turned = np.abs(np.unwrap(np.arctan2(*offsets.T)))
    is_out = (np.arange(len(offsets)) >= first) & (np.abs(turned - turned[first]) < missing * 2.0 * math.pi)
    position = aligned.track.position.copy()
    position[is_out, :2] = circle.center + 1.4 * offsets[is_out]
    flown = replace(aligned, track=replace(aligned.track, position=position))
    corner = requirements.waypoint_place(circle.first)
    (one,) = merge_loiter_findings(requirements, flown, [finding("turn", corner, None, 1.0)])
    assert one.ok is ok
    laps_text = one.reason.split(" laps flown at ")[0].split("; ")[-1]
    assert float(laps_text) == pytest.approx(circle.laps - missing, abs=0.08)
    assert ("a part of the circle was not flown" in one.reason) is (ok is None)


def test_corners_that_were_not_held_are_counted_and_the_worst_is_named() -> None:
    requirements, aligned, circle = laid(loiter())
    corners = [requirements.waypoint_place(k) for k in (circle.first, circle.first + 1, circle.last)]
    at = [finding("turn", corners[0], False, -1.0), finding("turn", corners[1], False, -3.0)]
    at += [finding("waypoint", corners[1], False, -2.0), finding("turn", corners[2], True, 5.0)]
    (one,) = merge_loiter_findings(requirements, aligned, at)
    count = circle.last - circle.first + 1
    assert one.ok is False
    assert one.reason.startswith(f"2 of {count} corners not held; the worst is waypoint 1 (item 2): turn -3.0")
    # Of the route alone the first is told.
    (planned,) = merge_loiter_findings(requirements, None, at)
    assert planned.reason.startswith(f"waypoint {circle.first} (item 2): turn -1.0")


def test_a_circle_that_was_left_early_has_no_radius() -> None:
    requirements, aligned, circle = laid(loiter(), stop=3000.0)
    corner = requirements.waypoint_place(circle.first)
    (one,) = merge_loiter_findings(requirements, aligned, [finding("turn", corner, None, None)])
    assert one.flown is None
    assert "flown at" not in one.reason


def test_a_circle_where_the_wind_leaves_no_way_around_says_so() -> None:
    setup = loiter()
    scenario = replace(setup.scenario, wind=replace(setup.scenario.wind, speed=30.0))
    requirements = route_requirements(
        replace(setup, scenario=scenario, limits=replace(setup.limits, wind=scenario.wind))
    )
    (circle,) = loiter_circles(requirements)
    (one,) = merge_loiter_findings(
        requirements, None, [finding("turn", requirements.waypoint_place(circle.first), True, 1.0)]
    )
    assert one.ok is False
    assert "at 25 m/s the circle cannot be flown" in one.reason


def test_a_flight_that_ends_in_a_loiter_says_nothing_against_the_loiter() -> None:
    """It ends 500 m after the circle, 1.3 km around, is joined: the next corner is not reached."""
    requirements, aligned, circle = laid(loiter(), stop=2500.0)
    corner = int(np.argmin(aligned.passed))
    assert circle.first < corner < circle.last
    found = [
        make_finding("waypoint", requirements.waypoint_place(k), ok=k < corner, reason="")
        for k in range(circle.first, corner + 1)
    ]
    (item,) = merge_loiter_findings(requirements, aligned, found)
    assert (item.rule, item.ok) == ("loiter", None)
    assert "the flight did not reach its end" in item.reason
