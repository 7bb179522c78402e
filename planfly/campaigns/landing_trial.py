"""Fly the landing of a plan with a steep final in dispersed conditions.

A plan does not model the flare.
"""

import math
from dataclasses import replace

from flight.mission.commands import Command
from flight.mission.items import Mission
from planfly.campaigns.campaign_base import campaign_of_setup
from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.flight_row import fly_one
from planfly.campaigns.statistics.decision import wilson
from planfly.planning.expected_failures import HOLDING_PROBABILITY
from planfly.workflow.open_flight import make_setup, mission_of_plan
from planfly.workflow.uav import Uav
from planner.plan import Plan

# Slope of a final above which its landing is flown, rad.  In `benchmarks.planning.plans_in_campaigns`, plans with a
# long enough strip and finals of 3.5 to 4.9 degrees held in 97 to 100 of 100 flights.  On one strip, finals of 6 and
# 7 degrees held in 78 to 95 %: an aircraft that arrives fast floats in the flare until a gust stalls it.
STEEP_FINAL_RAD = math.radians(5.0)
# Number of landings that are flown.
LANDING_COUNT = 40
# Number of waypoints before the landing that are flown: the last before the line-up, and both ends of the line-up.
_WAYPOINTS_BEFORE_LANDING = 3


def steep_landing_failures(plan: Plan, uav: Uav) -> tuple[str, ...]:
    """Return a text on the failed landings of a plan with a steep final; () if the landings succeed.

    Landings succeed if at least a fraction `HOLDING_PROBABILITY` is flyable.  They begin in the air before the line-up,
    with the default dispersions of a campaign.  Landings are not flown, and () is returned, for a plan that is not
    safe, has no landing, or has a final of at most `STEEP_FINAL_RAD`.
    """
    descent = None if plan.procedures is None else plan.procedures.descent
    if not plan.safe or descent is None or math.atan(descent.slope) <= STEEP_FINAL_RAD:
        return ()
    mission = landing_mission(mission_of_plan(plan, uav))
    base = campaign_of_setup(make_setup(plan.scenario, uav, mission, plan.seed), default_dispersions())
    flyable_count = sum(fly_one(base, index).outcome == "flyable" for index in range(LANDING_COUNT))
    if flyable_count >= HOLDING_PROBABILITY * LANDING_COUNT:
        return ()
    low, high = wilson(flyable_count, LANDING_COUNT)
    return (
        f"only {flyable_count} of {LANDING_COUNT} simulated landings succeed (95 % interval of the probability:"
        f" {low:.2f} to {high:.2f}) on a final of {math.degrees(math.atan(descent.slope)):.1f}°. Use a strip or"
        " a landing course with a"
        f" clear final of at most {math.degrees(STEEP_FINAL_RAD):.0f}°, or fly in less wind or turbulence",
    )


def landing_mission(mission: Mission) -> Mission:
    """Return the end of a plan's mission.

    It has the last waypoint before the line-up, the line-up and the landing.

    The items are numbered from 1.
    """
    landing_index = max(k for k, item in enumerate(mission.items) if item.command == Command.NAV_LAND)
    waypoints = [k for k in range(landing_index) if mission.items[k].command == Command.NAV_WAYPOINT]
    items = mission.items[waypoints[-min(len(waypoints), _WAYPOINTS_BEFORE_LANDING)] :]
    return replace(mission, items=tuple(replace(item, seq=number) for number, item in enumerate(items, 1)))
