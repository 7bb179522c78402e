"""Prepare ArduPlane before a flight.

The steps are: read parameters, upload the mission, set home, arm, and switch to AUTO.
"""

from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.sitl.conversation import REPLY_TIMEOUT_S, Awaited, Conversation, ConversationStep
from flight.autopilots.sitl.mission import UploadedMission
from flight.live.mission_server import MissionType
from flight.mission.items import Command, Frame, MissionItem

# ArduPlane's number of the mode AUTO.
AUTO = 10
# Requested messages, with their intervals in microseconds.
_MESSAGE_INTERVALS_US = {
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: 200_000,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 100_000,
}
# Forces arming: the checks before a take-off fail in the air.
_FORCE_ARMING = 21196


class Preflight(Conversation):
    """Conversation with one running ArduPlane."""

    def identify(self, parameters: Iterable[str]) -> ConversationStep:
        """Identify the autopilot, and read the named parameters; skip parameters that it lacks.

        Raises FlightError if the vehicle is not a fixed wing.
        """
        yield from self._identify("ArduPlane", _MESSAGE_INTERVALS_US, parameters)

    def prepare(self, mission: UploadedMission) -> ConversationStep:
        """Wait until ArduPlane has a position, upload the mission, arm ArduPlane, and start AUTO.

        Raises FlightError if ArduPlane finds no position, or refuses one of the other steps.
        """
        reported, ekf = self._reported, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT
        yield from self._wait_for_position(ekf, _MESSAGE_INTERVALS_US[ekf], mavlink.ESTIMATOR_CONST_POS_MODE)
        # Item 0 is home.
        yield from self._upload(
            [
                MissionItem(
                    0,
                    int(Command.NAV_WAYPOINT),
                    int(Frame.GLOBAL),
                    (0.0,) * 4,
                    mission.home.lat_deg,
                    mission.home.lon_deg,
                    mission.home.alt,
                ),
                *mission.items,
            ],
            MissionType.MISSION,
        )
        if mission.rally:
            yield from self._upload(list(mission.rally), MissionType.RALLY)
        yield from self._send_until_accepted(Command.DO_SET_HOME, lambda: self._send_home(mission.home), "home")
        yield from self._send_until_accepted(
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
            lambda: self._send_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, _FORCE_ARMING),
            "arming",
        )
        yield from self._send_until_accepted(
            Command.DO_SET_MODE,
            lambda: self._send_command(Command.DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, AUTO),
            "AUTO",
        )
        auto_mode = Awaited("AUTO", REPLY_TIMEOUT_S, "was not armed and in AUTO")
        yield from self._wait_until(lambda: reported.mode == AUTO and reported.armed, auto_mode)


def version_text(texts: list[str], number: int | None) -> str:
    """Return ArduPlane's name and version.

    texts: status texts of ArduPlane; the first that begins with "ArduPlane" is returned.
    number: AUTOPILOT_VERSION.flight_sw_version, used without such a text; None if not received.

    >>> version_text(["Initialising", "ArduPlane V4.6.0-dev (0123abcd)"], None)
    'ArduPlane V4.6.0-dev (0123abcd)'
    >>> version_text([], 0x040503FF)
    'ArduPlane 4.5.3'
    """
    names = [text for text in texts if text.startswith("ArduPlane")]
    if names:
        return names[0]
    if number is None:
        return "ArduPlane, version unknown"
    return f"ArduPlane {number >> 24 & 255}.{number >> 16 & 255}.{number >> 8 & 255}"
