"""Write the page of an identification: fits of equations, parameters, and uncertain quantities."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from aircraft.identification.estimate import Estimate
from aircraft.identification.parameters import PARAMETERS
from aircraft.identification.prediction import HORIZONS_S, QUANTITIES, UNITS, PredictedLog
from logs.views.figures import draw_pictures, view_json
from logs.views.identification import equation_chart, prediction_chart
from logs.views.report.page import (
    CHART_SCRIPTS,
    page_library,
    page_template,
    picture_data_url,
    script_digest,
    script_text,
    style_text,
)
from logs.views.scene import script_json

# Standard deviations from the estimate to either end of a 95 % interval.
_INTERVAL_SIGMAS = 1.96


@dataclass(frozen=True, slots=True)
class IdentificationFacts:
    """Data that the page of an identification shows.

    title: title of the aircraft.
    estimate: identified parameters and fits.
    logs: name and SHA-256 of each log.
    numbers: performance numbers of the aircraft: name, unit, lower end of the 95 % interval, estimate, and upper end.
    predicted: predictions of the check log, or of the logs themselves without a check log.
    check: file name of the check log; None without one.
    wide: for each performance number that the logs leave uncertain, a line with the flights that would narrow it.
    """

    title: str
    estimate: Estimate
    logs: tuple[tuple[str, str], ...]
    numbers: tuple[tuple[str, str, float, float, float], ...]
    predicted: PredictedLog
    check: str | None = None
    wide: tuple[str, ...] = ()


class ParameterRow(NamedTuple):
    """A row of the table of parameters, as text.

    low, high: ends of the 95 % interval.
    share: part of the prior's variance that the logs remove, percent.
    """

    title: str
    name: str
    prior: str
    estimate: str
    low: str
    high: str
    share: int


def parameter_rows(estimate: Estimate) -> list[ParameterRow]:
    """Return a row for each parameter, with its prior, its estimate and its 95 % interval."""
    shares = np.round(100.0 * estimate.log_fractions()).astype(int).tolist()
    rows = []
    for parameter, value, sd, share in zip(
        PARAMETERS, estimate.values.tolist(), estimate.sds.tolist(), shares, strict=True
    ):
        rows.append(
            ParameterRow(
                title=parameter.title,
                name=parameter.property_name,
                prior=f"{parameter.prior:g} ± {parameter.sd:g}",
                estimate=f"{value:.3f}",
                low=f"{value - _INTERVAL_SIGMAS * sd:.2f}",
                high=f"{value + _INTERVAL_SIGMAS * sd:.2f}",
                share=share,
            )
        )
    return rows


def shift_rows(estimate: Estimate, count: int = 3) -> list[tuple[str, str]]:
    """Return a row for each quantity that the identification keeps fixed: name and influence.

    The text lists the `count` parameters that change most if the quantity changes by one standard deviation, with their
    changes.
    """
    rows = []
    sds = np.array([parameter.sd for parameter in PARAMETERS])
    for name, shift in estimate.shifts.items():
        order = np.argsort(-np.abs(shift / sds))[:count]
        shift_text = ", ".join(f"{PARAMETERS[k].title} {shift[k]:+.3f}" for k in order.tolist())
        rows.append((name, shift_text))
    return rows


def prediction_rows(predicted: PredictedLog) -> list[tuple[str, str, list[str]]]:
    """Return a row for each predicted quantity and each time ahead, as text.

    It contains the quantity with its unit, the time ahead, and the root mean square prediction error of each model.
    """
    return [
        (
            f"{name} ({unit})",
            f"{horizon:g} s",
            [f"{prediction.rms[horizon][k]:.3g}" for prediction in predicted.predictions],
        )
        for k, (name, unit) in enumerate(zip(QUANTITIES, UNITS, strict=True))
        for horizon in HORIZONS_S
    ]


def identification_page(facts: IdentificationFacts) -> str:
    """Return the page of an identification as self-contained HTML, with pictures, charts and scripts."""
    charts = {f"fit-{k}": equation_chart(equation) for k, equation in enumerate(facts.estimate.equations)}
    charts["predicted"] = prediction_chart(facts.predicted)
    pictures = draw_pictures(charts)
    script = script_text(CHART_SCRIPTS)
    chart_rows = []
    for k, equation in enumerate(facts.estimate.equations):
        name = f"fit-{k}"
        fit_text = f"R² {equation.explained:.3f}; its residuals are autocorrelated over {equation.correlation:.2g} s"
        chart_rows.append((name, charts[name].title, picture_data_url(pictures[f"{name}.png"]), fit_text))
    return page_template("identification.html").render(
        facts=facts,
        minutes=f"{facts.estimate.seconds / 60.0:.1f}",
        fits=chart_rows,
        parameters=parameter_rows(facts.estimate),
        silent=facts.estimate.uninformed_lines(),
        shifts=shift_rows(facts.estimate),
        predictions=prediction_rows(facts.predicted),
        whiteness=[f"{100.0 * share:.0f} %" for share in facts.predicted.predictions[-1].whiteness],
        predicted_picture=picture_data_url(pictures["predicted.png"]),
        style=Markup(style_text("style", "compare", "identification")),
        scene=Markup(script_json(data=None)),
        flight_data=Markup(script_json({"flights": []})),
        chart_data=Markup(script_json({name: view_json(chart) for name, chart in charts.items()})),
        library=page_library(),
        script=Markup(script),
        script_digest=script_digest(script),
    )
