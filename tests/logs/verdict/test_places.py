"""Places are values: equal by what they hold, usable as keys, and not to be changed."""

import dataclasses

import pytest

from logs.verdict.places import FLIGHT, MISSION, PLAN, Change, Disagreement, Place


def test_places_of_the_same_data_are_one_key() -> None:
    # What a leg leads to comes with its index; logs of before do not hold it.
    assert Place("leg", 3, to_item=4) == Place("leg", 3)
    found = {Place("waypoint", 3, item=4): "turn", Place("leg", 3): "slope"}
    assert found[Place("waypoint", 3, 4)] == "turn"
    assert found[Place("leg", 3)] == "slope"
    different = {
        Place("waypoint", 3), Place("waypoint", 3, item=4), Place("leg", 3), Place("missile", 3, name="a"),
        Place("radar", 3, name="a"), Place("radar", 3, name="b"), FLIGHT, MISSION, PLAN,
    }  # fmt: skip
    assert len(different) == 9


def test_a_place_a_change_and_a_disagreement_cannot_be_changed() -> None:
    change = Change("length", Place("leg", 1), 300.0, 400.0, "m")
    for thing, field in (
        (Place("leg", 1), "index"),
        (change, "wanted"),
        (Disagreement("a", PLAN, "geometry", True, False), "here"),
    ):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(thing, field, 1)
    assert {change: 1}[dataclasses.replace(change)] == 1
