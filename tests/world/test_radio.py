"""Losses against ITU-R P.525 and P.526, and lines of sight against a march along the ray."""

import math

import numpy as np
import pytest

from world.arrays import Floats
from world.errors import ScenarioError
from world.frames import GeoOrigin
from world.radio import (
    EFFECTIVE_EARTH_RADIUS_M,
    LinkPoints,
    PathProfile,
    free_space_loss,
    knife_edge_loss,
    line_of_sight,
    link_margins,
    link_points,
    make_link,
    path_loss,
    path_profile,
)
from world.scenario_tables import LinkTable
from world.terrain import Peak, Terrain, make_flat_terrain, make_gridded_terrain, make_peaks_terrain

GHZ = 1e9
TABLE = {"frequency_mhz": 1000.0, "power_dbm": 20.0, "sensitivity_dbm": -100.0}
RAYS = 10_000


@pytest.mark.parametrize(
    ("kilometres", "megahertz", "decibels"),
    [(1.0, 1000.0, 92.4), (10.0, 2400.0, 120.0), (50.0, 433.0, 119.1), (0.1, 5800.0, 87.7)],
)
def test_free_space_loss_is_equation_4_of_p525(kilometres: float, megahertz: float, decibels: float) -> None:
    """32.4 + 20 log f + 20 log d, with f in MHz and d in km."""
    expected = 32.4 + 20.0 * math.log10(megahertz) + 20.0 * math.log10(kilometres)
    assert expected == pytest.approx(decibels, abs=0.06)
    assert free_space_loss(1000.0 * kilometres, 1e6 * megahertz) == pytest.approx(expected, abs=0.06)


# Loss of a knife edge by equation 31 of ITU-R P.526, calculated by hand, and below its range.
@pytest.mark.parametrize(
    ("parameter", "decibels"),
    [(-2.0, 0.0), (-0.78, 0.0), (-0.5, 1.96), (0.0, 6.03), (0.5, 10.29), (1.0, 13.93), (2.0, 19.04), (3.0, 22.42)],
)
def test_knife_edge_loss_is_equation_31_of_p526(parameter: float, decibels: float) -> None:
    assert knife_edge_loss(parameter) == pytest.approx(decibels, abs=0.01)


def fresnel_integrals(limit: float) -> tuple[float, float]:
    """Return the integrals of cos and sin of pi s^2 / 2 from 0 to a limit (ITU-R P.526-15, equations 7a and 7b)."""
    steps = 20_000
    s = (np.arange(steps) + 0.5) * limit / steps
    return (
        float(np.cos(0.5 * math.pi * s * s).sum()) * limit / steps,
        float(np.sin(0.5 * math.pi * s * s).sum()) * limit / steps,
    )


# Points of the curve of figure 9 of ITU-R P.526, which is equation 30.
@pytest.mark.parametrize("parameter", [-0.78, -0.4, 0.0, 0.4, 1.0, 1.6, 2.0, 2.4, 2.6])
def test_knife_edge_loss_is_the_curve_of_figure_9(parameter: float) -> None:
    """Within 0.1 dB; from there to 10 the approximation of the Recommendation is up to 0.13 dB lower."""
    cosine, sine = fresnel_integrals(parameter)
    exact = -20.0 * math.log10(0.5 * math.hypot(1.0 - cosine - sine, cosine - sine))
    assert knife_edge_loss(parameter) == pytest.approx(exact, abs=0.1)


def single_edge(height: float) -> PathProfile:
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
    assert path_loss(single_edge(height), 0.0, 0.0, frequency).diffraction_loss == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize(
    ("first_km", "second_km", "megahertz"), [(5.0, 5.0, 1000.0), (0.3, 9.7, 433.0), (8.0, 2.0, 5800.0)]
)
def test_fresnel_clearance_is_in_radii_of_equation_3(first_km: float, second_km: float, megahertz: float) -> None:
    """550 sqrt(d1 d2 / ((d1 + d2) f)) m, with d in km and f in MHz; 550 is rounded up from 547.5."""
    radius = 547.5 * math.sqrt(first_km * second_km / ((first_km + second_km) * megahertz))
    profile = PathProfile(np.array([1000.0 * first_km]), np.array([-radius]), 1000.0 * (first_km + second_km))
    found = path_loss(profile, 0.0, 0.0, 1e6 * megahertz).fresnel_clearance
    assert found == pytest.approx(1.0, abs=1e-3)


