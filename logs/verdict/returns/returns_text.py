"""Describe simulated returns to launch in words."""

import math
from collections.abc import Sequence

from flight.autopilots.parts import Cause, FailsafeAction
from flight.mission.return_path import ReturnPoint
from flight.simulation.setup import FlightSetup
from logs.verdict.returns.judge_returns import (
    KINDS,
    POINT_MASS_ERROR_M,
    POINT_MASS_POSITION_ERROR_M,
    UNJUDGED,
    UNSAFE,
    Kind,
    ReturnRange,
    Returns,
    SimulatedReturn,
    make_return_world,
)
from logs.verdict.returns.suggest_returns import Remedy
from logs.verdict.tolerances import CLEARANCE_TOLERANCE_M
from logs.verdict.wording import compared_texts, energy_left_text, quantity_text
from world.frames import to_geo
from world.scenario import Scenario
from world.wording import count_text

# Verb phrases for the outcome of one return; `limit` and `zones` are filled in.
_SINGULAR_TEXTS: dict[Kind, str] = {
    "ground": "hits the ground",
    "threat": "enters a missile's sphere",
    "zone": "violates {zones}",
    "lost": "does not arrive",
    "energy": "uses more energy than allowed",
    "unknown": "flies where the terrain is unknown",
    "power": "may use more energy than allowed, because the aircraft's power is uncertain",
    "used": "cannot be judged by energy, because the energy used before it is unknown",
    "unsure": "cannot be judged because the point mass and JSBSim disagree",
    "low": "descends below {limit:.0f} m above ground",
}
# Verb phrases for the outcome of several returns.
_PLURAL_TEXTS: dict[Kind, str] = {
    "ground": "hit the ground",
    "threat": "enter a missile's sphere",
    "zone": "violate {zones}",
    "lost": "do not arrive",
    "energy": "use more energy than allowed",
    "unknown": "fly where the terrain is unknown",
    "power": "may use more energy than allowed, because the aircraft's power is uncertain",
    "used": "cannot be judged by energy, because the energy used before them is unknown",
    "unsure": "cannot be judged because the point mass and JSBSim disagree",
    "low": "descend below {limit:.0f} m above ground",
}
# Largest number of violated zones that a summary names.
_MAX_NAMED_ZONES = 3
# Legend text of a path segment from which returns have this outcome.
_SEGMENT_NAMES: dict[Kind, str] = {
    "ground": "a return hits the ground",
    "threat": "a return enters a missile's sphere",
    "zone": "a return violates a zone",
    "lost": "a return does not arrive",
    "energy": "a return takes too much energy",
    "unknown": "a return is not judged: terrain unknown",
    "power": "a return is not judged: power uncertain",
    "used": "a return is not judged: energy used before unknown",
    "unsure": "a return is not judged: the point mass and JSBSim disagree",
    "low": "a return descends below the required height",
    "safe": "a return is safe",
}
# Texts for the reactions of an autopilot to a failure.
ACTION_TEXTS: dict[FailsafeAction, str] = {
    "return": "returns",
    "land": "lands by its landing sequence",
    "land here": "lands where it is",
    "autoland": "lands in mode AUTOLAND if it can, and otherwise returns",
    "on": "continues its mission",
    "circle": "circles where it is",
    "glide": "glides straight ahead without its motor, which is not a return",
    "parachute": "releases its parachute",
    "terminate": "ends its flight there",
    "disarm": "stops its motor, which ends its flight",
    "level": "flies straight and level, which is not a return",
    "guided": "circles at the fence's return point",
    "landed": "has landed",
    "never": "set, but no threshold triggers it",
}
# Clauses on the parts of returns that are not judged, by the name of the part in JSON answers.
UNJUDGED_PART_TEXTS = {
    "terrain": "with TERRAIN_FOLLOW returns follow the terrain, which is not simulated",
    "law": "the autopilot's own return is not simulated; ArduPlane's return is used instead",
    "autoland": "mode AUTOLAND lands by a pattern of its own",
    "return path": "RTL_AUTOLAND 4 returns along the mission's return path",
    "landing": "the landing sequence begins with the landing itself",
}


def unjudged_parts_text(parts: Sequence[str]) -> str:
    """Describe the parts of returns that are not judged; return "" if all are judged.

    >>> unjudged_parts_text(("autoland", "RTL_LAND_DELAY 0 lands after the return, which is not simulated"))
    'mode AUTOLAND lands by a pattern of its own; RTL_LAND_DELAY 0 lands after the return, which is not simulated'
    """
    return "; ".join(UNJUDGED_PART_TEXTS.get(part, part) for part in parts)


