"""What makes ArduPlane leave its mission, and what it does then, by its parameters.

Read in ArduPlane's sources, not triggered: `Plane::rc_failsafe_short_on_event`, `failsafe_long_on_event` and
`handle_battery_failsafe` in ArduPlane/events.cpp, `Plane::fence_check` in fence.cpp.
"""

from typing import Literal, NamedTuple

from flight.autopilots.arduplane.parameters import ArduPilotParameters

# What it does: "return" to launch by RTL; "land" where the mission has a landing sequence, else it returns; it goes
# "on" with its mission; or something that brings nobody home.
Does = Literal["return", "land", "on", "circle", "glide", "parachute", "terminate", "level", "guided"]


class Cause(NamedTuple):
    """Something that can happen on the way.

    name: for people.  does: what ArduPlane does then.
    parameter, value: the one that decides it; "" for what no parameter decides.
    """

    name: str
    does: Does
    parameter: str = ""
    value: int = 0

    @property
    def returns(self) -> bool:
        """Whether it flies a return to launch."""
        return self.does in ("return", "land")


_LONG: dict[int, Does] = {0: "on", 1: "return", 2: "glide", 3: "parachute", 4: "on", 5: "land"}
_SHORT: dict[int, Does] = {0: "on", 1: "circle", 2: "level", 3: "on", 4: "level"}
# What only a quadplane can do, to land on its rotors (4, 6), is to any other aeroplane what 2 is.
_BATTERY: dict[int, Does] = {
    0: "on",
    1: "return",
    2: "land",
    3: "terminate",
    4: "land",
    5: "parachute",
    6: "land",
    7: "land",
}
_FENCE: dict[int, Does] = {0: "on", 1: "return", 6: "guided", 7: "guided", 8: "land"}


def failsafe_causes(parameters: ArduPilotParameters, *, has_fence: bool) -> tuple[Cause, ...]:
    """What can take an aircraft off its mission in AUTO, in the order in which a person asks.

    has_fence: whether the mission carries a fence.

    >>> from flight.autopilots.arduplane.parameters import default_parameters
    >>> made = default_parameters().changed(FS_LONG_ACTN=1, BATT_FS_LOW_ACT=1)
    >>> for cause in failsafe_causes(made, has_fence=False):
    ...     print(cause.name, cause.parameter, cause.value, cause.does)
    the pilot's RTL  0 return
    the mission's end  0 return
    RC lost FS_LONG_ACTN 1 return
    station lost FS_GCS_ENABL 0 on
    battery low BATT_FS_LOW_ACT 1 return
    battery critical BATT_FS_CRT_ACT 0 on
    """
    long = int(parameters.long_failsafe)
    causes = [Cause("the pilot's RTL", "return"), Cause("the mission's end", "return")]
    short = int(parameters.short_failsafe)
    leaves_auto = _SHORT.get(short, "on") != "on" and parameters.throttle_failsafe > 0.0
    if leaves_auto:
        causes.append(Cause("RC lost for 1.5 s", _SHORT[short], "FS_SHORT_ACTN", short))
    if parameters.throttle_failsafe == 1.0 and leaves_auto and long == 0:
        # It is no longer in AUTO, and from any other mode FS_LONG_ACTN 0 is a return.
        causes.append(Cause("RC lost", "return", "FS_SHORT_ACTN", short))
    elif parameters.throttle_failsafe == 1.0:
        causes.append(Cause("RC lost", _LONG.get(long, "on"), "FS_LONG_ACTN", long))
    else:
        causes.append(Cause("RC lost", "on", "THR_FAILSAFE", int(parameters.throttle_failsafe)))
    if parameters.station_failsafe > 0.0:
        causes.append(Cause("station lost", _LONG.get(long, "on"), "FS_LONG_ACTN", long))
    else:
        causes.append(Cause("station lost", "on", "FS_GCS_ENABL", 0))
    for name, value, parameter in (
        ("battery low", parameters.low_battery, "BATT_FS_LOW_ACT"),
        ("battery critical", parameters.critical_battery, "BATT_FS_CRT_ACT"),
    ):
        causes.append(Cause(name, _BATTERY.get(int(value), "on"), parameter, int(value)))
    if has_fence:
        action = int(parameters.fence_action)
        if parameters.fence_enable > 0.0:
            causes.append(Cause("fence broken", _FENCE.get(action, "on"), "FENCE_ACTION", action))
        else:
            causes.append(Cause("fence broken", "on", "FENCE_ENABLE", 0))
    return tuple(causes)
