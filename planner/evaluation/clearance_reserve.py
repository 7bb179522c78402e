"""The height above ground that a path needs: the required clearance, and a reserve that fixed ends may not have."""

import math

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.problem_arrays import Rules
from world.kernels import compiled, inlined

Floats = NDArray[np.float64]

# Growth of the clearance reserve away from an end that starts without it, m per m.
RESERVE_GROWTH = 0.05


@compiled
def pack_clearance(rules: Rules) -> Floats:  # pragma: no cover - compiled
    """What the terrain is judged with, (12,): clearance, reserve; east, north, slack of both ends; and steps.

    The last four: pitch of samples (m), the steepest loss of height above the required clearance (m per m), whether
    the reserve is the same everywhere (1 or 0), and what the reserve alone adds to the ground's slope.
    """
    out = np.zeros(12)
    out[0], out[1] = rules.clearance, rules.reserve
    out[2], out[3], out[4] = rules.start[0], rules.start[1], rules.start_slack
    out[5], out[6], out[7] = rules.destination[0], rules.destination[1], rules.destination_slack
    whole = min(rules.start_slack, rules.destination_slack) >= rules.reserve
    out[11] = 0.0 if whole else RESERVE_GROWTH
    out[8], out[9] = rules.pitch, rules.steep.most + out[11]
    out[10] = 1.0 if whole else 0.0
    return out


@inlined
def required_clearance(clear: Floats, east: float, north: float) -> float:  # pragma: no cover - compiled
    """Height above ground that a path needs here, m: the reserve grows from what the fixed ends leave of it.

    clear: of `pack_clearance`.
    """
    # Without branches, so that a loop over many places becomes vector instructions: an end that leaves the whole
    # reserve takes nothing from it anywhere.
    dx, dy = east - clear[2], north - clear[3]
    keep = clear[4] + RESERVE_GROWTH * math.sqrt(dx * dx + dy * dy)
    dx, dy = east - clear[5], north - clear[6]
    other = clear[7] + RESERVE_GROWTH * math.sqrt(dx * dx + dy * dy)
    keep = other if other < keep else keep
    keep = keep if keep < clear[1] else clear[1]
    need: float = clear[0] + keep
    return need
