"""The go-around rule: judge the path of an aborted landing, flown by ArduPlane's control law.

A go-around is not an item of the mission; it can be commanded anywhere on the glide.  The rule therefore simulates it
from several places on the glide that the autopilot lays out, with ArduPlane's law on a point mass
(`flight.autopilots.arduplane.go_around_point_mass`), back to the last place before the glide, and judges the simulated
path.  A go-around that never gets back fails, and one whose path is not fully known is undecided.  A go-around climbs
on the landing course to a height above home, regardless of the altitude of the field, and only then turns.  From a
field higher than home it may therefore turn into a hill at once.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from flight.autopilots.arduplane.go_around_point_mass import aborted_at, climb_rows, fly_go_arounds
from flight.autopilots.arduplane.rtl_point_mass import RETURN_GROUND_IMPACT, RETURN_OFF_TERRAIN, RETURN_TIMEOUT
from flight.autopilots.autopilot import LandingGlide
from flight.mission.ground_ways import climb_pitch
from flight.mission.items import Command, MissionItem, command_name
from flight.mission.placing import home_place, landing_sequence, landing_starts
from flight.mission.return_path import LandingStart
from logs.verdict.findings import GROUND_WAY, Fact, Finding, make_finding, message
from logs.verdict.measures.path_sweeps import path_clearance
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.ways import Way, first_item, first_obstacle_on, is_laid_out, landing_item
from logs.verdict.places import FLIGHT
from logs.verdict.returns.judge_returns import ReturnWorld, return_world
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
# Distance between the simulated abort places on a glide, m.
_ABORT_SPACING_M = 50.0
# Maximum number of simulated abort places.
_MAX_ABORT_PLACES = 12
_NO_HEIGHT_TEXT = "no height would be sufficient"
# Pitch of the climb if the mission has no take-off, rad (`Plane::do_land`, ArduPlane/commands_logic.cpp).
_CLIMB_PITCH_RAD = math.radians(10.0)


@dataclass(frozen=True, slots=True)
class _Landing:
    """Landing that may be aborted.

    at: waypoint of the landing.
    glide: glide to the landing point.
    point: landing point at the mission's altitude, m, (3,).
    ground: altitude of the ground at the landing point, m AMSL.
    course: landing course, rad.
    run: length of the last leg, m.
    high: altitude where the glide begins, m AMSL.
    airspeed: true airspeed on the glide, m/s.
    pitch: pitch angle of the climb, rad.
    home: altitude of home, m AMSL.
    height: height above home at which the climb ends, m.
    landings: landing sequences to one of which the go-around flies, or else the place before the landing.
    item: mission item of the landing.
    open: reason why the path of the go-around is unknown, "" if it is known.
    """

    at: int
    glide: LandingGlide
    point: Floats
    ground: float
    course: float
    run: float
    high: float
    airspeed: float
    pitch: float
    home: float
    height: float
    landings: tuple[LandingStart, ...]
    item: MissionItem
    open: str

    def place(self, distance: float) -> tuple[float, float, float]:
        """Return the glide's east, north and up at a distance (m) before the landing point, m."""
        point_altitude = float(self.point[2])
        altitude = point_altitude + self.glide.flare_height + self.glide.slope * (distance - self.glide.flare_distance)
        east = float(self.point[0]) - distance * math.sin(self.course)
        north = float(self.point[1]) - distance * math.cos(self.course)
        return east, north, max(point_altitude, min(self.high, altitude))


