"""The rules about the world along the whole path: clearance over terrain, threats, and the bounds of the area."""

import math

import numpy as np
from numpy.typing import NDArray

from flight.guidance.fly_by_path import fly_by_path, path_polyline
from logs.verdict.findings import Finding, make_finding
from logs.verdict.measures.path_sweeps import path_clearance, path_spheres
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack

Floats = NDArray[np.float64]

# A mission file's 1e-7 degrees move a waypoint by up to 1 cm; on a steep slope that is this much height, m.
ROUNDING = 0.02
HEIGHT_ROUNDING = 0.1


def planned_path(shape: RouteDemands) -> tuple[Floats, NDArray[np.int64], Floats]:
    """Chain of points on the fly-by path (n, 3), the leg of each segment (n - 1,), and when each is passed (n,) s."""
    points, legs = path_polyline(fly_by_path(shape.setup.route, shape.limits))
    speed = np.where(np.isfinite(shape.ground_speed), shape.ground_speed, shape.setup.route.airspeed)
    run = np.hypot(*np.diff(points[:, :2], axis=0).T)
    return points, legs, np.concatenate([[0.0], np.cumsum(run / speed[legs])])


def clearance_findings(shape: RouteDemands, flown: AlignedTrack | None, *, geometric: bool = False) -> list[Finding]:
    """Judge the least height above ground on each leg."""
    ground = shape.setup.scenario.terrain
    limit = shape.limits.min_clearance
    if ground is None:
        reason = "no terrain was given, so heights above ground are not known"
        return [make_finding("clearance", "flight", ok=None, reason=reason, limit=limit, source="scenario", unit="m")]
    points, legs, _ = planned_path(shape)
    low, _ = path_clearance(ground.heights, ground.to_pixel.record, points)
    planned = [float(low[legs == leg].min()) if (legs == leg).any() else math.nan for leg in range(shape.legs)]
    out = []
    for leg in range(shape.legs):
        if geometric:
            out.append(_planned_clearance(leg, planned[leg], limit, ground.vertical_error))
        else:
            out.append(_flown_clearance(shape, flown, leg, planned[leg], limit))
    return out


def _less_error(clearance: float, limit: float, error: float | None) -> str:
    """A clearance (m) less the terrain's stated error, in words; "" where none is stated."""
    if error is None or math.isnan(clearance):
        return ""
    short = f", less than the {limit:.0f} m required" if limit - HEIGHT_ROUNDING > clearance - error else ""
    return f"; {clearance - error:.1f} m less the terrain's stated error of {error:g} m{short}"


def _planned_clearance(leg: int, planned: float, limit: float, error: float | None) -> Finding:
    reason = f"{planned:.1f} m above ground at the lowest"
    if math.isnan(planned):
        reason = "the leg leaves the known terrain"
    return make_finding(
        "clearance",
        f"leg {leg}",
        ok=None if math.isnan(planned) else planned >= limit - HEIGHT_ROUNDING,
        reason=reason
        + ("" if math.isnan(planned) or planned >= limit - HEIGHT_ROUNDING else f"; {limit:.0f} m are required")
        + _less_error(planned, limit, error),
        planned=planned,
        limit=limit,
        source="scenario",
        tolerance=HEIGHT_ROUNDING,
        margin=planned - limit,
        unit="m",
        method="exact along the fly-by path",
    )


def _flown_clearance(
    shape: RouteDemands, flown: AlignedTrack | None, leg: int, planned: float, limit: float
) -> Finding:
    least, ok, reason = math.nan, None, "the leg was not flown"
    if flown is not None and flown.flew(leg):
        # The first leg has what came before it, the last what came after.
        first = 0 if leg == 0 else int(flown.rows[leg])
        last = len(flown.track) - 1 if leg + 1 == shape.legs else int(flown.rows[leg + 1])
        span = flown.low[first:last]
        known = np.isfinite(span)
        if known.any():
            k = first + int(np.nanargmin(span))
            least = float(flown.low[k])
            reason = f"{least:.1f} m above ground {_place(flown, k, float(flown.low_at[k]))}"
            ok = least >= limit - HEIGHT_ROUNDING
        if not known.all():
            k = first + int(np.argmin(known))
            reason = ("" if math.isnan(least) else reason + "; ") + f"off the known terrain {_place(flown, k, 0.0)}"
            ok = None if ok is not False else False
        if ok is False:
            reason += f"; {limit:.0f} m are required"
        ground = shape.setup.scenario.terrain
        reason += _less_error(least, limit, None if ground is None else ground.vertical_error)
    if planned < limit - HEIGHT_ROUNDING:
        reason += f"; the planned path comes down to {planned:.1f} m"
    return make_finding(
        "clearance",
        f"leg {leg}",
        ok=ok,
        reason=reason,
        planned=planned,
        flown=least,
        limit=limit,
        source="scenario",
        tolerance=HEIGHT_ROUNDING,
        margin=least - limit,
        unit="m",
        method="exact along the flown track",
    )


def _place(flown: AlignedTrack, k: int, fraction: float) -> str:
    """When and where a segment's point was."""
    time, position = flown.track.time, flown.track.position
    when = time[k] + fraction * (time[k + 1] - time[k])
    where = position[k] + fraction * (position[k + 1] - position[k])
    return f"at {when:.1f} s, east {where[0]:.0f} m, north {where[1]:.0f} m"


