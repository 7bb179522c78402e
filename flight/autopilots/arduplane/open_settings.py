"""List ArduPlane's settings that change a flight but are not simulated.

These settings leave the verdict undecided.

Names, defaults and effects are from ArduPlane 4.6.3 and 4.7; docs/arduplane-branches.md lists the function of each.
Each is read from a parameter file, and has no part in the control law.
"""

import math
from collections.abc import Iterator
from enum import StrEnum
from typing import NamedTuple

from aircraft.catalog import Aircraft
from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.arming_checks import describe_failed_arming_checks
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.parameter_files import read_parameter_file
from flight.autopilots.parameter_set import AIRCRAFT_FILE
from flight.autopilots.parts import MissionParts
from flight.autopilots.rate_loop import RateGains, judge_rate_gains


class Phase(StrEnum):
    """Part of a flight that a setting changes."""

    FLIGHT = "flight"
    TAKE_OFF = "take-off"
    LANDING = "landing"


class OpenSetting(NamedTuple):
    """A setting of ArduPlane that is not simulated, with the values that do not change a flight.

    phase: the setting matters only where this part of a flight is flown.
    lowest, highest: range of values that change nothing.
    zero_is_off: True if 0 switches the setting off, and so changes nothing either.
    by_program: True if ArduPlane's own program flies it, with planfly's physics.
    """

    phase: Phase
    lowest: float = 0.0
    highest: float = 0.0
    zero_is_off: bool = False
    by_program: bool = False


