"""Describe returns in words."""

import math
from collections.abc import Sequence

from flight.autopilots.arduplane.failsafes import Cause
from flight.mission.return_path import ReturnPlace
from logs.verdict.returns.judge_returns import KINDS, Kind, Open, ReturnFlown, ReturnRange, Returns
from logs.verdict.returns.suggest_returns import Remedy
from world.frames import to_geo
from world.scenario import Scenario

# Outcome of one return, and of several.
_SINGULAR_TEXTS: dict[Kind, str] = {
    "ground": "hits the ground",
    "threat": "enters a missile's sphere",
    "zone": "violates a zone",
    "lost": "does not arrive",
    "energy": "takes more energy than may be used",
    "unknown": "flies where the ground is not known",
    "power": "may take more energy than may be used, as the power of the aircraft is uncertain",
    "unsure": "is flown too differently by the point mass and in JSBSim to be judged",
    "low": "comes lower than {limit:.0f} m above ground",
}
_PLURAL_TEXTS: dict[Kind, str] = {
    "ground": "hit the ground",
    "threat": "enter a missile's sphere",
    "zone": "violate a zone",
    "lost": "do not arrive",
    "energy": "take more energy than may be used",
    "unknown": "fly where the ground is not known",
    "power": "may take more energy than may be used, as the power of the aircraft is uncertain",
    "unsure": "are flown too differently by the point mass and in JSBSim to be judged",
    "low": "come lower than {limit:.0f} m above ground",
}
# Name of the path segment from which returns have this outcome.
_SEGMENT_NAMES: dict[Kind, str] = {
    "ground": "a return hits the ground",
    "threat": "a return enters a missile's sphere",
    "zone": "a return violates a zone",
    "lost": "a return does not arrive",
    "energy": "a return takes too much energy",
    "unknown": "a return is not judged: ground not known",
    "power": "a return is not judged: power uncertain",
    "unsure": "a return is not judged: flown too differently",
    "low": "a return comes lower than required",
    "safe": "a return is safe",
}
_ACTION_TEXTS = {
    "return": "returns",
    "land": "lands by its landing sequence",
    "autoland": "lands in mode AUTOLAND, otherwise returns",
    "on": "continues its mission",
    "circle": "circles where it is",
    "glide": "glides straight ahead without its motor, which is not a return",
    "parachute": "releases its parachute",
    "terminate": "ends its flight there",
    "level": "flies straight and level, which is not a return",
    "guided": "circles at the fence's return point",
    "landed": "has landed",
    "never": "set, but no threshold triggers it",
}
_OPEN_TEXTS: dict[Open, str] = {
    "terrain": "with TERRAIN_FOLLOW returns follow the terrain, which is not flown here",
    "law": "the autopilot's own return is not simulated; ArduPlane's return stands in",
    "autoland": "mode AUTOLAND lands by a pattern of its own",
    "return path": "RTL_AUTOLAND 4 returns along the mission's return path",
    "landing": "the landing sequence begins with the landing itself",
}


def way_text(kind: Kind) -> str:
    """Return the name of the path segment from which returns have this outcome.

    >>> way_text("ground")
    'a return hits the ground'
    """
    return _SEGMENT_NAMES[kind]


def outcome_text(ret: ReturnFlown, limit: float) -> str:
    """Return the outcome of one return.  limit: required least height above ground, m."""
    return "is safe" if ret.safe else _SINGULAR_TEXTS[ret.kind].format(limit=limit)


def measured_text(ret: ReturnFlown, limit: float, scenario: Scenario) -> str:
    """Return the destination of one return, its outcome, and its distances from ground and spheres.

    limit: required least height above ground, m.
    """
    east, north, _ = ret.clearance_at
    where = f"{east:.0f} m east, {north:.0f} m north"
    parts = [f"to {ret.target.name}", outcome_text(ret, limit)]
    if ret.kind == "ground":
        parts[-1] += f" at {where}"
    elif not math.isnan(ret.clearance):
        parts.append(f"{ret.clearance:.0f} m above ground at the lowest, at {where}")
    if ret.threat >= 0 and ret.outside <= 0.0:
        parts.append(f"{-ret.outside:.0f} m inside the sphere of {scenario.threats.names[ret.threat]}")
    elif math.isfinite(ret.outside):
        parts.append(f"{ret.outside:.0f} m outside every missile's sphere")
    return ", ".join(parts)


def counts_text(returns: Returns) -> str:
    """Return the number of returns per outcome, the worst first; "" if all are safe."""
    counts = {kind: returns.count(kind) for kind in KINDS if kind != "safe"}
    texts = {
        kind: (_SINGULAR_TEXTS if count == 1 else _PLURAL_TEXTS)[kind].format(limit=returns.limit)
        for kind, count in counts.items()
    }
    return ", ".join(f"{count} {texts[kind]}" for kind, count in counts.items() if count)


