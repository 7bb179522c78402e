"""The chart of turns and legs holds each finding's numbers, rings what fails, and names limits that it leaves out."""

from logs.report.charts.turn_chart import turn_chart
from logs.verdict.findings import Verdict
from logs.verdict.places import Place
from tests.logs.report.report_data import FINDINGS, VERDICT, finding


def test_bars_dots_and_dashes_are_the_findings_numbers() -> None:
    chart = turn_chart(VERDICT)
    assert chart is not None
    turns, slopes = chart.panels
    assert (turns.along, slopes.along, slopes.unit, chart.shared) == ("waypoint", "leg", "°", False)
    layers = {layer.name: layer for layer in slopes.layers}
    assert layers["planned"].x.tolist() == [0.0, 1.0]
    assert layers["flown"].y.tolist() == [4.25, 11.25]
    assert layers["limit"].y.tolist() == [7.8, 7.8]
    assert (layers["fails"].x.tolist(), layers["fails"].y.tolist()) == ([1.0], [11.25])
    assert slopes.span is not None
    assert slopes.span[0] < 0.0 < 11.25 < slopes.span[1]
    assert "fails" not in {layer.name for layer in turns.layers}


def test_a_limit_far_above_everything_is_said_and_does_not_press_it_flat() -> None:
    low = finding("turn", Place("waypoint", 1), True, 1.0, limit=152.0)
    chart = turn_chart(Verdict((low, FINDINGS[0]), True, True, (), "flown"))
    assert chart is not None
    (panel,) = chart.panels
    assert panel.note == "other limits from 152°"
    assert panel.span is not None
    assert panel.span[1] < 10.0
