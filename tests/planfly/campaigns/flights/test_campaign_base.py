"""What all flights share: opened once, and refused before anything is flown."""

from dataclasses import replace
from pathlib import Path

import pytest

from planfly.campaigns.flights.campaign_base import CampaignBase, check_middle, open_campaign
from planfly.campaigns.spread.spread_file import SpreadError, default_spread, parse_spread
from planfly.open_mission import open_mission
from tests.planfly.campaigns.made_campaigns import write_short
from world.errors import MissionError


def test_it_has_the_mission_as_fly_opens_it(base: CampaignBase, tmp_path: Path) -> None:
    mission, scenario = write_short(tmp_path)
    opened = open_mission(mission, str(scenario), None)
    assert base.mission.items == opened.setup.mission.items
    assert base.scenario.to_json() == opened.setup.scenario.to_json()
    # Whatever folder it lies in.
    assert base.mission.source == "short.waypoints"


def test_the_hash_is_of_all_that_decides_a_flight(base: CampaignBase) -> None:
    other = parse_spread('[mass]\ndistribution = "norm"\nloc = 1.0\nscale = 0.02\nsource = "x"', "x")
    assert base.world_hash() == replace(base, name="another").world_hash()
    fenced = replace(base.mission, fences=base.mission.items[:1])
    for changed in (replace(base, seed=2), replace(base, spread=other), replace(base, mission=fenced)):
        assert changed.world_hash() != base.world_hash()


@pytest.mark.parametrize(("mass", "good"), [(1.0, True), (1.9, False)])
def test_an_aircraft_that_cannot_fly_is_refused(base: CampaignBase, mass: float, good: bool) -> None:
    text = f'[mass]\ndistribution = "uniform"\nloc = {mass - 0.05}\nscale = 0.1\nsource = "x"\n'
    text += '[drag]\ndistribution = "uniform"\nloc = 2.8\nscale = 0.1\nsource = "x"\n' if not good else ""
    made = replace(base, spread=parse_spread(text, "mine.toml"))
    if good:
        check_middle(made)
        return
    with pytest.raises(SpreadError, match=r"mine.toml: mass 1.9, drag 2.85: .* no level flight at 25 m/s"):
        check_middle(made)


def test_a_missing_mission_is_one_line() -> None:
    with pytest.raises(MissionError, match="no such file"):
        open_campaign("none.waypoints", default_spread())
