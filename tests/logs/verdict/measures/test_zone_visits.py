"""Bounds of a part of a move beside a zone: no place between its ends is further beyond the limit than they say."""

import math

import numpy as np
import pytest

from logs.verdict.measures.path_moves import MOVE, move_point
from logs.verdict.measures.zone_visits import (
    PART,
    copy_move_part,
    depth_bounds,
    distances_outside_zone,
    max_violation_bound,
    path_zones,
    violation_depth,
)
from tests.soak import scaled
from tests.world.airspace.test_zone_kernels import star
from world.airspace.zone_kernels import ZoneRecords, zone_records
from world.airspace.zones import Cylinder, Polygon, Zone, ZoneLevel, make_polygon
from world.frames import POLYMAP
from world.kernels import Record, Records
from world.terrain import Terrain, make_flat_terrain, make_gridded_terrain

# ----------------------------------------------------------------------
# How a path meets a zone, by plain sums: depths, times, places of entry and exit, on lines and arcs, over slopes.

BOX = ((0.0, 0.0), (400.0, 0.0), (400.0, 200.0), (0.0, 200.0))


def move(
    east: float,
    north: float,
    up: float,
    *,
    course: float = 90.0,
    length: float = 0.0,
    lasts: float = 10.0,
    curvature: float = 0.0,
    climb: float = 0.0,
    bend: float = 0.0,
    time: float = 0.0,
    leg: int = 0,
) -> tuple[float, ...]:
    u, v = (math.sin(math.radians(course)), math.cos(math.radians(course))) if length else (0.0, 0.0)
    return (east, north, up, u, v, length, curvature, climb, bend, time, lasts, leg)


def visit(moves: list[tuple[float, ...]], zone: Zone, terrain: Terrain | None = None) -> Record:
    made: Records = np.array(moves, MOVE)
    return path_zones(made, zone_records([zone]), terrain)[0]


def box(kind: str = "exclusion", *, floor: ZoneLevel | None = None, ceiling: ZoneLevel | None = None) -> Zone:
    return Zone("box", "exclusion" if kind == "exclusion" else "inclusion", Polygon((BOX,)), floor, ceiling)


def slope(rise: float) -> Terrain:
    """Ground that rises this many m per m to the east, 0 m at east 0."""
    east, north = np.linspace(-2000.0, 2000.0, 41), np.linspace(-2000.0, 2000.0, 41)
    return make_gridded_terrain(np.tile(rise * east, (41, 1)), east, north, source="slope", sha256="", datum="")


@pytest.mark.parametrize("aside", [80.0, 20.0, 5.0, 0.5])
def test_a_way_through_a_box(aside: float) -> None:
    # 1,000 m to the east in 50 s: 300 m to the western edge, 400 m inside.
    found = visit([move(-300.0, aside, 100.0, length=1000.0, lasts=50.0)], box())
    assert found.depth == pytest.approx(min(aside, 100.0), abs=0.011)
    assert (found.entry_time, found.exit_time) == pytest.approx((15.0, 35.0), abs=1e-4)
    assert (found.entry_east, found.entry_north, found.exit_east) == pytest.approx((0.0, aside, 400.0), abs=2e-3)
    assert found.violation_time == pytest.approx(20.0, abs=1e-4)
    assert (found.entries, found.unknown) == (1, False)


@pytest.mark.parametrize("aside", [-0.05, -5.0, -300.0, 205.0])
def test_a_way_beside_a_box(aside: float) -> None:
    found = visit([move(-300.0, aside, 100.0, length=1000.0)], box())
    assert found.depth == pytest.approx(aside if aside < 0.0 else 200.0 - aside, abs=0.011)
    assert (found.entries, found.violation_time) == (0, 0.0)


