"""What the compiled judges are given: a scenario and its limits as numbers and arrays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import PerformanceTable
from planner.evaluation.missile_index import Missiles
from planner.evaluation.threat_grid import Cells
from world.frames import PolyMapRecord

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]

# A corner that a flight takes further from the legs than this (m) is judged in any case.
CORNER_SLACK = 30.0
# Numbers of a row of `Rules.spheres`: as long as a line of the processor's cache.
SPHERE = 8


class Steep(NamedTuple):
    """How steep the ground is, m per m: nowhere more than `most`, and within `reach` m of tile i, j than slopes[i, j].

    Tiles are of `world.terrain.TILE` pixels a side.
    """

    most: float
    slopes: Heights
    reach: float


class Rules(NamedTuple):
    """What paths are judged against, in the form that the compiled functions take.

    threats: (m, 7) east, north, up, kill radius and scale, detection radius and scale.  spheres: the same, of
    `pack_spheres`.  aircraft: what it can do.
    max_turn: rad.  room: whether a leg must hold its turns.  fly_over: whether a
    turn begins at its waypoint, not before it.  climb, dive: rad, NaN to ask the aircraft.
    spare: rad kept inside slope limits.  clearance, reserve: m, required and kept on top.  kill_margin: m.
    pitch: m between terrain samples of the graded judge.
    start_course, destination_course: rad or NaN.  start_slack, destination_slack: m of reserve at the ends.
    near: the threats by the points that they may reach.  missiles: the missiles by where they stand.  steep: how steep
    the ground is.
    """

    heights: Heights
    to_pixel: PolyMapRecord
    threats: Floats
    spheres: Floats
    aircraft: PerformanceTable
    bounds: Floats
    start: Floats
    destination: Floats
    floor: float
    ceiling: float
    max_turn: float
    room: bool
    fly_over: bool
    climb: float
    dive: float
    spare: float
    clearance: float
    reserve: float
    kill_margin: float
    pitch: float
    start_course: float
    destination_course: float
    start_slack: float
    destination_slack: float
    near: Cells
    missiles: Missiles
    steep: Steep


def pack_spheres(threats: Floats) -> Floats:
    """Threats (m, 7) as a point is compared with them, (m, 8): place, r^2 and scale^4 of missile and radar, and 0."""
    out = np.zeros((len(threats), SPHERE))
    out[:, :3] = threats[:, :3]
    for column in (3, 5):
        radius = threats[:, column]
        # A radius of 0 is no weapon, and no square is below this.
        out[:, column] = np.where(radius > 0.0, radius * radius, -1.0)
        out[:, column + 1] = threats[:, column + 1] ** 4
    out.setflags(write=False)
    return out
