"""Map flight without an engine: heights to glide home from, flat ground, and reachable places."""

import numpy as np

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.returns.drawn_returns import DrawnReturns
from logs.verdict.returns.glide_footprint import BAND_ROLES, Part
from logs.verdict.returns.glides_text import reached_text, site_text
from logs.verdict.returns.judge_glides import REACHES, Reach
from logs.views.charts import Label, Layer
from logs.views.map import Extent, MapChart, NamedWind, end_labels, map_extent, scenario_map
from logs.views.returns import east_and_north, path_layers, split_path_by_reach

# Role and name of a path segment, by the destination within reach without an engine.
_ROLES_AND_NAMES: dict[Reach, tuple[str, str]] = {reach: (f"reach-{reach}", reached_text(reach)) for reach in REACHES}


def glide_chart(setup: FlightSetup, drawn_returns: DrawnReturns, track: Track | None) -> MapChart | None:
    """Map the glide footprint, and the path coloured by the best destination within gliding reach.

    The footprint consists of the areas from which home or another site can be reached without an engine.  Return None
    if glides were not judged.

    track: flown track; None for glides from the planned path.
    """
    glides, scenario, route = drawn_returns.glides, setup.scenario, setup.route.positions
    if not glides.each:
        return None
    sites = np.array([[site.east, site.north, 0.0] for site in glides.sites])
    extent = map_extent(scenario, route, [sites, np.array([glide.start for glide in glides.each])])
    layers = make_footprint_layers(drawn_returns, extent)
    segments = split_path_by_reach(setup, drawn_returns, track)
    layers += path_layers(
        segments,
        _ROLES_AND_NAMES,
        east_and_north,
        lambda point: (
            f"{point.element.time:.0f} s: {reached_text(point.element.reach)}"
            + (f", {left:.0f} m of altitude to spare" if (left := glides.altitude_left(point.element)) >= 0.0 else "")
        ),
    )
    impacts = np.array([glide.own_return.impact for glide in glides.each if glide.own_return.end == "ground"])
    if len(impacts):
        name = f"place where {glides.autopilot}'s own return meets the ground"
        layers.append(Layer("dots", name, "comes-down", impacts[:, 0], impacts[:, 1], quiet=True))
    names = tuple(site_text(site) for site in glides.sites)
    layers.append(
        Layer("dots", "home, rally point or landing", "waypoint", sites[:, 0], sites[:, 1], hover_texts=names)
    )
    labels = [
        Label(name, site.east, site.north, "end", "waypoint") for name, site in zip(names, glides.sites, strict=True)
    ]
    return scenario_map(
        scenario,
        "without its engine",
        layers,
        [*labels, *end_labels(scenario, route, setup.route.items.tolist())],
        extent,
        route=route,
        winds=(NamedWind(scenario.wind),),
    )


def make_footprint_layers(drawn_returns: DrawnReturns, extent: Extent) -> list[Layer]:
    """Return the layers of the glide footprint; [] if no footprint was computed.

    There is an area for each band of heights above ground from which a glide reaches a site.  Another area is the flat
    ground on which a glide can end.

    extent: range of the map, outside which areas are cut off.
    """
    footprint = drawn_returns.glides.footprint
    if footprint is None:
        return []
    layers, place = [], "home, rally point or landing" if len(drawn_returns.glides.sites) > 1 else "home"
    for band in footprint.bands(*extent):
        name = f"{place} in reach from {band.max_height:.0f} m above ground"
        layers.append(make_area_layer(name, BAND_ROLES[band.max_height], band.parts))
    flat_parts = footprint.landings(*extent)
    return layers + (
        [make_area_layer("flat ground according to the elevation file", "landable", flat_parts)] if flat_parts else []
    )


def make_area_layer(name: str, role: str, parts: tuple[Part, ...]) -> Layer:
    """Make one layer of areas with holes; NaN separates their rings.

    parts: rings of each area, m, (k, 2): first its outline, then its holes; at least one area.
    """
    gap = np.full((1, 2), np.nan)
    x, y = np.vstack([points for part in parts for ring in part for points in (ring, gap)])[:-1].T
    return Layer("area", name, role, x, y, hover_texts=(name,))
