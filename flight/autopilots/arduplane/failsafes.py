"""List the causes that end ArduPlane's mission, and its reactions according to its parameters.

Read from ArduPlane's sources, not triggered: `Plane::rc_failsafe_short_on_event`, `failsafe_long_on_event` and
`handle_battery_failsafe` in ArduPlane/events.cpp, `Plane::fence_check` in fence.cpp; AP_BattMonitor for the thresholds.
"""

from typing import Literal, NamedTuple

from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.parts import BatteryFailsafe

# Reaction of ArduPlane.  "return": RTL; "land": the mission's landing sequence; "autoland": mode AUTOLAND, or else RTL;
# "on": it continues the mission; "landed": it is on the ground; "never": nothing can trigger the cause; the others do
# not lead home.
FailsafeAction = Literal[
    "return",
    "land",
    "autoland",
    "on",
    "circle",
    "glide",
    "parachute",
    "terminate",
    "level",
    "guided",
    "landed",
    "never",
]


class Cause(NamedTuple):
    """A possible cause of leaving the mission.

    name: name for people.
    does: ArduPlane's reaction.
    parameter, value: the parameter that decides the reaction, and its value; "" if no parameter decides.
    """

    name: str
    does: FailsafeAction
    parameter: str = ""
    value: int = 0

    @property
    def returns(self) -> bool:
        """True if it flies an RTL; a landing is not an RTL."""
        return self.does == "return"


_LONG_FAILSAFE: dict[int, FailsafeAction] = {0: "on", 1: "return", 2: "glide", 3: "parachute", 4: "on", 5: "autoland"}
# FBWA without a pilot: wings level, nose level, throttle at its minimum.
_SHORT_FAILSAFE: dict[int, FailsafeAction] = {0: "on", 1: "circle", 2: "glide", 3: "on", 4: "level"}
# Without a quadplane's rotors a landing on them (4, 6) is the same as 2.
_BATTERY_FAILSAFE: dict[int, FailsafeAction] = {
    0: "on",
    1: "return",
    2: "land",
    3: "terminate",
    4: "land",
    5: "parachute",
    6: "land",
    7: "autoland",
}
_FENCE_REACTION: dict[int, FailsafeAction] = {0: "on", 1: "return", 6: "guided", 7: "guided", 8: "autoland"}


def failsafe_causes(
    parameters: ArduPilotParameters, *, has_fence: bool, has_landing: bool = False, ends_landed: bool = False
) -> tuple[Cause, ...]:
    """Return the causes that can end a mission in AUTO, in the order of interest to pilots.

    has_fence: True if the mission carries a fence.
    has_landing: True if it has a landing sequence; without one a landing is an RTL.
    ends_landed: True if it ends on the ground.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> made = ArduPilotParameters.defaults().changed(FS_LONG_ACTN=1, BATT_FS_LOW_ACT=1, BATT_LOW_VOLT=14)
    >>> for cause in failsafe_causes(made, has_fence=False):
    ...     print(cause.name, cause.parameter, cause.value, cause.does)
    the pilot's RTL  0 return
    the mission's end  0 return
    RC lost FS_LONG_ACTN 1 return
    station lost FS_GCS_ENABL 0 on
    battery low BATT_FS_LOW_ACT 1 return
    battery critical BATT_FS_CRT_ACT 0 on
    """
    long_action = int(parameters.long_failsafe)
    causes = [Cause("the pilot's RTL", "return"), Cause("the mission's end", "landed" if ends_landed else "return")]
    short_action = int(parameters.short_failsafe)
    # THR_FAILSAFE 2 notices the loss, and starts no failsafe.
    detects_loss = parameters.throttle_failsafe == 1.0
    leaves_auto = _SHORT_FAILSAFE.get(short_action, "on") != "on" and detects_loss
    if leaves_auto:
        causes.append(Cause("RC lost for 1.5 s", _SHORT_FAILSAFE[short_action], "FS_SHORT_ACTN", short_action))
    if leaves_auto and long_action == 0:
        # It is no longer in AUTO, and from any other mode FS_LONG_ACTN 0 is an RTL.
        causes.append(Cause("RC lost", "return", "FS_SHORT_ACTN", short_action))
    elif detects_loss:
        causes.append(Cause("RC lost", _LONG_FAILSAFE.get(long_action, "on"), "FS_LONG_ACTN", long_action))
    else:
        causes.append(Cause("RC lost", "on", "THR_FAILSAFE", int(parameters.throttle_failsafe)))
    if parameters.station_failsafe > 0.0:
        causes.append(Cause("station lost", _LONG_FAILSAFE.get(long_action, "on"), "FS_LONG_ACTN", long_action))
    else:
        causes.append(Cause("station lost", "on", "FS_GCS_ENABL", 0))
    causes += _battery_causes(parameters, has_landing=has_landing)
    if has_fence:
        action = int(parameters.fence_action)
        if parameters.fence_enable > 0.0 or parameters.fence_auto_enable > 0.0:
            causes.append(Cause("fence broken", _FENCE_REACTION.get(action, "on"), "FENCE_ACTION", action))
        else:
            causes.append(Cause("fence broken", "on", "FENCE_ENABLE", 0))
    return tuple(causes)


