"""Prepare PX4 before a flight.

The steps are: read parameters, upload the mission, set home, arm, and start mission mode.
"""

from collections.abc import Iterable
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.sitl.conversation import REPLY_TIMEOUT_S, SYSTEM, Awaited, Conversation, ConversationStep
from flight.autopilots.sitl.mission import UploadedMission
from flight.live.mission_server import MissionType
from flight.mission.items import Command, MissionItem
from world.errors import FlightError

# PX4's number of the main mode MANUAL.
_MANUAL = 1
# PX4's number of the main mode AUTO.
_AUTO = 4
# PX4's number of the sub-mode MISSION of AUTO.
_MISSION = 4
# Mission mode as in a heartbeat: main mode and sub-mode.
MISSION_MODE = _AUTO << 16 | _MISSION << 24
# Requested messages, with their intervals in microseconds.
_MESSAGE_INTERVALS_US = {
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 200_000,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 100_000,
}
# Forces disarming in the air.
_FORCE_DISARMING = 21196
# FIRMWARE_VERSION_TYPE in the last byte of a version that is not a release.
_VERSION_TYPES = {0: " (development)", 64: " (alpha)", 128: " (beta)", 192: " (release candidate)"}


class Px4Preflight(Conversation):
    """Conversation with one running PX4."""

    def identify(self, parameters: Iterable[str]) -> ConversationStep:
        """Identify the autopilot, and read the named parameters; skip parameters that it lacks.

        Raises FlightError if the autopilot is not PX4.
        """
        yield from self._identify("PX4", _MESSAGE_INTERVALS_US, parameters)
        if self._reported.autopilot != mavlink.MAV_AUTOPILOT_PX4:
            autopilot, allowed = self._reported.autopilot, f"expected {mavlink.MAV_AUTOPILOT_PX4}, PX4"
            message = f"is not PX4: its heartbeat states autopilot {autopilot}; {allowed}"
            raise FlightError(message, field="autopilot", value=autopilot, allowed=allowed)

    def prepare(self, mission: UploadedMission) -> ConversationStep:
        """Wait until PX4 has a position, upload the mission, and arm PX4 in MANUAL.

        PX4 must be in MANUAL because its TECS would otherwise integrate errors on the rail. Raises FlightError if PX4
        has no position estimate, or refuses the mission, home, or arming.
        """
        estimator = mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
        yield from self._wait_for_position(estimator, _MESSAGE_INTERVALS_US[estimator])
        yield from self._upload(number_from_zero(mission.items), MissionType.MISSION)
        if mission.rally:
            yield from self._upload(list(mission.rally), MissionType.RALLY)
        yield from self._send_until_accepted(Command.DO_SET_HOME, lambda: self._send_home(mission.home), "home")
        yield from self._send_until_accepted(Command.DO_SET_MODE, lambda: self._send_mode(_MANUAL, 0), "MANUAL")
        yield from self._send_until_accepted(
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
            lambda: self._send_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1),
            "arming",
        )

    def start_mission(self) -> ConversationStep:
        """Switch PX4 to mission mode. Raises FlightError if PX4 refuses."""
        yield from self._send_until_accepted(Command.DO_SET_MODE, lambda: self._send_mode(_AUTO, _MISSION), "MISSION")
        mission_mode = Awaited("MISSION", REPLY_TIMEOUT_S, "was not armed and in mission mode")
        yield from self._wait_until(lambda: self._reported.mode == MISSION_MODE and self._reported.armed, mission_mode)

    def send_periodic_messages(self) -> None:
        """Send the messages that PX4 expects from a ground station.

        They are a heartbeat, and joystick inputs in neutral position with closed throttle.
        """
        self._send_heartbeat()
        self._link.send(mavlink.MAVLink_manual_control_message(SYSTEM, 0, 0, 0, 0, 0))

    def disarm(self) -> None:
        """Disarm PX4, which closes its log."""
        self._send_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, _FORCE_DISARMING)

    def _send_mode(self, main_mode: int, sub_mode: int) -> None:
        """Send the command for a flight mode, by PX4's numbers of the main mode and the sub-mode."""
        self._send_command(Command.DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main_mode, sub_mode)


def number_from_zero(items: Iterable[MissionItem]) -> list[MissionItem]:
    """Return a mission's items, which planfly numbers from 1, with PX4's numbers from 0.

    PX4 stores home separately. ArduPlane numbers items from 1, because its item 0 is home.

    >>> jump = MissionItem(3, Command.DO_JUMP, 2, (1.0, 2.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    >>> number_from_zero([jump])[0].seq, number_from_zero([jump])[0].params[:2]
    (2, (0.0, 2.0))
    """
    return [
        replace(
            item,
            seq=item.seq - 1,
            params=(item.params[0] - 1.0, *item.params[1:]) if item.command == Command.DO_JUMP else item.params,
        )
        for item in items
    ]


def version_text(number: int | None) -> str:
    """Return PX4's name and version, from AUTOPILOT_VERSION.flight_sw_version.

    >>> version_text(0x011000FF), version_text(0x01110080), version_text(None)
    ('PX4 1.16.0', 'PX4 1.17.0 (beta)', 'PX4, version unknown')
    """
    if number is None:
        return "PX4, version unknown"
    release_kind = "" if number & 255 == 255 else _VERSION_TYPES.get(number & 192, "")
    return f"PX4 {number >> 24 & 255}.{number >> 16 & 255}.{number >> 8 & 255}{release_kind}"
