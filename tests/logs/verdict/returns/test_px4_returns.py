"""PX4's returns over the hill, by the heights that PX4's `rtl.cpp` gives them: nothing in them is ArduPlane's.

The mission begins behind the hill, 5 km east of home, at 200 m: below the hill's top of 400 m.  A return climbs to
RTL_RETURN_ALT over home, which is at 0 m, and flies level over the hill: at most 115 m beside its top, where the ground
is 400 exp(-(115 / 300)^2 / 2) = 372 m high.
"""

from pathlib import Path

import numpy as np
import pytest

from flight.mission.items import Command, Frame, MissionItem
from flight.simulation.setup import FlightSetup
from logs.verdict.returns.drawn_returns import min_safe_altitudes
from logs.verdict.returns.judge_glides import judge_glides
from logs.verdict.returns.judge_returns import (
    POINT_MASS_ERROR_M,
    Returns,
    ReturnWorld,
    can_start_in_jsbsim,
    judge_returns,
    make_return_world,
)
from logs.verdict.returns.return_starts import ReturnStarts, planned_starts
from logs.verdict.returns.returns_text import (
    describe_return_causes,
    describe_rtl_ending,
    point_of_no_return_text,
    returns_headline,
)
from logs.verdict.returns.suggest_returns import suggest_parameters, suggest_rally_points
from planfly.rtl.jsbsim_returns import fly_return
from tests.logs.verdict.returns.hill import DEGREE, HEAD, hill_setup, mission_text
from tests.soak import some

HILL_M = 400.0
BESIDE_M = 372.0
EVERY = 8.0
BEHIND = mission_text(5000.0, 6500.0, amsl=200.0)


def setup(folder: Path, stated: str = "", mission: str = BEHIND, rally: tuple[object, ...] = ()) -> FlightSetup:
    (folder / "mine.params").write_text(f"# Stack: PX4 Pro\n{stated}\n", encoding="utf-8")
    return hill_setup(folder, '[flight]\nautopilot = "px4"\nparams = "mine.params"\n', mission, rally)


def world_and_starts(
    folder: Path, stated: str = "", mission: str = BEHIND, rally: tuple[object, ...] = ()
) -> tuple[ReturnWorld, ReturnStarts]:
    made = setup(folder, stated, mission, rally)
    return make_return_world(made), planned_starts(made, EVERY)


def judged(folder: Path, stated: str = "", mission: str = BEHIND, rally: tuple[object, ...] = ()) -> Returns:
    return judge_returns(*world_and_starts(folder, stated, mission, rally), EVERY)


def lowest(found: Returns) -> float:
    return min(one.clearance for one in found.each)


def test_it_returns_at_rtl_return_alt_over_home(tmp_path: Path) -> None:
    for height, kind in ((100.0, "ground"), (300.0, "ground"), (450.0, "safe"), (600.0, "safe")):
        found = judged(tmp_path, f"RTL_RETURN_ALT {height}\nRTL_DESCEND_ALT {height}")
        assert {one.kind for one in found.each} == {kind}
        if kind == "safe":
            # Or as low as it begins.
            expected = min(200.0, height - HILL_M), min(200.0, height - BESIDE_M)
            assert expected[0] - POINT_MASS_ERROR_M < lowest(found) < expected[1] + POINT_MASS_ERROR_M
    assert found.autopilot == "PX4"
    assert {one.target.transit_altitude for one in found.each} == {600.0}


def test_it_keeps_its_own_height_if_that_is_greater(tmp_path: Path) -> None:
    """At 600 m RTL_RETURN_ALT 100 and 400 are the same return over the hill; from below 400 m they are not."""
    for height in (100.0, 400.0):
        found = judged(tmp_path, f"RTL_RETURN_ALT {height}\nRTL_DESCEND_ALT 250", mission_text(4000.0, 6500.0))
        assert {one.kind for one in found.each} == {"safe"}
        assert 200.0 - POINT_MASS_ERROR_M < lowest(found) < 600.0 - BESIDE_M + POINT_MASS_ERROR_M


def test_it_ends_at_rtl_descend_alt(tmp_path: Path) -> None:
    """20 m over home are lower than the 30 m that are required."""
    found = judged(tmp_path, "RTL_RETURN_ALT 500\nRTL_DESCEND_ALT 20")
    assert {one.kind for one in found.each} == {"low"}
    assert lowest(found) == pytest.approx(20.0, abs=6.0)


def test_a_higher_return_needs_the_energy_of_its_climb(tmp_path: Path) -> None:
    low, high = (
        [one.energy for one in judged(tmp_path, f"RTL_RETURN_ALT {height}\nRTL_DESCEND_ALT 100").each]
        for height in (450.0, 650.0)
    )
    # 11 kg and 200 m.
    assert min(np.subtract(high, low)) > 11.0 * 9.81 * 200.0 / 3600.0