def _battery_causes(parameters: ArduPilotParameters, *, has_landing: bool) -> list[Cause]:
    """Return the reactions to a low and a critical battery.

    Nothing triggers them without a monitor or without a threshold.  The default of BATT_MONITOR depends on the board,
    so a file that does not state it is taken to have a monitor.
    """
    is_unstated = "BATT_MONITOR" in parameters.by_origin("default")
    is_monitored = is_unstated or parameters.battery_monitor > 0.0
    has_low_threshold = parameters.low_voltage > 0.0 or parameters.low_charge > 0.0
    has_critical_threshold = parameters.critical_voltage > 0.0 or parameters.critical_charge > 0.0
    causes = []
    for name, value, parameter, has_threshold in (
        ("battery low", parameters.low_battery, "BATT_FS_LOW_ACT", has_low_threshold),
        ("battery critical", parameters.critical_battery, "BATT_FS_CRT_ACT", has_critical_threshold),
    ):
        action = _BATTERY_FAILSAFE.get(int(value), "on")
        if action == "land" and not has_landing:
            action = "return"
        if action != "on" and not (is_monitored and has_threshold):
            action = "never"
        causes.append(Cause(name, action, parameter, int(value)))
    return causes


def battery_failsafes(parameters: ArduPilotParameters) -> tuple[BatteryFailsafe, ...]:
    r"""Return the failsafes that leave a mission at a charge or a voltage (`AP_BattMonitor_Params`).

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> made = ArduPilotParameters.of_text("BATT_CAPACITY 8000\nBATT_LOW_MAH 1500\nBATT_FS_LOW_ACT 1\n", "mine.param")
    >>> battery_failsafes(made)
    (BatteryFailsafe(parameter='BATT_LOW_MAH', threshold=1500.0, used_charge=6500.0),)
    """
    if parameters.battery_monitor <= 0.0 and "BATT_MONITOR" not in parameters.by_origin("default"):
        return ()
    found = []
    for action, level, voltage, charge in (
        (parameters.low_battery, "LOW", parameters.low_voltage, parameters.low_charge),
        (parameters.critical_battery, "CRT", parameters.critical_voltage, parameters.critical_charge),
    ):
        if _BATTERY_FAILSAFE.get(int(action), "on") == "on":
            continue
        if charge > 0.0:
            found.append(BatteryFailsafe(f"BATT_{level}_MAH", charge, parameters["BATT_CAPACITY"] - charge))
        if voltage > 0.0:
            found.append(BatteryFailsafe(f"BATT_{level}_VOLT", voltage))
    return tuple(found)
