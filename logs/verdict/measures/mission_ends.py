"""Check how a mission begins and ends.

PX4 requires a take-off and a landing; ArduPlane may return to launch at the end.
"""

import math

from flight.autopilots.parts import PX4_DEFAULT_LIMITS, FeasibilityLimits
from flight.mission.items import LANDINGS, TAKEOFFS, Command, Mission
from flight.simulation.setup import FlightSetup
from logs.verdict.tolerances import FINAL_WAYPOINT_TOLERANCE_M


def judges_return_after_last_item(setup: FlightSetup) -> bool:
    """Return True if ArduPlane returns to launch after the mission's last item, and this return is judged.

    It is not judged for a mission that ends at its scenario's destination.
    """
    return _returns_after_last_item(setup) and not _ends_at_destination(setup)


def _returns_after_last_item(setup: FlightSetup) -> bool:
    """Return True if ArduPlane returns to launch by itself after the mission's last item.

    ArduPlane does so (`AP_Mission::complete`, `Plane::exit_mission_callback`) unless the mission ends with a return to
    launch, a landing, an endless loiter or an endless jump.  The result is also False for an imported flight, and for
    any other autopilot.
    """
    route, mission = setup.route, setup.mission
    ends_in_flight = route.rtl_start is None and route.endless_jump is None
    if setup.imported_log is not None or setup.autopilot.checks.dialect != "ardupilot" or not ends_in_flight:
        return False
    last_seq = _last_seq(setup)
    last_item = next((item for item in mission.items if item.seq == last_seq), None)
    if last_item is None or last_item.command in LANDINGS | {Command.NAV_LOITER_UNLIM}:
        return False
    # The route of the airborne part of a flight ends before the landing.
    return not any(item.command in LANDINGS and item.seq > last_seq for item in mission.items)


def _last_seq(setup: FlightSetup) -> int:
    """Return the number of the last mission item on the route; -1 if no waypoint belongs to an item."""
    return next((seq for seq in reversed(setup.route.items.tolist()) if seq >= 0), -1)


def _distance_to_destination(setup: FlightSetup) -> float:
    """Return the distance from the mission's last item on the route to the scenario's destination, m."""
    route = setup.route
    return math.dist(route.positions[route.items.tolist().index(_last_seq(setup))], setup.scenario.destination)


def _ends_at_destination(setup: FlightSetup) -> bool:
    """Return True if a mission ends within `FINAL_WAYPOINT_TOLERANCE_M` of its scenario's destination.

    This is also the tolerance within which a flight reaches its last waypoint.
    """
    return not setup.scenario.external and _distance_to_destination(setup) <= FINAL_WAYPOINT_TOLERANCE_M


def unjudged_return_text(setup: FlightSetup) -> str:
    """Explain why ArduPlane's return to launch after the last item is not judged.

    Return "" if it is judged or does not occur.
    """
    if not _returns_after_last_item(setup):
        return ""
    if _ends_at_destination(setup):
        return f"the mission ends at the scenario's destination; {setup.autopilot.title} then returns to launch"
    return missing_home_text(setup)


def missing_home_text(setup: FlightSetup) -> str:
    """State that the return to launch after the last item cannot be judged without a home.

    This concerns ArduPlane.

    Return "" if the mission has a home, or if this return is not judged for another reason.
    """
    if setup.mission.home is not None or not judges_return_after_last_item(setup):
        return ""
    return f"{setup.autopilot.title} returns to home by itself after the last item, but the mission has no home"


def judged_return_text(setup: FlightSetup) -> str:
    """Explain why ArduPlane's return to launch after the last item is judged, and how to avoid it."""
    remedy = "A landing or NAV_LOITER_UNLIM at the end of the mission prevents this return"
    if setup.scenario.external:
        return f"After the last item {setup.autopilot.title} returns to launch by itself. {remedy}"
    return (
        "The return is judged, because the mission does not end at the scenario's destination: it ends"
        f" {_distance_to_destination(setup):.1f} m from it, and at most {FINAL_WAYPOINT_TOLERANCE_M:.0f} m are allowed."
        f" {remedy}"
    )


# Text on the items that each value of MIS_TKO_LAND_REQ requires.
_REQUIRED = {1: "a takeoff", 2: "a landing", 3: "a takeoff and a landing", 4: "both or neither", 5: "both or neither"}


def missing_ends_text(mission: Mission, limits: FeasibilityLimits) -> str:
    """Explain why PX4 refuses a mission that lacks a required take-off or landing; "" if it lacks none.

    limits: PX4's feasibility limits, with the required items (MIS_TKO_LAND_REQ).

    >>> missing_ends_text(Mission(None, ()), FeasibilityLimits(requires=2))
    "PX4's fixed-wing default refuses a mission without a landing: add one, or set MIS_TKO_LAND_REQ 0"
    """
    has_takeoff = any(item.command in TAKEOFFS for item in mission.items)
    has_landing = any(item.command in LANDINGS for item in mission.items)
    # MIS_TKO_LAND_REQ is 0 for nothing, 1 for a take-off, 2 for a landing, 3 for both, more for both or neither.
    is_enough = {0: True, 1: has_takeoff, 2: has_landing, 3: has_takeoff and has_landing}.get(
        limits.requires, has_takeoff == has_landing
    )
    if is_enough:
        return ""
    if limits.requires == PX4_DEFAULT_LIMITS.requires and not limits.stated:
        return "PX4's fixed-wing default refuses a mission without a landing: add one, or set MIS_TKO_LAND_REQ 0"
    requirement = f"MIS_TKO_LAND_REQ {limits.requires} requires {_REQUIRED[limits.requires]}"
    present = [name for name, is_present in (("a takeoff", has_takeoff), ("a landing", has_landing)) if is_present]
    present_ends = " and ".join(present) or "neither a takeoff nor a landing"
    return f"{requirement}, but this mission has {present_ends}"
