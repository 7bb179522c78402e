"""The touchdown rule: judge a flown landing, from the last waypoint to where the aircraft stops.

The rule judges the height of the final above ground, the hazards that the final enters, and the places on the
scenario's strip where the aircraft touches down and stops.  It only reports the sink rate towards the ground, which may
slope upwards, because the simulation of ArduPlane's law is accurate down to the flare but less accurate in the last
metres (`docs/measured.md`).  A sink rate beyond all measured ones therefore leaves the landing undecided, and no sink
rate passes or fails it.  The landing and approach rules judge a landing that is not flown, from the mission's items.
"""

import math
from typing import NamedTuple

import numpy as np

from flight.mission.ground_ways import Approach
from flight.simulation.track import Track
from logs.verdict.findings import GROUND_WAY, Fact, Finding, Message, make_finding, message, reason_of
from logs.verdict.measures.path_sweeps import path_clearance
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.ways import first_obstacle_on, track_way
from logs.verdict.places import Place
from logs.verdict.rule import Rule
from logs.verdict.tolerances import (
    CONTACT_HEIGHT_M,
    EARLY_TOUCHDOWN_DISTANCE_M,
    FINAL_APPROACH_CLEARANCE_M,
    FLARE_HEIGHT_MARGIN_M,
    GUST_TOUCHDOWN_ERROR_M,
    LANDING_POINT_ERROR_M,
    MAX_TOUCHDOWN_SINK_MPS,
    TOUCHDOWN_ERROR_M,
)
from logs.verdict.wording import place_text
from world.arrays import Floats
from world.terrain import Terrain

# Length of the strip about the touch-down over which the ground's slope is measured, m.
_SLOPE_RUN_M = 10.0


class _Landing(NamedTuple):
    """Measurements of a landing.

    along, aside: position of the touch-down beyond the landing point and to the right of the landing course, m.
    touch, stop: touch-down and stop, each as distance beyond the strip's center and distance to the side, m.
    left: length of strip remaining beyond the stop, m.
    sink, towards: sink rate at the touch-down, vertical and relative to the sloping ground, m/s.
    room: minimum height of the final above ground, m; inf without a final, NaN if unknown.
    over: height of the landing point above the ground, m.
    """

    along: float
    aside: float
    touch: tuple[float, float]
    stop: tuple[float, float]
    left: float
    sink: float
    towards: float
    room: float
    over: float = math.nan


