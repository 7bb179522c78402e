"""What pictures show of returns: stretches of the way, the ways of the worst, the least safe heights over a hill."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from logs.verdict.returns.drawn_returns import (
    DrawnReturns,
    collect_drawn_returns_without_glides,
    group_segments,
    min_safe_altitudes,
)
from logs.verdict.returns.judge_returns import judge_returns, make_return_world
from logs.verdict.returns.return_starts import planned_starts
from tests.logs.verdict.returns.hill import hill_drawn, hill_setup


def test_stretches_hold_every_place_and_meet() -> None:
    found = group_segments([1, 1, 2, 2, 2, 1], lambda one: one)
    assert found == [(1, [1, 1, 2]), (2, [2, 2, 2, 1]), (1, [1])]
    assert group_segments([], lambda one: one) == []


def test_the_way_of_the_worst_begins_where_it_turns_back_and_ends_where_it_hits(tmp_path: Path) -> None:
    found = hill_drawn(hill_setup(tmp_path))
    first, *others = found.worst
    assert first.simulated.kind == "ground"
    assert math.dist(first.path[0], first.simulated.start) < 1.0
    # 26 m/s and a second apart.
    steps = np.linalg.norm(np.diff(first.path, axis=0), axis=1)
    assert steps.max() < 40.0
    assert math.dist(first.marked_position[:2], (3000.0, 0.0)) < 500.0
    assert np.linalg.norm(first.path - first.marked_position, axis=1).min() < 40.0
    # Of each kind of trouble one before a second of any.
    kinds = [one.simulated.kind for one in (first, *others)]
    assert kinds[: len(set(kinds))] == list(dict.fromkeys(kinds))
    assert {kind for kind, _ in found.segments_by_outcome} >= {"safe", "ground"}


def test_where_all_are_safe_the_lowest_is_drawn(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    world, starts = make_return_world(setup).with_parameters(RTL_ALTITUDE=600.0), planned_starts(setup, 20.0)
    returns = judge_returns(world, starts, 20.0)
    (only,) = collect_drawn_returns_without_glides(world, starts, returns).worst
    assert only.simulated.safe
    assert only.simulated.clearance == min(one.clearance for one in returns.each)


def test_the_least_height_is_that_of_the_straight_slope_over_the_hill(tmp_path: Path) -> None:
    """From x m east at h a return is at 100 + (h - 100) 3000 / x over the hill's 400 m, and some 7 m higher, late."""
    setup = hill_setup(tmp_path)
    world, starts = make_return_world(setup), planned_starts(setup, 10.0)
    found = min_safe_altitudes(world, starts)
    east = np.interp(found.time, starts.time, starts.rows["east"])
    behind = east > 5000.0
    assert behind.sum() >= 5
    # The turn leads 75 m on, and up to 150 m aside of the hill's top, where it is 353 m high; 30 m are asked above it.
    lowest, highest = (100.0 + (top + 30.0 - 7.0 - 100.0) * (east[behind] + 75.0) / 3000.0 for top in (353.0, 400.0))
    assert np.all((lowest < found.altitude[behind]) & (found.altitude[behind] < highest))
    assert np.all(np.diff(found.altitude[behind]) > 0.0)
    # Before the hill nothing stands in the way: as low as the least height above ground.
    before = (east > 200.0) & (east < 1200.0)
    assert found.altitude[before] == pytest.approx(30.0, abs=15.0)
    # What is found is safe, and 15 m lower over the hill is not.
    again = replace(starts, rows=starts.rows.copy())
    again.rows["up"] = np.interp(starts.time, found.time, found.altitude)
    at = np.flatnonzero(np.isin(starts.time, found.time[behind]))
    assert {one.kind for one in judge_returns(world, again.subset(at), 10.0).each} == {"safe"}
    again.rows["up"] -= 15.0
    assert "safe" not in {one.kind for one in judge_returns(world, again.subset(at), 10.0).each}


def test_without_terrain_no_height_is_known(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    bare = replace(setup, scenario=replace(setup.scenario, terrain=None))
    assert np.isnan(min_safe_altitudes(make_return_world(bare), planned_starts(setup, 40.0)).altitude).all()


def test_a_place_with_two_ways_home_counts_by_the_worse(tmp_path: Path) -> None:
    found = hill_drawn(hill_setup(tmp_path))
    twice = replace(
        found.returns, each=(*found.returns.each, *(replace(one, kind="low") for one in found.returns.each))
    )
    kinds = {kind for kind, _ in DrawnReturns(twice, (), found.min_safe_altitudes).segments_by_outcome}
    assert "safe" not in kinds
    assert "ground" in kinds
    assert sum(len(ones) for _, ones in DrawnReturns(twice, (), found.min_safe_altitudes).segments_by_outcome) < len(
        twice.each
    )
