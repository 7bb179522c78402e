"""Exchange MAVLink messages with a SITL autopilot before the flight.

The aircraft is held on its rail meanwhile.

Each step of the conversation is a generator. When it is resumed, the autopilot's time has advanced, and the link has
processed the messages that arrived in between.
"""

import time
from collections.abc import Callable, Generator, Iterable
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.sitl.link import AutopilotLink
from flight.live.mission_server import MissionType, to_message
from flight.mission.items import Command, Frame, Home, MissionItem, command_name
from world.errors import FlightError

# Step of a conversation; it is resumed after each interval of the exchange, until it returns.
ConversationStep = Generator[None, None, None]

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
RETRY_INTERVAL_S = 1.0
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
    """Stopwatch of the autopilot's time and of real time, which starts when it is created."""

    def __init__(self, now: Callable[[], float], clock: Callable[[], float]) -> None:
        self._now, self._clock = now, clock
        self._start_times = now(), clock()

    def has_passed(self, seconds: float) -> bool:
        """Return True if more than ``seconds`` s of the autopilot's time have passed.

        In addition, ``seconds`` or `_MIN_REAL_TIME_S`, whichever is less, must have passed in real time.
        """
        start, clock_start = self._start_times
        return self._now() - start > seconds and self._clock() - clock_start > min(seconds, _MIN_REAL_TIME_S)


class Awaited(NamedTuple):
    """A state that an autopilot has to reach.

    field: name of the state in the fields of the error.
    timeout: s of the autopilot's time.
    failure_text: beginning of the error message after the timeout.
    """

    field: str
    timeout: float
    failure_text: str


