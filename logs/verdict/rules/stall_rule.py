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
from logs.verdict.wording import compared_texts
from world.arrays import Floats
from world.wind import W20


@dataclass(frozen=True, slots=True)
class _Margin:
    """Airspeed in a bank, with the stall speed in the same bank.

    speed: true airspeed, m/s.
    stall_speed: stall speed in this bank, true airspeed, m/s.
    level_stall_speed: stall speed in level flight, true airspeed, m/s.
    bank: rad.
    """

    speed: float
    stall_speed: float
    level_stall_speed: float
    bank: float

    @property
    def above_stall(self) -> float:
        """Margin above the stall, m/s."""
        return self.speed - self.stall_speed


def stall_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the smallest margin of the airspeed above the stall speed in a bank.

    It is judged in planned turns or in flight.

    A route whose airspeed is below the stall speed in a planned turn also fails after a flight: an autopilot that flew
    faster or banked less does not make the route flyable.  Return [] for a plan without a turn, and for a flight that
    cannot be compared.

    geometric: True to judge the planned turns only.
    """
    # The planned turn with the smallest margin above the stall.
    worst_margin: tuple[float, int, _Margin] | None = None
    for corner in range(1, requirements.legs):
        for speed in requirements.route.leg_airspeeds[corner - 1 : corner + 1].tolist():
            bank = planned_bank(requirements, corner, speed)
            stall_speed = min_level_airspeed(requirements, float(requirements.points[corner, 2]))
            margin = _Margin(speed, stall_speed / math.sqrt(math.cos(bank)), stall_speed, bank)
            if (
                bank > 0.0
                and math.isfinite(stall_speed)
                and (worst_margin is None or margin.above_stall < worst_margin[0])
            ):
                worst_margin = margin.above_stall, corner, margin
    planned = []
    if worst_margin is not None:
        _, corner, margin = worst_margin
        planned = [
            _stall_finding(margin, f"at waypoint {requirements.waypoint_place(corner).number}", 0.0, geometric=True)
        ]
    if geometric:
        return planned
    # Without an envelope there is no limit to compare a flight with.
    if aligned is None or not requirements.envelope:
        return []
    if planned and planned[0].ok is False:
        return planned
    # The smallest margin in flight.
    track = aligned.track
    width = max(1, min(len(track), round(STALL_AVERAGING_TIME_S / aligned.tick)))
    speeds = _window_means(track.airspeed, width)
    loads = _window_means(track.load_factor, width)
    banks = _window_means(np.abs(track.attitude[:, ROLL]), width)
    altitude = _window_means(track.position[:, 2], width)
    envelope = requirements.setup.envelope
    level_stall_speeds = np.interp(altitude, envelope.amsl, envelope.level_speed_min)
    # Larger of the measured load factor and the one that a level turn needs.  An imported log may contain no load
    # factor.
    load_factors = np.fmax(loads, 1.0 / np.cos(np.minimum(banks, requirements.limits.max_bank)))
    stall_speeds = level_stall_speeds * np.sqrt(np.maximum(load_factors, 0.0))
    margins = speeds - stall_speeds
    if not np.isfinite(margins).any():
        return []
    k = int(np.nanargmin(margins))
    tolerance = STALL_TOLERANCE_MPS + GUST_SPEED_FRACTION * W20[requirements.setup.scenario.wind.turbulence]
    margin = _Margin(float(speeds[k]), float(stall_speeds[k]), float(level_stall_speeds[k]), float(banks[k]))
    return [_stall_finding(margin, f"at {track.time[k + width // 2]:.1f} s", tolerance, geometric=False)]


def planned_bank(requirements: RouteRequirements, waypoint: int, speed: float) -> float:
    """Return the bank that the turn at a waypoint needs at an airspeed (m/s), at most the bank limit, rad.

    On an arc of radius R, the bank is atan(v^2 / (g R)) at the highest ground speed v on the arc.  In a turn so short
    that the aircraft cannot roll in completely, it is only the bank that can be reached.
    """
    turn = abs(float(requirements.turns[waypoint]))
    radius = float(requirements.radius[waypoint])
    limit = requirements.limits.max_bank
    if turn <= 0.0 or not math.isfinite(radius):
        return 0.0
    # The radius at the bank limit is computed for the airspeed of the faster leg.
    max_ground_speed = math.sqrt(float(requirements.min_radius[waypoint]) * GRAVITY * math.tan(limit))
    speed_deficit = max(requirements.route.leg_airspeeds[waypoint - 1 : waypoint + 1]) - speed
    bank = math.atan(max(0.0, max_ground_speed - speed_deficit) ** 2 / (GRAVITY * radius))
    # Rolling in and out again at 1 / ROLL_TIME turns by (g / v) ROLL_TIME bank^2.
    reachable_bank = math.sqrt(turn * speed / (GRAVITY * ROLL_TIME))
    return min(bank, reachable_bank, limit)


def min_level_airspeed(requirements: RouteRequirements, altitude: float) -> float:
    """Return the minimum true airspeed of level flight at an altitude (m AMSL), m/s.

    It is limited by the elevator, which is at its stop at this airspeed.
    """
    return requirements.setup.envelope.level_speeds(altitude)[0]


def _window_means(values: NDArray[np.floating], width: int) -> Floats:
    """Return the moving means of n values over windows of `width` rows, (n + 1 - width,)."""
    sums = np.concatenate([[0.0], np.cumsum(values.astype(np.float64))])
    return np.asarray((sums[width:] - sums[:-width]) / width)


def _stall_finding(margin: _Margin, time_or_place_text: str, tolerance: float, *, geometric: bool) -> Finding:
    """Make the finding on a margin above the stall.

    time_or_place_text: text on the time or place of the margin, such as "at waypoint 3".
    tolerance: accepted deficit of airspeed, m/s.
    """
    speed_text, limit_text = compared_texts(margin.speed, margin.stall_speed, "m/s", 1)
    stall_text = (
        f"airspeed {speed_text} {time_or_place_text}; the stall speed is {limit_text} in"
        f" {math.degrees(margin.bank):.0f}° of bank"
    )
    fault = message(stall_text, f" and {margin.level_stall_speed:.1f} m/s in level flight (true airspeeds)")
    return make_finding(
        "stall",
        FLIGHT,
        ok=margin.above_stall >= -tolerance,
        reason=fault.text,
        faults=[fault],
        planned=margin.speed if geometric else None,
        flown=None if geometric else margin.speed,
        limit=margin.stall_speed,
        at_least=True,
        source="aircraft",
        tolerance=tolerance,
        margin=margin.above_stall,
        unit="m/s",
        method="slowest level flight times the root of the load factor",
    )


RULE = Rule(
    name="stall",
    tolerances=("STALL_AVERAGING_TIME_S", "STALL_TOLERANCE_MPS", "GUST_SPEED_FRACTION"),
    judge=stall_findings,
    judges_whole_flight=True,
    suggest=suggest_flying_faster,
    log=LogNeeds(("airspeed", "attitude"), needs_aircraft=True, reports_missing=True),
)
