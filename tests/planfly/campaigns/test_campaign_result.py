"""The line that repeats a campaign asks for the same."""

import argparse
import shlex
from pathlib import Path
from types import SimpleNamespace

import pytest

import planfly
from planfly.api import campaigns
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.campaign_result import (
    DEFAULT_FLIGHTS,
    MAX_FLIGHTS,
    CampaignResult,
    campaign_command_line,
    make_goal,
    winds_command_line,
)
from planfly.campaigns.find_winds import WindsGoal, make_winds_goal
from planfly.campaigns.flight_row import STATION_COUNT
from planfly.campaigns.tables import CAMPAIGN_DATABASE, read_table
from planfly.cli import build_parser
from tests.planfly.campaigns.made_report import made_report

FLOWN = ("aircraft", "airspeed", "wind", "turbulence", "forecast", "at", "params", "guidance", "autopilot", "nav")
FLOWN_BY = (
    "--wind 8.25,270 --turbulence light --nav rtk --aircraft aerosonde --airspeed 21.5 --fence a.fence --fence b.kml "
    "--autopilot px4"
)


@pytest.mark.parametrize(
    "words",
    [
        "",
        "--prove 0.999 --flights 77 --confidence 0.9",
        "--at-least 0.95 --flights 1200 --seed 4 --spread 'my own.toml'",
        f"--prove 0.9 --scenario s.toml --terrain my.tif {FLOWN_BY}",
        "--guidance l1",
    ],
)
def test_a_campaigns_line_is_read_as_the_same_options(words: str) -> None:
    parse = build_parser().parse_args
    asked = parse(["campaign", "my plan.json", *shlex.split(words)])
    goal = make_goal(asked.flights, asked.prove, asked.at_least, asked.confidence)
    line = shlex.split(campaign_command_line(asked.target, goal, repeated_options(asked)))
    again = parse(line[1:])
    assert line[:3] == ["planfly", "campaign", "my plan.json"]
    assert make_goal(again.flights, again.prove, again.at_least, again.confidence) == goal
    assert repeated_options(again) == repeated_options(asked)


@pytest.mark.parametrize(
    "words", ["", "--prove 0.9 --directions 8 --most 12.5 --confidence 0.8 --flights 44", FLOWN_BY]
)
def test_a_searchs_line_is_read_as_the_same_options(words: str) -> None:
    parse = build_parser().parse_args
    asked = parse(["winds", "jacksboro-air", *shlex.split(words)])
    goal = asked_winds(asked)
    again = parse(shlex.split(winds_command_line(asked.target, goal, repeated_options(asked)))[1:])
    assert asked_winds(again) == goal
    assert repeated_options(again) == repeated_options(asked)


def asked_winds(args: argparse.Namespace) -> WindsGoal:
    """The goal of the options given, with the defaults."""
    requested = {"target": args.prove, **{name: getattr(args, name) for name in ("confidence", "directions", "most")}}
    return make_winds_goal(requested | {"flights": args.flights}, Path("none"), resume=False)


def repeated_options(args: argparse.Namespace) -> dict[str, object]:
    """What the API repeats, of the options given."""
    base = SimpleNamespace(seed=args.seed)
    flown = {name: getattr(args, name) for name in FLOWN}
    options = {"scenario": args.scenario, "terrain": args.terrain, "fence": args.fence, "seed": args.seed, **flown}
    return campaigns._list_command_line_options(base, options, args.spread, Path())  # type: ignore[arg-type]


def test_every_option_that_decides_what_is_flown_is_repeated() -> None:
    """What a command takes beside them decides how, where to or how many, or is the goal's."""
    asked = build_parser().parse_args(["campaign", "jacksboro-air"])
    others = {"command", "target", "prove", "at_least", "flights", "confidence", "workers", "scheduler", "resume"}
    others |= {"refly", "out", "overwrite", "json", "junit", "quiet"}
    # The options given, by keyword: the same once more.
    others |= {"options"}
    assert set(vars(asked)) - others == set(repeated_options(asked))


# ----------------------------------------------------------------------
# Campaigns for Python.


def test_the_public_name_is_the_package_s() -> None:
    assert planfly.campaign.__name__ == "campaign"
    assert planfly.CampaignResult is CampaignResult


def test_what_it_tells(base: CampaignBase, tmp_path: Path) -> None:
    with made_report(base, tmp_path) as (store, summary):
        tally = store.tally()
    result = CampaignResult(summary, read_table(tmp_path / CAMPAIGN_DATABASE), tmp_path / CAMPAIGN_DATABASE)
    assert result.probability == tally.flyable / 60
    assert result.interval.low < result.probability < result.interval.high
    assert result.bounds.low > result.interval.low
    assert result.by_rule == {"clearance": tally.failed}
    flights = result.flights
    assert list(flights["flight"]) == list(range(60))
    assert list(flights["outcome"]).count("lost") == 1
    assert "clearance" not in flights
    # Places are numbers, not JSON: NaN only where the rule was not judged.
    assert not any(name in flights for name in ("place_clearance", "place_energy"))
    for name in ("index", "item"):
        assert flights[f"place_clearance_{name}"].dtype.kind == "f"
    is_leg = flights["place_clearance_kind"] == "leg"
    assert is_leg.sum() > 0
    assert (flights["place_clearance_index"].notna() == is_leg).all()
    assert result.path_arrays()["clearance"].shape == (60, STATION_COUNT)
    with pytest.raises(ValueError, match="has no folder; name one with `out`"):
        CampaignResult(summary, result.columns).path_arrays()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((None, 0.9, 0.9, 0.95), "one of them"),
        ((None, 1.0, None, 0.95), "prove 1.0"),
        ((None, None, 0.4, 0.95), "at_least 0.4"),
        ((None, None, None, 1.0), "confidence 1.0"),
        ((0, None, None, 0.95), "flights 0"),
    ],
)
def test_numbers_that_are_none(given: tuple[int | None, float | None, float | None, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make_goal(*given)


def test_how_many_flights_are_meant() -> None:
    assert make_goal(None, None, None, 0.95).flights == DEFAULT_FLIGHTS
    assert make_goal(None, 0.99, None, 0.95).flights == MAX_FLIGHTS
    assert make_goal(7, None, 0.9, 0.95).target == 0.9