class _Aborted(NamedTuple):
    """Aborted landing and its go-around.

    before: distance of the abort before the landing point, m.
    over: height above ground at the abort, m.
    at_once: True if the aircraft is already above the end of the climb.
    room: height above ground where its margin after the climb is smallest, or the minimum height anywhere if the
        go-around hits the ground, m; inf if unknown.
    needed: required height at that place, m.
    climb: minimum height above ground in the climb beyond the landing point, m; inf without a climb.
    after: time from the abort to ground impact, s; NaN without impact.
    entered: sphere or zone that the go-around enters, "" if it enters none.
    lost: True if the go-around does not return to the line-up.
    open: text on the unknown part of the path, "" if all is known.
    """

    before: float
    over: float
    at_once: bool
    room: float = math.inf
    needed: float = GO_AROUND_CLEARANCE_M
    climb: float = math.inf
    after: float = math.nan
    entered: str = ""
    lost: bool = False
    open: str = ""

    @property
    def is_free(self) -> bool:
        """True if no fault is known."""
        return math.isnan(self.after) and not self.entered and not self.lost and self.room >= self.needed

    @property
    def badness(self) -> tuple[bool, bool, bool, float]:
        """Sort key that puts the worst go-around last."""
        return not math.isnan(self.after), bool(self.entered), self.lost, self.needed - self.room


