"""What rounding may add to a corridor that its turns fill."""

import math

import pytest

from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import leg, of
from tests.synthetic import bank_radius, make_setup


@pytest.mark.parametrize(("short", "ok"), [(0.018, True), (0.022, False)])
def test_turns_may_be_planned_two_centimetres_beyond_the_corridor(short: float, ok: bool) -> None:
    """A right angle's arc passes R (1 - cos 45) inside its legs."""
    stated = bank_radius() * (1.0 - math.sqrt(0.5)) - short
    setup = make_setup([[0, 0, 300], [0, 3000, 300], [3000, 3000, 300]], limits={"corridor_m": stated})
    assert of(judge_geometry(setup), "corridor", leg(0)).ok is ok
