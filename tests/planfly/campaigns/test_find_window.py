"""Windows by arithmetic with made flights: draws, members, departures beyond the forecast, and the answer."""

from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from logs.verdict.places import Place
from planfly.campaigns import find_window as find_window_module
from planfly.campaigns.answer_pages import window_page
from planfly.campaigns.campaign_base import CampaignBase, open_campaign, vary_flight
from planfly.campaigns.dispersions import Dispersions, default_dispersions, draw_flight, parse_dispersions
from planfly.campaigns.find_window import (
    Departure,
    WindowGoal,
    WindowResult,
    departure_times,
    find_window,
    last_departure,
)
from planfly.campaigns.flight_row import FlightRow
from planfly.campaigns.window_chart import draw_window
from planfly.campaigns.window_text import answer_line, unjudged_lines, window_lines
from planfly.campaigns.worker_pool import Workers
from tests.planfly.campaigns.made_campaigns import MISSION, SCENARIO
from tests.planfly.campaigns.made_searches import hire_here
from tests.world.made.forecast_files import ISSUED, wind_dataset, write_netcdf

FIRST = datetime.fromisoformat(ISSUED).replace(tzinfo=UTC)
HOUR = timedelta(hours=1)
SPREAD = """
[wind_speed]
distribution = "norm"
scale = 2.0
source = "made"
[wind_from]
distribution = "norm"
scale = 20.0
source = "made"
"""
GRADIENTS = """
[wind_gradient]
distribution = "uniform"
loc = 0.01
scale = 1e-8
source = "made"
"""
# Fastest wind in which a made flight is flyable, m/s.
LIMIT_MPS = 12.0


def at_hour(hour: float) -> datetime:
    return FIRST + hour * HOUR


def hourly_winds(*speeds: float) -> xarray.Dataset:
    """Return a westerly wind of one speed at each hour, everywhere."""
    return wind_dataset(np.array(speeds)[:, np.newaxis, np.newaxis, np.newaxis], 0.0, hours=range(len(speeds)))


def without_wind(text: str) -> str:
    return text[: text.index("[wind]")]


def open_in(folder: Path, dataset: xarray.Dataset, dispersions: Dispersions | None = None) -> CampaignBase:
    """Open the short mission at the first time of a forecast."""
    file = write_netcdf(folder / "winds.nc", dataset)
    (folder / "short.toml").write_text(without_wind(SCENARIO), encoding="utf-8")
    (folder / "short.waypoints").write_text(MISSION, encoding="ascii")
    options: Any = {"scenario": folder / "short.toml", "forecast": file, "at": FIRST.isoformat(), "seed": 1}
    return open_campaign(str(folder / "short.waypoints"), dispersions or default_dispersions(), options)


def made_row(base: CampaignBase, index: int, wind: object = None) -> FlightRow:
    """Make the row of a flight that is flyable in a mean wind of up to 12 m/s; two of ten are never."""
    draw = draw_flight(base.dispersions, base.seed, index)
    good = base.scenario.wind.speed <= LIMIT_MPS and index % 10 < 8
    failed = () if good else (("completion", Place("flight")),)
    return FlightRow(draw, "flyable" if good else "not flyable", "completed", failed, energy_left=90.0 - index)


@pytest.fixture
def made_flights() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(find_window_module, "worker_pool", hire_here)
        patch.setattr(find_window_module, "fly_one", made_row)
        yield


def found(base: CampaignBase, last: float, asked: float | None = None, flights: int = 10, **goal: float) -> Any:
    """Find the window with departures each hour up to the last."""
    question = None if asked is None else at_hour(asked)
    departures = departure_times(FIRST, at_hour(last), HOUR, question)
    goal = {"probability": 0.8} | goal
    return find_window(
        base, WindowGoal(departures, question, goal["probability"], flights), Workers(1), lambda *_: None
    )


