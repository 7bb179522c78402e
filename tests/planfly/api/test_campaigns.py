"""`planfly.winds` and `planfly.campaign`: what is asked for is what is flown."""

import json
from pathlib import Path
from typing import Any

import pytest

import planfly
from planfly.api import campaigns
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.dispersions import default_dispersions, draw_flight
from planfly.campaigns.find_winds import WindsGoal, WindsResult
from planfly.campaigns.flight_requests import FlyOne
from planfly.campaigns.flight_row import FlightRow, fly_one
from planfly.campaigns.fly_campaign import fly_campaign, open_store
from planfly.campaigns.report import OutputDirectory
from planfly.campaigns.statistics.decision import Estimate, Goal
from planfly.campaigns.statistics.wind_boundary import Direction
from planfly.campaigns.tables import CAMPAIGN_DATABASE, RequestedFlight, Store, WindsStore
from planfly.campaigns.worker_pool import Workers
from planfly.runtime.stages import Advance
from tests.planfly.campaigns.made_campaigns import all_fly, made_flight, short_base, table, write_short
from tests.planfly.campaigns.statistics.made_directions import no_numbers
from tests.planfly.conftest import FIELD
from tests.soak import SOAK

FLIGHTS = tuple((number, speed, speed < 8.0) for number in range(4) for speed in (2.0, 6.0, 7.5, 8.5, 10.0, 14.0))


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[CampaignBase, WindsGoal]]:
    """What a search was asked; it finds that 8 m/s decide."""
    seen = []

    def found(base: CampaignBase, goal: WindsGoal, _: object, store: WindsStore, __: object) -> WindsResult:
        seen.append((base, goal))
        if not store.stored_flights():
            store.add(RequestedFlight(0, 0, 5.0, 0), made_row(base))
        directions = [Direction(goal.most, goal.target, no_numbers(), goal.confidence) for _ in range(goal.directions)]
        for draw, (number, speed, flyable) in enumerate(FLIGHTS):
            directions[number].add(speed, draw, frozenset() if flyable else frozenset({"slope"}))
        return WindsResult(goal, tuple(one.boundary() for one in directions), FLIGHTS)

    monkeypatch.setattr(campaigns, "find_winds", found)
    return seen


def made_row(base: CampaignBase) -> FlightRow:
    return FlightRow(draw_flight(base.dispersions, base.seed, 0), "flyable", "completed")


def test_what_is_asked_is_what_is_flown(asked: list[tuple[CampaignBase, WindsGoal]], tmp_path: Path) -> None:
    out = tmp_path / "out"
    found = planfly.winds("paper-07", prove=0.9, directions=4, most=15.0, flights=199, seed=2, out=out)
    ((base, goal),) = asked
    assert goal == WindsGoal(0.9, 0.95, 4, 15.0, 199)
    assert base.seed == 2
    assert not {"wind_speed", "wind_from"} & {one.quantity.name for one in base.dispersions.varying}
    names = ["plan.json", "winds.html", "winds.json", "winds.png", "winds.sqlite"]
    assert sorted(file.name for file in out.iterdir()) == names
    assert repr(found).startswith("<WindsResult 4 directions")
    assert repr(found).endswith(" 24 flights>")
    # It goes on with the plan and the flights that are there; another question is refused.
    plan = (out / "plan.json").read_bytes()
    planfly.winds("paper-07", prove=0.9, directions=4, most=15.0, seed=2, out=out, resume=True)
    assert (out / "plan.json").read_bytes() == plan
    assert len(table(out / "winds.sqlite")) == 1
    with pytest.raises(planfly.PlanflyError, match="directions 8: the campaign in this file has 4"):
        planfly.winds("paper-07", prove=0.9, directions=8, most=15.0, seed=2, out=out, resume=True)


def test_too_few_flights_for_all_directions_are_stated_at_once(
    asked: list[tuple[CampaignBase, WindsGoal]], caplog: pytest.LogCaptureFixture
) -> None:
    text = "cannot judge all 4 directions; that needs at least 600 flights"
    for flights, is_warned in ((150, True), (599, True), (600, False)):
        planfly.winds("paper-07", directions=4, flights=flights)
        assert (f"warning: {flights} flights {text}" in caplog.text) is is_warned
    assert len(asked) == 3


def test_nothing_to_go_on_with(asked: list[object], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="resume: `out` is missing"):
        planfly.winds("paper-07", resume=True)
    with pytest.raises(ValueError, match="resume: `out` is missing"):
        planfly.campaign("paper-07", resume=True)
    assert asked == []


