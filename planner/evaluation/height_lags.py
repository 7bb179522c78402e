"""How far an autopilot is below or above the legs that it follows late: the height that a plan leaves it for that.

Height follows the demand as a first-order lag of `TrackingError.lag` seconds: on a long climb it is lag x climb rate
low, and that far high on a descent; after a change of slope the difference decays over the lag's length, from leg to
leg.  A leg that changes height by less than a step is demanded at its end's height from its beginning.  So ArduPlane's
TECS does it (ardupilot.org, Plane, TECS_HDEM_TCONST; GLIDE_SLOPE_MIN).
"""

import math

import numpy as np

from aircraft.envelope import ground_speed
from aircraft.path_limits import PerformanceTable, wind_speed_at
from aircraft.tracking import faster_by
from planner.evaluation.leg_geometry import Wind
from world.kernels import Record, Records, compiled, inlined

# How far the aircraft is below a leg at a share f of it, m: steady + slant (1 - f) + rest E(f x decay), where E is the
# decay; and the most and the least of that and 0.
HEIGHT_LAG = np.dtype([(name, np.float64) for name in ("steady", "slant", "rest", "decay", "most", "least")])


@inlined
def _left(lengths: float) -> float:  # pragma: no cover - compiled
    """What is left of a difference after so many lengths of the lag: exp(-x), a little more."""
    # By four terms of exp(x): a library's exponential rounds as the machine has it.
    left: float = 1.0 / (1.0 + lengths * (1.0 + lengths * (0.5 + lengths / 6.0)))
    return left


@inlined
def lag_length(
    tracking: Record, aircraft: PerformanceTable, east: float, north: float, amsl: float, wind: Wind
) -> float:  # pragma: no cover - compiled
    """Way (m) over the ground that the aircraft makes in its height's lag on a unit course."""
    speed, (wx, wy) = wind_speed_at(aircraft, amsl), wind
    along = ground_speed(aircraft.airspeed, speed * (east * wx + north * wy), speed * (east * wy - north * wx))
    # Where the wind leaves no way there is no plan either.
    along = aircraft.airspeed if math.isnan(along) else along
    length: float = tracking.lag * (along + faster_by(tracking, amsl))
    return max(1e-6, length)


@inlined
def set_lag(
    tracking: Record, length: float, run: float, rise: float, below: float, lag: Record
) -> float:  # pragma: no cover - compiled
    """Fill a `HEIGHT_LAG` record of a leg; returns how far the aircraft is below its end, m.

    length: of `lag_length`.  run, rise: of the leg.  below: how far the aircraft is below its beginning, m.
    """
    lag.steady, lag.slant = length * rise / max(run, 1e-6), 0.0
    if abs(rise) < tracking.step:
        lag.steady, lag.slant = 0.0, -rise
    lag.rest = below - lag.steady - lag.slant
    lag.decay = run / length
    end: float = lag.steady + lag.rest * _left(lag.decay)
    lag.most, lag.least = max(0.0, below, end, lag.slant), min(0.0, below, end, lag.slant)
    return end


@compiled
def measure_lags(
    tracking: Record, aircraft: PerformanceTable, wind: Wind, path: np.ndarray, legs: Records, lags: Records
) -> None:  # pragma: no cover - compiled
    """Fill `HEIGHT_LAG` records (w - 1,) of a path (w, 3) that begins at its own height."""
    below = 0.0
    for i in range(legs.shape[0]):
        leg, rise = legs[i], path[i + 1, 2] - path[i, 2]
        length = lag_length(tracking, aircraft, leg.east, leg.north, path[i, 2], wind)
        below = set_lag(tracking, length, leg.run, rise, below, lags[i])


@inlined
def below_at(lag: Record, share: float) -> float:  # pragma: no cover - compiled
    """How far the aircraft is below a leg at a share of it, m; negative above."""
    below: float = lag.steady + lag.slant * (1.0 - share) + lag.rest * _left(share * lag.decay)
    return below
