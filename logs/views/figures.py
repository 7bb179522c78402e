"""The pictures of a plan and its flight, ready for a file or a page.

Each is drawn by a module of `logs.views`.  Importing this module imports matplotlib (most of a second): commands
import it when they draw.
"""

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import Verdict
from logs.verdict.measures.route_requirements import with_fence_zones
from logs.views.drawing import png_bytes, svg_bytes
from logs.views.envelope import draw_envelope_and_flight
from logs.views.map import draw_map
from logs.views.profile import draw_profile
from logs.views.scene import draw_scene
from logs.views.time_series import draw_controls, draw_energy, draw_exposure, draw_time_plots
from logs.views.turns import draw_turns
from world.files import write_whole

__all__ = [
    "FIGURE_FILES", "draw_figures", "draw_map", "draw_pictures", "draw_profile", "draw_time_plots", "write_png",
]  # fmt: skip

# Those that are files too, beside the page; the others are in the page alone.
FIGURE_FILES = ("map", "profile", "scene", "turns", "envelope")


def draw_figures(setup: FlightSetup, track: Track | None, verdict: Verdict) -> dict[str, Figure]:
    """Draw all pictures of a flight, or of a plan that was not flown, by name; what has no data is left out.

    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.judge_geometry import judge_geometry
    >>> setup = example_log().setup
    >>> list(draw_figures(setup, None, judge_geometry(setup)))
    ['map', 'profile', 'scene', 'turns', 'envelope']
    """
    drawn = with_fence_zones(setup)
    plan = setup.plan.waypoints if setup.plan is not None else None
    paths: dict[str, Any] = {"plan_waypoints": plan, "route_waypoints": setup.route.waypoints}
    flown = track if track is not None and len(track) else None
    found: dict[str, Figure | None] = {
        "map": draw_map(drawn.scenario, **paths, track=flown, verdict=verdict),
        "profile": draw_profile(drawn.scenario, **paths, track=flown, verdict=verdict),
        "scene": draw_scene(drawn, flown, verdict),
        "turns": draw_turns(setup.scenario.name, verdict),
        "envelope": draw_envelope_and_flight(setup, flown),
    }
    if flown is not None:
        found |= {
            "time": draw_time_plots(setup, flown),
            "exposure": draw_exposure(setup, flown),
            "controls": draw_controls(setup, flown),
            "energy": draw_energy(setup, flown),
        }
    return {name: figure for name, figure in found.items() if figure is not None}


def draw_pictures(setup: FlightSetup, track: Track | None, verdict: Verdict, *, svg: bool = False) -> dict[str, bytes]:
    """Render the pictures, each 1500 px wide: file names (`map.png`) and bytes.

    svg: those of `FIGURE_FILES` as `map.svg` and so on, too.
    """
    figures = draw_figures(setup, track, verdict)
    found = {f"{name}.png": png_bytes(figure) for name, figure in figures.items()}
    if svg:
        found |= {f"{name}.svg": svg_bytes(figures[name]) for name in FIGURE_FILES if name in figures}
    return found


def write_png(figure: Figure, path: Path) -> None:
    """Write the figure as a PNG, whole or not at all.  Raises OSError.

    >>> import tempfile
    >>> from logs.views.drawing import new_figure
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_png(new_figure(2.0), Path(folder) / "empty.png")
    ...     (Path(folder) / "empty.png").read_bytes()[1:4]
    b'PNG'
    """
    write_whole(path, png_bytes(figure))