class Conversation:
    """MAVLink conversation with one autopilot before its flight.

    link: connection to the autopilot.
    now: function for the autopilot's time, s.
    clock: function for real time, s.
    """

    def __init__(
        self, link: AutopilotLink, now: Callable[[], float], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._link, self._now, self._clock = link, now, clock
        self._reported = link.reported

    def _identify(self, title: str, message_intervals: dict[int, int], parameters: Iterable[str]) -> ConversationStep:
        """Wait for the autopilot's heartbeat, request periodic messages, and read parameters.

        title: name of the expected autopilot.
        message_intervals: interval of each requested message by its number, microseconds.
        parameters: names of the parameters to read; parameters that the autopilot does not have are skipped.

        Raises FlightError if no heartbeat arrives, or if its vehicle is not a fixed wing.
        """
        reported = self._reported
        awaited = Awaited("heartbeat", HEARTBEAT_TIMEOUT_S, "sent no heartbeat over MAVLink")
        yield from self._wait_until(lambda: reported.vehicle is not None, awaited, self._send_heartbeat)
        if reported.vehicle != mavlink.MAV_TYPE_FIXED_WING:
            raise FlightError(
                f"is not {title}: its heartbeat states vehicle type {reported.vehicle}; expected 1, a fixed wing",
                field="vehicle type",
                value=reported.vehicle,
                allowed="expected 1, a fixed wing",
            )
        for message, interval in message_intervals.items():
            self._send_command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message, interval)
        self._send_command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        self._send_command(mavlink.MAV_CMD_DO_SEND_BANNER)
        names = list(parameters)
        for first in range(0, len(names), _PARAMETERS_PER_REQUEST):
            # The wait is limited because the autopilot does not answer for a parameter that it lacks.
            requested = names[first : first + _PARAMETERS_PER_REQUEST]
            for name in requested:
                self._link.send(mavlink.MAVLink_param_request_read_message(SYSTEM, COMPONENT, name.encode("ascii"), -1))
            stopwatch, received = self._start_stopwatch(), self._reported.parameters
            while not (received.keys() >= set(requested) or stopwatch.has_passed(RETRY_INTERVAL_S)):
                yield

    def _wait_for_position(self, message: int, interval: int, excluding_flags: int = 0) -> ConversationStep:
        """Wait until the autopilot's estimator has a position. Raises FlightError after a timeout.

        message, interval: number of the message that reports the estimator's state, and its interval, microseconds.
        excluding_flags: flags that must not be set, because the estimator then has no position.
        """
        reported = self._reported
        yield from self._wait_until(
            lambda: reported.ekf & _REQUIRED_EKF_FLAGS == _REQUIRED_EKF_FLAGS and not reported.ekf & excluding_flags,
            Awaited("EKF", POSITION_TIMEOUT_S, "had no position estimate (EKF)"),
            lambda: self._send_command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message, interval),
        )

    def _wait_until(
        self, is_done: Callable[[], bool], awaited: Awaited, request: Callable[[], None] | None = None
    ) -> ConversationStep:
        """Wait until a condition is true, and meanwhile repeat a request every second.

        is_done: function that returns True once the condition is true.
        awaited: description of the condition, for the error, and its timeout.
        request: function that sends the request; None to wait only.

        Raises FlightError after the timeout.
        """
        stopwatch, last_request = self._start_stopwatch(), None
        while not is_done():
            if stopwatch.has_passed(awaited.timeout):
                message = f"{awaited.failure_text} within {awaited.timeout:.0f} s{self._last_status_text()}"
                raise FlightError(message, field=awaited.field)
            if request is not None and (last_request is None or last_request.has_passed(RETRY_INTERVAL_S)):
                last_request = self._start_stopwatch()
                request()
            yield

    def _start_stopwatch(self) -> _Stopwatch:
        """Return a stopwatch that starts now."""
        return _Stopwatch(self._now, self._clock)

    def _last_status_text(self) -> str:
        """Return the last status text of the autopilot as the end of a message; "" without one."""
        return f"; its last message: {self._reported.texts[-1]}" if self._reported.texts else ""

    def _send_heartbeat(self) -> None:
        """Send the heartbeat of a ground station."""
        self._link.send(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
            )
        )

    def _send_command(self, command: int, *params: float) -> None:
        """Send a command with up to seven parameters; missing parameters are 0."""
        numbers = [float(value) for value in (*params, *(0.0,) * (7 - len(params)))]
        self._link.send(mavlink.MAVLink_command_long_message(SYSTEM, COMPONENT, int(command), 0, *numbers))

    def _send_home(self, home: Home) -> None:
        """Send the command that sets home."""
        item = MissionItem(0, int(Command.DO_SET_HOME), int(Frame.GLOBAL), (0.0,) * 4, home.lat_deg, home.lon_deg, 0.0)
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
                item.x,
                item.y,
                home.alt,
            )
        )

    def _send_until_accepted(self, command: int, request: Callable[[], None], name: str) -> ConversationStep:
        """Send a command every second until the autopilot accepts it.

        request: function that sends the command.
        name: name of the command's effect, for messages.

        Raises FlightError after a timeout.
        """
        acknowledged = self._reported.acknowledged
        acknowledged.pop(int(command), None)
        yield from self._wait_until(
            lambda: acknowledged.get(int(command)) == mavlink.MAV_RESULT_ACCEPTED,
            Awaited(name, REPLY_TIMEOUT_S, f"did not accept {name} ({command_name(int(command))})"),
            request,
        )

    def _upload(self, items: list[MissionItem], mission_type: MissionType) -> ConversationStep:
        """Upload a mission or rally points (MAVLink mission protocol).

        Retry for up to `UPLOAD_TIMEOUT_S` while the autopilot reports that it has no space. Raises FlightError if the
        autopilot refuses the items or does not answer.
        """
        stopwatch = self._start_stopwatch()
        list_name = "mission" if mission_type == MissionType.MISSION else "rally points"
        while True:
            # Send the number of items and each item that is requested, until an acknowledgment or a timeout.
            reported, link = self._reported, self._link
            reported.requested = reported.mission_result = None
            link.send(mavlink.MAVLink_mission_count_message(SYSTEM, COMPONENT, len(items), mission_type))
            last_item, item_stopwatch = None, self._start_stopwatch()
            while reported.mission_result is None and not item_stopwatch.has_passed(REPLY_TIMEOUT_S):
                if reported.requested is not None and (
                    reported.requested != last_item or item_stopwatch.has_passed(RETRY_INTERVAL_S)
                ):
                    last_item, item_stopwatch = reported.requested, self._start_stopwatch()
                    if last_item < len(items):
                        link.send(to_message(items[last_item], target_component=COMPONENT, seq=last_item))
                yield
            result = self._reported.mission_result
            if result == mavlink.MAV_MISSION_ACCEPTED:
                return
            if result != mavlink.MAV_MISSION_NO_SPACE or stopwatch.has_passed(UPLOAD_TIMEOUT_S):
                requested_item = self._reported.requested
                item_text = (
                    ""
                    if requested_item is None or requested_item >= len(items)
                    else (f" at item {requested_item} ({command_name(items[requested_item].command)})")
                )
                result_name = "no answer" if result is None else _MISSION_RESULTS.get(result, str(result))
                message = f"refused the {list_name}{item_text}: {result_name}{self._last_status_text()}"
                raise FlightError(message, field=list_name, value=result_name)
            start = self._now()
            while self._now() - start < RETRY_INTERVAL_S:
                yield
