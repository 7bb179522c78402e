"""Write the summary of a verdict: the headline, and the lines that explain it."""

import math
from collections.abc import Sequence
from typing import get_args

from flight.autopilots.autopilot import Origin
from flight.autopilots.parameter_files import LONGEST_NAME
from flight.autopilots.parameter_set import ParameterSet
from flight.simulation.setup import FlightSetup
from logs.verdict.conditions import Conditions, autopilot_line, condition_lines, corridor_line, mission_notes
from logs.verdict.findings import (
    AIRCRAFT_SLOPE,
    APART_FROM_FLIGHT,
    GROUND_FOLLOWING_ERROR,
    NO_HOME,
    NOT_FLOWN,
    PITCH_LIMIT_TIME,
    UNKNOWN_AIRCRAFT,
    UNKNOWN_PATH,
    Finding,
    undecided_findings,
)
from logs.verdict.measures.mission_ends import missing_ends_text, unjudged_return_text
from logs.verdict.places import FLIGHT, DecidingParameter, LevelAnswer, Place
from logs.verdict.rule_words import GROUND_RULES, RULE_WORDS, TAKE_OFF_RULES
from logs.verdict.suggestions import home_height, lowest_clearance
from logs.verdict.tolerances import NOTABLE_HEIGHT_ERROR_M
from logs.verdict.wording import deciding_text, disagreement_text, place_text
from world.wording import count_text, is_one_edit

# Maximum number of failed findings that the first line names.
_MAX_NAMED_FINDINGS = 4
# A part of a parameter's name is short if it has at most this many letters.
_LONGEST_SHORT_PART = 2
# Words after the distance in a note on a missile or zone that a path passed closely, by rule.
_NEAR_MISS_PLACES = {"threat": "outside a missile's range", "fence": "from a zone's limit"}
# Introductions of the lines on the other levels.
_LEVEL_TITLES = {
    "geometry": "Geometry only (no flight)",
    "airframe": "Without the autopilot (planfly's guidance, exact navigation)",
}


def setup_notes(setup: FlightSetup, findings: Sequence[Finding]) -> tuple[str, ...]:
    """Return notes for the headline.

    They concern an uncertain aircraft, a doubtful home altitude, and a missing landing.

    The note on home's altitude is left out if a finding already reports it.
    """
    # With home on the ground the flight is lower by the height of the mission's home.
    height = home_height(setup)
    clearance = lowest_clearance(findings) - max(0.0, height)
    if any(finding.rule == "clearance" and finding.place == FLIGHT for finding in findings):
        return mission_notes(setup, home_effect=None)
    if height > 0.0 and math.isfinite(clearance):
        return mission_notes(setup, f"; with home on the ground the lowest clearance is {clearance:.1f} m")
    return mission_notes(setup)


def headline(findings: Sequence[Finding], flyable: bool, setup_notes: Sequence[str] = ()) -> str:
    """Return a line with the verdict's answer and its failed, unjudged or narrowly passed findings.

    flyable: True if the verdict is flyable.
    setup_notes: notes from the function `setup_notes`.
    """
    if flyable:
        unjudged = []
        for rule in RULE_WORDS.values():
            rule_findings = [finding for finding in findings if finding.rule == rule.name and rule.unjudged]
            if count := sum(finding.ok is None for finding in rule_findings):
                count_suffix = f" on {count} {rule.unjudged_unit}{'s' if count > 1 else ''}"
                places_text = count_suffix if count < len(rule_findings) else ""
                unjudged.append(f"{rule.unjudged} not judged{places_text}")
        unjudged += ["return not judged"] if any(finding.check == NO_HOME for finding in findings) else []
        notes = [*unjudged, *_near_miss_notes(findings), *_altitude_notes(findings)]
        return "; ".join(["flyable", *notes, *setup_notes])
    failed_findings = _failed_by_urgency(findings)
    if not failed_findings and (reason := undecided_text(findings)):
        notes = [*_near_miss_notes(findings), *_altitude_notes(findings)]
        return "; ".join([f"not judged in full: {reason}", *notes, *setup_notes])
    named_findings = _headline_findings(failed_findings)
    unnamed_count = len(failed_findings) - len(named_findings)
    text = (
        "not flyable: "
        + ", ".join(RULE_WORDS[item.rule].phrase(RULE_WORDS[item.rule].word, item) for item in named_findings)
        + (f" and {unnamed_count} more" if unnamed_count else "")
    )
    return "; ".join([text, *setup_notes])


