"""What fails, named beside its place and, of threats, drawn where the flight was inside them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from flight.simulation.track import Track
from logs.figures.elements import style
from logs.figures.elements.failures import Failures
from logs.figures.elements.labels import LabelPlacer
from logs.verdict.places import Place
from world.threats import Threats

Floats = NDArray[np.float64]

# More labels than these would cover what they tell of.
_MOST = 16


def write_fail_labels(
    failed: Failures, corners: Floats, threats_at: Mapping[int, tuple[float, float]], placer: LabelPlacer, gap: float
) -> None:
    """Name the rules that fail beside the first failing legs, threats and waypoints, as the verdict names those.

    corners: (w, 2) drawn positions of the route's waypoints.  threats_at: of threats by their index; others get none.
    gap: pixels between label and place.
    """
    middles = 0.5 * (corners[:-1] + corners[1:])
    labels = [(f"{failed.name('leg', k)}: {', '.join(rules)}", *middles[k]) for k, rules in failed.legs.items()]
    labels += [(f"{text}: threat", *threats_at[k]) for k, text in failed.threat_names().items() if k in threats_at]
    labels += [
        (f"{failed.name('waypoint', k)}: {', '.join(rules)}", *corners[k]) for k, rules in failed.waypoints.items()
    ]
    frame: dict[str, Any] = {
        "boxstyle": "round,pad=0.2",
        "facecolor": "white",
        "edgecolor": style.FAIL,
        "linewidth": 0.9,
    }
    for text, x, y in labels[:_MOST]:
        placer.place(text, float(x), float(y), size=7.0, gap=gap, color=style.FAIL, bbox=frame)


def radius_of(threats: Threats, place: Place) -> float:
    """Radius (m) of the sphere that a failing place is: a missile's or a radar's."""
    radii = threats.kill_radius if place.kind == "missile" else threats.detection_radius
    return float(radii[place.index or 0])


def inside_threats(failed: Failures, threats: Threats, track: Track) -> NDArray[np.bool_]:
    """Rows (t,) of the track inside a sphere whose rule fails."""
    inside = np.zeros(len(track), dtype=bool)
    for place in failed.threats:
        away = track.position - threats.position[place.index or 0]
        inside |= (away**2).sum(axis=1) < radius_of(threats, place) ** 2
    return inside


def draw_inside(axes: Any, x: Floats, y: Floats, inside: NDArray[np.bool_]) -> list[Any]:
    """Draw the part of a flown line that is inside, broad; returns what the legend shows of it."""
    if not inside.any():
        return []
    look: dict[str, Any] = {"color": style.FAIL, "linewidth": 3.6, "solid_capstyle": "round"}
    axes.plot(np.where(inside, x, np.nan), np.where(inside, y, np.nan), zorder=6.5, **look)
    return [Line2D([], [], label="flown inside a threat's reach", **look)]
