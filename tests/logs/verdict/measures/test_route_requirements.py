"""The zones that a flight is judged by: the scenario's first, then its mission's fence."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from aircraft.path_limits import ROLL_TIME
from flight.mission.items import Command, Frame, MissionItem
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_requirements import (
    available_lengths,
    judged_airspace,
    route_requirements,
    slope_limit,
    steep_arc,
    turn_lengths,
    turn_limit,
    with_fence_zones,
)
from logs.verdict.places import Place
from planner.evaluation.certify_kernels import turn_and_roll_lengths
from planner.evaluation.problem import make_problem
from tests.logs.verdict.judging import ROUTE, leg, of, waypoint
from tests.synthetic import (
    CALM_CLIMB,
    CALM_DESCENT,
    bank_radius,
    make_scenario,
    make_setup,
)
from world.airspace.zones import Cylinder, Zone


def circle(seq: int, radius: float) -> MissionItem:
    params = (radius, 0.0, 0.0, 0.0)
    return MissionItem(seq, int(Command.NAV_FENCE_CIRCLE_INCLUSION), int(Frame.GLOBAL), params, 46.0, 8.0, 0.0)


def test_the_scenarios_zones_come_before_the_fences() -> None:
    setup = make_setup(ROUTE)
    mast = Zone("mast", "exclusion", Cylinder(0.0, 0.0, 9.0))
    setup = replace(setup, scenario=replace(setup.scenario, zones=(mast,)))
    setup = replace(setup, mission=replace(setup.mission, fences=(circle(0, 500.0),)))
    airspace = judged_airspace(setup)
    assert (len(airspace.zones), airspace.scenario_zone_count, airspace.fence_fault) == (2, 1, "")
    assert airspace.place(0) == Place("exclusion", 0, name="mast")
    assert airspace.place(1) == Place("inclusion", 1, name="fence item 0")
    assert float(airspace.records.zones[1].radius) == 500.0


def test_a_fence_that_is_none_is_named_and_left_out() -> None:
    setup = make_setup(ROUTE)
    setup = replace(setup, mission=replace(setup.mission, fences=(circle(3, -1.0),)))
    airspace = judged_airspace(setup)
    assert airspace.zones == ()
    assert airspace.fence_fault == "the mission: fence item 3: radius -1 m: must be above 0"


def test_what_draws_zones_has_the_fence_among_them() -> None:
    setup = make_setup(ROUTE)
    assert with_fence_zones(setup) is setup
    mast = Zone("mast", "exclusion", Cylinder(0.0, 0.0, 9.0))
    setup = replace(setup, scenario=replace(setup.scenario, zones=(mast,)))
    fenced = with_fence_zones(replace(setup, mission=replace(setup.mission, fences=(circle(0, 500.0),))))
    assert [zone.name for zone in fenced.scenario.zones] == ["mast", "fence item 0"]
    assert [zone.name for zone in setup.scenario.zones] == ["mast"]


# ----------------------------------------------------------------------
# A leg between a left and a right turn holds the roll from one bank into the other, for planner and verdict alike.


def zigzag(turn_deg: float, run: float, *, same_way: bool, course_deg: float = 20.0) -> np.ndarray:
    """Two turns of this angle with a leg of this length between them."""
    turn = math.radians(turn_deg)
    courses = math.radians(course_deg) + np.array([0.0, turn, 2.0 * turn if same_way else 0.0])
    steps = np.array([1500.0, run, 1500.0])[:, None] * np.stack([np.sin(courses), np.cos(courses), 0.0 * courses], 1)
    return np.array([0.0, 0.0, 500.0]) + np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def test_calm_the_roll_takes_the_bank_limit_over_the_rate() -> None:
    s_turn, same = (route_requirements(make_setup(zigzag(60.0, 300.0, same_way=way))) for way in (False, True))
    # 30 degrees into 30 degrees, less the 30 that any turn rolls in.
    assert s_turn.reversal[1] == pytest.approx(25.0 * ROLL_TIME * math.radians(30.0), rel=1e-6)
    assert same.reversal.tolist() == [0.0, 0.0, 0.0]
    # A waypoint that is flown over has no arc to roll out of.
    for over in ((1,), (2,), (1, 2)):
        flown_over = route_requirements(make_setup(zigzag(60.0, 300.0, same_way=False), fly_over=over))
        assert flown_over.reversal.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("turn", [30.0, 60.0, 90.0, 120.0])
@pytest.mark.parametrize("wind", [0.0, 10.0])
@pytest.mark.parametrize("same_way", [True, False])
def test_planner_and_check_need_the_same(turn: float, wind: float, same_way: bool) -> None:
    for from_deg in (20.0, 110.0, 245.0):
        points = zigzag(turn, 900.0, same_way=same_way)
        scenario = make_scenario(points, wind={"speed_mps": wind, "from_deg": from_deg})
        setup = make_setup(points, scenario=scenario)
        requirements = route_requirements(setup)
        needs, rolls = turn_and_roll_lengths(make_problem(scenario, setup.limits).certified, points)
        np.testing.assert_allclose(needs, requirements.length_after[:-1] + requirements.length_before[1:], atol=1e-6)
        np.testing.assert_allclose(rolls, requirements.reversal, atol=1e-6)
        assert (rolls.max() == 0.0) or not same_way


def test_a_leg_a_little_short_of_the_roll_fails_and_one_longer_passes() -> None:
    arcs = 2.0 * bank_radius() * math.tan(math.radians(30.0))
    roll = 25.0 * ROLL_TIME * math.radians(30.0)
    for spare, ok in ((-1.0, False), (1.0, True)):
        setup = make_setup(zigzag(60.0, arcs + roll + spare, same_way=False))
        assert of(judge_geometry(setup), "turn", waypoint(1)).ok is ok
    assert judge_geometry(make_setup(zigzag(60.0, arcs + 1.0, same_way=True))).flyable


@pytest.mark.parametrize("climb", [200.0, -200.0])
def test_the_roll_is_measured_at_the_lower_end_of_its_leg(climb: float) -> None:
    """Behind the leg the wind grows by 1 m/s each 50 m, from 4 m/s at the start's 500 m: 25 + 4 m/s, or 25 + 0."""
    points = zigzag(60.0, 900.0, same_way=False, course_deg=-60.0)
    points[2:, 2] += climb
    wind = {"speed_mps": 4.0, "from_deg": 180.0, "gradient": 0.02}
    requirements = route_requirements(make_setup(points, wind=wind))
    lower = 500.0 + min(0.0, climb)
    speed = 25.0 + 4.0 + 0.02 * (lower - 500.0)
    bank = [math.atan(speed**2 / (9.80665 * float(radius))) for radius in requirements.radius[1:3]]
    assert requirements.reversal[1] == pytest.approx(speed * ROLL_TIME * (sum(bank) - math.radians(30.0)), rel=1e-6)


