"""The shape of a random mission: turns, legs and heights inside all limits by a margin, or beyond one of them by it."""

import math
from dataclasses import dataclass

import numpy as np

from aircraft.path_limits import Limits
from world.arrays import Floats

# Turns (rad) and legs (m) that are drawn, and the shortest leg that is to break a slope limit.
TURNS = (math.radians(10.0), math.radians(90.0))
LEGS = (250.0, 2000.0)
SLOPE_LEG = 500.0
# Leg that a speed or a peak is put on, m.
LONG_LEG = (1500.0, 2500.0)


@dataclass(slots=True)
class Draft:
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


def draw_turns(draft: Draft, legs: int) -> Floats:
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


def draw_runs(draft: Draft, turns: Floats) -> Floats:
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


def draw_heights(draft: Draft, runs: Floats, turns: Floats, lowest: float) -> Floats:
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


def _slope(draft: Draft, leg: int, share: float, start: float, run: float) -> float:
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
