"""Coverage of a radio link at a flight's height: margins by hand, and cells that are in the ground."""

import numpy as np
import pytest

from logs.verdict.measures.link_coverage import FlightHeight, flight_height, link_coverage
from world.frames import GeoOrigin
from world.radio import RadioLink, free_space_loss, link_points, make_link
from world.scenario_tables import LinkTable
from world.terrain import Terrain, make_flat_terrain, make_gridded_terrain

FLAT = make_flat_terrain(np.array([[-20_000.0, 20_000.0], [-20_000.0, 20_000.0]]), 50.0, 0.0)
EXTENT = ((-3000.0, 6000.0), (-1500.0, 3000.0))


def link_of_120_db() -> RadioLink:
    table = LinkTable(frequency_mhz=1000.0, power_dbm=20.0, sensitivity_dbm=-110.0, east_m=0.0, north_m=0.0)
    link = make_link(table, "mine.toml", GeoOrigin(46.0, 8.0), None)
    assert link is not None
    return link


def slope() -> Terrain:
    """Return ground that rises by 100 m per km to the east, without data at its western edge."""
    axis = np.arange(-4000.0, 8001.0, 100.0)
    heights = np.tile(0.1 * axis, (axis.size, 1))
    heights[:, :20] = np.nan
    return make_gridded_terrain(heights, axis, axis, source="slope", sha256="", datum="")


def test_margins_are_those_of_free_space_over_level_ground() -> None:
    """From 1000 m nothing enters the Fresnel zone: 120 dB less the loss over the slant distance at each centre."""
    height = FlightHeight(1050.0, is_above_ground=False)
    coverage = link_coverage(link_of_120_db(), FLAT, np.array([0.0, 0.0, 1050.0]), height, EXTENT)
    # 9 km in 150 cells are 60 m each; 4.5 km are 75 of them.
    assert (coverage.margin.shape, coverage.side) == ((75, 150), 60.0)
    for row, column in ((0, 0), (74, 149), (30, 60)):
        east, north = -3000.0 + 60.0 * (column + 0.5), -1500.0 + 60.0 * (row + 0.5)
        expected = 120.0 - free_space_loss(float(np.hypot(east, north)), 1e9)
        assert coverage.margin[row, column] == pytest.approx(expected, abs=1e-6)
    assert not coverage.is_in_ground.any()


def test_a_height_above_ground_follows_the_ground_and_an_altitude_enters_it() -> None:
    ground, antenna = slope(), np.array([0.0, 0.0, 3.0])
    above = link_coverage(link_of_120_db(), ground, antenna, FlightHeight(150.0, is_above_ground=True), EXTENT)
    level = link_coverage(link_of_120_db(), ground, antenna, FlightHeight(300.0, is_above_ground=False), EXTENT)
    # The ground reaches 300 m at 3 km east, in the middle of which cell 100 begins; its data begin at 2000 m west.
    assert (level.is_in_ground[0, 99], level.is_in_ground[0, 100]) == (False, True)
    assert not above.is_in_ground.any()
    for coverage in (above, level):
        assert np.isnan(coverage.margin[:, :16]).all()
        assert (np.isfinite(coverage.margin) == ~coverage.is_in_ground)[:, 18:].all()
    east, north = -3000.0 + 60.0 * 120.5, -1500.0 + 60.0 * 10.5
    point = np.array([[east, north, 0.1 * east + 150.0]])
    expected = link_points(link_of_120_db(), ground, antenna, point).margin[0]
    assert above.margin[10, 120] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("altitudes", "text"),
    [([400.0, 402.0, 410.0], "402 m AMSL"), ([255.0, 355.0, 450.0], "155 m above ground")],
    ids=["level flight", "along the slope"],
)
def test_the_flights_height_is_the_one_that_varies_less(altitudes: list[float], text: str) -> None:
    """At 1, 2 and 3 km east the ground is at 100, 200 and 300 m."""
    positions = np.array([[1000.0 * (k + 1), 0.0, altitude] for k, altitude in enumerate(altitudes)])
    assert flight_height(slope(), positions).text == text


def test_off_the_terrain_the_height_is_an_altitude() -> None:
    assert flight_height(slope(), np.array([[90_000.0, 0.0, 300.0], [91_000.0, 0.0, 500.0]])).text == "400 m AMSL"
