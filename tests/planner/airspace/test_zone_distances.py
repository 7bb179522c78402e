"""What a certificate finds of a piece's room to zones, by plain sums and fine samples."""

from collections.abc import Callable

import numpy as np
import pytest

from planner.airspace.kept_zones import ZoneMargins, keep_zones
from planner.airspace.zone_distances import ZONE_ROOM, measure_zone_room
from tests.bench.airspace.scenarios import ring_distance, star
from tests.planner.airspace.test_zone_depths import FAR, GROUND, SQUARE
from world.airspace.zones import Cylinder, Zone, ZoneLevel, make_polygon

MARGINS = ZoneMargins(10.0, 5.0, 0.75)
DEPTHS = -GROUND.heights
DEPTHS.setflags(write=False)
Room = Callable[..., np.void]


@pytest.fixture
def room() -> Room:
    def made(
        zones: list[Zone], a: list[float], b: list[float], beside: tuple[float, float] = (0.0, 0.0), above: float = 0.0
    ) -> np.void:
        out = np.zeros(1, ZONE_ROOM)
        ends = np.array(a, dtype=np.float64), np.array(b, dtype=np.float64)
        kept = keep_zones(zones, FAR, GROUND, MARGINS)
        to_pixel = GROUND.to_pixel.record
        measure_zone_room(kept, GROUND.heights, DEPTHS, to_pixel, *ends, np.array(beside), 0.0, above, out[0])
        return out[0]

    return made


@pytest.mark.parametrize(("off", "kept"), [(10.1, True), (9.9, False), (-30.0, False)])
def test_beside_an_exclusion_and_into_it(room: Room, off: float, kept: bool) -> None:
    for shape in (Cylinder(400.0, 400.0, 400.0), SQUARE):
        found = room([Zone("it", "exclusion", shape)], [-900.0, 800.0 + off, 90.0], [1700.0, 800.0 + off, 90.0])
        assert bool(found["kept"]) == kept
        assert float(found["nearest"]) == pytest.approx(off, abs=1e-6)


@pytest.mark.parametrize(("off", "kept"), [(10.1, True), (9.9, False), (-30.0, False)])
def test_inside_an_inclusion_and_out_of_it(room: Room, off: float, kept: bool) -> None:
    for shape in (Cylinder(400.0, 400.0, 400.0), SQUARE):
        found = room([Zone("it", "inclusion", shape)], [400.0, 400.0, 90.0], [400.0, 800.0 - off, 90.0])
        assert bool(found["kept"]) == kept
        assert float(found["nearest"]) == pytest.approx(off, abs=1e-6)


@pytest.mark.parametrize(("up", "kept"), [(94.9, True), (95.1, False)])
def test_below_a_floor(room: Room, up: float, kept: bool) -> None:
    zone = Zone("it", "exclusion", SQUARE, floor=ZoneLevel(100.0, "amsl"))
    found = room([zone], [-900.0, 400.0, up], [1700.0, 400.0, up])
    assert bool(found["kept"]) == kept
    assert float(found["nearest"]) == pytest.approx(100.0 - up)
    assert bool(room([zone], [-900.0, 400.0, up - 7.0], [1700.0, 400.0, up - 7.0], above=7.0)["kept"]) == kept


def test_a_climb_that_is_above_a_ceiling_where_it_comes_to_the_zone(room: Room) -> None:
    """20 m above it there, and below it before: heights and places belong together."""
    zone = Zone("it", "exclusion", SQUARE, ceiling=ZoneLevel(100.0, "amsl"))
    found = room([zone], [-1000.0, 400.0, 20.0], [1000.0, 400.0, 220.0])
    assert bool(found["kept"])
    # Where it is 0.1 m above for each m that it is nearer, the distance on the map decides until the edge.
    assert 10.0 < float(found["nearest"]) <= 20.0


def test_a_floor_above_the_slope_is_exact(room: Room) -> None:
    zone = Zone("it", "exclusion", SQUARE, floor=ZoneLevel(100.0, "ground"))
    # Along the slope, 94 m above it.
    found = room([zone], [-1000.0, 400.0, -6.0], [1000.0, 400.0, 194.0])
    assert bool(found["kept"])
    assert float(found["nearest"]) == pytest.approx(6.0, abs=1e-3)
    # A flight 20 m beside a northbound leg is 2 m higher over lower ground.
    assert bool(room([zone], [400.0, 200.0, 134.0], [400.0, 600.0, 134.0])["kept"])
    assert not bool(room([zone], [400.0, 200.0, 134.0], [400.0, 600.0, 134.0], (20.0, 20.0))["kept"])


def test_what_a_flight_may_be_beside_grows_along_a_piece(room: Room) -> None:
    zone = Zone("it", "exclusion", Cylinder(0.0, 40.0, 20.0))
    near, far = ([-100.0, 0.0, 90.0], [900.0, 0.0, 90.0]), (0.0, 20.0)
    assert bool(room([zone], *near, far)["kept"])
    assert not bool(room([zone], *near, (20.0, 20.0))["kept"])


def test_nearest_zone_and_the_one_that_is_too_near(room: Room) -> None:
    fence = Zone("fence", "inclusion", Cylinder(0.0, 0.0, 1012.0), ceiling=ZoneLevel(111.0, "amsl"))
    tower = Zone("tower", "exclusion", Cylinder(0.0, 30.0, 14.0), floor=ZoneLevel(111.0, "amsl"))
    path = [-1000.0, 0.0, 105.0], [1000.0, 0.0, 105.0]
    found = room([tower, fence], *path)
    # 12 m within the fence and 6 m below its top; 16 m beside the tower and 6 m below it.
    assert (bool(found["kept"]), float(found["nearest"])) == (True, pytest.approx(6.0))
    close = Zone("close", "exclusion", Cylinder(500.0, 30.0, 21.0))
    found = room([tower, fence, close], *path)
    assert (bool(found["kept"]), int(found["zone"]), float(found["nearest"])) == (False, 2, pytest.approx(6.0))


def test_random_polygons_against_fine_samples(room: Room) -> None:
    rng = np.random.default_rng(13)
    for _ in range(150):
        ring = star(rng, rng.uniform(-300.0, 300.0, 2), float(rng.uniform(100.0, 700.0)), int(rng.integers(3, 12)))
        a, b = rng.uniform(-1200.0, 1200.0, (2, 2))
        places = a + np.linspace(0.0, 1.0, 3000)[:, None] * (b - a)
        away = float(ring_distance(np.array(ring), places).min())
        found = room([Zone("it", "exclusion", make_polygon([[(x, y) for x, y in ring]]))], [*a, 90.0], [*b, 90.0])
        if away > 0.5:
            assert float(found["nearest"]) == pytest.approx(away, abs=0.5)
        else:
            assert float(found["nearest"]) <= 0.5
        assert bool(found["kept"]) == (away >= 10.0) or abs(away - 10.0) < 0.5
