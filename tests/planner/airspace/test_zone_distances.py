"""What a certificate finds of a piece's margin to zones, by plain sums and fine samples."""

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.airspace.scenarios import ring_distance, star
from planner.airspace.zone_distances import ZONE_MARGIN, measure_zone_margin, zone_penetration
from planner.airspace.zone_limits import ZoneMargins, add_margins
from tests.soak import scaled
from world.airspace.zones import Cylinder, Polygon, Zone, ZoneKind, ZoneLevel, make_polygon
from world.terrain import Terrain, make_gridded_terrain

# ----------------------------------------------------------------------
# What a leg in zones is charged: nothing where it keeps their margins, and more the deeper and longer it is in.

MARGINS = ZoneMargins(15.0, 8.0, 1.0)
FAR = np.zeros((0, 3))
SQUARE = make_polygon([[(0.0, 0.0), (800.0, 0.0), (800.0, 800.0), (0.0, 800.0)]])
Charge = Callable[..., float]


def slanting() -> Terrain:
    """Ground that rises by a tenth to the east, from 0 m at 0."""
    east, north = np.linspace(-5000.0, 5000.0, 101), np.linspace(-5000.0, 5000.0, 101)
    heights = np.broadcast_to(0.1 * east, (101, 101)).copy()
    return make_gridded_terrain(heights, east, north, source="a slope", sha256="", datum="mean sea level")


GROUND = slanting()


@pytest.fixture
def charge() -> Charge:
    def made(
        zone: Zone, a: list[float], b: list[float], beside: float = 0.0, below: float = 0.0, above: float = 0.0
    ) -> float:
        zones = add_margins([zone], FAR, GROUND, MARGINS)
        ends = np.array(a, dtype=np.float64), np.array(b, dtype=np.float64)
        return float(zone_penetration(zones, GROUND.heights, GROUND.to_pixel.record, 40.0, *ends, beside, below, above))

    return made


@pytest.mark.parametrize("shape", [Cylinder(400.0, 400.0, 400.0), SQUARE])
@pytest.mark.parametrize(("off", "charged"), [(15.1, False), (14.9, True)])
def test_beside_an_exclusion(charge: Charge, shape: Polygon | Cylinder, off: float, charged: bool) -> None:
    zone = Zone("it", "exclusion", shape)
    assert (charge(zone, [-900.0, 800.0 + off, 90.0], [1700.0, 800.0 + off, 90.0]) > 0.0) == charged
    # As far again for an autopilot that may be 20 m beside the leg.
    assert (charge(zone, [-900.0, 820.0 + off, 90.0], [1700.0, 820.0 + off, 90.0], 20.0) > 0.0) == charged


@pytest.mark.parametrize("shape", [Cylinder(400.0, 400.0, 400.0), SQUARE])
@pytest.mark.parametrize(("off", "charged"), [(15.1, False), (14.9, True)])
def test_inside_the_edge_of_an_inclusion(charge: Charge, shape: Polygon | Cylinder, off: float, charged: bool) -> None:
    zone = Zone("it", "inclusion", shape)
    assert (charge(zone, [400.0, 400.0, 90.0], [400.0, 800.0 - off, 90.0]) > 0.0) == charged
    assert (charge(zone, [400.0, 400.0, 90.0], [400.0, 780.0 - off, 90.0], 20.0) > 0.0) == charged


@pytest.mark.parametrize(("up", "charged"), [(91.9, False), (92.1, True), (307.9, True), (308.1, False)])
def test_below_a_floor_and_above_a_ceiling(charge: Charge, up: float, charged: bool) -> None:
    zone = Zone("it", "exclusion", SQUARE, ZoneLevel(100.0, "amsl"), ZoneLevel(300.0, "amsl"))
    assert (charge(zone, [-900.0, 400.0, up], [1700.0, 400.0, up]) > 0.0) == charged
    inclusion = Zone("it", "inclusion", SQUARE, ZoneLevel(84.0, "amsl"), ZoneLevel(316.0, "amsl"))
    assert (charge(inclusion, [100.0, 400.0, up], [700.0, 400.0, up]) > 0.0) != charged


@pytest.mark.parametrize(("up", "charged"), [(91.9, False), (92.1, True)])
def test_how_far_a_flight_may_be_above_counts_against_a_floor(charge: Charge, up: float, charged: bool) -> None:
    zone = Zone("it", "exclusion", SQUARE, floor=ZoneLevel(100.0, "amsl"))
    assert (charge(zone, [-900.0, 400.0, up - 6.0], [1700.0, 400.0, up - 6.0], 0.0, 9.0, 6.0) > 0.0) == charged