def headline(returns: Returns) -> str:
    """Return a one-line summary of all returns.

    >>> from logs.verdict.measures.route_requirements import Airspace
    >>> headline(Returns((), 1.0, (), 60.0, None, 0.0, True))
    'no place to return from'
    >>> headline(Returns((), 1.0, (), 60.0, None, 0.0, True, open=("terrain",)))
    'not judged: with TERRAIN_FOLLOW returns follow the terrain, which is not flown here'
    """
    reasons = "; ".join(_OPEN_TEXTS[reason] for reason in returns.open)
    if not returns.each:
        return f"not judged: {reasons}" if reasons else "no place to return from"
    landing = "; the landing is not judged" if returns.lands else ""
    left_out_text = (
        f"; {returns.left_out} on or near the ground in take-off and landing left out" if returns.left_out else ""
    )
    return (f"not judged in full ({reasons}): " if reasons else "") + _judged_text(returns) + left_out_text + landing


def _judged_text(returns: Returns) -> str:
    total, failures = len(returns.each), counts_text(returns)
    if failures:
        safe = returns.count("safe")
        return f"of {total} returns {failures}; {safe} {'is' if safe == 1 else 'are'} safe"
    # Returns that begin below the limit, as after a take-off, say nothing about the path home.
    high_returns = [ret for ret in returns.each if not ret.floor < returns.limit] or returns.each
    lowest = min(high_returns, key=lambda ret: ret.clearance)
    least_left = min((ret.left for ret in returns.each if not math.isnan(ret.left)), default=math.nan)
    energy = "" if math.isnan(least_left) else f", and at least {least_left:.0f} Wh are left"
    until_text = " up to their landing" if returns.lands else ""
    return f"all {total} returns are safe{until_text}: never lower than {lowest.clearance:.0f} m above ground{energy}"


def no_return_text(returns: Returns) -> str:
    """Describe the place from which the battery no longer permits a return with reserve.

    >>> no_return_text(Returns((), 1.0, (), 60.0, None, 0.0, True))
    'point of no return: not judged, as the energy in the battery is not known'
    """
    point, name = returns.point_of_no_return, "point of no return"
    reserve = f"the reserve of {returns.reserve:.0f} Wh"
    match point.kind:
        case "battery":
            return f"{name}: not judged, as the energy in the battery is not known"
        case "used":
            return f"{name}: not judged, as the energy used before is not known"
        case "power":
            return f"{name}: not judged, as the power of the aircraft is uncertain"
        case "arrives":
            return f"{name}: not judged, as no return arrives"
        case "at once":
            text = f"{name}: before the start, as no return leaves {reserve}"
        case "later":
            text = f"{name}: {point.time:.0f} s; a return that starts later does not leave {reserve}"
        case "never":
            text = f"{name}: none, as every return leaves {reserve} (at least {point.left:.0f} Wh)"
    verb = "does" if point.skipped == 1 else "do"
    return text + (f"; {point.skipped} that {verb} not arrive are left out" if point.skipped else "")


def causes_text(causes: tuple[Cause, ...]) -> list[str]:
    """Describe, in two lines, which events make the aircraft return and which do not.

    >>> from flight.autopilots.arduplane.failsafes import failsafe_causes
    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> made = ArduPilotParameters.defaults().changed(FS_GCS_ENABL=1, FS_LONG_ACTN=1)
    >>> for line in causes_text(failsafe_causes(made, has_fence=False)):
    ...     print(line)
    it returns: the pilot's RTL, the mission's end, RC lost (FS_LONG_ACTN 1), station lost (FS_LONG_ACTN 1)
    it does not: battery low (BATT_FS_LOW_ACT 0), battery critical (BATT_FS_CRT_ACT 0): continues its mission
    """

    def setting_text(cause: Cause) -> str:
        return f" ({cause.parameter} {cause.value})" if cause.parameter else ""

    returning = [f"{cause.name}{setting_text(cause)}" for cause in causes if cause.returns]
    lines = [f"it returns: {', '.join(returning)}"] if returning else []
    for heading, is_landing in (("it lands", True), ("it does not", False)):
        other_causes: dict[str, list[str]] = {}
        for cause in causes:
            if not cause.returns and (cause.does in ("land", "autoland")) == is_landing:
                other_causes.setdefault(_ACTION_TEXTS[cause.does], []).append(f"{cause.name}{setting_text(cause)}")
        text = [f"{', '.join(names)}: {action}" for action, names in other_causes.items()]
        lines += [f"{heading}: {'; '.join(text)}"] if text else []
    return lines


