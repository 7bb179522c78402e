"""What the compiled judges are given: a scenario and its limits as numbers and arrays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.cells import Cells

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]

# Reach beside a leg that is looked into for missiles, m: what the arcs that cut its corners may use of it.
CORNER_SLACK = 30.0


class Rules(NamedTuple):
    """What paths are judged against, in the form that the compiled functions take.

    threats: (m, 7) east, north, up, kill radius and scale, detection radius and scale.  aircraft: packed limits.
    max_turn: rad.  room: whether a leg must hold its turns.  fly_over: whether a
    turn begins at its waypoint, not before it.  climb, dive: rad, NaN to ask the aircraft.
    spare: rad kept inside slope limits.  clearance, reserve: m, required and kept on top.  kill_margin: m.
    pitch: m between terrain samples of the graded judge.
    start_course, destination_course: rad or NaN.  start_slack, destination_slack: m of reserve at the ends.
    near: the threats that may reach a point.  missiles: those whose missile, the margin added, may reach a stretch of
    path as long as a cell, and `CORNER_SLACK` m beside it.  steepest: of the ground, m per m.
    """

    heights: Heights
    to_pixel: Floats
    threats: Floats
    aircraft: Floats
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
    missiles: Cells
    steepest: float
