"""An aircraft in the air, whoever steers it: its start, its ground and wind, and how long it may fly.

`flight.simulation.simulate.Flight` steers it by an autopilot's law, a `ProgramFlight` by a program of its own.
"""

import math
from abc import ABC, abstractmethod
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft, load_aircraft
from aircraft.path_limits import Limits, ground_speed_on
from flight.autopilots.autopilot import Autopilot
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.trim import Trim
from flight.guidance.gains import Gains
from flight.guidance.navigation_error import ERRORS, start_navigation
from flight.guidance.path import waypoint_records
from flight.simulation.setup import FlightSetup
from flight.simulation.tick import BLOCK_TICKS, ENDS, Workspace
from flight.simulation.track import Rows, Track, join_rows, quantised
from flight.simulation.turbulence import start_gusts
from world.errors import FlightError, StartError
from world.frames import GeoOrigin, PolyMap, fit_polymap, to_geo, to_map
from world.geometry import leg_courses
from world.random_streams import NAVIGATION, TURBULENCE, stream
from world.terrain import Heights, Terrain
from world.wind import W20

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# The aircraft's controls: their limits, and when a flight asked for all that they give.

# A control counts as at its limit within this share of its range.
_EDGE = 1e-3


def control_limits(aircraft: str) -> list[tuple[str, float]]:
    """Each control and its limit either way (rad; 1 for the throttle; NaN for an aircraft that is not known).

    >>> for name, limit in control_limits("aerosonde"):
    ...     print(f"{name} {limit:.2f}")
    elevator 0.52
    aileron 0.52
    rudder 0.52
    throttle 1.00
    """
    try:
        known = load_aircraft(aircraft)
    except FlightError:
        limits = (math.nan, math.nan, math.nan)
    else:
        limits = (known.max_elevator, known.max_aileron, known.max_rudder)
    return list(zip(("elevator", "aileron", "rudder", "throttle"), (*limits, 1.0), strict=True))


def held_at_limit(track: Track, k: int, low: float, high: float) -> NDArray[np.bool_]:
    """Rows at which control k (a column of `Track.commands`) is asked for its limit or more, (t,).

    low, high: its limits; none of the rows for NaN.

    >>> from flight.simulation.track import THROTTLE, TRACK_ROW, as_track
    >>> rows = np.zeros(3, TRACK_ROW)
    >>> rows["commands"][:, THROTTLE] = 0.5, 1.0, 0.9
    >>> held_at_limit(as_track(rows), THROTTLE, 0.0, 1.0)
    array([False,  True, False])
    """
    command = track.commands[:, k].astype(np.float64)
    edge = _EDGE * (high - low)
    return np.asarray((command <= low + edge) | (command >= high - edge))


# ----------------------------------------------------------------------
# The world as the compiled loop needs it: from JSBSim's latitude and longitude to the map, and the ground below.


# The local map extends this far (m) beyond the area and the route.
MAP_BUFFER = 5000.0
# Worst error of the local map that a flight accepts, m and rad.
WORST = (0.01, 1e-6)


