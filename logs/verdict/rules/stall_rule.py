"""The stall rule: compare the airspeed with the stall speed in a bank, which the load factor raises.

A level turn with bank b needs a lift of n = 1 / cos b weights, and the minimum speed that provides this lift is the
minimum level speed times the root of n (Beard and McLain, *Small Unmanned Aircraft*, section 5.1; any text on the level
turn).  All speeds are true airspeeds at the altitude where they are flown, like the envelope's speeds, so they include
the lower air density at that altitude; an autopilot's equivalent airspeeds are converted to true airspeeds first.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from aircraft.path_limits import ROLL_TIME
from flight.simulation.track import ROLL
from logs.verdict.findings import Finding, make_finding, message
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_flying_faster
from logs.verdict.tolerances import GUST_SPEED_FRACTION, STALL_AVERAGING_TIME_S, STALL_TOLERANCE_MPS
from world.arrays import Floats
from world.wind import W20


@dataclass(frozen=True, slots=True)
class _Margin:
    """True airspeed and the stall speeds in this bank (rad) and in level flight, m/s."""

    speed: float
    stall: float
    level: float
    bank: float

    @property
    def left(self) -> float:
        """Margin above the stall, m/s."""
        return self.speed - self.stall


def stall_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the minimum margin of airspeed above the stall in a bank; return [] for a route without a turn.

    A route fails in flight too if its speed is below the stall in a bank that it needs, whatever speed was flown,
    because an autopilot that did not accept the speed, or banked less, does not make the route flyable.
    """
    planned = _planned_findings(requirements)
    if geometric:
        return planned
    # Without an envelope there is no limit to compare a flight with.
    if aligned is None or not requirements.envelope:
        return []
    return [found for found in planned if found.ok is False] or _flown_findings(requirements, aligned)


def _planned_findings(requirements: RouteRequirements) -> list[Finding]:
    worst: tuple[float, int, _Margin] | None = None
    for i in range(1, requirements.legs):
        for speed in requirements.route.airspeed[i - 1 : i + 1].tolist():
            bank, level = (
                planned_bank(requirements, i, speed),
                level_stall(requirements, float(requirements.points[i, 2])),
            )
            found = _Margin(speed, level / math.sqrt(math.cos(bank)), level, bank)
            if bank > 0.0 and math.isfinite(level) and (worst is None or found.left < worst[0]):
                worst = found.left, i, found
    if worst is None:
        return []
    _, i, found = worst
    return [_finding(found, f"at waypoint {i}", 0.0, geometric=True)]


def planned_bank(requirements: RouteRequirements, i: int, speed: float) -> float:
    """Return the bank that a waypoint's turn needs at an airspeed (m/s), up to the bank limit, rad.

    On an arc of radius R the bank is atan(v^2 / (g R)) at the highest ground speed v on the arc.  A turn that ends
    before the aircraft has rolled in completely needs no more bank than the aircraft reaches by then.
    """
    turn, radius, limit = abs(float(requirements.turns[i])), float(requirements.radius[i]), requirements.limits.max_bank
    if turn <= 0.0 or not math.isfinite(radius):
        return 0.0
    # The bank limit's radius belongs to the ground speed of the faster leg.
    fastest = math.sqrt(float(requirements.tightest[i]) * GRAVITY * math.tan(limit))
    slower = max(requirements.route.airspeed[i - 1 : i + 1]) - speed
    bank = math.atan(max(0.0, fastest - slower) ** 2 / (GRAVITY * radius))
    # Rolling in and out again at 1 / ROLL_TIME turns by (g / v) ROLL_TIME bank^2.
    rolled = math.sqrt(turn * speed / (GRAVITY * ROLL_TIME))
    return min(bank, rolled, limit)


def level_stall(requirements: RouteRequirements, up: float) -> float:
    """Return the minimum true airspeed of level flight at an altitude (m AMSL), m/s.

    At this airspeed the elevator is at its stop.
    """
    return requirements.setup.envelope.level_speeds(up)[0]


def _flown_findings(requirements: RouteRequirements, aligned: AlignedTrack) -> list[Finding]:
    track = aligned.track
    width = max(1, min(len(track), round(STALL_AVERAGING_TIME_S / aligned.tick)))
    speed, load = _window_means(track.airspeed, width), _window_means(track.load_factor, width)
    bank = _window_means(np.abs(track.attitude[:, ROLL]), width)
    up = _window_means(track.position[:, 2], width)
    envelope = requirements.setup.envelope
    level = np.interp(up, envelope.amsl, envelope.level_speed_min)
    # Load that the wing carried, or that it needed to hold altitude in a turn within the bank limit.
    # An imported log may hold no load factor.
    carried = np.fmax(load, 1.0 / np.cos(np.minimum(bank, requirements.limits.max_bank)))
    stall = level * np.sqrt(np.maximum(carried, 0.0))
    margin = speed - stall
    if not np.isfinite(margin).any():
        return []
    k = int(np.nanargmin(margin))
    tolerance = STALL_TOLERANCE_MPS + GUST_SPEED_FRACTION * W20[requirements.setup.scenario.wind.turbulence]
    found = _Margin(float(speed[k]), float(stall[k]), float(level[k]), float(bank[k]))
    return [_finding(found, f"at {track.time[k + width // 2]:.1f} s", tolerance, geometric=False)]


def _window_means(values: NDArray[np.floating], width: int) -> Floats:
    """Return the mean over each window of `width` rows."""
    total = np.concatenate([[0.0], np.cumsum(values.astype(np.float64))])
    return np.asarray((total[width:] - total[:-width]) / width)


def _finding(found: _Margin, where: str, tolerance: float, *, geometric: bool) -> Finding:
    stall = f"{found.speed:.1f} m/s {where}, stall {found.stall:.1f} m/s in {math.degrees(found.bank):.0f}° of bank"
    fault = message(stall, f" (level {found.level:.1f} m/s; true airspeeds)")
    return make_finding(
        "stall",
        FLIGHT,
        ok=found.left >= -tolerance,
        reason=fault.text,
        faults=[fault],
        planned=found.speed if geometric else None,
        flown=None if geometric else found.speed,
        limit=found.stall,
        at_least=True,
        source="aircraft",
        tolerance=tolerance,
        margin=found.left,
        unit="m/s",
        method="slowest level flight times the root of the load factor",
    )


RULE = Rule(
    name="stall",
    tolerances=("STALL_AVERAGING_TIME_S", "STALL_TOLERANCE_MPS", "GUST_SPEED_FRACTION"),
    judge=stall_findings,
    whole=True,
    suggest=suggest_flying_faster,
    log=LogNeeds(("airspeed", "attitude"), aircraft=True, listed=True),
)
