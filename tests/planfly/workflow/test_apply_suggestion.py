"""The moves of items with which a suggestion is tried, applied in the studio, and stated in its text."""

import math
import re
from dataclasses import replace

import pytest

from flight.mission.edits import movable_indices
from flight.mission.items import Command, Frame, Mission, MissionItem
from logs.verdict.findings import Finding, make_finding
from logs.verdict.places import Change, ItemMove, Place, Suggestion
from logs.verdict.wording import suggestion_text
from planfly.workflow.apply_suggestion import apply_suggestion, item_moves
from planfly.workflow.mission_context import JudgedMission, MissionContext
from planfly.workflow.suggestion_trials import SuggestionTrials
from tests.mission_lines import setup_of, wp
from tests.planfly.studio.drafts import drawn_session, world_of
from world.errors import MissionError
from world.frames import to_geo

SCENARIO, AIRFRAME = world_of("jacksboro")
HOME = drawn_session(5, 12).mission.home
# East and north, m: three waypoints with a leg of 80 m to the north, the approach, and the landing point.
PLACES = (
    (0.0, 0.0),
    (1500.0, 0.0),
    (1500.0, 80.0),
    (4000.0, 80.0),
    (4000.0, 2000.0),
    (2500.0, 2000.0),
    (1000.0, 2000.0),
)
KINDS = (16, 16, 16, 16, 16, 16, 21)


def judged_mission() -> tuple[MissionContext, JudgedMission]:
    assert SCENARIO.terrain is not None
    ground = float(SCENARIO.terrain.height(0.0, 0.0))
    items = []
    for seq, (kind, (east, north)) in enumerate(zip(KINDS, PLACES, strict=True), 1):
        lat, lon = (round(float(angle), 7) for angle in to_geo(SCENARIO.origin, east - 2000.0, north - 1000.0))
        up = float(SCENARIO.terrain.height(east - 2000.0, north - 1000.0)) if kind == 21 else ground + 700.0
        items.append(MissionItem(seq, kind, int(Frame.GLOBAL), (0.0,) * 4, lat, lon, round(up, 3)))
    start = MissionItem(5, int(Command.DO_LAND_START), int(Frame.MISSION), (0.0,) * 4, 0.0, 0.0, 0.0)
    numbered = [*items[:4], start, *items[4:]]
    mission = Mission(HOME, tuple(MissionItem(k, *vars_of(item)) for k, item in enumerate(numbered, 1)))
    context = MissionContext.from_setup(
        MissionContext(SCENARIO, AIRFRAME, 1, drawn_session(5, 12).judged.setup).setup(mission)
    )
    return context, context.judge(mission)


def vars_of(item: MissionItem) -> tuple[object, ...]:
    return item.command, item.frame, item.params, item.lat_deg, item.lon_deg, item.alt


def longer(leg: int, metres: float) -> tuple[Finding, Suggestion]:
    place = Place("leg", leg)
    return make_finding("slope", place, ok=False, reason=""), (Change("length", place, None, metres, "m"),)


def test_a_longer_leg_moves_its_end_and_nothing_else() -> None:
    context, judged = judged_mission()
    changed = apply_suggestion(context, judged, *longer(1, 200.0))
    [move] = item_moves(context, judged.mission, changed)
    assert (move.item, move.up) == (3, 0.0)
    assert (move.east, move.north) == pytest.approx((0.0, 120.0), abs=0.05)


@pytest.mark.parametrize("leg", [3, 4])
def test_no_item_of_an_approach_is_moved_to_a_side(leg: int) -> None:
    """The landing point remains, so that the final approach would turn."""
    context, judged = judged_mission()
    with pytest.raises(MissionError, match="of the landing sequence to a side"):
        apply_suggestion(context, judged, *longer(leg, 3000.0))


@pytest.mark.parametrize(
    ("change", "offset"),
    [
        (Change("descent", Place("waypoint", 5), None, 12.0, "m"), (0.0, 0.0, -12.0)),
        # The last leg is 1500 m long, to the west.
        (Change("length", Place("leg", 5), 1500.0, 1900.0, "m"), (400.0, 0.0, 0.0)),
    ],
)
def test_a_gentler_landing_moves_the_waypoint_before_it(change: Change, offset: tuple[float, float, float]) -> None:
    """Item 7 is waypoint 5; the landing point, item 8, stays."""
    context, judged = judged_mission()
    finding = make_finding("landing", Place("waypoint", 6), ok=False, reason="")
    [move] = item_moves(context, judged.mission, apply_suggestion(context, judged, finding, (change,)))
    assert move.item == 7
    assert (move.east, move.north, move.up) == pytest.approx(offset, abs=0.5)


def test_a_rise_is_shared_between_its_ends_as_their_other_legs_allow() -> None:
    """Of 100 m item 2 can be lowered by 97 m and item 3 raised by 17 m, because the legs before and after fail beyond.

    A descent of 5 degrees loses 87.5 m on 1000 m; one of 4.9 degrees 85.7 m, so that 185 m have to become 85 m.
    """
    altitudes = (800.0, 810.0, 625.0, 555.0, 555.0)
    lines = [wp(0.0, 1000.0 * k - 2000.0, up - 300.0) for k, up in enumerate(altitudes)]
    setup = setup_of(*lines, limits={"max_dive_deg": 5.0, "min_clearance_m": 30.0})
    context = MissionContext.from_setup(setup)
    judged = context.judge(setup.mission)
    [finding] = judged.verdict.failed
    [trial] = [one for one in SuggestionTrials(context, judged).find_passing() if one.suggestion[0].what == "rise"]
    moves = {move.item: move.up for move in trial.suggestion[0].moves}
    assert (finding.rule, finding.place.index, list(moves)) == ("slope", 1, [2, 3])
    assert moves[3] - moves[2] == pytest.approx(100.0, abs=0.01)
    assert moves[2] > -97.5
    assert moves[3] < 17.5


