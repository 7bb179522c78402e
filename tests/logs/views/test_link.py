"""The path by the quality of its link: margins by hand, a map without gaps, and the coverage below it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from logs.recording.example_log import example_log
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.measures.link_coverage import FlightHeight, LinkCoverage
from logs.verdict.measures.link_outages import LinkAlongPath, Outage
from logs.views.figures import figure_views, make_subject
from logs.views.link import WEAK_MARGIN_DB, DrawnLink, compute_scenario_link, link_chart, link_map, link_quality
from world.radio import LinkPoints
from world.scenario import with_link


def along(margins: list[float], clearance: float = 1.0) -> LinkAlongPath:
    margin = np.array(margins)
    count = len(margin)
    positions = np.column_stack([np.zeros(count), 100.0 * np.arange(count), np.full(count, 300.0)])
    points = LinkPoints(margin, 100.0 * np.arange(count), np.zeros(count), margin >= 0.0, np.full(count, clearance))
    return LinkAlongPath(np.arange(float(count)), positions, points, (Outage(1.0, 2.0),))


def drawn(path: LinkAlongPath, margin: list[list[float]] | None = None) -> DrawnLink:
    cells = np.array([[20.0, 20.0]] if margin is None else margin)
    coverage = LinkCoverage(-200.0, 0.0, 100.0, FlightHeight(120.0, True), cells, np.isinf(cells))
    extent = ((-200.0, 200.0), (-100.0, 400.0))
    return DrawnLink(path, np.array([0.0, 0.0, 10.0]), coverage, extent, is_flown=True)


def linked_setup() -> FlightSetup:
    setup = example_log().setup
    origin = setup.scenario.origin
    entries = {"frequency_mhz": 1000.0, "power_dbm": 20.0, "sensitivity_dbm": -100.0}
    return setup.in_scenario(with_link(setup.scenario, **entries, lat_deg=origin.lat_deg, lon_deg=origin.lon_deg))


@pytest.mark.parametrize(
    ("margin", "quality"),
    [(WEAK_MARGIN_DB, "kept"), (WEAK_MARGIN_DB - 0.01, "weak"), (0.0, "weak"), (-0.01, "lost"), (math.nan, "unknown")],
)
def test_the_quality_is_by_the_margin(margin: float, quality: str) -> None:
    assert link_quality(margin) == quality


def test_the_map_has_a_line_for_each_quality_and_no_gap() -> None:
    setup = example_log().setup
    chart = link_map(setup, drawn(along([20.0, 20.0, 3.0, -4.0, math.nan])))
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


def test_the_map_shows_where_the_link_is_weak_or_lost_or_in_the_ground() -> None:
    """Cells of 100 m from (-200, 0): weak, lost, kept; and above them in the ground, unknown, lost."""
    chart = link_map(example_log().setup, drawn(along([20.0, 20.0]), [[5.9, -0.1, 6.0], [math.inf, math.nan, -30.0]]))
    areas = {
        layer.role: (layer.name, layer.x[np.isfinite(layer.x)], layer.y[np.isfinite(layer.y)])
        for layer in chart.panel.layers
        if layer.role.startswith("coverage-")
    }
    assert set(areas) == {"coverage-weak", "coverage-lost", "coverage-ground"}
    name, x, y = areas["coverage-weak"]
    assert name == "at 120 m above ground: less than 6 dB above the fade margin"
    assert (x.min(), x.max(), y.min(), y.max()) == (-200.0, -100.0, 0.0, 100.0)
    _, x, y = areas["coverage-ground"]
    assert (x.min(), x.max(), y.min(), y.max()) == (-200.0, -100.0, 100.0, 200.0)
    _, x, y = areas["coverage-lost"]
    assert (x.min(), x.max(), y.min(), y.max()) == (-100.0, 100.0, 0.0, 200.0)
    assert chart.title.endswith("the radio link along the path, and at 120 m above ground")


def test_the_chart_has_margin_loss_clearance_and_distance() -> None:
    chart = link_chart(example_log().setup, drawn(along([20.0, -1.0], clearance=7.0)))
    labels = ["link margin (dB)", "diffraction loss (dB)", "Fresnel clearance (radii)", "distance (km)"]
    assert [panel.label for panel in chart.panels] == labels
    assert chart.panels[0].layers[0].y.tolist() == [20.0, -1.0]
    # More than three radii make no difference.
    assert chart.panels[2].layers[0].y.tolist() == [3.0, 3.0]
    assert chart.panels[3].layers[0].y.tolist() == pytest.approx([0.0, 0.1])
    assert chart.title.endswith("the radio link over time")


def test_a_report_has_the_link_only_where_the_scenario_has_one() -> None:
    log, setup = example_log(), linked_setup()
    for track in (log.track, None):
        views = figure_views(make_subject(setup, track, judge_geometry(setup)))
        assert {"link", "link-map"} <= set(views)
        without = figure_views(make_subject(log.setup, track, judge_geometry(log.setup)))
        assert not {"link", "link-map"} & set(without)


def test_a_plan_is_drawn_along_its_path_and_a_flight_along_its_track() -> None:
    log, setup = example_log(), linked_setup()
    plan, flight = compute_scenario_link(setup, None), compute_scenario_link(setup, log.track)
    assert plan is not None
    assert flight is not None
    assert (plan.is_flown, flight.is_flown) == (False, True)
    assert flight.along.time[-1] == log.track.time[-1]
    assert plan.along.positions[-1] == pytest.approx(setup.route.positions[-1])
    nowhere = setup.in_scenario(replace(setup.scenario, terrain=None))
    assert compute_scenario_link(nowhere, log.track) is None
