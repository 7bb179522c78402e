"""What the commands of campaigns have in common."""

import argparse
import json
from pathlib import Path

import pytest

from planfly.campaigns.command_line import (
    campaign_dispersions,
    campaign_goal,
    default_campaign_folder,
    open_base,
    repeated_options,
)
from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.flight_row import fly_one
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.statistics.decision import Goal
from planfly.campaigns.tables import DATABASE
from planfly.terminal.parser import build_parser
from tests.planfly.campaigns.made_campaigns import short_base, write_short
from world.errors import PlanflyError


def parsed(*words: str) -> argparse.Namespace:
    return build_parser().parse_args(["campaign", "jacksboro", *words])


def test_goal_spread_and_line_of_the_options(tmp_path: Path) -> None:
    args = parsed("--prove", "0.99", "--seed", "3")
    assert campaign_goal(args, tmp_path).stops
    assert len(campaign_dispersions(args).varying) > 8
    assert {name: value for name, value in repeated_options(args).items() if value} == {"seed": 3}
    assert default_campaign_folder("some/plan.json", "winds") == Path("runs/plan-winds")


def test_a_goal_that_is_none_is_bad_input(tmp_path: Path) -> None:
    args = parsed("--at-least", "0.9")
    args.prove = 0.9
    with pytest.raises(PlanflyError, match="give one of them"):
        campaign_goal(args, tmp_path)


@pytest.mark.parametrize("goal", [[], ["--at-least", "0.9", "--flights", "9"]])
def test_a_campaign_that_is_gone_on_with_keeps_its_confidence_unless_one_is_named(
    goal: list[str], tmp_path: Path
) -> None:
    base = short_base(tmp_path)
    with open_store(base, Goal(0.9, False, 9, 0.8), tmp_path, resume=False):
        pass
    named = ("0.95", "0.9", "0.8")
    goals = [campaign_goal(parsed("--resume", *goal, "--confidence", one), tmp_path) for one in named]
    assert [one.confidence for one in goals] == [0.95, 0.9, 0.8]
    assert campaign_goal(parsed("--resume", *goal), tmp_path) == Goal(0.9, False, 9, 0.8)
    assert campaign_goal(parsed("--at-least", "0.9"), tmp_path).confidence == 0.95


def test_a_fence_that_is_named_is_kept_to(tmp_path: Path) -> None:
    """Zones join the scenario, fences the mission; and it is another campaign than that without them."""
    mission, scenario = write_short(tmp_path)
    circle, zone = tmp_path / "keep-out.fence", tmp_path / "zone.geojson"
    circle.write_text("QGC WPL 110\n0\t0\t0\t5004\t50\t0\t0\t0\t46.0\t8.00904\t0\t1\n")
    ring = [[8.0, 46.01], [8.01, 46.01], [8.01, 46.02], [8.0, 46.01]]
    zone.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    parse = build_parser().parse_args
    words = ["campaign", str(mission), "--scenario", str(scenario)]
    with_both, without = (
        open_base(parse([*words, *fences]), default_dispersions(), tmp_path / name, DATABASE, again=False)
        for name, fences in (("a", ["--fence", str(circle), "--fence", str(zone)]), ("b", []))
    )
    assert [item.command for item in with_both.mission.fences] == [5004]
    assert len(with_both.scenario.spec.zones) == 1
    assert with_both.world_hash() != without.world_hash()
    assert "fence" not in {rule for rule, _ in fly_one(without, 0).failed}
    assert "fence" in {rule for rule, _ in fly_one(with_both, 0).failed}