@pytest.mark.parametrize(
    "bad",
    [
        {"prove": 0.49},
        {"prove": 1.0},
        {"confidence": 1.0},
        {"directions": 3},
        {"directions": 73},
        {"most": 0.9},
        {"most": 41.0},
        {"flights": 0},
        # No direction is judged by fewer than 150 flights.
        {"flights": 149},
    ],
)
def test_numbers_that_are_none_are_refused(bad: dict[str, Any], asked: list[object]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        planfly.winds("paper-07", **bad)
    assert asked == []


# ----------------------------------------------------------------------
# Campaigns: the goal of one that goes on, and fences.


def test_a_goal_is_one_of_two(tmp_path: Path) -> None:
    with pytest.raises(planfly.ArgumentError, match="give only one of them"):
        planfly.campaign("paper-07", prove=0.9, at_least=0.9)


@pytest.mark.parametrize("goal", [(None, None, None), (9, None, 0.9)])
def test_a_campaign_that_goes_on_keeps_its_confidence_unless_one_is_named(
    goal: tuple[int | None, float | None, float | None], tmp_path: Path
) -> None:
    base = short_base(tmp_path)
    with open_store(base, Goal(0.9, False, 9, 0.8), tmp_path, resume=False):
        pass
    flights, prove, at_least = goal
    named = (0.95, 0.9, 0.8)
    goals = [campaigns.continued_goal(tmp_path, flights, prove, at_least, one) for one in named]
    assert [one.confidence for one in goals] == list(named)
    assert campaigns.continued_goal(tmp_path, flights, prove, at_least, None) == Goal(0.9, False, 9, 0.8)
    assert campaigns.continued_goal(tmp_path, 12, prove, at_least, None).target == 0.9


def test_a_campaign_that_goes_on_without_a_number_says_its_number(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    base = short_base(tmp_path)
    out = tmp_path / "out"
    out.mkdir()
    with open_store(base, Goal(None, False, 2), out, resume=False) as store:
        for index in range(2):
            store.add(made_flight(base, index))
    monkeypatch.setattr(campaigns, "finish_campaign", lambda base, goal, estimate, *_: estimate)
    options = {"scenario": tmp_path / "short.toml", "seed": 1, "out": out, "resume": True}
    planfly.campaign(tmp_path / "short.waypoints", at_least=0.9, **options)
    too_few = (
        "warning: 2 flights cannot show a probability of at least 0.9, even if all are flyable; that needs"
        " 29 flights without a failure"
    )
    # 0.9^28 is above and 0.9^29 below 0.05.
    assert caplog.messages == ["number of flights: 2, as in the resumed campaign", too_few]
    caplog.clear()
    planfly.campaign(tmp_path / "short.waypoints", flights=2, at_least=0.9, **options)
    assert caplog.messages == [too_few]


def test_a_fence_that_is_named_is_kept_to(tmp_path: Path) -> None:
    """Zones join the scenario, fences the mission; and it is another campaign than that without them."""
    mission, scenario = write_short(tmp_path)
    circle, zone = tmp_path / "keep-out.fence", tmp_path / "zone.geojson"
    circle.write_text("QGC WPL 110\n0\t0\t0\t5004\t50\t0\t0\t0\t46.0\t8.00904\t0\t1\n")
    ring = [[8.0, 46.01], [8.01, 46.01], [8.01, 46.02], [8.0, 46.01]]
    zone.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    with_both, without = (
        campaigns._open_base(
            mission,
            {"scenario": scenario, "fence": fences},
            default_dispersions(),
            OutputDirectory(tmp_path / name, CAMPAIGN_DATABASE, resume=False, overwrite=False),
        )
        for name, fences in (("a", [circle, zone]), ("b", []))
    )
    assert [item.command for item in with_both.mission.fences] == [5004]
    assert len(with_both.scenario.spec.zones) == 1
    assert with_both.inputs_hash() != without.inputs_hash()
    assert "fence" not in {rule for rule, _ in fly_one(without, 0).failed}
    assert "fence" in {rule for rule, _ in fly_one(with_both, 0).failed}


def without_pool(monkeypatch: pytest.MonkeyPatch, fly: FlyOne) -> None:
    """Have every flight of a campaign in its table before a pool would be asked for it."""

    def flown(base: CampaignBase, goal: Goal, workers: Workers, store: Store, advance: Advance) -> Estimate:
        for index in range(goal.flights):
            store.add(fly(base, index, None))
        return fly_campaign(base, goal, workers, store, advance)

    monkeypatch.setattr(campaigns, "fly_campaign", flown)


def test_a_plan_at_hand_is_flown_as_its_file_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same mission, draws and flights; the line that repeats it names the plan in the campaign's folder."""
    (tmp_path / "field.toml").write_text(f"{FIELD}[planner]\npopulation = 20\ngenerations = 5\n", encoding="utf-8")
    plan = planfly.plan(tmp_path / "field.toml", seed=1, out=tmp_path / "plan.json")
    bases = [
        campaigns._open_base(
            target,
            {"seed": 3, "wind": (4.0, 90.0)},
            default_dispersions(),
            OutputDirectory(tmp_path / name, CAMPAIGN_DATABASE, resume=False, overwrite=False),
        )
        for name, target in (("a", plan), ("b", tmp_path / "plan.json"))
    ]
    assert bases[0].inputs_hash() == bases[1].inputs_hash()
    assert (tmp_path / "a" / "plan.json").read_bytes() == (tmp_path / "b" / "plan.json").read_bytes()
    assert bases[0].scenario.wind.speed == 4.0
    if not SOAK:
        without_pool(monkeypatch, fly_one)
    found = planfly.campaign(plan, flights=2, workers=1, seed=3, wind=(4.0, 90.0), out=tmp_path / "c")
    assert found.columns["outcome"].tolist() == [fly_one(bases[1], k).outcome for k in (0, 1)]
    page = (tmp_path / "c" / "report.html").read_text(encoding="utf-8")
    assert f"planfly campaign {tmp_path / 'c' / 'plan.json'} --flights 2" in page


def test_a_campaign_whose_folder_does_not_stay_gives_its_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the flights made up, which a pool would fly: the store holds its table as long as it is open."""

    without_pool(monkeypatch, all_fly)
    plan = planfly.plan("paper-07", seed=1)
    found = planfly.campaign(plan, flights=5, wind=(4.0, 90.0))
    assert found.columns["outcome"].tolist() == ["flyable"] * 5
    assert found.table is None
    assert found.summary.estimate.tally.flown == 5
