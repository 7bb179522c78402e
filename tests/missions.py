"""Random missions with a known answer: inside every limit by a margin, or beyond exactly one of them by it.

Each comes from its number alone, by a seed that is the paper's year: place, courses, lengths, heights, speed, wind,
turbulence, and whether a limit is the aircraft's or a number of the scenario's.  Limits are asked of
`aircraft.path_limits` and of the envelope; nothing here asks the rules that judge.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft, load_aircraft
from aircraft.envelope import Envelope
from aircraft.path_limits import Limits
from flight.dynamics.envelope_tables import load_envelope
from flight.mission.items import Command, Frame, Mission, MissionItem, on_grid
from flight.simulation.flight_setup import FlightSetup
from logs.verdict.places import Place
from planfly.airframe import Airframe, load_airframe
from planfly.pipeline import make_setup
from world.frames import GeoOrigin, to_geo
from world.scenario import Scenario, from_spec
from world.wind import Wind

Floats = NDArray[np.float64]

SEED = 2014
# What an infeasible mission breaks: the steepest climb or dive of aircraft or scenario, the turn that its legs leave
# room for, the legs that its turns need, the scenario's largest turn, the clearance, the level speeds.
KINDS = {
    "climb": "slope",
    "dive": "slope",
    "turn": "turn",
    "legs": "turn",
    "clearance": "clearance",
    "fast": "speed",
    "slow": "speed",
    "climb number": "slope",
    "dive number": "slope",
    "turn number": "turn",
}
# Turns (rad) and legs (m) that are drawn, and the shortest leg that is to break a slope limit.
TURNS = (math.radians(10.0), math.radians(90.0))
LEGS = (250.0, 2000.0)
SLOPE_LEG = 500.0
# Leg that a speed or a peak is put on, m.
LONG_LEG = (1500.0, 2500.0)
_AIRSPEEDS = (18.0, 31.0)  # that a scenario may ask an Aerosonde to fly


@dataclass(frozen=True, slots=True)
class MadeMission:
    """A mission ready to be judged and flown.

    kind: what it breaks, "" for nothing.  places: the legs or waypoints, without their items, at which that is to be
    found.
    """

    setup: FlightSetup
    airframe: Airframe
    kind: str
    places: tuple[Place, ...]

    @property
    def rule(self) -> str:
        """The rule that is to fail."""
        return KINDS.get(self.kind, "")


@dataclass(slots=True)
class _Draft:
    """A mission while it is drawn.

    bad: the leg, or the waypoint, that breaks the limit; -1 for none.  short: the leg that is too short for its turns.
    """

    rng: np.random.Generator
    kind: str
    margin: float
    bad: int
    limits: Limits
    courses: Floats
    speeds: Floats
    short: int = -1

    @property
    def inside(self) -> float:
        """Share of a limit that is used where it is kept."""
        return 1.0 - self.margin

    @property
    def beyond(self) -> float:
        """Share of a limit that is used where it is broken."""
        return 1.0 + self.margin

    def breaks(self, *kinds: str) -> bool:
        """Whether the mission is to break its limit in one of these ways."""
        return self.kind in kinds


@cache
def _aerosonde() -> tuple[Aircraft, Envelope]:
    aircraft = load_aircraft("aerosonde")
    return aircraft, load_envelope(aircraft)


def feasible(number: int, margin: float) -> MadeMission:
    """A mission that keeps this share of every limit free."""
    return _make("", number, margin)


def infeasible(number: int, margin: float) -> MadeMission:
    """A mission that goes beyond one limit by this share of it, and keeps it free of every other one."""
    return _make(list(KINDS)[number % len(KINDS)], number, margin)


def _make(kind: str, number: int, margin: float) -> MadeMission:
    rng = np.random.default_rng([SEED, number, list(KINDS).index(kind) if kind else len(KINDS)])
    _, envelope = _aerosonde()
    lowest = float(rng.uniform(200.0, 2000.0))
    clearance = round(float(rng.uniform(30.0, 100.0)), 1)
    wind = Wind(float(rng.uniform(0.0, 10.0)), float(rng.uniform(-math.pi, math.pi)), 0.0, _turbulence(rng), None, 0.0)
    # Level speeds that hold from the lowest height to well above any that the legs will reach.
    slow, fast = (f([envelope.level_speeds(lowest + up)[k] for up in (0.0, 1500.0)]) for k, f in ((0, max), (1, min)))
    inside = 1.0 - margin
    airspeed = round(float(rng.uniform(max(_AIRSPEEDS[0], slow / inside), min(_AIRSPEEDS[1], fast * inside))), 2)
    numbers = _numbers(rng, kind)
    limits = Limits(
        max_turn=None if numbers["turn"] is None else math.radians(numbers["turn"]),
        max_climb=None if numbers["climb"] is None else math.radians(numbers["climb"]),
        max_dive=None if numbers["dive"] is None else math.radians(numbers["dive"]),
        min_clearance=clearance,
        envelope=envelope,
        airspeed=airspeed,
        max_bank=math.radians(30.0),
        wind=wind,
    )
    legs = int(rng.integers(4, 8))
    waypoint = kind in ("turn", "turn number")
    bad = int(rng.integers(1, legs)) if waypoint else int(rng.integers(1, legs - 1)) if kind else -1
    draft = _Draft(rng, kind, margin, bad, limits, np.zeros(legs), np.full(legs, airspeed))
    if kind in ("fast", "slow"):
        top = envelope.level_speeds(lowest)[1] * draft.beyond
        low = envelope.level_speeds(lowest)[0] * inside
        draft.speeds[bad] = round(top if kind == "fast" else low, 2)
    turns = _turns(draft, legs)
    draft.courses = rng.uniform(-math.pi, math.pi) + np.concatenate([[0.0], np.cumsum(turns)])
    runs = _runs(draft, turns)
    heights = _heights(draft, runs, turns, lowest)
    steps = runs[:, None] * np.stack([np.sin(draft.courses), np.cos(draft.courses)], axis=1)
    points = np.column_stack([np.vstack([np.zeros(2), np.cumsum(steps, axis=0)]), heights])
    scenario = _scenario(draft, points, numbers, f"{kind or 'feasible'} {number}")
    airframe = load_airframe(scenario)
    mission = _mission(points, draft.speeds, scenario.origin)
    setup = make_setup(scenario, airframe, mission, number)
    return MadeMission(setup, airframe, kind, _places(draft))


def _places(draft: _Draft) -> tuple[Place, ...]:
    """Where a mission's fault is to be found: of a leg too short for its turns, at either of them."""
    if not draft.kind:
        return ()
    if draft.short >= 0:
        return Place("waypoint", draft.short), Place("waypoint", draft.short + 1)
    return (Place("waypoint" if draft.kind == "turn number" else "leg", draft.bad),)