def test_two_edges_are_replaced_by_bullingtons_edge() -> None:
    """Edges of 50 m at 2 and 8 km of 10 km meet at 125 m in the middle: v = 125 * 0.05164 = 6.455."""
    profile = PathProfile(np.array([2000.0, 5000.0, 8000.0]), np.array([50.0, 0.0, 50.0]), 10_000.0)
    edge = knife_edge_loss(6.4550)
    expected = edge + (1.0 - math.exp(-edge / 6.0)) * 10.2
    assert path_loss(profile, 0.0, 0.0, 299_792_458.0 / 0.3).diffraction_loss == pytest.approx(expected, abs=0.1)


def bullington_of_the_text(d: Floats, h: Floats, hts: float, hrs: float, wavelength: float) -> float:
    """Return the loss of equations 47 to 55 of ITU-R P.526-15, as its text states them: distances in km, heights in m.

    d, h: profile points, with both ends.
    """
    ce, total = 1.0 / 8494.667, float(d[-1])
    di, hi = d[1:-1], h[1:-1] + 500.0 / 8494.667 * d[1:-1] * (total - d[1:-1])
    assert ce == pytest.approx(1.0 / (6371.0 * 4.0 / 3.0), rel=1e-6)
    stim, slope = float(((hi - hts) / di).max()), (hrs - hts) / total
    if stim < slope:
        above = hi - (hts * (total - di) + hrs * di) / total
        parameter = float((above * np.sqrt(0.002 * total / (wavelength * di * (total - di)))).max())
    else:
        srim = float(((hi - hrs) / (total - di)).max())
        db = (hrs - hts + srim * total) / (stim + srim)
        above_point = hts + stim * db - (hts * (total - db) + hrs * db) / total
        parameter = above_point * math.sqrt(0.002 * total / (wavelength * db * (total - db)))
    luc = 0.0
    if parameter > -0.78:
        luc = 6.9 + 20.0 * math.log10(math.sqrt((parameter - 0.1) ** 2 + 1.0) + parameter - 0.1)
    return luc + (1.0 - math.exp(-luc / 6.0)) * (10.0 + 0.02 * total)


def test_the_diffraction_loss_is_that_of_the_text_of_p526() -> None:
    """500 profiles of hills, from 1 to 60 km, at 100 MHz to 10 GHz."""
    rng = np.random.default_rng(11)
    hidden = 0
    for _ in range(500):
        length, wavelength = float(rng.uniform(1.0, 60.0)), 0.299792458 / float(rng.uniform(0.1, 10.0))
        distances = np.linspace(0.0, length, 101)
        heights = 100.0 + 100.0 * np.sin(distances * rng.uniform(0.2, 3.0) + rng.uniform(0.0, 6.0))
        station, aircraft = heights[0] + 3.0, heights[-1] + rng.uniform(1.0, 400.0)
        expected = bullington_of_the_text(distances, heights, station, aircraft, wavelength)
        inner = 1000.0 * distances[1:-1]
        raised = heights[1:-1] + inner * (1000.0 * length - inner) / (2.0 * 8_494_667.0)
        profile = PathProfile(inner, raised, 1000.0 * length)
        found = path_loss(profile, station, aircraft, 299_792_458.0 / wavelength).diffraction_loss
        assert found == pytest.approx(expected, abs=0.01)
        back = PathProfile(1000.0 * length - inner[::-1], raised[::-1], 1000.0 * length)
        assert path_loss(back, aircraft, station, 299_792_458.0 / wavelength).diffraction_loss == pytest.approx(found)
        hidden += expected > 6.0
    assert 100 < hidden < 450


def test_the_earth_bulges_between_the_antennas() -> None:
    """25 km from either end of 50 km it is 25000 * 25000 / (2 * 8494667) = 36.8 m."""
    ground = make_flat_terrain(np.array([[-1000.0, 51_000.0], [-1000.0, 1000.0]]), 0.0, 0.0)
    profile = path_profile(ground, np.zeros(3), np.array([50_000.0, 0.0, 0.0]))
    assert pytest.approx(8_494_667.0, abs=1.0) == EFFECTIVE_EARTH_RADIUS_M
    assert profile.altitudes.max() == pytest.approx(36.8, abs=0.1)


@pytest.mark.parametrize(("kilometres", "expected"), [(26.0, True), (26.14, False)])
def test_the_horizon_over_the_sea(kilometres: float, expected: bool) -> None:
    """From 10 m the horizon is at sqrt(2 * 8494667 * 10) = 13,034.7 m, for two antennas at 26,069 m."""
    ground = make_flat_terrain(np.array([[-1000.0, 30_000.0], [-1000.0, 1000.0]]), 0.0, 0.0)
    ends = np.array([0.0, 0.0, 10.0]), np.array([1000.0 * kilometres, 0.0, 10.0])
    assert line_of_sight(ground, *ends) is expected
    assert line_of_sight(ground, *ends[::-1]) is expected


