"""Write the summary of a verdict: the headline, and the lines that a reader needs with it."""

import math
from collections.abc import Sequence

from flight.autopilots.parameter_files import LONGEST_NAME
from flight.simulation.setup import FlightSetup
from logs.verdict.conditions import Conditions, autopilot_line, condition_lines, corridor_line
from logs.verdict.findings import (
    APART_FROM_FLIGHT,
    NOT_FLOWN,
    UNKNOWN_AIRCRAFT,
    UNKNOWN_WAY,
    Finding,
    undecided_findings,
)
from logs.verdict.measures.mission_ends import missing_ends_text
from logs.verdict.places import DecidingParameter, LevelAnswer
from logs.verdict.rule_words import RULE_WORDS, RuleWords
from logs.verdict.wording import deciding_text, disagreement_text, place_text

# Maximum number of failed findings that the first line names.
_NAMED = 4
# Introductions of the lines on the other levels.
_LEVELS = {
    "geometry": "By geometry only",
    "airframe": "By the airframe (planfly's guidance, exact navigation)",
}


def headline(findings: Sequence[Finding], flyable: bool, source: str = "") -> str:
    """Write the first line: the answer, and which findings failed, were not judged or narrowly passed.

    source: the source of the aircraft's model, if the model is uncertain.
    """
    whose = [f"an aircraft from {source}"] if source else []
    if flyable:
        silent = [_unjudged_text(findings, rule) for rule in RULE_WORDS.values() if rule.unjudged]
        return "; ".join(["flyable", *filter(None, silent), *_near_miss_notes(findings), *whose])
    failed = _failed_by_urgency(findings)
    if not failed and (open_text := undecided_text(findings)):
        return "; ".join([f"not judged in full: {open_text}", *whose])
    named = _headline_findings(failed)
    more = len(failed) - len(named)
    text = "not flyable: " + ", ".join(_phrase(item) for item in named) + (f", +{more} more" if more else "")
    return "; ".join([text, *whose])


def undecided_text(findings: Sequence[Finding]) -> str:
    """Describe the findings that leave the verdict undecided; return "" if there are none.

    >>> from logs.verdict.findings import UNKNOWN_AIRCRAFT, make_finding
    >>> from logs.verdict.places import Place
    >>> legs = (Place("leg", k, to_item=k + 1) for k in range(2))
    >>> undecided_text([make_finding("slope", leg, ok=None, reason="", check=UNKNOWN_AIRCRAFT) for leg in legs])
    'slopes on leg 0, to item 1, and leg 1, to item 2, are too close to the limit to judge with what is known of ...'
    """
    open_findings = undecided_findings(findings)
    ways = [
        f"{'the turn-around on' if item.place.kind == 'leg' else 'the circle at'} {place_text(item.place)}"
        for item in open_findings
        if item.check == UNKNOWN_WAY
    ]
    circles = f"only a flight tells where {' and '.join(ways[:_NAMED])} is flown" if ways else ""
    known = _unknown_aircraft_text([item for item in open_findings if item.check == UNKNOWN_AIRCRAFT])
    beside = [item.brief for item in open_findings if item.check in APART_FROM_FLIGHT]
    items = [item.brief for item in open_findings if item.check == NOT_FLOWN]
    more = [f"{len(items) - _NAMED} more items"] if len(items) > _NAMED else []
    return "; ".join(filter(None, [known, circles, *items[:_NAMED], *more, *beside]))


def _unknown_aircraft_text(every: Sequence[Finding]) -> str:
    """Describe the findings for which the aircraft is not known well enough; return "" if there are none."""
    found = [item for item in every if item.rule == "slope"]
    if len(found) < len(every):
        speeds = sum(item.rule == "speed" for item in every)
        subjects = [
            f"{name}{'s' if count > 1 or name == 'slope' else ''} on {count} leg{'s' if count > 1 else ''}"
            for name, count in (("slope", len(found)), ("airspeed", speeds))
            if count
        ]
        subjects += ["energy"] if len(found) + speeds < len(every) else []
        one = len(subjects) == 1 and (subjects == ["energy"] or speeds == 1)
        are = "is" if one else "are"
        listed = " and ".join(filter(None, [", ".join(subjects[:-1]), subjects[-1]]))
        return f"{listed} {are} too close to the limit to judge with what is known of the aircraft"
    if not found:
        return ""
    if len(found) > _NAMED:
        return f"slopes on {len(found)} legs are too close to the limit to judge with what is known of the aircraft"
    places = [place_text(item.place) + ("," if item.place.to_item is not None else "") for item in found]
    slopes, are = ("slopes", "are") if len(found) > 1 else ("slope", "is")
    return (
        f"{slopes} on {' and '.join(places)} {are} too close to the limit to judge with what is known of the aircraft"
    )