def test_it_is_what_the_simulated_px4_flies_in_six_degrees_of_freedom(tmp_path: Path) -> None:
    world, starts = world_and_starts(tmp_path, "RTL_RETURN_ALT 450\nRTL_DESCEND_ALT 100")
    point_mass = judge_returns(world, starts, EVERY)
    rows = [k for k, row in enumerate(starts.rows) if can_start_in_jsbsim(world, row)]
    for k in some(rows, len(rows) // 3):
        flown = fly_return(world, starts.rows[k])
        assert flown is not None
        assert flown[0] == pytest.approx(point_mass.each[k].clearance, abs=POINT_MASS_ERROR_M)


def test_the_least_rtl_return_alt_is_suggested(tmp_path: Path) -> None:
    world, starts = world_and_starts(tmp_path, "RTL_RETURN_ALT 100\nRTL_DESCEND_ALT 100")
    (found,) = suggest_parameters(world, starts)
    (height,) = found.parameters.values()
    # The hill, 30 m and a margin of 15 m, in steps of 25 m.
    assert set(found.parameters) == {"RTL_RETURN_ALT"}
    assert height in (425.0, 450.0)
    after = judge_returns(found.apply_to(world), starts, EVERY)
    assert after.safe
    assert lowest(after) >= 45.0
    assert lowest(judge_returns(world.with_parameters(RTL_RETURN_ALT=height - 25.0), starts, EVERY)) < 45.0


def test_a_greater_rtl_descend_alt_is_suggested_where_that_is_too_low(tmp_path: Path) -> None:
    world, starts = world_and_starts(tmp_path, "RTL_RETURN_ALT 500\nRTL_DESCEND_ALT 20")
    (found,) = suggest_parameters(world, starts)
    # 30 m and a margin of 15 m, in steps of 25 m; it may end 10 m lower.
    assert found.parameters in ({"RTL_DESCEND_ALT": 50.0}, {"RTL_DESCEND_ALT": 75.0})
    assert judge_returns(found.apply_to(world), starts, EVERY).safe


def test_both_heights_are_raised_where_both_are_too_low(tmp_path: Path) -> None:
    world, starts = world_and_starts(tmp_path, "RTL_RETURN_ALT 100\nRTL_DESCEND_ALT 20")
    remedies = suggest_parameters(world, starts)
    assert set(remedies[-1].parameters) == {"RTL_RETURN_ALT", "RTL_DESCEND_ALT"}
    assert judge_returns(remedies[-1].apply_to(world), starts, EVERY).safe


def test_rally_points_on_the_ground_behind_the_hill_are_suggested(tmp_path: Path) -> None:
    world, starts = world_and_starts(tmp_path, "RTL_RETURN_ALT 100\nRTL_DESCEND_ALT 100")
    found = suggest_rally_points(world, starts)
    assert found is not None
    assert found.rally is not None
    assert judge_returns(found.apply_to(world), starts, EVERY).safe
    # A return ends 100 m over a rally point, so it may stand on the ground: at 0 m, or where the hill's foot begins.
    assert all(0.0 <= point.up < 60.0 for point in found.rally)


def test_rtl_type_chooses_between_home_and_a_rally_point(tmp_path: Path) -> None:
    """Home is 5 to 6.5 km away, the rally point 1 km further than that from half of the places."""
    place = 8.0 + 12_000.0 / DEGREE
    point = MissionItem(0, Command.NAV_RALLY_POINT, Frame.GLOBAL_RELATIVE_ALT, (0.0,) * 4, 46.0, place, 0.0)
    for stated, homes in (("RTL_TYPE 1", 0), ("RTL_TYPE 5", 0), ("RTL_TYPE 0", 4)):
        found = judged(tmp_path, stated, rally=(point,))
        targets = [one.target.name for one in found.each]
        # Nearer than 6 km to home.
        expected = sum(one.start[0] < 6000.0 for one in found.each) if homes else 0
        assert targets.count("home") == pytest.approx(expected, abs=1)
        assert set(targets) <= {"home", "rally point 1"}


def row(number: int, command: int, east: float = 0.0, up: float = 0.0, p2: float = 0.0, p1: float = 0.0) -> str:
    lat, lon = (46.0, 8.0 + east / DEGREE) if east else (0.0, 0.0)
    return f"{number}\t0\t3\t{command}\t{p1:g}\t{p2:g}\t0\t0\t{lat:.7f}\t{lon:.7f}\t{up:g}\t1\n"


# As QGroundControl writes a landing: a loiter to 60 m, and the landing at 0 m; between home and the hill.
LANDING = (
    HEAD
    + row(1, 16, 5000.0, 200.0)
    + row(2, 16, 6500.0, 200.0)
    + row(3, 189)
    + row(4, 31, 1500.0, 60.0, p2=150.0, p1=1.0)
    + row(5, 21, 700.0, 0.0)
)


def test_the_default_returns_to_the_landing_of_the_mission(tmp_path: Path) -> None:
    """RTL_TYPE 1 climbs to RTL_RETURN_ALT over the landing, and flies the landing sequence; 0 goes home."""
    for stated, kind in (("RTL_RETURN_ALT 100", "ground"), ("RTL_RETURN_ALT 450", "safe")):
        found = judged(tmp_path, f"{stated}\nRTL_TYPE 1", LANDING)
        behind = [one for one in found.each if one.start[0] > 4500.0]
        assert {one.target.name for one in found.each} == {"the landing sequence at item 4"}
        assert {one.kind for one in behind} == {kind}
        assert not found.unjudged_parts
    # It is left at the loiter's 60 m.
    assert min(one.clearance for one in behind) == pytest.approx(50.0, abs=12.0)
    assert "the landing is not judged" in returns_headline(found)
    at_home = judged(tmp_path, "RTL_RETURN_ALT 450\nRTL_TYPE 0", LANDING)
    assert {one.target.name for one in at_home.each} == {"home"}


def test_a_return_to_a_landing_stays_below_rtl_return_alt_by_nav_fw_alt_rad(tmp_path: Path) -> None:
    """After its climb it flies level to the loiter of a landing, but climbs on to RTL_RETURN_ALT on the way home."""
    for return_type, lower_m in ((1, 30.0), (0, 0.0)):
        near, far = (
            judged(
                tmp_path,
                f"RTL_RETURN_ALT 480\nRTL_DESCEND_ALT 300\nRTL_TYPE {return_type}\nNAV_FW_ALT_RAD {radius}",
                LANDING.replace("\t60\t", "\t300\t"),
            )
            for radius in (10, 40)
        )
        # Behind the hill, which is 400 m high; the circles are left at other places, which moves the paths over it.
        heights = [min(one.clearance for one in found.each if one.start[0] > 4500.0) for found in (near, far)]
        assert heights[0] - heights[1] == pytest.approx(lower_m, abs=8.0)
    assert (
        "Before a landing sequence, the climb may end up to NAV_FW_ALT_RAD (40 m) below" in describe_rtl_ending(far)[-1]
    )


@pytest.mark.parametrize(
    ("stated", "mission", "said", "is_simulated"),
    [
        ("RTL_TYPE 2", BEHIND, "RTL_TYPE 2 returns along the mission, which is not simulated", False),
        ("RTL_TYPE 4", LANDING, "RTL_TYPE 4 returns along the mission, which is not simulated", False),
        ("RTL_TYPE 5", BEHIND, "RTL_TYPE 5 without a rally point loiters where the RTL begins", False),
        ("RTL_LAND_DELAY 0", BEHIND, "RTL_LAND_DELAY 0 lands after the return, which is not simulated", True),
        ("RTL_TYPE 1", LANDING.replace("\t189\t", "\t178\t"), "a landing without DO_LAND_START", True),
        (
            "RTL_TYPE 1",
            HEAD + "".join(LANDING.splitlines(True)[2:5]) + row(5, 21, 700.0),
            "begins with the landing",
            False,
        ),
    ],
)
def test_what_is_not_simulated_is_named_and_not_judged(
    stated: str, mission: str, said: str, is_simulated: bool, tmp_path: Path
) -> None:
    if "begins with" in said:
        mission = HEAD + row(1, 16, 5000.0, 200.0) + row(2, 16, 6500.0, 200.0) + row(3, 189) + row(4, 21, 700.0)
    found = judged(tmp_path, f"RTL_RETURN_ALT 450\n{stated}", mission)
    assert bool(found.each) is is_simulated
    assert ("because no return was simulated" in point_of_no_return_text(found)) is not is_simulated
    assert not found.safe
    assert found.undecided or mission.count("\t21\t")
    assert said in returns_headline(found)


def test_its_own_words_are_px4s(tmp_path: Path) -> None:
    found = judged(tmp_path, "RTL_RETURN_ALT 450\nNAV_DLL_ACT 2")
    lines = [*describe_return_causes(found.causes), *describe_rtl_ending(found)]
    assert "station lost (NAV_DLL_ACT 2)" in lines[0]
    assert "RTL_RETURN_ALT (450 m above the destination)" in lines[-1]
    assert (found.autoland, found.stands_in) == (None, False)


def test_the_lowest_safe_altitude_is_where_it_clears_the_hill(tmp_path: Path) -> None:
    """Without RTL_RETURN_ALT it returns at its own height: 30 m over the hill, found in steps of 10 m."""
    world, starts = world_and_starts(tmp_path, "RTL_RETURN_ALT 0\nRTL_DESCEND_ALT 100")
    found = min_safe_altitudes(world, starts)
    assert np.isfinite(found.altitude).all()
    assert BESIDE_M + 15.0 < found.altitude.min() <= found.altitude.max() < HILL_M + 55.0


def test_without_its_engine_its_own_return_is_not_simulated(tmp_path: Path) -> None:
    glides = judge_glides(*world_and_starts(tmp_path, "FW_AIRSPD_MIN 19"))
    assert {one.own_return.end for one in glides.each} == {"not flown"}
    assert (glides.autopilot, glides.airspeed_name, glides.airspeed) == ("PX4", "FW_AIRSPD_MIN", 19.0)