_FLIGHT = Phase.FLIGHT
_TAKE_OFF = Phase.TAKE_OFF
_LANDING = Phase.LANDING
OPEN_SETTINGS = {
    # `Plane::stabilize_pitch_get_pitch_out` raises the pitch demand with the throttle.
    "KFF_THR2PTCH": OpenSetting(_FLIGHT, by_program=True),
    # `Plane::stabilize_yaw` steers by the rudder below this height; lower values concern take-off and landing alone.
    "GROUND_STEER_ALT": OpenSetting(_FLIGHT, 0.0, 20.0),
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
    # `AP_PitchController::get_servo_out`: the pitch that a turn needs, in its documented range.
    "PTCH2SRV_RLL": OpenSetting(_FLIGHT, 0.7, 1.5, by_program=True),
    # `AC_PID`: filters in Hz, and the trim that the integrator can hold.
    **{
        f"{axis}_RATE_{name}": OpenSetting(_FLIGHT, 1.0, math.inf, zero_is_off=True, by_program=True)
        for axis in ("RLL", "PTCH")
        for name in ("FLTT", "FLTE")
    },
    "RLL_RATE_IMAX": OpenSetting(_FLIGHT, 0.1, math.inf, by_program=True),
    "PTCH_RATE_IMAX": OpenSetting(_FLIGHT, 0.1, math.inf, by_program=True),
    # `AP_Airspeed::read`: no pressure becomes an airspeed.
    "ARSPD_RATIO": OpenSetting(_FLIGHT, 1e-9, math.inf),
    # `AP_AHRS_DCM` and `NavEKF3`: position, attitude and their sensors.
    "AHRS_GPS_USE": OpenSetting(_FLIGHT, 1.0, 2.0),
    "EK3_SRC1_POSXY": OpenSetting(_FLIGHT, 3.0, 3.0),
    "EK3_IMU_MASK": OpenSetting(_FLIGHT, 1.0, math.inf),
    "INS_ENABLE_MASK": OpenSetting(_FLIGHT, 1.0, math.inf),
    # `Plane::channel_function_mixer`: elevons and V-tails.
    "MIXING_GAIN": OpenSetting(_FLIGHT, 0.25, math.inf),
    "MIXING_OFFSET": OpenSetting(_FLIGHT, -500.0, 500.0),
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
# Number of airspeed sensors that ArduPlane 4.7 reads.
_AIRSPEED_SENSORS = 6
# Ways to judge a flight without an airspeed sensor: ArduPlane's own program simulates only the first sensor.
_WITHOUT_SENSOR_TEXT = (
    "ARSPD_USE 1 to simulate the flight with the sensor, or ARSPD_USE 0 to fly ArduPlane's own program (--sitl) without"
    " it"
)
# Values of AHRS_EKF_TYPE.
_EKF2 = 2.0
_EKF3 = 3.0
_EXTERNAL_AHRS = 11.0
# Values of EK3_SRC1_POSZ: barometer, GPS.
_HEIGHT_SOURCES = (1.0, 3.0)
# Largest TERRAIN_SPACING whose grid follows the ground as the elevation data do, m: ArduPlane's default.
_MAX_TERRAIN_SPACING_M = 100.0
# Number of outputs without SERVO_32_ENABLE.
_BASE_OUTPUT_COUNT = 16
# Servo functions of mixed surfaces: differential spoilers, elevons.
_ELEVON_FUNCTIONS = (16.0, 17.0, 86.0, 87.0, 77.0, 78.0)
# Servo functions by the part that they move: aileron, flaperons; elevator, V-tails; throttles.
_FUNCTIONS_BY_PART = {
    "ailerons": (4.0, 24.0, 25.0, *_ELEVON_FUNCTIONS),
    "elevator": (19.0, 79.0, 80.0, *_ELEVON_FUNCTIONS),
    "motor": (70.0, 73.0, 74.0),
}
# Pitch rate that a flight needs in addition to the pitch rate of turns, deg/s: a change of 10 deg within a second.
_PITCH_CHANGE_RATE_DEGPS = 10.0
# Highest bank for which ArduPlane computes the pitch rate of a turn, rad.
_MAX_COORDINATED_BANK_RAD = math.radians(80.0)
# Parameters of the rate controllers.
_RATE_GAIN_NAMES = (
    *(f"{axis}_RATE_{gain}" for axis in ("RLL", "PTCH") for gain in ("FF", "P", "I", "D")),
    *("RLL2SRV_TCONST", "PTCH2SRV_TCONST", "SCALING_SPEED"),
)
# Height from which a take-off banks freely, as a ratio to TKOFF_LVL_ALT.
_FREE_BANK_HEIGHT_RATIO = 3.0


def describe_open_settings(parameters: ArduPilotParameters, mission: MissionParts, *, by_program: bool) -> list[str]:
    r"""Return a sentence for each parameter that affects a mission's flight but is not simulated.

    The texts have no full stop.

    by_program: True if the ArduPlane program flies.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> parameters = ArduPilotParameters.from_text("LAND_PF_ARSPD 11\nKFF_THR2PTCH 2\n", "mine.param")
    >>> describe_open_settings(parameters, MissionParts(), by_program=False)
    ['KFF_THR2PTCH 2 affects the flight, but is not simulated']
    >>> describe_open_settings(parameters, MissionParts(lands=True), by_program=False)[1]
    'LAND_PF_ARSPD 11 affects the landing, but is not simulated'
    """
    is_flown = {Phase.FLIGHT: True, Phase.TAKE_OFF: mission.takes_off, Phase.LANDING: mission.lands}
    values = _DEFAULTS | {name: value for name, value, _ in parameters.values}
    texts = [
        f"{name} {values[name]:g} affects the {setting.phase}, but is not simulated"
        for name, setting in OPEN_SETTINGS.items()
        if is_flown[setting.phase]
        and not setting.lowest <= values[name] <= setting.highest
        and not (setting.zero_is_off and values[name] == 0.0)
        and not (by_program and setting.by_program)
    ]
    # Without an airspeed sensor in use, the text says how such a flight can be judged. `AP_Airspeed::update` takes the
    # first sensor if the primary one is missing.
    primary = int(values["ARSPD_PRIMARY"]) + 1
    prefixes = {number: f"ARSPD{number if number > 1 else ''}" for number in range(1, _AIRSPEED_SENSORS + 1)}
    present = [number for number, prefix in prefixes.items() if values[f"{prefix}_TYPE"] != 0.0]
    if values["ARSPD_ENABLE"] == 0.0 or not present:
        name = "ARSPD_TYPE" if values["ARSPD_ENABLE"] else "ARSPD_ENABLE"
        remedy_text = f"set {name} 1, and {_WITHOUT_SENSOR_TEXT}"
        texts.append(f"{name} 0 leaves no airspeed sensor, which is not simulated; {remedy_text}")
    else:
        name = f"{prefixes[primary if primary in present else present[0]]}_USE"
        if values[name] != 1.0:
            use_text = f"{name} {values[name]:g} affects the flight, but is not simulated"
            texts.append(f"{use_text}; set {_WITHOUT_SENSOR_TEXT}")
    # Settings with which ArduPlane has no position, or uses another estimator than EKF3.
    type_names: tuple[str, ...] = ("GPS1_TYPE", "GPS2_TYPE")
    if values["GPS_AUTO_SWITCH"] == 0.0:
        type_names = type_names[int(values["GPS_PRIMARY"] != 0.0) :][:1]
    if not any(values[name] for name in type_names):
        verb = "leave" if len(type_names) > 1 else "leaves"
        texts.append(f"{' and '.join(type_names)} 0 {verb} no GPS, and so no position, which is not simulated")
    estimator, height_source = values["AHRS_EKF_TYPE"], values["EK3_SRC1_POSZ"]
    # `AP_AHRS::init` replaces EKF2 by EKF3.
    enabling = {_EKF2: "", _EKF3: "EK3_ENABLE", _EXTERNAL_AHRS: "EAHRS_TYPE"}
    if estimator not in enabling:
        texts.append(f"AHRS_EKF_TYPE {estimator:g} estimates the position without EKF3, which is not simulated")
    elif enabling[estimator] and values[enabling[estimator]] == 0.0:
        estimator_text = f"{enabling[estimator]} 0 with AHRS_EKF_TYPE {estimator:g}"
        texts.append(f"{estimator_text} leaves no position, which is not simulated")
    if height_source not in _HEIGHT_SOURCES:
        source_text = f"EK3_SRC1_POSZ {height_source:g} uses neither barometer nor GPS for the altitude"
        texts.append(f"{source_text}, which is not simulated")
    texts += describe_failed_arming_checks(parameters, values, mission)
    return [*texts, *_describe_dependent_settings(parameters, values, mission, by_program=by_program)]


def _describe_dependent_settings(
    parameters: ArduPilotParameters, values: dict[str, float], mission: MissionParts, *, by_program: bool
) -> Iterator[str]:
    """Yield a sentence for each open setting whose effect depends on other settings, mission or aircraft."""
    # Each control (ailerons, elevator, motor) to which a user's file with servo parameters assigns no servo output.
    count = 2 * _BASE_OUTPUT_COUNT if values["SERVO_32_ENABLE"] else _BASE_OUTPUT_COUNT
    pins = int(values["SERVO_GPIO_MASK"])
    outputs = [output for output in range(1, count + 1) if not pins & 1 << (output - 1)]
    moving_outputs = [output for output in outputs if values[f"SERVO{output}_MIN"] < values[f"SERVO{output}_MAX"]]
    functions = {values[f"SERVO{output}_FUNCTION"] for output in moving_outputs}
    names = f"SERVO1_FUNCTION to SERVO{count}_FUNCTION" + (f" without SERVO_GPIO_MASK {pins}" if pins else "")
    names += " with SERVOn_MIN below SERVOn_MAX" if moving_outputs != outputs else ""
    states_outputs = any(name.startswith("SERVO") for name in parameters.by_origin("file"))
    for part, moving in _FUNCTIONS_BY_PART.items():
        if states_outputs and functions.isdisjoint(moving):
            yield f"{names} move no {part}, which is not simulated"
    if mission.follows_terrain and parameters.terrain_spacing > _MAX_TERRAIN_SPACING_M:
        # `AP_Terrain::height_amsl` interpolates between points of that spacing.
        yield (
            f"TERRAIN_SPACING {parameters.terrain_spacing:g} m makes ArduPlane's terrain coarser than the elevation"
            " data, which is not simulated"
        )
    yield from _describe_rate_gains(parameters, mission.aircraft)
    # `Plane::set_servos_flaps` compares the demanded airspeed in whole m/s, which only a landing demands below the
    # minimum.
    min_airspeed = 0 if mission.lands else int(values["AIRSPEED_MIN"])
    for number in (1, 2):
        percent, flap_speed = values[f"FLAP_{number}_PERCNT"], values[f"FLAP_{number}_SPEED"]
        if percent != 0.0 and flap_speed > 0.0 and min_airspeed <= flap_speed:
            yield (
                f"FLAP_{number}_PERCNT {percent:g} moves the flaps below FLAP_{number}_SPEED {flap_speed:g} m/s,"
                " which is not simulated"
            )
    for name in ("ARSPD_WIND_MAX",) if by_program else ("AHRS_WIND_MAX", "ARSPD_WIND_MAX"):
        if 0.0 < values[name] < mission.wind:
            yield f"{name} {values[name]:g} in {mission.wind:.3g} m/s wind affects the airspeed, but is not simulated"
    if mission.lands and int(values["MIS_OPTIONS"]) & _CONTINUE_AFTER_LANDING:
        yield f"MIS_OPTIONS {values['MIS_OPTIONS']:g} continues the mission after its landing, which is not simulated"
    if by_program:
        return
    # Pitch rate limits that are too low for turns or for pitch changes: `AP_PitchController::get_servo_out` limits the
    # sum of two rates, the rate that a turn needs, and the rate that changes the pitch.
    bank = parameters.roll_limit
    turn_rate = math.degrees(GRAVITY / parameters.airspeed_cruise * math.tan(min(bank, _MAX_COORDINATED_BANK_RAD)))
    needed_rates = {
        "PTCH2SRV_RMAX_UP": turn_rate * math.sin(bank) + _PITCH_CHANGE_RATE_DEGPS,
        "PTCH2SRV_RMAX_DN": _PITCH_CHANGE_RATE_DEGPS,
    }
    for name, needed_rate in needed_rates.items():
        if 0.0 < values[name] < needed_rate:
            rate_text = f"is below the {needed_rate:.3g} deg/s that the flight needs"
            yield f"{name} {values[name]:g} {rate_text}, which is not simulated"
    for airspeed in mission.throttled_airspeeds:
        if not parameters.airspeed_min <= airspeed <= parameters.airspeed_max:
            # `Plane::do_change_speed` falls through to the throttle.
            range_text = f"AIRSPEED_MIN {values['AIRSPEED_MIN']:g} to AIRSPEED_MAX {values['AIRSPEED_MAX']:g}"
            yield (
                f"DO_CHANGE_SPEED to {airspeed:g} m/s is outside {range_text}, so that its throttle sets TRIM_THROTTLE,"
                " which is not simulated"
            )
    free_bank_height = _FREE_BANK_HEIGHT_RATIO * parameters.takeoff_level_height
    if mission.takes_off and values["TKOFF_ALT"] < free_bank_height:
        # `Plane::takeoff_calc_roll`.
        yield (
            f"TKOFF_ALT {values['TKOFF_ALT']:g} removes the bank limit of the take-off below {free_bank_height:g} m,"
            " which is not simulated"
        )
    if parameters.throttle_cruise <= _MOTOR_OFF_THROTTLE:
        yield f"TRIM_THROTTLE {values['TRIM_THROTTLE']:g} stops the motor, which is not simulated"
    reverse = _REVERSE_IN_FLIGHT | _REVERSE_IN_RETURN * mission.returns | _REVERSE_IN_LANDING * mission.lands
    if parameters.throttle_min < 0.0 and int(values["USE_REV_THRUST"]) & reverse:
        settings_text = f"THR_MIN {values['THR_MIN']:g} and USE_REV_THRUST {values['USE_REV_THRUST']:g}"
        yield f"{settings_text} reverse the thrust, which is not simulated"
    if mission.returns and mission.has_return_path and parameters.rtl_autoland == _BY_RETURN_PATH:
        yield "RTL_AUTOLAND 4 returns along the mission's return path, which is not simulated"


def _describe_rate_gains(parameters: ArduPilotParameters, aircraft: Aircraft | None) -> Iterator[str]:
    """Yield a sentence for each of the user's gains that is too low or too high to control the attitude.

    The gains in the aircraft's file and ArduPlane's defaults are assumed to suit the aircraft.
    """
    aircraft_values: dict[str, float] = {}
    if aircraft is not None and (aircraft.folder / AIRCRAFT_FILE).exists():
        entries = read_parameter_file(aircraft.folder / AIRCRAFT_FILE)
        aircraft_values = {name: entry.value for name, entry in entries.items()}
    file_values = parameters.by_origin("file")
    values = {name: parameters.table.by_name[name].default for name in _RATE_GAIN_NAMES} | aircraft_values | file_values
    # `Plane::calc_speed_scaler`: scale the gains to the speed for which the aircraft's own gains are stated.
    scale = values["SCALING_SPEED"] / aircraft_values.get("SCALING_SPEED", values["SCALING_SPEED"])
    for axis, time_constant in (("RLL", "RLL2SRV_TCONST"), ("PTCH", "PTCH2SRV_TCONST")):
        names = [f"{axis}_RATE_{gain}" for gain in ("FF", "P", "I", "D")]
        if file_values.keys().isdisjoint((*names, time_constant, "SCALING_SPEED")):
            continue
        # `AP_FW_Controller::_get_rate_out` scales the feed-forward with the speed ratio, the others with its square.
        feed_forward, p, i, d = (values[name] for name in names)
        gains = RateGains(feed_forward * scale, p * scale**2, i * scale**2, d * scale**2)
        default = parameters.table.by_name[names[0]].default
        feed_forwards = (aircraft_values.get(names[0]) or default, default)
        fault = judge_rate_gains(gains, (min(feed_forwards), max(feed_forwards)), values[time_constant])
        if fault:
            gains_text = ", ".join(f"{name} {values[name]:g}" for name in [*names[1:], names[0], time_constant])
            yield f"{gains_text}: these gains are {fault} to hold the attitude, which is not simulated"
