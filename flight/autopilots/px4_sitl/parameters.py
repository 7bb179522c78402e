"""Collect PX4's parameters for a flight: from the simulation, the aircraft and the user.

The user's parameters have priority.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from aircraft.catalog import Aircraft
from flight.autopilots.parameter_files import LONGEST_NAME, read_parameter_file
from flight.autopilots.px4.open_settings import rate_gains
from flight.autopilots.px4.parameters import Px4Parameters
from flight.autopilots.px4_sitl.physics import AILERON, ELEVATOR, RUDDER, THROTTLE
from flight.simulation.setup import FlightSetup

# CA_SV_CSn_TYPE of the surface about each axis.
_SURFACES = {AILERON: 15.0, ELEVATOR: 3.0, RUDDER: 4.0}
# PWM_MAIN_FUNCn of the first motor.
_MOTOR_FUNCTION = 101.0
# PWM_MAIN_FUNCn of the first surface.
_SERVO_FUNCTION = 201.0

# Parameters for planfly's physics and a start in the air, for any aircraft.
SIMULATION = {
    # One motor and three surfaces, in the order of the outputs.
    "CA_AIRFRAME": 1.0,
    "CA_ROTOR_COUNT": 1.0,
    "CA_SV_CS_COUNT": float(len(_SURFACES)),
    **{f"CA_SV_CS{output}_TYPE": kind for output, kind in _SURFACES.items()},
    "CA_SV_CS0_TRQ_R": 1.0,
    "CA_SV_CS1_TRQ_P": 1.0,
    "CA_SV_CS2_TRQ_Y": 1.0,
    **{f"PWM_MAIN_FUNC{output + 1}": _SERVO_FUNCTION + output for output in _SURFACES},
    f"PWM_MAIN_FUNC{THROTTLE + 1}": _MOTOR_FUNCTION,
    # One of each sensor, without delay.
    "EKF2_MULTI_IMU": 0.0,
    "EKF2_MULTI_MAG": 0.0,
    "SENS_IMU_MODE": 1.0,
    "SENS_MAG_MODE": 1.0,
    "EKF2_GPS_DELAY": 0.0,
    "SENS_GPS0_DELAY": 0.0,
    # PX4 is held in MANUAL on the rail, with planfly as its joystick; no lost link ends a flight.
    "COM_RC_IN_MODE": 1.0,
    "COM_RC_OVERRIDE": 0.0,
    "NAV_RCL_ACT": 0.0,
    "NAV_DLL_ACT": 0.0,
    # No battery failsafe ends a flight: the verdict judges energy.
    "CBRK_SUPPLY_CHK": 894281.0,
    "COM_LOW_BAT_ACT": 0.0,
    "COM_FLTT_LOW_ACT": 0.0,
    "FD_FAIL_R": 0.0,
    "FD_FAIL_P": 0.0,
    # The mission starts and ends in the air.
    "MIS_TKO_LAND_REQ": 0.0,
    "MIS_DIST_1WP": 100_000.0,
    # The log lasts from arming to disarming.
    "SDLOG_MODE": 0.0,
    "SDLOG_PROFILE": 1.0,
    # The rudder coordinates turns, and does little more.
    "FW_YR_FF": 0.1,
    "FW_YR_P": 0.05,
    "FW_YR_I": 0.05,
}
# Prefixes of the user's parameters for flight; others belong to the hardware of the file.
FLYING = ("FW_", "NPFG_", "NAV_ACC_RAD", "NAV_FW_", "NAV_LOITER_RAD", "NAV_MIN_", "RTL_", "MIS_", "WEIGHT_", "CS_")


@dataclass(frozen=True, slots=True)
class Px4FlightParameters:
    """Parameters of a flight of PX4's program, by name.

    values: all parameters that replace PX4's own defaults.
    changed: values that the user's file states and that differ from the aircraft's, or that the aircraft lacks.
    unused: names in the user's file that PX4 does not get, because they belong to other hardware.
    """

    values: Mapping[str, float]
    changed: Mapping[str, float]
    unused: tuple[str, ...] = ()


def collect_px4_parameters(
    setup: FlightSetup, aircraft: Aircraft, law_parameters: Px4Parameters
) -> Px4FlightParameters:
    """Collect the parameters for a flight of the PX4 program.

    They come from the simulation, the aircraft and the user's file. FW_AIRSPD_TRIM is the mission's airspeed, unless
    the user states a value. Raises ParameterError if a file is invalid.
    """
    file = setup.scenario.flight.params
    user_values = {} if file is None else {name: entry.value for name, entry in read_parameter_file(Path(file)).items()}
    user_values |= law_parameters.by_origin("file")
    base = SIMULATION | rate_gains(aircraft) | law_parameters.by_origin("aircraft")
    base["FW_AIRSPD_TRIM"] = setup.airspeed
    flight_values = {
        name: value
        for name, value in user_values.items()
        if name.startswith(FLYING) and name not in SIMULATION and len(name) <= LONGEST_NAME
    }
    changed_values = {name: value for name, value in flight_values.items() if base.get(name) != value}
    return Px4FlightParameters(
        base | flight_values, changed_values, tuple(sorted(user_values.keys() - flight_values.keys()))
    )
