"""Check a mission for the takeoff and the landing that PX4 requires."""

from flight.autopilots.parts import PX4_DEFAULT_LIMITS, FeasibilityLimits
from flight.mission.items import LANDINGS, TAKEOFFS, Mission

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