def _turbulence(rng: np.random.Generator) -> Any:
    return ("none", "light")[int(rng.integers(2))]


def _numbers(rng: np.random.Generator, kind: str) -> dict[str, float | None]:
    """Angles in degrees that the scenario sets, or None where the aircraft's count."""
    out: dict[str, float | None] = {}
    for name, low, high in (("turn", 25.0, 75.0), ("climb", 2.0, 5.0), ("dive", 2.0, 4.0)):
        value, drawn = float(rng.uniform(low, high)), rng.random() < 0.3
        out[name] = round(value, 2) if kind == f"{name} number" or (drawn and kind not in (name, "legs")) else None
    return out


def _turns(draft: _Draft, legs: int) -> Floats:
    """Turn at each inner waypoint, (legs - 1,) rad, positive to the right."""
    low, high = TURNS
    most = draft.limits.max_turn
    if most is not None:
        high = min(high, draft.inside * most)
    turns = draft.rng.uniform(low, high, legs - 1) * draft.rng.choice([-1.0, 1.0], legs - 1)
    if draft.breaks("turn number") and most is not None:
        turns[draft.bad - 1] = math.copysign(draft.beyond * most, turns[draft.bad - 1])
    if draft.breaks("turn", "legs"):
        # A corner that its legs have no room for is no corner at all if it hardly turns.
        for k in {draft.bad - 1, draft.bad} if draft.kind == "legs" else {draft.bad - 1}:
            turns[k] = math.copysign(float(draft.rng.uniform(math.radians(30.0), TURNS[1])), turns[k])
    return np.asarray(turns)


