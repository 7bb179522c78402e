"""`planfly.winds`: the search of the command, its numbers checked, its files where they are asked for."""

from pathlib import Path
from typing import Any

import pytest

import planfly
from planfly.api import wind_limits
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.dispersions import draw_flight
from planfly.campaigns.find_winds import WindsFound, WindsGoal
from planfly.campaigns.flight_row import FlightRow
from planfly.campaigns.statistics.wind_boundary import Direction
from planfly.campaigns.tables import AskedFlight, WindsStore
from tests.planfly.campaigns.made_campaigns import table
from tests.planfly.campaigns.statistics.made_directions import no_numbers

FLIGHTS = tuple((number, speed, speed < 8.0) for number in range(4) for speed in (2.0, 6.0, 7.5, 8.5, 10.0, 14.0))


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[CampaignBase, WindsGoal]]:
    """What a search was asked; it finds that 8 m/s decide."""
    seen = []

    def found(base: CampaignBase, goal: WindsGoal, _: object, store: WindsStore) -> WindsFound:
        seen.append((base, goal))
        if not store.known():
            store.add(AskedFlight(0, 0, 5.0, 0), made_row(base))
        directions = [Direction(goal.most, goal.target, no_numbers(), goal.confidence) for _ in range(goal.directions)]
        for draw, (number, speed, flyable) in enumerate(FLIGHTS):
            directions[number].add(speed, draw, frozenset() if flyable else frozenset({"slope"}))
        return WindsFound(goal, tuple(one.boundary() for one in directions), FLIGHTS)

    monkeypatch.setattr(wind_limits, "find_winds", found)
    return seen


def made_row(base: CampaignBase) -> FlightRow:
    return FlightRow(draw_flight(base.dispersions, base.seed, 0), "flyable", "completed")


def test_what_is_asked_is_what_is_flown(asked: list[tuple[CampaignBase, WindsGoal]], tmp_path: Path) -> None:
    out = tmp_path / "out"
    found = planfly.winds("paper-07", prove=0.9, directions=4, most=15.0, flights=99, seed=2, out=out)
    ((base, goal),) = asked
    assert goal == WindsGoal(0.9, 0.95, 4, 15.0, 99)
    assert base.seed == 2
    assert not {"wind_speed", "wind_from"} & {one.quantity.name for one in base.dispersions.varying}
    names = ["plan.json", "winds.html", "winds.json", "winds.png", "winds.sqlite"]
    assert sorted(file.name for file in out.iterdir()) == names
    assert repr(found).startswith("<WindsFound 4 directions, ")
    assert repr(found).endswith(" 24 flights>")
    # It goes on with the plan and the flights that are there; another question is refused.
    plan = (out / "plan.json").read_bytes()
    planfly.winds("paper-07", prove=0.9, directions=4, most=15.0, seed=2, out=out, resume=True)
    assert (out / "plan.json").read_bytes() == plan
    assert len(table(out / "winds.sqlite")) == 1
    with pytest.raises(planfly.PlanflyError, match="directions 8: the flights there were asked for with 4"):
        planfly.winds("paper-07", prove=0.9, directions=8, most=15.0, seed=2, out=out, resume=True)


def test_nothing_to_go_on_with(asked: list[object], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="resume: out is missing"):
        planfly.winds("paper-07", resume=True)
    with pytest.raises(ValueError, match="resume: out is missing"):
        planfly.campaign("paper-07", resume=True)
    assert asked == []


@pytest.mark.parametrize(
    "bad",
    [{"prove": 0.49}, {"prove": 1.0}, {"confidence": 1.0}, {"directions": 3}, {"directions": 73}, {"most": 0.9},
     {"most": 41.0}, {"flights": 0}],
)  # fmt: skip
def test_numbers_that_are_none_are_refused(bad: dict[str, Any], asked: list[object]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        planfly.winds("paper-07", **bad)
    assert asked == []
