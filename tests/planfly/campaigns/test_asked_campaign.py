"""What the commands of campaigns have in common."""

import argparse
from pathlib import Path

import pytest

from planfly.campaigns.asked_campaign import campaign_goal, campaign_spread, command_line, default_campaign_folder
from planfly.terminal.parser import build_parser
from world.errors import PlanflyError


def parsed(*words: str) -> argparse.Namespace:
    return build_parser().parse_args(["campaign", "jacksboro", *words])


def test_goal_spread_and_line_of_the_options() -> None:
    args = parsed("--prove", "0.99", "--seed", "3")
    assert campaign_goal(args).stops
    assert len(campaign_spread(args).varying) > 8
    assert command_line(args) == "planfly campaign jacksboro --prove 0.99 --seed 3"
    assert default_campaign_folder("some/plan.json", "winds") == Path("runs/plan-winds")


def test_a_goal_that_is_none_is_bad_input() -> None:
    args = parsed("--at-least", "0.9")
    args.prove = 0.9
    with pytest.raises(PlanflyError, match="give one of them"):
        campaign_goal(args)
