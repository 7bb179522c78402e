"""A mission's fence as zones on the map: every kind of shape, and what is none."""

import math

import numpy as np
import pytest

from flight.mission.fence_zones import fence_zones
from flight.mission.items import Command, Frame, MissionItem
from world.airspace.zones import Cylinder, Polygon
from world.errors import MissionError
from world.frames import GeoOrigin

ORIGIN = GeoOrigin(46.0, 8.0)
# Metres of a degree at 46 N on WGS84: by the meridian's and the prime vertical's radii of curvature.
_A, _E2 = 6_378_137.0, 0.006_694_379_990_14
_W = math.sqrt(1.0 - _E2 * math.sin(math.radians(46.0)) ** 2)
NORTH = math.radians(_A * (1.0 - _E2) / _W**3)
EAST = math.radians(_A / _W * math.cos(math.radians(46.0)))


def item(seq: int, command: Command, p1: float, east: float, north: float) -> MissionItem:
    lat, lon = 46.0 + north / NORTH, 8.0 + east / EAST
    return MissionItem(seq, int(command), int(Frame.GLOBAL), (p1, 0.0, 0.0, 0.0), lat, lon, 0.0)


def polygon(first: int, command: Command, corners: list[tuple[float, float]]) -> list[MissionItem]:
    return [item(first + k, command, float(len(corners)), *corner) for k, corner in enumerate(corners)]


def test_every_shape_comes_to_its_place() -> None:
    triangle, square = [(0.0, 0.0), (900.0, 0.0), (0.0, 600.0)], [(0.0, 0.0), (50.0, 0.0), (50.0, 50.0), (0.0, 50.0)]
    fence = (
        *polygon(0, Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION, triangle),
        item(3, Command.NAV_FENCE_CIRCLE_EXCLUSION, 123.0, 300.0, -200.0),
        *polygon(4, Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION, square),
        item(8, Command.NAV_FENCE_CIRCLE_INCLUSION, 50.5, -10.0, 20.0),
    )
    zones = fence_zones(fence, ORIGIN)
    assert [(zone.name, zone.kind) for zone in zones] == [
        ("fence item 0", "inclusion"),
        ("fence item 3", "exclusion"),
        ("fence item 4", "exclusion"),
        ("fence item 8", "inclusion"),
    ]
    assert all(zone.floor is None and zone.ceiling is None for zone in zones)
    for k, corners in ((0, triangle), (2, square)):
        shape = zones[k].shape
        assert isinstance(shape, Polygon)
        # The Earth curves between the corners: a decimetre in 900 m.
        np.testing.assert_allclose(shape.rings[0], corners, atol=0.15)
    for k, (east, north, radius) in ((1, (300.0, -200.0, 123.0)), (3, (-10.0, 20.0, 50.5))):
        circle = zones[k].shape
        assert isinstance(circle, Cylinder)
        np.testing.assert_allclose((circle.east, circle.north, circle.radius), (east, north, radius), atol=0.02)


BOW = [(0.0, 0.0), (90.0, 90.0), (90.0, 0.0), (0.0, 90.0)]
EXCLUSION = Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION
FAULTS = {
    "a bow tie": (polygon(2, EXCLUSION, BOW), "fence item 2: crosses or touches itself"),
    "two corners": (polygon(0, EXCLUSION, BOW[:2]), "fence item 0: 2 corners: at least three"),
    "no radius": ([item(5, Command.NAV_FENCE_CIRCLE_EXCLUSION, 0.0, 0.0, 0.0)], "fence item 5: radius 0 m"),
    "too few follow": (polygon(0, EXCLUSION, BOW)[:3], "fence item 0: p1 4: fewer corners follow"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_no_shape_is_refused_by_its_item(case: str) -> None:
    items, wanted = FAULTS[case]
    with pytest.raises(MissionError, match=f"^m.plan: {wanted}"):
        fence_zones(tuple(items), ORIGIN, "m.plan")
