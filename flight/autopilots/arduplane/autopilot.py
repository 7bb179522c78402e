"""ArduPlane's control law as an autopilot, with its parameters."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, Self

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.contacts import Contact
from aircraft.tracking import TrackingError
from flight.autopilots.arduplane.failsafes import battery_failsafes
from flight.autopilots.arduplane.ground_law import (
    ARDUPLANE_GROUND,
    CONTACTS,
    IN_AIR,
    TAKING_OFF,
    ground_loop,
    ground_tick,
)
from flight.autopilots.arduplane.landing import go_around_height, landing_airspeed, landing_glide
from flight.autopilots.arduplane.launch import motor_start, takeoff_slew
from flight.autopilots.arduplane.law import ARDUPLANE, arduplane_loop, arduplane_tick
from flight.autopilots.arduplane.navigator import LOITER_ALTITUDE_TOLERANCE_M, MAX_ACCEPTANCE_M, turn_distance
from flight.autopilots.arduplane.open_settings import describe_open_settings
from flight.autopilots.arduplane.parameters import (
    HEIGHT_CANDIDATES,
    SIDE_CANDIDATES,
    ArduPilotParameters,
    speeds_flown,
)
from flight.autopilots.arduplane.releases import choose_release, release_note, simulated_release
from flight.autopilots.arduplane.tracking_error import tracking_error
from flight.autopilots.autopilot import (
    Autopilot,
    BatteryFailsafe,
    GroundAutopilot,
    LandingGlide,
    Loop,
    MissionParts,
    SpeedLimits,
    StoredAutopilot,
    StoredParameters,
    Tick,
)
from flight.autopilots.gust_height import height_in_updrafts
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.mission.ground_ways import Approach, GroundPhases, TakeOff
from flight.mission.itinerary import Loiter
from flight.mission.loiter_circles import LoiterRules
from flight.mission.return_path import ReturnRules
from world.arrays import Floats
from world.kernels import Record
from world.scenario_tables import ArduPlaneVersion, FlightTable, Navigation
from world.wind import Turbulence

# Fields of `flight.autopilots.arduplane.law.ARDUPILOT_MEMORY` that belong to the current leg or mission, not to the
# aircraft.
_LEG_FIELDS = (
    *(
        "leg",
        "cross_track_integrator",
        "reached_loiter_target",
        "loiter_started",
        "loiter_time",
        "loiter_angle_sum",
        "old_loiter_bearing",
        "reached_target_altitude",
        "next_sum_lap",
    ),
    *(
        "start_lap_altitude",
        "loiter_complete",
        "exit_wait_angle",
        "leg_after_loiter",
        "is_in_rtl",
        "rtl_climb_complete",
        "terrain_leg",
        "sloped_leg",
    ),
)


# Neutral values of parameters that change the flight of a mission and are not simulated: an altitude offset,
# soaring, lift motors, turns by rudder alone, and flight without an airspeed sensor.
_NEUTRAL = {
    "ALT_OFFSET": 0.0,
    "SOAR_ENABLE": 0.0,
    "Q_ENABLE": 0.0,
    "RUDDER_ONLY": 0.0,
    "ARSPD_USE": 1.0,
}


@dataclass(frozen=True)
class ArduPlane(Autopilot):
    """ArduPlane's control law: L1 along the legs, TECS for altitude and airspeed.

    >>> made = ArduPlane(ArduPilotParameters.defaults())
    >>> made.acceptance_radius, made.turn_distance(math.radians(45.0), 0.0), made.speed_limits[:2]
    (90.0, 45.0, (9.0, 22.0))
    """

    name: ClassVar = "ardupilot"
    title: ClassVar = "ArduPlane"
    own: ClassVar[np.dtype[np.record] | None] = ARDUPLANE
    cruise_parameter: ClassVar = "AIRSPEED_CRUISE"
    equivalent_airspeeds: ClassVar = True
    acceptance_limit: ClassVar = MAX_ACCEPTANCE_M
    refuses_as_arduplane: ClassVar = True
    flies_ground: ClassVar[bool] = True
    height_candidates: ClassVar = HEIGHT_CANDIDATES
    side_candidates: ClassVar = SIDE_CANDIDATES
    parameters: ArduPilotParameters = field()

    @classmethod
    def load(cls, table: FlightTable, aircraft: Aircraft, scenario: str) -> Self:
        """Return the autopilot with the parameters of the user's file, of the aircraft, and the defaults.

        Its release is the stated one, or the release that wrote the file, or the newest.
        """
        version, notes = choose_release(table.arduplane_version, table.params)
        return cls(ArduPilotParameters.load(aircraft, table.params, version, notes))

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """Return the autopilot with the parameters and the release that a log stores.

        A log that states no release was flown by the control law of 4.6.
        """
        version = stored.version or "4.6"
        if stored.parameters is None:
            return cls(ArduPilotParameters.defaults(version))
        return cls(ArduPilotParameters.restore(stored.parameters, version))

    def store(self) -> StoredAutopilot:
        """Return its parameters and its release for a log."""
        parameters = self.parameters
        stored = StoredParameters(parameters.values, parameters.unused, parameters.source)
        return StoredAutopilot(parameters=stored, program=self.program, version=parameters.version)

    def in_release(self, version: ArduPlaneVersion) -> Self:
        """Return the same autopilot with the control law of another ArduPlane release."""
        return replace(self, parameters=self.parameters.in_release(version))

    @classmethod
    def of_flight_log(
        cls, program: str, parameters: Mapping[str, float], source: str
    ) -> tuple[Self, tuple[str, ...]] | None:
        """Return ArduPlane with the log's parameters, for a log of any ArduPlane release."""
        if not program.startswith("ArduP"):
            return None
        law_parameters, notes = ArduPilotParameters.of_log(parameters, source, simulated_release(program))
        note = release_note(program)
        return cls(law_parameters), (note, *notes) if note else notes

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """Return an empty list, because ArduPlane has a default for each parameter that the aircraft does not state."""
        ArduPilotParameters.load(aircraft)
        return []

    @property
    def tick(self) -> Tick:
        """Compiled function for one tick of ArduPlane's controllers."""
        return arduplane_tick

    @property
    def loop(self) -> Loop:
        """Compiled simulation loop of ArduPlane's controllers and the aircraft model."""
        return arduplane_loop

    def initialise_records(self, guidance: Record, record: Record) -> None:
        """Copy the parameters into the controllers' record."""
        record.parameters = self.parameters.record()

    def transfer_state(self, previous_record: Record, record: Record, start: Floats) -> None:
        """Start a new leg at ``start``, as after a change of mode, and keep the state of TECS and airspeed filter."""
        record.memory = previous_record.memory
        for name in _LEG_FIELDS:
            setattr(record.memory, name, 0)
        record.memory.from_east, record.memory.from_north, record.memory.from_up = start

    def described(self, aircraft: str) -> str:
        """Return a description of the simulated ArduPlane with the parameters that matter most in a flight."""
        parameters = self.parameters
        source_text = f"the parameters of {parameters.source}" if parameters.source else "its default parameters"
        return (
            f"the simulated ArduPlane {parameters.version} with {source_text} (WP_RADIUS {parameters.wp_radius:g} m,"
            f" NAVL1_PERIOD {parameters.navl1_period:g} s, TECS_HDEM_TCONST {parameters.tecs_height_demand_time:g} s)"
        )

    @property
    def version(self) -> str:
        """Simulated ArduPlane release."""
        return self.parameters.version

    @property
    def parameter_notes(self) -> tuple[str, ...]:
        """Notes on a parameter file of another release."""
        return self.parameters.notes

    @property
    def battery_failsafes(self) -> tuple[BatteryFailsafe, ...]:
        """Failsafes from BATT_FS_LOW_ACT and BATT_FS_CRT_ACT with their thresholds; none in a program's flight."""
        return () if self.is_program else battery_failsafes(self.parameters)

    @property
    def resets_jump_counters(self) -> bool:
        """True in 4.7, unless MIS_OPTIONS keeps the counters."""
        return self.parameters.resets_jump_counters

    @property
    def acceptance_radius(self) -> float | None:
        """WP_RADIUS."""
        return self.parameters.wp_radius

    def settings_not_flown(self, mission: MissionParts) -> list[str]:
        """Return `_NEUTRAL` settings that are not neutral, zero rate gains, an own fence, RTL over terrain, and others.

        The others are those of `flight.autopilots.arduplane.open_settings`.
        """
        parameters = self.parameters
        values = {name: value for name, value, _ in parameters.values}
        texts = [
            f"{name} {values[name]:g} changes the flight and is not flown"
            for name, neutral in _NEUTRAL.items()
            if values[name] != neutral
        ]
        texts += [
            f"{axis}_P 0 and {axis}_FF 0 leave the attitude uncontrolled, which is not flown"
            for axis in ("RLL_RATE", "PTCH_RATE")
            if values[f"{axis}_P"] == values[f"{axis}_FF"] == 0.0
        ]
        fence_parameters = parameters.changed(FENCE_ENABLE=1.0) if mission.enables_fence else parameters
        if fence_parameters.has_fence_of_its_own:
            texts.append(f"the circle and the altitudes of FENCE_TYPE {parameters.fence_type:g} are not judged")
        if mission.returns and parameters.rtl_follows_terrain:
            texts.append(
                f"TERRAIN_FOLLOW {parameters.terrain_follow:g} has the return follow the terrain, which is not flown"
            )
        return texts + describe_open_settings(parameters, mission, by_program=self.is_program)

    @property
    def follows_ground(self) -> bool:
        """TERRAIN_ENABLE."""
        return self.parameters.terrain_enable == 1.0

    def turn_distance(self, turn: float, amsl: float) -> float:
        """Return WP_RADIUS for a right angle, more in thin air, and a fraction of it for a smaller turn."""
        factor = float(true_by_equivalent(amsl))
        return float(turn_distance(0.0, turn, self.parameters.wp_radius, math.inf, factor))

    def airspeed_factor(self, amsl: float) -> float:
        """Return the ratio of true to equivalent airspeed."""
        return float(true_by_equivalent(amsl))

    def landing_airspeed(self, cruise: float, tail_wind: float, amsl: float) -> float:
        """Return the airspeed by TECS_LAND_ARSPD, or AIRSPEED_CRUISE and AIRSPEED_MIN, and LAND_WIND_COMP."""
        return landing_airspeed(self.parameters, tail_wind) * self.airspeed_factor(amsl)

    def with_scenario_rtl_settings(
        self, rtl_altitude: float | None, rtl_autoland: int | None, *, lands: bool, lower: float = 0.0
    ) -> Autopilot:
        """Return the autopilot with a scenario's RTL_ALTITUDE and RTL_AUTOLAND.

        RTL_AUTOLAND is 1 unless a file states it: with 0 ArduPlane does not arm if the mission has a landing.  On a
        field that is lower than home the flare would climb (`flight.autopilots.arduplane.ground_law`): there
        TECS_LAND_PMAX holds the nose down unless a file states it.

        >>> default = ArduPlane(ArduPilotParameters.defaults())
        >>> made = default.with_scenario_rtl_settings(180.0, None, lands=True, lower=50.0)
        >>> made.parameters.rtl_altitude, made.parameters.rtl_autoland, round(made.parameters.landing_pitch_max, 4)
        (180.0, 1.0, -0.0175)
        """
        values = {} if rtl_altitude is None else {"RTL_ALTITUDE": rtl_altitude}
        stated = self.parameters.by_origin("file")
        if rtl_autoland is not None:
            values["RTL_AUTOLAND"] = float(rtl_autoland)
        elif lands and self.parameters.rtl_autoland == 0.0 and "RTL_AUTOLAND" not in stated:
            values["RTL_AUTOLAND"] = 1.0
        if lands and lower > _LOW_FIELD_M and "TECS_LAND_PMAX" not in stated:
            values["TECS_LAND_PMAX"] = _NOSE_DOWN_DEG
        return ArduPlane(self.parameters.changed(**values)) if values else self

    def landing_glide(self, height: float, run: float, tail_wind: float, amsl: float) -> LandingGlide:
        """Return the glide by LAND_FLARE_*, LAND_WIND_COMP, TECS_LAND_SINK and TECS_LAND_ARSPD."""
        airspeed = self.landing_airspeed(0.0, tail_wind, amsl)
        return landing_glide(height, run, airspeed + tail_wind, self.parameters)

    @property
    def launch_trigger(self) -> tuple[float, str] | None:
        """TKOFF_THR_MINACC."""
        min_acceleration = self.parameters.takeoff_acceleration
        return (min_acceleration, "TKOFF_THR_MINACC") if min_acceleration > 0.0 else None

    def go_around_height(self, stated_height: float, takeoff_height: float) -> float | None:
        """Return the landing item's first parameter, or the take-off's height, or 30 m."""
        return go_around_height(stated_height, takeoff_height)

    @property
    def return_rules(self) -> ReturnRules:
        """Rules of an RTL from RTL_*, FLIGHT_OPTIONS, LEVEL_ROLL_LIMIT, RALLY_* and TECS and slope limits.

        >>> made = ArduPlane(ArduPilotParameters.defaults().changed(RTL_ALTITUDE=-1, FLIGHT_OPTIONS=16, RTL_AUTOLAND=2))
        >>> made.return_rules.height, made.return_rules.climb_first, made.return_rules.rally_limit
        (nan, inf, 5000.0)
        >>> made.return_rules.lands
        'straight'
        """
        parameters = self.parameters
        return ReturnRules(
            height=math.nan if parameters.rtl_altitude < 0.0 else parameters.rtl_altitude,
            radius=parameters.return_radius,
            climb_first=math.inf if parameters.climbs_before_turn else parameters.rtl_climb_min,
            first_bank=min(parameters.level_roll_limit, parameters.roll_limit),
            sink=parameters.tecs_sink_max or math.inf,
            min_slope_height=parameters.altitude_slope_min,
            rally_limit=parameters.rally_limit,
            includes_home=parameters.rally_includes_home > 0.0,
            slope_to_stated_height=True,
            lands=_LANDS.get(int(parameters.rtl_autoland), ""),
            deviation_note=_RETURN_PATH if int(parameters.rtl_autoland) == 4 else "",
        )

    @property
    def loiter_rules(self) -> LoiterRules:
        """Rules of loiters from WP_LOITER_RAD, the air's density, and `LOITER_ALTITUDE_TOLERANCE_M`.

        >>> rules = ArduPlane(ArduPilotParameters.defaults().changed(WP_LOITER_RAD=-80.0)).loiter_rules
        >>> rules.radius, round(rules.radius_scale(1300.0), 3)
        (-80.0, 1.135)
        """
        parameters = self.parameters
        return LoiterRules(
            radius=parameters.loiter_radius,
            radius_name="WP_LOITER_RAD",
            radius_of=radius_read,
            radius_scale=_radius_growth,
            steers_to_center=True,
            exits_on_heading=True,
            climb=parameters.tecs_climb_max,
            sink=parameters.tecs_sink_max or math.inf,
            altitude_tolerance=LOITER_ALTITUDE_TOLERANCE_M,
            unflown_note=_bank_limit_note(parameters.navl1_lim_bank),
            rtl_exit_note=_BEFORE_RETURN,
        )

    @property
    def speed_limits(self) -> SpeedLimits | None:
        """AIRSPEED_MIN and AIRSPEED_MAX."""
        return SpeedLimits(self.parameters.airspeed_min, self.parameters.airspeed_max, "AIRSPEED_MIN", "AIRSPEED_MAX")

    @property
    def min_ground_speed(self) -> float:
        """MIN_GROUNDSPEED."""
        return self.parameters.ground_speed_min

    def speeds_flown(self, commanded: Floats, cruise: float) -> Floats:
        """Return the last airspeed that ArduPlane accepted, for each leg."""
        return speeds_flown(commanded, cruise, self.parameters)

    @property
    def stated_bank(self) -> float | None:
        """ROLL_LIMIT_DEG of the user's file, or None if the file does not state it."""
        return self.parameters.roll_limit if "ROLL_LIMIT_DEG" in self.parameters.by_origin("file") else None

    @property
    def bank_limit(self) -> float:
        """ROLL_LIMIT_DEG, from any source."""
        return self.parameters.roll_limit

    def tracking_error(
        self, airspeed: float, nav: Navigation, *, fly_over: bool = False, turbulence: Turbulence = "none"
    ) -> TrackingError | None:
        """Return ArduPlane's deviations with these parameters."""
        return tracking_error(self.parameters, airspeed, nav, fly_over=fly_over, turbulence=turbulence)

    def gust_rise(self, sink: float, turbulence: Turbulence) -> float:
        """Return the altitude gained in updrafts while ArduPlane holds airspeed and cannot sink fast enough, m."""
        return height_in_updrafts(sink, turbulence)

    def from_ground(
        self, ground_phases: GroundPhases, aircraft: Aircraft, contacts: Sequence[Contact]
    ) -> "ArduPlaneFromGround":
        """Return the same controllers with take-off and landing."""
        return ArduPlaneFromGround(
            self.parameters, ground_phases=ground_phases, aircraft=aircraft, contacts=tuple(contacts)
        )

    def with_parameters(self, **values: float) -> "ArduPlane":
        """Return ArduPlane's control law with the given parameters changed; it replaces a recorded program."""
        return ArduPlane(self.parameters.changed(**values))


