"""The fly-by path: continuous in position, course, height and slope, and within the bank limit."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.autopilot import Autopilot
from flight.guidance.path import (
    NODE,
    PIECE,
    FlyByPath,
    Records,
    fly_by_path,
    mean_curvature,
    point_on_piece,
    profile_at,
    project,
    waypoint_records,
)
from flight.mission.route import Route, RouteRules, make_route, route_points
from flight.simulation.setup import FlightSetup
from tests.mission_lines import ORIGIN, mission, wp
from tests.sampled_paths import sample_path
from tests.setups import MakeSetup
from tests.soak import scaled
from world.arrays import Floats
from world.geometry import leg_runs, turning_angles
from world.kernels import Record, field_names

# All fields of a piece but where its leg changes, which may be nowhere.
FINITE = set(field_names(PIECE)) - {"leg_change"}
USUAL_ARDUPLANE = ArduPlane(ArduPilotParameters.defaults())
RADIUS = 25.0**2 / (9.80665 * math.tan(math.radians(30.0)))


def _path(setup: FlightSetup) -> FlyByPath:
    return fly_by_path(setup.route, setup.limits)


def test_a_first_leg_without_length_has_no_slope(make_setup: MakeSetup) -> None:
    """As of a circle to a height that the flight begins at."""
    limits = make_setup(np.array([[0.0, 0.0, 500.0], [0.0, 1000.0, 500.0]])).limits
    way = np.array([[0.0, 0.0, 500.0], [0.0, 0.0, 500.0], [0.0, 1000.0, 520.0], [1000.0, 1000.0, 520.0]])
    path = fly_by_path(Route(route_points(way, 25.0), ""), limits)
    assert path.length == pytest.approx(2000.0, abs=150.0)
    assert path.nodes["slope"][0] == pytest.approx(20.0 / 1000.0, rel=0.2)
    assert np.isfinite(path.nodes["altitude"]).all()


def _records(*lines: str, autopilot: Autopilot = USUAL_ARDUPLANE) -> Records:
    """The waypoint records of a mission, as an autopilot flies it."""
    made = mission(*lines)
    rules = RouteRules(autopilot.returns.rules, autopilot.loiters)
    return waypoint_records(make_route(made, ORIGIN, None, 25.0, False, rules=rules), made)


def _items_with(records: Records, name: str) -> set[int]:
    return set(records["item"][records[name] != 0].tolist())


def test_only_a_loiter_before_a_return_has_an_exit_bearing_that_of_0_north_0_east() -> None:
    """From 36.5° N 84.2° W that is atan2(84.2, -36.5 / cos 18.25°) = 114.5° (`Location::get_bearing_to`)."""
    loiters = wp(0, 2000, command=18, p="1 0 150 0"), wp(0, 4000)
    last = wp(3000, 4000, command=18, p="1 0 150 0")
    records = _records(wp(0, 0), *loiters, last, "2 20 0 0 0 0 0 0 0")
    assert _items_with(records, "exit_bearing") == {4}
    assert np.degrees(np.unique(records["exit_bearing"][records["item"] == 4])) == pytest.approx([114.5], abs=0.1)
    assert _items_with(_records(wp(0, 0), *loiters), "exit_bearing") == set()


def test_the_waypoints_of_a_missions_landing_are_marked() -> None:
    """`MissionBase::isLanding`: those after the first place behind DO_LAND_START; and the last before the landing."""
    land, start = wp(4000, 0, 0, command=21), "2 189 0 0 0 0 0 0 0"
    records = _records(wp(0, 0), start, wp(1000, 0), wp(2000, 0), wp(3000, 0), land)
    assert (_items_with(records, "ignores_altitude"), _items_with(records, "precedes_landing")) == ({4, 5}, {5})
    records = _records(wp(0, 0), wp(1000, 0), wp(2000, 0), land)
    assert (_items_with(records, "ignores_altitude"), _items_with(records, "precedes_landing")) == (set(), {3})
    loiter = wp(2000, 0, command=31, p="0 150 0 0")
    records = _records(wp(0, 0), start, wp(1000, 0), loiter, land)
    assert (_items_with(records, "ignores_altitude"), _items_with(records, "precedes_landing")) == (set(), {4})
    assert _items_with(_records(wp(0, 0), wp(1000, 0)), "precedes_landing") == set()


def _end(piece: Record) -> tuple[Floats, float]:
    """Position and course at the end of a piece."""
    return np.array(point_on_piece(piece, float(piece.length))), float(piece.course + piece.curvature * piece.length)


def _whole(path: FlyByPath, setup: FlightSetup, corners: int = 0) -> None:
    """Pieces follow one another without a gap, and without a corner but for so many."""
    points, kinks = setup.route.positions, 0
    first, last = path.pieces[0], path.pieces[-1]
    assert (first.east, first.north) == pytest.approx(points[0, :2])
    for one, two in itertools.pairwise(path.pieces):
        end, course = _end(one)
        assert end == pytest.approx([two.east, two.north], abs=1e-5)
        assert one.start + one.length == pytest.approx(two.start, abs=1e-5)
        kinks += abs(math.remainder(course - two.course, math.tau)) > 1e-6
    assert kinks == corners
    end, _ = _end(last)
    assert end == pytest.approx(points[-1, :2], abs=1e-5)
    assert last.start + last.length == pytest.approx(path.length)
    assert path.nodes[-1].distance == pytest.approx(path.length)
    legs = [piece.leg + (piece.start + piece.length > piece.leg_change) for piece in path.pieces]
    assert legs == sorted(legs)
    assert legs[-1] == setup.route.legs - 1


def _smooth_profile(path: FlyByPath) -> None:
    """Height and slope have no step."""
    nodes = path.nodes
    at = np.linspace(0.0, path.length, 1500)
    height, slope, _ = np.array([profile_at(nodes, float(s)) for s in at]).T
    step = at[1]
    slopes, half = nodes["slope"], nodes["half_length"]
    change = np.abs(np.diff(slopes, prepend=slopes[0]))
    blended = half > 0.0
    assert (change[~blended] < 1e-12).all()
    bend = max((change[blended] / (2 * half[blended])).max(initial=0.0), 1e-12)
    assert np.abs(slope).max() <= np.abs(slopes).max() + 1e-12
    assert np.abs(np.diff(slope)).max() <= bend * step + 1e-9
    # The trapezoid of the slopes gives the rise but for the parabolas' curvature.
    assert np.abs(np.diff(height) - step * 0.5 * (slope[1:] + slope[:-1])).max() <= bend * step**2 + 1e-9
    # No parabola extends beyond the next.
    assert (half[:-1] + half[1:] <= np.diff(nodes["distance"]) + 1e-9).all()


def test_a_right_angle_by_hand(make_setup: MakeSetup) -> None:
    setup = make_setup([[0, 0, 500], [0, 1000, 500], [1000, 1000, 500]])
    path = _path(setup)
    assert path.pieces["length"] == pytest.approx([1000 - RADIUS, RADIUS * math.pi / 2, 1000 - RADIUS])
    assert path.pieces["curvature"] == pytest.approx([0.0, 1 / RADIUS, 0.0])  # to the right
    assert path.pieces["leg"].tolist() == [0, 0, 1]
    assert path.pieces[1].leg_change == pytest.approx(path.pieces[1].start + RADIUS * math.pi / 4)
    _whole(path, setup)
    # Nearest to the corner on its bisector: R (1 / cos(theta / 2) - 1).
    away = np.linalg.norm(sample_path(path, 0.5)[:, :2] - [0, 1000], axis=1)
    assert away.min() == pytest.approx(RADIUS * (math.sqrt(2) - 1), abs=0.01)


@settings(deadline=None, max_examples=scaled(40, 20), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_route_with_long_legs_is_whole_smooth_and_at_the_bank_limit(make_setup: MakeSetup, data: Any) -> None:
    turns = data.draw(st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=5))
    points, course = [np.array([0.0, 0.0, 4000.0])], data.draw(st.floats(-3.0, 3.0))
    for turn in [0.0, *turns]:
        course += math.radians(turn)
        length, slope = data.draw(st.floats(1200.0, 3000.0)), data.draw(st.floats(-0.15, 0.15))
        points.append(points[-1] + length * np.array([math.sin(course), math.cos(course), slope]))
    wind = (data.draw(st.floats(0.0, 10.0)), data.draw(st.floats(0.0, 359.0)))
    setup = make_setup(points, wind=wind)
    path, limits = _path(setup), setup.limits
    _whole(path, setup)
    _smooth_profile(path)
    # The radius is at the bank limit, no smaller and no larger.
    arcs = path.pieces[path.pieces["curvature"] != 0.0]
    legs = np.diff(setup.route.positions[:, :2], axis=0)
    courses = np.arctan2(legs[:, 0], legs[:, 1])
    bent = turning_angles(setup.route.positions) >= 1e-6
    wanted = [
        limits.turn_radius(a, b, up)
        for a, b, up, is_bent in zip(courses, courses[1:], setup.route.positions[1:-1, 2], bent, strict=False)
        if is_bent
    ]
    assert 1 / np.abs(arcs["curvature"]) == pytest.approx(wanted, rel=1e-6)
    # The profile meets the ends, and each corner's height halfway on its arc but for the arc's own blend.
    assert profile_at(path.nodes, 0.0)[0] == pytest.approx(points[0][2])
    assert profile_at(path.nodes, path.length)[0] == pytest.approx(points[-1][2], abs=1e-6)


@settings(deadline=None, max_examples=scaled(40, 20), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(
        st.tuples(st.floats(-400.0, 400.0), st.floats(-400.0, 400.0), st.floats(450.0, 550.0)), min_size=3, max_size=7
    )
)
def test_any_route_on_short_legs_stays_whole(make_setup: MakeSetup, points: list[tuple[float, float, float]]) -> None:
    way = np.array(points)
    assume(leg_runs(way).min() >= 1.0)
    setup = make_setup(way)
    path = _path(setup)
    turns = turning_angles(way)
    drawn = int((path.pieces["curvature"] != 0.0).sum())
    _whole(path, setup, corners=int((turns > 1e-6).sum()) - drawn)
    _smooth_profile(path)
    # Only what is sharper than 150 degrees may stay a corner.
    assert drawn >= int(((turns > 1e-6) & (turns < math.radians(150.0))).sum())
    assert (np.abs(path.pieces["curvature"]) < np.inf).all()
    assert all(np.isfinite(path.pieces[name]).all() for name in FINITE)


def test_legs_too_short_share_their_length(make_setup: MakeSetup) -> None:
    setup = make_setup([[0, 0, 500], [0, 1000, 500], [100, 1000, 500], [100, 2000, 500]])
    path = _path(setup)
    _whole(path, setup)
    arcs = path.pieces[path.pieces["curvature"] != 0.0]
    assert 1 / np.abs(arcs["curvature"]) == pytest.approx([50.0, 50.0])
    # A gentle turn beside a sharp one keeps its share: tangents stand as the turns want them.
    uneven = make_setup([[0, 0, 500], [0, 1000, 500], [50, 1050, 500], [50, 2000, 500], [900, 2000, 500]])
    _whole(_path(uneven), uneven)


def test_collinear_u_turn_and_fly_over(make_setup: MakeSetup) -> None:
    straight = make_setup([[0, 0, 500], [0, 700, 550], [0, 2000, 500]])
    path = _path(straight)
    _whole(path, straight)
    assert len(path.pieces) == 2
    assert not path.pieces["curvature"].any()
    assert profile_at(path.nodes, 700.0)[0] == pytest.approx(550.0, abs=3.0)
    _smooth_profile(path)

    back = make_setup([[0, 0, 500], [0, 2000, 500], [0, 50, 500]])
    path = _path(back)
    assert path.pieces["length"].tolist() == [2000.0, 1950.0]
    _whole(path, back, corners=1)

    # Nearly a U-turn on legs too short for it: its corner stays, or the path would not come near the waypoint.
    nearly = make_setup([[0, 0, 500], [0, 2000, 500], [60, 0, 500]])
    path = _path(nearly)
    _whole(path, nearly, corners=1)
    # On longer legs it is an arc like any other: T = R tan(80 degrees) = 626 m.
    angle = math.radians(160.0)
    longer = make_setup([[0, 0, 500], [0, 2000, 500], [2000 * math.sin(angle), 2000 + 2000 * math.cos(angle), 500]])
    path = _path(longer)
    _whole(path, longer)
    assert 1 / path.pieces[1].curvature == pytest.approx(RADIUS)

    over = make_setup([[0, 0, 500], [0, 1000, 500], [1000, 1000, 500], [1000, 0, 500]], fly_over=[1])
    path = _path(over)
    assert path.pieces[0].length == 1000.0
    assert np.linalg.norm(sample_path(path, 1.0)[:, :2] - [0, 1000], axis=1).min() < 1e-9
    # Behind the waypoint 90 and 60 degrees to the right, and 60 back: cos 60 = (1 + cos 90) / 2.
    swing = [RADIUS * math.radians(angle) for angle in (75.0, 75.0, 60.0)]
    assert path.pieces["length"][1:4] == pytest.approx(swing)
    assert path.pieces["curvature"][1:4] == pytest.approx([1 / RADIUS, 1 / RADIUS, -1 / RADIUS])
    assert (path.pieces[4].east, path.pieces[4].north) == pytest.approx((RADIUS * (1.0 + math.sqrt(3.0)), 1000.0))
    _whole(path, over)
    # As the reference of an autopilot that turns by a law of its own, the corner stays sharp.
    sharp = fly_by_path(over.route, over.limits, fly_over_turn="none")
    assert sharp.pieces["length"][0] == 1000.0
    _whole(sharp, over, corners=1)


@pytest.mark.parametrize("turn_deg", [120.0, 165.0, 180.0, -135.0])
def test_a_sharp_corner_that_is_flown_over_swings_out_and_back(make_setup: MakeSetup, turn_deg: float) -> None:
    """Beyond the next leg it leads R (1 - cos turn)."""
    turn = math.radians(turn_deg)
    end = [2500.0 * math.sin(turn), 3000.0 + 2500.0 * math.cos(turn), 500.0]
    setup = make_setup([[0, 0, 500], [0, 3000, 500], end], fly_over=[1])
    path = _path(setup)
    _whole(path, setup)
    _smooth_profile(path)
    behind = sample_path(path, 1.0)[3000:, :2] - [0.0, 3000.0]
    beyond = -math.copysign(1.0, turn) * (behind @ [math.cos(turn), -math.sin(turn)])
    radius = setup.limits.turn_radius(0.0, turn, 500.0)
    assert beyond.max() == pytest.approx(radius * (1.0 - math.cos(turn)), abs=0.5)


def test_one_leg_and_a_leg_of_a_metre(make_setup: MakeSetup) -> None:
    setup = make_setup([[0, 0, 500], [300, 400, 520]])
    path = _path(setup)
    assert path.length == pytest.approx(500.0)
    assert sample_path(path, 7.0)[-1] == pytest.approx([300, 400, 520])
    short = make_setup([[0, 0, 500], [0, 1000, 500], [1, 1000, 501], [1, 2000, 500]])
    _whole(_path(short), short)
    _smooth_profile(_path(short))


def test_slope_blends_take_the_stated_acceleration(make_setup: MakeSetup) -> None:
    setup = make_setup([[0, 0, 500], [0, 2000, 500], [0, 4000, 700]])
    _, slope, bend = np.array([profile_at(_path(setup).nodes, float(s)) for s in np.arange(1900.0, 2100.0, 0.5)]).T
    assert np.abs(bend).max() * 25.0**2 == pytest.approx(1.0)  # m/s^2
    assert slope[0] == 0.0
    assert slope[-1] == pytest.approx(0.1)


def test_a_leg_that_the_wind_forbids_still_has_a_path(make_setup: MakeSetup) -> None:
    setup = make_setup([[0, 0, 500], [0, 1000, 500], [1000, 1000, 500]], wind=(30.0, 90.0))
    assert setup.limits.turn_radius(0.0, math.pi / 2, 500.0) == math.inf
    path = _path(setup)
    _whole(path, setup)
    assert all(np.isfinite(path.pieces[name]).all() for name in FINITE)


# ----------------------------------------------------------------------
# Projection on the path, its curvature over a window, and its height profile.


def _pieces(course: float, *curvatures: float) -> Records:
    """Pieces of 300 m, one after the other; all of them begin at one point, which curvature does not ask for."""
    rows = [(300.0 * k, 300.0, 120.0, -80.0, course, curvature, 0, math.inf) for k, curvature in enumerate(curvatures)]
    return np.array(rows, PIECE)


@given(
    st.floats(-7.0, 7.0),
    st.floats(-2.0, 4.5),
    st.floats(-90.0, 90.0),
    st.floats(100.0, 5000.0),
    st.sampled_from([-1, 0, 1]),
)
def test_projection_undoes_the_construction(
    course: float, share: float, aside: float, radius: float, side: int
) -> None:
    # A point `aside` to the right of that `along` on the piece; arcs up to 258 degrees, and a little before.
    piece = _pieces(course, side / radius)[0]
    along = share * radius if share > 0.0 else share * 0.5 * radius
    east, north = point_on_piece(piece, along)
    here = course + piece.curvature * along
    got = project(piece, east + aside * math.cos(here), north - aside * math.sin(here))
    assert got[0] == pytest.approx(along, abs=1e-6 * radius)
    assert got[1] == pytest.approx(aside, abs=1e-6)
    assert math.remainder(got[2] - here, math.tau) == pytest.approx(0.0, abs=1e-6)


def test_mean_curvature_of_a_window() -> None:
    pieces = _pieces(0.0, 0.0, 0.01, 0.0)
    for start, end, wanted in ((0.0, 100.0, 0.0), (250.0, 350.0, 0.005), (400.0, 500.0, 0.01), (550.0, 950.0, 0.00125)):
        assert mean_curvature(pieces, 0, start, end) == pytest.approx(wanted)
    assert mean_curvature(pieces, 2, 5000.0, 5100.0) == 0.0  # beyond the end


def test_profile_by_hand() -> None:
    # Level at 500 m, from 1000 m on with a slope of 0.1, its parabola 100 m to either side.
    nodes = np.array([(0.0, 500.0, 0.0, 0.0), (1000.0, 500.0, 0.1, 100.0), (2000.0, 600.0, 0.1, 0.0)], NODE)
    for s, wanted in (
        (-50.0, (500.0, 0.0, 0.0)),
        (899.0, (500.0, 0.0, 0.0)),
        (1000.0, (500.0 + 0.5 * 5e-4 * 100**2, 0.05, 5e-4)),
        (1101.0, (510.1, 0.1, 0.0)),
        (2500.0, (650.0, 0.1, 0.0)),
    ):
        assert profile_at(nodes, s) == pytest.approx(wanted, abs=1e-9)
