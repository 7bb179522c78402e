"""List the events that can end a mission of ArduPlane, and ArduPlane's reaction to each.

The reactions depend on ArduPlane's parameters.

Read from ArduPlane's sources, not triggered: `Plane::rc_failsafe_short_on_event`, `failsafe_long_on_event` and
`handle_battery_failsafe` in ArduPlane/events.cpp, `Plane::fence_check` in fence.cpp; AP_BattMonitor for the thresholds.
"""

import math

from flight.autopilots.arduplane.parameters import OTHER_BATTERY_MONITORS, ArduPilotParameters
from flight.autopilots.parts import BatteryFailsafe, Cause, FailsafeAction, LinkLossReaction
from world.scenario_tables import LinkUse

_LONG_FAILSAFE: dict[int, FailsafeAction] = {0: "on", 1: "return", 2: "glide", 3: "parachute", 4: "on", 5: "autoland"}
# FBWA without a pilot: wings level, nose level, throttle at its minimum.
_SHORT_FAILSAFE: dict[int, FailsafeAction] = {0: "on", 1: "circle", 2: "glide", 3: "on", 4: "level"}
# Without a quadplane's rotors the vertical landings 4 and 6 are the same as 2.
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
# Values of BATT_MONITOR that measure only the voltage: an analog monitor, and the Bebop's monitor (`has_current`).
_MONITORS_WITHOUT_CURRENT = (3, 6)
# FS_SHORT_ACTN that starts no short failsafe.
_NO_SHORT_FAILSAFE = 3
_FENCE_REACTION: dict[int, FailsafeAction] = {0: "on", 1: "return", 6: "guided", 7: "guided", 8: "autoland"}


def failsafe_causes(
    parameters: ArduPilotParameters,
    *,
    has_fence: bool,
    has_landing_sequence: bool = False,
    ends_with_landing: bool = False,
) -> tuple[Cause, ...]:
    """Return the events that can end a mission in AUTO, each as a `Cause` with ArduPlane's reaction.

    The order is fixed.

    has_fence: True if the mission carries a fence.
    has_landing_sequence: True if the mission has a landing sequence; without one the reaction "land" is an RTL.
    ends_with_landing: True if the mission contains a landing item, so that it ends on the ground.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> parameters = ArduPilotParameters.defaults().changed(FS_LONG_ACTN=1, BATT_FS_LOW_ACT=1, BATT_LOW_VOLT=14)
    >>> for cause in failsafe_causes(parameters, has_fence=False):
    ...     print(cause.name, cause.parameter, cause.value, cause.action)
    the pilot's RTL  0 return
    the mission's end  0 return
    RC lost FS_LONG_ACTN 1 return
    station lost FS_GCS_ENABL 0 on
    battery low BATT_FS_LOW_ACT 1 return
    battery critical BATT_FS_CRT_ACT 0 on
    """
    causes = [
        Cause("the pilot's RTL", "return"),
        Cause("the mission's end", "landed" if ends_with_landing else "return"),
        *_control_loss_causes(parameters),
        _station_loss_cause(parameters),
    ]
    # A battery failsafe never reacts without a monitor, or without a threshold that the monitor can measure.
    monitors = active_battery_monitors(parameters)
    for monitor in dict.fromkeys(["BATT", *monitors]):
        number = "" if monitor == "BATT" else f" {monitor.removeprefix('BATT')}"
        for level, name in (("LOW", "low"), ("CRT", "critical")):
            parameter = f"{monitor}_FS_{level}_ACT"
            value = int(parameters[parameter])
            reaction = _BATTERY_FAILSAFE.get(value, "on")
            if reaction == "land" and not has_landing_sequence:
                reaction = "return"
            has_voltage = parameters[f"{monitor}_{level}_VOLT"] > 0.0 and parameters[f"{monitor}_LOW_TIMER"] > 0.0
            has_charge = parameters[f"{monitor}_{level}_MAH"] > 0.0 and measures_current(parameters, monitor)
            if reaction != "on" and not (monitor in monitors and (has_voltage or has_charge)):
                reaction = "never"
            causes.append(Cause(f"battery{number} {name}", reaction, parameter, value))
    if has_fence:
        action = int(parameters.fence_action)
        if parameters.fence_enable > 0.0 or parameters.fence_auto_enable > 0.0:
            causes.append(Cause("fence broken", _FENCE_REACTION.get(action, "on"), "FENCE_ACTION", action))
        else:
            causes.append(Cause("fence broken", "on", "FENCE_ENABLE", 0))
    return tuple(causes)


def _control_loss_causes(parameters: ArduPilotParameters) -> list[Cause]:
    """Return the loss of the remote control as causes: for the short failsafe, and for the long failsafe.

    Each cause has ArduPlane's reaction. The short failsafe is left out if it does not leave AUTO. If the loss triggers
    no failsafe, the result is one cause with the reaction "on": the mission continues.
    """
    long_action, short_action = int(parameters.long_failsafe), int(parameters.short_failsafe)
    # THR_FAILSAFE 2 detects the loss, but starts no failsafe.
    if parameters.throttle_failsafe != 1.0:
        return [Cause("RC lost", "on", "THR_FAILSAFE", int(parameters.throttle_failsafe))]
    long_failsafe = Cause("RC lost", _LONG_FAILSAFE.get(long_action, "on"), "FS_LONG_ACTN", long_action)
    if _SHORT_FAILSAFE.get(short_action, "on") == "on":
        return [long_failsafe]
    short_name = f"RC lost for {parameters['FS_SHORT_TIMEOUT']:g} s"
    short_failsafe = Cause(short_name, _SHORT_FAILSAFE[short_action], "FS_SHORT_ACTN", short_action)
    if long_action == 0:
        # After the short failsafe ArduPlane is no longer in AUTO; in any other mode FS_LONG_ACTN 0 is an RTL.
        long_failsafe = Cause("RC lost", "return", "FS_SHORT_ACTN", short_action)
    return [short_failsafe, long_failsafe]


