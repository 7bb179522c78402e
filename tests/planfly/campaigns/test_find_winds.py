"""The boundary of made flights, whose truth is known; the same whoever flew, and however often it was stopped."""

import random
import re
import threading
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import pytest

from logs.verdict.places import Place
from planfly.campaigns import find_winds as find_winds_module
from planfly.campaigns.campaign_base import CampaignBase, GivenWind
from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.failure_counts import RuleFailures
from planfly.campaigns.find_winds import (
    MIN_FLIGHTS_PER_DIRECTION,
    SEARCHED_QUANTITIES,
    CalmFailures,
    WindsGoal,
    WindsResult,
    _Search,
    find_winds,
    make_winds_goal,
    open_winds_store,
)
from planfly.campaigns.flight_requests import FlyOne
from planfly.campaigns.flight_row import FlightRow, fly_one, make_lost_row
from planfly.campaigns.report import wind_lines
from planfly.campaigns.tables import WINDS_DATABASE, FlownFlight, RequestedFlight, StoreError
from planfly.campaigns.worker_pool import Workers
from tests.planfly.campaigns.kills import finish_client, kill_while_it_flies, workers_killed
from tests.planfly.campaigns.made_campaigns import (
    deadly_in_the_east,
    made_flight,
    short_base,
    slow_flight,
    table,
)
from tests.planfly.campaigns.made_searches import GOAL, flying_here, keep_part, same, searched
from tests.planfly.campaigns.slow_client import winds_goal
from tests.soak import SOAK, note, scaled, some

pytestmark = pytest.mark.filterwarnings("default")
LEG = Place("leg", 3)
FEWER = WindsGoal(0.9, 0.95, 4 if SOAK else 2, 20.0, scaled(200, 96))


@pytest.fixture(scope="module")
def wind_base(tmp_path_factory: pytest.TempPathFactory) -> CampaignBase:
    return short_base(tmp_path_factory.mktemp("winds"), default_dispersions().without(SEARCHED_QUANTITIES))


@pytest.fixture
def here() -> Iterator[None]:
    with flying_here():
        yield


@pytest.fixture(scope="module")
def whole(wind_base: CampaignBase, tmp_path_factory: pytest.TempPathFactory) -> tuple[WindsResult, Path]:
    """A search that was never stopped, for `FEWER`, and its folder."""
    folder = tmp_path_factory.mktemp("whole")
    with flying_here():
        return searched(wind_base, folder, FEWER), folder


