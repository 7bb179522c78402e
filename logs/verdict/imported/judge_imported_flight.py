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
    FlightSetup,
    ImportedLog,
    MissingItems,
    Quantity,
    RowFaults,
    VerticalDatum,
)
from flight.simulation.track import Track
from logs.verdict.conditions import Conditions, autopilot_line, condition_lines, corridor_line, setup_conditions
from logs.verdict.findings import Finding, make_finding
from logs.verdict.imported.flown_legs import FlownLegs, flown_legs, gaps_between, stretch_end_text
from logs.verdict.judge_geometry import track_findings
from logs.verdict.places import FLIGHT, LevelAnswer, Place
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.rules.registry import RULES
from logs.verdict.summary import headline, undecided_text
from logs.verdict.tolerances import MAX_UNSEEN_TIME_S
from logs.verdict.verdict import Verdict

# ----------------------------------------------------------------------
# The lines of a verdict on an imported flight: the answer, what was judged and what was not, and facts about the log.

_DATUM_TEXTS: dict[VerticalDatum, str] = {
    "amsl": "above mean sea level, as the log has it",
    "ellipsoid": "above the WGS 84 ellipsoid",
    "pressure": "by pressure, above the level of 1013.25 hPa",
    "unstated": "above what the log does not say",
}
# Largest number of clock jumps whose times are listed.
_MAX_LISTED_JUMPS = 4


def imported_lines(
    findings: Sequence[Finding],
    setup: FlightSetup,
    own: LevelAnswer,
    flown: Sequence[FlownLegs],
    conditions: Conditions,
) -> tuple[str, ...]:
    """Return the lines of the summary, the headline first."""
    source = setup.source
    if source is None:
        return (own.headline,)
    lines = [own.headline, *condition_lines(conditions)]
    lines.append(f"{autopilot_line(conditions, flown=True)} ({source.format} {source.file}{_start_time_text(source)})")
    lines += [*_judged_lines(source, flown, setup.route.leg_numbers.tolist()), *_unjudged_lines(findings)]
    lines += [line] if (line := corridor_line(setup)) else []
    if source.mission:
        lines.append(f"Mission: {source.mission}")
    lines.append(f"Heights: {heights_text(source)}")
    wind = setup.scenario.wind
    if source.wind:
        lines.append(f"Wind: {wind.speed:.1f} m/s on average, {source.wind}")
    lines.append(f"Rows: {rows_text(source.faults, len(source.gaps))}")
    if source.damage.lossy or source.damage.cut:
        lines.append(f"Lost: {damage_text(source.damage)}")
    lines += [f"Note: {note}" for note in source.notes]
    if setup.route.notes:
        lines.append(f"Not flown as written: {'; '.join(setup.route.notes)}")
    return tuple(lines)


def _judged_lines(source: ImportedLog, flown: Sequence[FlownLegs], numbers: Sequence[int]) -> list[str]:
    """Return a line for each stretch that is judged, with its time and the numbers of its legs.

    numbers: number of each leg of the route, as in `flight.mission.route.Route.leg_numbers`.
    """
    if not source.stretches:
        return ["Judged: nothing, as no stretch of the flight followed the mission"]
    by_start = {legs.stretch.start: legs for legs in flown}
    lines = []
    for stretch in source.stretches:
        name = stretch.mode or "the flight (the log knows no modes)"
        times = f"{name} from {stretch.start:.1f} s to {stretch.end:.1f} s"
        legs = by_start.get(stretch.start)
        if legs is None:
            lines.append(f"Judged: nothing of {times}: it passed no two waypoints in order")
            continue
        first, last = numbers[legs.first], numbers[legs.last - 1]
        part = f", leg {last} in part" if legs.partial else ""
        begins = float(legs.aligned.track.time[0])
        lines.append(f"Judged: {times}, legs {first} to {last}{part}, from {begins:.1f} s on")
    return lines


def _unjudged_lines(findings: Sequence[Finding]) -> list[str]:
    """Return a line for each rule that was not judged, with the reason and, if partial, the numbers."""
    lines = []
    for rule in RULE_WORDS.values():
        rule_findings = [item for item in findings if item.rule == rule.name]
        unjudged = [item for item in rule_findings if item.ok is None]
        if not unjudged:
            continue
        where = "" if len(unjudged) == len(rule_findings) else f" on {len(unjudged)} of {len(rule_findings)}"
        lines.append(f"Not judged: {rule.title}{where} ({unjudged[0].brief})")
    return lines