def hills() -> Terrain:
    """Return smooth hills of up to 400 m."""
    rng = np.random.default_rng(7)
    peaks = [Peak(float(e), float(n), float(h), 700.0) for e, n, h in rng.uniform((0, 0, 50), (9e3, 9e3, 400), (20, 3))]
    return make_peaks_terrain(np.array([[0.0, 9000.0], [0.0, 9000.0]]), peaks, 500.0)


def rough_ground() -> Terrain:
    """Return ground that rises or falls by up to 40 m from each pixel to the next, 50 m away."""
    axis = np.arange(-500.0, 9501.0, 50.0)
    heights = np.random.default_rng(5).uniform(0.0, 40.0, (axis.size, axis.size))
    return make_gridded_terrain(heights, axis, axis, source="rough", sha256="", datum="")


@pytest.mark.parametrize("make_ground", [hills, rough_ground])
def test_lines_of_sight_equal_a_march_along_the_ray(make_ground: object) -> None:
    """All of 10,000 rays, against a plain march in steps of a metre, and a tenth of that near the ground."""
    assert callable(make_ground)
    ground, rng = make_ground(), np.random.default_rng(7)
    differing = visible = 0
    for _ in range(RAYS):
        (east, north), (to_east, to_north) = rng.uniform(0.0, 9000.0, (2, 2))
        station = np.array([east, north, float(ground.height(east, north)) + 3.0])
        aircraft = np.array([to_east, to_north, float(ground.height(to_east, to_north)) + rng.uniform(20.0, 200.0)])
        length = math.dist(station[:2], aircraft[:2])
        least = math.inf
        for step in (20.0, 1.0, 0.1):
            # Only a ray that comes near the ground, or into it, needs smaller steps.
            if not -1.0 < least < 30.0 * min(1.0, step) and step < 20.0:
                break
            fractions = np.linspace(0.0, 1.0, 2 + math.ceil(length / step))
            points = station + fractions[:, None] * (aircraft - station)
            bulge = fractions * (1.0 - fractions) * length**2 / (2.0 * 8_494_667.0)
            least = float((points[:, 2] - ground.height(points[:, 0], points[:, 1]) - bulge).min())
        found = line_of_sight(ground, station, aircraft)
        differing += found is not (least > 0.0)
        visible += least > 0.0
    assert differing == 0
    assert 0.1 * RAYS < visible < 0.9 * RAYS


# ----------------------------------------------------------------------
# Links over terrain.


def points_of(ground: Terrain, station: list[float], aircraft: list[float], **entries: float) -> LinkPoints:
    """Return the link between two positions, m."""
    link = make_link(
        LinkTable(**{**TABLE, **entries}, east_m=0.0, north_m=0.0), "mine.toml", GeoOrigin(46.0, 8.0), None
    )
    assert link is not None
    positions = np.array([aircraft])
    points = link_points(link, ground, np.array(station), positions)
    assert link_margins(link, ground, np.array(station), positions) == pytest.approx(points.margin, nan_ok=True)
    return points


FLAT = make_flat_terrain(np.array([[-20_000.0, 20_000.0], [-20_000.0, 20_000.0]]), 0.0, 0.0)


def test_a_budget_adds_up() -> None:
    """20 dBm + 2 dBi + 1 dBi - 3 dB + 100 dBm - 15 dB leave 105 dB; 1 km at 1 GHz takes 92.45 dB."""
    budget = {"station_gain_dbi": 2.0, "aircraft_gain_dbi": 1.0, "cable_loss_db": 3.0, "fade_margin_db": 15.0}
    found = points_of(FLAT, [0.0, 0.0, 500.0], [1000.0, 0.0, 500.0], **budget)
    assert found.margin[0] == pytest.approx(105.0 - 92.45, abs=0.01)
    assert found.distance[0] == pytest.approx(1000.0)


# 10 dB of fade margin and 120 dB of budget leave 110 dB; free space over 300 m at 1 GHz takes 81.99 dB.
@pytest.mark.parametrize("offset", [0.0, 1e-9, 0.5, 9.0])
def test_an_aircraft_above_the_station_is_in_free_space(offset: float) -> None:
    found = points_of(FLAT, [0.0, 0.0, 3.0], [offset, 0.0, 303.0])
    assert found.margin[0] == pytest.approx(110.0 - 81.99, abs=0.01)
    assert (bool(found.is_visible[0]), float(found.diffraction_loss[0])) == (True, 0.0)


