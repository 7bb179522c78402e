"""What ArduPlane is told before it flies: parameters, mission, home, arming, AUTO."""

from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.sitl.conversation import ANSWERS, Awaited, Conversation, Talk
from flight.autopilots.sitl.mission import UploadedMission
from flight.live.mission_server import MissionType
from flight.mission.items import Command, Frame, Home, MissionItem

# ArduPlane's number of the mode.
AUTO = 10
# Messages that are wanted, and how often, microseconds.
_WANTED = {mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: 200_000, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 100_000}
# Forces arming: what is checked before a take-off does not hold in the air.
_FORCE = 21196


class Preflight(Conversation):
    """The conversation with one ArduPlane."""

    def meet(self, parameters: Iterable[str]) -> Talk:
        """Learn who it is and which of these parameters it has; raises FlightError for what is no ArduPlane."""
        yield from self._introduce("ArduPlane", _WANTED, parameters)

    def prepare(self, mission: UploadedMission) -> Talk:
        """Wait until it knows where it is, hand over the mission, and set it on its way in AUTO.

        Raises FlightError where it does not come to know, or refuses.
        """
        news, ekf = self._news, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT
        yield from self._knows_its_place(ekf, _WANTED[ekf], mavlink.ESTIMATOR_CONST_POS_MODE)
        yield from self._upload([_home_item(mission.home), *mission.items], MissionType.MISSION)
        if mission.rally:
            yield from self._upload(list(mission.rally), MissionType.RALLY)
        yield from self._obeys(Command.DO_SET_HOME, lambda: self._set_home(mission.home), "home")
        yield from self._obeys(
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
            lambda: self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, _FORCE),
            "arming",
        )
        yield from self._obeys(
            Command.DO_SET_MODE,
            lambda: self._command(Command.DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, AUTO),
            "AUTO",
        )
        under_way = Awaited("AUTO", ANSWERS, "is not in AUTO, armed")
        yield from self._until(lambda: news.mode == AUTO and news.armed, under_way)


def _home_item(home: Home) -> MissionItem:
    return MissionItem(
        0, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, home.lat_deg, home.lon_deg, home.alt
    )


def version_text(texts: list[str], number: int | None) -> str:
    """What an autopilot calls itself: of its messages the one with its name, else of its version's number.

    >>> version_text(["Initialising", "ArduPlane V4.6.0-dev (0123abcd)"], None)
    'ArduPlane V4.6.0-dev (0123abcd)'
    >>> version_text([], 0x040503FF)
    'ArduPlane 4.5.3'
    """
    named = [text for text in texts if text.startswith("ArduPlane")]
    if named:
        return named[0]
    if number is None:
        return "ArduPlane, version unknown"
    return f"ArduPlane {number >> 24 & 255}.{number >> 16 & 255}.{number >> 8 & 255}"
