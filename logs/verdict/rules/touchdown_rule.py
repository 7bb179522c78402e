"""The touchdown rule: judge a flown landing, from the last waypoint to the stop.

The rule judges the height of the final approach above ground, the hazards that it enters, and the points on the
scenario's strip where the aircraft touches down and stops.  It only reports the sink rate towards the ground, which may
slope upwards, because the simulated ArduPlane is accurate down to the flare but less accurate in the last metres
(`docs/measured.md`).  A sink rate beyond all measured ones therefore leaves the landing undecided, and no sink rate
passes or fails it.  The landing and approach rules judge a landing that is not flown, from the mission's items.
"""

import math
from typing import NamedTuple

import numpy as np

from flight.mission.ground_phases import Approach
from flight.simulation.track import Track
from logs.verdict.findings import GROUND_PATH, Fact, Finding, Message, finding_reason, make_finding, message
from logs.verdict.measures.ground_paths import hazard_on_path, track_path
from logs.verdict.measures.path_sweeps import path_clearance
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import Place
from logs.verdict.rule import Rule
from logs.verdict.suggestions import suggest_other_landing_course
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

# Length of ground, with the touchdown in the middle, over which the ground's slope is measured, m.
_SLOPE_RUN_M = 10.0


class _Landing(NamedTuple):
    """Measurements of a landing.

    distance_beyond_point: distance of the touchdown beyond the landing point, m; negative before the point.
    lateral_offset: distance of the touchdown to the right of the landing course, m.
    touchdown, stop: positions on the strip, each as distance beyond the strip's center and to the right of it, m.
    strip_left: length of strip remaining beyond the stop, m.
    sink, ground_sink: sink rate at the touchdown, vertical and relative to the sloping ground, m/s.
    final_clearance: minimum height of the final approach above ground, m; inf without one, NaN if unknown.
    point_height: height of the landing point above the ground, m.
    """

    distance_beyond_point: float
    lateral_offset: float
    touchdown: tuple[float, float]
    stop: tuple[float, float]
    strip_left: float
    sink: float
    ground_sink: float
    final_clearance: float
    point_height: float = math.nan


