"""What an autopilot is told before it flies, in order, while the physics holds the aircraft on its rail.

A conversation is a generator: each time it is resumed a little more of the autopilot's time has passed, and it takes
what has been told meanwhile.
"""

import time
from collections.abc import Callable, Generator, Iterable
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.sitl.link import AutopilotLink
from flight.live.mission_server import MissionType, to_message
from flight.mission.items import Command, Frame, Home, MissionItem, command_name
from world.errors import FlightError

Talk = Generator[None, None, None]

SYSTEM, COMPONENT = 1, mavlink.MAV_COMP_ID_AUTOPILOT1
# How long (s of its own time) an autopilot may take: to speak, to know where it is, to answer, to take a mission.
SPEAKS, KNOWS, ANSWERS, TAKES = 30.0, 60.0, 5.0, 30.0
# Asked for again after so long, s.
AGAIN = 1.0
# Messages take their time by the clock, however fast the autopilot's goes: at least so long is waited, s.
_BY_THE_CLOCK = 0.5
# Parameters that are asked for at a time: ArduPilot keeps no more than some twenty questions.
_AT_ONCE = 10
_EKF_NEEDED = (
    mavlink.ESTIMATOR_ATTITUDE
    | mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_POS_HORIZ_ABS
    | mavlink.ESTIMATOR_POS_VERT_ABS
)
_MISSION_RESULTS = {number: entry.name for number, entry in mavlink.enums["MAV_MISSION_RESULT"].items()}


class _Since:
    """Time since a moment, of the autopilot and by the clock."""

    def __init__(self, now: Callable[[], float], clock: Callable[[], float]) -> None:
        self._now, self._clock = now, clock
        self._moments = now(), clock()

    def longer_than(self, seconds: float) -> bool:
        """Whether more of the autopilot's time has passed, and enough by the clock."""
        began, by_clock = self._moments
        return self._now() - began > seconds and self._clock() - by_clock > min(seconds, _BY_THE_CLOCK)


class Awaited(NamedTuple):
    """Something that an autopilot has to come to.

    field: its name.  seconds: within so many.  failed: what is said where it does not.
    """

    field: str
    seconds: float
    failed: str


