"""The speed rule: judge the commanded airspeed by the envelope, the distance to reach it, and the flown airspeed."""

import math
from typing import NamedTuple

import numpy as np

from logs.verdict.findings import NOT_FLOWN, UNKNOWN_AIRCRAFT, Fact, Finding, Message, make_finding, message, reason_of
from logs.verdict.measures.route_requirements import RouteRequirements, slope_limit
from logs.verdict.measures.slopes import measure_ability, steady_rows
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import fly_level_speed
from logs.verdict.tolerances import (
    GUST_DURATION_S,
    GUST_SIGMAS,
    GUST_SPEED_FRACTION,
    HELD_SPEED_FRACTION,
    LEVEL_SLOPE_RAD,
    MAX_STEADY_ACCELERATION_MPS2,
    MEAN_SPEED_TOLERANCE_MPS,
    MEASURED_FRACTION,
    MIN_CONTROLLED_AIRSPEED_MPS,
    MIN_GROUND_SPEED_MPS,
    PLAN_TOLERANCE_RAD,
    SATURATED_TIME_S,
    SLOPE_CHANGE_LAG_M,
)
from world.arrays import Floats
from world.wind import W20


def speed_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge each leg's commanded airspeed by the envelope, and report the flown airspeed."""
    found = [_speed_finding(requirements, aligned, leg, geometric) for leg in range(requirements.legs)]
    return [*_parameter_findings(requirements), *found] if geometric else found


def _parameter_findings(requirements: RouteRequirements) -> list[Finding]:
    """Report contradictory speed parameters as undecided: only a flight shows which airspeed is held."""
    parameters = requirements.setup.autopilot.parameters
    if parameters is None or not parameters.misfits or requirements.setup.source is not None:
        return []
    more = f" (+{len(parameters.misfits) - 1} more)" if len(parameters.misfits) > 1 else ""
    fault = message(f"{parameters.misfits[0]}{more}", ": only a flight tells which airspeed is held")
    return [make_finding("speed", FLIGHT, ok=None, reason=fault.text, faults=[fault], check=NOT_FLOWN)]


def _speed_finding(requirements: RouteRequirements, aligned: AlignedTrack | None, leg: int, geometric: bool) -> Finding:
    commanded = float(requirements.route.airspeed[leg])
    slowest, fastest, faults = _level_speed_range(requirements, leg, commanded)
    command = float(requirements.setup.route.airspeed[leg])
    notes = [_command_text(command, commanded, slowest, fastest)]
    notes += [*_speed_range_notes(requirements, command), *_short_leg_notes(requirements, leg, commanded)]
    margin = min(commanded - slowest, fastest - commanded)
    at_least = commanded - slowest <= fastest - commanded
    limit = slowest if at_least else fastest
    mean, tolerance, facts, source = math.nan, 0.0, [], "aircraft"
    unflown = not geometric and (aligned is None or not aligned.flew(leg))
    if unflown:
        notes.append("the leg was not flown")
    elif aligned is not None:
        measured = _measure_airspeed(requirements, aligned, leg)
        if measured is None:
            mean = _nearest_mean(aligned, leg, commanded)
            notes.append(f"{mean:.1f} m/s reached; the leg is too short to hold it")
        else:
            mean, tolerance, least = measured
            off = abs(mean - commanded)
            notes.append(f"flown {mean:.2f} m/s on average, {least:.1f} m/s at the slowest second")
            if off > MEAN_SPEED_TOLERANCE_MPS + tolerance and not _caused_by_air(
                requirements, aligned, leg, mean - commanded
            ):
                text = f"flown {mean:.1f} m/s on average, {off:.1f} m/s off the commanded {commanded:.1f} m/s"
                notes += [text] if requirements.envelope else []
                faults += [] if requirements.envelope else [message(text)]
            wanted = _flown_command(requirements, leg)
            if not faults and (unheld := _find_held_speed(requirements, aligned, leg, wanted)):
                # From here on the flown speed is judged by its command, no longer the command by the envelope.
                mean, allowed, source = unheld.speed, unheld.allowed, "mission"
                limit, at_least = wanted + math.copysign(allowed, mean - wanted), mean < wanted
                margin, tolerance = allowed - abs(mean - wanted), unheld.tolerance
                faults.append(message(f"{mean:.1f} m/s held of the commanded {wanted:.1f} m/s"))
        facts.append(Fact("speed error", mean - commanded, "m/s"))
    ok: bool | None = not faults
    check = ""
    if not faults and (doubt := _uncertainty_text(requirements, leg, commanded, fastest)):
        ok, check = None, UNKNOWN_AIRCRAFT
        notes.insert(0, doubt)
    return make_finding(
        "speed",
        requirements.leg(leg),
        ok=None if ok and unflown else ok,
        reason=reason_of(faults, notes),
        faults=faults,
        planned=commanded,
        flown=mean,
        limit=limit,
        at_least=at_least,
        source=source,
        tolerance=tolerance,
        margin=margin,
        unit="m/s",
        method="commanded airspeed in the envelope",
        check=check,
        facts=facts,
    )