@pytest.mark.parametrize(
    ("after", "before", "room"),
    [
        # What the neighbours leave of 400 and 300 m, less the rolls' 20 and 10 m.
        (100.0, 60.0, (280.0, 230.0)),
        # Half of a leg is left in any case.
        (250.0, 60.0, (180.0, 230.0)),
        (100.0, 290.0, (280.0, 140.0)),
        (math.inf, math.inf, (180.0, 140.0)),
    ],
)
def test_a_turn_may_use_what_its_neighbours_leave_of_its_legs(
    after: float, before: float, room: tuple[float, float]
) -> None:
    runs, reversal = np.array([400.0, 300.0]), np.array([20.0, 10.0])
    found = available_lengths(runs, np.array([0.0, 7.0, before]), np.array([after, 9.0, 0.0]), reversal, 1)
    assert found == pytest.approx(room)


@pytest.mark.parametrize(("first", "second"), [(90.0, 300.0), (300.0, 90.0)])
def test_the_sharpest_turn_fits_the_shorter_of_its_legs(first: float, second: float) -> None:
    """R tan(turn / 2) of 90 m."""
    requirements = route_requirements(make_setup([[0, 0, 300], [0, first, 300], [second, first, 300]]))
    assert requirements.turn_limit[1] == pytest.approx(2.0 * math.atan(90.0 / bank_radius()))


