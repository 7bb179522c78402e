"""Chart a radio link over time, and map its quality along the path and over the area."""

from dataclasses import dataclass
from itertools import groupby
from typing import Literal

import numpy as np

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.link_coverage import LinkCoverage, flight_height, link_coverage
from logs.verdict.measures.link_outages import LinkAlongPath, link_along_path, station_antenna
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.returns.glide_footprint import cell_outlines
from logs.views.charts import Chart, Label, Layer, Panel, series, shorten
from logs.views.glides import make_area_layer
from logs.views.map import Extent, MapChart, NamedWind, end_labels, map_extent, scenario_map
from logs.views.returns import path_layers
from world.arrays import Floats

# The map calls a link weak if its signal exceeds the fade margin by less than this, dB.
WEAK_MARGIN_DB = 6.0
LinkQuality = Literal["kept", "weak", "lost", "unknown"]
# If this fraction of the first Fresnel zone is free of ground, the loss is close to the loss in free space.
_CLEAR_FRACTION = 0.6
# Largest clearance that the chart shows, in radii of the first Fresnel zone; more makes no difference.
_MAX_SHOWN_CLEARANCE = 3.0
# Role and name of a path segment by the quality of the link there; the first is drawn lowest.
_ROLES_AND_NAMES: dict[LinkQuality, tuple[str, str]] = {
    "kept": ("return-safe", "link kept"),
    "weak": ("return-low", f"less than {WEAK_MARGIN_DB:.0f} dB above the fade margin"),
    "unknown": ("return-unknown", "terrain below the radio path unknown"),
    "lost": ("return-ground", "below the fade margin"),
}


def link_quality(margin: float) -> LinkQuality:
    """Classify a link by its margin: how far the signal exceeds the fade margin, dB; NaN if unknown.

    >>> link_quality(8.0), link_quality(2.0), link_quality(-1.0), link_quality(float("nan"))
    ('kept', 'weak', 'lost', 'unknown')
    """
    if np.isnan(margin):
        return "unknown"
    return "lost" if margin < 0.0 else "weak" if margin < WEAK_MARGIN_DB else "kept"


@dataclass(frozen=True, slots=True, eq=False)
class DrawnLink:
    """Data for the pictures of a radio link.

    along: the link along the path.
    antenna: position of the station's antenna, m, (3,).
    coverage: the link in each cell of the map, for an aircraft at the path's median height.
    extent: range of the map.
    is_flown: True if the path was flown, False for the planned path.
    """

    along: LinkAlongPath
    antenna: Floats
    coverage: LinkCoverage
    extent: Extent
    is_flown: bool


def compute_link(setup: FlightSetup, along: LinkAlongPath, antenna: Floats, *, is_flown: bool) -> DrawnLink | None:
    """Compute the coverage of a radio link around a path, and collect the data for its pictures.

    Return None if the scenario has no link or no terrain, or the path has no positions.

    along: the link along the path.
    antenna: position of the station's antenna, m, (3,).
    is_flown: True if the path was flown.
    """
    link, terrain = setup.scenario.link, setup.scenario.terrain
    if link is None or terrain is None or not len(along.positions):
        return None
    extent = map_extent(setup.scenario, setup.route.positions, [along.positions, antenna[None, :]])
    coverage = link_coverage(link, terrain, antenna, flight_height(terrain, along.positions), extent)
    return DrawnLink(along, antenna, coverage, extent, is_flown)


def compute_scenario_link(setup: FlightSetup, track: Track | None) -> DrawnLink | None:
    """Compute the scenario's radio link along a flight or plan, and the data for its pictures.

    Return None if the scenario has no link or no terrain, the station's position is unknown, or the path has no
    positions.

    track: flown track; None for the planned path.
    """
    link, terrain = setup.scenario.link, setup.scenario.terrain
    antenna = None if link is None or terrain is None else station_antenna(setup, link, terrain)
    if link is None or terrain is None or antenna is None:
        return None
    if track is None:
        path = route_requirements(setup).path
        along = link_along_path(link, terrain, antenna, path.times, path.points)
    else:
        along = link_along_path(link, terrain, antenna, track.time, track.position)
    return compute_link(setup, along, antenna, is_flown=track is not None)


