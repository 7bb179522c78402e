"""Answer of ``planfly returns`` with ``--json``."""

import math
from typing import Literal

from pydantic.dataclasses import dataclass

from logs.verdict.conditions import Conditions
from logs.verdict.returns.glides_text import glide_range_text, glides_headline
from logs.verdict.returns.judge_glides import GLIDE_CLEARANCE_M
from logs.verdict.returns.judge_returns import ReturnRange, SimulatedReturn
from logs.verdict.returns.returns_text import return_range_text, returns_headline
from planfly.api.returning import RemedyTrial, ReturnsResult
from planfly.terminal.verdict_answers import STRICT
from world.frames import to_geo


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CauseEntry:
    """A trigger that ends the mission, or may end it."""

    name: str
    does: str
    """Action: return, land, autoland, on, circle, glide, parachute, terminate, level, guided, landed, never, land here
    or disarm."""
    parameter: str
    """Parameter that decides the action; empty if there is none."""
    value: int


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReturnEntry:
    """Consecutive returns with the same target and outcome; the numbers are those of the worst return."""

    first_s: float
    last_s: float
    count: int
    kind: str
    """ground, threat, zone, lost, energy, unknown, power, used, unsure, low or safe."""
    target: str
    """home, a rally point by its number, or a landing sequence by its first item."""
    reason: str
    """Reason for the choice of the target; empty if there is no choice."""
    worst_at_s: float
    clearance_m: float | None
    clearance_east_m: float | None
    clearance_north_m: float | None
    outside_m: float | None
    """Least distance outside the sphere of a missile, m; null if there is no missile."""
    threat: str | None
    zone: str | None
    energy_wh: float | None
    left_wh: float | None
    text: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class RallyEntry:
    """A rally point."""

    lat_deg: float
    lon_deg: float
    over_home_m: float


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReturnSuggestion:
    """A remedy."""

    parameters: dict[str, float]
    rally: list[RallyEntry] | None
    """Rally points that replace those of the mission; null keeps the mission's rally points."""
    safe: int
    unsafe: int
    headline: str
    """Outcome of the returns with this remedy, in one line."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class MeasuredReturn:
    """Outcome of one return."""

    kind: str
    target: str
    clearance_m: float | None
    outside_m: float | None
    """Least distance outside the sphere of a missile, m; null if there is no missile."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ProgramReturnEntry:
    """A return that the ArduPlane program also flew."""

    at_s: float
    east_m: float
    north_m: float
    law: MeasuredReturn
    program: MeasuredReturn | None
    """Outcome of the flight by the program; null if it could not be flown."""
    agrees: bool
    """True if both returns have the same target and the same outcome."""
    worse: bool
    """True if the program's outcome is worse and replaces the simulated outcome."""
    reason: str
    """Reason why the program could not fly the return; empty if it did."""
    log: str | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ByProgram:
    """The worst returns flown by the ArduPlane program, the worst first."""

    version: str
    """Version of the program; empty if the program flew none of the returns."""
    returns: list[ProgramReturnEntry]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class GlideEntry:
    """Consecutive glides that reach the same place.

    The numbers are those of the glide with the least height left.
    """

    first_s: float
    last_s: float
    count: int
    reach: str
    """Place that can be reached: home, site, flat, nothing or unknown."""
    site: int | None
    """Number of the site that can be reached; null for none."""
    least_at_s: float
    left_m: float | None
    """Height left at the place, m; negative if the glide falls short; null if no glide path leads to a place."""
    flat_east_m: float | None
    """Flat ground that can be reached, m east; null for none."""
    flat_north_m: float | None
    own: str
    """Outcome of the autopilot's own return without thrust: arrives, low, ground, threat, unknown or not flown."""
    own_target: str
    own_over_m: float | None
    """Height above ground of the autopilot's return over its target, m; null if it does not get there."""
    own_short_m: float | None
    """Distance of the touchdown of the autopilot's return from its target, m; null if it does not come down."""
    text: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class GlideSiteEntry:
    """A place to glide to."""

    kind: str
    """Kind of the place: home, rally or landing."""
    number: int
    """Number of the rally point or of the mission item."""
    east_m: float
    north_m: float


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class GlidesEntry:
    """Reach of the aircraft without its engine."""

    headline: str
    not_judged: str
    """Reason why glides are not judged: terrain or far; empty if they are judged."""
    airspeed_mps: float
    """Equivalent airspeed of the glides, m/s."""
    margin_m: float
    cell_m: float | None
    sites: list[GlideSiteEntry]
    home: int
    """Number of places from which home can be reached; the next four fields count the other places."""
    site: int
    flat: int
    nothing: int
    unknown: int
    own_arrives: int
    """Number of places from which the autopilot's own return arrives over its target, at margin_m or higher."""
    ranges: list[GlideEntry]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReturnsAnswer:
    """planfly returns: the returns in ranges of seconds, the worst first."""

    schema: Literal["planfly.returns/1"] = "planfly.returns/1"
    exit_code: int
    what: str
    headline: str
    safe: bool
    conditions: Conditions
    every_s: float
    least_clearance_m: float
    causes: list[CauseEntry]
    rtl_autoland: int | None
    """ArduPlane's parameter RTL_AUTOLAND; null if another autopilot flies."""
    not_judged: list[str]
    """Reasons that leave the returns undecided: terrain, law, autoland, return path, landing, or a clause that names a
    setting of the autopilot."""
    ranges: list[ReturnEntry]
    by_program: ByProgram | None
    """Returns flown with --sitl; worse outcomes are counted in headline and ranges."""
    left_out: int
    """Number of places that were left out: on the ground, or too low in a take-off or a landing to return."""
    starts_too_low: int
    """Number of returns that begin where the flight itself is below the required height; they are not safe."""
    no_return: str
    """Point of no return by energy: never, at once or later (no_return_s); if unknown, battery, used, power, arrives or
    not flown."""
    no_return_s: float | None
    engine_out: GlidesEntry
    suggestions: list[ReturnSuggestion]
    """Remedies found with --suggest."""
    files: list[str]
    """Files written with --out: pictures, map and log."""
    notes: list[str]


