"""Judge returns along the route, and fly campaigns, in the studio's second process."""

from collections import Counter
from pathlib import Path
from typing import Any

from flight.mission.items import Mission
from logs.verdict.returns.judge_returns import judge_returns, return_world
from logs.verdict.returns.returns_text import headline, no_return_text, range_text
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.flight_row import fly_one
from planfly.rtl.return_summary import return_starts
from planfly.studio.edit_context import EditContext
from planfly.studio.pilot import Advance
from planfly.workflow.pipeline import fly_and_judge
from world.errors import MissionError
from world.extras import need_extra

# Maximum number of returns that are judged along the route.
_MAX_RETURNS = 240
# Maximum number of ranges of the route that are named.
_MAX_RANGES = 6
# Number of flights in a campaign.
FLIGHTS = 24


def returns(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Fly the mission, and judge a return to launch from every part of it."""
    desk, mission = payload
    setup = desk.setup(mission)
    if mission.home is None or desk.scenario.terrain is None:
        lacks = "home" if mission.home is None else "terrain"
        raise MissionError(f"{mission.source}: returns are not judged without a {lacks}", field=lacks)
    world = return_world(setup)
    flown = fly_and_judge(
        setup, desk.airframe, None, lambda done, total, remark: advance(0.5 * done, total, remark), reference="never"
    )
    every = max(1.0, (float(flown.track.time[-1]) if len(flown.track) else 0.0) / _MAX_RETURNS)
    starts = return_starts(setup, flown.track, every)
    remark = f"flying {len(starts)} returns"
    found = judge_returns(
        world, starts, every, advance=lambda done, total: advance(0.5 + 0.5 * done / max(1.0, total), 1.0, remark)
    )
    lines = [range_text(one, found, desk.scenario) for one in found.ranges[:_MAX_RANGES]]
    return {
        "state": "ok" if found.safe else "open" if found.undecided else "fail",
        "headline": headline(found),
        "lines": [*lines, *filter(None, [no_return_text(found)])],
    }


def campaign(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Fly the mission `FLIGHTS` times, each in its own wind, aircraft, terrain and start."""
    need_extra("campaigns")
    from planfly.campaigns.statistics.decision import wilson

    desk, mission = payload
    setup = desk.setup(mission)
    base = CampaignBase(
        *(desk.scenario, desk.airframe, mission, desk.placed(mission), setup.plan, default_dispersions(), desk.seed),
        name=Path(mission.source).stem,
    )
    flyable, fails = 0, Counter[str]()
    for index in range(FLIGHTS):
        advance(index, FLIGHTS, f"{flyable} of {index} flyable")
        row = fly_one(base, index)
        flyable += row.outcome == "flyable"
        fails.update({rule for rule, _ in row.failed})
    low, high = wilson(flyable, FLIGHTS)
    common = [f"{rule} fails in {count}" for rule, count in fails.most_common(5)]
    return {
        "state": "ok" if flyable == FLIGHTS else "open" if flyable else "fail",
        "headline": f"{flyable} of {FLIGHTS} flights are flyable: {low:.0%} to {high:.0%} at 95 %",
        "lines": [*common, f"planfly campaign flies more: {FLIGHTS} flights show little about rare failures"],
    }
