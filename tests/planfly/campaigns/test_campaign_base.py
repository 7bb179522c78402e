"""What all flights share: opened once, and refused before anything is flown."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import copy_aircraft_folder, load_aircraft, read_aircraft
from aircraft.data_sheet import DataSheet
from flight.mission.items import Home
from planfly.campaigns.campaign_base import (
    CampaignBase,
    GivenWind,
    _draw_strip_error,
    _terrain_error_at_home,
    check_level_flight_at_medians,
    open_campaign,
    vary_flight,
    vary_terrain,
)
from planfly.campaigns.dispersions import (
    QUANTITIES,
    Dispersions,
    Draw,
    SpreadError,
    default_dispersions,
    parse_dispersions,
    read_dispersions,
)
from planfly.workflow.data_sheets import make_data_sheet_folder
from planfly.workflow.open_flight import open_flight
from tests.planfly.campaigns.made_campaigns import MISSION, write_short
from world.airfield import LandingStrip
from world.errors import MissionError
from world.frames import to_geo
from world.scenario import load_scenario


def test_it_has_the_mission_as_fly_opens_it(base: CampaignBase, tmp_path: Path) -> None:
    mission, scenario = write_short(tmp_path)
    opened = open_flight(mission, {"scenario": scenario})
    assert base.mission.items == opened.mission.items
    assert base.scenario.to_json() == opened.scenario.to_json()
    # Whatever folder it lies in.
    assert base.mission.source == "short.waypoints"


def test_the_hash_is_of_all_that_decides_a_flight(base: CampaignBase) -> None:
    other = parse_dispersions('[mass]\ndistribution = "norm"\nloc = 1.0\nscale = 0.02\nsource = "x"', "x")
    assert base.inputs_hash() == replace(base, name="another").inputs_hash()
    fenced = replace(base.mission, fences=base.mission.items[:1])
    for changed in (replace(base, seed=2), replace(base, dispersions=other), replace(base, mission=fenced)):
        assert changed.inputs_hash() != base.inputs_hash()


@pytest.mark.parametrize(("mass", "good"), [(1.0, True), (1.9, False)])
def test_an_aircraft_that_cannot_fly_is_refused(base: CampaignBase, mass: float, good: bool) -> None:
    text = f'[mass]\ndistribution = "uniform"\nloc = {mass - 0.05}\nscale = 0.1\nsource = "x"\n'
    text += '[drag]\ndistribution = "uniform"\nloc = 2.8\nscale = 0.1\nsource = "x"\n' if not good else ""
    made = replace(base, dispersions=parse_dispersions(text, "mine.toml"))
    if good:
        check_level_flight_at_medians(made)
        return
    with pytest.raises(
        SpreadError,
        match=r"mine.toml: .* cannot fly level at 25 m/s with the medians of these factors: mass 1.9, drag 2.85",
    ):
        check_level_flight_at_medians(made)


def test_a_model_that_a_dispersion_cannot_vary_is_refused(base: CampaignBase) -> None:
    cessna = replace(base, uav=replace(base.uav, aircraft=load_aircraft("c172x")))
    with pytest.raises(
        SpreadError, match=r"drag: .* varies the property aero/drag-factor, which the model of c172x does not have"
    ):
        check_level_flight_at_medians(cessna)


def test_a_missing_mission_is_one_line() -> None:
    with pytest.raises(MissionError, match="no such file"):
        open_campaign("none.waypoints", default_dispersions(), {})


# ----------------------------------------------------------------------
# A draw changes what it says, and nothing else.


def drawn(**values: float) -> Draw:
    return Draw(0, 99, {one.name: one.nominal for one in QUANTITIES} | values)


def test_the_nominal_draw_is_the_setup_itself(base: CampaignBase) -> None:
    made = vary_flight(base, drawn())
    wind, own = made.setup.scenario.wind, base.scenario.wind
    assert (wind.speed, wind.turbulence) == (own.speed, own.turbulence)
    assert wind.from_course == pytest.approx(own.from_course)
    assert made.setup.seed == 99
    assert made.setup.scenario.terrain is base.scenario.terrain
    assert made.off_nominal.start_offset == (0.0, 0.0, 0.0)
    assert made.off_nominal.variation.mass == made.off_nominal.variation.drag == made.off_nominal.variation.control == 1


@pytest.mark.parametrize(
    ("values", "speed", "from_deg", "turbulence"),
    [
        ({"wind_speed": 2.0, "wind_from": 120.0}, 7.0, 10.0, "light"),
        ({"wind_speed": -9.0}, 0.0, 250.0, "light"),
        ({"turbulence": 1.0}, 5.0, 250.0, "moderate"),
        ({"turbulence": 2.0}, 5.0, 250.0, "moderate"),
        ({"turbulence": -1.0}, 5.0, 250.0, "none"),
    ],
)
def test_wind(base: CampaignBase, values: dict[str, float], speed: float, from_deg: float, turbulence: str) -> None:
    setup = vary_flight(base, drawn(**values)).setup
    for wind in (setup.scenario.wind, setup.limits.wind):
        assert (wind.speed, wind.turbulence) == (speed, turbulence)
        assert math.degrees(wind.from_course) == pytest.approx(from_deg)
    # The log's scenario says the same.
    assert setup.scenario.spec.wind.speed_mps == speed


def test_gusts_are_the_flights_own_whatever_the_scenario_states(base: CampaignBase) -> None:
    fixed = replace(base, scenario=replace(base.scenario, wind=replace(base.scenario.wind, seed=3)))
    assert vary_flight(fixed, drawn()).setup.scenario.wind.seed is None


def test_a_mean_wind_takes_the_scenarios_place(base: CampaignBase) -> None:
    wind = vary_flight(base, drawn(wind_gradient=0.002), GivenWind(11.0, 45.0)).setup.scenario.wind
    assert (wind.speed, math.degrees(wind.from_course), wind.gradient) == (11.0, pytest.approx(45.0), 0.002)


def test_aircraft_battery_terrain_and_start(base: CampaignBase) -> None:
    values = {"mass": 1.1, "drag": 0.9, "control_power": 0.8, "battery": 0.5, "terrain_height": 7.0}
    made = vary_flight(base, drawn(**values, start_east=1.0, start_north=-2.0, start_up=3.0))
    variation = made.off_nominal.variation
    assert (variation.mass, variation.drag, variation.control) == (1.1, 0.9, 0.8)
    assert made.setup.battery == pytest.approx(0.5 * base.uav.battery)
    assert made.off_nominal.start_offset == (1.0, -2.0, 3.0)
    ground = made.setup.scenario.terrain
    assert ground is not None
    assert float(ground.height(500.0, 0.0)) == pytest.approx(107.0)
    # The route stays where it was planned.
    np.testing.assert_array_equal(made.setup.route.positions, vary_flight(base, drawn()).setup.route.positions)


# ----------------------------------------------------------------------
# Draws of the whole aircraft.


@pytest.fixture(scope="module")
def sheet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an aircraft from a data sheet, and a mission that it flies."""
    place = tmp_path_factory.mktemp("drawn")
    make_data_sheet_folder(place / "foam", DataSheet(2.1, 1.6, 15.0, 10.0))
    rows = [f"{k}\t0\t0\t16\t0\t0\t0\t0\t{46.0 + 0.004 * k:.6f}\t8.0\t500.0\t1" for k in range(3)]
    (place / "hop.waypoints").write_text("QGC WPL 110\n" + "\n".join(rows) + "\n")
    return place


