"""Threats as records and as spheres: each number under its name, powers as they are compared with."""

import numpy as np
import pytest

from planner.evaluation.problem_arrays import (
    OBJECTIVES,
    SPHERE,
    VIOLATIONS,
    as_columns,
    sphere_records,
    threat_records,
)
from planner.plan import Objective, Violation
from world.threats import Threats

THREATS = Threats(
    names=("missile", "radar"),
    position=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
    kill_radius=np.array([700.0, 0.0]),
    detection_radius=np.array([0.0, 900.0]),
    kill_scale=np.array([70.0, 0.0]),
    detection_scale=np.array([0.0, 90.0]),
)


def test_units_stand_under_their_names() -> None:
    missile, radar = threat_records(THREATS)
    assert [missile[name] for name in ("east", "north", "up")] == [1.0, 2.0, 3.0]
    assert [radar[name] for name in ("east", "north", "up")] == [4.0, 5.0, 6.0]
    names = ("kill_radius", "kill_scale", "detection_radius", "detection_scale")
    assert [missile[name] for name in names] == [700.0, 70.0, 0.0, 0.0]
    assert [radar[name] for name in names] == [0.0, 0.0, 900.0, 90.0]


def test_spheres_hold_squares_and_fourth_powers() -> None:
    missile, radar = sphere_records(threat_records(THREATS))
    assert [radar[name] for name in ("east", "north", "up")] == [4.0, 5.0, 6.0]
    assert (missile["kill_radius2"], missile["kill_scale4"]) == (490_000.0, 24_010_000.0)
    assert (radar["detection_radius2"], radar["detection_scale4"]) == (810_000.0, 65_610_000.0)


def test_no_distance_is_within_a_weapon_that_is_not_there() -> None:
    missile, radar = sphere_records(threat_records(THREATS))
    # Not even that of a point at the unit itself.
    assert missile["detection_radius2"] < 0.0
    assert radar["kill_radius2"] < 0.0


def test_a_sphere_fills_a_line_of_the_cache() -> None:
    assert SPHERE.itemsize == 64


@pytest.mark.parametrize("make", [threat_records, lambda threats: sphere_records(threat_records(threats))])
def test_records_are_locked_and_none_are_made_of_none(make: object) -> None:
    assert callable(make)
    assert len(make(Threats((), np.zeros((0, 3)), *(4 * [np.zeros(0)])))) == 0
    assert not make(THREATS).flags.writeable


def test_columns_stand_in_the_order_of_violations_and_objectives() -> None:
    found = np.zeros(2, VIOLATIONS)
    for item in Violation:
        found[item.name.lower()] = 10.0 + item
    assert as_columns(found).tolist() == [[10.0, 11.0, 12.0, 13.0]] * 2
    scored = np.zeros(1, OBJECTIVES)
    scored["kill_exposure"] = 3.0
    assert as_columns(scored)[0, Objective.KILL_EXPOSURE] == 3.0
    # A view: what is written to the one stands in the other.
    as_columns(scored)[0, Objective.HEIGHT_SUM] = 8.0
    assert scored["height_sum"][0] == 8.0
