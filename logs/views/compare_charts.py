"""Two flights in one picture: over the first one's map, and as panels over the distance flown."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flight.simulation.setup import FlightSetup
from flight.simulation.track import TRACK_ROW, Track, as_track
from logs.verdict.imported.model_comparison import Reflight
from logs.verdict.measures.route_requirements import with_fence_zones
from logs.views import drawing
from logs.views.map import DrawnTrack, NamedWind, draw_tracks_on_map
from logs.views.time_series import Axis, Panel, Series, Stack, doubles, draw_panels, draw_stack

Floats = NDArray[np.float64]


_SECOND = "#D55E00"
_POINTS = 3000


@dataclass(frozen=True, slots=True)
class NamedFlight:
    """A flight to draw, and the name that its lines have in the legend."""

    name: str
    setup: FlightSetup
    track: Track


def draw_both_on_map(flights: tuple[NamedFlight, NamedFlight]) -> Figure:
    """Draw the first flight's map and route with both tracks over it, and both winds where they differ."""
    first, _ = flights
    looks: tuple[dict[str, Any], dict[str, Any]] = (
        {"color": drawing.FLOWN, "width": 1.6},
        {"color": _SECOND, "width": 1.6, "dashes": (0, (5, 2))},
    )
    winds = [
        NamedWind(flight.setup.scenario.wind, flight.name, look["color"])
        for flight, look in zip(flights, looks, strict=True)
    ]
    a, b = (replace(named.wind, seed=None) for named in winds)
    return draw_tracks_on_map(
        with_fence_zones(first.setup).scenario,
        "two flights from above",
        plan_waypoints=None,
        route_waypoints=first.setup.route.waypoints,
        tracks=[
            DrawnTrack(drawing.shorten(flight.name, 40), flight.track, **look)
            for flight, look in zip(flights, looks, strict=True)
        ],
        winds=[NamedWind(a)] if a == b else winds,
        verdict=None,
    )


def draw_both_over_distance(flights: tuple[NamedFlight, NamedFlight]) -> Figure:
    """Six panels over the distance flown, those of `comparison_stack`."""
    return draw_stack(comparison_stack(flights))


def comparison_stack(flights: tuple[NamedFlight, NamedFlight]) -> Stack:
    """Height, height above ground, airspeed, bank, cross-track and throttle of both over the distance flown.

    Without terrain, that of the height above it is left out.
    """
    flown = [_distance(flight.track) for flight in flights]
    along = np.linspace(0.0, max(float(distance[-1]) for distance in flown), _POINTS)

    def series(values: list[Floats]) -> list[Series]:
        looks: tuple[dict[str, Any], dict[str, Any]] = (
            {"color": drawing.FLOWN, "width": 1.6},
            {"color": _SECOND, "width": 1.1, "dashes": (0, (4, 1.2))},
        )
        return [
            Series(drawing.shorten(flight.name, 22), np.interp(along, distance, value, right=np.nan), **look)
            for flight, distance, value, look in zip(flights, flown, values, looks, strict=True)
        ]

    tracks = [flight.track for flight in flights]
    panels = [
        Panel("height\n(m AMSL)", series([track.position[:, 2] for track in tracks])),
        Panel("height above\nground (m)", series([_above(flight) for flight in flights])),
        Panel("airspeed\n(m/s)", series([doubles(track.airspeed) for track in tracks]), least_span=4.0),
        Panel("bank, right +\n(°)", series([np.degrees(doubles(_roll(track))) for track in tracks])),
        Panel("cross-track,\nright + (m)", series([doubles(track.cross_track) for track in tracks]), least_span=0.1),
        Panel("throttle\n(%)", series([100.0 * doubles(_throttle(track)) for track in tracks])),
    ]
    return Stack("Two flights along their way", panels, Axis("distance flown over the ground (km)", along / 1e3), None)


def _roll(track: Track) -> NDArray[np.float32]:
    roll: NDArray[np.float32]
    roll, _, _ = track.attitude.T
    return roll


def _throttle(track: Track) -> NDArray[np.float32]:
    throttle: NDArray[np.float32]
    _, _, _, throttle = track.controls.T
    return throttle


def _distance(track: Track) -> Floats:
    steps = np.nan_to_num(np.hypot(*np.diff(track.position[:, :2], axis=0).T))
    return np.concatenate([[0.0], np.cumsum(steps)])


def _above(flight: NamedFlight) -> Floats:
    terrain, position = flight.setup.scenario.terrain, flight.track.position
    if terrain is None:
        return np.full(len(position), np.nan)
    return np.asarray(position[:, 2] - terrain.height(position[:, 0], position[:, 1]))


# ----------------------------------------------------------------------
# An imported flight and the model's of the same mission: a picture for each quantity, over the way.

_SIMULATED = "#D55E00"
# File name, field of a profile, axis label, factor, least span.
_PICTURES = (
    ("refly-cross-track.png", "cross_track", "right of the\nlegs (m)", 1.0, 4.0),
    ("refly-height.png", "height_error", "above the\nlegs (m)", 1.0, 4.0),
    ("refly-ground-speed.png", "ground_speed", "ground speed\n(m/s)", 1.0, 4.0),
    ("refly-bank.png", "bank", "bank, right +\n(°)", 180.0 / np.pi, 10.0),
    ("refly-energy.png", "energy", "energy used\n(Wh)", 1.0, 1.0),
)


def refly_pictures(again: Reflight) -> dict[str, bytes]:
    """PNG files by name, one a quantity; that of the energy only where the log holds it.

    >>> from flight.simulation.setup import MissionStretch
    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.imported.flown_legs import flown_legs
    >>> from logs.verdict.imported.model_comparison import compare_with_model
    >>> log = example_log()
    >>> flown = flown_legs(log.setup, log.track, MissionStretch(0.0, 36.5, "AUTO", "log"))
    >>> again = compare_with_model(log.setup, flown, log.track, "completed")
    >>> list(refly_pictures(again))[:2]
    ['refly-cross-track.png', 'refly-height.png']
    """
    return {name: drawing.png_bytes(figure) for name, figure in refly_figures(again).items()}


def refly_figures(again: Reflight) -> dict[str, Figure]:
    """Draw each quantity over the way: as flown, and as simulated."""
    axis = Axis("along the legs (km)", again.distance / 1e3)
    legs, out = _legs(again), {}
    for file, name, label, factor, span in _PICTURES:
        flown, model = factor * getattr(again.flown, name), factor * getattr(again.model, name)
        if not np.isfinite(flown).any():
            continue
        series = [
            Series("flown", flown, width=1.3),
            Series("simulated", model, color=_SIMULATED, width=1.1, dashes=(0, (4, 1.2))),
        ]
        difference = Series("flown less simulated", flown - model, color=drawing.QUIET, filled=True)
        panels = [
            Panel(label, series, least_span=span),
            Panel("difference", [difference], limits=(("", 0.0),), least_span=0.5 * span),
        ]
        title = f"{drawing.shorten(again.setup.scenario.name, 40)}: flown, and by the model {again.setup.aircraft}"
        out[file] = draw_panels(title, panels, axis, legs)
    return out


def _legs(again: Reflight) -> Track:
    """Rows that say which leg each place is on."""
    rows = np.zeros(len(again.distance), TRACK_ROW)
    rows["time"] = np.arange(len(rows))
    rows["leg"] = again.first + np.searchsorted(again.ends, again.distance, side="right")
    return as_track(rows)