def undecided_text(findings: Sequence[Finding]) -> str:
    """Describe the findings that leave the verdict undecided; return "" without any.

    >>> from logs.verdict.findings import UNKNOWN_AIRCRAFT, make_finding
    >>> from logs.verdict.places import Place
    >>> legs = (Place("leg", k, to_item=k + 1) for k in range(2))
    >>> undecided_text([make_finding("slope", leg, ok=None, reason="", check=UNKNOWN_AIRCRAFT) for leg in legs])
    "slopes on leg 0 (to item 1) and leg 1 (to item 2) are too close to the limit to judge, because the aircraft's ..."
    """
    open_findings = undecided_findings(findings)
    paths = [
        f"{'the turn-around on' if finding.place.kind == 'leg' else 'the circle at'} {place_text(finding.place)}"
        for finding in open_findings
        if finding.check == UNKNOWN_PATH
    ]
    path_text = (
        f"only a simulated flight shows how {' and '.join(paths[:_MAX_NAMED_FINDINGS])} is flown" if paths else ""
    )
    aircraft_text = _unknown_aircraft_text([finding for finding in open_findings if finding.check == UNKNOWN_AIRCRAFT])
    other_briefs = [finding.brief for finding in open_findings if finding.check in APART_FROM_FLIGHT]
    item_briefs = [finding.brief for finding in open_findings if finding.check == NOT_FLOWN]
    return "; ".join(
        filter(
            None,
            [aircraft_text, path_text, *_first_briefs(item_briefs, "item"), *_first_briefs(other_briefs, "finding")],
        )
    )


def _first_briefs(briefs: Sequence[str], noun: str) -> list[str]:
    """Keep the first `_MAX_NAMED_FINDINGS` texts, and replace the others by one text with their number.

    noun: what the texts describe, in the singular, such as "item".

    >>> _first_briefs(["a", "b", "c", "d", "e"], "item")
    ['a', 'b', 'c', 'd', '1 more item']
    """
    more_count = len(briefs) - _MAX_NAMED_FINDINGS
    return [*briefs[:_MAX_NAMED_FINDINGS], *([count_text(more_count, f"more {noun}")] if more_count > 0 else [])]


# Noun, preposition and counted place by rule, for a sentence on an insufficiently known aircraft.
_PLACED_SUBJECTS = {
    "slope": ("slope", "on", "leg"),
    "speed": ("airspeed", "on", "leg"),
    "turn": ("turn", "at", "waypoint"),
    "loiter": ("loiter", "at", "waypoint"),
    "landing": ("landing", "at", "waypoint"),
}


def _unknown_aircraft_text(open_findings: Sequence[Finding]) -> str:
    """Describe findings that are undecided because the aircraft is uncertain; "" without any.

    If a few slopes are the only such findings, the text names their legs.  Otherwise it counts the findings by rule.
    """
    slope_findings = [finding for finding in open_findings if finding.rule == "slope"]
    if len(slope_findings) < len(open_findings):
        counts = {rule: sum(finding.rule == rule for finding in open_findings) for rule in _PLACED_SUBJECTS}
        subjects = [
            f"{noun}{'s' if count > 1 or rule == 'slope' else ''} {place_preposition} {count_text(count, place)}"
            for (rule, count), (noun, place_preposition, place) in zip(
                counts.items(), _PLACED_SUBJECTS.values(), strict=True
            )
            if count
        ]
        subjects += ["energy"] if sum(counts.values()) < len(open_findings) else []
        is_singular = len(subjects) == 1 and not slope_findings and max(counts.values()) <= 1
        verb = "is" if is_singular else "are"
        subject_text = " and ".join(filter(None, [", ".join(subjects[:-1]), subjects[-1]]))
        return f"{subject_text} {verb} too close to the limit to judge, because the aircraft's limits are uncertain"
    if not slope_findings:
        return ""
    if len(slope_findings) > _MAX_NAMED_FINDINGS:
        return (
            f"slopes on {len(slope_findings)} legs are too close to the limit to judge, because the aircraft's"
            " limits are uncertain"
        )
    place_names = [place_text(finding.place) for finding in slope_findings]
    noun, verb = ("slopes", "are") if len(slope_findings) > 1 else ("slope", "is")
    return (
        f"{noun} on {' and '.join(place_names)} {verb} too close to the limit to judge,"
        " because the aircraft's limits are uncertain"
    )


