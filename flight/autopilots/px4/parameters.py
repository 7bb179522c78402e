"""Define PX4's parameters for fixed-wing missions, in SI units and radians.

Names, units, ranges and defaults are from PX4's parameter reference (docs.px4.io, v1.16 and v1.17) and the `*_params.c`
files next to the modules that read them. PX4 itself enforces no range: a value outside the documented range is
accepted and reported if it can be flown (FW_R_LIM is documented from 35 degrees, and 30 is flown). A parameter is
taken from the first source that states it: the user's file, the aircraft, PX4's defaults. An aircraft's folder
describes the aircraft once, in `ardupilot.parm`: `FROM_ARDUPILOT` lists which of those values are the same quantity in
PX4.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, get_args

import numpy as np

from flight.autopilots.parameter_files import Entry
from flight.autopilots.parameter_origin import PX4
from flight.autopilots.parameter_set import Definition, ParameterSet, ParameterTable
from flight.autopilots.parts import Candidate
from world.errors import ParameterError
from world.kernels import Record, record_dtype
from world.scenario_tables import NEWEST_PX4, Px4Version

_VERSIONS: tuple[Px4Version, ...] = get_args(Px4Version)

_RAD_PER_DEG = math.pi / 180.0


# Definitions by the field of `PX4_PARAMETERS`; parameters that are not simulated stand at the end.
DEFINITIONS = {
    # Lateral guidance.
    "npfg_period": Definition("NPFG_PERIOD", 10.0, 0.5, 1000.0, documented=(1.0, 100.0)),
    "npfg_damping": Definition("NPFG_DAMPING", 0.7, 0.05, 5.0, documented=(0.1, 1.0)),
    "npfg_enables_period_lower_bound": Definition("NPFG_LB_PERIOD", 1.0, 0.0, 1.0),
    "npfg_enables_period_upper_bound": Definition("NPFG_UB_PERIOD", 1.0, 0.0, 1.0),
    "npfg_roll_time_constant": Definition("NPFG_ROLL_TC", 0.5, 0.0, 20.0, documented=(0.0, 2.0)),
    "npfg_switch_distance_multiplier": Definition("NPFG_SW_DST_MLT", 0.32, 0.0, 10.0, documented=(0.1, 1.0)),
    "npfg_period_safety_factor": Definition("NPFG_PERIOD_SF", 1.5, 1.0, 10.0),
    "min_ground_speed": Definition("FW_GND_SPD_MIN", 5.0, 0.0, 40.0),
    "roll_limit": Definition("FW_R_LIM", 50.0, 5.0, 85.0, _RAD_PER_DEG, documented=(35.0, 75.0)),
    "roll_slew_rate": Definition("FW_PN_R_SLEW_MAX", 90.0, 0.0, 1000.0, _RAD_PER_DEG),
    "roll_time_constant": Definition("FW_R_TC", 0.4, 0.02, 10.0, documented=(0.2, 1.0)),
    "roll_rate_max": Definition("FW_R_RMAX", 70.0, 0.0, 720.0, _RAD_PER_DEG, documented=(0.0, 180.0)),
    # Switching of waypoints.
    "acceptance_radius": Definition("NAV_ACC_RAD", 10.0, 0.05, 10_000.0, documented=(0.05, 200.0)),
    "altitude_acceptance_radius": Definition("NAV_FW_ALT_RAD", 10.0, 0.05, 10_000.0, documented=(0.05, 200.0)),
    "loiter_radius": Definition("NAV_LOITER_RAD", 80.0, -10_000.0, 10_000.0),
    # Altitude and speed.
    "target_climb_rate": Definition("FW_T_CLMB_R_SP", 3.0, 0.1, 1000.0, documented=(0.5, 15.0)),
    "target_sink_rate": Definition("FW_T_SINK_R_SP", 2.0, 0.1, 1000.0, documented=(0.5, 15.0)),
    "max_climb_rate": Definition("FW_T_CLMB_MAX", 5.0, 0.1, 100.0, documented=(1.0, 15.0)),
    "min_sink_rate": Definition("FW_T_SINK_MIN", 2.0, 0.1, 100.0, documented=(1.0, 15.0)),
    "max_sink_rate": Definition("FW_T_SINK_MAX", 5.0, 0.1, 100.0, documented=(1.0, 15.0)),
    "altitude_time_constant": Definition("FW_T_ALT_TC", 5.0, 0.1, 1000.0, documented=(2.0, 50.0)),
    "altitude_rate_feedforward": Definition("FW_T_HRATE_FF", 0.3, 0.0, 1.0),
    "airspeed_time_constant": Definition("FW_T_TAS_TC", 5.0, 0.1, 1000.0, documented=(2.0, 50.0)),
    "integrator_gain_pitch": Definition("FW_T_I_GAIN_PIT", 0.1, 0.0, 20.0, documented=(0.0, 2.0)),
    "pitch_damping_gain": Definition("FW_T_PTCH_DAMP", 0.1, 0.0, 20.0, documented=(0.0, 2.0)),
    "seb_rate_feedforward": Definition("FW_T_SEB_R_FF", 1.0, 0.0, 3.0, documented=(0.5, 1.5)),
    "throttle_damping_gain": Definition("FW_T_THR_DAMPING", 0.05, 0.0, 10.0, documented=(0.0, 1.0)),
    "integrator_gain_throttle": Definition("FW_T_THR_INTEG", 0.02, 0.0, 10.0, documented=(0.0, 1.0)),
    "load_factor_correction": Definition("FW_T_RLL2THR", 15.0, 0.0, 200.0, documented=(0.0, 20.0)),
    "pitch_speed_weight": Definition("FW_T_SPDWEIGHT", 1.0, 0.0, 2.0),
    "ste_rate_time_constant": Definition("FW_T_STE_R_TC", 0.4, 0.0, 20.0, documented=(0.0, 2.0)),
    "vertical_acceleration_limit": Definition("FW_T_VERT_ACC", 7.0, 0.1, 100.0, documented=(1.0, 10.0)),
    "airspeed_std_dev": Definition("FW_T_SPD_STD", 0.07, 0.01, 10.0),
    "airspeed_rate_std_dev": Definition("FW_T_SPD_DEV_STD", 0.2, 0.01, 10.0),
    "airspeed_rate_noise_std_dev": Definition("FW_T_SPD_PRC_STD", 0.2, 0.01, 10.0),
    "airspeed_min": Definition("FW_AIRSPD_MIN", 10.0, 0.5, 500.0),
    "airspeed_trim": Definition("FW_AIRSPD_TRIM", 15.0, 0.5, 500.0),
    "airspeed_max": Definition("FW_AIRSPD_MAX", 20.0, 0.5, 500.0),
    "pitch_limit_min": Definition("FW_P_LIM_MIN", -30.0, -80.0, 0.0, _RAD_PER_DEG, documented=(-60.0, 0.0)),
    "pitch_limit_max": Definition("FW_P_LIM_MAX", 30.0, 0.0, 80.0, _RAD_PER_DEG, documented=(0.0, 60.0)),
    "pitch_trim": Definition("FW_PSP_OFF", 0.0, -90.0, 90.0, _RAD_PER_DEG),
    "pitch_time_constant": Definition("FW_P_TC", 0.4, 0.02, 10.0, documented=(0.2, 1.0)),
    "throttle_trim": Definition("FW_THR_TRIM", 0.6, 0.0, 1.0),
    "throttle_min": Definition("FW_THR_MIN", 0.0, 0.0, 1.0),
    "throttle_max": Definition("FW_THR_MAX", 1.0, 0.0, 1.0),
    "throttle_slew_rate": Definition("FW_THR_SLEW_MAX", 0.0, 0.0, 100.0, documented=(0.0, 1.0)),
    # RTL.
    "rtl_altitude": Definition("RTL_RETURN_ALT", 100.0, 0.0, 10_000.0),
    "rtl_descend_altitude": Definition("RTL_DESCEND_ALT", 100.0, 0.0, 10_000.0),
    "rtl_loiter_radius": Definition("RTL_LOITER_RAD", 80.0, 1.0, 10_000.0),
    "rtl_type": Definition("RTL_TYPE", 1.0, 0.0, 5.0),
    # Mission checks.
    "takeoff_landing_requirement": Definition("MIS_TKO_LAND_REQ", 2.0, 0.0, 5.0),
    "landing_angle": Definition("FW_LND_ANG", 5.0, 1.0, 45.0, _RAD_PER_DEG),
    # Not simulated.
    "uses_airspeed": Definition("FW_USE_AIRSPD", 1.0, 0.0, 1.0),
    "enables_min_ground_speed": Definition("NPFG_EN_MIN_GSP", 1.0, 0.0, 1.0),
    "landing_altitude_acceptance_radius": Definition("NAV_FW_ALTL_RAD", 5.0, 0.05, 200.0),
    "track_keeping": Definition("NPFG_TRACK_KEEP", 1.0, 0.0, 1.0),
    "excess_wind": Definition("NPFG_WIND_REG", 1.0, 0.0, 1.0),
    "track_keeping_speed": Definition("NPFG_GSP_MAX_TK", 5.0, 0.0, 50.0),
    "fast_descend_altitude_error": Definition("FW_T_F_ALT_ERR", -1.0, -1.0, 10_000.0),
    "throttle_trim_min_airspeed": Definition("FW_THR_ASPD_MIN", 0.0, 0.0, 1.0),
    "throttle_trim_max_airspeed": Definition("FW_THR_ASPD_MAX", 0.0, 0.0, 1.0),
    "wind_airspeed_scale": Definition("FW_WIND_ARSP_SC", 0.0, 0.0, 10.0),
    "weight_base": Definition("WEIGHT_BASE", -1.0, -1.0, 10_000.0),
    "weight_gross": Definition("WEIGHT_GROSS", -1.0, -1.0, 10_000.0),
    "service_ceiling": Definition("FW_SERVICE_CEIL", -1.0, -1.0, 20_000.0),
    "rtl_land_delay": Definition("RTL_LAND_DELAY", -1.0, -1.0, 10_000.0),
    "fence_action": Definition("GF_ACTION", 2.0, 0.0, 5.0),
    "fence_max_distance": Definition("GF_MAX_HOR_DIST", 0.0, 0.0, 1e6),
    "fence_max_altitude": Definition("GF_MAX_VER_DIST", 0.0, 0.0, 1e6),
    "max_flight_time": Definition("COM_FLT_TIME_MAX", -1.0, -1.0, 1e6),
}
# Parameters that are read but not simulated with a value other than PX4's default.
NOT_SIMULATED = tuple(definition.name for definition in list(DEFINITIONS.values())[-18:])
# Minimum number of parameters in a complete set: a ground station saves more than a thousand.
_COMPLETE_SET_COUNT = 300
# Parameters whose values should not decrease from one to the next; PX4 warns of some such values and flies with them.
_ORDERS = (
    ("FW_THR_MIN", "FW_THR_TRIM", "FW_THR_MAX"),
    ("FW_AIRSPD_MIN", "FW_AIRSPD_TRIM", "FW_AIRSPD_MAX"),
    ("FW_P_LIM_MIN", "FW_PSP_OFF", "FW_P_LIM_MAX"),
    ("FW_T_SINK_MIN", "FW_T_SINK_MAX"),
    ("FW_T_SINK_R_SP", "FW_T_SINK_MAX"),
    ("FW_T_CLMB_R_SP", "FW_T_CLMB_MAX"),
)
# Minimum and maximum; the minimum must be lower.
_PAIRS = (("FW_THR_MIN", "FW_THR_MAX"), ("FW_AIRSPD_MIN", "FW_AIRSPD_MAX"))

PX4_PARAMETERS = record_dtype(
    *DEFINITIONS,
    ("uses_switch_distance", np.bool_),  # True if the navigator uses guidance's own switch distance: up to 1.16
    # Gains of the airspeed filter, see `speed_filter_gains`.
    "kalman_gain_00",
    "kalman_gain_01",
    "kalman_gain_10",
    "kalman_gain_11",
)
# ArduPlane's parameters of an aircraft that PX4 has under another name, with the factor to PX4's unit.
FROM_ARDUPILOT = {
    "AIRSPEED_CRUISE": ("FW_AIRSPD_TRIM", 1.0),
    "AIRSPEED_MIN": ("FW_AIRSPD_MIN", 1.0),
    "AIRSPEED_MAX": ("FW_AIRSPD_MAX", 1.0),
    "ROLL_LIMIT_DEG": ("FW_R_LIM", 1.0),
    "PTCH_LIM_MAX_DEG": ("FW_P_LIM_MAX", 1.0),
    "PTCH_LIM_MIN_DEG": ("FW_P_LIM_MIN", 1.0),
    "PTCH_TRIM_DEG": ("FW_PSP_OFF", 1.0),
    "TRIM_THROTTLE": ("FW_THR_TRIM", 0.01),
    "THR_MIN": ("FW_THR_MIN", 0.01),
    "THR_MAX": ("FW_THR_MAX", 0.01),
    "TECS_CLMB_MAX": ("FW_T_CLMB_MAX", 1.0),
    "TECS_SINK_MIN": ("FW_T_SINK_MIN", 1.0),
    "TECS_SINK_MAX": ("FW_T_SINK_MAX", 1.0),
}
# Slew rates of servos and motors, s for the whole range.
SLEW_NAMES = (*(f"CA_SV{servo}_SLEW" for servo in range(8)), *(f"CA_R{rotor}_SLEW" for rotor in range(12)))
# Drivers of outputs with the number of their outputs.
_OUTPUT_COUNT_BY_DRIVER = {
    "PWM_MAIN": 14,
    "PWM_AUX": 11,
    "PCA9685": 16,
    "UAVCAN_EC": 8,
    "UAVCAN_SV": 8,
    "HIL_ACT": 16,
    "SIM_GZ_EC": 8,
    "SIM_GZ_SV": 8,
    "TAP_ESC": 8,
    "VOXL_ESC": 4,
    "VOXL2_IO": 4,
}
# Functions of the outputs: motors, surfaces, others, or 0 for none.
OUTPUT_FUNCTION_NAMES = tuple(
    f"{driver}_FUNC{output}" for driver, count in _OUTPUT_COUNT_BY_DRIVER.items() for output in range(1, count + 1)
)
# Parameters that may leave a verdict undecided (`flight.autopilots.px4.autopilot.Px4.describe_unsimulated_settings`),
# or that state the reaction to a lost link (`flight.autopilots.px4.failsafes`).
_WHEN_STATED = {
    "ASPD_PRIMARY": 1.0,
    "BAT_AVRG_CURRENT": 15.0,
    "BAT_CRIT_THR": 0.07,
    "BAT_EMERGEN_THR": 0.05,
    "BAT1_CAPACITY": -1.0,
    "CBRK_FLIGHTTERM": 121212.0,
    # Loss of a radio link (`flight.autopilots.px4.failsafes`).
    **dict.fromkeys(("COM_DLL_EXCEPT", "COM_RCL_EXCEPT", "NAV_DLL_ACT"), 0.0),
    "COM_DL_LOSS_T": 10.0,
    "COM_FAIL_ACT_T": 5.0,
    "COM_RC_IN_MODE": 3.0,
    "COM_RC_LOSS_T": 0.5,
    "NAV_RCL_ACT": 2.0,
    "COM_FLTT_LOW_ACT": 0.0,
    "COM_ARM_AUTH_REQ": 0.0,
    "COM_LOW_BAT_ACT": 0.0,
    "COM_WIND_MAX": -1.0,
    "COM_WIND_MAX_ACT": 0.0,
    "FD_FAIL_P": 60.0,
    "FD_FAIL_R": 60.0,
    "FW_LND_EARLYCFG": 0.0,
    "FW_LND_THRTC_SC": 1.0,
    "FW_P_RMAX_NEG": 60.0,
    "FW_P_RMAX_POS": 60.0,
    "FW_T_THR_LOW_HGT": -1.0,
    "GF_PREDICT": 0.0,
    "MIS_COMMAND_TOUT": 0.0,
    "RTL_TIME_FACTOR": 1.1,
    "RTL_TIME_MARGIN": 100.0,
    "FW_Y_RMAX": 50.0,
    # Gains of the rate controllers.
    **dict.fromkeys(("FW_RR_FF", "FW_PR_FF"), 0.5),
    **dict.fromkeys(("FW_RR_I", "FW_PR_I"), 0.1),
    **dict.fromkeys(("FW_RR_D", "FW_PR_D"), 0.0),
    "FW_RR_P": 0.05,
    "FW_PR_P": 0.08,
    # Position, altitude and arming.
    **dict.fromkeys(("COM_ARMABLE", "EKF2_BARO_CTRL", "EKF2_EN", "EKF2_HGT_REF", "SYS_HAS_BARO", "SYS_HAS_GPS"), 1.0),
    **dict.fromkeys(("CYPHAL_ENABLE", "GPS_2_CONFIG", "SEP_PORT1_CFG", "SYS_HITL", "UAVCAN_ENABLE"), 0.0),
    **dict.fromkeys(("SENS_EN_GPSSIM", "SIM_GZ_EN"), 0.0),
    "EKF2_GPS_CTRL": 7.0,
    "GPS_1_CONFIG": 201.0,
    # Surfaces and motors.
    **dict.fromkeys(("CA_AIRFRAME", "CA_ROTOR_COUNT", "CA_SV_CS_COUNT"), 0.0),
    "SYS_CTRL_ALLOC": 1.0,
    **{f"CA_SV_CS{surface}_TYPE": 0.0 for surface in range(8)},
    **{f"CA_SV_CS{surface}_TRQ_{axis}": 1.0 for surface in range(8) for axis in "RP"},
    **dict.fromkeys(SLEW_NAMES, 0.0),
    **dict.fromkeys(OUTPUT_FUNCTION_NAMES, 0.0),
    "NAV_MIN_GND_DIST": -1.0,
}
TABLE = ParameterTable(
    PX4,
    "PX4",
    DEFINITIONS,
    pairs=_PAIRS,
    orders=_ORDERS,
    when_stated=[Definition(name, default, -math.inf, math.inf) for name, default in _WHEN_STATED.items()],
    log_digits=6,
)


@dataclass(frozen=True, slots=True)
class Px4Parameters(ParameterSet):
    r"""Parameters of PX4.

    version: release of PX4.
    notes: notes on a parameter file that another release wrote; not stored in a log.

    >>> default = Px4Parameters.defaults()
    >>> round(default["FW_R_LIM"], 3), default["NAV_ACC_RAD"], Px4Parameters.defaults("1.16").uses_switch_distance
    (0.873, 10.0, True)
    >>> default.changed(NAV_ACC_RAD=56.0)["NAV_ACC_RAD"]
    56.0
    >>> Px4Parameters.from_text("1\t1\tNAV_ACC_RAD\t30.0\t9\n1\t1\tBAT1_N_CELLS\t3\t6\n", "mine.params").unused
    ('BAT1_N_CELLS',)
    >>> Px4Parameters.from_text("FW_R_LIM 30", "mine.params").outside_documented_ranges
    ('FW_R_LIM 30 (35..75)',)
    >>> Px4Parameters.from_text("FW_AIRSPD_TRIM 25", "mine.params").contradictions
    ('FW_AIRSPD_TRIM 25 of the file is above FW_AIRSPD_MAX 20 of the defaults',)
    >>> parameters, notes = Px4Parameters.from_log({"NAV_ACC_RAD": -5.0, "FW_R_LIM": 45.0}, "a.ulg", "1.16")
    >>> parameters.by_origin("file"), notes
    ({'FW_R_LIM': 45.0}, ('NAV_ACC_RAD -5 in the log is outside 0.05..10000: the default is used',))
    """

    table: ClassVar[ParameterTable] = TABLE
    not_simulated: ClassVar[tuple[str, ...]] = NOT_SIMULATED
    version: Px4Version = NEWEST_PX4
    notes: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        """Raise ParameterError if the version of PX4 is unknown."""
        if self.version not in _VERSIONS:
            allowed = f"expected {' or '.join(_VERSIONS)}"
            message = f"px4_version: {self.version!r}: {allowed}"
            raise ParameterError(message, file=self.source, field="px4_version", value=self.version, allowed=allowed)

    @classmethod
    def _read_aircraft_values(cls, entries: Mapping[str, Entry]) -> dict[str, float]:
        """Return the values in the aircraft's file for ArduPlane, converted to PX4's parameters and ranges.

        Parameters that PX4 does not have are omitted.
        """
        values = {}
        for name, entry in entries.items():
            if name in FROM_ARDUPILOT:
                px4_name, factor = FROM_ARDUPILOT[name]
                definition = TABLE.by_name[px4_name]
                values[px4_name] = min(definition.high, max(definition.low, entry.value * factor))
        return values

    @classmethod
    def _is_relevant(cls, definition: Definition, value: float) -> bool:
        """Return True for a parameter that is simulated, or whose value differs from its default.

        A ground station saves every parameter, so a default value in a file does not mean that the user has set it.
        """
        return definition.name not in NOT_SIMULATED or value != definition.default

    @property
    def is_complete_set(self) -> bool:
        """True if the user's file is a complete set of parameters.

        In this case a parameter that the file lacks has the default of the release.
        """
        return len(self.unused) + len(self.by_origin("file")) >= _COMPLETE_SET_COUNT

    @property
    def uses_switch_distance(self) -> bool:
        """True if the navigator uses the switch distance of the guidance (NPFG), as releases up to 1.16 do.

        Up to 1.16 the position controller published this distance. The modules that replace the controller in 1.17 do
        not.
        """
        return self.version == "1.16"

    def record(self) -> Record:
        """Return the parameters for compiled code, as a record of `PX4_PARAMETERS`."""
        record: Record = np.zeros(1, PX4_PARAMETERS)[0]
        for (field_name, definition), parameter in zip(DEFINITIONS.items(), self.values, strict=False):
            setattr(record, field_name, parameter.value * definition.to_si)
        record.uses_switch_distance = self.uses_switch_distance
        gains = speed_filter_gains(
            record.airspeed_std_dev, record.airspeed_rate_std_dev, record.airspeed_rate_noise_std_dev
        )
        record.kalman_gain_00, record.kalman_gain_01, record.kalman_gain_10, record.kalman_gain_11 = gains
        return record


def speed_filter_gains(
    speed_sigma: float, rate_sigma: float, process_sigma: float
) -> tuple[float, float, float, float]:
    """Return the 2x2 steady-state Kalman gains of the airspeed filter, row by row (PX4: kKg00 to kKg11).

    The first row corrects the airspeed, the second row the airspeed rate. The first column applies to the error of the
    measured airspeed, the second to the error of the measured rate. The units are 1/s and 1 in the first row, 1/s^2 and
    1/s in the second.

    speed_sigma, rate_sigma: standard deviations of the measured airspeed (m/s) and of its measured rate (m/s^2).
    process_sigma: standard deviation of the noise that drives the rate, m/s^2.

    The filter is a Kalman-Bucy filter on an integrator chain (Kalman and Bucy 1961, J. Basic Eng. 83, 95-108), as the
    reference describes PX4's parameters FW_T_SPD_*.

    >>> [round(gain, 2) for gain in speed_filter_gains(0.07, 0.2, 0.2)]
    [1.92, 0.26, 2.12, 0.67]
    """
    dynamics, precision = np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([speed_sigma**-2.0, rate_sigma**-2.0])
    # Solve the Riccati equation by the stable eigenvectors of its Hamiltonian (Potter 1966, SIAM J. Appl. Math. 14,
    # 496-501).
    hamiltonian = np.block([[dynamics.T, -precision], [-np.diag([0.0, process_sigma * process_sigma]), -dynamics]])
    eigenvalues, eigenvectors = np.linalg.eig(hamiltonian)
    stable_vectors = eigenvectors[:, eigenvalues.real < 0.0]
    gains = np.real(stable_vectors[2:] @ np.linalg.inv(stable_vectors[:2])) @ precision
    return float(gains[0, 0]), float(gains[0, 1]), float(gains[1, 0]), float(gains[1, 1])


# ----------------------------------------------------------------------
# Parameters that may cause a flight to fail, with the steps and ranges of the parameter reference.

HEIGHT_CANDIDATES = (
    Candidate("FW_T_CLMB_R_SP", 0.5, 6.0, "m/s"),
    Candidate("FW_T_SINK_R_SP", 0.5, 6.0, "m/s"),
    Candidate("FW_T_HRATE_FF", 0.1, 1.0, ""),
    Candidate("FW_T_ALT_TC", 0.5, 2.0, "s"),
    Candidate("FW_THR_MAX", 0.05, 1.0, ""),
)
# Largest value of FW_P_LIM_MAX that is tried, rad.
MAX_TRIED_PITCH_RAD = math.radians(45.0)
PITCH_CANDIDATE = Candidate("FW_P_LIM_MAX", 1.0, math.degrees(MAX_TRIED_PITCH_RAD), "deg")
SIDE_CANDIDATES = (
    Candidate("NAV_ACC_RAD", 5.0, 60.0, "m"),
    Candidate("NAV_ACC_RAD", 5.0, 90.0, "m"),
    Candidate("NAV_ACC_RAD", 5.0, 120.0, "m"),
    # Back to PX4's default.
    Candidate("NAV_ACC_RAD", 5.0, 10.0, "m"),
    Candidate("NPFG_PERIOD", 1.0, 5.0, "s"),
    Candidate("FW_R_LIM", 1.0, 60.0, "deg", least=35.0),
)