def test_a_corner_that_is_cut_by_a_metre_of_way_is_found() -> None:
    # Across the corner at (0, 0) at 45 degrees, 0.5 m inside: a metre of a 2 km way.
    off = 0.5 * math.sqrt(0.5)
    away = 1000.0 * math.sqrt(0.5)
    found = visit([move(off - away, off + away, 100.0, course=135.0, length=2000.0, lasts=2000.0)], box())
    assert found.entries == 1
    assert found.violation_time == pytest.approx(1.0, abs=1e-3)
    # Deepest at half a metre from the corner along the diagonal: 0.35 m from either edge.
    assert found.depth == pytest.approx(off, abs=0.011)


def test_an_arc_between_its_chords_ends() -> None:
    # A quarter of a circle of 500 m about (0, 0), from its north to its east; a zone of 3 m at its middle, outside by
    # 1 m or reached by 1 m: the chord passes it at 146 m.
    radius, middle = 500.0, 500.0 * math.sqrt(0.5)
    arc = move(0.0, radius, 0.0, length=radius * math.pi / 2.0, curvature=1.0 / radius, lasts=100.0)
    for out, inside in ((4.0, False), (2.0, True)):
        place = middle * (radius + out) / radius
        found = visit([arc], Zone("post", "exclusion", Cylinder(place, place, 3.0)))
        assert found.depth == pytest.approx(3.0 - out, abs=0.011)
        assert (found.entries == 1) == inside
        assert found.at_time == pytest.approx(50.0, abs=0.5)


def test_a_blend_between_its_ends_heights() -> None:
    # A parabola from 100 m to 100 m that comes up to 125 m at its middle.
    hump = move(0.0, 100.0, 100.0, length=400.0, climb=100.0, bend=-100.0)
    for floor, depth in ((126.0, -1.0), (124.0, 1.0)):
        found = visit([hump], box(floor=ZoneLevel(floor, "amsl")))
        assert found.depth == pytest.approx(depth, abs=0.011)
        # 1 m below its top the parabola is 2/25 of its length wide, the square root of 1/25 on either side of it.
        assert found.violation_time == pytest.approx(2.0 if depth > 0.0 else 0.0, abs=1e-3)


def test_a_climb_that_begins_level_goes_through_a_band() -> None:
    # The height is 300 m by the square of the time's share: both ends are outside 100 m to 160 m, 30 m deep between.
    zone = box(floor=ZoneLevel(100.0, "amsl"), ceiling=ZoneLevel(160.0, "amsl"))
    found = visit([move(50.0, 100.0, 0.0, bend=300.0, lasts=30.0)], zone)
    assert found.depth == pytest.approx(30.0, abs=0.011)
    times = [30.0 * math.sqrt(up / 300.0) for up in (100.0, 160.0)]
    assert (found.entry_time, found.exit_time) == pytest.approx(times, abs=1e-4)


@pytest.mark.parametrize("kind", ["exclusion", "inclusion"])
def test_a_climb_through_a_band(kind: str) -> None:
    # 300 m up in 30 s, on the spot: 50 m from the nearest edge; the band is 100 m to 160 m.
    zone = box(kind, floor=ZoneLevel(100.0, "amsl"), ceiling=ZoneLevel(160.0, "amsl"))
    found = visit([move(50.0, 100.0, 0.0, climb=300.0, lasts=30.0)], zone)
    if kind == "exclusion":
        assert found.depth == pytest.approx(30.0, abs=0.011)
        assert (found.entry_time, found.exit_time, found.violation_time) == pytest.approx((10.0, 16.0, 6.0), abs=1e-3)
    else:
        assert found.depth == pytest.approx(140.0, abs=0.011)
        assert (found.entries, found.entry_time, found.exit_time) == (2, 0.0, 30.0)
        assert found.violation_time == pytest.approx(24.0, abs=1e-3)