def failed_at_take_off(findings: Sequence[Finding]) -> bool:
    """Return True if a flight failed at take-off and flew no leg.

    The airframe's reference flight, which begins in the air, then shows nothing about the flight as a whole.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import FLIGHT
    >>> launch = make_finding("launch", Place("waypoint", 0), ok=False, reason="")
    >>> ends = [make_finding("completion", FLIGHT, ok=False, reason="", flown=legs) for legs in (0, 1)]
    >>> [failed_at_take_off((launch, end)) for end in ends], failed_at_take_off(ends)
    ([True, False], False)
    """
    fails_take_off = any(finding.ok is False and finding.rule in TAKE_OFF_RULES for finding in findings)
    return fails_take_off and any(finding.rule == "completion" and finding.flown == 0.0 for finding in findings)


def most_urgent_failure(findings: Sequence[Finding]) -> Finding | None:
    """Return the failed finding that the headline names first, or None if nothing failed.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import FLIGHT
    >>> findings = [make_finding(rule, FLIGHT, ok=False, reason="") for rule in ("energy", "completion")]
    >>> first = most_urgent_failure(findings)
    >>> first.rule
    'completion'
    """
    failed_findings = _failed_by_urgency(findings)
    return _headline_findings(failed_findings)[0] if failed_findings else None


def _failed_by_urgency(findings: Sequence[Finding]) -> list[Finding]:
    """Return the failed findings, the most urgent first, and then in the order of the rules."""
    order = {name: k for k, name in enumerate(RULE_WORDS)}
    failed = (finding for finding in findings if finding.ok is False)
    return sorted(failed, key=lambda finding: (-RULE_WORDS[finding.rule].urgency, order[finding.rule]))


def _near_miss_notes(findings: Sequence[Finding]) -> list[str]:
    """Return notes on missiles' ranges and zones that the path clears by less than the navigation error."""
    notes = []
    for finding in findings:
        place = _NEAR_MISS_PLACES.get(finding.rule)
        facts = {fact.what: fact.value for fact in finding.facts if place and finding.ok}
        if facts.get("nearest", math.inf) < facts.get("navigation error", 0.0):
            other_count = sum(name.startswith("distance to zone") for name in facts) - 1
            others = f" ({count_text(other_count, 'other zone')}, too)" if other_count > 0 else ""
            notes.append(f"passes {max(0.0, facts['nearest']):.1f} m {place}, less than the navigation error{others}")
    return notes


def _altitude_notes(findings: Sequence[Finding]) -> list[str]:
    """Return notes on the worst altitude errors at passed waypoints and on ground-following legs."""
    waypoint_errors = _passing_errors(findings, "waypoint", "height error")
    # The slope rule judges how well a leg follows the ground, because its slope is the slope of the ground.
    leg_errors = _passing_errors(findings, "slope", GROUND_FOLLOWING_ERROR)
    return [
        *_worst_error_notes(waypoint_errors, "passed", "its altitude"),
        *_worst_error_notes(leg_errors, "flown up to", "its height above ground"),
    ]


def _passing_errors(findings: Sequence[Finding], rule: str, fact_name: str) -> list[tuple[float, Place]]:
    """Collect value and place of a fact from all findings of a rule that did not fail and have the fact."""
    return [
        (fact.value, finding.place)
        for finding in findings
        for fact in finding.facts
        if finding.rule == rule and finding.ok is not False and fact.what == fact_name
    ]


def _worst_error_notes(errors: Sequence[tuple[float, Place]], verb: str, reference: str) -> list[str]:
    """Return a note on the largest altitude error (m), if it is notable; otherwise [].

    verb, reference: words of the note, such as "passed" and "its altitude" in "item 3 passed 30 m above its altitude".
    """
    notable = [(error, place) for error, place in errors if abs(error) > NOTABLE_HEIGHT_ERROR_M]
    if not notable:
        return []
    error, place = max(notable, key=lambda pair: abs(pair[0]))
    more_text = f", and {len(notable) - 1} more by over {NOTABLE_HEIGHT_ERROR_M:.0f} m" if len(notable) > 1 else ""
    side = "above" if error > 0.0 else "below"
    return [f"{place_text(place)} {verb} {abs(error):.0f} m {side} {reference}{more_text}"]


