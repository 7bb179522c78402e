"""Every MAV_CMD has its name and its treatment by both autopilots, against the autopilots' sources read by hand."""

import pytest

from flight.mission.commands import Command, Treatment, command_support

# What `AP_Mission::mavlink_int_to_mission_cmd` (libraries/AP_Mission/AP_Mission.cpp) stores in ArduPlane; all else is
# MAV_MISSION_UNSUPPORTED, NAV_SPLINE_WAYPOINT (82) in ArduPlane too.
ARDUPLANE_TAKES = {
    *(16, 17, 18, 19, 20, 21, 22, 30, 31, 83, 84, 85, 92, 93, 94, 112, 114, 115, 177, 178, 179, 181, 182, 183, 184),
    *(188, 189, 191, 193, 194, 195, 197, 201, 202, 203, 205, 206, 207, 208, 210, 211, 212, 213, 215, 216, 217, 218),
    *(222, 223, 531, 532, 534, 600, 601, 1000, 2000, 2001, 2500, 2501, 3000, 42600, 42702, 42703),
}
# What of that `Plane::start_command` (ArduPlane/commands_logic.cpp) and `AP_Mission::start_command` fly or steer with:
# climbs and balloon drops, VTOL, parachute, inverted flight, autotune, scripts, auxiliary switches, engine.
ARDUPLANE_STEERS = {30, 83, 84, 85, 94, 208, 210, 212, 217, 218, 223, 3000, 42702}
# What the itinerary flies of ArduPlane's: places, returns, ends, conditions, jumps, speeds, home, the landing mark.
ARDUPLANE_FLOWN = {16, 17, 18, 19, 20, 21, 22, 31, 112, 114, 177, 178, 179, 189, 600, 601}

# What both `parse_mavlink_mission_item` (src/modules/mavlink/mavlink_mission.cpp) and `checkMissionItemValidity`
# (src/modules/navigator/MissionFeasibility/FeasibilityChecker.cpp) of PX4 1.17 take; NAV_ROI (80) is stored as
# DO_SET_ROI, and 1.16 takes neither DO_AUTOTUNE_ENABLE (212) nor COMPONENT_ARM_DISARM (400).
PX4_TAKES = {
    *(16, 17, 19, 20, 21, 22, 31, 80, 84, 85, 93, 177, 178, 179, 187, 189, 195, 196, 197, 200, 201, 203, 204, 205),
    *(206, 211, 212, 214, 260, 400, 530, 532, 534, 1000, 1001, 2000, 2001, 2003, 2500, 2501, 3000, 4501, 42600),
}
# `MissionBlock` (mission_block.cpp) waits at NAV_DELAY, flies VTOL items, and hands DO_SET_HOME, DO_AUTOTUNE_ENABLE and
# COMPONENT_ARM_DISARM to other modules.
PX4_STEERS = {84, 85, 93, 179, 212, 400, 3000}
PX4_FLOWN = {16, 17, 19, 20, 21, 22, 31, 177, 178, 189, 4501}


def expected(number: int, takes: set[int], flown: set[int], steers: set[int]) -> Treatment:
    if number not in takes:
        return Treatment.REFUSED
    if number in flown:
        return Treatment.FLOWN
    return Treatment.OPEN if number in steers else Treatment.NO_EFFECT


@pytest.mark.parametrize("command", [*map(int, Command), 0, 50_000])
def test_every_command_is_treated_as_the_autopilots_treat_it(command: int) -> None:
    support = command_support(command)
    assert support.arduplane == expected(command, ARDUPLANE_TAKES, ARDUPLANE_FLOWN, ARDUPLANE_STEERS)
    assert support.px4 == expected(command, PX4_TAKES, PX4_FLOWN, PX4_STEERS)
    assert support.reason


def test_the_commands_are_those_of_mavlinks_dialects() -> None:
    from pymavlink.dialects.v20 import ardupilotmega, common

    for dialect in (ardupilotmega, common):
        known = {k: one.name for k, one in dialect.enums["MAV_CMD"].items() if not one.name.endswith("_ENUM_END")}
        assert {k: f"MAV_CMD_{Command(k).name}" for k in known} == known
