"""A return to launch flown in JSBSim by the whole law."""

import math
from dataclasses import replace

import numpy as np

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.mission.items import Command, Frame, Mission, MissionItem
from flight.simulation.simulate import simulate
from logs.verdict.returns.judge_returns import ReturnWorld
from planfly.airframe import load_airframe
from planfly.pipeline import make_setup
from world.errors import PlanflyError
from world.frames import to_geo
from world.kernels import Record

# It is flown in from so far away, m, so that it is steady where the return begins.
_LEAD = 500.0
# A flight that passes the start further away than this, m, across the ground or in height, has not begun there.
_ASIDE, _HEIGHT = 60.0, 15.0
# From a waypoint on, a law is late on a slope by this, s; so far ahead in height the waypoint stands.
_LATE = 3.0


def fly_return(world: ReturnWorld, start: Record) -> tuple[float, float] | None:
    """Least height above ground and least distance outside a kill sphere of a return flown in JSBSim, m.

    Exact navigation and the mean wind alone, as on the point mass.  start: a record of
    `flight.autopilots.arduplane.swift_return.RETURN_START`.  None for a return that cannot be flown.
    """
    scenario = replace(world.scenario, wind=replace(world.scenario.wind, turbulence="none"))
    try:
        airframe = replace(load_airframe(scenario), autopilot=ArduPlane(world.parameters))
        setup = replace(make_setup(scenario, airframe, _mission(world, start), 1), nav="perfect")
        flown = simulate(setup, airframe.aircraft)
    except PlanflyError:
        return None
    track = flown.track
    begin = np.array([float(start["east"]), float(start["north"])])
    near = np.hypot(*(track.position[: round(2.0 * _LEAD / 10.0 * 60.0), :2] - begin).T)
    if not near.size or float(near.min()) > _ASIDE:
        return None
    position = track.position[int(np.argmin(near)) :]
    if abs(float(position[0, 2]) - float(start["up"])) > _HEIGHT:
        return None
    low = math.nan
    if world.scenario.terrain is not None:
        low = float((position[:, 2] - world.scenario.terrain.height(position[:, 0], position[:, 1])).min())
    outside = math.inf
    threats = world.scenario.threats
    for k in np.flatnonzero(threats.kill_radius > 0.0):
        away = np.linalg.norm(position - threats.position[k], axis=1) - threats.kill_radius[k]
        outside = min(outside, float(away.min()))
    return (min(0.0, low) if flown.ended == "ground contact" else low), outside


def _mission(world: ReturnWorld, start: Record) -> Mission:
    """A mission that passes a start on its course and slope, and returns from there."""
    east, north, up = (float(start[name]) for name in ("east", "north", "up"))
    ve, vn, vu = (float(start[f"velocity_{name}"]) for name in ("east", "north", "up"))
    over = max(1.0, math.hypot(ve, vn))
    up += _LATE * vu
    places = [(east - _LEAD * ve / over, north - _LEAD * vn / over, up - _LEAD * vu / over), (east, north, up)]
    origin, mission = world.scenario.origin, world.setup.mission
    items = []
    for number, place in enumerate(places, 1):
        lat, lon = (float(value) for value in to_geo(origin, place[0], place[1]))
        params = (0.0, float(number - 1), 0.0, 0.0)
        items.append(MissionItem(number, Command.NAV_WAYPOINT, Frame.GLOBAL, params, lat, lon, place[2]))
    back = int(Command.NAV_RETURN_TO_LAUNCH)
    items.append(MissionItem(3, back, int(Frame.MISSION), (0.0,) * 4, 0.0, 0.0, 0.0))
    rally = []
    for number, point in enumerate(world.rally):
        lat, lon = (float(value) for value in to_geo(origin, point.east, point.north))
        frame = Frame.GLOBAL_RELATIVE_ALT if point.base else Frame.GLOBAL
        place_up = point.up - point.base
        rally.append(MissionItem(number, Command.NAV_RALLY_POINT, frame, (0.0,) * 4, lat, lon, place_up))
    return Mission(mission.home, tuple(items), rally=tuple(rally), source=mission.source)
