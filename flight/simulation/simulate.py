"""The flight: JSBSim under guidance along a route, over its terrain, until its end or its failure."""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft
from aircraft.path_limits import Limits, ground_speed_on
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.nodes import GROUND_SETTER, GUST_SETTERS, Links
from flight.dynamics.state import STATE_SIZE, S
from flight.dynamics.trim import straight
from flight.guidance.fly_by_path import FlyByPath, fly_by_path
from flight.guidance.gains import load_gains
from flight.guidance.navigation_error import ERRORS, NAV_STATES, start_navigation
from flight.guidance.rows import Lateral, M
from flight.simulation.dryden import GUST_STATES, start_gusts
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.local_map import Chart, Ground
from flight.simulation.tick import ENDS, linked_tick, tick
from flight.simulation.track import COLUMNS, Track, quantised
from flight.simulation.workspace import ROW, Arena, K, Table
from world.errors import FlightError
from world.frames import to_geo
from world.geometry import leg_courses, signed_turns
from world.kernels import entry
from world.random_streams import NAVIGATION, TURBULENCE, stream
from world.wind import W20

Floats = NDArray[np.float64]
Progress = Callable[[float, float], None]
Sink = Callable[[Floats], None]

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
LAWS = {"path": Lateral.PATH, "l1": Lateral.L1, "vector-field": Lateral.VECTOR_FIELD}