def touchdown_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge a flown landing with one finding; return [] without a flown landing.

    geometric: True before a flight: the only finding is then on a strip that is too short to be judged.
    """
    ground_phases = requirements.ground_phases
    if ground_phases is None or ground_phases.procedures.approach is None:
        planned_approach = requirements.setup.ground_phases.approach if geometric else None
        faults = [] if planned_approach is None else _short_strip_messages(planned_approach)
        if planned_approach is None or not faults:
            return []
        place = requirements.waypoint_place(planned_approach.leg + 1)
        reason = finding_reason(faults)
        return [make_finding("touchdown", place, ok=None, reason=reason, faults=faults, check=GROUND_PATH)]
    approach = ground_phases.procedures.approach
    place = ground_phases.whole_route.waypoint_place(approach.leg + 1)
    track, terrain = ground_phases.landing_track, requirements.setup.scenario.terrain
    if ground_phases.landing_start_row >= len(ground_phases.track) - 1:
        reason = "the flight did not reach its landing"
        fault = message(f"the touchdown at {place_text(place)} is not judged: {reason}")
        return [make_finding("touchdown", place, ok=None, reason=reason, faults=[fault], unit="m", check=GROUND_PATH)]
    point_height = math.nan if terrain is None else float(approach.point[2] - terrain.height(*approach.point[:2]))
    if terrain is None or math.isnan(point_height):
        reason = "the terrain at the landing point is unknown"
        fault = message(f"the touchdown at {place_text(place)} is not judged: {reason}")
        return [make_finding("touchdown", place, ok=None, reason=reason, faults=[fault], unit="m", check=GROUND_PATH)]
    # First row in which the aircraft is as low above ground as at its final standstill.
    touchdown_row = None
    if len(track):
        position = np.asarray(track.position, dtype=np.float64)
        heights = position[:, 2] - terrain.height(position[:, 0], position[:, 1])
        speed = np.hypot(*np.asarray(track.velocity[:, :2], dtype=np.float64).T)
        # The aircraft has landed only if it has stopped.
        if speed[-1] < 1.0:
            is_low = heights <= heights[-1] + CONTACT_HEIGHT_M
            touchdown_row = int(np.argmax(is_low)) if is_low.any() else None
    if touchdown_row is None:
        end_text = ""
        if len(track):
            distance = math.hypot(*(position[-1, :2] - approach.point[:2]).tolist())
            end_text = f": the flight ended {distance:.0f} m from it"
        fault = message("the aircraft did not touch down", f" at {_landing_point_text(approach)}{end_text}")
        return [make_finding("touchdown", place, ok=False, reason=fault.text, faults=[fault], unit="m")]
    landing = _measure_landing(requirements, track, terrain, approach, touchdown_row)._replace(
        point_height=point_height
    )
    faults = _detect_faults(approach, landing)
    if entered_hazard := hazard_on_path(requirements, track_path(track)):
        faults.append(message(f"the final approach enters {entered_hazard}"))
    has_gusts = requirements.setup.scenario.wind.turbulence != "none"
    return [_landing_finding(place, approach, landing, faults, has_gusts=has_gusts)]


def _measure_landing(
    requirements: RouteRequirements, track: Track, terrain: Terrain, approach: Approach, touchdown_row: int
) -> _Landing:
    """Measure a landing: touchdown, stop, sink rates, and lowest clearance of the final approach.

    The result's `point_height` remains NaN.

    touchdown_row: row of the track in which the aircraft touches down.
    """
    position = np.asarray(track.position, dtype=np.float64)
    distance_beyond_point, lateral_offset = _as_floats(approach.distances_from_landing_point(position[touchdown_row]))
    touchdown, stop = (_as_floats(approach.distances_from_strip_center(position[row])) for row in (touchdown_row, -1))
    # Sink rates just before touchdown: vertical, and relative to the sloping ground.
    sink_row = max(0, touchdown_row - 2)
    east_speed, north_speed, vertical_speed = (float(value) for value in track.velocity[sink_row])
    half_base = 0.5 * _SLOPE_RUN_M * np.array([math.sin(approach.course), math.cos(approach.course)])
    east_north = position[sink_row, :2]
    height_change = float(terrain.height(*(east_north + half_base)) - terrain.height(*(east_north - half_base)))
    course_speed = east_speed * math.sin(approach.course) + north_speed * math.cos(approach.course)
    ground_sink = -vertical_speed + height_change / _SLOPE_RUN_M * course_speed
    point_altitude = float(approach.point[2])
    glide = requirements.setup.autopilot.ground.glide(
        approach.start_altitude - point_altitude, approach.length, approach.tail_wind, point_altitude
    )
    flare_distance = glide.flare_distance + max(0.0, FLARE_HEIGHT_MARGIN_M - glide.flare_height) / glide.slope
    is_near = approach.distances_from_landing_point(position)[0] > -max(EARLY_TOUCHDOWN_DISTANCE_M, flare_distance)
    end_row = int(np.argmax(is_near)) if is_near.any() else len(position)
    final_clearance = math.inf
    if end_row >= 2:
        heights, _ = path_clearance(terrain.heights, terrain.to_pixel.record, np.ascontiguousarray(position[:end_row]))
        final_clearance = float(heights.min())
    return _Landing(
        distance_beyond_point=distance_beyond_point,
        lateral_offset=lateral_offset,
        touchdown=touchdown,
        stop=stop,
        strip_left=0.5 * approach.strip.length - stop[0],
        sink=-vertical_speed,
        ground_sink=ground_sink,
        final_clearance=final_clearance,
    )


def _landing_finding(
    place: Place, approach: Approach, landing: _Landing, faults: list[Message], *, has_gusts: bool
) -> Finding:
    """Make the finding on a measured landing.

    It fails if there are `faults`; without faults, it is undecided if the simulation is too inaccurate to pass it.

    has_gusts: True if the air is turbulent.
    """
    # Parts of the landing that the simulation is too inaccurate to decide.
    undecided_messages = _short_strip_messages(approach)
    strip_left = 0.5 * approach.strip.length - max(landing.touchdown[0], landing.stop[0])
    if has_gusts and strip_left < GUST_TOUCHDOWN_ERROR_M and not undecided_messages:
        brief = f"touches down or comes to rest {strip_left:.0f} m before the strip's end"
        error_text = f"; in turbulence the touchdown point is uncertain by ±{GUST_TOUCHDOWN_ERROR_M:.0f} m"
        undecided_messages.append(message(brief, error_text))
    if landing.point_height > LANDING_POINT_ERROR_M:
        brief = f"the landing point of {_landing_point_text(approach)} is {landing.point_height:.0f} m above the ground"
        undecided_messages.append(message(brief, ": the aircraft flares too early and drops"))
    if landing.final_clearance < FINAL_APPROACH_CLEARANCE_M:
        brief = f"the final approach clears the ground by only {landing.final_clearance:.1f} m"
        error_text = f"; the flight may be {FINAL_APPROACH_CLEARANCE_M:.0f} m lower than simulated"
        undecided_messages.append(message(brief, error_text))
    if landing.ground_sink > MAX_TOUCHDOWN_SINK_MPS:
        brief = f"sinks at {landing.ground_sink:.1f} m/s towards the ground at touchdown"
        known_text = f"; ArduPlane's known landings touch down at up to {MAX_TOUCHDOWN_SINK_MPS:g} m/s"
        undecided_messages.append(message(brief, known_text))
    if not undecided_messages and math.isnan(landing.final_clearance):
        undecided_messages.append(message("the terrain below the final approach is unknown"))
    messages = faults or undecided_messages
    direction = "before" if landing.distance_beyond_point < 0.0 else "beyond"
    left = landing.strip_left
    facts = [
        f"touches down {abs(landing.distance_beyond_point):.0f} m {direction} the landing point, "
        f"{abs(landing.lateral_offset):.1f} m to the side",
        f"comes to rest with {left:.0f} m of the strip left" if left >= 0.0 else f"overruns the strip by {-left:.0f} m",
        f"sinks at {landing.sink:.1f} m/s at touchdown, {landing.ground_sink:.1f} m/s relative to the sloping ground;"
        " the flare itself is not judged",
    ]
    if math.isfinite(landing.final_clearance):
        facts.append(f"the final approach stays at least {landing.final_clearance:.0f} m above ground")
    if approach.tail_wind > 0.1:
        facts.append(f"with {approach.tail_wind:.1f} m/s of tailwind")
    limit = 0.5 * approach.strip.length - TOUCHDOWN_ERROR_M
    max_distance = max(landing.stop[0], abs(landing.touchdown[0]))
    return make_finding(
        "touchdown",
        place,
        ok=False if faults else None if undecided_messages else True,
        reason=finding_reason(messages, facts),
        faults=messages,
        flown=max_distance,
        limit=limit,
        source="scenario",
        tolerance=0.0,
        margin=limit - max_distance,
        unit="m",
        method="contact of skids or wheels with the ground, from the flown track",
        check=GROUND_PATH if undecided_messages and not faults else "",
        facts=(
            Fact("along", landing.distance_beyond_point, "m"),
            Fact("aside", landing.lateral_offset, "m"),
            Fact("sink", landing.sink, "m/s"),
            Fact("sink towards the ground", landing.ground_sink, "m/s"),
            Fact("strip left", landing.strip_left, "m"),
            Fact("final above ground", landing.final_clearance, "m"),
        ),
    )


def _landing_point_text(approach: Approach) -> str:
    """Name the mission item of the landing point."""
    return f"item {approach.item}"


def _as_floats(values: tuple[Floats, Floats]) -> tuple[float, float]:
    """Convert two arrays of one element each to floats."""
    return float(values[0]), float(values[1])


def _detect_faults(approach: Approach, landing: _Landing) -> list[Message]:
    """Return faults of a touchdown or stop off the strip, and of a landing point below the ground."""
    half_length, half_width = 0.5 * approach.strip.length, 0.5 * approach.strip.width
    # On a strip shorter than the error of the touchdown point, only a larger overrun than this error is certain.
    allowed_distance = (
        half_length - TOUCHDOWN_ERROR_M if half_length > TOUCHDOWN_ERROR_M else half_length + TOUCHDOWN_ERROR_M
    )
    touchdown, stop = landing.touchdown, landing.stop
    faults = []
    if -landing.point_height > LANDING_POINT_ERROR_M:
        brief = (
            f"the landing point of {_landing_point_text(approach)} is {-landing.point_height:.0f} m below the ground"
        )
        faults.append(message(brief, ": the aircraft hits the ground before it flares"))
    if abs(touchdown[0]) > allowed_distance:
        direction = "before" if touchdown[0] < 0.0 else "beyond"
        brief = f"touches down {abs(touchdown[0]):.0f} m {direction} the strip's center"
        allowed_distance = max(0.0, half_length - TOUCHDOWN_ERROR_M)
        faults.append(message(brief, f"; {allowed_distance:.0f} m before or beyond it are allowed"))
    if stop[0] > allowed_distance:
        brief = f"comes to rest {half_length - stop[0]:.0f} m before the strip's end"
        if stop[0] > half_length:
            brief = f"runs {stop[0] - half_length:.0f} m beyond the strip's end"
        faults.append(message(brief, f"; {TOUCHDOWN_ERROR_M:.0f} m of the strip must be left"))
    width_text = f"; the strip is {2.0 * half_width:.0f} m wide"
    for verb, offset in (("touches down", abs(touchdown[1])), ("comes to rest", abs(stop[1]))):
        if offset > half_width:
            faults.append(message(f"{verb} {offset:.0f} m to the side of the strip's center line", width_text))
            break
    return faults


def _short_strip_messages(approach: Approach) -> list[Message]:
    """Return a message if a strip is too short for the uncertain touchdown point; otherwise []."""
    if approach.strip.length > 2.0 * TOUCHDOWN_ERROR_M:
        return []
    brief = f"the strip is {approach.strip.length:.0f} m long"
    return [
        message(
            brief,
            f"; the touchdown point is uncertain by ±{TOUCHDOWN_ERROR_M:.0f} m, so a longer strip is required",
        )
    ]


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
    suggest=suggest_other_landing_course,
)
