"""A photo line flown just within what a photo bears, and just outside it."""

import numpy as np
import pytest

from logs.verdict.measures.photo_lines import _cells
from tests.logs.verdict.judging import judge
from tests.synthetic import fly_path, make_setup


@pytest.mark.parametrize(("off", "lost"), [(4.9, 0.0), (5.1, 20.0), (-4.9, 0.0), (-5.1, 20.0)])
def test_low_over_ground_a_photo_may_be_five_metres_off(off: float, lost: float) -> None:
    """A tenth of 30 m would be 3 m.  Three lines of 1,000 m, off from 400 m to 600 m on the first."""
    ways = [
        [(200.0 * k, north) for north in (-300.0, 0.0, 1000.0, 1300.0)][:: 1 if k % 2 == 0 else -1] for k in range(3)
    ]
    setup = make_setup([[*place, 30.0] for way in ways for place in way], limits={"surveys": "lines"})
    track = fly_path(setup, up=lambda s: np.where((s > 700.0) & (s < 900.0), off, 0.0))
    first = next(item for item in judge(setup, track).findings if item.rule == "survey")
    assert first.flown == pytest.approx(100.0 - lost, abs=1.0)


def test_a_line_is_looked_at_metre_by_metre() -> None:
    along = np.arange(0.0, 12.25, 0.25)
    taken = _cells(along, along <= 7.0, 12.0)
    assert (len(taken), np.count_nonzero(taken)) == (12, 7)
