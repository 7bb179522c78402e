"""Missions whose path passes 5 m on the right or the wrong side of a zone's edge or band: the answer by plain sums.

Each comes from its number alone.  Its way, before it is turned to any course: from (0, 0) north to (0, 3000), then east
or on; a zone lies beside one feature of it, 5 m clear of it or 5 m over it.  Every second mission is wrong.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from flight.mission.items import Command, Frame, Mission, MissionItem, round_to_grid
from flight.simulation.setup import FlightSetup
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import load_uav
from tests.setups import spec_around
from tests.synthetic import bank_radius
from world.arrays import Floats
from world.frames import GeoOrigin, to_geo
from world.scenario import scenario_from_spec

SEED = 12
MARGIN = 5.0
SPEED = 25.0
NORTH = 3000.0  # of the corner
EXCLUSION, INCLUSION = Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION, Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION


@dataclass(frozen=True, slots=True)
class FencedMission:
    """A mission and what is to be found of it.

    feature: what of it passes the zone.  wrong: whether it is 5 m on the wrong side.  rule: that judges it.
    plain: its path is straight legs and fly-by arcs alone.
    """

    setup: FlightSetup
    feature: str
    wrong: bool
    rule: str = "fence"
    plain: bool = True


@dataclass(slots=True)
class Draft:
    """A mission as it is drawn.

    sign: 1 where the path is to be wrong, -1 where it is to be right.
    points: of the way, (w, 3).  zones: tables of them, in metres, before they are turned.  fence: polygons of the
    mission's own, each with its command.  items: of which point, with which command and parameters; None for waypoints
    of all points in a row.
    """

    rng: np.random.Generator
    sign: float
    points: Floats
    zones: list[dict[str, Any]]
    fence: list[tuple[Command, list[list[float]]]]
    items: list[tuple[int, Command, tuple[float, ...]]] | None = None
    terrain: dict[str, Any] | None = None
    limits: dict[str, Any] | None = None
    rule: str = "fence"
    plain: bool = True

    def exclude(self, **shape: Any) -> None:
        self.zones.append({"name": "zone", "kind": "exclusion", **shape})

    def include(self, **shape: Any) -> None:
        self.zones.append({"name": "zone", "kind": "inclusion", **shape})

    @property
    def up(self) -> float:
        return float(self.points[0, 2])

    @property
    def radius(self) -> float:
        return bank_radius(SPEED)


def beside_leg(draft: Draft) -> list[list[float]]:
    """A polygon east of the first leg, its westernmost corner or edge 5 m beside or over it, up to 50 corners."""
    rng, edge = draft.rng, -draft.sign * MARGIN
    count = int(rng.integers(2, 48))
    norths = np.sort(rng.uniform(700.0, 2000.0, count)) + np.arange(count)
    easts = edge + rng.uniform(0.0, 200.0, count)
    # 80 m of edge, so that a path over it is as deep as the margin where it is wrong.
    k = int(rng.integers(0, count - 1)) if count > 2 else 0
    easts[k] = easts[k + 1] = edge
    norths[k + 1 :] += 80.0
    return [[float(e), float(n)] for e, n in zip(easts, norths, strict=True)] + [
        [edge + 700.0, 2300.0],
        [edge + 700.0, 600.0],
    ]


def leg(draft: Draft) -> None:
    draft.exclude(polygon_m=beside_leg(draft))


def own_fence(draft: Draft) -> None:
    draft.fence.append((EXCLUSION, beside_leg(draft)))


def own_inclusion(draft: Draft) -> None:
    edge = -MARGIN if draft.sign < 0.0 else MARGIN
    # A fence's edge is straight in degrees; with a corner each 500 m it is so on the map, too.
    norths = np.arange(-900.0, 9001.0, 495.0)
    west, east = [[edge, float(n)] for n in norths[::-1]], [[9000.0, float(n)] for n in norths]
    draft.fence.append((INCLUSION, [*west, *east]))


def hole(draft: Draft) -> None:
    box = [[-3000.0, -3000.0], [9000.0, -3000.0], [9000.0, 9000.0], [-3000.0, 9000.0]]
    draft.include(rings_m=[box, beside_leg(draft)])


def edge(draft: Draft) -> None:
    # Only the second leg comes so far north.
    draft.points[3, 1] = NORTH - 500.0
    north = NORTH - draft.sign * MARGIN
    draft.include(polygon_m=[[-900.0, -900.0], [9000.0, -900.0], [9000.0, north], [-900.0, north]])


def turned_end(draft: Draft) -> Floats:
    """A third point, after a turn to the right at (0, 3000), of which the second half is drawn."""
    turn = math.radians(float(draft.rng.uniform(30.0, 110.0)))
    end = [2500.0 * math.sin(turn), NORTH + 2500.0 * math.cos(turn)]
    draft.points[2, :2] = end
    draft.points = draft.points[:3]
    tangent = draft.radius * math.tan(turn / 2.0)
    return np.array([draft.radius, NORTH - tangent, turn])


def arc(draft: Draft) -> None:
    """A disc about the centre of the corner's arc, 5 m smaller or larger than it."""
    east, north, _ = turned_end(draft)
    draft.exclude(east_m=east, north_m=north, radius_m=draft.radius + draft.sign * MARGIN)


