"""The envelope's picture: limits where the envelope has them, dots where the flight was."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from logs.views.drawing import draw_chart
from logs.views.envelope import envelope_chart
from tests.logs.views.report.report_data import make_setup, make_track
from tests.synthetic import make_setup as setup_along


def labelled(axes: Any, label: str) -> Any:
    return next(line for line in axes.lines if line.get_label() == label)


def test_limits_are_the_envelopes_and_the_bank_limit_the_plans() -> None:
    slopes, bank = draw_chart(envelope_chart(make_setup(), None)).axes
    # report_data's aircraft climbs 0.2 rad and descends 0.1 rad at every speed and height; the route is at 300..380 m.
    assert labelled(slopes, "steepest climb at 300 m").get_ydata() == pytest.approx(math.degrees(0.2))
    assert labelled(slopes, "steepest descent at 380 m").get_ydata() == pytest.approx(-math.degrees(0.1))
    assert labelled(bank, "limit of planned turns; corrections may bank beyond it").get_ydata()[0] == pytest.approx(
        30.0
    )
    assert labelled(bank, "the aircraft's bank limit").get_ydata()[0] == pytest.approx(math.degrees(0.7))
    legs = labelled(slopes, "legs as planned (over the ground)")
    np.testing.assert_allclose(legs.get_xdata(), 25.0)
    # 40 m up over 1000 m, 40 m up over 800 m, 20 m down over 600 m.
    wanted = np.degrees(np.arctan([40.0 / 1000.0, 40.0 / 800.0, -20.0 / 600.0]))
    np.testing.assert_allclose(legs.get_ydata(), wanted)
    assert not any("flown" in line.get_label() for line in slopes.lines)


def test_legs_are_drawn_at_the_true_airspeed_of_an_equivalent_command() -> None:
    """ArduPlane at 3,000 m, where the density is 0.9093 kg/m^3 by 1.2250 at sea level (ISO 2533)."""
    made = setup_along([[0, 0, 3000], [0, 1000, 3000]], terrain={"kind": "flat", "amsl_m": 2500.0})
    setup = replace(made, autopilot=ArduPlane(ArduPilotParameters.defaults()))
    for one, factor in ((made, 1.0), (setup, math.sqrt(1.2250 / 0.9093))):
        slopes, _ = draw_chart(envelope_chart(one, None)).axes
        legs = labelled(slopes, "legs as planned (over the ground)")
        np.testing.assert_allclose(legs.get_xdata(), 25.0 * factor, rtol=1e-3)


def test_dots_are_the_path_through_the_air_and_the_bank_to_either_side() -> None:
    track = make_track()
    velocity = np.tile(np.array([30.0, 0.0, 5.0]), (len(track), 1)).astype(np.float32)
    wind = np.tile(np.array([10.0, 0.0, 1.0]), (len(track), 1)).astype(np.float32)
    slopes, bank = draw_chart(envelope_chart(make_setup(), replace(track, velocity=velocity, wind=wind))).axes
    dots = labelled(slopes, "flown, moment by moment")
    # 20 m/s ahead and 4 m/s up through the air.
    assert dots.get_ydata() == pytest.approx(math.degrees(math.atan2(4.0, 20.0)), abs=1e-4)
    assert dots.get_xdata() == pytest.approx(25.0)
    # Half a radian to the left is as much bank as to the right.
    assert labelled(bank, "flown, moment by moment").get_ydata().max() == pytest.approx(math.degrees(0.5), abs=1e-4)


def test_rows_that_are_no_numbers_are_left_out() -> None:
    track = make_track()
    airspeed = track.airspeed.copy()
    airspeed[5:20] = np.nan
    slopes, _ = draw_chart(envelope_chart(make_setup(), replace(track, airspeed=airspeed))).axes
    assert len(labelled(slopes, "flown, moment by moment").get_xdata()) == len(track) - 15
