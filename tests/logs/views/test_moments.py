"""The moments are the track's rows in the units of the read-out, and legs and waypoints have their items' names."""

from dataclasses import replace

import numpy as np
import pytest

from logs.views.map import position_text
from logs.views.moments import MAX_MOMENTS, aircraft_model, flight_moments, leg_names, waypoint_names
from tests.logs.views.report.report_data import make_setup, make_track

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
    assert leg_names(SETUP) == ["leg 0 (to item 1)", "leg 1 (to item 2)", "leg 2 (to item 3)"]
    assert waypoint_names(SETUP)[1] == "waypoint 1 (item 1)\n340 m AMSL"
    bare = replace(SETUP, route=SETUP.route.with_fields(item=-1))
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