def _headline_findings(failed: list[Finding]) -> list[Finding]:
    """Select at most four failed findings: the worst of each rule before the second worst of any rule.

    Within a rule, findings whose number is within the limit come last.  They may fail only because of the others, like
    the arc at the end of a steep leg.
    """
    margins = [0.0 if finding.margin is None else finding.margin for finding in failed]
    indices_by_margin = sorted(range(len(failed)), key=margins.__getitem__)
    counts: dict[str, int] = {}
    rank_in_rule = {}
    for k in indices_by_margin:
        rank_in_rule[k] = counts[failed[k].rule] = counts.get(failed[k].rule, 0) + 1
    chosen_indices = sorted(range(len(failed)), key=lambda k: (rank_in_rule[k], k))[:_MAX_NAMED_FINDINGS]
    rules = [finding.rule for finding in failed]
    return [failed[k] for k in sorted(chosen_indices, key=lambda k: (rules.index(rules[k]), margins[k] >= 0.0, k))]


def summary_lines(
    findings: Sequence[Finding],
    setup: FlightSetup,
    level: str,
    levels: Sequence[LevelAnswer],
    conditions: Conditions,
    deciding: DecidingParameter | None = None,
) -> tuple[str, ...]:
    """Return the lines of the summary, from the answer and the conditions to the other levels.

    levels: answers of all levels; the last answer is the verdict's own, whose headline is the first line.
    """
    *other_answers, own_answer = levels
    lines = [own_answer.headline]
    # The airframe's reference flight flies no take-off and no landing, and no slope that the aircraft cannot fly.
    if not any(
        finding.rule in GROUND_RULES or any(fact.what == AIRCRAFT_SLOPE for fact in finding.facts)
        for finding in findings
        if finding.ok is False
    ):
        is_refused = any(finding.rule == "mission" and finding.ok is False for finding in findings)
        lines += _airframe_or_autopilot_lines(levels, deciding, setup, is_refused=is_refused)
    # The failed leg with the longest time at the pitch limit.
    failed_places = {finding.place for finding in findings if finding.ok is False}
    pitch_times = [
        (fact.value, finding.place)
        for finding in findings
        for fact in finding.facts
        if fact.what == PITCH_LIMIT_TIME and finding.place in failed_places
    ]
    if pitch_times:
        time, place = max(pitch_times, key=lambda pair: pair[0])
        limit_name = setup.autopilot.speeds.max_pitch_name
        lines.append(f"Pitch: at its limit {limit_name} for {time:.0f} s on {place_text(place)}")
    lines.append(f"Start: {setup.started}" if setup.started else "Start: not stated")
    lines += [*condition_lines(conditions), autopilot_line(conditions, is_flown=level == "flown")]
    lines += _parameter_lines(setup, is_flown=level == "flown")
    rtl_settings, parameters = setup.scenario.returns, setup.autopilot.parameters
    is_stated = rtl_settings is not None and rtl_settings.rtl_autoland is not None
    if is_stated and parameters is not None and not hasattr(parameters, "rtl_autoland"):
        lines.append(f"Not used: rtl_autoland of [returns], for which {setup.autopilot.title} has no parameter")
    lines += [f"Not judged: {text}" for _, text in unjudged_parts(findings, setup)]
    # These are limits of PX4 and not of the aircraft, so they decide nothing for another autopilot.
    lines += [
        f"PX4 would reject the mission: {finding.reason}"
        for finding in findings
        if finding.rule == "mission" and finding.ok is None and finding.check != NOT_FLOWN
    ]
    checks = setup.autopilot.checks
    missing_ends = missing_ends_text(setup.mission, checks.feasibility) if checks.dialect == "px4" else ""
    if missing_ends and not any(finding.rule == "mission" for finding in findings):
        lines.append(f"PX4 would reject the mission: {missing_ends}")
    lines += [
        f"{RULE_WORDS[finding.rule].title.capitalize()}: {finding.reason}"
        for finding in findings
        if RULE_WORDS[finding.rule].is_warning and finding.ok is None
    ]
    lines += _terrain_error_lines(findings, setup)
    if setup.plan is not None and setup.plan.unmet_margins:
        lines.append(f"Planner's margins not met: {'; '.join(setup.plan.unmet_margins)}")
    lines += [f"Note: {warning}" for warning in setup.mission.warnings]
    lines += [f"Not flown as written: {note}" for note in setup.notes]
    if level == "flown":
        lines += [line] if (line := corridor_line(setup, findings)) else []
    if level == "geometric":
        lines.append("Level: geometric (judged by the route and the aircraft's envelope, without a flight)")
    for answer in other_answers:
        # The findings on which the verdict and another level differ, or a statement that they agree.
        texts = list(map(disagreement_text, answer.disagreements[:_MAX_NAMED_FINDINGS]))
        if len(answer.disagreements) > _MAX_NAMED_FINDINGS:
            texts.append(f"and {len(answer.disagreements) - _MAX_NAMED_FINDINGS} more")
        if not texts:
            agreed_text = "flight and geometry agree on every finding that both judge"
            texts = [agreed_text if answer.name == "geometry" else "both flights agree"]
        agreement = f"; {'; '.join(texts)}" if level == "flown" else ""
        if answer.name == "airframe" and failed_at_take_off(findings):
            agreement = "; it begins in the air, after the take-off that failed"
        lines.append(f"{_LEVEL_TITLES[answer.name]}: {answer.headline}{agreement}")
    return tuple(lines)