def heights_text(source: ImportedLog) -> str:
    """Describe which height was used, its datum, and the offsets of the other heights at the start.

    >>> from flight.simulation.setup import HeightOffset, Heights
    >>> heights_text(ImportedLog("a.BIN", "", "", heights=Heights("POS", "amsl", (HeightOffset("GPS.Alt", -0.1),))))
    'POS, above mean sea level, as the log has it; at the start GPS.Alt -0.1 m of it'
    """
    offsets = ", ".join(f"{one.name} {one.offset:+.1f} m" for one in source.heights.offsets)
    offset_text = f"; at the start {offsets} of it" if offsets else ""
    return f"{source.heights.source}, {_DATUM_TEXTS[source.heights.datum]}{offset_text}"


def rows_text(faults: RowFaults, gaps: int) -> str:
    """Describe the faults of a log's rows.

    >>> rows_text(RowFaults(doubled=2, clock_jumps=(12.5,)), 1)
    '1 gap, 2 doubled, 1 jump of the clock (at 12.5 s)'
    >>> rows_text(RowFaults(), 0)
    'in order, without gaps'
    """
    counted = (
        (gaps, "gap" if gaps == 1 else "gaps"),
        (faults.doubled, "doubled"),
        (faults.unordered, "out of order"),
        (faults.unusable, "without a place or a time"),
        (faults.glitches, "position glitches"),
    )
    words = [f"{count} {name}" for count, name in counted if count]
    if faults.clock_jumps:
        count = len(faults.clock_jumps)
        times = ", ".join(f"{time:.1f} s" for time in faults.clock_jumps[:_MAX_LISTED_JUMPS])
        words.append(f"{count} {'jump' if count == 1 else 'jumps'} of the clock (at {times})")
    return ", ".join(words) or "in order, without gaps"


# Largest number of runs of items that a line lists.
_MAX_RUNS = 6


def missing_text(missing: MissingItems) -> str:
    """Describe which part of a mission is not judged, and which of its items the log lacks.

    >>> missing_text(MissingItems(tuple(range(7, 14)), total=14, first=1, last=6, end=13))
    'not judged beyond item 6: items 7 to 13 of 14 are not in the log or left out'
    >>> missing_text(MissingItems((1, 5), total=0, first=2, last=4, end=9))
    'not judged before item 2 and beyond item 4: items 1 and 5 are not in the log or left out'
    >>> missing_text(MissingItems((1, 2, 3), total=4, first=0, last=0, end=3))
    'not judged: items 1 to 3 of 4 are not in the log or left out'
    """
    runs: list[list[int]] = []
    for number in missing.numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1] = [runs[-1][0], number]
        else:
            runs.append([number])
    words = [" to ".join(map(str, run)) for run in runs[:_MAX_RUNS]]
    if len(runs) > _MAX_RUNS:
        words.append(f"{len(missing.numbers) - sum(run[-1] - run[0] + 1 for run in runs[:_MAX_RUNS])} more")
    listed = " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
    before = f"before item {missing.first}" if missing.first > 1 else ""
    beyond = f"beyond item {missing.last}" if missing.last and missing.beyond else ""
    where = " and ".join(filter(None, [before, beyond]))
    several = len(missing.numbers) > 1
    of = f" of {missing.total}" if missing.total else ""
    items = f"{'items' if several else 'item'} {listed}{of} {'are' if several else 'is'} not in the log or left out"
    return f"not judged{' ' if where else ''}{where}: {items}"


def damage_text(damage: Damage) -> str:
    """Describe which parts of a file could not be read.

    >>> damage_text(Damage(places=2, size=40, cut=True))
    '2 places in the file (40 bytes) cannot be read; it ends within a message'
    """
    words = []
    if damage.places:
        size = f" ({damage.size:,} bytes)" if damage.size else ""
        words.append(f"{damage.places} {'place' if damage.places == 1 else 'places'} in the file{size} cannot be read")
    if damage.unreadable:
        words.append(f"{damage.unreadable} messages hold nothing that can be used")
    if damage.cut:
        words.append("it ends within a message")
    return "; ".join(words) or "nothing"


def _start_time_text(source: ImportedLog) -> str:
    if not isfinite(source.utc_start) or not 0.0 <= source.utc_start < 4.1e9:
        return ""
    return f", its time 0 is {datetime.fromtimestamp(source.utc_start, UTC):%Y-%m-%d %H:%M:%S} UTC"


# Name of each quantity in a message about a log without it.
_LABELS: dict[Quantity, str] = {
    "heights": "height",
    "airspeed": "airspeed",
    "attitude": "attitude",
    "battery": "battery current and voltage",
    "wind": "wind",
    "throttle": "throttle",
    "velocity": "velocity",
}
# Track columns of quantities.
_COLUMNS: dict[Quantity, str] = {"airspeed": "airspeed", "attitude": "attitude", "battery": "energy"}
_DATUMS = {
    "ellipsoid": "the log's heights are above the ellipsoid, the plan's above mean sea level",
    "pressure": "the log's heights are by pressure, above the level of 1013.25 hPa",
    "unstated": "the log does not say what its heights are above (--datum says it)",
}
_UNNAMED_TEXT = "the aircraft is not named (--aircraft)"