def _command_text(command: float, commanded: float, slowest: float, fastest: float) -> str:
    """Describe a commanded airspeed, equivalent and true, among those of level flight; all m/s."""
    true = "" if command == commanded else f" of equivalent airspeed, {commanded:.1f} m/s of true airspeed,"
    if not (math.isfinite(slowest) and math.isfinite(fastest)):
        return f"{command:.1f} m/s{true} commanded, and no level flight is known"
    return f"{command:.1f} m/s{true} commanded of {slowest:.1f} to {fastest:.1f} m/s in level flight"


def _flown_command(requirements: RouteRequirements, leg: int) -> float:
    """Return the airspeed that the autopilot flies on a leg, m/s; it may differ from the command."""
    setup = requirements.setup
    command = setup.route.airspeed
    taken = setup.autopilot.speeds_flown(command, setup.airspeed)
    return float(requirements.route.airspeed[leg] * taken[leg] / command[leg])


class _HeldSpeed(NamedTuple):
    """Airspeed that was held instead of the commanded airspeed, m/s.

    allowed: tolerated difference from the command, m/s.
    tolerance: further difference that gusts may cause, m/s.
    """

    speed: float
    allowed: float
    tolerance: float


def _find_held_speed(
    requirements: RouteRequirements, aligned: AlignedTrack, leg: int, commanded: float
) -> _HeldSpeed | None:
    """Return the airspeed at which the flight of a leg settled if it is far from the command, or None.

    The airspeed is the mean over the second half of the leg's steady rows, because in the first half the autopilot may
    still change its speed.  Return None if the leg is too steep for the aircraft, because the slope rule then names the
    cause, and for an imported flight, because its airspeed sensor may have the same error.
    """
    if abs(float(requirements.slopes[leg])) > slope_limit(requirements, leg)[0] + PLAN_TOLERANCE_RAD:
        return None
    rows = steady_rows(requirements, aligned, leg)
    time = aligned.track.time[rows]
    if requirements.setup.source is not None or time.size < 2 or 0.5 * float(time[-1] - time[0]) < SATURATED_TIME_S:
        return None
    half = rows.start + int(np.searchsorted(time, 0.5 * float(time[0] + time[-1])))
    speed = float(aligned.track.airspeed[half : rows.stop].astype(np.float64).mean())
    off, allowed = speed - commanded, max(MEAN_SPEED_TOLERANCE_MPS, HELD_SPEED_FRACTION * commanded)
    tolerance = _gust_spread(requirements, float(aligned.track.time[rows.stop - 1] - aligned.track.time[half]))
    if abs(off) <= allowed + tolerance or _caused_by_air(requirements, aligned, leg, off):
        return None
    if off > 0.0 and float(requirements.ground_speed[leg]) < MIN_GROUND_SPEED_MPS:
        return None
    if off > 0.0 and requirements.setup.min_ground_speeds[leg + 1] > 0.0:
        # The airspeed is raised for a minimum ground speed.
        return None
    return _HeldSpeed(speed, allowed, tolerance)


