"""Chart an identification: measured and predicted values of its equations, and of a log."""

import numpy as np

from aircraft.identification.estimate import Equation
from aircraft.identification.prediction import QUANTITIES, UNITS, PredictedLog
from logs.views.charts import Chart, Panel, filled_series, series

# Displayed unit, and factor to it, by unit of the equation: degrees instead of radians.
_SHOWN = {"rad": ("°", 180.0 / np.pi), "rad/s2": ("°/s²", 180.0 / np.pi), "m/s2": ("m/s²", 1.0)}


def equation_chart(equation: Equation) -> Chart:
    """Chart measured and predicted values of an equation, and their difference, over time.

    The time is the time of all log segments joined together.

    >>> wave = np.sin(np.arange(500) / 20.0)
    >>> chart = equation_chart(Equation("pitch acceleration", "rad/s2", 25.0, wave, 0.9 * wave, 0.99, 0.1))
    >>> [panel.title for panel in chart.panels]
    ['pitch acceleration', 'measured minus predicted']
    """
    unit, factor = _SHOWN[equation.unit]
    time = np.arange(len(equation.measured)) / equation.hertz
    lines = (
        series("measured", "flown", time, factor * equation.measured),
        series("predicted", "other", time, factor * equation.predicted),
    )
    residual = filled_series("difference", "difference", time, factor * (equation.measured - equation.predicted))
    panels = (
        Panel(equation.name, unit, lines, min_span=0.1),
        Panel("measured minus predicted", unit, (residual,), limits=(("", 0.0),), min_span=0.1),
    )
    return Chart(f"{equation.name}, R² {equation.explained:.3f}", "time, all log segments joined", "s", panels)


def prediction_chart(predicted: PredictedLog) -> Chart:
    """Chart measured quantities and the identified model's predictions, one panel for each quantity.

    Each value was predicted from the measurements half a second earlier.
    """
    panels = tuple(
        Panel(
            name,
            unit.replace("deg", "°"),
            (
                series("measured", "flown", predicted.time, predicted.measured[:, k]),
                series("predicted 0.5 s before", "other", predicted.time, predicted.predicted[:, k]),
            ),
            min_span=1.0,
        )
        for k, (name, unit) in enumerate(zip(QUANTITIES, UNITS, strict=True))
    )
    return Chart("Predictions half a second ahead", "time, all log segments joined", "s", panels)
