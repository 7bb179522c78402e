"""A chart's data keep their numbers, as fine as a screen can show, and nothing that JSON cannot hold."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.findings import Verdict
from logs.verdict.places import Place
from logs.views import drawing
from logs.views.compare_charts import NamedFlight
from logs.views.failures import Failures
from logs.views.report.charts import (
    LOOKS,
    MAX_MOMENTS,
    Chart,
    ChartPanel,
    Layer,
    aircraft_model,
    chart_json,
    compare_charts,
    envelope_chart,
    flight_moments,
    leg_names,
    map_chart,
    numbers,
    parted_unit,
    position_text,
    stack_chart,
    telling_digits,
    turn_chart,
    waypoint_names,
)
from logs.views.time_series import Axis, Panel, Series, Stack, control_stack, time_axis, time_stack
from tests.logs.made_flight import make_setup as made_setup
from tests.logs.views.report.report_data import FINDINGS, VERDICT, finding, make_setup, make_track


def test_numbers_are_rounded_and_what_is_none_is_null() -> None:
    assert numbers([1.26, -0.04, math.nan, math.inf], 1) == [1.3, 0.0, None, None]
    assert math.copysign(1.0, numbers([-0.04], 1)[0] or 0.0) == 1.0


def test_digits_show_a_ten_thousandth_of_the_range() -> None:
    for span in (0.003, 1.0, 85.0, 25_000.0):
        step = 10.0 ** -telling_digits(np.array([5.0, 5.0 + span]))
        assert span / 1e5 <= step <= max(span / 1e3, 1.0)
    assert telling_digits(np.array([np.nan])) == 4
    assert telling_digits(np.array([200.0, 200.0])) == 2


def test_layers_without_values_and_limits_that_are_none_are_left_out() -> None:
    x = np.array([0.0, 1.0])
    shown = Layer("band", "ground", "terrain", x, np.array([2.0, np.nan]), np.zeros(2), dashed=True, legend="all")
    hidden = Layer("line", "lost", "flown", x, np.full(2, np.nan))
    panel = ChartPanel("height", "m", (shown, hidden), (("floor", math.nan), ("ceiling", 9.0)), span=(0.0, 3.0))
    made = chart_json(Chart("way", "km", (panel,), marks=((0.12345, "leg 0"),)))
    (found,) = made["panels"]
    assert found["limits"] == [["ceiling", 9.0]]
    (layer,) = found["layers"]
    assert (layer["y"], layer["low"]) == ([2.0, None], [0.0, 0.0])
    assert (layer["dashed"], layer["legend"], "quiet" in layer) == (True, "all", False)
    assert made["marks"] == [[0.123, "leg 0"]]
    json.dumps(made, allow_nan=False)


# ----------------------------------------------------------------------
# The moments are the track's rows in the units of the read-out, and legs and waypoints have their items' names.

SETUP, TRACK = make_setup(), make_track()


def test_moments_are_the_tracks_rows() -> None:
    found = flight_moments(SETUP, TRACK)
    assert found["time"] == TRACK.time.tolist()
    assert (found["east"][10], found["north"][10], found["up"][10]) == (-650.0, -400.0, 310.0)
    assert found["above"][10] == 110.0
    assert found["airspeed"][10] == 25.0
    # Half a radian to the left at row 41.
    assert found["bank"][41] == pytest.approx(-28.6)
    assert found["leg"][-1] == 2
    # A course is told from 0 to 360 degrees.
    attitude = TRACK.attitude.copy()
    attitude[:, 2] = -0.5
    assert flight_moments(SETUP, replace(TRACK, attitude=attitude))["heading"][0] == pytest.approx(331.4)
    assert found["legs"] == leg_names(SETUP)


def test_unknown_places_are_left_out_and_long_flights_thinned() -> None:
    position = TRACK.position.copy()
    position[3:5] = np.nan
    found = flight_moments(SETUP, replace(TRACK, position=position))
    assert len(found["time"]) == len(TRACK) - 2
    assert 3.0 not in found["time"]
    many = {name: np.repeat(getattr(TRACK, name), 50, axis=0) for name in TRACK.__slots__}
    assert len(flight_moments(SETUP, type(TRACK)(**many))["time"]) == MAX_MOMENTS


def test_without_terrain_no_height_above_ground_is_said() -> None:
    found = flight_moments(make_setup(terrain={"kind": "none"}, threats=[]), TRACK)
    assert set(found["above"]) == {None}


def test_legs_and_waypoints_have_the_names_of_the_verdict() -> None:
    assert leg_names(SETUP) == ["leg 0, to item 1", "leg 1, to item 2", "leg 2, to item 3"]
    assert waypoint_names(SETUP)[1] == "waypoint 1 (item 1)<br>340 m AMSL"
    bare = replace(SETUP, route=replace(SETUP.route, items=np.full(4, -1)))
    assert leg_names(bare)[0] == "leg 0"


def test_the_model_is_one_unit_wide_and_has_a_red_and_a_green_wing() -> None:
    model = aircraft_model()
    corners = np.array(model["corners"])
    assert corners.shape == (len(model["colours"]), 3, 3)
    assert np.ptp(corners[..., 1]) == pytest.approx(1.0)
    left = max(range(len(corners)), key=lambda k: corners[k, :, 1].max())
    red, green, _ = model["colours"][left]
    assert red > green
    assert position_text(-46.0, 8.0) == "−46.0000°, 8.0000°"


# ----------------------------------------------------------------------
# Charts over time hold the values of the drawn panels, their limits, and where legs begin and controls are held.

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
    assert set(LOOKS) <= set(drawing.DRAWN)


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


# ----------------------------------------------------------------------
# Two flights' charts hold both by name; without one map origin there is no map.


def test_both_flights_are_on_map_and_along_their_way() -> None:
    first = NamedFlight("a.mcap", make_setup(), make_track())
    made = compare_charts((first, replace(first, name="b.mcap")))
    assert [(one["name"], one["dashed"]) for one in made["flight"]["flights"]] == [("a.mcap", False), ("b.mcap", True)]
    names = [layer["name"] for layer in made["charts"]["along"]["panels"][0]["layers"]]
    assert names == ["a.mcap", "b.mcap"]
    origin = first.setup.scenario.origin
    away = replace(first.setup.scenario, origin=replace(origin, lat_deg=origin.lat_deg + 1.0))
    apart = compare_charts((first, replace(first, setup=replace(first.setup, scenario=away))))
    assert (apart["scene"], "map" in apart["charts"]) == (None, False)


# ----------------------------------------------------------------------
# The envelope's chart has the aircraft's limits, the legs and the flight where they are.


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


# ----------------------------------------------------------------------
# The map's own data: reach at the path's height, what is shown, and what the plan was where the route differs.

SETUP, TRACK = make_setup(), make_track()


def test_the_map_reaches_as_far_as_area_and_flights_with_a_rim() -> None:
    position = TRACK.position.copy()
    position[5, 0] = 2000.0
    found = map_chart(SETUP, [TRACK, replace(TRACK, position=position)], Failures({}, {}))
    rim = 0.015 * 3200.0
    assert found["shown"] == [[-1200.0 - rim, 2000.0 + rim], [-800.0 - rim, 800.0 + rim]]
    assert found["area"] == [[-1200.0, 1200.0], [-800.0, 800.0]]
    assert (found["start"], found["destination"]) == ([-900.0, -400.0], [700.0, 400.0])


def test_a_missiles_reach_is_its_spheres_cut_at_the_height_of_the_path() -> None:
    (reach,) = map_chart(SETUP, [], Failures({}, {}))["reach"]
    # 250 m about the ground at 200 m; the path passes 160 m above it, at about 360 m.
    assert reach == pytest.approx(np.sqrt(250.0**2 - 160.0**2), abs=3.0)


def test_entered_threats_and_a_route_without_a_plan_are_told() -> None:
    entered = Failures({}, {}, threats=(Place("missile", 0, name="x"),))
    found = map_chart(SETUP, [TRACK], entered)
    assert found["entered"] == [0]
    assert (found["searched"], found["routeName"]) == (None, "route of the mission")


def test_a_plan_is_told_from_a_route_that_differs_by_over_a_metre() -> None:
    setup = made_setup()
    assert setup.plan is not None
    same = replace(setup, route=replace(setup.route, waypoints=setup.plan.waypoints))
    assert map_chart(same, [], Failures({}, {}))["routeName"] == "planned path"
    moved = replace(setup.plan, waypoints=setup.route.waypoints + np.array([0.0, 2.0, 0.0]))
    found = map_chart(replace(setup, plan=moved), [], Failures({}, {}))
    assert found["routeName"] == "route of the mission"
    assert found["searched"] == np.round(moved.waypoints[:, :2], 1).tolist()


# ----------------------------------------------------------------------
# The chart of turns and legs holds each finding's numbers, rings what fails, and names limits that it leaves out.


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