@pytest.mark.usefixtures("made_flights")
def test_windows_are_the_runs_of_open_departures(tmp_path: Path) -> None:
    """Calm, too strong at 3 to 5 o'clock, and calm: the wind at 2:30 would be 16 m/s."""
    base = open_in(tmp_path, hourly_winds(4.0, 4.0, 4.0, 28.0, 28.0, 28.0, 4.0, 4.0, 4.0))
    result = found(base, 7.0)
    assert [departure.flyable for departure in result.departures] == [8, 8, 8, 0, 0, 0, 8, 8]
    assert result.windows == ((at_hour(0), at_hour(2)), (at_hour(6), at_hour(7)))
    assert [result.is_open(departure) for departure in result.departures] == [True] * 3 + [False] * 3 + [True] * 2
    assert [departure.wind for departure in result.departures[2:4]] == [(4.0, 270.0), (28.0, 270.0)]
    assert [departure.rules for departure in result.departures] == [("completion",)] * 8
    # The tenth flight has 81 Wh left.
    assert {departure.energy_left for departure in result.departures} == {81.0}
    assert result.is_go is True
    assert answer_line(result) == "take-off windows (UTC): 2026-05-01 06:00 to 08:00, 2026-05-01 12:00 to 13:00"
    lines = window_lines(result)
    assert " ".join(lines[1].split()) == "2026-05-01 06:00 8/10 44% to 97% 4.0 m/s from 270 81 Wh left completion"
    assert len(lines) == 9
    assert draw_window(result).axes


@pytest.mark.usefixtures("made_flights")
def test_a_departure_that_is_asked_about(tmp_path: Path) -> None:
    base = open_in(tmp_path, hourly_winds(4.0, 4.0, 28.0, 28.0, 4.0))
    go = found(base, 3.0, 0.5)
    assert (go.is_go, [departure.time for departure in go.departures][1]) == (True, at_hour(0.5))
    assert answer_line(go).startswith(
        "take-off at 2026-05-01 06:30 UTC: go, 8 of 10 flights are flyable; take-off windows (UTC): 2026-"
    )
    no_go = found(base, 3.0, 2.0)
    assert no_go.is_go is False
    assert (
        "no go, 0 of 10 flights are flyable, less than the required 80 %; take-off windows (UTC): 2026-05-01"
        " 06:00 to 07:00" in answer_line(no_go)
    )
    # After the end of the forecast, and before its beginning.
    for hour, words in ((9.0, "15:00"), (-2.0, "04:00")):
        unknown = found(base, 3.0, hour)
        assert unknown.is_go is None
        assert f"take-off at 2026-05-01 {words} UTC: not judged: " in answer_line(unknown)
        assert "the forecast covers 2026-05-01 06:00 to 2026-05-01 10:00 UTC" in answer_line(unknown)


@pytest.mark.usefixtures("made_flights")
def test_a_share_that_reaches_the_probability_is_open(tmp_path: Path) -> None:
    base = open_in(tmp_path, hourly_winds(4.0, 4.0))
    assert found(base, 0.0, probability=0.8).is_go is True
    closed = found(base, 0.0, probability=0.81)
    assert closed.is_go is False
    assert (
        answer_line(closed)
        == "no take-off time is flyable; the best is 2026-05-01 06:00 UTC with 8 of 10 flights flyable"
    )


@pytest.mark.usefixtures("made_flights")
def test_a_departure_beyond_the_forecast_is_not_judged(tmp_path: Path) -> None:
    """The flight of a minute from the last time of the forecast is beyond it, too."""
    base = open_in(tmp_path, hourly_winds(4.0, 28.0, 28.0))
    result = found(base, 4.0)
    assert [bool(departure.rows) for departure in result.departures] == [True, True, False, False, False]
    assert "the forecast ends at 2026-05-01 08:00 UTC" in result.departures[2].not_judged
    assert result.windows == ((FIRST, FIRST),)
    assert window_lines(result)[-1].startswith("2026-05-01 10:00  not judged: ")
    assert draw_window(result).axes
    # Nothing is known of the departures that could be open.
    assert found(open_in(tmp_path, hourly_winds(28.0, 28.0)), 4.0).is_go is None


def changed(result: WindowResult, **changes: object) -> WindowResult:
    """Change all rows of the first departure of a result."""
    first, *others = result.departures
    rows = tuple(replace(row, **changes) for row in first.rows)  # type: ignore[arg-type]
    return replace(result, departures=(Departure(first.time, first.scenarios, rows), *others))


@pytest.mark.usefixtures("made_flights")
def test_all_rules_that_fail_most_flights_are_named(tmp_path: Path) -> None:
    result = found(open_in(tmp_path, hourly_winds(28.0, 4.0)), 0.0)
    failed = (("speed", Place("leg", 0)), ("completion", Place("flight")))
    tied = changed(result, failed=failed)
    assert set(tied.departures[0].rules) == {"speed", "completion"}
    assert window_lines(tied)[1].endswith("  completion, airspeed")
    texts = [text.get_text().strip() for text in draw_window(tied).axes[0].texts]
    assert texts == ["completion, airspeed"]