def _opened(place: Path, dispersions: Dispersions) -> CampaignBase:
    return open_campaign(str(place / "hop.waypoints"), dispersions, {"aircraft": place / "foam"})


def test_an_aircraft_brings_its_draws(sheet: Path) -> None:
    made = _opened(sheet, default_dispersions())
    names = [one.quantity.name for one in made.dispersions.varying]
    assert "mass" in names
    assert not {"drag", "control_power"} & set(names)
    # Line 2 of the file is row 0, which seeds 0, 512, ... fly.
    with (sheet / "foam" / "draws.csv").open() as file:
        properties, first, second = (next(file).strip().split(",") for _ in range(3))
    nominal = {one.name: one.nominal for one in QUANTITIES}
    for seed, row in ((1024, first), (513, second)):
        found = vary_flight(made, Draw(0, seed, nominal)).off_nominal.variation.properties
        assert [name for name, _ in found] == properties
        assert [value for _, value in found] == pytest.approx([float(value) for value in row])
    # Each flight's aircraft is one that is known.
    varied = vary_flight(made, Draw(0, 1, nominal))
    assert (varied.setup.envelope.climb_sd, varied.setup.envelope.descent_sd) == (0.0, 0.0)
    assert varied.setup.envelope.fastest_sd == 0.0 < made.uav.limits.envelope.fastest_sd
    assert varied.setup.envelope.power_sd == 0.0 < made.uav.limits.envelope.power_sd


