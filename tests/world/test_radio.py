"""Losses against ITU-R P.525 and P.526, and lines of sight against a march along the ray."""

import math

import numpy as np
import pytest

from world.errors import ScenarioError
from world.frames import GeoOrigin
from world.radio import (
    EFFECTIVE_EARTH_RADIUS_M,
    PathProfile,
    free_space_loss,
    knife_edge_loss,
    link_points,
    make_link,
    path_loss,
    path_profile,
)
from world.scenario_tables import LinkTable
from world.terrain import Peak, make_flat_terrain, make_peaks_terrain

GHZ = 1e9
TABLE = {"frequency_mhz": 1000.0, "power_dbm": 20.0, "sensitivity_dbm": -100.0}


@pytest.mark.parametrize(
    ("kilometres", "megahertz", "decibels"),
    [(1.0, 1000.0, 92.4), (10.0, 2400.0, 120.0), (50.0, 433.0, 119.1), (0.1, 5800.0, 87.7)],
)
def test_free_space_loss_is_equation_4_of_p525(kilometres: float, megahertz: float, decibels: float) -> None:
    """32.4 + 20 log f + 20 log d, with f in MHz and d in km."""
    expected = 32.4 + 20.0 * math.log10(megahertz) + 20.0 * math.log10(kilometres)
    assert expected == pytest.approx(decibels, abs=0.06)
    assert free_space_loss(1000.0 * kilometres, 1e6 * megahertz) == pytest.approx(expected, abs=0.06)


# Points of figure 9 of ITU-R P.526 (loss over the diffraction parameter), read to 0.1 dB where the figure prints the
# curve through its grid, and the values that follow from equation 31 by hand.
@pytest.mark.parametrize(
    ("parameter", "decibels"), [(-0.78, 0.0), (0.0, 6.03), (0.5, 10.3), (1.0, 13.9), (2.0, 19.0), (3.0, 22.4)]
)
def test_knife_edge_loss_is_equation_31_of_p526(parameter: float, decibels: float) -> None:
    assert knife_edge_loss(parameter) == pytest.approx(decibels, abs=0.1)


def single_edge(height: float, frequency: float) -> PathProfile:
    """Return a profile of 10 km with one edge in the middle, `height` over the line between antennas at 0 m."""
    distances = np.array([2500.0, 5000.0, 7500.0])
    return PathProfile(distances, np.array([-1000.0, height, -1000.0]), 10_000.0)


@pytest.mark.parametrize(("height", "parameter"), [(0.0, 0.0), (20.0, 1.0328), (50.0, 2.5820), (-20.0, -1.0328)])
def test_one_edge_has_its_own_parameter_and_bullingtons_addition(height: float, parameter: float) -> None:
    """Equation 26 with d1 = d2 = 5 km and 0.3 m: v = h sqrt(2 / 0.3 (1/5000 + 1/5000)) = 0.05164 h; and equation 55."""
    frequency = 299_792_458.0 / 0.3
    assert height * math.sqrt(2.0 / 0.3 * (2.0 / 5000.0)) == pytest.approx(parameter, abs=1e-3)
    edge = knife_edge_loss(parameter)
    expected = edge + (1.0 - math.exp(-edge / 6.0)) * (10.0 + 0.02 * 10.0)
    found = path_loss(single_edge(height, frequency), 0.0, 0.0, frequency)
    assert found.diffraction_loss == pytest.approx(expected, abs=0.1)
    assert found.is_visible == (height < 0.0)


def test_fresnel_clearance_is_in_radii_of_equation_2() -> None:
    """At the middle of 10 km and 0.3 m the first zone has sqrt(0.3 * 5000 * 5000 / 10000) = 27.39 m."""
    found = path_loss(single_edge(-27.386, 1.0), 0.0, 0.0, 299_792_458.0 / 0.3)
    assert found.fresnel_clearance == pytest.approx(1.0, abs=1e-3)


def test_two_edges_are_replaced_by_bullingtons_edge() -> None:
    """Edges of 50 m at 2 and 8 km of 10 km meet at 125 m in the middle: v = 125 * 0.05164 = 6.455."""
    profile = PathProfile(np.array([2000.0, 5000.0, 8000.0]), np.array([50.0, 0.0, 50.0]), 10_000.0)
    edge = knife_edge_loss(6.4550)
    expected = edge + (1.0 - math.exp(-edge / 6.0)) * 10.2
    assert path_loss(profile, 0.0, 0.0, 299_792_458.0 / 0.3).diffraction_loss == pytest.approx(expected, abs=0.1)


