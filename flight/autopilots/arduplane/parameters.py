"""ArduPlane's parameters that decide how it flies a mission, in SI units and radians.

Names, units, ranges and defaults are those of ArduPlane's complete parameter list (ardupilot.org, Plane, version 4.6);
an older name stands beside the present one with what takes its value to the present unit.  Of three sources the first
that states a parameter counts: the file that a person gives, the file `ardupilot.parm` of the aircraft, ArduPlane.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import Candidate, Origin, ParameterValue, StoredParameters, find_misfits
from flight.autopilots.parameter_files import Entry, parse_parameters, read_parameter_file
from flight.autopilots.parameter_origin import ARDUPILOT, read_parameters_for, refuse_unknown
from world.errors import ParameterError
from world.files import TextLine
from world.kernels import Record, record_dtype

Floats = NDArray[np.float64]


# Whose law, parameters and defaults these are.
RELEASE = "4.6"
# Of an aircraft, beside its model: what ArduPlane has to be told of it.
AIRCRAFT_FILE = "ardupilot.parm"

_DEGREE = math.pi / 180.0
_PERCENT = 0.01
_CENTI = 0.01
_KILOMETRE = 1000.0


class Definition(NamedTuple):
    """One parameter.

    name: ArduPlane's.
    default: ArduPlane's, in its unit.
    low, high: what is taken, in that unit.
    to_si: factor to SI and radians.
    old: an older name, and the factor from its unit to that of the present name.
    """

    name: str
    default: float
    low: float
    high: float
    to_si: float = 1.0
    old: tuple[str, float] | None = None


# By the field of `ArduPilotParameters`.
DEFINITIONS = {
    "navl1_period": Definition("NAVL1_PERIOD", 17.0, 1.0, 60.0),
    "navl1_damping": Definition("NAVL1_DAMPING", 0.75, 0.3, 2.0),
    "navl1_lim_bank": Definition("NAVL1_LIM_BANK", 0.0, 0.0, 89.0),
    "navl1_xtrack_i": Definition("NAVL1_XTRACK_I", 0.02, 0.0, 1.0),
    "wp_radius": Definition("WP_RADIUS", 90.0, 0.0, 32767.0),
    "wp_max_radius": Definition("WP_MAX_RADIUS", 0.0, 0.0, 32767.0),
    "wp_loiter_rad": Definition("WP_LOITER_RAD", 60.0, -32767.0, 32767.0),
    "roll_limit": Definition("ROLL_LIMIT_DEG", 45.0, 5.0, 90.0, _DEGREE, ("LIM_ROLL_CD", _CENTI)),
    "pitch_limit_max": Definition("PTCH_LIM_MAX_DEG", 20.0, 0.0, 90.0, _DEGREE, ("LIM_PITCH_MAX", _CENTI)),
    "pitch_limit_min": Definition("PTCH_LIM_MIN_DEG", -25.0, -90.0, 0.0, _DEGREE, ("LIM_PITCH_MIN", _CENTI)),
    "pitch_trim": Definition("PTCH_TRIM_DEG", 0.0, -45.0, 45.0, _DEGREE, ("TRIM_PITCH_CD", _CENTI)),
    "roll_time": Definition("RLL2SRV_TCONST", 0.5, 0.05, 10.0),
    "pitch_time": Definition("PTCH2SRV_TCONST", 0.5, 0.05, 10.0),
    "rudder_mix": Definition("KFF_RDDRMIX", 0.5, 0.0, 1.0),
    "airspeed_cruise": Definition("AIRSPEED_CRUISE", 12.0, 1.0, 500.0, 1.0, ("TRIM_ARSPD_CM", _CENTI)),
    "airspeed_min": Definition("AIRSPEED_MIN", 9.0, 1.0, 500.0, 1.0, ("ARSPD_FBW_MIN", 1.0)),
    "airspeed_max": Definition("AIRSPEED_MAX", 22.0, 1.0, 500.0, 1.0, ("ARSPD_FBW_MAX", 1.0)),
    "stall_prevention": Definition("STALL_PREVENTION", 1.0, 0.0, 1.0),
    "throttle_min": Definition("THR_MIN", 0.0, -100.0, 100.0, _PERCENT),
    "throttle_max": Definition("THR_MAX", 100.0, 1.0, 100.0, _PERCENT),
    "throttle_cruise": Definition("TRIM_THROTTLE", 45.0, 0.0, 100.0, _PERCENT),
    "throttle_slew": Definition("THR_SLEWRATE", 100.0, 0.0, 500.0, _PERCENT),
    "glide_slope_min": Definition("GLIDE_SLOPE_MIN", 15.0, 0.0, 1000.0),
    "glide_slope_threshold": Definition("GLIDE_SLOPE_THR", 5.0, 0.0, 100.0),
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
    "tecs_pitch_max": Definition("TECS_PITCH_MAX", 15.0, 0.0, 90.0, _DEGREE),
    "tecs_pitch_min": Definition("TECS_PITCH_MIN", 0.0, -90.0, 0.0, _DEGREE),
    "tecs_height_demand_time": Definition("TECS_HDEM_TCONST", 3.0, 0.0, 20.0),
    "rtl_altitude": Definition("RTL_ALTITUDE", 100.0, -1.0, 9000.0, 1.0, ("ALT_HOLD_RTL", _CENTI)),
    "rtl_radius": Definition("RTL_RADIUS", 0.0, -32767.0, 32767.0),
    "rtl_climb_min": Definition("RTL_CLIMB_MIN", 0.0, 0.0, 9000.0),
    "flight_options": Definition("FLIGHT_OPTIONS", 0.0, 0.0, 2.0**31 - 1.0),
    "level_roll_limit": Definition("LEVEL_ROLL_LIMIT", 5.0, 0.0, 45.0, _DEGREE),
    "rally_limit": Definition("RALLY_LIMIT_KM", 5.0, 0.0, 20_000.0, _KILOMETRE),
    "rally_includes_home": Definition("RALLY_INCL_HOME", 0.0, 0.0, 1.0),
    "rtl_autoland": Definition("RTL_AUTOLAND", 0.0, 0.0, 4.0),
    "flare_time": Definition("LAND_FLARE_SEC", 2.0, 0.0, 60.0),
    "flare_height": Definition("LAND_FLARE_ALT", 3.0, 0.0, 1000.0),
    "flare_weight": Definition("LAND_FLARE_AIM", 50.0, 0.0, 100.0, _PERCENT),
    "landing_sink": Definition("TECS_LAND_SINK", 0.25, 0.0, 100.0),
    "landing_airspeed": Definition("TECS_LAND_ARSPD", -1.0, -1.0, 500.0),
    "landing_head_wind": Definition("LAND_WIND_COMP", 50.0, 0.0, 100.0, _PERCENT),
    "takeoff_acceleration": Definition("TKOFF_THR_MINACC", 0.0, 0.0, 100.0),
    "takeoff_delay": Definition("TKOFF_THR_DELAY", 2.0, 0.0, 127.0, 0.1),
    "takeoff_ground_speed": Definition("TKOFF_THR_MINSPD", 0.0, 0.0, 100.0),
    "takeoff_rotation": Definition("TKOFF_ROTATE_SPD", 0.0, 0.0, 100.0),
    "takeoff_ground_pitch": Definition("TKOFF_GND_PITCH", 5.0, -10.0, 20.0, _DEGREE),
    "takeoff_level_height": Definition("TKOFF_LVL_ALT", 5.0, 0.0, 1000.0),
    "takeoff_leveling": Definition("TKOFF_PLIM_SEC", 2.0, 0.0, 100.0),
    "takeoff_slew": Definition("TKOFF_THR_SLEW", 0.0, -1.0, 127.0, _PERCENT),
    "takeoff_throttle": Definition("TKOFF_THR_MAX", 0.0, 0.0, 100.0, _PERCENT),
    "landing_pitch": Definition("LAND_PITCH_DEG", 0.0, -20.0, 20.0, _DEGREE, ("LAND_PITCH_CD", _CENTI)),
    "landing_pitch_max": Definition("TECS_LAND_PMAX", 10.0, -5.0, 45.0, _DEGREE),
    "landing_speed_weight": Definition("TECS_LAND_SPDWGT", -1.0, -1.0, 2.0),
    "landing_time": Definition("TECS_LAND_TCONST", 2.0, 0.1, 20.0),
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
}
# Bit of FLIGHT_OPTIONS that has a return climb to its height before it turns.
CLIMB_BEFORE_TURN = 1 << 4
# Bits of TERRAIN_FOLLOW: every mode, and RTL.
_FOLLOW_ALWAYS, _FOLLOW_HOME = 1 << 0, 1 << 4
# Bits of FENCE_TYPE that are limits of its own, and not the mission's fence: altitudes and a circle about home.
_OWN_FENCES = 0b1011
# Of a loiter whose radius is stated as 1 m or less, m (ArduPlane's `LOITER_RADIUS_DEFAULT`).
_USUAL_LOITER_RADIUS = 60.0
# Read, and no flight of ours shows it: a return is on a slope where this would have it follow the terrain.
NOT_FLOWN = ("TERRAIN_FOLLOW",)
ARDUPILOT_PARAMETERS = record_dtype(*DEFINITIONS)


@dataclass(frozen=True, slots=True)
class ArduPilotParameters:
    """What ArduPlane flies with; all but the first three are those of `DEFINITIONS`, made of ``values``.

    values: every parameter that the law knows, in the order of `DEFINITIONS`.
    unused: names that the file states and the law has no use for.
    source: the file that a person gave, "" for none.
    navl1_period: s.  navl1_xtrack_i: 1/s.
    wp_radius: m, turns begin this far before a right angle.  wp_max_radius: m, 0 for none.
    wp_loiter_rad: m, of a loiter that states none, negative to the left.
    roll_limit, pitch_limit_max, pitch_limit_min, pitch_trim: rad.
    roll_time, pitch_time: s, in which an attitude is to follow its demand.
    airspeed_cruise, airspeed_min, airspeed_max: m/s, equivalent airspeeds.
    stall_prevention: 1 where a bank is narrowed, and the minimum airspeed raised, for the load in it; 0 where not.
    throttle_min, throttle_max, throttle_cruise: 0..1.  throttle_slew: of the throttle's range, 1/s, 0 for no limit.
    glide_slope_min: m, a leg that climbs or sinks less is flown as a step.
    glide_slope_threshold: m, so far above a climbing slope it is drawn anew, 0 for never.
    tecs_climb_max, tecs_sink_min, tecs_sink_max: m/s.
    tecs_time: s.  tecs_vertical_acceleration: m/s^2.  tecs_speed_frequency: rad/s.
    tecs_roll_to_throttle: m/s climb that a bank of 45 degrees takes.
    tecs_pitch_max, tecs_pitch_min: rad, 0 for the pitch limits.
    tecs_height_demand_time: s, of the height demand's lag.
    rtl_altitude: m over home, negative for the present height.  rtl_radius: m, 0 for that of a loiter.
    rtl_climb_min: m that a return climbs before it turns.  level_roll_limit: rad, its bank meanwhile.
    flight_options: bits; bit 4 has a return climb to its height before it turns.
    rally_limit: m, a nearest rally point further away than this is not flown to; 0 for no limit.
    rally_includes_home: 1 where a return goes home if that is nearer than any rally point; 0 where not.
    rtl_autoland: 0 where a return stays in its circle; 1 has it go on from there to the mission's landing sequence, 2
        straight to it, 3 says that sequence is for go-arounds only, 4 goes by the mission's return path.
    terrain_enable: 1 if it has heights of the terrain.  terrain_lookahead: m, the farthest that it looks ahead for
        rising ground on a leg above ground; terrain_spacing: m, between the places there.
    terrain_follow: bits of the modes that follow the terrain.
    low_voltage, critical_voltage: V.  low_charge, critical_charge: mAh; 0 or less triggers nothing.
    flare_time: s before the touch-down that the glide aims to flare at.  flare_height: m; half the most that the flare
        begins at.  flare_weight: share of the flare that is flown with the sink of its end.
    landing_sink: m/s, at the flare's end.  landing_airspeed: m/s, negative for the mean of cruise and minimum.
    landing_head_wind: share of the head wind by which that is raised, up to the cruise airspeed.
    takeoff_acceleration: m/s^2 along the nose that starts the motor; 0 where it needs none.
    takeoff_delay: s after that.
    takeoff_ground_speed: m/s that it needs by then.  takeoff_rotation: m/s, until then the nose is at
        takeoff_ground_pitch (rad).  takeoff_level_height: m, to which the bank of a take-off is level_roll_limit; it is
        free at three times that.  takeoff_leveling: s before its end that a take-off begins to level off.
    takeoff_slew: of the throttle's range in a take-off, 1/s; 0 for throttle_slew, negative for no limit.
    takeoff_throttle: 0..1, 0 for throttle_max.
    landing_pitch: rad, least of the flare.  landing_pitch_max: rad, its largest; 0 for that of flight.
    landing_speed_weight: of TECS in a landing, negative for one that falls to 0 on its way.  landing_time: s, of TECS.
    landing_sink_change: m/s of sink a metre beyond the landing point.  flare_holdoff: m, at which the sink is the last.
    fence_type: bits of the limits that its fence has: 1 and 8 altitudes, 2 a circle about home, 4 the mission's fence.
    altitude_offset: m, added to the altitudes of mission items.  soaring, quadplane, rudder_only: 1 where it soars, has
        lift motors, or steers by the rudder alone; no flight shows any of these four.
    throttle_failsafe to fence_auto_enable: when it leaves its mission by itself, and what it does then; see
        `flight.autopilots.arduplane.failsafes`.
    """

    not_flown: ClassVar[tuple[str, ...]] = NOT_FLOWN
    values: tuple[ParameterValue, ...]
    unused: tuple[str, ...] = ()
    source: str = ""
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
    stall_prevention: float = field(init=False)
    throttle_min: float = field(init=False)
    throttle_max: float = field(init=False)
    throttle_cruise: float = field(init=False)
    throttle_slew: float = field(init=False)
    glide_slope_min: float = field(init=False)
    glide_slope_threshold: float = field(init=False)
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

    def __post_init__(self) -> None:
        """Take the values to SI."""
        for (name, definition), parameter in zip(DEFINITIONS.items(), self.values, strict=True):
            object.__setattr__(self, name, parameter.value * definition.to_si)

    @property
    def beyond(self) -> tuple[str, ...]:
        """Nothing: a value beyond its range is refused."""
        return ()

    @property
    def misfits(self) -> tuple[str, ...]:
        r"""Values of the file that contradict another parameter, in words; ArduPlane flies with them all the same.

        >>> parameters_of("TRIM_THROTTLE 60\nTHR_MAX 50", "mine.param").misfits
        ('THR_MAX 50 of the file is below TRIM_THROTTLE 60 of the file',)
        """
        return find_misfits(self.values, _ORDERS)

    def changed(self, **values: float) -> "ArduPilotParameters":
        """The same parameters but for these, by ArduPlane's names and in its units.

        >>> default_parameters().changed(ROLL_LIMIT_DEG=30.0).roll_limit == math.radians(30.0)
        True
        """
        kept = {parameter.name for parameter in self.values}
        if unknown := sorted(set(values) - kept):
            raise ValueError(f"{unknown[0]}: not a parameter of the law")
        made = tuple(
            parameter._replace(value=values[parameter.name], origin="file") if parameter.name in values else parameter
            for parameter in self.values
        )
        return ArduPilotParameters(made, self.unused, self.source)

    @property
    def climbs_before_turn(self) -> bool:
        """Whether a return climbs to its height before it turns: bit 4 of FLIGHT_OPTIONS."""
        return bool(int(self.flight_options) & CLIMB_BEFORE_TURN)

    @property
    def follows_terrain_home(self) -> bool:
        """Whether a return follows the terrain: bit 0 or 4 of TERRAIN_FOLLOW.

        >>> [default_parameters().changed(TERRAIN_FOLLOW=bits).follows_terrain_home for bits in (0, 1, 8, 16)]
        [False, True, False, True]
        """
        return bool(int(self.terrain_follow) & (_FOLLOW_ALWAYS | _FOLLOW_HOME))

    @property
    def has_fence_of_its_own(self) -> bool:
        """True if its fence is on, acts, and has a circle about home or altitudes.

        >>> [default_parameters().changed(FENCE_ENABLE=1, FENCE_TYPE=kind).has_fence_of_its_own for kind in (4, 6)]
        [False, True]
        """
        enabled = self.fence_enable > 0.0 or self.fence_auto_enable > 0.0
        return enabled and self.fence_action > 0.0 and bool(int(self.fence_type) & _OWN_FENCES)

    @property
    def return_radius(self) -> float:
        """Radius of the circle that a return ends in, m at sea level, negative to the left.

        RTL_RADIUS, or WP_LOITER_RAD where that is 1 m or less, or 60 m where both are; to the side of RTL_RADIUS if
        that is not 0 (`ModeRTL::navigate` in ArduPlane/mode_rtl.cpp, `Plane::update_loiter` in navigation.cpp).

        >>> made = default_parameters()
        >>> [made.changed(RTL_RADIUS=m, WP_LOITER_RAD=-80.0).return_radius for m in (0.0, -150.0, 1.0)]
        [-80.0, -150.0, 80.0]
        >>> made.return_radius, made.changed(WP_LOITER_RAD=-1.0).return_radius
        (60.0, -60.0)
        """
        size = next((abs(radius) for radius in (self.rtl_radius, self.wp_loiter_rad) if abs(radius) > 1.0), None)
        return math.copysign(size or _USUAL_LOITER_RADIUS, self.rtl_radius or self.wp_loiter_rad)

    @property
    def loiter_radius(self) -> float:
        """Radius of a loiter that states none, m at sea level, negative to the left: WP_LOITER_RAD, or 60 m."""
        size = abs(self.wp_loiter_rad)
        return math.copysign(size if size > 1.0 else _USUAL_LOITER_RADIUS, self.wp_loiter_rad)

    def by_origin(self, origin: Origin) -> dict[str, float]:
        """The values (in ArduPlane's units) that one source states, by name."""
        return {name: value for name, value, stated in self.values if stated == origin}

    def record(self) -> Record:
        """The parameters for compiled code, as a record of `ARDUPILOT_PARAMETERS`."""
        record: Record = np.zeros(1, ARDUPILOT_PARAMETERS)[0]
        for name in DEFINITIONS:
            setattr(record, name, getattr(self, name))
        return record


def default_parameters() -> ArduPilotParameters:
    """ArduPlane's own values, whatever it flies.

    >>> default_parameters().wp_radius, default_parameters().tecs_height_demand_time
    (90.0, 3.0)
    """
    return _parameters([], "", ())


def load_parameters(aircraft: Aircraft, path: Path | str | None = None) -> ArduPilotParameters:
    """The parameters that an aircraft is flown with: of a file, of the aircraft, and ArduPlane's defaults.

    Raises ParameterError, in one line, for a file that cannot be read or states what is not allowed.

    >>> from aircraft.catalog import load_aircraft
    >>> load_parameters(load_aircraft("aerosonde")).wp_radius
    90.0
    """
    stated: list[tuple[Origin, dict[str, float]]] = []
    unused: tuple[str, ...] = ()
    if path is not None:
        entries = read_parameters_for(Path(path), ARDUPILOT)
        values, unused = _known(entries)
        refuse_unknown(Path(path), ARDUPILOT, entries, values)
        stated.append(("file", values))
    own = aircraft.folder / AIRCRAFT_FILE
    if own.exists():
        stated.append(("aircraft", _known(read_parameter_file(own))[0]))
    return _parameters(stated, "" if path is None else str(path), unused)


def parameters_of(text: str, source: str) -> ArduPilotParameters:
    r"""The parameters of a file's text alone, with ArduPlane's defaults.  Raises ParameterError.

    >>> parameters_of("LIM_ROLL_CD 3000\nFOO 1\n", "old.parm").unused
    ('FOO',)
    """
    values, unused = _known(parse_parameters(text, source))
    return _parameters([("file", values)], source, unused)


def stored_parameters(stored: StoredParameters) -> ArduPilotParameters:
    """Parameters that were recorded, by their present names; those that were not yet known have their defaults.

    Raises ParameterError for a value that is not allowed.

    >>> stored_parameters(StoredParameters((ParameterValue("WP_RADIUS", 50.0, "file"),), (), "a.parm")).wp_radius
    50.0
    """
    origins: dict[Origin, dict[str, float]] = {"file": {}, "aircraft": {}, "default": {}}
    for name, value, origin in stored.values:
        if name in _BY_NAME:
            definition, _ = _BY_NAME[name]
            if not definition.low <= value <= definition.high:
                raise _refused(stored.source, name, value, f"allowed {definition.low:g}..{definition.high:g}")
            origins[origin][name] = value
    return _parameters(list(origins.items()), stored.source, stored.unused)


# What has to be in order, but that ArduPlane does not compare.
_ORDERS = (
    ("THR_MIN", "TRIM_THROTTLE", "THR_MAX"),
    ("AIRSPEED_MIN", "AIRSPEED_CRUISE", "AIRSPEED_MAX"),
    ("PTCH_LIM_MIN_DEG", "PTCH_TRIM_DEG", "PTCH_LIM_MAX_DEG"),
    ("TECS_SINK_MIN", "TECS_SINK_MAX"),
)
# What has to be in order.
_PAIRS = (("THR_MIN", "THR_MAX"), ("AIRSPEED_MIN", "AIRSPEED_MAX"))


def logged_parameters(logged: Mapping[str, float], source: str) -> tuple[ArduPilotParameters, tuple[str, ...]]:
    """The parameters of a flight log, by their names of any release, and what could not be used of them, in sentences.

    A log without parameters has ArduPlane's defaults, and says so.  source: the log's file.

    >>> made, notes = logged_parameters({"LIM_ROLL_CD": 4500.0, "WP_RADIUS": -5.0}, "a.BIN")
    >>> made.by_origin("file"), notes
    ({'ROLL_LIMIT_DEG': 45.0}, ('WP_RADIUS -5 of the log is not allowed: the default is taken',))
    """
    values: dict[str, float] = {}
    notes = []
    for definition in DEFINITIONS.values():
        old = definition.old
        if definition.name in logged:
            value = logged[definition.name]
        elif old is not None and old[0] in logged:
            value = logged[old[0]] * old[1]
        else:
            continue
        if definition.low <= value <= definition.high:
            values[definition.name] = value
        else:
            notes.append(f"{definition.name} {value:g} of the log is not allowed: the default is taken")
    for low, high in _PAIRS:
        if low in values and high in values and values[low] >= values[high]:
            notes.append(f"{low} {values[low]:g} and {high} {values[high]:g} of the log: the defaults are taken")
            del values[low], values[high]
    if not values:
        notes.append("the log holds no parameters: ArduPlane's defaults are taken")
    stated = tuple(ParameterValue(name, value, "file") for name, value in values.items())
    try:
        return stored_parameters(StoredParameters(stated, (), source)), tuple(notes)
    except ParameterError as error:
        return default_parameters(), (*notes, f"{error}: ArduPlane's defaults are taken")


def _parameters(
    stated: list[tuple[Origin, dict[str, float]]], source: str, unused: tuple[str, ...]
) -> ArduPilotParameters:
    """Parameters of the first source that states each, and ArduPlane's default where none does."""

    def found(definition: Definition) -> ParameterValue:
        for origin, values in stated:
            if definition.name in values:
                return ParameterValue(definition.name, values[definition.name], origin)
        return ParameterValue(definition.name, definition.default, "default")

    made = ArduPilotParameters(tuple(map(found, DEFINITIONS.values())), unused, source)
    if stated:
        _check_order(made, source or AIRCRAFT_FILE)
    return made


def _check_order(made: ArduPilotParameters, source: str) -> None:
    """Refuse a minimum that is not below its maximum."""
    values = {name: value for name, value, _ in made.values}
    for low, high in _PAIRS:
        if values[low] >= values[high]:
            value, allowed = values[low], f"must be below {high} {values[high]:g}"
            message = f"{source}: {low} {value:g}: {allowed}"
            raise ParameterError(message, file=source, field=low, value=value, allowed=allowed)


# Definition and factor to its unit, by each name that a file may have.
_BY_NAME = {definition.name: (definition, 1.0) for definition in DEFINITIONS.values()} | {
    definition.old[0]: (definition, definition.old[1]) for definition in DEFINITIONS.values() if definition.old
}


def _known(entries: Mapping[str, Entry]) -> tuple[dict[str, float], tuple[str, ...]]:
    """Values by their present names and in their present units, and the names that the law has no use for."""
    values: dict[str, float] = {}
    unused = []
    for name, entry in entries.items():
        if name not in _BY_NAME:
            unused.append(name)
            continue
        definition, factor = _BY_NAME[name]
        value = entry.value * factor
        if not definition.low <= value <= definition.high:
            raise _refused(
                entry.where, name, entry.value, f"allowed {definition.low / factor:g}..{definition.high / factor:g}"
            )
        if values.setdefault(definition.name, value) != value:
            raise _refused(entry.where, name, entry.value, "the same parameter has another value under its other name")
    return values, tuple(unused)


def _refused(where: TextLine | str, name: str, value: float, allowed: str) -> ParameterError:
    """The error of a value.  where: its line; of one that was recorded, the source, which the message does not name."""
    at, file = (f"{where}: ", where.file) if isinstance(where, TextLine) else ("", where)
    return ParameterError(f"{at}{name}: {value:g}: {allowed}", file=file, field=name, value=value, allowed=allowed)


# ----------------------------------------------------------------------
# Parameters that may decide a flight that fails, with the steps and ranges of the parameter reference.

HEIGHT_CANDIDATES = (
    Candidate("TECS_HDEM_TCONST", 0.2, 1.0, "s"),
    Candidate("TECS_CLMB_MAX", 0.5, 10.0, "m/s"),
    Candidate("TECS_SINK_MAX", 0.5, 10.0, "m/s"),
    Candidate("TECS_TIME_CONST", 0.2, 3.0, "s"),
)
SIDE_CANDIDATES = (
    Candidate("NAVL1_PERIOD", 1.0, 10.0, "s"),
    Candidate("WP_RADIUS", 5.0, 30.0, "m"),
    Candidate("WP_RADIUS", 5.0, 150.0, "m"),
    Candidate("ROLL_LIMIT_DEG", 1.0, 60.0, "deg"),
)


# ----------------------------------------------------------------------
# Which of a mission's airspeeds ArduPlane takes up.


def takes_speed(airspeed: float, parameters: ArduPilotParameters) -> bool:
    """Whether ArduPlane takes a commanded airspeed (m/s, equivalent): from AIRSPEED_MIN to AIRSPEED_MAX.

    A command of another speed changes nothing: told to fly at 17 m/s with AIRSPEED_MIN at 18, ArduPlane 4.6 flew on at
    its 25.

    >>> from flight.autopilots.arduplane.parameters import default_parameters
    >>> takes_speed(22.0, default_parameters()), takes_speed(22.1, default_parameters())
    (True, False)
    """
    return parameters.airspeed_min <= airspeed <= parameters.airspeed_max


def speeds_flown(commanded: Floats, cruise: float, parameters: ArduPilotParameters) -> Floats:
    """Airspeeds (l,) that ArduPlane flies on each leg, of those commanded (l,); m/s, equivalent.

    cruise: its airspeed until it takes up the first.

    >>> from flight.autopilots.arduplane.parameters import default_parameters
    >>> speeds_flown(np.array([8.0, 15.0, 30.0, 10.0]), 12.0, default_parameters()).tolist()
    [12.0, 15.0, 15.0, 10.0]
    """
    flown = []
    speed = cruise
    for wanted in commanded.tolist():
        speed = wanted if takes_speed(wanted, parameters) else speed
        flown.append(speed)
    return np.array(flown)
