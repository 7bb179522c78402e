"""Answer a station's requests: commands, modes, parameters, messages and their rates.

Missions are answered by `flight.live.mission_server`.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.arming import ACCEPTED, DENIED, IN_PROGRESS, UNSUPPORTED, ArmingState, CommandResult
from flight.live.flight_process import LoiterCenter
from flight.live.link import Peer
from flight.live.telemetry import (
    INFO,
    LOITER,
    PERIODS,
    RTL,
    STREAMS,
    WARNING,
    Status,
    StatusText,
    telemetry_message,
)
from flight.mission.items import Command, Frame, MissionItem, is_located, item_problem
from world.errors import PlanflyError

# ----------------------------------------------------------------------
# The vehicle's parameters: readable by ground stations, and partly settable.

# Parameter that allows arming although the mission is judged not flyable.
FORCE = "PFLY_FORCE"
# Number of parameters sent per second to a station that requested all.
PARAMETERS_PER_SECOND = 200.0
_FIXED_REASON = "is fixed by the aircraft or the scenario"


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter; values are sent as float32.

    min_value, max_value: range that a station may set; max_value is None for a fixed parameter.
    fixed_reason: reason why the parameter is fixed.
    is_simulated: True for a parameter of the simulated autopilot, which may be set only on the ground; the mission is
        then judged again.
    """

    name: str
    value: float
    min_value: float = 0.0
    max_value: float | None = None
    fixed_reason: str = _FIXED_REASON
    is_simulated: bool = False


def _empty_parameters(_stated: Mapping[str, float]) -> Mapping[str, float]:
    """Return no parameters; stands for the parameters of a vehicle without a simulated autopilot."""
    return {}


@dataclass(slots=True)
class Parameters:
    """Parameters of the vehicle, by number and by name.

    autopilot_values: function that returns the simulated autopilot's parameters by name, with the values that stations
        have set. It raises PlanflyError if a value is not allowed.
    stated: values of the simulated autopilot's parameters that stations have set.
    """

    entries: list[Parameter]
    autopilot_values: Callable[[Mapping[str, float]], Mapping[str, float]] = _empty_parameters
    stated: dict[str, float] = field(default_factory=dict)
    _numbers: dict[str, int] = field(init=False)

    def __post_init__(self) -> None:
        """Index the names."""
        self._numbers = {entry.name: number for number, entry in enumerate(self.entries)}

    def __getitem__(self, name: str) -> float:
        """Return the value of a parameter.

        Raises KeyError for an unknown name.
        """
        return self.entries[self._numbers[name]].value

    def set_value(self, name: str, value: float) -> None:
        """Set the value of a parameter, without the checks for stations.

        Raises KeyError for an unknown name.
        """
        number = self._numbers[name]
        self.entries[number] = replace(self.entries[number], value=value)

    def message(self, number: int) -> Any:
        """Return the PARAM_VALUE message of a parameter, by its number."""
        entry = self.entries[number]
        return mavlink.MAVLink_param_value_message(
            entry.name.encode(), entry.value, mavlink.MAV_PARAM_TYPE_REAL32, len(self.entries), number
        )

    def find(self, name: bytes, number: int) -> int | None:
        """Return the number of the parameter that PARAM_REQUEST_READ names, or None if it is unknown.

        number: number that the message states; -1 to find the parameter by name.
        """
        if number >= 0:
            return number if number < len(self.entries) else None
        return self._numbers.get(_decode_name(name))

    def set(self, name: bytes, value: float, *, in_flight: bool = False) -> tuple[int | None, str]:
        """Set a parameter for a station, and return its number and the reason for a refusal.

        in_flight: True to refuse parameters of the simulated autopilot.

        The number is None for an unknown parameter. The reason is "" if the parameter was set.
        """
        number = self._numbers.get(_decode_name(name))
        if number is None:
            return None, f"{_decode_name(name)}: no such parameter"
        entry = self.entries[number]
        unchanged_text = f"the value stays {entry.value:g}"
        if entry.is_simulated:
            if in_flight:
                return (
                    number,
                    f"{entry.name} {value:g}: refused, because parameters are fixed during a flight; {unchanged_text}",
                )
            if not math.isfinite(value):
                return number, f"{entry.name} {value:g}: expected a finite number; {unchanged_text}"
            # MAVLink carries 0.7 as 0.699999988. The number that was typed is the shortest one with the same float32.
            stated_values = self.stated | {entry.name: float(str(np.float32(value)))}
            try:
                values = self.autopilot_values(stated_values)
            except PlanflyError as error:
                return number, f"{error}; {unchanged_text}"
            if values[entry.name] != stated_values[entry.name]:
                return number, f"{entry.name} {_FIXED_REASON}: {unchanged_text}"
            self.stated = stated_values
            for autopilot_name, autopilot_value in values.items():
                self.set_value(autopilot_name, autopilot_value)
            return number, ""
        if entry.max_value is None:
            return number, f"{entry.name} {entry.fixed_reason}: {unchanged_text}"
        if not (math.isfinite(value) and entry.min_value <= value <= entry.max_value):
            return number, f"{entry.name} {value:g}: allowed {entry.min_value:g}..{entry.max_value:g}; {unchanged_text}"
        self.set_value(entry.name, value)
        return number, ""


