"""One flight of a campaign: the same as ``planfly fly`` in its wind, and of its index alone."""

from dataclasses import replace
from pathlib import Path

from logs.verdict.findings import Verdict, make_finding
from logs.verdict.places import Place
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import failed_findings, fly_one, least_margins, lost_row
from planfly.campaigns.spread.spread_file import parse_spread
from planfly.campaigns.storage.row_values import same_flight
from planfly.open_mission import open_mission
from planfly.pipeline import fly_and_judge
from tests.planfly.campaigns.made_campaigns import write_short
from world.scenario_variants import with_wind


def test_a_flight_is_that_of_fly_in_the_same_wind(base: CampaignBase, tmp_path: Path) -> None:
    """Where wind alone varies, opening the mission in that wind with that seed flies the same."""
    wind_only = '[wind_speed]\ndistribution = "norm"\nscale = 2.0\nsource = "x"'
    varied = replace(base, spread=parse_spread(wind_only, "x"))
    row = fly_one(varied, 3)
    mission, scenario = write_short(tmp_path)
    own = base.scenario.wind
    speed = own.speed + row.draw.values["wind_speed"]
    opened = open_mission(
        mission, str(scenario), None, seed=row.draw.seed, change=lambda s: with_wind(s, speed, own.from_course, None)
    )
    flown = fly_and_judge(opened.setup, opened.airframe, None)
    assert speed != own.speed
    assert (row.outcome == "flyable") is flown.verdict.flyable
    assert row.duration == float(flown.track.time[-1])
    assert dict(row.margins) == dict(least_margins(flown.verdict.findings))
    assert len(row.margins) > 5


def test_the_same_index_gives_the_same_flight_and_log(base: CampaignBase, tmp_path: Path) -> None:
    first = fly_one(base, 2, log=tmp_path / "a.mcap")
    fly_one(base, 1)
    again = fly_one(base, 2, log=tmp_path / "b.mcap")
    assert same_flight(first, again)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    assert not same_flight(first, fly_one(base, 1))


def test_the_draw_shows_in_the_flight(base: CampaignBase) -> None:
    heavy = '[start_up]\ndistribution = "uniform"\nloc = 9.0\nscale = 0.001\nsource = "x"'
    row = fly_one(replace(base, spread=parse_spread(heavy, "x")), 0)
    margin = dict(row.margins)["clearance"].value
    level = fly_one(replace(base, spread=parse_spread(heavy.replace("9.0", "-9.0"), "x")), 0)
    # Below the mission's 80 m above ground by 9 m, where 60 are required: 11 are left, and a little for gusts.
    low = dict(level.margins)["clearance"].value
    assert low is not None
    assert margin is not None
    assert 9.0 < low < 12.0 < margin


def test_a_flight_that_failed_nothing_but_is_not_whole_names_completion() -> None:
    verdict = Verdict((), flyable=False, complete=False, lines=("x",), level="flown")
    assert failed_findings(verdict) == (("completion", Place("flight")),)
    finding = make_finding("turn", Place("waypoint", 1), ok=False, reason="x")
    assert failed_findings(replace(verdict, findings=(finding,))) == (("turn", Place("waypoint", 1)),)


def test_a_lost_flight_keeps_its_draw(base: CampaignBase) -> None:
    assert lost_row(base, 4, "died").draw == fly_one(base, 4).draw