@dataclass(frozen=True)
class ArduPlaneFromGround(ArduPlane, GroundAutopilot):
    """ArduPlane's law with take-off, landing, or both.

    ground_phases: take-off and landing that are flown.
    contacts: points where the aircraft touches the ground.
    """

    own: ClassVar[np.dtype[np.record] | None] = ARDUPLANE_GROUND
    ground_phases: GroundPhases = field(kw_only=True)
    aircraft: Aircraft = field(kw_only=True)
    contacts: tuple[Contact, ...] = field(kw_only=True)

    @property
    def tick(self) -> Tick:
        """Compiled function for one tick of ArduPlane's controllers."""
        return ground_tick

    @property
    def loop(self) -> Loop:
        """Compiled simulation loop of ArduPlane's controllers and the aircraft model."""
        return ground_loop

    @property
    def motor_start(self) -> float:
        """Time of the motor start, s after the release; inf if it never starts."""
        take_off = self.ground_phases.take_off
        if take_off is None:
            return -math.inf
        return motor_start(take_off.acceleration, take_off.speed, take_off.launch.incline, self.parameters)

    @property
    def released_throttle(self) -> float:
        """Throttle at the end of the rail."""
        parameters = self.parameters
        # Without a slew limit the throttle opens at once (not 0 times infinity); it is closed if the motor starts
        # later.
        running_time = max(0.0, -self.motor_start)
        return min(
            parameters.takeoff_throttle or parameters.throttle_max,
            running_time * takeoff_slew(parameters) if running_time else 0.0,
        )

    def initialise_records(self, guidance: Record, record: Record) -> None:
        """Copy the parameters, the contacts, the take-off and the landing into the controllers' record."""
        super().initialise_records(guidance, record)
        record.stage_parameters = record.parameters
        ground = record.ground
        contacts = self.contacts[:CONTACTS]
        ground.contacts = len(contacts)
        for index, contact in enumerate(contacts):
            ground.contact[index] = contact.forward, contact.right, contact.down
            ground.is_support[index] = contact.stands
        ground.turnover_speed = _TURNOVER_SPEED_RATIO * self.aircraft.stall_speed
        ground.stage = IN_AIR
        if self.ground_phases.take_off is not None:
            self._begin_take_off(self.ground_phases.take_off, ground)
        if self.ground_phases.approach is not None:
            self._begin_landing(self.ground_phases.approach, ground)

    def _begin_take_off(self, take_off: TakeOff, ground: Record) -> None:
        parameters, launch = self.parameters, take_off.launch
        ground.stage, ground.is_on_runway = TAKING_OFF, launch.method == "runway"
        ground.motor_start = self.motor_start
        ground.throttle_slew, ground.takeoff_throttle = (
            takeoff_slew(parameters),
            parameters.takeoff_throttle or parameters.throttle_max,
        )
        ground.home_up, ground.takeoff_end_altitude, ground.launch_up = (
            take_off.home_altitude,
            take_off.end_altitude,
            take_off.home[2],
        )
        ground.takeoff_pitch, ground.leg = self._climb_pitch(take_off), take_off.waypoint
        # Start when the aircraft moved at 5 m/s, at which its course over the ground is known.
        acceleration = take_off.acceleration
        ground.time_at_course_speed = (
            max(0.0, take_off.speed - _COURSE_SPEED_MPS) / acceleration if acceleration else 0.0
        )

    def _climb_pitch(self, take_off: TakeOff) -> float:
        """Return the climb pitch, rad: the item's pitch, or the maximum pitch if the motor runs before the launch.

        TECS runs with the motor, and the launch winds its integrator up to the maximum pitch: two flights of ArduPlane
        4.6.3.  In five flights in which the launch acceleration started the motor it was the item's pitch.
        """
        if self.motor_start > -math.inf or take_off.acceleration <= 0.0:
            return take_off.pitch
        parameters = self.parameters
        return max(take_off.pitch, min(parameters.pitch_limit_max, parameters.tecs_pitch_max or math.inf))

    def _begin_landing(self, approach: Approach, ground: Record) -> None:
        landing_altitude = float(approach.point[2])
        glide = self.landing_glide(
            approach.start_altitude - landing_altitude, approach.length, approach.tail_wind, landing_altitude
        )
        ground.has_landing, ground.landing_leg = True, approach.leg
        ground.east, ground.north, ground.up = approach.point
        ground.glide_start_altitude, ground.slope = approach.start_altitude, glide.slope
        # `AP_TECS::_update_height_demand`.
        ground.flares_by_demand = self.parameters.version != "4.6"
        ground.flare_height, ground.flare_distance = glide.flare_height, glide.flare_distance
        ground.airspeed = landing_airspeed(self.parameters, approach.tail_wind)


