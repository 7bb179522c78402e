"""Judge the stretches of an imported flight that followed the mission, as far as its log permits.

The rules are the same as for planfly's own flights.  A log may lack data that a rule needs, have pauses, and end before
the flight.  Parts that the log does not show are not judged, and the reason is given; a violation that the log shows
counts in any case.
"""

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from math import isfinite

import numpy as np

from flight.simulation.setup import (
    Damage,
    DataKind,
    FlightSetup,
    ImportedLog,
    MissingItems,
    RowFaults,
    VerticalDatum,
)
from flight.simulation.track import Track
from logs.verdict.conditions import Conditions, autopilot_line, condition_lines, corridor_line, judging_conditions
from logs.verdict.findings import Finding, make_finding
from logs.verdict.imported.flown_legs import FlownLegs, flown_legs, gaps_between, stretch_end_text
from logs.verdict.places import FLIGHT, LevelAnswer, Place
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.rules.registry import RULES, run_rules
from logs.verdict.summary import headline, undecided_text
from logs.verdict.tolerances import MAX_UNSEEN_TIME_S
from logs.verdict.verdict import Verdict
from world.wording import count_text

# ----------------------------------------------------------------------
# The lines of a verdict on an imported flight: the answer, what was judged and what was not, and facts about the log.

_DATUM_TEXTS: dict[VerticalDatum, str] = {
    "amsl": "above mean sea level, according to the log",
    "ellipsoid": "above the WGS 84 ellipsoid",
    "pressure": "by pressure, above the 1013.25 hPa level",
    "unstated": "above a datum that the log does not state",
}
# Largest number of clock jumps whose times are listed.
_MAX_LISTED_JUMPS = 4


def imported_summary_lines(
    findings: Sequence[Finding],
    setup: FlightSetup,
    own_answer: LevelAnswer,
    flown_stretches: Sequence[FlownLegs],
    conditions: Conditions,
) -> tuple[str, ...]:
    """Return the lines of the summary on an imported flight, the headline first.

    For a flight that was not imported, the headline is the only line.

    own_answer: answer of the verdict at the level "flown", with the headline.
    flown_stretches: legs flown in each judged stretch of the log.
    """
    imported_log = setup.imported_log
    if imported_log is None:
        return (own_answer.headline,)
    lines = [own_answer.headline, *condition_lines(conditions)]
    # A date before 1970 or after 2099 (4.1e9 s) shows that the log's clock was not set.
    start_time_text = (
        ""
        if not isfinite(imported_log.utc_start) or not 0.0 <= imported_log.utc_start < 4.1e9
        else f", time 0 s is {datetime.fromtimestamp(imported_log.utc_start, UTC):%Y-%m-%d %H:%M:%S} UTC"
    )
    log_text = f"{imported_log.format} {imported_log.file}{start_time_text}"
    lines.append(f"{autopilot_line(conditions, is_flown=True)} ({log_text})")
    # One line for each rule that has unjudged findings: their number, unless none was judged, and the first reason.
    unjudged_lines = []
    for rule in RULE_WORDS.values():
        rule_findings = [finding for finding in findings if finding.rule == rule.name]
        unjudged = [finding for finding in rule_findings if finding.ok is None]
        if not unjudged:
            continue
        count_text = "" if len(unjudged) == len(rule_findings) else f" on {len(unjudged)} of {len(rule_findings)}"
        unjudged_lines.append(f"Not judged: {rule.title}{count_text} ({unjudged[0].brief})")
    # One line for each stretch, with its time and the numbers of its judged legs.
    if not imported_log.stretches:
        lines.append("Judged: nothing, because no part of the flight followed the mission")
    legs_by_start = {legs.stretch.start: legs for legs in flown_stretches}
    for stretch in imported_log.stretches:
        name = f"the flight in {stretch.mode}" if stretch.mode else "the flight"
        time_text = f"{name} from {stretch.start:.1f} s to {stretch.end:.1f} s"
        time_text += "" if stretch.mode else " (the log contains no modes)"
        legs = legs_by_start.get(stretch.start)
        if legs is None:
            lines.append(f"Not judged: {time_text}, because this part did not pass two waypoints in order")
            continue
        first, last = setup.route.leg_numbers[[legs.first, legs.last - 1]].tolist()
        partial_text = f", leg {last} in part" if legs.partial else ""
        start_time = float(legs.aligned.track.time[0])
        lines.append(
            f"Judged: {time_text}, on legs {first} to {last}{partial_text}; leg {first} begins at {start_time:.1f} s"
        )
    lines += unjudged_lines
    lines += [line] if (line := corridor_line(setup, findings)) else []
    if imported_log.mission:
        lines.append(f"Mission: {imported_log.mission}")
    lines.append(f"Heights: {altitude_source_text(imported_log)}")
    wind = setup.scenario.wind
    if imported_log.wind:
        lines.append(f"Wind: {wind.speed:.1f} m/s on average, {imported_log.wind}")
    lines.append(f"Rows: {row_faults_text(imported_log.faults, len(imported_log.gaps))}")
    if imported_log.damage.lossy or imported_log.damage.cut:
        lines.append(f"Lost: {damage_text(imported_log.damage)}")
    lines += [f"Note: {note}" for note in imported_log.notes]
    lines += [f"Not flown as written: {note}" for note in setup.route.notes]
    return tuple(lines)