def test_several_ways_out_of_an_inclusion() -> None:
    # East, 100 m beyond the box on both sides, and back, on two legs.
    there = move(-100.0, 100.0, 50.0, length=600.0, lasts=60.0)
    back = move(500.0, 100.0, 50.0, course=270.0, length=600.0, lasts=60.0, time=60.0, leg=1)
    found = visit([there, back], box("inclusion"))
    assert found.depth == pytest.approx(100.0, abs=0.011)
    # 10 s to the box; 20 s beyond it, at its end and on the way back; 10 s at the end.
    assert (found.entries, found.violation_time) == (3, pytest.approx(40.0, abs=1e-3))
    assert (found.entry_time, found.exit_time, found.exit_leg) == (0.0, 120.0, 1)


def test_a_hole_is_outside() -> None:
    hole = [(100.0, 50.0), (300.0, 50.0), (300.0, 150.0), (100.0, 150.0)]
    zone = Zone("ring", "exclusion", make_polygon([list(BOX), hole]))
    found = visit([move(-100.0, 100.0, 0.0, length=600.0, lasts=60.0)], zone)
    assert (found.entries, found.violation_time) == (2, pytest.approx(20.0, abs=1e-3))
    assert found.depth == pytest.approx(50.0, abs=0.011)


def test_levels_above_a_slope() -> None:
    # Level at 150 m over ground of 0.2 m per m: 150 m above it at the box's west, 70 m at its east.
    way = [move(-100.0, 100.0, 150.0, length=600.0, lasts=60.0)]
    # Below 100 m above ground from east 250 m on.
    found = visit(way, box(ceiling=ZoneLevel(100.0, "ground")), slope(0.2))
    assert (found.entry_east, found.exit_east) == pytest.approx((250.0, 400.0), abs=2e-3)
    # d m below the ceiling at 5 d m from there: d m from the eastern edge too where 5 d + d = 150 m.
    assert found.depth == pytest.approx(25.0, abs=0.011)
    # An inclusion up to 100 m above ground is left until there.
    wide = [(-500.0, -500.0), (900.0, -500.0), (900.0, 700.0), (-500.0, 700.0)]
    low = Zone("low", "inclusion", make_polygon([wide]), None, ZoneLevel(100.0, "ground"))
    held = visit(way, low, slope(0.2))
    assert (held.exit_east, held.depth) == pytest.approx((250.0, 70.0), abs=0.011)


def test_a_ridge_between_two_looks_is_seen() -> None:
    # 130 m above level ground and a ceiling of 100 m above it, with one ridge of 40 m, a pixel wide, under the way.
    east = np.linspace(-1000.0, 1000.0, 201)
    heights = np.zeros((201, 201))
    heights[:, 121] = 40.0  # at east 210 m
    ridge = make_gridded_terrain(heights, east, east, source="ridge", sha256="", datum="")
    found = visit(
        [move(-100.0, 100.0, 130.0, length=600.0, lasts=600.0)], box(ceiling=ZoneLevel(100.0, "ground")), ridge
    )
    # 30 m of the ridge's 40 m: the uppermost quarter of its two sides of 10 m.
    assert found.depth == pytest.approx(10.0, abs=0.011)
    assert (found.entry_east, found.exit_east) == pytest.approx((207.5, 212.5), abs=2e-3)


def test_unknown_ground_is_not_judged() -> None:
    way = [move(-100.0, 100.0, 130.0, length=600.0, lasts=60.0)]
    for terrain in (None, make_flat_terrain(np.array([[-5000.0, -4000.0], [0.0, 1.0]]), 0.0, 10.0)):
        found = visit(way, box(ceiling=ZoneLevel(100.0, "ground")), terrain)
        assert (found.unknown, found.entries) == (True, 0)
        # Beside its shape a zone is not violated whatever the ground.
        beside = visit([move(-100.0, -30.0, 130.0, length=600.0)], box(ceiling=ZoneLevel(100.0, "ground")), terrain)
        assert (beside.unknown, beside.depth) == (False, pytest.approx(-30.0, abs=0.011))


