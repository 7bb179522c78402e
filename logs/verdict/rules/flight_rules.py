"""The rules about the flight itself: waypoints, speed, departure, completion."""

import math

import numpy as np
from numpy.typing import NDArray

from logs.verdict.findings import Finding, make_finding
from logs.verdict.measures.leg_fits import CLEAR_OF_TURN, straight_span
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.slopes import SATURATED, measure_ability, steady_rows
from logs.verdict.measures.track_alignment import AlignedTrack, along_across, approaches
from logs.verdict.rules.slope_rule import GUST_SHARE, LEVEL
from world.wind import W20

Floats = NDArray[np.float64]

# A waypoint is passed within this of where the fly-by path passes it, and within this height of that path beside what
# the blend of slopes takes, m.
PASS = 10.0
PASS_HEIGHT = 15.0
# The mean airspeed of a leg may differ from the command by this, m/s.
OFF_MEAN = 1.0
# Taking up another slope may put the aircraft this far ahead or behind, m: a short leg is mostly that.
TAKE_UP = 10.0
# The time over which a gust lasts, s.
_GUST_TIME = 10.0
# A departure: bank beyond this (rad), or airspeed below this; for another aircraft below this share of its slowest
# level speed, which for the Aerosonde is the same.
MOST_BANK = math.radians(75.0)
SLOWEST = 15.0
SLOWEST_SHARE = 0.94
# A leg counts as flown if the track keeps within this of its line, clear of the turns, m.
CORRIDOR = 20.0
# A log with a pause this long between rows (s) has lost some.
LONGEST_GAP = 0.5
# Position and ground velocity of one tick may disagree by this, m/s, before the record contradicts itself.
CONTRADICTION = 10.0


def waypoint_findings(shape: RouteDemands, flown: AlignedTrack | None) -> list[Finding]:
    """Judge how close the track came to each waypoint."""
    apexes = shape.apexes()
    return [_waypoint(shape, flown, i, apexes) for i in range(len(shape.points))]


def _waypoint(shape: RouteDemands, flown: AlignedTrack | None, i: int, apexes: Floats) -> Finding:
    cut = float(shape.cut[i])
    limit = cut + PASS
    away, off, reason = math.nan, math.nan, "missed: nothing was flown"
    if flown is not None:
        away, off = _closest(shape, flown, i, float(apexes[i, 2]))
        reason = f"passed at {away:.1f} m, {abs(off):.1f} m {'above' if off >= 0.0 else 'below'}"
        if cut >= 1.0:
            reason += f" (the fly-by path passes at {cut:.0f} m)"
    room = PASS_HEIGHT + float(shape.sag[i])
    ok = flown is not None and away <= limit and abs(off) <= room
    if flown is not None and not ok:
        reason = f"missed: {reason}; at most {limit:.0f} m and {room:.0f} m of height count as passed"
        if i > 0 and not flown.passed[i]:
            reason = f"missed: the flight ended {math.hypot(away, off):.0f} m away"
    return make_finding(
        "waypoint",
        shape.waypoint(i),
        ok=ok,
        reason=reason,
        planned=cut,
        flown=away,
        limit=limit,
        source="fly-over" if shape.setup.route.fly_over[i] else "fly-by path",
        tolerance=0.0,
        margin=limit - away,
        unit="m",
        method="closest approach, horizontal",
    )


def _closest(shape: RouteDemands, flown: AlignedTrack, i: int, level: float) -> tuple[float, float]:
    """Closest horizontal approach between the neighbouring waypoints, m, and the height above ``level`` there."""
    first = int(flown.rows[i - 1]) if i else 0
    last = int(flown.rows[i + 1]) if i + 1 < len(shape.points) else len(flown.track) - 1
    position = flown.track.position[first : max(last, first + 1) + 1]
    distance, fraction = approaches(position, shape.points[i])
    if not distance.size:
        off = flown.track.position[-1] - shape.points[i]
        return math.hypot(off[0], off[1]), float(off[2])
    # Of equally close rows, as on a path that crosses itself above or below, the one nearest in height.
    near = np.flatnonzero(distance <= distance.min() + 0.5)
    up = position[near, 2] + fraction[near] * (position[near + 1, 2] - position[near, 2]) - level
    return float(distance.min()), float(up[np.argmin(np.abs(up))])


def speed_findings(shape: RouteDemands, flown: AlignedTrack | None, *, geometric: bool = False) -> list[Finding]:
    """Judge each leg's speed: the commanded airspeed in the envelope, and the flown one near the command."""
    return [_speed(shape, flown, leg, geometric) for leg in range(shape.legs)]