def vehicle_parameters(
    *,
    airspeed: float,
    min_airspeed: float,
    max_airspeed: float,
    max_bank_deg: float,
    system: int,
    speed: float,
    autopilot_values: Callable[[Mapping[str, float]], Mapping[str, float]] = _empty_parameters,
    not_simulated: Iterable[str] = (),
) -> Parameters:
    """Return the parameters of a vehicle and of its simulated autopilot, sorted by name.

    airspeed, min_airspeed, max_airspeed: m/s.
    max_bank_deg: degrees.
    system: the vehicle's MAVLink system id.
    speed: speed of the flight relative to real time.
    autopilot_values: function that returns the simulated autopilot's parameters by name, from the values that stations
        have set. They replace parameters of the vehicle with the same name.
    not_simulated: parameters that are read but not simulated; they cannot be set.

    >>> parameters = vehicle_parameters(
    ...     airspeed=25.0, min_airspeed=18.0, max_airspeed=31.0, max_bank_deg=30.0, system=1, speed=1.0,
    ...     autopilot_values=lambda stated: {"WP_RADIUS": 90.0, "TRIM_PITCH_CD": 2.0} | stated,
    ...     not_simulated=["TRIM_PITCH_CD"],
    ... )
    >>> parameters["AIRSPEED_CRUISE"]
    25.0
    >>> parameters.set(b"AIRSPEED_MAX", 99.0)
    (1, 'AIRSPEED_MAX is fixed by the aircraft or the scenario: the value stays 31')
    >>> parameters.set(b"WP_RADIUS", 70.0), parameters["WP_RADIUS"]
    ((13, ''), 70.0)
    >>> parameters.set(b"TRIM_PITCH_CD", 3.0)[1]
    'TRIM_PITCH_CD is read, but has no effect on a flight: the value stays 2'
    """
    vehicle_entries = [
        Parameter("AIRSPEED_CRUISE", airspeed),
        Parameter("AIRSPEED_MAX", max_airspeed),
        Parameter("AIRSPEED_MIN", min_airspeed),
        Parameter("ARMING_CHECK", 1.0),
        Parameter("ARMING_REQUIRE", 1.0),
        Parameter("FENCE_TOTAL", 0.0),
        Parameter("MIS_TOTAL", 0.0),
        Parameter(FORCE, 0.0, 0.0, 1.0),
        Parameter("RALLY_TOTAL", 0.0),
        Parameter("ROLL_LIMIT_DEG", max_bank_deg),
        Parameter("SIM_SPEEDUP", speed),
        Parameter("SYSID_THISMAV", float(system)),
    ]
    entries = {entry.name: entry for entry in vehicle_entries}
    unflown_names = set(not_simulated)
    for name, value in autopilot_values({}).items():
        entries[name] = Parameter(
            name, value, fixed_reason="is read, but has no effect on a flight", is_simulated=name not in unflown_names
        )
    return Parameters([entries[name] for name in sorted(entries)], autopilot_values)


def _decode_name(name: bytes | str) -> str:
    """Return a parameter's name from a MAVLink field of up to 16 characters, which may end with NUL."""
    data = name.encode("latin-1", "replace") if isinstance(name, str) else name
    return data.split(b"\0")[0].decode("ascii", "replace")[:16]


