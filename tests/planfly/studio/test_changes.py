"""What has changed since the last flight: by legs and items, with figures, over insertions and deletions."""

import re
from dataclasses import replace

import numpy as np

from flight.mission import edits
from flight.mission.items import Command, Frame
from logs.verdict.findings import Finding, make_finding, message
from logs.verdict.places import FLIGHT, Place
from planfly.studio import messages
from planfly.studio.changes import FlightResults, describe_changes, flight_results
from planfly.studio.session import Session
from tests.planfly.studio.drafts import drawn_session, session_of


def figures_of(session: Session, seconds: float = 100.0) -> FlightResults:
    """Of the geometric verdict, whose findings are made as those of a flight are."""
    judged = session.judged
    return flight_results(judged.mission, judged.setup.route, judged.verdict.findings, seconds)


def test_a_height_that_fails_and_is_mended_is_said_with_its_leg_and_figures() -> None:
    session = drawn_session(5, 12)
    before = figures_of(session)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=-90.0))
    low = figures_of(session, 103.0)
    said = describe_changes(before, low)
    words = re.compile(r"(leg to item \d+): clearance, height above ground ([\d.]+) m \u2192 ([-\d.]+) m, fails now")
    place, was, now = next(found.groups() for line in said if (found := words.fullmatch(line)))
    assert float(was) > 60.0 > float(now)
    assert said[-1] == "3 s longer"
    session.step_history("undo")
    assert f"{place}: clearance, height above ground {now} m \u2192 {was} m, now passes" in describe_changes(
        low, figures_of(session)
    )
    assert describe_changes(before, figures_of(session)) == ["nothing"]


def test_items_that_have_other_numbers_are_the_same() -> None:
    """Before all but the first leg a waypoint is inserted: all numbers are others, and nothing else has changed."""
    session = drawn_session(8, 8)
    before = figures_of(session)
    own = edits.movable_indices(session.mission)
    (east, north, _), (far, further, _) = session.item_position(own[0]), session.item_position(own[1])
    assert [one.place for one in before.results.values() if one.ok is False] == [
        "item 6",
        "leg to item 2",
        "leg to item 3",
        "item 8",
    ]
    middle = {"east": 0.5 * (east + far), "north": 0.5 * (north + further)}
    session.edit(messages.Insert(kind="insert", rev=session.rev, after=own[0], **middle))
    inserted = figures_of(session)
    # The leg to the inserted item follows ground that falls more steeply than its limit, which is no failure.
    assert [re.sub(r"-[\d.]+", "-", line) for line in describe_changes(before, inserted)] == [
        "leg to item 3: slope -\u00b0, fails now",
        "the former leg to item 2: slope -\u00b0, is gone",
    ]
    session.edit(messages.Delete(kind="delete", rev=session.rev, ks=[edits.movable_indices(session.mission)[1]]))
    assert [re.sub(r"-[\d.]+", "-", line) for line in describe_changes(inserted, figures_of(session))] == [
        "leg to item 2: slope -\u00b0, fails now",
        "the former leg to item 3: slope -\u00b0, is gone",
    ]


def test_without_a_failure_the_closest_figures_are_said() -> None:
    session = drawn_session(5, 12)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=150.0))
    before = figures_of(session)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=5.0))
    said = describe_changes(before, figures_of(session))
    assert any(line.startswith("closest to its limit: clearance") for line in said), said


def clearance(leg: int, planned: float, flown: float | None = None) -> Finding:
    ok = None if flown is None else flown >= 30.0
    margin = None if flown is None else flown - 30.0
    return make_finding(
        "clearance", Place("leg", leg), ok=ok, reason="", planned=planned, flown=flown, margin=margin, unit="m"
    )


def approach(waypoint: int, planned: float, flown: float | None = None) -> Finding:
    """Of a waypoint that counts as reached within 5 m."""
    ok = None if flown is None else flown <= 5.0
    return make_finding(
        "waypoint", Place("waypoint", waypoint), ok=ok, reason="", planned=planned, flown=flown, unit="m"
    )