@dataclass(frozen=True, slots=True)
class SimulatedFlight:
    """A flight: its track, how it ended ("completed" or why not), and the path it was to follow."""

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

    sink: is handed each second's rows, as `Flight.block` gives them.  progress: is told the distance flown and the
    whole, m.
    variation: an aircraft that differs from its model, which guidance knows nothing of: for robustness.
    Raises FlightError for a flight that cannot start.
    """
    flight = Flight(setup, aircraft, variation)
    blocks: list[Floats] = []
    ended = ""
    while not ended:
        rows, ended = flight.block(round(BLOCK / flight.dt))
        blocks.append(rows)
        if sink is not None and len(rows):
            sink(rows)
        if progress is not None:
            progress(min(flight.memory[M.DISTANCE], flight.path.length), flight.path.length)
    return SimulatedFlight(as_track(np.concatenate(blocks)), ended, flight.path)


def _slowest_leg(setup: FlightSetup, limits: Limits) -> float:
    """Least ground speed on any leg in the mean wind at its heights, m/s, at least 3."""
    points, courses = setup.route.waypoints, leg_courses(setup.route.waypoints)
    speeds = []
    for leg, airspeed in enumerate(setup.route.airspeed):
        table = limits.performance(float(airspeed))
        speeds += [float(ground_speed_on(table, courses[leg], up)) for up in points[leg : leg + 2, 2]]
    return max(3.0, float(np.nanmin([*speeds, math.inf]))) if np.isfinite(speeds).any() else 3.0


class Flight:
    """One flight in progress, advanced by `block`: `simulate` in one go, the live vehicle in step with a clock."""

    def __init__(self, setup: FlightSetup, aircraft: Aircraft, variation: Variation | None = None) -> None:
        scenario, limits = setup.scenario, setup.limits
        self.path = fly_by_path(setup.route, limits)
        self.speeds = setup.route.airspeed
        gains = load_gains(aircraft)
        self.terrain = Ground(scenario.terrain)
        self.chart = Chart.around(setup)
        self.steps = round(FDM_HZ / setup.guidance_hz)
        self.dt = self.steps / FDM_HZ
        self.arena = Arena(gains, round(BLOCK / self.dt), self._tables(setup))
        self.memory, self.commands = self.arena.memory, self.arena.commands
        braking = scenario.flight.motor_braking
        self.fdm = Fdm(aircraft, rate_hz=FDM_HZ, motor_braking=braking, variation=variation)
        self.memory[M.MAX_BANK] = limits.max_bank + BANK_RESERVE
        self.memory[M.GUIDANCE] = LAWS[setup.guidance]
        # Guidance knows the model; it is not told how the aircraft differs from it.
        self._start(setup, gains.reference_airspeed, Fdm(aircraft, rate_hz=FDM_HZ, motor_braking=braking))
        self._disturb(setup)
        self._step = self._linked(self.fdm.links())
        constants = self.arena.constants
        constants[K.LONGITUDE] = self.chart.position.record["centre_y"]
        constants[K.DT], constants[K.SLOWEST] = self.dt, 0.94 * aircraft.stall_speed
        slow = _slowest_leg(setup, limits)
        self.most_ticks = int((PATIENCE * self.path.length / slow + PATIENCE_SECONDS) / self.dt)

    def _tables(self, setup: FlightSetup) -> dict[Table, Floats]:
        route = setup.route
        turns = np.concatenate([[0.0], np.abs(signed_turns(route.waypoints)), [0.0]])
        return {
            Table.POSITION: self.chart.position.rows(),
            Table.ANGLE: self.chart.angle.rows(),
            Table.TO_PIXEL: self.terrain.packed,
            Table.PIECES: self.path.pieces,
            Table.NODES: self.path.nodes,
            Table.CORNERS: np.column_stack([route.waypoints[:, :2], turns, route.fly_over, route.acceptance]),
            Table.SPEEDS: self.speeds[:, np.newaxis],
        }

    def _disturb(self, setup: FlightSetup) -> None:
        """Set the wind, and start turbulence and navigation's error."""
        wind, arena = setup.scenario.wind, self.arena
        to = wind.to_course
        arena.wind[:] = (
            *(wind.speed, math.cos(to), math.sin(to)),
            *(wind.gradient, wind.reference_amsl, W20[wind.turbulence]),
        )
        # What blows is set as a gust, all of it: three nodes a tick, not six; none in still air.
        self.windy = bool(wind.speed or wind.gradient or W20[wind.turbulence])
        self.random = stream(wind.seed if wind.seed is not None else setup.seed, TURBULENCE)
        start_gusts(self.random.standard_normal(GUST_STATES), arena.gusts)
        sigma, time_constant = ERRORS[setup.nav]
        arena.constants[K.NAV_SIGMA], arena.constants[K.NAV_TIME] = sigma, time_constant
        self.nav_random = stream(setup.seed, NAVIGATION) if sigma else None
        if self.nav_random is not None:
            start_navigation(self.nav_random.standard_normal(NAV_STATES), arena.nav)

    def _start(self, setup: FlightSetup, reference: float, model: Fdm) -> None:
        points = setup.route.waypoints
        east, north, up = (float(value) for value in points[0])
        under = self.terrain.height(east, north)
        if not math.isnan(under) and up <= under:
            raise FlightError(
                f"{setup.mission.source}: start at {up:.0f} m AMSL: not above the terrain, which is at {under:.0f} m"
            )
        lat, lon = to_geo(setup.scenario.origin, east, north)
        level = straight(model, reference, up)
        if level is None:
            raise FlightError(f"{setup.aircraft}: no level flight at {reference:.1f} m/s and {up:.0f} m AMSL")
        step = points[1] - points[0]
        # A map course is the true course and this.
        turn = self.chart.convergence(float(lat), float(lon))
        course = math.atan2(step[0], step[1]) - turn
        slope = math.atan2(step[2], math.hypot(step[0], step[1]))
        # A speed or a first slope that the aircraft cannot hold is the verdict's business, not the start's: it starts
        # at the nearest speed it can, and level.
        aircraft = self.fdm.aircraft
        speed = min(aircraft.airspeed_max, max(aircraft.airspeed_min, float(self.speeds[0])))
        east_wind, north_wind = setup.scenario.wind.at(up)
        cos, sin = math.cos(turn), math.sin(turn)
        wind = (north_wind * cos + east_wind * sin, east_wind * cos - north_wind * sin, 0.0)
        ground = min(0.0, up - 1000.0) if math.isnan(under) else under
        trimmed = None
        for climb in (slope, 0.0):
            try:
                trimmed = self.fdm.start(float(lat), float(lon), up, course, speed, climb, wind, ground)
                break
            except FlightError as error:
                problem = error
        if trimmed is None:
            raise FlightError(f"{setup.mission.source}: {problem}") from problem
        self.commands[:] = trimmed.commands()
        self.arena.air[:2] = wind[:2]
        self.fdm.set_wind(0.0, 0.0, 0.0)
        self.fdm.set_gust(*wind)
        memory = self.memory
        memory[M.TRIM_ELEVATOR], memory[M.TRIM_ALPHA] = level.elevator, level.alpha
        memory[M.TRIM_THROTTLE] = (straight(model, speed, up) or level).throttle
        memory[M.LAST_AIRSPEED] = -1.0

    def block(self, count: int) -> tuple[Floats, str]:
        """Fly up to ``count`` ticks: their rows, and how the flight ended ("" while it goes on)."""
        parts: list[Floats] = []
        ended = ""
        size = len(self.arena.noise)
        while count > 0 and not ended:
            rows, ended = self._second(min(count, size))
            parts.append(rows)
            count -= size
        return (parts[0] if len(parts) == 1 else np.concatenate([np.empty((0, ROW)), *parts])), ended

    def _second(self, count: int) -> tuple[Floats, str]:
        """Do the same with as many ticks as the arena has room for."""
        noise, constants = self.arena.noise, self.arena.constants
        noise[:count, :3] = self.random.standard_normal((count, 3))
        if self.nav_random is not None:
            noise[:count, 3:] = self.nav_random.standard_normal((count, 3))
        left = self.most_ticks - int(constants[K.TICK])
        constants[K.ROW] = 0.0
        status = self._fly(min(count, left))
        rows = quantised(self.arena.rows[: int(constants[K.ROW])])
        if status:
            return rows, ENDS[status]
        if left <= count:
            return rows, f"time limit: not finished after {self.most_ticks * self.dt:.0f} s"
        return rows, ""

    def _linked(self, links: Links) -> Callable[[], int]:
        """Make what reads JSBSim, does a tick, sets JSBSim, and returns the tick's status."""
        arena, tables, heights = self.arena, self.arena.tables, self.terrain.heights
        arena.factors[:] = links.factors
        arena.scales[:] = links.scales.ravel()
        self._run = links.run
        # What is not set: gusts in still air, and ground that is not known.
        unset = [*(() if self.windy else GUST_SETTERS), *(() if self.terrain.known else (GROUND_SETTER,))]
        if links.nodes is not None:
            links.nodes[[STATE_SIZE + k for k in unset]] = 0
            linked = entry(linked_tick, arena.packed, tables, heights, links.nodes)
            return partial(linked, arena.packed, tables, heights, links.nodes)
        read, once = _reader(links, arena), entry(tick, arena.packed, tables, heights)
        setters = [(k, setter) for k, setter in enumerate(links.setters) if k not in unset]

        def step() -> int:
            read()
            status = once(arena.packed, tables, heights)
            if not status:
                values = arena.out.tolist()
                for k, setter in setters:
                    setter(values[k])
            return status

        return step

    def _fly(self, count: int) -> int:
        """Fly ``count`` ticks into the arena's rows; returns the last tick's status."""
        step, run, steps = self._step, self._run, (None,) * self.steps
        for _ in range(count):
            if status := step():
                return status
            for _ in steps:
                run()
        return 0


def _reader(links: Links, arena: Arena) -> Callable[[], None]:
    """Make a function that fills the arena's state, in JSBSim's units; time and winds are known without asking."""
    getters = links.getters[S.LATITUDE : S.WIND_NORTH]
    pack: Callable[..., None] = struct.Struct(f"{len(getters)}d").pack_into
    state = arena.state[S.LATITUDE : S.WIND_NORTH]
    return lambda: pack(state, 0, *[getter() for getter in getters])


def as_track(rows: Floats) -> Track:
    """Rows of `Flight.block`, (t, ROW), as a track."""
    values, at = [], 0
    for columns in COLUMNS.values():
        values.append(rows[:, at] if columns == 1 else rows[:, at : at + columns])
        at += columns
    return Track(*values)  # type: ignore[arg-type]  # Track gives each array its own type