def return_law_lines(setup: FlightSetup) -> list[str]:
    """Return lines on simulated returns to launch.

    They state the autopilot's control law, the path of the returns, and unjudged parts.

    Return [] for a mission without a home.
    """
    if setup.mission.home is None:
        return []
    world = make_return_world(setup)
    behaviour, unjudged = world.autopilot.returns, world.unjudged_parts
    lines = [f"returns to launch are simulated with a point-mass model under {world.autopilot.title}'s control laws"]
    lines += [behaviour.path_text] if behaviour.path_text else []
    if unjudged:
        extent = "in full" if world.is_simulated else "at all"
        lines.append(f"the returns are not judged {extent}: {unjudged_parts_text(unjudged)}")
    return lines


def segment_text(kind: Kind) -> str:
    """Return the legend text of a path segment from which returns have a given outcome.

    >>> segment_text("ground")
    'a return hits the ground'
    """
    return _SEGMENT_NAMES[kind]


def outcome_text(ret: SimulatedReturn, limit: float) -> str:
    """Describe the outcome of one return, such as "is safe" or "hits the ground".

    limit: required minimum height above ground, m.
    """
    if ret.kind == "zone" and ret.violation is not None:
        side, (east, north) = "outside" if ret.violation.is_inclusion else "inside", ret.violation.position
        depth_text = quantity_text(ret.violation.depth, "m")
        return f"is {depth_text} {side} zone {ret.violation.name} at {east:.0f} m east, {north:.0f} m north"
    return "is safe" if ret.safe else _SINGULAR_TEXTS[ret.kind].format(limit=limit, zones="a zone")


def measured_text(ret: SimulatedReturn, limit: float, scenario: Scenario) -> str:
    """Describe one return: destination, outcome, minimum height, and distance from missile spheres.

    limit: required minimum height above ground, m.
    """
    east, north, _ = ret.lowest_position
    position_text = f"{east:.0f} m east, {north:.0f} m north"
    parts = [f"leads to {ret.target.name} and {outcome_text(ret, limit)}"]
    if ret.kind == "ground":
        parts[-1] += f" at {position_text}"
    elif math.isfinite(ret.clearance):
        parts.append(f"{_height_text(ret, limit)} at the lowest point, at {position_text}")
    if ret.threat >= 0 and ret.sphere_distance <= 0.0:
        parts.append(f"{-ret.sphere_distance:.0f} m inside the sphere of {scenario.threats.names[ret.threat]}")
    elif math.isfinite(ret.sphere_distance):
        parts.append(f"{ret.sphere_distance:.0f} m outside every missile's sphere")
    return ", ".join(parts)


def failure_counts_text(returns: Returns) -> str:
    """Count the unsafe returns by outcome, worst first, such as "3 hit the ground"; "" if all are safe."""
    counts = {kind: returns.count(kind) for kind in KINDS if kind != "safe"}
    texts = {kind: _kind_text(returns, kind, is_plural=count != 1) for kind, count in counts.items()}
    return ", ".join(f"{count} {texts[kind]}" for kind, count in counts.items() if count)


def _kind_text(returns: Returns, kind: Kind, *, is_plural: bool) -> str:
    """Return the verb phrase for an outcome, such as "hit the ground", with the names of violated zones.

    is_plural: True for a verb in the plural.
    """
    violations = [ret.violation for ret in returns.each if ret.kind == "zone" and ret.violation is not None]
    names = list(dict.fromkeys(violation.name for violation in violations))
    more_text = f" and {len(names) - _MAX_NAMED_ZONES} more" if len(names) > _MAX_NAMED_ZONES else ""
    zones_text = f"{'zone' if len(names) == 1 else 'zones'} {', '.join(names[:_MAX_NAMED_ZONES])}{more_text}"
    texts = _PLURAL_TEXTS if is_plural else _SINGULAR_TEXTS
    return texts[kind].format(limit=returns.limit, zones=zones_text if names else "a zone")