def test_the_earth_bulges_between_the_antennas() -> None:
    """25 km from either end of 50 km it is 25000 * 25000 / (2 * 8494667) = 36.8 m."""
    ground = make_flat_terrain(np.array([[-1000.0, 51_000.0], [-1000.0, 1000.0]]), 0.0, 0.0)
    profile = path_profile(ground, np.zeros(3), np.array([50_000.0, 0.0, 0.0]))
    assert pytest.approx(8_494_667.0, abs=1.0) == EFFECTIVE_EARTH_RADIUS_M
    assert profile.altitudes.max() == pytest.approx(36.8, abs=0.1)


def test_lines_of_sight_equal_a_march_along_the_ray() -> None:
    """10,000 rays over peaks, against a march in steps of a tenth of the terrain's spacing."""
    rng = np.random.default_rng(7)
    peaks = [Peak(float(e), float(n), float(h), 700.0) for e, n, h in rng.uniform((0, 0, 50), (9e3, 9e3, 400), (20, 3))]
    ground = make_peaks_terrain(np.array([[0.0, 9000.0], [0.0, 9000.0]]), peaks, 500.0)
    doubtful = differing = 0
    for _ in range(10_000):
        (east, north), (to_east, to_north) = rng.uniform(0.0, 9000.0, (2, 2))
        station = np.array([east, north, float(ground.height(east, north)) + 3.0])
        aircraft = np.array([to_east, to_north, float(ground.height(to_east, to_north)) + rng.uniform(20.0, 200.0)])
        profile = path_profile(ground, station, aircraft)
        found = path_loss(profile, float(station[2]), float(aircraft[2]), GHZ).is_visible
        length = math.dist(station[:2], aircraft[:2])
        fractions = np.arange(1, max(2, math.ceil(10.0 * length / ground.spacing))) / max(
            2, math.ceil(10.0 * length / ground.spacing)
        )
        points = station + fractions[:, None] * (aircraft - station)
        bulge = fractions * (1.0 - fractions) * length**2 / (2.0 * EFFECTIVE_EARTH_RADIUS_M)
        clearance = float((points[:, 2] - ground.height(points[:, 0], points[:, 1]) - bulge).min())
        if abs(clearance) < 0.5:
            # The ground is sampled at its own spacing: between two samples it may reach a ray that grazes it.
            doubtful += 1
        else:
            differing += found != (clearance > 0.0)
    assert differing == 0
    assert doubtful < 200


def test_a_budget_adds_up() -> None:
    """20 dBm + 2 dBi + 1 dBi - 3 dB + 100 dBm - 15 dB leave 105 dB; 1 km at 1 GHz takes 92.45 dB."""
    table = LinkTable(
        **TABLE,
        station_gain_dbi=2.0,
        aircraft_gain_dbi=1.0,
        cable_loss_db=3.0,
        fade_margin_db=15.0,
        east_m=0.0,
        north_m=0.0,
    )
    link = make_link(table, "mine.toml", GeoOrigin(46.0, 8.0), None)
    assert link is not None
    ground = make_flat_terrain(np.array([[-2000.0, 2000.0], [-2000.0, 2000.0]]), 0.0, 0.0)
    found = link_points(link, ground, np.array([0.0, 0.0, 500.0]), np.array([[1000.0, 0.0, 500.0]]))
    assert found.margin[0] == pytest.approx(105.0 - 92.45, abs=0.01)
    assert found.distance[0] == pytest.approx(1000.0)


def test_a_station_off_the_terrain_is_refused() -> None:
    ground = make_flat_terrain(np.array([[-2000.0, 2000.0], [-2000.0, 2000.0]]), 0.0, 0.0)
    table = LinkTable(**TABLE, east_m=90_000.0, north_m=0.0)
    with pytest.raises(ScenarioError, match=r"mine\.toml: link: east 90000 m, north 0 m: the elevation file"):
        make_link(table, "mine.toml", GeoOrigin(46.0, 8.0), ground)
