"""The flight: JSBSim under guidance along a route, over its terrain, until its end or its failure."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft
from aircraft.compiled import compiled
from flight.chart import Chart, Ground
from flight.fdm import Fdm, Variation
from flight.gains import load_gains
from flight.guidance import MEMORY_SIZE, M, guide
from flight.path import FlyByPath, fly_by_path
from flight.setup import FlightSetup, limits_of
from flight.state import COMMAND_SIZE, STATE_SIZE, C, S
from flight.track import COLUMNS, Track, join_tracks
from flight.trim import straight
from flight.turbulence import GUST_STATES, start_gusts, step_gusts
from world.errors import FlightError
from world.frames import polymap, to_geo
from world.geometry import wrap
from world.streams import TURBULENCE, stream
from world.terrain import Heights, ground_height
from world.wind import W20

Floats = NDArray[np.float64]
Progress = Callable[[float, float], None]
Sink = Callable[[Track], None]

FDM_HZ = 120.0
STEPS_A_TICK = 2
TICK = STEPS_A_TICK / FDM_HZ
# Rows that are handed on at a time, s of flight.
BLOCK = 1.0
# Bank that guidance may add to the planned turns' to correct an error, rad.
BANK_RESERVE = math.radians(2.5)
STEEPEST_BANK = math.radians(75.0)
# A flight may take this much longer than its length over its slowest ground speed, s on top.
PATIENCE = 1.5
PATIENCE_SECONDS = 60.0
ROW = sum(COLUMNS.values())

_ENDS = {
    1: "completed",
    2: "departure: the state is not a number",
    3: "ground contact",
    4: "departure: bank beyond 75 degrees",
    5: "departure: airspeed below the stall",
}


@dataclass(frozen=True, slots=True)
class Flown:
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
) -> Flown:
    """Fly a setup from a trimmed start.  The same setup gives the same track, bit for bit.

    sink: is handed each second of the track as it is flown.  progress: is told the distance flown and the whole, m.
    variation: an aircraft that differs from its model, which guidance knows nothing of: for robustness.
    Raises FlightError for a flight that cannot start.
    """
    flight = Flight(setup, aircraft, variation)
    blocks: list[Track] = []
    ended = ""
    while not ended:
        rows, ended = flight.block(round(BLOCK / TICK))
        if len(rows):
            block = as_track(rows)
            blocks.append(block)
            if sink is not None:
                sink(block)
        if progress is not None:
            progress(min(flight.memory[M.DISTANCE], flight.path.length), flight.path.length)
    return Flown(join_tracks(blocks), ended, flight.path)


class Flight:
    """One flight in progress, advanced by `block`: `simulate` in one go, the live vehicle in step with a clock."""

    def __init__(self, setup: FlightSetup, aircraft: Aircraft, variation: Variation | None = None) -> None:
        scenario, limits = setup.scenario, limits_of(setup)
        self.path = fly_by_path(setup.route, limits)
        self.speeds = setup.route.airspeed
        gains = load_gains(aircraft)
        self.gains = gains.packed()
        self.terrain = Ground(scenario.terrain)
        self.chart = Chart.around(setup)
        wind = scenario.wind
        self.wind = np.array(
            [wind.speed, wind.from_course + math.pi, wind.gradient, wind.reference_amsl, W20[wind.turbulence]]
        )
        braking = scenario.flight.motor_braking
        self.fdm = Fdm(aircraft, rate_hz=FDM_HZ, motor_braking=braking, variation=variation)
        self.state, self.commands = np.zeros(STATE_SIZE), np.zeros(COMMAND_SIZE)
        # What one tick leaves for the next: wind, gusts, ground and energy, see `_tick`.
        self.air = np.zeros(7)
        self.memory = np.zeros(MEMORY_SIZE)
        self.memory[M.MAX_BANK] = limits.max_bank + BANK_RESERVE
        # Guidance knows the model; it is not told how the aircraft differs from it.
        self._start(setup, gains.reference_airspeed, Fdm(aircraft, rate_hz=FDM_HZ, motor_braking=braking))
        seed = wind.seed if wind.seed is not None else setup.seed
        self.random = stream(seed, TURBULENCE)
        self.gusts = np.zeros(GUST_STATES)
        start_gusts(self.random.standard_normal(GUST_STATES), self.gusts)
        self.slowest = 0.94 * aircraft.stall_speed
        self.ticks = 0
        slow = max(5.0, float(self.speeds.min()) - wind.speed)
        self.most_ticks = int((PATIENCE * self.path.length / slow + PATIENCE_SECONDS) / TICK)

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
        ground = 0.0 if math.isnan(under) else under
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
        memory = self.memory
        memory[M.TRIM_ELEVATOR], memory[M.TRIM_ALPHA] = level.elevator, level.alpha
        memory[M.TRIM_THROTTLE] = (straight(model, speed, up) or level).throttle
        memory[M.LAST_AIRSPEED] = -1.0

    def block(self, count: int) -> tuple[Floats, str]:
        """Fly up to ``count`` ticks: their rows, and how the flight ended ("" while it goes on)."""
        rows = np.zeros((count, ROW))
        noise = self.random.standard_normal((count, 3))
        fdm, state, commands, memory = self.fdm, self.state, self.commands, self.memory
        chart, ground = self.chart, self.terrain
        pieces, nodes = self.path.pieces, self.path.nodes
        air = self.air
        for k in range(count):
            fdm.read(state)
            status = _tick(
                state, chart.position.packed, chart.angle.packed, ground.heights, ground.packed, pieces, nodes,
                self.speeds, self.gains, memory, commands, self.wind, self.gusts, noise[k], self.slowest,
                self.ticks * TICK, rows[k], air,
            )  # fmt: skip
            if status == 2:
                return rows[:k], _ENDS[2]
            if status:
                return rows[: k + 1], _ENDS[status]
            self.ticks += 1
            if self.ticks >= self.most_ticks:
                return rows[: k + 1], f"time limit: not finished after {self.ticks * TICK:.0f} s"
            fdm.write(commands)
            fdm.set_wind(air[0], air[1], 0.0)
            fdm.set_gust(air[2], air[3], air[4])
            if ground.known:
                fdm.set_terrain(air[5])
            fdm.step(STEPS_A_TICK)
        return rows, ""


def as_track(rows: Floats) -> Track:
    """Rows of `Flight.block`, (t, ROW), as a track."""
    values, at = [], 0
    for columns in COLUMNS.values():
        values.append(rows[:, at] if columns == 1 else rows[:, at : at + columns])
        at += columns
    return Track(*values)  # type: ignore[arg-type]  # Track gives each array its own type


@compiled
def _tick(
    state: Floats, position: Floats, angle: Floats, heights: Heights, to_pixel: Floats, pieces: Floats, nodes: Floats,
    speeds: Floats, gains: Floats, memory: Floats, commands: Floats, wind: Floats, gusts: Floats, noise: Floats,
    slowest: float, time: float, row: Floats, air: Floats,
) -> int:  # pragma: no cover - compiled  # fmt: skip
    """Judge the state, guide, make the wind for the next tick, and fill a row of the track.

    air: (7,) wind north and east, gust north, east and down (m/s), ground below (m, the last that was known), energy
    used (Wh).
    Returns a key of `_ENDS`, or 0 to fly on.
    """
    for value in state:
        if not math.isfinite(value):
            return 2
    east, north = polymap(position, state[S.LATITUDE], state[S.LONGITUDE])
    turn, _ = polymap(angle, state[S.LATITUDE], state[S.LONGITUDE])
    cos, sin = math.cos(turn), math.sin(turn)
    up = state[S.AMSL]
    place = np.array([
        east, north, up,
        state[S.V_EAST] * cos + state[S.V_NORTH] * sin,
        state[S.V_NORTH] * cos - state[S.V_EAST] * sin,
    ])  # fmt: skip
    state[S.YAW] = wrap(state[S.YAW] + turn)
    ground = ground_height(heights, to_pixel, east, north)
    clearance = up - ground
    guide(state, place, pieces, nodes, speeds, gains, memory, commands, TICK)
    _wind(state, wind, gusts, noise, clearance, up, turn, air)
    air[5] = ground if not math.isnan(ground) else air[5]
    air[6] += state[S.POWER] * TICK / 3600.0
    _fill(row, state, place, commands, memory, time, air[6], clearance, cos, sin)
    if clearance <= 0.0:
        return 3
    if abs(state[S.ROLL]) > STEEPEST_BANK:
        return 4
    if state[S.AIRSPEED] < slowest:
        return 5
    return 1 if memory[M.DONE] > 0.0 else 0


@compiled
def _wind(
    state: Floats, wind: Floats, gusts: Floats, noise: Floats, clearance: float, up: float, turn: float, air: Floats
) -> None:  # pragma: no cover - compiled
    """Mean wind at this height and the next gust, true north, east and down, into ``air``.

    wind: speed, map course it blows to, gradient, reference height, w20.  turn: map course of true north, rad.
    """
    speed = max(0.0, wind[0] + wind[2] * (up - wind[3]))
    cos, sin = math.cos(wind[1] - turn), math.sin(wind[1] - turn)
    air[0], air[1] = speed * cos, speed * sin
    air[2] = air[3] = air[4] = 0.0
    if wind[4] > 0.0:
        # Over unknown ground the scales of 300 m and above hold.
        height = clearance if not math.isnan(clearance) else 1000.0
        along, across, down = step_gusts(gusts, noise, wind[4], height, state[S.AIRSPEED], TICK)
        air[2] = along * cos - across * sin
        air[3] = along * sin + across * cos
        air[4] = down


@compiled
def _fill(
    row: Floats, state: Floats, place: Floats, commands: Floats, memory: Floats, time: float, energy: float,
    clearance: float, cos: float, sin: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """One row of the track, in the order of `flight.track.COLUMNS`."""
    row[0] = time
    row[1:4] = place[:3]
    row[4:6] = place[3:5]
    row[6] = -state[S.V_DOWN]
    row[7:10] = state[S.ROLL : S.YAW + 1]
    row[10:13] = state[S.P : S.R + 1]
    row[13] = state[S.AIRSPEED]
    row[14:16] = state[S.ALPHA : S.BETA + 1]
    row[16:20] = state[S.ELEVATOR : S.THROTTLE + 1]
    row[20:24] = commands[C.ELEVATOR : C.THROTTLE + 1]
    row[24] = state[S.WIND_EAST] * cos + state[S.WIND_NORTH] * sin
    row[25] = state[S.WIND_NORTH] * cos - state[S.WIND_EAST] * sin
    row[26] = -state[S.WIND_DOWN]
    row[27] = state[S.ACCEL_N]
    row[28] = state[S.CURRENT]
    row[29] = energy
    row[30] = memory[M.LEG]
    row[31] = memory[M.CROSS_TRACK]
    row[32] = memory[M.HEIGHT_ERROR]
    row[33] = memory[M.SPEED_COMMAND]
    row[34] = clearance
