"""Control arming, modes and start of the vehicle by ground stations.

This is a state machine without a clock.
"""

from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.flight_process import LoiterCenter, MissionJudged
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

# Values of param2 of MAV_CMD_COMPONENT_ARM_DISARM for a forced command: MAVLink's, and MAVProxy's for arming.
_FORCE_VALUES = (21196, 2989)
# Result of an accepted command.
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
# Result of a denied command.
DENIED = mavlink.MAV_RESULT_DENIED
# Result of a command that must be repeated.
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
    is_judging: True while a verdict on the mission is awaited.
    last_verdict: last verdict on the mission; None without a mission.
    force: True if the parameter PFLY_FORCE allows a flight against the verdict.
    end_requested: True if the flight must end.
    loiter_center: loiter center of a requested diversion; None if no diversion is requested.
    mission_state: MISSION_STATE of MISSION_CURRENT.
    """

    mode: int = MANUAL
    armed: bool = False
    flying: bool = False
    is_judging: bool = False
    last_verdict: MissionJudged | None = None
    force: bool = False
    end_requested: bool = False
    loiter_center: LoiterCenter | None = None
    mission_state: int = NO_MISSION

    @property
    def can_arm(self) -> bool:
        """True if the vehicle would accept arming now."""
        return not self.is_judging and not self._arming_refusal(False)

    @property
    def should_start(self) -> bool:
        """True if the flight must start, because the vehicle is armed and in AUTO, and its mission is judged."""
        return (
            self.armed
            and self.mode == AUTO
            and not self.flying
            and not self.is_judging
            and self.last_verdict is not None
        )

    def arm(self, should_arm: bool, param2: float) -> CommandResult:
        """Arm or disarm the vehicle (MAV_CMD_COMPONENT_ARM_DISARM), or refuse the command.

        should_arm: True to arm, False to disarm.
        param2: second parameter of the command; the values in `_FORCE_VALUES` force the command.

        The result is IN_PROGRESS while the verdict on the mission is awaited; the command must then be repeated.
        """
        is_forced = param2 in _FORCE_VALUES
        if not should_arm:
            if self.flying and not is_forced:
                return CommandResult(
                    DENIED,
                    "disarm denied in flight: a forced disarm (param2 21196; MAVProxy: disarm force) ends the flight",
                )
            self.end_requested = self.flying
            self.armed = False
            return CommandResult(ACCEPTED)
        if self.armed:
            return CommandResult(ACCEPTED)
        if self.is_judging:
            return CommandResult(IN_PROGRESS)
        reason = self._arming_refusal(is_forced)
        if reason:
            return CommandResult(DENIED, f"arming denied: {reason}")
        self.armed = True
        if self.mode == AUTO:
            return CommandResult(ACCEPTED)
        return CommandResult(
            ACCEPTED, "armed: AUTO starts the mission" if self.last_verdict else "armed: no mission yet"
        )

    def set_mode(self, mode: int) -> CommandResult:
        """Change the mode to one of ArduPlane's modes, or deny it.

        Denied are modes that this vehicle lacks, RTL and GUIDED on the ground, MANUAL in flight, and AUTO without a
        mission.
        """
        if mode not in MODE_NAMES:
            plane_mode = mavlink.enums["PLANE_MODE"].get(mode)
            name = plane_mode.name.removeprefix("PLANE_MODE_") if plane_mode else f"mode {mode}"
            return CommandResult(DENIED, f"{name} denied: this vehicle has {', '.join(MODE_NAMES.values())}")
        if self.flying:
            return self._change_flight_mode(mode)
        if mode in (RTL, GUIDED):
            return CommandResult(DENIED, f"{MODE_NAMES[mode]} denied: not in flight")
        if mode == AUTO and self.last_verdict is None and not self.is_judging:
            return CommandResult(DENIED, "AUTO denied: no mission")
        self.mode = mode
        return CommandResult(ACCEPTED, "AUTO: arming starts the mission" if mode == AUTO and not self.armed else "")

    def start_mission(self) -> CommandResult:
        """Start the mission (MAV_CMD_MISSION_START) by a change to AUTO; denied if the vehicle is not armed."""
        if not self.armed:
            return CommandResult(DENIED, "start denied: not armed")
        return self.set_mode(AUTO)

    def pause_or_continue(self, should_continue: bool) -> CommandResult:
        """Loiter at the aircraft's position, or continue the mission (MAV_CMD_DO_PAUSE_CONTINUE)."""
        if self.flying:
            return self._change_flight_mode(AUTO if should_continue else LOITER)
        return CommandResult(ACCEPTED) if should_continue else CommandResult(DENIED, "pause denied: not in flight")

    def go_to(self, center: LoiterCenter) -> CommandResult:
        """Request a flight in mode GUIDED to a loiter around a center; denied on the ground."""
        if not self.flying:
            return CommandResult(DENIED, "go-to denied: not in flight")
        self.mode, self.loiter_center = GUIDED, center
        self.mission_state = PAUSED
        return CommandResult(ACCEPTED)

    def continue_from_current_item(self) -> None:
        """Request that the flight continue at the mission's current item, which a station has just changed.

        The request is made by setting `loiter_center`; the vehicle then diverts the flight. In AUTO the center's values
        are not used.
        """
        self.loiter_center = LoiterCenter()

    def set_flight_mode(self, mode: int) -> None:
        """Set the mode of a flight; the mission is active in AUTO, and paused in any other mode."""
        self.mode = mode
        self.mission_state = ACTIVE if mode == AUTO else PAUSED

    def _change_flight_mode(self, mode: int) -> CommandResult:
        """Continue the flight in another mode, without the position of an earlier go-to.

        MANUAL is denied, because there is no pilot. The current mode is accepted and changes nothing.
        """
        if mode == MANUAL:
            return CommandResult(DENIED, "MANUAL denied: no pilot has the sticks; a forced disarm ends the flight")
        if mode != self.mode:
            self.set_flight_mode(mode)
            self.loiter_center = LoiterCenter()
        return CommandResult(ACCEPTED)

    def on_mission_uploaded(self) -> None:
        """Record that a mission was uploaded whose verdict is awaited."""
        self.is_judging, self.mission_state = True, NOT_STARTED

    def on_mission_judged(self, verdict: MissionJudged) -> str:
        """Store the verdict on a mission; disarm the vehicle if the verdict allows no flight.

        Returns the reason for disarming, or "" if the vehicle was not disarmed.
        """
        self.is_judging = False
        self.last_verdict = verdict
        self.mission_state = NOT_STARTED
        reason = self._arming_refusal(False)
        if self.armed and reason:
            self.armed = False
            return f"disarmed: {reason}"
        return ""

    def on_mission_cleared(self) -> None:
        """Discard the mission's verdict, and leave AUTO."""
        self.is_judging, self.last_verdict, self.mission_state = False, None, NO_MISSION
        if self.mode == AUTO:
            self.mode = MANUAL

    def on_flight_started(self) -> None:
        """Record that the flight has started."""
        self.flying, self.mission_state = True, ACTIVE

    def on_flight_ended(self, is_completed: bool) -> None:
        """Disarm the vehicle after its flight, ready to fly again.

        is_completed: True if the route was flown to its end; in AUTO the mission is then complete.
        """
        self.flying = self.armed = self.end_requested = False
        self.mission_state = COMPLETE if is_completed and self.mode == AUTO else NOT_STARTED
        self.mode, self.loiter_center = MANUAL, None

    def _arming_refusal(self, is_forced: bool) -> str:
        """Return the reason to refuse arming because of the last verdict, or "" to allow it.

        is_forced: True to allow a mission that is judged not flyable.
        """
        if self.last_verdict is None:
            return ""
        if not self.last_verdict.possible:
            return "the mission cannot be flown"
        if not (self.last_verdict.flyable or self.force or is_forced):
            return "the mission is judged not flyable; set PFLY_FORCE 1 to fly it anyway"
        return ""


__all__ = ["ACCEPTED", "DENIED", "IN_PROGRESS", "LOITER", "UNSUPPORTED", "ArmingState", "CommandResult"]