def returns_headline(returns: Returns) -> str:
    """Summarize all simulated returns to launch in one line.

    >>> from logs.verdict.measures.route_requirements import Airspace
    >>> returns_headline(Returns((), 1.0, (), 60.0, None, 0.0, True))
    'no position to return from'
    >>> returns_headline(Returns((), 1.0, (), 60.0, None, 0.0, True, unjudged_parts=("terrain",)))
    'not judged: with TERRAIN_FOLLOW returns follow the terrain, which is not simulated'
    """
    reasons = unjudged_parts_text(returns.unjudged_parts)
    if not returns.each:
        return f"not judged: {reasons}" if reasons else "no position to return from"
    landing_suffix = "; the landing is not judged" if returns.lands else ""
    omitted_text = (
        f"; {count_text(returns.omitted_count, 'start')} on or near the ground during take-off and landing omitted"
        if returns.omitted_count
        else ""
    )
    low_count = returns.too_low_start_count
    low_text = (
        f"; at {count_text(low_count, 'start')} the flight itself is below the required height" if low_count else ""
    )
    incomplete_text = f"not judged in full ({reasons}): " if reasons else ""
    total, failure_counts = len(returns.each), failure_counts_text(returns)
    common_kind = next((kind for kind in KINDS if returns.count(kind) == total), None)
    subject, verb = (f"all {total} returns", "are") if total > 1 else ("the only return", "is")
    if failure_counts and common_kind is not None:
        judged_text = f"{subject} {_kind_text(returns, common_kind, is_plural=total > 1)}"
    elif failure_counts:
        safe_count, (first_count, _, outcomes) = returns.count("safe"), failure_counts.partition(" ")
        safe_text = "none is" if safe_count == 0 else "1 is" if safe_count == 1 else f"{safe_count} are"
        judged_text = f"{first_count} of {total} returns {outcomes}; {safe_text} safe"
    else:
        # Returns that begin below the limit, as after a take-off, are left out: their lowest point is the start.
        high_returns = [ret for ret in returns.each if not ret.required_height < returns.limit] or returns.each
        lowest_return = min(high_returns, key=lambda ret: ret.clearance)
        energies_left = [ret.energy_left for ret in returns.each if not math.isnan(ret.energy_left)]
        energy_text = f", and at least {quantity_text(min(energies_left), 'Wh')} are left" if energies_left else ""
        end_text = f" up to {'its' if total == 1 else 'their'} landing" if returns.lands else ""
        height_text = f"never lower than {lowest_return.clearance:.0f} m above ground"
        judged_text = f"{subject} {verb} safe{end_text}: {height_text}{energy_text}"
    return f"{incomplete_text}{judged_text}{low_text}{omitted_text}{landing_suffix}"


def point_of_no_return_text(returns: Returns) -> str:
    """Describe the point of no return, after which a return to launch no longer leaves the energy reserve.

    >>> point_of_no_return_text(Returns((), 1.0, (), 60.0, None, 0.0, True))
    'point of no return by energy: not judged, because no return was simulated'
    """
    point, name = returns.point_of_no_return, "point of no return by energy"
    reserve = f"the reserve of {quantity_text(returns.reserve, 'Wh')}"
    match point.kind:
        case "battery":
            return f"{name}: not judged, because the battery energy is unknown"
        case "used":
            return f"{name}: not judged, because the energy used before is unknown"
        case "power":
            return f"{name}: not judged, because the power of the aircraft is uncertain"
        case "arrives":
            return f"{name}: not judged, because no return arrives"
        case "not flown":
            return f"{name}: not judged, because no return was simulated"
        case "at once":
            text = f"{name}: before the start, because no return leaves {reserve}"
        case "later":
            text = f"{name}: {point.time:.0f} s; a return that starts later does not leave {reserve}"
        case "never":
            left_text = f"at least {quantity_text(point.remaining_energy, 'Wh')} are left"
            arrives_text = "every return that arrives" if point.skipped_count else "every return"
            text = f"{name}: none, because {arrives_text} leaves {reserve} ({left_text})"
    if not point.skipped_count:
        return text
    verb, be = ("does", "is") if point.skipped_count == 1 else ("do", "are")
    return f"{text}; {count_text(point.skipped_count, 'return')} that {verb} not arrive {be} left out"