def go_around_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None = None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the go-around of a mission that lands and has a home; warn if it is too low.

    If the scenario requires that a landing may be aborted, a low go-around fails, and an unjudged one is undecided.
    """
    requirements = requirements if requirements.ground is None else requirements.ground.whole
    setup = requirements.setup
    returns, terrain, home = setup.scenario.returns, setup.scenario.terrain, setup.mission.home
    is_required = returns is not None and "go_around" in returns.require
    landing_place = (
        landing_item(requirements) if is_laid_out(requirements) and terrain is not None and home is not None else None
    )
    landing = None if landing_place is None or terrain is None else _landing(requirements, terrain, *landing_place)
    if landing is not None and terrain is not None:
        return [_finding(requirements, terrain, landing, is_required=is_required)]
    if not is_required or setup.source is not None:
        return []
    reason = message(
        "a go-around is not judged",
        ": this requires the simulated ArduPlane, a home, terrain data and a glide to the landing point",
    )
    return [make_finding("go_around", FLIGHT, ok=None, reason=reason.text, faults=[reason], check=GROUND_WAY)]


def _landing(requirements: RouteRequirements, terrain: Terrain, waypoint: int, item: MissionItem) -> _Landing | None:
    """Return the landing at waypoint `waypoint`, or None if its glide or the height of its go-around is not known."""
    setup, leg = requirements.setup, waypoint - 1
    glide_start, landing_point = requirements.points[leg], requirements.points[waypoint]
    run, course = float(requirements.runs[leg]), float(requirements.courses[leg])
    home_position = home_place(setup.mission, setup.scenario.origin, terrain)
    home_altitude = math.nan if home_position is None else home_position.up
    first, takeoff = first_item(requirements)
    takeoff_climb = 0.0 if takeoff is None else float(requirements.points[first, 2]) - home_altitude
    height = setup.autopilot.go_around_height(item.params[0], takeoff_climb)
    landings = _go_around_destinations(requirements, waypoint)
    ground_altitude, terrain_altitude = (
        setup.route.landing_ground,
        float(terrain.height(float(landing_point[0]), float(landing_point[1]))),
    )
    if (
        height is None
        or math.isnan(home_altitude + ground_altitude + terrain_altitude)
        or run < MIN_LEG_LENGTH_M
        or glide_start[2] <= ground_altitude
    ):
        return None
    wind = setup.scenario.wind.along(course, ground_altitude)[0]
    point = np.array([landing_point[0], landing_point[1], ground_altitude])
    return _Landing(
        glide=setup.autopilot.landing_glide(float(glide_start[2]) - ground_altitude, run, wind, ground_altitude),
        at=waypoint,
        point=point,
        ground=terrain_altitude,
        course=course,
        run=run,
        high=float(glide_start[2]),
        airspeed=setup.autopilot.landing_airspeed(setup.airspeed, wind, ground_altitude),
        pitch=_CLIMB_PITCH_RAD if takeoff is None else climb_pitch(takeoff),
        home=home_altitude,
        height=height,
        landings=landings,
        item=item,
        open=_unknown_path_text(requirements, item, landings),
    )


def _go_around_destinations(requirements: RouteRequirements, waypoint: int) -> tuple[LandingStart, ...]:
    """Return the landing sequences to which a go-around may fly, or else the place before the landing."""
    setup = requirements.setup
    mission, origin, terrain = setup.mission, setup.scenario.origin, setup.scenario.terrain
    previous_item = int(setup.route.items[waypoint - 1])
    previous_place = landing_sequence(mission, origin, terrain, previous_item)[:1] if previous_item >= 0 else ()
    return landing_starts(mission, origin, terrain) or previous_place


def _unknown_path_text(requirements: RouteRequirements, item: MissionItem, landings: tuple[LandingStart, ...]) -> str:
    """Explain why the path of a go-around is not known; return "" if it is known."""
    next_item = next(
        (mission_item for mission_item in requirements.setup.mission.items if mission_item.seq == item.seq + 1), None
    )
    # This takes precedence over landing sequences (`AP_Landing::restart_landing_sequence`).
    if (
        next_item is not None
        and next_item.command == Command.NAV_CONTINUE_AND_CHANGE_ALT
        and int(next_item.params[0]) in (0, 1)
    ):
        return f"{command_name(next_item.command)} (item {next_item.seq}) follows the landing, and is flown instead"
    return "" if landings else "no waypoint before the landing is known to fly back to"


def _finding(requirements: RouteRequirements, terrain: Terrain, landing: _Landing, *, is_required: bool) -> Finding:
    place, height = requirements.waypoint(landing.at), landing.height
    climb_text = f"it climbs to {height:.0f} m over home"
    climb_text += f", which is {landing.home + height - landing.ground:.0f} m over the landing point"
    # A go-around flies to no rally point.
    setup = requirements.setup
    world = return_world(replace(setup, mission=replace(setup.mission, rally=())))
    aborted_landings = (
        []
        if landing.open
        else _simulate_go_arounds(requirements, terrain, world, landing, height, _abort_places(landing))
    )
    worst = max(aborted_landings, key=lambda aborted: aborted.badness, default=None)
    unknown_text = landing.open or next((aborted.open for aborted in aborted_landings if aborted.open), "")
    climb = Fact("climb above ground", min((aborted.climb for aborted in aborted_landings), default=math.inf), "m")
    if worst is None or (unknown_text and worst.is_free):
        unknown_text = unknown_text or "its glide is below the ground, or the terrain below it is unknown"
        unjudged = message("a go-around is not judged", f": {climb_text}; {unknown_text}")
        check = GROUND_WAY if is_required else ""
        return make_finding(
            "go_around", place, ok=None, reason=unjudged.text, faults=[unjudged], unit="m", check=check, facts=[climb]
        )
    if worst.is_free:
        fault = message(f"{climb_text}; at least {worst.room:.0f} m above ground on the way back")
    else:
        sufficient_height = _next_sufficient_height(requirements, terrain, world, landing, worst.before)
        remedy_text = f"{sufficient_height:.0f} m would be sufficient (parameter 1 of item {landing.item.seq})"
        fault = message(
            _brief_outcome(worst),
            f": {climb_text}, and {_outcome_text(worst)};"
            f" {remedy_text if sufficient_height > 0.0 else _NO_HEIGHT_TEXT}",
        )
    ok = worst.is_free or (False if is_required else None)
    return make_finding(
        "go_around",
        place,
        ok=ok,
        reason=fault.text,
        faults=[] if ok else [fault],
        planned=worst.room,
        limit=worst.needed,
        at_least=True,
        source="check",
        tolerance=0.0,
        margin=None if worst.entered or worst.lost else worst.room - worst.needed,
        unit="m",
        method=f"flown by the simulated ArduPlane on a point mass from {len(aborted_landings)} places of the glide",
        facts=[climb],
    )


def _abort_places(landing: _Landing) -> Floats:
    """Return the simulated abort places up to flare or touchdown, as distances before the landing point, m, (n,)."""
    last = min(landing.run, max(landing.glide.flare_distance, EARLY_TOUCHDOWN_DISTANCE_M))
    count = min(_MAX_ABORT_PLACES, max(2, math.ceil((landing.run - last) / _ABORT_SPACING_M) + 1))
    return np.linspace(landing.run, last, count)


def _simulate_go_arounds(
    requirements: RouteRequirements,
    terrain: Terrain,
    world: ReturnWorld,
    landing: _Landing,
    height: float,
    places: Sequence[float] | Floats,
) -> list[_Aborted]:
    """Simulate and judge go-arounds from the places on the glide that are above the ground.

    height: height above home at which the climb ends, m.
    places: distances before the landing point, m.
    """
    top_altitude = landing.home + height
    starts_on_glide = [(float(distance), landing.place(float(distance))) for distance in places]
    heights = [altitude - float(terrain.height(east, north)) for _, (east, north, altitude) in starts_on_glide]
    airborne = [
        (*start, height_above_ground)
        for start, height_above_ground in zip(starts_on_glide, heights, strict=True)
        if height_above_ground > 0.0
    ]
    if not airborne:
        return []
    start_records: Records = np.concatenate(
        [
            aborted_at(place, landing.course, landing.glide.slope, landing.airspeed, world.aircraft)
            for _, place, _ in airborne
        ]
    )
    flown = fly_go_arounds(
        start_records, top_altitude, landing.pitch, landing.landings, world.parameters, world.aircraft, world.around
    )
    return [
        _judge_go_around(
            requirements,
            terrain,
            landing,
            _Aborted(distance, height_above_ground, at_once=place[2] > top_altitude),
            row,
            path,
            destination,
            top_altitude,
        )
        for (distance, place, height_above_ground), row, path, destination in zip(
            airborne, flown.flown, flown.ways, flown.landings, strict=True
        )
    ]


def _judge_go_around(
    requirements: RouteRequirements,
    terrain: Terrain,
    landing: _Landing,
    aborted: _Aborted,
    flown: Record,
    positions: Floats,
    destination: LandingStart,
    top_altitude: float,
) -> _Aborted:
    """Return `aborted` completed with the judgement of its simulated go-around.

    flown: record with dtype `flight.autopilots.arduplane.rtl_point_mass.RETURN_RESULT`.
    positions: one point a second, m, (n, 3).
    destination: destination of the go-around.
    top_altitude: altitude above which the climb is over, m AMSL.
    """
    rows, end_status = climb_rows(positions, top_altitude), int(flown["ended"])
    aborted = aborted._replace(
        lost=end_status == RETURN_TIMEOUT, open=_unknown_part_text(end_status, has_climbed=rows < len(positions))
    )
    if destination.lands and rows < len(positions):
        # Its path on a glide that may begin anywhere is unknown; the path before the glide is known.
        positions, end_status = positions[: rows + 1], 0
        aborted = aborted._replace(
            lost=False, open=f"its landing sequence begins with the landing (item {destination.item})"
        )
    if len(positions) < 2:
        # It was aborted at its destination, or above the end of its climb.
        return aborted._replace(room=aborted.over)
    steps = np.diff(positions[:, :2], axis=0)
    path = Way(positions, np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))]))
    heights = path_clearance(terrain.heights, terrain.to_pixel.record, positions)[0]
    min_height = float(np.nanmin(heights, initial=math.inf))
    aborted = aborted._replace(entered=first_obstacle_on(requirements, path))
    if end_status == RETURN_GROUND_IMPACT or min_height <= 0.0:
        return aborted._replace(room=min(min_height, 0.0), after=float(flown["clearance_time"]))
    is_beyond_point = (positions[:-1, :2] - landing.point[:2]) @ (
        math.sin(landing.course),
        math.cos(landing.course),
    ) > 0.0
    climb = float(np.nanmin(heights[:rows][is_beyond_point[:rows]], initial=math.inf))
    if climb < GO_AROUND_MODEL_ERROR_M and not aborted.open:
        passing_text = (
            f"aborted {aborted.before:.0f} m before the landing point, its climb clears the ground by {climb:.0f} m"
        )
        aborted = aborted._replace(open=f"{passing_text}, and may be flown {GO_AROUND_MODEL_ERROR_M:.0f} m lower")
    required = _required_heights(terrain, destination, 0.5 * (positions[:-1] + positions[1:]))[rows:]
    return_heights = np.where(np.isnan(heights[rows:]), math.inf, heights[rows:])
    if not return_heights.size:
        return aborted._replace(climb=climb)
    worst = int(np.argmin(return_heights - required))
    return aborted._replace(climb=climb, room=float(return_heights[worst]), needed=float(required[worst]))


def _unknown_part_text(end_status: int, *, has_climbed: bool) -> str:
    """Describe the unknown part of a go-around; return "" if the path is known.

    end_status: status with which the simulation ended.
    has_climbed: True if the go-around reaches the height at which its climb ends.
    """
    if end_status != RETURN_OFF_TERRAIN:
        return ""
    return (
        "it leads to where the terrain is unknown"
        if has_climbed
        else "it leaves the terrain data before it reaches its height"
    )


def _required_heights(terrain: Terrain, destination: LandingStart, points: Floats) -> Floats:
    """Return the required height above ground at points (n, 3) of the path back, m, (n,).

    Near a destination that is lower than `GO_AROUND_CLEARANCE_M`, the destination's own height is required.
    """
    required = np.full(len(points), GO_AROUND_CLEARANCE_M)
    for east, north, up in (start.place for start in (destination, *destination.onward)):
        height = up - float(terrain.height(east, north))
        is_near = np.hypot(points[:, 0] - east, points[:, 1] - north) <= LINE_UP_DISTANCE_M
        if height < GO_AROUND_CLEARANCE_M:
            required[is_near] = np.minimum(required[is_near], height)
    return required


def _next_sufficient_height(
    requirements: RouteRequirements, terrain: Terrain, world: ReturnWorld, landing: _Landing, worst_distance: float
) -> float:
    """Return the next climb height above home at which all go-arounds are free, m; NaN if no height is sufficient.

    worst_distance: distance before the landing point of the abort place to try first, m.

    Heights are tried in steps of `_HEIGHT_STEP_M` up to `_MAX_HEIGHT_M`.
    """
    first = _HEIGHT_STEP_M * math.ceil(landing.height / _HEIGHT_STEP_M + 1e-9)
    distances = [worst_distance, *_abort_places(landing).tolist()]
    for height in np.arange(first, _MAX_HEIGHT_M + 1.0, _HEIGHT_STEP_M).tolist():
        for distance in distances:
            aborted_landings = _simulate_go_arounds(requirements, terrain, world, landing, height, [distance])
            if not all(aborted.is_free and not aborted.open for aborted in aborted_landings):
                # Try the next height first at the place where this one was not enough.
                distances[0] = distance
                break
        else:
            return float(height)
    return math.nan


def _brief_outcome(worst: _Aborted) -> str:
    """Describe the outcome of the worst go-around in a few words."""
    if not math.isnan(worst.after):
        return "a go-around hits the ground"
    if worst.entered:
        return f"a go-around enters {worst.entered}"
    return "a go-around does not return to the line-up" if worst.lost else "a go-around comes too close to the ground"


def _outcome_text(worst: _Aborted) -> str:
    """Describe the abort and the outcome of the worst go-around."""
    abort_text = f"aborted {worst.before:.0f} m before the landing point, {worst.over:.0f} m above ground,"
    turn_text = " is already at this height, turns at once" if worst.at_once else ""
    if not math.isnan(worst.after):
        outcome = f"hits the ground {worst.after:.0f} s later"
    elif worst.entered:
        outcome = f"enters {worst.entered}"
    elif worst.lost:
        outcome = "does not return to the line-up"
    else:
        outcome = f"comes down to {worst.room:.0f} m above ground on the way back"
    return f"{abort_text}{turn_text} and {outcome}" if turn_text else f"{abort_text} {outcome}"


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
    of_route=True,
)