def altitude_source_text(imported_log: ImportedLog) -> str:
    """Describe source and datum of a log's altitudes, and the log's other altitudes at the start.

    >>> from flight.simulation.setup import HeightOffset, Heights
    >>> heights = Heights("POS", "amsl", (HeightOffset("GPS.Alt", -0.1),))
    >>> altitude_source_text(ImportedLog("a.BIN", "", "", heights=heights))
    'from POS, above mean sea level, according to the log; other heights differ at the start: GPS.Alt by -0.1 m'
    """
    offsets = ", ".join(f"{height.name} by {height.offset:+.1f} m" for height in imported_log.heights.offsets)
    offset_text = f"; other heights differ at the start: {offsets}" if offsets else ""
    return f"from {imported_log.heights.source}, {_DATUM_TEXTS[imported_log.heights.datum]}{offset_text}"


def row_faults_text(faults: RowFaults, gaps: int) -> str:
    """State how many gaps a log has, and how many faulty rows of each kind, such as duplicates.

    gaps: number of pauses between the rows.
    >>> row_faults_text(RowFaults(doubled=2, clock_jumps=(12.5,)), 1)
    '1 gap, 2 duplicates, 1 clock jump (at 12.5 s)'
    >>> row_faults_text(RowFaults(), 0)
    'in order, without gaps'
    """
    counts = (
        (gaps, "gap" if gaps == 1 else "gaps"),
        (faults.doubled, "duplicate" if faults.doubled == 1 else "duplicates"),
        (faults.unordered, "out of order"),
        (faults.unusable, "without a position or a time"),
        (faults.glitches, "position glitch" if faults.glitches == 1 else "position glitches"),
    )
    texts = [f"{count} {name}" for count, name in counts if count]
    if faults.clock_jumps:
        count = len(faults.clock_jumps)
        times = ", ".join(f"{time:.1f} s" for time in faults.clock_jumps[:_MAX_LISTED_JUMPS])
        texts.append(f"{count} clock {'jump' if count == 1 else 'jumps'} (at {times})")
    return ", ".join(texts) or "in order, without gaps"


# Largest number of ranges of consecutive items that a line lists.
_MAX_LISTED_RANGES = 6