def test_level_ground_with_few_pixels_enters_the_fresnel_zone() -> None:
    """From 3 m to 30 m over 5 km at 1 GHz, by hand, where the zone is nearest the ground, 500 m from the station.

    There the ray is 5.70 m high, the bulge 0.13 m, and the zone's radius 11.62 m: 0.48 radii, v = -0.68, J = 0.69 dB.
    """
    found = points_of(FLAT, [0.0, 0.0, 3.0], [5000.0, 0.0, 30.0])
    assert FLAT.spacing > 5000.0
    assert found.fresnel_clearance[0] == pytest.approx(0.48, abs=0.01)
    assert found.diffraction_loss[0] == pytest.approx(0.69 + (1.0 - math.exp(-0.69 / 6.0)) * 10.1, abs=0.1)


@pytest.mark.parametrize("height", [0.5, 0.0, -3.0])
def test_an_aircraft_on_the_ground_is_not_behind_it(height: float) -> None:
    """On the ground, or 3 m below it by an error of the terrain, its antenna is half a metre above."""
    found = points_of(FLAT, [0.0, 0.0, 30.0], [500.0, 0.0, height])
    half = points_of(FLAT, [0.0, 0.0, 30.0], [500.0, 0.0, 0.5])
    assert bool(found.is_visible[0])
    assert found.margin[0] == half.margin[0]


@pytest.mark.parametrize(("station", "aircraft"), [(700.0, 20.0), (20.0, 700.0), (3.0, 20.0)])
def test_a_station_above_the_aircraft_is_like_an_aircraft_above_the_station(station: float, aircraft: float) -> None:
    ground = hills()
    one = [1000.0, 2000.0, float(ground.height(1000.0, 2000.0)) + station]
    other = [8000.0, 7000.0, float(ground.height(8000.0, 7000.0)) + aircraft]
    for values, swapped_values in zip(points_of(ground, one, other), points_of(ground, other, one), strict=True):
        assert values == pytest.approx(swapped_values)


@pytest.mark.parametrize(
    ("megahertz", "decibels"), [(30.0, 82.0), (15_000.0, 136.0)], ids=["lowest frequency", "highest frequency"]
)
def test_both_ends_of_the_range_of_frequencies(megahertz: float, decibels: float) -> None:
    """Free space over 10 km takes 32.4 + 20 log f + 20 dB."""
    assert 32.45 + 20.0 * math.log10(megahertz) + 20.0 == pytest.approx(decibels, abs=0.1)
    found = points_of(FLAT, [0.0, 0.0, 5000.0], [10_000.0, 0.0, 5000.0], frequency_mhz=megahertz)
    assert found.margin[0] == pytest.approx(110.0 - decibels, abs=0.1)


def ground_with_hole() -> Terrain:
    """Return level ground with one pixel without data at 500 m east."""
    axis = np.arange(-100.0, 1101.0, 100.0)
    heights = np.zeros((axis.size, axis.size))
    heights[axis.size // 2, 6] = np.nan
    return make_gridded_terrain(heights, axis, axis, source="hole", sha256="", datum="")


@pytest.mark.parametrize(
    ("aircraft", "is_known"),
    [
        ([1000.0, 500.0, 300.0], False),
        ([300.0, 500.0, 300.0], True),
        ([1000.0, 950.0, 300.0], True),
        ([1500.0, 900.0, 300.0], False),
    ],
    ids=["across the hole", "before the hole", "past the hole", "off the terrain"],
)
def test_unknown_ground_below_the_ray_leaves_the_margin_unknown(aircraft: list[float], is_known: bool) -> None:
    ground = ground_with_hole()
    found = points_of(ground, [0.0, 500.0, 10.0], aircraft)
    assert bool(np.isfinite(found.margin[0])) is is_known
    assert (line_of_sight(ground, np.array([0.0, 500.0, 10.0]), np.array(aircraft)) is not None) is is_known


def test_a_station_off_the_terrain_is_refused() -> None:
    ground = make_flat_terrain(np.array([[-2000.0, 2000.0], [-2000.0, 2000.0]]), 0.0, 0.0)
    table = LinkTable(**TABLE, east_m=90_000.0, north_m=0.0)
    with pytest.raises(
        ScenarioError,
        match=r"mine\.toml: link: .* no data at the ground station, east 90000 m",
    ):
        make_link(table, "mine.toml", GeoOrigin(46.0, 8.0), ground)


def test_a_station_beyond_the_180th_meridian_is_near() -> None:
    """From 179.99 to -179.99 degrees at the equator it is 0.02 degrees, 2226 m."""
    link = make_link(LinkTable(**TABLE, lat_deg=0.0, lon_deg=-179.99), "mine.toml", GeoOrigin(0.0, 179.99), None)
    assert link is not None
    assert link.station == pytest.approx((2226.4, 0.0), abs=0.5)
