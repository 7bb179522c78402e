"""Fresh plans from the ground to the ground, looked at metre by metre: no way of theirs comes too near to anything.

Everything here is plain sums over points a metre apart, from the mission's items alone.  `scaled` has 30 planned in a
soak, and two otherwise.
"""

import math
from itertools import pairwise

import numpy as np
import pytest

from flight.mission.from_plan import plan_mission
from flight.mission.items import Command, Mission, MissionItem
from logs.verdict.judge_geometry import judge_geometry
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import FlightTask, fly_and_judge
from planfly.workflow.uav import Uav, load_uav
from tests.autopilots import need_arduplane
from tests.ground_missions import draw_field
from tests.soak import SOAK, note, scaled
from world.arrays import Floats
from world.frames import to_map
from world.scenario import Scenario


def metres(a: Floats, b: Floats) -> Floats:
    """Points of a straight line a metre apart, (n, 3)."""
    return np.linspace(a, b, 2 + int(math.dist(a[:2], b[:2])))


def above(scenario: Scenario, points: Floats) -> Floats:
    """Heights above ground, m."""
    assert scenario.terrain is not None
    return np.asarray(points[:, 2] - scenario.terrain.height(points[:, 0], points[:, 1]))


def outside(scenario: Scenario, points: Floats) -> float:
    """Least distance from the surface of a missile's sphere, m."""
    threats = scenario.threats
    away = [np.linalg.norm(points - place, axis=1).min() for place in threats.position]
    return min((float(a - r) for a, r in zip(away, threats.kill_radius, strict=True)), default=math.inf)


def heights_over_ground(scenario: Scenario, uav: Uav, course: float, amsl: float, speed: float) -> tuple[float, float]:
    """Steepest climb and descent over the ground on a course, m per m: the wind's triangle, by hand."""
    climb, dive = uav.limits.with_margin().envelope.air_angles(speed, amsl)
    east, north = scenario.wind.velocity_at(amsl)
    along, across = (
        east * math.sin(course) + north * math.cos(course),
        east * math.cos(course) - north * math.sin(course),
    )
    out = []
    for angle in (climb, dive):
        level = speed * math.cos(angle)
        out.append(speed * math.sin(angle) / (math.sqrt(level**2 - across**2) + along))
    return out[0], out[1]


def places(scenario: Scenario, items: list[MissionItem]) -> Floats:
    east, north = to_map(scenario.origin, [one.lat_deg for one in items], [one.lon_deg for one in items])
    return np.column_stack([east, north, [one.alt for one in items]])


def course_of(a: Floats, b: Floats) -> float:
    return math.atan2(b[0] - a[0], b[1] - a[1])


def check_climb(scenario: Scenario, uav: Uav, points: Floats, until: int) -> None:
    """From home to the plan's first waypoint: within 0.7 of the climb, and over the ground all the way."""
    assert scenario.terrain is not None
    ground = float(scenario.terrain.height(*points[0, :2]))
    up, least = ground, 0.7
    for k, (a, b) in enumerate(pairwise(points[: until + 1])):
        # ArduPlane commands equivalent airspeeds: the true one is higher up here.
        speed = uav.airspeed * uav.autopilot.speeds.true_airspeed_factor(float(b[2]))
        steepest, _ = heights_over_ground(scenario, uav, course_of(a, b), float(b[2]), speed)
        up = min(up + least * steepest * math.dist(a[:2], b[:2]), max(float(b[2]), points[0, 2]))
        assert up >= b[2] - 0.5, f"leg {k} is not climbed at {least} of the steepest"
    # The straight climb itself, from the ground: it passes over the ground, and outside every missile.
    first, run = points[1], math.dist(points[0, :2], points[1, :2])
    steepest, _ = heights_over_ground(scenario, uav, course_of(points[0], first), float(first[2]), uav.airspeed)
    line = metres(np.array([*points[0, :2], ground]), np.array([*first[:2], ground + 0.7 * steepest * run]))
    assert above(scenario, line)[60:].min() > 0.0
    assert outside(scenario, line) > 0.0


def check_landing(scenario: Scenario, uav: Uav, points: Floats, land: MissionItem, home: float) -> None:
    """Line-up, glide and go-around: on one course into the wind, over the ground, and no steeper than can be flown."""
    assert scenario.terrain is not None
    begin, last, point = points[-3:]
    course = course_of(last, point)
    assert course_of(begin, last) == pytest.approx(course, abs=1e-3)
    assert scenario.wind.components_on_course(course, float(point[2]))[0] <= 1e-6
    assert point[2] == pytest.approx(float(scenario.terrain.height(*point[:2])), abs=0.1)
    run, height = math.dist(last[:2], point[:2]), float(last[2] - point[2])
    assert begin[2] == pytest.approx(last[2], abs=1e-3)
    tail = scenario.wind.components_on_course(course, float(point[2]))[0]
    speed = uav.autopilot.ground.airspeed(uav.airspeed, tail, float(point[2]))
    _, steepest = heights_over_ground(scenario, uav, course, float(point[2]), speed)
    assert height / run < steepest
    assert above(scenario, metres(last, point))[: int(run) - 60].min() > 0.0
    climb, _ = heights_over_ground(scenario, uav, course, home + land.params[0], uav.airspeed)
    top = home + land.params[0]
    ahead = (top - point[2]) / (0.7 * climb)
    turned = np.array([point[0] + ahead * math.sin(course), point[1] + ahead * math.cos(course), top])
    assert above(scenario, metres(point, turned))[60:].min(initial=1.0) > 0.0
    assert above(scenario, metres(turned, begin)).min() > 20.0


