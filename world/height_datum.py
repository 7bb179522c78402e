"""What an elevation file's heights count from: mean sea level, or the ellipsoid, some 47 m below it in the Alps.

A file whose reference system counts from an ellipsoid is converted by PROJ's grid of the geoid where this machine has
it, and refused otherwise.  A person may state what the heights count from, whatever the file says.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
# As stated by a person: the name of what heights count from, or the height of mean sea level in the file, m.
NamedDatum = Literal["ellipsoid", "egm96", "egm2008"]
StatedDatum = str | float
# m.  The geoid is nowhere farther from the ellipsoid than 110 m.
MAX_SEA_LEVEL = 200.0

# Geoids by EPSG's code of the height above them.  The first whose grid is at hand is taken: satellite receivers and
# autopilots count from EGM96.
GEOIDS = {"EGM96": 5773, "EGM2008": 3855}
_MEAN_SEA_LEVEL = "mean sea level"
UNSTATED = f"{_MEAN_SEA_LEVEL}, as the file's heights are taken"


@dataclass(frozen=True, slots=True)
class HeightDatum:
    """What heights count from.

    text: for a reader, what they count from after the conversion.
    sea_level: height of mean sea level in the file at longitudes and latitudes (deg), m; None where it is 0.
    """

    text: str
    sea_level: Callable[[Floats, Floats], Floats] | None = None


def counts_from_ellipsoid(crs: str) -> bool:
    """Whether a reference system's heights count from an ellipsoid; one without heights says nothing.

    >>> counts_from_ellipsoid("EPSG:4979"), counts_from_ellipsoid("EPSG:4326+5773"), counts_from_ellipsoid("EPSG:4326")
    (True, False, False)
    """
    from pyproj import CRS

    system = CRS.from_user_input(crs)
    names = [axis.name for axis in system.axis_info if axis.direction in ("up", "down")]
    for part in system.sub_crs_list:
        if part.is_vertical:
            names += [part.name, part.datum.name if part.datum else ""]
    return any("ellipsoid" in name.lower() for name in names)


def height_datum(crs: str | None, stated: StatedDatum | None) -> HeightDatum:
    """What a file's heights count from.

    crs: the file's reference system; None where it has none.
    stated: by a person, who knows better than the file: a `NamedDatum` or a number; None where nobody did.

    Raises ValueError for heights above an ellipsoid where no grid of a geoid is at hand, and for depths.
    """
    if stated is not None and not isinstance(stated, str):
        return HeightDatum(f"{_MEAN_SEA_LEVEL}, at {stated:g} m of the file's heights as stated", _level(stated))
    if stated in ("egm96", "egm2008"):
        return HeightDatum(f"{_MEAN_SEA_LEVEL} ({stated.upper()}, as stated)")
    if stated == "ellipsoid" or (crs is not None and counts_from_ellipsoid(crs)):
        name, transformer = _geoid()
        return HeightDatum(f"{_MEAN_SEA_LEVEL}, converted from the ellipsoid by {name}", _undulation(transformer))
    if crs is not None and _counts_downwards(crs):
        raise ValueError("heights count downwards, as depths")
    name = "" if crs is None else _vertical_name(crs)
    return HeightDatum(f"{_MEAN_SEA_LEVEL} ({name}, as the file states)" if name else UNSTATED)


def _level(height: float) -> Callable[[Floats, Floats], Floats]:
    return lambda lon, _: np.full(np.shape(lon), height)


def _undulation(transformer: Any) -> Callable[[Floats, Floats], Floats]:
    """The geoid's height above the ellipsoid: what is lost when an ellipsoidal height of 0 is converted."""

    def heights(lon: Floats, lat: Floats) -> Floats:
        _, _, below = transformer.transform(lon, lat, np.zeros(np.shape(lon)))
        return -np.asarray(below, dtype=np.float64)

    return heights


@cache
def _geoid() -> tuple[str, Any]:
    """Name of a geoid whose grid this machine has, and the conversion to heights above it."""
    from pyproj import Transformer
    from pyproj.transformer import TransformerGroup

    for name, code in GEOIDS.items():
        target = f"EPSG:4326+{code}"
        with warnings.catch_warnings():
            # That the grid is missing is what is asked.
            warnings.simplefilter("ignore", UserWarning)
            if TransformerGroup("EPSG:4979", target, always_xy=True).best_available:
                return name, Transformer.from_crs("EPSG:4979", target, always_xy=True, only_best=True)
    raise ValueError("heights count from the ellipsoid, and no grid of a geoid is at hand")


def _counts_downwards(crs: str) -> bool:
    from pyproj import CRS

    return any(axis.direction == "down" for axis in CRS.from_user_input(crs).axis_info)


def _vertical_name(crs: str) -> str:
    from pyproj import CRS

    return next((part.name for part in CRS.from_user_input(crs).sub_crs_list if part.is_vertical), "")
