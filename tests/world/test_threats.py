"""Threats hold what they were given, and nothing changes it afterwards."""

import numpy as np
import pytest

from world.threats import Threats

ARRAYS = ("position", "kill_radius", "detection_radius", "kill_scale", "detection_scale")


def two_units() -> Threats:
    return Threats(
        names=("missile", "radar"),
        position=np.array([[1, 2, 3], [4, 5, 6]]),
        kill_radius=np.array([700, 0]),
        detection_radius=np.array([0, 900]),
        kill_scale=np.array([70, 0]),
        detection_scale=np.array([0, 90]),
    )


def test_units_are_counted_and_their_numbers_are_floats() -> None:
    threats = two_units()
    assert len(threats) == 2
    assert all(getattr(threats, name).dtype == np.float64 for name in ARRAYS)
    assert threats.position[1].tolist() == [4.0, 5.0, 6.0]


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_are_locked_and_are_not_the_givers(name: str) -> None:
    threats = two_units()
    with pytest.raises(ValueError, match="read-only"):
        getattr(threats, name)[0] = 9.0
    given = np.zeros((2, 3) if name == "position" else 2)
    fields = {item: getattr(threats, item) for item in ARRAYS} | {name: given}
    made = Threats(threats.names, **fields)
    given += 5.0
    assert not getattr(made, name).any()


def test_no_threats_are_none() -> None:
    empty = np.zeros(0)
    none = Threats((), np.zeros((0, 3)), empty, empty, empty, empty)
    assert len(none) == 0
    assert none.position.shape == (0, 3)
    assert all(getattr(none, name).shape == (0,) for name in ARRAYS[1:])
