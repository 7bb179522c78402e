"""Zones stand where the data puts them, on the map and on the profile."""

from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure

from logs.figures.elements.labels import LabelPlacer
from logs.figures.elements.zones import draw_zone_cuts, draw_zone_shapes, name_zones, zone_handles, zone_label
from world.airspace.zones import Cylinder, Zone, ZoneLevel, make_polygon

SQUARE = make_polygon([[(1000.0, -500.0), (2000.0, -500.0), (2000.0, 500.0), (1000.0, 500.0)]])
KEEP_OUT, STAY_IN = Zone("town", "exclusion", SQUARE), Zone("fence", "inclusion", Cylinder(1500.0, 0.0, 1400.0))


@pytest.fixture
def axes() -> Any:
    axes = Figure(figsize=(8, 6), dpi=100).add_axes((0.1, 0.1, 0.8, 0.8))
    axes.set(xlim=(0.0, 3000.0), ylim=(-1500.0, 1500.0))
    return axes


@pytest.mark.parametrize(
    ("floor", "ceiling", "text"),
    [
        (None, None, "town"),
        (None, ZoneLevel(120.0, "ground"), "town, below 120 m above ground"),
        (ZoneLevel(600.0, "amsl"), None, "town, above 600 m AMSL"),
        (ZoneLevel(100.0, "amsl"), ZoneLevel(600.0, "amsl"), "town, 100 to 600 m AMSL"),
        (ZoneLevel(50.0, "ground"), ZoneLevel(600.0, "amsl"), "town, 50 m above ground to 600 m AMSL"),
    ],
)
def test_labels_say_the_heights(floor: ZoneLevel | None, ceiling: ZoneLevel | None, text: str) -> None:
    assert zone_label(Zone("town", "exclusion", SQUARE, floor, ceiling)) == text


def test_shapes_are_drawn_where_they_are(axes: Any) -> None:
    handles = draw_zone_shapes(axes, (KEEP_OUT, STAY_IN))
    exclusions, inclusions = [item for item in axes.collections if isinstance(item, PatchCollection)]
    box = exclusions.get_paths()[0].get_extents()
    assert (box.x0, box.x1, box.y0, box.y1) == (1000.0, 2000.0, -500.0, 500.0)
    box = inclusions.get_paths()[0].get_extents()
    assert (box.x0, box.x1) == pytest.approx((100.0, 2900.0))
    assert exclusions.get_hatch()
    assert not inclusions.get_hatch()
    assert [handle.get_label() for handle in handles] == ["zone to keep out of", "edge of a zone to stay in"]


def test_nothing_is_drawn_without_zones(axes: Any) -> None:
    assert draw_zone_shapes(axes, ()) == zone_handles(()) == []
    assert len(axes.collections) == 0


def test_names_stand_in_exclusions_and_at_an_inclusions_edge(axes: Any) -> None:
    name_zones(axes, (KEEP_OUT, STAY_IN), LabelPlacer(axes))
    places = {text.get_text(): axes.transData.inverted().transform(text.get_window_extent()) for text in axes.texts}
    assert places["town"].mean(axis=0) == pytest.approx([1500.0, 0.0], abs=60.0)
    assert places["fence"][0, 1] >= 1300.0


def cuts(axes: Any, zone: Zone) -> tuple[list[np.ndarray], list[tuple[str, float, float]]]:
    """Filled areas over a straight way at 200 m, ground at 50 m, and names."""
    axes.set(xlim=(0.0, 3.0), ylim=(0.0, 400.0))
    distance = np.linspace(0.0, 3000.0, 301)
    points = np.column_stack([distance, np.zeros(301), np.full(301, 200.0)])
    names = draw_zone_cuts(axes, (zone,), distance, points, np.full(301, 50.0))
    return [path.vertices for item in axes.collections for path in item.get_paths()], names


def test_an_exclusion_takes_its_band_where_the_way_is_over_it(axes: Any) -> None:
    zone = Zone("town", "exclusion", SQUARE, ZoneLevel(100.0, "ground"), ZoneLevel(300.0, "amsl"))
    (area,), ((name, middle, amsl),) = cuts(axes, zone)
    assert (area[:, 0].min(), area[:, 0].max()) == pytest.approx((1.0, 2.0))
    assert (area[:, 1].min(), area[:, 1].max()) == pytest.approx((150.0, 300.0))
    assert name.startswith("town")
    assert (middle, amsl) == pytest.approx((1.5, 225.0))


def test_an_inclusion_takes_what_is_outside_it(axes: Any) -> None:
    zone = Zone("fence", "inclusion", SQUARE, None, ZoneLevel(300.0, "amsl"))
    areas, names = cuts(axes, zone)
    boxes = sorted((*np.round(area.min(axis=0), 6), *np.round(area.max(axis=0), 6)) for area in areas)
    assert boxes == [(0.0, 0.0, 0.99, 400.0), (1.0, 300.0, 2.0, 400.0), (2.01, 0.0, 3.0, 400.0)]
    assert names == []