@pytest.mark.parametrize(("up", "charged"), [(90.0, False), (94.0, True)])
def test_a_floor_above_the_slope(charge: Charge, up: float, charged: bool) -> None:
    """Lowest 15 m west of the square, where the ground is 1.5 m below sea level: 8 m under the floor is at 90.5 m."""
    zone = Zone("it", "exclusion", SQUARE, floor=ZoneLevel(100.0, "ground"))
    assert (charge(zone, [-900.0, 400.0, up], [1700.0, 400.0, up]) > 0.0) == charged
    # A leg that climbs with the ground is as far from it everywhere.
    assert (charge(zone, [-900.0, 400.0, up - 90.0], [1700.0, 400.0, up + 170.0]) > 0.0) == charged


def test_deeper_and_longer_is_dearer(charge: Charge) -> None:
    zone = Zone("it", "exclusion", SQUARE)
    charges = [charge(zone, [-900.0, north, 90.0], [1700.0, north, 90.0]) for north in (810.0, 780.0, 700.0, 500.0)]
    assert charges == sorted(charges)
    assert charges[0] > 0.0
    assert charge(zone, [300.0, 700.0, 90.0], [500.0, 700.0, 90.0]) < charges[2]
    fence = Zone("it", "inclusion", SQUARE)
    outside = [charge(fence, [400.0, 400.0, 90.0], [400.0, north, 90.0]) for north in (790.0, 830.0, 1200.0)]
    assert outside == sorted(outside)
    assert outside[0] > 0.0


@pytest.mark.parametrize("kind", ["exclusion", "inclusion"])
def test_nothing_is_charged_only_where_fine_samples_keep_the_margin(charge: Charge, kind: ZoneKind) -> None:
    rng = np.random.default_rng(11)
    free = 0
    for _ in range(scaled(300, 100)):
        ring = star(rng, rng.uniform(-300.0, 300.0, 2), float(rng.uniform(200.0, 1500.0)), int(rng.integers(3, 12)))
        a, b = rng.uniform(-1200.0, 1200.0, (2, 2))
        places = a + np.linspace(0.0, 1.0, 2000)[:, None] * (b - a)
        away = ring_distance(np.array(ring), places) * (1.0 if kind == "exclusion" else -1.0)
        zone = Zone("it", kind, make_polygon([[(x, y) for x, y in ring]]))
        charged = charge(zone, [*a, 90.0], [*b, 90.0])
        if away.min() < 14.9:
            assert charged > 0.0
        elif away.min() > 16.0:
            assert charged == 0.0
            free += 1
    assert free > scaled(10, 2)


CERTIFIED_MARGINS = ZoneMargins(10.0, 5.0, 0.75)
DEPTHS = -GROUND.heights
DEPTHS.setflags(write=False)
ZoneMargin = Callable[..., np.void]


def satisfied(found: np.void) -> bool:
    return bool(found["excess"] >= 0.0)


@pytest.fixture
def zone_margin() -> ZoneMargin:
    def made(
        zones: list[Zone], a: list[float], b: list[float], beside: tuple[float, float] = (0.0, 0.0), above: float = 0.0
    ) -> np.void:
        out = np.zeros(1, ZONE_MARGIN)
        ends = np.array(a, dtype=np.float64), np.array(b, dtype=np.float64)
        widened = add_margins(zones, FAR, GROUND, CERTIFIED_MARGINS)
        to_pixel = GROUND.to_pixel.record
        measure_zone_margin(widened, GROUND.heights, DEPTHS, to_pixel, *ends, np.array(beside), 0.0, above, out[0])
        return out[0]

    return made


@pytest.mark.parametrize(("off", "ok"), [(10.1, True), (9.9, False), (-30.0, False)])
def test_beside_an_exclusion_and_into_it(zone_margin: ZoneMargin, off: float, ok: bool) -> None:
    for shape in (Cylinder(400.0, 400.0, 400.0), SQUARE):
        found = zone_margin([Zone("it", "exclusion", shape)], [-900.0, 800.0 + off, 90.0], [1700.0, 800.0 + off, 90.0])
        assert satisfied(found) == ok
        assert float(found["nearest"]) == pytest.approx(off, abs=1e-6)


@pytest.mark.parametrize(("off", "ok"), [(10.1, True), (9.9, False), (-30.0, False)])
def test_inside_an_inclusion_and_out_of_it(zone_margin: ZoneMargin, off: float, ok: bool) -> None:
    for shape in (Cylinder(400.0, 400.0, 400.0), SQUARE):
        found = zone_margin([Zone("it", "inclusion", shape)], [400.0, 400.0, 90.0], [400.0, 800.0 - off, 90.0])
        assert satisfied(found) == ok
        assert float(found["nearest"]) == pytest.approx(off, abs=1e-6)


