"""Do the long tasks of the studio in its second worker process.

The tasks are returns to launch, a campaign, the battery, the take-off window and the ground risk of a mission.
"""

from collections import Counter
from collections.abc import Iterable
from datetime import timedelta
from typing import Any

from flight.mission.items import Mission
from logs.verdict.returns.judge_returns import judge_returns, make_return_world
from logs.verdict.returns.return_starts import return_starts
from logs.verdict.returns.returns_text import point_of_no_return_text, return_range_text, returns_headline
from logs.verdict.rule_words import rule_word
from planfly.campaigns.campaign_base import CampaignBase, campaign_of_setup
from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.flight_row import fly_one
from planfly.campaigns.worker_pool import Workers
from planfly.studio.edit_context import EditContext
from planfly.studio.worker_process import Advance
from planfly.workflow.pipeline import FlightTask, fly_and_judge
from world.errors import MissionError
from world.extras import require_extra

# Maximum number of returns that are judged along the route.
_MAX_RETURNS = 240
# Maximum number of ranges of the route that are named.
_MAX_LISTED_RANGES = 6
# Number of flights in a campaign.
FLIGHT_COUNT = 24
# Number of flights for the ground risk, each with its returns and falls.
_RISK_FLIGHTS = 12
# Number of flights for each take-off time in a forecast.
_WINDOW_FLIGHTS = 10
# Time between two take-off times.
_WINDOW_STEP = timedelta(hours=1)
# Time from the first to the last take-off time.
_WINDOW_SPAN = timedelta(hours=12)
# One worker process, because another core flies for the page.
_WORKERS = Workers(count=1)


def run_returns_task(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Fly a mission, and judge simulated returns to launch from points along the flight.

    Return state, headline and result lines as page data.

    payload: editing context, and mission.
    Raises MissionError without a home or terrain.
    """
    context, mission = payload
    setup = context.setup(mission)
    if mission.home is None or context.scenario.terrain is None:
        missing_input = "home" if mission.home is None else "terrain"
        reason = f"returns cannot be judged without {missing_input}"
        raise MissionError(f"{mission.source}: {reason}", field=missing_input)
    world = make_return_world(setup)
    task = FlightTask(advance=lambda done, total, remark: advance(0.5 * done, total, remark), reference="never")
    flight = fly_and_judge(setup, task)
    interval = max(1.0, (float(flight.track.time[-1]) if len(flight.track) else 0.0) / _MAX_RETURNS)
    starts = return_starts(setup, flight.track, interval)
    remark = f"flying {len(starts)} returns"
    judged_returns = judge_returns(
        world, starts, interval, advance=lambda done, total: advance(0.5 + 0.5 * done / max(1.0, total), 1.0, remark)
    )
    lines = [
        return_range_text(return_range, judged_returns, context.scenario)
        for return_range in judged_returns.ranges[:_MAX_LISTED_RANGES]
    ]
    return {
        "state": "ok" if judged_returns.safe else "open" if judged_returns.undecided else "fail",
        "headline": returns_headline(judged_returns),
        "lines": [*lines, *filter(None, [point_of_no_return_text(judged_returns)])],
    }


def run_campaign_task(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Fly a mission `FLIGHT_COUNT` times with varied conditions, and return the results as page data.

    Wind, aircraft, terrain error and start position vary.

    payload: editing context, and mission.
    advance: function that reports the progress: flights done, flights in all, and a remark.
    """
    require_extra("campaigns")
    from planfly.campaigns.statistics.decision import Estimator, Goal, Tally

    base = _campaign_base(*payload)
    flyable, undecided, failure_counts = 0, 0, Counter[str]()
    for index in range(FLIGHT_COUNT):
        advance(index, FLIGHT_COUNT, f"{flyable} of {index} flyable")
        row = fly_one(base, index)
        flyable += row.outcome == "flyable"
        undecided += row.outcome == "undecided"
        failure_counts.update({rule for rule, _ in row.failures})
    tally = Tally(flyable, FLIGHT_COUNT - flyable - undecided, undecided=undecided)
    lower, upper = Estimator(Goal(target=None, stops=False, flights=FLIGHT_COUNT)).estimate(tally).interval
    headline = f"{flyable} of {FLIGHT_COUNT} flights are flyable"
    headline += f", {undecided} not judged in full" if undecided else ""
    failure_texts = [f"{rule_word(rule)} fails in {count}" for rule, count in failure_counts.most_common(5)]
    return {
        "state": "ok" if flyable == FLIGHT_COUNT else "open" if flyable or undecided else "fail",
        "headline": f"{headline} (probability {lower:.0%} to {upper:.0%} at 95 % confidence)",
        "lines": [
            *failure_texts,
            f"{FLIGHT_COUNT} flights show little about rare failures; planfly campaign flies more",
        ],
    }


def _campaign_base(context: EditContext, mission: Mission) -> CampaignBase:
    """Return the base of a campaign that flies a mission with planfly's default dispersions."""
    return campaign_of_setup(context.setup(mission), default_dispersions())


def run_battery_task(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Find the smallest battery for a mission and its returns to launch.

    The answer is page data.

    payload: editing context, and mission.
    """
    require_extra("campaigns")
    from planfly.campaigns.battery_text import answer_line, battery_lines
    from planfly.campaigns.find_battery import BatteryGoal, find_battery

    result = find_battery(_campaign_base(*payload), BatteryGoal(flights=FLIGHT_COUNT), _WORKERS, advance)
    return _answer(result.is_enough, answer_line(result), battery_lines(result))


def run_ground_risk_task(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Find the volumes and the ground risk class of a mission by SORA 2.5.

    The answer is page data.

    payload: editing context, and mission.
    """
    require_extra("campaigns")
    from planfly.campaigns.find_ground_risk import GroundRiskGoal, find_ground_risk
    from planfly.campaigns.ground_risk_text import answer_line, risk_lines

    result = find_ground_risk(_campaign_base(*payload), GroundRiskGoal(flights=_RISK_FLIGHTS), _WORKERS, advance)
    return _answer(True if result.is_judged else None, answer_line(result), risk_lines(result))


def run_window_task(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Find the take-off times at which a mission is flyable in its forecast.

    The answer is page data.

    payload: editing context, and mission.

    Raises MissionError without a forecast.
    """
    require_extra("campaigns")
    from planfly.campaigns.find_window import DEFAULT_PROBABILITY, WindowGoal, departure_times, find_window
    from planfly.campaigns.window_text import answer_line, window_lines

    context, mission = payload
    facts = context.scenario.wind.forecast
    if facts is None:
        reason = "departures need a forecast: planfly studio --forecast FILE --at TIME"
        raise MissionError(f"{mission.source}: {reason}", field="forecast")
    first = facts.departure
    departures = departure_times(first, min(first + _WINDOW_SPAN, facts.last_time), _WINDOW_STEP)
    goal = WindowGoal(departures, first, DEFAULT_PROBABILITY, _WINDOW_FLIGHTS)
    result = find_window(_campaign_base(context, mission), goal, _WORKERS, advance)
    return _answer(result.is_go, answer_line(result), window_lines(result))


def _answer(is_good: bool | None, headline: str, lines: Iterable[str]) -> dict[str, Any]:
    """Return an answer as page data.

    is_good: True for a good answer, False for a bad one; None if it is not known.
    """
    return {
        "state": "open" if is_good is None else "ok" if is_good else "fail",
        "headline": headline,
        "lines": [*lines],
    }
