"""A suggestion is offered if its trial mends its finding, and what passed before still passes."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.mission.edits import movable_indices, raise_items
from flight.mission_files.formats import HOME_LINE_MISSING_TEXT
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import UNKNOWN_AIRCRAFT, Fact, Finding, make_finding
from logs.verdict.judge_flight import judge_flight
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.places import FLIGHT, Change, ItemMove, Place, RemainingFinding, Suggestion
from logs.verdict.verdict import Verdict
from logs.verdict.wording import suggestion_text
from planfly.workflow import suggestion_trials
from planfly.workflow.apply_suggestion import apply_suggestion
from planfly.workflow.mission_context import JudgedMission, MissionContext
from planfly.workflow.suggestion_trials import (
    MAX_TRIAL_FLIGHTS,
    MAX_TRIED_FINDINGS,
    PassedTrial,
    SuggestionTrials,
    is_improved,
    is_passed,
    judge_mission_geometry,
    remaining_findings,
    tried_suggestions,
    with_tried_suggestions,
)
from tests.flight.autopilots.arduplane.flown_grounds import circuit, fly
from tests.mission_lines import setup_of, wp
from tests.planfly.studio.drafts import drawn_session
from world.airfield import LandingStrip
from world.wind import Wind

SESSION = drawn_session(5, 12)
CONTEXT = MissionContext.from_setup(SESSION.judged.setup)


def higher(leg: int, metres: float) -> Suggestion:
    return (Change("height", Place("leg", leg), None, metres, "m"),)


def low(leg: int, *suggestions: Suggestion, item: int | None = None) -> Finding:
    place = Place("leg", leg, item)
    return replace(make_finding("clearance", place, ok=False, reason="", margin=-leg), suggestions=suggestions)


def verdict_of(*findings: Finding, level: str = "flown") -> Verdict:
    return Verdict(findings, flyable=not findings, complete=True, lines=("",), level=level)


def test_a_finding_that_is_gone_is_worth_no_other() -> None:
    before = verdict_of(low(1), low(2))
    assert is_improved(before, verdict_of(low(2)), low(1))
    assert not is_improved(before, verdict_of(low(2), low(3)), low(1))
    assert not is_improved(before, verdict_of(low(1)), low(1))
    assert not is_improved(before, verdict_of(low(2), low(3), low(4)), low(1))
    # An item that was inserted shifts the numbers of those behind it.
    assert not is_improved(before, verdict_of(low(1, item=7)), low(1, item=6))


def undecided(leg: int) -> Finding:
    return make_finding("clearance", Place("leg", leg), ok=None, reason="", check=UNKNOWN_AIRCRAFT)


def test_what_is_undecided_has_not_passed() -> None:
    passed = make_finding("clearance", Place("leg", 3), ok=True, reason="")
    before = verdict_of(low(1), undecided(2), passed)
    assert is_passed(before, verdict_of(undecided(2), passed), low(1))
    assert not is_passed(before, verdict_of(undecided(1), passed), low(1))
    assert not is_passed(before, verdict_of(undecided(3)), low(1))


def unjudged(leg: int) -> Finding:
    return make_finding("clearance", Place("leg", leg), ok=None, reason="the leg was not flown")


def test_a_failure_is_not_swapped_for_another_open_finding() -> None:
    """As many findings fail as before, but leg 3 passed before; it may neither fail nor be left open."""
    passed = make_finding("clearance", Place("leg", 3), ok=True, reason="")
    before = verdict_of(low(1), passed)
    assert is_passed(before, verdict_of(passed), low(1))
    for after in (low(3), undecided(3), unjudged(3)):
        assert not is_passed(before, verdict_of(after), low(1))
        assert not remaining_findings(before, verdict_of(after))


def test_what_an_early_end_left_unjudged_is_named() -> None:
    """Legs 4 to 6 were not reached: a change of leg 1 cannot be blamed for them, and they are stated."""
    before = replace(verdict_of(low(1), *(unjudged(leg) for leg in (4, 5, 6))), complete=False)
    after = verdict_of(low(4), undecided(5), make_finding("clearance", Place("leg", 6), ok=True, reason=""))
    assert is_passed(before, after, low(1))
    remaining = remaining_findings(before, after)
    assert remaining == (
        RemainingFinding("clearance", Place("leg", 4), fails=True),
        RemainingFinding("clearance", Place("leg", 5), fails=False),
    )
    text = suggestion_text((replace(higher(1, 12.0)[0], remaining=remaining),))
    fails_text = "clearance at leg 4 then fails later in the flight"
    assert (
        text
        == f"raise both ends of leg 1 by 12 m: {fails_text}; clearance at leg 5 then is undecided later in the flight"
    )
    lost = replace(higher(1, 12.0)[0], remaining=(RemainingFinding("departure", FLIGHT, fails=True),))
    assert (
        suggestion_text((lost,)) == "raise both ends of leg 1 by 12 m: loss of control then fails later in the flight"
    )
    # The energy of a flight that ended early passes only for the part that was flown.
    flown_part, whole = (make_finding("energy", FLIGHT, ok=ok, reason="") for ok in (True, False))
    assert is_passed(replace(before, findings=(*before.findings, flown_part)), verdict_of(whole), low(1))
    assert not is_passed(verdict_of(low(1), flown_part), verdict_of(whole), low(1))
    # A flight to the end left nothing unjudged for that reason.
    assert not is_passed(replace(before, complete=True), after, low(1))


@pytest.mark.parametrize(
    ("error_before", "error_after", "passes"),
    [
        (-104.0, -104.0, False),
        (-104.0, -53.0, False),
        (-104.0, -51.0, True),
        (-12.0, -9.0, True),
        (-12.0, -11.0, False),
    ],
)
def test_a_slope_passes_only_if_the_altitude_is_mended(error_before: float, error_after: float, passes: bool) -> None:
    """A lower airspeed that makes the verdict pass changes nothing for an aircraft that is as low as before.

    A half of 104 m is 52 m; 10 m are allowed at any rate.
    """
    place = Place("leg", 1)
    steep, gentle = (
        make_finding("slope", place, ok=ok, reason="", facts=[Fact("height error", error, "m")])
        for ok, error in ((False, error_before), (True, error_after))
    )
    assert is_passed(verdict_of(steep), verdict_of(gentle), steep) is passes


def test_legs_that_are_low_because_home_is_below_the_ground_are_offered_homes_altitude() -> None:
    """The ground is at 100 m: 80 m above a home at 0 m are 20 m below it, and 80 m above a home on it are enough."""
    lines = [wp(0, 500, 80.0), wp(0, 2500, 80.0), wp(2000, 2500, 80.0)]
    judged = judge_mission_geometry(setup_of(*lines, home="36.5 -84.2 0"))
    texts = {finding.suggestion for finding in judged.failed if finding.rule == "clearance"}
    assert texts == {"set home to 100.0 m AMSL, the ground there, instead of 0.0 m"}
    # With an item in the place of home there is no altitude of home to set.
    setup = setup_of(*lines, home="36.5 -84.2 0")
    mission = replace(setup.mission, warnings=(f"a.waypoints:2: {HOME_LINE_MISSING_TEXT}",))
    judged = judge_mission_geometry(replace(setup, mission=mission))
    assert {finding.suggestion for finding in judged.failed if finding.rule == "clearance"} == {""}
    # 11 m below the ground there, home is beyond the error of elevation files, and 9 m below it is within it.
    for home, what in ((89.0, "home altitude"), (91.0, "height")):
        lines = [wp(0, 500 + 1000 * k, 25.0) for k in range(3)]
        judged = judge_mission_geometry(setup_of(*lines, home=f"36.5 -84.2 {home}"))
        changes = {finding.suggestions[0][0].what for finding in judged.failed if finding.suggestions}
        assert changes == {what}


def test_a_home_below_the_ground_is_mended_where_only_some_legs_are_too_low() -> None:
    """40 m above a home 28 m below the ground are 12 m above ground, and 40 m with home on it; 160 m are enough."""
    legs = [wp(0, 500, 40.0), wp(0, 2500, 40.0), wp(0, 4500, 160.0), wp(2000, 4500, 160.0)]
    judged = judge_mission_geometry(setup_of(*legs, home="36.5 -84.2 72"))
    home = "set home to 100.0 m AMSL, the ground there, instead of 72.0 m"
    assert [finding.suggestion for finding in judged.failed if finding.rule == "clearance"] == [home, home]
    assert judged.headline.endswith("; home is 28 m below the ground there, which shifts all heights above home")
    # A leg between altitudes above mean sea level stays as low with any home.
    low = [wp(0, 500, 112.0, frame=0), wp(0, 2500, 112.0, frame=0), wp(0, 4500, 160.0), wp(2000, 4500, 160.0)]
    (finding, *_) = judge_mission_geometry(setup_of(*low, home="36.5 -84.2 72")).failed
    assert finding.suggestion.startswith("raise both ends of leg 0")


def test_items_that_state_heights_above_home_as_amsl_are_offered_the_other_frame() -> None:
    """The ground and home are at 100 m: 80 m AMSL are 20 m below the ground, 80 m above home are enough."""
    lines = [wp(0, 500, 80.0), wp(0, 2500, 80.0, frame=0), wp(2000, 2500, 80.0)]
    judged = judge_mission_geometry(setup_of(*lines, home="36.5 -84.2 100"))
    (finding, *_) = [finding for finding in judged.failed if finding.rule == "clearance"]
    first = "read the altitudes of the items below ground as heights above home (frame 3 instead of 0)"
    assert finding.suggestion.startswith(f"{first}; or raise waypoint 1 (item 2) by 50 m: move item 2 up by 50 m")
    # Below the ground in both frames, the item is raised.
    lines[1] = wp(0, 2500, -20.0, frame=0)
    judged = judge_mission_geometry(setup_of(*lines, home="36.5 -84.2 100"))
    assert not any(
        change.what == "altitude frame" for one in judged.failed for way in one.suggestions for change in way
    )


def test_legs_that_are_low_with_home_on_the_ground_are_raised_in_addition() -> None:
    """From 60 m above a home at 0 m to 15 m above one at 100 m: 30 m are required, 15 m and 1 m more are added."""
    judged = judge_mission_geometry(setup_of(wp(0, 500, 15.0), wp(0, 2500, 15.0), home="36.5 -84.2 0"))
    (finding,) = [finding for finding in judged.failed if finding.rule == "clearance"]
    home = "set home to 100.0 m AMSL, the ground there, instead of 0.0 m"
    assert finding.suggestion.startswith(f"{home} and raise both ends of leg 0 (to item 2) by 16 m")


def test_legs_that_are_high_because_home_is_above_the_ground_are_offered_homes_altitude() -> None:
    """The ground is at 100 m: 80 m above a home at 200 m are 180 m above ground, and 120 m are allowed."""
    lines = [wp(0, 500, 80.0), wp(0, 2500, 80.0)]
    judged = judge_mission_geometry(setup_of(*lines, home="36.5 -84.2 200", limits={"max_height_m": 120.0}))
    (finding,) = [finding for finding in judged.failed if finding.rule == "height"]
    home = "set home to 100.0 m AMSL, the ground there, instead of 200.0 m"
    assert finding.suggestion == home


def test_heights_above_home_among_altitudes_amsl_are_offered_the_other_frame() -> None:
    """The ground and home are at 100 m: 180 m above home are 180 m above ground, and 180 m AMSL are 80 m."""
    lines = [wp(0, 500, 180.0, frame=0), wp(0, 2500, 180.0), wp(2000, 2500, 180.0), wp(4000, 2500, 180.0)]
    judged = judge_mission_geometry(setup_of(*lines, home="36.5 -84.2 100", limits={"max_height_m": 120.0}))
    finding, *_ = [finding for finding in judged.failed if finding.rule == "height"]
    frames = "read the altitudes of the items that are too high as above mean sea level (frame 0 instead of 3)"
    assert finding.suggestion == frames


def test_a_landing_that_fails_in_a_tailwind_is_offered_the_other_end_which_was_flown() -> None:
    """The final to the west begins at 1100 m east, 600 m before the landing point; mirrored, it begins at -100 m."""
    flown = fly(circuit(None, LandingStrip(500.0, 600.0, length=300.0), wind=(8.0, 90.0)))
    setup, verdict = flown.setup, judge_flight(flown.setup, flown.track, flown.flight.ended)
    assert [finding.rule for finding in verdict.failed] == ["touchdown"]
    judged = JudgedMission(setup.mission, setup, route_requirements(setup), verdict)
    (passed,) = SuggestionTrials(MissionContext.from_setup(setup), judged).find_passing()
    assert [change.what for change in passed.suggestion] == ["landing course"]
    (move,) = passed.suggestion[0].moves
    assert (move.item, round(move.east), round(move.north), move.up) == (4, -1200, 0, 0.0)
    # A crosswind is no reason to land from the other end.
    calm = replace(setup, scenario=replace(setup.scenario, wind=Wind(8.0, 0.0)))
    assert not judge_flight(calm, flown.track, flown.flight.ended).failed[0].suggestions


@dataclass
class Flights:
    """Trials whose flight fails by a test's own rule; their geometry passes."""

    fails: Callable[[float], list[Finding]]
    count: int = 0

    def __call__(self, setup: FlightSetup, *_: Any) -> Any:
        flights = self
        up = setup.route.positions[1, 2] - SESSION.judged.setup.route.positions[1, 2]

        class Fake:
            def __init__(self) -> None:
                self.setup, self.requirements, self.geometry_verdict = setup, SESSION.judged.requirements, verdict_of()

            def __getattr__(self, name: str) -> Verdict:
                assert name == "flight_verdict"
                flights.count += 1
                self.flight_verdict = verdict_of(*flights.fails(round(float(up), 3)))
                return self.flight_verdict

        return Fake()


