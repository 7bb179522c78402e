"""Render the frames of a movie of a flight: the map, the aircraft and its trail, and numbers.

Frames depend only on the log and the speed of the movie, not on the clock.  The map is drawn once; each frame adds the
moving parts.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.markers import MarkerStyle
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs import theme
from logs.verdict.measures.route_requirements import with_fence_zones
from logs.verdict.measures.track_alignment import find_leg_ends, with_legs
from logs.views.charts import shorten
from logs.views.draw_map import draw_map
from logs.views.drawing import clean_style
from logs.views.map import flight_map
from world.arrays import Floats

Pixels = NDArray[np.uint8]

# Frames a second.
RATE = 12
# Resolution of the frames, pixels an inch.
_DPI = 100.0
# Largest number of points of the trail; an hour of flight has more points than a screen.
_MAX_TRAIL_POINTS = 4000


@dataclass(frozen=True, slots=True)
class MovieFrames:
    """The frames of a movie of a flight, `RATE` a second.

    start, end: flight time of the first and the last frame, s.
    speed: speed of the movie as a multiple of the flight's.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> movie = MovieFrames(log.setup, log.track, 0.0, log.end_time, speed=10.0)
    >>> len(movie), movie.times()[:2]
    (45, array([0. , 0.83333333]))
    >>> next(movie.frames()).shape
    (726, 1000, 3)
    """

    setup: FlightSetup
    track: Track
    start: float
    end: float
    speed: float

    def __len__(self) -> int:
        """Return the number of frames, at least 2: the first shows the start, the last the end."""
        return max(1, math.ceil((self.end - self.start) * RATE / self.speed - 1e-9)) + 1

    def times(self) -> Floats:
        """Return the flight time that each frame shows, s, (n,)."""
        return np.minimum(self.end, self.start + np.arange(len(self)) * self.speed / RATE)

    def frames(self) -> Iterator[Pixels]:
        """Yield each frame as its red, green and blue pixels, (height, width, 3).

        Height and width are even, as video formats require.
        """
        setup, track = self.setup, with_legs(self.track, find_leg_ends(self.setup, self.track))
        figure = draw_map(
            flight_map(
                with_fence_zones(setup).scenario,
                plan_waypoints=None,
                route_waypoints=setup.route.positions,
                track=None,
                verdict=None,
                stops=setup.route.stops.tolist(),
                items=setup.route.items.tolist(),
            )
        )
        axes = figure.axes[0]
        figure.set_dpi(_DPI)
        canvas = FigureCanvasAgg(figure)
        with clean_style():
            axes.set_title(f"{shorten(setup.scenario.name, 60)}: the flight", fontweight="bold")
            canvas.draw()  # type: ignore[no-untyped-call]  # matplotlib has no types here
            ground = canvas.copy_from_bbox(figure.bbox)  # type: ignore[no-untyped-call]  # nor here
            moving = _MovingParts(figure, axes, setup, track)
            for time in self.times():
                canvas.restore_region(ground)  # type: ignore[no-untyped-call]  # nor here
                moving.show(float(time))
                pixels: Pixels = np.asarray(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]  # nor here
                yield pixels[: len(pixels) // 2 * 2, : pixels.shape[1] // 2 * 2].copy()


class _MovingParts:
    """The parts that each frame draws over the map: trail, aircraft, and a line of numbers."""

    def __init__(self, figure: Figure, axes: Any, setup: FlightSetup, track: Track) -> None:
        """Add the moving parts to the axes of the map and to the figure; `show` draws them."""
        self._axes, self._figure, self._setup, self._track = axes, figure, setup, track
        look: dict[str, Any] = {"animated": True, "zorder": 9}
        (self._trail,) = axes.plot([], [], color=theme.colour("flown"), linewidth=1.6, **look)
        (self._aircraft,) = axes.plot([], [], linestyle="", markersize=17.0, color=theme.colour("aircraft"), **look)
        self._text = figure.text(
            0.02,
            0.018,
            "",
            family="monospace",
            fontsize=9.5,
            va="bottom",
            animated=True,
            bbox={"facecolor": theme.colour("paper"), "edgecolor": theme.colour("rim"), "pad": 4.0},
        )
        position = track.position
        terrain = setup.scenario.terrain
        ground = np.full(len(position), math.nan)
        if terrain is not None:
            ground = np.asarray(terrain.height(position[:, 0], position[:, 1]))
        self._above = position[:, 2] - ground
        self._step = max(1, len(position) // _MAX_TRAIL_POINTS)

    def show(self, time: float) -> None:
        """Draw trail, aircraft and numbers in the track's last row at or before a flight time, s."""
        track = self._track
        k = max(0, int(np.searchsorted(track.time, time, side="right")) - 1)
        rows = np.append(np.arange(0, k, self._step), k)
        trail = track.position[rows]
        self._trail.set_data(trail[:, 0], trail[:, 1])
        _, _, yaw = track.attitude[k].tolist()
        rotation = Affine2D().rotate(-yaw if math.isfinite(yaw) else 0.0)
        self._aircraft.set_marker(MarkerStyle(_PLANE, transform=rotation))
        self._aircraft.set_data(track.position[k : k + 1, 0], track.position[k : k + 1, 1])
        roll, _, _ = track.attitude[k].tolist()
        leg_numbers = self._setup.route.leg_numbers
        parts = [
            f"{float(track.time[k]):7.1f} s",
            f"leg {leg_numbers[min(int(track.leg[k]), len(leg_numbers) - 1)]} of {leg_numbers[-1] + 1}",
            f"{format_signed_number(float(track.airspeed[k]), 1)} m/s",
            f"{format_signed_number(float(track.position[k, 2]), 0)} m AMSL",
            f"{format_signed_number(float(self._above[k]), 0)} m above ground",
            f"bank {format_signed_number(math.degrees(roll), 0)}°",
        ]
        self._text.set_text("   ".join(parts))
        for artist in (self._trail, self._aircraft):
            self._axes.draw_artist(artist)
        self._figure.draw_artist(self._text)


def format_signed_number(value: float, digits: int) -> str:
    """Format a number with a fixed number of decimals and a true minus sign; "?" if it is not finite.

    Zero and positive numbers have no sign.

    >>> format_signed_number(-0.3, 0), format_signed_number(-12.34, 1)
    ('0', '−12.3')
    """
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "\N{MINUS SIGN}") if math.isfinite(value) else "?"


# Arrowhead that points north: nose, right wing, tail, left wing.
_PLANE = [(0.0, 1.0), (0.7, -0.8), (0.0, -0.35), (-0.7, -0.8), (0.0, 1.0)]
