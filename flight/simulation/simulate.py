"""Fly JSBSim along a route and over its terrain, until the flight ends.

In a `Flight` a simulated autopilot controls the aircraft, in a `flight.autopilots.program.ProgramFlight` an external
program.
"""

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.contacts import Gear, find_contacts
from aircraft.path_limits import ground_speed_on
from flight.autopilots.parts import ControlLaw
from flight.dynamics.compiled_model import PROOF_STEPS, CompiledModel
from flight.dynamics.fdm import JSBSIM_VERSION, Fdm, Variation
from flight.dynamics.jsbsim_properties import Getter, Setter
from flight.dynamics.model_program import UnsupportedModel
from flight.dynamics.trim import steady_flight
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.guidance.gains import Gains, load_gains
from flight.guidance.navigation_error import ERRORS, start_navigation_error
from flight.guidance.path import FlyByPath, fly_by_path, waypoint_records
from flight.mission.ground_phases import GroundPhases, TakeOff
from flight.simulation.setup import EngineChoice, FlightSetup
from flight.simulation.tick import BLOCK_TICKS, ENDS, READ_FIELDS, Workspace, rtl_loiter_timeout
from flight.simulation.track import Rows, Track, TrackBuilder, join_rows, quantise
from flight.simulation.turbulence import start_gusts
from world.arrays import Floats, Heights
from world.errors import FlightError, StartError
from world.forecast.wind_field import without_levels_above
from world.frames import GeoOrigin, PolyMap, fit_polymap, to_geo, to_map
from world.geometry import leg_courses
from world.kernels import Records
from world.random_streams import NAVIGATION, TURBULENCE, stream
from world.terrain import Terrain
from world.wind import W20

# ----------------------------------------------------------------------
# The flight loop: read JSBSim, do a tick, set JSBSim and step it, with as little Python as possible.


def make_loop(
    getters: Sequence[Getter],
    setters: Sequence[Setter],
    tick: Callable[[], int],
    workspace: Workspace,
    step_model: Callable[[], object],
    steps: int,
) -> Callable[[int], int]:
    """Return a function that flies up to a given number of ticks in JSBSim, and returns its end code or 0.

    getters: getters of the state, in the order of `flight.simulation.tick.READ_FIELDS`.
    setters: setters of the outputs, in the order of `flight.simulation.tick.OUTPUT`.
    tick: the control law's tick, on this workspace.
    step_model: function that steps JSBSim; it is called ``steps`` times per tick.
    """
    # Call each getter by name: a loop over the list takes 1.5 times as long.
    (
        latitude,
        longitude,
        amsl,
        velocity_north,
        velocity_east,
        velocity_down,
        roll,
        pitch,
        yaw,
        roll_rate,
        pitch_rate,
        yaw_rate,
        airspeed,
        alpha,
        beta,
        elevator,
        aileron,
        rudder,
        throttle,
        current,
        power,
        load_factor,
    ) = getters
    (
        set_elevator,
        set_aileron,
        set_rudder,
        set_throttle,
        set_gust_north,
        set_gust_east,
        set_gust_down,
        set_ground,
    ) = setters
    # struct writes these floats in half the time of a slice assignment.
    pack: Callable[..., None] = struct.Struct(f"{len(READ_FIELDS)}d").pack_into
    readings, output, step_range = workspace.readings, workspace.output.tolist, (None,) * steps

    def fly(count: int) -> int:
        for _ in range(count):
            pack(
                readings,
                0,
                latitude(),
                longitude(),
                amsl(),
                velocity_north(),
                velocity_east(),
                velocity_down(),
                roll(),
                pitch(),
                yaw(),
                roll_rate(),
                pitch_rate(),
                yaw_rate(),
                airspeed(),
                alpha(),
                beta(),
                elevator(),
                aileron(),
                rudder(),
                throttle(),
                current(),
                power(),
                load_factor(),
            )
            if status := tick():
                return status
            elevator_out, aileron_out, rudder_out, throttle_out, north_out, east_out, down_out, ground_out = output()
            set_elevator(elevator_out)
            set_aileron(aileron_out)
            set_rudder(rudder_out)
            set_throttle(throttle_out)
            set_gust_north(north_out)
            set_gust_east(east_out)
            set_gust_down(down_out)
            set_ground(ground_out)
            for _ in step_range:
                step_model()
        return 0

    return fly


