"""Describe settings with which ArduPlane does not arm; they leave the verdict undecided.

Read from ArduPlane 4.6.3 and 4.7: `AP_Arming::pre_arm_checks` and `AP_Arming_Plane::pre_arm_checks` call the functions
that each check names. A battery is full, and the aircraft stands at home with its throttle stick at idle.
"""

import math
from collections.abc import Iterator, Mapping

from flight.autopilots.arduplane.failsafes import active_battery_monitors, measures_current
from flight.autopilots.arduplane.parameters import OWN_FENCE_BITS, RADIO_CHANNEL_COUNT, ArduPilotParameters
from flight.autopilots.parts import MissionParts
from flight.mission.commands import Command as C

# Items that bits of ARMING_MIS_ITEMS require (`AP_Arming::mission_checks`).
_ITEMS_FOR_ARMING = {
    1 << 0: C.NAV_LAND,
    1 << 1: C.NAV_VTOL_LAND,
    1 << 2: C.DO_LAND_START,
    1 << 3: C.NAV_TAKEOFF,
    1 << 4: C.NAV_VTOL_TAKEOFF,
    1 << 6: C.NAV_RETURN_TO_LAUNCH,
}
# Bit of ARMING_MIS_ITEMS: a rally point within RALLY_LIMIT_KM of the aircraft.
_RALLY_FOR_ARMING = 1 << 5
# Limits without which ArduPlane does not arm (`AP_Arming_Plane::pre_arm_checks`): lowest and highest value.
_LIMITS_FOR_ARMING = {
    "ROLL_LIMIT_DEG": (3.0, math.inf),
    "PTCH_LIM_MAX_DEG": (3.0, math.inf),
    "PTCH_LIM_MIN_DEG": (-math.inf, -3.0),
    "AIRSPEED_MIN": (5.0, math.inf),
}
# Marks with which ArduPlane does not arm if RTL_AUTOLAND is 0 (`AP_Arming_Plane::mission_checks`).
_MARKS_OF_AUTOLAND = (C.DO_LAND_START, C.DO_RETURN_PATH_START)
# Number of servo outputs.
_OUTPUT_COUNT = 32
# Value of FS_SHORT_ACTN that switches the short failsafe off.
_SHORT_FAILSAFE_OFF = 3.0
# Bit of FENCE_TYPE: the mission's fence.
_MISSION_FENCE_BIT = 1 << 2
# Value of FENCE_AUTOENABLE: on while armed.
_ON_WHEN_ARMED = 3.0
# Lowest FENCE_ALT_MIN (`AC_Fence::pre_arm_check_alt`), m.
_LOWEST_FENCE_FLOOR_M = -100.0