def unjudged_parts(findings: Sequence[Finding], setup: FlightSetup) -> list[tuple[str, str]]:
    """Return a pair for each rule with unjudged findings: the rule, and a text on places and reasons.

    Findings with the same reason are described together, in the order of the first of each.
    """
    parts = []
    for rule in RULE_WORDS.values():
        rule_findings = [finding for finding in findings if finding.rule == rule.name and rule.explains_unjudged]
        unjudged = [finding for finding in rule_findings if finding.ok is None]
        if not unjudged:
            continue
        is_placed = all(finding.place.kind in ("leg", "waypoint") for finding in unjudged)
        if not is_placed or len(unjudged) == len(rule_findings):
            parts.append((rule.name, f"{rule.title} ({unjudged[0].reason})"))
            continue
        places_by_reason: dict[str, list[str]] = {}
        for finding in unjudged:
            places_by_reason.setdefault(finding.reason, []).append(place_text(finding.place))
        texts = []
        for reason, places in list(places_by_reason.items())[:_MAX_NAMED_FINDINGS]:
            more_text = f" and {len(places) - _MAX_NAMED_FINDINGS} more" if len(places) > _MAX_NAMED_FINDINGS else ""
            texts.append(f"on {'; '.join(places[:_MAX_NAMED_FINDINGS])}{more_text} ({reason})")
        more_text = ""
        if len(places_by_reason) > _MAX_NAMED_FINDINGS:
            more_text = f"; {count_text(len(places_by_reason) - _MAX_NAMED_FINDINGS, 'more reason')}"
        parts.append((rule.name, f"{rule.title} {'; '.join(texts)}{more_text}"))
    if reason := unjudged_return_text(setup):
        parts.append(("return", f"{RULE_WORDS['return'].title} ({reason})"))
    return parts


def _airframe_or_autopilot_lines(
    levels: Sequence[LevelAnswer], deciding: DecidingParameter | None, setup: FlightSetup, *, is_refused: bool
) -> list[str]:
    """Return a line if the airframe can fly the mission but the autopilot cannot, otherwise [].

    The line names the parameter that decides, if it is known.  If the flight of the airframe is undecided, the line
    names only the parameter.

    is_refused: True if the autopilot would reject an item of the mission, which no other parameters change.
    """
    answers = {level.name: level for level in levels}
    airframe = answers.get("airframe")
    if "autopilot" not in answers or answers["autopilot"].flyable or levels[-1].undecided or airframe is None:
        return []
    if not airframe.flyable:
        if deciding is None or not airframe.undecided:
            return []
        return [f"A parameter decides: {deciding_text(deciding)}, as far as it can be judged"]
    parameters_note = "" if setup.autopilot.parameters is None else " with these parameters"
    # Other parameter values are always tried with the simulated control law, even if the autopilot's program flew.
    flew_program = setup.autopilot.program is not None
    no_value_text = ": no parameter value that was tried lets the flight pass with a margin for simulation errors"
    reason = "" if flew_program or not parameters_note else no_value_text
    if is_refused:
        parameters_note, reason = "", ": it rejects an item of the mission"
    if deciding is not None:
        reason = f": {deciding_text(deciding)}{', by the simulated flight' if flew_program else ''}"
    return [f"The aircraft can fly this mission, but {setup.autopilot.title}{parameters_note} cannot{reason}"]