def corner(draft: Draft) -> None:
    """A post outside the middle of the corner's arc, where the legs would lead."""
    east, north, turn = turned_end(draft)
    size = float(draft.rng.uniform(6.0, 30.0))
    out = draft.radius + size - draft.sign * MARGIN
    place = (east - out * math.cos(turn / 2.0), north + out * math.sin(turn / 2.0))
    draft.exclude(east_m=place[0], north_m=place[1], radius_m=size)


def loiter(draft: Draft) -> None:
    """A disc in a loiter's circle, 5 m smaller or larger than it."""
    radius = float(draft.rng.uniform(130.0, 300.0))
    turns = (2.0, 0.0, radius * float(draft.rng.choice([-1.0, 1.0])), 0.0)
    way = Command.NAV_WAYPOINT
    draft.items = [(0, way, ()), (1, way, ()), (2, Command.NAV_LOITER_TURNS, turns), (3, way, ())]
    east, north, _ = draft.points[2].tolist()
    draft.exclude(east_m=east, north_m=north, radius_m=radius + draft.sign * MARGIN)
    draft.plain = False


def jump(draft: Draft) -> None:
    """A box beside the leg that only a jump leads along: from the third point back to the first."""
    way = Command.NAV_WAYPOINT
    draft.items = [(0, way, ()), (1, way, ()), (2, way, ()), (-1, Command.DO_JUMP, (1.0, 1.0)), (3, way, ())]
    back = -draft.points[2, :2] / np.hypot(*draft.points[2, :2])
    right = np.array([back[1], -back[0]])
    middle, side = 0.5 * draft.points[2, :2], float(draft.rng.choice([-1.0, 1.0]))
    near, far = -draft.sign * MARGIN * side, 200.0 * side
    draft.exclude(
        polygon_m=[
            (middle + a * back + b * right).tolist() for a, b in ((-200, near), (200, near), (200, far), (-200, far))
        ]
    )
    draft.plain = False


def band(draft: Draft) -> None:
    """A layer over the middle of the first leg that it passes below or above by 5 m, or is in by 5 m."""
    above = bool(draft.rng.integers(2))
    level = draft.up + draft.sign * MARGIN * (1.0 if above else -1.0)
    draft.exclude(east_m=0.0, north_m=1500.0, radius_m=400.0, **counted(draft, level, ceiling=above))


def layer(draft: Draft) -> None:
    """A layer to stay in, over the whole way, of which the second leg is the highest or the lowest, level, by 40 m."""
    above = bool(draft.rng.integers(2))
    draft.points[1:3, 2] += 40.0 if above else -40.0
    level = float(draft.points[1, 2]) - draft.sign * MARGIN * (1.0 if above else -1.0)
    draft.include(east_m=0.0, north_m=1500.0, radius_m=20_000.0, **counted(draft, level, ceiling=above))


def counted(draft: Draft, level: float, *, ceiling: bool) -> dict[str, float]:
    """A floor or a ceiling at a height above the sea, counted from there or from the ground, which is at 50 m."""
    side = "ceiling" if ceiling else "floor"
    return {f"{side}_amsl_m": level} if draft.rng.integers(2) else {f"{side}_agl_m": level - 50.0}


def climb(draft: Draft) -> None:
    """A layer over a part of a climb of 120 m, whose highest place is where the layer's shape ends."""
    draft.points[1:, 2] += 120.0
    floor = draft.up + 120.0 * 2000.0 / NORTH - draft.sign * MARGIN
    draft.exclude(polygon_m=[[-300.0, 1000.0], [300.0, 1000.0], [300.0, 2000.0], [-300.0, 2000.0]], floor_amsl_m=floor)


def hill(draft: Draft) -> None:
    """A layer above ground over a hill under the first leg, which the way comes nearest to at the hill's top."""
    sigma, north = float(draft.rng.uniform(150.0, 400.0)), float(draft.rng.uniform(1200.0, 1800.0))
    peak = {"east_m": 100.0, "north_m": north, "height_m": 200.0, "sigma_m": sigma}
    turned = turn_of(draft)
    place = turned @ np.array([100.0, north])
    draft.terrain = {"kind": "peaks", "peak": [peak | {"east_m": float(place[0]), "north_m": float(place[1])}]}
    top = 200.0 * math.exp(-0.5 * (100.0 / sigma) ** 2)
    ceiling = draft.up - top + draft.sign * MARGIN
    draft.exclude(polygon_m=[[-900.0, 300.0], [900.0, 300.0], [900.0, 2700.0], [-900.0, 2700.0]], ceiling_agl_m=ceiling)


