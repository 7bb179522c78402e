"""Export the ground risk volumes of a flight as KML and GeoJSON (RFC 7946)."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from flight.simulation.setup import FlightSetup
from logs.verdict.returns.glide_footprint import outline_parts
from logs.views.exports.map_files import MapZone, kml_text, plan_line
from logs.views.ground_risk import RiskVolume
from world.arrays import Floats
from world.frames import to_geo
from world.raster_file import longitude_near


def risk_kml(setup: FlightSetup, volumes: Sequence[RiskVolume]) -> str:
    """Return a KML document with the ground risk volumes and the planned route."""
    zones = [
        MapZone(
            volume.name,
            tuple(tuple(_to_degrees(setup, ring)[:, ::-1] for ring in part) for part in outline_parts(volume.area)),
            volume.height,
            above_ground=True,
            folder="ground risk",
            role=volume.role,
        )
        for volume in volumes
    ]
    return kml_text(f"{setup.scenario.name}: ground risk", [plan_line(setup)], zones)


def risk_geojson(setup: FlightSetup, volumes: Sequence[RiskVolume], properties: dict[str, Any]) -> str:
    """Return a GeoJSON document with a feature for each ground risk volume.

    At the antimeridian, longitudes continue beyond 180 degrees, so that no area is split.

    properties: properties that all features get in addition to their name and their height above ground.
    """
    features = [
        {
            "type": "Feature",
            "properties": {
                "name": volume.name,
                "height_above_ground_m": None if volume.height is None else round(volume.height, 1),
                **properties,
            },
            "geometry": {
                "type": "MultiPolygon",
                "coordinates": [
                    [_to_degrees(setup, ring).round(7).tolist() for ring in part] for part in outline_parts(volume.area)
                ],
            },
        }
        for volume in volumes
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}, indent=1) + "\n"


def _to_degrees(setup: FlightSetup, ring: Floats) -> Floats:
    """Convert an outline from east and north, m, (n, 2), to longitude and latitude, degrees, (n, 2).

    Longitudes do not jump at the antimeridian: they continue beyond 180 degrees.
    """
    origin = setup.scenario.origin
    lat, lon = to_geo(origin, ring[:, 0], ring[:, 1])
    return np.column_stack([longitude_near(lon, origin.lon_deg), lat])
