"""A changed scenario is one that a file may have, and goes through JSON and back."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.world.made.made_scenario import made_spec, same_scenario
from world.airspace.zone_tables import ZoneTable
from world.errors import ScenarioError
from world.scenario import Scenario, from_spec, load_scenario
from world.scenario_variants import (
    fixed_ends,
    over_terrain,
    with_flight,
    with_planner,
    with_threats,
    with_wind,
    with_zones,
)


@pytest.fixture
def scenario() -> Scenario:
    return from_spec(made_spec(), "made")


def test_another_wind_is_one_that_a_file_may_have(scenario: Scenario) -> None:
    windy = with_wind(scenario, 11.0, math.radians(30.0), "moderate")
    assert (windy.wind.speed, windy.wind.turbulence, windy.wind.gradient) == (11.0, "moderate", 0.01)
    assert windy.wind.from_course == pytest.approx(math.radians(30.0))
    assert same_scenario(from_spec(windy.to_json(), "again"), windy)
    assert same_scenario(with_wind(scenario, None, None, None), scenario)
    assert with_wind(scenario, None, None, "none").wind.speed == 6.0
    # What a file may not say, an option may not either: the log could not be read back.
    for speed, course, turbulence, match in (
        (99.0, 0.0, None, "wind: speed_mps: 99.0: allowed 0..40"),
        (math.nan, 0.0, None, "wind: speed_mps: nan: allowed 0..40"),
        (5.0, 99.0, None, "wind: from_deg: .*: allowed -360..360"),
        (None, None, "severe", 'wind: turbulence: "severe"'),
    ):
        with pytest.raises(ScenarioError, match=match):
            with_wind(scenario, speed, course, turbulence)


def test_other_entries_of_flight_and_planner(scenario: Scenario) -> None:
    fast = with_flight(scenario, airspeed_mps=30.0, guidance=None)
    assert fast.flight == scenario.flight.model_copy(update={"airspeed_mps": 30.0})
    assert same_scenario(from_spec(fast.to_json(), "again"), fast)
    seeded = with_planner(scenario, "--seed", seed=9)
    assert seeded.planner == scenario.planner.model_copy(update={"seed": 9})
    assert same_scenario(from_spec(seeded.to_json(), "again"), seeded)
    with pytest.raises(ScenarioError, match=r"made: flight: airspeed_mps: 7\.0: allowed 15\.\.60"):
        with_flight(scenario, airspeed_mps=7.0)
    with pytest.raises(ScenarioError, match=r"--seed: seed: -1: allowed 0\.\."):
        with_planner(scenario, "--seed", seed=-1)


def test_more_threats_stand_on_the_ground_with_the_scales_of_the_others(scenario: Scenario) -> None:
    more = with_threats(scenario, [(500.0, -300.0, 250.0, 0.0), (0.0, 600.0, 0.0, 900.0)], "--threat")
    assert more.threats.names[-2:] == ("pop-up 1", "pop-up 2")
    assert more.terrain is not None
    for place in more.threats.position[-2:]:
        assert place[2] == pytest.approx(float(more.terrain.height(place[0], place[1])))
    # The medians of 100 / 400 and 2 / 1, and of 2 / 1.
    assert more.threats.kill_scale[-2:].tolist() == pytest.approx([250.0 * 1.125, 0.0])
    assert more.threats.detection_scale[-2:].tolist() == pytest.approx([0.0, 1800.0])
    assert same_scenario(from_spec(more.to_json(), "again"), more)
    with pytest.raises(ScenarioError, match=r"--threat: kill_radius_m: -5\.0: allowed above 0"):
        with_threats(scenario, [(0.0, 0.0, -5.0, 0.0)], "--threat")


def test_ends_keep_their_heights_above_the_sea_whatever_is_below() -> None:
    before = load_scenario("jacksboro")
    ends = fixed_ends(before.to_json(), before.start, before.destination)
    assert [ends[key]["amsl_m"] for key in ("start", "destination")] == [before.start[2], before.destination[2]]
    assert not any("height_m" in ends[key] for key in ("start", "destination"))
    after = over_terrain(before, "jacksboro")
    assert np.array_equal(after.start, before.start)
    assert np.array_equal(after.destination, before.destination)
    assert np.array_equal(after.bounds, before.bounds)


@pytest.mark.parametrize(("radius", "held"), [(995.0, False), (1005.0, True)])
def test_more_zones_hold_no_end_but_of_a_scenario_made_around_a_mission(
    scenario: Scenario, radius: float, held: bool
) -> None:
    """A cylinder 1 km beside the start, as wide as nearly that, or a little more."""
    east, north = float(scenario.start[0]), float(scenario.start[1]) + 1000.0
    tables = [ZoneTable(name="mill", kind="exclusion", east_m=east, north_m=north, radius_m=radius)]
    external = replace(scenario, external=True)
    made = with_zones(external, tables, "mills.geojson")
    assert [zone.name for zone in made.zones] == ["mill"]
    again = from_spec(made.to_json(), "a log", ground=made.terrain, external=True)
    assert again.zones == made.zones
    if held:
        with pytest.raises(ScenarioError, match=r"mills\.geojson: zones: mill: start lies inside"):
            with_zones(scenario, tables, "mills.geojson")
    else:
        assert with_zones(scenario, tables, "mills.geojson").zones == made.zones


def test_zones_are_counted_with_those_that_are_there(scenario: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("world.scenario_variants.MOST_ZONES", 2)
    tables = [ZoneTable(name="mill", kind="exclusion", east_m=9000.0, north_m=9000.0, radius_m=5.0)]
    two = with_zones(with_zones(scenario, tables, "a"), tables, "b")
    assert len(two.zones) == 2
    with pytest.raises(ScenarioError, match="c: 1 zones more: at most 2 in all"):
        with_zones(two, tables, "c")