@pytest.mark.parametrize(("begin", "course"), [(-100.0, 90.0), (350.0, 270.0)])
def test_a_violation_over_known_ground_is_found_on_a_way_with_one_end_over_unknown_ground(
    begin: float, course: float
) -> None:
    """A ridge of 40 m at east 200 m lifts a ceiling of 100 m to 140 m; east of 300 m the ground is unknown."""
    axis = np.arange(-200.0, 601.0, 10.0)
    heights = np.where(axis > 300.0, np.nan, np.where(axis == 200.0, 40.0, 0.0))
    ground = make_gridded_terrain(np.tile(heights, (axis.size, 1)), axis, axis, source="", sha256="", datum="")
    way = [move(begin, 100.0, 130.0, course=course, length=450.0)]
    found = visit(way, box(ceiling=ZoneLevel(100.0, "ground")), ground)
    assert (found.depth, found.unknown) == (pytest.approx(10.0, abs=0.011), True)


def test_of_many_zones_each_is_judged_by_itself() -> None:
    rng = np.random.default_rng(3)
    zones = [
        Zone(f"z{k}", "exclusion", Cylinder(float(e), float(n), float(r)))
        for k, (e, n, r) in enumerate(zip(*rng.uniform(-5000, 5000, (2, 300)), rng.uniform(50, 300, 300), strict=True))
    ]
    way = [move(-5000.0 + 10.0 * k, 0.0, 0.0, length=10.0, lasts=1.0, time=float(k)) for k in range(1000)]
    found = path_zones(np.array(way, MOVE), zone_records(zones), None)
    depths = []
    for zone, one in zip(zones, found, strict=True):
        assert isinstance(zone.shape, Cylinder)
        beside = abs(zone.shape.north)
        ahead = max(0.0, abs(zone.shape.east) - 5000.0)
        depths.append(zone.shape.radius - math.hypot(beside, ahead))
        if depths[-1] > 0.0:
            assert one.depth == pytest.approx(depths[-1], abs=0.011)
            chord = min(2.0 * math.sqrt(zone.shape.radius**2 - beside**2), 10_000.0)
            inside = min(5000.0, zone.shape.east + chord / 2.0) - max(-5000.0, zone.shape.east - chord / 2.0)
            assert one.violation_time == pytest.approx(inside / 10.0, abs=0.01)
        else:
            # No less than it is, and not beyond the limit.
            assert depths[-1] - 0.011 <= one.depth <= 0.0
            assert one.entries == 0
    assert 5 < sum(depth > 0.0 for depth in depths) < 100


def test_a_stay_over_several_blocks_of_moves_is_counted_once() -> None:
    """200 moves of 10 m in 1 s each: the box is 400 m wide, from the 50th move on."""
    moves = [move(-500.0 + 10.0 * k, 50.0, 100.0, length=10.0, lasts=1.0, time=float(k), leg=k) for k in range(200)]
    found = visit(moves, box())
    assert (found.entries, found.violation_time) == (1, pytest.approx(40.0, abs=1e-4))
    assert (found.entry_time, found.exit_time) == pytest.approx((50.0, 90.0), abs=1e-4)


@pytest.mark.parametrize("side", ["floor", "ceiling"])
def test_a_zone_of_one_level_above_a_slope(side: str) -> None:
    """Level at 100 m over ground that rises by 1 in 5: 60 m above it at 200 m, 40 m at 300 m."""
    level = ZoneLevel(50.0, "ground")
    zone = box(floor=level) if side == "floor" else box(ceiling=level)
    found = visit([move(-300.0, 100.0, 100.0, length=1000.0, lasts=50.0)], zone, slope(0.2))
    # The floor lets it in up to 250 m, the ceiling from there on.
    first, last = (0.0, 250.0) if side == "floor" else (250.0, 400.0)
    assert (found.entry_east, found.exit_east) == pytest.approx((first, last), abs=0.01)


NO_GROUND = (np.full((2, 2), np.nan, np.float32), np.zeros(1, POLYMAP)[0])


