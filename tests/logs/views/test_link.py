"""The path by the quality of its link: margins by hand, and a map without gaps."""

import math

import numpy as np
import pytest

from logs.recording.example_log import example_log
from logs.verdict.measures.link_outages import LinkAlongPath, Outage
from logs.views.link import WEAK_MARGIN_DB, link_chart, link_map, link_quality
from world.radio import LinkPoints


def along(margins: list[float]) -> LinkAlongPath:
    margin = np.array(margins)
    count = len(margin)
    positions = np.column_stack([np.zeros(count), 100.0 * np.arange(count), np.full(count, 300.0)])
    points = LinkPoints(margin, 100.0 * np.arange(count), np.zeros(count), margin >= 0.0, np.ones(count))
    return LinkAlongPath(np.arange(float(count)), positions, points, (Outage(1.0, 2.0),))


@pytest.mark.parametrize(
    ("margin", "quality"),
    [(WEAK_MARGIN_DB, "kept"), (WEAK_MARGIN_DB - 0.01, "weak"), (0.0, "weak"), (-0.01, "lost"), (math.nan, "unknown")],
)
def test_the_quality_is_by_the_margin(margin: float, quality: str) -> None:
    assert link_quality(margin) == quality


def test_the_map_has_a_line_for_each_quality_and_no_gap() -> None:
    setup = example_log().setup
    chart = link_map(setup, along([20.0, 20.0, 3.0, -4.0, math.nan]), np.array([0.0, 0.0, 10.0]))
    lines = {layer.name: layer for layer in chart.panel.layers if layer.role.startswith("return-")}
    assert list(lines) == [
        "link kept",
        "less than 6 dB above the fade margin",
        "terrain below the radio path unknown",
        "below the fade margin",
    ]
    # Kept from 0 to the first weak point at 200 m, weak to 300 m, lost to 400 m.
    assert lines["link kept"].y[:3].tolist() == [0.0, 100.0, 200.0]
    assert lines["less than 6 dB above the fade margin"].y[:2].tolist() == [200.0, 300.0]
    assert lines["below the fade margin"].y[:2].tolist() == [300.0, 400.0]


def test_the_chart_has_margin_loss_and_distance() -> None:
    chart = link_chart(example_log().setup, along([20.0, -1.0]))
    assert [panel.label for panel in chart.panels] == ["link margin (dB)", "terrain loss (dB)", "distance (km)"]
    assert chart.panels[0].layers[0].y.tolist() == [20.0, -1.0]
    assert chart.panels[2].layers[0].y.tolist() == pytest.approx([0.0, 0.1])
    assert chart.title.endswith("the radio link over time")
