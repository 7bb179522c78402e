"""Define starts, surroundings and outcomes of simulated RTLs, the same for every autopilot.

An autopilot that has its own RTL simulates it with a point mass (`flight.autopilots.point_mass`) that its control law
steers: the function `flight.autopilots.parts.ReturnBehaviour.fly`.
"""

from dataclasses import dataclass

import numpy as np

from world.arrays import Floats, Heights
from world.frames import POLYMAP, PolyMapRecord
from world.kernels import Records, read_only, record_dtype
from world.scenario import Scenario

# Start of an RTL: position in map axes, m; velocity over the ground, m/s; bank, rad; time after take-off, s.
RETURN_START = record_dtype("east", "north", "up", "velocity_east", "velocity_north", "velocity_up", "roll", "time")

# End of an RTL: it reached its landing sequence, or flew its loiter at the target altitude once around and for
# `flight.mission.itinerary.ENDLESS_LOITER_TIME_S` s.
RETURN_ARRIVED = 1
# End of an RTL: it hit the ground.
RETURN_GROUND_IMPACT = 2
# End of an RTL: it left the elevation data.
RETURN_OFF_TERRAIN = 3
# End of an RTL: it timed out.
RETURN_TIMEOUT = 4
# End of an RTL: it fell below the minimum clearance or distance that the caller demands.
RETURN_ABORTED = 5
# Outcome of one simulated RTL. Times in s since the start; heights above ground and distances outside spheres in m.
RETURN_RESULT = record_dtype(
    ("outcome", np.int64),  # `RETURN_ARRIVED` ... `RETURN_ABORTED`
    "end_time",
    "arrival_time",  # of the arrival within `LOITER_CAPTURE_RADIUS_M` of the target; NaN without an arrival
    "arrival_altitude",  # m AMSL, at the arrival
    "clearance",  # minimum height above ground; after ground contact down to -`MAX_IMPACT_DEPTH_M`
    "clearance_time",  # of that minimum, or of the first ground contact
    "clearance_east",
    "clearance_north",
    "clearance_up",
    "clearance_before_arrival",  # minimum height above ground before the arrival
    "sphere_distance",  # minimum distance outside the kill spheres
    ("threat", np.int64),  # index of the sphere at that distance; -1 without spheres
    "threat_time",
    "distance_before_arrival",  # minimum distance outside the kill spheres before the arrival
    "energy",  # Wh, NaN if the envelope has no power data
    ("position_count", np.int64),  # number of stored positions
)
# An RTL has arrived at its loiter within this distance of its target (m), or within
# `flight.simulation.tick.RTL_ARRIVAL_LOITER_RADII` of its radii. Flights of ArduPlane were compared up to there.
LOITER_CAPTURE_RADIUS_M = 200.0
# Depth below the ground to which an RTL that hits the ground is continued, m: this shows by how much it is too low, and
# whether an RTL that barely hits the ground would hit again.
MAX_IMPACT_DEPTH_M = 10.0
# Delay from engine failure to the turn back, s; the delay used in the ArduPlane reference flights.
ENGINE_FAILURE_REACTION_S = 3.0
# An RTL times out after this multiple of the nominal time for its distance and climb ...
TIMEOUT_RATIO = 3.0
# ... plus this time, s.
TIMEOUT_BASE_S = 600.0


@dataclass(frozen=True, slots=True, eq=False)
class ReturnEnvironment:
    """Terrain and threats that an RTL can meet, for compiled code.

    heights, to_pixel: altitudes of the terrain, and the map from position to pixel; all NaN without terrain.
    spheres, radii: centers (m, 3) and radii (m,) of the kill spheres, m; a sphere with radius 0 is ignored.
    known: True if the scenario has terrain.
    """

    heights: Heights
    to_pixel: PolyMapRecord
    spheres: Floats
    radii: Floats
    known: bool


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedReturns:
    """Simulated RTLs.

    results: outcomes, (n,) of dtype `RETURN_RESULT`.
    tracks: n arrays (t, 3) of positions at intervals of 1 s, m; empty if positions were not stored.
    """

    results: Records
    tracks: tuple[Floats, ...] = ()


def make_return_environment(scenario: Scenario) -> ReturnEnvironment:
    """Return the terrain and the kill spheres of a scenario, for simulated RTLs."""
    threats, terrain = scenario.threats, scenario.terrain
    spheres, radii = threats.position.reshape(-1, 3), threats.kill_radius
    if terrain is None:
        nothing: Heights = np.full((2, 2), np.nan, dtype=np.float32)
        return ReturnEnvironment(read_only(nothing), np.zeros(1, POLYMAP)[0], spheres, radii, False)
    return ReturnEnvironment(terrain.heights, terrain.to_pixel.record, spheres, radii, True)
