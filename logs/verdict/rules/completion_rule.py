"""The completion rule: judge whether a feasible plan was flown to its end and recorded completely."""

from collections.abc import Iterable, Sequence

import numpy as np

from flight.mission.items import Command
from flight.simulation.setup import FlightSetup, MissingItems
from logs.verdict.findings import Finding, finding_reason, make_finding, message
from logs.verdict.imported.flown_legs import FlownLegs, gaps_between, stretch_end_text
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.rule import Rule
from logs.verdict.tolerances import MAX_ROW_GAP_S, MAX_ROW_GAP_TICKS, MAX_VELOCITY_DISAGREEMENT_MPS
from logs.verdict.wording import place_text
from world.wording import count_text


def completion_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, end_reason: str, log_complete: bool
) -> list[Finding]:
    """Judge with one finding whether a feasible plan was flown to its last waypoint, with a complete log.

    end_reason: "completed", or the reason why the flight ended early.
    log_complete: True if the log is not cut off.
    """
    plan = requirements.setup.plan
    faults = []
    if plan is not None and plan.failures:
        faults.append(message("the plan is not feasible", f": {plan.failures[0]}"))
    if end_reason != "completed":
        ending_place = ""
        if aligned is not None and not aligned.passed[-1]:
            row = len(aligned.track) - 1
            ending_place = (
                f" on {place_text(requirements.leg_place(aligned.leg_at(row)))}, {aligned.position_text(row)}"
            )
        faults.append(message(f"the flight ended early: {end_reason}", ending_place))
    if not log_complete:
        faults.append(message("the log is damaged or unfinished"))
    flown_count, leg_numbers = 0, requirements.setup.route.leg_numbers
    leg_count = len(set(leg_numbers.tolist()))
    if aligned is None:
        faults.append(message("the track has fewer than two usable rows"))
    else:
        # A leg counts as flown only once its loiter is complete.
        flown_count = leg_count - len(set(leg_numbers[~aligned.passed[1:]].tolist()))
        if flown_count < leg_count:
            first_unflown = place_text(requirements.leg_place(int(np.argmin(aligned.passed[1:]))))
            unflown_text = f"; the first leg that was not flown to its end is {first_unflown}"
            faults.append(message(f"{flown_count} of {count_text(leg_count, 'leg')} flown", unflown_text))
        # A long gap between the log's rows, and positions that contradict the velocities, are faults, too.
        track = aligned.track
        steps = np.diff(track.time)
        gap = int(np.argmax(steps))
        if steps[gap] > max(MAX_ROW_GAP_S, MAX_ROW_GAP_TICKS * float(np.median(steps))):
            faults.append(message(f"the log has no rows from {track.time[gap]:.1f} s to {track.time[gap + 1]:.1f} s"))
        # Across missing rows the mean velocity is meaningless.
        is_short = steps <= MAX_ROW_GAP_S
        squares = np.zeros(int(is_short.sum()))
        for axis in range(3):
            mean_velocity = np.diff(track.position[:, axis])[is_short] / steps[is_short]
            recorded_velocity = track.velocity[:, axis].astype(np.float64)
            squares += (mean_velocity - 0.5 * (recorded_velocity[1:] + recorded_velocity[:-1])[is_short]) ** 2
        differences = np.sqrt(squares)
        if differences.size and differences.max() > MAX_VELOCITY_DISAGREEMENT_MPS:
            k = int(np.argmax(differences))
            faults.append(
                message(f"position and velocity contradict each other at {track.time[:-1][is_short][k]:.2f} s")
            )
    success_text = f"all {leg_count} legs flown" if leg_count > 1 else "the only leg flown"
    reason = finding_reason(faults) if faults else success_text
    return [
        make_finding(
            "completion",
            FLIGHT,
            ok=not faults,
            reason=reason,
            faults=faults,
            planned=leg_count,
            flown=flown_count,
            limit=leg_count,
            at_least=True,
            source="route",
            tolerance=0.0,
            margin=flown_count - leg_count,
            unit="legs",
            method="waypoints passed in order",
        )
    ]


