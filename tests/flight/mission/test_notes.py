"""Notes stand in the order in which their reasons came up, each with its items in ranges."""

from flight.mission.notes import Notes


def test_each_reason_is_said_once_with_all_its_items_in_ranges() -> None:
    notes = Notes()
    for text, seq in (("b", 7), ("a", 2), ("b", 8), ("b", 8), ("b", 11), ("whole", None), ("whole", None), ("a", 1)):
        notes.add(text, seq)
    assert notes.lines() == ("items 7-8, 11: b", "items 1-2: a", "whole")


def test_one_item_is_no_items_and_nothing_noted_is_no_line() -> None:
    notes = Notes()
    assert notes.lines() == ()
    notes.add("a", 5)
    assert notes.lines() == ("item 5: a",)
