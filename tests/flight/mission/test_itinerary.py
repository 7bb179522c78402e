"""Itineraries: the order in which items are flown, their speeds, and a note for each that is not flown as written."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight.mission.itinerary import make_itinerary
from flight.mission.route import RouteRules, make_route
from tests.mission_lines import ORIGIN, ground, mission, refusal, route, wp


def test_speeds_count_for_the_legs_after_them() -> None:
    flown = route(
        wp(0, 0),
        wp(0, 900),
        "2 178 0 22 -1 0 0 0 0",
        wp(0, 1800),
        "2 178 1 28 80 0 0 0 0",
        "2 178 2 3 -1 0 0 0 0",
        wp(0, 2700),
        "2 178 0 -1 -1 0 0 0 0",
        wp(0, 3600),
        "2 178 0 -2 -1 0 0 0 0",
        wp(0, 4500),
        "2 178 0 0 -1 0 0 0 0",
        wp(0, 5400),
    )
    assert flown.leg_airspeeds.tolist() == [25.0, 22.0, 22.0, 22.0, 25.0, 25.0]
    # Of type 1 it is the least ground speed from there on, which is left as it is by a change of airspeed.
    assert np.array_equal(flown.points["min_ground_speed"], [math.nan] * 3 + [28.0] * 4, equal_nan=True)
    assert flown.notes == (
        "item 5: DO_CHANGE_SPEED's throttle is ignored",
        "item 5: DO_CHANGE_SPEED (ground speed) sets MIN_GROUNDSPEED to 28 m/s",
        "item 6: DO_CHANGE_SPEED of type 2, neither airspeed nor ground speed, is ignored",
        "item 12: DO_CHANGE_SPEED to 0 m/s is ignored",
    )


def test_a_distance_to_fly_on_beyond_a_waypoint_is_flown_and_a_negative_one_leaves_the_verdict_open() -> None:
    flown = route(wp(0, 0), wp(0, 900, p="0 0 150.9 0"), wp(900, 900, p="0 0 -50 0"), wp(900, 1800))
    assert flown.notes == (
        "item 2: after NAV_WAYPOINT the flight continues straight for 150 m, as in ArduPlane",
        "item 3: NAV_WAYPOINT with -50 m to fly on beyond it is flown with 0 m, but ArduPlane may fly 255 m",
    )
    assert [one.item for one in flown.open_items] == [3]


@pytest.mark.parametrize(
    ("change", "airspeed", "noted"),
    [
        ("0 22 -1", 22.0, None),
        ("1 22 -1", 22.0, "DO_CHANGE_SPEED of type 1 is flown as airspeed, because PX4 ignores the type"),
        ("2 22 80", 22.0, "DO_CHANGE_SPEED of type 2 is flown as airspeed, because PX4 ignores the type"),
        ("0 0 -1", 25.0, "DO_CHANGE_SPEED to 0 m/s returns to PX4's default airspeed"),
        ("0 -1 -1", 25.0, "DO_CHANGE_SPEED to -1 m/s returns to PX4's default airspeed"),
        ("0 -2 -1", 25.0, "DO_CHANGE_SPEED to -2 m/s returns to PX4's default airspeed"),
        ("0 -1 80", 25.0, "DO_CHANGE_SPEED's throttle is not flown"),
    ],
)
def test_a_speed_by_its_value_alone_is_that_or_the_autopilots_own(
    change: str, airspeed: float, noted: str | None
) -> None:
    items = wp(0, 0), "2 178 0 28 -1 0 0 0 0", wp(0, 900), f"2 178 {change} 0 0 0 0", wp(0, 1800)
    flown = make_route(mission(*items), ORIGIN, None, 25.0, False, rules=RouteRules(reads_as_px4=True))
    assert flown.leg_airspeeds.tolist() == [28.0, airspeed]
    assert flown.notes[-1:] == (() if noted is None else (f"item 4: {noted}",))


def test_a_gate_changes_the_speed_where_its_plane_cuts_the_leg() -> None:
    gate, fast, slow = wp(300, 600, command=4501), "2 178 0 28 -1 0 0 0 0", "2 178 0 20 -1 0 0 0 0"
    items = wp(0, 0), fast, gate, slow, wp(0, 1800)
    flown = make_route(mission(*items), ORIGIN, None, 25.0, False, rules=RouteRules(reads_as_px4=True))
    # From the gate to item 5 lead (-300, 1200): at right angles to that, 300^2 / 1200 m sooner on the leg.
    assert flown.positions[:, :2] == pytest.approx(np.array([[0.0, 0.0], [0.0, 525.0], [0.0, 1800.0]]), abs=0.1)
    assert (flown.leg_airspeeds.tolist(), flown.items.tolist(), flown.notes) == ([28.0, 20.0], [1, 3, 5], ())
    # ArduPlane has no gates.
    plain = route(*items)
    assert (plain.leg_airspeeds.tolist(), plain.items.tolist()) == ([20.0], [1, 5])
    assert plain.notes == ("item 3: CONDITION_GATE is not flown",)


@pytest.mark.parametrize(
    ("items", "airspeed", "noted"),
    [
        # Behind the leg's begin: passed at once.
        ((wp(0, 0), wp(0, -300, command=4501), "2 178 0 20 -1 0 0 0 0", wp(0, 1800)), [20.0], []),
        # Two on one leg, the second one behind the first one's plane.
        (
            (
                *(wp(0, 0), wp(0, 900, command=4501), "2 178 0 28 -1 0 0 0 0"),
                *(wp(0, 600, command=4501), "2 178 0 20 -1 0 0 0 0", wp(0, 1800)),
            ),
            [25.0, 20.0],
            [],
        ),
        ((wp(0, 0), wp(0, 900, command=4501), wp(0, 1800)), [25.0], []),
        (
            (wp(0, 0), wp(0, 1800), wp(0, 2000, command=4501)),
            [25.0],
            ["item 3: CONDITION_GATE is passed at once, because no waypoint follows it"],
        ),
        (
            (wp(0, 0), wp(0, 900, command=4501), "2 178 0 20 -1 0 0 0 0", wp(0, 1800, command=17, p="0 0 100 0")),
            None,
            ["item 2: CONDITION_GATE is not between waypoints, so the speed after it applies from the leg's start"],
        ),
    ],
)
def test_gates_that_leave_their_leg_whole(
    items: tuple[str, ...], airspeed: list[float] | None, noted: list[str]
) -> None:
    flown = make_route(mission(*items), ORIGIN, None, 25.0, False, rules=RouteRules(reads_as_px4=True))
    assert [note for note in flown.notes if "GATE" in note] == noted
    if airspeed is None:
        assert flown.leg_airspeeds[0] == 20.0
    else:
        assert flown.leg_airspeeds.tolist() == airspeed


def test_what_is_the_cameras_is_not_called_not_flown() -> None:
    items = wp(0, 0), "2 206 25 0 1 0 0 0 0", wp(0, 900), "2 203 0 0 0 0 1 0 0", "2 181 0 1 0 0 0 0 0", wp(0, 1800)
    assert route(*items).notes == (
        "item 4: DO_DIGICAM_CONTROL only controls the camera",
        "item 5: DO_SET_RELAY is not flown",
    )


@pytest.mark.parametrize("mark", [188, 189, 191, 600])
def test_a_mark_is_flown_as_written(mark: int) -> None:
    items = wp(0, 0), wp(0, 900), f"2 {mark} 0 0 0 0 0 0 0", wp(0, 1800)
    assert route(*items).notes == ()


def test_jumps_are_followed_as_often_as_they_say() -> None:
    corners = [wp(0, 0), wp(0, 900), wp(900, 900)]
    assert route(*corners, "2 177 2 2 0 0 0 0 0").items.tolist() == [1, 2, 3, 2, 3, 2, 3]
    assert route(*corners, "2 177 1 0 0 0 0 0 0").items.tolist() == [1, 2, 3]
    endless = route(*corners, "2 177 2 -1 0 0 0 0 0")
    assert endless.items.tolist() == [1, 2, 3, 2, 3]
    assert endless.notes == (
        "item 4: DO_JUMP repeats indefinitely, so the simulated flight flies its items once more and then ends",
    )
    assert (endless.endless_jump, route(*corners, "2 177 2 2 0 0 0 0 0").endless_jump) == (4, None)
    # What follows a jump without end is never flown.
    beyond = route(*corners, "2 177 2 -1 0 0 0 0 0", wp(0, 0))
    assert beyond.items.tolist() == [1, 2, 3, 2, 3]
    assert beyond.notes[1] == "item 5: never reached"
    skipping = route(wp(0, 0), "2 177 4 1 0 0 0 0 0", wp(0, 900), wp(900, 900))
    assert skipping.items.tolist() == [1, 4]
    assert skipping.notes == ("item 3: never reached",)
    # A counter is never reset: the inner jump is taken once, not once each time round.
    nested = route(*corners, "2 177 2 1 0 0 0 0 0", "2 177 1 1 0 0 0 0 0")
    assert nested.items.tolist() == [1, 2, 3, 2, 3, 1, 2, 3]


@pytest.mark.parametrize(("count", "opens", "notes"), [(15, False, False), (16, False, True), (101, True, False)])
def test_arduplane_counts_a_hundred_jumps_and_fifteen_on_a_small_board(count: int, opens: bool, notes: bool) -> None:
    """`AP_Mission::get_jump_times_run`: the other jumps count as used up."""
    jumps = [line for k in range(count) for line in (wp(0, 100 * k + 900), f"2 177 {2 * k + 2} 1 0 0 0 0 0")]
    made = make_itinerary(mission(wp(0, 0), *jumps))
    assert [(one.item, "beyond the first 100" in one.text) for one in made.open_items] == [(203, True)] * opens
    assert any("a board with little memory" in note for note in made.notes) == notes
    assert made.px4_open_items == ()


@pytest.mark.parametrize(("count", "opens"), [(9, False), (10, True)])
def test_px4_ends_a_mission_at_ten_jumps_in_a_row(count: int, opens: bool) -> None:
    """`MissionBase::getNonJumpItem` reads ten items at most (`MAX_JUMP_ITERATION`)."""
    made = make_itinerary(mission(wp(0, 0), wp(0, 900), *["2 177 2 0 0 0 0 0 0"] * count, wp(0, 1800)))
    assert [one.item for one in made.px4_open_items] == [count + 2] * opens
    assert made.open_items == ()


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 6), st.integers(0, 30))
def test_a_jump_flies_its_body_once_more_each_time(corners: int, repeats: int) -> None:
    places = [wp(900 * math.cos(k), 900 * math.sin(k)) for k in range(corners)]
    flown = route(*places, f"2 177 1 {repeats} 0 0 0 0 0")
    assert flown.items.tolist() == list(range(1, corners + 1)) * (repeats + 1)


def test_jumps_to_nowhere_or_too_often_are_refused() -> None:
    assert "item 3: DO_JUMP p1 9: the mission has no item 9" in refusal(wp(0, 0), wp(0, 900), "2 177 9 1 0 0 0 0 0")
    assert "DO_JUMP p1 0" in refusal(wp(0, 0), wp(0, 900), "2 177 0 1 0 0 0 0 0")
    assert "more than 10,000 positions to fly to" in refusal(wp(0, 0), wp(0, 900), "2 177 1 9999 0 0 0 0 0")
    assert "more than 200,000 items" in refusal(wp(0, 0), wp(0, 900), "2 177 3 999999 0 0 0 0 0")


@pytest.mark.parametrize("command", [17, 18, 19, 31])
@pytest.mark.parametrize(("frame", "keeps"), [(3, True), (10, True), (0, False)])
def test_a_loiter_at_a_height_of_0_keeps_the_altitude_of_the_item_before(command: int, frame: int, keeps: bool) -> None:
    """ArduPlane's `Location::sanitize` takes a relative altitude of 0 for the present one; home is at 300 m."""
    loiter = wp(0, 1500, 0, command=command, p="1 0 0 0", frame=frame)
    made = route(wp(0, 500, 150), loiter, wp(0, 5000, 150), terrain=ground())
    altitudes = made.positions[made.items == 2, 2]
    assert bool(np.allclose(altitudes, 450.0, atol=0.02)) is keeps
    assert any("at a height of 0 m" in note for note in made.notes) is keeps


