"""The go-around rule: judge the path of an aborted landing, flown by ArduPlane's control law.

A go-around is not an item of the mission; it can be commanded anywhere on the glide.  The rule therefore simulates it
from several places on the glide that the autopilot lays out, with the simulated ArduPlane on a point mass
(`flight.autopilots.arduplane.go_around_point_mass`), back to a landing sequence or to the last waypoint before the
glide, and judges the simulated path.  A go-around that never gets back there is a fault, as is one that meets an
obstacle; a go-around whose path is not fully known is not judged.  The aircraft
climbs on the landing course to a height above home, regardless of the altitude of the field, and only then turns.  From
a field higher than home it may therefore turn into a hill at once.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from flight.autopilots.arduplane.go_around_point_mass import count_climb_rows, fly_go_arounds, make_abort_start
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.parts import LandingGlide
from flight.autopilots.simulated_returns import RETURN_GROUND_IMPACT, RETURN_OFF_TERRAIN, RETURN_TIMEOUT
from flight.mission.ground_phases import climb_pitch
from flight.mission.items import Command, MissionItem, command_name
from flight.mission.placing import home_point, landing_sequence, landing_starts
from flight.mission.return_path import LandingStart
from logs.verdict.findings import GROUND_PATH, Fact, Finding, make_finding, message
from logs.verdict.measures.ground_paths import (
    GroundPath,
    has_ground_paths,
    hazard_on_path,
    landing_item,
    takeoff_item,
)
from logs.verdict.measures.path_sweeps import path_clearance
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.returns.judge_returns import ReturnWorld, make_return_world
from logs.verdict.rule import Rule
from logs.verdict.tolerances import (
    EARLY_TOUCHDOWN_DISTANCE_M,
    GO_AROUND_CLEARANCE_M,
    GO_AROUND_MODEL_ERROR_M,
    LINE_UP_DISTANCE_M,
    MIN_LEG_LENGTH_M,
)
from world.arrays import Floats
from world.kernels import Record, Records
from world.terrain import Terrain

# Step between the climb heights above home that `_next_sufficient_height` tries, m.
_HEIGHT_STEP_M = 5.0
# Maximum climb height above home that `_next_sufficient_height` tries, m.
_MAX_HEIGHT_M = 1000.0
# Distance between the simulated abort points on a glide, m.
_ABORT_SPACING_M = 50.0
# Maximum number of simulated abort points.
_MAX_ABORT_POINTS = 12
_NO_HEIGHT_TEXT = f"No climb up to {_MAX_HEIGHT_M:.0f} m above home is sufficient"
# Pitch of the climb if the mission has no take-off, rad (`Plane::do_land`, ArduPlane/commands_logic.cpp).
_CLIMB_PITCH_RAD = math.radians(10.0)


@dataclass(frozen=True, slots=True)
class _Landing:
    """Landing that may be aborted.

    waypoint: waypoint of the landing.
    glide: glide to the landing point.
    point: landing point at the mission's altitude, m, (3,).
    ground_altitude: altitude of the ground at the landing point, m AMSL.
    course: landing course, rad.
    leg_length: length of the last leg, m.
    glide_start_altitude: altitude where the glide begins, m AMSL.
    airspeed: true airspeed on the glide, m/s.
    pitch: pitch angle of the climb, rad.
    home_altitude: altitude of home, m AMSL.
    climb_height: height above home at which the climb ends, m.
    destinations: landing sequences from which the autopilot chooses, or else the waypoint before the landing.
    item: mission item of the landing.
    unknown_path_text: reason why the path of the go-around is unknown, "" if it is known.
    """

    waypoint: int
    glide: LandingGlide
    point: Floats
    ground_altitude: float
    course: float
    leg_length: float
    glide_start_altitude: float
    airspeed: float
    pitch: float
    home_altitude: float
    climb_height: float
    destinations: tuple[LandingStart, ...]
    item: MissionItem
    unknown_path_text: str

    def position(self, distance: float) -> tuple[float, float, float]:
        """Return the position on the glide at a distance (m) before the landing point: east, north and up, m."""
        point_altitude = float(self.point[2])
        altitude = point_altitude + self.glide.flare_height + self.glide.slope * (distance - self.glide.flare_distance)
        east = float(self.point[0]) - distance * math.sin(self.course)
        north = float(self.point[1]) - distance * math.cos(self.course)
        return east, north, max(point_altitude, min(self.glide_start_altitude, altitude))


class _GoAround(NamedTuple):
    """Aborted landing and its go-around.

    abort_distance: distance of the abort before the landing point, m.
    abort_height: height above ground at the abort, m.
    turns_at_once: True if the aircraft is already above the end of the climb.
    lowest_height: height above ground at the point after the climb with the smallest margin, or the minimum height
        anywhere if the go-around hits the ground, m; inf if unknown.
    required_height: required height at that point, m.
    min_climb_height: minimum height above ground in the climb beyond the landing point, m; inf without a climb.
    impact_time: time from the abort to ground impact, s; NaN without impact.
    entered_hazard: sphere or zone that the go-around enters, "" if it enters none.
    is_lost: True if the go-around does not get back to the start of an approach.
    unknown_part_text: text on the unknown part of the path, "" if all is known.
    """

    abort_distance: float
    abort_height: float
    turns_at_once: bool
    lowest_height: float = math.inf
    required_height: float = GO_AROUND_CLEARANCE_M
    min_climb_height: float = math.inf
    impact_time: float = math.nan
    entered_hazard: str = ""
    is_lost: bool = False
    unknown_part_text: str = ""

    @property
    def is_clear(self) -> bool:
        """True if the go-around hits nothing, returns to the approach, and keeps the required height.

        The unknown part of its path is ignored.
        """
        return (
            math.isnan(self.impact_time)
            and not self.entered_hazard
            and not self.is_lost
            and self.lowest_height >= self.required_height
        )

    @property
    def severity(self) -> tuple[bool, bool, bool, float]:
        """Sort key that puts the worst go-around last."""
        return (
            not math.isnan(self.impact_time),
            bool(self.entered_hazard),
            self.is_lost,
            self.required_height - self.lowest_height,
        )


def go_around_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None = None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the go-around of a mission that lands and has a home, with one finding.

    If the scenario requires go-arounds, a fault fails the finding, and an unjudged go-around leaves the verdict
    undecided.  Otherwise, a fault is only a warning.  Return [] if there is nothing to judge and go-arounds are not
    required, and for an imported flight.
    """
    requirements = requirements if requirements.ground_phases is None else requirements.ground_phases.whole_route
    setup = requirements.setup
    return_requirements, terrain, home = setup.scenario.returns, setup.scenario.terrain, setup.mission.home
    is_required = return_requirements is not None and "go_around" in return_requirements.require
    landing_place = (
        landing_item(requirements.setup)
        if has_ground_paths(requirements) and terrain is not None and home is not None
        else None
    )
    landing = None if landing_place is None or terrain is None else _find_landing(requirements, terrain, *landing_place)
    if landing is not None and terrain is not None:
        return [_go_around_finding(requirements, terrain, landing, is_required=is_required)]
    if not is_required or setup.imported_log is not None:
        return []
    reason = message(
        "a go-around is not judged",
        ": this requires the simulated ArduPlane, a home, terrain data and a glide to the landing point",
    )
    return [make_finding("go_around", FLIGHT, ok=None, reason=reason.text, faults=[reason], check=GROUND_PATH)]


