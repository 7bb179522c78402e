"""Outages of a radio link along a path, from margins that are known by hand."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from logs.verdict.measures import link_outages
from logs.verdict.measures.link_outages import LinkAlongPath, link_along_path
from world.frames import GeoOrigin
from world.radio import LinkPoints, RadioLink, make_link
from world.scenario_tables import LinkTable
from world.terrain import make_flat_terrain

FLAT = make_flat_terrain(np.array([[-20_000.0, 20_000.0], [-20_000.0, 20_000.0]]), 0.0, 0.0)
UNKNOWN = math.nan


def any_link() -> RadioLink:
    table = LinkTable(frequency_mhz=1000.0, power_dbm=20.0, sensitivity_dbm=-90.0, east_m=0.0, north_m=0.0)
    link = make_link(table, "mine.toml", GeoOrigin(46.0, 8.0), None)
    assert link is not None
    return link


def along_margins(monkeypatch: pytest.MonkeyPatch, margins: Sequence[float], start: float = 0.0) -> LinkAlongPath:
    """Return a link with these margins, a second apart, from a time on, s."""
    count = len(margins)

    def points(link: RadioLink, terrain: object, station: object, positions: np.ndarray) -> LinkPoints:
        assert positions.shape == (count, 3)
        return LinkPoints(np.array(margins), *(np.zeros(count) for _ in range(2)), np.ones(count) > 0, np.zeros(count))

    monkeypatch.setattr(link_outages, "link_points", points)
    times = start + np.arange(count, dtype=np.float64)
    positions = np.column_stack([times, np.zeros(count), np.full(count, 100.0)])
    return link_along_path(any_link(), FLAT, np.zeros(3), times, positions)


@pytest.mark.parametrize(
    ("margins", "outages"),
    [
        ([3.0, 0.0, 2.0], []),
        # Lost a quarter of a second after 1 s, where it falls from 1 to -3 dB, and back half a second before 3 s.
        ([1.0, 1.0, -3.0, 3.0, 3.0], [(1.25, 2.5)]),
        ([-1.0, -1.0, -2.0], [(0.0, 2.0)]),
        ([-1.0, 1.0, 1.0, -1.0], [(0.0, 0.5), (2.5, 3.0)]),
        # One point below between two above; from exactly 0 it begins at once.
        ([0.0, -4.0, 4.0], [(0.0, 1.5)]),
        # An unknown margin ends an outage, and begins none.
        ([-1.0, -1.0, UNKNOWN, -1.0, -1.0], [(0.0, 1.0), (3.0, 4.0)]),
        ([1.0, UNKNOWN, -1.0], []),
        ([UNKNOWN, UNKNOWN], []),
    ],
)
def test_outages_by_interpolated_margins(
    margins: list[float], outages: list[tuple[float, float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    for start in (0.0, 100.0):
        along = along_margins(monkeypatch, margins, start)
        expected = [start + time for outage in outages for time in outage]
        assert [time for outage in along.outages for time in (outage.start, outage.end)] == pytest.approx(expected)
        durations = [last - first for first, last in outages]
        assert along.time_below_margin == pytest.approx(sum(durations))
        assert along.longest_outage == pytest.approx(max(durations, default=0.0))
        assert along.is_known == (not any(map(math.isnan, margins)))


def test_the_worst_point_is_that_of_the_smallest_known_margin(monkeypatch: pytest.MonkeyPatch) -> None:
    assert along_margins(monkeypatch, [3.0, UNKNOWN, -7.0, 2.0]).worst_point == 2
    assert along_margins(monkeypatch, [UNKNOWN, UNKNOWN]).worst_point == -1


@pytest.mark.parametrize(("duration", "count"), [(0.0, 2), (0.3, 2), (1.0, 2), (1.2, 3), (7.5, 9)])
def test_the_link_is_computed_at_least_once_a_second_from_end_to_end(duration: float, count: int) -> None:
    time = 50.0 + np.array([0.0, duration])
    path = np.array([[0.0, 100.0, 200.0], [0.0, 900.0, 300.0]])
    along = link_along_path(any_link(), FLAT, np.array([0.0, 0.0, 3.0]), time, path)
    assert len(along.time) == count
    assert (along.time[0], along.time[-1]) == (time[0], time[-1])
    if duration:
        assert np.diff(along.time).max() <= 1.0
        assert along.positions[[0, -1]] == pytest.approx(path)


def test_rows_without_a_position_or_a_time_are_left_out() -> None:
    time = np.array([0.0, 1.0, math.nan, 3.0, 4.0])
    path = np.column_stack([np.zeros(5), 1000.0 * np.arange(5.0), np.full(5, 300.0)])
    path[3, 1] = math.nan
    along = link_along_path(any_link(), FLAT, np.array([0.0, 0.0, 3.0]), time, path)
    assert along.positions[:, 1] == pytest.approx([0.0, 1000.0, 2000.0, 3000.0, 4000.0])
    nothing = link_along_path(any_link(), FLAT, np.array([0.0, 0.0, 3.0]), time[2:3], path[2:3])
    assert (len(nothing.time), nothing.outages, nothing.worst_point) == (0, (), -1)
