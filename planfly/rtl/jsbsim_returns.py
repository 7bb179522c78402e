"""Fly a return to launch in JSBSim, by the simulated autopilot or by the ArduPlane program."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flight.mission.items import LANDINGS, Command, Frame, Mission, MissionItem
from flight.mission.return_path import LandingStart
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import Track
from logs.verdict.returns.judge_returns import ReturnWorld
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import Uav, load_uav
from world.arrays import Floats
from world.errors import PlanflyError
from world.frames import to_geo
from world.kernels import Record

# Length of the lead-in, m, so that the flight is steady at the start of the return.
LEAD_IN_LENGTH_M = 500.0
# Maximum horizontal distance at which a flight passes the start of a return, m.
_MAX_START_DISTANCE_M = 60.0
# Maximum vertical distance at which a flight passes the start of a return, m.
_MAX_START_HEIGHT_ERROR_M = 15.0
# Battery with which no flight ends early, Wh.
_ENDLESS_BATTERY_WH = 1e9
# Delay of the simulated autopilot in following a slope after a waypoint, s; the altitude of the start waypoint is
# advanced by this delay.
_SLOPE_DELAY_S = 3.0


class NearestApproaches(NamedTuple):
    """Closest points of a path to the ground and to missiles.

    clearance: minimum height above ground, m; NaN if unknown.
    lowest_position: position of this minimum, (3,), m.
    outside: minimum distance from the surface of a kill sphere, negative inside, m; inf without missiles.
    threat: index of the threat with this sphere, -1 without missiles.
    """

    clearance: float
    lowest_position: tuple[float, float, float]
    outside: float
    threat: int


def fly_return(world: ReturnWorld, start: Record) -> tuple[float, float] | None:
    """Simulate a return to launch in JSBSim.

    Return its minimum height above ground and distance from kill spheres, m.

    The navigation is exact, and the wind has no gusts, as in the simulation with a point mass.  The result is None for
    a return that cannot be flown.

    start: a record of `flight.autopilots.simulated_returns.RETURN_START`.
    """
    try:
        setup, uav = return_setup(world, start)
        # The energy is judged by the point mass: an empty battery does not end the flight.
        flight = fly_to_end(Flight(replace(setup, battery=_ENDLESS_BATTERY_WH), uav.aircraft))
    except PlanflyError:
        return None
    position = positions_from_start(flight.track, start)
    if position is None:
        return None
    approach = find_nearest_approaches(world, position)
    return (min(0.0, approach.clearance) if flight.ended == "ground contact" else approach.clearance), approach.outside


def return_setup(world: ReturnWorld, start: Record, landing: LandingStart | None = None) -> tuple[FlightSetup, Uav]:
    """Make the setup and the UAV for simulating a return to launch, with a lead-in before it.

    The flight has the mean wind, but neither turbulence nor navigation errors. The times of a forecast are shifted, so
    that the return begins in the same wind as in the flight.

    start: position, velocity and time at which the return begins.
    landing: the landing sequence that ends the return, or None.
    Raises MissionError for a return without a valid route, and the ScenarioError or ParameterError of `load_uav`.
    """
    wind = replace(world.scenario.wind, turbulence="none")
    if wind.field is not None:
        # The flight begins at time 0, and passes the start of the return after the lead-in.
        lead_in_time = LEAD_IN_LENGTH_M / max(1.0, math.hypot(start["velocity_east"], start["velocity_north"]))
        times = wind.field.times - (float(start["time"]) - lead_in_time)
        wind = replace(wind, field=replace(wind.field, times=times))
    scenario = replace(world.scenario, wind=wind)
    uav = replace(load_uav(scenario), autopilot=world.autopilot)
    setup = make_setup(scenario, uav, _return_mission(world, start, landing), seed=1)
    return replace(setup, nav="perfect"), uav


def positions_from_start(track: Track, start: Record) -> Floats | None:
    """Return the positions of a flight from the start of its return to launch to the end, (t, 3), m.

    The return to launch starts at the row nearest to `start`, among the rows of the first 100 s; the lead-in before it
    is shorter.  The result is None if the flight does not reach this point, or passes it too high or too low.

    track: flight with the lead-in and the return to launch.
    start: a record of `flight.autopilots.simulated_returns.RETURN_START`.
    """
    start_position = np.array([float(start["east"]), float(start["north"])])
    distances = np.hypot(*(track.position[: round(2.0 * LEAD_IN_LENGTH_M / 10.0 * 60.0), :2] - start_position).T)
    if not distances.size or float(distances.min()) > _MAX_START_DISTANCE_M:
        return None
    positions: Floats = track.position[int(np.argmin(distances)) :]
    return None if abs(float(positions[0, 2]) - float(start["up"])) > _MAX_START_HEIGHT_ERROR_M else positions


def find_nearest_approaches(world: ReturnWorld, positions: Floats) -> NearestApproaches:
    """Find the points of a path that are closest to the ground and to missiles.

    positions: path points, (t, 3), m.
    """
    clearance, lowest_position = math.nan, (math.nan, math.nan, math.nan)
    if world.scenario.terrain is not None:
        heights = positions[:, 2] - world.scenario.terrain.height(positions[:, 0], positions[:, 1])
        lowest_row = int(np.argmin(heights))
        clearance, (east, north, altitude) = float(heights[lowest_row]), positions[lowest_row].tolist()
        lowest_position = east, north, altitude
    min_distance, threat = math.inf, -1
    threats = world.scenario.threats
    for index in np.flatnonzero(threats.kill_radius > 0.0):
        distance = float(
            (np.linalg.norm(positions - threats.position[index], axis=1) - threats.kill_radius[index]).min()
        )
        if distance < min_distance:
            min_distance, threat = distance, int(index)
    return NearestApproaches(clearance, lowest_position, min_distance, threat)


def _return_mission(world: ReturnWorld, start: Record, landing: LandingStart | None) -> Mission:
    """Make a mission that flies through the start of a return to launch, and then commands RTL.

    The mission passes this point on the course and slope that the flight has there.
    """
    east, north, altitude = (float(start[name]) for name in ("east", "north", "up"))
    velocity_east, velocity_north, velocity_up = (float(start[f"velocity_{name}"]) for name in ("east", "north", "up"))
    ground_speed = max(1.0, math.hypot(velocity_east, velocity_north))
    turns = world.autopilot.turns
    # An autopilot that reads no acceptance radius from an item begins the RTL before the last waypoint.
    distance_ahead = 0.0 if turns.reads_acceptance else turns.distance(math.pi, altitude)
    altitude += _SLOPE_DELAY_S * velocity_up
    points = [
        (
            east - LEAD_IN_LENGTH_M * velocity_east / ground_speed,
            north - LEAD_IN_LENGTH_M * velocity_north / ground_speed,
            altitude - LEAD_IN_LENGTH_M * velocity_up / ground_speed,
        ),
        (
            east + distance_ahead * velocity_east / ground_speed,
            north + distance_ahead * velocity_north / ground_speed,
            altitude,
        ),
    ]
    origin, mission = world.scenario.origin, world.setup.mission
    items = []
    for number, point in enumerate(points, 1):
        lat, lon = (float(value) for value in to_geo(origin, point[0], point[1]))
        params = (0.0, float(number - 1), 0.0, 0.0)
        items.append(MissionItem(number, Command.NAV_WAYPOINT, Frame.GLOBAL, params, lat, lon, point[2]))
    rtl_command = int(Command.NAV_RETURN_TO_LAUNCH)
    items.append(MissionItem(3, rtl_command, int(Frame.MISSION), (0.0,) * 4, 0.0, 0.0, 0.0))
    if landing is not None:
        # The landing sequence, from DO_LAND_START to the landing.
        commands = [item.command for item in mission.items]
        start_index = next(index for index, item in enumerate(mission.items) if item.seq == landing.item)
        first_index = max(index for index in range(start_index) if commands[index] == Command.DO_LAND_START)
        last_index = next(index for index in range(start_index, len(commands)) if commands[index] in LANDINGS)
        items += [replace(item, seq=seq) for seq, item in enumerate(mission.items[first_index : last_index + 1], 4)]
    rally = []
    for number, rally_point in enumerate(world.rally):
        lat, lon = (float(value) for value in to_geo(origin, rally_point.east, rally_point.north))
        frame = Frame.GLOBAL_RELATIVE_ALT if rally_point.base else Frame.GLOBAL
        height = rally_point.up - rally_point.base
        rally.append(MissionItem(number, Command.NAV_RALLY_POINT, frame, (0.0,) * 4, lat, lon, height))
    home = None if mission.home is None else replace(mission.home, alt=world.home.up)
    return Mission(home, tuple(items), rally=tuple(rally), source=mission.source)
