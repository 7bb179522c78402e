"""One tick of the compiled loop: judge the state, navigate, guide, make the wind, fill a row of the track."""

import math

import numpy as np
from numpy.typing import NDArray

from flight.dynamics.nodes import get_node, set_node
from flight.dynamics.state import STATE_SIZE, C, S
from flight.guidance.lateral import guide
from flight.guidance.navigation_error import navigate
from flight.guidance.rows import M
from flight.simulation import workspace as at
from flight.simulation.dryden import step_gusts
from flight.simulation.workspace import NOISE_SIZE, ROW, K, Table
from world.frames import polymap_within
from world.geometry import wrap
from world.kernels import compiled, compiled_views
from world.terrain import Heights, pixel_height
from world.wind import mean_wind_speed

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STEEPEST_BANK = math.radians(75.0)
# What `tick` returns, and how the flight ended by then.
COMPLETED, NOT_A_NUMBER, GROUND, BANKED, STALLED, MISSED = 1, 2, 3, 4, 5, 6
# A flight that passes the end of its route further than this from it, m, has missed it.
FAR = 100.0
ENDS = {
    COMPLETED: "completed",
    NOT_A_NUMBER: "departure: the state is not a number",
    GROUND: "ground contact",
    BANKED: "departure: bank beyond 75 degrees",
    STALLED: "departure: airspeed below the stall",
    MISSED: "missed: passed the end of the route more than 100 m from it",
}
_STATE, _COMMANDS, _FACTORS, _PLACE, _SEEN = at.STATE, at.COMMANDS, at.FACTORS, at.PLACE, at.SEEN
_AIR, _WIND, _GUSTS, _NAV, _MEMORY = at.AIR, at.WIND, at.GUSTS, at.NAV, at.MEMORY
_GAINS, _CONSTANTS, _LAYOUT = at.GAINS, at.CONSTANTS, at.LAYOUT
_OUT, _OUT_SIZE, _SCALES, _NOISE = at.OUT, at.OUT_SIZE, at.SCALES, at.NOISE
# Rows of the state that JSBSim gives; time and winds are known without asking.
_FIRST, _LAST = int(S.LATITUDE), int(S.ACCEL_N)


