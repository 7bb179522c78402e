"""Talk to a SITL autopilot before it flies, while the aircraft is held on its rail.

A conversation is a generator.  Each time it is resumed, the autopilot's time has advanced, and the link has received
the autopilot's new messages.
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

# MAVLink system id of the autopilot.
SYSTEM = 1
# MAVLink component id of the autopilot.
COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
# Timeout for the first heartbeat, s of the autopilot's time.
HEARTBEAT_TIMEOUT_S = 30.0
# Timeout for the position estimate, s of the autopilot's time.
POSITION_TIMEOUT_S = 60.0
# Timeout for a reply, s of the autopilot's time.
REPLY_TIMEOUT_S = 5.0
# Timeout for the upload of a mission, s of the autopilot's time.
UPLOAD_TIMEOUT_S = 30.0
# Interval between repeated requests, s of the autopilot's time.
AGAIN = 1.0
# Minimum wait by the clock, s: messages take real time, however fast the autopilot's time runs.
_MIN_REAL_TIME_S = 0.5
# Number of parameters in one request: ArduPilot queues no more than some twenty requests.
_PARAMETERS_PER_REQUEST = 10
_REQUIRED_EKF_FLAGS = (
    mavlink.ESTIMATOR_ATTITUDE
    | mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_POS_HORIZ_ABS
    | mavlink.ESTIMATOR_POS_VERT_ABS
)
_MISSION_RESULTS = {number: entry.name for number, entry in mavlink.enums["MAV_MISSION_RESULT"].items()}


class _Stopwatch:
    """Time since a given moment, both in the autopilot's time and by the clock."""

    def __init__(self, now: Callable[[], float], clock: Callable[[], float]) -> None:
        self._now, self._clock = now, clock
        self._moments = now(), clock()

    def longer_than(self, seconds: float) -> bool:
        """Return True if more than this time of the autopilot has passed, and enough time by the clock."""
        start, clock_start = self._moments
        return self._now() - start > seconds and self._clock() - clock_start > min(seconds, _MIN_REAL_TIME_S)


class Awaited(NamedTuple):
    """A state that an autopilot has to reach.

    field: name of the state.
    seconds: timeout, s.
    failed: message after the timeout.
    """

    field: str
    seconds: float
    failed: str