# Name of the mode that flies a return to launch.
_RETURN_MODE = "RTL"


def imported_completion_finding(setup: FlightSetup, stretches: Sequence[FlownLegs], log_complete: bool) -> Finding:
    """Judge if an imported flight completed its mission.

    It is not judged if the log may lack a part of the flight.

    stretches: legs that were flown in each stretch of the log.
    log_complete: True if planfly's own log of the flight is not cut off.
    """
    last_leg, faults, unknown_texts, notes = setup.route.legs - 1, [], [], []
    flown_legs = {leg for legs in stretches for leg in range(legs.first, legs.last - legs.partial)}
    leg_count = len(set(setup.route.leg_numbers.tolist()))
    finished_count = leg_count - len(_leg_numbers(setup, set(range(setup.route.legs)) - flown_legs))
    missing_items = None if setup.imported_log is None else setup.imported_log.missing
    if not log_complete:
        faults.append(message("the log is damaged or unfinished"))
    if not stretches:
        followed_stretches = () if setup.imported_log is None else setup.imported_log.stretches
        reason = (
            "none of the mission's legs was flown"
            if followed_stretches
            else "no part of the flight followed the mission"
        )
        # The flight may have included legs that the log does not contain.
        if missing_items is not None and followed_stretches:
            unknown_texts.append(f"none of the legs in the log was flown; {_missing_items_text(missing_items)}")
        else:
            faults.append(message(reason))
    elif last_leg in flown_legs and missing_items is not None and missing_items.beyond:
        unknown_texts.append(
            f"{finished_count} of {count_text(leg_count, 'leg')} in the log flown, including"
            f" the last leg; {_missing_items_text(missing_items)}"
        )
    elif last_leg in flown_legs:
        last_leg_text = f"{finished_count} of {count_text(leg_count, 'leg')} flown, including the last leg"
        unflown_legs, doubt_texts = _unflown_legs(setup, stretches, flown_legs)
        if unflown_legs:
            unflown_text = f"{_legs_text(setup, unflown_legs)} not flown along the mission"
            faults.append(message(unflown_text, f"; {last_leg_text}"))
        unknown_texts += [f"{'; '.join(doubt_texts)}; {last_leg_text}"] if doubt_texts else []
        notes += [] if unflown_legs or doubt_texts else [last_leg_text]
    else:
        last_stretch = stretches[-1]
        legs_text = f"{finished_count} of {count_text(leg_count, 'leg')} flown"
        # The waypoint to which the aircraft was flying when the last part of the log ended.
        waypoint = min(setup.route.legs, last_stretch.last if last_stretch.partial else last_stretch.last + 1)
        item = int(setup.route.items[waypoint])
        waypoint_text = f"waypoint {setup.route.stops[waypoint]}" + (f" (item {item})" if item >= 0 else "")
        ending = f"{stretch_end_text(last_stretch.stretch)}, on the way to {waypoint_text}"
        commands = {mission_item.seq: mission_item.command for mission_item in setup.mission.items}
        is_return_next = commands.get(item) == Command.NAV_RETURN_TO_LAUNCH
        if is_return_next and last_stretch.stretch.next_mode == _RETURN_MODE:
            notes.append(f"{legs_text}, and the return at the mission's end began at {last_stretch.stretch.end:.1f} s")
        elif last_stretch.stretch.ended == "log":
            unknown_texts.append(f"{ending}; {legs_text}")
        else:
            faults.append(message(ending, f"; {legs_text}"))
    unknown_texts += [
        f"the path to item {stop.item} is not judged, because it is not laid out" for stop in setup.route.unjoined_stops
    ]
    notes += _gap_notes(stretches)
    return make_finding(
        "completion",
        FLIGHT,
        ok=False if faults else None if unknown_texts else True,
        reason=finding_reason(faults, [*unknown_texts, *notes]),
        faults=faults,
        planned=leg_count,
        flown=finished_count,
        limit=leg_count,
        at_least=True,
        source="route",
        tolerance=0.0,
        margin=finished_count - leg_count,
        unit="legs",
        method="waypoints passed in order, in the parts of the flight that followed the mission",
    )


