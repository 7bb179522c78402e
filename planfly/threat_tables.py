"""Convert threats from a data frame, columns, mappings or an array to tables of a scenario file."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from world.errors import ArgumentError
from world.scenario_tables import SCALE_RATIOS

# Threats as a caller gives them.
GivenThreats = Mapping[str, ArrayLike] | Sequence[Mapping[str, Any]] | ArrayLike
# Keys of the columns of an array of threats.
_ARRAY_COLUMNS = ("east_m", "north_m", "kill_radius_m", "detection_radius_m")
_NAN_ALLOWED = "expected a number: 0 for a threat without this radius, None for a missing value"
_EXPECTED = (
    "expected a data frame or a mapping of columns named as the keys of [[threats]], a list of mappings with these"
    " keys, or an array (n, 4) of east, north, kill radius and detection radius, m"
)


def threat_tables(threats: Any) -> list[dict[str, Any]]:
    """Return a table of a scenario file for each threat, without missing values and radii of 0.

    threats: a data frame or a mapping of columns named as the keys of [[threats]], a list of mappings with these keys,
    or an array (n, 4) of east, north, kill radius and detection radius, m.  None and masked values are missing.

    Raises ArgumentError, which names the argument `threats`, for anything else, and for NaN.

    >>> threat_tables([(900.0, 90.0, 60.0, 0.0)])
    [{'east_m': 900.0, 'north_m': 90.0, 'kill_radius_m': 60.0}]
    """
    try:
        if isinstance(threats, Mapping):
            columns = {name: np.ma.asarray(values) for name, values in threats.items()}
            distinct_shapes = {column.shape for column in columns.values()}
            if len(distinct_shapes) > 1 or any(len(shape) != 1 for shape in distinct_shapes):
                shapes = ", ".join(f"{name} of shape {column.shape}" for name, column in columns.items())
                raise ArgumentError.of_argument("threats", shapes, "expected columns (n,) of equal length")
            values = [column.tolist() for column in columns.values()]
            rows = [dict(zip(columns, row, strict=True)) for row in zip(*values, strict=True)]
        elif hasattr(threats, "to_dict"):
            rows = threats.to_dict("records")
        elif len(threats) and all(isinstance(row, Mapping) for row in threats):
            rows = [dict(row) for row in threats]
        elif np.iscomplexobj(threats):
            raise TypeError(_EXPECTED)
        else:
            array = np.ma.asarray(threats, dtype=np.float64)
            if array.size and array.shape[1:] != (len(_ARRAY_COLUMNS),):
                raise ArgumentError.of_argument("threats", array, _EXPECTED, shown=f"of shape {array.shape}")
            rows = [dict(zip(_ARRAY_COLUMNS, row, strict=True)) for row in array.tolist()]
    except (TypeError, ValueError) as error:
        if isinstance(error, ArgumentError):
            raise
        raise ArgumentError.of_argument("threats", type(threats).__name__, _EXPECTED) from None
    tables = []
    for number, row in enumerate(rows):
        table = {}
        for key, value in row.items():
            is_nan = isinstance(value, float | np.floating) and math.isnan(value)
            if hasattr(value, "__len__") and not isinstance(value, str):
                shown = type(value).__name__
                raise ArgumentError.of_argument(f"threats row {number}: {key}", value, "expected a number", shown=shown)
            if is_nan and key != "name":
                raise ArgumentError.of_argument(f"threats row {number}: {key}", float(value), _NAN_ALLOWED)
            if value is not None and not is_nan:
                table[key] = value
        for kind in SCALE_RATIOS:
            radius, scale = f"{kind}_radius_m", f"{kind}_scale_m"
            if table.get(radius) == 0.0:
                table = {key: value for key, value in table.items() if key not in (radius, scale)}
            elif isinstance(table.get(radius), str):
                raise ArgumentError.of_argument(
                    f"threats: column {radius}", table[radius], "expected numbers, not text"
                )
        tables.append(table)
    return tables
