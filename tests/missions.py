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

from aircraft.catalog import Aircraft, load_aircraft
from aircraft.envelope import Envelope
from aircraft.path_limits import Limits
from flight.dynamics.envelope_tables import load_envelope
from flight.simulation.setup import FlightSetup
from logs.verdict.places import Place
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import Uav, load_uav
from tests.mission_draft import Draft, draw_heights, draw_runs, draw_turns
from tests.setups import spec_around, waypoint_mission
from world.arrays import Floats
from world.scenario import Scenario, scenario_from_spec
from world.wind import Wind

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
_AIRSPEEDS = (18.0, 31.0)  # that a scenario may ask an Aerosonde to fly


@dataclass(frozen=True, slots=True)
class MadeMission:
    """A mission ready to be judged and flown.

    kind: what it breaks, "" for nothing.  places: the legs or waypoints, without their items, at which that is to be
    found.
    """

    setup: FlightSetup
    uav: Uav
    kind: str
    places: tuple[Place, ...]

    @property
    def rule(self) -> str:
        """The rule that is to fail."""
        return KINDS.get(self.kind, "")


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
    draft = Draft(rng, kind, margin, bad, limits, np.zeros(legs), np.full(legs, airspeed))
    if kind in ("fast", "slow"):
        top = envelope.level_speeds(lowest)[1] * draft.beyond
        low = envelope.level_speeds(lowest)[0] * inside
        draft.speeds[bad] = round(top if kind == "fast" else low, 2)
    turns = draw_turns(draft, legs)
    draft.courses = rng.uniform(-math.pi, math.pi) + np.concatenate([[0.0], np.cumsum(turns)])
    runs = draw_runs(draft, turns)
    heights = draw_heights(draft, runs, turns, lowest)
    steps = runs[:, None] * np.stack([np.sin(draft.courses), np.cos(draft.courses)], axis=1)
    points = np.column_stack([np.vstack([np.zeros(2), np.cumsum(steps, axis=0)]), heights])
    scenario = _scenario(draft, points, numbers, f"{kind or 'feasible'} {number}")
    uav = load_uav(scenario)
    mission = waypoint_mission(points, draft.speeds, scenario.origin)
    setup = make_setup(scenario, uav, mission, number)
    return MadeMission(setup, uav, kind, _places(draft))


def _places(draft: Draft) -> tuple[Place, ...]:
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


def _scenario(draft: Draft, points: Floats, numbers: dict[str, float | None], name: str) -> Scenario:
    rng, limits = draft.rng, draft.limits
    low, high = points.min(axis=0), points.max(axis=0)
    over = draft.beyond * limits.min_clearance + float(rng.choice([0.0, 1.0]) * rng.uniform(0.0, 500.0))
    terrain: dict[str, Any] = {"kind": "flat", "amsl_m": float(low[2]) - over}
    if draft.breaks("clearance"):
        terrain = {"kind": "peaks", "peak": [_peak(points, draft.bad, draft.inside * limits.min_clearance, rng)]}
    angles = {f"max_{key}_deg": value for key, value in numbers.items() if value is not None}
    spec = spec_around(
        points,
        name=name,
        buffer=1000.0,
        ceiling=float(high[2]) + 1000.0,
        origin={"lat_deg": float(rng.uniform(-60.0, 60.0)), "lon_deg": float(rng.uniform(-180.0, 180.0))},
        terrain=terrain,
        limits=angles | {"min_clearance_m": limits.min_clearance},
        flight={"airspeed_mps": limits.airspeed, "autopilot": "planfly"},
        wind={
            "speed_mps": limits.wind.speed,
            "from_deg": math.degrees(limits.wind.from_course),
            "turbulence": limits.wind.turbulence,
        },
    )
    return scenario_from_spec(spec, name)


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