@pytest.mark.parametrize("run", [60.0, 150.0, 250.0])
def test_the_sharpest_turn_over_a_waypoint_takes_the_leg_after_it(run: float) -> None:
    """As long as the leg, and within a thousandth of it a little sharper does not fit."""
    requirements = route_requirements(make_setup([[0, 0, 300], [0, 50, 300], [run, 50, 300]], fly_over=(1,)))
    sharpest = float(requirements.turn_limit[1])
    assert turn_lengths(sharpest, bank_radius(), fly_over=True)[1] == pytest.approx(run, rel=1e-6)
    assert turn_lengths(1.001 * sharpest, bank_radius(), fly_over=True)[1] > run


def test_any_turn_over_a_waypoint_fits_a_long_leg() -> None:
    requirements = route_requirements(make_setup([[0, 0, 300], [0, 50, 300], [5000, 50, 300]], fly_over=(1,)))
    assert requirements.turn_limit[1] == math.pi


@pytest.mark.parametrize(("speeds", "fastest"), [([20.0, 30.0], 30.0), ([30.0, 20.0], 30.0)])
def test_a_turns_arc_is_that_of_its_faster_leg(speeds: list[float], fastest: float) -> None:
    requirements = route_requirements(make_setup([[0, 0, 300], [0, 1000, 300], [1000, 1000, 300]], speeds=speeds))
    assert requirements.radius[1] == pytest.approx(bank_radius(fastest))


# ----------------------------------------------------------------------
# What a route asks: turns with their arcs, legs with their limits, and the path that is planned along it.

RIGHT_ANGLE = [[0, 0, 300], [0, 2000, 300], [2000, 2000, 300]]


def test_a_right_angle_in_calm_air_has_the_bank_limits_arc() -> None:
    requirements = route_requirements(make_setup(RIGHT_ANGLE))
    radius = bank_radius()
    assert requirements.turns[1] == pytest.approx(math.pi / 2)
    assert requirements.radius[1] == requirements.min_radius[1] == pytest.approx(radius)
    assert requirements.length_before[1] == requirements.length_after[1] == pytest.approx(radius)
    assert requirements.fly_by_offset[1] == pytest.approx((math.sqrt(2.0) - 1.0) * radius)
    apex = requirements.apexes()[1]
    assert math.hypot(apex[0] - 0.0, apex[1] - 2000.0) == pytest.approx(float(requirements.fly_by_offset[1]))


def test_the_planned_path_passes_the_apexes_in_time() -> None:
    requirements = route_requirements(make_setup(RIGHT_ANGLE))
    path = requirements.path
    assert len(path.points) == len(path.times) == len(path.legs) + 1
    assert (np.diff(path.times) > 0.0).all()
    assert sorted(set(path.legs.tolist())) == [0, 1]
    # The arc is shorter than its two tangents.
    saved = (2.0 - math.pi / 2) * bank_radius()
    assert path.times[-1] == pytest.approx((4000.0 - saved) / 25.0, rel=1e-4)
    nearest = np.sqrt(((path.points - requirements.apexes()[1]) ** 2).sum(axis=1)).min()
    assert nearest < 10.0


def test_without_the_envelope_the_aircraft_limits_nothing() -> None:
    requirements = route_requirements(make_setup(RIGHT_ANGLE), envelope=False)
    for limits in (requirements.climb, requirements.dive, requirements.turn_limit):
        assert np.isinf(limits).all()


def test_a_leg_that_the_wind_leaves_no_way_along_has_no_ground_speed() -> None:
    requirements = route_requirements(make_setup(RIGHT_ANGLE, wind={"speed_mps": 30.0, "from_deg": 0.0}))
    assert np.isnan(requirements.ground_speed[0])
    assert np.isfinite(requirements.path.times).all()