def suggestion_entry(result: ReturnsResult, trial: RemedyTrial) -> ReturnSuggestion:
    """Return the JSON entry of a suggested remedy.

    The entry has the numbers of safe and unsafe returns with this remedy.
    """
    rally = None
    if trial.remedy.rally is not None:
        rally = []
        for point in trial.remedy.rally:
            lat, lon = (float(value) for value in to_geo(result.setup.scenario.origin, point.east, point.north))
            rally.append(
                RallyEntry(lat_deg=round(lat, 7), lon_deg=round(lon, 7), over_home_m=round(point.up - point.base, 1))
            )
    return ReturnSuggestion(
        parameters=trial.remedy.parameters,
        rally=rally,
        safe=trial.returns.count("safe"),
        unsafe=len(trial.returns.each) - trial.returns.count("safe"),
        headline=returns_headline(trial.returns),
    )


def program_returns_entry(result: ReturnsResult) -> ByProgram | None:
    """Return the JSON entry of the returns that the ArduPlane program flew.

    Returns None if the program was not used.
    """
    if result.by_program is None:
        return None
    log_path_by_name = {log.name: str(log) for log in result.files}
    entries = [
        ProgramReturnEntry(
            at_s=round(pair.simulated.time, 2),
            east_m=round(pair.simulated.start[0], 1),
            north_m=round(pair.simulated.start[1], 1),
            law=_measured_return(pair.simulated),
            program=None if pair.flown is None else _measured_return(pair.flown),
            agrees=pair.agrees,
            worse=pair.worse,
            reason=pair.reason,
            log=None if pair.log is None else log_path_by_name.get(pair.log.name),
        )
        for pair in result.by_program.pairs
    ]
    return ByProgram(version=result.by_program.program, returns=entries)


def _measured_return(simulated_return: SimulatedReturn) -> MeasuredReturn:
    """Return the JSON entry of a return: outcome, target, and smallest distances from ground and missiles."""
    return MeasuredReturn(
        kind=simulated_return.kind,
        target=simulated_return.target.name,
        clearance_m=_round_to_tenths(simulated_return.clearance),
        outside_m=_round_to_tenths(simulated_return.sphere_distance),
    )


def _round_to_tenths(value: float) -> float | None:
    """Return a number rounded to one decimal, or None if it is not finite."""
    return round(value, 1) if math.isfinite(value) else None


def glides_entry(result: ReturnsResult) -> GlidesEntry:
    """Return the JSON entry of all glides after an engine failure, in ranges with the same place in reach."""
    glides = result.glides
    entries = []
    for glide_range in glides.ranges:
        glide = glide_range.lowest_glide
        entries.append(
            GlideEntry(
                first_s=round(glide_range.first, 2),
                last_s=round(glide_range.last, 2),
                count=glide_range.count,
                reach=glide.reach,
                site=glide_range.site if glide_range.site >= 0 else None,
                least_at_s=round(glide.time, 2),
                left_m=_round_to_tenths(glides.altitude_left(glide)),
                flat_east_m=_round_to_tenths(glide.flat_position[0]),
                flat_north_m=_round_to_tenths(glide.flat_position[1]),
                own=glide.own_return.end,
                own_target=glide.own_return.target.name,
                own_over_m=_round_to_tenths(glide.own_return.arrival_height),
                own_short_m=_round_to_tenths(glide.own_return.shortfall),
                text=glide_range_text(glide_range, glides),
            )
        )
    return GlidesEntry(
        headline=glides_headline(glides),
        not_judged=glides.not_judged,
        airspeed_mps=glides.airspeed,
        margin_m=GLIDE_CLEARANCE_M,
        cell_m=_round_to_tenths(glides.cell),
        sites=[
            GlideSiteEntry(kind=site.kind, number=site.number, east_m=round(site.east, 1), north_m=round(site.north, 1))
            for site in glides.sites
        ],
        own_arrives=glides.arrival_count,
        home=glides.count("home"),
        site=glides.count("site"),
        flat=glides.count("flat"),
        nothing=glides.count("nothing"),
        unknown=glides.count("unknown"),
        ranges=entries,
    )


def return_range_entry(result: ReturnsResult, return_range: ReturnRange) -> ReturnEntry:
    """Return the JSON entry of consecutive returns with the same outcome.

    Its numbers are those of the worst return.
    """
    worst_return, scenario, round_to_tenths = return_range.worst, result.setup.scenario, _round_to_tenths
    return ReturnEntry(
        first_s=round(return_range.first, 2),
        last_s=round(return_range.last, 2),
        count=return_range.count,
        kind=worst_return.kind,
        target=worst_return.target.name,
        reason=worst_return.target.reason,
        worst_at_s=round(worst_return.time, 2),
        clearance_m=round_to_tenths(worst_return.clearance),
        clearance_east_m=round_to_tenths(worst_return.lowest_position[0]),
        clearance_north_m=round_to_tenths(worst_return.lowest_position[1]),
        outside_m=round_to_tenths(worst_return.sphere_distance),
        threat=scenario.threats.names[worst_return.threat] if worst_return.kind == "threat" else None,
        zone=result.returns.airspace.zones[worst_return.zone].name if worst_return.zone >= 0 else None,
        energy_wh=round_to_tenths(worst_return.energy),
        left_wh=round_to_tenths(worst_return.energy_left),
        text=return_range_text(return_range, result.returns, scenario),
    )
