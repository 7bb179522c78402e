"""The greatest height above ground on each leg, and the ceiling, by plain sums on level and sloping ground."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.places import FLIGHT
from logs.verdict.rules.height_rule import max_segment_heights
from tests.logs.verdict.judging import ROUTE, judge, leg, of, suggested
from tests.synthetic import edited, fly_path, make_setup
from world.terrain import Terrain, make_gridded_terrain


def limited(most: float, **how: Any) -> FlightSetup:
    """The route over level ground at the sea: 300 m high, 380 m at waypoint 2."""
    return make_setup(ROUTE, limits={"max_height_m": most}, **how)


def findings(setup: FlightSetup, track: Track | None = None) -> list[Finding]:
    verdict = judge_geometry(setup) if track is None else judge(setup, track)
    return [item for item in verdict.findings if item.rule == "height"]


def test_without_a_limit_there_is_nothing_to_say(setup: FlightSetup, track: Track) -> None:
    assert findings(setup) == findings(setup, track) == []


def test_each_leg_has_its_own_height() -> None:
    items = findings(limited(350.0))
    assert [item.place for item in items] == [leg(k) for k in range(4)]
    assert [item.ok for item in items] == [True, False, False, True]
    # The blends of the climbs beside them reach a little way into the level legs, and stay below the waypoint's top.
    assert [item.planned for item in items[::3]] == pytest.approx([300.0, 300.0], abs=1.5)
    assert items[1].planned == pytest.approx(380.0, abs=2.5)
    assert items[1].margin == pytest.approx(350.0 - (items[1].planned or 0.0))
    assert "at most 350 m are allowed" in items[1].reason
    assert all(item.ok for item in findings(limited(381.0)))


def test_a_flight_is_judged_by_its_track() -> None:
    setup = limited(350.0)
    track = fly_path(setup)
    high = edited(track, position=track.position + np.array([0.0, 0.0, 60.0]))
    items = findings(setup, high)
    assert [item.ok for item in items] == [False] * 4
    assert items[0].flown == pytest.approx(360.0, abs=1.5)
    assert suggested(items[0], "descent", leg(0)).wanted == pytest.approx(12.0, abs=1.0)
    low = edited(track, position=track.position - np.array([0.0, 0.0, 60.0]))
    items = findings(setup, low)
    assert [item.ok for item in items] == [True] * 4
    assert "the planned path rises to 3" in items[1].reason


def test_the_scenarios_ceiling_counts_on_each_leg() -> None:
    setup = limited(2000.0)
    setup = replace(setup, scenario=replace(setup.scenario, ceiling=340.0))
    items = findings(setup)
    assert [item.ok for item in items] == [True, False, False, True]
    assert "above the scenario's ceiling of 340 m" in items[1].reason


def test_no_terrain_no_height() -> None:
    setup = limited(350.0)
    (item,) = findings(replace(setup, scenario=replace(setup.scenario, terrain=None)))
    assert (item.ok, item.place, item.limit) == (None, FLIGHT, 350.0)


def test_a_leg_that_was_not_flown_is_not_judged() -> None:
    setup = limited(350.0)
    items = findings(setup, fly_path(setup, stop=1000.0))
    assert [item.ok for item in items] == [True, None, None, None]
    assert of(judge(setup, fly_path(setup, stop=1000.0)), "height", leg(3)).reason == "the leg was not flown"


def valley() -> Terrain:
    """Ground at 100 m with a trench of 40 m at north 500, 100 m to its sides."""
    axis = np.arange(-1000.0, 1001.0, 100.0)
    heights = np.full((21, 21), 100.0)
    heights[axis == 500.0] = 60.0
    return make_gridded_terrain(heights, axis, axis, source="", sha256="", datum="")


def test_the_height_over_a_valley_is_found_between_two_points() -> None:
    points = np.array([[0.0, 0.0, 200.0], [0.0, 900.0, 200.0], [0.0, 900.0, 260.0], [0.0, 5000.0, 260.0]])
    most, at = max_segment_heights(valley(), points)
    assert most[:2] == pytest.approx([140.0, 160.0])
    assert at[0] == pytest.approx(500.0 / 900.0)
    assert np.isnan(most[2])


def test_the_height_over_a_valley_across_the_map() -> None:
    """The same with the ground's axes changed over: a place's east counts as it is."""
    ground = valley()
    axis = np.arange(-1000.0, 1001.0, 100.0)
    turned = make_gridded_terrain(ground.heights.T.copy(), axis, axis, source="", sha256="", datum="")
    points = np.array([[-900.0, 0.0, 200.0], [900.0, 0.0, 200.0]])
    for terrain in (turned, valley()):
        most, at = max_segment_heights(terrain, points if terrain is turned else points[:, [1, 0, 2]])
        # As the raster's rows may run to the south, the trench is at 500 m or at -500 m.
        assert most[0] == pytest.approx(140.0)
        assert abs(-900.0 + 1800.0 * at[0]) == pytest.approx(500.0)


def test_each_leg_is_judged_by_its_own_part_of_the_track() -> None:
    """The first leg 60 m too high, the others below the limit; the last row, beyond the end, too high again."""
    setup = limited(390.0)
    track = fly_path(setup)
    position = track.position.copy()
    first = np.hypot(*(position[:, :2] - [0.0, 2000.0]).T).argmin() - 20
    position[5:first, 2] += 100.0
    assert [item.ok for item in findings(setup, edited(track, position=position))] == [False, True, True, True]
    position = track.position.copy()
    position[-1, 2] += 100.0
    assert [item.ok for item in findings(setup, edited(track, position=position))] == [True, True, True, False]
    position = track.position.copy()
    position[0, 2] += 100.0
    assert [item.ok for item in findings(setup, edited(track, position=position))] == [False, True, True, True]


@pytest.mark.parametrize("row", [0, -1])
def test_the_ceiling_counts_in_every_row(row: int) -> None:
    setup = limited(2000.0)
    setup = replace(setup, scenario=replace(setup.scenario, ceiling=390.0))
    track = fly_path(setup)
    assert all(item.ok for item in findings(setup, track))
    position = track.position.copy()
    position[row, 2] += 100.0
    failed = [item for item in findings(setup, edited(track, position=position)) if item.ok is False]
    assert [item.place for item in failed] == [leg(0 if row == 0 else 3)]
    assert "400.0 m AMSL, above the scenario's ceiling of 390 m" in failed[0].reason


def test_where_it_is_highest_is_told() -> None:
    """A dip of the ground between two rows: at north 503.3 m after 20.13 s, however the rows lie."""
    setup = make_setup([[100.0, 0.0, 300.0], [100.0, 900.0, 300.0]], limits={"max_height_m": 150.0})
    axis = np.arange(-1300.0, 1301.0, 100.0) + 3.3
    heights = np.full((27, 27), 100.0)
    heights[np.isclose(np.abs(axis - 3.3), 500.0)] = 60.0
    ground = make_gridded_terrain(heights, axis, axis, source="", sha256="", datum="")
    setup = replace(setup, scenario=replace(setup.scenario, terrain=ground))
    (item,) = findings(setup, fly_path(setup))
    assert item.flown == pytest.approx(240.0, abs=0.01)
    assert "240.0 m above ground at 20.1 s, east 100 m, north 503 m" in item.reason


@pytest.mark.parametrize(("most", "ok"), [(210.0, None), (190.0, False)])
def test_ground_that_is_known_in_part_judges_what_is_above_it(most: float, ok: bool | None) -> None:
    setup = make_setup([[0.0, 0.0, 300.0], [0.0, 900.0, 300.0]], limits={"max_height_m": most})
    axis = np.arange(-1300.0, 1301.0, 100.0)
    heights = np.full((27, 27), 100.0)
    heights[np.abs(axis) > 650.0] = np.nan
    ground = make_gridded_terrain(heights, axis, axis, source="", sha256="", datum="")
    setup = replace(setup, scenario=replace(setup.scenario, terrain=ground))
    track = fly_path(setup)
    (item,) = findings(setup, track)
    assert (item.ok, item.flown) == (ok, pytest.approx(200.0))
    assert "part of the terrain below the leg is unknown" in item.reason
    level = replace(ground, heights=np.full_like(ground.heights, 100.0))
    (item,) = findings(replace(setup, scenario=replace(setup.scenario, terrain=level)), track)
    assert item.ok is (most > 200.0)
    assert "unknown" not in item.reason


@pytest.mark.parametrize(("over", "told"), [(-0.05, False), (0.05, False), (0.15, True)])
def test_a_plan_above_the_limit_is_told_beside_a_flight_that_is_not(over: float, told: bool) -> None:
    setup = make_setup([[0.0, 0.0, 300.0], [0.0, 4000.0, 300.0]], limits={"max_height_m": 300.0 - over})
    track = fly_path(setup, rate=10.0)
    low = edited(track, position=track.position - np.array([0.0, 0.0, 9.0]))
    (item,) = findings(setup, low)
    assert item.ok is True
    assert ("the planned path rises to" in item.reason) is told
