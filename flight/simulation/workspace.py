"""All that the compiled tick works on: one record, and one table of the path.

Each array that is passed to compiled code costs as much as a hundred sums.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight.ardupilot.law_memory import ARDUPILOT_MEMORY
from flight.ardupilot.parameters import ARDUPILOT_PARAMETERS
from flight.dynamics.state import COMMANDS, STATE
from flight.guidance.fly_by_path import FlyByPath
from flight.guidance.gains import GAINS, Gains
from flight.guidance.guidance_memory import GUIDANCE_MEMORY
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.guidance.navigation_error import MOTION, NAVIGATION_LAGS
from flight.guidance.path_kernels import NODE, PIECE, Records
from flight.simulation.dryden import GUST_FILTERS
from flight.simulation.track import TRACK_ROW
from world.frames import POLYMAP
from world.kernels import Record, field_names, record_dtype

Floats = NDArray[np.float64]

# What is read of JSBSim each tick: the state but for time and wind, which are known without asking.
READ_FIELDS = field_names(STATE)[: field_names(STATE).index("time")]
# Ticks that are flown at a time, at most.
BLOCK_TICKS = 60
# Mean wind and gust, true north, east and down; ground below; battery.
AIR = record_dtype(
    "wind_north",  # m/s, the way the air moves
    "wind_east",
    "gust_north",
    "gust_east",
    "gust_down",
    "ground",  # m, the last that was known
    "energy",  # Wh used
)
# What a tick finds where the aircraft is.
PLACE = record_dtype(
    "north_cos",  # of the map course of true north
    "north_sin",
    "ground",  # m AMSL, NaN where it is unknown
    "clearance",  # m above it
)
MEAN_WIND = record_dtype(
    "speed",  # m/s at the reference height
    "cos",  # of the map course that it blows to
    "sin",
    "gradient",  # 1/s
    "reference_amsl",  # m
    "w20",  # m/s, turbulence's wind at 20 ft
)
TIMING = record_dtype(
    ("tick", np.int64),  # ticks flown
    ("row", np.int64),  # row of the block that is filled next
    "dt",  # s
)
SETTINGS = record_dtype(
    "slowest",  # m/s, slower is a departure
    "battery",  # Wh; a flight that has used as much ends
    "navigation_sigma",  # m
    "navigation_time",  # s
    "middle",  # rad, longitude of the local map's middle
    ("pieces", np.int64),  # rows of the path's table that have one
    ("nodes", np.int64),
    ("waypoints", np.int64),
    ("on_last_leg", np.bool_),  # of a flight that another program steers, by its own account
)
# The i-th piece, node and waypoint of a path beside each other.
PATH_ROW = record_dtype(("piece", PIECE), ("node", NODE), ("waypoint", WAYPOINT))
# What is set in JSBSim after a tick.
OUTPUT = record_dtype(*field_names(COMMANDS), "gust_north", "gust_east", "gust_down", "ground")
# Unit normals of a tick.
NOISE = record_dtype(("turbulence", np.float64, (3,)), ("navigation", np.float64, (3,)))
WORKSPACE = record_dtype(
    ("state", STATE),
    ("state_factors", STATE),  # take what JSBSim gives to SI
    ("true", MOTION),
    ("estimated", MOTION),
    ("commands", COMMANDS),
    ("air", AIR),
    ("place", PLACE),
    ("wind", MEAN_WIND),
    ("gusts", GUST_FILTERS),
    ("navigation", NAVIGATION_LAGS),
    ("memory", GUIDANCE_MEMORY),
    ("gains", GAINS),
    ("ardupilot", ARDUPILOT_MEMORY),
    ("parameters", ARDUPILOT_PARAMETERS),
    ("timing", TIMING),
    ("settings", SETTINGS),
    ("position_map", POLYMAP),  # latitude and longitude to east and north
    ("north_map", POLYMAP),  # latitude and longitude to the map course of true north
    ("pixel_map", POLYMAP),  # east and north to column and row of the terrain
    ("output", OUTPUT),  # in JSBSim's units
    ("scale_above", OUTPUT),  # take an SI value above zero to JSBSim's
    ("scale_below", OUTPUT),  # and one that is not
    ("noise", NOISE, (BLOCK_TICKS,)),
    ("rows", TRACK_ROW, (BLOCK_TICKS,)),
)
# As many float64 as it takes the place of.
WORKSPACE_NUMBERS = WORKSPACE.itemsize // 8


class Workspace:
    """One flight's record and path, in one block of memory, and plain views of what passes to and from JSBSim.

    block: (n,) numbers, the workspace's and then the path's, for compiled code.
    array: (1,) of `WORKSPACE`, for compiled code.
    record: its one record, for Python.
    path: of `PATH_ROW`, as many as there are pieces, nodes or waypoints.
    readings: (n,) the state's `READ_FIELDS`.
    output: (n,) the fields of `OUTPUT`.
    commands: (4,) the fields of `flight.dynamics.state.COMMANDS`.
    on_last_leg: (1,) of the workspace's settings.
    ticks_flown, rows_filled: (1,) of the workspace's timing.
    turbulence, navigation: (BLOCK_TICKS, 3) the noise of each.
    rows: (BLOCK_TICKS,) of the track.
    """

    def __init__(self, gains: Gains, path: FlyByPath, waypoints: Records) -> None:
        parts = {"piece": path.pieces, "node": path.nodes, "waypoint": waypoints}
        rows_of_path = max(map(len, parts.values()))
        self.block: Floats = np.zeros(WORKSPACE_NUMBERS + rows_of_path * PATH_ROW.itemsize // 8)
        self.array: Records = self.block[:WORKSPACE_NUMBERS].view(WORKSPACE)
        self.path: Records = self.block[WORKSPACE_NUMBERS:].view(PATH_ROW)
        self.record: Record = self.array[0]
        self.record.gains = gains.record()
        for name, rows in parts.items():
            self.path[name][: len(rows)] = rows
            setattr(self.record.settings, f"{name}s", len(rows))
        self.readings = self._numbers("state", len(READ_FIELDS))
        self.output = self._numbers("output", len(field_names(OUTPUT)))
        self.commands = self._numbers("commands", len(field_names(COMMANDS)))
        self._true, self._estimated = (self._numbers(name, len(field_names(MOTION))) for name in ("true", "estimated"))
        # Made once: numpy takes microseconds for each field of a record that Python asks for.
        self.ticks_flown: NDArray[np.int64] = self.array["timing"]["tick"]
        self.rows_filled: NDArray[np.int64] = self.array["timing"]["row"]
        self.on_last_leg: NDArray[np.bool_] = self.array["settings"]["on_last_leg"]
        self.turbulence: Floats = self.array["noise"]["turbulence"][0]
        self.navigation: Floats = self.array["noise"]["navigation"][0]
        self.rows: Records = self.array["rows"][0]

    def navigation_error(self) -> list[float]:
        """The estimated motion less the true one: the fields of `flight.guidance.navigation_error.MOTION`."""
        error: list[float] = (self._estimated - self._true).tolist()
        return error

    def _numbers(self, field: str, count: int) -> Floats:
        """The first numbers of a field, as an array that shares its memory."""
        fields: Any = WORKSPACE.fields
        return np.frombuffer(self.array, np.float64, count, fields[field][1])
