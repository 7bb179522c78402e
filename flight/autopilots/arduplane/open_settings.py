"""List ArduPlane's settings that change a flight, are not simulated, and therefore leave the verdict open.

Names, defaults and effects are from ArduPlane 4.6.3 and 4.7; docs/arduplane-branches.md lists the function of each.
Each is read from a parameter file, and has no part in the control law.
"""

from collections.abc import Iterator
from enum import StrEnum
from typing import NamedTuple

from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.parts import MissionParts


class Phase(StrEnum):
    """Part of a flight that a setting changes."""

    FLIGHT = "flight"
    TAKE_OFF = "take-off"
    LANDING = "landing"


class OpenSetting(NamedTuple):
    """A setting with a neutral value.

    phase: the setting matters only where this part of a flight is flown.
    lowest, highest: range of values that change nothing.
    by_program: True if ArduPlane's own program flies it, with planfly's physics.
    """

    phase: Phase
    lowest: float = 0.0
    highest: float = 0.0
    by_program: bool = False


_FLIGHT = Phase.FLIGHT
_TAKE_OFF = Phase.TAKE_OFF
_LANDING = Phase.LANDING
OPEN_SETTINGS = {
    # `Plane::stabilize_pitch_get_pitch_out` raises the pitch demand with the throttle.
    "KFF_THR2PTCH": OpenSetting(_FLIGHT, by_program=True),
    # `Plane::throttle_watt_limiter` and, in 4.7, `FWD_BATT_CMP::apply_min_max` reduce the throttle.
    "BATT_WATT_MAX": OpenSetting(_FLIGHT),
    "FWD_BAT_THR_CUT": OpenSetting(_FLIGHT),
    # `AP_TECS::_update_speed_demand` flies faster in a descent.
    "TECS_OPTIONS": OpenSetting(_FLIGHT, by_program=True),
    # `AP_AdvancedFailsafe::check` may end a flight.
    "AFS_ENABLE": OpenSetting(_FLIGHT),
    # `AP_Parachute::check_sink_rate` releases the parachute.
    "CHUTE_CRT_SINK": OpenSetting(_FLIGHT),
    # `AP_ICEngine::throttle_override` and `update_idle_governor` keep the throttle above idle; below 0 the governor is
    # off.
    "ICE_IDLE_PCT": OpenSetting(_FLIGHT),
    "ICE_IDLE_RPM": OpenSetting(_FLIGHT, -1e9, -1e-9),
    # `Plane::takeoff_calc_throttle`, `auto_takeoff_check`, `takeoff_tail_hold`, `set_servos_flaps`, `set_throttle`.
    "TKOFF_OPTIONS": OpenSetting(_TAKE_OFF, by_program=True),
    "TKOFF_ACCEL_CNT": OpenSetting(_TAKE_OFF, 0.0, 1.0, by_program=True),
    "TKOFF_TDRAG_ELEV": OpenSetting(_TAKE_OFF, by_program=True),
    "TKOFF_FLAP_PCNT": OpenSetting(_TAKE_OFF),
    "TKOFF_THR_IDLE": OpenSetting(_TAKE_OFF, by_program=True),
    "TECS_TKOFF_IGAIN": OpenSetting(_TAKE_OFF, by_program=True),
    # `AP_Landing`: deepstall, pre-flare, limits of speed and throttle, throttle slew.
    "LAND_TYPE": OpenSetting(_LANDING, by_program=True),
    "LAND_PF_ARSPD": OpenSetting(_LANDING, by_program=True),
    "LAND_OPTIONS": OpenSetting(_LANDING, by_program=True),
    "LAND_THR_SLEW": OpenSetting(_LANDING, by_program=True),
    "LAND_FLAP_PERCNT": OpenSetting(_LANDING),
    # `Plane::rangefinder_correction`.
    "RNGFND_LANDING": OpenSetting(_LANDING),
    # `AP_TECS` in a landing: sink rate, damping of pitch and throttle, integrator.
    "TECS_APPR_SMAX": OpenSetting(_LANDING, by_program=True),
    "TECS_LAND_TDAMP": OpenSetting(_LANDING, by_program=True),
    "TECS_LAND_IGAIN": OpenSetting(_LANDING, by_program=True),
    "TECS_LAND_PDAMP": OpenSetting(_LANDING, by_program=True),
}
_DEFAULTS = {name: definition.default for name, definition in ArduPilotParameters.table.when_stated.items()}
# Bits of USE_REV_THRUST for a mission without a landing.
_REVERSE_IN_FLIGHT = 0b1_1101
# Bit of USE_REV_THRUST for a return.
_REVERSE_IN_RETURN = 0b100_0000
# Bits of USE_REV_THRUST for a landing and for a landing sequence.
_REVERSE_IN_LANDING = 0b1000_0000_0010
# Bit of MIS_OPTIONS: continue the mission after a landing.
_CONTINUE_AFTER_LANDING = 0b100
# Highest TRIM_THROTTLE with which ArduPlane stops the motor (`Plane::calc_throttle`), 0..1.
_MOTOR_OFF_THROTTLE = 0.01
# RTL_AUTOLAND of a return along the mission's return path.
_BY_RETURN_PATH = 4.0
# Height from which a take-off banks freely, as a ratio to TKOFF_LVL_ALT.
_FREE_BANK_HEIGHT_RATIO = 3.0