def trials_of(
    monkeypatch: pytest.MonkeyPatch, findings: list[Finding], fails: Callable[[float], list[Finding]]
) -> tuple[SuggestionTrials, Flights]:
    """Trials of whole suggestions: no parts of their moves are tried."""
    flights = Flights(fails)
    monkeypatch.setattr(suggestion_trials, "Trial", flights)
    monkeypatch.setattr(suggestion_trials, "_MAX_TRIED_PARTS", 0)
    judged = replace(SESSION.judged, verdict=verdict_of(*findings))
    return SuggestionTrials(CONTEXT, judged), flights


def test_a_step_that_is_too_small_in_flight_is_enlarged_by_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """12 m and once and a half of the 6 m that still lack, and 2 m."""
    item = low(1, higher(1, 12.0))
    trials, flights = trials_of(monkeypatch, [item], lambda up: [] if up > 20.0 else [low(1, higher(1, 6.0))])
    [tried] = tried_suggestions(trials.find_passing())
    assert tried.suggestions == (higher(1, 23.0),)
    assert flights.count == 2


@pytest.mark.parametrize(
    ("enough", "moved"),
    [({1}, {1}), ({7}, {7}), ({2, 6}, {2, 6}), ({1, 2, 7}, {1, 2, 7}), ({1, 2, 6, 7}, {1, 2, 6, 7}), (set(), {1})],
)
def test_the_smallest_part_of_the_moves_that_passes_is_suggested(
    enough: set[int], moved: set[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Raising legs 1 and 6 moves waypoints 1, 2, 6 and 7; the flight passes if all waypoints of `enough` are raised."""
    altitudes = SESSION.judged.setup.route.positions[:, 2]
    flown: list[int] = []

    class RaisedTrial:
        def __init__(self, setup: FlightSetup, *_: Any) -> None:
            raised = {k for k, up in enumerate(setup.route.positions[:, 2] - altitudes) if up > 1.0}
            flown.append(len(raised))
            self.setup, self.requirements, self.geometry_verdict = setup, SESSION.judged.requirements, verdict_of()
            self.flight_verdict = verdict_of() if raised and enough <= raised else verdict_of(low(1))

    monkeypatch.setattr(suggestion_trials, "Trial", RaisedTrial)
    judged = replace(SESSION.judged, verdict=verdict_of(low(1, (*higher(1, 12.0), *higher(6, 12.0)))))
    (trial,) = SuggestionTrials(CONTEXT, judged).find_passing()
    items = SESSION.judged.setup.route.items
    assert {move.item for change in trial.suggestion for move in change.moves} == {items[k] for k in moved}
    assert {change.wanted for change in trial.suggestion} == {12.0}
    # The whole suggestion is tried first, after the unchanged mission, and then single items before pairs.
    assert flown[:2] == [0, 4]
    assert flown[2:] == sorted(flown[2:])
    if len(moved) < 4:
        assert [change.place.index for change in trial.suggestion] == sorted(moved)
        change = trial.suggestion[0]
        assert f"(item {items[min(moved)]}) by 12 m: move item" in suggestion_text((change,))


def test_one_end_of_a_leg_is_raised_if_that_is_enough() -> None:
    """From 80 m down to 20 m above ground where 30 m are required: 10 m are missing at the end, and 1 m is added."""
    lines = [wp(0, 500, 80.0), wp(0, 2500, 80.0), wp(0, 4500, 20.0)]
    judged = judge_mission_geometry(setup_of(*lines, home="36.5 -84.2 100"))
    (finding,) = [finding for finding in judged.failed if finding.rule == "clearance"]
    assert finding.suggestion == "raise waypoint 2 (item 3) by 11 m: move item 3 up by 11 m"


def test_a_distance_from_a_missile_is_enlarged_by_what_is_missing() -> None:
    """40 m that still lack 10 m become 40 m and once and a half of 10 m and 2 m; 10.4 m add 17.6 m, rounded."""
    place = Place("missile", 0, name="sa")

    def near(missing: float) -> Finding:
        change = Change("distance", place, None, missing, "m")
        return replace(make_finding("threat", place, ok=False, reason=""), suggestions=((change,),))

    for missing, wanted in ((10.0, 57.0), (10.4, 58.0), (0.0, 42.0)):
        larger = suggestion_trials._larger_suggestion(near(40.0), near(40.0).suggestions[0], verdict_of(near(missing)))
        assert larger == (Change("distance", place, None, wanted, "m"),)
    # Another missile's distance is no part of it.
    other = replace(near(10.0), place=Place("missile", 1, name="sb"))
    assert suggestion_trials._larger_suggestion(near(40.0), near(40.0).suggestions[0], verdict_of(other)) is None


@pytest.mark.parametrize(
    ("distance", "wanted"),
    # The navigation error of 4.5 m less 1.3 m is 3.2 m, and 1.5 times 3.2 m and 2 m are 6.8 m, rounded up to 7 m.
    [(1.3, 19.0), (3.5, 16.0), (4.5, None), (9.0, None)],
)
def test_a_distance_from_a_zone_is_enlarged_to_the_navigation_error(distance: float, wanted: float | None) -> None:
    """Zone 1 is passed at its own distance, also if zone 0 is nearer."""
    place = Place("exclusion", 1, name="town")
    suggestion = (Change("north", place, None, 12.0, "m"),)
    finding = replace(make_finding("fence", place, ok=False, reason=""), suggestions=(suggestion,))
    values = {"navigation error": 4.5, "distance to zone 0": 0.5, "distance to zone 1": distance}
    facts = [Fact(name, value, "m") for name, value in values.items()]
    passed = make_finding("fence", FLIGHT, ok=True, reason="", facts=facts)
    larger = suggestion_trials._larger_suggestion(finding, suggestion, verdict_of(passed))
    assert larger == (None if wanted is None else (replace(suggestion[0], wanted=wanted),))


def test_one_end_of_a_leg_is_moved_past_a_zone_if_that_is_enough() -> None:
    """The zone reaches 40 m west of item 3, 2000 m behind item 2, which stays."""
    corners = [[-40.0, 2400.0], [300.0, 2400.0], [300.0, 2700.0], [-40.0, 2700.0]]
    zone = {"name": "town", "kind": "exclusion", "polygon_m": corners}
    lines = [wp(-3000, 500, 80.0), wp(0, 500, 80.0), wp(0, 2500, 80.0), wp(-3000, 2500, 80.0)]
    judged = judge_mission_geometry(setup_of(*lines, home="36.5 -84.2 100", zones=[zone]))
    (finding,) = judged.failed
    (west,) = [way[-1] for way in finding.suggestions if way[-1].what == "west"]
    assert [move.item for move in west.moves] == [3]
    assert west.moves[0].east == pytest.approx(-west.wanted, abs=0.1)
    assert west.wanted > 40.0


def test_no_larger_step_shortens_a_flight_to_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """99 %, and half of the remaining 1 %, round up to 100 %."""

    def long(percent: float) -> Finding:
        change = Change("duration", FLIGHT, None, percent, "%")
        return replace(make_finding("energy", FLIGHT, ok=False, reason=""), suggestions=((change,),))

    trials, flights = trials_of(monkeypatch, [long(99.0)], lambda _: [long(50.0)])
    assert trials.find_passing() == []
    assert flights.count == 1


def test_another_leg_that_then_fails_is_raised_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    item, other = low(1, higher(1, 12.0)), low(4, higher(4, 10.0))
    state = iter([[other, low(5, higher(5, 8.0))], []])
    trials, _ = trials_of(monkeypatch, [item], lambda up: next(state))
    [tried] = tried_suggestions(trials.find_passing())
    assert tried.suggestions == ((*higher(1, 12.0), *higher(4, 10.0), *higher(5, 8.0)),)


@pytest.mark.parametrize(("distance", "count"), [(299.0, 2), (301.0, 1)])
def test_a_far_move_is_offered_only_if_no_smaller_one_passes(distance: float, count: int) -> None:
    [near], [far] = higher(1, 12.0), higher(1, 30.0)
    far = replace(far, moves=(ItemMove(3, 0.6 * distance, 0.8 * distance, 0.0),))
    item = low(1, (near,), (far,))
    near_trial, far_trial = (PassedTrial(item, (change,), SESSION.judged.setup) for change in (near, far))
    [tried] = tried_suggestions([far_trial, near_trial])
    assert len(tried.suggestions) == count
    assert (near,) in tried.suggestions
    assert tried_suggestions([far_trial])[0].suggestions == ((far,),)


def test_the_smallest_move_is_offered_first_and_of_far_moves_only_the_smallest() -> None:
    changes = [
        replace(higher(1, up)[0], moves=(ItemMove(3, 0.0, north, up),)) for north, up in ((40.0, 30.0), (0.0, 12.0))
    ]
    far = [replace(higher(1, 1.0)[0], moves=(ItemMove(3, 0.0, north, 0.0),)) for north in (900.0, 400.0)]
    for offered, expected in ((changes, changes[::-1]), (far, far[1:])):
        item = low(1, *((change,) for change in offered))
        trials = [PassedTrial(item, (change,), SESSION.judged.setup) for change in offered]
        [tried] = tried_suggestions(trials)
        assert [change.moves for (change,) in tried.suggestions] == [change.moves for change in expected]


def test_beyond_the_end_of_a_flight_a_suggestion_is_tried_by_geometry_and_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The flight passed two waypoints, so that it ended on leg 2: legs 1 and 2 are flown, and leg 3 is not."""
    findings = [low(leg, higher(leg, 12.0)) for leg in (1, 2, 3)]
    verdict = replace(verdict_of(*findings), complete=False, leg_ends=(10.0, 20.0, math.inf, math.inf))
    for fails_by_geometry in (True, False):
        trials, flights = trials_of(monkeypatch, findings, lambda up: [])
        trials.judged = replace(trials.judged, verdict=verdict)
        if fails_by_geometry:
            trials._current_trial.geometry_verdict = verdict_of(*findings, level="geometric")
        not_flown = {trial.finding.place.index: trial.suggestion[-1].not_flown for trial in trials.find_passing()}
        assert not_flown == {1: False, 2: False, 3: fails_by_geometry}
        assert flights.count == (2 if fails_by_geometry else 3)
    text = suggestion_text((replace(higher(3, 12.0)[0], not_flown=True),))
    assert text == "raise both ends of leg 3 by 12 m: not tried in flight, because the flight ended before this leg"


def test_a_longer_leg_is_compared_with_its_length_in_the_mission(monkeypatch: pytest.MonkeyPatch) -> None:
    """The trial moves the start of leg 3, which then is 77 m long; in the mission it has another length."""

    def short(leg: int, current: float) -> Finding:
        return low(leg, (Change("length", Place("leg", leg), current, current + 90.0, "m"),))

    runs = SESSION.judged.requirements.runs
    state = iter([[short(3, 77.0)], []])
    trials, _ = trials_of(monkeypatch, [short(2, float(runs[2]))], lambda up: next(state))
    [trial] = trials.find_passing()
    assert [change.current for change in trial.suggestion] == [float(runs[2]), float(runs[3])]


def test_what_helps_nothing_or_harms_elsewhere_is_not_offered(monkeypatch: pytest.MonkeyPatch) -> None:
    item = low(1, higher(1, 12.0))
    trials, _ = trials_of(monkeypatch, [item], lambda up: [low(1)])
    assert trials.find_passing() == []
    trials, _ = trials_of(monkeypatch, [item], lambda up: [low(2)])
    assert trials.find_passing() == []


def test_flights_are_few_and_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    items = [low(leg, higher(leg, 12.0), higher(leg, 14.0)) for leg in range(1, 9)]
    trials, flights = trials_of(monkeypatch, items, lambda up: items)
    assert trials.find_passing() == []
    assert flights.count == MAX_TRIAL_FLIGHTS
    # The same mission is flown once, and the first of each finding before the second of any.
    same = [low(leg, higher(1, 12.0), higher(1, 14.0)) for leg in range(1, 9)]
    trials, flights = trials_of(monkeypatch, same, lambda up: [])
    assert len(trials.find_passing()) == 2 * MAX_TRIED_FINDINGS
    assert flights.count == 2


@pytest.mark.parametrize(("affordable", "flown"), [(0, 0), (1, 0), (3, 2), (99, MAX_TRIAL_FLIGHTS)])
def test_of_a_long_flight_fewer_suggestions_are_flown(
    affordable: int, flown: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One flight of those that may be flown is the reference flight."""
    monkeypatch.setattr(suggestion_trials, "max_explaining_flights", lambda _: affordable)
    items = [low(leg, higher(leg, 12.0), higher(leg, 14.0)) for leg in range(1, 9)]
    trials, flights = trials_of(monkeypatch, items, lambda up: items)
    assert trials.find_passing() == []
    assert flights.count == flown


def test_no_suggestion_of_a_mission_of_thousands_of_legs_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    legs = SESSION.judged.requirements.legs
    for max_legs, tried in ((legs, 1), (legs - 1, 0)):
        monkeypatch.setattr(suggestion_trials, "MAX_TRIED_LEGS", max_legs)
        trials, flights = trials_of(monkeypatch, [low(1, higher(1, 12.0))], lambda up: [])
        assert (len(trials.find_passing()), flights.count) == (tried, tried)


def test_by_geometry_every_suggestion_that_is_offered_mends() -> None:
    """And one that leads beyond the ceiling is not offered."""
    context = SESSION.context
    judged = context.judge(raise_items(SESSION.mission, movable_indices(SESSION.mission), -90.0))
    [first, *_] = [item for item in judged.verdict.failed if item.rule == "clearance"]
    wrong = replace(first, suggestions=(higher(first.place.index or 0, 9000.0), *first.suggestions))
    findings = tuple(wrong if item is first else item for item in judged.verdict.findings)
    offered = with_tried_suggestions(replace(judged, verdict=replace(judged.verdict, findings=findings)))
    after = {(item.rule, item.place): item.suggestions for item in offered.failed}
    assert after[first.rule, first.place] == first.suggestions[:1]
    for one in SuggestionTrials(context, judged).find_passing():
        assert is_improved(judged.verdict, context.judge(one.setup.mission).verdict, one.finding)
        # As a reader applies it, who knows nothing of the smaller steps that were tried before.
        assert one.setup.mission.items == apply_suggestion(context, judged, one.finding, one.suggestion).items


# ----------------------------------------------------------------------
# Legs that are too low over varied ground are offered to follow it.


def over_a_hill(*lines: str, height: float = 80.0, **tables: Any) -> FlightSetup:
    """A mission over level ground at 0 m with a hill 2,000 m north, where 30 m above ground are required."""
    hill = [{"east_m": 0.0, "north_m": 2000.0, "height_m": height, "sigma_m": 600.0}]
    terrain = {"kind": "peaks", "peak": hill}
    return setup_of(*lines, home="36.5 -84.2 0", terrain=terrain, limits={"min_clearance_m": 30.0}, **tables)


def following(judged: Verdict) -> list[tuple[int | None, list[tuple[str, int | None, float]]]]:
    """The legs that are offered to follow the ground, by the leg of the finding."""
    return [
        (finding.place.index, [(change.what, change.place.index, change.wanted) for change in way])
        for finding in judged.failed
        for way in finding.suggestions
        if way[0].what == "terrain height"
    ]


def test_a_low_leg_over_a_hill_is_offered_to_follow_the_ground() -> None:
    """60 m above home are 20 m below the top, and at the leg's end 60 m above the ground."""
    lines = [wp(0, 0, 60.0), wp(0, 4000, 60.0), wp(2000, 4000, 60.0)]
    judged = judge_mission_geometry(over_a_hill(*lines))
    (leg,) = {finding.place.index for finding in judged.failed if finding.rule == "clearance"}
    assert following(judged) == [(leg, [("terrain height", leg, 60.0)])]
    (finding,) = [finding for finding in judged.failed if finding.rule == "clearance"]
    assert finding.suggestion.startswith("follow the ground to item 2 at 60 m above it (frame 10); or raise both ends")
    # Over ground that varies by less than 20 m, raising the leg is all that is offered.
    low = judge_mission_geometry(over_a_hill(wp(0, 0, 40.0), wp(0, 4000, 40.0), height=18.0))
    assert {finding.rule for finding in low.failed} == {"clearance"}
    assert following(low) == []


def test_several_low_legs_are_offered_to_follow_the_ground_together() -> None:
    """Both legs cross the hill, on which the required 30 m and the 10 m by which a leg may be off are wanted."""
    lines = [wp(0, 0, 60.0), wp(0, 2000, 60.0), wp(0, 4000, 60.0), wp(2000, 4000, 60.0)]
    judged = judge_mission_geometry(over_a_hill(*lines))
    first, second = [finding.place.index for finding in judged.failed if finding.rule == "clearance"]
    wanted = [("terrain height", first, 40.0), ("terrain height", second, 60.0)]
    assert following(judged) == [(first, wanted), (second, wanted)]
    (finding, _) = [finding for finding in judged.failed if finding.rule == "clearance"]
    setup = over_a_hill(*lines)
    session = JudgedMission(setup.mission, setup, route_requirements(setup), judged)
    (following_both,) = [way for way in finding.suggestions if way[0].what == "terrain height"]
    changed = apply_suggestion(MissionContext.from_setup(setup), session, finding, following_both)
    assert [(item.frame, round(item.alt)) for item in changed.items] == [(3, 60), (10, 40), (10, 60), (3, 60)]


def test_an_autopilot_that_does_not_follow_the_ground_is_not_offered_to() -> None:
    setup = over_a_hill(wp(0, 0, 60.0), wp(0, 4000, 60.0))
    law = ArduPlane(ArduPilotParameters.defaults().changed(TERRAIN_ENABLE=0.0))
    assert len(following(judge_mission_geometry(setup))) == 1
    assert following(judge_mission_geometry(replace(setup, autopilot=law))) == []


# ----------------------------------------------------------------------
# Legs of a return to launch have no height of their own: a parameter and the item before them decide.

RTL = "3 20 0 0 0 0 0 0 0"


def test_a_return_is_not_offered_to_follow_the_ground() -> None:
    """The way there crosses the hill 20 m below its top, and the return, which climbs to 100 m, 20 m above it."""
    judged = judge_mission_geometry(over_a_hill(wp(0, 0, 60.0), wp(0, 4000, 60.0), RTL))
    (low_leg, low_return) = [finding.place for finding in judged.failed if finding.rule == "clearance"]
    assert (low_leg.to_item, low_return.to_item) == (2, 3)
    assert all(places == [("terrain height", low_leg.index, 60.0)] for _, places in following(judged))
    assert not any("item 3 at" in finding.suggestion for finding in judged.failed)


def low_return(height: float = 100.0, rtl_altitude: float = 100.0) -> FlightSetup:
    """A return by ArduPlane from 150 m, 4 km away, down to its RTL_ALTITUDE over a hill in the middle."""
    setup = over_a_hill(wp(0, 0, 150.0), wp(0, 4000, 150.0), RTL, height=height)
    context = MissionContext.from_setup(replace(setup, autopilot=ArduPlane(ArduPilotParameters.defaults())))
    return context.setup_with_parameters(setup.mission, {"RTL_ALTITUDE": rtl_altitude})


def test_a_low_return_is_offered_the_parameter_of_its_altitude_or_a_higher_start() -> None:
    """Half way it is at 125 m, over a top of 100 m: 5 m too low, so that its end or its start has to be 10 m higher."""
    (finding,) = [finding for finding in judge_mission_geometry(low_return()).failed if finding.rule == "clearance"]
    (end,), (start,) = finding.suggestions
    assert (end.what, end.place, end.parameter, end.current) == ("parameter", FLIGHT, "RTL_ALTITUDE", 100.0)
    # 1.2 m more than the required 130 m are kept: twice 131.2 m less 150 m is 112.4 m.  The grid cuts the top.
    assert end.wanted in (112.0, 113.0)
    assert (start.what, start.place) == ("height", Place("waypoint", 1, 2))
    assert 10.0 <= start.wanted <= 22.0
    assert f"set RTL_ALTITUDE to {end.wanted:g} m instead of 100 m" in finding.suggestion
    assert (
        f"raise waypoint 1 (item 2) by {start.wanted:.0f} m: move item 2 up by {start.wanted:.0f} m"
        in finding.suggestion
    )
    # It passes with the parameter, and with its margin; 1 m less has no such margin.
    for altitude, has_margin in ((end.wanted, True), (end.wanted - 1.0, False)):
        judged = judge_mission_geometry(low_return(rtl_altitude=altitude))
        margins = [other.margin for other in judged.findings if other.rule == "clearance" and other.place.to_item == 3]
        assert all(margin is not None and margin >= 1.2 for margin in margins) is has_margin
        assert not (has_margin and judged.failed)


def test_a_return_that_keeps_its_altitude_is_offered_a_higher_start_only() -> None:
    judged = judge_mission_geometry(low_return(125.0, -1.0))
    (finding,) = [finding for finding in judged.failed if finding.rule == "clearance" and finding.place.to_item == 3]
    assert [change.what for way in finding.suggestions for change in way] == ["height"]


def test_both_are_offered_where_neither_is_enough_and_not_where_one_is() -> None:
    end = Change("parameter", FLIGHT, 100.0, 120.0, "m", parameter="RTL_ALTITUDE")
    start = Change("height", Place("waypoint", 1, 2), None, 12.0, "m")
    finding = low(1, (end,), (end, start), (start,))
    alone = PassedTrial(finding, (replace(start, wanted=40.0),), SESSION.judged.setup)
    assert suggestion_trials._has_passing_part([alone], finding, (end, start))
    assert not suggestion_trials._has_passing_part([alone], finding, (start,))
    assert not suggestion_trials._has_passing_part([alone], low(1), (end, start))
