"""The line that repeats a campaign asks for the same."""

import shlex

import pytest

from planfly.campaigns.asked_campaign import campaign_spread, repeated_options
from planfly.campaigns.campaign_result import make_goal
from planfly.campaigns.find_winds import WindsGoal
from planfly.campaigns.repeated_line import campaign_line, winds_line
from planfly.terminal.parser import build_parser

FLOWN_BY = (
    "--wind 8.25,270 --turbulence light --nav rtk --aircraft aerosonde --airspeed 21.5 --fence a.fence --fence b.kml"
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
    line = shlex.split(campaign_line(asked.target, goal, repeated_options(asked)))
    again = parse(line[1:])
    assert line[:3] == ["planfly", "campaign", "my plan.json"]
    assert make_goal(again.flights, again.prove, again.at_least, again.confidence) == goal
    assert repeated_options(again) == repeated_options(asked)


@pytest.mark.parametrize(
    "words", ["", "--prove 0.9 --directions 8 --most 12.5 --confidence 0.8 --flights 44", FLOWN_BY]
)
def test_a_searchs_line_is_read_as_the_same_options(words: str) -> None:
    parse = build_parser().parse_args
    asked = parse(["winds", "jacksboro", *shlex.split(words)])
    goal = WindsGoal(asked.prove, asked.confidence, asked.directions, asked.most, asked.flights or 5000)
    again = parse(shlex.split(winds_line(asked.target, goal, repeated_options(asked)))[1:])
    assert (again.prove, again.confidence, again.directions, again.most) == (
        asked.prove, asked.confidence, asked.directions, asked.most,
    )  # fmt: skip
    assert (again.flights or 5000) == goal.flights
    assert repeated_options(again) == repeated_options(asked)


def test_every_option_that_decides_what_is_flown_is_repeated() -> None:
    """What a command takes beside them decides how, where to or how many, or is the goal's."""
    asked = vars(build_parser().parse_args(["campaign", "jacksboro"]))
    others = {
        "command",
        "call",
        "target",
        "prove",
        "at_least",
        "flights",
        "confidence",
        "workers",
        "scheduler",
        "resume",
    }
    others |= {"refly", "out", "overwrite", "json", "quiet"}
    assert set(asked) - others == set(repeated_options(build_parser().parse_args(["campaign", "jacksboro"])))
    assert campaign_spread(build_parser().parse_args(["campaign", "jacksboro"])).varying