def test_a_return_or_a_landing_ends_the_itinerary() -> None:
    home = route(wp(0, 500, 150), wp(0, 1500, 200), "0 20 0 0 0 0 0 0 0", wp(5, 5))
    # Home is at 300 m, and 100 m over it is where planfly's guidance comes home.
    assert (home.rtl_start, home.rtl_loiter) == (1, pytest.approx((0.0, 0.0, 400.0, 80.0, 0.0), abs=0.01))
    assert home.notes == (
        "item 4: never reached",
        "item 3: NAV_RETURN_TO_LAUNCH returns to home, 1.5 km away, descending 100 m on a straight slope to 400"
        " m AMSL;"
        " the simulated flight ends after 60 s of the loiter there",
    )
    landed = route(
        wp(0, 500, 150), "3 189 0 0 0 0 36.5 -84.2 0", wp(0, 1500, 60), wp(900, 1500, 0, command=21), wp(0, 0)
    )
    assert landed.positions[-1] == pytest.approx([900.0, 1500.0, 360.0], abs=0.02)
    assert [note.split(":")[0] for note in landed.notes] == ["item 4", "item 5"]
    here = route(wp(0, 500), wp(0, 1500), "3 85 0 0 0 0 0 0 0")
    assert here.items.tolist() == [1, 2]
    assert "without a position" in here.notes[0]
    ignored = route(wp(0, 500), wp(0, 1500), "0 20 0 0 0 0 0 0 0", home="0 0 0", terrain=ground())
    assert ignored.legs == 1
    assert ignored.notes[0] == "item 3: NAV_RETURN_TO_LAUNCH without a home is not flown"


