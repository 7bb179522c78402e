"""The pictures of a plan and its flight, ready for a file or a page.

`logs.figure_map`, `logs.figure_profile` and `logs.figure_time` draw them.  Importing this module imports matplotlib
(most of a second): commands import it when they draw.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from flight.setup import FlightSetup
from flight.track import Track
from logs.figure_map import draw_map
from logs.figure_profile import draw_profile
from logs.figure_style import png_bytes
from logs.figure_time import draw_time_plots
from logs.verdict import Verdict
from world.files import write_whole

__all__ = ["Pictures", "draw_map", "draw_pictures", "draw_profile", "draw_time_plots", "write_png"]


@dataclass(frozen=True, slots=True)
class Pictures:
    """The pictures as PNG bytes, each 1500 px wide; time_plots is None where nothing was flown."""

    map: bytes
    profile: bytes
    time_plots: bytes | None


def draw_pictures(setup: FlightSetup, track: Track | None, verdict: Verdict | None) -> Pictures:
    """Draw all pictures of a flight, or of a plan that was not flown."""
    plan = setup.plan.waypoints if setup.plan is not None else None
    paths: dict[str, Any] = {"plan_waypoints": plan, "route_waypoints": setup.route.waypoints}
    flown = track if track is not None and len(track) else None
    return Pictures(
        map=png_bytes(draw_map(setup.scenario, **paths, track=flown, verdict=verdict)),
        profile=png_bytes(draw_profile(setup.scenario, **paths, track=flown, verdict=verdict)),
        time_plots=png_bytes(draw_time_plots(setup, flown)) if flown is not None else None,
    )


def write_png(figure: Figure, path: Path) -> None:
    """Write the figure as a PNG, whole or not at all.  Raises OSError."""
    write_whole(path, png_bytes(figure))
