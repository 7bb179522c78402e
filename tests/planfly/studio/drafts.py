"""Random missions for the studio's tests: waypoints, circles, jumps, changes of speed, in all frames."""

import math
from functools import cache

import numpy as np

from flight.mission.items import Command, Frame, Home, Mission, MissionItem, round_to_grid
from planfly.flight_options import MissionOptions
from planfly.studio.documents import Document
from planfly.studio.session import Session, TriedChanges
from planfly.studio.worker_tasks import try_planned_suggestions
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import Uav, load_uav
from world.errors import MissionError
from world.frames import to_geo
from world.scenario import Scenario, load_scenario

FRAMES = (Frame.GLOBAL, Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_TERRAIN_ALT)
_KINDS = (Command.NAV_LOITER_TURNS, Command.NAV_LOITER_TIME, Command.NAV_LOITER_TO_ALT)


@cache
def world_of(name: str) -> tuple[Scenario, Uav]:
    scenario = load_scenario(name)
    return scenario, load_uav(scenario)


def draw_mission(rng: np.random.Generator, count: int, scenario: Scenario, *, jumps: bool = True) -> Mission:
    """A mission of so many places, some of which are circles, with changes of speed and jumps back between them."""
    (west, east), (south, north) = scenario.bounds.tolist()
    assert scenario.terrain is not None
    middle = np.array([0.5 * (west + east), 0.5 * (south + north)])
    here, course = middle + rng.uniform(-0.2, 0.2, 2) * (east - west), rng.uniform(0.0, 2.0 * math.pi)
    base = float(scenario.terrain.height(*middle))
    lat, lon = to_geo(scenario.origin, *middle)
    home = Home(round_to_grid(float(lat)), round_to_grid(float(lon)), round(base, 3))
    items: list[MissionItem] = []
    for _ in range(count):
        if items and rng.random() < 0.08:
            params = (0.0, round(float(rng.uniform(20.0, 30.0)), 1), -1.0, 0.0)
            items.append(_item(len(items), Command.DO_CHANGE_SPEED, Frame.MISSION, params))
        kind = Command.NAV_WAYPOINT if rng.random() > 0.12 else rng.choice(_KINDS)
        params = (0.0, float(rng.choice([0.0, 30.0, 60.0])), 0.0, 0.0)
        if kind != Command.NAV_WAYPOINT:
            amount = {Command.NAV_LOITER_TURNS: 1.0, Command.NAV_LOITER_TIME: 20.0}.get(kind, 0.0)
            radius = float(rng.choice([0.0, 120.0, -150.0]))
            params = (amount, radius if kind == Command.NAV_LOITER_TO_ALT else 0.0, radius, 0.0)
        frame = Frame(rng.choice(FRAMES))
        ground = float(scenario.terrain.height(*np.clip(here, [west, south], [east, north])))
        above = float(rng.uniform(90.0, 320.0))
        alt = {Frame.GLOBAL: ground + above, Frame.GLOBAL_RELATIVE_ALT: ground + above - base}.get(frame, above)
        lat, lon = to_geo(scenario.origin, *here)
        place = round_to_grid(float(lat)), round_to_grid(float(lon)), round(alt, 3)
        items.append(MissionItem(len(items) + 1, int(kind), int(frame), params, *place))
        if jumps and len(items) > 4 and rng.random() < 0.04:
            target = float(rng.integers(2, len(items)))
            items.append(_item(len(items), Command.DO_JUMP, Frame.MISSION, (target, 1.0, 0.0, 0.0)))
        course += float(rng.normal(0.0, 0.7))
        away = middle - here
        if np.hypot(*away) > 0.3 * (east - west):
            course = math.atan2(*away) + float(rng.normal(0.0, 0.3))
        here = here + rng.uniform(300.0, 1500.0) * np.array([math.sin(course), math.cos(course)])
    return Mission(home, tuple(items), source="drawn.waypoints")


def _item(before: int, command: Command, frame: Frame, params: tuple[float, float, float, float]) -> MissionItem:
    return MissionItem(before + 1, int(command), int(frame), params, 0.0, 0.0, 0.0)


def session_of(mission: Mission, name: str = "jacksboro") -> Session:
    """A session of a mission in a scenario's world."""
    scenario, uav = world_of(name)
    setup = make_setup(scenario, uav, mission, 1)
    return Session.from_document(
        Document("drawn.waypoints", "drawn", setup, "waypoints"), MissionOptions(scenario=name)
    )


def try_planned(session: Session) -> None:
    """Try the suggestions of a session by geometry, as a worker process does."""
    value = try_planned_suggestions((session.context, session.mission), lambda done, total, remark: None)
    session.tried["geometric"] = TriedChanges(session.rev, **value)


def drawn_session(seed: int, count: int, name: str = "jacksboro", *, jumps: bool = True) -> Session:
    """A session of a random mission that can be laid out."""
    rng = np.random.default_rng(seed)
    while True:
        try:
            return session_of(draw_mission(rng, count, world_of(name)[0], jumps=jumps), name)
        except MissionError:
            continue