# One line each of the commands that a fixed wing's mission may hold; none but a mark may go in silence.
@pytest.mark.parametrize("command", [17, 18, 19, 30, 31, 80, 82, 92, 93, 94, 112, 115, 183, 201, 530, 50_000])
def test_nothing_is_dropped_in_silence(command: int) -> None:
    flown = route(wp(0, 0), wp(0, 900, command=command), wp(900, 900), f"2 {command} 1 2 3 4 0 0 0")
    flies = command in (17, 18, 19, 31, 82, 94)
    assert (2 in flown.items) == flies
    assert {number for note in flown.notes for number in ("2", "4") if number in note.split(":")[0]} == {"2", "4"}


@pytest.mark.parametrize(("stated", "flown"), [(0.5, 0.5), (1.0, 1.0), (1.5, 1.0), (2.9, 2.0), (300.0, 255.0)])
def test_a_loiter_of_more_than_one_turn_keeps_whole_turns_as_in_arduplane(stated: float, flown: float) -> None:
    """`AP_Mission::mavlink_int_to_mission_cmd` stores the turns in a byte, a fraction only below one turn."""
    read = mission(wp(0, 0), wp(0, 1000, command=18, p=f"{stated} 0 0 0"), wp(0, 5000))
    (loiter,) = (stop.loiter for stop in make_itinerary(read).stops if stop.loiter is not None)
    assert loiter.turns == flown
    assert any("flown as" in note for note in make_itinerary(read).notes) is (stated != flown)