def first_failed(findings: Sequence[Finding]) -> Finding | None:
    """Return the failed finding that the headline names first, or None if nothing failed.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import FLIGHT
    >>> findings = [make_finding(rule, FLIGHT, ok=False, reason="") for rule in ("energy", "completion")]
    >>> first = first_failed(findings)
    >>> first.rule
    'completion'
    """
    failed = _failed_by_urgency(findings)
    return _headline_findings(failed)[0] if failed else None


def _failed_by_urgency(findings: Sequence[Finding]) -> list[Finding]:
    """Return the failed findings sorted by urgency, and then by the order of the rules."""
    order = {name: k for k, name in enumerate(RULE_WORDS)}
    failed = (item for item in findings if item.ok is False)
    return sorted(failed, key=lambda item: (-RULE_WORDS[item.rule].urgency, order[item.rule]))


def _unjudged_text(findings: Sequence[Finding], rule: RuleWords) -> str:
    """Describe which findings of a rule were not judged; return "" if all were judged."""
    mine = [item for item in findings if item.rule == rule.name]
    silent = sum(item.ok is None for item in mine)
    if not silent:
        return ""
    return f"{rule.unjudged} not judged" + ("" if silent == len(mine) else f" on {silent} {rule.unjudged_of}")


def _near_miss_notes(findings: Sequence[Finding]) -> list[str]:
    """Name each threat that the aircraft missed by less than its navigation error."""
    out = []
    for item in findings:
        facts = {fact.what: fact.value for fact in item.facts if item.rule == "threat" and item.ok}
        if facts.get("nearest", math.inf) < facts.get("navigation error", 0.0):
            out.append(f"a missile missed by {facts['nearest']:.1f} m, less than the navigation error")
    return out


def _headline_findings(failed: list[Finding]) -> list[Finding]:
    """Return at most four failed findings, the worst of each rule before the second worst of any rule."""
    margins = [0.0 if item.margin is None else item.margin for item in failed]
    by_margin = sorted(range(len(failed)), key=margins.__getitem__)
    count: dict[str, int] = {}
    rank = {}
    for k in by_margin:
        rank[k] = count[failed[k].rule] = count.get(failed[k].rule, 0) + 1
    chosen = sorted(range(len(failed)), key=lambda k: (rank[k], k))[:_NAMED]
    return [failed[k] for k in sorted(chosen)]


def _phrase(item: Finding) -> str:
    """Describe a failed finding in a few words."""
    words = RULE_WORDS[item.rule]
    return words.phrase(words.word, item)


def summary_lines(
    findings: Sequence[Finding],
    setup: FlightSetup,
    level: str,
    levels: Sequence[LevelAnswer],
    conditions: Conditions,
    deciding: DecidingParameter | None = None,
) -> tuple[str, ...]:
    """Write the summary: answer, airframe or autopilot, start, conditions, autopilot, what was not judged, levels.

    levels: answers of all levels; the verdict's own is last and has the headline.
    """
    *others, own = levels
    lines = [own.headline, *_airframe_or_autopilot_lines(levels, deciding, setup)]
    lines.append(f"Start: {setup.started}" if setup.started else "Start: not stated")
    lines += [*condition_lines(conditions), autopilot_line(conditions, flown=level == "flown")]
    lines += _parameter_lines(setup, flown=level == "flown")
    lines += _ignored_settings_lines(setup)
    silent: dict[str, str] = {}
    for item in findings:
        if item.ok is None and RULE_WORDS[item.rule].explained:
            silent.setdefault(item.rule, item.reason)
    lines += [f"Not judged: {RULE_WORDS[rule].title} ({reason})" for rule, reason in silent.items()]
    # These are the autopilot's own limits, which say nothing about the aircraft.
    lines += [
        f"PX4 would reject it: {item.reason}"
        for item in findings
        if item.rule == "mission" and item.ok is None and item.check != NOT_FLOWN
    ]
    lack = missing_ends_text(setup.mission, setup.autopilot.mission_checks) if setup.autopilot.refuses else ""
    if lack and not any(item.rule == "mission" for item in findings):
        lines.append(f"PX4 would reject it: {lack}")
    lines += [
        f"{RULE_WORDS[item.rule].title.capitalize()}: {item.reason}"
        for item in findings
        if RULE_WORDS[item.rule].warns and item.ok is None
    ]
    lines += _terrain_error_lines(findings, setup)
    if setup.notes:
        lines.append(f"Not flown as written: {'; '.join(setup.notes)}")
    if level == "flown":
        lines += [line] if (line := corridor_line(setup)) else []
    if level == "geometric":
        lines.append("Level: geometric, from the route and the aircraft's envelope, without a flight")
    for other in others:
        agreement = f"; {_agreement_text(other)}" if level == "flown" else ""
        lines.append(f"{_LEVELS[other.name]}: {other.headline}{agreement}")
    return tuple(lines)


