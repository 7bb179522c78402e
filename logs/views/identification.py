"""Chart an identification: measured and predicted values of equations, and a replayed log."""

from collections.abc import Sequence

import numpy as np

from aircraft.identification.estimate import Equation
from logs.views.charts import Chart, Panel, filled_series, series
from world.arrays import Floats

# Displayed unit and factor, by unit: degrees in place of radians.
_SHOWN = {"rad": ("°", 180.0 / np.pi), "rad/s2": ("°/s²", 180.0 / np.pi), "m/s2": ("m/s²", 1.0)}


def equation_chart(equation: Equation) -> Chart:
    """Return measured and predicted values over the joined time of all stretches, and their difference.

    >>> wave = np.sin(np.arange(500) / 20.0)
    >>> chart = equation_chart(Equation("pitch acceleration", "rad/s2", 25.0, wave, 0.9 * wave, 0.99, 0.1))
    >>> [panel.title for panel in chart.panels]
    ['pitch acceleration', 'measured less predicted']
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
        Panel("measured less predicted", unit, (residual,), limits=(("", 0.0),), min_span=0.1),
    )
    return Chart(f"{equation.name}, R² {equation.explained:.3f}", "time of all stretches", "s", panels)


def replay_chart(names: Sequence[str], units: Sequence[str], logged: Floats, identified: Floats, hertz: float) -> Chart:
    """Return some windows of a replay one after the other, with one panel a quantity.

    names, units: names and units of the k quantities.  logged, identified: (t, k).
    """
    time = np.arange(len(logged)) / hertz
    panels = tuple(
        Panel(
            name,
            unit.replace("deg", "°"),
            (series("logged", "flown", time, logged[:, k]), series("replayed", "other", time, identified[:, k])),
            min_span=1.0,
        )
        for k, (name, unit) in enumerate(zip(names, units, strict=True))
    )
    return Chart("Windows of 5 s of the check log", "time of the windows", "s", panels)