def judge_imported_flight(setup: FlightSetup, track: Track, *, log_complete: bool) -> Verdict:
    """Judge the stretches of a flight that followed its mission, at the level "flown".

    setup: flight setup with the source of the flight.
    log_complete: True if planfly's own log of the flight has its end.
    """
    source = setup.source
    if source is None:
        raise ValueError("a flight without a source was not imported")
    flown = [legs for stretch in source.stretches if (legs := flown_legs(setup, track, stretch)) is not None]
    findings = _merge_findings([_stretch_findings(setup, legs) for legs in flown])
    ends = [rule.judge_imported_end for rule in RULES.values() if rule.judge_imported_end is not None]
    findings = (*findings, *(judge(setup, flown, log_complete) for judge in ends))
    failed = any(item.ok is False for item in findings)
    unjudged = "; ".join(
        filter(None, [_missing_part_text(findings, source.missing), _unseen_text(flown), _uncertainty_text(findings)])
    )
    flyable = bool(flown) and not failed and not unjudged
    complete = not unjudged and all(item.ok is True for item in findings if item.rule == "completion")
    answer = [headline(findings, flyable).replace("flyable", "flown as planned", 1)] if failed or not unjudged else []
    answer_text = "; ".join([*answer, *filter(None, [unjudged])])
    own = LevelAnswer(setup.autopilot.level, flyable, answer_text, undecided=bool(unjudged) and not failed)
    conditions = setup_conditions(setup)
    lines = imported_lines(findings, setup, own, flown, conditions)
    return Verdict(
        findings,
        flyable,
        complete,
        lines,
        "flown",
        levels=(own,),
        notes=setup.route.notes,
        leg_ends=_leg_ends(setup, flown),
        parameters=setup.autopilot.parameters,
        unjudged=unjudged,
        imported=True,
        conditions=conditions,
    )


def _missing_part_text(findings: Sequence[Finding], missing: MissingItems | None) -> str:
    """Describe which items or which part of the flight the log lacks; return "" if it lacks none."""
    if missing is not None:
        return missing_text(missing)
    parts = [item.reason for item in findings if item.rule == "completion" and item.ok is None]
    return f"not judged from end to end: {parts[0]}" if parts else ""


def _unseen_text(flown: Sequence[FlownLegs]) -> str:
    """Describe pauses of the log that are too long to know where the aircraft was; return "" if there are none."""
    long = []
    for legs in flown:
        time = legs.aligned.track.time
        long += [(float(time[k]), float(time[k + 1])) for k in np.flatnonzero(np.diff(time) > MAX_UNSEEN_TIME_S)]
    if not long:
        return ""
    start, end = max(long, key=lambda pause: pause[1] - pause[0])
    others = f", and in {len(long) - 1} more pauses" if len(long) > 1 else ""
    return f"not judged from {start:.1f} s to {end:.1f} s{others}: the log has no rows"


def _judged_times(legs: FlownLegs) -> tuple[float, float]:
    """Return start and end of a stretch's flight on its legs, s."""
    time = legs.aligned.track.time
    return float(time[0]), float(time[-1])


def _uncertainty_text(findings: Sequence[Finding]) -> str:
    """Describe which findings an uncertain aircraft leaves undecided; return "" if there are none."""
    text = undecided_text(findings)
    return f"not judged in full: {text}" if text else ""


def _stretch_findings(setup: FlightSetup, legs: FlownLegs) -> list[Finding]:
    """Return the findings of one stretch, at the places of the whole route."""
    out = []
    for item in track_findings(legs.requirements, legs.aligned):
        judged = _check_gaps(_check_data(setup, legs, item), legs)
        if legs.partial:
            judged = _check_unreached(judged, legs)
        out.append(_at_route_place(judged, legs.first, setup))
    return [*out, *_findings_without_data(setup, {item.rule for item in out})]


def _findings_without_data(setup: FlightSetup, found: set[str]) -> list[Finding]:
    """Return findings for rules with `LogNeeds.listed` that found nothing because the log lacks their data."""
    out = []
    for rule in RULES.values():
        lacking = [one for one in rule.log.quantities if setup.source is not None and one not in setup.source.holds]
        margin = RULE_WORDS[rule.name].margin
        if rule.log.listed and margin is not None and lacking and rule.name not in found:
            why = f"the log holds no {_LABELS[lacking[0]]}"
            out.append(make_finding(rule.name, FLIGHT, ok=None, reason=why, source="aircraft", unit=margin.unit))
    return out


