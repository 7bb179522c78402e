"""Time plots show the track's columns in the units of their labels, and energy by its own sums."""

import math
from dataclasses import replace

import numpy as np
import pytest

from logs.views.charts import Chart, Layer, Panel
from logs.views.time_series import compute_exposure_rates, control_chart, energy_chart, exposure_chart, time_chart
from tests.logs.views.report.report_data import make_setup, make_track

SETUP, TRACK = make_setup(), make_track()


def line(panel: Panel, name: str) -> Layer:
    return next(layer for layer in panel.layers if layer.name == name)


def panel(chart: Chart, title: str) -> Panel:
    return next(panel for panel in chart.panels if panel.title.startswith(title))


def test_bank_and_height_above_ground_are_those_of_track_and_terrain() -> None:
    chart = time_chart(SETUP, TRACK)
    assert len(chart.panels) == 8
    bank = panel(chart, "bank")
    # Half a radian to the left at 41 s; the limit is 30 degrees either way.
    flown = line(bank, "flown")
    assert np.interp(41.0, flown.x, flown.y) == pytest.approx(-math.degrees(0.5))
    assert bank.limits == (
        ("limit of planned turns; corrections may bank beyond it", pytest.approx(30.0)),
        ("", pytest.approx(-30.0)),
    )
    above = line(panel(chart, "height above"), "from track and terrain")
    # The ground is level at 200 m; the route starts at 300 m and ends at 360 m.
    assert above.y[[0, -1]] == pytest.approx([100.0, 160.0])
    assert line(panel(chart, "cross-track"), "according to guidance").y.min() == -3.25
    # Legs of 40, 32 and 25 rows, a row a second.
    assert chart.marks == ((0.0, "leg 0"), (40.0, "leg 1"), (72.0, "leg 2"))
    assert (chart.along, chart.unit, chart.timed) == ("time since the start", "s", True)


def test_legs_to_one_stop_have_one_number() -> None:
    """As around a loiter: the second waypoint belongs to the first stop, so that leg 1 begins with the third leg."""
    setup = replace(SETUP, route=SETUP.route.with_fields(stop=[0, 1, 1, 2]))
    assert time_chart(setup, TRACK).marks == ((0.0, "leg 0"), (72.0, "leg 1"))


def test_without_terrain_there_is_no_panel_of_clearance() -> None:
    chart = time_chart(make_setup(terrain={"kind": "none"}, threats=[]), TRACK)
    assert len(chart.panels) == 7
    assert not any("ground" in panel.title for panel in chart.panels)


def test_controls_are_in_degrees_and_the_throttle_in_percent() -> None:
    count = len(TRACK)
    commands = np.zeros((count, 4), dtype=np.float32)
    commands[:, 0], commands[:, 3] = math.radians(10.0), 0.5
    commands[30:60, 3] = commands[80:83, 3] = 1.0
    chart = control_chart(SETUP, replace(TRACK, commands=commands, controls=0.5 * commands))
    elevator, aileron, _, throttle = chart.panels
    assert [panel.title for panel in chart.panels] == ["elevator", "aileron", "rudder", "throttle"]
    assert line(elevator, "commanded").y == pytest.approx(10.0, abs=1e-5)
    assert line(elevator, "actual").y == pytest.approx(5.0, abs=1e-5)
    assert line(throttle, "commanded").y.max() == 100.0
    # Held at full throttle from 30 to 59 s, and again from 80 to 82 s.
    band = throttle.layers[0]
    assert (band.name, band.kind, band.quiet) == ("held at its limit", "band", True)
    assert band.x[np.isfinite(band.y)].tolist() == [30.0, 59.0, 80.0, 82.0]
    assert not any(layer.kind == "band" for layer in aileron.layers)


def test_power_and_energy_as_height_are_the_tracks() -> None:
    chart = energy_chart(SETUP, TRACK)
    # Half a watt-hour each second is 1800 W.
    power = panel(chart, "power").layers[0].y
    assert power[np.isfinite(power)] == pytest.approx(1800.0)
    height = panel(chart, "energy as")
    # 25^2 / (2 9.80665) = 31.87 m above the height itself, at the start 300 m.
    assert line(height, "height and speed").y[0] == pytest.approx(300.0 + 31.866, abs=0.01)
    assert line(height, "height only").y[0] == 300.0


def test_an_aircraft_without_a_battery_shows_the_heat_of_its_fuel_in_kilowatt_hours() -> None:
    envelope = replace(SETUP.envelope, power_level=np.ones_like(SETUP.envelope.climb), volts=0.0)
    setup = replace(SETUP, limits=replace(SETUP.limits, envelope=envelope))
    chart = energy_chart(setup, TRACK)
    assert [panel.label for panel in chart.panels] == ["heat of fuel used (kWh)", "power (kW)", "energy as height (m)"]
    used = line(chart.panels[0], "used")
    assert (used.kind, used.y[-1]) == ("band", pytest.approx(float(TRACK.energy[-1]) / 1000.0))
    assert "in full tanks" in chart.title


# ----------------------------------------------------------------------
# Exposure along a track is the closed-form integral of the paper's law.


def test_exposure_is_that_of_the_segments() -> None:
    # Past a unit at 100 m with scale 100: (100/d)^4 inside 300 m, integrated over s in closed form.
    position = np.column_stack([np.linspace(-500.0, 500.0, 401), np.full(401, 100.0), np.zeros(401)])
    rate = compute_exposure_rates(position, np.zeros((1, 3)), np.array([300.0]), np.array([100.0]))
    far = math.sqrt(300.0**2 - 100.0**2)
    exact = 100.0**4 * (far / (1e4 * 300.0**2) + math.atan(far / 100.0) / 1e6)
    assert float(rate.sum() * 2.5) == pytest.approx(exact, rel=1e-9)
    assert float(rate.max()) == pytest.approx(1.0, rel=1e-3)


def test_only_what_the_flight_was_exposed_to_has_panels() -> None:
    """A radar 100 m from the start reaches the flight; the missile beside it ends 50 m short of it."""
    near = {"east_m": -900, "north_m": -500, "amsl_m": 300}
    radar = {**near, "name": "R", "detection_radius_m": 400, "detection_scale_m": 90}
    missile = {**near, "name": "M", "kill_radius_m": 50, "kill_scale_m": 20}
    chart = exposure_chart(make_setup(threats=[radar, missile]), make_track())
    assert chart is not None
    assert [panel.title for panel in chart.panels] == ["detection strength", "detection so far"]
    assert exposure_chart(make_setup(threats=[missile]), make_track()) is None
    assert exposure_chart(make_setup(threats=[]), make_track()) is None