class Conversation:
    """The conversation with one autopilot.

    link: connection to the autopilot.
    now: function for the autopilot's time, s.
    clock: function for real time, s.
    """

    def __init__(
        self, link: AutopilotLink, now: Callable[[], float], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._link, self._now, self._clock = link, now, clock
        self._news = link.news

    def _identify(self, kind: str, message_intervals: dict[int, int], parameters: Iterable[str]) -> Talk:
        """Identify the autopilot, request messages, and read those of the given parameters that it has.

        kind: name of the expected autopilot.
        message_intervals: requested intervals, microseconds, by the number of the message.

        Raises FlightError if it is not a fixed wing.
        """
        news = self._news
        awaited = Awaited("heartbeat", HEARTBEAT_TIMEOUT_S, "said nothing over MAVLink")
        yield from self._wait_until(lambda: news.vehicle is not None, awaited, self._send_heartbeat)
        if news.vehicle != mavlink.MAV_TYPE_FIXED_WING:
            raise FlightError(
                f"is no {kind}: its heartbeat says vehicle type {news.vehicle}; expected 1, a fixed wing",
                field="vehicle type",
                value=news.vehicle,
                allowed="expected 1, a fixed wing",
            )
        for message, interval in message_intervals.items():
            self._send_command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message, interval)
        self._send_command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        self._send_command(mavlink.MAV_CMD_DO_SEND_BANNER)
        names = list(parameters)
        for first in range(0, len(names), _PARAMETERS_PER_REQUEST):
            yield from self._read_parameters(names[first : first + _PARAMETERS_PER_REQUEST])

    def _wait_for_position(self, message: int, interval: int, excluding_flags: int = 0) -> Talk:
        """Wait until its estimator has a position.

        message: number of the message that reports it, every ``interval`` us.
        excluding_flags: flags that exclude a position.
        """
        news = self._news
        yield from self._wait_until(
            lambda: news.ekf & _REQUIRED_EKF_FLAGS == _REQUIRED_EKF_FLAGS and not news.ekf & excluding_flags,
            Awaited("EKF", POSITION_TIMEOUT_S, "did not find its position (EKF)"),
            lambda: self._send_command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message, interval),
        )

    def _wait_until(
        self, is_done: Callable[[], bool], awaited: Awaited, request: Callable[[], None] | None = None
    ) -> Talk:
        """Wait until a condition holds, repeating a request each second. Raises FlightError after a timeout."""
        stopwatch, last_request = self._start_stopwatch(), None
        while not is_done():
            if stopwatch.longer_than(awaited.seconds):
                message = f"{awaited.failed} within {awaited.seconds:.0f} s{self._last_status_text()}"
                raise FlightError(message, field=awaited.field)
            if request is not None and (last_request is None or last_request.longer_than(AGAIN)):
                last_request = self._start_stopwatch()
                request()
            yield

    def _start_stopwatch(self) -> _Stopwatch:
        return _Stopwatch(self._now, self._clock)

    def _last_status_text(self) -> str:
        return f"; it last said: {self._news.texts[-1]}" if self._news.texts else ""

    def _send_heartbeat(self) -> None:
        self._link.send(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
            )
        )

    def _send_command(self, command: int, *params: float) -> None:
        numbers = [float(value) for value in (*params, *(0.0,) * (7 - len(params)))]
        self._link.send(mavlink.MAVLink_command_long_message(SYSTEM, COMPONENT, int(command), 0, *numbers))

    def _set_home(self, home: Home) -> None:
        place = MissionItem(0, int(Command.DO_SET_HOME), int(Frame.GLOBAL), (0.0,) * 4, home.lat_deg, home.lon_deg, 0.0)
        self._link.send(
            mavlink.MAVLink_command_int_message(
                SYSTEM,
                COMPONENT,
                int(Frame.GLOBAL),
                int(Command.DO_SET_HOME),
                0,
                0,
                0.0,
                0.0,
                0.0,
                0.0,
                place.x,
                place.y,
                home.alt,
            )
        )

    def _send_until_accepted(self, command: int, request: Callable[[], None], name: str) -> Talk:
        acknowledged = self._news.acknowledged
        acknowledged.pop(int(command), None)
        yield from self._wait_until(
            lambda: acknowledged.get(int(command)) == mavlink.MAV_RESULT_ACCEPTED,
            Awaited(name, REPLY_TIMEOUT_S, f"refused {name} ({command_name(int(command))})"),
            request,
        )

    def _read_parameters(self, names: list[str]) -> Talk:
        """Read parameters; the autopilot does not answer for parameters that it does not have."""
        for name in names:
            self._link.send(mavlink.MAVLink_param_request_read_message(SYSTEM, COMPONENT, name.encode("ascii"), -1))
        stopwatch, parameters = self._start_stopwatch(), self._news.parameters
        while not (parameters.keys() >= set(names) or stopwatch.longer_than(AGAIN)):
            yield

    def _upload(self, items: list[MissionItem], kind: MissionType) -> Talk:
        """Upload a list (MAVLink mission protocol), and retry while the autopilot has no space for it yet."""
        stopwatch = self._start_stopwatch()
        list_name = "mission" if kind == MissionType.MISSION else "rally points"
        while True:
            yield from self._send_items(items, kind)
            result = self._news.mission_result
            if result == mavlink.MAV_MISSION_ACCEPTED:
                return
            if result != mavlink.MAV_MISSION_NO_SPACE or stopwatch.longer_than(UPLOAD_TIMEOUT_S):
                requested_item = self._news.requested
                item_text = (
                    ""
                    if requested_item is None or requested_item >= len(items)
                    else (f" at item {requested_item} ({command_name(items[requested_item].command)})")
                )
                result_name = "no answer" if result is None else _MISSION_RESULTS.get(result, str(result))
                message = f"refused the {list_name}{item_text}: {result_name}{self._last_status_text()}"
                raise FlightError(message, field=list_name, value=result_name)
            yield from self._wait(AGAIN)

    def _send_items(self, items: list[MissionItem], kind: MissionType) -> Talk:
        """Send the number of items and each requested item, until an acknowledgment or a timeout."""
        news, link = self._news, self._link
        news.requested = news.mission_result = None
        link.send(mavlink.MAVLink_mission_count_message(SYSTEM, COMPONENT, len(items), kind))
        last_item, stopwatch = None, self._start_stopwatch()
        while news.mission_result is None and not stopwatch.longer_than(REPLY_TIMEOUT_S):
            if news.requested is not None and (news.requested != last_item or stopwatch.longer_than(AGAIN)):
                last_item, stopwatch = news.requested, self._start_stopwatch()
                if last_item < len(items):
                    link.send(to_message(items[last_item], target_component=COMPONENT, seq=last_item))
            yield

    def _wait(self, seconds: float) -> Talk:
        start = self._now()
        while self._now() - start < seconds:
            yield