def _runs(draft: _Draft, turns: Floats) -> Floats:
    """Length of each leg, m: at random, or just what its turns need."""
    legs = len(turns) + 1
    radii = np.zeros(legs + 1)
    for i in range(1, legs):
        speed = float(draft.speeds[i - 1 : i + 1].max())
        radii[i] = draft.limits.turn_radius(float(draft.courses[i - 1]), float(draft.courses[i]), 0.0, speed)
    angles = np.concatenate([[0.0], np.abs(turns), [0.0]])
    tangents = radii * np.tan(0.5 * angles)
    # What a turn would need if it were sharper by the margin.
    wide = radii * np.tan(0.5 * np.minimum(angles / draft.inside, math.radians(170.0)))
    runs = np.zeros(legs)
    for leg in range(legs):
        need = max(
            wide[leg] + tangents[leg + 1],
            tangents[leg] + wide[leg + 1],
            (tangents[leg] + tangents[leg + 1]) / draft.inside,
        )
        low, high = LEGS
        if leg == draft.bad and draft.breaks("climb", "dive", "climb number", "dive number"):
            low = SLOPE_LEG
        if leg == draft.bad and draft.breaks("clearance", "fast", "slow"):
            low, high = LONG_LEG
        runs[leg] = max(need, low if draft.rng.random() < 0.3 else draft.rng.uniform(low, high))
    if draft.breaks("legs"):
        draft.short = draft.bad
        runs[draft.bad] = (tangents[draft.bad] + tangents[draft.bad + 1]) / draft.beyond
    if draft.breaks("turn"):
        # Room on one leg for this turn, were it gentler by the margin, beside the neighbour's.
        i = draft.bad
        leg = draft.short = i if i < legs - 1 or draft.rng.random() < 0.5 else i - 1
        other = tangents[leg + 1] if leg == i else tangents[leg]
        runs[leg] = other + radii[i] * math.tan(0.5 * angles[i] / draft.beyond)
    return runs


def _heights(draft: _Draft, runs: Floats, turns: Floats, lowest: float) -> Floats:
    """Height of each waypoint, m, the least of them ``lowest``.

    A fly-by arc is shorter than its two tangents, and steeper: by tan(turn / 2) / (turn / 2).  It keeps to the limits
    as the legs do.  The legs beside one that is too steep are level, so that nothing else is.
    """
    up = np.zeros(len(runs) + 1)
    shares = np.where(draft.rng.random(len(runs)) < 0.3, 1.0, draft.rng.uniform(0.0, 1.0, len(runs)))
    shares *= draft.rng.choice([-1.0, 0.0, 1.0], len(runs), p=[0.4, 0.2, 0.4])
    if draft.breaks("climb", "dive", "climb number", "dive number"):
        shares[[draft.bad - 1, draft.bad + 1]] = 0.0
    steeper = np.tan(0.5 * np.abs(turns)) / (0.5 * np.abs(turns))
    base = lowest
    # The limits depend on the heights, and which height is the least on the slopes.
    for _ in range(4):
        up[0] = base
        for leg, run in enumerate(runs):
            slope = _slope(draft, leg, float(shares[leg]), up[leg], run)
            before = (up[leg] - up[leg - 1]) / runs[leg - 1] if leg else 0.0
            if before * slope > 0.0 and leg != draft.bad:
                sign = math.copysign(1.0, slope)
                most = min(abs(math.tan(_slope(draft, k, sign, up[leg], run))) for k in (leg - 1, leg))
                room = max(0.0, 2.0 * most / float(steeper[leg - 1]) - abs(before))
                slope = math.copysign(min(abs(slope), math.atan(room)), slope)
            up[leg + 1] = up[leg] + run * math.tan(slope)
        base += lowest - float(up.min())
    return up


