"""Prepare ArduPlane before it flies, by parameters, mission, home, arming, and AUTO."""

from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.sitl.conversation import REPLY_TIMEOUT_S, Awaited, Conversation, Talk
from flight.autopilots.sitl.mission import UploadedMission
from flight.live.mission_server import MissionType
from flight.mission.items import Command, Frame, Home, MissionItem

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
    """The conversation with one ArduPlane."""

    def meet(self, parameters: Iterable[str]) -> Talk:
        """Identify the autopilot, and read those of the given parameters that it has.

        Raises FlightError if it is not ArduPlane.
        """
        yield from self._identify("ArduPlane", _MESSAGE_INTERVALS_US, parameters)

    def prepare(self, mission: UploadedMission) -> Talk:
        """Wait until it has a position, upload the mission, and start it in AUTO.

        Raises FlightError if it finds no position, or refuses.
        """
        news, ekf = self._news, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT
        yield from self._wait_for_position(ekf, _MESSAGE_INTERVALS_US[ekf], mavlink.ESTIMATOR_CONST_POS_MODE)
        yield from self._upload([_home_item(mission.home), *mission.items], MissionType.MISSION)
        if mission.rally:
            yield from self._upload(list(mission.rally), MissionType.RALLY)
        yield from self._send_until_accepted(Command.DO_SET_HOME, lambda: self._set_home(mission.home), "home")
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
        auto_mode = Awaited("AUTO", REPLY_TIMEOUT_S, "is not in AUTO, armed")
        yield from self._wait_until(lambda: news.mode == AUTO and news.armed, auto_mode)


def _home_item(home: Home) -> MissionItem:
    return MissionItem(
        0, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, home.lat_deg, home.lon_deg, home.alt
    )


def version_text(texts: list[str], number: int | None) -> str:
    """Return the autopilot's name and version from its messages, or otherwise from its version number.

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