def _speed(shape: RouteDemands, flown: AlignedTrack | None, leg: int, geometric: bool) -> Finding:
    commanded = float(shape.setup.route.airspeed[leg])
    slowest, fastest, wrong = _commanded(shape, leg, commanded)
    reason = f"{commanded:.1f} m/s commanded of {slowest:.1f} to {fastest:.1f} m/s in level flight"
    inside = min(commanded - slowest, fastest - commanded)
    bound = slowest if commanded - slowest <= fastest - commanded else fastest
    numbers = {"limit": bound, "margin": inside}
    source, method, mean, tolerance = "aircraft", "envelope", math.nan, 0.0
    unflown = False
    if not geometric:
        measured = _measured(shape, flown, leg) if flown is not None else None
        if measured is None:
            unflown = True
            reason += "; too little was flown to judge"
        else:
            mean, tolerance, least = measured
            reason += f"; flown {mean:.2f} m/s on average, {least:.1f} m/s at the slowest second"
            off = abs(mean - commanded)
            if not wrong:
                numbers = {"limit": commanded + math.copysign(OFF_MEAN, mean - commanded), "margin": OFF_MEAN - off}
                source, method = "check", "mean airspeed, once taken up"
            if off > OFF_MEAN + tolerance and not _by_the_air(shape, flown, leg, mean - commanded):
                wrong.append(f"flown {mean:.1f} m/s on average, {off:.1f} m/s off the commanded {commanded:.1f} m/s")
    ok: bool | None = not wrong
    return make_finding(
        "speed",
        f"leg {leg}",
        ok=None if ok and unflown else ok,
        reason="; ".join(wrong) + f" ({reason})" if wrong else reason,
        planned=commanded,
        flown=mean,
        source=source,
        tolerance=tolerance,
        unit="m/s",
        method=method,
        **numbers,
    )


def _by_the_air(shape: RouteDemands, flown: AlignedTrack | None, leg: int, off: float) -> bool:
    """Whether rising or sinking air took the speed on a leg where the aircraft showed that it can more than it asks."""
    if flown is None or off * shape.slopes[leg] >= 0.0:
        return False
    shown = measure_ability(shape, flown, leg)
    return shown is not None and shown.covers(float(shape.slopes[leg]))


def _commanded(shape: RouteDemands, leg: int, commanded: float) -> tuple[float, float, list[str]]:
    """Level-flight speeds that hold all along a leg, and what is wrong with the commanded one."""
    heights = (float(shape.points[leg, 2]), float(shape.points[leg + 1, 2]))
    speeds = [shape.setup.envelope.level_speeds(up) for up in heights]
    slowest, fastest = max(low for low, _ in speeds), min(high for _, high in speeds)
    wrong = []
    if math.isnan(shape.ground_speed[leg]):
        wrong.append(f"the wind leaves no way along leg {leg} at {commanded:.0f} m/s")
    if commanded < slowest:
        wrong.append(
            f"{commanded:.1f} m/s is below the slowest level flight, {slowest:.1f} m/s at {max(heights):.0f} m"
        )
    if commanded > fastest:
        wrong.append(
            f"{commanded:.1f} m/s is above the fastest level flight, {fastest:.1f} m/s at {max(heights):.0f} m"
        )
    return slowest, fastest, wrong


def _measured(shape: RouteDemands, flown: AlignedTrack, leg: int) -> tuple[float, float, float] | None:
    """Mean airspeed of a leg, what gusts and a new slope may add to it, and the least mean over a second, m/s."""
    if not flown.flew(leg):
        return None
    rows = steady_rows(shape, flown, leg)
    time = flown.track.time[rows]
    if time.size < 2 or time[-1] - time[0] < min(SATURATED, 0.5 * float(shape.runs[leg]) / SLOWEST):
        return None
    speed = flown.track.airspeed[rows].astype(np.float64)
    lasts = float(time[-1] - time[0])
    gust = GUST_SHARE * W20[shape.setup.scenario.wind.turbulence]
    width = max(1, min(speed.size, round(1.0 / flown.tick())))
    total = np.concatenate([[0.0], np.cumsum(speed)])
    least = float(((total[width:] - total[:-width]) / width).min())
    spread = 2.0 * gust * math.sqrt(min(1.0, 2.0 * _GUST_TIME / max(lasts, 1e-3)))
    steepened = leg > 0 and abs(float(shape.slopes[leg] - shape.slopes[leg - 1])) > LEVEL
    return float(speed.mean()), spread + (TAKE_UP / lasts if steepened else 0.0), least


