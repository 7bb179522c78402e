"""Jumps and tags, and the commands between them: in ArduPlane's order, and in PX4's.

ArduPlane's order is walked a second time here, as `AP_Mission::update` does it tick by tick (libraries/AP_Mission); 4.6
never resets a jump's counter, and 4.7 resets a counter that is used up.
"""

import random

import pytest

from flight.mission.items import Mission
from flight.mission.itinerary import make_itinerary
from flight.mission.route import Route, RouteRules, make_route
from flight.mission_files.formats import parse_mission
from tests.mission_lines import ORIGIN, mission, refusal, route, wp
from world.errors import MissionError

SPEED = "2 178 0 {} -1 0 0 0 0"


def walked(read: Mission, *, resets: bool = False) -> tuple[list[int], list[float]]:
    """Items flown to and the airspeed that each is flown to with, 25 m/s at first, as ArduPlane's loop would."""
    items = {item.seq: item for item in read.items}
    tags = {int(one.params[0]): one.seq for one in reversed(read.items) if one.command == 600}
    run: dict[int, int] = {}

    def get_next(k: int, count: bool) -> int:
        while k in items and items[k].command in (177, 601):
            target, times = int(items[k].params[0]), int(items[k].params[1])
            target = tags[target] if items[k].command == 601 else target
            if run.get(k, 0) < times:
                run[k] = run.get(k, 0) + count
                k = target
            else:
                run[k] = 0 if resets and count else run.get(k, 0)
                k += 1
        return k

    speed, nav, flown, speeds = 25.0, 0, list[int](), list[float]()
    while True:
        do, k = 0, get_next(nav + 1, True)
        while k in items and items[k].command > 95:
            if not do:
                do = k
                speed = items[k].params[1] if items[k].command == 178 else speed
            k = get_next(k + 1, True)
        if k not in items:
            return flown, speeds
        nav = k
        run_on_leg = {do}
        while do:
            do = get_next(do + 1, False)
            # Commands that jumps lead back to run again and again on the leg.
            do = do if do in items and items[do].command > 95 and do not in run_on_leg else 0
            run_on_leg.add(do)
            speed = items[do].params[1] if do and items[do].command == 178 else speed
        flown.append(nav)
        speeds.append(speed)


def drawn(seed: int) -> Mission:
    """A mission of 4 to 8 places with speeds, servos, tags and one to three counted jumps among them."""
    rng = random.Random(seed)
    lines = [wp(700.0 * k, 500.0 * (k % 2)) for k in range(rng.randint(4, 8))]
    for tag in range(3):
        lines.insert(rng.randint(1, len(lines) - 1), f"2 600 {tag} 0 0 0 0 0 0")
    for _ in range(rng.randint(2, 6)):
        lines.insert(rng.randint(1, len(lines) - 1), SPEED.format(rng.randint(18, 30)))
    for _ in range(rng.randint(0, 2)):
        lines.insert(rng.randint(1, len(lines) - 1), "2 183 9 1500 0 0 0 0 0")
    for _ in range(rng.randint(1, 3)):
        at, times = rng.randint(2, len(lines) - 1), rng.randint(0, 3)
        if rng.random() < 0.6:
            lines.insert(at, f"2 601 {rng.randint(0, 2)} {times} 0 0 0 0 0")
        else:
            lines.insert(at, f"2 177 {rng.randint(1, len(lines))} {times} 0 0 0 0 0")
    return mission(*lines)


@pytest.mark.parametrize("resets", [False, True])
@pytest.mark.parametrize("seed", range(40))
def test_drawn_missions_are_walked_as_arduplane_walks_them(seed: int, resets: bool) -> None:
    read = drawn(seed)
    flown, speeds = walked(read, resets=resets)
    stops = make_itinerary(read, resets_jump_counters=resets).stops
    assert [stop.item for stop in stops] == flown
    assert [25.0 if stop.airspeed != stop.airspeed else stop.airspeed for stop in stops] == speeds


LOOP = (wp(0, 0), wp(0, 1000), wp(1000, 1000), wp(1000, 0))


