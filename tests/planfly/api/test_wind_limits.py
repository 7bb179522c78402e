"""`planfly.winds`: the search of the command, its numbers checked, its files where they are asked for."""

from pathlib import Path
from typing import Any

import pytest

import planfly
from planfly.api import wind_limits
from planfly.campaigns.find_winds import WindsFound, WindsGoal
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.statistics.wind_boundary import Direction

FLIGHTS = tuple((number, speed, speed < 8.0) for number in range(4) for speed in (2.0, 6.0, 7.5, 8.5, 10.0, 14.0))


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[CampaignBase, WindsGoal]]:
    """What a search was asked; it finds that 8 m/s decide."""
    seen = []

    def found(base: CampaignBase, goal: WindsGoal, *_: object) -> WindsFound:
        seen.append((base, goal))
        directions = [Direction(goal.most, goal.target, goal.confidence) for _ in range(goal.directions)]
        for number, speed, flyable in FLIGHTS:
            directions[number].add(speed, flyable)
        return WindsFound(goal, tuple(one.boundary() for one in directions), FLIGHTS)

    monkeypatch.setattr(wind_limits, "find_winds", found)
    return seen


def test_what_is_asked_is_what_is_flown(asked: list[tuple[CampaignBase, WindsGoal]], tmp_path: Path) -> None:
    found = planfly.winds("paper-07", prove=0.9, directions=4, most=15.0, flights=99, seed=2, out=tmp_path / "out")
    ((base, goal),) = asked
    assert goal == WindsGoal(0.9, 0.95, 4, 15.0, 99)
    assert base.seed == 2
    assert not {"wind_speed", "wind_from"} & {one.quantity.name for one in base.spread.varying}
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["winds.html", "winds.json", "winds.png"]
    assert repr(found).startswith("<WindsFound 4 directions, ")
    assert repr(found).endswith(" 24 flights>")


@pytest.mark.parametrize(
    "bad",
    [{"prove": 0.49}, {"prove": 1.0}, {"confidence": 1.0}, {"directions": 3}, {"directions": 73}, {"most": 0.9},
     {"most": 41.0}, {"flights": 0}],
)  # fmt: skip
def test_numbers_that_are_none_are_refused(bad: dict[str, Any], asked: list[object]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        planfly.winds("paper-07", **bad)
    assert asked == []
