"""A flight of the field and the model's of the same mission: a picture for each quantity, over the way."""

import numpy as np
from matplotlib.figure import Figure

from flight.simulation.track import TRACK_ROW, Track, as_track
from logs.figures.elements import style
from logs.figures.elements.panels import Axis, Panel, Series, draw_panels
from logs.verdict.field.model_comparison import Reflight

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

    >>> from flight.simulation.field_source import MissionStretch
    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.field.flown_legs import flown_legs
    >>> from logs.verdict.field.model_comparison import compare_with_model
    >>> log = example_log()
    >>> flown = flown_legs(log.setup, log.track, MissionStretch(0.0, 36.5, "AUTO", "log"))
    >>> again = compare_with_model(log.setup, flown, log.track, "completed")
    >>> list(refly_pictures(again))[:2]
    ['refly-cross-track.png', 'refly-height.png']
    """
    return {name: style.png_bytes(figure) for name, figure in refly_figures(again).items()}


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
        difference = Series("flown less simulated", flown - model, color=style.QUIET, filled=True)
        panels = [
            Panel(label, series, least_span=span),
            Panel("difference", [difference], limits=(("", 0.0),), least_span=0.5 * span),
        ]
        title = f"{style.shorten(again.setup.scenario.name, 40)}: flown, and by the model {again.setup.aircraft}"
        out[file] = draw_panels(title, panels, axis, legs)
    return out


def _legs(again: Reflight) -> Track:
    """Rows that say which leg each place is on."""
    rows = np.zeros(len(again.distance), TRACK_ROW)
    rows["time"] = np.arange(len(rows))
    rows["leg"] = again.first + np.searchsorted(again.ends, again.distance, side="right")
    return as_track(rows)