def _unflown_legs(
    setup: FlightSetup, flown_stretches: Sequence[FlownLegs], flown_legs: set[int]
) -> tuple[list[int], list[str]]:
    """Return the legs that were certainly not flown, and texts on incomplete legs.

    The texts name legs that were not recorded or only partly flown.

    flown_legs: indices of the legs that were flown completely.
    """
    unflown_legs = [leg for leg in range(setup.route.legs) if leg not in flown_legs]
    begins_in_flight = setup.imported_log is not None and setup.imported_log.begins_in_flight
    unseen_legs = [leg for leg in unflown_legs if begins_in_flight and leg < flown_stretches[0].first]
    partly_flown_legs = [
        leg
        for leg in unflown_legs
        if leg not in unseen_legs
        and any(stretch_legs.partial and stretch_legs.last - 1 == leg for stretch_legs in flown_stretches)
    ]
    doubt_texts = []
    if unseen_legs:
        doubt_texts.append(f"the log begins in flight, and {_legs_text(setup, unseen_legs)} not recorded")
    doubt_texts += [f"{_legs_text(setup, partly_flown_legs)} flown only in part"] if partly_flown_legs else []
    return [leg for leg in unflown_legs if leg not in unseen_legs and leg not in partly_flown_legs], doubt_texts


def _gap_notes(flown_stretches: Sequence[FlownLegs]) -> list[str]:
    """Return one note on the gaps between the log's rows in the judged stretches, or [] without gaps."""
    gaps = [gap for legs in flown_stretches for gap in gaps_between(legs, legs.stretch.start, legs.stretch.end)]
    if not gaps:
        return []
    longest_gap = max(gaps, key=lambda gap: gap.end - gap.start)
    gap_time = sum(gap.end - gap.start for gap in gaps)
    return [
        f"the log has {count_text(len(gaps), 'gap')} with a total of {gap_time:.1f} s;"
        f" the longest is from {longest_gap.start:.1f} s to {longest_gap.end:.1f} s"
    ]


def _leg_numbers(setup: FlightSetup, legs: Iterable[int]) -> list[int]:
    """Return the leg numbers that messages show, sorted; all legs of a loiter share one number.

    legs: indices in the route.
    """
    return sorted({int(setup.route.leg_numbers[leg]) for leg in legs})


def _legs_text(setup: FlightSetup, legs: Iterable[int]) -> str:
    """Return leg numbers as subject and verb: "leg 3 is", "legs 3 to 10 are" or "8 legs from 1 to 12 are"."""
    numbers = _leg_numbers(setup, legs)
    first, last = numbers[0], numbers[-1]
    if first == last:
        return f"leg {first} is"
    is_unbroken = last - first + 1 == len(numbers)
    plural_text = f"legs {first} to {last}" if is_unbroken else f"{len(numbers)} legs from {first} to {last}"
    return f"{plural_text} are"


def _missing_items_text(missing: MissingItems) -> str:
    """State the number of mission items that are not in the log."""
    count = len(missing.numbers)
    return f"{count} {'item of the mission is' if count == 1 else 'items of the mission are'} not in the log"


RULE = Rule(
    name="completion",
    tolerances=(
        "MAX_VELOCITY_DISAGREEMENT_MPS",
        "MAX_ROW_GAP_TICKS",
        "MAX_ROW_GAP_S",
        "PARTIAL_LEG_MIN_S",
        "MIN_IN_ORDER_FRACTION",
        "MIN_NEAR_WAYPOINT_M",
        "MAX_NEAR_WAYPOINT_M",
        "PLAN_MISMATCH_DISTANCE_M",
    ),
    judge_end=completion_findings,
    judge_imported_end=imported_completion_finding,
)
