"""The verdict in a line, and what a reader should know beside it."""

from collections.abc import Sequence

from flight.simulation.flight_setup import FlightSetup
from logs.verdict.findings import RULES, Finding, Prediction
from logs.verdict.wording import disagreement_text, place_text, shortened

# Failed findings that the first line names.
_NAMED = 4
_UNITS = {"deg": "°", "m": " m", "s": " s", "m/s": " m/s", "Wh": " Wh", "legs": " legs"}
_GUIDANCE = {
    "path": "planfly's guidance on the fly-by path",
    "l1": "L1 as ArduPlane flies it, along the legs",
    "vector-field": "Beard and McLain's vector field on the fly-by path",
}
_NAV = {
    "perfect": "exact",
    "rtk": "with RTK's error (0.05 m on each axis)",
    "gnss": "with GNSS's error (1.5 m on each axis)",
}
# What ends a flight comes first, then what a plan may be mended by; the others follow in the verdict's order.
_FIRST = ("departure", "completion", "mission", "slope")
_URGENCY = {rule: k for k, rule in enumerate(dict.fromkeys((*_FIRST, *RULES)))}


def headline(findings: Sequence[Finding], flyable: bool) -> str:
    """First line: the answer, and what failed or was not judged."""
    if flyable:
        terrain = [item for item in findings if item.rule == "clearance" and item.ok is None]
        if not terrain:
            return "flyable"
        whole = len(terrain) == sum(item.rule == "clearance" for item in findings)
        return "flyable; terrain not judged" if whole else f"flyable; terrain not judged on {len(terrain)} legs"
    failed = sorted((item for item in findings if item.ok is False), key=lambda item: _URGENCY[item.rule])
    named = _spread(failed)
    more = len(failed) - len(named)
    return "not flyable: " + ", ".join(_phrase(item) for item in named) + (f", +{more} more" if more else "")


def _spread(failed: list[Finding]) -> list[Finding]:
    """At most four findings: the worst of each rule before the second worst of any."""
    margins = [0.0 if item.margin is None else item.margin for item in failed]
    by_margin = sorted(range(len(failed)), key=margins.__getitem__)
    count: dict[str, int] = {}
    rank = {}
    for k in by_margin:
        rank[k] = count[failed[k].rule] = count.get(failed[k].rule, 0) + 1
    chosen = sorted(range(len(failed)), key=lambda k: (rank[k], k))[:_NAMED]
    return [failed[k] for k in sorted(chosen)]


def _phrase(item: Finding) -> str:
    """One failed finding in a few words."""
    where = place_text(item.place)
    match item.rule:
        case "completion" | "departure":
            return f"{item.rule} ({shortened(item.brief)})"
        case "waypoint":
            return f"{where} missed" + (f" ({item.flown:.0f} m > {item.limit:.0f} m)" if _over(item) else "")
        case "threat":
            # One without a name of its own is called "threat 3 (missile)".
            named = f"threat {where}" if item.place.name else where
            return f"{named} ({max(item.flown or 0.0, item.planned or 0.0):.1f} s inside)"
    if item.place.kind == "flight":
        return f"{item.rule} ({_numbers(item)})"
    return f"{item.rule} {'at' if item.place.kind == 'waypoint' else 'on'} {where} ({_numbers(item)})"


def _over(item: Finding) -> bool:
    return item.flown is not None and item.limit is not None and item.flown > item.limit


def _numbers(item: Finding) -> str:
    """Worse of planned and flown against the limit, if that is what failed; else the reason in brief."""
    if item.limit is None or item.rule == "speed":
        return shortened(item.brief)
    values = [value for value in (item.flown, item.planned) if value is not None]
    unit = _UNITS.get(item.unit, "")
    if item.rule == "loiter" and item.planned is not None and item.planned < item.limit:
        return f"radius {item.planned:.0f}{unit} < {item.limit:.0f}{unit}"
    if item.rule in ("clearance", "bounds"):
        low = min(values, default=None)
        if item.flown is not None:
            low = item.flown
        return shortened(item.brief) if low is None else f"{low:.1f}{unit} < {item.limit:.1f}{unit}"
    worst = max(values, key=abs, default=None)
    if worst is None or abs(worst) <= abs(item.limit):
        return shortened(item.brief)
    return f"{worst:.1f}{unit} {'>' if worst > 0.0 else '<'} {item.limit:.1f}{unit}"


def summary_lines(
    findings: Sequence[Finding], flyable: bool, setup: FlightSetup, level: str, prediction: Prediction | None = None
) -> tuple[str, ...]:
    """Lines of the summary: the answer; how the flight started; what was not judged; what is not flown as written."""
    lines = [headline(findings, flyable)]
    lines.append(f"Start: {setup.route.started}" if setup.route.started else "Start: not stated")
    silent: dict[str, str] = {}
    for item in findings:
        if item.ok is None and item.rule in ("mission", "clearance", "threat", "bounds", "energy"):
            silent.setdefault(item.rule, item.reason)
    lines += [f"Not judged: {rule} ({reason})" for rule, reason in silent.items()]
    lines += _less_error(findings, setup)
    if setup.route.notes:
        lines.append(f"Not flown as written: {'; '.join(setup.route.notes)}")
    if level == "flown":
        lines.append(f"Flown by: {flown_by(setup)}; navigation {_NAV[setup.nav]}")
        lines += _parameter_lines(setup)
    if level == "geometric":
        lines.append("Level: geometric, from the route and the aircraft's envelope, without a flight")
    if prediction is not None:
        lines.append(f"By geometry alone: {prediction.headline}; {_agreement(prediction)}")
    return tuple(lines)


def flown_by(setup: FlightSetup) -> str:
    """Who steers, in words: planfly's guidance or ArduPlane, with the parameters that decide most of its flight."""
    parameters = setup.parameters
    if parameters is None:
        return _GUIDANCE[setup.guidance]
    whose = f"the parameters of {parameters.source}" if parameters.source else "its default parameters"
    return (
        f"ArduPlane's law with {whose} (WP_RADIUS {parameters.wp_radius:g} m,"
        f" NAVL1_PERIOD {parameters.navl1_period:g} s, TECS_HDEM_TCONST {parameters.tecs_height_demand_time:g} s)"
    )


def _parameter_lines(setup: FlightSetup) -> list[str]:
    """Where ArduPlane's parameters are from, if a file states any, and which of the file's have no use here."""
    parameters = setup.parameters
    if parameters is None or not parameters.source:
        return []
    names = {origin: len(parameters.by_origin(origin)) for origin in ("file", "aircraft", "default")}
    unused = list(parameters.unused[:_NAMED])
    more = len(parameters.unused) - len(unused)
    said = f"; not used: {', '.join(unused)}{f', +{more} more' if more else ''}" if unused else ""
    return [
        f"Parameters: {names['file']} of the file, {names['aircraft']} of the aircraft,"
        f" {names['default']} ArduPlane's defaults{said}"
    ]


def _less_error(findings: Sequence[Finding], setup: FlightSetup) -> list[str]:
    """The least clearance less the terrain's stated error, where one is stated."""
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
        f"Terrain's stated error: {error:g} m; the least clearance is {low:.1f} m, {low - error:.1f} m less that error"
        f" ({required:g} m are required)"
    ]


def _agreement(prediction: Prediction) -> str:
    differing = prediction.disagreements
    if not differing:
        return "flight and geometry agree on every finding"
    more = f", +{len(differing) - _NAMED} more" if len(differing) > _NAMED else ""
    return "; ".join(map(disagreement_text, differing[:_NAMED])) + more