def check_mission(scenario: Scenario, uav: Uav, mission: Mission) -> None:
    commands = [Command(one.command) for one in mission.items]
    assert commands[:2] == [Command.NAV_TAKEOFF, Command.DO_CHANGE_SPEED]
    assert commands[-4:] == [Command.DO_LAND_START, Command.NAV_WAYPOINT, Command.NAV_WAYPOINT, Command.NAV_LAND]
    points = places(scenario, [one for one in mission.items if one.frame == 0])
    assert mission.home is not None
    assert scenario.terrain is not None
    assert mission.home.alt == pytest.approx(float(scenario.terrain.height(*points[0, :2])), abs=0.1)
    start = int(np.argmin(np.linalg.norm(points - scenario.start, axis=1)))
    check_climb(scenario, uav, points, start)
    check_landing(scenario, uav, points, mission.items[-1], mission.home.alt)
    # What is flown between take-off and glide keeps the scenario's clearance, and keeps out of every missile's reach.
    for a, b in pairwise(points[:-1]):
        way = metres(a, b)
        assert above(scenario, way).min() >= scenario.limits.min_clearance_m - 0.1
        assert outside(scenario, way) > 0.0
    assert outside(scenario, metres(points[-2], points[-1])) > 0.0
    turns = [
        abs(math.remainder(course_of(b, c) - course_of(a, b), 2.0 * math.pi))
        for a, b, c in zip(points[:-2], points[1:-1], points[2:], strict=True)
    ]
    assert max(turns) < math.radians(150.0)


def test_no_way_of_a_fresh_plan_from_the_ground_meets_anything() -> None:
    # An ordinary run takes two that are planned at once.
    wanted, planned, first = scaled(30, 2), 0, 0 if SOAK else 9
    number = first
    while planned < wanted:
        scenario = draw_field(number)
        number += 1
        uav = load_uav(scenario)
        plan = make_plan(scenario, uav, 1)
        if not plan.safe:
            assert plan.certificate.problems
            continue
        mission = plan_mission(plan, uav.airspeed, uav.max_bank, tracking=uav.limits.tracking)
        check_mission(scenario, uav, mission)
        verdict = judge_geometry(make_setup(scenario, uav, mission, 1, plan=plan))
        assert verdict.flyable, verdict.headline
        planned += 1
    note("plans from the ground to the ground", planned=planned, drawn=number - first)
    # Or nearly all would be refused.
    assert number - first <= 2 * wanted


@pytest.mark.skipif(not SOAK, reason="minutes of plans and flights: in make soak")
@pytest.mark.parametrize("whose", ["law", "ArduPlane itself"])
@pytest.mark.parametrize(
    ("launch", "aircraft", "wanted"),
    [("catapult", "aerosonde", 30), ("hand", "zagi", 4), ("runway", "ultrastick25e", 5)],
)
def test_fresh_plans_do_no_harm(launch: str, aircraft: str, wanted: int, whose: str) -> None:
    """What harm is, is looked for row by row: no ground before the strip, no sphere, and at rest within the strip."""
    program = need_arduplane() if whose == "ArduPlane itself" else None
    planned, number, harmed, unflyable = 0, 0, [], []
    least = math.inf
    while planned < wanted:
        scenario = draw_field(number, launch, {"autopilot": "ardupilot", "aircraft": aircraft})
        number += 1
        uav = load_uav(scenario)
        plan = make_plan(scenario, uav, 1)
        if not plan.safe:
            continue
        planned += 1
        mission = plan_mission(plan, uav.airspeed, uav.max_bank, tracking=uav.limits.tracking)
        setup = make_setup(scenario, uav, mission, 1, plan=plan)
        flown = fly_and_judge(setup, FlightTask(reference="never", autopilot=program))
        harm, low = harm_of_flight(scenario, setup.route.positions[-1], flown.track.position)
        least = min(least, low)
        harmed += [f"{scenario.name}: {harm}"] if harm else []
        unflyable += [] if flown.verdict.flyable else [f"{scenario.name}: {flown.verdict.headline}"]
    note(
        f"plans from the ground to the ground by {launch}, flown by ArduPlane's law"
        if program is None
        else f"plans from the ground to the ground by {launch}, flown by ArduPlane itself",
        planned=planned,
        drawn=number,
        least_m=round(least, 1),
        harmed="; ".join(harmed),
        not_flyable="; ".join(unflyable),
    )
    assert not harmed
    # Most fields are too small or too low for what a light wing climbs.
    assert number <= (2 if aircraft == "aerosonde" else 8) * wanted


def harm_of_flight(scenario: Scenario, point: Floats, flown: Floats) -> tuple[str, float]:
    """What is wrong with a flown track (t, 3) m that lands at a point, "" for nothing; and how low it was before, m.

    Before: beyond 150 m from either end.  A glide of 5 degrees is 13 m over its point there, and the ground may rise.
    """
    flown = np.asarray(flown, dtype=np.float64)
    room, away = above(scenario, flown), np.hypot(*(flown[:, :2] - point[:2]).T)
    gone = np.hypot(*(flown[:, :2] - flown[0, :2]).T) > 150.0
    on_way = room[(away > 150.0) & (np.cumsum(gone) > 0)]
    faults = []
    if on_way.min(initial=math.inf) < 3.0:
        faults.append(f"{on_way.min():.1f} m above ground on its way")
    if room.min() < -0.5:
        faults.append("in the ground")
    if outside(scenario, flown) < 0.0:
        faults.append("inside a sphere")
    if not away[-1] < 100.0:
        faults.append(f"it ends {away[-1]:.0f} m from the landing point")
    return ", ".join(faults), float(on_way.min(initial=math.inf))