def test_waypoints_are_places_with_their_items(setup: FlightSetup) -> None:
    items = setup.route.items.copy()
    items[1] = -1
    requirements = route_requirements(replace(setup, route=setup.route.with_fields(item=items)))
    assert [requirements.waypoint_place(k) for k in (1, 2)] == [Place("waypoint", 1), Place("waypoint", 2, item=2)]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_apex_lies_inside_its_corner_halfway_between_the_heights_at_its_arcs_ends(side: float) -> None:
    turn = math.radians(60.0)
    east, north = side * 2000.0 * math.sin(turn), 2000.0 + 2000.0 * math.cos(turn)
    setup = make_setup([[0, 0, 300], [0, 2000, 300 + 2000 * 0.10], [east, north, 300 + 2000 * 0.04]])
    tangent = bank_radius() * math.tan(0.5 * turn)
    inside = bank_radius() * (1.0 / math.cos(0.5 * turn) - 1.0)
    # The bisector of the corner's inside points 120 degrees to the right, or left, of north.
    toward = math.radians(120.0)
    apex = route_requirements(setup).apexes()[1]
    assert apex[:2] == pytest.approx([side * inside * math.sin(toward), 2000.0 + inside * math.cos(toward)], abs=1e-6)
    # The second leg falls by 0.06: 120 m in 2 km.
    ends = 500.0 - 0.10 * tangent, 500.0 - 0.06 * tangent
    assert apex[2] == pytest.approx(0.5 * sum(ends), abs=1e-6)


def test_an_apex_of_a_corner_without_room_has_the_slopes_of_its_shorter_leg() -> None:
    points = [[0, 0, 300], [0, 2000, 300], [40, 2000, 304], [40, 4000, 304]]
    apex = route_requirements(make_setup(points)).apexes()[1]
    assert apex[2] == pytest.approx(300.0 + 0.5 * 40.0 * 0.1, abs=1e-6)