def _airframe_or_autopilot_lines(
    levels: Sequence[LevelAnswer], deciding: DecidingParameter | None, setup: FlightSetup
) -> list[str]:
    """If the airframe can fly the mission but the autopilot cannot, say so and name the parameter that decides."""
    answers = {level.name: level.flyable for level in levels}
    if answers.get("autopilot") is not False or not answers.get("airframe") or levels[-1].undecided:
        return []
    whose = "" if setup.autopilot.parameters is None else " with these parameters"
    # Other parameters are flown by the law, whoever flew.
    by_law = setup.autopilot.program is not None
    why = "" if by_law or not whose else ": with none of the parameters that were tried would it pass"
    if deciding is not None:
        why = f": {deciding_text(deciding)}{', by the simulated flight' if by_law else ''}"
    return [f"The aircraft can fly this, but {setup.autopilot.title}{whose} cannot{why}"]


def _parameter_lines(setup: FlightSetup, *, flown: bool) -> list[str]:
    """Describe the source of the parameters if a file sets any, and the names in the file that have no effect.

    Without a flight, only faults of the file are described.
    """
    parameters = setup.autopilot.parameters
    if parameters is None or not parameters.source:
        return []
    misfits = [f"Parameters that do not fit: {'; '.join(parameters.misfits)}"] if parameters.misfits else []
    if not flown and all(len(name) <= LONGEST_NAME for name in parameters.unused):
        return misfits
    names = {origin: len(parameters.by_origin(origin)) for origin in ("file", "aircraft", "default")}
    # A name that is too long is a mistake in the file, and the others belong to other hardware.
    by_length = sorted(parameters.unused, key=lambda name: len(name) <= LONGEST_NAME)
    unused = [
        name if len(name) <= LONGEST_NAME else f"{name} (longer than {LONGEST_NAME} characters)"
        for name in by_length[:_NAMED]
    ]
    more = len(parameters.unused) - len(unused)
    said = f"; not used: {', '.join(unused)}{f', +{more} more' if more else ''}" if unused else ""
    returns = [name for name in parameters.not_flown if name in parameters.by_origin("file")]
    said += f"; read but not simulated: {', '.join(returns)}" if returns else ""
    said += f"; beyond {setup.autopilot.title}'s documented ranges, but flown: {', '.join(parameters.beyond)}" * bool(
        parameters.beyond
    )
    return [
        f"Parameters: {names['file']} from the file, {names['aircraft']} from the aircraft,"
        f" {names['default']} from {setup.autopilot.title}'s defaults{said}",
        *misfits,
    ]


def _ignored_settings_lines(setup: FlightSetup) -> list[str]:
    """Name the settings of the scenario's returns for which the autopilot has no parameter."""
    returns, parameters = setup.scenario.returns, setup.autopilot.parameters
    if returns is None or returns.rtl_autoland is None or parameters is None or hasattr(parameters, "rtl_autoland"):
        return []
    return [f"Not used: rtl_autoland of [returns], for which {setup.autopilot.title} has no parameter"]


def _terrain_error_lines(findings: Sequence[Finding], setup: FlightSetup) -> list[str]:
    """Subtract the terrain's stated error, if any, from the lowest clearance."""
    error = None if setup.scenario.terrain is None else setup.scenario.terrain.vertical_error
    heights = [
        item.planned if item.flown is None else item.flown
        for item in findings
        if item.rule == "clearance" and item.planned is not None
    ]
    if error is None or not heights:
        return []
    low, required = min(heights), setup.scenario.limits.min_clearance_m
    return [
        f"Terrain's stated error: {error:g} m; the lowest clearance is {low:.1f} m, or {low - error:.1f}"
        " m with that error subtracted"
        f" ({required:g} m are required)"
    ]


def _agreement_text(other: LevelAnswer) -> str:
    """Describe where the verdict and another level agree or differ."""
    differing = other.disagreements
    if not differing:
        geometry = other.name == "geometry"
        return "flight and geometry agree on every finding that both have" if geometry else "both flights agree"
    more = f", +{len(differing) - _NAMED} more" if len(differing) > _NAMED else ""
    return "; ".join(map(disagreement_text, differing[:_NAMED])) + more
