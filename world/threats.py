"""Threats: missiles and radars, each a sphere about a position."""

from dataclasses import dataclass

import numpy as np

from world.arrays import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Threats:
    """Air-defence units (m of them); a radius of 0 means that a unit has no missile, or no radar.

    names: m labels, made by `threat_label`.
    position: (m, 3) east, north, up in m.
    kill_radius, detection_radius: (m,) m, the paper's R_PKmax and R_PRDmax.
    kill_scale, detection_scale: (m,) m, the paper's gamma and delta (eq. 9 and 10).
    """

    names: tuple[str, ...]
    position: Floats
    kill_radius: Floats
    detection_radius: Floats
    kill_scale: Floats
    detection_scale: Floats

    def __post_init__(self) -> None:
        """Replace the arrays by read-only copies."""
        for name in ("position", "kill_radius", "detection_radius", "kill_scale", "detection_scale"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        """Return the number of threats."""
        return len(self.names)


def threat_label(name: str, index: int) -> str:
    """Return the label of a threat: its name, or its number (from 1) if it has no name.

    >>> threat_label("east valley", 0), threat_label("", 2)
    ('east valley', 'threat 3')
    """
    return name or f"threat {index + 1}"