def test_a_copy_of_an_aircraft_has_its_draws(sheet: Path) -> None:
    names = copy_aircraft_folder(sheet / "copy", read_aircraft(sheet / "foam"))
    assert {"draws.csv", "uncertainty.toml"} <= set(names)
    assert (sheet / "copy" / "draws.csv").read_bytes() == (sheet / "foam" / "draws.csv").read_bytes()


def test_a_file_of_dispersions_names_draws(sheet: Path) -> None:
    spread = sheet / "spread.toml"
    spread.write_text('[aircraft]\ndraws = "foam/draws.csv"\n')
    made = _opened(sheet, read_dispersions(spread))
    assert made.dispersions.draws is not None
    assert made.dispersions.varying == ()
    other = replace(made.dispersions.draws, values=made.dispersions.draws.values + 0.01)
    assert replace(made, dispersions=replace(made.dispersions, draws=other)).inputs_hash() != made.inputs_hash()


@pytest.mark.parametrize(("quantity", "drawn"), [("wind_speed", True), ("drag", False)])
def test_a_file_without_draws_flies_the_folders_or_leaves_slopes_open(sheet: Path, quantity: str, drawn: bool) -> None:
    spread = sheet / f"{quantity}.toml"
    spread.write_text(f'[{quantity}]\ndistribution = "norm"\nloc = 1\nscale = 0.05\nsource = "x"\n')
    made = _opened(sheet, read_dispersions(spread))
    assert [one.quantity.name for one in made.dispersions.varying] == [quantity]
    varied = vary_flight(made, Draw(0, 1, {one.name: one.nominal for one in QUANTITIES}))
    assert (made.dispersions.draws is not None) is drawn
    assert bool(varied.off_nominal.variation.properties) is drawn
    # What is not known is either flown or left open.
    envelope = varied.setup.envelope
    assert (envelope.climb_sd == 0.0, envelope.descent_sd == 0.0) == (drawn, drawn)
    assert drawn or envelope.climb_sd == made.uav.limits.envelope.climb_sd > 0.0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[aircraft]\ndraws = "none.csv"', "none.csv: cannot be read"),
        ("[aircraft]\ndraws = 3", "aircraft.draws: expected only a file of draws"),
        ("[aircraft]\n", "aircraft.draws: expected only a file of draws"),
        (
            '[aircraft]\ndraws = "foam/draws.csv"\n[drag]\ndistribution = "norm"\nloc = 1\nscale = 0.1\nsource = "x"',
            "drag: cannot be combined with [aircraft] draws",
        ),
        ('[aircraft]\ndraws = "other.csv"', "other.csv: these draws belong to another aircraft: "),
    ],
)
def test_bad_draws_are_refused(sheet: Path, text: str, told: str) -> None:
    (sheet / "other.csv").write_text("ident/wings\n1.0\n")
    (sheet / "bad.toml").write_text(text)
    with pytest.raises(SpreadError) as caught:
        _opened(sheet, read_dispersions(sheet / "bad.toml"))
    assert told in str(caught.value)


