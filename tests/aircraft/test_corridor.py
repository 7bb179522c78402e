"""The corridor: what a scenario states, or what whoever flies needs."""

import pytest

from aircraft.corridor import corridor_half_width


@pytest.mark.parametrize(
    ("stated", "radius", "wanted"),
    [
        (None, None, 30.0),
        (None, 14.9, 30.0),
        (None, 15.1, 30.2),
        (None, 90.0, 180.0),
        (5.0, 90.0, 5.0),
        (5.0, None, 5.0),
    ],
)
def test_half_width(stated: float | None, radius: float | None, wanted: float) -> None:
    assert corridor_half_width(stated, radius) == pytest.approx(wanted)