def describe_open_settings(parameters: ArduPilotParameters, mission: MissionParts, *, by_program: bool) -> list[str]:
    r"""Describe the settings that change a mission's flight and are not simulated, without a full stop.

    by_program: True if ArduPlane's own program flies.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> made = ArduPilotParameters.of_text("LAND_PF_ARSPD 11\nKFF_THR2PTCH 2\n", "mine.param")
    >>> describe_open_settings(made, MissionParts(), by_program=False)
    ['KFF_THR2PTCH 2 changes the flight and is not flown']
    >>> describe_open_settings(made, MissionParts(lands=True), by_program=False)[1]
    'LAND_PF_ARSPD 11 changes the landing and is not flown'
    """
    is_flown = {Phase.FLIGHT: True, Phase.TAKE_OFF: mission.takes_off, Phase.LANDING: mission.lands}
    values = _DEFAULTS | {name: value for name, value, _ in parameters.values}
    texts = [
        f"{name} {values[name]:g} changes the {setting.phase} and is not flown"
        for name, setting in OPEN_SETTINGS.items()
        if is_flown[setting.phase]
        and not setting.lowest <= values[name] <= setting.highest
        and not (by_program and setting.by_program)
    ]
    return [*texts, *_describe_others(parameters, values, mission, by_program=by_program)]


def _describe_others(
    parameters: ArduPilotParameters, values: dict[str, float], mission: MissionParts, *, by_program: bool
) -> Iterator[str]:
    """Describe settings that depend on one another or on the mission."""
    # `Plane::set_servos_flaps` compares the demanded airspeed in whole m/s, which only a landing demands below the
    # minimum.
    min_airspeed = 0 if mission.lands else int(values["AIRSPEED_MIN"])
    for number in (1, 2):
        percent, flap_speed = values[f"FLAP_{number}_PERCNT"], values[f"FLAP_{number}_SPEED"]
        if percent != 0.0 and flap_speed > 0.0 and min_airspeed <= flap_speed:
            yield (
                f"FLAP_{number}_PERCNT {percent:g} below FLAP_{number}_SPEED {flap_speed:g}"
                " changes the flight and is not flown"
            )
    for name in ("ARSPD_WIND_MAX",) if by_program else ("AHRS_WIND_MAX", "ARSPD_WIND_MAX"):
        if 0.0 < values[name] < mission.wind:
            yield f"{name} {values[name]:g} in {mission.wind:.3g} m/s of wind changes the airspeed and is not flown"
    if mission.lands and int(values["MIS_OPTIONS"]) & _CONTINUE_AFTER_LANDING:
        yield f"MIS_OPTIONS {values['MIS_OPTIONS']:g} continues the mission after its landing, which is not flown"
    if by_program:
        return
    for airspeed in mission.throttled_airspeeds:
        if not parameters.airspeed_min <= airspeed <= parameters.airspeed_max:
            # `Plane::do_change_speed` falls through to the throttle.
            range_text = f"AIRSPEED_MIN {values['AIRSPEED_MIN']:g} to AIRSPEED_MAX {values['AIRSPEED_MAX']:g}"
            yield (
                f"DO_CHANGE_SPEED to {airspeed:g} m/s with a throttle sets TRIM_THROTTLE outside {range_text},"
                " which is not flown"
            )
    free_bank_height = _FREE_BANK_HEIGHT_RATIO * parameters.takeoff_level_height
    if mission.takes_off and values["TKOFF_ALT"] < free_bank_height:
        # `Plane::takeoff_calc_roll`.
        yield (
            f"TKOFF_ALT {values['TKOFF_ALT']:g} frees the bank of the take-off below {free_bank_height:g} m,"
            " which is not flown"
        )
    if parameters.throttle_cruise <= _MOTOR_OFF_THROTTLE:
        yield f"TRIM_THROTTLE {values['TRIM_THROTTLE']:g} stops the motor, which is not flown"
    reverse = _REVERSE_IN_FLIGHT | _REVERSE_IN_RETURN * mission.returns | _REVERSE_IN_LANDING * mission.lands
    if parameters.throttle_min < 0.0 and int(values["USE_REV_THRUST"]) & reverse:
        settings_text = f"THR_MIN {values['THR_MIN']:g} and USE_REV_THRUST {values['USE_REV_THRUST']:g}"
        yield f"{settings_text} reverse the thrust, which is not flown"
    if mission.returns and mission.has_return_path and parameters.rtl_autoland == _BY_RETURN_PATH:
        yield "RTL_AUTOLAND 4 returns along the mission's return path, which is not flown"