def link_chart(setup: FlightSetup, drawn: DrawnLink) -> Chart:
    """Chart link margin, diffraction loss, Fresnel clearance and distance to the station over time."""
    along, points = drawn.along, drawn.along.points
    name, role = ("flown", "flown") if drawn.is_flown else ("planned path", "planned")

    def make_panel(
        title: str, unit: str, values: Floats, limits: tuple[tuple[str, float], ...] = (), note: str = ""
    ) -> Panel:
        """Make a panel of one quantity along the path over time.

        limits: name and value of each limit line.
        note: text on values that are not shown.
        """
        return Panel(title, unit, (series(name, role, along.time, values),), limits=limits, note=note)

    clearance = np.clip(points.fresnel_clearance, -_MAX_SHOWN_CLEARANCE, _MAX_SHOWN_CLEARANCE)
    zone_limits = (("line of sight", 0.0), (f"{100.0 * _CLEAR_FRACTION:.0f} % of the first zone", _CLEAR_FRACTION))
    panels = (
        make_panel("link margin", "dB", points.margin, (("required", 0.0),)),
        make_panel("diffraction loss", "dB", points.diffraction_loss),
        make_panel(
            "Fresnel clearance", "radii", clearance, zone_limits, f"limited to {_MAX_SHOWN_CLEARANCE:.0f} radii"
        ),
        make_panel("distance", "km", points.distance / 1000.0),
    )
    title = f"{shorten(setup.scenario.name, 60)}: the radio link over time"
    return Chart(title, "time since the start", "s", panels, timed=drawn.is_flown)


def link_map(setup: FlightSetup, drawn: DrawnLink) -> MapChart:
    """Map a radio link: its quality along the path, the areas of a weak or lost link, and the station.

    The areas apply to an aircraft at the flight's median height.
    """
    scenario, route, along = setup.scenario, setup.route.positions, drawn.along
    points, antenna = along.points, drawn.antenna
    qualities = [link_quality(float(margin)) for margin in points.margin]
    segments = []
    for quality, group in groupby(range(len(qualities)), lambda k: qualities[k]):
        # Each segment reaches to the first point of the next, so that the path has no gaps.
        rows = list(group)
        segments.append((quality, [*rows, *range(rows[-1] + 1, min(rows[-1] + 2, len(qualities)))]))

    def find_position(k: int) -> tuple[float, float]:
        """Return east and north of point k of the path, m."""
        return float(along.positions[k, 0]), float(along.positions[k, 1])

    def describe_point(k: int) -> str:
        """Return the time and the link margin at point k of the path as text."""
        return f"{along.time[k]:.0f} s: {points.margin[k]:.1f} dB above the fade margin"

    # Areas in which the link is weak, lost or in the ground, at the flight's height.
    coverage = drawn.coverage
    is_weak = (coverage.margin >= 0.0) & (coverage.margin < WEAK_MARGIN_DB)
    height_text = coverage.height.text
    areas = (
        (f"at {height_text}: less than {WEAK_MARGIN_DB:.0f} dB above the fade margin", "coverage-weak", is_weak),
        (f"at {height_text}: below the fade margin", "coverage-lost", coverage.margin < 0.0),
        (f"ground above {height_text}", "coverage-ground", coverage.is_in_ground),
    )
    coverage_layers = [
        make_area_layer(name, role, parts)
        for name, role, is_chosen in areas
        if (parts := cell_outlines(coverage.west, coverage.south, coverage.side, is_chosen))
    ]
    layers = [
        *coverage_layers,
        *path_layers(segments, _ROLES_AND_NAMES, find_position, describe_point),
    ]
    layers.append(Layer("dots", "station", "waypoint", antenna[:1], antenna[1:2], hover_texts=("station",)))
    label = Label("station", float(antenna[0]), float(antenna[1]), "end", "waypoint", (1, 1))
    return scenario_map(
        scenario,
        f"the radio link along the path, and at {drawn.coverage.height.text}",
        layers,
        [label, *end_labels(scenario, route, setup.route.items.tolist())],
        drawn.extent,
        route=route,
        winds=(NamedWind(scenario.wind),),
    )