def _slope(draft: _Draft, leg: int, share: float, start: float, run: float) -> float:
    """Slope of a leg, rad: this share of what is allowed, or beyond it."""
    if leg == draft.bad and draft.breaks("fast", "slow"):
        return 0.0
    sign, used = math.copysign(1.0, share), abs(share) * draft.inside
    if leg == draft.bad and draft.breaks("climb", "dive", "climb number", "dive number"):
        sign, used = (1.0 if "climb" in draft.kind else -1.0), draft.beyond
    slope = 0.0
    for _ in range(4):
        ends = (start, start + 0.5 * run * math.tan(slope), start + run * math.tan(slope))
        side = 0 if sign > 0.0 else 1
        course, speed = float(draft.courses[leg]), float(draft.speeds[leg])
        limit = min(draft.limits.slopes(course, up, speed)[side] for up in ends)
        number = (draft.limits.max_climb, draft.limits.max_dive)[side]
        slope = sign * used * max(0.0, min(limit, math.inf if number is None else number))
    return slope


def _scenario(draft: _Draft, points: Floats, numbers: dict[str, float | None], name: str) -> Scenario:
    rng, limits = draft.rng, draft.limits
    low, high = points.min(axis=0), points.max(axis=0)
    over = draft.beyond * limits.min_clearance + float(rng.choice([0.0, 1.0]) * rng.uniform(0.0, 500.0))
    terrain: dict[str, Any] = {"kind": "flat", "amsl_m": float(low[2]) - over}
    if draft.breaks("clearance"):
        terrain = {"kind": "peaks", "peak": [_peak(points, draft.bad, draft.inside * limits.min_clearance, rng)]}
    angles = {f"max_{key}_deg": value for key, value in numbers.items() if value is not None}
    ends = [dict(zip(("east_m", "north_m", "amsl_m"), map(float, p), strict=True)) for p in (points[0], points[-1])]
    spec: dict[str, Any] = {
        "name": name,
        "origin": {"lat_deg": float(rng.uniform(-60.0, 60.0)), "lon_deg": float(rng.uniform(-180.0, 180.0))},
        "terrain": terrain,
        "area": {
            "east_m": [float(low[0]) - 1000.0, float(high[0]) + 1000.0],
            "north_m": [float(low[1]) - 1000.0, float(high[1]) + 1000.0],
            "ceiling_amsl_m": float(high[2]) + 1000.0,
        },
        "start": ends[0],
        "destination": ends[1],
        "limits": angles | {"min_clearance_m": limits.min_clearance},
        "flight": {"airspeed_mps": limits.airspeed},
        "wind": {
            "speed_mps": limits.wind.speed,
            "from_deg": math.degrees(limits.wind.from_course),
            "turbulence": limits.wind.turbulence,
        },
    }
    return from_spec(spec, name)


def _peak(points: Floats, leg: int, over: float, rng: np.random.Generator) -> dict[str, float]:
    """A peak under the middle of a leg, whose line passes this far (m) over it at the least."""
    a, b = points[leg], points[leg + 1]
    middle = 0.5 * (a + b)
    sigma = float(rng.uniform(0.06, 0.12)) * math.hypot(*(b - a)[:2])
    share = np.linspace(0.0, 1.0, 2001)
    away = (share - 0.5) * math.hypot(*(b - a)[:2])
    line = a[2] + share * (b[2] - a[2])
    height = middle[2] - over
    for _ in range(5):
        height += float((line - height * np.exp(-0.5 * (away / sigma) ** 2)).min()) - over
    return {"east_m": float(middle[0]), "north_m": float(middle[1]), "height_m": height, "sigma_m": sigma}


def _mission(points: Floats, speeds: Floats, origin: GeoOrigin) -> Mission:
    """Waypoints above mean sea level, with a speed command before each leg that has another."""
    items: list[MissionItem] = []
    lat, lon = to_geo(origin, points[:, 0], points[:, 1])
    for k, (point, y, x) in enumerate(zip(points, lat.tolist(), lon.tolist(), strict=True)):
        place = (on_grid(y), on_grid(x), float(point[2]))
        items.append(MissionItem(len(items) + 1, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, *place))
        if k < len(speeds) and (k == 0 or speeds[k] != speeds[k - 1]):
            change = (0.0, float(speeds[k]), -1.0, 0.0)
            items.append(
                MissionItem(len(items) + 1, int(Command.DO_CHANGE_SPEED), int(Frame.MISSION), change, 0.0, 0.0, 0.0)
            )
    return Mission(None, tuple(items), source="made mission")
