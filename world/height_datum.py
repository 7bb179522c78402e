"""Vertical datum of an elevation file: mean sea level, or the ellipsoid.

The ellipsoid is some 47 m lower in the Alps.

Heights above an ellipsoid are converted with PROJ's grid of the geoid if this machine has it, and rejected otherwise.
A datum that the user states overrides the datum of the file.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np

from world.arrays import Floats

# Datum as the user states it: its name, or the height of mean sea level in the file, m.
NamedDatum = Literal["ellipsoid", "egm96", "egm2008"]
StatedDatum = str | float
# Largest height of mean sea level that may be stated, m; the geoid is nowhere more than 110 m from the ellipsoid.
MAX_SEA_LEVEL = 200.0

# EPSG codes of the heights above each geoid.  The first geoid with an installed grid is used; EGM96 is the datum of
# satellite receivers and autopilots.
GEOIDS = {"EGM96": 5773, "EGM2008": 3855}
_MEAN_SEA_LEVEL = "mean sea level"
UNSTATED = f"{_MEAN_SEA_LEVEL} (assumed, because the file states no datum)"


@dataclass(frozen=True, slots=True)
class HeightDatum:
    """Vertical datum of heights.

    text: description of the datum after the conversion.
    sea_level: function from longitudes and latitudes (deg) to the height of mean sea level in the file, m; None if this
        height is 0 everywhere.
    """

    text: str
    sea_level: Callable[[Floats, Floats], Floats] | None = None


def is_above_ellipsoid(crs: str) -> bool:
    """Return True if the heights of a reference system are above an ellipsoid; False without heights.

    >>> is_above_ellipsoid("EPSG:4979"), is_above_ellipsoid("EPSG:4326+5773"), is_above_ellipsoid("EPSG:4326")
    (True, False, False)
    """
    from pyproj import CRS

    system = CRS.from_user_input(crs)
    names = [axis.name for axis in system.axis_info if axis.direction in ("up", "down")]
    for part in system.sub_crs_list:
        if part.is_vertical:
            names += [part.name, part.datum.name if part.datum else ""]
    return any("ellipsoid" in name.lower() for name in names)


def height_datum(crs: str | None, stated_datum: StatedDatum | None) -> HeightDatum:
    """Determine the vertical datum of an elevation file, and its conversion to mean sea level.

    crs: the file's reference system, or None if unknown.
    stated_datum: datum stated by the user, a `NamedDatum` or a number, which overrides the file's datum; None if not
        stated.

    Raises ValueError for depths, and for heights above an ellipsoid if no geoid grid is installed.
    """
    if stated_datum is not None and not isinstance(stated_datum, str):
        return HeightDatum(
            f"{_MEAN_SEA_LEVEL} (at {stated_datum:g} m in the file's heights, as stated)",
            lambda lon, _: np.full(np.shape(lon), stated_datum),
        )
    if stated_datum in ("egm96", "egm2008"):
        return HeightDatum(f"{_MEAN_SEA_LEVEL} ({stated_datum.upper()}, as stated)")
    if stated_datum == "ellipsoid" or (crs is not None and is_above_ellipsoid(crs)):
        name, transformer = _find_geoid()

        def sea_level(lon: Floats, lat: Floats) -> Floats:
            """Return the geoid's height above the ellipsoid at longitudes and latitudes (deg), m.

            It is minus the height above the geoid of a point on the ellipsoid.
            """
            _, _, negated_heights = transformer.transform(lon, lat, np.zeros(np.shape(lon)))
            return -np.asarray(negated_heights, dtype=np.float64)

        return HeightDatum(f"{_MEAN_SEA_LEVEL}, converted from the ellipsoid by {name}", sea_level)
    name = ""
    if crs is not None:
        from pyproj import CRS

        system = CRS.from_user_input(crs)
        if any(axis.direction == "down" for axis in system.axis_info):
            raise ValueError("heights are positive downwards, as depths")
        name = next((part.name for part in system.sub_crs_list if part.is_vertical), "")
    return HeightDatum(f"{_MEAN_SEA_LEVEL} ({name}, as the file states)" if name else UNSTATED)


@cache
def _find_geoid() -> tuple[str, Any]:
    """Return the name of the first geoid whose grid is installed, and the transformer to heights above it.

    Raises ValueError if none is installed.
    """
    from pyproj import Transformer
    from pyproj.transformer import TransformerGroup

    for name, code in GEOIDS.items():
        target = f"EPSG:4326+{code}"
        with warnings.catch_warnings():
            # PROJ warns of a missing grid, but this loop only looks for an installed one.
            warnings.simplefilter("ignore", UserWarning)
            if TransformerGroup("EPSG:4979", target, always_xy=True).best_available:
                return name, Transformer.from_crs("EPSG:4979", target, always_xy=True, only_best=True)
    raise ValueError("heights are above the ellipsoid, and no geoid grid is available")