def _station_loss_cause(parameters: ArduPilotParameters) -> Cause:
    """Return the loss of the ground station's heartbeats as a `Cause` with ArduPlane's reaction."""
    if parameters.station_failsafe <= 0.0:
        return Cause("station lost", "on", "FS_GCS_ENABL", 0)
    long_action = int(parameters.long_failsafe)
    return Cause("station lost", _LONG_FAILSAFE.get(long_action, "on"), "FS_LONG_ACTN", long_action)


def link_loss_reactions(parameters: ArduPilotParameters, use: LinkUse) -> tuple[LinkLossReaction, ...]:
    """Return ArduPlane's reactions to the loss of a radio link in AUTO, in order of time.

    A loss within a landing sequence is not considered.

    use: "telemetry" for the ground station's heartbeats, "control" for the remote control.

    For the ground station, FS_LONG_TIMEOUT starts at the last heartbeat (`Plane::check_long_failsafe`). For the remote
    control it starts at the short failsafe, which begins FS_SHORT_TIMEOUT after the loss (`check_short_rc_failsafe`).
    The short failsafe begins even if ArduPlane does not react to it in AUTO.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> parameters = ArduPilotParameters.defaults().changed(FS_SHORT_ACTN=1, FS_LONG_ACTN=1, FS_LONG_TIMEOUT=20)
    >>> [(reaction.action, reaction.delay) for reaction in link_loss_reactions(parameters, "control")]
    [('circle', 1.5), ('return', 21.5)]
    >>> link_loss_reactions(parameters, "telemetry")
    (LinkLossReaction(action='on', delay=inf, parameter='FS_GCS_ENABL', value=0),)
    """
    long_delay = parameters["FS_LONG_TIMEOUT"]
    if use == "telemetry":
        causes, delays = [_station_loss_cause(parameters)], [long_delay]
    else:
        short_delay = parameters["FS_SHORT_TIMEOUT"]
        if int(parameters.short_failsafe) != _NO_SHORT_FAILSAFE:
            long_delay += short_delay
        causes = _control_loss_causes(parameters)
        delays = [short_delay, long_delay][-len(causes) :]
    reactions = [
        LinkLossReaction(cause.action, delay, cause.parameter, cause.value)
        for cause, delay in zip(causes, delays, strict=True)
        if cause.action != "on"
    ]
    last_cause = causes[-1]
    return tuple(reactions) or (LinkLossReaction("on", math.inf, last_cause.parameter, last_cause.value),)


def battery_failsafes(parameters: ArduPilotParameters) -> tuple[BatteryFailsafe, ...]:
    r"""Return the failsafes that end a mission when a battery reaches a charge or voltage threshold.

    A monitor that measures only voltage never triggers on charge, and BATT_LOW_TIMER 0 disables the voltage failsafes
    (`AP_BattMonitor_Backend::update_failsafes`, `check_failsafe_types`).

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> text = "BATT_CAPACITY 8000\nBATT_LOW_MAH 1500\nBATT_FS_LOW_ACT 1\n"
    >>> parameters = ArduPilotParameters.from_text(text, "mine.param")
    >>> [(failsafe.parameter, failsafe.used_charge) for failsafe in battery_failsafes(parameters)]
    [('BATT_LOW_MAH', 6500.0)]
    """
    monitors = active_battery_monitors(parameters)
    failsafes = []
    for monitor in monitors:
        for level in ("LOW", "CRT"):
            action = parameters[f"{monitor}_FS_{level}_ACT"]
            charge, voltage = parameters[f"{monitor}_{level}_MAH"], parameters[f"{monitor}_{level}_VOLT"]
            if _BATTERY_FAILSAFE.get(int(action), "on") == "on":
                continue
            if charge > 0.0 and measures_current(parameters, monitor):
                capacity_name = f"{monitor}_CAPACITY"
                capacity = parameters[capacity_name]
                failsafe = BatteryFailsafe(f"{monitor}_{level}_MAH", charge, capacity - charge, len(monitors) > 1)
                failsafes.append(failsafe._replace(capacity_parameter=capacity_name, capacity=capacity))
            if voltage > 0.0 and parameters[f"{monitor}_LOW_TIMER"] > 0.0:
                failsafes.append(BatteryFailsafe(f"{monitor}_{level}_VOLT", voltage))
    return tuple(failsafes)


def active_battery_monitors(parameters: ArduPilotParameters) -> list[str]:
    """Return the prefix of each battery monitor that is on, such as "BATT" or "BATT2".

    The default of BATT_MONITOR depends on the board. If a file does not state BATT_MONITOR, the first monitor is
    assumed to be on.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> active_battery_monitors(ArduPilotParameters.defaults().changed(BATT3_MONITOR=4))
    ['BATT', 'BATT3']
    """
    is_unstated = "BATT_MONITOR" in parameters.by_origin("default")
    is_monitored = is_unstated or parameters.battery_monitor > 0.0
    return [
        *(["BATT"] if is_monitored else []),
        *(monitor for monitor in OTHER_BATTERY_MONITORS if parameters[f"{monitor}_MONITOR"] > 0.0),
    ]


def measures_current(parameters: ArduPilotParameters, monitor: str) -> bool:
    """Return True if a battery monitor measures the current."""
    return int(parameters[f"{monitor}_MONITOR"]) not in _MONITORS_WITHOUT_CURRENT
