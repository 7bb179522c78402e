"""Failures: the most frequent first."""

from planfly.campaigns.pictures.failure_picture import MOST, draw_failures


def test_bars_are_as_long_as_flights_failed() -> None:
    figure = draw_failures([("slopes", "leg 2", 3), ("clearance", "leg 8", 9)], 100)
    assert [patch.get_width() for patch in figure.axes[0].patches] == [9, 3]
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels == ["clearance, leg 8", "slopes, leg 2"]


def test_none_is_said_and_many_are_cut() -> None:
    assert "No flight of 7" in draw_failures([], 7).axes[0].texts[0].get_text()
    many = [("turns", f"waypoint {k}", k + 1) for k in range(40)]
    assert len(draw_failures(many, 100).axes[0].patches) == MOST