def limit(draft: Draft) -> None:
    """The greatest height above ground."""
    draft.limits = {"max_height_m": draft.up - 50.0 - draft.sign * MARGIN}
    draft.rule = "height"


FEATURES: tuple[Callable[[Draft], None], ...] = (
    leg,
    arc,
    corner,
    loiter,
    jump,
    band,
    layer,
    climb,
    hill,
    limit,
    edge,
    hole,
    own_fence,
    own_inclusion,
)


def turn_of(draft: Draft) -> Floats:
    """The matrix that turns a mission's axes to its course on the map, the same whenever it is asked."""
    angle = float(np.random.default_rng([SEED, int(draft.up * 1e6)]).uniform(-math.pi, math.pi))
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def turned_table(table: dict[str, Any], turn: Floats) -> dict[str, Any]:
    out = dict(table)
    if "polygon_m" in out:
        out["polygon_m"] = (np.array(out["polygon_m"]) @ turn.T).tolist()
    if "rings_m" in out:
        out["rings_m"] = [(np.array(ring) @ turn.T).tolist() for ring in out["rings_m"]]
    if "east_m" in out:
        out["east_m"], out["north_m"] = (turn @ np.array([out["east_m"], out["north_m"]])).tolist()
    return out


def mission_of(draft: Draft, points: Floats, turn: Floats, origin: GeoOrigin) -> Mission:
    lat, lon = to_geo(origin, points[:, 0], points[:, 1])
    places = [
        (round_to_grid(float(a)), round_to_grid(float(o)), float(up))
        for a, o, up in zip(lat, lon, points[:, 2], strict=True)
    ]
    way = draft.items or [(k, Command.NAV_WAYPOINT, ()) for k in range(len(points))]
    items = []
    for seq, (k, command, params) in enumerate(way, 1):
        p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
        place = places[k] if k >= 0 else (0.0, 0.0, 0.0)
        frame = Frame.GLOBAL if k >= 0 else Frame.MISSION
        items.append(MissionItem(seq, int(command), int(frame), (p1, p2, p3, p4), *place))
    fence: list[MissionItem] = []
    for command, polygon in draft.fence:
        easts, norths = turn @ np.array(polygon).T
        lats, lons = to_geo(origin, easts, norths)
        size = (float(len(polygon)), 0.0, 0.0, 0.0)
        for a, o in zip(lats.tolist(), lons.tolist(), strict=True):
            fence.append(
                MissionItem(len(fence), int(command), int(Frame.GLOBAL), size, round_to_grid(a), round_to_grid(o), 0.0)
            )
    return Mission(None, tuple(items), tuple(fence), source="made mission")


@cache
def _uav() -> Any:
    spec = spec_around([[0.0, 0.0, 300.0], [0.0, 900.0, 300.0]], buffer=900.0, ceiling=900.0, flight=FLIGHT)
    return load_uav(scenario_from_spec(spec, "made"))


FLIGHT = {"airspeed_mps": SPEED, "autopilot": "planfly"}


def fenced_mission(number: int) -> FencedMission:
    """The mission of a number."""
    rng = np.random.default_rng([SEED, number])
    feature, sign = FEATURES[(number // 2) % len(FEATURES)], 1.0 if number % 2 else -1.0
    up = round(float(rng.uniform(350.0, 900.0)), 6)
    points = np.array([[0.0, 0.0, up], [0.0, NORTH, up], [2500.0, NORTH, up], [5000.0, NORTH, up]])
    draft = Draft(rng, sign, points, [], [])
    feature(draft)
    turn = turn_of(draft)
    placed = draft.points.copy()
    placed[:, :2] = draft.points[:, :2] @ turn.T
    origin = GeoOrigin(float(rng.uniform(-60.0, 60.0)), float(rng.uniform(-180.0, 180.0)))
    scenario = scenario_from_spec(
        spec_around(
            placed,
            name=f"{feature.__name__} {number}",
            buffer=4000.0,
            ceiling=3000.0,
            origin={"lat_deg": origin.lat_deg, "lon_deg": origin.lon_deg},
            terrain=draft.terrain or {"kind": "flat", "amsl_m": 50.0},
            limits=draft.limits or {},
            flight=FLIGHT,
            zones=[turned_table(table, turn) for table in draft.zones],
        ),
        "made",
        external=True,
    )
    uav = _uav()
    setup = make_setup(scenario, uav, mission_of(draft, placed, turn, origin), number)
    return FencedMission(setup, feature.__name__, sign > 0.0, draft.rule, draft.plain)