def _find_landing(
    requirements: RouteRequirements, terrain: Terrain, waypoint: int, item: MissionItem
) -> _Landing | None:
    """Return the landing at a waypoint, with the glide to it and the climb of a go-around from it.

    Return None if the climb height of its go-around, home's altitude or the ground at the landing is unknown, and if
    the glide to the waypoint is too short or does not descend.
    """
    setup, leg = requirements.setup, waypoint - 1
    glide_start, landing_point = requirements.points[leg], requirements.points[waypoint]
    leg_length, course = float(requirements.runs[leg]), float(requirements.courses[leg])
    home_position = home_point(setup.mission, setup.scenario.origin, terrain)
    home_altitude = math.nan if home_position is None else home_position.up
    takeoff_waypoint, takeoff = takeoff_item(requirements.setup)
    takeoff_climb = 0.0 if takeoff is None else float(requirements.points[takeoff_waypoint, 2]) - home_altitude
    climb_height = setup.autopilot.ground.go_around_height(item.params[0], takeoff_climb)
    # The destinations are the landing sequences, or else the waypoint before the landing.
    mission, origin = setup.mission, setup.scenario.origin
    previous_item = int(setup.route.items[waypoint - 1])
    previous_place = landing_sequence(mission, origin, terrain, previous_item)[:1] if previous_item >= 0 else ()
    destinations = landing_starts(mission, origin, terrain) or previous_place
    unknown_path_text = "" if destinations else "no waypoint before the landing is known to fly back to"
    next_item = next((mission_item for mission_item in mission.items if mission_item.seq == item.seq + 1), None)
    # This command takes precedence over landing sequences (`AP_Landing::restart_landing_sequence`).
    is_overriding = next_item is not None and next_item.command == Command.NAV_CONTINUE_AND_CHANGE_ALT
    if next_item is not None and is_overriding and int(next_item.params[0]) in (0, 1):
        name = command_name(next_item.command)
        unknown_path_text = f"{name} (item {next_item.seq}) follows the landing, and is flown instead"
    ground_altitude = setup.route.landing_ground
    terrain_altitude = float(terrain.height(float(landing_point[0]), float(landing_point[1])))
    if (
        climb_height is None
        or ground_altitude is None
        or math.isnan(home_altitude + terrain_altitude)
        or leg_length < MIN_LEG_LENGTH_M
        or glide_start[2] <= ground_altitude
    ):
        return None
    tailwind = setup.scenario.wind.components_on_course(course, ground_altitude)[0]
    point = np.array([landing_point[0], landing_point[1], ground_altitude])
    return _Landing(
        glide=setup.autopilot.ground.glide(
            float(glide_start[2]) - ground_altitude, leg_length, tailwind, ground_altitude
        ),
        waypoint=waypoint,
        point=point,
        ground_altitude=terrain_altitude,
        course=course,
        leg_length=leg_length,
        glide_start_altitude=float(glide_start[2]),
        airspeed=setup.autopilot.ground.airspeed(setup.airspeed, tailwind, ground_altitude),
        pitch=_CLIMB_PITCH_RAD if takeoff is None else climb_pitch(takeoff),
        home_altitude=home_altitude,
        climb_height=climb_height,
        destinations=destinations,
        item=item,
        unknown_path_text=unknown_path_text,
    )