def looked(records: ZoneRecords, place: tuple[float, float, float]) -> tuple[float, float, int]:
    return distances_outside_zone(records, 0, *NO_GROUND, *place)


def whole(one: Record, records: ZoneRecords) -> Record:
    part: Record = np.zeros(1, PART).view(PART)[0]
    part.first, part.last = 0.0, 1.0
    part.east, part.north, up = move_point(one, 0.0)
    part.outline_distance, part.band_distance, part.edge = looked(records, (part.east, part.north, up))
    part.end_east, part.end_north, up = move_point(one, 1.0)
    part.end_outline_distance, part.end_band_distance, part.end_edge = looked(
        records, (part.end_east, part.end_north, up)
    )
    return part


@pytest.mark.parametrize("kind", ["exclusion", "inclusion"])
def test_no_place_is_beyond_the_bounds(kind: str) -> None:
    rng = np.random.default_rng(9)
    shapes = (make_polygon([star(rng, 9)]), Cylinder(100.0, -200.0, 600.0))
    band = (ZoneLevel(100.0, "amsl"), ZoneLevel(300.0, "amsl"))
    tight = 0
    for k in range(scaled(200, 60)):
        zone = Zone("z", "exclusion" if kind == "exclusion" else "inclusion", shapes[k % 2], *band)
        records = zone_records([zone])
        length = float(rng.uniform(5.0, 300.0))
        row = move(
            *rng.uniform(-700.0, 700.0, 2).tolist(),
            float(rng.uniform(0.0, 400.0)),
            course=float(rng.uniform(0.0, 360.0)),
            length=length,
            climb=float(rng.uniform(-60.0, 60.0)),
            bend=float(rng.uniform(-30.0, 30.0)),
            curvature=float(rng.choice([0.0, rng.uniform(-0.008, 0.008)])),
        )
        moves: Records = np.array([row], MOVE)
        one, part = moves[0], whole(moves[0], records)
        rise = max(abs(one.climb), abs(one.climb + 2.0 * one.bend))
        farthest = max_violation_bound(records, 0, one, part, length)
        low, high = depth_bounds(kind == "exclusion", part, length, rise, farthest)
        depths = []
        for share in np.linspace(0.0, 1.0, 101):
            away, off, _ = looked(records, move_point(one, share))
            depths.append(violation_depth(kind == "exclusion", away, off))
            outside = -away if kind == "exclusion" else away
            assert outside <= farthest + 1e-9
        assert low - 1e-9 <= min(depths)
        assert max(depths) <= high + 1e-9
        tight += high - max(depths) < 0.1 * length
    assert tight > scaled(40, 10)


def test_along_an_edge_the_bound_is_exact() -> None:
    records = zone_records([Zone("z", "exclusion", make_polygon([[(0.0, -900.0), (900.0, -900.0), (0.0, 5000.0)]]))])
    way: Records = np.array([move(5.0, 0.0, 0.0, course=0.0, length=2000.0)], MOVE)
    assert max_violation_bound(records, 0, way[0], whole(way[0], records), 2000.0) == pytest.approx(5.0)


def test_unknown_ground_tells_nothing_but_beside_the_shape() -> None:
    for exclusion in (True, False):
        assert math.isnan(violation_depth(exclusion, -3.0, math.nan))
        assert violation_depth(exclusion, 3.0, math.nan) == (-3.0 if exclusion else 3.0)


def test_a_copy_is_the_same() -> None:
    parts: Records = np.zeros(2, PART)
    for k, name in enumerate(parts.dtype.names or ()):
        parts[0][name] = k + 1
    copy_move_part(parts[0], parts[1])
    assert parts[0].tolist() == parts[1].tolist()


def ends(away: float, to_away: float, off: float, to_off: float) -> Record:
    """A part by what is asked of its ends alone."""
    part: Record = np.zeros(1, PART).view(PART)[0]
    part.outline_distance, part.end_outline_distance, part.band_distance, part.end_band_distance = (
        away,
        to_away,
        off,
        to_off,
    )
    return part


