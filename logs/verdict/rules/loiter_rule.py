"""The loiter rule: can a circle be held with this bank in this wind, and was it flown around to its end.

A loiter is flown as corners around its circle.  Each is judged like any turn; what is said of them is one finding a
loiter, and of the legs between them the worst of each rule.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from logs.verdict.findings import Finding, make_finding
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack
from world.geometry import tangent_length

Floats = NDArray[np.float64]

# Radii are known to this, m: 1e-7 degrees at the circle's middle.
RADIUS_TOLERANCE = 0.02


@dataclass(frozen=True, slots=True)
class Circle:
    """One loiter of a route: its first and last corner, the middle (2,) m, the radius (m), and turns flown around."""

    first: int
    last: int
    middle: Floats
    radius: float
    turns: float


def circles(shape: RouteDemands) -> list[Circle]:
    """Loiters of a route, in flying order."""
    arcs, items = shape.setup.route.arcs, shape.setup.route.items
    found: list[Circle] = []
    i = 0
    while i < len(arcs):
        last = i
        while last + 1 < len(arcs) and arcs[last + 1] > 0.0 and items[last + 1] == items[i]:
            last += 1
        if arcs[i] > 0.0:
            angle = float(np.abs(shape.turns[i : last + 1]).sum())
            found.append(Circle(i, last, _middle(shape, i), float(arcs[i]), angle / (2.0 * math.pi)))
            i = last
        i += 1
    return found


def _middle(shape: RouteDemands, i: int) -> Floats:
    """Middle of the circle that a corner's arc is part of, (2,) m."""
    if not 0 < i < shape.legs:
        return np.array(shape.points[i, :2])
    ux, uy = shape.leg_unit(i - 1)
    side = math.copysign(1.0, shape.turns[i])
    reach = tangent_length(abs(float(shape.turns[i])), float(shape.radius[i]))
    return np.array(shape.points[i, :2] - reach * np.array([ux, uy]) + side * shape.radius[i] * np.array([uy, -ux]))


def fold_loiters(shape: RouteDemands, flown: AlignedTrack | None, findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Findings with those at a loiter's corners replaced by one, and those of its legs by the worst of each rule."""
    found = list(findings)
    for circle in circles(shape):
        corners = {shape.waypoint(i) for i in range(circle.first, circle.last + 1)}
        legs = {f"leg {leg}" for leg in range(circle.first, circle.last)}
        at = [item for item in found if item.rule in ("turn", "waypoint") and item.where in corners]
        if at:
            place = found.index(at[0])
            found[place] = _loiter(shape, flown, circle, at)
            found = [item for item in found if not any(item is other for other in at[1:])]
        for rule in ("slope", "speed", "clearance"):
            mine = [item for item in found if item.rule == rule and item.where in legs]
            if len(mine) > 1:
                worst = min(mine, key=_badness)
                said = replace(worst, reason=f"{worst.reason}; the worst of the circle's {len(mine)} legs")
                found = [said if item is worst else item for item in found if item is worst or item not in mine]
    return tuple(found)


def _badness(item: Finding) -> tuple[int, float]:
    return (0 if item.ok is False else 1 if item.ok is None else 2), 0.0 if item.margin is None else item.margin


def _loiter(shape: RouteDemands, flown: AlignedTrack | None, circle: Circle, at: list[Finding]) -> Finding:
    inner = np.arange(max(1, circle.first), min(shape.legs - 1, circle.last) + 1)
    known = bool(inner.size and np.isfinite(shape.turn_limit[inner]).all())
    tightest = float(shape.tightest[inner].max()) if known else math.nan
    wrong = []
    if known and circle.radius < tightest - RADIUS_TOLERANCE:
        speed, bank = float(shape.setup.route.airspeed[circle.first]), math.degrees(shape.limits.max_bank)
        radius = f"at {speed:.0f} m/s and {bank:.0f}° bank the aircraft needs {tightest:.0f} m"
        if not math.isfinite(tightest):
            radius = f"at {speed:.0f} m/s the wind leaves no way around it"
        wrong.append(f"radius {circle.radius:.0f} m where {radius} in this wind")
    bad = [item for item in at if item.ok is False]
    if flown is not None and bad:
        worst = min(bad, key=_badness)
        corners = len({item.where for item in bad})
        wrong.append(
            f"{corners} of {circle.last - circle.first + 1} corners not held, as {worst.where}: {worst.reason}"
        )
    elif bad and not wrong:
        wrong.append(f"{bad[0].where}: {bad[0].reason}")
    facts = [f"{circle.turns:.2f} turns with {circle.radius:.0f} m"]
    mean = math.nan
    if flown is not None and flown.passed[circle.last] and flown.rows[circle.last] > flown.rows[circle.first]:
        rows = slice(int(flown.rows[circle.first]), int(flown.rows[circle.last]) + 1)
        off = flown.track.position[rows, :2] - circle.middle
        radii = np.hypot(off[:, 0], off[:, 1])
        mean = float(radii.mean())
        facts.append(f"flown with {radii.min():.1f} to {radii.max():.1f} m")
    ok: bool | None = not (wrong or bad)
    if ok and any(item.ok is None for item in at):
        ok = None
        facts.append("the flight did not get to its end")
    return make_finding(
        "loiter",
        shape.waypoint(circle.first),
        ok=ok,
        reason="; ".join(wrong) + f" ({'; '.join(facts)})" if wrong else "; ".join(facts),
        planned=circle.radius,
        flown=mean,
        limit=tightest,
        source="aircraft" if known else "none",
        tolerance=RADIUS_TOLERANCE,
        margin=circle.radius - tightest,
        unit="m",
        method="radius over the ground against the bank limit's in this wind; each corner as a turn",
    )