@pytest.mark.usefixtures("made_flights")
@pytest.mark.parametrize(("outcome", "words"), [("flyable", "10 of 10"), ("not flyable", "0 of 10")])
def test_what_is_not_judged_is_named_and_decides_nothing(outcome: str, words: str, tmp_path: Path) -> None:
    """All flights are flyable, or fail, but for a take-off that is not judged."""
    unjudged = (("takeoff", "take-off (PX4's take-off is not simulated)"),)
    result = found(open_in(tmp_path, hourly_winds(4.0, 4.0)), 0.0, 0.0)
    result = changed(result, outcome=outcome, undecided=True, unjudged=unjudged)
    assert result.is_go is None
    assert f"UTC: not judged in full: {words} flights are flyable, 10 are not judged in full; " in answer_line(result)
    assert unjudged_lines(result) == ["Not judged: take-off (PX4's take-off is not simulated)"]
    # Two of ten flights that are not judged do not decide a probability of 0.8.
    first, *_ = found(open_in(tmp_path, hourly_winds(4.0, 4.0)), 0.0).departures
    rows = tuple(replace(row, undecided=row.outcome != "flyable") for row in first.rows)
    assert Departure(first.time, first.scenarios, rows).is_judged_in_full(0.8)
    assert not Departure(first.time, first.scenarios, rows).is_judged_in_full(0.81)


@pytest.mark.usefixtures("made_flights")
def test_the_page_lists_all_departures_in_both_times(tmp_path: Path) -> None:
    result = found(open_in(tmp_path, hourly_winds(4.0, 28.0, 28.0)), 3.0)
    result = replace(result, goal=replace(result.goal, zone=timezone(timedelta(hours=2))))
    figure = draw_window(result)
    # The third and fourth departures are hatched in each panel.
    assert [sum(patch.get_hatch() is not None for patch in axes.patches) for axes in figure.axes] == [2, 2, 2]
    page = window_page(result, figure, "planfly window x").render().decode()
    assert '<div class="answer reached">' in page
    assert "<strong>take-off windows (UTC): 2026-05-01 06:00 only</strong>" in page
    assert '<th scope="col" class="u">take-off, UTC</th><th scope="col" class="u">take-off, UTC+02:00</th>' in page
    assert page.count('<td class="u">2026-05-01 06:00</td><td class="u">2026-05-01 08:00</td>') == 1
    assert page.count('<td colspan="5">not judged: ') == 2
    assert page.count("<svg ") == 2
    assert "Repeat: <code>planfly window x</code>" in page
    assert "Repeat" not in window_page(result, draw_window(result), "").render().decode()


@pytest.mark.usefixtures("made_flights")
def test_a_hurricane_is_not_judged(tmp_path: Path) -> None:
    base = open_in(tmp_path, hourly_winds(4.0, 45.0, 4.0))
    storm = found(base, 1.0).departures[1]
    assert storm.rows == ()
    assert "wind at the start: 45.0 m/s at 2026-05-01 07:00 UTC: allowed 0..40 m/s" in storm.not_judged


def test_the_default_end_is_the_last_time_that_the_forecast_covers(tmp_path: Path) -> None:
    # Two legs of 700 m at 25 m/s.
    base = open_in(tmp_path, hourly_winds(4.0, 4.0, 4.0))
    assert (at_hour(2) - last_departure(base, FIRST)).total_seconds() == pytest.approx(56.0, abs=1.0)
    base = open_in(tmp_path, wind_dataset(4.0, 0.0, hours=np.arange(0.0, 49.0, 6.0)))
    assert last_departure(base, at_hour(3)) == at_hour(27)
    assert last_departure(base, at_hour(100)) == at_hour(100)


