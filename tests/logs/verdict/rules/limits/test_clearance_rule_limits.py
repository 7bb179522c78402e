"""Heights over level ground just inside and just outside the clearance, planned and flown, on each leg."""

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import judge, leg, of
from tests.synthetic import bump, fly_path, make_setup

ROUTE = [[0, 0], [0, 3000], [0, 6000], [0, 9000]]


def over(up: float) -> list[list[float]]:
    return [[*place, up] for place in ROUTE]


@pytest.mark.parametrize(("up", "ok"), [(59.91, True), (59.89, False), (57.5, False)])
def test_a_planned_clearance_is_kept_to_a_decimetre(up: float, ok: bool) -> None:
    setup = make_setup(over(up), limits={"min_clearance_m": 60.0})
    assert of(judge_geometry(setup), "clearance", leg(1)).ok is ok


@pytest.mark.parametrize(("up", "ok"), [(59.92, True), (59.88, False), (57.5, False)])
@pytest.mark.parametrize(("number", "at"), [(0, 0.0), (0, 1500.0), (1, 4500.0), (2, 7500.0), (2, 9000.0)])
def test_a_flown_clearance_is_kept_to_a_decimetre_from_the_first_row_to_the_last(
    up: float, ok: bool, number: int, at: float
) -> None:
    setup = make_setup(over(100.0), limits={"min_clearance_m": 60.0})
    item = of(judge(setup, fly_path(setup, up=bump(at, up - 100.0, 150.0))), "clearance", leg(number))
    assert item.ok is ok
    assert item.flown == pytest.approx(up, abs=0.01)
    assert np.isclose(item.margin or 0.0, up - 60.0, atol=0.01)
