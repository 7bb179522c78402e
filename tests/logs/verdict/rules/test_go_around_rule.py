"""Landings that are aborted, flown by ArduPlane's law past walls and hills of known height."""

import math
from typing import Any

import numpy as np
import pytest

from logs.verdict.findings import Finding
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.rules import go_around_rule
from logs.verdict.verdict import Verdict
from tests.logs.verdict.judging import of
from tests.logs.verdict.rules.test_climbout_approach_rule import POINT, RUN, Ground, landing, over, wall, with_arduplane
from tests.mission_lines import wp
from tests.soak import scaled
from world.arrays import Floats

HEIGHT = 37.0


def go_around(heights: Ground, *lines: str, **tables: Any) -> tuple[Finding, Verdict]:
    verdict = judge_geometry(with_arduplane(over(heights, *lines, **tables)))
    return of(verdict, "go_around"), verdict


def higher_field(east: Floats, north: Floats) -> Floats:
    """Level ground at home, 37 m higher from 1.5 km on."""
    return np.where(north > 1500.0, 100.0 + HEIGHT, 100.0) + 0.0 * east


def test_a_go_around_from_a_field_above_home_is_too_low_and_the_height_that_would_do_is_named() -> None:
    # 50 m over home are 13 m over the field; 20 m over it are 57 m over home, the next five are 60.
    warned, verdict = go_around(higher_field, *landing(HEIGHT, p="50 0 0 0"))
    assert warned.ok is None
    # From below 50 m it climbs there, from above it sinks no deeper than it was.
    assert warned.planned == pytest.approx(13.0, abs=2.5)
    assert "above home, 13 m above the landing point" in warned.reason
    assert "m above ground on the way back" in warned.reason
    assert warned.reason.endswith("A climb to 60 m above home is sufficient: set parameter 1 of item 3 to this height")
    # It decides no verdict, and is said.
    assert verdict.flyable
    assert f"Go-around: {warned.reason}" in verdict.lines
    # 20 m above ground are asked for: 55 m leave 18 m, 60 m leave 23.
    for height, ok in ((55, None), (60, True)):
        assert go_around(higher_field, *landing(HEIGHT, p=f"{height} 0 0 0"))[0].ok is ok


def test_a_hill_ahead_of_the_landing_leaves_no_height_for_a_go_around() -> None:
    found, _ = go_around(wall(POINT + 150.0, 300.0), *landing())
    assert found.ok is None
    assert "hits the ground" in found.reason
    assert found.reason.endswith("No climb up to 1000 m above home is sufficient")


def test_a_go_around_flies_back_to_where_the_landing_sequence_begins_and_on_to_the_line_up() -> None:
    # The landing sequence begins 2 km east of the last waypoint, behind a ridge.
    def ridge(east: Floats, north: Floats) -> Floats:
        return np.where((east == 1000.0), 180.0, 100.0) + 0.0 * north

    def low_ridge(east: Floats, north: Floats) -> Floats:
        return np.where((east == 1000.0), 130.0, 100.0) + 0.0 * north

    start = ("3 189 0 0 0 0 0 0 0", wp(2000, POINT - RUN, 60))
    direct = landing(p="50 0 0 0")
    assert go_around(ridge, *direct)[0].ok is True
    assert go_around(ridge, direct[0], *start, *direct[1:])[0].ok is None
    assert go_around(low_ridge, direct[0], *start, *direct[1:])[0].ok is True


def test_a_zone_and_a_missile_on_the_way_back_are_named() -> None:
    def zoned(east: float) -> Finding:
        corners = [[east + x, POINT + y] for x, y in ((-60.0, -200.0), (60.0, -200.0), (60.0, 300.0), (-60.0, 300.0))]
        zone = {"name": "town", "kind": "exclusion", "polygon_m": corners}
        return go_around(wall(0.0, 100.0), *landing(p="30 0 0 0"), zones=[zone])[0]

    hit, missed = zoned(200.0), zoned(3000.0)
    assert (hit.ok, missed.ok) == (None, True)
    assert "enters zone town" in hit.reason or "enters town" in hit.reason


