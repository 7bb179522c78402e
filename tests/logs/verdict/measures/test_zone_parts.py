"""Bounds of a part of a move beside a zone: no place between its ends is further beyond the limit than they say."""

import math

import numpy as np
import pytest

from logs.verdict.measures.path_moves import MOVE, move_point
from logs.verdict.measures.zone_parts import (
    PART,
    between_ends,
    beyond_limit,
    copy_part,
    farthest_from_outline,
    look_at_zone,
)
from tests.logs.verdict.measures.test_zone_visits import move
from tests.world.airspace.test_zone_kernels import star
from world.airspace.zone_kernels import ZoneRecords, zone_records
from world.airspace.zones import Cylinder, Zone, ZoneLevel, make_polygon
from world.frames import POLYMAP
from world.kernels import Record, Records
from world.terrain import flat_terrain

NO_GROUND = (np.full((2, 2), np.nan, np.float32), np.zeros(1, POLYMAP)[0])


def looked(records: ZoneRecords, place: tuple[float, float, float]) -> tuple[float, float, int]:
    return look_at_zone(records, 0, *NO_GROUND, *place)


def whole(one: Record, records: ZoneRecords) -> Record:
    part: Record = np.zeros(1, PART).view(PART)[0]
    part.first, part.last = 0.0, 1.0
    part.east, part.north, up = move_point(one, 0.0)
    part.away, part.off, part.edge = looked(records, (part.east, part.north, up))
    part.to_east, part.to_north, up = move_point(one, 1.0)
    part.to_away, part.to_off, part.to_edge = looked(records, (part.to_east, part.to_north, up))
    return part


@pytest.mark.parametrize("kind", ["exclusion", "inclusion"])
def test_no_place_is_beyond_the_bounds(kind: str) -> None:
    rng = np.random.default_rng(9)
    shapes = (make_polygon([star(rng, 9)]), Cylinder(100.0, -200.0, 600.0))
    band = (ZoneLevel(100.0, "amsl"), ZoneLevel(300.0, "amsl"))
    tight = 0
    for k in range(200):
        zone = Zone("z", "exclusion" if kind == "exclusion" else "inclusion", shapes[k % 2], *band)
        records = zone_records([zone])
        length = float(rng.uniform(5.0, 300.0))
        row = move(
            *rng.uniform(-700.0, 700.0, 2).tolist(), float(rng.uniform(0.0, 400.0)),
            course=float(rng.uniform(0.0, 360.0)), length=length, climb=float(rng.uniform(-60.0, 60.0)),
            bend=float(rng.uniform(-30.0, 30.0)), curvature=float(rng.choice([0.0, rng.uniform(-0.008, 0.008)])),
        )  # fmt: skip
        moves: Records = np.array([row], MOVE)
        one, part = moves[0], whole(moves[0], records)
        rise = max(abs(one.climb), abs(one.climb + 2.0 * one.bend))
        farthest = farthest_from_outline(records, 0, one, part, length)
        low, high = between_ends(kind == "exclusion", part, length, rise, farthest)
        depths = []
        for share in np.linspace(0.0, 1.0, 101):
            away, off, _ = looked(records, move_point(one, share))
            depths.append(beyond_limit(kind == "exclusion", away, off))
            outside = -away if kind == "exclusion" else away
            assert outside <= farthest + 1e-9
        assert low - 1e-9 <= min(depths)
        assert max(depths) <= high + 1e-9
        tight += high - max(depths) < 0.1 * length
    assert tight > 40


def test_along_an_edge_the_bound_is_exact() -> None:
    records = zone_records([Zone("z", "exclusion", make_polygon([[(0.0, -900.0), (900.0, -900.0), (0.0, 5000.0)]]))])
    way: Records = np.array([move(5.0, 0.0, 0.0, course=0.0, length=2000.0)], MOVE)
    assert farthest_from_outline(records, 0, way[0], whole(way[0], records), 2000.0) == pytest.approx(5.0)


def test_unknown_ground_tells_nothing_but_beside_the_shape() -> None:
    for exclusion in (True, False):
        assert math.isnan(beyond_limit(exclusion, -3.0, math.nan))
        assert beyond_limit(exclusion, 3.0, math.nan) == (-3.0 if exclusion else 3.0)