def describe_failed_arming_checks(
    parameters: ArduPilotParameters, values: Mapping[str, float], mission: MissionParts
) -> Iterator[str]:
    """Yield one sentence for each pre-arm check that fails with these settings.

    Yields nothing if the settings disable the checks.

    values: value of every parameter by name; the default where no file states one.
    """
    # 4.7 has ARMING_SKIPCHK for ARMING_CHECK.
    if values["ARMING_CHECK"] == 0.0 or values["ARMING_SKIPCHK"] != 0.0 or values["ARMING_REQUIRE"] == 0.0:
        return
    for name, (lowest, highest) in _LIMITS_FOR_ARMING.items():
        if not lowest <= values[name] <= highest:
            limit_text = f"at least {lowest:g}" if math.isinf(highest) else f"at most {highest:g}"
            yield f"{name} {values[name]:g} prevents arming: ArduPlane requires {limit_text}"
    # Items that arming requires but the mission lacks, and items that it forbids, as in `AP_Arming::mission_checks` and
    # `AP_Arming_Plane::mission_checks`.
    if parameters.by_origin("file").get("RTL_AUTOLAND") == 0.0:
        for mark in _MARKS_OF_AUTOLAND:
            if mark in mission.commands:
                yield f"RTL_AUTOLAND 0 prevents arming, because the mission has {mark.name}"
    bits = int(values["ARMING_MIS_ITEMS"])
    for bit, command in _ITEMS_FOR_ARMING.items():
        if bits & bit and command not in mission.commands:
            yield f"ARMING_MIS_ITEMS {bits} prevents arming, because the mission has no {command.name}"
    if bits & _RALLY_FOR_ARMING and mission.rally_distance > (parameters.rally_limit or math.inf):
        yield f"ARMING_MIS_ITEMS {bits} prevents arming, because no rally point is within RALLY_LIMIT_KM of home"
    elif bits & _RALLY_FOR_ARMING and math.isinf(mission.rally_distance):
        yield f"ARMING_MIS_ITEMS {bits} prevents arming, because there is no rally point"
    # Servo outputs and radio channels whose trim is outside their minimum and maximum, as in `AP_Arming::servo_checks`
    # and `rc_calibration_checks`.
    outputs = [f"SERVO{output}" for output in range(1, _OUTPUT_COUNT + 1) if values[f"SERVO{output}_FUNCTION"] > 0.0]
    channels = [f"RC{channel}" for channel in range(1, RADIO_CHANNEL_COUNT + 1)]
    for name in (*outputs, *channels):
        lowest, trim, highest = (values[f"{name}_{end}"] for end in ("MIN", "TRIM", "MAX"))
        if not lowest <= trim <= highest:
            range_text = f"{name}_MIN {lowest:g} to {name}_MAX {highest:g}"
            yield f"{name}_TRIM {trim:g} prevents arming: ArduPlane requires {range_text}"
    # `Plane::rc_failsafe_active` takes a throttle pulse at or below THR_FS_VALUE (at or above it on a reversed channel)
    # as a lost radio. `AP_Arming::manual_transmitter_checks` fails if the pulse at idle is such a pulse.
    channel, value = f"RC{values['RCMAP_THROTTLE']:g}", values["THR_FS_VALUE"]
    is_reversed = values.get(f"{channel}_REVERSED", 0.0) > 0.0
    end = "MAX" if is_reversed else "MIN"
    idle = values.get(f"{channel}_{end}", math.nan)
    if parameters.throttle_failsafe == 1.0 and (value <= idle if is_reversed else value >= idle):
        side = "above" if is_reversed else "below"
        yield f"THR_FS_VALUE {value:g} prevents arming: ArduPlane requires a value {side} {channel}_{end} {idle:g}"
    # `AP_Arming_Plane::pre_arm_checks` up to 4.6: 4.7 has no FS_SHORT_TIMEOUT.
    has_timeout = parameters.version == "4.6" or "FS_SHORT_TIMEOUT" in parameters.by_origin("file")
    long_timeout, short_timeout = values["FS_LONG_TIMEOUT"], values["FS_SHORT_TIMEOUT"]
    if has_timeout and parameters.short_failsafe != _SHORT_FAILSAFE_OFF and long_timeout < short_timeout:
        limit_text = f"at least FS_SHORT_TIMEOUT {short_timeout:g}"
        yield f"FS_LONG_TIMEOUT {long_timeout:g} prevents arming: ArduPlane 4.6 requires {limit_text}"
    for monitor in active_battery_monitors(parameters):
        yield from _describe_battery_faults(
            values, monitor, mission.full_voltage, has_current=measures_current(parameters, monitor)
        )
    yield from _describe_fence_faults(parameters, values, mission)


