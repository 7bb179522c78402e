"""ArduPlane's control law as an autopilot, with its parameters."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import ClassVar, Literal, Self

from aircraft.catalog import Aircraft
from aircraft.contacts import Contact
from flight.autopilots.arduplane.failsafes import battery_failsafes, failsafe_causes, link_loss_reactions
from flight.autopilots.arduplane.ground_law import (
    ARDUPLANE_GROUND,
    IN_AIR,
    MAX_CONTACT_POINTS,
    TAKING_OFF,
    ground_loop,
    ground_tick,
)
from flight.autopilots.arduplane.landing import go_around_height, landing_airspeed, landing_glide
from flight.autopilots.arduplane.launch import motor_start_time, takeoff_slew
from flight.autopilots.arduplane.law import ARDUPLANE, arduplane_loop, arduplane_tick
from flight.autopilots.arduplane.navigator import LOITER_ALTITUDE_TOLERANCE_M, MAX_ACCEPTANCE_M, turn_distance
from flight.autopilots.arduplane.open_settings import describe_open_settings
from flight.autopilots.arduplane.parameters import (
    CLIMB_BEFORE_TURN,
    HEIGHT_CANDIDATES,
    MAX_TRIED_PITCH_DEG,
    SIDE_CANDIDATES,
    ArduPilotParameters,
)
from flight.autopilots.arduplane.releases import choose_release, release_difference_note, simulated_release
from flight.autopilots.arduplane.rtl_point_mass import fly_returns
from flight.autopilots.arduplane.tracking_error import tracking_error
from flight.autopilots.autopilot import Autopilot, Origin, StoredAutopilot, StoredParameters
from flight.autopilots.gust_height import updraft_altitude_gain
from flight.autopilots.parts import (
    Candidate,
    ControlLaw,
    Deviations,
    GroundRules,
    MissionChecks,
    MissionParts,
    RateLimit,
    ReturnBehaviour,
    ReturnMission,
    ReturnTrials,
    RtlSettings,
    SpeedLimits,
    SpeedRules,
    TurnRules,
)
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.mission.ground_phases import GroundPhases
from flight.mission.items import LANDINGS, Command
from flight.mission.itinerary import Loiter
from flight.mission.loiter_circles import LoiterRules
from flight.mission.return_path import ReturnRules
from world.arrays import Floats
from world.kernels import Record
from world.scenario_tables import NEWEST_ARDUPLANE, ArduPlaneVersion, FlightTable

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
        "from_item_height",
    ),
)


# Neutral values of parameters that change the flight of a mission and are not simulated: an altitude offset,
# soaring, lift motors, and turns by rudder alone.
_NEUTRAL = {
    "ALT_OFFSET": 0.0,
    "SOAR_ENABLE": 0.0,
    "Q_ENABLE": 0.0,
    "RUDDER_ONLY": 0.0,
}
# Values of RTL_CLIMB_MIN that are tried to make RTLs safe, m.
_TRIED_CLIMBS_M = (20.0, 50.0, 100.0, 200.0)
# Bit of FENCE_OPTIONS: a position inside any inclusion is inside the fence (`AC_PolyFence_loader::breached`).
_UNION_OF_INCLUSIONS_BIT = 1 << 1


@dataclass(frozen=True)
class ArduPlane(Autopilot):
    """ArduPlane's control law: L1 along the legs, TECS for altitude and airspeed.

    >>> default = ArduPlane(ArduPilotParameters.defaults())
    >>> default.turns.acceptance_radius, default.turns.distance(math.radians(45.0), 0.0), default.speeds.limits[:2]
    (90.0, 45.0, (9.0, 22.0))
    """

    name: ClassVar = "ardupilot"
    title: ClassVar = "ArduPlane"
    parameters: ArduPilotParameters = field()

    @classmethod
    def load(cls, table: FlightTable, aircraft: Aircraft, scenario: str) -> Self:
        """Return the autopilot with parameters from the user's file, the aircraft's file, and the defaults.

        The simulated release is the release that the table states, or else the release that wrote the user's file, or
        else the newest release.
        """
        version, notes = table.arduplane_version or NEWEST_ARDUPLANE, tuple[str, ...]()
        if table.params is not None:
            version, notes = choose_release(table.arduplane_version, table.params)
        return cls(ArduPilotParameters.load(aircraft, table.params, version, notes))

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """Return the autopilot with the parameters and the release that a log stores.

        If the log states no release, the release is 4.6.
        """
        version = stored.version or "4.6"
        if stored.parameters is None:
            return cls(ArduPilotParameters.defaults(version))
        return cls(ArduPilotParameters.restore(stored.parameters, version))

    def store(self) -> StoredAutopilot:
        """Return the parameters and the release of ArduPlane for a log."""
        parameters = self.parameters
        stored = StoredParameters(parameters.values, parameters.unused, parameters.source)
        return StoredAutopilot(parameters=stored, program=self.program, version=parameters.version)

    def with_release(self, version: ArduPlaneVersion) -> Self:
        """Return the same autopilot with the control law of another ArduPlane release."""
        return replace(self, parameters=self.parameters.with_release(version))

    @classmethod
    def from_flight_log(
        cls, program: str, parameters: Mapping[str, float], source: str
    ) -> tuple[Self, tuple[str, ...]] | None:
        """Return ArduPlane with the parameters of a flight log, and notes on values that cannot be used.

        The log may be from any ArduPlane release. Return None for the log of another program.
        """
        if not program.startswith("ArduP"):
            return None
        law_parameters, notes = ArduPilotParameters.from_log(parameters, source, simulated_release(program))
        note = release_difference_note(program)
        return cls(law_parameters), (note, *notes) if note else notes

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """Return an empty list: ArduPlane has a default for each parameter that the aircraft does not state.

        Raises ParameterError if the aircraft's own parameter file is invalid.
        """
        ArduPilotParameters.load(aircraft)
        return []

    @property
    def control_law(self) -> ControlLaw:
        """Control law of ArduPlane with these parameters."""
        return ControlLaw(arduplane_tick, arduplane_loop, ARDUPLANE, self._initialise, _transfer_state)

    def _initialise(self, guidance: Record, record: Record) -> None:
        """Copy the parameters into the control law's record."""
        record.parameters = self.parameters.record()

    def describe(self, aircraft: str) -> str:
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

    @cached_property
    def checks(self) -> MissionChecks:
        """Checks of missions by ArduPlane, from TERRAIN_ENABLE, MIS_OPTIONS, FENCE_OPTIONS and BATT_*.

        The checks list settings that the simulated ArduPlane ignores; the ArduPlane program itself uses some of them.

        >>> default = ArduPilotParameters.defaults()
        >>> [len(ArduPlane(default.changed(MIS_OPTIONS=bits)).checks.parameter_notes) for bits in (0, 1, 8)]
        [0, 1, 0]
        """
        parameters, mission_notes = self.parameters, list[str]()
        if int(parameters["MIS_OPTIONS"]) & _CLEAR_AT_START:
            # `AP_Mission::init`; a mission uploaded after the start is flown.
            mission_notes.append(
                f"MIS_OPTIONS {parameters['MIS_OPTIONS']:g} clears the mission each time ArduPlane starts: upload the"
                " mission after the last power-up"
            )
        return MissionChecks(
            dialect="ardupilot",
            resets_jump_counters=parameters.resets_jump_counters,
            follows_terrain=parameters.terrain_enable == 1.0,
            any_inclusion_suffices=bool(
                int(self._parameter_values.get("FENCE_OPTIONS", 0.0)) & _UNION_OF_INCLUSIONS_BIT
            ),
            battery_failsafes=battery_failsafes(parameters),
            describe_unsimulated_settings=partial(self.describe_unsimulated_settings, by_program=False),
            parameter_notes=(*parameters.notes, *mission_notes),
        )

    @property
    def _parameter_values(self) -> dict[str, float]:
        """Value of every parameter by name; the default where no file states one."""
        return {name: value for name, value, _ in self.parameters.values}

    def describe_unsimulated_settings(self, mission: MissionParts, *, by_program: bool) -> list[str]:
        """Describe settings that would change the flight of a mission, but are not simulated.

        by_program: True for a flight with the ArduPlane program, in which more settings have an effect.
        """
        parameters, values = self.parameters, self._parameter_values
        texts = [
            f"{name} {values[name]:g} affects the flight, but is not simulated"
            for name, neutral in _NEUTRAL.items()
            if values[name] != neutral
        ]
        fence_parameters = parameters.changed(FENCE_ENABLE=1.0) if mission.enables_fence else parameters
        if fence_parameters.has_own_fence:
            texts.append(f"the circle and the altitude limits of FENCE_TYPE {parameters.fence_type:g} are not judged")
        if mission.returns and parameters.rtl_follows_terrain:
            texts.append(
                f"TERRAIN_FOLLOW {parameters.terrain_follow:g} makes returns follow the terrain, which is not simulated"
            )
        return texts + describe_open_settings(parameters, mission, by_program=by_program)

    @property
    def turns(self) -> TurnRules:
        """Rules of turns from WP_RADIUS and ROLL_LIMIT_DEG."""
        parameters = self.parameters
        return TurnRules(
            acceptance_radius=parameters.wp_radius,
            # WP_RADIUS for a right angle, proportionally less for a smaller turn, and more in thin air.
            distance=lambda turn, amsl: float(
                turn_distance(0.0, turn, parameters.wp_radius, math.inf, float(eas_to_tas_ratio(amsl)))
            ),
            acceptance_limit=MAX_ACCEPTANCE_M,
            acceptance_parameter="WP_RADIUS",
            max_bank=parameters.roll_limit,
            bank_parameter="ROLL_LIMIT_DEG",
        )

    @property
    def speeds(self) -> SpeedRules:
        """Rules of airspeed, throttle and climb rate from AIRSPEED_*, MIN_GROUNDSPEED, THR_MAX and TECS_*_MAX.

        ArduPlane ignores a commanded speed outside its limits. With AIRSPEED_MIN 18, ArduPlane 4.6 continued at 25 m/s
        after a command to fly at 17 m/s.
        """
        parameters = self.parameters
        limits = SpeedLimits(parameters.airspeed_min, parameters.airspeed_max, "AIRSPEED_MIN", "AIRSPEED_MAX")
        return SpeedRules(
            limits,
            equivalent=True,
            min_ground_speed=parameters.ground_speed_min,
            cruise_parameter="AIRSPEED_CRUISE",
            max_throttle=parameters.throttle_max,
            max_throttle_name=f"THR_MAX {100.0 * parameters.throttle_max:g} %" if parameters.throttle_max < 1.0 else "",
            climb_limit=RateLimit.from_parameters(TECS_CLMB_MAX=parameters.tecs_climb_max),
            sink_limit=RateLimit.from_parameters(TECS_SINK_MAX=parameters.tecs_sink_max),
            max_pitch=self._max_pitch + parameters.pitch_trim,
            max_pitch_name=f"{' and '.join(self._max_pitch_parameters)} {math.degrees(self._max_pitch):g}°",
        )

    @property
    def ground(self) -> GroundRules:
        """Rules of take-off, landing and go-around from TKOFF_*, LAND_* and TECS_LAND_*."""
        min_acceleration = self.parameters.takeoff_acceleration
        return GroundRules(
            control_law=lambda phases, aircraft, contacts: (
                ArduPlaneFromGround(self, phases, aircraft, tuple(contacts)).control_law
            ),
            # By LAND_FLARE_*, LAND_WIND_COMP and TECS_LAND_*.
            glide=lambda height, run, tail_wind, amsl: landing_glide(
                height, run, self._landing_airspeed(0.0, tail_wind, amsl) + tail_wind, self.parameters
            ),
            airspeed=self._landing_airspeed,
            # The landing item's first parameter, or the take-off's height, or 30 m.
            go_around_height=go_around_height,
            launch_trigger=(min_acceleration, "TKOFF_THR_MINACC") if min_acceleration > 0.0 else None,
        )

    def _landing_airspeed(self, cruise: float, tail_wind: float, amsl: float) -> float:
        """Return the true airspeed on the landing glide, m/s, by TECS_LAND_ARSPD and LAND_WIND_COMP.

        Without TECS_LAND_ARSPD the airspeed follows from AIRSPEED_CRUISE and AIRSPEED_MIN.

        cruise: not used; it belongs to the interface of `GroundRules.airspeed`.
        tail_wind: m/s, negative for a head wind.
        amsl: altitude of the landing point, m.
        """
        return landing_airspeed(self.parameters, tail_wind) * self.speeds.true_airspeed_factor(amsl)

    @property
    def returns(self) -> ReturnBehaviour:
        """Behaviour of ArduPlane in an RTL, from its parameters.

        >>> parameters = ArduPilotParameters.defaults().changed(RTL_ALTITUDE=-1, FLIGHT_OPTIONS=16, RTL_AUTOLAND=2)
        >>> rules = ArduPlane(parameters).returns.rules
        >>> rules.height, rules.initial_climb, rules.rally_limit, rules.landing_join
        (nan, inf, 5000.0, 'straight')
        """
        parameters = self.parameters
        rules = ReturnRules(
            height=math.nan if parameters.rtl_altitude < 0.0 else parameters.rtl_altitude,
            radius=parameters.return_radius,
            initial_climb=math.inf if parameters.climbs_before_turn else parameters.rtl_climb_min,
            initial_climb_bank=min(parameters.level_roll_limit, parameters.roll_limit),
            max_sink_rate=parameters.tecs_sink_max or math.inf,
            min_slope_height=parameters.altitude_slope_min,
            rally_limit=parameters.rally_limit,
            includes_home=parameters.rally_includes_home > 0.0,
            slope_to_stated_height=True,
            landing_join=_LANDING_JOIN_BY_AUTOLAND.get(int(parameters.rtl_autoland), ""),
            deviation_note=_RETURN_PATH_TEXT if int(parameters.rtl_autoland) == 4 else "",
        )
        # RTL_CLIMB_MIN or FLIGHT_OPTIONS makes ArduPlane climb before it turns.
        options = float(int(parameters.flight_options) | CLIMB_BEFORE_TURN)
        climbs = [{"RTL_CLIMB_MIN": climb} for climb in _TRIED_CLIMBS_M]
        altitude = {"RTL_ALTITUDE": max(0.0, parameters.rtl_altitude)}
        return ReturnBehaviour(
            rules,
            self._rtl_parameters,
            after_link_loss=partial(link_loss_reactions, parameters),
            fly=partial(fly_returns, parameters),
            flies_without_engine=True,
            # A landing sequence begins with DO_LAND_START; a mission with a landing item ends on the ground.
            causes=lambda mission: failsafe_causes(
                parameters,
                has_fence=mission.has_fence,
                has_landing_sequence=bool(mission.landings),
                ends_with_landing=not mission.commands.isdisjoint(LANDINGS),
            ),
            # An RTL that follows the terrain is not simulated.
            unsimulated_text=lambda mission: "terrain" if parameters.rtl_follows_terrain else "",
            unsimulated_part_texts=self._unsimulated_rtl_parts,
            trials=ReturnTrials(
                (altitude,),
                (*climbs, {"FLIGHT_OPTIONS": options}),
                "RTL_ALTITUDE, climb",
                endings=({"RTL_AUTOLAND": 1.0}, {"RTL_AUTOLAND": 3.0}),
            ),
        )

    def _unsimulated_rtl_parts(self, mission: ReturnMission) -> tuple[str, ...]:
        """Return texts on the parts of a mission's RTLs that are not simulated.

        These parts are the mission's return path, which an RTL follows if RTL_AUTOLAND is 4, and every setting that is
        not simulated in any flight.
        """
        has_path = not mission.commands.isdisjoint((Command.DO_RETURN_PATH_START, Command.DO_LAND_START))
        path_parts = ("return path",) if has_path and int(self.parameters.rtl_autoland) == 4 else ()
        return (*path_parts, *self.describe_unsimulated_settings(MissionParts(), by_program=False))

    def _rtl_parameters(self, settings: RtlSettings) -> dict[str, float]:
        """Return the values of RTL_ALTITUDE, RTL_AUTOLAND and TECS_LAND_PMAX for a scenario's RTL settings.

        RTL_AUTOLAND is 1 unless a file states a value, because ArduPlane with 0 does not arm for a mission with a
        landing. TECS_LAND_PMAX is set for a field below home unless a file states a value. Without it, the aircraft
        would climb in the flare (`flight.autopilots.arduplane.ground_law`).

        >>> default = ArduPlane(ArduPilotParameters.defaults())
        >>> default.returns.make_parameters(RtlSettings(180.0, lands=True, field_depth=50.0))
        {'RTL_ALTITUDE': 180.0, 'RTL_AUTOLAND': 1.0, 'TECS_LAND_PMAX': -1.0}
        """
        values = {} if settings.altitude is None else {"RTL_ALTITUDE": settings.altitude}
        file_values = self.parameters.by_origin("file")
        if settings.autoland is not None:
            values["RTL_AUTOLAND"] = float(settings.autoland)
        elif settings.lands and self.parameters.rtl_autoland == 0.0 and "RTL_AUTOLAND" not in file_values:
            values["RTL_AUTOLAND"] = 1.0
        if settings.lands and settings.field_depth > _LOW_FIELD_M and "TECS_LAND_PMAX" not in file_values:
            values["TECS_LAND_PMAX"] = _NOSE_DOWN_DEG
        return values

    @property
    def loiters(self) -> LoiterRules:
        """Rules of loiters from WP_LOITER_RAD, the air density, and `LOITER_ALTITUDE_TOLERANCE_M`.

        >>> rules = ArduPlane(ArduPilotParameters.defaults().changed(WP_LOITER_RAD=-80.0)).loiters
        >>> rules.radius, round(rules.radius_scale(1300.0), 3)
        (-80.0, 1.135)
        """
        parameters, bank = self.parameters, self.parameters.navl1_lim_bank
        # With a bank limit for loiters, `AP_L1_Control::loiter_radius` increases the radius with altitude only if the
        # radius cannot be flown at this bank.
        bank_text = (
            f"NAVL1_LIM_BANK {bank:g} is not simulated, so ArduPlane may fly smaller loiters than the simulation"
        )
        return LoiterRules(
            radius=parameters.loiter_radius,
            radius_name="WP_LOITER_RAD",
            radius_of=read_loiter_radius,
            radius_scale=_radius_growth,
            steers_to_center=True,
            exits_on_heading=True,
            max_climb_rate=self.speeds.climb_limit.rate,
            max_sink_rate=self.speeds.sink_limit.rate,
            altitude_tolerance=LOITER_ALTITUDE_TOLERANCE_M,
            unflown_note=bank_text if bank > 0.0 else "",
            rtl_exit_note=_EXIT_BEFORE_RTL_TEXT,
        )

    @property
    def deviations(self) -> Deviations:
        """Deviations from the legs, and the altitude gain in updrafts while the airspeed is held."""
        # Try values only up to the pitch at which another parameter becomes the limit.
        name, *other_names = self._max_pitch_parameters
        higher_limits = (limit for limit in self._pitch_limits.values() if limit > self._max_pitch)
        max_tried = min(MAX_TRIED_PITCH_DEG, *map(math.degrees, higher_limits), math.inf)
        is_raised = max_tried > math.degrees(self._max_pitch)
        return Deviations(
            tracking_error=partial(tracking_error, self.parameters),
            gust_rise=updraft_altitude_gain,
            altitude_candidates=HEIGHT_CANDIDATES,
            track_candidates=SIDE_CANDIDATES,
            pitch_candidates=(Candidate(name, 1.0, max_tried, "deg", others=tuple(other_names)),) if is_raised else (),
        )

    @property
    def _max_pitch(self) -> float:
        """Largest pitch that TECS demands, rad; PTCH_TRIM_DEG is not included."""
        return min(self._pitch_limits.values())

    @property
    def _max_pitch_parameters(self) -> tuple[str, ...]:
        """Names of the parameters that set the largest pitch; both names if the two limits are equal."""
        return tuple(name for name, limit in self._pitch_limits.items() if limit == self._max_pitch)

    @property
    def _pitch_limits(self) -> dict[str, float]:
        """Upper pitch limits by parameter, rad; infinite for TECS_PITCH_MAX 0, which sets no limit."""
        parameters = self.parameters
        return {
            "TECS_PITCH_MAX": parameters.tecs_pitch_max or math.inf,
            "PTCH_LIM_MAX_DEG": parameters.pitch_limit_max,
        }

    def with_parameters(self, origin: Origin = "file", /, **values: float) -> "ArduPlane":
        """Return a simulated ArduPlane with some parameters changed, also if this autopilot is the program."""
        return ArduPlane(self.parameters.changed(origin, **values))