@dataclass(frozen=True, slots=True)
class LocalMap:
    """From geodetic radians to the map, fitted around one flight: a copy of the projection that compiled code takes.

    position: (latitude, longitude) to (east, north).
    angle: (latitude, longitude) to the map course of true north (rad), and 0.
    middle: longitude of its middle, rad; longitudes are taken within half a turn of it.
    """

    position: PolyMap
    angle: PolyMap
    middle: float

    @staticmethod
    def around(setup: FlightSetup) -> "LocalMap":
        """Fit the area and the route with `MAP_BUFFER` around them; 0.1 mm and 1e-9 rad on areas up to 600 km wide.

        Raises FlightError where the map cannot be fitted: an area about a pole.
        """
        origin: GeoOrigin = setup.scenario.origin
        points = np.concatenate([setup.route.waypoints[:, :2], setup.scenario.bounds.T])
        low, high = points.min(axis=0) - MAP_BUFFER, points.max(axis=0) + MAP_BUFFER
        outline = np.array([[e, n] for e in (low[0], 0.5 * (low[0] + high[0]), high[0]) for n in (low[1], high[1])])
        lat, lon = (np.radians(values) for values in to_geo(origin, outline[:, 0], outline[:, 1]))
        # Longitudes about the origin's, so that an area may lie across the 180th meridian.
        here = math.radians(origin.lon_deg)
        lon = here + (lon - here + math.pi) % (2.0 * math.pi) - math.pi
        bounds = np.array([[lat.min(), lat.max()], [lon.min(), lon.max()]])
        if not (np.isfinite(bounds).all() and np.ptp(bounds[1]) < math.pi):
            raise FlightError(f"{setup.mission.source}: the area lies about a pole", file=setup.mission.source)

        def position(phi: Floats, lam: Floats) -> tuple[Floats, Floats]:
            return to_map(origin, np.degrees(phi), np.degrees(lam))

        def angle(phi: Floats, lam: Floats) -> tuple[Floats, Floats]:
            step = 1e-5
            east0, north0 = position(phi - step, lam)
            east1, north1 = position(phi + step, lam)
            return np.arctan2(east1 - east0, north1 - north0), np.zeros_like(phi)

        middle = float((bounds[1, 0] + bounds[1, 1]) / 2)
        local = LocalMap(fit_polymap(position, bounds, 1e-4), fit_polymap(angle, bounds, 1e-9), middle)
        if not (local.position.residual <= WORST[0] and local.angle.residual <= WORST[1]):
            raise FlightError(
                f"{setup.mission.source}: the area is too large to fly in: its map is out by"
                f" {local.position.residual:.2g} m; {WORST[0]:g} m is allowed",
                file=setup.mission.source,
            )
        return local

    def convergence(self, lat_deg: float, lon_deg: float) -> float:
        """Map course of true north at a position, rad."""
        lon = self.middle + math.remainder(math.radians(lon_deg) - self.middle, 2.0 * math.pi)
        return float(self.angle(math.radians(lat_deg), lon)[0])


class Ground:
    """Terrain for the compiled tick; unknown ground is a raster without data.

    known: whether there is terrain.  heights: (rows, cols) m.  to_pixel: from the map to the raster.
    """

    def __init__(self, terrain: Terrain | None) -> None:
        self.known = terrain is not None
        self.terrain = terrain
        self.heights: Heights
        if terrain is None:
            self.heights, self.to_pixel = np.full((2, 2), np.nan, dtype=np.float32), _off_the_raster()
            # Locked like a terrain's: a compiled function has one type for locked arrays and one for others.
            self.heights.setflags(write=False)
        else:
            self.heights, self.to_pixel = terrain.heights, terrain.to_pixel

    def height(self, east: float, north: float) -> float:
        """Ground height at a map position, m; NaN where it is unknown."""
        return math.nan if self.terrain is None else float(self.terrain.height(east, north))


def _off_the_raster() -> PolyMap:
    """Make a map that takes every position to a pixel that no raster has."""

    def nowhere(x: Floats, y: Floats) -> tuple[Floats, Floats]:
        return np.full_like(x, -9.0), np.full_like(y, -9.0)

    return fit_polymap(nowhere, [[-1.0, 1.0], [-1.0, 1.0]], 1e-6)


# A flight may take this much longer than its length over its slowest ground speed, s on top.
PATIENCE = 1.5
PATIENCE_SECONDS = 60.0


@dataclass(frozen=True, slots=True)
class Start:
    """Where and how a route begins.

    lat_deg, lon_deg: geodetic.  amsl, ground: m.
    course: true, of the first leg, rad.  slope: of the first leg, rad.
    airspeed: m/s, true.
    wind: (3,) m/s, north, east, down, the way the air moves.
    """

    lat_deg: float
    lon_deg: float
    amsl: float
    course: float
    slope: float
    airspeed: float
    wind: tuple[float, float, float]
    ground: float


