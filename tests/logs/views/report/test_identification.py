"""The page of an identification: what it says; `tests.logs.views.report.test_page_in_browser` shows it to a browser."""

from dataclasses import replace

import numpy as np
import pytest

from aircraft.identification.estimate import Equation, Estimate
from aircraft.identification.parameters import INDEX, PARAMETERS, prior_means, prior_sds
from aircraft.identification.prediction import HORIZONS_S, PredictedLog, Prediction
from logs.views.report.identification import IdentificationFacts, identification_page, parameter_rows

WAVE = np.sin(np.arange(2000) / 40.0)


def facts() -> IdentificationFacts:
    """Of made numbers: thrust is half the prior's as wide, and everything else is the prior."""
    sds = prior_sds()
    sds[INDEX["thrust"]] *= 0.5
    values = prior_means()
    values[INDEX["thrust"]] = 0.85
    names = (("angle of attack", "rad"), ("forward acceleration", "m/s2"), ("pitch acceleration", "rad/s2"))
    equations = tuple(Equation(name, unit, 25.0, WAVE, 0.9 * WAVE, 0.99, 0.4) for name, unit in names)
    shifts = {"airspeed (1 %)": 0.01 * np.eye(len(PARAMETERS))[INDEX["thrust"]]}
    estimate = Estimate(values, np.diag(sds**2), (), equations, shifts, seconds=600.0)
    errors = {horizon: np.array([3.1, 0.43, 0.2, 1.7, 0.65, 0.041]) for horizon in HORIZONS_S}
    table = np.column_stack([WAVE] * 6)
    models = (Prediction("constant rates", errors), Prediction("identified", errors, (0.36, 0.24, 0.68)))
    predicted = PredictedLog(models, 1500, np.arange(2000) / 50.0, table, 1.02 * table)
    numbers = (("climb at full throttle", "°", 5.8, 7.7, 9.6), ("power in level flight", "W", 380.0, 485.0, 624.0))
    wide = ("sink at idle: known only to ±23 %; to improve this, fly glides",)
    return IdentificationFacts("mine", estimate, (("A.BIN", "ab" * 32),), numbers, predicted, "C<1>.BIN", wide)


def test_the_share_of_the_log_is_what_it_takes_off_the_priors_variance() -> None:
    rows = {row.name: row for row in parameter_rows(facts().estimate)}
    thrust = rows["ident/thrust"]
    assert (thrust.prior, thrust.estimate, thrust.share) == ("1 ± 0.2", "0.850", 75)
    # 0.85 less and more 1.96 times 0.1.
    assert (thrust.low, thrust.high) == ("0.65", "1.05")
    assert rows["ident/lift-slope"].share == 0


def test_the_page_says_what_was_found_and_what_was_not(monkeypatch: pytest.MonkeyPatch) -> None:
    # A browser is shown the pictures themselves.
    blank = dict.fromkeys(("fit-0.png", "fit-1.png", "fit-2.png", "predicted.png"), b"")
    monkeypatch.setattr("logs.views.report.identification.draw_pictures", lambda _: blank)
    page = identification_page(facts())
    for said in (
        "mine, from 10.0 minutes of flight",
        "climb at full throttle",
        "7.7",
        "these logs do not show",
        "battery current (BAT)",
        "0.041",
        "R² 0.990",
        "airspeed (1 %)",
        "thrust +0.010",
        "ab" * 32,
        "1500 predictions of C&lt;1&gt;.BIN, which was not used",
        "white at 36 %, 24 %, 68 %",
    ):
        assert said in page, said
    assert "sink at idle: known only to ±23 %; to improve this, fly glides" in page
    assert "<1>" not in page
    # Nothing is asked of a network.
    assert "http" not in page.partition('<script type="application/json"')[0].replace("http-equiv", "")
    bare = replace(facts(), check=None, estimate=replace(facts().estimate, dynamics=False))
    shown = identification_page(bare)
    assert "of the logs from which the estimate was made" in shown
    assert "Performance only" in shown
