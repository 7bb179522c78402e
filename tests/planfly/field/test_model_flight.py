from dataclasses import replace
from pathlib import Path

import pytest

from logs.field_logs.example_raw_log import example_raw_log
from logs.field_logs.raw_log import ModeChange
from planfly.field.field_flights import FieldOptions
from planfly.field.model_flight import fly_again
from tests.logs.field_logs.judged_flights import judged
from world.errors import LogError


def silent(_done: float, _whole: float, _remark: str) -> None:
    """Report nothing."""


def test_the_model_flies_the_legs_of_the_longest_stretch_in_the_wind_of_the_log(tmp_path: Path) -> None:
    flight = judged(tmp_path, options=FieldOptions(aircraft="aerosonde"))
    (again,) = fly_again(flight.setup, flight.track, None, None, silent)
    assert (len(again.legs), again.ended, again.stands_in) == (2, "completed", False)
    # 3 m/s from the north: 25 m/s of equivalent airspeed are 25.6 at 500 m, less 3 against the wind.
    flown, model = again.legs[0].ground_speed
    assert flown == pytest.approx(25.0, abs=0.1)
    assert model == pytest.approx(25.6 - 3.0, abs=0.5)
    assert again.setup.parameters is not None
    assert again.setup.parameters.wp_radius == 60.0


def test_another_aircraft_stands_in_where_none_is_named(tmp_path: Path) -> None:
    flight = judged(tmp_path)
    assert fly_again(flight.setup, flight.track, None, None, silent)[0].stands_in
    assert not fly_again(flight.setup, flight.track, "aerosonde", None, silent)[0].stands_in


def test_a_flight_that_followed_no_mission_is_not_flown_again(tmp_path: Path) -> None:
    raw = replace(example_raw_log(), modes=(ModeChange(20.0, "FBWA", False),))
    flight = judged(tmp_path, raw)
    with pytest.raises(LogError, match="none of its mission's legs was flown"):
        fly_again(flight.setup, flight.track, None, None, silent)


def test_every_stretch_is_flown_again_the_longest_first(tmp_path: Path) -> None:
    """AUTO from 20 s to 75 s, and from 76 s on: the turn is at 70 s, the end at 110 s."""
    modes = (ModeChange(20.0, "AUTO", True), ModeChange(75.0, "FBWA", False), ModeChange(76.0, "AUTO", True))
    flight = judged(tmp_path, replace(example_raw_log(), modes=modes), FieldOptions(aircraft="aerosonde"))
    found = fly_again(flight.setup, flight.track, None, None, silent)
    assert [(again.stretch.start, again.first, len(again.legs)) for again in found] == [(20.0, 0, 2)]
    turned = (ModeChange(20.0, "AUTO", True), ModeChange(40.0, "FBWA", False), ModeChange(68.0, "AUTO", True))
    flight = judged(tmp_path, replace(example_raw_log(), modes=turned), FieldOptions(aircraft="aerosonde"))
    found = fly_again(flight.setup, flight.track, None, None, silent)
    assert [(again.stretch.start, again.first, len(again.legs)) for again in found] == [(20.0, 0, 1), (68.0, 1, 1)]
