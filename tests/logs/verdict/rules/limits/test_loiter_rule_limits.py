"""A circle just as wide as the aircraft needs, and two centimetres narrower."""

import pytest

from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import of
from tests.mission_lines import setup_of, wp
from tests.synthetic import bank_radius


@pytest.mark.parametrize(("short", "ok"), [(0.018, True), (0.022, False)])
def test_a_circle_may_be_two_centimetres_narrower_than_the_bank_limits(short: float, ok: bool) -> None:
    radius = bank_radius() - short
    setup = setup_of(wp(0, 0), wp(0, 2000, command=18, p=f"2 0 {radius:.6f} 0"), wp(0, 4000))
    item = of(judge_geometry(setup), "loiter")
    assert item.limit == pytest.approx(bank_radius(), abs=1e-4)
    assert item.ok is ok