def test_the_terrain_error_at_a_surveyed_strip_is_that_of_the_survey() -> None:
    """10 m elsewhere; 0.5 m up to 200 m beyond the strip's ends (400 m), and half way between 900 m from the centre."""
    scenario = load_scenario("jacksboro")
    strip, terrain = scenario.landing, scenario.terrain
    assert strip is not None
    assert terrain is not None
    assert (strip.length, strip.height_sd) == (400.0, 0.5)
    varied = vary_terrain(terrain, 10.0, strip, 0.5)
    for distance, error in ((0.0, 0.5), (370.0, 0.5), (900.0, 5.25), (1430.0, 10.0), (4000.0, 10.0)):
        for east, north in ((distance, 0.0), (0.0, distance)):
            place = strip.east + east, strip.north + north
            difference = float(varied.height(*place) - terrain.height(*place))
            # Heights between pixels, some 25 m apart, are interpolated.
            assert difference == pytest.approx(error, abs=0.25), (distance, east)
    everywhere = vary_terrain(terrain, 10.0, strip, None)
    assert float(everywhere.height(strip.east, strip.north) - terrain.height(strip.east, strip.north)) == pytest.approx(
        10.0, abs=1e-3
    )


@pytest.mark.parametrize(("frame", "altitude"), [(0, 180.0), (3, 187.0), (10, 187.0)])
def test_heights_above_home_and_terrain_move_with_home(tmp_path: Path, frame: int, altitude: float) -> None:
    """Ground and home at 100 m, 7 m too low: the autopilot measures home where it stands, and altitudes AMSL stay."""
    mission, scenario = write_short(tmp_path)
    item_altitude = 180 if frame == 0 else 80
    mission.write_text(MISSION.replace("\t0\t16", f"\t{frame}\t16").replace("\t180\t", f"\t{item_altitude}\t"))
    made = open_campaign(str(mission), default_dispersions(), {"scenario": scenario})
    nominal, varied = (vary_flight(made, drawn(terrain_height=error)).setup for error in (0.0, 7.0))
    np.testing.assert_allclose(nominal.route.positions[:, 2], 180.0)
    np.testing.assert_allclose(varied.route.positions[:, 2], altitude)
    np.testing.assert_array_equal(varied.route.positions[:, :2], nominal.route.positions[:, :2])
    assert varied.mission.home is not None
    assert varied.mission.home.alt == pytest.approx(107.0)


def test_home_at_a_surveyed_strip_has_the_error_of_the_survey(base: CampaignBase) -> None:
    """The survey is 0.5 m wrong and the map 10 m; 4 km from the strip home has the error of the map."""
    scenario = load_scenario("jacksboro")
    strip, terrain = scenario.landing, scenario.terrain
    assert strip is not None
    assert terrain is not None
    for distance, error in ((0.0, 0.5), (4000.0, 10.0)):
        lat, lon = to_geo(scenario.origin, strip.east + distance, strip.north)
        itinerary = replace(base.placed.itinerary, home=Home(float(lat), float(lon), 300.0))
        made = replace(base, scenario=scenario, placed=replace(base.placed, itinerary=itinerary))
        assert _terrain_error_at_home(made, vary_terrain(terrain, 10.0, strip, 0.5)) == pytest.approx(error, abs=1e-3)


def test_strip_errors_have_the_stated_deviation_and_do_not_change_the_other_draws() -> None:
    strip = replace(LandingStrip(0.0, 0.0), height_sd=2.0)
    errors = np.array([_draw_strip_error(strip, seed) for seed in range(2000)], dtype=np.float64)
    # The standard deviation of 2,000 normal draws has a standard error of 2 / sqrt(4000) = 0.03.
    assert errors.std() == pytest.approx(2.0, abs=0.1)
    assert abs(errors.mean()) < 0.15
    assert _draw_strip_error(LandingStrip(0.0, 0.0), 1) is None