def missing_items_text(missing: MissingItems) -> str:
    """Describe which part of a mission is not judged, and which items the log lacks.

    >>> missing_items_text(MissingItems(tuple(range(7, 14)), total=14, first=1, last=6, end=13))
    'not judged beyond item 6: items 7 to 13 of 14 are ignored or not in the log'
    >>> missing_items_text(MissingItems((1, 5), total=0, first=2, last=4, end=9))
    'not judged before item 2 and beyond item 4: items 1 and 5 are ignored or not in the log'
    >>> missing_items_text(MissingItems((1, 2, 3), total=4, first=0, last=0, end=3))
    'not judged: items 1 to 3 of 4 are ignored or not in the log'
    """
    ranges: list[list[int]] = []
    for number in missing.numbers:
        if ranges and number == ranges[-1][-1] + 1:
            ranges[-1] = [ranges[-1][0], number]
        else:
            ranges.append([number])
    listed_ranges = ranges[:_MAX_LISTED_RANGES]
    range_texts = [" to ".join(map(str, item_range)) for item_range in listed_ranges]
    if len(ranges) > _MAX_LISTED_RANGES:
        listed_count = sum(item_range[-1] - item_range[0] + 1 for item_range in listed_ranges)
        range_texts.append(f"{len(missing.numbers) - listed_count} more")
    numbers_text = " and ".join(filter(None, [", ".join(range_texts[:-1]), range_texts[-1]]))
    before_text = f"before item {missing.first}" if missing.first > 1 else ""
    after_text = f"beyond item {missing.last}" if missing.last and missing.beyond else ""
    unjudged_text = " and ".join(filter(None, [before_text, after_text]))
    is_several = len(missing.numbers) > 1
    total_text = f" of {missing.total}" if missing.total else ""
    items_text = (
        f"{('items' if is_several else 'item')} {numbers_text}{total_text} "
        f"{('are' if is_several else 'is')} ignored or not in the log"
    )
    return f"not judged{' ' if unjudged_text else ''}{unjudged_text}: {items_text}"


def damage_text(damage: Damage) -> str:
    """Describe the parts of a file that could not be read; return "nothing" for an undamaged file.

    >>> damage_text(Damage(places=2, size=40, cut=True))
    '2 places in the file (40 bytes) cannot be read; the file ends within a message'
    """
    texts = []
    if damage.places:
        size_text = f" ({damage.size:,} bytes)" if damage.size else ""
        texts.append(
            f"{damage.places} {'place' if damage.places == 1 else 'places'} in the file{size_text} cannot be read"
        )
    if damage.unreadable:
        verb = "contains" if damage.unreadable == 1 else "contain"
        texts.append(f"{count_text(damage.unreadable, 'message')} {verb} no usable data")
    if damage.cut:
        texts.append("the file ends within a message")
    return "; ".join(texts) or "nothing"


# Name of each quantity in a message about a log without it.
_QUANTITY_LABELS: dict[DataKind, str] = {
    "heights": "height",
    "airspeed": "airspeed",
    "attitude": "attitude",
    "battery": "battery current and voltage",
    "wind": "wind",
    "throttle": "throttle",
    "velocity": "velocity",
}
# Column of the track with the values of each quantity.
_TRACK_COLUMNS: dict[DataKind, str] = {"airspeed": "airspeed", "attitude": "attitude", "battery": "energy"}
_DATUM_REASONS = {
    "ellipsoid": "the log's heights are above the ellipsoid, but the plan's heights are above mean sea level",
    "pressure": "the log's heights are pressure altitudes, above the 1013.25 hPa level",
    "unstated": "the log does not state the datum of its heights; name it with --datum",
}
_UNNAMED_TEXT = "no aircraft was named; name it with --aircraft"