def test_the_bounds_by_plain_sums() -> None:
    """A place between two ends is nearest to the limit where the ways from both meet."""
    part = ends(4.0, 2.0, -3.0, -5.0)
    # Outline: 2..8 m outside over 10 m of way; band: -9..1 m over 10 m of rise.
    assert depth_bounds(False, part, 10.0, 10.0, math.inf) == (max(-2.0, -9.0), max(8.0, 1.0))
    assert depth_bounds(True, part, 10.0, 10.0, math.inf) == (min(-8.0, -1.0), min(2.0, 9.0))
    # No place is further than the edges beside it say.
    assert depth_bounds(False, part, 10.0, 10.0, 5.0) == (-2.0, 5.0)
    assert depth_bounds(True, part, 10.0, 10.0, 1.5) == (-8.0, 1.5)
    # In the band's upper part the band decides.
    low = ends(-9.0, -9.0, -1.0, -1.0)
    assert depth_bounds(False, low, 2.0, 4.0, math.inf) == (-3.0, 1.0)


def test_over_unknown_ground_the_outline_alone_bounds() -> None:
    part = ends(4.0, 2.0, math.nan, -5.0)
    assert depth_bounds(True, part, 10.0, 10.0, math.inf) == (-math.inf, 2.0)
    assert depth_bounds(False, part, 10.0, 10.0, math.inf) == (-2.0, math.inf)


@pytest.mark.parametrize(("length", "farthest"), [(2000.0, 250.0), (500.0, 300.0 - math.hypot(50.0, 500.0))])
def test_through_a_cylinder_the_bound_is_where_the_way_is_nearest_to_its_axis(length: float, farthest: float) -> None:
    """North-east, 50 m beside the axis after 1,000 m; the shorter way ends 500 m before."""
    half, side = 1000.0 * math.sqrt(0.5), 50.0 * math.sqrt(0.5)
    records = zone_records([Zone("z", "exclusion", Cylinder(70.0, -40.0, 300.0))])
    start = (70.0 - half - side, -40.0 - half + side, 0.0)
    way: Records = np.array([move(*start, course=45.0, length=length)], MOVE)
    found = max_violation_bound(records, 0, way[0], whole(way[0], records), length)
    assert found == pytest.approx(farthest, abs=1e-9)


@pytest.mark.parametrize(("turned", "bounded"), [(0.9, True), (1.1, False)])
def test_an_arc_is_bounded_by_its_bow_up_to_a_radian(turned: float, bounded: bool) -> None:
    length = 300.0
    records = zone_records([Zone("z", "inclusion", Cylinder(0.0, 0.0, 900.0))])
    way: Records = np.array([move(0.0, 0.0, 0.0, length=length, curvature=turned / length)], MOVE)
    part = whole(way[0], records)
    found = max_violation_bound(records, 0, way[0], part, length)
    bow = 0.125 * turned / length * length**2
    assert found == (
        pytest.approx(max(part.outline_distance, part.end_outline_distance) + bow) if bounded else math.inf
    )


@pytest.mark.parametrize(
    ("floor", "ceiling", "off"),
    [(None, ZoneLevel(100.0, "ground"), -30.0), (ZoneLevel(100.0, "ground"), None, 30.0)],
)
def test_levels_above_ground_count_from_it(floor: ZoneLevel | None, ceiling: ZoneLevel | None, off: float) -> None:
    ground = make_flat_terrain(np.array([[-900.0, 900.0], [-900.0, 900.0]]), 80.0, 100.0)
    records = zone_records([Zone("z", "exclusion", Cylinder(0.0, 0.0, 300.0), floor, ceiling)])
    found = distances_outside_zone(records, 0, ground.heights, ground.to_pixel.record, 0.0, 0.0, 150.0)
    assert found[1] == pytest.approx(off)