def describe_return_causes(causes: tuple[Cause, ...]) -> list[str]:
    """List, in up to three lines, the events that cause a return to launch, a landing, or neither.

    >>> from flight.autopilots.arduplane.failsafes import failsafe_causes
    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> made = ArduPilotParameters.defaults().changed(FS_GCS_ENABL=1, FS_LONG_ACTN=1)
    >>> for line in describe_return_causes(failsafe_causes(made, has_fence=False)):
    ...     print(line)
    causes of a return: the pilot's RTL, the mission's end, RC lost (FS_LONG_ACTN 1), station lost (FS_LONG_ACTN 1)
    no return after battery low (BATT_FS_LOW_ACT 0), battery critical (BATT_FS_CRT_ACT 0): the aircraft ...
    """

    def setting_text(cause: Cause) -> str:
        """Return the parameter that decides the reaction to an event, and its value, in brackets."""
        return f" ({cause.parameter} {cause.value})" if cause.parameter else ""

    returning = [f"{cause.name}{setting_text(cause)}" for cause in causes if cause.is_return]
    lines = [f"causes of a return: {', '.join(returning)}"] if returning else []
    for heading, is_landing in (("landing after", True), ("no return after", False)):
        other_causes: dict[str, list[str]] = {}
        for cause in causes:
            if not cause.is_return and (cause.action in ("land", "autoland", "land here")) == is_landing:
                subject = "" if cause.action == "never" else "the aircraft "
                action_text = subject + ACTION_TEXTS[cause.action]
                other_causes.setdefault(action_text, []).append(f"{cause.name}{setting_text(cause)}")
        text = [f"{', '.join(names)}: {action}" for action, names in other_causes.items()]
        lines += [f"{heading} {'; '.join(text)}"] if text else []
    return lines


def describe_rtl_ending(returns: Returns) -> list[str]:
    """Describe in one or two lines how ArduPlane's RTL ends.

    This depends on RTL_AUTOLAND and the mission's landing sequences.

    For any other autopilot, return its line on the path of an RTL, or [] if it has none.

    >>> describe_rtl_ending(Returns((), 1.0, (), 60.0, None, 0.0, True, autoland=0))
    ['RTL_AUTOLAND 0: a return ends in a loiter at its target']
    """
    if returns.autoland is None:
        return [returns.path_text] if returns.path_text else []
    loiter_text = "a return ends in a loiter at its target"
    items_text = (
        f"item{'s' if len(returns.landings) > 1 else ''} {', '.join(str(landing.item) for landing in returns.landings)}"
    )
    match returns.autoland, bool(returns.landings):
        case 0, True:
            text = f"{loiter_text}; with this setting and DO_LAND_START in the mission ArduPlane does not arm"
        case ((1 | 2), False):
            text = f"the mission has no DO_LAND_START: {loiter_text}"
        case 1, True:
            text = f"from its loiter a return continues to the landing sequence at {items_text}"
        case 2, True:
            text = f"a return flies straight to the landing sequence at {items_text}; RTL_ALTITUDE has no effect"
        case 3, _:
            text = f"the landing sequence is for go-arounds only: {loiter_text}"
        case 4, _:
            text = "a return follows the mission's return path, if it has one"
        case _:
            text = loiter_text
    assumed_text = " (assumed: with 0 ArduPlane does not arm)" if returns.autoland_assumed else ""
    lines = [f"RTL_AUTOLAND {returns.autoland}{assumed_text}: {text}"]
    if returns.landings:
        lines.append("within the landing sequence, the loss of the RC or GCS link has no effect")
    return lines


def return_range_text(return_range: ReturnRange, returns: Returns, scenario: Scenario) -> str:
    """Describe the returns to launch from a time range: judgement, destination and worst return."""
    worst_return = return_range.worst
    time_text = (
        f"{return_range.first:.0f} s"
        if return_range.count == 1
        else f"{return_range.first:.0f} to {return_range.last:.0f} s"
    )
    reason = f" ({worst_return.target.reason})" if worst_return.target.reason else ""
    worst_text, start_text = (
        ("", "") if return_range.count == 1 else ("worst ", f", started at {worst_return.time:.0f} s,")
    )
    start_name = "return started" if return_range.count == 1 else "returns started"
    judgement = (
        "not judged"
        if worst_return.kind in UNJUDGED
        else ("safe" if worst_return.safe else "unsafe" if worst_return.kind in UNSAFE else "too low")
    )
    return (
        f"{start_name} at {time_text}: {judgement}; the {worst_text}return to {worst_return.target.name}"
        f"{reason}{start_text} {_range_outcome_text(worst_return, returns, scenario)}"
    )