def judge_imported_flight(setup: FlightSetup, track: Track, *, log_complete: bool) -> Verdict:
    """Judge the stretches of an imported flight that followed its mission, at the level "flown".

    Raises ValueError for a flight that was not imported.

    setup: flight setup with the source of the flight.
    log_complete: True if planfly's own log of the flight has its end.
    """
    imported_log = setup.imported_log
    if imported_log is None:
        raise ValueError("setup.imported_log is missing: only imported flights can be judged here")
    flown_stretches = [
        legs for stretch in imported_log.stretches if (legs := flown_legs(setup, track, stretch)) is not None
    ]
    # Among the findings of all stretches for a rule, place and check, a failure replaces a pass, and a pass an unjudged
    # finding.
    merged: dict[tuple[str, Place, str], Finding] = {}
    for finding in (finding for legs in flown_stretches for finding in _judge_stretch(setup, legs)):
        key = (finding.rule, finding.place, finding.check)
        if key not in merged or _merge_precedence(finding) > _merge_precedence(merged[key]):
            merged[key] = finding
    rules = dict.fromkeys(finding.rule for finding in merged.values())
    end_judges = [rule.judge_imported_end for rule in RULES.values() if rule.judge_imported_end is not None]
    findings = (
        *(finding for rule in rules for finding in merged.values() if finding.rule == rule),
        *(judge(setup, flown_stretches, log_complete) for judge in end_judges),
    )
    has_failed = any(finding.ok is False for finding in findings)
    unjudged_texts = []
    unended = [finding.reason for finding in findings if finding.rule == "completion" and finding.ok is None]
    if imported_log.missing is not None:
        unjudged_texts.append(missing_items_text(imported_log.missing))
    elif unended:
        unjudged_texts.append(f"not judged from end to end: {unended[0]}")
    pauses = []
    for legs in flown_stretches:
        time = legs.aligned.track.time
        pauses += [(float(time[k]), float(time[k + 1])) for k in np.flatnonzero(np.diff(time) > MAX_UNSEEN_TIME_S)]
    if pauses:
        start, end = max(pauses, key=lambda pause: pause[1] - pause[0])
        others_text = f", and in {count_text(len(pauses) - 1, 'more pause')}" if len(pauses) > 1 else ""
        pause_text = f"not judged from {start:.1f} s to {end:.1f} s{others_text}"
        unjudged_texts.append(f"{pause_text}, because the log has no rows there")
    if undecided := undecided_text(findings):
        unjudged_texts.append(f"not judged in full: {undecided}")
    unjudged_text = "; ".join(unjudged_texts)
    flyable = bool(flown_stretches) and not has_failed and not unjudged_text
    complete = not unjudged_text and all(finding.ok is True for finding in findings if finding.rule == "completion")
    answer_texts = (
        [headline(findings, flyable).replace("flyable", "flown as planned", 1)]
        if has_failed or not unjudged_text
        else []
    )
    answer_text = "; ".join([*answer_texts, *filter(None, [unjudged_text])])
    own_answer = LevelAnswer(
        setup.autopilot.answer_name, flyable, answer_text, undecided=bool(unjudged_text) and not has_failed
    )
    conditions = judging_conditions(setup)
    lines = imported_summary_lines(findings, setup, own_answer, flown_stretches, conditions)
    return Verdict(
        findings,
        flyable,
        complete,
        lines,
        "flown",
        levels=(own_answer,),
        notes=setup.route.notes,
        leg_ends=_leg_end_times(setup, flown_stretches),
        parameters=setup.autopilot.parameters,
        unjudged=unjudged_text,
        imported=True,
        conditions=conditions,
    )


def _judge_stretch(setup: FlightSetup, legs: FlownLegs) -> list[Finding]:
    """Judge one stretch of the log; the findings number legs and waypoints as in the whole route.

    legs: legs that were flown in the stretch.
    """
    findings = []
    for finding in run_rules(legs.requirements, legs.aligned):
        place, index, log_needs = finding.place, finding.place.index, RULES[finding.rule].log
        checked = _mark_unjudged_without_data(setup, legs, finding)
        # Not judged, although passed: a leg with a gap in the log, and a waypoint, for rules that need its rows.
        is_leg, is_waypoint = place.kind == "leg", place.kind == "waypoint"
        if checked.ok is True and index is not None and (is_leg or (is_waypoint and log_needs.needs_no_gap)):
            time, rows = legs.aligned.track.time, legs.aligned.rows
            first, last = index if is_leg else max(0, index - 1), min(len(rows) - 1, index + 1)
            gaps = gaps_between(legs, float(time[rows[first]]), float(time[rows[last]]))
            if gaps:
                reason = f"the log has no rows from {gaps[0].start:.1f} s to {gaps[0].end:.1f} s"
                checked = _mark_unjudged(checked, reason, keep_measurements=True)
        # Not judged: the last waypoint of a stretch that does not reach it, and the leg to this waypoint, for rules
        # that need the whole leg, unless it failed.
        is_last_leg = is_leg and index == legs.requirements.legs - 1
        if legs.partial and is_waypoint and index == legs.requirements.legs:
            checked = _mark_unjudged(checked, stretch_end_text(legs.stretch))
        elif legs.partial and is_last_leg and log_needs.needs_full_leg and checked.ok is not False:
            checked = _mark_unjudged(checked, f"flown in part: {stretch_end_text(legs.stretch)}")
        if legs.first and index is not None and (is_leg or is_waypoint):
            checked = replace(checked, place=replace(place, index=index + legs.first))
        findings.append(checked)
    # An unjudged finding for each rule for which the log lacks the data, unless `LogNeeds.reports_missing` is False.
    judged_rules = {finding.rule for finding in findings}
    findings_without_data = []
    for rule in RULES.values():
        missing_quantities = [
            quantity
            for quantity in rule.log.quantities
            if setup.imported_log is not None and quantity not in setup.imported_log.holds
        ]
        margin = RULE_WORDS[rule.name].margin
        if rule.log.reports_missing and margin is not None and missing_quantities and rule.name not in judged_rules:
            reason = f"the log contains no {_QUANTITY_LABELS[missing_quantities[0]]}"
            findings_without_data.append(
                make_finding(rule.name, FLIGHT, ok=None, reason=reason, source="aircraft", unit=margin.unit)
            )
    return [*findings, *findings_without_data]