def threat_findings(shape: RouteDemands, flown: AlignedTrack | None, *, geometric: bool = False) -> list[Finding]:
    """Judge each missile and radar sphere that plan or flight touches, or say that there is none."""
    scenario = shape.setup.scenario
    if scenario.external:
        reason = "the mission came without a scenario, so threats are not known"
        return [make_finding("threat", "flight", ok=None, reason=reason, unit="s")]
    threats = scenario.threats
    points, _, times = planned_path(shape)
    touched: list[Finding] = []
    nearest = math.inf
    for kind, radii, scales in (
        ("kill", threats.kill_radius, threats.kill_scale),
        ("detection", threats.detection_radius, threats.detection_scale),
    ):
        plan = path_spheres(points, times, threats.position, radii, scales)
        track = np.full_like(plan, math.nan)
        if flown is not None:
            track = path_spheres(flown.track.position, flown.track.time, threats.position, radii, scales)
        for m, name in enumerate(threats.names):
            if radii[m] <= 0.0:
                continue
            if kind == "kill":
                nearest = min(nearest, (plan if geometric or flown is None else track)[m, 2] - radii[m])
            if plan[m, 2] <= radii[m] or track[m, 2] <= radii[m]:
                touched.append(_touched(name, kind, plan[m], None if geometric else track[m], float(radii[m])))
    if not any(item.where.endswith("(missile)") for item in touched):
        touched.insert(0, _untouched(len(threats), nearest, flown is not None or geometric))
    return touched


def _untouched(count: int, nearest: float, judged: bool) -> Finding:
    reason = f"no missile sphere of {count} threats is entered" if count else "the scenario has no threats"
    if math.isfinite(nearest):
        reason += f"; the nearest stays {nearest:.0f} m away"
    return make_finding(
        "threat",
        "flight",
        ok=True if judged else None,
        reason=reason if judged else "nothing was flown",
        planned=0.0,
        flown=0.0 if judged else None,
        limit=0.0,
        source="scenario",
        tolerance=0.0,
        margin=0.0,
        unit="s",
        method="time inside, exact on each segment",
    )


def _touched(name: str, kind: str, plan: Floats, track: Floats | None, radius: float) -> Finding:
    seen = plan if track is None else track
    missing = bool(np.isnan(seen[2]))
    facts = f"planned {plan[0]:.1f} s inside {radius:.0f} m, exposure {plan[1]:.3g} s"
    if track is not None and not missing:
        facts += f"; flown {track[0]:.1f} s, exposure {track[1]:.3g} s, nearest {track[2]:.0f} m at {track[3]:.1f} s"
    if kind == "detection":
        ok: bool | None = True
        reason = f"reported; detection has no limit: {facts}"
    else:
        ok = None if missing else bool(seen[2] > radius)
        reason = facts if ok is not False else f"inside the missile's reach: {facts}"
    return make_finding(
        "threat",
        f"{name} ({'missile' if kind == 'kill' else 'radar'})",
        ok=ok,
        reason=reason,
        planned=float(plan[0]),
        flown=None if track is None else float(track[0]),
        limit=0.0 if kind == "kill" else None,
        source="scenario" if kind == "kill" else "none",
        tolerance=0.0 if kind == "kill" else None,
        margin=-float(seen[0]) if kind == "kill" else None,
        unit="s",
        method="time inside, exact on each segment",
    )


def bounds_findings(shape: RouteDemands, flown: AlignedTrack | None, *, geometric: bool = False) -> list[Finding]:
    """One finding: the least distance inside the area's box, its floor and its ceiling."""
    scenario = shape.setup.scenario
    if scenario.external:
        reason = "the mission came without a scenario, so there is no area to stay in"
        return [make_finding("bounds", "flight", ok=None, reason=reason, unit="m")]
    planned, side, k = _inside_box(shape, shape.points)
    found, at = planned, f"at {shape.waypoint(k)}"
    ok: bool | None = planned >= -ROUNDING
    flown_margin = math.nan
    if not geometric and flown is None:
        ok, at = None, "nothing was flown"
    elif flown is not None:
        found, side, k = _inside_box(shape, flown.track.position)
        flown_margin, ok = found, found >= -ROUNDING
        at = f"at {flown.track.time[k]:.1f} s"
    where = f"{abs(found):.0f} m {'inside' if found >= 0.0 else 'beyond'} the {side} {at}"
    return [
        make_finding(
            "bounds",
            "flight",
            ok=ok,
            reason=where if ok is not None else at,
            planned=planned,
            flown=flown_margin,
            limit=0.0,
            source="scenario",
            tolerance=ROUNDING,
            margin=found if ok is not None else None,
            unit="m",
            method="least distance inside the box",
        )
    ]


def _inside_box(shape: RouteDemands, points: Floats) -> tuple[float, str, int]:
    """Least distance inside the box (negative: outside), the side that is meant, and the row."""
    scenario = shape.setup.scenario
    (west, east), (south, north) = scenario.bounds
    rooms = {
        "western edge": points[:, 0] - west,
        "eastern edge": east - points[:, 0],
        "southern edge": points[:, 1] - south,
        "northern edge": north - points[:, 1],
        "floor": points[:, 2] - scenario.floor,
        "ceiling": scenario.ceiling - points[:, 2],
    }
    side = min(rooms, key=lambda name: float(rooms[name].min()))
    k = int(np.argmin(rooms[side]))
    return float(rooms[side][k]), side, k
