"""List the events that can end a mission of PX4, and PX4's reactions according to its parameters.

Read from PX4's sources and its parameter reference, not triggered: `Failsafe::checkStateAndMode` in
`src/modules/commander/failsafe/failsafe.cpp`.  Before it returns or lands, PX4 first holds its position in a loiter for
COM_FAIL_ACT_T, which is not simulated.
"""

from flight.autopilots.parts import Cause, FailsafeAction
from flight.autopilots.px4.parameters import Px4Parameters

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


def failsafe_causes(parameters: Px4Parameters, *, has_fence: bool) -> tuple[Cause, ...]:
    """Return the events that can end a mission, with PX4's reaction to each, in a fixed order.

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
    causes = [Cause("the pilot's RTL", "return")]
    links = (("RC lost", "NAV_RCL_ACT", "COM_RCL_EXCEPT"), ("station lost", "NAV_DLL_ACT", "COM_DLL_EXCEPT"))
    for name, parameter, exception in links:
        if int(parameters[exception]) & _EXCEPT_MISSIONS_BIT:
            causes.append(Cause(name, "on", exception, int(parameters[exception])))
        else:
            action = int(parameters[parameter])
            causes.append(Cause(name, _LINK_LOSS.get(action, "on"), parameter, action))
    battery_action = int(parameters["COM_LOW_BAT_ACT"])
    for name, actions in (("battery critical", _CRITICAL_BATTERY), ("battery emergency", _EMERGENCY_BATTERY)):
        causes.append(Cause(name, actions.get(battery_action, "on"), "COM_LOW_BAT_ACT", battery_action))
    if has_fence:
        fence_action = int(parameters["GF_ACTION"])
        causes.append(Cause("fence broken", _FENCE.get(fence_action, "on"), "GF_ACTION", fence_action))
    return tuple(causes)
