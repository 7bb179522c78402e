"""Signals of a steady state, by their numbers alone."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from aircraft.identification.alignment import Signals


def steady(rows: int = 2000, hertz: float = 50.0, **values: ArrayLike) -> Signals:
    """Signals that stay at these values (SI), each a number or as many as its field has columns; the rest is 0.

    Airspeed is 25 m/s, density 1.2 kg/m^3 and the throttle 0.6; no battery is logged.
    """
    widths: Mapping[str, int] = {
        "acceleration": 3,
        "rates": 3,
        "rate_changes": 3,
        "attitude": 3,
        "velocity": 3,
        "wind": 2,
        "surfaces": 3,
    }
    flat = {"airspeed": 25.0, "density": 1.2, "throttle": 0.6, "current": np.nan, "voltage": np.nan}
    made = {
        name: np.tile(np.asarray(values.get(name, np.zeros(width)), float), (rows, 1)) for name, width in widths.items()
    }
    made |= {name: np.full(rows, values.get(name, value), float) for name, value in flat.items()}
    block = (np.arange(rows) // 500).astype(np.int64)
    return Signals(**made, edges=(0, rows), block=block, hertz=hertz)
