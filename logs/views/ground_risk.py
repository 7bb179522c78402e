"""Map the ground risk of a mission: its ground risk volumes over the population density."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from flight.simulation.setup import FlightSetup
from logs.verdict.returns.glide_footprint import outline_parts
from logs.views.charts import Label, Layer
from logs.views.glides import make_area_layer
from logs.views.map import MapChart, NamedWind, end_labels, map_extent, scenario_map
from world.population import DENSITY_LIMITS_PER_KM2, Population, format_density

# Names of the population density bands, from the lowest density.
_BAND_NAMES = (
    *(f"below {limit:,.0f} people/km²" for limit in DENSITY_LIMITS_PER_KM2),
    f"from {DENSITY_LIMITS_PER_KM2[-1]:,.0f} people/km²",
)


class RiskVolume(NamedTuple):
    """A volume around a mission that a ground risk assessment considers.

    name: name of the volume, such as "flight geography".
    role: role in `logs.theme` that gives its style.
    area: area on the map, in m east and north of the origin.
    height: height above ground, m; None for an area on the ground.
    """

    name: str
    role: str
    area: BaseGeometry
    height: float | None


def ground_risk_map(setup: FlightSetup, volumes: Sequence[RiskVolume], population: Population | None) -> MapChart:
    """Make a map of the ground risk volumes of a mission over the population density.

    volumes: volumes from the smallest to the largest.
    population: population around the mission; None to draw none.
    """
    scenario, route = setup.scenario, setup.route.positions
    outline = shapely.get_coordinates(shapely.union_all([volume.area for volume in volumes]))
    extent = map_extent(scenario, route, [np.column_stack([outline, np.zeros(len(outline))])])
    layers, labels = [], []
    if population is not None:
        layers += [
            make_area_layer(_BAND_NAMES[band], f"population-{band}", parts)
            for band, area in population.bands
            if (parts := outline_parts(area))
        ]
    layers += [make_area_layer(volume.name, volume.role, outline_parts(volume.area)) for volume in reversed(volumes)]
    layers.append(Layer("line", "route of the mission", "planned", route[:, 0], route[:, 1], quiet=True))
    if population is not None:
        east, north = population.max_place
        layers.append(Layer("dots", "highest density", "comes-down", np.array([east]), np.array([north])))
        labels.append(Label(format_density(population.max_density), east, north, "end", "ink", (1, 1)))
    return scenario_map(
        scenario,
        "ground risk",
        layers,
        [*labels, *end_labels(scenario, route, setup.route.items.tolist())],
        extent,
        route=route,
        winds=(NamedWind(scenario.wind),),
    )