@compiled_views
def _map(
    arena: Floats, tables: Floats, name: int, x: float, y: float
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Both components of one of the polynomial maps."""
    rows = tables[_start(arena, name) : _end(arena, name)]
    return polymap_within(rows, int(arena[_LAYOUT + 3 * name + 2]), x, y)


@compiled
def _start(arena: Floats, name: int) -> int:  # pragma: no cover - compiled
    """First row of a table; a function that gave the rows themselves would have to count references to them."""
    return int(arena[_LAYOUT + 3 * name])


@compiled
def _end(arena: Floats, name: int) -> int:  # pragma: no cover - compiled
    """Row after the last of a table."""
    return int(arena[_LAYOUT + 3 * name + 1])


@compiled_views
def linked_tick(arena: Floats, tables: Floats, heights: Heights, nodes: Ints) -> int:  # pragma: no cover - compiled
    """Read JSBSim, do `tick`, and set JSBSim unless the flight has ended.

    nodes: (STATE_SIZE + OUT_SIZE,) addresses of what is read and set, 0 for none, as `flight.dynamics.nodes.addresses`
    gives.
    """
    for i in range(_FIRST, _LAST + 1):
        arena[_STATE + i] = get_node(nodes[i]) if nodes[i] != 0 else 0.0
    status = tick(arena, tables, heights)
    if status == 0:
        for i in range(_OUT_SIZE):
            if nodes[STATE_SIZE + i] != 0:
                set_node(nodes[STATE_SIZE + i], arena[_OUT + i])
    return status


@compiled_views
def tick(arena: Floats, tables: Floats, heights: Heights) -> int:  # pragma: no cover - compiled
    """Take the state as JSBSim gave it, in its units; return a key of `ENDS` or 0 to fly on.

    What to set in JSBSim, in its units, stands in the arena's `out`.

    arena, tables: `flight.simulation.workspace`.  heights: of the terrain.
    """
    state, memory = arena[_STATE:_COMMANDS], arena[_MEMORY:_GAINS]
    commands, place, seen = arena[_COMMANDS:_FACTORS], arena[_PLACE:_SEEN], arena[_SEEN:_AIR]
    air, constants = arena[_AIR:_WIND], arena[_CONSTANTS:_LAYOUT]
    total = 0.0
    for i in range(state.size):
        state[i] *= arena[_FACTORS + i]
        total += state[i] * 0.0
    if total != 0.0:  # any NaN or infinity
        return NOT_A_NUMBER
    state[S.WIND_NORTH], state[S.WIND_EAST], state[S.WIND_DOWN] = air[0] + air[2], air[1] + air[3], air[4]
    dt, k = constants[K.DT], int(constants[K.ROW])
    # About the chart's middle, so that a flight may cross the 180th meridian.
    middle = constants[K.LONGITUDE]
    state[S.LONGITUDE] = middle + wrap(state[S.LONGITUDE] - middle)
    place[0], place[1] = _map(arena, tables, Table.POSITION, state[S.LATITUDE], state[S.LONGITUDE])
    place[2] = state[S.AMSL]
    # Map course of true north.
    turn, _ = _map(arena, tables, Table.ANGLE, state[S.LATITUDE], state[S.LONGITUDE])
    cos, sin = math.cos(turn), math.sin(turn)
    east = state[S.V_EAST] * cos + state[S.V_NORTH] * sin
    place[3], place[4], place[5] = east, state[S.V_NORTH] * cos - state[S.V_EAST] * sin, -state[S.V_DOWN]
    state[S.YAW] = wrap(state[S.YAW] + turn)
    col, row = _map(arena, tables, Table.TO_PIXEL, place[0], place[1])
    ground = pixel_height(heights, col, row)
    clearance = place[2] - ground
    noise = arena[_NOISE + NOISE_SIZE * k : _NOISE + NOISE_SIZE * (k + 1)]
    navigate(place, seen, arena[_NAV:_MEMORY], noise[3:], constants[K.NAV_SIGMA], constants[K.NAV_TIME], dt)
    guide(
        state, seen, tables[_start(arena, Table.PIECES) : _end(arena, Table.PIECES)],
        tables[_start(arena, Table.NODES) : _end(arena, Table.NODES)],
        tables[_start(arena, Table.CORNERS) : _end(arena, Table.CORNERS)],
        tables[_start(arena, Table.SPEEDS) : _end(arena, Table.SPEEDS), 0],
        arena[_GAINS:_CONSTANTS], memory, commands, dt,
    )  # fmt: skip
    _blow(state, arena[_WIND:_GUSTS], arena[_GUSTS:_NAV], noise, clearance, place[2], cos, sin, air, dt)
    air[5] = ground if not math.isnan(ground) else air[5]
    air[6] += state[S.POWER] * dt / 3600.0
    start = int(constants[K.ROWS]) + ROW * k
    _fill(
        arena[start : start + ROW], state, place, commands, memory, constants[K.TICK] * dt, air[6], clearance, cos, sin
    )
    constants[K.TICK] += 1.0
    constants[K.ROW] += 1.0
    status = 0
    if memory[M.DONE] > 0.0:
        near = abs(memory[M.CROSS_TRACK]) <= FAR and abs(memory[M.HEIGHT_ERROR]) <= FAR
        status = COMPLETED if near else MISSED
    if clearance <= 0.0:
        status = GROUND
    elif abs(state[S.ROLL]) > STEEPEST_BANK:
        status = BANKED
    elif state[S.AIRSPEED] < constants[K.SLOWEST]:
        status = STALLED
    out = arena[_OUT:_SCALES]
    for i in range(4):
        out[i] = commands[i]
    out[4], out[5], out[6], out[7] = air[0] + air[2], air[1] + air[3], air[4], air[5]
    for i in range(_OUT_SIZE):
        out[i] *= arena[_SCALES + 2 * i + (0 if out[i] > 0.0 else 1)]
    return status


@compiled
def _blow(
    state: Floats, wind: Floats, gusts: Floats, noise: Floats, clearance: float, up: float, turn_cos: float,
    turn_sin: float, air: Floats, dt: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Mean wind at this height and the next gust, true north, east and down, into ``air``.

    wind: speed, the cosine and sine of the map course it blows to, gradient, reference height, w20.
    """
    speed = mean_wind_speed(wind[0], wind[3], wind[4], up)
    # The angle less the map course of true north.
    cos = wind[1] * turn_cos + wind[2] * turn_sin
    sin = wind[2] * turn_cos - wind[1] * turn_sin
    air[0], air[1] = speed * cos, speed * sin
    if wind[5] > 0.0:
        # Over unknown ground the scales of 300 m and above hold.
        height = clearance if not math.isnan(clearance) else 1000.0
        along, across, down = step_gusts(gusts, noise, wind[5], height, state[S.AIRSPEED], dt)
        air[2] = along * cos - across * sin
        air[3] = along * sin + across * cos
        air[4] = down


@compiled
def _fill(
    row: Floats, state: Floats, place: Floats, commands: Floats, memory: Floats, time: float, energy: float,
    clearance: float, cos: float, sin: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """One row of the track, in the order of `flight.simulation.track.COLUMNS`."""
    # Element by element: assigning a slice checks shapes.
    row[0] = time
    for i in range(3):
        row[1 + i] = place[i]
        row[7 + i] = state[S.ROLL + i]
        row[10 + i] = state[S.P + i]
    row[4], row[5], row[6] = place[3], place[4], place[5]
    row[13], row[14], row[15] = state[S.AIRSPEED], state[S.ALPHA], state[S.BETA]
    for i in range(4):
        row[16 + i] = state[S.ELEVATOR + i]
        row[20 + i] = commands[C.ELEVATOR + i]
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