def _go_around_finding(
    requirements: RouteRequirements, terrain: Terrain, landing: _Landing, *, is_required: bool
) -> Finding:
    """Simulate go-arounds from positions on the glide, and judge the worst of them.

    is_required: True if a fault fails the finding; False if it is only a warning.
    """
    setup, place, height = requirements.setup, requirements.waypoint_place(landing.waypoint), landing.climb_height
    climb_text = (
        f"the aircraft climbs to {height:.0f} m above home,"
        f" {landing.home_altitude + height - landing.ground_altitude:.0f} m above the landing point"
    )
    # Rally points are removed, because a go-around never flies to one.
    world = make_return_world(replace(setup, mission=replace(setup.mission, rally=())))
    go_arounds = (
        []
        if landing.unknown_path_text
        else _simulate_go_arounds(requirements, terrain, world, landing, height, _abort_distances(landing))
    )
    worst = max(go_arounds, key=lambda go_around: go_around.severity, default=None)
    unknown_text = landing.unknown_path_text or next(
        (go_around.unknown_part_text for go_around in go_arounds if go_around.unknown_part_text), ""
    )
    climb = Fact(
        "climb above ground", min((go_around.min_climb_height for go_around in go_arounds), default=math.inf), "m"
    )
    if worst is None or (unknown_text and worst.is_clear):
        unknown_text = unknown_text or "the glide is below the ground, or the terrain below the glide is unknown"
        unjudged = message("a go-around is not judged", f": {climb_text}; {unknown_text}")
        check = GROUND_PATH if is_required else ""
        return make_finding(
            "go_around", place, ok=None, reason=unjudged.text, faults=[unjudged], unit="m", check=check, facts=[climb]
        )
    if worst.is_clear:
        fault = message(f"{climb_text}; at least {worst.lowest_height:.0f} m above ground on the way back")
    else:
        if not math.isnan(worst.impact_time):
            brief, outcome = "hits the ground", f"hits the ground {worst.impact_time:.0f} s later"
        elif worst.entered_hazard or worst.is_lost:
            hazard = worst.entered_hazard
            brief = outcome = f"enters {hazard}" if hazard else "does not get back to the approach"
        else:
            brief = "comes too close to the ground"
            outcome = f"descends to {worst.lowest_height:.0f} m above ground on the way back"
        turn_text = " is already above this height, turns at once and" if worst.turns_at_once else ""
        outcome_text = (
            f"after an abort {worst.abort_height:.0f} m above ground, {worst.abort_distance:.0f} m before the landing"
            f" point, the aircraft{turn_text} {outcome} ({climb_text})"
        )
        remedy_text = _NO_HEIGHT_TEXT
        sufficient_height = _next_sufficient_height(requirements, terrain, world, landing, worst.abort_distance)
        if sufficient_height > 0.0:
            remedy_text = (
                f"A climb to {sufficient_height:.0f} m above home is sufficient: set parameter 1 of item"
                f" {landing.item.seq} to this height"
            )
        fault = message(f"a go-around {brief}", f": {outcome_text}. {remedy_text}")
    ok = worst.is_clear or (False if is_required else None)
    return make_finding(
        "go_around",
        place,
        ok=ok,
        reason=fault.text,
        faults=[] if ok else [fault],
        planned=worst.lowest_height,
        limit=worst.required_height,
        at_least=True,
        source="check",
        tolerance=0.0,
        margin=None if worst.entered_hazard or worst.is_lost else worst.lowest_height - worst.required_height,
        unit="m",
        method=f"simulated ArduPlane flying a point-mass model from {len(go_arounds)} positions on the glide",
        facts=[climb],
    )