def test_a_copy_is_the_same() -> None:
    parts: Records = np.zeros(2, PART)
    for k, name in enumerate(parts.dtype.names or ()):
        parts[0][name] = k + 1
    copy_part(parts[0], parts[1])
    assert parts[0].tolist() == parts[1].tolist()


def ends(away: float, to_away: float, off: float, to_off: float) -> Record:
    """A part by what is asked of its ends alone."""
    part: Record = np.zeros(1, PART).view(PART)[0]
    part.away, part.to_away, part.off, part.to_off = away, to_away, off, to_off
    return part


def test_the_bounds_by_plain_sums() -> None:
    """A place between two ends is nearest to the limit where the ways from both meet."""
    part = ends(4.0, 2.0, -3.0, -5.0)
    # Outline: 2..8 m outside over 10 m of way; band: -9..1 m over 10 m of rise.
    assert between_ends(False, part, 10.0, 10.0, math.inf) == (max(-2.0, -9.0), max(8.0, 1.0))
    assert between_ends(True, part, 10.0, 10.0, math.inf) == (min(-8.0, -1.0), min(2.0, 9.0))
    # No place is further than the edges beside it say.
    assert between_ends(False, part, 10.0, 10.0, 5.0) == (-2.0, 5.0)
    assert between_ends(True, part, 10.0, 10.0, 1.5) == (-8.0, 1.5)
    # In the band's upper part the band decides.
    low = ends(-9.0, -9.0, -1.0, -1.0)
    assert between_ends(False, low, 2.0, 4.0, math.inf) == (-3.0, 1.0)


def test_over_unknown_ground_the_outline_alone_bounds() -> None:
    part = ends(4.0, 2.0, math.nan, -5.0)
    assert between_ends(True, part, 10.0, 10.0, math.inf) == (-math.inf, 2.0)
    assert between_ends(False, part, 10.0, 10.0, math.inf) == (-2.0, math.inf)


@pytest.mark.parametrize(("length", "farthest"), [(2000.0, 250.0), (500.0, 300.0 - math.hypot(50.0, 500.0))])
def test_through_a_cylinder_the_bound_is_where_the_way_is_nearest_to_its_axis(length: float, farthest: float) -> None:
    """North-east, 50 m beside the axis after 1,000 m; the shorter way ends 500 m before."""
    half, side = 1000.0 * math.sqrt(0.5), 50.0 * math.sqrt(0.5)
    records = zone_records([Zone("z", "exclusion", Cylinder(70.0, -40.0, 300.0))])
    start = (70.0 - half - side, -40.0 - half + side, 0.0)
    way: Records = np.array([move(*start, course=45.0, length=length)], MOVE)
    found = farthest_from_outline(records, 0, way[0], whole(way[0], records), length)
    assert found == pytest.approx(farthest, abs=1e-9)


@pytest.mark.parametrize(("turned", "bounded"), [(0.9, True), (1.1, False)])
def test_an_arc_is_bounded_by_its_bow_up_to_a_radian(turned: float, bounded: bool) -> None:
    length = 300.0
    records = zone_records([Zone("z", "inclusion", Cylinder(0.0, 0.0, 900.0))])
    way: Records = np.array([move(0.0, 0.0, 0.0, length=length, curvature=turned / length)], MOVE)
    part = whole(way[0], records)
    found = farthest_from_outline(records, 0, way[0], part, length)
    bow = 0.125 * turned / length * length**2
    assert found == (pytest.approx(max(part.away, part.to_away) + bow) if bounded else math.inf)


@pytest.mark.parametrize(
    ("floor", "ceiling", "off"),
    [(None, ZoneLevel(100.0, "ground"), -30.0), (ZoneLevel(100.0, "ground"), None, 30.0)],
)
def test_levels_above_ground_count_from_it(floor: ZoneLevel | None, ceiling: ZoneLevel | None, off: float) -> None:
    ground = flat_terrain(np.array([[-900.0, 900.0], [-900.0, 900.0]]), 80.0, 100.0)
    records = zone_records([Zone("z", "exclusion", Cylinder(0.0, 0.0, 300.0), floor, ceiling)])
    found = look_at_zone(records, 0, ground.heights, ground.to_pixel.record, 0.0, 0.0, 150.0)
    assert found[1] == pytest.approx(off)