@pytest.mark.parametrize("acceleration", [1.0, 3.0])
def test_a_slopes_blend_is_a_parabola_about_the_waypoint_or_about_each_end_of_its_arc(
    acceleration: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of v^2 / (2 a) times the change of slope, at the highest ground speed: 25 + 5 m/s."""
    monkeypatch.setattr("logs.verdict.measures.route_requirements.BLEND_ACCELERATION", acceleration)
    parabola = 30.0**2 / (2.0 * acceleration)
    wind = {"speed_mps": 5.0, "from_deg": 180.0}
    straight = make_setup([[0, 0, 300], [0, 2000, 380], [0, 4000, 340]], wind=wind)
    assert route_requirements(straight).blend.tolist() == pytest.approx([0.0, 0.06 * parabola, 0.0])
    # Both tangents, of 0.04 and -0.01, are joined by an arc that is shorter than they are.
    turning = make_setup([[0, 0, 300], [0, 2000, 380], [2000, 2000, 360]], wind=wind)
    requirements = route_requirements(turning)
    radius = float(requirements.radius[1])
    on_arc = (0.04 - 0.01) * radius / (radius * 0.5 * math.pi)
    assert requirements.blend[1] == pytest.approx(max(abs(on_arc - 0.04), abs(on_arc + 0.01)) * parabola)


def test_a_leg_names_the_item_that_it_leads_to_and_none_of_ours() -> None:
    setup = make_setup(RIGHT_ANGLE)
    # As after a jump back to item 4, and along a lead-out that no item asks for.
    items = np.array([4, 4, -1])
    requirements = route_requirements(replace(setup, route=setup.route.with_fields(item=items)))
    assert [(requirements.leg_place(k).index, requirements.leg_place(k).to_item) for k in range(2)] == [
        (0, 4),
        (1, None),
    ]
    assert [requirements.waypoint_place(k).item for k in range(3)] == [4, 4, None]


def test_limits_of_a_mission_without_a_scenario_are_not_the_scenarios() -> None:
    setup = make_setup(RIGHT_ANGLE)
    assert route_requirements(setup).limits_source == "scenario"
    alone = replace(setup, scenario=replace(setup.scenario, external=True))
    assert route_requirements(alone).limits_source == "default"


# ----------------------------------------------------------------------
# Of a fly-by arc too steep for the aircraft: its slope, and the limit on the mean of both legs' courses.

# Degrees of climb of both legs: each is within what the aircraft can there, the arc between them is not.
SLOPE = 10.5


def corner(turn_deg: float, slopes_deg: tuple[float, float]) -> np.ndarray:
    turn = math.radians(turn_deg)
    first, second = (2000.0 * math.tan(math.radians(slope)) for slope in slopes_deg)
    east, north = 2000.0 * math.sin(turn), 2000.0 + 2000.0 * math.cos(turn)
    return np.array([[0.0, 0.0, 1500.0], [0.0, 2000.0, 1500.0 + first], [east, north, 1500.0 + first + second]])


def limit_by_hand(course_deg: float, wind: float, from_deg: float) -> float:
    """Tangent of the steepest climb over the ground, at 25 m/s, of an aircraft that climbs 13.7 degrees in calm air."""
    level = 25.0 * math.cos(math.radians(CALM_CLIMB))
    off = math.radians(from_deg + 180.0 - course_deg)
    tail, cross = wind * math.cos(off), wind * math.sin(off)
    return 25.0 * math.sin(math.radians(CALM_CLIMB)) / (math.sqrt(level**2 - cross**2) + tail)


@pytest.mark.parametrize("from_deg", [180.0, 280.0])
def test_the_other_legs_limit_counts_too(from_deg: float) -> None:
    """With the wind behind on one leg and ahead on the other, half of the arc has either's limit."""
    setup = make_setup(corner(100.0, (SLOPE, SLOPE)), wind={"speed_mps": 9.0, "from_deg": from_deg})
    limits = [limit_by_hand(course, 9.0, from_deg) for course in (0.0, 100.0)]
    assert (limits[0] < limits[1]) is (from_deg == 180.0)
    item = of(judge_geometry(setup), "slope", leg(0))
    printed = re.search(r"the aircraft can fly at most ([\d.]+)° there", item.reason)
    assert printed is not None, item.reason
    assert abs(math.tan(math.radians(float(printed[1]))) - sum(limits) / 2.0) < 2e-3
    found = steep_arc(route_requirements(setup), 0)
    assert found is not None
    assert abs(found.limit - sum(limits) / 2.0) < 1e-4


@pytest.mark.parametrize(("speeds", "steep"), [([25.0, 25.0], True), ([25.0, 34.0], False), ([34.0, 25.0], False)])
def test_an_arc_beside_a_leg_that_cannot_climb_at_all_is_not_judged(speeds: list[float], steep: bool) -> None:
    """At 34 m/s the aircraft sinks at full throttle: the leg fails by its speed."""
    requirements = route_requirements(make_setup(corner(100.0, (11.0, 11.0)), speeds=speeds))
    assert (requirements.climb > 0.0).all() == (34.0 not in speeds)
    assert (steep_arc(requirements, 0) is not None) is steep


@pytest.mark.parametrize(("climb", "dive"), [(9.0, 6.0), (15.0, 9.0)])
def test_the_tighter_of_scenario_and_aircraft(climb: float, dive: float) -> None:
    """The aircraft has 13.7 degrees up and 7.8 down."""
    setup = make_setup(corner(20.0, (4.0, -4.0)), limits={"max_climb_deg": climb, "max_dive_deg": dive})
    requirements = route_requirements(setup)
    for number, (fixed, own) in enumerate(((climb, CALM_CLIMB), (dive, CALM_DESCENT))):
        limit, source = slope_limit(requirements, number)
        assert math.degrees(limit) == pytest.approx(min(fixed, own))
        assert source == ("scenario" if fixed < own else "aircraft")


@pytest.mark.parametrize(("fixed", "source"), [(70.0, "scenario"), (175.0, "aircraft")])
def test_the_tighter_turn(fixed: float, source: str) -> None:
    """Legs of 400 m hold an arc of R tan(turn / 2) = 400 m."""
    points = [[0, 0, 300], [0, 400, 300], [400, 400, 300]]
    requirements = route_requirements(make_setup(points, limits={"max_turn_deg": fixed}))
    own = 2.0 * math.degrees(math.atan(400.0 / bank_radius()))
    assert turn_limit(requirements, 1) == (pytest.approx(math.radians(min(fixed, own))), source)
    assert turn_limit(route_requirements(make_setup(points), envelope=False), 1) == (math.inf, "none")