def _abort_distances(landing: _Landing) -> Floats:
    """Return evenly spaced abort points on the glide, as distances before the landing point, m, (n,).

    The first is at the start of the glide.  The last is at the flare, or at the earliest accepted touchdown.
    """
    last_distance = min(landing.leg_length, max(landing.glide.flare_distance, EARLY_TOUCHDOWN_DISTANCE_M))
    point_count = min(_MAX_ABORT_POINTS, max(2, math.ceil((landing.leg_length - last_distance) / _ABORT_SPACING_M) + 1))
    return np.linspace(landing.leg_length, last_distance, point_count)


def _simulate_go_arounds(
    requirements: RouteRequirements,
    terrain: Terrain,
    world: ReturnWorld,
    landing: _Landing,
    climb_height: float,
    abort_distances: Sequence[float] | Floats,
) -> list[_GoAround]:
    """Simulate and judge go-arounds from the abort points that are above ground; return [] if none is.

    climb_height: height above home at which the climb ends, m.
    abort_distances: distances of the abort points before the landing point, m.
    """
    top_altitude = landing.home_altitude + climb_height
    starts_on_glide = [(float(distance), landing.position(float(distance))) for distance in abort_distances]
    heights = [altitude - float(terrain.height(east, north)) for _, (east, north, altitude) in starts_on_glide]
    airborne = [
        (*start, height_above_ground)
        for start, height_above_ground in zip(starts_on_glide, heights, strict=True)
        if height_above_ground > 0.0
    ]
    parameters, scenario, time = world.autopilot.parameters, world.scenario, float(requirements.path.times[-1])
    if not airborne or not isinstance(parameters, ArduPilotParameters):
        return []
    start_records: Records = np.concatenate(
        [
            make_abort_start(
                place, landing.course, landing.glide.slope, landing.airspeed, scenario.wind_velocity(place, time), time
            )
            for _, place, _ in airborne
        ]
    )
    results = fly_go_arounds(
        start_records,
        top_altitude,
        landing.pitch,
        landing.destinations,
        parameters,
        world.aircraft,
        world.environment,
    )
    return [
        _judge_go_around(
            requirements,
            terrain,
            landing,
            _GoAround(distance, height_above_ground, turns_at_once=place[2] > top_altitude),
            row,
            path,
            destination,
            top_altitude,
        )
        for (distance, place, height_above_ground), row, path, destination in zip(
            airborne, results.results, results.tracks, results.landings, strict=True
        )
    ]