def test_draws_of_flight_k_are_equal_at_each_departure(tmp_path: Path) -> None:
    base = open_in(tmp_path, hourly_winds(4.0, 9.0, 4.0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(find_window_module, "worker_pool", hire_here)
        patch.setattr(find_window_module, "fly_one", made_row)
        result = found(base, 1.0)
    draws = [[row.draw for row in departure.rows] for departure in result.departures]
    assert draws[0] == draws[1]
    assert len({draw.seed for draw in draws[0]}) == 10


def test_flight_k_flies_in_member_k_modulo_their_number(tmp_path: Path) -> None:
    members = [wind_dataset(4.0 + k, 0.0).expand_dims(number=[k]) for k in range(3)]
    base = open_in(tmp_path, xarray.concat(members, "number"))
    flown: list[tuple[int, float]] = []

    def fly(member_base: CampaignBase, index: int, wind: object = None) -> FlightRow:
        flown.append((index, member_base.scenario.wind.speed))
        return made_row(member_base, index)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(find_window_module, "worker_pool", hire_here)
        patch.setattr(find_window_module, "fly_one", fly)
        result = found(base, 0.0)
    assert sorted(flown) == [(k, 4.0 + k % 3) for k in range(10)]
    # The mean of the members.
    assert result.departures[0].wind == pytest.approx((5.0, 270.0))


def test_one_worker_and_two_fly_the_same_rows(tmp_path: Path) -> None:
    base = open_in(tmp_path, hourly_winds(4.0, 9.0, 4.0))
    departures = departure_times(FIRST, at_hour(1), HOUR)
    goal = WindowGoal(departures, None, 0.9, 10)
    rows = []
    for count in (1, 2):
        result = find_window(base, goal, Workers(count), lambda *_: None)
        rows.append([replace(row, seconds=0.0, worker="") for departure in result.departures for row in departure.rows])
    assert rows[0] == rows[1]
    assert {row.outcome for row in rows[0]} == {"flyable"}


# ----------------------------------------------------------------------
# Drawn winds in a forecast.


@pytest.mark.parametrize("gradient", [0.0, 0.01])
def test_a_drawn_difference_moves_the_wind_by_the_same_vector_everywhere(gradient: float, tmp_path: Path) -> None:
    """Also in a wind that turns and grows with height, whose mean profile has a gradient."""
    u = (6.0 + np.array([0.0, 100.0, 300.0, 800.0]) * gradient)[:, np.newaxis, np.newaxis] + np.linspace(0.0, 2.0, 7)
    spread = parse_dispersions(SPREAD, "spread.toml")
    base = open_in(tmp_path, wind_dataset(u, 1.0 + 0.3 * u, hours=(0.0, 2.0)), spread)
    assert (base.scenario.wind.gradient > 0.002) == (gradient > 0.0)
    random = np.random.default_rng(2)
    positions = np.column_stack(
        [random.uniform(-400.0, 2400.0, 200), random.uniform(-700.0, 700.0, 200), random.uniform(110.0, 900.0, 200)]
    )
    seconds = random.uniform(0.0, 600.0, 200)
    old = base.scenario.wind_velocities(positions, seconds)
    shifts = []
    for index in range(5):
        varied = vary_flight(base, draw_flight(base.dispersions, base.seed, index)).setup.scenario
        changes = varied.wind_velocities(positions, seconds) - old
        np.testing.assert_allclose(changes, np.broadcast_to(changes[0], changes.shape), rtol=0.0, atol=1e-6)
        before, after = (one.wind.velocity_at(one.wind.reference_amsl) for one in (base.scenario, varied))
        assert changes[0] == pytest.approx(np.subtract(after, before), abs=1e-6)
        shifts.append(changes[0])
    assert np.ptp(shifts, axis=0).min() > 0.1


def test_a_drawn_gradient_is_added_to_the_forecasts(tmp_path: Path) -> None:
    u = np.array([6.0, 7.0, 9.0, 14.0])[:, np.newaxis, np.newaxis]
    spread = parse_dispersions(GRADIENTS, "spread.toml")
    base = open_in(tmp_path, wind_dataset(u, 0.0, hours=(0.0, 2.0)), spread)
    varied = vary_flight(base, draw_flight(base.dispersions, base.seed, 0)).setup.scenario
    positions = np.array([[0.0, 0.0, amsl] for amsl in (180.0, 280.0, 580.0)])
    change = (varied.wind_velocities(positions, np.zeros(3)) - base.scenario.wind_velocities(positions, np.zeros(3)))[
        :, 0
    ]
    # 0.01 m/s for each metre above the start at 180 m.
    assert change == pytest.approx([0.0, 1.0, 4.0], abs=1e-4)