@pytest.mark.usefixtures("here")
def test_the_boundary_is_found_in_each_direction(wind_base: CampaignBase, tmp_path: Path) -> None:
    goal = replace(GOAL, flights=scaled(400, 240))
    found = searched(wind_base, tmp_path, goal)
    # A flight fails from W + luck - 0.5 on, luck even in 0..1: one in ten has failed at W - 0.4.
    truth = [7.6, 7.6, 7.6, 11.6]
    for direction, boundary in enumerate(found.boundaries):
        assert boundary.estimate == pytest.approx(truth[direction], abs=0.5)
        assert boundary.low <= boundary.estimate <= boundary.high
        assert not boundary.is_beyond_search
    assert len(found.flights) <= goal.flights
    assert found.from_deg(3) == 270.0
    assert found.lost == ()
    # The wind is what is asked for: none is stated, whatever the scenario's is.
    lines = wind_lines(found)
    start = next(number for number, line in enumerate(lines) if line.startswith("Aircraft: aerosonde, 11 kg, 25 m/s"))
    world, pilot = lines[start + 1 : start + 3]
    assert world.startswith(
        "Conditions: wind from every direction in turn, light turbulence (vertical gusts: 0.77 m/s RMS); "
    )
    assert pilot.startswith("Flown by: ")
    # No draw is flown twice in a direction, and those of least index are among them.
    rows = table(tmp_path / WINDS_DATABASE)
    for direction in range(4):
        draws = [row[3] for row in rows if row[1] == direction]
        assert len(set(draws)) == len(draws)
        assert set(range(len(draws) // 3)) <= set(draws)


def flight_that_states_its_margin(base: CampaignBase, index: int, wind: GivenWind) -> FlightRow:
    """A made flight that also tells by how much it passed, where that is less than a metre a second of wind."""
    row = made_flight(base, index, wind)
    margin = (12.0 if wind.from_deg == 270.0 else 8.0) + row.draw.seed % 1000 / 1000.0 - 0.5 - wind.speed
    return replace(row, marginal_passes=(("clearance", Place("leg", 1), margin),)) if 0.0 < margin < 1.0 else row


def test_failures_in_calm_air_are_known_by_rule_and_place(wind_base: CampaignBase) -> None:
    """From N and E every flight fails, in calm air at leg 3; from S and W every flight in 20 m/s flies."""
    search = _Search(GOAL, wind_base)
    failed = FlownFlight("not flyable", (("clearance", LEG),))
    flies = FlownFlight("flyable", ())
    flown = [(direction, 0.0, failed) for direction in (0, 0, 1)] + [(0, 5.0, failed)] * 20 + [(1, 5.0, failed)] * 20
    flown += [(direction, 20.0, flies) for direction in (2, 3) for _ in range(60)]
    for number, (direction, speed, outcome) in enumerate(flown):
        search.add_result(RequestedFlight(number, direction, speed, number), outcome)
    calm = search.result().calm
    assert calm == CalmFailures(0.0, 3, 3, (RuleFailures("clearance", 3, ((LEG, 3),)),))
    windy = _Search(GOAL, wind_base)
    for number in range(80):
        windy.add_result(RequestedFlight(number, number % 4, 20.0, number), flies)
    assert windy.result().calm is None


def test_a_direction_in_which_every_flight_fails_does_not_fail_the_mission_in_calm_air(wind_base: CampaignBase) -> None:
    """From S all of 4 flights fail in 5 m/s and of 6 in 10 m/s; from the others all of 18 fly in 10 m/s."""
    search = _Search(GOAL, wind_base)
    failed = FlownFlight("not flyable", (("landing", Place("waypoint", 9)),))
    flown = [(2, 5.0, failed)] * 4 + [(2, 10.0, failed)] * 6
    flown += [(direction, 10.0, FlownFlight("flyable", ())) for direction in (0, 1, 3) for _ in range(6)]
    for number, (direction, speed, outcome) in enumerate(flown):
        search.add_result(RequestedFlight(number, direction, speed, number), outcome)
    found = search.result()
    assert found.calm is None
    assert found.answer == "not judged"
    assert found.reasons[2] == "10 of at least 150 flights"
    lines = wind_lines(found)
    assert lines[0].startswith("not judged: 4 of 4 directions have too few flights (6 to 10 flights)")
    assert lines[1:4] == [
        "directions in which the boundary is not proven, with their own flights:",
        "  from 0° to 90°: no failure up to 10.0 m/s (0 of 12 flights failed)",
        "  from 180°: weakest failure at 5.0 m/s (10 of 10 flights failed)",
    ]
    assert not any("calm" in line for line in lines)
    # Flights in nearly calm air show it.
    search.add_result(RequestedFlight(len(flown), 2, 0.5, 0), failed)
    assert search.result().calm == CalmFailures(0.5, 1, 1, (RuleFailures("landing", 1, ((Place("waypoint", 9), 1),)),))


def test_flights_that_are_not_judged_in_full_are_no_failures(wind_base: CampaignBase) -> None:
    """From N 6 flights are undecided and 6 fail; from E 150 fly, in 20 m/s, and one is undecided."""
    search = _Search(GOAL, wind_base)
    loiter = (("loiter", Place("waypoint", 4)),)
    undecided = FlownFlight("undecided", loiter, undecided="loiters (state the bank limit)")
    flown = [(0, 5.0, undecided)] * 6 + [(0, 10.0, FlownFlight("not flyable", loiter))] * 6
    flown += [(1, 20.0, FlownFlight("flyable", ()))] * MIN_FLIGHTS_PER_DIRECTION + [(1, 20.0, undecided)]
    for number, (direction, speed, outcome) in enumerate(flown):
        search.add_result(RequestedFlight(number, direction, speed, number), outcome)
    found = search.result()
    assert found.undecided_counts() == [6, 1, 0, 0]
    assert found.failures[:2] == ((RuleFailures("loiter", 6, ((Place("waypoint", 4), 6),)),), ())
    assert found.calm is None
    assert found.answer == "not judged"
    assert found.reasons[:2] == (
        "6 of 12 flights not judged in full",
        "1 of 151 flights not judged in full",
    )
    assert found.judged == (False, False, False, False)
    lines = wind_lines(found)
    assert lines[0] == (
        "not judged: 7 of 163 flights are not judged in full; first reason: loiters (state the bank limit)"
    )
    assert lines[1].startswith("not judged: 2 of 4 directions have too few flights (0 flights)")
    assert not any("best estimate" in line or "the weakest wind" in line for line in lines)


def undecided_flight(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """A flight whose loiter is not judged."""
    return replace(
        made_flight(base, index, wind),
        outcome="undecided",
        failed=(("loiter", LEG),),
        undecided_text="loiters (a guess)",
    )


@pytest.mark.usefixtures("here")
def test_a_search_that_ends_in_calm_air_reports_the_flights_flown(wind_base: CampaignBase, tmp_path: Path) -> None:
    """Three flights show a target of 0.9: 0.1 ** 2 is below 5 %, and three are flown at least."""
    reports: list[tuple[float, float, str]] = []
    searched(wind_base, tmp_path, fly=undecided_flight, advance=lambda *report: reports.append(report))
    assert reports[-1] == (3.0, 3.0, "3 flights in calm air, none of them flyable")


@pytest.mark.usefixtures("here")
def test_a_mission_that_is_not_judged_in_calm_air_is_not_searched(wind_base: CampaignBase, tmp_path: Path) -> None:
    found = searched(wind_base, tmp_path, fly=undecided_flight)
    assert found.answer == "not judged"
    assert found.undecided == tuple((number, "loiters (a guess)") for number in range(3))
    lines = wind_lines(found)
    assert lines[0] == ("not judged: 3 of 3 flights are not judged in full; first reason: loiters (a guess)")
    assert lines[-1] == "3 flights in calm air only, because none of them is flyable"
    assert not any("fail" in line for line in lines)


def test_failures_are_counted_by_direction_up_to_the_boundary(wind_base: CampaignBase) -> None:
    """From N the slope fails from 5 m/s on, and in 20 m/s control; from E control fails; from S every flight flies."""
    search = _Search(GOAL, wind_base)
    slope, loss = (FlownFlight("not flyable", ((rule, LEG),)) for rule in ("slope", "departure"))
    flies = FlownFlight("flyable", ())
    flown = [(0, speed, flies if speed < 5.0 else slope) for speed in (1.0, 2.0, 3.0, 4.0, 5.0, 5.0) for _ in range(20)]
    flown += [(0, 20.0, loss)] * 60 + [(1, 20.0, flies)] * 40 + [(1, 19.0, loss)] * 20 + [(2, 20.0, flies)] * 60
    for number, (direction, speed, outcome) in enumerate(flown):
        search.add_result(RequestedFlight(number, direction, speed, number), outcome)
    found = search.result()
    assert found.boundaries[0].high < 20.0
    assert found.failures[1] == (RuleFailures("departure", 20, ((LEG, 20),)),)
    assert found.failures[0] == (RuleFailures("slope", 40, ((LEG, 40),)),)
    assert found.failures[2] == ()


def flight_that_fails_in_calm_air(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """Every flight fails at leg 3 but that of draw 2 of seed 4."""
    row = replace(made_flight(base, index, wind), outcome="not flyable", failed=(("clearance", LEG),))
    return made_flight(base, index, wind) if index == 2 and base.seed == 4 else row


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    # 0.1^3 and 0.5^5 are at most 0.05; for 0.001, 0.5 has to fail ten times.
    ("target", "confidence", "flights"),
    [(0.9, 0.95, 3), (0.5, 0.95, 5), (0.5, 0.999, 10)],
)
def test_a_mission_that_always_fails_in_calm_air_is_answered_at_once(
    target: float, confidence: float, flights: int, wind_base: CampaignBase, tmp_path: Path
) -> None:
    goal = WindsGoal(target, confidence, 4, 20.0, 400)
    found = searched(wind_base, tmp_path, goal, fly=flight_that_fails_in_calm_air)
    assert found.calm == CalmFailures(0.0, flights, flights, (RuleFailures("clearance", flights, ((LEG, flights),)),))
    assert [boundary.estimate for boundary in found.boundaries] == [0.0] * 4
    assert table(tmp_path / WINDS_DATABASE) == []
    lines = wind_lines(found)
    assert lines[0] == f"not flyable with a probability of at least {target:g} even in calm air"
    assert lines[1] == f"in calm air, {flights} of {flights} flights fail"
    assert "clearance" in lines[2]
    assert "leg 3" in lines[2]
    assert lines[-1] == f"{flights} flights in calm air only, because none of them is flyable"
    assert not any("not settled" in line for line in lines)
    assert searched(wind_base, tmp_path, goal, fly=flight_that_fails_in_calm_air) == found


@pytest.mark.usefixtures("here")
def test_one_flight_that_flies_in_calm_air_is_worth_a_search(wind_base: CampaignBase, tmp_path: Path) -> None:
    goal = WindsGoal(0.9, 0.95, 4, 20.0, 24)
    found = searched(replace(wind_base, seed=4), tmp_path, goal, fly=flight_that_fails_in_calm_air)
    assert len(found.flights) == 24
    assert len(table(tmp_path / WINDS_DATABASE)) == 24


@pytest.mark.usefixtures("here")
def test_how_narrowly_flights_passed_makes_the_boundary_surer(
    wind_base: CampaignBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As many flights; and what is told is still there when the search goes on."""
    monkeypatch.setattr(find_winds_module, "_MAX_FLIGHTS_EACH", 6)
    goal = replace(GOAL, directions=4 if SOAK else 2, flights=scaled(120, 60))
    told = searched(wind_base, tmp_path / "told", goal, fly=flight_that_states_its_margin)
    bare = searched(wind_base, tmp_path / "bare", goal)
    for wise, bare_one in zip(told.boundaries, bare.boundaries, strict=True):
        assert wise.width < 0.8 * bare_one.width
    assert searched(wind_base, tmp_path / "told", goal, fly=flight_that_states_its_margin) == told
    if not SOAK:
        return
    # And where a part of it is there alone.
    keep_part(wind_base, tmp_path / "told", tmp_path / "part", {*range(70), 72}, goal)
    again = searched(wind_base, tmp_path / "part", goal, fly=flight_that_states_its_margin)
    assert same((told, tmp_path / "told"), (again, tmp_path / "part"))


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("seed", some((2, 0, 3, 1), 4))
def test_what_was_stopped_anywhere_comes_out_the_same(
    wind_base: CampaignBase, whole: tuple[WindsResult, Path], tmp_path: Path, seed: int
) -> None:
    count = len(whole[0].flights)
    # The last round that was begun has gaps; seed 0 has none at all, seed 1 all.
    last = {0: 0, 1: count}.get(seed, random.Random(seed).randrange(count))
    numbers = {k for k in range(count) if k < last - 5 or (k <= last + 5 and (k * 7 + seed) % 3)}
    keep_part(wind_base, whole[1], tmp_path / "part", set(range(count)) if last == count else numbers, FEWER)
    flown_now: list[int] = []

    def counted(base: CampaignBase, index: int, wind: Any) -> Any:
        flown_now.append(index)
        return made_flight(base, index, wind)

    again = searched(wind_base, tmp_path / "part", FEWER, fly=counted)
    assert same(whole, (again, tmp_path / "part"))
    # What was there was not flown again.
    assert len(flown_now) == (0 if last == count else count - len(numbers & set(range(count))))


@pytest.mark.usefixtures("here")
def test_more_flights_or_fewer_go_on_as_if_asked_at_once(wind_base: CampaignBase, tmp_path: Path) -> None:
    few, many = (WindsGoal(0.9, 0.95, 4, 20.0, flights) for flights in (31, 60))
    first, asked_many = (searched(wind_base, tmp_path / name, goal) for name, goal in (("a", few), ("many", many)))
    assert len(first.flights) == 31
    assert same((searched(wind_base, tmp_path / "a", many), tmp_path / "a"), (asked_many, tmp_path / "many"))
    # Fewer are told of, and none of the others is lost.
    assert searched(wind_base, tmp_path / "a", few) == first
    assert len(table(tmp_path / "a" / WINDS_DATABASE)) == len(asked_many.flights)


@pytest.mark.parametrize(
    ("flown", "margin"),
    [
        (FlownFlight("flyable", (), (("slope", LEG, 0.25),)), {("slope", "leg", 3): 0.25}),
        (FlownFlight("flyable", ()), {}),
        (FlownFlight("not flyable", (("threat", LEG),), (("slope", LEG, 0.25),)), {("slope", "leg", 3): 0.25}),
        # It ended before: what it would have passed is not known, narrowly or not.
        (FlownFlight("not flyable", (("threat", LEG), ("completion", Place("flight"))), (("slope", LEG, 0.25),)), None),
        (FlownFlight("lost", ()), None),
    ],
)
def test_a_flight_that_did_not_go_on_to_its_end_states_no_margin(
    wind_base: CampaignBase, flown: FlownFlight, margin: dict[Any, float] | None
) -> None:
    search = _Search(GOAL, wind_base)
    search.add_result(RequestedFlight(0, 2, 8.0, 0), flown)
    assert search.directions[2].margin == [margin]
    assert search.directions[2].speeds == [8.0]


@pytest.mark.usefixtures("here")
def test_a_search_that_is_gone_on_with_keeps_its_goal(wind_base: CampaignBase, tmp_path: Path) -> None:
    """GOAL is 0.9 with 95 % confidence, in 4 directions up to 20 m/s."""
    default, kept = WindsGoal(0.99, 0.95, 16, 20.0, 5000), replace(GOAL, most=17.0, flights=31)
    nothing = dict.fromkeys(("target", "confidence", "directions", "most", "flights"))
    for resume in (False, True):
        assert make_winds_goal(nothing, tmp_path, resume=resume) == default
    searched(wind_base, tmp_path, kept)
    assert make_winds_goal(nothing, tmp_path, resume=True) == kept
    assert make_winds_goal(nothing, tmp_path, resume=False) == default
    for name, value in (("flights", 48), ("target", 0.8), ("most", 9.0), ("directions", 8), ("confidence", 0.9)):
        assert make_winds_goal(nothing | {name: value}, tmp_path, resume=True) == replace(kept, **{name: value})


@pytest.mark.usefixtures("here")
def test_a_table_whose_flights_do_not_follow_is_refused(wind_base: CampaignBase, tmp_path: Path) -> None:
    with open_winds_store(wind_base, GOAL, tmp_path, resume=False) as store:
        store.add(RequestedFlight(3, 1, 9.9, 0), made_flight(wind_base, 0))
    with pytest.raises(StoreError, match="flight 3 belongs to a search with other settings"):
        searched(wind_base, tmp_path)
    assert len(table(tmp_path / WINDS_DATABASE)) == 1


def surer_but_in_the_west(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """A made flight; in a wind from W flights begin to fail in winds that are 6 m/s apart, elsewhere 1 m/s."""
    if wind is None or wind.from_deg != 270.0:
        return made_flight(base, index, wind)
    return made_flight(base, index, GivenWind(12.0 + (wind.speed - 12.0) / 6.0, wind.from_deg))


@pytest.mark.usefixtures("here")
def test_progress_tells_what_is_known(wind_base: CampaignBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planfly.campaigns.worker_pool.REPORT_INTERVAL_S", 0.0)
    monkeypatch.setattr(find_winds_module, "MIN_FLIGHTS_PER_DIRECTION", 36)
    monkeypatch.setattr(find_winds_module, "BOUNDARY_ACCURACY_MPS", 1.2)
    goal = replace(GOAL, flights=600)
    told: list[tuple[float, float, str]] = []
    with open_winds_store(wind_base, goal, tmp_path, resume=False) as store:
        found = find_winds(wind_base, goal, Workers(1), store, lambda *one: told.append(one), surer_but_in_the_west)
    # What it takes at least is said before the first flight.
    assert told.pop(0) == (0.0, 4 * 36.0, "0 of 144 flights at least")
    pattern = r"(\d) of 4 directions settled, (\d+) flights?, \d+ flights a minute(, \d+ s left at least)?"
    lines = [re.fullmatch(pattern, remark) for _, _, remark in told]
    assert all(lines)
    flights = len(found.flights)
    # The last line says it again, with all directions settled.
    assert [int(line[2]) for line in lines if line] == [*range(1, flights + 1), flights]
    # Four directions take 36 each; how many more shows when it shows.
    assert [bool(line[3]) for line in lines if line] == [k < 4 * 36 for k in range(1, flights + 2)]
    # Three of them are alike, and settled together.
    assert [key for key, _ in groupby(line[1] for line in lines if line)] == ["0", "3", "4"]
    assert told[0][:2] == (1.0, 144.0)
    assert all(done < whole for done, whole, _ in told)


@pytest.mark.skipif(not SOAK, reason="workers die at a small count in test_local_pool.py: in make soak")
def test_a_deadly_flight_is_named_and_counts_against(wind_base: CampaignBase, tmp_path: Path) -> None:
    """By workers: all others come out as without them, and the one counts as not flyable."""
    # Six of each direction in 10 m/s, in which none flies, and six in 5 m/s, in which all others fly.
    goal = WindsGoal(0.9, 0.95, 4, 20.0, 48)
    found = searched(wind_base, tmp_path / "two", goal, fly=deadly_in_the_east)

    def here(base: CampaignBase, index: int, wind: Any) -> Any:
        dies = index == 9 and wind.from_deg == 90.0
        return make_lost_row(base, index, "lost: its workers died") if dies else made_flight(base, index, wind)

    with flying_here():
        want = searched(wind_base, tmp_path / "one", goal, fly=here)
    assert same((found, tmp_path / "two"), (want, tmp_path / "one"))
    (lost,) = found.lost
    assert found.flights[lost][::2] == (1, False)
    # The flights of N and S are those of E but for the one.
    assert found.boundaries[1].estimate < found.boundaries[0].estimate == found.boundaries[2].estimate


@pytest.mark.skipif(not SOAK, reason="seven workers and flights in earnest: in make soak")
@pytest.mark.parametrize("fly", [made_flight, fly_one])
def test_any_workers_find_the_same_stopped_or_not(wind_base: CampaignBase, tmp_path: Path, fly: FlyOne) -> None:
    goal = WindsGoal(0.9, 0.95, 4, 20.0, 60)
    one = searched(wind_base, tmp_path / "w1", goal, 1, fly)
    for workers in (2, 4):
        again = searched(wind_base, tmp_path / f"w{workers}", goal, workers, fly)
        assert same((one, tmp_path / "w1"), (again, tmp_path / f"w{workers}"))
    keep_part(wind_base, tmp_path / "w1", tmp_path / "part", {*range(22), 24, 27}, goal)
    again = searched(wind_base, tmp_path / "part", goal, 2, fly)
    assert same((one, tmp_path / "w1"), (again, tmp_path / "part"))


@pytest.mark.skipif(not SOAK, reason="a table after a kill, and gone on with, above and in its own tests: in make soak")
def test_a_killed_client_loses_no_flight(tmp_path: Path) -> None:
    kills, count, folder = scaled(20, 1), scaled(400, 40), tmp_path / "killed"
    folder.mkdir()
    moments, written = random.Random(4), set[int]()
    for _ in range(kills):
        said = kill_while_it_flies("winds", folder, count, moments.randint(1, 12), moments.uniform(0.0, 0.2))
        assert not said & written
        written |= said
        assert written <= {row[0] for row in table(folder / WINDS_DATABASE)}
    assert not finish_client("winds", folder, count) & written
    base, goal = short_base(folder, default_dispersions().without(SEARCHED_QUANTITIES)), winds_goal(count)
    want = searched(base, tmp_path / "one", goal)
    assert same((searched(base, folder, goal), folder), (want, tmp_path / "one"))
    note("winds: kill -9 of its client", kills=kills, flights=count, lost=0)


@pytest.mark.skipif(not SOAK, reason="workers are killed at a small count in a campaign's tests: in make soak")
def test_a_killed_worker_loses_no_flight(wind_base: CampaignBase, tmp_path: Path) -> None:
    kills, goal, begun = scaled(20, 2), winds_goal(scaled(1200, 150)), threading.Event()
    (tmp_path / "killed").mkdir()
    with (
        open_winds_store(wind_base, goal, tmp_path / "killed", resume=False) as store,
        workers_killed(kills, begun) as killed,
    ):
        found = find_winds(
            wind_base, goal, Workers(2), store, lambda done, *_: begun.set() if done else None, slow_flight
        )
    assert len(killed) == kills
    want = searched(wind_base, tmp_path / "one", goal)
    assert same((found, tmp_path / "killed"), (want, tmp_path / "one"))
    note("winds: kill -9 of its workers", kills=kills, flights=goal.flights, lost=0)


def test_the_wind_that_is_asked_about_does_not_vary() -> None:
    names = {one.quantity.name for one in default_dispersions().without(SEARCHED_QUANTITIES).varying}
    assert not names & {"wind_speed", "wind_from"}
