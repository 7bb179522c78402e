"""What rounding may miss of an acceptance radius, and which of several close approaches counts."""

import math
from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import judge, of, waypoint
from tests.synthetic import bank_radius, fly_path, make_setup


@pytest.mark.parametrize(("short", "ok"), [(0.018, True), (0.022, False)])
def test_an_arc_may_miss_its_acceptance_by_two_centimetres(short: float, ok: bool) -> None:
    """A right angle's arc passes its waypoint at R (root 2 - 1)."""
    setup = make_setup([[0, 0, 300], [0, 3000, 300], [3000, 3000, 300]])
    radius = bank_radius() * (math.sqrt(2.0) - 1.0) - short
    stated = replace(setup, route=setup.route.with_fields(acceptance_radius=radius))
    assert of(judge_geometry(stated), "waypoint", waypoint(1)).ok is ok


def test_of_rows_that_are_half_a_metre_further_the_one_nearest_in_height_counts() -> None:
    """Over the waypoint 10 m too high, and a metre less for each decimetre before or after it."""
    setup = make_setup([[0, 0, 300], [0, 300, 300], [0, 600, 300]])

    def peak(s: np.ndarray) -> np.ndarray:
        return np.maximum(0.0, 10.0 - 10.0 * np.abs(s - 300.0))

    item = of(judge(setup, fly_path(setup, up=peak, rate=1000.0)), "waypoint", waypoint(1))
    assert item.flown == pytest.approx(0.0, abs=0.02)
    assert {fact.what: fact.value for fact in item.facts}["height error"] == pytest.approx(5.0, abs=0.5)
