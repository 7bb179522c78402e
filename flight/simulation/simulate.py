"""The flight: JSBSim under guidance along a route, over its terrain, until its end or its failure."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.path_limits import Limits, ground_speed_on
from flight.dynamics.fdm import Fdm, LoopAccess, Variation
from flight.dynamics.trim import Trim, straight
from flight.guidance.fly_by_path import FlyByPath, waypoint_records
from flight.guidance.gains import load_gains
from flight.guidance.guidance_memory import CROSS_TRACK, L1, VECTOR_FIELD
from flight.guidance.navigation_error import ERRORS, start_navigation
from flight.simulation.dryden import start_gusts
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.local_map import Ground, LocalMap
from flight.simulation.loop import make_loop
from flight.simulation.tick import ENDS, tick_in_block
from flight.simulation.track import Rows, Track, as_track, join_rows, quantised
from flight.simulation.workspace import BLOCK_TICKS, READ_FIELDS, Workspace
from world.errors import FlightError, StartError
from world.frames import to_geo
from world.geometry import leg_courses
from world.random_streams import NAVIGATION, TURBULENCE, stream
from world.wind import W20

Progress = Callable[[float, float], None]
Sink = Callable[[Rows], None]

FDM_HZ = 120.0
# Of the usual guidance, s; `Flight.dt` is a flight's own.
TICK = 1.0 / 60.0
# Rows that are handed on at a time, s of flight.
BLOCK = 1.0
# Bank that guidance may add to the planned turns' to correct an error, rad.
BANK_RESERVE = math.radians(3.0)
# A flight may take this much longer than its length over its slowest ground speed, s on top.
PATIENCE = 1.5
PATIENCE_SECONDS = 60.0
# By its name in a scenario's `[flight] guidance`.
LAWS = {"path": CROSS_TRACK, "l1": L1, "vector-field": VECTOR_FIELD}


@dataclass(frozen=True, slots=True)
class SimulatedFlight:
    """A flight that is over.

    track: as flown.
    ended: "completed" or why not.
    path: that it was to follow.
    """

    track: Track
    ended: str
    path: FlyByPath


def simulate(
    setup: FlightSetup,
    aircraft: Aircraft,
    *,
    sink: Sink | None = None,
    progress: Progress | None = None,
    variation: Variation | None = None,
) -> SimulatedFlight:
    """Fly a setup from a trimmed start.  The same setup gives the same track, bit for bit.

    sink: is handed each second's rows, (t,) of `flight.simulation.track.TRACK_ROW`.
    progress: is called with the distance flown and the whole, m.
    variation: an aircraft that differs from its model, which guidance knows nothing of: for robustness.

    Raises FlightError for an aircraft that cannot be loaded, and StartError for a flight that cannot start.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from flight.mission.items import Mission
    >>> from flight.mission.route import Route
    >>> from flight.simulation.flight_setup import make_limits
    >>> from world.scenario import load_scenario
    >>> scenario, aerosonde = load_scenario("tight"), load_aircraft("aerosonde")
    >>> way = scenario.start + np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0]])
    >>> route = Route(way, np.array([25.0]), np.zeros(2), np.zeros(2, dtype=bool), np.arange(2), "")
    >>> limits = make_limits(scenario, load_envelope(aerosonde), 25.0, 0.5)
    >>> flown = simulate(FlightSetup(scenario, Mission(None, ()), "", route, limits, "aerosonde", 888.0, 1), aerosonde)
    >>> flown.ended, round(float(flown.track.time[-1])), bool(abs(flown.track.cross_track).max() < 0.1)
    ('completed', 12, True)
    """
    flight = Flight(setup, aircraft, variation)
    blocks: list[Rows] = []
    ended = ""
    while not ended:
        rows, ended = flight.block(round(BLOCK / flight.dt))
        blocks.append(rows)
        if sink is not None and len(rows):
            sink(rows)
        if progress is not None:
            progress(min(flight.memory.distance, flight.path.length), flight.path.length)
    return SimulatedFlight(as_track(join_rows(blocks)), ended, flight.path)


def _slowest_leg(setup: FlightSetup, limits: Limits) -> float:
    """Least ground speed on any leg in the mean wind at its heights, m/s, at least 3."""
    points, courses = setup.route.waypoints, leg_courses(setup.route.waypoints)
    speeds = []
    for leg, airspeed in enumerate(setup.route.airspeed):
        table = limits.performance(float(airspeed))
        speeds += [float(ground_speed_on(table, courses[leg], up)) for up in points[leg : leg + 2, 2]]
    return max(3.0, float(np.nanmin([*speeds, math.inf]))) if np.isfinite(speeds).any() else 3.0


class Flight:
    """One flight in progress, advanced by `block`: `simulate` in one go, the live vehicle in step with a clock.

    dt: of a tick, s.
    path: that it follows.
    map: from JSBSim's positions, around area and route.
    memory: guidance's, a record of `flight.guidance.guidance_memory.GUIDANCE_MEMORY`.
    fdm: the aircraft that flies.
    """

    def __init__(self, setup: FlightSetup, aircraft: Aircraft, variation: Variation | None = None) -> None:
        limits, gains = setup.limits, load_gains(aircraft)
        self.path = setup.path
        self._ground = Ground(setup.scenario.terrain)
        self.map = LocalMap.around(setup)
        self._steps = round(FDM_HZ / setup.guidance_hz)
        self.dt = self._steps / FDM_HZ
        self._workspace = Workspace(gains, self.path, waypoint_records(setup.route))
        self._work = self._workspace.record
        self._work.position_map, self._work.north_map = self.map.position.record, self.map.angle.record
        self._work.pixel_map = self._ground.to_pixel.record
        self.memory = self._work.memory
        braking = setup.scenario.flight.motor_braking
        self.fdm = Fdm(aircraft, rate_hz=FDM_HZ, motor_braking=braking, variation=variation)
        # Guidance knows the model, not how the aircraft differs from it.
        model = Fdm(aircraft, rate_hz=FDM_HZ, motor_braking=braking)
        self._start(setup, model, gains.reference_airspeed)
        self.memory.max_bank = limits.max_bank + BANK_RESERVE
        self.memory.law = LAWS[setup.guidance]
        self._disturb(setup)
        self._work.timing.dt = self.dt
        self._work.settings.slowest = 0.94 * aircraft.stall_speed
        self._work.settings.middle = self.map.middle
        self._work.settings.battery = setup.battery
        self._fly = self._loop(self.fdm.loop_access())
        slow = _slowest_leg(setup, limits)
        self.most_ticks = int((PATIENCE * self.path.length / slow + PATIENCE_SECONDS) / self.dt)

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

    def _start(self, setup: FlightSetup, model: Fdm, reference: float) -> None:
        """Trim the aircraft at the route's start, and guidance's controls with the model.

        reference: airspeed at which the gains hold, m/s.
        """
        points = setup.route.waypoints
        east, north, up = (float(value) for value in points[0])
        under = self._ground.height(east, north)
        if not math.isnan(under) and up <= under:
            reason = f"start at {up:.0f} m AMSL: not above the terrain, which is at {under:.0f} m"
            raise StartError(setup.mission.source, reason)
        lat, lon = (float(value) for value in to_geo(setup.scenario.origin, east, north))
        level = straight(model, reference, up)
        if level is None:
            raise StartError(setup.aircraft, f"no level flight at {reference:.1f} m/s and {up:.0f} m AMSL")
        step = points[1] - points[0]
        # A map course is the true course and this.
        turn = self.map.convergence(lat, lon)
        course = math.atan2(step[0], step[1]) - turn
        slope = math.atan2(step[2], math.hypot(step[0], step[1]))
        # A speed or a first slope that the aircraft cannot hold is the verdict's business, not the start's: it starts
        # at the nearest speed it can, and level.
        aircraft = self.fdm.aircraft
        speed = min(aircraft.airspeed_max, max(aircraft.airspeed_min, float(setup.route.airspeed[0])))
        east_wind, north_wind = setup.scenario.wind.at(up)
        cos, sin = math.cos(turn), math.sin(turn)
        wind = (north_wind * cos + east_wind * sin, east_wind * cos - north_wind * sin, 0.0)
        ground = min(0.0, up - 1000.0) if math.isnan(under) else under
        trimmed = self._trimmed(setup, (lat, lon, up), course, speed, slope, wind, ground)
        self._work.commands = tuple(trimmed.commands())
        self._work.air.wind_north, self._work.air.wind_east = wind[:2]
        self.fdm.set_wind(0.0, 0.0, 0.0)
        self.fdm.set_gust(*wind)
        memory = self.memory
        memory.trim_elevator, memory.trim_alpha = level.elevator, level.alpha
        memory.trim_throttle = (straight(model, speed, up) or level).throttle
        memory.last_airspeed = -1.0

    def _trimmed(
        self,
        setup: FlightSetup,
        begin: tuple[float, float, float],
        course: float,
        speed: float,
        slope: float,
        wind: tuple[float, float, float],
        ground: float,
    ) -> Trim:
        """Start on this slope (rad) if the aircraft can hold it, else level.  begin: latitude, longitude, m AMSL."""
        try:
            return self.fdm.start(*begin, course, speed, slope, wind, ground)
        except FlightError:
            pass
        try:
            return self.fdm.start(*begin, course, speed, 0.0, wind, ground)
        except FlightError as error:
            raise StartError(setup.mission.source, str(error)) from error

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
        left = self.most_ticks - int(space.ticks_flown[0])
        space.rows_filled[0] = 0
        status = self._fly(min(count, left))
        rows = quantised(space.rows[: space.rows_filled[0]])
        if status:
            return rows, ENDS[status]
        if left <= count:
            return rows, f"time limit: not finished after {self.most_ticks * self.dt:.0f} s"
        return rows, ""

    def _loop(self, access: LoopAccess) -> Callable[[int], int]:
        """Make what flies a number of ticks into the workspace's rows and returns the last tick's status."""
        work, space = self._work, self._workspace
        work.state_factors = access.factors[0]
        work.scale_above, work.scale_below = (tuple(scales) for scales in zip(*access.scales, strict=True))
        # Not set: gusts in still air, and ground that is not known.
        used = (True, True, True, True, self._windy, self._windy, self._windy, self._ground.known)
        setters = [setter if use else _ignore for setter, use in zip(access.setters, used, strict=True)]
        return make_loop(
            [access.getters[field] for field in READ_FIELDS],
            setters,
            partial(tick_in_block, space.block, self._ground.heights),
            space,
            access.run,
            self._steps,
        )


def _ignore(_value: float) -> None:
    """Set nothing."""
