"""The speed rule: each leg's commanded airspeed in the envelope, and the flown one near the command."""

import math

import numpy as np

from logs.verdict.findings import Finding, Message, make_finding, message, reason_of
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.slopes import measure_ability, steady_rows
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import Place
from logs.verdict.tolerances import (
    GUST_SHARE,
    GUST_SIGMAS,
    GUST_TIME,
    LEVEL,
    MEASURED_SHARE,
    OFF_MEAN,
    SATURATED,
    SLOWEST,
    TAKE_UP,
)
from world.wind import W20


def speed_findings(demands: RouteDemands, aligned: AlignedTrack | None, *, geometric: bool = False) -> list[Finding]:
    """Judge each leg's speed: the commanded airspeed in the envelope, and the flown one near the command."""
    return [_speed(demands, aligned, leg, geometric) for leg in range(demands.legs)]


def _speed(demands: RouteDemands, aligned: AlignedTrack | None, leg: int, geometric: bool) -> Finding:
    commanded = float(demands.setup.route.airspeed[leg])
    slowest, fastest, faults = _commanded(demands, leg, commanded)
    reason = f"{commanded:.1f} m/s commanded of {slowest:.1f} to {fastest:.1f} m/s in level flight"
    margin = min(commanded - slowest, fastest - commanded)
    limit = slowest if commanded - slowest <= fastest - commanded else fastest
    source, method, mean, tolerance = "aircraft", "envelope", math.nan, 0.0
    unflown = False
    if not geometric:
        measured = _measured(demands, aligned, leg) if aligned is not None else None
        if measured is None:
            unflown = True
            reason += "; too little was flown to judge"
        else:
            mean, tolerance, least = measured
            reason += f"; flown {mean:.2f} m/s on average, {least:.1f} m/s at the slowest second"
            off = abs(mean - commanded)
            if not faults:
                limit, margin = commanded + math.copysign(OFF_MEAN, mean - commanded), OFF_MEAN - off
                source, method = "check", "mean airspeed, once taken up"
            if off > OFF_MEAN + tolerance and not _by_the_air(demands, aligned, leg, mean - commanded):
                faults.append(
                    message(f"flown {mean:.1f} m/s on average, {off:.1f} m/s off the commanded {commanded:.1f} m/s")
                )
    ok: bool | None = not faults
    return make_finding(
        "speed",
        Place("leg", leg),
        ok=None if ok and unflown else ok,
        reason=reason_of(faults, [reason]),
        faults=faults,
        planned=commanded,
        flown=mean,
        limit=limit,
        source=source,
        tolerance=tolerance,
        margin=margin,
        unit="m/s",
        method=method,
    )


def _by_the_air(demands: RouteDemands, aligned: AlignedTrack | None, leg: int, off: float) -> bool:
    """Whether rising or sinking air took the speed on a leg where the aircraft showed that it can more than it asks."""
    if aligned is None or off * demands.slopes[leg] >= 0.0:
        return False
    ability = measure_ability(demands, aligned, leg)
    return ability is not None and ability.covers(float(demands.slopes[leg]))


def _commanded(demands: RouteDemands, leg: int, commanded: float) -> tuple[float, float, list[Message]]:
    """Level-flight speeds that hold all along a leg, and what is wrong with the commanded one."""
    heights = (float(demands.points[leg, 2]), float(demands.points[leg + 1, 2]))
    speeds = [demands.setup.envelope.level_speeds(up) for up in heights]
    slowest, fastest = max(low for low, _ in speeds), min(high for _, high in speeds)
    faults = []
    if math.isnan(demands.ground_speed[leg]):
        faults.append(message(f"the wind leaves no way along leg {leg} at {commanded:.0f} m/s"))
    top = max(heights)
    if commanded < slowest:
        below = f"{commanded:.1f} m/s is below the slowest level flight, {slowest:.1f} m/s at {top:.0f} m"
        faults.append(message(below))
    if commanded > fastest:
        above = f"{commanded:.1f} m/s is above the fastest level flight, {fastest:.1f} m/s at {top:.0f} m"
        faults.append(message(above))
    return slowest, fastest, faults


def _measured(demands: RouteDemands, aligned: AlignedTrack, leg: int) -> tuple[float, float, float] | None:
    """Mean airspeed of a leg, what gusts and a new slope may add to it, and the least mean over a second, m/s."""
    if not aligned.flew(leg):
        return None
    rows = steady_rows(demands, aligned, leg)
    time = aligned.track.time[rows]
    if time.size < 2 or time[-1] - time[0] < min(SATURATED, MEASURED_SHARE * float(demands.runs[leg]) / SLOWEST):
        return None
    speed = aligned.track.airspeed[rows].astype(np.float64)
    lasts = float(time[-1] - time[0])
    gust = GUST_SHARE * W20[demands.setup.scenario.wind.turbulence]
    width = max(1, min(speed.size, round(1.0 / aligned.tick())))
    total = np.concatenate([[0.0], np.cumsum(speed)])
    least = float(((total[width:] - total[:-width]) / width).min())
    spread = GUST_SIGMAS * gust * math.sqrt(min(1.0, 2.0 * GUST_TIME / max(lasts, 1e-3)))
    steepened = leg > 0 and abs(float(demands.slopes[leg] - demands.slopes[leg - 1])) > LEVEL
    return float(speed.mean()), spread + (TAKE_UP / lasts if steepened else 0.0), least