# INT32_MAX in a latitude or longitude: not set.
_UNSET_COORDINATE = 2**31 - 1
# Minimum interval between two messages of a kind, s.
_MIN_PERIOD_S = 0.02
# Maximum interval between two messages of a kind, s.
_MAX_PERIOD_S = 3600.0
# Number of arm commands that may wait for a verdict.
_MAX_WAITING_COMMANDS = 16


class PeerMessage(NamedTuple):
    """A MAVLink message for one station."""

    peer: Peer
    message: Any


# Response to a request; a text is for all stations.
Response = PeerMessage | StatusText


@dataclass(frozen=True, slots=True)
class _WaitingArmCommand:
    """An arm command that waits for the verdict.

    param1, param2: of MAV_CMD_COMPONENT_ARM_DISARM.
    """

    peer: Peer
    system: int
    component: int
    param1: float
    param2: float


@dataclass(slots=True)
class Requests:
    """Handler of requests: it returns messages for the requesting station, and texts for all stations.

    arming: state that commands about arming and modes change.
    parameters: parameters that stations read and set.
    status: state of the vehicle, for the telemetry that stations request.
    set_start_item: function that sets the item at which the next flight starts, by the station's number.
    """

    arming: ArmingState
    parameters: Parameters
    status: Status
    set_start_item: Callable[[int], CommandResult]
    _waiting_commands: list[_WaitingArmCommand] = field(default_factory=list)

    def handle(self, message: Any, peer: Peer, now: float) -> list[Response]:
        """Return the responses to a message; messages of other types have none."""
        match message.get_type():
            case "COMMAND_LONG" | "COMMAND_INT":
                return self._on_command(message, peer, now)
            case "SET_MODE":
                # SET_MODE is a message; ArduPilot acknowledges it as the command of its number.
                reply, command = self.arming.set_mode(int(message.custom_mode)), mavlink.MAVLINK_MSG_ID_SET_MODE
                return self._acknowledge(peer, message.get_srcSystem(), message.get_srcComponent(), command, reply)
            case "MISSION_SET_CURRENT":
                reply = self.set_start_item(int(message.seq))
                if reply.result == ACCEPTED:
                    return [PeerMessage(peer, telemetry_message("MISSION_CURRENT", self.status))]
                # MISSION_SET_CURRENT cannot be refused, and MAVSDK repeats it at each MISSION_CURRENT of another item,
                # without end. MAVSDK gives up if no MISSION_CURRENT arrives during its timeout. A MISSION_CURRENT that
                # was sent before the refusal still causes one repetition.
                peer.due["MISSION_CURRENT"] = now + _MISSION_CURRENT_PAUSE_S
                return [StatusText(reply.text, WARNING)]
            case "SET_POSITION_TARGET_GLOBAL_INT" | "SET_POSITION_TARGET_LOCAL_NED":
                return [StatusText(_NO_GUIDED_TARGET_TEXT, WARNING)]
            case "REQUEST_DATA_STREAM":
                rate = int(message.req_message_rate)
                period = min(_MAX_PERIOD_S, max(_MIN_PERIOD_S, 1.0 / rate)) if message.start_stop and rate else None
                for name in STREAMS.get(int(message.req_stream_id), ()):
                    peer.periods[name], peer.due[name] = period, now
            case "PARAM_REQUEST_LIST":
                # All parameters are sent, from the first one.
                peer.next_parameter = 0.0
            case "PARAM_REQUEST_READ":
                number = self.parameters.find(message.param_id, int(message.param_index))
                return [] if number is None else [PeerMessage(peer, self.parameters.message(number))]
            case "PARAM_SET":
                number, problem = self.parameters.set(
                    message.param_id, float(message.param_value), in_flight=self.arming.flying
                )
                # A new value of the parameter `FORCE` applies to the next arming.
                self.arming.force = self.parameters[FORCE] != 0.0
                replies: list[Response] = [StatusText(problem, WARNING)] if problem else []
                if number is not None:
                    replies.append(PeerMessage(peer, self.parameters.message(number)))
                return replies
            # A PING with a target and a TIMESYNC with tc1 are answers, which get no response.
            case "PING" if not (message.target_system or message.target_component):
                pong = mavlink.MAVLink_ping_message(
                    message.time_usec, message.seq, message.get_srcSystem(), message.get_srcComponent()
                )
                return [PeerMessage(peer, pong)]
            case "TIMESYNC" if message.tc1 == 0:
                return [PeerMessage(peer, mavlink.MAVLink_timesync_message(int(self.status.wall * 1e9), message.ts1))]
        return []

    def answer_waiting_arm_commands(self) -> list[Response]:
        """Return the responses to arm commands that have waited for the verdict."""
        waiting_commands, self._waiting_commands = self._waiting_commands, []
        replies: list[Response] = []
        for command in waiting_commands:
            reply = self.arming.arm(command.param1 == 1.0, command.param2)
            replies += self._acknowledge(command.peer, command.system, command.component, _ARM_COMMAND, reply)
        return replies

    def _on_command(self, message: Any, peer: Peer, now: float) -> list[Response]:
        """Run a command and acknowledge it; the acknowledgement of an arm command may wait for the verdict."""
        system, component = message.get_srcSystem(), message.get_srcComponent()
        number = int(message.command)
        if number == _ARM_COMMAND:
            reply = self.arming.arm(message.param1 == 1.0, message.param2)
            if reply.result == IN_PROGRESS:
                if len(self._waiting_commands) < _MAX_WAITING_COMMANDS:
                    self._waiting_commands.append(
                        _WaitingArmCommand(peer, system, component, message.param1, message.param2)
                    )
                else:
                    reply = CommandResult(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
            return self._acknowledge(peer, system, component, number, reply)
        messages: list[Any] = []
        if number in _MESSAGE_COMMANDS:
            reply, messages = self._run_message_command(number, message, peer, now)
        elif number == mavlink.MAV_CMD_DO_SET_MODE:
            reply = self.arming.set_mode(_to_integer(message.param2))
        elif number == mavlink.MAV_CMD_MISSION_START:
            reply = self.arming.start_mission()
        elif number == mavlink.MAV_CMD_DO_PAUSE_CONTINUE:
            reply = self.arming.pause_or_continue(message.param1 == 1)
        elif number in _MODE_COMMANDS:
            reply = self.arming.set_mode(_MODE_COMMANDS[number])
        elif number == mavlink.MAV_CMD_DO_REPOSITION:
            center = _parse_loiter_center(message)
            reply = CommandResult(DENIED, _INVALID_POSITION_TEXT) if center is None else self.arming.go_to(center)
        elif number == mavlink.MAV_CMD_DO_SET_MISSION_CURRENT:
            reply = self.set_start_item(_to_integer(message.param1))
        else:
            reply = CommandResult(UNSUPPORTED, _UNSUPPORTED_COMMAND_TEXTS.get(number, ""))
        return [
            *self._acknowledge(peer, system, component, number, reply),
            *(PeerMessage(peer, extra_message) for extra_message in messages),
        ]

    def _run_message_command(
        self, number: int, message: Any, peer: Peer, now: float
    ) -> tuple[CommandResult, list[Any]]:
        """Send a message once, or set or get its interval; return the result and the messages to send.

        number: MAV_CMD of the command.
        message: COMMAND_LONG or COMMAND_INT that carries the command.
        """
        implied_number = _MESSAGE_COMMANDS[number]
        requested_number = _to_integer(message.param1) if implied_number is None else implied_number
        message_class = mavlink.mavlink_map.get(requested_number)
        name = message_class.msgname if message_class is not None else ""
        if number == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            # In microseconds; negative to switch the message off, 0 for the default interval.
            interval = message.param2
            if name not in PERIODS:
                result = ACCEPTED if name == "HEARTBEAT" and interval in (0.0, 1e6) else UNSUPPORTED
            elif not math.isfinite(interval):
                result = DENIED
            elif interval < 0:
                result, peer.periods[name] = ACCEPTED, None
            else:
                period = min(_MAX_PERIOD_S, max(_MIN_PERIOD_S, interval / 1e6)) if interval else PERIODS[name]
                result, peer.periods[name], peer.due[name] = ACCEPTED, period, now
            return CommandResult(result), []
        if number == mavlink.MAV_CMD_GET_MESSAGE_INTERVAL:
            current_period = peer.periods.get(name)
            current_interval = -1 if current_period is None else round(current_period * 1e6)
            reply = mavlink.MAVLink_message_interval_message(requested_number & 0xFFFF, current_interval)
            return CommandResult(ACCEPTED), [reply]
        reply = telemetry_message(name, self.status)
        return (CommandResult(ACCEPTED), [reply]) if reply is not None else (CommandResult(UNSUPPORTED), [])

    @staticmethod
    def _acknowledge(peer: Peer, system: int, component: int, number: int, reply: CommandResult) -> list[Response]:
        """Return the COMMAND_ACK for a station, and the text of the reply, if any.

        system, component: MAVLink ids of the station.
        number: MAV_CMD of the acknowledged command.
        reply: result of the command and its text.
        """
        ack = mavlink.MAVLink_command_ack_message(number, reply.result, 0, 0, system, component)
        replies: list[Response] = [PeerMessage(peer, ack)]
        if reply.text:
            replies.append(StatusText(reply.text, INFO if reply.result in (ACCEPTED, IN_PROGRESS) else WARNING))
        return replies


def _parse_loiter_center(message: Any) -> LoiterCenter | None:
    """Return the loiter center in MAV_CMD_DO_REPOSITION, or None if it is invalid."""
    if message.get_type() == "COMMAND_INT":
        lat, lon = (math.nan if value == _UNSET_COORDINATE else value / 1e7 for value in (message.x, message.y))
        alt, frame = float(message.z), int(message.frame)
    else:
        lat, lon, alt = float(message.param5), float(message.param6), float(message.param7)
        frame = int(Frame.GLOBAL)
    radius = float(message.param3) if math.isfinite(message.param3) else 0.0
    # NaN stands for the aircraft's position.
    north, east, up = (0.0 if math.isnan(value) else value for value in (lat, lon, alt))
    item = MissionItem(0, int(Command.NAV_LOITER_TIME), frame, (0.0, 0.0, radius, 0.0), north, east, up)
    if not is_located(item.command, frame) or item_problem(item) is not None:
        return None
    return LoiterCenter(lat, lon, alt, frame, radius)


def _to_integer(value: float) -> int:
    """Return the integer in a command's float parameter, or -1 if it is not an integer."""
    return int(value) if math.isfinite(value) and 0 <= value < 2**24 else -1


# Time without MISSION_CURRENT after a refused MISSION_SET_CURRENT, s.
_MISSION_CURRENT_PAUSE_S = 3.0
# MAV_CMD_DO_ORBIT, which pymavlink 2.4.41 does not have.
_DO_ORBIT = 34
_NO_GUIDED_TARGET_TEXT = (
    "target refused: MAV_CMD_DO_REPOSITION, or a MISSION_ITEM_INT with current 2, sends the aircraft to a position"
)
_INVALID_POSITION_TEXT = "go-to denied: expected a latitude of -90..90, a longitude of -180..180 and a finite altitude"
# Commands that are equivalent to a mode.
_MODE_COMMANDS = {mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: RTL, mavlink.MAV_CMD_NAV_LOITER_UNLIM: LOITER}
# Commands that do not control this aircraft, with an alternative.
_UNSUPPORTED_COMMAND_TEXTS: dict[int, str] = {
    mavlink.MAV_CMD_DO_CHANGE_SPEED: "speed change refused: put DO_CHANGE_SPEED into the mission",
    _DO_ORBIT: "orbit refused: put a loiter into the mission",
    mavlink.MAV_CMD_DO_CHANGE_ALTITUDE: "altitude change refused: send a go-to with the altitude",
    mavlink.MAV_CMD_NAV_TAKEOFF: "take-off refused: put NAV_TAKEOFF into the mission and start it",
    mavlink.MAV_CMD_NAV_LAND: "landing refused: put NAV_LAND into the mission and start it",
    mavlink.MAV_CMD_DO_SET_HOME: "home refused: home is item 0 of the mission",
}
_ARM_COMMAND = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
# Commands about messages, with the number of the message if the command implies it.
_MESSAGE_COMMANDS: dict[int, int | None] = {
    mavlink.MAV_CMD_REQUEST_MESSAGE: None,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: None,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: None,
    mavlink.MAV_CMD_GET_HOME_POSITION: mavlink.MAVLINK_MSG_ID_HOME_POSITION,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
}