def test_where_it_is_required_a_go_around_that_is_too_low_fails_and_one_that_is_not_judged_is_left_open() -> None:
    asked = {"returns": {"require": ["go_around"]}}
    for height, ok in ((50, False), (60, True)):
        found, verdict = go_around(higher_field, *landing(HEIGHT, p=f"{height} 0 0 0"), **asked)
        assert (found.ok, verdict.flyable) == (ok, bool(ok))
    assert verdict.headline.startswith("flyable")
    failed = go_around(higher_field, *landing(HEIGHT, p="50 0 0 0"), **asked)[1]
    assert "go-around at waypoint 2, item 3 (a go-around comes too close to the ground)" in failed.headline
    # By planfly's guidance nothing is known of it.
    other = judge_geometry(over(higher_field, *landing(HEIGHT), **asked))
    assert other.headline.startswith("not judged in full: a go-around is not judged")
    # Whether returns are safe is another question.
    assert not [item for item in other.findings if item.rule == "return"]


def test_only_of_arduplane_a_go_around_is_told() -> None:
    assert "go_around" not in {item.rule for item in judge_geometry(over(higher_field, *landing(HEIGHT))).findings}


REQUIRED = {"returns": {"require": ["go_around"]}}
LEVEL = wall(0.0, 100.0)
MARK = "3 189 0 0 0 0 0 0 0"


def test_a_go_around_whose_landing_sequence_begins_with_the_landing_is_left_open() -> None:
    lines = landing(p="60 0 0 0")
    found, verdict = go_around(LEVEL, lines[0], lines[1], MARK, lines[2], **REQUIRED)
    assert found.ok is None
    assert "the landing sequence begins with the landing itself (item 4)" in found.reason
    assert verdict.headline.startswith("not judged in full: a go-around is not judged")
    # What it meets before that is known.
    assert go_around(wall(POINT + 150.0, 300.0), lines[0], lines[1], MARK, lines[2], **REQUIRED)[0].ok is False


def test_a_go_around_that_does_not_get_back_fails() -> None:
    # As fast against the wind as that blows: south of the field it gets nowhere.
    found, _ = go_around(LEVEL, *landing(p="60 0 0 0"), wind={"speed_mps": 25.0, "from_deg": 180.0}, **REQUIRED)
    assert found.ok is False
    assert found.reason.startswith("a go-around does not get back to the approach: ")


def test_a_go_around_goes_to_the_landing_sequence_that_is_nearest_where_its_climb_is_over() -> None:
    """From the landing point that behind it is 1,000 m away and that ahead 1,100 m; 300 m further on it is not so."""
    land = wp(0, -500, 0, command=21, p="60 0 0 0")
    behind, ahead = (MARK, wp(0, -1500, 60), land), (MARK, wp(0, 600, 60), land)
    for order in ((*behind, *ahead), (*ahead, *behind)):
        assert go_around(LEVEL, wp(0, -3000, 60), *order, **REQUIRED)[0].ok is True
        into, _ = go_around(wall(300.0, 300.0), wp(0, -3000, 60), *order, **REQUIRED)
        assert "hits the ground" in into.reason
    assert go_around(wall(300.0, 300.0), wp(0, -3000, 60), *behind, **REQUIRED)[0].ok is True


def test_a_command_behind_the_landing_that_is_flown_instead_leaves_it_open() -> None:
    for first, ok in ((0, None), (1, None), (2, True)):
        after = f"3 30 {first} 0 0 0 0 0 150"
        found, verdict = go_around(LEVEL, *landing(p="60 0 0 0"), after, **REQUIRED)
        assert found.ok is ok
        # An item behind the landing is only flown if somebody continues the mission.
        assert verdict.undecided
    found, _ = go_around(LEVEL, *landing(p="60 0 0 0"), "3 30 1 0 0 0 0 0 150")
    assert "NAV_CONTINUE_AND_CHANGE_ALT (item 4) follows the landing, and is flown instead" in found.reason


def test_a_climb_that_passes_the_ground_beyond_the_landing_point_by_too_little_is_left_open() -> None:
    def climbs(top: float) -> tuple[Finding, float]:
        found, _ = go_around(wall(POINT + 150.0, top), *landing(p="60 0 0 0"), **REQUIRED)
        return found, next(fact.value for fact in found.facts if fact.what == "climb above ground")

    level, least_level = climbs(100.0)
    # So high that the wall is what decides.
    _, high = climbs(125.0)
    assert 0.0 < high < least_level
    top = 125.0 + high - 6.0
    for more, ok in ((-0.5, True), (0.5, None)):
        found, least = climbs(top + more)
        assert found.ok is ok
        assert least == pytest.approx(6.0 - more, abs=0.1)
    assert "the climb clears the ground by" in climbs(top + 1.0)[0].reason
    assert level.ok is True


