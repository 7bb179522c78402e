"""Exposure along the flown track: its strength, from missiles and from radars, and its sum over time."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import COLUMNS, Track
from logs.figures.elements import style
from logs.figures.elements.panels import Axis, Panel, Series, Stack, draw_stack
from world.geometry import segment_exposure
from world.kernels import compiled

Floats = NDArray[np.float64]

# Segments that the track is joined to for the curve; the sums stay those of straight segments.
_MOST = 12_000


def exposure_rates(position: Floats, centres: Floats, radii: Floats, scales: Floats) -> Floats:
    """Mean of (scale/d)^4 inside each of m spheres on each segment (paper eq. 9 and 10), summed over the spheres.

    position: (t, 3) m.  centres: (m, 3).  radii, scales: (m,).  Returns (t - 1,), 1 at one scale's
    distance; NaN where the track is not a number.
    """
    return _rates(
        np.ascontiguousarray(position), np.ascontiguousarray(centres), np.ascontiguousarray(radii), scales.copy()
    )


@compiled
def _rates(position: Floats, centres: Floats, radii: Floats, scales: Floats) -> Floats:  # pragma: no cover - compiled
    count = position.shape[0] - 1
    out = np.zeros(max(0, count))
    for k in range(count):
        for m in range(centres.shape[0]):
            if radii[m] > 0.0:
                _, rate = segment_exposure(position[k], position[k + 1], centres[m], radii[m], scales[m])
                out[k] += rate
    return out


def draw_exposure(setup: FlightSetup, track: Track) -> Figure | None:
    """Panels along the flown distance, those of `exposure_stack`; None where the flight was exposed to nothing."""
    stack = exposure_stack(setup, track)
    return None if stack is None else draw_stack(stack)


def exposure_stack(setup: FlightSetup, track: Track) -> Stack | None:
    """Strength and sum of kill and of detection along the flown distance (km), of those that the flight was exposed to.

    None where it was exposed to nothing.
    """
    threats = setup.scenario.threats
    if not len(threats) or len(track) < 2:
        return None
    rows = np.unique(np.linspace(0, len(track) - 1, min(len(track), _MOST)).astype(np.intp))
    rows = rows[np.isfinite(track.position[rows]).all(axis=1)]
    if rows.size < 2:
        return None
    time, position = track.time[rows], track.position[rows]
    steps = np.hypot(*np.diff(position[:, :2], axis=0).T)
    kilometres = np.concatenate([[0.0], np.cumsum(steps)]) / 1000.0
    panels: list[Panel] = []
    for name, colour, radii, scales in (
        ("kill", style.MISSILE, threats.kill_radius, threats.kill_scale),
        ("detection", style.RADAR, threats.detection_radius, threats.detection_scale),
    ):
        if not (radii > 0.0).any():
            continue
        rate = exposure_rates(position, threats.position, radii, scales)
        if not np.nansum(rate):
            continue
        total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(rate) * np.diff(time))])
        strength = Series("strength", np.append(rate, rate[-1]), color=colour, filled=True)
        panels.append(Panel(f"{name}\nstrength (1)", [strength]))
        panels.append(Panel(f"{name}\nso far (s)", [Series("sum over time", total, color=colour, width=1.6)]))
    if not panels:
        return None
    whole = Track(*(getattr(track, item)[rows] for item in COLUMNS))
    title = f"{style.shorten(setup.scenario.name, 60)}: exposure along the flown track"
    return Stack(title, panels, Axis("distance flown over the ground (km)", kilometres), whole)