def _judge_go_around(
    requirements: RouteRequirements,
    terrain: Terrain,
    landing: _Landing,
    go_around: _GoAround,
    result: Record,
    positions: Floats,
    destination: LandingStart,
    top_altitude: float,
) -> _GoAround:
    """Return a simulated go-around with its outcome: heights, hazards, and where its path is unknown.

    result: record of dtype `flight.autopilots.simulated_returns.RETURN_RESULT`.
    positions: simulated path with one point per second, m, (n, 3).
    destination: destination of the go-around.
    top_altitude: altitude at which the climb ends, m AMSL.
    """
    climb_end, end_status = count_climb_rows(positions, top_altitude), int(result["outcome"])
    unknown_part_text = "" if end_status != RETURN_OFF_TERRAIN else "the way back leaves the terrain data"
    if unknown_part_text and climb_end == len(positions):
        unknown_part_text = "the aircraft leaves the terrain data before it reaches that height"
    go_around = go_around._replace(is_lost=end_status == RETURN_TIMEOUT, unknown_part_text=unknown_part_text)
    if destination.is_landing and climb_end < len(positions):
        # It is unknown where the aircraft joins the glide: judge only the climb.
        positions, end_status = positions[: climb_end + 1], 0
        go_around = go_around._replace(
            is_lost=False,
            unknown_part_text=f"the landing sequence begins with the landing itself (item {destination.item})",
        )
    if len(positions) < 2:
        # The landing was aborted at the destination, or above the end of the climb.
        return go_around._replace(lowest_height=go_around.abort_height)
    steps = np.diff(positions[:, :2], axis=0)
    path = GroundPath(positions, np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))]))
    heights = path_clearance(terrain.heights, terrain.to_pixel.record, positions)[0]
    min_height = float(np.nanmin(heights, initial=math.inf))
    go_around = go_around._replace(entered_hazard=hazard_on_path(requirements, path))
    if end_status == RETURN_GROUND_IMPACT or min_height <= 0.0:
        return go_around._replace(lowest_height=min(min_height, 0.0), impact_time=float(result["clearance_time"]))
    landing_direction = math.sin(landing.course), math.cos(landing.course)
    is_beyond_point = (positions[:-1, :2] - landing.point[:2]) @ landing_direction > 0.0
    min_climb_height = float(np.nanmin(heights[:climb_end][is_beyond_point[:climb_end]], initial=math.inf))
    if min_climb_height < GO_AROUND_MODEL_ERROR_M and not go_around.unknown_part_text:
        passing_text = (
            f"if the landing is aborted {go_around.abort_distance:.0f} m before the landing point, the climb clears "
            f"the ground by {min_climb_height:.0f} m"
        )
        go_around = go_around._replace(
            unknown_part_text=f"{passing_text}; the flight may be {GO_AROUND_MODEL_ERROR_M:.0f} m lower"
        )
    # Near a destination that is lower than `GO_AROUND_CLEARANCE_M`, its height is the required height.
    middles = (0.5 * (positions[:-1] + positions[1:]))[climb_end:]
    required = np.full(len(middles), GO_AROUND_CLEARANCE_M)
    for east, north, up in (start.position for start in (destination, *destination.next_stops)):
        destination_height = up - float(terrain.height(east, north))
        is_near = np.hypot(middles[:, 0] - east, middles[:, 1] - north) <= LINE_UP_DISTANCE_M
        required[is_near] = np.fmin(required[is_near], destination_height)
    return_heights = np.where(np.isnan(heights[climb_end:]), math.inf, heights[climb_end:])
    if not return_heights.size:
        return go_around._replace(min_climb_height=min_climb_height)
    lowest_row = int(np.argmin(return_heights - required))
    return go_around._replace(
        min_climb_height=min_climb_height,
        lowest_height=float(return_heights[lowest_row]),
        required_height=float(required[lowest_row]),
    )


def _next_sufficient_height(
    requirements: RouteRequirements, terrain: Terrain, world: ReturnWorld, landing: _Landing, worst_distance: float
) -> float:
    """Find the next higher climb height with which all go-arounds are clear, m.

    The height is above home; NaN if there is none.

    Heights are tried in steps of `_HEIGHT_STEP_M` up to `_MAX_HEIGHT_M`.
    worst_distance: abort point to try first, as a distance before the landing point, m.
    """
    lowest_height = _HEIGHT_STEP_M * math.ceil(landing.climb_height / _HEIGHT_STEP_M + 1e-9)
    distances = [worst_distance, *_abort_distances(landing).tolist()]
    for height in np.arange(lowest_height, _MAX_HEIGHT_M + 1.0, _HEIGHT_STEP_M).tolist():
        for distance in distances:
            go_arounds = _simulate_go_arounds(requirements, terrain, world, landing, height, [distance])
            if not all(go_around.is_clear and not go_around.unknown_part_text for go_around in go_arounds):
                # Try the next height first at the distance at which this height was not enough.
                distances[0] = distance
                break
        else:
            return float(height)
    return math.nan


RULE = Rule(
    name="go_around",
    tolerances=(
        "GO_AROUND_CLEARANCE_M",
        "LINE_UP_DISTANCE_M",
        "GO_AROUND_MODEL_ERROR_M",
        "EARLY_TOUCHDOWN_DISTANCE_M",
        "MIN_LEG_LENGTH_M",
    ),
    judge=go_around_findings,
    is_same_for_plan=True,
)
