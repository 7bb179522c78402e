"""The envelope's chart has the aircraft's limits, the legs and the flight where they are."""

import math

import pytest

from logs.report.charts.envelope_chart import envelope_chart
from tests.logs.report.report_data import make_setup, make_track


def test_limits_legs_and_flight_stand_where_they_are() -> None:
    slopes, banks = envelope_chart(make_setup(), make_track()).panels
    lines = {layer.name: layer for layer in slopes.layers}
    # The aircraft climbs 0.2 rad and descends 0.1 rad at every speed and height; the route is at 300..380 m.
    assert lines["steepest climb at 300 m"].y == pytest.approx(math.degrees(0.2))
    assert lines["steepest descent at 380 m"].y == pytest.approx(-math.degrees(0.1))
    legs = lines["legs as planned (over the ground)"]
    assert legs.x == pytest.approx(25.0)
    assert legs.y == pytest.approx([math.degrees(math.atan(rise)) for rise in (40 / 1000, 40 / 800, -20 / 600)])
    flown = {layer.name: layer for layer in banks.layers}
    assert flown["flown, moment by moment"].y.max() == pytest.approx(math.degrees(0.5))
    assert flown["limit of planned turns; corrections may bank beyond it"].y == pytest.approx(30.0)
    assert flown["the aircraft's bank limit"].y == pytest.approx(math.degrees(0.7))


def test_a_bare_plan_has_no_dots_of_a_flight() -> None:
    names = {layer.name for panel in envelope_chart(make_setup(), None).panels for layer in panel.layers}
    assert not any("flown" in name for name in names)
