"""Define ArduPlane's parameters for a mission, in SI units and radians.

Names, units, ranges and defaults are from ArduPlane's complete parameter list (ardupilot.org, Plane, version 4.7); an
older name stands next to the present name, with the factor to the present unit. A parameter is taken from the first
source that states it: the user's file, the file `ardupilot.parm` of the aircraft, ArduPlane's defaults. Parameters
that 4.6 does not have are not read for 4.6, which uses a fixed value instead.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self, get_args

import numpy as np

from flight.autopilots.parameter_files import Entry
from flight.autopilots.parameter_origin import ARDUPILOT
from flight.autopilots.parameter_set import Definition, ParameterSet, ParameterTable, Stated
from flight.autopilots.parts import Candidate
from world.errors import ParameterError
from world.kernels import Record, record_dtype
from world.scenario_tables import NEWEST_ARDUPLANE, ArduPlaneVersion

_VERSIONS: tuple[ArduPlaneVersion, ...] = get_args(ArduPlaneVersion)
_RAD_PER_DEG = math.pi / 180.0
_PER_PERCENT = 0.01
_PER_CENTI = 0.01
_M_PER_KM = 1000.0


# Definitions of the parameters, by the field of `ArduPilotParameters`.
DEFINITIONS = {
    "navl1_period": Definition("NAVL1_PERIOD", 17.0, 1.0, 60.0),
    "navl1_damping": Definition("NAVL1_DAMPING", 0.75, 0.3, 2.0),
    "navl1_lim_bank": Definition("NAVL1_LIM_BANK", 0.0, 0.0, 89.0),
    "navl1_xtrack_i": Definition("NAVL1_XTRACK_I", 0.02, 0.0, 1.0),
    "wp_radius": Definition("WP_RADIUS", 90.0, 0.0, 32767.0),
    "wp_max_radius": Definition("WP_MAX_RADIUS", 0.0, 0.0, 32767.0),
    "wp_loiter_rad": Definition("WP_LOITER_RAD", 60.0, -32767.0, 32767.0),
    "roll_limit": Definition("ROLL_LIMIT_DEG", 45.0, 5.0, 90.0, _RAD_PER_DEG, ("LIM_ROLL_CD", _PER_CENTI)),
    "pitch_limit_max": Definition("PTCH_LIM_MAX_DEG", 20.0, 0.0, 90.0, _RAD_PER_DEG, ("LIM_PITCH_MAX", _PER_CENTI)),
    "pitch_limit_min": Definition("PTCH_LIM_MIN_DEG", -25.0, -90.0, 0.0, _RAD_PER_DEG, ("LIM_PITCH_MIN", _PER_CENTI)),
    "pitch_trim": Definition("PTCH_TRIM_DEG", 0.0, -45.0, 45.0, _RAD_PER_DEG, ("TRIM_PITCH_CD", _PER_CENTI)),
    "roll_time": Definition("RLL2SRV_TCONST", 0.5, 0.05, 10.0),
    "pitch_time": Definition("PTCH2SRV_TCONST", 0.5, 0.05, 10.0),
    "rudder_mix": Definition("KFF_RDDRMIX", 0.5, 0.0, 1.0),
    "airspeed_cruise": Definition("AIRSPEED_CRUISE", 12.0, 1.0, 500.0, 1.0, ("TRIM_ARSPD_CM", _PER_CENTI)),
    "airspeed_min": Definition("AIRSPEED_MIN", 9.0, 1.0, 500.0, 1.0, ("ARSPD_FBW_MIN", 1.0)),
    "airspeed_max": Definition("AIRSPEED_MAX", 22.0, 1.0, 500.0, 1.0, ("ARSPD_FBW_MAX", 1.0)),
    "airspeed_stall": Definition("AIRSPEED_STALL", 0.0, 0.0, 500.0),
    "stall_prevention": Definition("STALL_PREVENTION", 1.0, 0.0, 1.0),
    "throttle_min": Definition("THR_MIN", 0.0, -100.0, 100.0, _PER_PERCENT),
    "throttle_max": Definition("THR_MAX", 100.0, 1.0, 100.0, _PER_PERCENT),
    "throttle_cruise": Definition("TRIM_THROTTLE", 45.0, 0.0, 100.0, _PER_PERCENT),
    "throttle_slew": Definition("THR_SLEWRATE", 100.0, 0.0, 500.0, _PER_PERCENT),
    "altitude_slope_min": Definition("ALT_SLOPE_MIN", 15.0, 0.0, 1000.0, 1.0, ("GLIDE_SLOPE_MIN", 1.0)),
    "altitude_slope_threshold": Definition("ALT_SLOPE_MAXHGT", 5.0, 0.0, 100.0, 1.0, ("GLIDE_SLOPE_THR", 1.0)),
    "climb_slope_height": Definition("CLIMB_SLOPE_HGT", 25.0, 0.0, 1000.0),
    "tecs_climb_max": Definition("TECS_CLMB_MAX", 5.0, 0.1, 100.0),
    "tecs_sink_min": Definition("TECS_SINK_MIN", 2.0, 0.1, 100.0),
    "tecs_sink_max": Definition("TECS_SINK_MAX", 5.0, 0.0, 100.0),
    "tecs_time": Definition("TECS_TIME_CONST", 5.0, 1.0, 20.0),
    "tecs_throttle_damping": Definition("TECS_THR_DAMP", 0.5, 0.0, 5.0),
    "tecs_integral": Definition("TECS_INTEG_GAIN", 0.3, 0.0, 2.0),
    "tecs_vertical_acceleration": Definition("TECS_VERT_ACC", 7.0, 1.0, 50.0),
    "tecs_speed_frequency": Definition("TECS_SPD_OMEGA", 2.0, 0.1, 10.0),
    "tecs_roll_to_throttle": Definition("TECS_RLL2THR", 10.0, 0.0, 100.0),
    "tecs_speed_weight": Definition("TECS_SPDWEIGHT", 1.0, 0.0, 2.0),
    "tecs_pitch_damping": Definition("TECS_PTCH_DAMP", 0.3, 0.0, 5.0),
    "tecs_pitch_max": Definition("TECS_PITCH_MAX", 15.0, 0.0, 90.0, _RAD_PER_DEG),
    "tecs_pitch_min": Definition("TECS_PITCH_MIN", 0.0, -90.0, 0.0, _RAD_PER_DEG),
    "tecs_height_demand_time": Definition("TECS_HDEM_TCONST", 3.0, 0.0, 20.0),
    "rtl_altitude": Definition("RTL_ALTITUDE", 100.0, -1.0, 9000.0, 1.0, ("ALT_HOLD_RTL", _PER_CENTI)),
    "rtl_radius": Definition("RTL_RADIUS", 0.0, -32767.0, 32767.0),
    "rtl_climb_min": Definition("RTL_CLIMB_MIN", 0.0, 0.0, 9000.0),
    "flight_options": Definition("FLIGHT_OPTIONS", 0.0, 0.0, 2.0**31 - 1.0),
    "level_roll_limit": Definition("LEVEL_ROLL_LIMIT", 5.0, 0.0, 45.0, _RAD_PER_DEG),
    "rally_limit": Definition("RALLY_LIMIT_KM", 5.0, 0.0, 20_000.0, _M_PER_KM),
    "rally_includes_home": Definition("RALLY_INCL_HOME", 0.0, 0.0, 1.0),
    "rtl_autoland": Definition("RTL_AUTOLAND", 0.0, 0.0, 4.0),
    "flare_time": Definition("LAND_FLARE_SEC", 2.0, 0.0, 60.0),
    "flare_height": Definition("LAND_FLARE_ALT", 3.0, 0.0, 1000.0),
    "flare_weight": Definition("LAND_FLARE_AIM", 50.0, 0.0, 100.0, _PER_PERCENT),
    "landing_sink": Definition("TECS_LAND_SINK", 0.25, 0.0, 100.0),
    "landing_airspeed": Definition("TECS_LAND_ARSPD", -1.0, -1.0, 500.0),
    "landing_head_wind": Definition("LAND_WIND_COMP", 50.0, 0.0, 100.0, _PER_PERCENT),
    "takeoff_acceleration": Definition("TKOFF_THR_MINACC", 0.0, 0.0, 100.0),
    "takeoff_delay": Definition("TKOFF_THR_DELAY", 2.0, 0.0, 127.0, 0.1),
    "takeoff_ground_speed": Definition("TKOFF_THR_MINSPD", 0.0, 0.0, 100.0),
    "takeoff_rotation": Definition("TKOFF_ROTATE_SPD", 0.0, 0.0, 100.0),
    "takeoff_ground_pitch": Definition("TKOFF_GND_PITCH", 5.0, -10.0, 20.0, _RAD_PER_DEG),
    "takeoff_level_height": Definition("TKOFF_LVL_ALT", 10.0, 0.0, 1000.0),
    "takeoff_leveling": Definition("TKOFF_PLIM_SEC", 2.0, 0.0, 100.0),
    "takeoff_slew": Definition("TKOFF_THR_SLEW", 0.0, -1.0, 127.0, _PER_PERCENT),
    "takeoff_throttle": Definition("TKOFF_THR_MAX", 0.0, 0.0, 100.0, _PER_PERCENT),
    "landing_pitch": Definition("LAND_PITCH_DEG", 0.0, -20.0, 20.0, _RAD_PER_DEG, ("LAND_PITCH_CD", _PER_CENTI)),
    "landing_pitch_max": Definition("TECS_LAND_PMAX", 10.0, -5.0, 45.0, _RAD_PER_DEG),
    "landing_speed_weight": Definition("TECS_LAND_SPDWGT", -1.0, -1.0, 2.0),
    "landing_time": Definition("TECS_LAND_TCONST", 2.0, 0.1, 20.0),
    "flare_damping": Definition("TECS_LAND_DAMP", 0.5, 0.0, 5.0),
    "landing_sink_change": Definition("TECS_LAND_SRC", 0.0, -2.0, 2.0),
    "flare_holdoff": Definition("TECS_FLARE_HGT", 1.0, 0.0, 15.0),
    "throttle_failsafe": Definition("THR_FAILSAFE", 1.0, 0.0, 2.0),
    "short_failsafe": Definition("FS_SHORT_ACTN", 0.0, 0.0, 4.0),
    "long_failsafe": Definition("FS_LONG_ACTN", 0.0, 0.0, 5.0),
    "station_failsafe": Definition("FS_GCS_ENABL", 0.0, 0.0, 3.0),
    "terrain_enable": Definition("TERRAIN_ENABLE", 1.0, 0.0, 1.0),
    "terrain_lookahead": Definition("TERRAIN_LOOKAHD", 2000.0, 0.0, 10_000.0),
    "terrain_spacing": Definition("TERRAIN_SPACING", 100.0, 1.0, 10_000.0),
    "terrain_follow": Definition("TERRAIN_FOLLOW", 0.0, 0.0, 2.0**31 - 1.0),
    "battery_monitor": Definition("BATT_MONITOR", 0.0, 0.0, 255.0),
    "low_battery": Definition("BATT_FS_LOW_ACT", 0.0, 0.0, 7.0),
    "low_voltage": Definition("BATT_LOW_VOLT", 0.0, -1.0, 1000.0),
    "low_charge": Definition("BATT_LOW_MAH", 0.0, -1.0, 1e6),
    "critical_battery": Definition("BATT_FS_CRT_ACT", 0.0, 0.0, 7.0),
    "critical_voltage": Definition("BATT_CRT_VOLT", 0.0, -1.0, 1000.0),
    "critical_charge": Definition("BATT_CRT_MAH", 0.0, -1.0, 1e6),
    "fence_enable": Definition("FENCE_ENABLE", 0.0, 0.0, 2.0),
    "fence_auto_enable": Definition("FENCE_AUTOENABLE", 0.0, 0.0, 3.0),
    "fence_action": Definition("FENCE_ACTION", 1.0, 0.0, 8.0),
    "fence_type": Definition("FENCE_TYPE", 4.0, 0.0, 15.0),
    "altitude_offset": Definition("ALT_OFFSET", 0.0, -32767.0, 32767.0),
    "soaring": Definition("SOAR_ENABLE", 0.0, 0.0, 1.0),
    "quadplane": Definition("Q_ENABLE", 0.0, 0.0, 2.0),
    "rudder_only": Definition("RUDDER_ONLY", 0.0, 0.0, 1.0),
    "ground_speed_min": Definition("MIN_GROUNDSPEED", 0.0, 0.0, 500.0, 1.0, ("MIN_GNDSPD_CM", _PER_CENTI)),
    "airspeed_use": Definition("ARSPD_USE", 1.0, 0.0, 2.0),
    "roll_rate_p": Definition("RLL_RATE_P", 0.08, 0.0, 100.0),
    "roll_rate_ff": Definition("RLL_RATE_FF", 0.345, 0.0, 100.0),
    "pitch_rate_p": Definition("PTCH_RATE_P", 0.04, 0.0, 100.0),
    "pitch_rate_ff": Definition("PTCH_RATE_FF", 0.345, 0.0, 100.0),
}
# Parameters that 4.6 does not have, with the fixed values that it uses: heights in m.
_FIXED_IN_4_6 = {"CLIMB_SLOPE_HGT": 20.0}
# Bit of MIS_OPTIONS: counters of jumps are not reset when they are exhausted.
_KEEPS_JUMP_COUNTERS = 1 << 3
# Bit of FLIGHT_OPTIONS: an RTL climbs to its altitude before it turns.
CLIMB_BEFORE_TURN = 1 << 4
# Bit of FLIGHT_OPTIONS: every climb of a mission is a step.
IMMEDIATE_CLIMB = 1 << 14
# Bit of FLIGHT_OPTIONS: the load factor may limit the bank to LEVEL_ROLL_LIMIT, below 25 degrees.
FULL_LOAD_FACTOR_LIMIT = 1 << 16
# Bit of TERRAIN_FOLLOW: every mode.
_FOLLOW_ALWAYS_BIT = 1 << 0
# Bit of TERRAIN_FOLLOW: RTL.
_FOLLOW_HOME_BIT = 1 << 4
# Bits of FENCE_TYPE for ArduPlane's own limits, not the mission's fence: altitudes and a circle about home.
OWN_FENCE_BITS = 0b1011
# Radius of a loiter whose radius is stated as 1 m or less, m (ArduPlane's `LOITER_RADIUS_DEFAULT`).
_DEFAULT_LOITER_RADIUS_M = 60.0
# Parameters that are read but not simulated: an RTL is simulated on a slope even if this makes it follow the terrain.
NOT_SIMULATED = ("TERRAIN_FOLLOW",)
ARDUPILOT_PARAMETERS = record_dtype(
    *DEFINITIONS,
    "roll_rate_max",  # rad/s, infinite without a limit
    ("is_4_7", np.bool_),
)
# Parameters whose values should not decrease from one to the next; ArduPlane does not compare them.
_ORDERS = (
    ("THR_MIN", "TRIM_THROTTLE", "THR_MAX"),
    ("AIRSPEED_MIN", "AIRSPEED_CRUISE", "AIRSPEED_MAX"),
    ("PTCH_LIM_MIN_DEG", "PTCH_TRIM_DEG", "PTCH_LIM_MAX_DEG"),
    ("TECS_SINK_MIN", "TECS_SINK_MAX"),
)
# Minimum and maximum; the minimum must be lower.
_PAIRS = (("THR_MIN", "THR_MAX"), ("AIRSPEED_MIN", "AIRSPEED_MAX"))
# Prefixes of the parameters of battery monitors after the first (`AP_BattMonitor::var_info`).
OTHER_BATTERY_MONITORS = tuple(f"BATT{number}" for number in "23456789ABCDEFG")
_BATTERY_THRESHOLDS = ("LOW_VOLT", "LOW_MAH", "FS_LOW_ACT", "CRT_VOLT", "CRT_MAH", "FS_CRT_ACT")
# Number of radio channels.
RADIO_CHANNEL_COUNT = 16
# Defaults of the pulses of radio channels and servo outputs, us (`RC_Channel::var_info`, `SRV_Channel::var_info`).
_PULSES_US = {"MIN": 1100.0, "TRIM": 1500.0, "MAX": 1900.0}
# Parameters that the control law does not use, but that decide verdicts (`flight.autopilots.arduplane.open_settings`,
# `flight.autopilots.arduplane.arming_checks` and `flight.autopilots.arduplane.failsafes`), with their defaults.
_WHEN_STATED = {
    **dict.fromkeys(("KFF_THR2PTCH", "BATT_WATT_MAX", "FWD_BAT_THR_CUT", "TECS_OPTIONS", "AFS_ENABLE"), 0.0),
    **dict.fromkeys(("CHUTE_CRT_SINK", "ICE_IDLE_PCT", "AHRS_WIND_MAX", "ARSPD_WIND_MAX", "MIS_OPTIONS"), 0.0),
    **dict.fromkeys(("FLAP_1_PERCNT", "FLAP_1_SPEED", "FLAP_2_PERCNT", "FLAP_2_SPEED"), 0.0),
    **dict.fromkeys(("TKOFF_OPTIONS", "TKOFF_TDRAG_ELEV", "TKOFF_FLAP_PCNT", "TKOFF_THR_IDLE"), 0.0),
    **dict.fromkeys(("TECS_TKOFF_IGAIN", "TECS_APPR_SMAX", "TECS_LAND_TDAMP", "TECS_LAND_IGAIN"), 0.0),
    **dict.fromkeys(("LAND_TYPE", "LAND_PF_ARSPD", "LAND_OPTIONS", "LAND_THR_SLEW", "LAND_FLAP_PERCNT"), 0.0),
    **dict.fromkeys(("RNGFND_LANDING", "TECS_LAND_PDAMP"), 0.0),
    **dict.fromkeys(("RLL2SRV_RMAX", "PTCH2SRV_RMAX_UP", "PTCH2SRV_RMAX_DN"), 0.0),
    "PTCH2SRV_RLL": 1.0,
    # Gains and filters of the rate controllers.
    **dict.fromkeys(("RLL_RATE_I", "PTCH_RATE_I"), 0.15),
    **dict.fromkeys(("RLL_RATE_D", "PTCH_RATE_D", "RLL_RATE_FLTE", "PTCH_RATE_FLTE"), 0.0),
    **dict.fromkeys(("RLL_RATE_IMAX", "PTCH_RATE_IMAX"), 0.666),
    **dict.fromkeys(("RLL_RATE_FLTT", "PTCH_RATE_FLTT"), 3.0),
    "SCALING_SPEED": 15.0,
    # Airspeed sensors.
    **dict.fromkeys(("ARSPD_ENABLE", "ARSPD_TYPE"), 1.0),
    **dict.fromkeys(("ARSPD_PRIMARY", *(f"ARSPD{number}_TYPE" for number in range(2, 7))), 0.0),
    **dict.fromkeys((f"ARSPD{number}_USE" for number in range(2, 7)), 1.0),
    "ARSPD_RATIO": 2.0,
    # Position and attitude estimate.
    **dict.fromkeys(("AHRS_GPS_USE", "EK3_ENABLE", "EK3_SRC1_POSZ", "GPS1_TYPE", "GPS_AUTO_SWITCH"), 1.0),
    **dict.fromkeys(("EAHRS_TYPE", "GPS2_TYPE", "GPS_PRIMARY"), 0.0),
    **dict.fromkeys(("AHRS_EKF_TYPE", "EK3_IMU_MASK", "EK3_SRC1_POSXY"), 3.0),
    "INS_ENABLE_MASK": 127.0,
    # Arming and outputs.
    **dict.fromkeys(("ARMING_MIS_ITEMS", "ARMING_SKIPCHK", "MIXING_OFFSET"), 0.0),
    **dict.fromkeys(("ARMING_CHECK", "ARMING_REQUIRE", "FENCE_OPTIONS"), 1.0),
    **dict.fromkeys(("GROUND_STEER_ALT", "SERVO_32_ENABLE", "SERVO_GPIO_MASK"), 0.0),
    "MIXING_GAIN": 0.5,
    **{f"SERVO{output}_FUNCTION": 0.0 for output in range(5, 33)},
    "SERVO1_FUNCTION": 4.0,
    "SERVO2_FUNCTION": 19.0,
    "SERVO3_FUNCTION": 70.0,
    "SERVO4_FUNCTION": 21.0,
    "ICE_IDLE_RPM": -1.0,
    "TKOFF_ACCEL_CNT": 1.0,
    "TKOFF_ALT": 50.0,
    "USE_REV_THRUST": 2.0,
    # Used only by the checks before arming.
    **{f"SERVO{output}_{name}": pulse for output in range(1, 33) for name, pulse in _PULSES_US.items()},
    **{
        f"RC{channel}_{name}": value
        for channel in range(1, RADIO_CHANNEL_COUNT + 1)
        for name, value in (*_PULSES_US.items(), ("REVERSED", 0.0))
    },
    "RCMAP_THROTTLE": 3.0,
    "THR_FS_VALUE": 950.0,
    "FS_SHORT_TIMEOUT": 1.5,
    "FS_LONG_TIMEOUT": 5.0,
    "FENCE_MARGIN": 2.0,
    "FENCE_MARGIN_XY": 0.0,
    "FENCE_RADIUS": 300.0,
    "FENCE_ALT_MAX": 100.0,
    "FENCE_ALT_MIN": -10.0,
    **{f"{monitor}_ARM_{unit}": 0.0 for monitor in ("BATT", *OTHER_BATTERY_MONITORS) for unit in ("VOLT", "MAH")},
    # Used only by the battery failsafes; `BATT_MONITOR` and its thresholds are in `DEFINITIONS`.
    "BATT_CAPACITY": 3300.0,
    "BATT_LOW_TIMER": 10.0,
    **{
        f"{monitor}_{name}": default
        for monitor in OTHER_BATTERY_MONITORS
        for name, default in (
            ("MONITOR", 0.0),
            ("CAPACITY", 3300.0),
            ("LOW_TIMER", 10.0),
            *((name, 0.0) for name in _BATTERY_THRESHOLDS),
        )
    },
}
# Names before 4.6 of parameters of `_WHEN_STATED`, with the factor to the present unit.
_OLD_NAMES = {"GPS1_TYPE": ("GPS_TYPE", 1.0), "GPS2_TYPE": ("GPS_TYPE2", 1.0)}
# Parameters whose values in the aircraft's own file are not part of the set: the aircraft needs them in any case.
_NEEDED_BY_AIRCRAFT = ("RLL_RATE_I", "RLL_RATE_D", "PTCH_RATE_I", "PTCH_RATE_D", "SCALING_SPEED")
TABLE = ParameterTable(
    ARDUPILOT,
    "ArduPlane",
    DEFINITIONS,
    pairs=_PAIRS,
    orders=_ORDERS,
    when_stated=[
        Definition(name, default, -math.inf, math.inf, old=_OLD_NAMES.get(name))
        for name, default in _WHEN_STATED.items()
    ],
)


@dataclass(frozen=True, slots=True)
class ArduPilotParameters(ParameterSet):
    r"""Parameters of ArduPlane; the fields of `DEFINITIONS` are computed from ``values``.

    version: release of ArduPlane.
    notes: notes on a file that another release wrote; not stored in a log.

    >>> default = ArduPilotParameters.defaults()
    >>> default.wp_radius, default.tecs_height_demand_time
    (90.0, 3.0)
    >>> default.changed(ROLL_LIMIT_DEG=30.0).roll_limit == math.radians(30.0)
    True
    >>> ArduPilotParameters.from_text("LIM_ROLL_CD 3000\nFOO 1\n", "old.parm").unused
    ('FOO',)
    >>> parameters = ArduPilotParameters.from_text("GLIDE_SLOPE_MIN 20\nCLIMB_SLOPE_HGT 30\n", "mine.param", "4.6")
    >>> parameters.altitude_slope_min, parameters.climb_slope_height, parameters.unused
    (20.0, 20.0, ('CLIMB_SLOPE_HGT',))
    >>> ArduPilotParameters.from_text("TRIM_THROTTLE 60\nTHR_MAX 50", "mine.param").contradictions
    ('THR_MAX 50 of the file is below TRIM_THROTTLE 60 of the file',)
    >>> parameters, notes = ArduPilotParameters.from_log({"LIM_ROLL_CD": 4500.0, "WP_RADIUS": -5.0}, "a.BIN")
    >>> parameters.by_origin("file"), notes
    ({'ROLL_LIMIT_DEG': 45.0}, ('WP_RADIUS -5 in the log is outside 0..32767: the default is used',))

    navl1_period: period of the L1 controller, s.
    navl1_xtrack_i: gain of the cross-track integrator, 1/s.
    wp_radius: distance before a waypoint at which a right-angled turn begins, m.
    wp_max_radius: maximum distance at which a waypoint is passed, m; 0 for no limit.
    wp_loiter_rad: radius of a loiter that states no radius, m, negative to the left.
    roll_limit, pitch_limit_max, pitch_limit_min, pitch_trim: rad.
    roll_time, pitch_time: time constants with which roll and pitch follow their demands, s.
    airspeed_cruise, airspeed_min, airspeed_max: equivalent airspeeds, m/s.
    airspeed_stall: stall speed at a load factor of 1, m/s; 0 if not stated.
    stall_prevention: 1 if the load factor limits the bank and raises the minimum airspeed; 0 if not.
    throttle_min, throttle_max, throttle_cruise: 0..1.
    throttle_slew: maximum change of the throttle, fraction of its range per second; 0 for no limit.
    altitude_slope_min: minimum altitude change of a leg that is flown as a slope, m; a smaller change is flown as a
        step. The parameter's value 0, which makes every change a step, is stored as inf.
    altitude_slope_threshold: height above a climbing slope at which the slope is redrawn, m; 0 for never.
    climb_slope_height: height above home, m, below which 4.7 climbs to the altitude of the leg's end at once; in 4.6 a
        climb that begins below it is a step.
    tecs_climb_max, tecs_sink_min, tecs_sink_max: climb and sink rates, m/s.
    tecs_time: time constant of TECS, s.
    tecs_vertical_acceleration: m/s^2.
    tecs_speed_frequency: bandwidth of the airspeed filter, rad/s.
    tecs_roll_to_throttle: climb rate that a bank of 45 degrees costs, m/s.
    tecs_pitch_max, tecs_pitch_min: rad; 0 for the pitch limits.
    tecs_height_demand_time: lag of the altitude demand, s.
    rtl_altitude: altitude of an RTL above home, m; negative for the current altitude.
    rtl_radius: radius of the RTL loiter, m; 0 for ``wp_loiter_rad``.
    rtl_climb_min: height that an RTL climbs before it turns, m.
    level_roll_limit: bank limit during this climb, rad.
    flight_options: bits; with bit 4 an RTL climbs to its altitude before it turns, with bit 14 climbs are steps.
    rally_limit: maximum distance to the nearest rally point, m; an RTL ignores a rally point that is further away. 0
        for no limit.
    rally_includes_home: 1 if an RTL goes home when home is nearer than any rally point; 0 if not.
    rtl_autoland: 0 if an RTL stays in its loiter. With 1 it continues to the mission's landing sequence, with 2 it
        flies straight there. With 3 the sequence is for go-arounds only. With 4 the RTL uses the mission's return path.
    terrain_enable: 1 if ArduPlane has terrain data.
    terrain_lookahead: distance over which ArduPlane looks ahead for rising ground on a leg above terrain, m.
    terrain_spacing: distance between the samples of the terrain, m.
    terrain_follow: bits of the modes that follow the terrain.
    low_voltage, critical_voltage: thresholds, V; 0 or less triggers nothing.
    low_charge, critical_charge: thresholds, mAh; 0 or less triggers nothing.
    flare_time: time before touchdown at which the flare begins, s.
    flare_height: half the maximum height of the flare, m.
    flare_weight: fraction of the flare that is flown with its final sink rate.
    landing_sink: sink rate at the end of the flare, m/s.
    landing_airspeed: airspeed of the landing approach, m/s; negative for the mean of cruise and minimum airspeed.
    landing_head_wind: fraction of the headwind that is added to the landing airspeed, up to the cruise airspeed.
    takeoff_acceleration: acceleration along the nose that starts the motor, m/s^2; 0 if none is needed.
    takeoff_delay: time from this acceleration to the start of the motor, s.
    takeoff_ground_speed: ground speed that is required at the start of the motor, m/s.
    takeoff_rotation: airspeed up to which the pitch on the ground is ``takeoff_ground_pitch``, m/s.
    takeoff_ground_pitch: rad.
    takeoff_level_height: height, m, up to which the bank of a take-off is limited to ``level_roll_limit``; the bank is
        not limited above three times this height.
    takeoff_leveling: time before the end of the take-off at which the aircraft begins to level off, s.
    takeoff_slew: maximum change of the throttle in a take-off, fraction of its range per second; 0 for
        ``throttle_slew``, negative for no limit.
    takeoff_throttle: throttle of a take-off, 0..1; 0 for ``throttle_max``.
    landing_pitch: minimum pitch in the flare, rad.
    landing_pitch_max: maximum pitch in a landing, rad; 0 for ``pitch_limit_max``.
    landing_speed_weight: speed weight of TECS in a landing; negative for a weight that falls to 0 on the last leg.
    landing_time: time constant of TECS in a landing, s.
    flare_damping: gain of the pitch damping in the flare.
    landing_sink_change: increase of the sink rate for each meter beyond the landing point, 1/s.
    flare_holdoff: height at which the final sink rate is reached, m.
    fence_type: bits of ArduPlane's own limits: 1 and 8 altitudes, 2 a circle about home, 4 the mission's fence.
    altitude_offset: altitude that is added to the altitudes of mission items, m; not simulated.
    soaring, quadplane, rudder_only: 1 if the aircraft soars, has lift motors, or steers by the rudder alone; not
        simulated.
    ground_speed_min: minimum ground speed, for which the airspeed is raised, m/s; 0 for none.
    airspeed_use: 1 with an airspeed sensor; not simulated.
    roll_rate_p to pitch_rate_ff: gains of the rate controllers; not simulated.
    throttle_failsafe to fence_auto_enable: events that end the mission, and ArduPlane's reactions; see
        `flight.autopilots.arduplane.failsafes`.
    """

    table: ClassVar[ParameterTable] = TABLE
    not_simulated: ClassVar[tuple[str, ...]] = NOT_SIMULATED
    version: ArduPlaneVersion = NEWEST_ARDUPLANE
    notes: tuple[str, ...] = field(default=(), compare=False)
    navl1_period: float = field(init=False)
    navl1_damping: float = field(init=False)
    navl1_lim_bank: float = field(init=False)
    navl1_xtrack_i: float = field(init=False)
    wp_radius: float = field(init=False)
    wp_max_radius: float = field(init=False)
    wp_loiter_rad: float = field(init=False)
    roll_limit: float = field(init=False)
    pitch_limit_max: float = field(init=False)
    pitch_limit_min: float = field(init=False)
    pitch_trim: float = field(init=False)
    roll_time: float = field(init=False)
    pitch_time: float = field(init=False)
    rudder_mix: float = field(init=False)
    airspeed_cruise: float = field(init=False)
    airspeed_min: float = field(init=False)
    airspeed_max: float = field(init=False)
    airspeed_stall: float = field(init=False)
    stall_prevention: float = field(init=False)
    throttle_min: float = field(init=False)
    throttle_max: float = field(init=False)
    throttle_cruise: float = field(init=False)
    throttle_slew: float = field(init=False)
    altitude_slope_min: float = field(init=False)
    altitude_slope_threshold: float = field(init=False)
    climb_slope_height: float = field(init=False)
    tecs_climb_max: float = field(init=False)
    tecs_sink_min: float = field(init=False)
    tecs_sink_max: float = field(init=False)
    tecs_time: float = field(init=False)
    tecs_throttle_damping: float = field(init=False)
    tecs_integral: float = field(init=False)
    tecs_vertical_acceleration: float = field(init=False)
    tecs_speed_frequency: float = field(init=False)
    tecs_roll_to_throttle: float = field(init=False)
    tecs_speed_weight: float = field(init=False)
    tecs_pitch_damping: float = field(init=False)
    tecs_pitch_max: float = field(init=False)
    tecs_pitch_min: float = field(init=False)
    tecs_height_demand_time: float = field(init=False)
    rtl_altitude: float = field(init=False)
    rtl_radius: float = field(init=False)
    rtl_climb_min: float = field(init=False)
    flight_options: float = field(init=False)
    level_roll_limit: float = field(init=False)
    rally_limit: float = field(init=False)
    rally_includes_home: float = field(init=False)
    rtl_autoland: float = field(init=False)
    flare_time: float = field(init=False)
    flare_height: float = field(init=False)
    flare_weight: float = field(init=False)
    landing_sink: float = field(init=False)
    landing_airspeed: float = field(init=False)
    landing_head_wind: float = field(init=False)
    takeoff_acceleration: float = field(init=False)
    takeoff_delay: float = field(init=False)
    takeoff_ground_speed: float = field(init=False)
    takeoff_rotation: float = field(init=False)
    takeoff_ground_pitch: float = field(init=False)
    takeoff_level_height: float = field(init=False)
    takeoff_leveling: float = field(init=False)
    takeoff_slew: float = field(init=False)
    takeoff_throttle: float = field(init=False)
    landing_pitch: float = field(init=False)
    landing_pitch_max: float = field(init=False)
    landing_speed_weight: float = field(init=False)
    landing_time: float = field(init=False)
    flare_damping: float = field(init=False)
    landing_sink_change: float = field(init=False)
    flare_holdoff: float = field(init=False)
    throttle_failsafe: float = field(init=False)
    short_failsafe: float = field(init=False)
    long_failsafe: float = field(init=False)
    station_failsafe: float = field(init=False)
    terrain_enable: float = field(init=False)
    terrain_lookahead: float = field(init=False)
    terrain_spacing: float = field(init=False)
    terrain_follow: float = field(init=False)
    battery_monitor: float = field(init=False)
    low_battery: float = field(init=False)
    low_voltage: float = field(init=False)
    low_charge: float = field(init=False)
    critical_battery: float = field(init=False)
    critical_voltage: float = field(init=False)
    critical_charge: float = field(init=False)
    fence_enable: float = field(init=False)
    fence_auto_enable: float = field(init=False)
    fence_action: float = field(init=False)
    fence_type: float = field(init=False)
    altitude_offset: float = field(init=False)
    soaring: float = field(init=False)
    quadplane: float = field(init=False)
    rudder_only: float = field(init=False)
    ground_speed_min: float = field(init=False)
    airspeed_use: float = field(init=False)
    roll_rate_p: float = field(init=False)
    roll_rate_ff: float = field(init=False)
    pitch_rate_p: float = field(init=False)
    pitch_rate_ff: float = field(init=False)

    def __post_init__(self) -> None:
        """Convert the values to SI. Raises ParameterError for an unknown release."""
        if self.version not in _VERSIONS:
            allowed = f"expected {' or '.join(_VERSIONS)}"
            message = f"arduplane_version: {self.version!r}: {allowed}"
            raise ParameterError(
                message, file=self.source, field="arduplane_version", value=self.version, allowed=allowed
            )
        for (name, definition), parameter in zip(DEFINITIONS.items(), self.values, strict=False):
            object.__setattr__(self, name, parameter.value * definition.to_si)
        # ALT_SLOPE_MIN 0 disables slopes (`Plane::set_offset_altitude_location`).
        object.__setattr__(self, "altitude_slope_min", self.altitude_slope_min or math.inf)

    @classmethod
    def _read_aircraft_values(cls, entries: Mapping[str, Entry]) -> dict[str, float]:
        """Return the values in the aircraft's file by name, except the parameters in `_NEEDED_BY_AIRCRAFT`."""
        values, _ = cls.table.read(entries)
        return {name: value for name, value in values.items() if name not in _NEEDED_BY_AIRCRAFT}

    @classmethod
    def _without_unknown_parameters(cls, sources: list[Stated], *fields: Any) -> tuple[list[Stated], tuple[str, ...]]:
        """Remove parameters that release 4.6 lacks.

        Return the sources, and the names removed from the user's file.

        Release 4.6 uses fixed values instead of these parameters, which an additional source states. For any other
        release the sources are returned unchanged.

        fields: the other arguments of the class; the first is the release.
        """
        if not fields or fields[0] != "4.6":
            return sources, ()
        stated_names = [name for origin, values in sources for name in values if origin == "file"]
        known_sources: list[Stated] = [
            (origin, {name: value for name, value in values.items() if name not in _FIXED_IN_4_6})
            for origin, values in sources
        ]
        return [*known_sources, ("default", _FIXED_IN_4_6)], tuple(
            name for name in stated_names if name in _FIXED_IN_4_6
        )

    def with_release(self, version: ArduPlaneVersion) -> Self:
        """Return the same parameters for another ArduPlane release.

        >>> ArduPilotParameters.defaults().with_release("4.6").climb_slope_height
        20.0
        """
        sources: list[Stated] = [(origin, self.by_origin(origin)) for origin in ("file", "assumed", "aircraft")]
        return self._build(sources, self.source, self.unused, version, self.notes)

    @property
    def resets_jump_counters(self) -> bool:
        """True if ArduPlane resets the counter of a completed jump.

        ArduPlane 4.7 does, unless bit 3 of MIS_OPTIONS is set.

        >>> [ArduPilotParameters.defaults().changed(MIS_OPTIONS=bits).resets_jump_counters for bits in (0, 8)]
        [True, False]
        """
        return self.version != "4.6" and not int(self["MIS_OPTIONS"]) & _KEEPS_JUMP_COUNTERS

    @property
    def climbs_before_turn(self) -> bool:
        """True if an RTL climbs to its altitude before it turns (bit 4 of FLIGHT_OPTIONS)."""
        return bool(int(self.flight_options) & CLIMB_BEFORE_TURN)

    @property
    def rtl_follows_terrain(self) -> bool:
        """True if an RTL follows the terrain (bit 0 or bit 4 of TERRAIN_FOLLOW).

        >>> [ArduPilotParameters.defaults().changed(TERRAIN_FOLLOW=bits).rtl_follows_terrain for bits in (0, 1, 8, 16)]
        [False, True, False, True]
        """
        return bool(int(self.terrain_follow) & (_FOLLOW_ALWAYS_BIT | _FOLLOW_HOME_BIT))

    @property
    def has_own_fence(self) -> bool:
        """True if a fence of ArduPlane itself is on and triggers an action.

        Such a fence is a circle about home, or altitude limits; the mission does not contain it.

        >>> default = ArduPilotParameters.defaults()
        >>> [default.changed(FENCE_ENABLE=1, FENCE_TYPE=kind).has_own_fence for kind in (4, 6)]
        [False, True]
        """
        enabled = self.fence_enable > 0.0 or self.fence_auto_enable > 0.0
        return enabled and self.fence_action > 0.0 and bool(int(self.fence_type) & OWN_FENCE_BITS)

    @property
    def return_radius(self) -> float:
        """Radius of the RTL loiter, m at sea level, negative to the left.

        It is RTL_RADIUS, or WP_LOITER_RAD if RTL_RADIUS is at most 1 m, or 60 m if both are at most 1 m. The sign is
        the sign of RTL_RADIUS, or of WP_LOITER_RAD if RTL_RADIUS is 0. Follows `ModeRTL::navigate` in
        ArduPlane/mode_rtl.cpp and `Plane::update_loiter` in navigation.cpp.

        >>> parameters = ArduPilotParameters.defaults()
        >>> [parameters.changed(RTL_RADIUS=m, WP_LOITER_RAD=-80.0).return_radius for m in (0.0, -150.0, 1.0)]
        [-80.0, -150.0, 80.0]
        >>> parameters.return_radius, parameters.changed(WP_LOITER_RAD=-1.0).return_radius
        (60.0, -60.0)
        """
        abs_radius = next((abs(radius) for radius in (self.rtl_radius, self.wp_loiter_rad) if abs(radius) > 1.0), None)
        return math.copysign(abs_radius or _DEFAULT_LOITER_RADIUS_M, self.rtl_radius or self.wp_loiter_rad)

    @property
    def loiter_radius(self) -> float:
        """Default loiter radius, m at sea level, negative to the left: WP_LOITER_RAD, or 60 m."""
        abs_radius = abs(self.wp_loiter_rad)
        return math.copysign(abs_radius if abs_radius > 1.0 else _DEFAULT_LOITER_RADIUS_M, self.wp_loiter_rad)

    def record(self) -> Record:
        """Return the parameters for compiled code, as a record of `ARDUPILOT_PARAMETERS`."""
        record: Record = np.zeros(1, ARDUPILOT_PARAMETERS)[0]
        for name in DEFINITIONS:
            setattr(record, name, getattr(self, name))
        record.roll_rate_max = math.radians(self["RLL2SRV_RMAX"]) or math.inf
        record.is_4_7 = self.version != "4.6"
        return record


# ----------------------------------------------------------------------
# Parameters that may cause a flight to fail, with the steps and ranges of the parameter reference.

HEIGHT_CANDIDATES = (
    Candidate("TECS_HDEM_TCONST", 0.2, 1.0, "s"),
    Candidate("TECS_CLMB_MAX", 0.5, 10.0, "m/s"),
    Candidate("TECS_SINK_MAX", 0.5, 10.0, "m/s"),
    Candidate("TECS_TIME_CONST", 0.2, 3.0, "s"),
    Candidate("THR_MAX", 5.0, 100.0, "%"),
)
# Largest value of a pitch limit that is tried, degrees.
MAX_TRIED_PITCH_DEG = 30.0
SIDE_CANDIDATES = (
    Candidate("NAVL1_PERIOD", 1.0, 10.0, "s"),
    Candidate("WP_RADIUS", 5.0, 30.0, "m"),
    Candidate("WP_RADIUS", 5.0, 150.0, "m"),
    Candidate("ROLL_LIMIT_DEG", 1.0, 60.0, "deg"),
)