def _uncertainty_text(requirements: RouteRequirements, leg: int, commanded: float, fastest: float) -> str:
    """Explain why an uncertain maximum airspeed leaves a commanded speed undecided; return "" if decided."""
    envelope = requirements.setup.envelope
    if not envelope.fastest_sd:
        return ""
    sure = envelope.surely()
    heights = requirements.points[leg : leg + 2, 2].tolist()
    if commanded <= min(sure.level_speeds(up)[1] for up in heights):
        return ""
    says = f"what {envelope.source} says of the fastest level flight is {fastest:.1f} m/s"
    return f"{commanded:.1f} m/s commanded, and {says} give or take {envelope.fastest_sd:.1f} m/s"


def _speed_range_notes(requirements: RouteRequirements, command: float) -> list[str]:
    """Return a note if the autopilot does not accept a commanded speed (m/s)."""
    autopilot = requirements.setup.autopilot
    limits = autopilot.speed_limits
    if limits is None or limits.min <= command <= limits.max:
        return []
    taken = f"{limits.min_name} {limits.min:g} to {limits.max_name} {limits.max:g} m/s"
    does = "flies the nearest for this one" if limits.nearest else "ignores this one"
    return [f"{autopilot.title} takes speeds from {taken}, and {does}"]


def _short_leg_notes(requirements: RouteRequirements, leg: int, commanded: float) -> list[str]:
    """Return a note if a leg is too short to reach its speed at `MAX_STEADY_ACCELERATION_MPS2`."""
    before = float(requirements.route.airspeed[leg - 1]) if leg else commanded
    change, run = commanded - before, float(requirements.runs[leg])
    seconds = abs(change) / MAX_STEADY_ACCELERATION_MPS2
    # Distance at the mean of both speeds over ground, in the wind along the leg.
    start = float(requirements.ground_speed[leg]) - change
    needs = seconds * (start + 0.5 * change)
    if not needs > run or not start > 0.0:
        return []
    # start t + a t^2 / 2 = run
    rate = math.copysign(MAX_STEADY_ACCELERATION_MPS2, change)
    end = math.sqrt(max(0.0, start * start + 2.0 * rate * run)) - start + before
    return [
        f"from {before:.1f} to {commanded:.1f} m/s takes about {seconds:.0f} s and {needs:.0f} m, and the leg has"
        f" {run:.0f} m: about {end:.1f} m/s are reached on it"
    ]


def _nearest_mean(aligned: AlignedTrack, leg: int, commanded: float) -> float:
    """Return the one-second mean airspeed on a leg (or the mean over a shorter leg) nearest to the command, m/s."""
    means = _second_means(aligned, aligned.leg_rows(leg))
    return float(means[np.argmin(np.abs(means - commanded))])


def _second_means(aligned: AlignedTrack, rows: slice) -> Floats:
    """Return the mean airspeed over each second of some rows, or over all rows if they are fewer, m/s."""
    speed = aligned.track.airspeed[rows].astype(np.float64)
    width = max(1, min(speed.size, round(1.0 / aligned.tick)))
    total = np.concatenate([[0.0], np.cumsum(speed)])
    return np.asarray((total[width:] - total[:-width]) / width)


def _caused_by_air(requirements: RouteRequirements, aligned: AlignedTrack, leg: int, off: float) -> bool:
    """Return True if vertical air motion caused the speed error `off`, because the aircraft showed enough ability."""
    if off * requirements.slopes[leg] >= 0.0:
        return False
    ability = measure_ability(requirements, aligned, leg)
    return ability is not None and ability.covers(float(requirements.slopes[leg]))


