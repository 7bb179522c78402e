"""List PX4's reactions to the loss of a radio link in a mission, according to its parameters.

Read from PX4's sources, not triggered: `Failsafe::checkStateAndMode`, `Failsafe::fromNavDllOrRclActParam`,
`FailsafeBase::getSelectedAction`; and from the parameter reference.
"""

import math

from flight.autopilots.parts import FailsafeAction, LinkLossReaction
from flight.autopilots.px4.parameters import Px4Parameters
from world.scenario_tables import LinkUse

# NAV_DLL_ACT and NAV_RCL_ACT: hold, return, land, terminate, disarm; any other value continues the mission.
_ACTIONS: dict[int, FailsafeAction] = {1: "circle", 2: "return", 3: "land here", 5: "terminate", 6: "disarm"}
# Actions before which PX4 does not hold.
_IMMEDIATE_ACTIONS: tuple[FailsafeAction, ...] = ("circle", "terminate", "disarm")
# Bit of COM_DLL_EXCEPT and COM_RCL_EXCEPT: missions.
_MISSION_BIT = 1 << 0
# COM_RC_IN_MODE that ignores the remote control.
_NO_REMOTE_CONTROL = 4.0
# COM_FAIL_ACT_T up to which PX4 does not hold before it reacts, s.
_MIN_HOLD_TIME_S = 0.1


def link_loss_reactions(parameters: Px4Parameters, use: LinkUse) -> tuple[LinkLossReaction, ...]:
    """Return the reactions to the loss of a radio link in a mission, in order of time.

    PX4 notices the loss after COM_DL_LOSS_T or COM_RC_LOSS_T.  Before a return or a landing it holds for
    COM_FAIL_ACT_T, and then reacts even if the link is back.

    use: "telemetry" for the ground station's link, "control" for the remote control.

    >>> made = Px4Parameters.defaults().changed(NAV_DLL_ACT=2)
    >>> [(reaction.action, reaction.delay) for reaction in link_loss_reactions(made, "telemetry")]
    [('circle', 10.0), ('return', 15.0)]
    >>> [(reaction.action, reaction.delay) for reaction in link_loss_reactions(made, "control")]
    [('circle', 0.5), ('return', 5.5)]
    """
    if use == "telemetry":
        name, exceptions, delay = "NAV_DLL_ACT", "COM_DLL_EXCEPT", parameters["COM_DL_LOSS_T"]
    else:
        name, exceptions, delay = "NAV_RCL_ACT", "COM_RCL_EXCEPT", parameters["COM_RC_LOSS_T"]
    value = int(parameters[name])
    action = _ACTIONS.get(value)
    if use == "control" and parameters["COM_RC_IN_MODE"] == _NO_REMOTE_CONTROL:
        return (LinkLossReaction("on", math.inf, "COM_RC_IN_MODE", _NO_REMOTE_CONTROL),)
    if action is not None and int(parameters[exceptions]) & _MISSION_BIT:
        return (LinkLossReaction("on", math.inf, exceptions, parameters[exceptions]),)
    if action is None:
        return (LinkLossReaction("on", math.inf, name, value),)
    hold_time = parameters["COM_FAIL_ACT_T"]
    if action in _IMMEDIATE_ACTIONS or hold_time <= _MIN_HOLD_TIME_S:
        return (LinkLossReaction(action, delay, name, value),)
    return (
        LinkLossReaction("circle", delay, "COM_FAIL_ACT_T", hold_time),
        LinkLossReaction(action, delay + hold_time, name, value),
    )
