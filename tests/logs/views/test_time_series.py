"""Time plots show the track's columns in the units of their labels, and energy by its own sums."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from logs.views.time_series import draw_controls, draw_energy, draw_exposure, draw_time_plots, exposure_rates
from tests.logs.views.report.report_data import make_setup, make_track

SETUP, TRACK = make_setup(), make_track()


def line(axes: Any, label: str) -> Any:
    return next(one for one in axes.lines if one.get_label() == label)


def panel(figure: Any, title: str) -> Any:
    return next(axes for axes in figure.axes if axes.get_ylabel().startswith(title))


def test_bank_and_height_above_ground_are_those_of_track_and_terrain() -> None:
    figure = draw_time_plots(SETUP, TRACK)
    assert len(figure.axes) == 8
    bank = panel(figure, "bank")
    # Half a radian to the left at 41 s; the limit is 30 degrees either way.
    assert np.interp(41.0, *line(bank, "flown").get_xydata().T) == pytest.approx(-math.degrees(0.5))
    assert line(bank, "limit of planned turns;\ncorrections may pass it").get_ydata()[0] == pytest.approx(30.0)
    above = line(panel(figure, "height above"), "from track and terrain")
    # The ground is level at 200 m; the route starts at 300 m and ends at 360 m.
    assert above.get_ydata()[[0, -1]] == pytest.approx([100.0, 160.0])
    cross = line(panel(figure, "cross-track"), "as guidance saw it")
    assert cross.get_ydata().min() == -3.25


def test_without_terrain_there_is_no_panel_of_clearance() -> None:
    figure = draw_time_plots(make_setup(terrain={"kind": "none"}, threats=[]), TRACK)
    assert len(figure.axes) == 7
    assert not any("ground" in axes.get_ylabel() for axes in figure.axes)


def test_controls_are_in_degrees_and_the_throttle_in_percent() -> None:
    count = len(TRACK)
    commands = np.zeros((count, 4), dtype=np.float32)
    commands[:, 0], commands[:, 3] = math.radians(10.0), 0.5
    commands[30:60, 3] = 1.0
    track = replace(TRACK, commands=commands, controls=0.5 * commands)
    figure = draw_controls(SETUP, track)
    assert [axes.get_ylabel().split("\n")[0] for axes in figure.axes] == ["elevator", "aileron", "rudder", "throttle"]
    assert line(figure.axes[0], "commanded").get_ydata() == pytest.approx(10.0, abs=1e-5)
    assert line(figure.axes[0], "as it stood").get_ydata() == pytest.approx(5.0, abs=1e-5)
    assert line(figure.axes[3], "commanded").get_ydata().max() == 100.0
    # Held at full throttle from 30 to 59 s.
    (band,) = [one for one in figure.axes[3].collections if one.get_label() == "held at its limit"]
    corners = band.get_paths()[0].vertices[:, 0]
    assert (corners.min(), corners.max()) == (30.0, 59.0)
    assert not figure.axes[1].collections


def test_power_and_energy_as_height_are_the_tracks() -> None:
    figure = draw_energy(SETUP, TRACK)
    # Half a watt-hour each second is 1800 W.
    power = panel(figure, "power").lines[0].get_ydata()
    assert power[np.isfinite(power)] == pytest.approx(1800.0)
    height = panel(figure, "energy as")
    whole = line(height, "height and speed").get_ydata()
    # 25^2 / (2 9.80665) = 31.87 m above the height itself, at the start 300 m.
    assert whole[0] == pytest.approx(300.0 + 31.866, abs=0.01)
    assert line(height, "height alone").get_ydata()[0] == 300.0


def test_an_aircraft_without_a_battery_shows_the_heat_of_its_fuel_in_kilowatt_hours() -> None:
    envelope = replace(SETUP.envelope, power_level=np.ones_like(SETUP.envelope.climb), volts=0.0)
    setup = replace(SETUP, limits=replace(SETUP.limits, envelope=envelope))
    figure = draw_energy(setup, TRACK)
    assert [axes.get_ylabel().replace("\n", " ") for axes in figure.axes] == [
        "heat of fuel used (kWh)", "power (kW)", "energy as height (m)",
    ]  # fmt: skip
    assert line(figure.axes[0], "used").get_ydata()[-1] == pytest.approx(float(TRACK.energy[-1]) / 1000.0)
    assert "in full tanks" in figure.texts[0].get_text()


# ----------------------------------------------------------------------
# Exposure along a track is the closed-form integral of the paper's law.


def test_exposure_is_that_of_the_segments() -> None:
    # Past a unit at 100 m with scale 100: (100/d)^4 inside 300 m, integrated over s in closed form.
    position = np.column_stack([np.linspace(-500.0, 500.0, 401), np.full(401, 100.0), np.zeros(401)])
    rate = exposure_rates(position, np.zeros((1, 3)), np.array([300.0]), np.array([100.0]))
    far = math.sqrt(300.0**2 - 100.0**2)
    exact = 100.0**4 * (far / (1e4 * 300.0**2) + math.atan(far / 100.0) / 1e6)
    assert float(rate.sum() * 2.5) == pytest.approx(exact, rel=1e-9)
    assert float(rate.max()) == pytest.approx(1.0, rel=1e-3)


def test_only_what_the_flight_was_exposed_to_has_panels() -> None:
    """A radar 100 m from the start reaches the flight; the missile beside it ends 50 m short of it."""
    near = {"east_m": -900, "north_m": -500, "amsl_m": 300}
    radar = {**near, "name": "R", "detection_radius_m": 400, "detection_scale_m": 90}
    missile = {**near, "name": "M", "kill_radius_m": 50, "kill_scale_m": 20}
    figure = draw_exposure(make_setup(threats=[radar, missile]), make_track())
    assert figure is not None
    assert [axes.get_ylabel().split("\n")[0] for axes in figure.axes] == ["detection", "detection"]
    assert draw_exposure(make_setup(threats=[missile]), make_track()) is None
    assert draw_exposure(make_setup(threats=[]), make_track()) is None
