"""All that the compiled tick works on, in two arrays: passing an array to compiled code costs more than most sums.

One array holds what changes, at fixed places; the other the tables of a flight, below each other, all as wide as the
widest.
"""

from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flight.dynamics.state import COMMAND_SIZE, STATE_SIZE
from flight.guidance.gains import Gains
from flight.guidance.navigation_error import NAV_STATES
from flight.guidance.rows import G, M
from flight.simulation.dryden import GUST_STATES
from flight.simulation.track import COLUMNS

Floats = NDArray[np.float64]

# One row of a track.
ROW: Final = sum(COLUMNS.values())
PLACE_SIZE: Final = 6
# Wind north and east, gust north, east and down (m/s, true axes), ground below (m), energy used (Wh).
AIR_SIZE: Final = 7
# Speed, cosine and sine of the map course it blows to, gradient, reference height, W20.
WIND_SIZE: Final = 6


class K(IntEnum):
    """Rows of the constants and counters of a flight."""

    TICK = 0  # ticks flown
    DT = 1  # s
    SLOWEST = 2  # m/s, slower is a departure
    ROW = 3  # row of the block that is filled next
    NAV_SIGMA = 4  # m
    NAV_TIME = 5  # s
    ROWS = 6  # where the rows of a block start in the arena
    LONGITUDE = 7  # rad, the chart's middle


class Table(IntEnum):
    """Tables of a flight: each has its first row, the row after its last and its columns in the layout."""

    POSITION = 0
    ANGLE = 1
    TO_PIXEL = 2
    PIECES = 3
    NODES = 4
    CORNERS = 5
    SPEEDS = 6


# Where the fixed parts start.
STATE: Final = 0
COMMANDS: Final = STATE + STATE_SIZE
FACTORS: Final = COMMANDS + COMMAND_SIZE
PLACE: Final = FACTORS + STATE_SIZE
SEEN: Final = PLACE + PLACE_SIZE
AIR: Final = SEEN + PLACE_SIZE
WIND: Final = AIR + AIR_SIZE
GUSTS: Final = WIND + WIND_SIZE
NAV: Final = GUSTS + GUST_STATES
MEMORY: Final = NAV + NAV_STATES
GAINS: Final = MEMORY + len(M)
CONSTANTS: Final = GAINS + len(G)
LAYOUT: Final = CONSTANTS + len(K)
# What is set in JSBSim: commands, gusts north, east and down, the ground's height; SI here, then times its scale.
OUT: Final = LAYOUT + 3 * len(Table)
OUT_SIZE: Final = COMMAND_SIZE + 4
SCALES: Final = OUT + OUT_SIZE
NOISE: Final = SCALES + 2 * OUT_SIZE
# Turbulence's and navigation's, each tick.
NOISE_SIZE: Final = 6


class Arena:
    """The arrays and named views into them.

    block: ticks that are flown at a time; `noise` (block, 6) and `rows` (block, ROW) hold one block.  tables: one
    two-dimensional array for each of `Table`, copied into `tables`.
    """

    def __init__(self, gains: Gains, block: int, tables: dict[Table, Floats]) -> None:
        rows = NOISE + NOISE_SIZE * block
        self.packed: Floats = np.zeros(rows + ROW * block)
        self.packed[GAINS:CONSTANTS] = gains.packed()
        self.packed[CONSTANTS + K.ROWS] = rows
        self.tables: Floats = np.zeros(
            (sum(map(len, tables.values())), max(table.shape[1] for table in tables.values()))
        )
        at = 0
        for name, table in tables.items():
            end = at + len(table)
            self.tables[at:end, : table.shape[1]] = table
            self.packed[LAYOUT + 3 * name : LAYOUT + 3 * name + 3] = at, end, table.shape[1]
            at = end
        self.state = self.packed[STATE:COMMANDS]
        self.commands = self.packed[COMMANDS:FACTORS]
        self.factors = self.packed[FACTORS:PLACE]
        self.air = self.packed[AIR:WIND]
        self.wind = self.packed[WIND:GUSTS]
        self.gusts = self.packed[GUSTS:NAV]
        self.nav = self.packed[NAV:MEMORY]
        self.memory = self.packed[MEMORY:GAINS]
        self.constants = self.packed[CONSTANTS:LAYOUT]
        self.out = self.packed[OUT:SCALES]
        self.scales = self.packed[SCALES:NOISE]
        self.noise = self.packed[NOISE:rows].reshape(block, NOISE_SIZE)
        self.rows = self.packed[rows:].reshape(block, ROW)