def test_a_go_around_that_leaves_the_known_ground_in_its_climb_is_left_open() -> None:
    found, verdict = go_around(LEVEL, *landing(p="3000 0 0 0"), **REQUIRED)
    assert (found.ok, verdict.undecided) == (None, True)
    assert found.reason.endswith("the aircraft leaves the terrain data before it reaches that height")


def test_a_low_place_of_the_landing_sequence_lowers_what_is_asked_for_only_near_it() -> None:
    # From 60 m it sinks to a place at 12 m, 2 km to the east: half way there it is at 36 m.
    low = (MARK, wp(2000, POINT - RUN, 12))
    lines = landing(p="60 0 0 0")

    def past(top: float) -> Finding:
        def ridge(east: Floats, north: Floats) -> Floats:
            return np.where(east == 1000.0, top, 100.0) + 0.0 * north

        return go_around(ridge, lines[0], *low, *lines[1:], **REQUIRED)[0]

    assert past(108.0).limit == pytest.approx(12.0)
    into = past(122.0)
    assert (into.ok, into.limit) == (False, 20.0)


@pytest.mark.parametrize(("distance", "limit"), [(440.0, 12.0), (560.0, 20.0)])
def test_a_low_place_lowers_what_is_asked_for_within_500_m(distance: float, limit: float) -> None:
    """A ring of 7 m around a place at 12 m: the aircraft clears it by 18 m, which is enough within 500 m of it."""
    low = (MARK, wp(2000, POINT - RUN, 12))
    lines = landing(p="60 0 0 0")

    def ring(east: Floats, north: Floats) -> Floats:
        radius = np.hypot(east - 2000.0, north - (POINT - RUN))
        return np.where(np.abs(radius - distance) < 15.0, 107.0, 100.0)

    found = go_around(ring, lines[0], *low, *lines[1:], **REQUIRED)[0]
    assert (found.ok, found.limit) == (limit == 12.0, pytest.approx(limit))


def test_it_is_aborted_all_along_the_glide_to_the_flare(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[float] = []
    fly = go_around_rule.fly_go_arounds

    def noted(starts: Any, *given: Any) -> Any:
        seen.extend(float(row["north"]) for row in starts)
        return fly(starts, *given)

    monkeypatch.setattr(go_around_rule, "fly_go_arounds", noted)
    go_around(wall(0.0, 100.0), *landing(p="60 0 0 0"))
    before = POINT - np.array(seen)
    assert before[0] == pytest.approx(RUN, abs=1.0)
    assert 60.0 <= before[-1] < 150.0
    assert len(seen) == 12
    assert np.diff(before) == pytest.approx(np.diff(before)[0], abs=0.1)


def test_fields_above_home_whose_abort_has_to_hit_the_hill_are_named() -> None:
    """A valley 240 m wide to land in: turning in it takes more, so an abort at once meets a side that is higher.

    Its height is under that of the abort over home, or the field's: by arithmetic there is no way out.
    """
    rng = np.random.default_rng(35)
    for _ in range(scaled(10, 2)):
        above, deep = float(rng.uniform(25.0, 150.0)), float(rng.uniform(90.0, 160.0))
        asked, side = round(rng.uniform(10.0, above + 15.0)), math.copysign(1.0, rng.uniform(-1.0, 1.0))

        def valley(east: Floats, north: Floats, above: float = above, deep: float = deep) -> Floats:
            field = np.where(north > 1200.0, 100.0 + above, 100.0) + 0.0 * east
            return np.where((np.abs(east) > 120.0) & (north > 2300.0), field + deep, field)

        line_up = (wp(0, 0, above + 100.0), wp(0, POINT - RUN, above + 100.0))
        start = ("3 189 0 0 0 0 0 0 0", wp(side * 1500.0, POINT - RUN - 500.0, above + 80.0))
        land = wp(0, POINT, above, command=21, p=f"{asked} 0 0 0")
        found, verdict = go_around(valley, line_up[0], *start, line_up[1], land)
        assert found.ok is None, (above, deep, asked)
        assert "hits the ground" in found.reason
        assert f"Go-around: {found.reason}" in verdict.lines