def _transfer_state(previous_record: Record, record: Record, start: Floats) -> None:
    """Start a new leg at ``start``, and keep the state of TECS and of the airspeed filter.

    This is ArduPlane's behaviour after a change of mode.

    previous_record, record: records of the control law before and after the change; the internal state in the second
        is set.
    start: position, (3,) m.
    """
    record.memory = previous_record.memory
    for name in _LEG_FIELDS:
        setattr(record.memory, name, 0)
    record.memory.from_east, record.memory.from_north, record.memory.from_up = start


@dataclass(frozen=True)
class ArduPlaneFromGround:
    """ArduPlane's controllers for a mission with a take-off, a landing, or both.

    ground_phases: take-off and landing that are flown.
    contacts: points where the aircraft touches the ground.
    """

    autopilot: ArduPlane
    ground_phases: GroundPhases
    aircraft: Aircraft
    contacts: tuple[Contact, ...]

    @property
    def parameters(self) -> ArduPilotParameters:
        """Parameters of the autopilot."""
        return self.autopilot.parameters

    @property
    def control_law(self) -> ControlLaw:
        """Control law of a flight that starts or ends on the ground."""
        return ControlLaw(
            ground_tick, ground_loop, ARDUPLANE_GROUND, self._initialise, throttle_at_release=self.throttle_at_release
        )

    @property
    def motor_start(self) -> float:
        """Time of the motor start, s after the release; negative for a start on the rail.

        It is inf if the motor never starts. It is -inf if the motor runs before the launch, or without a take-off.
        """
        take_off = self.ground_phases.take_off
        if take_off is None:
            return -math.inf
        return motor_start_time(take_off.acceleration, take_off.speed, take_off.launch.incline, self.parameters)

    @property
    def throttle_at_release(self) -> float:
        """Throttle (0..1) when the aircraft leaves the rail."""
        parameters = self.parameters
        # Without a slew limit the throttle opens at once (not 0 times infinity); it is closed if the motor starts
        # later.
        running_time = max(0.0, -self.motor_start)
        return min(
            parameters.takeoff_throttle or parameters.throttle_max,
            running_time * takeoff_slew(parameters) if running_time else 0.0,
        )

    def _initialise(self, guidance: Record, record: Record) -> None:
        """Copy parameters, ground contacts, take-off and landing into the control law's record."""
        record.parameters = self.parameters.record()
        record.stage_parameters = record.parameters
        ground = record.ground
        contacts = self.contacts[:MAX_CONTACT_POINTS]
        ground.contacts = len(contacts)
        for index, contact in enumerate(contacts):
            ground.contact[index] = contact.forward, contact.right, contact.down
            ground.is_support[index] = contact.is_support
        ground.turnover_speed = _TURNOVER_SPEED_RATIO * self.aircraft.stall_speed
        ground.stage = IN_AIR
        take_off, approach = self.ground_phases.take_off, self.ground_phases.approach
        if take_off is not None:
            parameters, launch = self.parameters, take_off.launch
            ground.stage, ground.is_on_runway = TAKING_OFF, launch.method == "runway"
            ground.motor_start = self.motor_start
            ground.throttle_slew = takeoff_slew(parameters)
            ground.takeoff_throttle = parameters.takeoff_throttle or parameters.throttle_max
            ground.home_up = take_off.home_altitude
            ground.takeoff_end_altitude = take_off.end_altitude
            ground.launch_up = take_off.home[2]
            ground.takeoff_pitch, ground.leg = take_off.pitch, take_off.waypoint
            # If the motor runs before the launch, TECS runs too. The launch then winds up the pitch integrator of TECS
            # to the maximum pitch, as two flights of ArduPlane 4.6.3 showed. If the launch acceleration starts the
            # motor, ArduPlane climbs with the item's pitch, as five flights showed.
            if self.motor_start == -math.inf and take_off.acceleration > 0.0:
                max_pitch = min(parameters.pitch_limit_max, parameters.tecs_pitch_max or math.inf)
                ground.takeoff_pitch = max(take_off.pitch, max_pitch)
            # Time since the ground speed reached 5 m/s, from which on ArduPlane knows its course over the ground.
            acceleration = take_off.acceleration
            ground.time_at_course_speed = (
                max(0.0, take_off.speed - _COURSE_SPEED_MPS) / acceleration if acceleration else 0.0
            )
        if approach is not None:
            landing_altitude = float(approach.point[2])
            glide = self.autopilot.ground.glide(
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

# Join to the landing sequence after an RTL, by RTL_AUTOLAND; with 3 the landing sequence is only for go-arounds.
_LANDING_JOIN_BY_AUTOLAND: dict[int, Literal["", "circle", "straight"]] = {1: "circle", 2: "straight"}
_RETURN_PATH_TEXT = (
    "RTL_AUTOLAND 4 returns along the mission's return path or landing sequence, which is not simulated. The simulated"
    " RTL ends in its loiter"
)

# `Plane::verify_loiter_heading` waits for the heading to the position of the next item. The position of an RTL item is
# 0 N 0 E.
_EXIT_BEFORE_RTL_TEXT = (
    "ArduPlane leaves the loiter on the heading to 0° N 0° E, because an RTL item has no position. The simulated flight"
    " does the same, but the route is judged with an exit on the heading to home"
)

# Bit of MIS_OPTIONS: clear the mission when ArduPlane starts.
_CLEAR_AT_START = 1 << 0
# ArduPlane ignores a radius up to this value, m.
_MAX_IGNORED_RADIUS_M = 1.0
# The radius of LOITER_TURNS is stored in a byte, in whole metres or, from this on, in tens of metres. Loiters without
# end and to an altitude have sixteen bits (`AP_Mission::mavlink_int_to_mission_cmd`).
_MAX_BYTE_RADIUS_M = 255.0


def read_loiter_radius(loiter: Loiter) -> float:
    """Return the radius that ArduPlane reads from a loiter item, m; 0 if it uses WP_LOITER_RAD instead.

    ArduPlane reads the radius of three kinds of loiter: by turns, to an altitude, and unlimited. In a loiter by time
    it flies WP_LOITER_RAD, even if the time is zero. It then reads only the direction from the item, because
    `Plane::verify_loiter_time` does not pass the item's radius to `Plane::update_loiter`. An infinite or undefined
    radius is returned without its sign.

    >>> [read_loiter_radius(Loiter(radius, turns=3)) for radius in (-250.7, 307.0, 1.0)]
    [250.0, 300.0, 0.0]
    >>> read_loiter_radius(Loiter(307.0, seconds=60.0, endless=True))
    307.0
    >>> read_loiter_radius(Loiter(200.0, to_altitude=True))
    200.0
    >>> read_loiter_radius(Loiter(200.0, seconds=60.0, timed=True)), read_loiter_radius(Loiter(200.0, timed=True))
    (0.0, 0.0)
    """
    if loiter.timed:
        return 0.0
    if not math.isfinite(loiter.radius):
        return abs(loiter.radius)
    stated_radius = float(math.floor(abs(loiter.radius)))
    if not (loiter.endless or loiter.to_altitude) and stated_radius > _MAX_BYTE_RADIUS_M:
        # ArduPlane stores a larger radius in steps of 10 m.
        stated_radius = 10.0 * min(_MAX_BYTE_RADIUS_M, math.floor(stated_radius / 10.0))
    return stated_radius if stated_radius > _MAX_IGNORED_RADIUS_M else 0.0


def _radius_growth(amsl: float) -> float:
    """Return the ratio of the loiter radius flown at an altitude (m AMSL) to the radius at sea level.

    The ratio is the square of the ratio of true to equivalent airspeed.
    """
    return float(eas_to_tas_ratio(amsl)) ** 2
