"""The map of the ground risk: volumes and population where the data state them, and KML and GeoJSON read back."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely

from flight.simulation.setup import FlightSetup
from logs.recording.example_log import example_log
from logs.views.exports.map_files import KML
from logs.views.exports.risk_files import risk_geojson, risk_kml
from logs.views.ground_risk import RiskVolume, ground_risk_map
from world.frames import to_map
from world.population import Population

VOLUMES = (
    RiskVolume("flight geography", "flight-geography", shapely.box(0.0, 0.0, 100.0, 50.0), 120.0),
    RiskVolume(
        "footprint",
        "ground-risk-buffer",
        shapely.box(-400.0, -400.0, 500.0, 450.0) - shapely.box(200.0, 200.0, 300.0, 300.0),
        None,
    ),
)
POPULATION = Population(
    "made.tif", 1.0, 312.0, 40.0, (46.0, 8.0), (60.0, 70.0), 100.0, ((2, shapely.box(50.0, 60.0, 150.0, 160.0)),)
)


@pytest.fixture(scope="module")
def setup() -> FlightSetup:
    return example_log().setup


def test_the_map_shows_volumes_over_the_population(setup: FlightSetup) -> None:
    chart = ground_risk_map(setup, VOLUMES, POPULATION)
    layers = {layer.name: layer for layer in chart.panel.layers}
    geography = layers["flight geography"]
    assert (geography.x.min(), geography.x.max(), geography.y.max()) == (0.0, 100.0, 50.0)
    people = layers["below 500 people/km²"]
    assert (people.role, people.x.min(), people.y.max()) == ("population-2", 50.0, 160.0)
    densest = layers["highest density"]
    assert (densest.x[0], densest.y[0]) == (60.0, 70.0)
    names = [layer.name for layer in chart.panel.layers]
    assert names.index("below 500 people/km²") < names.index("footprint") < names.index("flight geography")
    assert any(label.text == "312 people/km²" for label in chart.panel.labels)
    assert chart.east[0] <= -400.0
    assert chart.east[1] >= 500.0


def test_the_map_needs_no_population(setup: FlightSetup) -> None:
    chart = ground_risk_map(setup, VOLUMES, None)
    assert not any(layer.role.startswith("population") for layer in chart.panel.layers)


def test_geojson_reads_back(setup: FlightSetup) -> None:
    document = json.loads(risk_geojson(setup, VOLUMES, {"ground_risk_class": 5}))
    assert document["type"] == "FeatureCollection"
    properties = [feature["properties"] for feature in document["features"]]
    assert properties[0] == {"name": "flight geography", "height_above_ground_m": 120.0, "ground_risk_class": 5}
    assert properties[1]["height_above_ground_m"] is None

    def to_plane(points: np.ndarray) -> np.ndarray:
        """Convert longitudes and latitudes to positions on the map."""
        return np.column_stack(to_map(setup.scenario.origin, points[:, 1], points[:, 0]))

    for feature, volume in zip(document["features"], VOLUMES, strict=True):
        shape = shapely.geometry.shape(feature["geometry"])
        assert shape.is_valid
        # RFC 7946: the outline counter-clockwise, its holes clockwise.
        assert shape.geoms[0].exterior.is_ccw
        assert not any(ring.is_ccw for ring in shape.geoms[0].interiors)
        # Degrees have 7 decimals, 1 cm along an outline of 3.5 km.
        assert shapely.transform(shape, to_plane).symmetric_difference(volume.area).area < 35.0


def test_kml_reads_back(setup: FlightSetup) -> None:
    root = ElementTree.fromstring(risk_kml(setup, VOLUMES))
    marks = {mark.findtext(f"{{{KML}}}name"): mark for mark in root.iter(f"{{{KML}}}Placemark")}
    body = marks["flight geography"]
    assert next(body.iter(f"{{{KML}}}altitudeMode")).text == "relativeToGround"
    lon, lat, up = map(float, (next(body.iter(f"{{{KML}}}coordinates")).text or "").split()[0].split(","))
    east, north = to_map(setup.scenario.origin, lat, lon)
    assert float(shapely.Point(float(east), float(north)).distance(VOLUMES[0].area.exterior)) < 0.1
    assert up == 120.0
    assert len(list(marks["footprint"].iter(f"{{{KML}}}innerBoundaryIs"))) == 1