# Default duration of a guidance tick, s; `Flight.dt` is the duration in one flight.
TICK_S = 1.0 / 60.0
# Flight time simulated in one call of `RunningFlight.fly_block`, s.
BLOCK_DURATION_S = 1.0
# The same for a flight that is neither recorded nor shown; 40 us are spent in Python for each block.
LONG_BLOCK_DURATION_S = 10.0
# Bank that guidance may add to the bank of planned turns in order to correct an error, rad.
BANK_RESERVE_RAD = math.radians(3.0)
# Time added to the time limit of a flight that takes off or lands, s.
GROUND_TIME_ALLOWANCE_S = 120.0
# Time limit of a flight, as a multiple of the time for its length at its lowest ground speed.
TIME_LIMIT_FACTOR = 1.5
# Time added to that limit, s.
TIME_LIMIT_BASE_S = 60.0
# Lowest ground speed that is assumed for it, m/s.
MIN_GROUND_SPEED_MPS = 3.0


# ----------------------------------------------------------------------
# The map and the ground around one flight, in the form that the compiled loop needs. JSBSim provides latitudes and
# longitudes; all other code uses positions on the map.

# Margin of the local map around the area and the route, m.
MAP_MARGIN_M = 5000.0
# Maximum errors of the local map, m and rad.
MAX_MAP_ERRORS = (0.01, 1e-6)


@dataclass(frozen=True, slots=True)
class LocalMap:
    """Map projection for compiled code: polynomials that are fitted around one flight.

    position: from latitude and longitude, rad, to east and north, m.
    angle: from latitude and longitude, rad, to the grid convergence, rad, which is the map course of true north, and 0.
    center_longitude: longitude of the map's center, rad; longitudes are normalised to within pi of it.
    """

    position: PolyMap
    angle: PolyMap
    center_longitude: float

    @staticmethod
    def around(setup: FlightSetup) -> "LocalMap":
        """Fit a local map around the area and the route, with a margin of `MAP_MARGIN_M`.

        The error is 0.1 mm and 1e-9 rad on areas up to 600 km wide. Raises FlightError if the map cannot be fitted, as
        for an area around a pole.
        """
        points = np.concatenate([setup.route.positions[:, :2], setup.scenario.bounds.T])
        min_corner, max_corner = points.min(axis=0) - MAP_MARGIN_M, points.max(axis=0) + MAP_MARGIN_M
        return _fit_local_map(
            setup.scenario.origin, tuple(min_corner.tolist()), tuple(max_corner.tolist()), setup.mission.source
        )

    def convergence(self, lat_deg: float, lon_deg: float) -> float:
        """Return the grid convergence, the map course of true north, at a position (degrees), rad."""
        lon = self.center_longitude + math.remainder(math.radians(lon_deg) - self.center_longitude, 2.0 * math.pi)
        return float(self.angle(math.radians(lat_deg), lon)[0])


