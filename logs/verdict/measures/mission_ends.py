"""Check how a mission ends: with the takeoff and the landing that PX4 requires, or with ArduPlane's own return."""

import math

from flight.autopilots.parts import PX4_DEFAULT_LIMITS, FeasibilityLimits
from flight.mission.items import LANDINGS, TAKEOFFS, Command, Mission
from flight.simulation.setup import FlightSetup

# Distance within which a mission ends at the destination of its scenario, m.
_AT_DESTINATION_M = 1.0


def returns_after_last_item(setup: FlightSetup) -> bool:
    """Return True if ArduPlane returns to launch by itself after the mission's last item.

    It does (`AP_Mission::complete`, `Plane::exit_mission_callback`) unless the mission ends with a return, a landing, a
    loiter without end or a jump without end.  A mission that ends at the destination of its scenario is judged up to
    there.
    """
    route, mission, scenario = setup.route, setup.mission, setup.scenario
    ends_in_flight = route.rtl_start < 0 and route.endless_jump < 0 and mission.home is not None
    if setup.source is not None or setup.autopilot.checks.dialect != "ardupilot" or not ends_in_flight:
        return False
    last_seq = next((seq for seq in reversed(route.items.tolist()) if seq >= 0), -1)
    last_item = next((item for item in mission.items if item.seq == last_seq), None)
    if last_item is None or last_item.command in LANDINGS | {Command.NAV_LOITER_UNLIM}:
        return False
    # The route of the airborne part of a flight ends before the landing.
    if any(item.command in LANDINGS and item.seq > last_seq for item in mission.items):
        return False
    last_position = route.waypoints[route.items.tolist().index(last_seq)]
    return scenario.external or math.dist(last_position, scenario.destination) > _AT_DESTINATION_M


# What each value of MIS_TKO_LAND_REQ requires.
_REQUIRED = {1: "a takeoff", 2: "a landing", 3: "a takeoff and a landing", 4: "both or neither", 5: "both or neither"}


def missing_ends_text(mission: Mission, limits: FeasibilityLimits) -> str:
    """Describe PX4's objection to a missing takeoff or landing; return "" if nothing is missing.

    >>> missing_ends_text(Mission(None, ()), FeasibilityLimits(requires=2))
    "PX4's fixed-wing default refuses a mission without a landing: add one, or set MIS_TKO_LAND_REQ 0"
    """
    has_takeoff = any(item.command in TAKEOFFS for item in mission.items)
    has_landing = any(item.command in LANDINGS for item in mission.items)
    is_enough = {0: True, 1: has_takeoff, 2: has_landing, 3: has_takeoff and has_landing}.get(
        limits.requires, has_takeoff == has_landing
    )
    if is_enough:
        return ""
    if limits.requires == PX4_DEFAULT_LIMITS.requires and not limits.stated:
        return "PX4's fixed-wing default refuses a mission without a landing: add one, or set MIS_TKO_LAND_REQ 0"
    requirement = f"MIS_TKO_LAND_REQ {limits.requires} requires {_REQUIRED[limits.requires]}"
    return f"{requirement}, but this mission has {_present_ends(has_takeoff, has_landing)}"


def _present_ends(has_takeoff: bool, has_landing: bool) -> str:
    """Name the takeoff and the landing that a mission has."""
    present = [name for name, is_present in (("a takeoff", has_takeoff), ("a landing", has_landing)) if is_present]
    return " and ".join(present) or "neither a takeoff nor a landing"
