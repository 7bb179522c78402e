"""The height above ground that a path needs: the required clearance, and a reserve that fixed ends may not have."""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled
from planner.rules import Rules

Floats = NDArray[np.float64]

# Growth of the clearance reserve away from an end that starts without it, m per m.
RESERVE_GROWTH = 0.05


@compiled
def pack_clearance(rules: Rules) -> Floats:  # pragma: no cover - compiled
    """What the terrain is judged with, (12,): clearance, reserve; east, north, slack of both ends; and steps.

    The last four: pitch of samples (m), the steepest loss of height above the required clearance (m per m), whether
    the reserve is the same everywhere (1 or 0), and nothing.
    """
    out = np.zeros(12)
    out[0], out[1] = rules.clearance, rules.reserve
    out[2], out[3], out[4] = rules.start[0], rules.start[1], rules.start_slack
    out[5], out[6], out[7] = rules.destination[0], rules.destination[1], rules.destination_slack
    whole = min(rules.start_slack, rules.destination_slack) >= rules.reserve
    out[8], out[9] = rules.pitch, rules.steepest + (0.0 if whole else RESERVE_GROWTH)
    out[10] = 1.0 if whole else 0.0
    return out


@compiled
def required_clearance(clear: Floats, east: float, north: float) -> float:  # pragma: no cover - compiled
    """Height above ground that a path needs here, m: the reserve grows from what the fixed ends leave of it.

    clear: of `pack_clearance`.
    """
    keep = clear[1]
    if clear[4] < keep:
        away = math.sqrt((east - clear[2]) ** 2 + (north - clear[3]) ** 2)
        keep = min(keep, clear[4] + RESERVE_GROWTH * away)
    if clear[7] < keep:
        away = math.sqrt((east - clear[5]) ** 2 + (north - clear[6]) ** 2)
        keep = min(keep, clear[7] + RESERVE_GROWTH * away)
    need: float = clear[0] + keep
    return need