def landing_text(returns: Returns) -> list[str]:
    """Describe, in lines, how RTL_AUTOLAND ends a return, and the landing sequence.

    Return [] for another autopilot.

    >>> landing_text(Returns((), 1.0, (), 60.0, None, 0.0, True, autoland=0))
    ['RTL_AUTOLAND 0: a return stays in its circle']
    """
    if returns.autoland is None:
        return []
    stays_text = "a return stays in its circle"
    items_text = (
        f"item{'s' if len(returns.landings) > 1 else ''} {', '.join(str(landing.item) for landing in returns.landings)}"
    )
    match returns.autoland, bool(returns.landings):
        case 0, True:
            text = f"{stays_text}; with this setting and DO_LAND_START in the mission ArduPlane does not arm"
        case ((1 | 2), False):
            text = f"the mission has no DO_LAND_START: {stays_text}"
        case 1, True:
            text = f"from its circle a return continues to the landing sequence at {items_text}"
        case 2, True:
            text = f"a return flies straight to the landing sequence at {items_text}"
        case 3, _:
            text = f"the landing sequence is for go-arounds only: {stays_text}"
        case 4, _:
            text = "a return follows the mission's return path, if it has one"
        case _:
            text = stays_text
    lines = [f"RTL_AUTOLAND {returns.autoland}: {text}"]
    if returns.landings:
        lines.append("within the landing sequence, the loss of transmitter or station changes nothing")
    return lines


def range_text(return_range: ReturnRange, returns: Returns, scenario: Scenario) -> str:
    """Describe a time range: destination and outcome of its returns, and its worst return."""
    worst = return_range.worst
    when = (
        f"{return_range.first:.0f} s"
        if return_range.count == 1
        else f"{return_range.first:.0f} to {return_range.last:.0f} s"
    )
    reason = f" ({worst.target.reason})" if worst.target.reason else ""
    return f"{when}: to {worst.target.name}{reason}: {_range_outcome_text(worst, return_range, returns, scenario)}"


def _range_outcome_text(
    worst_return: ReturnFlown, return_range: ReturnRange, returns: Returns, scenario: Scenario
) -> str:
    prefix = "" if return_range.count == 1 else f"at worst from {worst_return.time:.0f} s, "
    east, north, up = worst_return.clearance_at
    where = f"{east:.0f} m east, {north:.0f} m north"
    digits = 1 if abs(worst_return.clearance - returns.limit) < 1.0 else 0
    height_text = f"{worst_return.clearance:.{digits}f} m above ground at {where}"
    match worst_return.kind:
        case "ground":
            return f"{prefix}hits the ground at {where}, {up:.0f} m AMSL"
        case "threat":
            return (
                f"{prefix}{-worst_return.outside:.0f} m inside the sphere of"
                f" {scenario.threats.names[worst_return.threat]}"
            )
        case "zone":
            return f"{prefix}violates zone {returns.airspace.zones[worst_return.zone].name}"
        case "lost":
            end = "landing sequence" if worst_return.target.landing is not None else "circle"
            return f"{prefix}does not reach its {end} at {worst_return.target.position[2]:.0f} m AMSL"
        case "energy":
            leaves = f"leaves {worst_return.left:.0f} Wh of the required {returns.reserve:.0f} Wh"
            return f"{prefix}takes {worst_return.energy:.0f} Wh and {leaves}"
        case "power":
            leaves = f"leaves {worst_return.left:.0f} Wh of the required {returns.reserve:.0f} Wh"
            return f"{prefix}takes {worst_return.energy:.0f} Wh and {leaves}, but the power is uncertain"
        case "unknown":
            return f"{prefix}flies where the elevation is not known"
        case "unsure":
            return f"{prefix}{height_text} by the point mass, but JSBSim flies it or one near it too far from there"
    if worst_return.floor < returns.limit:
        height_text += " (taking off or landing: it begins below the required height)"
    energy_text = "" if math.isnan(worst_return.left) else f", {worst_return.left:.0f} Wh left"
    sphere_text = (
        "" if math.isinf(worst_return.outside) else f", {worst_return.outside:.0f} m outside every missile's sphere"
    )
    return f"{prefix}{height_text} at the lowest{sphere_text}{energy_text}"


def remedy_text(remedy: Remedy, returns: Returns, scenario: Scenario) -> str:
    """Describe a remedy and the outcome of the returns with it."""
    changes = [f"{name} {value:g}" for name, value in remedy.parameters.items()]
    if remedy.rally is not None:
        noun = "rally point" if len(remedy.rally) == 1 else "rally points"
        changes.append(f"{len(remedy.rally)} {noun} ({'; '.join(rally_texts(remedy.rally, scenario))})")
    return f"{' and '.join(changes)}: {headline(returns)}"


def rally_texts(rally: Sequence[ReturnPlace], scenario: Scenario) -> list[str]:
    """Return latitude, longitude and height above home of rally points, for entry in a ground station."""
    texts = []
    for point in rally:
        lat, lon = (float(value) for value in to_geo(scenario.origin, point.east, point.north))
        texts.append(f"{lat:.7f}, {lon:.7f}, {point.up - point.base:.0f} m over home")
    return texts