def _mark_unjudged_without_data(setup: FlightSetup, legs: FlownLegs, finding: Finding) -> Finding:
    """Mark a finding as not judged if its rule needs data that the log lacks, or a known aircraft.

    A finding that can be judged is returned unchanged.
    """
    imported_log = setup.imported_log
    if imported_log is None:
        return finding
    reason, log_needs = "", RULES[finding.rule].log
    for quantity in log_needs.quantities:
        if quantity not in imported_log.holds:
            reason = f"the log contains no {_QUANTITY_LABELS[quantity]}"
            break
        if quantity == "heights":
            has_plan_heights = imported_log.plan_heights or not log_needs.needs_planned_heights
            reason = (
                _DATUM_REASONS.get(imported_log.heights.datum, "") if has_plan_heights else "the plan states no heights"
            )
        else:
            track = legs.aligned.track
            values = getattr(track, _TRACK_COLUMNS[quantity])
            is_missing = ~np.isfinite(values.reshape(len(values), -1)).all(axis=1)
            if is_missing.any():
                time, rows_text = track.time[is_missing], count_text(int(is_missing.sum()), "row")
                reason = (
                    f"the log contains no {_QUANTITY_LABELS[quantity]} at {rows_text} from {time[0]:.1f} s to"
                    f" {time[-1]:.1f} s"
                )
        if reason:
            break
    if reason:
        return _mark_unjudged(finding, reason)
    if not imported_log.aircraft_known and log_needs.needs_aircraft and finding.limit_source != "scenario":
        return _mark_unjudged(finding, _UNNAMED_TEXT, keep_measurements=bool(finding.ok))
    return finding


def _mark_unjudged(finding: Finding, cause: str, *, keep_measurements: bool = False) -> Finding:
    """Return a copy of a finding that is marked as not judged, with `cause` as its reason.

    keep_measurements: True to keep the finding's reason and facts.
    """
    reason = f"{cause}; {finding.reason}" if keep_measurements else cause
    facts = finding.facts if keep_measurements else ()
    return replace(finding, ok=None, reason=reason, brief=cause, placed=False, margin=None, facts=facts, suggestions=())


def _merge_precedence(finding: Finding) -> int:
    """Return a finding's precedence in a merge: 2 if failed, 1 if passed, 0 if unjudged."""
    return {False: 2, True: 1, None: 0}[finding.ok]


def _leg_end_times(setup: FlightSetup, flown_stretches: Sequence[FlownLegs]) -> tuple[float, ...]:
    """Return the end time, s, of each leg of the whole route except the last; inf if it was not reached.

    The times never decrease.
    """
    end_times = np.full(len(setup.route.points), np.inf)
    for legs in flown_stretches:
        times = legs.aligned.track.time[legs.aligned.rows]
        end_waypoint = legs.last if legs.partial else legs.last + 1
        end_times[legs.first : end_waypoint] = np.minimum(
            end_times[legs.first : end_waypoint], times[: end_waypoint - legs.first]
        )
    if flown_stretches:
        # The aircraft was past all waypoints before the first identified one.
        end_times[: flown_stretches[0].first] = end_times[flown_stretches[0].first]
    sorted_ends = np.maximum.accumulate(end_times)
    return tuple(sorted_ends[1:-1].tolist())
