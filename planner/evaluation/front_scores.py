"""Compute the values by which the plans of a Pareto front are compared.

Exposure is the paper's detection density (eq. 10 of Yang, Tang and Lozano, CEC 2014), integrated over the time of
flight in the mean wind, in seconds at full density. The minimum height above ground is taken at samples of each leg.
The other values are length, time and energy.
"""

import math
from enum import IntEnum

import numpy as np

from planner.evaluation.problem import ProblemArrays
from planner.evaluation.travel_cost import LENGTH_COST, TravelCost, leg_cost
from world.arrays import Floats
from world.frames import polymap
from world.geometry import window_exposure
from world.kernels import Record, compiled, inner
from world.terrain import TILE_PIXELS, pixel_height

_LENGTH_COLUMN = 0
_EXPOSURE_COLUMN = 1
_CLEARANCE_COLUMN = 2
_TIME_COLUMN = 3
_ENERGY_COLUMN = 4


class Value(IntEnum):
    """Columns of the values by which paths are compared.

    Length (m), exposure (s), clearance (m), time (s) and energy (J).
    """

    LENGTH = 0
    EXPOSURE = 1
    CLEARANCE = 2
    TIME = 3
    ENERGY = 4


def front_values(data: ProblemArrays, energy: TravelCost | None, paths: Floats) -> Floats:
    """Return the values of each path in the order of `Value`, (n, 5), in m, s, m, s and J.

    energy: cost function for energy, as `make_travel_cost` returns it, of which only the power coefficients and the
        winds are used; if None, the energy is NaN.
    paths: (n, w, 3) m.
    """
    out = np.zeros((len(paths), len(Value)))
    time_cost = LENGTH_COST._replace(length=0.0, time=1.0, winds=data.travel.winds)
    energy_cost = time_cost if energy is None else energy._replace(length=0.0, time=0.0, energy=1.0)
    _fill_values(data, time_cost, energy_cost, np.ascontiguousarray(paths), out)
    if energy is None:
        out[:, Value.ENERGY] = np.nan
    return out


@compiled
def _fill_values(
    data: ProblemArrays, time_cost: TravelCost, energy_cost: TravelCost, paths: Floats, out: Floats
) -> None:
    """Fill a table with the values of paths: length, exposure, clearance, time and energy.

    time_cost, energy_cost: costs of a leg in time (s) and in energy.
    paths: (n, w, 3) m.
    out: (n, 5) table of zeros to fill, in the order of `Value`.

    The exposure is the mean detection on a leg times the leg's time; the clearance is the smallest height.
    """
    for n in range(paths.shape[0]):
        path = paths[n]
        min_height = math.inf
        for i in range(path.shape[0] - 1):
            start, end = path[i], path[i + 1]
            dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
            seconds = leg_cost(time_cost, data.aircraft, start, end)
            out[n, _LENGTH_COLUMN] += math.sqrt(dx * dx + dy * dy + dz * dz)
            out[n, _EXPOSURE_COLUMN] += seconds * _mean_detection(data, start, dx, dy, dz)
            min_height = _min_height(data, start, dx, dy, dz, min_height)
            out[n, _TIME_COLUMN] += seconds
            out[n, _ENERGY_COLUMN] += leg_cost(energy_cost, data.aircraft, start, end)
        out[n, _CLEARANCE_COLUMN] = min_height


@inner
def _mean_detection(data: ProblemArrays, start: Floats, dx: float, dy: float, dz: float) -> float:
    """Return the mean detection density along a leg, summed over the radars whose range it enters.

    start: (3,) start of the leg, m.
    dx, dy, dz: vector of the leg, m.
    """
    total, length2 = 0.0, dx * dx + dy * dy + dz * dz
    if length2 < 1e-12:
        return 0.0
    for k in range(data.threats.shape[0]):
        threat: Record = data.threats[k]
        radius = threat.detection_radius
        if radius <= 0.0:
            continue
        x, y, z = start[0] - threat.east, start[1] - threat.north, start[2] - threat.up
        dot, start2 = dx * x + dy * y + dz * z, x * x + y * y + z * z
        mid_fraction = -dot / length2
        discriminant = mid_fraction * mid_fraction - (start2 - radius * radius) / length2
        if discriminant <= 0.0:
            continue
        half_fraction = math.sqrt(discriminant)
        begin_fraction, end_fraction = max(0.0, mid_fraction - half_fraction), min(1.0, mid_fraction + half_fraction)
        if end_fraction > begin_fraction:
            total += window_exposure(begin_fraction, end_fraction, length2, dot, start2, threat.detection_scale)
    return total


@inner
def _min_height(data: ProblemArrays, start: Floats, dx: float, dy: float, dz: float, min_height: float) -> float:
    """Return the minimum height above ground at samples of a leg and on the earlier legs, m.

    start: (3,) start of the leg, m.
    dx, dy, dz: vector of the leg, m.
    min_height: minimum height on the earlier legs, m.

    The result is -inf off the terrain. A sample is skipped if the steepest slope nearby shows that the ground cannot be
    closer there.
    """
    horizontal_length = math.sqrt(dx * dx + dy * dy)
    count = 1 + int(horizontal_length / data.sample_spacing)
    tiles, k = data.slope_bounds.tiles, 0
    while True:
        fraction = k / count
        column, row = polymap(data.to_pixel, start[0] + fraction * dx, start[1] + fraction * dy)
        height = start[2] + fraction * dz - pixel_height(data.heights, column, row)
        if not height >= min_height:
            min_height = -math.inf if math.isnan(height) else height
        if k == count or min_height == -math.inf:
            return min_height
        i = min(max(int(row) // TILE_PIXELS, 0), tiles.shape[0] - 1)
        j = min(max(int(column) // TILE_PIXELS, 0), tiles.shape[1] - 1)
        skip_fraction = (height - min_height) / (tiles[i, j] * horizontal_length + abs(dz) + 1e-9)
        skip_fraction = min(skip_fraction, data.slope_bounds.tile_side / (horizontal_length + 1e-9))
        k = min(count, k + max(1, int(skip_fraction * count)))