def test_the_text_of_a_suggestion_that_passed_moves_the_items_as_its_trial_did() -> None:
    context, judged = judged_mission()
    told = []
    for trial in SuggestionTrials(context, judged).find_passing():
        text = suggestion_text(trial.suggestion)
        after = trial.setup.mission
        match = re.fullmatch(r".*: move item (\d+) (.*)", text)
        if match is None:
            continue
        step = {side: float(metres) for side, metres in re.findall(r"(\w+) by ([\d.]+) m", match[2])}
        index = int(match[1]) - 1
        row = movable_indices(after).index(index)
        offset = (context.item_positions(after) - context.item_positions(judged.mission))[row]
        east, north = step.get("east", 0.0) - step.get("west", 0.0), step.get("north", 0.0) - step.get("south", 0.0)
        assert (east, north) == pytest.approx(offset[:2].tolist(), abs=0.06)
        told.append(trial.suggestion[0].what)
    assert "length" in told


def test_an_end_with_a_loiter_makes_the_last_waypoint_one() -> None:
    context, judged = judged_mission()
    last = max(k for k, item in enumerate(judged.mission.items) if item.command == 16)
    end = Place("waypoint", judged.setup.route.items.tolist().index(judged.mission.items[last].seq))
    finding = make_finding("return", end, ok=False, reason="")
    changed = apply_suggestion(context, judged, finding, (Change("end loiter", end, None, 17.0, ""),))
    assert changed.items[last] == replace(judged.mission.items[last], command=17, params=(0.0,) * 4)
    assert [item for k, item in enumerate(changed.items) if k != last] == [
        item for k, item in enumerate(judged.mission.items) if k != last
    ]


def test_raises_of_neighbouring_legs_combine_by_the_larger() -> None:
    """Item 3 ends leg 1, which needs 30 m, and begins leg 2, which needs 50 m."""
    context, judged = judged_mission()
    finding = make_finding("clearance", Place("leg", 1), ok=False, reason="")
    changes = [Change("height", Place("leg", leg), None, metres, "m") for leg, metres in ((1, 30.0), (2, 50.0))]
    for suggestion in (tuple(changes), tuple(reversed(changes))):
        moves = item_moves(context, judged.mission, apply_suggestion(context, judged, finding, suggestion))
        assert {move.item: move.up for move in moves} == pytest.approx({2: 30.0, 3: 50.0, 4: 50.0}, abs=0.01)


def test_only_the_items_of_stated_moves_are_moved() -> None:
    """Leg 1 leads from item 2 to item 3."""
    context, judged = judged_mission()
    finding = make_finding("clearance", Place("leg", 1), ok=False, reason="")
    for stated, expected in (((), {2: 30.0, 3: 30.0}), ((ItemMove(3, 0.0, 0.0, 30.0),), {3: 30.0})):
        change = Change("height", Place("leg", 1), None, 30.0, "m", moves=stated)
        moves = item_moves(context, judged.mission, apply_suggestion(context, judged, finding, (change,)))
        assert {move.item: move.up for move in moves} == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(
    ("what", "wanted"), [("length", 80.004), ("rise", 0.0), ("height", 0.0), ("north", 0.0), ("airspeed", None)]
)
def test_a_suggestion_that_would_change_nothing_is_refused(what: str, wanted: float | None) -> None:
    """Leg 1 is 80 m long and level; items are rounded to a centimetre."""
    context, judged = judged_mission()
    place = Place("leg", 1)
    wanted = float(judged.setup.route.leg_airspeeds[1]) if wanted is None else wanted
    finding = make_finding("slope", place, ok=False, reason="")
    with pytest.raises(MissionError, match="no item at the place of this suggestion"):
        apply_suggestion(context, judged, finding, (Change(what, place, None, wanted, "m"),))


def test_a_move_to_a_side_of_an_item_without_altitude_has_no_change_of_altitude() -> None:
    context, judged = judged_mission()
    items = list(judged.mission.items)
    # An item that no flight reaches, because the mission jumps past it.
    jump = MissionItem(2, int(Command.DO_JUMP), int(Frame.MISSION), (4.0, -1.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    items[1:2] = [jump, replace(items[1], seq=3, alt=math.nan, params=(0.0,) * 4)]
    before = replace(judged.mission, items=tuple(replace(item, seq=seq) for seq, item in enumerate(items, 1)))
    moved_item = replace(before.items[2], lat_deg=before.items[2].lat_deg + 0.001)
    after = replace(before, items=(*before.items[:2], moved_item, *before.items[3:]))
    [move] = item_moves(context, before, after)
    assert (move.item, move.up) == (3, 0.0)
    # A thousandth of a degree of latitude.
    assert (move.east, move.north) == pytest.approx((0.0, 111.0), abs=0.5)
