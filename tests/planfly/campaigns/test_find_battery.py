"""Batteries: arithmetic of capacities, quantile and interval, comparison with the aircraft's battery, flights."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planfly
from flight.mission_files.formats import mission_text
from planfly.campaigns.answer_pages import battery_page
from planfly.campaigns.battery_chart import draw_battery
from planfly.campaigns.battery_text import answer_line, battery_lines
from planfly.campaigns.campaign_base import CampaignBase, open_campaign
from planfly.campaigns.dispersions import default_dispersions, draw_flight
from planfly.campaigns.find_battery import (
    BatteryGoal,
    BatteryResult,
    CapacityRange,
    EnergyRow,
    find_battery,
    fly_for_energy,
    quantile_of_capacities,
)
from planfly.campaigns.worker_pool import Workers
from planfly.cli import main
from tests.logs.verdict.returns import hill
from tests.mission_lines import mission, wp
from world.errors import PlanflyError

_DRAW = draw_flight(default_dispersions(), 1, 0)


def energy_row(mission_energy: float = math.nan, **others: float) -> EnergyRow:
    """Make the row of a flight that needs an energy for its mission, Wh."""
    ended = "ground contact" if math.isnan(mission_energy) else "completed"
    return replace(
        EnergyRow(draw=_DRAW, outcome="flyable", ended=ended, mission_energy=mission_energy),
        **others,  # type: ignore[arg-type]
    )


@pytest.fixture(scope="module")
def base() -> CampaignBase:
    return open_campaign("tight", default_dispersions(), {"seed": 1})


def battery_result(base: CampaignBase, rows: list[EnergyRow], own: float, **goal: float) -> BatteryResult:
    """Make the result for rows that were flown at the stated mass."""
    question = BatteryGoal(**goal)  # type: ignore[arg-type]
    capacity, interval = quantile_of_capacities(tuple(rows), question)
    kept = sum(row.required_capacity(question.reserve) <= own for row in rows)
    return BatteryResult(question, base, capacity, interval, own, False, kept, tuple(rows), 1.0, 11.0, 44.4)


def test_a_flight_needs_the_larger_energy_over_the_usable_part_of_its_battery() -> None:
    row = energy_row(80.0, return_energy=88.0, battery_factor=0.8)
    assert row.required_capacity(0.2) == pytest.approx(88.0 / (0.8 * 0.8))
    assert row.is_decided_by_return
    alone = energy_row(80.0)
    assert alone.required_capacity(0.5) == pytest.approx(160.0)
    assert not alone.is_decided_by_return


def test_the_capacity_is_the_median_unbiased_quantile() -> None:
    rows = tuple(energy_row(0.8 * k) for k in range(100, 0, -1))
    capacity, interval = quantile_of_capacities(rows, BatteryGoal())
    # Position n p + (p + 1) / 3 of the sorted capacities 1 to 100 Wh (Hyndman and Fan 1996, definition 8).
    assert capacity == pytest.approx(95.0 + 1.95 / 3.0)
    assert interval.low < 95.0 < interval.high <= 100.0


def test_the_interval_covers_the_true_quantile() -> None:
    random = np.random.default_rng(3)
    true_quantile = (100.0 + 1.6448536 * 8.0) / 0.8
    covered = 0
    for _ in range(300):
        rows = tuple(energy_row(float(energy)) for energy in random.normal(100.0, 8.0, 100))
        low, high = quantile_of_capacities(rows, BatteryGoal())[1]
        covered += low <= true_quantile <= high
    # At a true coverage of 0.95, fewer than 273 of 300 have a probability of 0.1 %.
    assert covered >= 273


@pytest.mark.parametrize(("flights", "has_upper_end"), [(71, False), (72, True)])
def test_too_few_flights_have_no_upper_end(flights: int, has_upper_end: bool) -> None:
    """0.95^71 is above 0.025, half of what is left at a confidence of 0.95; 0.95^72 is below."""
    rows = tuple(energy_row(80.0 + k) for k in range(flights))
    assert math.isfinite(quantile_of_capacities(rows, BatteryGoal())[1].high) == has_upper_end


def test_an_interval_without_an_upper_end_says_so(base: CampaignBase) -> None:
    """24 flights are fewer than the 72 of the least interval with an upper end."""
    line = answer_line(battery_result(base, [energy_row(80.0)] * 24, own=200.0))
    assert " at 95% confidence, 24 flights are too few for an upper bound" in line


@pytest.mark.parametrize(("crashes", "is_known"), [(5, True), (6, False)])
def test_flights_that_do_not_complete_leave_it_unknown(base: CampaignBase, crashes: int, is_known: bool) -> None:
    rows = [energy_row(80.0) for _ in range(100 - crashes)] + [energy_row() for _ in range(crashes)]
    result = battery_result(base, rows, own=200.0)
    assert math.isfinite(result.capacity) == is_known
    assert (
        "6 of 100 flights do not complete the mission; most frequent reason: ground contact" in answer_line(result)
    ) != is_known
    if not is_known:
        assert result.is_enough is None


@pytest.mark.parametrize(
    ("flights", "kept", "is_enough"),
    [
        # 0.95^58 is above and 0.95^59 is below 0.05.
        (58, 58, None),
        (59, 59, True),
        (100, 100, True),
        (100, 95, None),
        (100, 85, False),
    ],
)
def test_the_own_battery_is_judged_by_the_binomial_bounds(
    base: CampaignBase, flights: int, kept: int, is_enough: bool | None
) -> None:
    rows = [energy_row(80.0 if k < kept else 120.0) for k in range(flights)]
    result = battery_result(base, rows, own=110.0)
    assert result.is_enough is is_enough
    assert any(f"in {kept} of {flights} flights" in line for line in battery_lines(result))


def test_a_guessed_battery_is_not_compared(base: CampaignBase) -> None:
    result = replace(battery_result(base, [energy_row(80.0)] * 100, own=888.0), is_guessed=True)
    assert result.is_enough is None
    assert any("the aircraft's battery is unknown" in line for line in battery_lines(result))


def test_no_battery_carries_itself(base: CampaignBase) -> None:
    none = CapacityRange(math.inf, math.inf)
    result = replace(
        battery_result(base, [energy_row(80.0)] * 100, own=888.0, specific_energy=30.0),
        capacity=math.inf,
        interval=none,
    )
    assert answer_line(result).startswith("no battery keeps a reserve of 20%")


@pytest.mark.parametrize(("lost", "is_known"), [(4, True), (5, False)])
def test_no_battery_covers_a_return_that_does_not_arrive(base: CampaignBase, lost: int, is_known: bool) -> None:
    """The quantile of 100 flights is between the 95th and the 96th capacity."""
    rows = [energy_row(80.0, return_energy=96.0) for _ in range(100 - lost)]
    rows += [energy_row(80.0, return_energy=math.inf) for _ in range(lost)]
    result = battery_result(base, rows, own=200.0)
    assert result.kept == 100 - lost
    assert math.isfinite(result.capacity) == is_known
    nothing = (
        "no battery keeps a reserve of 20% in the mission and in every return with probability 0.95, because a return "
    )
    assert (answer_line(result) == f"{nothing}does not arrive in 5 of 100 flights") != is_known
    battery_page(result, draw_battery(result), "").render()


def test_a_return_of_unknown_energy_leaves_it_unknown(base: CampaignBase) -> None:
    rows = [energy_row(80.0, return_energy=96.0)] * 94 + [energy_row(80.0, unknown_returns=1)] * 6
    result = battery_result(base, rows, own=888.0)
    assert math.isnan(result.capacity)
    assert result.is_enough is None
    assert answer_line(result).startswith("not judged: in 6 of 100 flights a return leaves the known terrain")
    assert "the aircraft's battery of 888 Wh is not judged, because the needed one is unknown" in battery_lines(result)


def test_a_return_that_hits_something_is_no_matter_of_the_battery(base: CampaignBase) -> None:
    result = battery_result(base, [energy_row(80.0, return_energy=96.0, blocked_returns=2)] * 100, own=888.0)
    assert result.capacity == pytest.approx(96.0 / 0.8)
    assert "in every return that arrives with probability 0.95" in answer_line(result)


def test_a_return_against_more_wind_than_the_airspeed_is_covered_by_no_battery(tmp_path: Path) -> None:
    """With 30 m/s from home, 5 m/s more than its airspeed, no return comes back."""
    file = tmp_path / "away.waypoints"
    file.write_text(mission_text(mission(wp(0, 0), wp(0, 1500)), "waypoints"), encoding="ascii")
    base = open_campaign(str(file), default_dispersions(), {"seed": 1, "wind": (30.0, 180.0)})
    row = fly_for_energy(base, 0, interval=5.0, mass_factor=1.0)
    assert row.ended == "completed"
    assert math.isinf(row.return_energy)
    assert not row.blocked_returns


def test_an_aircraft_that_burns_fuel_is_refused(base: CampaignBase) -> None:
    fuelled = replace(base.uav, aircraft=replace(base.uav.aircraft, battery_voltage=0.0))
    with pytest.raises(PlanflyError, match="tight: aerosonde burns fuel: expected an electric aircraft"):
        find_battery(replace(base, uav=fuelled), BatteryGoal(flights=2), Workers(1), lambda *_: None)


def test_a_flight_uses_what_its_track_says(base: CampaignBase) -> None:
    row = fly_for_energy(base, 0, interval=5.0, mass_factor=1.0)
    assert sum(row.leg_energies) == pytest.approx(row.mission_energy, rel=1e-3)
    assert row.battery_factor == draw_flight(base.dispersions, base.seed, 0).values["battery"]
    heavier = fly_for_energy(base, 0, interval=5.0, mass_factor=1.3)
    assert heavier.mission_energy > 1.02 * row.mission_energy


def px4_base(folder: Path, stated: str) -> CampaignBase:
    """Open a mission behind the hill for PX4, which returns over it."""
    (folder / "hill.toml").write_text(hill.SCENARIO, encoding="utf-8")
    (folder / "behind.waypoints").write_text(hill.mission_text(5000.0, 6500.0, amsl=200.0), encoding="utf-8")
    (folder / "mine.params").write_text(f"# Stack: PX4 Pro\n{stated}\n", encoding="utf-8")
    options = {"seed": 1, "scenario": str(folder / "hill.toml"), "params": str(folder / "mine.params")}
    return open_campaign(str(folder / "behind.waypoints"), default_dispersions(), options)  # type: ignore[arg-type]


def test_a_higher_return_of_px4_needs_a_larger_battery(tmp_path: Path) -> None:
    rows = {}
    for height in (450, 650):
        base = px4_base(tmp_path, f"RTL_RETURN_ALT {height}")
        rows[height] = fly_for_energy(base, 0, interval=20.0, mass_factor=1.0)
        assert rows[height].is_decided_by_return
    # 11 kg are lifted by 200 m.
    assert rows[650].return_energy - rows[450].return_energy > 11.0 * 9.81 * 200.0 / 3600.0
    lines = battery_lines(battery_result(base, [energy_row(80.0)] * 20, own=888.0))
    assert "returns to launch are simulated with a point-mass model under PX4's control laws" in lines
    assert any("RTL_RETURN_ALT (650 m above the destination)" in line for line in lines)
    assert not any("ArduPlane" in line for line in lines)


def test_a_battery_without_simulated_returns_is_not_compared(tmp_path: Path) -> None:
    base = px4_base(tmp_path, "RTL_TYPE 2")
    result = replace(battery_result(base, [energy_row(80.0)] * 100, own=888.0), has_returns=False)
    assert result.is_enough is None
    assert "in the mission (without returns)" in answer_line(result)
    assert "the returns are not judged at all: RTL_TYPE 2 returns along the mission, which is not simulated" in (
        battery_lines(result)
    )
    found = find_battery(base, BatteryGoal(flights=2, interval=60.0), Workers(1), lambda *_: None)
    assert not found.has_returns


def test_the_legs_around_a_loiter_are_one_in_the_energies_and_in_the_lines(tmp_path: Path) -> None:
    """A loiter of two laps between two legs has many corners: people count a leg to it and one from it."""
    file = tmp_path / "loiter.waypoints"
    lines = (wp(0, 500), wp(0, 2500, command=18, p="2 0 200 0"), wp(2500, 2500))
    file.write_text(mission_text(mission(*lines), "waypoints"), encoding="ascii")
    base = open_campaign(str(file), default_dispersions(), {"seed": 1})
    assert base.nominal_setup().route.legs > 4
    row = fly_for_energy(base, 0, interval=10.0, mass_factor=1.0)
    assert row.ended == "completed"
    assert len(row.leg_energies) == 2
    assert sum(row.leg_energies) == pytest.approx(row.mission_energy, rel=1e-3)
    assert row.return_leg in (0, 1)
    # Two returns from different corners of the loiter decide at one place, which has one line.
    rows = [replace(row, return_energy=2.0 * row.mission_energy, return_leg=0, return_time=30.0 + k) for k in range(2)]
    lines_on_it = [line for line in battery_lines(battery_result(base, rows, own=888.0)) if "the return that" in line]
    assert lines_on_it == [
        "in 2 of 2 flights the return that starts at 30 s (leg 0 (to item 2)) decides the capacity",
    ]


def test_a_found_battery_keeps_the_reserve_in_other_flights(base: CampaignBase) -> None:
    """A twentieth of fresh flights may need more; so many of 40 that the found probability is refuted do not."""
    found = planfly.battery("tight", seed=1, flights=60, workers=2, every=5.0)
    assert found.is_enough
    fresh = [fly_for_energy(replace(base, seed=77), index, interval=5.0, mass_factor=1.0) for index in range(40)]
    kept = sum(row.required_capacity(0.2) <= found.capacity for row in fresh)
    # At a probability of 0.95, fewer than 33 of 40 have a probability of 0.1 %.
    assert kept >= 33
    assert repr(found).startswith("<BatteryResult tight: ")


def test_the_chart_has_the_capacities_of_the_flights_and_the_page_what_decides(base: CampaignBase) -> None:
    rows = [energy_row(0.8 * k, leg_energies=(0.2 * k, 0.6 * k)) for k in range(1, 101)]  # type: ignore[arg-type]
    rows[:3] = [replace(row, return_energy=90.0, return_time=12.0, return_leg=1) for row in rows[:3]]
    result = battery_result(base, rows, own=120.0)
    figure = draw_battery(result)
    step, *lines = figure.axes[0].lines
    capacities, shares = step.get_data()
    assert list(zip(capacities, shares, strict=True))[3][1] == pytest.approx(0.03)
    assert float(np.max(np.asarray(capacities)[:-1])) == pytest.approx(90.0 / 0.8)
    probability, found, own = (line.get_label() for line in lines)
    assert probability == "P = 0.95"
    assert found == f"found: {result.capacity:.0f} Wh"
    assert own == "the aircraft's: 120 Wh"
    page = battery_page(result, figure, "planfly battery tight").render().decode()
    assert '<td class="">the end of the mission</td><td class="n">97</td><td class="n">97%</td>' in page
    assert '>3</td><td class="n">3%</td>' in page
    # The median of 1 to 100 is 50.5: 10.1 Wh of 40.4.
    assert '<td class="n">10.1 Wh</td><td class="n">25%</td>' in page
    assert page.count("<svg ") == 2


def test_a_battery_of_which_nothing_is_known_has_a_chart(base: CampaignBase) -> None:
    result = battery_result(base, [energy_row() for _ in range(20)], own=120.0)
    assert [text.get_text() for text in draw_battery(result).axes[0].texts][-1].startswith("no flight completed")
    assert '<div class="answer undecided">' in battery_page(result, draw_battery(result), "").render().decode()


def test_the_files_of_a_battery(tmp_path: Path) -> None:
    result = planfly.battery("tight", flights=20, every=60.0, seed=1, workers=1, out=tmp_path / "out")
    assert [file.name for file in result.files] == ["battery.png", "report.html"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    command = "planfly battery tight --probability 0.95 --reserve 0.2 --every 60 --flights 20 --seed 1"
    assert f"<code>{command}</code>" in page
    with pytest.raises(planfly.PlanflyError, match="exists and is not empty"):
        planfly.battery("tight", flights=20, out=tmp_path / "out", overwrite=False)


@pytest.mark.parametrize(("command", "least"), [("battery", 20), ("ground-risk", 20), ("window", 10)])
def test_the_help_states_the_numbers_of_flights(command: str, least: int, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([command, "--help"])
    assert f"{least} to 10" in " ".join(capsys.readouterr().out.split())