def _describe_battery_faults(
    values: Mapping[str, float], monitor: str, full_voltage: float, *, has_current: bool
) -> Iterator[str]:
    """Yield a sentence for each failsafe threshold of one battery monitor that prevents arming.

    The low threshold prevents arming if it is below the critical threshold. Any threshold prevents arming if it exceeds
    the charge or the voltage of a full battery. Follows `AP_BattMonitor_Backend::arming_checks`.

    values: value of every parameter by name; the default where no file states one.
    monitor: prefix of the monitor's parameters, such as "BATT2".
    full_voltage: voltage of the full battery, V.
    has_current: True if the monitor measures the current.
    """
    for unit in ("VOLT", "MAH"):
        low_threshold, critical_threshold = (values[f"{monitor}_{level}_{unit}"] for level in ("LOW", "CRT"))
        if 0.0 < low_threshold < critical_threshold:
            limit_text = f"at least {monitor}_CRT_{unit} {critical_threshold:g}"
            yield f"{monitor}_LOW_{unit} {low_threshold:g} prevents arming: ArduPlane requires {limit_text}"
    capacity = values[f"{monitor}_CAPACITY"]
    for level in ("ARM", "LOW", "CRT"):
        charge, voltage = values[f"{monitor}_{level}_MAH"], values[f"{monitor}_{level}_VOLT"]
        if charge > 0.0 and charge > capacity and (has_current or level == "ARM"):
            limit_text = f"at most {monitor}_CAPACITY {capacity:g}"
            yield f"{monitor}_{level}_MAH {charge:g} prevents arming: ArduPlane requires {limit_text}"
        if voltage > full_voltage:
            limit_text = f"at most the {full_voltage:g} V of a full battery"
            yield f"{monitor}_{level}_VOLT {voltage:g} prevents arming: ArduPlane requires {limit_text}"


def _describe_fence_faults(
    parameters: ArduPilotParameters, values: Mapping[str, float], mission: MissionParts
) -> Iterator[str]:
    """Yield the reasons why a fence prevents arming: no limits, unusable limits, or home violates it.

    Follows `AC_Fence::pre_arm_check`.

    parameters: ArduPlane's parameters.
    values: value of every parameter by name; the default where no file states one.
    """
    kinds = int(parameters.fence_type)
    has_mission_fence = bool(kinds & _MISSION_FENCE_BIT and mission.has_fence)
    if parameters.fence_enable > 0.0 and not (kinds & OWN_FENCE_BITS or has_mission_fence):
        yield f"FENCE_ENABLE {parameters.fence_enable:g} prevents arming, because no fence of FENCE_TYPE {kinds} exists"
    if not kinds or not (parameters.fence_enable > 0.0 or parameters.fence_auto_enable > 0.0):
        return
    margin, radius, ceiling, floor = (values[f"FENCE_{name}"] for name in ("MARGIN", "RADIUS", "ALT_MAX", "ALT_MIN"))
    side_name = "FENCE_MARGIN_XY" if parameters.version != "4.6" and values["FENCE_MARGIN_XY"] > 0.0 else "FENCE_MARGIN"
    side_margin = values[side_name]
    if has_mission_fence and side_margin > mission.smallest_inclusion:
        limit_text = f"at most the {mission.smallest_inclusion:g} m of an inclusion circle"
        yield f"{side_name} {side_margin:g} prevents arming: ArduPlane requires {limit_text}"
    # These are checked with any FENCE_TYPE.
    if side_margin > radius:
        yield f"{side_name} {side_margin:g} prevents arming: ArduPlane requires at most FENCE_RADIUS {radius:g}"
    if margin < 0.0:
        yield f"FENCE_MARGIN {margin:g} prevents arming: ArduPlane requires at least 0"
    if ceiling < 0.0 or floor < _LOWEST_FENCE_FLOOR_M or ceiling - floor <= 2.0 * margin:
        range_text = f"FENCE_ALT_MIN {floor:g} and FENCE_ALT_MAX {ceiling:g}"
        yield f"{range_text} prevent arming with FENCE_MARGIN {margin:g}"
    is_on_at_home = parameters.fence_enable > 0.0 or parameters.fence_auto_enable == _ON_WHEN_ARMED
    if has_mission_fence and is_on_at_home and mission.fence_at_home:
        name = "FENCE_ENABLE" if parameters.fence_enable > 0.0 else "FENCE_AUTOENABLE"
        value = parameters.fence_enable or parameters.fence_auto_enable
        yield f"{name} {value:g} prevents arming, because home is {mission.fence_at_home}"