class Conversation:
    """The conversation with one autopilot.

    link: to it.  now: its own time, s.  clock: anybody's, s.
    """

    def __init__(
        self, link: AutopilotLink, now: Callable[[], float], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._link, self._now, self._clock = link, now, clock
        self._news = link.news

    def _introduce(self, kind: str, wanted: dict[int, int], parameters: Iterable[str]) -> Talk:
        """Learn which of these parameters it has, and have it tell what is wanted; FlightError for no fixed wing.

        kind: what it should be, in words.  wanted: intervals in microseconds by the number of the message.
        """
        news = self._news
        heard = Awaited("heartbeat", SPEAKS, "said nothing over MAVLink")
        yield from self._until(lambda: news.vehicle is not None, heard, self._say_hello)
        if news.vehicle != mavlink.MAV_TYPE_FIXED_WING:
            raise FlightError(
                f"is no {kind}: its heartbeat says vehicle type {news.vehicle}; 1, a fixed wing, flies",
                field="vehicle type", value=news.vehicle, allowed="1, a fixed wing, flies",
            )  # fmt: skip
        for message, interval in wanted.items():
            self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message, interval)
        self._command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        self._command(mavlink.MAV_CMD_DO_SEND_BANNER)
        names = list(parameters)
        for k in range(0, len(names), _AT_ONCE):
            yield from self._ask_for(names[k : k + _AT_ONCE])

    def _knows_its_place(self, message: int, interval: int, lost: int = 0) -> Talk:
        """Wait until its estimator has a place.

        message: the number of the one that tells, every ``interval`` us.  lost: flags of one that has none.
        """
        news = self._news
        yield from self._until(
            lambda: news.ekf & _EKF_NEEDED == _EKF_NEEDED and not news.ekf & lost,
            Awaited("EKF", KNOWS, "did not come to know where it is (EKF)"),
            lambda: self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message, interval),
        )

    def _until(self, done: Callable[[], bool], awaited: Awaited, again: Callable[[], None] | None = None) -> Talk:
        """Wait until something holds, asking for it each second; raise FlightError where it does not come to."""
        started, asked = self._since(), None
        while not done():
            if started.longer_than(awaited.seconds):
                message = f"{awaited.failed} within {awaited.seconds:.0f} s{self._last_text()}"
                raise FlightError(message, field=awaited.field)
            if again is not None and (asked is None or asked.longer_than(AGAIN)):
                asked = self._since()
                again()
            yield

    def _since(self) -> _Since:
        return _Since(self._now, self._clock)

    def _last_text(self) -> str:
        return f"; it last said: {self._news.texts[-1]}" if self._news.texts else ""

    def _say_hello(self) -> None:
        self._link.send(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
            )
        )

    def _command(self, command: int, *params: float) -> None:
        numbers = [float(value) for value in (*params, *(0.0,) * (7 - len(params)))]
        self._link.send(mavlink.MAVLink_command_long_message(SYSTEM, COMPONENT, int(command), 0, *numbers))

    def _set_home(self, home: Home) -> None:
        place = MissionItem(0, int(Command.DO_SET_HOME), int(Frame.GLOBAL), (0.0,) * 4, home.lat_deg, home.lon_deg, 0.0)
        self._link.send(
            mavlink.MAVLink_command_int_message(
                SYSTEM, COMPONENT, int(Frame.GLOBAL), int(Command.DO_SET_HOME), 0, 0,
                0.0, 0.0, 0.0, 0.0, place.x, place.y, home.alt,
            )
        )  # fmt: skip

    def _obeys(self, command: int, ask: Callable[[], None], what: str) -> Talk:
        acknowledged = self._news.acknowledged
        acknowledged.pop(int(command), None)
        yield from self._until(
            lambda: acknowledged.get(int(command)) == mavlink.MAV_RESULT_ACCEPTED,
            Awaited(what, ANSWERS, f"refused {what} ({command_name(int(command))})"),
            ask,
        )

    def _ask_for(self, names: list[str]) -> Talk:
        """Read parameters; those that it does not have are not answered."""
        for name in names:
            self._link.send(mavlink.MAVLink_param_request_read_message(SYSTEM, COMPONENT, name.encode("ascii"), -1))
        started, known = self._since(), self._news.parameters
        while not (known.keys() >= set(names) or started.longer_than(AGAIN)):
            yield

    def _upload(self, items: list[MissionItem], kind: MissionType) -> Talk:
        """Hand over a list (MAVLink mission protocol), again while there is no space for it yet."""
        started = self._since()
        what = "mission" if kind == MissionType.MISSION else "rally points"
        while True:
            yield from self._offer(items, kind)
            result = self._news.mission_result
            if result == mavlink.MAV_MISSION_ACCEPTED:
                return
            if result != mavlink.MAV_MISSION_NO_SPACE or started.longer_than(TAKES):
                asked = self._news.requested
                item = (
                    ""
                    if asked is None or asked >= len(items)
                    else (f" at item {asked} ({command_name(items[asked].command)})")
                )
                name = "no answer" if result is None else _MISSION_RESULTS.get(result, str(result))
                message = f"refused the {what}{item}: {name}{self._last_text()}"
                raise FlightError(message, field=what, value=name)
            yield from self._wait(AGAIN)

    def _offer(self, items: list[MissionItem], kind: MissionType) -> Talk:
        """Count, then each item that is asked for, until the upload is acknowledged or nothing more comes."""
        news, link = self._news, self._link
        news.requested = news.mission_result = None
        link.send(mavlink.MAVLink_mission_count_message(SYSTEM, COMPONENT, len(items), kind))
        last, answered = None, self._since()
        while news.mission_result is None and not answered.longer_than(ANSWERS):
            if news.requested is not None and (news.requested != last or answered.longer_than(AGAIN)):
                last, answered = news.requested, self._since()
                if last < len(items):
                    link.send(to_message(items[last], target_component=COMPONENT, seq=last))
            yield

    def _wait(self, seconds: float) -> Talk:
        began = self._now()
        while self._now() - began < seconds:
            yield