# On a field lower than home by more than this, m, the flare climbs ...
_LOW_FIELD_M = 3.0
# ... unless the nose is held down to this pitch.
_NOSE_DOWN_DEG = -1.0
# No aircraft touches the ground with its nose, its tail or a wing above this ratio to its stall speed.
_TURNOVER_SPEED_RATIO = 0.75
# Ground speed above which ArduPlane knows its course, m/s.
_COURSE_SPEED_MPS = 5.0

# Continuation of an RTL, by RTL_AUTOLAND; with 3 the landing sequence is only for go-arounds.
_LANDS: dict[int, Literal["", "circle", "straight"]] = {1: "circle", 2: "straight"}
_RETURN_PATH = (
    "RTL_AUTOLAND 4 returns along the mission's return path or landing sequence: not flown, it stays in its circle"
)

# `Plane::verify_loiter_heading` lines up with the place of the next item; an RTL item has no place, which is 0 N 0 E.
_BEFORE_RETURN = (
    "ArduPlane leaves its circle on the heading to 0° N 0° E, and returns from there: so it is flown, but the route is"
    " judged on the heading to home"
)

# ArduPlane treats a radius up to this as no radius, m.
_NO_RADIUS_M = 1.0
# The radius of LOITER_TURNS is stored in a byte, in whole metres or, from this on, in tens of metres.  Loiters without
# end and to an altitude have sixteen bits (`AP_Mission::mavlink_int_to_mission_cmd`).
_MAX_BYTE_RADIUS_M = 255.0