def departure_findings(shape: RouteDemands, flown: AlignedTrack | None) -> list[Finding]:
    """One finding: numbers that are none, extreme bank, too slow to fly, or ground contact."""
    if flown is None:
        return [make_finding("departure", "flight", ok=None, reason="no usable rows", unit="deg")]
    track = flown.track
    bank = np.abs(track.attitude[:, 0].astype(np.float64))
    slowest = _slowest(shape, track.position[:, 2])
    wrong = []
    if flown.bad_rows:
        wrong.append(f"{flown.bad_rows} rows without usable numbers, the first {_moment(flown.first_bad)}")
    if (bank > MOST_BANK).any():
        k = int(np.argmax(bank > MOST_BANK))
        wrong.append(f"bank {math.degrees(bank[k]):.0f}° at {track.time[k]:.1f} s")
    if (track.airspeed < slowest).any():
        k = int(np.argmax(track.airspeed < slowest))
        wrong.append(f"airspeed {track.airspeed[k]:.1f} m/s at {track.time[k]:.1f} s, below {slowest[k]:.1f} m/s")
    if (flown.low <= 0.0).any():
        wrong.append(f"ground contact at {track.time[int(np.argmax(flown.low <= 0.0))]:.1f} s")
    said = f"bank at most {math.degrees(bank.max()):.0f}°, airspeed at least {float(track.airspeed.min()):.1f} m/s"
    return [
        make_finding(
            "departure",
            "flight",
            ok=not wrong,
            reason="; ".join(wrong) if wrong else said,
            flown=math.degrees(bank.max()),
            limit=math.degrees(MOST_BANK),
            source="check",
            tolerance=0.0,
            margin=math.degrees(MOST_BANK - bank.max()),
            unit="deg",
            method="every row",
        )
    ]


def _moment(time: float) -> str:
    return f"at {time:.1f} s" if math.isfinite(time) else "without a time"


def _slowest(shape: RouteDemands, up: Floats) -> Floats:
    """Airspeed below which the aircraft is taken to have stopped flying, at each height."""
    if shape.setup.aircraft == "aerosonde":
        return np.full(up.shape, SLOWEST)
    envelope = shape.setup.envelope
    return np.asarray(SLOWEST_SHARE * np.interp(up, envelope.amsl, envelope.level_speed_min))


def completion_findings(shape: RouteDemands, flown: AlignedTrack | None, ended: str, whole: bool) -> list[Finding]:
    """One finding: planned feasibly, flown to the last waypoint, recorded whole and without contradiction."""
    plan = shape.setup.plan
    wrong = []
    if plan is not None and not plan.feasible:
        wrong.append("the plan is not feasible")
    if ended != "completed":
        wrong.append(f"the flight ended early: {ended}")
    if not whole:
        wrong.append("the log is damaged or unfinished")
    legs = 0
    if flown is None:
        wrong.append("the track has fewer than two usable rows")
    else:
        legs = int(flown.passed[1:].sum())
        if legs < shape.legs:
            wrong.append(f"{legs} of {shape.legs} legs flown")
        wrong += _strays(shape, flown)
        wrong += _record_faults(flown)
    notes = "; ".join(shape.setup.route.notes)
    reason = "; ".join(wrong) if wrong else f"all {shape.legs} legs flown"
    return [
        make_finding(
            "completion",
            "flight",
            ok=not wrong,
            reason=reason + (f" (not flown as written: {notes})" if notes else ""),
            planned=shape.legs,
            flown=legs,
            limit=shape.legs,
            source="route",
            tolerance=0.0,
            margin=legs - shape.legs,
            unit="legs",
            method="waypoints passed in order",
        )
    ]


def _strays(shape: RouteDemands, flown: AlignedTrack) -> list[str]:
    """Legs that the track left between their turns."""
    out = []
    for leg in range(shape.legs):
        if not flown.flew(leg):
            continue
        rows = flown.leg_rows(leg)
        along, across = along_across(shape, leg, flown.track.position[rows])
        low, high = straight_span(shape, leg, CLEAR_OF_TURN)
        off = np.where((along >= low) & (along <= high), np.abs(across), 0.0)
        k = int(np.argmax(off))
        if off[k] > CORRIDOR:
            out.append(f"left leg {leg} by {off[k]:.0f} m at {flown.track.time[rows.start + k]:.1f} s")
    return out


def _record_faults(flown: AlignedTrack) -> list[str]:
    """Pauses in the record, and places where position and velocity contradict each other."""
    track, out = flown.track, []
    step = np.diff(track.time)
    gap = int(np.argmax(step))
    if step[gap] > max(LONGEST_GAP, 5.0 * float(np.median(step))):
        out.append(f"rows are missing from {track.time[gap]:.1f} s to {track.time[gap + 1]:.1f} s")
    # Where rows are missing the mean velocity says nothing.
    short = step <= LONGEST_GAP
    moved = np.diff(track.position, axis=0)[short] / step[short, None]
    mean = 0.5 * (track.velocity[1:].astype(np.float64) + track.velocity[:-1])[short]
    off = np.sqrt(((moved - mean) ** 2).sum(axis=1))
    if off.size and off.max() > CONTRADICTION:
        k = int(np.argmax(off))
        out.append(f"position and velocity contradict each other at {track.time[:-1][short][k]:.2f} s")
    return out
