"""Chart a blind prediction: the predicted 95 % band of each quantity, and the flown values."""

from collections.abc import Sequence

import numpy as np

from aircraft.identification.blind import Band
from logs.views.charts import Chart, Label, Layer, Panel

# Largest step along the axis within one window, as a multiple of the median step.
_MAX_STEP_RATIO = 5.0
# Position of the centre of a label along the axis, as a fraction of the axis; far enough that the text does not cover
# the vertical axis on the small screen of a telephone.
_LABEL_FRACTION = 0.12


def band_chart(bands: Sequence[Band], title: str, *, by_time: bool = True) -> Chart:
    """Chart the predicted band and the flown values of each quantity, in a panel for each quantity.

    Quantities that were not measured in the flight have no panel.

    by_time: True if the bands are over the time of the log, s; False if over the distance along the legs, m.

    >>> time = np.arange(4.0)
    >>> chart = band_chart([Band("bank", "deg", time, time - 1.0, time + 1.0, time)], "a flight")
    >>> [panel.title for panel in chart.panels], chart.unit
    (['bank'], 's')
    """
    factor = 1.0 if by_time else 1e-3
    panels = []
    for band in bands:
        if not np.isfinite(band.flown).any():
            continue
        # NaN between the segments of a log, which end where the axis jumps, so that no line joins them.
        axis_values = factor * band.along
        steps = np.diff(axis_values)
        jumps = np.flatnonzero(steps > _MAX_STEP_RATIO * np.median(steps)) + 1
        axis_values, low, high, flown_values = (
            np.insert(column, jumps, np.nan) for column in (axis_values, band.low, band.high, band.flown)
        )
        layers = (
            Layer("band", "band of 95 %", "band", axis_values, high, low),
            Layer("line", "flown", "flown", axis_values, flown_values),
        )
        top = float(np.nanmax([high, flown_values]))
        left = float(axis_values[0] + _LABEL_FRACTION * (np.nanmax(axis_values) - axis_values[0]))
        inside_label = Label(f"{100.0 * band.inside:.0f} % inside", left, top, "end", prefer=(0, -1))
        panels.append(Panel(band.name, band.unit.replace("deg", "°"), layers, min_span=1.0, labels=(inside_label,)))
    along_name, unit = ("time of the log", "s") if by_time else ("along the legs", "km")
    return Chart(title, along_name, unit, tuple(panels), page_height=170, print_height=1.3)