def radius_read(loiter: Loiter) -> float:
    """Return the radius that ArduPlane reads from a loiter's item, m; 0 if it reads no radius.

    It reads the radius of loiters by turns, to an altitude, and without end.  For a loiter by time, even of zero time,
    it flies WP_LOITER_RAD, and reads only the side from the item: of the four `Plane::verify_loiter_*` only the
    function for time passes no radius of the item to `Plane::update_loiter`.

    >>> radius_read(Loiter(-250.7, turns=3)), radius_read(Loiter(307.0, turns=3)), radius_read(Loiter(1.0, turns=3))
    (250.0, 300.0, 0.0)
    >>> radius_read(Loiter(307.0, seconds=60.0, endless=True)), radius_read(Loiter(200.0, to_height=True))
    (307.0, 200.0)
    >>> radius_read(Loiter(200.0, seconds=60.0, timed=True)), radius_read(Loiter(200.0, timed=True))
    (0.0, 0.0)
    """
    if loiter.timed:
        return 0.0
    if not math.isfinite(loiter.radius):
        return abs(loiter.radius)
    stated_radius = float(math.floor(abs(loiter.radius)))
    if not (loiter.endless or loiter.to_height) and stated_radius > _MAX_BYTE_RADIUS_M:
        stated_radius = 10.0 * min(_MAX_BYTE_RADIUS_M, math.floor(stated_radius / 10.0))
    return stated_radius if stated_radius > _NO_RADIUS_M else 0.0


def _radius_growth(up: float) -> float:
    """Return the factor by which a loiter is wider at an altitude (m AMSL).

    It is the square of the ratio of true to equivalent airspeed.
    """
    return float(true_by_equivalent(up)) ** 2


def _bank_limit_note(bank: float) -> str:
    """Return a note that a bank limit for loiters (deg) is not simulated; "" if ArduPlane has no limit.

    With a limit, `AP_L1_Control::loiter_radius` lets a loiter grow with altitude only if the bank cannot hold its
    radius.
    """
    if bank <= 0.0:
        return ""
    return f"NAVL1_LIM_BANK {bank:g} is not flown: circles are as wide as without it, but ArduPlane's may be narrower"
