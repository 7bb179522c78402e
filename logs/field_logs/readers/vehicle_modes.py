"""Flight modes by their numbers, and which of them follow a mission."""

from pymavlink import mavutil

_PLANE_AUTO = 10
# PX4's vehicle_status.nav_state (PX4, msg/VehicleStatus.msg).
_PX4_MISSION = 3
_PX4_STATES = {
    0: "MANUAL", 1: "ALTCTL", 2: "POSCTL", 3: "MISSION", 4: "LOITER", 5: "RTL", 8: "FREE", 10: "ACRO",
    12: "DESCEND", 13: "TERMINATION", 14: "OFFBOARD", 15: "STAB", 17: "TAKEOFF", 18: "LAND", 21: "ORBIT",
}  # fmt: skip
# Main mode and sub-mode of PX4's custom_mode: AUTO, MISSION.
_PX4_AUTO, _PX4_AUTO_MISSION = 4, 4


def plane_mode(number: int) -> tuple[str, bool]:
    """ArduPlane's name of a mode, and whether it follows the mission.

    >>> plane_mode(10), plane_mode(5)
    (('AUTO', True), ('FBWA', False))
    """
    return mavutil.mode_mapping_apm.get(number, f"mode {number}"), number == _PLANE_AUTO


def px4_state(number: int) -> tuple[str, bool]:
    """PX4's name of a navigation state, and whether it follows the mission.

    >>> px4_state(3), px4_state(5)
    (('MISSION', True), ('RTL', False))
    """
    return _PX4_STATES.get(number, f"state {number}"), number == _PX4_MISSION


def px4_mode(custom_mode: int) -> tuple[str, bool]:
    """PX4's name of a mode as a heartbeat carries it, and whether it follows the mission.

    >>> px4_mode(4 << 24 | 4 << 16)
    ('MISSION', True)
    """
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    mission = (main, sub) == (_PX4_AUTO, _PX4_AUTO_MISSION)
    return ("MISSION" if mission else str(mavutil.interpret_px4_mode(0, custom_mode)), mission)