class Airborne(ABC):
    """One flight in progress, advanced by `block`.

    dt: of a tick, s.
    setup: with the program that flies it, once that has said which it is.
    path: that it is to follow.
    map: from JSBSim's positions, around area and route.
    memory: guidance's, a record of `flight.guidance.inner_loops.GUIDANCE_MEMORY`.
    fdm: the aircraft that flies.
    max_ticks: after so many its time is up.
    """

    def __init__(
        self,
        setup: FlightSetup,
        aircraft: Aircraft,
        gains: Gains,
        variation: Variation | None = None,
        local_map: LocalMap | None = None,
        start_offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Load it: local_map is the setup's where another flight of it has fitted one already.

        start_offset: east, north and up from the route's first waypoint to where the flight begins, m.
        """
        self.setup = setup
        self.path = setup.path
        self._start_offset = start_offset
        self._ground = Ground(setup.scenario.terrain)
        self.map = local_map or LocalMap.around(setup)
        self._steps = setup.fdm_hz // setup.guidance_hz
        self.dt = self._steps / setup.fdm_hz
        waypoints = waypoint_records(setup.route)
        self._airspeeds = setup.autopilot.speeds_flown(setup.route.airspeed, setup.airspeed)
        waypoints["airspeed"] = np.append(self._airspeeds, self._airspeeds[-1])
        self._workspace = Workspace(gains, self.path, waypoints, setup.autopilot.own)
        self._work = self._workspace.record
        self._work.position_map, self._work.north_map = self.map.position.record, self.map.angle.record
        self._work.pixel_map = self._ground.to_pixel.record
        self.memory = self._work.memory
        braking = setup.scenario.flight.motor_braking
        self.fdm = Fdm(aircraft, rate_hz=setup.fdm_hz, motor_braking=braking, variation=variation)
        self._work.timing.dt = self.dt
        self._work.settings.slowest = 0.94 * aircraft.stall_speed
        self._work.settings.middle = self.map.middle
        self._work.settings.battery = setup.battery
        patience = PATIENCE * self.path.length / _slowest_leg(setup, self._airspeeds) + PATIENCE_SECONDS
        self.max_ticks = int(patience / self.dt)

    @abstractmethod
    def _fly(self, count: int) -> int:
        """Fly up to a number of ticks into the workspace's rows; return the last one's status, 0 to fly on."""

    def _disturb(self, setup: FlightSetup) -> None:
        """Set the wind, and start turbulence and navigation's error."""
        wind, work = setup.scenario.wind, self._work
        to = wind.to_course
        w20 = W20[wind.turbulence]
        work.wind = (wind.speed, math.cos(to), math.sin(to), wind.gradient, wind.reference_amsl, w20)
        self._windy = bool(wind.speed or wind.gradient or w20)
        self._random = stream(wind.seed if wind.seed is not None else setup.seed, TURBULENCE)
        start_gusts(self._random.standard_normal(5), work.gusts)
        sigma, time_constant = ERRORS[setup.nav]
        work.settings.navigation_sigma, work.settings.navigation_time = sigma, time_constant
        self._navigation_random = stream(setup.seed, NAVIGATION) if sigma else None
        if self._navigation_random is not None:
            start_navigation(self._navigation_random.standard_normal(6), work.navigation)

    def _start(self, setup: FlightSetup) -> Start:
        """Where the route begins.  Raises StartError for a place that is not above the terrain."""
        points = setup.route.waypoints
        east, north, up = (float(value + off) for value, off in zip(points[0], self._start_offset, strict=True))
        under = self._ground.height(east, north)
        if not math.isnan(under) and up <= under:
            reason = f"start at {up:.0f} m AMSL: not above the terrain, which is at {under:.0f} m"
            raise StartError(setup.mission.source, reason, field="start", value=up)
        lat, lon = (float(value) for value in to_geo(setup.scenario.origin, east, north))
        step = points[1] - points[0]
        # A map course is the true course and this.
        turn = self.map.convergence(lat, lon)
        # A speed or a first slope that the aircraft cannot hold is the verdict's business, not the start's: it starts
        # at the nearest speed it can, and level.
        aircraft = self.fdm.aircraft
        east_wind, north_wind = setup.scenario.wind.at(up)
        cos, sin = math.cos(turn), math.sin(turn)
        return Start(
            lat_deg=lat,
            lon_deg=lon,
            amsl=up,
            course=math.atan2(step[0], step[1]) - turn,
            slope=math.atan2(step[2], math.hypot(step[0], step[1])),
            airspeed=min(aircraft.airspeed_max, max(aircraft.airspeed_min, float(self._airspeeds[0]))),
            wind=(north_wind * cos + east_wind * sin, east_wind * cos - north_wind * sin, 0.0),
            ground=min(0.0, up - 1000.0) if math.isnan(under) else under,
        )

    def _trim(self, source: str, start: Start) -> Trim:
        """Begin trimmed on the start's slope if the aircraft can hold it, else level.  Raises StartError."""
        begin = (start.lat_deg, start.lon_deg, start.amsl, start.course, start.airspeed)
        try:
            trimmed = self.fdm.start(*begin, start.slope, start.wind, start.ground)
        except FlightError:
            try:
                trimmed = self.fdm.start(*begin, 0.0, start.wind, start.ground)
            except FlightError as error:
                known = {"field": error.field, "value": error.value, "allowed": error.allowed}
                raise StartError(source, str(error), **known) from error
        self._work.commands = tuple(trimmed.commands())
        self._work.air.wind_north, self._work.air.wind_east = start.wind[:2]
        # All that blows is set as a gust.
        self.fdm.set_wind(0.0, 0.0, 0.0)
        self.fdm.set_gust(*start.wind)
        return trimmed

    def block(self, count: int) -> tuple[Rows, str]:
        """Fly up to ``count`` ticks: their rows, and how the flight ended ("" while it goes on)."""
        parts: list[Rows] = []
        ended = ""
        while count > 0 and not ended:
            rows, ended = self._fill_workspace(min(count, BLOCK_TICKS))
            parts.append(rows)
            count -= BLOCK_TICKS
        return (parts[0] if len(parts) == 1 else join_rows(parts)), ended

    def _fill_workspace(self, count: int) -> tuple[Rows, str]:
        """Fly up to ``count`` ticks, as many as the workspace has rows at most: as `block`."""
        space = self._workspace
        space.turbulence[:count] = self._random.standard_normal((count, 3))
        if self._navigation_random is not None:
            space.navigation[:count] = self._navigation_random.standard_normal((count, 3))
        left = self.max_ticks - int(space.ticks_flown[0])
        space.rows_filled[0] = 0
        status = self._fly(min(count, left))
        rows = quantised(space.rows[: space.rows_filled[0]])
        if status:
            return rows, ENDS[status]
        if left <= count:
            return rows, f"time limit: not finished after {self.max_ticks * self.dt:.0f} s"
        return rows, ""


class ProgramFlight(Airborne, AbstractContextManager["ProgramFlight"]):
    """A flight that a program steers, in lockstep with our physics; on leaving it the program has ended."""

    @abstractmethod
    def prepare(self) -> None:
        """Have the program take the mission and fly to the first waypoint.  Raises FlightError."""

    @abstractmethod
    def keep_log(self, target: Path) -> bool:
        """End the program in order, and move its own log to a file; whether there was one."""


class ProgramAutopilot(Autopilot):
    """An autopilot that is a program of its own; `law` is the autopilot that models it."""

    @classmethod
    @abstractmethod
    def flying(cls, law: Any, binary: Path) -> Self:
        """The program, with the settings of its law.  binary: its file."""

    @abstractmethod
    def start(self, setup: FlightSetup, aircraft: Aircraft) -> ProgramFlight:
        """Start the program for a flight.  Raises FlightError."""


def _slowest_leg(setup: FlightSetup, airspeeds: Floats) -> float:
    """Least ground speed on any leg in the mean wind at its heights, m/s, at least 3."""
    limits: Limits = setup.limits
    points, courses = setup.route.waypoints, leg_courses(setup.route.waypoints)
    speeds = []
    for leg, airspeed in enumerate(airspeeds):
        table = limits.performance(float(airspeed))
        speeds += [float(ground_speed_on(table, courses[leg], up)) for up in points[leg : leg + 2, 2]]
    return max(3.0, float(np.nanmin([*speeds, math.inf]))) if np.isfinite(speeds).any() else 3.0