def _level_speed_range(
    requirements: RouteRequirements, leg: int, commanded: float
) -> tuple[float, float, list[Message]]:
    """Return the airspeeds at which level flight is possible along the whole leg, and faults of the commanded speed."""
    heights = (float(requirements.points[leg, 2]), float(requirements.points[leg + 1, 2]))
    speeds = [requirements.setup.envelope.level_speeds(up) for up in heights]
    # If level flight is impossible at one altitude, NaN remains for the whole leg.
    slowest, fastest = float(np.max([low for low, _ in speeds])), float(np.min([high for _, high in speeds]))
    faults = []
    if math.isnan(requirements.ground_speed[leg]):
        faults.append(message(f"the wind leaves no way along leg {leg} at {commanded:.0f} m/s"))
    top = max(heights)
    if math.isnan(slowest) or math.isnan(fastest):
        faults.append(message(f"no level flight at {top:.0f} m"))
    if commanded < slowest:
        below = f"{commanded:.1f} m/s is below the slowest level flight, {slowest:.1f} m/s at {top:.0f} m"
        faults.append(message(below))
    if commanded > fastest:
        above = f"{commanded:.1f} m/s is above the fastest level flight, {fastest:.1f} m/s at {top:.0f} m"
        faults.append(message(above))
    return slowest, fastest, faults


def _measure_airspeed(
    requirements: RouteRequirements, aligned: AlignedTrack, leg: int
) -> tuple[float, float, float] | None:
    """Return a leg's mean airspeed, its tolerance, and its minimum mean over a second, m/s; None if too short.

    The tolerance allows for gusts and for a change of slope at the start of the leg.
    """
    rows = steady_rows(requirements, aligned, leg)
    time = aligned.track.time[rows]
    if time.size < 2 or time[-1] - time[0] < min(
        SATURATED_TIME_S, MEASURED_FRACTION * float(requirements.runs[leg]) / MIN_CONTROLLED_AIRSPEED_MPS
    ):
        return None
    speed = aligned.track.airspeed[rows].astype(np.float64)
    lasts = float(time[-1] - time[0])
    least = float(_second_means(aligned, rows).min())
    spread = _gust_spread(requirements, lasts)
    steepened = leg > 0 and abs(float(requirements.slopes[leg] - requirements.slopes[leg - 1])) > LEVEL_SLOPE_RAD
    return float(speed.mean()), spread + (SLOPE_CHANGE_LAG_M / lasts if steepened else 0.0), least


def _gust_spread(requirements: RouteRequirements, seconds: float) -> float:
    """Return how much gusts may change the mean airspeed over a duration, m/s."""
    gust = GUST_SPEED_FRACTION * W20[requirements.setup.scenario.wind.turbulence]
    return GUST_SIGMAS * gust * math.sqrt(min(1.0, 2.0 * GUST_DURATION_S / max(seconds, 1e-3)))


RULE = Rule(
    name="speed",
    tolerances=(
        *(
            "MAX_STEADY_ACCELERATION_MPS2",
            "GUST_SPEED_FRACTION",
            "GUST_SIGMAS",
            "GUST_DURATION_S",
            "HELD_SPEED_FRACTION",
            "MIN_GROUND_SPEED_MPS",
            "LEVEL_SLOPE_RAD",
        ),
        *(
            "MEASURED_FRACTION",
            "MEAN_SPEED_TOLERANCE_MPS",
            "PLAN_TOLERANCE_RAD",
            "SATURATED_TIME_S",
            "MIN_CONTROLLED_AIRSPEED_MPS",
            "SLOPE_CHANGE_LAG_M",
            "UNDECIDED_FRACTION",
        ),
    ),
    judge=speed_findings,
    suggest=fly_level_speed,
    log=LogNeeds(("airspeed",), aircraft=True, full_leg=True),
)
