"""What compiled code evaluates paths with: a scenario and its limits as numbers and arrays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import PerformanceTable
from planner.airspace.airspace_arrays import KeptAirspace
from planner.evaluation.missile_index import MissileIndex
from planner.evaluation.threat_grid import ThreatCells
from planner.plan import Objective, Violation
from world.frames import PolyMapRecord
from world.kernels import Record, Records
from world.threats import Threats

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]

# One unit of the scenario: its position (m), and radius and scale (m) of its missile and its radar.
THREAT = np.dtype(
    [
        (name, np.float64)
        for name in ("east", "north", "up", "kill_radius", "kill_scale", "detection_radius", "detection_scale")
    ]
)
# A unit as a point is compared with it: its position (m), radii to the power of two, scales to the power of four, and
# what makes the record as long as a line of the processor's cache.
SPHERE = np.dtype(
    [
        (name, np.float64)
        for name in ("east", "north", "up", "kill_radius2", "kill_scale4", "detection_radius2", "detection_scale4")
    ]
    + [("padding", np.float64)]
)
# What is found of one path, by the names of `Violation` and `Objective` and in their order.
VIOLATIONS = np.dtype([(item.name.lower(), np.float64) for item in Violation])
OBJECTIVES = np.dtype([(item.name.lower(), np.float64) for item in Objective])


class SlopeBounds(NamedTuple):
    """How steep the ground is at most, m per m.

    steepest: anywhere.
    tiles: within `tile_side` m of each tile of `world.terrain.TILE` pixels a side.
    """

    steepest: float
    tiles: Heights
    tile_side: float


class ProblemArrays(NamedTuple):
    """What paths are evaluated against; lengths in m, angles in rad.

    heights: raster of the ground.
    to_pixel: map from positions to its pixels.
    threats: `THREAT` records (m,).
    spheres: `SPHERE` records (m,), each of the threat with its number.
    aircraft: what it can do, of which turbulence leaves a plan a share.
    west, east, south, north: edges of the map; floor and ceiling: lowest and highest waypoint.
    start, destination: (3,) fixed ends.
    max_turn: largest course change.
    legs_hold_turns: whether a leg must be as long as its turns.
    fly_over: whether a turn begins at its waypoint, not before it.
    max_climb, max_dive: NaN to ask the aircraft.
    angle_margin: kept inside slope limits.
    clearance: required above ground; buffer: wanted on top of it, and start_buffer and destination_buffer at the ends.
    kill_margin: wanted between path and missile spheres.
    sample_pitch: between samples of the terrain along a leg, of the graded scores.
    start_course, destination_course: NaN where none is asked for.
    threat_cells: the threats by the points that they may reach.
    missiles: the missiles by where they stand.
    slope_bounds: of the ground.
    tracking: a record of `aircraft.tracking.TRACKING`: how far the autopilot strays from its legs.
    airspace: zones, and the greatest height above ground.
    """

    heights: Heights
    to_pixel: PolyMapRecord
    threats: Records
    spheres: Records
    aircraft: PerformanceTable
    west: float
    east: float
    south: float
    north: float
    start: Floats
    destination: Floats
    floor: float
    ceiling: float
    max_turn: float
    legs_hold_turns: bool
    fly_over: bool
    max_climb: float
    max_dive: float
    angle_margin: float
    clearance: float
    buffer: float
    kill_margin: float
    sample_pitch: float
    start_course: float
    destination_course: float
    start_buffer: float
    destination_buffer: float
    threat_cells: ThreatCells
    missiles: MissileIndex
    slope_bounds: SlopeBounds
    tracking: Record
    airspace: KeptAirspace


def threat_records(threats: Threats) -> Records:
    """Units of a scenario as `THREAT` records (m,)."""
    out = np.zeros(len(threats.position), dtype=THREAT)
    for axis, name in enumerate(("east", "north", "up")):
        out[name] = threats.position[:, axis]
    for name in ("kill_radius", "kill_scale", "detection_radius", "detection_scale"):
        out[name] = getattr(threats, name)
    out.setflags(write=False)
    return out


def sphere_records(threats: Records) -> Records:
    """`SPHERE` records (m,) of `THREAT` records."""
    out = np.zeros(len(threats), dtype=SPHERE)
    for name in ("east", "north", "up"):
        out[name] = threats[name]
    for kind in ("kill", "detection"):
        radius = threats[f"{kind}_radius"]
        # A radius of 0 is no weapon, and no square is below this.
        out[f"{kind}_radius2"] = np.where(radius > 0.0, radius * radius, -1.0)
        out[f"{kind}_scale4"] = threats[f"{kind}_scale"] ** 4
    out.setflags(write=False)
    return out


def as_columns(records: Records) -> Floats:
    """Records (n,) whose fields are all float64 as a table (n, fields)."""
    return records.view(np.float64).reshape(len(records), -1)