def test_a_place_is_compared_by_its_flown_laps_and_never_with_one_that_was_not_flown() -> None:
    """The first flight ends on the hill before item 2, the second one only in the second lap."""
    drawn = drawn_session(5, 12, jumps=False).mission
    places = [item for item in drawn.items if item.command == Command.NAV_WAYPOINT][:3]
    items = [replace(item, seq=k) for k, item in enumerate(places, 1)]
    jump = replace(items[0], seq=4, command=int(Command.DO_JUMP), frame=int(Frame.MISSION), params=(2.0, 1.0, 0.0, 0.0))
    mission = replace(drawn, items=(*items, jump))
    route = session_of(mission).judged.setup.route
    (first_to_2, second_to_2), last = np.flatnonzero(route.items[1:] == 2).tolist(), route.legs
    hill = [clearance(first_to_2, 41.0, -0.3), clearance(second_to_2, 41.5)]
    hill += [approach(first_to_2 + 1, 0.07, 937.0), approach(second_to_2 + 1, 0.07), approach(last, 0.08)]
    later = [clearance(first_to_2, 41.0, 40.0), clearance(second_to_2, 41.5)]
    later += [approach(first_to_2 + 1, 0.07, 2.75), approach(second_to_2 + 1, 0.07), approach(last, 0.08, 2200.0)]
    before, after = (flight_results(mission, route, findings, 100.0) for findings in (hill, later))
    assert describe_changes(before, after) == [
        "item 3: waypoint, closest approach 2200 m, fails now, not flown before",
        "leg to item 2: clearance, height above ground -0.3 m \u2192 40 m, now passes",
        "item 2: waypoint, closest approach 937 m \u2192 2.75 m, now passes",
    ]
    assert describe_changes(after, before)[-1] == "item 3: waypoint, closest approach 2200 m, not flown now"


def bank(largest: float, contact: str = "") -> Finding:
    """The flight's bank, of 60 degrees at most, and where it met the ground."""
    faults = [message(contact, " on leg 2")] if contact else []
    return make_finding(
        "departure",
        FLIGHT,
        ok=not faults,
        reason="",
        faults=faults,
        flown=largest,
        limit=60.0,
        tolerance=0.0,
        margin=60.0 - largest,
        unit="deg",
    )


def test_a_value_that_is_within_its_limit_is_not_named_for_a_failure_of_another_cause() -> None:
    session = drawn_session(5, 12)
    mission, route = session.mission, session.judged.setup.route
    lost, flew, turned = (
        flight_results(mission, route, [one], 100.0)
        for one in (bank(26.6, "ground contact at 484.3 s"), bank(40.4), bank(75.0, "bank 75\u00b0 at 9.0 s"))
    )
    ground = "flight: loss of control (ground contact at 484.3 s)"
    assert describe_changes(lost, flew) == [f"{ground}, now passes"]
    assert describe_changes(flew, lost) == [f"{ground}, fails now"]
    assert describe_changes(flew, turned) == [
        "flight: loss of control, largest bank 40.4\u00b0 \u2192 75\u00b0, fails now"
    ]
    assert describe_changes(flew, flight_results(mission, route, [bank(45.0)], 100.0)) == [
        "closest to its limit: loss of control, largest bank 40.4\u00b0 \u2192 45\u00b0 (flight)"
    ]


def slope(planned: float, flown: float, *, ok: bool | None) -> Finding:
    """A descent of at most 3.92 degrees; the plan decides if it is steeper, and otherwise the flight."""
    decisive = planned if planned < -3.92 else flown
    return make_finding(
        "slope",
        Place("leg", 1),
        ok=ok,
        reason="",
        faults=[message("descends")] if ok is False else [],
        planned=planned,
        flown=flown,
        limit=-3.92,
        at_least=True,
        tolerance=0.01,
        margin=decisive + 3.92,
        unit="deg",
    )


def test_a_failure_of_the_plan_is_shown_by_planned_values() -> None:
    """The flown descent becomes gentler, from 4.02 to 3.96 degrees, while the planned one becomes too steep."""
    session = drawn_session(5, 12)
    mission, route = session.mission, session.judged.setup.route
    undecided, steep = (
        flight_results(mission, route, [one], 100.0)
        for one in (slope(-3.90, -4.02, ok=None), slope(-4.10, -3.96, ok=False))
    )
    values = "-3.9\u00b0 \u2192 -4.1\u00b0"
    assert describe_changes(undecided, steep) == [f"leg to item 4: slope planned {values}, fails now"]
    back = "-4.1\u00b0 \u2192 -3.9\u00b0"
    assert describe_changes(steep, undecided) == [f"leg to item 4: slope planned {back}, is not judged now"]
