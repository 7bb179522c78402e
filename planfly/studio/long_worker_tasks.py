"""Judge returns to launch along the route, and fly campaigns, in the studio's second worker process."""

from collections import Counter
from pathlib import Path
from typing import Any

from flight.mission.items import Mission
from logs.verdict.returns.judge_returns import judge_returns, make_return_world
from logs.verdict.returns.returns_text import headline, point_of_no_return_text, range_text
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.flight_row import fly_one
from planfly.rtl.return_summary import return_starts
from planfly.studio.edit_context import EditContext
from planfly.studio.worker_process import Advance
from planfly.workflow.pipeline import fly_and_judge
from world.errors import MissionError
from world.extras import require_extra

# Maximum number of returns that are judged along the route.
_MAX_RETURNS = 240
# Maximum number of ranges of the route that are named.
_MAX_LISTED_RANGES = 6
# Number of flights in a campaign.
FLIGHT_COUNT = 24


def run_returns_task(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Fly a mission, and judge returns to launch from points along the flight.

    Returns the results of the returns as page data.

    payload: editing context, and mission.
    """
    context, mission = payload
    setup = context.setup(mission)
    if mission.home is None or context.scenario.terrain is None:
        missing_input = "home" if mission.home is None else "terrain"
        reason = f"returns cannot be judged without {missing_input}"
        raise MissionError(f"{mission.source}: {reason}", field=missing_input)
    world = make_return_world(setup)
    flight = fly_and_judge(
        setup, context.airframe, None, lambda done, total, remark: advance(0.5 * done, total, remark), reference="never"
    )
    interval = max(1.0, (float(flight.track.time[-1]) if len(flight.track) else 0.0) / _MAX_RETURNS)
    starts = return_starts(setup, flight.track, interval)
    remark = f"flying {len(starts)} returns"
    judged_returns = judge_returns(
        world, starts, interval, advance=lambda done, total: advance(0.5 + 0.5 * done / max(1.0, total), 1.0, remark)
    )
    lines = [
        range_text(return_range, judged_returns, context.scenario)
        for return_range in judged_returns.ranges[:_MAX_LISTED_RANGES]
    ]
    return {
        "state": "ok" if judged_returns.safe else "open" if judged_returns.undecided else "fail",
        "headline": headline(judged_returns),
        "lines": [*lines, *filter(None, [point_of_no_return_text(judged_returns)])],
    }


def run_campaign_task(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Fly a mission `FLIGHT_COUNT` times with varied conditions, and return the results as page data.

    Wind, aircraft, terrain error and start position vary.

    payload: editing context, and mission.
    """
    require_extra("campaigns")
    from planfly.campaigns.statistics.decision import wilson

    context, mission = payload
    setup = context.setup(mission)
    base = CampaignBase(
        *(
            context.scenario,
            context.airframe,
            mission,
            context.place_mission(mission),
            setup.plan,
            default_dispersions(),
            context.seed,
        ),
        name=Path(mission.source).stem,
    )
    flyable, failure_counts = 0, Counter[str]()
    for index in range(FLIGHT_COUNT):
        advance(index, FLIGHT_COUNT, f"{flyable} of {index} flyable")
        row = fly_one(base, index)
        flyable += row.outcome == "flyable"
        failure_counts.update({rule for rule, _ in row.failed})
    lower, upper = wilson(flyable, FLIGHT_COUNT)
    common = [f"{rule} fails in {count}" for rule, count in failure_counts.most_common(5)]
    return {
        "state": "ok" if flyable == FLIGHT_COUNT else "open" if flyable else "fail",
        "headline": f"{flyable} of {FLIGHT_COUNT} flights are flyable: {lower:.0%} to {upper:.0%} at 95 %",
        "lines": [*common, f"planfly campaign flies more: {FLIGHT_COUNT} flights show little about rare failures"],
    }
