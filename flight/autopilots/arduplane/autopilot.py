"""ArduPlane's law as an autopilot, with the parameters that it flies by."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal, Self

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.contacts import Contact
from aircraft.tracking import TrackingError
from flight.autopilots.arduplane.ground_law import ARDUPLANE_GROUND, CONTACTS, IN_AIR, TAKING_OFF, ground_tick
from flight.autopilots.arduplane.landing import go_around_height, landing_airspeed, landing_glide
from flight.autopilots.arduplane.launch import motor_start, takeoff_slew
from flight.autopilots.arduplane.law import ARDUPLANE, arduplane_tick
from flight.autopilots.arduplane.navigator import MAX_ACCEPTANCE, REACHED_HEIGHT, turn_distance
from flight.autopilots.arduplane.parameters import (
    HEIGHT_CANDIDATES,
    RELEASE,
    SIDE_CANDIDATES,
    ArduPilotParameters,
    speeds_flown,
)
from flight.autopilots.arduplane.tracking_error import tracking_error
from flight.autopilots.autopilot import (
    Autopilot,
    Floats,
    GroundAutopilot,
    LandingGlide,
    SpeedLimits,
    StoredAutopilot,
    StoredParameters,
    Tick,
)
from flight.autopilots.gust_height import height_in_updrafts
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.mission.ground_ways import Approach, GroundWays, TakeOff
from flight.mission.itinerary import Loiter
from flight.mission.loiter_circles import LoiterRules
from flight.mission.return_path import ReturnRules
from world.kernels import Record
from world.scenario_tables import FlightTable, Navigation
from world.wind import Turbulence

# What of `flight.autopilots.arduplane.law.ARDUPILOT_MEMORY` belongs to the way that is flown, and not to the aircraft.
_OF_THE_WAY = (
    *("leg", "cross_track_sum", "on_circle", "loitering", "stayed", "circled", "bearing", "at_height", "next_look"),
    *("up_before", "over", "waited", "left_for", "returning", "climbed", "ground_leg"),
)


@dataclass(frozen=True)
class ArduPlane(Autopilot):
    """ArduPlane's law: L1 along the legs, TECS for height and airspeed.

    >>> made = ArduPlane(ArduPilotParameters.defaults())
    >>> made.acceptance_radius, made.turn_distance(math.radians(45.0), 0.0), made.speed_limits[:2]
    (90.0, 45.0, (9.0, 22.0))
    """

    name: ClassVar = "ardupilot"
    title: ClassVar = "ArduPlane"
    own: ClassVar[np.dtype[np.record] | None] = ARDUPLANE
    cruise_parameter: ClassVar = "AIRSPEED_CRUISE"
    equivalent_airspeeds: ClassVar = True
    acceptance_limit: ClassVar = MAX_ACCEPTANCE
    refuses_as_arduplane: ClassVar = True
    flies_ground: ClassVar[bool] = True
    height_candidates: ClassVar = HEIGHT_CANDIDATES
    side_candidates: ClassVar = SIDE_CANDIDATES
    parameters: ArduPilotParameters = field()

    @classmethod
    def load(cls, table: FlightTable, aircraft: Aircraft, scenario: str) -> Self:
        """Return the autopilot with the parameters of the user's file, of the aircraft, and the defaults."""
        return cls(ArduPilotParameters.load(aircraft, table.params))

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """Return the autopilot with the parameters that a log stores."""
        return cls(
            ArduPilotParameters.defaults()
            if stored.parameters is None
            else ArduPilotParameters.restore(stored.parameters)
        )

    def store(self) -> StoredAutopilot:
        """Its parameters."""
        parameters = self.parameters
        stored = StoredParameters(parameters.values, parameters.unused, parameters.source)
        return StoredAutopilot(parameters=stored, program=self.program)

    @classmethod
    def of_flight_log(
        cls, program: str, parameters: Mapping[str, float], source: str
    ) -> tuple[Self, tuple[str, ...]] | None:
        """ArduPlane with the log's parameters, for a log that any release of it wrote."""
        if not program.startswith("ArduP"):
            return None
        made, notes = ArduPilotParameters.of_log(parameters, source)
        return cls(made), notes

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """None: what the aircraft does not state has ArduPlane's defaults."""
        ArduPilotParameters.load(aircraft)
        return []

    @property
    def tick(self) -> Tick:
        """One tick of the law."""
        return arduplane_tick

    def begin(self, memory: Record, own: Record) -> None:
        """Hand over the parameters."""
        own.parameters = self.parameters.record()

    def take_over(self, before: Record, own: Record, here: Floats) -> None:
        """As a change of mode: energies and airspeed are kept, and the leg begins here."""
        own.memory = before.memory
        for name in _OF_THE_WAY:
            setattr(own.memory, name, 0)
        own.memory.from_east, own.memory.from_north, own.memory.from_up = here

    def described(self, aircraft: str) -> str:
        """The law with the parameters that decide most of a flight."""
        made = self.parameters
        whose = f"the parameters of {made.source}" if made.source else "its default parameters"
        return (
            f"ArduPlane {RELEASE}'s law with {whose} (WP_RADIUS {made.wp_radius:g} m,"
            f" NAVL1_PERIOD {made.navl1_period:g} s, TECS_HDEM_TCONST {made.tecs_height_demand_time:g} s)"
        )

    @property
    def version(self) -> str:
        """The release whose law it is."""
        return RELEASE

    @property
    def acceptance_radius(self) -> float | None:
        """WP_RADIUS."""
        return self.parameters.wp_radius

    def settings_not_flown(self, *, returns: bool) -> list[str]:
        """ALT_OFFSET, SOAR_ENABLE, Q_ENABLE, RUDDER_ONLY, a fence of its own, and returns that follow the terrain."""
        made = self.parameters
        switched = {"ALT_OFFSET": made.altitude_offset, "SOAR_ENABLE": made.soaring, "Q_ENABLE": made.quadplane}
        switched["RUDDER_ONLY"] = made.rudder_only
        left = [f"{name} {value:g} changes the flight and is not flown" for name, value in switched.items() if value]
        if made.has_fence_of_its_own:
            left.append(f"the circle and the altitudes of FENCE_TYPE {made.fence_type:g} are not judged")
        if returns and made.follows_terrain_home:
            left.append(f"TERRAIN_FOLLOW {made.terrain_follow:g} has the return follow the terrain, which is not flown")
        return left

    @property
    def follows_ground(self) -> bool:
        """TERRAIN_ENABLE."""
        return self.parameters.terrain_enable == 1.0

    def turn_distance(self, turn: float, amsl: float) -> float:
        """WP_RADIUS for a right angle, in thin air more, and a share of it for a gentler turn."""
        factor = float(true_by_equivalent(amsl))
        return float(turn_distance(0.0, turn, self.parameters.wp_radius, math.inf, factor))

    def airspeed_factor(self, amsl: float) -> float:
        """True by equivalent airspeed."""
        return float(true_by_equivalent(amsl))

    def landing_airspeed(self, cruise: float, tail_wind: float, amsl: float) -> float:
        """By TECS_LAND_ARSPD, or AIRSPEED_CRUISE and AIRSPEED_MIN, and LAND_WIND_COMP."""
        return landing_airspeed(self.parameters, tail_wind) * self.airspeed_factor(amsl)

    def as_asked(
        self, rtl_altitude: float | None, rtl_autoland: int | None, *, lands: bool, lower: float = 0.0
    ) -> Autopilot:
        """With RTL_ALTITUDE and RTL_AUTOLAND, and the latter 1 where nobody states it: 0 does not arm with a landing.

        On a field that is lower than home the flare would rise (`flight.autopilots.arduplane.ground_law`): there
        TECS_LAND_PMAX holds the nose down where nobody states it.

        >>> made = ArduPlane(ArduPilotParameters.defaults()).as_asked(180.0, None, lands=True, lower=50.0)
        >>> made.parameters.rtl_altitude, made.parameters.rtl_autoland, round(made.parameters.landing_pitch_max, 4)
        (180.0, 1.0, -0.0175)
        """
        values = {} if rtl_altitude is None else {"RTL_ALTITUDE": rtl_altitude}
        stated = self.parameters.by_origin("file")
        if rtl_autoland is not None:
            values["RTL_AUTOLAND"] = float(rtl_autoland)
        elif lands and self.parameters.rtl_autoland == 0.0 and "RTL_AUTOLAND" not in stated:
            values["RTL_AUTOLAND"] = 1.0
        if lands and lower > _LOWER and "TECS_LAND_PMAX" not in stated:
            values["TECS_LAND_PMAX"] = _NOSE_DOWN
        return ArduPlane(self.parameters.changed(**values)) if values else self

    def landing_glide(self, height: float, run: float, tail_wind: float, amsl: float) -> LandingGlide:
        """By LAND_FLARE_*, LAND_WIND_COMP, TECS_LAND_SINK and TECS_LAND_ARSPD."""
        airspeed = self.landing_airspeed(0.0, tail_wind, amsl)
        return landing_glide(height, run, airspeed + tail_wind, self.parameters)

    @property
    def launch_trigger(self) -> tuple[float, str] | None:
        """TKOFF_THR_MINACC."""
        least = self.parameters.takeoff_acceleration
        return (least, "TKOFF_THR_MINACC") if least > 0.0 else None

    def go_around_height(self, asked: float, takeoff: float) -> float | None:
        """The landing item's first number, or the take-off's height, or 30 m."""
        return go_around_height(asked, takeoff)

    @property
    def return_rules(self) -> ReturnRules:
        """By RTL_*, FLIGHT_OPTIONS, LEVEL_ROLL_LIMIT, RALLY_*, TECS_SINK_MAX and GLIDE_SLOPE_MIN.

        >>> made = ArduPlane(ArduPilotParameters.defaults().changed(RTL_ALTITUDE=-1, FLIGHT_OPTIONS=16, RTL_AUTOLAND=2))
        >>> made.return_rules.height, made.return_rules.climb_first, made.return_rules.rally_limit
        (nan, inf, 5000.0)
        >>> made.return_rules.lands
        'straight'
        """
        made = self.parameters
        return ReturnRules(
            height=math.nan if made.rtl_altitude < 0.0 else made.rtl_altitude,
            radius=made.return_radius,
            climb_first=math.inf if made.climbs_before_turn else made.rtl_climb_min,
            first_bank=min(made.level_roll_limit, made.roll_limit),
            sink=made.tecs_sink_max or math.inf,
            least_slope=made.glide_slope_min,
            rally_limit=made.rally_limit,
            includes_home=made.rally_includes_home > 0.0,
            slope_to_stated_height=True,
            lands=_LANDS.get(int(made.rtl_autoland), ""),
            instead=_RETURN_PATH if int(made.rtl_autoland) == 4 else "",
        )

    @property
    def loiter_rules(self) -> LoiterRules:
        """By WP_LOITER_RAD and the air's density, until it is within `REACHED_HEIGHT` of a height.

        >>> rules = ArduPlane(ArduPilotParameters.defaults().changed(WP_LOITER_RAD=-80.0)).loiter_rules
        >>> rules.radius, round(rules.growth(1300.0), 3)
        (-80.0, 1.135)
        """
        made = self.parameters
        return LoiterRules(
            radius=made.loiter_radius,
            radius_name="WP_LOITER_RAD",
            radius_of=radius_read,
            growth=_growth,
            at_middle=True,
            lines_up=True,
            climb=made.tecs_climb_max,
            sink=made.tecs_sink_max or math.inf,
            short=REACHED_HEIGHT,
            unflown=_limited_circles(made.navl1_lim_bank),
            before_return=_BEFORE_RETURN,
        )

    @property
    def speed_limits(self) -> SpeedLimits | None:
        """AIRSPEED_MIN and AIRSPEED_MAX."""
        return SpeedLimits(self.parameters.airspeed_min, self.parameters.airspeed_max, "AIRSPEED_MIN", "AIRSPEED_MAX")

    def speeds_flown(self, commanded: Floats, cruise: float) -> Floats:
        """The last speed that it took."""
        return speeds_flown(commanded, cruise, self.parameters)

    @property
    def stated_bank(self) -> float | None:
        """ROLL_LIMIT_DEG of a person's file."""
        return self.parameters.roll_limit if "ROLL_LIMIT_DEG" in self.parameters.by_origin("file") else None

    @property
    def bank_limit(self) -> float:
        """ROLL_LIMIT_DEG, whoever states it."""
        return self.parameters.roll_limit

    def tracking_error(
        self, airspeed: float, nav: Navigation, *, fly_over: bool = False, turbulence: Turbulence = "none"
    ) -> TrackingError | None:
        """How far its law strays with these parameters."""
        return tracking_error(self.parameters, airspeed, nav, fly_over=fly_over, turbulence=turbulence)

    def gust_rise(self, sink: float, turbulence: Turbulence) -> float:
        """It keeps its airspeed, and cannot sink faster than the aircraft does so."""
        return height_in_updrafts(sink, turbulence)

    def from_ground(self, ways: GroundWays, aircraft: Aircraft, contacts: Sequence[Contact]) -> "ArduPlaneFromGround":
        """The same law with its take-off and its landing."""
        return ArduPlaneFromGround(self.parameters, ways=ways, aircraft=aircraft, contacts=tuple(contacts))

    def with_parameters(self, **values: float) -> "ArduPlane":
        """The law, whoever flew before, with other parameters."""
        return ArduPlane(self.parameters.changed(**values))


