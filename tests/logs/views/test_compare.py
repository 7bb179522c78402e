"""Two flights in one picture: each line is its own flight's."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.simulation.setup import MissionStretch
from logs.recording.example_log import example_log
from logs.verdict.imported.flown_legs import flown_legs
from logs.verdict.imported.model_comparison import compare_with_model
from logs.views.compare import NamedFlight, make_two_flights_chart, make_two_flights_map, refly_charts
from logs.views.draw_map import draw_map
from logs.views.drawing import draw_chart, png_bytes
from tests.logs.views.report.report_data import make_setup, make_track
from world.wind import Wind

FIRST = NamedFlight("first.mcap", make_setup(), make_track())


def shorter() -> NamedFlight:
    """The first half, 10 m higher and 2 m/s slower."""
    half = FIRST.track.rows(0, 49)
    raised = half.position + np.array([0.0, 0.0, 10.0])
    return NamedFlight("second.mcap", FIRST.setup, replace(half, position=raised, airspeed=half.airspeed - 2.0))


def line(axes: Any, label: str) -> Any:
    return next(one for one in axes.lines if one.get_label() == label)


def test_the_map_has_both_tracks_and_no_line_that_joins_them() -> None:
    second = shorter()
    axes = draw_map(make_two_flights_map((FIRST, second))).axes[0]
    for flight in (FIRST, second):
        drawn = line(axes, flight.name).get_xydata()
        np.testing.assert_array_equal(drawn, flight.track.position[:, :2])
    assert "flown track" not in [one.get_label() for one in axes.lines]
    # The legend stands below the map, where it hides nothing, and has no line that was not drawn.
    assert axes.get_legend() is None
    (legend,) = axes.figure.legends
    shown = [text.get_text() for text in legend.get_texts()]
    assert {"first.mcap", "second.mcap"} <= set(shown)
    assert "flown track" not in shown


def test_both_winds_are_told_where_they_differ() -> None:
    def notes(second: NamedFlight) -> list[str]:
        return [
            text.get_text()
            for text in draw_map(make_two_flights_map((FIRST, second))).texts
            if "wind" in text.get_text()
        ]

    assert len(notes(shorter())) == 1
    other = replace(FIRST.setup, scenario=replace(FIRST.setup.scenario, wind=Wind(7.0, 1.0)))
    first, second = notes(replace(FIRST, name="second.mcap", setup=other))
    assert first.startswith("first.mcap:")
    assert second == "second.mcap:\nwind 7.0 m/s\nfrom 057°"


def test_panels_run_over_the_distance_flown_and_end_with_each_flight() -> None:
    figure = draw_chart(make_two_flights_chart((FIRST, shorter())))
    height, above, airspeed, *_ = figure.axes
    assert len(figure.axes) == 6
    first, second = line(height, "first.mcap"), line(height, "second.mcap")
    # The route is 2.4 km long; 48 s at 25 m/s are half of it: 1.2 km, less the corner cut by a row.
    assert first.get_xdata()[-1] == pytest.approx(2.4, abs=0.02)
    known = np.isfinite(second.get_ydata())
    assert second.get_xdata()[known].max() == pytest.approx(1.2, abs=0.02)
    # Half a kilometre on, the first leg is half way from 300 m to 340 m; the ground is level at 200 m.
    assert np.interp(0.5, *first.get_xydata().T) == pytest.approx(320.0, abs=0.1)
    assert np.interp(0.5, *second.get_xydata()[known].T) == pytest.approx(330.0, abs=0.1)
    assert np.interp(0.5, *line(above, "first.mcap").get_xydata().T) == pytest.approx(120.0, abs=0.1)
    assert np.nanmax(line(airspeed, "second.mcap").get_ydata()) == pytest.approx(23.0)


def test_without_terrain_the_height_above_it_is_left_out() -> None:
    bare = make_setup(terrain={"kind": "none"}, threats=[])
    flight = replace(FIRST, setup=bare)
    panels = draw_chart(make_two_flights_chart((flight, replace(flight, name="second.mcap")))).axes
    titles = [axes.get_ylabel().replace("\n", " ").split(" (")[0] for axes in panels]
    assert titles == ["altitude", "airspeed", "bank, right +", "cross-track, right +", "throttle"]


def test_a_small_cross_track_fills_its_panel() -> None:
    """7 cm to either side are seen: the panel ends at 7 cm and its 8 % of air, not at a metre."""
    swing = np.linspace(-0.07, 0.07, len(FIRST.track)).astype(np.float32)
    flight = replace(FIRST, track=replace(FIRST.track, cross_track=swing))
    panels = draw_chart(make_two_flights_chart((flight, replace(flight, name="second.mcap")))).axes
    (cross,) = [axes for axes in panels if axes.get_ylabel().startswith("cross-track")]
    assert cross.get_ylim() == pytest.approx((-0.07 - 0.0112, 0.07 + 0.0112), abs=1e-6)


LOG = example_log()
FLOWN = flown_legs(LOG.setup, LOG.track, MissionStretch(0.0, 36.5, "AUTO", "log"))
assert FLOWN is not None
MOVED = replace(LOG.track, position=LOG.track.position + np.array([0.0, -2.0, 0.0]))
AGAIN = compare_with_model(LOG.setup, FLOWN, MOVED, "completed")
NONE = np.full(len(AGAIN.distance), np.nan)


def test_a_picture_a_quantity_and_none_of_what_was_not_logged() -> None:
    assert len(refly_charts(AGAIN)) == 5
    silent = replace(AGAIN, flown=replace(AGAIN.flown, energy=np.full(len(AGAIN.distance), np.nan)))
    assert "refly-energy.png" not in refly_charts(silent)


def test_lines_are_where_the_data_puts_them() -> None:
    upper, lower = draw_chart(refly_charts(AGAIN)["refly-cross-track.png"]).axes
    flown, model = (line(upper, name).get_ydata() for name in ("flown", "simulated"))
    assert np.nanmax(np.abs(flown)) < 1e-6
    assert abs(np.nanmedian(model[: len(model) // 2]) - 2.0) < 1e-6
    assert lower.get_xlabel() == "along the legs (km)"


def test_the_same_bytes_twice() -> None:
    one = replace(AGAIN, flown=replace(AGAIN.flown, **dict.fromkeys(("bank", "energy", "ground_speed"), NONE)))
    first, second = ([png_bytes(draw_chart(chart)) for chart in refly_charts(one).values()] for _ in range(2))
    assert first == second
