"""Turns as flown: angle, bank, radius and how closely the waypoint was passed."""

import math

import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.track_alignment import lay_track
from logs.verdict.measures.turns import TurnMeasure, measure_turn
from tests.synthetic import bank_radius, fly_path


def test_a_clean_turn_is_measured_as_it_was_flown(setup: FlightSetup, track: Track) -> None:
    demands = route_demands(setup)
    aligned = lay_track(demands, track)
    assert aligned is not None
    for i in (1, 2, 3):
        measure = measure_turn(demands, aligned, i)
        assert measure.fitted
        assert measure.over
        assert measure.full_circles == 0
        assert measure.angle == pytest.approx(abs(demands.turns[i]), abs=1e-4)
        assert measure.radius == pytest.approx(bank_radius(), rel=0.02)
        assert measure.held_bank == pytest.approx(math.radians(30.0), abs=0.01)
        assert measure.passed == pytest.approx(demands.fly_by_offset[i], abs=0.1)


def test_a_turn_that_was_not_reached_has_no_numbers(setup: FlightSetup) -> None:
    demands = route_demands(setup)
    aligned = lay_track(demands, fly_path(setup, stop=2500.0))
    assert aligned is not None
    assert measure_turn(demands, aligned, 3) == TurnMeasure()