@dataclass(frozen=True)
class ArduPlaneFromGround(ArduPlane, GroundAutopilot):
    """ArduPlane's law from the ground, or to it, or both.

    ways: what of it is flown.  contacts: where the aircraft meets the ground.
    """

    own: ClassVar[np.dtype[np.record] | None] = ARDUPLANE_GROUND
    ways: GroundWays = field(kw_only=True)
    aircraft: Aircraft = field(kw_only=True)
    contacts: tuple[Contact, ...] = field(kw_only=True)

    @property
    def tick(self) -> Tick:
        """One tick of the law."""
        return ground_tick

    @property
    def motor_start(self) -> float:
        """When the motor starts, s after the release; inf for never."""
        take_off = self.ways.take_off
        if take_off is None:
            return -math.inf
        return motor_start(take_off.acceleration, take_off.speed, take_off.launch.incline, self.parameters)

    @property
    def released_throttle(self) -> float:
        """What the throttle has come to on the rail."""
        made = self.parameters
        # At once, and not 0 times infinity, for one that knows no limit; none yet where the motor starts later.
        since = max(0.0, -self.motor_start)
        return min(made.takeoff_throttle or made.throttle_max, since * takeoff_slew(made) if since else 0.0)

    def begin(self, memory: Record, own: Record) -> None:
        """Hand over the parameters, the contacts and the ways."""
        super().begin(memory, own)
        own.staged = own.parameters
        ground = own.ground
        used = self.contacts[:CONTACTS]
        ground.contacts = len(used)
        for k, one in enumerate(used):
            ground.contact[k] = one.forward, one.right, one.down
            ground.stands[k] = one.stands
        ground.turnover = _TURNOVER_SHARE * self.aircraft.stall_speed
        ground.stage = IN_AIR
        if self.ways.take_off is not None:
            self._begin_take_off(self.ways.take_off, ground)
        if self.ways.approach is not None:
            self._begin_landing(self.ways.approach, ground)

    def _begin_take_off(self, take_off: TakeOff, ground: Record) -> None:
        made, launch = self.parameters, take_off.launch
        ground.stage, ground.rolls = TAKING_OFF, launch.method == "runway"
        ground.motor = self.motor_start
        ground.slew, ground.full = takeoff_slew(made), made.takeoff_throttle or made.throttle_max
        ground.base, ground.top, ground.low = take_off.base, take_off.top, take_off.home[2]
        ground.pitch, ground.leg = take_off.pitch, take_off.waypoint
        # Since it moved at 5 m/s, at which its course over the ground is known.
        pushed = take_off.acceleration
        ground.fast = max(0.0, take_off.speed - _MOVES) / pushed if pushed else 0.0

    def _begin_landing(self, approach: Approach, ground: Record) -> None:
        up = float(approach.point[2])
        glide = self.landing_glide(approach.begin - up, approach.run, approach.tail_wind, up)
        ground.lands, ground.landing_leg = True, approach.leg
        ground.east, ground.north, ground.up = approach.point
        ground.home = approach.base
        ground.begin, ground.slope = approach.begin, glide.slope
        ground.flare_height, ground.flare_distance = glide.flare_height, glide.flare_distance
        ground.airspeed = landing_airspeed(self.parameters, approach.tail_wind)