def test_a_loop_in_a_loop_is_flown_again_by_47_and_not_by_46() -> None:
    nested = mission(wp(0, 0), wp(0, 1000), "2 177 1 1 0 0 0 0 0", wp(1000, 1000), "2 177 1 1 0 0 0 0 0", wp(2000, 0))
    once, again = (make_itinerary(nested, resets_jump_counters=resets) for resets in (False, True))
    assert [stop.item for stop in once.stops] == [1, 2, 1, 2, 4, 1, 2, 4, 6]
    assert [stop.item for stop in again.stops] == [1, 2, 1, 2, 4, 1, 2, 1, 2, 4, 6]
    assert once.passes_exhausted_jump
    assert not make_itinerary(mission(*LOOP, "2 177 2 2 0 0 0 0 0", wp(2000, 0))).passes_exhausted_jump


def test_commands_behind_a_spent_jump_run_a_round_early_in_arduplane_and_in_their_place_in_px4() -> None:
    items = *LOOP, SPEED.format(22), "2 177 2 2 0 0 0 0 0", SPEED.format(30), wp(2000, 0), wp(2000, 1000)
    flown = route(*items)
    assert flown.items.tolist() == [1, 2, 3, 4, 2, 3, 4, 2, 3, 4, 8, 9]
    # ArduPilot #30376: at the begin of the last round the jump's counter is used up, and item 7 runs.
    assert flown.leg_airspeeds.tolist() == [25.0] * 3 + [22.0] * 3 + [30.0] * 5
    assert flown.notes == ("item 7: DO_CHANGE_SPEED is flown one loop early, as in ArduPlane",)
    by_px4 = make_route(mission(*items), ORIGIN, None, 25.0, False, rules=RouteRules(reads_as_px4=True))
    assert by_px4.leg_airspeeds.tolist() == [25.0] * 3 + [22.0] * 6 + [30.0] * 2
    assert by_px4.notes == ()


def test_a_jumps_target_command_is_not_run_behind_another_command() -> None:
    items = SPEED.format(20), wp(0, 0), wp(0, 1000), SPEED.format(22), "2 177 1 1 0 0 0 0 0", wp(1000, 1000)
    # Behind item 3 ArduPlane runs item 4; from there on the jump is spent, and item 6 the next: item 1 is left out.
    assert route(*items).leg_airspeeds.tolist() == [20.0, 22.0, 22.0, 22.0]
    by_px4 = make_route(mission(*items), ORIGIN, None, 25.0, False, rules=RouteRules(reads_as_px4=True))
    assert by_px4.leg_airspeeds.tolist() == [20.0, 20.0, 20.0, 22.0]


def test_a_tag_leads_to_the_first_item_of_its_number_wherever_the_jump_stands() -> None:
    forward = route(wp(0, 0), wp(0, 900), "2 601 9 1 0 0 0 0 0", wp(900, 900), "2 600 9 0 0 0 0 0 0", wp(0, 1800))
    assert forward.items.tolist() == [1, 2, 6]
    back = route(
        wp(0, 0),
        "2 600 4 0 0 0 0 0 0",
        wp(0, 900),
        wp(900, 900),
        "2 600 4 0 0 0 0 0 0",
        wp(900, 0),
        "2 601 4 2 0 0 0 0 0",
    )
    assert back.items.tolist() == [1, 3, 4, 6, 3, 4, 6, 3, 4, 6]
    endless = route(wp(0, 0), "2 600 4 0 0 0 0 0 0", wp(0, 900), wp(900, 900), "2 601 4 -1 0 0 0 0 0")
    assert endless.items.tolist() == [1, 3, 4, 3, 4]
    assert (
        "item 5: DO_JUMP_TAG repeats indefinitely, so the simulated flight flies its items once more and then ends"
        in endless.notes
    )
    assert "DO_JUMP_TAG p1 7: the mission has no JUMP_TAG 7" in refusal(wp(0, 0), wp(0, 900), "2 601 7 1 0 0 0 0 0")
    with pytest.raises(MissionError, match="p2 -3"):
        parse_mission("QGC WPL 110\n0 1 0 16 0 0 0 0 36.5 -84.2 300 1\n1 0 2 601 4 -3 0 0 0 0 0 1", "a.waypoints")