def test_long_missions_walk_in_linear_time() -> None:
    stops = make_itinerary(mission(*[wp(k, k) for k in range(9000)])).stops
    assert len(stops) == 9000


@pytest.mark.parametrize(("frame", "is_open"), [(3, False), (10, True)])
def test_arduplane_takes_the_height_of_a_take_off_above_terrain_for_an_altitude(frame: int, is_open: bool) -> None:
    """`Plane::do_takeoff` subtracts home's altitude from the number of the item."""
    stops = make_itinerary(mission(wp(0, 300, 60, command=22, frame=frame), wp(0, 900), wp(0, 1800)))
    assert [one.item for one in stops.open_items] == [1] * is_open
    assert stops.px4_open_items == ()


@pytest.mark.parametrize(("frames", "is_open"), [((3, 3), False), ((10, 3), True), ((3, 10), True)])
def test_a_glide_from_or_to_an_item_above_terrain_is_open(frames: tuple[int, int], is_open: bool) -> None:
    stops = make_itinerary(mission(wp(0, 0), wp(0, 900, frame=frames[0]), wp(0, 1800, 0, command=21, frame=frames[1])))
    assert [one.item for one in stops.open_items] == [3] * is_open
    assert stops.px4_open_items == ()


def test_a_vertical_take_off_is_over_home_and_its_place_is_not_flown_to() -> None:
    """As ArduPlane does it: it climbs where it stands, and a fixed wing of it passes the item over."""
    flown = route(wp(0, 700, 80, command=84), wp(900, 700))
    assert flown.positions == pytest.approx(np.array([[0, 0, 380], [900, 700, 400]]), abs=0.01)
    assert flown.notes[:2] == (
        "item 1: NAV_VTOL_TAKEOFF is not flown straight up",
        "item 1: the position of NAV_VTOL_TAKEOFF is not flown to, as in ArduPlane; PX4 would fly to it",
    )
    later = route(wp(0, 0), wp(700, 700, command=84), wp(0, 900))
    assert later.items.tolist() == [1, 3]
    assert later.notes == ("item 2: NAV_VTOL_TAKEOFF in the air is not flown",)