# A field that is lower than home by more than this (m) has a flare that rises; so high (degrees) the nose may be in it.
_LOWER, _NOSE_DOWN = 3.0, -1.0
# Faster than this share of its slowest flight no aircraft touches the ground with its nose, its tail or a wing.
_TURNOVER_SHARE = 0.75
# Faster over the ground than this ArduPlane knows its course, m/s.
_MOVES = 5.0

# What a return goes on to, by RTL_AUTOLAND; with 3 the landing sequence is for go-arounds alone.
_LANDS: dict[int, Literal["", "circle", "straight"]] = {1: "circle", 2: "straight"}
_RETURN_PATH = "RTL_AUTOLAND 4 goes by the mission's return path or landing sequence: not flown, it stays in its circle"

# `Plane::verify_loiter_heading` lines up with the place of the next item; a return has none, which is 0 N 0 E.
_BEFORE_RETURN = "ArduPlane leaves its circle heading for 0° N 0° E, and returns from there: flown heading for home"

# A radius of so many metres or less is none to ArduPlane.  A mission's item holds that of LOITER_TURNS in a byte: whole
# metres, or from this on whole tens of them; those without end and to a height have sixteen bits
# (`AP_Mission::mavlink_int_to_mission_cmd`).
_NO_RADIUS, _BYTE = 1.0, 255.0


def radius_read(loiter: Loiter) -> float:
    """The radius that ArduPlane reads of a loiter's item, m, 0 for none: that of turns, to a height, and without end.

    For a time, be that none, it flies WP_LOITER_RAD, and takes of the item no more than the side: of the four
    `Plane::verify_loiter_*` that of a time alone hands no radius of the item to `Plane::update_loiter`.

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
    stated = float(math.floor(abs(loiter.radius)))
    if not (loiter.endless or loiter.to_height) and stated > _BYTE:
        stated = 10.0 * min(_BYTE, math.floor(stated / 10.0))
    return stated if stated > _NO_RADIUS else 0.0


def _growth(up: float) -> float:
    """By how much a circle is wider at a height (m AMSL): as the square of true by equivalent airspeed."""
    return float(true_by_equivalent(up)) ** 2


def _limited_circles(bank: float) -> str:
    """That a bank limit of circles (deg) is not flown; "" where ArduPlane has none.

    With one, `AP_L1_Control::loiter_radius` lets no circle grow with height that the bank can hold as it is.
    """
    if bank <= 0.0:
        return ""
    return f"NAVL1_LIM_BANK {bank:g} is not flown: circles are as wide as without it, where ArduPlane's may be narrower"
