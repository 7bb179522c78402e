"""List the events that can end a mission of PX4, and PX4's reactions according to its parameters.

Read from PX4's sources and its parameter reference, not triggered: `Failsafe::checkStateAndMode` and
`Failsafe::fromNavDllOrRclActParam` in `src/modules/commander/failsafe/failsafe.cpp`, `FailsafeBase::getSelectedAction`
in `framework.cpp`. Before it returns or lands, PX4 first holds its position in a loiter for COM_FAIL_ACT_T, which is
not simulated.
"""

import math

from flight.autopilots.parts import Cause, FailsafeAction, LinkLossReaction
from flight.autopilots.px4.parameters import Px4Parameters
from world.scenario_tables import LinkUse

# Reactions by the values of NAV_RCL_ACT and NAV_DLL_ACT.
_LINK_LOSS: dict[int, FailsafeAction] = {
    0: "on",
    1: "circle",
    2: "return",
    3: "land here",
    5: "terminate",
    6: "disarm",
    7: "circle",
}
# Reactions by the value of GF_ACTION.
_FENCE: dict[int, FailsafeAction] = {0: "on", 1: "on", 2: "circle", 3: "return", 4: "terminate", 5: "land here"}
# Reactions by the value of COM_LOW_BAT_ACT, at BAT_CRIT_THR and at BAT_EMERGEN_THR.
_CRITICAL_BATTERY: dict[int, FailsafeAction] = {0: "on", 1: "return", 2: "land here", 3: "return"}
_EMERGENCY_BATTERY: dict[int, FailsafeAction] = {0: "on", 1: "return", 2: "land here", 3: "land here"}
# Bit of COM_RCL_EXCEPT and COM_DLL_EXCEPT: a mission continues without the link.
_EXCEPT_MISSIONS_BIT = 1
# COM_RC_IN_MODE that ignores the remote control.
_NO_REMOTE_CONTROL = 4
# Reactions before which PX4 holds, unless COM_FAIL_ACT_T is at most `_MIN_HOLD_TIME_S`.
_HELD_ACTIONS: tuple[FailsafeAction, ...] = ("return", "land here")
_MIN_HOLD_TIME_S = 0.1


def failsafe_causes(parameters: Px4Parameters, *, has_fence: bool) -> tuple[Cause, ...]:
    """Return the events that can end a mission, each as a `Cause` with PX4's reaction, in a fixed order.

    has_fence: True if the mission carries a fence.

    >>> for cause in failsafe_causes(Px4Parameters.defaults(), has_fence=True):
    ...     print(cause.name, cause.parameter, cause.value, cause.action)
    the pilot's RTL  0 return
    RC lost NAV_RCL_ACT 2 return
    station lost NAV_DLL_ACT 0 on
    battery critical COM_LOW_BAT_ACT 0 on
    battery emergency COM_LOW_BAT_ACT 0 on
    fence broken GF_ACTION 2 circle
    """
    causes = [
        Cause("the pilot's RTL", "return"),
        _link_loss_cause(parameters, "control"),
        _link_loss_cause(parameters, "telemetry"),
    ]
    battery_action = int(parameters["COM_LOW_BAT_ACT"])
    for name, actions in (("battery critical", _CRITICAL_BATTERY), ("battery emergency", _EMERGENCY_BATTERY)):
        causes.append(Cause(name, actions.get(battery_action, "on"), "COM_LOW_BAT_ACT", battery_action))
    if has_fence:
        fence_action = int(parameters["GF_ACTION"])
        causes.append(Cause("fence broken", _FENCE.get(fence_action, "on"), "GF_ACTION", fence_action))
    return tuple(causes)


def _link_loss_cause(parameters: Px4Parameters, use: LinkUse) -> Cause:
    """Return the loss of a radio link as a `Cause` with PX4's reaction; "on" if PX4 ignores the loss.

    use: "telemetry" for the ground station's link, "control" for the remote control.
    """
    if use == "telemetry":
        name, parameter, exceptions = "station lost", "NAV_DLL_ACT", "COM_DLL_EXCEPT"
    else:
        name, parameter, exceptions = "RC lost", "NAV_RCL_ACT", "COM_RCL_EXCEPT"
        if int(parameters["COM_RC_IN_MODE"]) == _NO_REMOTE_CONTROL:
            return Cause(name, "on", "COM_RC_IN_MODE", _NO_REMOTE_CONTROL)
    value = int(parameters[parameter])
    action = _LINK_LOSS.get(value, "on")
    if action != "on" and int(parameters[exceptions]) & _EXCEPT_MISSIONS_BIT:
        return Cause(name, "on", exceptions, int(parameters[exceptions]))
    return Cause(name, action, parameter, value)


def link_loss_reactions(parameters: Px4Parameters, use: LinkUse) -> tuple[LinkLossReaction, ...]:
    """Return PX4's reactions to the loss of a radio link in a mission, in order of time.

    PX4 notices the loss after COM_DL_LOSS_T or COM_RC_LOSS_T. Before an RTL or a landing PX4 loiters for
    COM_FAIL_ACT_T. Then it reacts even if the link has been restored.

    use: "telemetry" for the ground station's link, "control" for the remote control.

    >>> parameters = Px4Parameters.defaults().changed(NAV_DLL_ACT=2)
    >>> [(reaction.action, reaction.delay) for reaction in link_loss_reactions(parameters, "telemetry")]
    [('circle', 10.0), ('return', 15.0)]
    >>> [(reaction.action, reaction.delay) for reaction in link_loss_reactions(parameters, "control")]
    [('circle', 0.5), ('return', 5.5)]
    """
    _, action, parameter, value = _link_loss_cause(parameters, use)
    if action == "on":
        return (LinkLossReaction(action, math.inf, parameter, value),)
    delay, hold_time = parameters["COM_DL_LOSS_T" if use == "telemetry" else "COM_RC_LOSS_T"], 0.0
    reactions = []
    if action in _HELD_ACTIONS and parameters["COM_FAIL_ACT_T"] > _MIN_HOLD_TIME_S:
        hold_time = parameters["COM_FAIL_ACT_T"]
        reactions.append(LinkLossReaction("circle", delay, "COM_FAIL_ACT_T", hold_time))
    return (*reactions, LinkLossReaction(action, delay + hold_time, parameter, value))
