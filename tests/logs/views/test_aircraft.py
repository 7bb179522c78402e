"""Pictures of an aircraft show its numbers: slopes in degrees, radii by the law of turns, answers in their units."""

import math
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.dynamics.characteristics import Mode, StepResponse, TrimRow
from flight.dynamics.trim import Trim
from logs.views.aircraft import draw_envelope, draw_step_responses, draw_trims
from tests.synthetic import envelope

AIRCRAFT = load_aircraft("aerosonde")


def labelled(axes: Any, label: str) -> Any:
    return next(line for line in axes.lines if line.get_label() == label)


def test_envelope_panels_are_the_envelopes_numbers() -> None:
    slopes, speeds, wind, turns = draw_envelope(AIRCRAFT, envelope()).axes
    # The table made by hand climbs 13.7 degrees at 25 m/s and sinks at most 7.8, at every height.
    assert np.interp(25.0, *labelled(slopes, "0 m").get_xydata().T) == pytest.approx(13.7)
    lowest = min(float(np.interp(25.0, *line.get_xydata().T)) for line in slopes.lines if len(line.get_xdata()) == 5)
    assert lowest == pytest.approx(-7.8)
    assert labelled(speeds, "fastest: full throttle").get_xdata() == pytest.approx(32.0)
    # 10 m/s behind: tan = 25 sin 13.7 / (25 cos 13.7 + 10).
    steep = math.radians(13.7)
    behind = math.degrees(math.atan2(25.0 * math.sin(steep), 25.0 * math.cos(steep) + 10.0))
    assert np.interp(25.0, *labelled(wind, "10 m/s tailwind").get_xydata().T) == pytest.approx(behind, abs=0.05)
    assert np.interp(25.0, *labelled(wind, "calm").get_xydata().T) == pytest.approx(13.7, abs=0.05)
    # 25^2 / (g tan 30) = 110.4 m.
    assert np.interp(25.0, *labelled(turns, "30° of bank").get_xydata().T) == pytest.approx(110.4, abs=0.2)


def test_no_legend_covers_a_line() -> None:
    panels = draw_envelope(AIRCRAFT, envelope()).axes
    panels[0].figure.canvas.draw()
    for axes in panels:
        box = axes.get_legend().get_window_extent()
        assert axes.bbox.x0 < box.x0 < box.x1 < axes.bbox.x1
        # The marks of speeds run from edge to edge; everything else is a line of numbers.
        lines = [line for line in axes.lines if len(line.get_xdata()) > 2]
        assert lines
        for line in lines:
            pixels = axes.transData.transform(line.get_xydata())
            assert not any(box.contains(x, y) for x, y in pixels if np.isfinite([x, y]).all())


def trim(airspeed: float, throttle: float) -> TrimRow:
    return TrimRow(
        Trim(airspeed, 500.0, 0.0, math.radians(4.0), 0.0, math.radians(-3.0), 0.0, 0.0, throttle), 700.0, 3600.0
    )


def test_trims_and_modes_stand_at_their_speeds_and_roots() -> None:
    modes = {
        20.0: [Mode("phugoid", complex(-0.05, 0.5)), Mode("short period", complex(-8.0, 9.0))],
        30.0: [Mode("phugoid", complex(-0.04, 0.3)), Mode("spiral", complex(0.02, 0.0))],
    }
    figure = draw_trims(AIRCRAFT, [trim(20.0, 0.3), trim(30.0, 0.6)], modes)
    surfaces, throttle, whole, slow, power = figure.axes
    assert labelled(surfaces, "angle of attack").get_ydata() == pytest.approx([4.0, 4.0])
    assert labelled(surfaces, "elevator").get_ydata() == pytest.approx([-3.0, -3.0])
    np.testing.assert_allclose(labelled(throttle, "throttle").get_xydata(), [[20.0, 30.0], [30.0, 60.0]])
    assert power.lines[0].get_ydata() == pytest.approx([0.7, 0.7])

    def roots(axes: Any) -> set[tuple[float, float]]:
        marked = [line for line in axes.lines if line.get_marker() not in ("None", "", None)]
        return {tuple(point) for line in marked for point in np.asarray(line.get_xydata()).tolist()}

    assert roots(whole) == {(-0.05, 0.5), (-8.0, 9.0), (-0.04, 0.3), (0.02, 0.0)}
    assert roots(slow) == roots(whole) - {(-8.0, 9.0)}


@pytest.mark.parametrize(
    ("control", "size", "held", "title"),
    [
        ("elevator", -0.1, 1.0, "elevator 5.7° up, 1 s"),
        ("aileron", 0.1, 2.0, "aileron 5.7° to roll right, 2 s"),
        ("throttle", 0.2, math.inf, "throttle +20 %, held"),
    ],
)
def test_an_answer_is_in_degrees_with_the_time_of_the_step_shaded(
    control: str, size: float, held: float, title: str
) -> None:
    time = np.linspace(0.0, 10.0, 11)
    change = np.column_stack([0.01 * time, time])
    figure = draw_step_responses(AIRCRAFT, [StepResponse(control, size, held, time, ("pitch", "airspeed"), change)])
    pitch, airspeed = figure.axes
    assert (pitch.get_title(loc="left"), airspeed.get_title(loc="left")) == (
        "change of pitch (°)",
        "change of airspeed (m/s)",
    )
    assert pitch.lines[-1].get_ydata()[-1] == pytest.approx(math.degrees(0.1))
    assert airspeed.lines[-1].get_ydata()[-1] == 10.0
    corners = np.asarray(pitch.patches[0].get_extents().get_points())
    shaded = pitch.transData.inverted().transform(corners)[:, 0]
    assert shaded == pytest.approx([1.0, min(1.0 + held, 10.0)])
    assert title in [text.get_text() for text in figure.texts]
