"""What PX4 is told before it flies: parameters, mission, home, arming, and its mission mode on the rail."""

from collections.abc import Iterable
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.sitl.conversation import ANSWERS, SYSTEM, Awaited, Conversation, Talk
from flight.autopilots.sitl.mission import UploadedMission
from flight.live.mission_server import MissionType
from flight.mission.items import Command, MissionItem
from world.errors import FlightError

# PX4's numbers of its modes: the main one, and of AUTO the sub-mode, as a heartbeat packs them.
_MANUAL, _AUTO, _MISSION = 1, 4, 4
MISSION_MODE = _AUTO << 16 | _MISSION << 24
# Messages that are wanted, and how often, microseconds.
_WANTED = {mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 200_000, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 100_000}
# Forces disarming in the air.
_FORCE = 21196
# Of a version that is no release, FIRMWARE_VERSION_TYPE in its last byte.
_KINDS = {0: " (development)", 64: " (alpha)", 128: " (beta)", 192: " (release candidate)"}


class Px4Preflight(Conversation):
    """The conversation with one PX4."""

    def meet(self, parameters: Iterable[str]) -> Talk:
        """Learn who it is and which of these parameters it has; raises FlightError for what is no PX4."""
        yield from self._introduce("PX4", _WANTED, parameters)
        if self._news.autopilot != mavlink.MAV_AUTOPILOT_PX4:
            told, allowed = self._news.autopilot, f"{mavlink.MAV_AUTOPILOT_PX4}, PX4, is expected"
            message = f"is no PX4: its heartbeat says autopilot {told}; {allowed}"
            raise FlightError(message, field="autopilot", value=told, allowed=allowed)

    def prepare(self, mission: UploadedMission) -> Talk:
        """Wait until it knows where it is, hand over the mission, and arm it in MANUAL.

        In any other mode its height control would wind up on the rail.  Raises FlightError where it does not come to
        know, or refuses.
        """
        estimator = mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
        yield from self._knows_its_place(estimator, _WANTED[estimator])
        yield from self._upload(counted_from_0(mission.items), MissionType.MISSION)
        if mission.rally:
            yield from self._upload(list(mission.rally), MissionType.RALLY)
        yield from self._obeys(Command.DO_SET_HOME, lambda: self._set_home(mission.home), "home")
        yield from self._obeys(Command.DO_SET_MODE, lambda: self._set_mode(_MANUAL, 0), "MANUAL")
        yield from self._obeys(
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
            lambda: self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1),
            "arming",
        )

    def set_out(self) -> Talk:
        """Set it on its way; raises FlightError where it refuses."""
        yield from self._obeys(Command.DO_SET_MODE, lambda: self._set_mode(_AUTO, _MISSION), "MISSION")
        under_way = Awaited("MISSION", ANSWERS, "is not in its mission mode, armed")
        yield from self._until(lambda: self._news.mode == MISSION_MODE and self._news.armed, under_way)

    def accompany(self) -> None:
        """Tell it that a station is there, to which it answers, and of its joystick at rest, throttle closed."""
        self._say_hello()
        self._link.send(mavlink.MAVLink_manual_control_message(SYSTEM, 0, 0, 0, 0, 0))

    def disarm(self) -> None:
        """Have it disarm, which closes its log."""
        self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, _FORCE)

    def _set_mode(self, main: int, sub: int) -> None:
        self._command(Command.DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub)


def counted_from_0(items: Iterable[MissionItem]) -> list[MissionItem]:
    """A mission's items, which ArduPlane counts from 1, as PX4 counts them: it keeps home elsewhere.

    >>> jump = MissionItem(3, Command.DO_JUMP, 2, (1.0, 2.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    >>> counted_from_0([jump])[0].seq, counted_from_0([jump])[0].params[:2]
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
    """What a PX4 calls itself, by AUTOPILOT_VERSION.flight_sw_version.

    >>> version_text(0x011000FF), version_text(0x01110080), version_text(None)
    ('PX4 1.16.0', 'PX4 1.17.0 (beta)', 'PX4, version unknown')
    """
    if number is None:
        return "PX4, version unknown"
    kind = "" if number & 255 == 255 else _KINDS.get(number & 192, "")
    return f"PX4 {number >> 24 & 255}.{number >> 16 & 255}.{number >> 8 & 255}{kind}"
