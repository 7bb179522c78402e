"""Positions of a scenario file: in metres or degrees, above the sea or above the ground, inside the area."""

import math
from typing import Any

import numpy as np
import pytest

from world.errors import ScenarioError
from world.frames import GeoOrigin
from world.map_positions import check_altitude, check_in_area, make_threats, map_position
from world.scenario_tables import PointTable, ThreatTable
from world.terrain import Terrain, make_gridded_terrain

ORIGIN = GeoOrigin(46.0, 8.0)
BOUNDS = np.array([[-1000.0, 1000.0], [-2000.0, 2000.0]])


def ramp() -> Terrain:
    """Ground that is 200 m high at east 0 and rises by 0.1 m a metre to the east."""
    east, north = np.linspace(-3000.0, 3000.0, 7), np.linspace(-3000.0, 3000.0, 7)
    heights = np.tile(200.0 + 0.1 * east, (7, 1))
    return make_gridded_terrain(heights, east, north, source="ramp", sha256="", datum="mean sea level")


def placed(ground: Terrain | None, **table: Any) -> list[float]:
    return map_position(PointTable(**table), "start", "s.toml", ORIGIN, ground).tolist()


def test_heights_count_from_the_sea_or_from_the_ground() -> None:
    assert placed(ramp(), east_m=500.0, north_m=-40.0, amsl_m=90.0) == [500.0, -40.0, 90.0]
    assert placed(ramp(), east_m=500.0, north_m=-40.0, height_m=90.0) == pytest.approx([500.0, -40.0, 340.0])
    assert placed(ramp(), east_m=-500.0, north_m=-40.0) == pytest.approx([-500.0, -40.0, 150.0])


def test_degrees_come_to_the_map() -> None:
    assert placed(None, lat_deg=46.0, lon_deg=8.0, amsl_m=5.0) == pytest.approx([0.0, 0.0, 5.0], abs=1e-6)
    # A degree of latitude at 46 degrees on WGS84 is 111.15 km, one of longitude 77.46 km.
    east, north, _ = placed(None, lat_deg=46.01, lon_deg=8.01, amsl_m=5.0)
    assert (east, north) == pytest.approx((774.6, 1111.5), abs=0.5)
    # Degrees of zero are degrees too.
    here = map_position(PointTable(lat_deg=0.0, lon_deg=0.0, amsl_m=1.0), "start", "s", GeoOrigin(0.0, 0.0), None)
    assert here.tolist() == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)


@pytest.mark.parametrize(("ground", "east"), [(None, 0.0), (ramp(), 9000.0)])
def test_a_height_needs_ground_to_count_from(ground: Terrain | None, east: float) -> None:
    place = rf"east {east:.0f} m, north 0 m \(latitude 4[56]\.\d+, longitude 8\.\d+\)"
    message = rf"^s\.toml: start: {place}: no terrain there .*; give amsl_m$"
    with pytest.raises(ScenarioError, match=message):
        placed(ground, east_m=east, north_m=0.0, height_m=50.0)
    assert placed(ground, east_m=east, north_m=0.0, amsl_m=50.0) == [east, 0.0, 50.0]


def test_a_point_outside_the_area_says_by_how_far_and_where_the_area_is() -> None:
    with pytest.raises(ScenarioError) as caught:
        check_in_area("start", np.array([1250.0, 0.0, 400.0]), "s.toml", BOUNDS, ORIGIN)
    # A degree of latitude at 46 degrees on WGS84 is 111.15 km, one of longitude 77.46 km.
    assert str(caught.value) == (
        "s.toml: start: east 1250 m: 250 m outside the area, which reaches from -1000 to 1000 m"
        " (the area covers latitude 45.9820..46.0180, longitude 7.9871..8.0129)"
    )


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ((1000.0, 2000.0, 301.0), ""),
        ((-1000.0, -2000.0, 500.0), ""),
        ((1000.1, 0.0, 400.0), "east 1000 m: 0.1 m outside the area, which reaches from -1000 to 1000 m"),
        ((-1000.1, 0.0, 400.0), "east -1000 m: 0.1 m outside the area, which reaches from -1000 to 1000 m"),
        ((0.0, 2000.1, 400.0), "north 2000 m: 0.1 m outside the area, which reaches from -2000 to 2000 m"),
        ((0.0, math.nan, 400.0), "north nan m: nan m outside the area"),
        ((0.0, 0.0, 149.0), "149 m AMSL: below the floor, 150 m AMSL"),
        ((0.0, 0.0, 501.0), "501 m AMSL: above the ceiling, 500 m AMSL"),
        ((0.0, 0.0, math.nan), "nan m AMSL: "),
        ((500.0, 0.0, 249.9), "250 m AMSL: not above the terrain, which is at 250 m"),
        ((500.0, 0.0, 250.1), ""),
    ],
)
def test_ends_stand_in_the_area_between_floor_and_ceiling_above_the_ground(
    point: tuple[float, float, float], message: str
) -> None:
    def check() -> None:
        check_in_area("start", np.array(point), "s.toml", BOUNDS, ORIGIN)
        check_altitude("start", np.array(point), "s.toml", 150.0, 500.0, ramp())

    if not message:
        check()
        return
    with pytest.raises(ScenarioError) as caught:
        check()
    assert str(caught.value).startswith(f"s.toml: start: {message}")


def test_threats_stand_on_the_ground_unless_they_give_a_height() -> None:
    here = {"east_m": 1000.0, "north_m": 0.0}
    missile, radar = (
        {"kill_radius_m": 700.0, "kill_scale_m": 70.0},
        {"detection_radius_m": 9.0, "detection_scale_m": 3.0},
    )
    tables = [
        ThreatTable(**here, **missile),
        ThreatTable(**here, **radar, name="tall", height_m=25.0),
        ThreatTable(**here, **missile, **radar, amsl_m=12.0),
    ]
    threats = make_threats(tables, "s.toml", ORIGIN, ramp())
    assert threats.names == ("threat 1", "tall", "threat 3")
    assert threats.position.tolist() == [
        pytest.approx([1000.0, 0.0, 300.0]),
        pytest.approx([1000.0, 0.0, 325.0]),
        [1000.0, 0.0, 12.0],
    ]
    assert threats.kill_radius.tolist() == [700.0, 0.0, 700.0]
    assert threats.kill_scale.tolist() == [70.0, 0.0, 70.0]
    assert threats.detection_radius.tolist() == [0.0, 9.0, 9.0]
    assert threats.detection_scale.tolist() == [0.0, 3.0, 3.0]
    with pytest.raises(ScenarioError, match=r"^s\.toml: threats\[1\]: .*no terrain there"):
        make_threats([tables[2], tables[0]], "s.toml", ORIGIN, None)