def _height_text(ret: SimulatedReturn, limit: float) -> str:
    """Return a return's lowest height above ground as text.

    Near the required height the text has more digits.

    If this is `limit` (m), the text near it also states the requirement and its tolerance.
    """
    if not abs(ret.clearance - ret.required_height) < 1.0:
        return f"{ret.clearance:.0f} m above ground"
    text, _ = compared_texts(ret.clearance, ret.required_height - CLEARANCE_TOLERANCE_M, "m")
    if ret.required_height < limit:
        return f"{text} above ground"
    tolerance_text = quantity_text(CLEARANCE_TOLERANCE_M, "m")
    return f"{text} above ground (required: {quantity_text(limit, 'm')}, with a tolerance of {tolerance_text})"


def _range_outcome_text(worst_return: SimulatedReturn, returns: Returns, scenario: Scenario) -> str:
    """Describe the outcome of the worst return of a time range, with its position, height or energy."""
    east, north, up = worst_return.lowest_position
    position_text = f"{east:.0f} m east, {north:.0f} m north"
    height_text = f"{_height_text(worst_return, returns.limit)} at {position_text}"
    match worst_return.kind:
        case "ground":
            return f"hits the ground at {position_text}, {up:.0f} m AMSL"
        case "threat":
            return (
                f"flies {-worst_return.sphere_distance:.0f} m into the sphere of"
                f" {scenario.threats.names[worst_return.threat]}"
            )
        case "zone":
            return outcome_text(worst_return, returns.limit)
        case "lost":
            end_text = "landing sequence" if worst_return.target.landing is not None else "loiter"
            return f"does not reach its {end_text} at {worst_return.target.position[2]:.0f} m AMSL"
        case "energy" | "power" | "used":
            taken_text = quantity_text(worst_return.energy, "Wh")
            if worst_return.kind == "used":
                energy_outcome = "the energy used before is unknown"
            elif worst_return.energy_left < 0.0:
                energy_outcome = (
                    f"ends with an empty battery, as {quantity_text(worst_return.energy_used, 'Wh')} are used before it"
                )
            else:
                left_text = quantity_text(worst_return.energy_left, "Wh")
                reserve_text = quantity_text(returns.reserve, "Wh")
                uncertain_text = ", but the power is uncertain" if worst_return.kind == "power" else ""
                energy_outcome = f"leaves {left_text} of the required {reserve_text}{uncertain_text}"
            return f"takes {taken_text} and {energy_outcome}"
        case "unknown":
            return "flies where the terrain is unknown"
        case "unsure":
            return (
                f"stays {height_text} according to the point-mass model, but this return or a similar one,"
                f" flown in JSBSim, differs by more than {POINT_MASS_ERROR_M:.0f} m in height or"
                f" {POINT_MASS_POSITION_ERROR_M:.0f} m in distance from a missile's sphere"
            )
    if worst_return.required_height < returns.limit:
        height_text += " (taking off or landing: the flight itself is below the required height)"
    elif worst_return.starts_too_low:
        height_text += " (the flight itself is below the required height where this return begins)"
    energy_text = "" if math.isnan(worst_return.energy_left) else f", with {energy_left_text(worst_return.energy_left)}"
    sphere_text = (
        ""
        if math.isinf(worst_return.sphere_distance)
        else f", {worst_return.sphere_distance:.0f} m outside every missile's sphere"
    )
    return f"comes down to {height_text}{sphere_text}{energy_text}"


def remedy_text(remedy: Remedy, returns: Returns, scenario: Scenario) -> str:
    """Describe a remedy and the outcome of the returns with it.

    returns: returns after the change.
    """
    changes = [f"{name} {value:g}" for name, value in remedy.parameters.items()]
    if remedy.rally is not None:
        noun = "rally point" if len(remedy.rally) == 1 else "rally points"
        changes.append(f"{len(remedy.rally)} {noun} ({'; '.join(rally_texts(remedy.rally, scenario))})")
    return f"{' and '.join(changes)}; then {returns_headline(returns)}"


def rally_texts(rally: Sequence[ReturnPoint], scenario: Scenario) -> list[str]:
    """Return latitude, longitude and height above home of each rally point as text."""
    texts = []
    for point in rally:
        lat, lon = (float(value) for value in to_geo(scenario.origin, point.east, point.north))
        texts.append(f"{lat:.7f}, {lon:.7f}, {point.up - point.base:.0f} m above home")
    return texts
