"""Charts over time hold the values of the drawn panels, their limits, and where legs begin and controls are held."""

from dataclasses import replace

import numpy as np
import pytest

from logs.figures.elements import style
from logs.figures.elements.panels import Axis, Panel, Series, Stack, time_axis
from logs.figures.time_series import control_stack, time_stack
from logs.report.charts.chart import chart_json
from logs.report.charts.stack_chart import LOOKS, parted_unit, stack_chart
from tests.logs.report.report_data import make_setup, make_track

SETUP, TRACK = make_setup(), make_track()


def test_every_panel_has_its_unit_and_every_line_its_look() -> None:
    chart = stack_chart(time_stack(SETUP, TRACK))
    units = {panel.title: panel.unit for panel in chart.panels}
    assert units["airspeed"] == units["climb rate"] == "m/s"
    assert units["bank, right +"] == "°"
    assert units["height above ground"] == "m"
    assert (chart.along, chart.unit, chart.timed) == ("time since the start", "s", True)
    speed = chart.panels[0]
    assert [(layer.name, layer.look) for layer in speed.layers] == [("commanded", "commanded"), ("flown", "flown")]
    assert speed.layers[1].y == pytest.approx(25.0)
    # Legs of 40, 32 and 25 rows, a row a second.
    assert chart.marks == ((0.0, "leg 0"), (40.0, "leg 1"), (72.0, "leg 2"))
    assert set(LOOKS) <= set(style.DRAWN)


def test_thinned_lines_keep_their_highest_and_lowest_value() -> None:
    values = np.sin(np.arange(9000.0))
    values[4321], values[777] = 5.0, -7.0
    stack = Stack("", [Panel("x (m)", [Series("flown", values)])], Axis("time (s)", np.arange(9000.0)), None)
    (layer,) = stack_chart(stack).panels[0].layers
    assert len(layer.x) < 1300
    assert (layer.x[np.argmax(layer.y)], layer.y.max(), layer.x[np.argmin(layer.y)], layer.y.min()) == (
        4321,
        5,
        777,
        -7,
    )


def test_a_control_at_its_limit_is_a_band_over_just_those_seconds() -> None:
    commands = np.zeros((len(TRACK), 4), dtype=np.float32)
    commands[:, 3] = 0.5
    commands[30:60, 3] = commands[80:83, 3] = 1.0
    *others, throttle = stack_chart(control_stack(SETUP, replace(TRACK, commands=commands))).panels
    band = throttle.layers[0]
    assert (band.name, band.kind, band.quiet) == ("held at its limit", "band", True)
    assert band.x[np.isfinite(band.y)].tolist() == [30.0, 59.0, 80.0, 82.0]
    assert not any(layer.kind == "band" for panel in others for layer in panel.layers)


def test_a_panel_shows_all_its_values_and_limits_and_no_less_than_its_least() -> None:
    axis = time_axis(TRACK)
    wide = Panel("x (m)", [Series("flown", np.linspace(0.0, 10.0, len(TRACK)))], [("limit", 20.0)])
    still = Panel("y (m)", [Series("flown", np.full(len(TRACK), 3.0))], least_span=4.0)
    first, second = stack_chart(Stack("", [wide, still], axis, None)).panels
    assert first.span == pytest.approx((-1.6, 21.6))
    assert second.span == pytest.approx((1.0 - 0.32, 5.0 + 0.32))


def test_what_is_filled_is_a_band_down_to_nought() -> None:
    filled = Series("used", np.array([1.0, 2.0]), filled=True)
    chart = stack_chart(Stack("", [Panel("used (Wh)", [filled])], Axis("time (s)", np.array([0.0, 1.0])), None))
    (layer,) = chart_json(chart)["panels"][0]["layers"]
    assert (layer["kind"], layer["low"]) == ("band", [0.0, 0.0])


def test_units_stand_at_the_end_of_a_label() -> None:
    assert parted_unit("height above\nground (m)") == ("height above ground", "m")
    assert parted_unit("kill\nstrength (1)") == ("kill strength", "")