@lru_cache(maxsize=4)
def _fit_local_map(
    origin: GeoOrigin, min_corner: tuple[float, float], max_corner: tuple[float, float], source: str
) -> LocalMap:
    """Fit a local map over a rectangle of the map; the flights of a campaign share it.

    min_corner, max_corner: corners of the rectangle, east and north, m.
    source: file of the mission, for messages.

    Raises FlightError if the map cannot be fitted.
    """
    outline = np.array(
        [
            [east, north]
            for east in (min_corner[0], 0.5 * (min_corner[0] + max_corner[0]), max_corner[0])
            for north in (min_corner[1], max_corner[1])
        ]
    )
    lat, lon = (np.radians(values) for values in to_geo(origin, outline[:, 0], outline[:, 1]))
    # Longitudes relative to the origin, so that an area may include the 180th meridian.
    origin_longitude = math.radians(origin.lon_deg)
    lon = origin_longitude + (lon - origin_longitude + math.pi) % (2.0 * math.pi) - math.pi
    bounds = np.array([[lat.min(), lat.max()], [lon.min(), lon.max()]])
    if not (np.isfinite(bounds).all() and np.ptp(bounds[1]) < math.pi):
        raise FlightError(f"{source}: the area contains a pole", file=source)

    def position(latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
        """Return the map position of a latitude and longitude (rad), m."""
        return to_map(origin, np.degrees(latitude), np.degrees(longitude))

    def angle(latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
        """Return the map course of true north at a latitude and longitude (rad), rad, and 0."""
        step = 1e-5
        east0, north0 = position(latitude - step, longitude)
        east1, north1 = position(latitude + step, longitude)
        return np.arctan2(east1 - east0, north1 - north0), np.zeros_like(latitude)

    center_longitude = float((bounds[1, 0] + bounds[1, 1]) / 2)
    local = LocalMap(fit_polymap(position, bounds, 1e-4), fit_polymap(angle, bounds, 1e-9), center_longitude)
    if not (local.position.residual <= MAX_MAP_ERRORS[0] and local.angle.residual <= MAX_MAP_ERRORS[1]):
        raise FlightError(
            f"{source}: the area is too large to fly in: its map has an error "
            f"of {local.position.residual:.2g} m; {MAX_MAP_ERRORS[0]:g} m is allowed",
            file=source,
        )
    return local


class Ground:
    """Terrain for the compiled tick; without terrain, a raster without data.

    known: True if there is terrain.
    heights: altitudes of the ground, m, (rows, columns); NaN where unknown.
    to_pixel: transformation from map positions (east, north) to column and row of ``heights``.
    """

    def __init__(self, terrain: Terrain | None) -> None:
        self.known = terrain is not None
        self.terrain = terrain
        self.heights: Heights
        if terrain is None:
            self.heights = np.full((2, 2), np.nan, dtype=np.float32)
            # Lock it like a terrain's array, because locked arrays are a different type for compiled code.
            self.heights.setflags(write=False)
            # Every position maps to a pixel outside any raster.
            self.to_pixel = fit_polymap(
                lambda x, y: (np.full_like(x, -9.0), np.full_like(y, -9.0)), [[-1.0, 1.0], [-1.0, 1.0]], 1e-6
            )
        else:
            self.heights, self.to_pixel = terrain.heights, terrain.to_pixel

    def height(self, east: float, north: float) -> float:
        """Return the ground altitude at a map position, m; NaN if unknown."""
        return math.nan if self.terrain is None else float(self.terrain.height(east, north))


# ----------------------------------------------------------------------
# One flight in progress, for any autopilot: its start, ground, wind and time limit.


@dataclass(frozen=True, slots=True)
class Start:
    """Position, course, airspeed and wind at the start of a route.

    lat_deg, lon_deg: geodetic.
    amsl: altitude of the aircraft, m.
    course: true course of the first leg, rad.
    slope: slope of the first leg, rad.
    airspeed: m/s, true.
    wind: velocity of the air, north, east and down, m/s.
    ground: altitude of the ground, m AMSL.
    """

    lat_deg: float
    lon_deg: float
    amsl: float
    course: float
    slope: float
    airspeed: float
    wind: tuple[float, float, float]
    ground: float


@dataclass(frozen=True, slots=True)
class Release:
    """State of the aircraft at its release.

    position: latitude and longitude, deg, and altitude, m AMSL.
    attitude: roll, pitch, yaw (true), rad.
    velocity: velocity of the aircraft over the ground, north, east and down, m/s.
    wind: velocity of the air, north, east and down, m/s.
    ground: altitude of the ground, m AMSL.
    """

    position: tuple[float, float, float]
    attitude: tuple[float, float, float]
    velocity: tuple[float, float, float]
    wind: tuple[float, float, float]
    ground: float


class RunningFlight:
    """One flight in progress, advanced by `fly_block`.

    dt: duration of a tick, s.
    setup: setup of the flight; it names the external autopilot program once that program is known.
    path: reference path.
    map: local map from JSBSim's positions, around area and route.
    guidance_memory: internal state of the guidance, a record of `flight.guidance.inner_loops.GUIDANCE_MEMORY`.
    fdm: the simulated aircraft.
    start: start of the route, with the airspeed limited to the aircraft's range.
    max_ticks: time limit, ticks.
    engine: flight model in use, and the reason for it, as in "JSBSim, as requested".
    _law: control law of a simulated autopilot; None for an external program that starts in the air.
    _fly_ticks: flies up to a number of ticks, fills the workspace's rows, and returns the end code; 0 if the flight
        continues.
    """

    _law: ControlLaw | None = None
    _fly_ticks: Callable[[int], int]
    engine: str = "JSBSim, because the program of an autopilot flies"

    def __init__(
        self,
        setup: FlightSetup,
        aircraft: Aircraft,
        gains: Gains,
        variation: Variation | None = None,
        local_map: LocalMap | None = None,
        start_offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
        gear: Gear | None = None,
    ) -> None:
        """Load the aircraft, find the start of the route, and start the wind and the navigation error.

        local_map: local map of the setup, if another flight has already fitted one.
        start_offset: east, north and up from the route's first waypoint to the start of the flight, m.
        gear: gear for ground contact; None for a flight without ground contact.

        Raises FlightError if the aircraft cannot be loaded, and StartError if the start is not above the terrain.
        """
        self._ground = Ground(setup.scenario.terrain)
        self._steps = setup.fdm_hz // setup.guidance_hz
        self.dt = self._steps / setup.fdm_hz
        self._gains = gains
        self._prepare_route(setup, aircraft, local_map or LocalMap.around(setup))
        self._new_fdm = partial(
            Fdm,
            aircraft,
            rate_hz=setup.fdm_hz,
            motor_braking=setup.scenario.flight.motor_braking,
            variation=variation,
            gear=gear,
        )
        self.fdm = self._new_fdm()
        points = setup.route.positions
        east, north, up = (float(value + offset) for value, offset in zip(points[0], start_offset, strict=True))
        ground_altitude = self._ground.height(east, north)
        if not math.isnan(ground_altitude) and up <= ground_altitude:
            reason = f"start at {up:.0f} m AMSL: not above the terrain, which is at {ground_altitude:.0f} m"
            raise StartError(setup.mission.source, reason, field="start", value=up)
        lat, lon = (float(value) for value in to_geo(setup.scenario.origin, east, north))
        first_leg = points[1] - points[0]
        convergence = self.map.convergence(lat, lon)
        # If the aircraft cannot hold the airspeed or the first slope, the flight starts level at the nearest airspeed
        # that the aircraft can hold; the verdict reports it.
        self.start = Start(
            lat_deg=lat,
            lon_deg=lon,
            amsl=up,
            course=math.atan2(first_leg[0], first_leg[1]) - convergence,
            slope=math.atan2(first_leg[2], math.hypot(first_leg[0], first_leg[1])),
            airspeed=min(aircraft.airspeed_max, max(aircraft.airspeed_min, float(self._airspeeds[0]))),
            wind=_find_wind(setup, (east, north, up), convergence),
            ground=min(0.0, up - 1000.0) if math.isnan(ground_altitude) else ground_altitude,
        )
        # The mean wind, and the random streams of turbulence and navigation error.
        wind, record, w20 = setup.scenario.wind, self._work, W20[setup.scenario.wind.turbulence]
        cos, sin = math.cos(wind.to_course), math.sin(wind.to_course)
        record.wind = (wind.speed, cos, sin, wind.gradient, wind.reference_amsl, w20, 0.0)
        self._windy = bool(wind.speed or wind.gradient or w20 or wind.field)
        self._random = stream(wind.seed if wind.seed is not None else setup.seed, TURBULENCE)
        start_gusts(self._random.standard_normal(5), record.gusts)
        sigma, time_constant = ERRORS[setup.nav]
        record.settings.navigation_sigma, record.settings.navigation_time = sigma, time_constant
        self._navigation_random = stream(setup.seed, NAVIGATION) if sigma else None
        if self._navigation_random is not None:
            start_navigation_error(self._navigation_random.standard_normal(6), record.navigation)

    def _prepare_route(self, setup: FlightSetup, aircraft: Aircraft, local_map: LocalMap) -> None:
        """Create the workspace of the compiled loop for a route, and set the flight's time limit.

        local_map: local map of the setup.
        """
        self.setup, self.map = setup, local_map
        # An autopilot with its own turns does not follow the arcs after fly-over waypoints.
        turns = setup.autopilot.turns
        follows_arcs = turns.follows_path and turns.keeps_to_arcs
        follows_arcs = follows_arcs or not setup.route.fly_over.any()
        self.path = (
            setup.path
            if follows_arcs
            else fly_by_path(setup.route, setup.limits, setup.scenario.terrain, fly_over_turn="none")
        )
        waypoints = waypoint_records(setup.route, setup.mission, fly_over=setup.scenario.flight.fly_over)
        waypoints["is_mission_end"] &= setup.autopilot.loiters.ends_in_circle
        self._airspeeds = setup.autopilot.speeds.flown_airspeeds(setup.route.leg_airspeeds, setup.airspeed)
        waypoints["airspeed"] = np.append(self._airspeeds, self._airspeeds[-1])
        waypoints["min_ground_speed"] = setup.min_ground_speeds
        law_memory = None if self._law is None else self._law.memory
        self._workspace = Workspace(self._gains, self.path, waypoints, law_memory, setup.scenario.wind.field)
        self._work = self._workspace.record
        self._work.position_map, self._work.north_map = self.map.position.record, self.map.angle.record
        self._work.pixel_map = self._ground.to_pixel.record
        self.guidance_memory = self._work.memory
        self._work.timing.dt = self.dt
        self._work.settings.min_airspeed = 0.94 * aircraft.stall_speed
        self._work.settings.center_longitude = self.map.center_longitude
        self._work.settings.battery = setup.battery
        self.max_ticks = int(_time_limit(setup, self.path, waypoints, self._airspeeds) / self.dt)

    @property
    def position(self) -> Floats:
        """Position of the aircraft at the start of the last tick, (3,) east, north and up, m."""
        true = self._work.true
        return np.array([true.east, true.north, true.up])

    @property
    def distance(self) -> float:
        """Distance flown along the path, m."""
        return min(float(self.guidance_memory.distance), self.path.length)

    def _start_trimmed(
        self,
        source: str,
        start: Start,
        launch_end: Release | None = None,
        commands: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
    ) -> None:
        """Start the aircraft trimmed on the slope of the first leg, or level if it cannot hold that slope.

        source: file of the mission, for messages.
        launch_end: state in which a launch then releases the aircraft; None for a start in the air.
        commands: elevator, aileron, rudder (rad) and throttle (0..1) at the release.

        Raises StartError if the aircraft can fly neither the slope nor level.
        """
        start_values = (start.lat_deg, start.lon_deg, start.amsl, start.course, start.airspeed)
        try:
            trimmed = self.fdm.start(*start_values, start.slope, start.wind, start.ground)
        except FlightError:
            try:
                trimmed = self.fdm.start(*start_values, 0.0, start.wind, start.ground)
            except FlightError as error:
                error_fields = {"field": error.field, "value": error.value, "allowed": error.allowed}
                raise StartError(source, str(error), **error_fields) from error
        # Mean wind is set as part of the gust.
        self.fdm.set_wind(0.0, 0.0, 0.0)
        self.fdm.set_gust(*start.wind)
        self._work.commands = tuple(trimmed.commands())
        self._work.air.wind_north, self._work.air.wind_east = start.wind[:2]
        if launch_end is not None:
            self._work.commands = release_aircraft(self.fdm, launch_end, commands)
            self._work.air.wind_north, self._work.air.wind_east = launch_end.wind[:2]

    def fly_block(self, count: int) -> tuple[Rows, str]:
        """Fly up to ``count`` ticks; return their track rows and the reason for the flight's end.

        The reason is "" while the flight continues.
        """
        workspace, row_blocks, end_reason = self._workspace, list[Rows](), ""
        while count > 0 and not end_reason:
            # The rows of these ticks fit in the workspace.
            ticks = min(count, BLOCK_TICKS)
            workspace.turbulence[:ticks] = self._random.standard_normal((ticks, 3))
            if self._navigation_random is not None:
                workspace.navigation[:ticks] = self._navigation_random.standard_normal((ticks, 3))
            remaining_ticks = self.max_ticks - int(workspace.ticks_flown[0])
            workspace.rows_filled[0] = 0
            status = self._fly_ticks(min(ticks, remaining_ticks))
            row_blocks.append(quantise(workspace.rows[: workspace.rows_filled[0]]))
            if status:
                end_reason = ENDS[status]
            elif remaining_ticks <= ticks:
                end_reason = f"time limit of {self.max_ticks * self.dt:.0f} s reached"
                route, next_waypoint = self.setup.route, min(int(self.guidance_memory.leg) + 1, self.setup.route.legs)
                if route.arc_radii[next_waypoint] > 0.0 and route.rtl_start is None:
                    end_reason += f" in the loiter of item {route.items[next_waypoint]}"
            count -= ticks
        return (row_blocks[0] if len(row_blocks) == 1 else join_rows(row_blocks)), end_reason


def _time_limit(setup: FlightSetup, path: FlyByPath, waypoints: Records, airspeeds: Floats) -> float:
    """Return the time limit of a flight along a route, s, a multiple of the predicted time.

    path, waypoints: reference path, and `WAYPOINT` records of the route, (w,).
    airspeeds: airspeed on each leg, m/s.

    An autopilot that steers to a loiter's center flies around the center at the radius that the bank limit requires. It
    then flies one more lap until the next waypoint lies ahead. A loiter that cannot be flown in the wind adds nothing,
    because no time limit would be long enough.
    """
    extra_lengths = dict[int, float]()
    circles = waypoints[(waypoints["loiter_radius"] != 0.0) & setup.autopilot.loiters.steers_to_center]
    # Process waypoints of one loiter that agree in these fields only once.
    first_indices = np.unique(circles[["item", "loiter_radius", "airspeed", "up"]], return_index=True)[1]
    for waypoint in circles[first_indices]:
        stated_radius, altitude = abs(float(waypoint["loiter_radius"])), float(waypoint["up"])
        flown_radius = max(
            setup.limits.turn_radius(course, course + math.pi, altitude, float(waypoint["airspeed"]))
            for course in (0.0, math.pi)
        )
        # Autopilots hold an equivalent airspeed: the true airspeed is higher in thinner air.
        flown_radius *= eas_to_tas_ratio(altitude) ** 2
        if stated_radius < flown_radius < math.inf and not waypoint["is_rtl"]:
            extra_length = (
                2.0 * math.pi * (float(waypoint["loiter_turns"]) * (flown_radius - stated_radius) + flown_radius)
            )
            extra_lengths[int(waypoint["item"])] = max(extra_length, extra_lengths.get(int(waypoint["item"]), 0.0))
    length = path.length + sum(extra_lengths.values())
    # The lowest ground speed on any leg in the mean wind; a default if no leg can be flown.
    positions, courses = setup.route.positions, leg_courses(setup.route.positions)
    tables = {airspeed: setup.limits.performance(airspeed) for airspeed in set(airspeeds.tolist())}
    speeds = [
        float(ground_speed_on(tables[airspeed], courses[leg], up))
        for leg, airspeed in enumerate(airspeeds.tolist())
        for up in positions[leg : leg + 2, 2]
    ]
    ground_speed = float(np.nanmin(speeds)) if np.isfinite(speeds).any() else MIN_GROUND_SPEED_MPS
    if (wind_field := setup.scenario.wind.field) is not None:
        # Allow for the largest deviation of the forecast's wind from the mean wind around the flight.
        longest_time = TIME_LIMIT_FACTOR * length / MIN_GROUND_SPEED_MPS + TIME_LIMIT_BASE_S
        flight_field = wind_field.between(0.0, longest_time)
        flight_field = without_levels_above(flight_field, float(setup.route.positions[:, 2].max()))
        ground_speed -= float(np.linalg.norm(flight_field.velocities, axis=-1).max())
    time_limit = TIME_LIMIT_FACTOR * length / max(MIN_GROUND_SPEED_MPS, ground_speed) + TIME_LIMIT_BASE_S
    # A loiter for a time lasts as long as its item states, although its path is only one circle.
    timed_loiters = waypoints[(waypoints["loiter_time"] > 0.0) & (waypoints["loiter_time"] < math.inf)]
    time_limit += sum(
        dict(zip(timed_loiters["item"].tolist(), timed_loiters["loiter_time"].tolist(), strict=True)).values()
    )
    if setup.route.rtl_loiter is not None:
        # An autopilot that flies an RTL by its own control law may loiter longer than the path does.
        radius_factor = eas_to_tas_ratio(setup.route.rtl_loiter.up) ** 2
        time_limit += rtl_loiter_timeout(radius_factor * setup.route.rtl_loiter.radius)
    if waypoints["is_mission_end"][-1]:
        time_limit += rtl_loiter_timeout(setup.autopilot.loiters.radius)
    return time_limit


def _find_wind(setup: FlightSetup, position: Sequence[float], convergence: float) -> tuple[float, float, float]:
    """Return the mean wind at a position at the start of the flight: true north, east and down, m/s.

    position: east, north, up, m.
    convergence: grid convergence, the map course of true north, rad.
    """
    east, north = setup.scenario.wind_velocity(position)
    # The wind of a forecast is along true north, and a stated wind along the map's north.
    angle = convergence if setup.scenario.wind.field is None else 0.0
    return *_to_true_north(east, north, angle), 0.0


# ----------------------------------------------------------------------
# Start from the ground.


def default_gear(ground_phases: GroundPhases) -> Gear:
    """Return the gear to assume for a model without ground contacts.

    It is wheels for a runway, otherwise a belly.
    """
    return (
        "wheels" if ground_phases.take_off is not None and ground_phases.take_off.launch.method == "runway" else "belly"
    )


def find_release(
    setup: FlightSetup, local_map: LocalMap, ground: Ground, aircraft: Aircraft, take_off: TakeOff
) -> Release:
    """Return the state of the aircraft at the end of its launch, or at rest on a runway.

    local_map, ground: local map and terrain of the flight.
    aircraft: aircraft whose wheels determine its height above a runway.
    take_off: the take-off that is simulated.
    """
    launch = take_off.launch
    position, velocity = take_off.release_state()
    if launch.method == "runway":
        stand_heights = [contact.down for contact in find_contacts(aircraft, "wheels") if contact.is_support]
        position[2] += max(stand_heights, default=0.0)
    lat, lon = (float(value) for value in to_geo(setup.scenario.origin, position[0], position[1]))
    convergence = local_map.convergence(lat, lon)
    ground_altitude = ground.height(float(position[0]), float(position[1]))
    return Release(
        position=(lat, lon, float(position[2])),
        attitude=(0.0, launch.incline, take_off.course - convergence),
        velocity=(*_to_true_north(float(velocity[0]), float(velocity[1]), convergence), -float(velocity[2])),
        wind=_find_wind(setup, position.tolist(), convergence),
        ground=float(take_off.home[2]) if math.isnan(ground_altitude) else ground_altitude,
    )


def _to_true_north(east: float, north: float, convergence: float) -> tuple[float, float]:
    """Return the true north and east components of a map vector.

    convergence: grid convergence, the map course of true north, rad.
    """
    cos, sin = math.cos(convergence), math.sin(convergence)
    return north * cos + east * sin, east * cos - north * sin


def release_aircraft(
    fdm: Fdm, release_state: Release, commands: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    """Put the aircraft into the state at the end of its launch; return the control commands.

    release_state: position, attitude, velocity, wind and ground at the release.
    commands: elevator, aileron, rudder (rad) and throttle (0..1), which are set and returned.
    """
    fdm.release(
        release_state.position,
        release_state.attitude,
        release_state.velocity,
        wind=release_state.wind,
        terrain_amsl=release_state.ground,
        commands=commands,
    )
    # Mean wind is set as part of the gust.
    fdm.set_wind(0.0, 0.0, 0.0)
    fdm.set_gust(*release_state.wind)
    return commands


# ----------------------------------------------------------------------
# The flight by a simulated autopilot.

# Fields of `flight.guidance.inner_loops.GUIDANCE_MEMORY` that describe the flown path and not the aircraft.
_PATH_MEMORY_FIELDS = (
    *(
        "piece",
        "leg",
        "distance",
        "cross_track",
        "height_error",
        "is_finished",
        "is_in_rtl",
        "loiter_time",
        "loiter_angle",
        "bearing",
    ),
    *("cross_track_integrator", "path_bank", "path_bank_rate", "roll_offset", "roll_offset_rate", "max_arc_speed"),
    *("l1_leg", "l1_integrator", "course_integrator", "altitude_integrator", "slope_acceleration"),
)
# Records that a flight keeps when it is diverted to another route.
_DIVERSION_RECORDS = ("state", "true", "estimated", "commands", "air", "place", "wind", "gusts", "navigation", "memory")


class Flight(RunningFlight):
    """A flight by a simulated autopilot: as fast as possible, or live in real time."""

    _law: ControlLaw

    def __init__(
        self,
        setup: FlightSetup,
        aircraft: Aircraft,
        variation: Variation | None = None,
        local_map: LocalMap | None = None,
        start_offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
        engine: EngineChoice | None = None,
    ) -> None:
        """Start the flight from a trimmed state.

        variation: differences of the aircraft from its model, which guidance does not know.
        local_map: local map of the setup, if another flight has already fitted one.
        start_offset: east, north and up from the route's first waypoint to the start of the flight, m.
        engine: flight model that flies; None for the choice of the setup.

        Raises FlightError if the aircraft cannot be loaded, and StartError if the flight cannot start.
        """
        gains = load_gains(aircraft)
        self._ground_phases, gear = setup.ground_phases, None
        self._law = setup.autopilot.model.control_law
        ground_law = setup.autopilot.ground.control_law
        if self._ground_phases and ground_law is not None:
            gear = default_gear(self._ground_phases)
            self._law = ground_law(self._ground_phases, aircraft, find_contacts(aircraft, gear))
        super().__init__(setup, aircraft, gains, variation, local_map, start_offset, gear)
        if self._ground_phases:
            self.max_ticks += int(GROUND_TIME_ALLOWANCE_S / self.dt)
        start = self.start
        if setup.autopilot.speeds.equivalent:
            true_airspeed = start.airspeed * setup.autopilot.speeds.true_airspeed_factor(start.amsl)
            start = replace(start, slope=0.0, airspeed=min(aircraft.airspeed_max, true_airspeed))
        # Guidance knows the trim of the model, but not the differences of the aircraft from it.
        model = Fdm(aircraft, rate_hz=setup.fdm_hz, motor_braking=setup.scenario.flight.motor_braking)
        level_trim = steady_flight(model, gains.reference_airspeed, start.amsl)
        if level_trim is None:
            reason = f"no level flight at {gains.reference_airspeed:.1f} m/s and {start.amsl:.0f} m AMSL"
            raise StartError(setup.aircraft, reason, field="airspeed", value=gains.reference_airspeed)
        launch_end, take_off = None, self._ground_phases.take_off
        if take_off is not None:
            launch_end = find_release(setup, self.map, self._ground, aircraft, take_off)
        commands = (level_trim.elevator, 0.0, 0.0, self._law.throttle_at_release)
        start_motion = partial(self._start_trimmed, setup.mission.source, start, launch_end, commands)
        start_motion()
        memory = self.guidance_memory
        memory.trim_elevator, memory.trim_alpha = level_trim.elevator, level_trim.alpha
        memory.trim_throttle = (steady_flight(model, start.airspeed, start.amsl) or level_trim).throttle
        memory.last_airspeed, memory.stall_speed = -1.0, aircraft.stall_speed
        memory.max_bank = setup.limits.max_bank + BANK_RESERVE_RAD
        self._law.initialise(self.guidance_memory, self._workspace.law_record)
        # The compiled model flies only if its steps equal those of JSBSim.
        self._compiled: CompiledModel | None = None
        if (engine or setup.engine) == "jsbsim":
            self.engine = "JSBSim, as requested"
        elif self._law.loop is None:
            self.engine = f"JSBSim, because the control loop of {setup.autopilot.title} is not compiled"
        else:
            has_gusts, has_terrain = self._windy, bool(self._ground.known)
            try:
                compiled = CompiledModel(self.fdm, READ_FIELDS, self._steps, gusts=has_gusts, terrain=has_terrain)
            except UnsupportedModel as unsupported:
                self.engine = f"JSBSim, because the compiled model does not cover {unsupported}"
            except (FlightError, ArithmeticError) as error:
                self.engine = f"JSBSim, because the compiled model cannot start: {error}"
            else:
                if differences := compiled.find_differences():
                    # Start again, since the comparison has moved the aircraft.
                    self.fdm = self._new_fdm()
                    start_motion()
                    self.engine = f"JSBSim, because the compiled model differs from it in {differences[0]}"
                else:
                    self._compiled = compiled
                    self.engine = (
                        f"compiled model, bit-identical to JSBSim {JSBSIM_VERSION} over {PROOF_STEPS} test steps"
                    )
        self._fly_ticks = self._make_loop()

    def divert(self, setup: FlightSetup, local_map: LocalMap) -> None:
        """Change to the route of another setup, which starts at the aircraft's position at time 0.

        The aircraft, its wind and the estimates of guidance are kept; the state of guidance on the old route is
        discarded.

        setup: setup with the same aircraft, autopilot, wind and rates.
        local_map: local map of that setup.
        """
        old_record, old_law_record = self._work, self._workspace.law_record
        # The aircraft is in the air, even if the new mission starts with a take-off.
        self._ground_phases, self._law = GroundPhases(), setup.autopilot.model.control_law
        self._prepare_route(setup, self.fdm.aircraft, local_map)
        for name in _DIVERSION_RECORDS:
            setattr(self._work, name, getattr(old_record, name))
        self._work.wind.start_time += old_record.timing.tick * self.dt
        for name in _PATH_MEMORY_FIELDS:
            setattr(self.guidance_memory, name, 0)
        self._law.initialise(self.guidance_memory, self._workspace.law_record)
        self._law.transfer_state(old_law_record, self._workspace.law_record, setup.route.positions[0])
        self._fly_ticks = self._make_loop()

    def _make_loop(self) -> Callable[[int], int]:
        """Return a function that flies up to a given number of ticks, and returns the flight's end code.

        The code is 0 if the flight has not ended. The function writes the track into the rows of the workspace.
        """
        record, workspace, access = self._work, self._workspace, self.fdm.loop_access()
        record.state_factors = access.factors[0]
        record.scale_positive, record.scale_negative = (tuple(scales) for scales in zip(*access.scales, strict=True))
        if self._compiled is not None and self._law.loop is not None:
            model = self._compiled
            return partial(self._law.loop, workspace.block, self._ground.heights, *model.arrays)
        # Do not set gusts in still air, nor the altitude of unknown ground.
        is_used = (True, True, True, True, self._windy, self._windy, self._windy, self._ground.known)
        setters = [
            setter if use else (lambda _value: None) for setter, use in zip(access.setters, is_used, strict=True)
        ]
        return make_loop(
            [access.getters[field] for field in READ_FIELDS],
            setters,
            partial(self._law.tick, workspace.block, self._ground.heights),
            workspace,
            access.run,
            self._steps,
        )


@dataclass(frozen=True, slots=True)
class SimulatedFlight:
    """A flight that has ended.

    track: flown track.
    ended: "completed", or the reason why the flight ended earlier.
    path: reference path.
    """

    track: Track
    ended: str
    path: FlyByPath


def fly_to_end(flight: RunningFlight) -> SimulatedFlight:
    """Fly until the flight ends. The same setup always gives the same track, bit for bit.

    Raises FlightError if a program does not fly to the end.

    >>> import numpy as np
    >>> from aircraft.catalog import load_aircraft
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from flight.mission.items import Mission
    >>> from flight.mission.route import Route, route_points
    >>> from flight.simulation.setup import make_limits
    >>> from world.scenario import load_scenario
    >>> scenario, aerosonde = load_scenario("tight"), load_aircraft("aerosonde")
    >>> waypoints = scenario.start + np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0]])
    >>> route = Route(route_points(waypoints, 25.0), "")
    >>> limits = make_limits(scenario, load_envelope(aerosonde), 25.0, 0.5)
    >>> setup = FlightSetup(scenario, Mission(None, ()), route, limits, "aerosonde", 888.0, 1)
    >>> flown = fly_to_end(Flight(setup, aerosonde))
    >>> flown.ended, round(float(flown.track.time[-1])), bool(abs(flown.track.cross_track).max() < 0.1)
    ('completed', 12, True)
    """
    builder, end_reason = TrackBuilder(), ""
    while not end_reason:
        rows, end_reason = flight.fly_block(round(LONG_BLOCK_DURATION_S / flight.dt))
        builder.add(rows)
    return SimulatedFlight(builder.track(), end_reason, flight.path)
