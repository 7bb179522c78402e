"""Chart a radio link: margin, terrain loss and distance over time, and the path by the quality of the link."""

from itertools import groupby
from typing import Literal

import numpy as np

from flight.simulation.setup import FlightSetup
from logs.verdict.measures.link_outages import LinkAlongPath
from logs.views.charts import Chart, Label, Layer, Panel, series, shorten
from logs.views.map import MapChart, NamedWind, end_labels, map_extent, scenario_map
from logs.views.returns import path_layers
from world.arrays import Floats

# Margin above the fade margin below which the map calls the link weak, dB.
WEAK_MARGIN_DB = 6.0
LinkQuality = Literal["kept", "weak", "lost", "unknown"]
# Role and name of the path by the quality of the link; the first is drawn lowest.
_LOOKS: dict[LinkQuality, tuple[str, str]] = {
    "kept": ("return-safe", "link kept"),
    "weak": ("return-low", f"less than {WEAK_MARGIN_DB:.0f} dB above the fade margin"),
    "unknown": ("return-unknown", "terrain below the radio path unknown"),
    "lost": ("return-ground", "below the fade margin"),
}


def link_quality(margin: float) -> LinkQuality:
    """Return the quality of a link from its margin above the fade margin, dB.

    >>> link_quality(8.0), link_quality(2.0), link_quality(-1.0), link_quality(float("nan"))
    ('kept', 'weak', 'lost', 'unknown')
    """
    if np.isnan(margin):
        return "unknown"
    return "lost" if margin < 0.0 else "weak" if margin < WEAK_MARGIN_DB else "kept"


def link_chart(setup: FlightSetup, along: LinkAlongPath) -> Chart:
    """Chart the margin above the fade margin, the terrain loss and the distance over time."""
    points = along.points

    def panel(title: str, unit: str, values: Floats, limits: tuple[tuple[str, float], ...] = ()) -> Panel:
        """Return a panel of values over time.

        limits: names and values of the limit lines.
        """
        return Panel(title, unit, (series("flown", "flown", along.time, values),), limits=limits)

    panels = (
        panel("link margin", "dB", points.margin, (("required", 0.0),)),
        panel("terrain loss", "dB", points.diffraction_loss),
        panel("distance", "km", points.distance / 1000.0),
    )
    title = f"{shorten(setup.scenario.name, 60)}: the radio link over time"
    return Chart(title, "time since the start", "s", panels, timed=True)


def link_map(setup: FlightSetup, along: LinkAlongPath, antenna: Floats) -> MapChart:
    """Return a map of the path, coloured by the quality of the link, and of the station.

    antenna: position of the station's antenna, m, (3,).
    """
    scenario, route, points = setup.scenario, setup.route.positions, along.points
    qualities = [link_quality(float(margin)) for margin in points.margin]
    segments = []
    for quality, group in groupby(range(len(qualities)), lambda k: qualities[k]):
        # Each segment reaches to the first point of the next, so that the path has no gaps.
        rows = list(group)
        segments.append((quality, [*rows, *range(rows[-1] + 1, min(rows[-1] + 2, len(qualities)))]))

    def position(k: int) -> tuple[float, float]:
        """Return east and north of point k, m."""
        return float(along.positions[k, 0]), float(along.positions[k, 1])

    def point_text(k: int) -> str:
        """Describe the link margin at point k."""
        return f"{along.time[k]:.0f} s: {points.margin[k]:.1f} dB above the fade margin"

    layers = path_layers(segments, _LOOKS, position, point_text)
    layers.append(Layer("dots", "station", "waypoint", antenna[:1], antenna[1:2], hover_texts=("station",)))
    label = Label("station", float(antenna[0]), float(antenna[1]), "end", "waypoint", (1, 1))
    return scenario_map(
        scenario,
        "the radio link along the flight",
        layers,
        [label, *end_labels(scenario, route, setup.route.stops.tolist())],
        map_extent(scenario, route, [along.positions, antenna[None, :]]),
        route=route,
        winds=(NamedWind(scenario.wind),),
    )
