"""A page has a chart for each picture but the 3-D view, and a flight only where one was flown."""

import json
from dataclasses import replace

import numpy as np

from logs.figures.elements.failures import Failures
from logs.report.charts.page_charts import report_charts, report_flight
from tests.logs.report.report_data import VERDICT, make_setup, make_track

SETUP, TRACK = make_setup(), make_track()


def test_there_is_a_chart_for_every_picture_with_data() -> None:
    charts = report_charts(SETUP, TRACK, VERDICT, Failures({}, {}))
    # The flight is exposed to nothing.
    assert set(charts) == {"map", "profile", "turns", "envelope", "time", "controls", "energy"}
    json.dumps(charts, allow_nan=False)
    assert set(report_charts(SETUP, None, VERDICT, Failures({}, {}))) == {"map", "profile", "turns", "envelope"}


def test_a_flight_without_a_known_place_is_none_to_show() -> None:
    assert len(report_flight(SETUP, TRACK)["flights"]) == 1
    assert report_flight(SETUP, None)["flights"] == []
    lost = replace(TRACK, position=np.full_like(TRACK.position, np.nan))
    assert report_flight(SETUP, lost)["flights"] == []