@pytest.mark.parametrize(("up", "ok"), [(94.9, True), (95.1, False)])
def test_below_a_floor(zone_margin: ZoneMargin, up: float, ok: bool) -> None:
    zone = Zone("it", "exclusion", SQUARE, floor=ZoneLevel(100.0, "amsl"))
    found = zone_margin([zone], [-900.0, 400.0, up], [1700.0, 400.0, up])
    assert satisfied(found) == ok
    assert float(found["nearest"]) == pytest.approx(100.0 - up)
    higher = zone_margin([zone], [-900.0, 400.0, up - 7.0], [1700.0, 400.0, up - 7.0], above=7.0)
    assert satisfied(higher) == ok


def test_a_climb_that_is_above_a_ceiling_where_it_comes_to_the_zone(zone_margin: ZoneMargin) -> None:
    """20 m above it there, and below it before: heights and places belong together."""
    zone = Zone("it", "exclusion", SQUARE, ceiling=ZoneLevel(100.0, "amsl"))
    found = zone_margin([zone], [-1000.0, 400.0, 20.0], [1000.0, 400.0, 220.0])
    assert satisfied(found)
    # Where it is 0.1 m above for each m that it is nearer, the distance on the map decides until the edge.
    assert 10.0 < float(found["nearest"]) <= 20.0


def test_a_floor_above_the_slope_is_exact(zone_margin: ZoneMargin) -> None:
    zone = Zone("it", "exclusion", SQUARE, floor=ZoneLevel(100.0, "ground"))
    # Along the slope, 94 m above it.
    found = zone_margin([zone], [-1000.0, 400.0, -6.0], [1000.0, 400.0, 194.0])
    assert satisfied(found)
    assert float(found["nearest"]) == pytest.approx(6.0, abs=1e-3)
    # A flight 20 m beside a northbound leg is 2 m higher over lower ground.
    assert satisfied(zone_margin([zone], [400.0, 200.0, 134.0], [400.0, 600.0, 134.0]))
    assert not satisfied(zone_margin([zone], [400.0, 200.0, 134.0], [400.0, 600.0, 134.0], (20.0, 20.0)))


def test_what_a_flight_may_be_beside_grows_along_a_piece(zone_margin: ZoneMargin) -> None:
    zone = Zone("it", "exclusion", Cylinder(0.0, 40.0, 20.0))
    near, far = ([-100.0, 0.0, 90.0], [900.0, 0.0, 90.0]), (0.0, 20.0)
    assert satisfied(zone_margin([zone], *near, far))
    assert not satisfied(zone_margin([zone], *near, (20.0, 20.0)))


def test_nearest_zone_and_the_one_that_is_too_near(zone_margin: ZoneMargin) -> None:
    fence = Zone("fence", "inclusion", Cylinder(0.0, 0.0, 1012.0), ceiling=ZoneLevel(111.0, "amsl"))
    tower = Zone("tower", "exclusion", Cylinder(0.0, 30.0, 14.0), floor=ZoneLevel(111.0, "amsl"))
    path = [-1000.0, 0.0, 105.0], [1000.0, 0.0, 105.0]
    found = zone_margin([tower, fence], *path)
    # 12 m within the fence and 6 m below its top; 16 m beside the tower and 6 m below it.  5 m below are required.
    assert (float(found["excess"]), float(found["nearest"])) == (pytest.approx(1.0), pytest.approx(6.0))
    close = Zone("close", "exclusion", Cylinder(500.0, 30.0, 21.0))
    found = zone_margin([tower, fence, close], *path)
    # 9 m beside the third, of 10 m.
    assert (float(found["excess"]), float(found["nearest"])) == (pytest.approx(-1.0), pytest.approx(6.0))
    assert int(found["zone"]) == 2


def test_random_polygons_against_fine_samples(zone_margin: ZoneMargin) -> None:
    rng = np.random.default_rng(13)
    for _ in range(150):
        ring = star(rng, rng.uniform(-300.0, 300.0, 2), float(rng.uniform(100.0, 700.0)), int(rng.integers(3, 12)))
        a, b = rng.uniform(-1200.0, 1200.0, (2, 2))
        places = a + np.linspace(0.0, 1.0, 3000)[:, None] * (b - a)
        away = float(ring_distance(np.array(ring), places).min())
        found = zone_margin(
            [Zone("it", "exclusion", make_polygon([[(x, y) for x, y in ring]]))], [*a, 90.0], [*b, 90.0]
        )
        if away > 0.5:
            assert float(found["nearest"]) == pytest.approx(away, abs=0.5)
        else:
            assert float(found["nearest"]) <= 0.5
        assert satisfied(found) == (away >= 10.0) or abs(away - 10.0) < 0.5