def heights(made: Route) -> list[float]:
    return [round(float(up), 3) for up in made.positions[:, 2]]


def test_a_home_that_is_set_counts_for_the_altitudes_and_the_return_behind_it() -> None:
    """`Plane::set_next_WP` adds the home of the moment; the file's home is at 300 m."""
    moved = wp(600, 0, 420.0, command=179, frame=0)
    made = route(wp(0, 0, 100), wp(0, 900, 100), moved, wp(900, 900, 100), wp(900, 1800, 700, frame=0))
    assert heights(made) == [400.0, 400.0, 520.0, 700.0]
    # Relative to the home before, 300 m; a second command is run when the next place is already flown to.
    over = wp(600, 0, 50.0, command=179)
    made = route(wp(0, 0, 100), wp(0, 900, 100), "2 183 9 1500 0 0 0 0 0", over, wp(900, 900, 100), wp(900, 1800, 100))
    assert heights(made) == [400.0, 400.0, 400.0, 450.0]
    back = route(wp(0, 0, 100), wp(0, 900, 100), moved, "2 20 0 0 0 0 0 0 0")
    assert back.rtl_loiter is not None
    assert back.rtl_loiter[:2] == pytest.approx((600.0, 0.0), abs=0.02)
    assert made.open_items == back.open_items == ()
    # PX4 takes no coordinates for it, and where it is flown otherwise the verdict is open.
    by_px4 = make_route(
        mission(wp(0, 0), moved, wp(0, 900)), ORIGIN, None, 25.0, False, rules=RouteRules(reads_as_px4=True)
    )
    assert [one.item for one in by_px4.open_items] == [2]
    here = route(wp(0, 0), wp(0, 900), "2 179 1 0 0 0 0 0 0", wp(900, 900))
    assert [one.item for one in here.open_items] == [3]
    assert route("2 179 1 0 0 0 0 0 0", wp(0, 0), wp(0, 900)).open_items == ()


@pytest.mark.parametrize(
    ("altitude", "frame", "opens"),
    [("0", 3, False), ("0.009", 3, False), ("-330", 3, True), ("1", 0, True), ("0", 0, False)],
)
def test_a_home_at_zero_degrees_is_ignored_only_at_altitude_zero(altitude: str, frame: int, opens: bool) -> None:
    """`AP_AHRS::set_home` refuses latitude, longitude and altitude of 0 alone, the altitude in whole centimetres."""
    made = route(wp(0, 0), wp(0, 900), f"{frame} 179 0 0 0 0 0 0 {altitude}", wp(900, 900))
    assert [one.item for one in made.open_items] == [3] * opens
    assert any("ignored, as in ArduPlane" in note for note in made.notes) != opens


@pytest.mark.parametrize(("jumps", "open_item"), [(63, None), (64, 2)])
def test_arduplane_ends_a_mission_at_65_jumps_in_a_row(jumps: int, open_item: int | None) -> None:
    """`AP_Mission::get_next_cmd`: the 65th jump item ends the search; after 64 repeats the item is read once more."""
    read = mission(wp(0, 0), f"0 177 2 {jumps} 0 0 0 0 0", wp(0, 900))
    # The jump leads to itself; it is passed for the last time after its repeats.
    flown = make_itinerary(read)
    counted = [one for one in flown.open_items if "jumps in a row" in one.text]
    assert [one.item for one in counted] == ([] if open_item is None else [open_item])


@pytest.mark.parametrize(("repeats", "open_item"), [(255, None), (256, 2)])
def test_arduplane_ends_a_mission_at_257_commands_without_a_waypoint(repeats: int, open_item: int | None) -> None:
    """`AP_Mission::advance_current_nav_cmd`: the first command is run, and 255 more are passed."""
    read = mission(wp(0, 0), "0 206 50 0 0 0 0 0 0", f"0 177 2 {repeats} 0 0 0 0 0", wp(0, 900))
    flown = make_itinerary(read)
    counted = [one for one in flown.open_items if "commands without a waypoint" in one.text]
    assert [one.item for one in counted] == ([] if open_item is None else [open_item])