def touchdown_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge a flown landing; before a flight, only report a strip that is too short."""
    ground = requirements.ground
    if ground is None or ground.ways.approach is None:
        planned = requirements.setup.ground_ways.approach if geometric else None
        return [] if planned is None else _planned_findings(requirements.waypoint(planned.leg + 1), planned)
    approach = ground.ways.approach
    place = ground.whole.waypoint(approach.leg + 1)
    track, terrain = ground.landing, requirements.setup.scenario.terrain
    if ground.left >= len(ground.track) - 1:
        reason = "the flight did not get to its landing"
        fault = message(f"the touchdown at {place_text(place)} is not judged: {reason}")
        return [make_finding("touchdown", place, ok=None, reason=reason, faults=[fault], unit="m", check=GROUND_WAY)]
    over = math.nan if terrain is None else float(approach.point[2] - terrain.height(*approach.point[:2]))
    if terrain is None or math.isnan(over):
        reason = "the ground at the landing point is not known"
        fault = message(f"the touchdown at {place_text(place)} is not judged: {reason}")
        return [make_finding("touchdown", place, ok=None, reason=reason, faults=[fault], unit="m", check=GROUND_WAY)]
    k = _touchdown_row(track, terrain)
    if k is None:
        fault = message("the aircraft did not touch down", f" at {_landing_point_text(approach)}")
        return [make_finding("touchdown", place, ok=False, reason=fault.text, faults=[fault], unit="m")]
    landing = _measure_landing(requirements, track, terrain, approach, k)._replace(over=over)
    faults = _detect_faults(approach, landing)
    if entered := first_obstacle_on(requirements, track_way(track)):
        faults.append(message(f"the final enters {entered}"))
    gusts = requirements.setup.scenario.wind.turbulence != "none"
    return [_finding(place, approach, landing, faults, gusts=gusts)]


def _planned_findings(place: Place, approach: Approach) -> list[Finding]:
    """Before a flight, return a finding if the strip is too short to judge the touch-down."""
    found = _short_strip_messages(approach)
    reason = reason_of(found)
    return [make_finding("touchdown", place, ok=None, reason=reason, faults=found, check=GROUND_WAY)] if found else []


def _measure_landing(
    requirements: RouteRequirements, track: Track, terrain: Terrain, approach: Approach, k: int
) -> _Landing:
    """Measure a landing that touches down at row `k`; the field `over` stays unset."""
    position = np.asarray(track.position, dtype=np.float64)
    along, aside = _as_floats(approach.place(position[k]))
    touch, stop = (_as_floats(approach.on_strip(position[row])) for row in (k, -1))
    sink, towards = _sink_rates(track, terrain, approach, k)
    return _Landing(
        along=along,
        aside=aside,
        touch=touch,
        stop=stop,
        left=0.5 * approach.strip.length - stop[0],
        sink=sink,
        towards=towards,
        room=_final_clearance(requirements, position, terrain, approach),
    )


def _finding(place: Place, approach: Approach, landing: _Landing, faults: list[Message], *, gusts: bool) -> Finding:
    """Return the finding on a landing, with its faults, otherwise its undecided parts, otherwise unknown ground.

    gusts: True if the air is turbulent.
    """
    open_ = [] if faults else _undecided_messages(approach, landing, gusts=gusts)
    if not faults and not open_ and math.isnan(landing.room):
        open_ = [message("the ground below the final is not known")]
    messages = faults or open_
    inside = 0.5 * approach.strip.length - TOUCHDOWN_ERROR_M
    farthest = max(landing.stop[0], abs(landing.touch[0]))
    return make_finding(
        "touchdown",
        place,
        ok=False if faults else None if open_ else True,
        reason=reason_of(messages, _describe_landing(approach, landing)),
        faults=messages,
        flown=farthest,
        limit=inside,
        source="scenario",
        tolerance=0.0,
        margin=inside - farthest,
        unit="m",
        method="contact of skids or wheels with the ground, from the flown track",
        check=GROUND_WAY if open_ else "",
        facts=(
            Fact("along", landing.along, "m"),
            Fact("aside", landing.aside, "m"),
            Fact("sink", landing.sink, "m/s"),
            Fact("sink towards the ground", landing.towards, "m/s"),
            Fact("strip left", landing.left, "m"),
            Fact("final above ground", landing.room, "m"),
        ),
    )


def _landing_point_text(approach: Approach) -> str:
    """Name the landing point by its mission item."""
    return f"item {approach.item}"


def _as_floats(values: tuple[Floats, Floats]) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _touchdown_row(track: Track, terrain: Terrain) -> int | None:
    """Return the first row at which the aircraft is as low above ground as at rest; None if it never stopped."""
    if not len(track):
        return None
    position = np.asarray(track.position, dtype=np.float64)
    over = position[:, 2] - terrain.height(position[:, 0], position[:, 1])
    speed = np.hypot(*np.asarray(track.velocity[:, :2], dtype=np.float64).T)
    # The aircraft has landed only if it has stopped.
    if not speed[-1] < 1.0:
        return None
    low = over <= over[-1] + CONTACT_HEIGHT_M
    return int(np.argmax(low)) if low.any() else None


def _sink_rates(track: Track, terrain: Terrain, approach: Approach, k: int) -> tuple[float, float]:
    """Return the vertical sink rate just before touch-down, and the sink rate relative to the sloping ground, m/s."""
    k = max(0, k - 2)
    east, north, up = (float(value) for value in track.velocity[k])
    here = np.asarray(track.position[k, :2], dtype=np.float64)
    ahead = 0.5 * _SLOPE_RUN_M * np.array([math.sin(approach.course), math.cos(approach.course)])
    rise = float(terrain.height(*(here + ahead)) - terrain.height(*(here - ahead))) / _SLOPE_RUN_M
    over_ground = east * math.sin(approach.course) + north * math.cos(approach.course)
    return -up, -up + rise * over_ground


def _final_clearance(requirements: RouteRequirements, position: Floats, terrain: Terrain, approach: Approach) -> float:
    """Return the minimum height above ground before flare or touch-down, m, as in `_Landing.room`."""
    up = float(approach.point[2])
    glide = requirements.setup.autopilot.landing_glide(approach.begin - up, approach.run, approach.tail_wind, up)
    flares = glide.flare_distance + max(0.0, FLARE_HEIGHT_MARGIN_M - glide.flare_height) / glide.slope
    near = approach.place(position)[0] > -max(EARLY_TOUCHDOWN_DISTANCE_M, flares)
    until = int(np.argmax(near)) if near.any() else len(position)
    if until < 2:
        return math.inf
    low, _ = path_clearance(terrain.heights, terrain.to_pixel.record, np.ascontiguousarray(position[:until]))
    return float(low.min())


def _detect_faults(approach: Approach, landing: _Landing) -> list[Message]:
    """Return a fault for each part of the landing off the strip, and for a landing point below the ground."""
    half, side = 0.5 * approach.strip.length, 0.5 * approach.strip.width
    # On a strip shorter than the error, only a distance beyond the strip by more than the error is known.
    inside = half - TOUCHDOWN_ERROR_M if half > TOUCHDOWN_ERROR_M else half + TOUCHDOWN_ERROR_M
    touch, stop = landing.touch, landing.stop
    faults = []
    if -landing.over > LANDING_POINT_ERROR_M:
        brief = f"the landing point of {_landing_point_text(approach)} is {-landing.over:.0f} m below the ground"
        faults.append(message(brief, ": the aircraft meets it before it flares"))
    if abs(touch[0]) > inside:
        where = "before" if touch[0] < 0.0 else "beyond"
        brief = f"touches down {abs(touch[0]):.0f} m {where} the strip's center"
        faults.append(message(brief, f"; {max(0.0, half - TOUCHDOWN_ERROR_M):.0f} m are allowed on this strip"))
    if stop[0] > inside:
        brief = f"comes to rest {half - stop[0]:.0f} m before the strip's end"
        if stop[0] > half:
            brief = f"runs {stop[0] - half:.0f} m beyond the strip's end"
        faults.append(message(brief, f"; {TOUCHDOWN_ERROR_M:.0f} m must be left"))
    aside = max(abs(touch[1]), abs(stop[1]))
    if aside > side:
        faults.append(message(f"{aside:.0f} m off the strip's center line", f"; it is {2.0 * side:.0f} m wide"))
    return faults


def _short_strip_messages(approach: Approach) -> list[Message]:
    """Return a message if a strip is too short for the touch-down error of the simulated law."""
    if approach.strip.length > 2.0 * TOUCHDOWN_ERROR_M:
        return []
    brief = f"the strip is {approach.strip.length:.0f} m long"
    return [
        message(brief, f"; a touch-down is known only within {TOUCHDOWN_ERROR_M:.0f} m either way, which needs more")
    ]


def _undecided_messages(approach: Approach, landing: _Landing, *, gusts: bool) -> list[Message]:
    """Return messages on parts of a landing that the limited accuracy of the simulated law leaves undecided."""
    found = _short_strip_messages(approach)
    left = 0.5 * approach.strip.length - max(landing.touch[0], landing.stop[0])
    if gusts and left < GUST_TOUCHDOWN_ERROR_M and not found:
        brief = f"comes down or to rest {left:.0f} m before the strip's end"
        found.append(message(brief, f"; in turbulence the place is known only within {GUST_TOUCHDOWN_ERROR_M:.0f} m"))
    if landing.over > LANDING_POINT_ERROR_M:
        brief = f"the landing point of {_landing_point_text(approach)} is {landing.over:.0f} m above the ground"
        found.append(message(brief, ": the aircraft flares too early, and falls"))
    if landing.room < FINAL_APPROACH_CLEARANCE_M:
        brief = f"the final passes the ground by {landing.room:.1f} m"
        found.append(message(brief, f", and may be flown {FINAL_APPROACH_CLEARANCE_M:.0f} m lower than simulated"))
    if landing.towards > MAX_TOUCHDOWN_SINK_MPS:
        brief = f"sinks at {landing.towards:.1f} m/s towards the ground at its touch-down"
        found.append(message(brief, f"; ArduPlane's landings are known with up to {MAX_TOUCHDOWN_SINK_MPS:g} m/s"))
    return found


def _describe_landing(approach: Approach, landing: _Landing) -> list[str]:
    """Describe the landing in a list of phrases."""
    before = "before" if landing.along < 0.0 else "beyond"
    known = [f"touches down {abs(landing.along):.0f} m {before} the landing point, {abs(landing.aside):.1f} m aside"]
    known.append(f"comes to rest with {landing.left:.0f} m of the strip left")
    sinks = f"sinks at {landing.sink:.1f} m/s at touch-down, {landing.towards:.1f} m/s relative to the sloping ground"
    known.append(f"{sinks}; the flare itself is not judged")
    if math.isfinite(landing.room):
        known.append(f"the final stays {landing.room:.0f} m above ground or more")
    if approach.tail_wind > 0.1:
        known.append(f"with {approach.tail_wind:.1f} m/s of tail wind")
    return known


RULE = Rule(
    name="touchdown",
    tolerances=(
        "GUST_TOUCHDOWN_ERROR_M",
        "TOUCHDOWN_ERROR_M",
        "CONTACT_HEIGHT_M",
        "MAX_TOUCHDOWN_SINK_MPS",
        "EARLY_TOUCHDOWN_DISTANCE_M",
        "FINAL_APPROACH_CLEARANCE_M",
        "FLARE_HEIGHT_MARGIN_M",
        "LANDING_POINT_ERROR_M",
        "ROUNDING_M",
    ),
    judge=touchdown_findings,
)