def _parameter_lines(setup: FlightSetup, *, is_flown: bool) -> list[str]:
    """Return lines on the sources of the parameters, on names without an effect, and on contradictions.

    Return [] without a parameter file.  Without a flight, the sources are described only if the file has a fault.
    """
    parameters = setup.autopilot.parameters
    if parameters is None or not parameters.source:
        return []
    faults = []
    if isinstance(parameters, ParameterSet):
        # Names that look like misspelled parameter names.  A name that differs by a digit, as BATT2_CAPACITY from
        # BATT_CAPACITY, is another parameter.  So is a name in a file that contains the similar name, too.
        known_names, stated_names = parameters.table.by_any_name, parameters.by_origin("file")
        absent_names = [name for name in known_names if known_names[name][0].name not in stated_names]
        for name in parameters.unused:
            meant_names = (
                known_name
                for known_name in absent_names
                if is_one_edit(name, known_name)
                # Short parts such as P and D are not misspelled.
                and min(map(len, set(name.split("_")) ^ set(known_name.split("_")))) > _LONGEST_SHORT_PART
            )
            if name not in known_names and (meant_name := next(meant_names, "")):
                title = parameters.table.title
                faults.append(f"Not a parameter of the simulated {title}: {name}: did you mean {meant_name}?")
        faults = faults[:_MAX_NAMED_FINDINGS]
    if parameters.contradictions:
        faults.append(f"Contradictory parameters: {'; '.join(parameters.contradictions)}")
    if not is_flown and all(len(name) <= LONGEST_NAME for name in parameters.unused):
        return faults
    counts = {origin: len(parameters.by_origin(origin)) for origin in get_args(Origin)}
    assumed_text = f"{counts['assumed']} assumed for the landing, " if counts["assumed"] else ""
    # A name that is too long is a mistake in the file; other unused names belong to other hardware.
    unused_by_length = sorted(parameters.unused, key=lambda name: len(name) <= LONGEST_NAME)
    unused_names = [
        name if len(name) <= LONGEST_NAME else f"{name} (longer than {LONGEST_NAME} characters)"
        for name in unused_by_length[:_MAX_NAMED_FINDINGS]
    ]
    unnamed_count = len(parameters.unused) - len(unused_names)
    notes = (
        f"; not used: {', '.join(unused_names)}{f' and {unnamed_count} more' if unnamed_count else ''}"
        if unused_names
        else ""
    )
    not_simulated = [name for name in parameters.not_simulated if name in parameters.by_origin("file")]
    notes += f"; read but not simulated: {', '.join(not_simulated)}" if not_simulated else ""
    if undocumented_texts := parameters.outside_documented_ranges:
        notes += f"; outside {setup.autopilot.title}'s documented ranges, but used: {', '.join(undocumented_texts)}"
    return [
        f"Parameters: {counts['file']} from the file, {assumed_text}{counts['aircraft']} from the aircraft,"
        f" {counts['default']} from {setup.autopilot.title}'s defaults{notes}",
        *faults,
    ]


def _terrain_error_lines(findings: Sequence[Finding], setup: FlightSetup) -> list[str]:
    """Return a line on the lowest clearance less the terrain's error; [] if the terrain states no error.

    Return [] also if no finding states a clearance.
    """
    error = None if setup.scenario.terrain is None else setup.scenario.terrain.vertical_error
    clearances = [
        finding.planned if finding.flown is None else finding.flown
        for finding in findings
        if finding.rule == "clearance" and finding.planned is not None
    ]
    if error is None or not clearances:
        return []
    min_clearance, required_clearance = min(clearances), setup.scenario.limits.min_clearance_m
    return [
        f"Terrain's stated error: {error:g} m; the lowest clearance is {min_clearance:.1f} m, or"
        f" {min_clearance - error:.1f}"
        " m with that error subtracted"
        f" ({required_clearance:g} m are required)"
    ]
