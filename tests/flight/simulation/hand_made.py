"""A workspace for a straight path to the north, with maps so simple that every number in it is known."""

import math

import numpy as np

from flight.guidance.gains import Gains
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.guidance.path import NODE, PIECE, FlyByPath
from flight.simulation.tick import Workspace
from world.arrays import Heights
from world.frames import PolyMap, fit_polymap
from world.kernels import field_names

# m of the path, m above the sea of its height and of the ground, m a rad of latitude and of longitude.
LENGTH, HEIGHT, GROUND, RADIUS = 4000.0, 500.0, 100.0, 6_400_000.0
# No aircraft's: their sizes do not matter here.
GAINS = Gains(
    **dict.fromkeys(
        (
            "cross_track_frequency",
            "cross_track_damping",
            "cross_track_integral",
            "intercept",
            "turn_lead",
            "turn_smoothing",
            "height_frequency",
            "height_damping",
            "height_integral",
            "slope_lead",
            "speed_gain",
            "speed_integral",
            "throttle_per_slope",
            "slow_margin",
            "roll_gain",
            "roll_rate_gain",
            "aileron_per_roll_rate",
            "aileron_per_roll_acceleration",
            "alpha_per_g",
            "elevator_per_alpha",
            "elevator_per_pitch_rate",
            "pitch_rate_gain",
            "yaw_rate_gain",
        ),
        0.5,
    ),
    reference_airspeed=25.0,
)


def straight_path() -> FlyByPath:
    pieces = np.array([(0.0, LENGTH, 0.0, 0.0, 0.0, 0.0, 0, math.inf)], PIECE)
    nodes = np.array([(0.0, HEIGHT, 0.0, 0.0)], NODE)
    return FlyByPath(pieces, nodes, LENGTH)


def linear_map(u: tuple[float, float, float], v: tuple[float, float, float], half: float) -> PolyMap:
    """(x, y) to u[0] + u[1] x + u[2] y and the same of v, fitted where both are within `half` of 0."""
    box = [[-half, half], [-half, half]]
    return fit_polymap(lambda x, y: (u[0] + u[1] * x + u[2] * y, v[0] + v[1] * x + v[2] * y), box, 1e-12)


def north_at(course: float) -> PolyMap:
    """The same map course of true north (rad) everywhere."""
    return linear_map((course, 0.0, 0.0), (0.0, 0.0, 0.0), 0.01)


def make_workspace() -> Workspace:
    """Of a flight at 25 m/s that has just begun, in still air, over level ground."""
    path = straight_path()
    waypoints = np.zeros(2, WAYPOINT)
    waypoints["north"] = 0.0, LENGTH
    waypoints["airspeed"] = 25.0
    space = Workspace(GAINS, path, waypoints)
    work = space.record
    work.position_map = linear_map((0.0, 0.0, RADIUS), (0.0, RADIUS, 0.0), 0.01).record
    work.north_map = north_at(0.0).record
    work.pixel_map = linear_map((1.0, 1e-4, 0.0), (1.0, 0.0, 1e-4), 1e4).record
    for factors in (work.state_factors, work.scale_positive, work.scale_negative):
        for name in field_names(factors.dtype):
            factors[name] = 1.0
    work.timing.dt = 1.0 / 60.0
    work.settings.min_airspeed, work.settings.navigation_time, work.settings.battery = 14.0, 1.0, math.inf
    work.memory.max_bank, work.memory.last_airspeed = 0.5, -1.0
    work.air.ground = GROUND
    return space


def level_ground(amsl: float = GROUND) -> Heights:
    """Pixels up to 10 km from the origin, locked as a terrain's are."""
    heights = np.full((3, 3), amsl, dtype=np.float32)
    heights.setflags(write=False)
    return heights