def _check_data(setup: FlightSetup, legs: FlownLegs, item: Finding) -> Finding:
    """Return a finding, marked as not judged if the log lacks the data that its rule needs."""
    source = setup.source
    if source is None:
        return item
    reason, needs = "", RULES[item.rule].log
    for quantity in needs.quantities:
        if quantity not in source.holds:
            reason = f"the log holds no {_LABELS[quantity]}"
            break
        if quantity == "heights":
            stated = source.plan_heights or not needs.planned_heights
            reason = _DATUMS.get(source.heights.datum, "") if stated else "the plan states no heights"
        else:
            reason = _missing_values_text(legs, quantity)
        if reason:
            break
    if reason:
        return _mark_unjudged(item, reason)
    if not source.aircraft_known and needs.aircraft and item.limit_source != "scenario":
        return _mark_unjudged(item, _UNNAMED_TEXT, measured=bool(item.ok))
    return item


def _missing_values_text(legs: FlownLegs, quantity: Quantity) -> str:
    """Describe when a stretch lacks values of a quantity that the log has elsewhere; return "" if it lacks none."""
    values = getattr(legs.aligned.track, _COLUMNS[quantity])
    bad = ~np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    if not bad.any():
        return ""
    time = legs.aligned.track.time[bad]
    return f"the log holds no {_LABELS[quantity]} at {int(bad.sum())} rows from {time[0]:.1f} s to {time[-1]:.1f} s"


def _mark_unjudged(item: Finding, why: str, *, measured: bool = False) -> Finding:
    """Return a finding marked as not judged, with the reason; keep its measurements if `measured`."""
    reason = f"{why}; {item.reason}" if measured else why
    facts = item.facts if measured else ()
    return replace(item, ok=None, reason=reason, brief=why, placed=False, margin=None, facts=facts, suggestions=())


def _check_gaps(item: Finding, legs: FlownLegs) -> Finding:
    """Mark a passed finding as not judged if the log has a pause in its leg."""
    if item.ok is not True or item.place.index is None or item.place.kind not in ("leg", "waypoint"):
        return item
    track, rows = legs.aligned.track, legs.aligned.rows
    first = item.place.index if item.place.kind == "leg" else max(0, item.place.index - 1)
    last = min(len(rows) - 1, item.place.index + 1)
    start, end = float(track.time[rows[first]]), float(track.time[rows[last]])
    for gap in gaps_between(legs, start, end):
        if item.place.kind == "leg" or RULES[item.rule].log.no_gap:
            why = f"the log has no rows from {gap.start:.1f} s to {gap.end:.1f} s"
            return _mark_unjudged(item, why, measured=True)
    return item


def _check_unreached(item: Finding, legs: FlownLegs) -> Finding:
    """Mark the unreached last waypoint as not judged, and findings on the leg before it as partial."""
    leg, waypoint = legs.requirements.legs - 1, legs.requirements.legs
    unreached = item.place.kind == "waypoint" and item.place.index == waypoint
    of_leg = item.place.kind == "leg" and item.place.index == leg
    if unreached:
        return _mark_unjudged(item, stretch_end_text(legs.stretch))
    if of_leg and RULES[item.rule].log.full_leg:
        return (
            _mark_unjudged(item, f"flown in part: {stretch_end_text(legs.stretch)}") if item.ok is not False else item
        )
    return item


def _at_route_place(item: Finding, first: int, setup: FlightSetup) -> Finding:
    """Return a finding at its place on the whole route."""
    place = item.place
    if not first or place.index is None or place.kind not in ("leg", "waypoint"):
        return item
    index = place.index + first
    return replace(item, place=replace(place, index=index))


def _merge_findings(stretches: Sequence[Sequence[Finding]]) -> tuple[Finding, ...]:
    """Merge the findings of all stretches: one per rule, place and check, a failure before a pass."""
    found: dict[tuple[str, Place, str], Finding] = {}
    for findings in stretches:
        for item in findings:
            key = (item.rule, item.place, item.check)
            known = found.get(key)
            if known is None or _precedence(item) > _precedence(known):
                found[key] = item
    rules = list(dict.fromkeys(item.rule for item in found.values()))
    return tuple(item for rule in rules for item in found.values() if item.rule == rule)


def _precedence(item: Finding) -> int:
    return {False: 2, True: 1, None: 0}[item.ok]


def _leg_ends(setup: FlightSetup, flown: Sequence[FlownLegs]) -> tuple[float, ...]:
    """Return the end of each leg but the last, s, inf from the first leg that no stretch reached; rising."""
    ends = np.full(len(setup.route.waypoints), np.inf)
    for legs in flown:
        times = legs.aligned.track.time[legs.aligned.rows]
        passed = legs.last if legs.partial else legs.last + 1
        ends[legs.first : passed] = np.minimum(ends[legs.first : passed], times[: passed - legs.first])
    if flown:
        # The aircraft was past all waypoints before the first one that was met.
        ends[: flown[0].first] = ends[flown[0].first]
    rising = np.maximum.accumulate(ends)
    return tuple(rising[1:-1].tolist())
