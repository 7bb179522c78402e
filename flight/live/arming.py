"""Control arming, modes and start of the vehicle by ground stations, as a state machine without a clock."""

from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.flight_process import MissionJudged, Place
from flight.live.telemetry import (
    ACTIVE,
    AUTO,
    COMPLETE,
    GUIDED,
    LOITER,
    MANUAL,
    MODE_NAMES,
    NO_MISSION,
    NOT_STARTED,
    PAUSED,
    RTL,
)

# Values of param2 of MAV_CMD_COMPONENT_ARM_DISARM that force it: MAVLink's number, and MAVProxy's number for arming.
_FORCE_VALUES = (21196, 2989)
# Result of an accepted command.
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
# Result of a denied command.
DENIED = mavlink.MAV_RESULT_DENIED
# Result of a command that is to be repeated.
IN_PROGRESS = mavlink.MAV_RESULT_IN_PROGRESS
# Result of an unknown command.
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED


@dataclass(frozen=True, slots=True)
class CommandResult:
    """MAV_RESULT of a command, and a text for the stations ("" for no text)."""

    result: int
    text: str = ""


@dataclass(slots=True)
class ArmingState:
    """The vehicle's state for its commands.

    mode: ArduPlane's number.
    judging: True while a verdict on the mission is awaited.
    judged: the last verdict; None without a mission.
    force: PFLY_FORCE.
    end_requested: True if the flight is to be ended.
    place: target of the current flight's diversion in its new mode; None for no diversion.
    mission_state: MISSION_STATE of MISSION_CURRENT.
    """

    mode: int = MANUAL
    armed: bool = False
    flying: bool = False
    judging: bool = False
    judged: MissionJudged | None = None
    force: bool = False
    end_requested: bool = False
    place: Place | None = None
    mission_state: int = NO_MISSION

    @property
    def armable(self) -> bool:
        """True if arming would be accepted now."""
        return not self.judging and not self._arming_refusal(False)

    @property
    def starts(self) -> bool:
        """True if the flight is to be started: armed, in AUTO, and judged."""
        return self.armed and self.mode == AUTO and not self.flying and not self.judging and self.judged is not None

    def arm(self, should_arm: bool, param2: float) -> CommandResult:
        """Arm or disarm (MAV_CMD_COMPONENT_ARM_DISARM).

        IN_PROGRESS: repeat the command after the verdict.
        """
        is_forced = param2 in _FORCE_VALUES
        if not should_arm:
            if self.flying and not is_forced:
                return CommandResult(
                    DENIED, "in flight: a forced disarm (param2 21196; MAVProxy: disarm force) ends the flight"
                )
            self.end_requested = self.flying
            self.armed = False
            return CommandResult(ACCEPTED)
        if self.armed:
            return CommandResult(ACCEPTED)
        if self.judging:
            return CommandResult(IN_PROGRESS)
        reason = self._arming_refusal(is_forced)
        if reason:
            return CommandResult(DENIED, f"arming denied: {reason}")
        self.armed = True
        if self.mode == AUTO:
            return CommandResult(ACCEPTED)
        return CommandResult(ACCEPTED, "armed: AUTO starts the mission" if self.judged else "armed: no mission yet")

    def set_mode(self, mode: int) -> CommandResult:
        """Change to one of ArduPlane's modes."""
        if mode not in MODE_NAMES:
            plane_mode = mavlink.enums["PLANE_MODE"].get(mode)
            name = plane_mode.name.removeprefix("PLANE_MODE_") if plane_mode else f"mode {mode}"
            return CommandResult(DENIED, f"{name} denied: this vehicle has {', '.join(MODE_NAMES.values())}")
        if self.flying:
            return self._divert(mode)
        if mode in (RTL, GUIDED):
            return CommandResult(DENIED, f"{MODE_NAMES[mode]} denied: not in flight")
        if mode == AUTO and self.judged is None and not self.judging:
            return CommandResult(DENIED, "AUTO denied: no mission")
        self.mode = mode
        return CommandResult(ACCEPTED, "AUTO: arming starts the mission" if mode == AUTO and not self.armed else "")

    def start(self) -> CommandResult:
        """Start the mission (MAV_CMD_MISSION_START)."""
        if not self.armed:
            return CommandResult(DENIED, "start denied: not armed")
        return self.set_mode(AUTO)

    def pause(self, should_continue: bool) -> CommandResult:
        """Loiter at the aircraft's position, or continue the mission (MAV_CMD_DO_PAUSE_CONTINUE)."""
        if self.flying:
            return self._divert(AUTO if should_continue else LOITER)
        return CommandResult(ACCEPTED) if should_continue else CommandResult(DENIED, "pause denied: not in flight")

    def go_to(self, place: Place) -> CommandResult:
        """Fly to a place and loiter there, in GUIDED."""
        if not self.flying:
            return CommandResult(DENIED, "go-to denied: not in flight")
        self.mode, self.place = GUIDED, place
        self.mission_state = PAUSED
        return CommandResult(ACCEPTED)

    def restart_mission(self) -> None:
        """Continue the mission from the item that was set in flight."""
        self.place = Place()

    def diverted(self, mode: int) -> None:
        """Store that the flight is in this mode now."""
        self.mode = mode
        self.mission_state = ACTIVE if mode == AUTO else PAUSED

    def _divert(self, mode: int) -> CommandResult:
        """Continue the flight in another mode; nothing changes if it is the current mode."""
        if mode == MANUAL:
            return CommandResult(DENIED, "MANUAL denied: no pilot has the sticks; a forced disarm ends the flight")
        if mode != self.mode:
            self.diverted(mode)
            self.place = Place()
        return CommandResult(ACCEPTED)

    def mission_uploaded(self) -> None:
        """Store that a mission was uploaded and is being judged."""
        self.judging, self.mission_state = True, NOT_STARTED

    def mission_judged(self, judged: MissionJudged) -> str:
        """Store a verdict, and return the reason why the vehicle was disarmed, or "" if it was not disarmed."""
        self.judging = False
        self.judged = judged
        self.mission_state = NOT_STARTED
        reason = self._arming_refusal(False)
        if self.armed and reason:
            self.armed = False
            return f"disarmed: {reason}"
        return ""

    def mission_cleared(self) -> None:
        """Store that the mission was cleared."""
        self.judging, self.judged, self.mission_state = False, None, NO_MISSION
        if self.mode == AUTO:
            self.mode = MANUAL

    def flight_started(self) -> None:
        """Store that the flight has started."""
        self.flying, self.mission_state = True, ACTIVE

    def flight_ended(self, completed: bool) -> None:
        """Store that the flight is over; the vehicle is then disarmed and ready to fly again."""
        self.flying = self.armed = self.end_requested = False
        self.mission_state = COMPLETE if completed and self.mode == AUTO else NOT_STARTED
        self.mode, self.place = MANUAL, None

    def _arming_refusal(self, is_forced: bool) -> str:
        if self.judged is None:
            return ""
        if not self.judged.possible:
            return "the mission cannot be flown"
        if not (self.judged.flyable or self.force or is_forced):
            return "the mission is judged not flyable; set PFLY_FORCE 1 to fly it anyway"
        return ""


__all__ = ["ACCEPTED", "DENIED", "IN_PROGRESS", "LOITER", "UNSUPPORTED", "ArmingState", "CommandResult"]
