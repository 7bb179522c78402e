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
_NO_HEIGHT_TEXT = "no height would do"
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

    def place(self, before: float) -> tuple[float, float, float]:
        """Return the glide's east, north and up at a distance (m) before the landing point, m."""
        low = float(self.point[2])
        up = low + self.glide.flare_height + self.glide.slope * (before - self.glide.flare_distance)
        east = float(self.point[0]) - before * math.sin(self.course)
        north = float(self.point[1]) - before * math.cos(self.course)
        return east, north, max(low, min(self.high, up))


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
    returns, ground, home = setup.scenario.returns, setup.scenario.terrain, setup.mission.home
    required = returns is not None and "go_around" in returns.require
    found = (
        landing_item(requirements) if is_laid_out(requirements) and ground is not None and home is not None else None
    )
    landing = None if found is None or ground is None else _landing(requirements, ground, *found)
    if landing is not None and ground is not None:
        return [_finding(requirements, ground, landing, required=required)]
    if not required or setup.source is not None:
        return []
    reason = message(
        "a go-around is not judged",
        ": it needs the simulated ArduPlane, a home, known ground and a glide to the landing point",
    )
    return [make_finding("go_around", FLIGHT, ok=None, reason=reason.text, faults=[reason], check=GROUND_WAY)]


def _landing(requirements: RouteRequirements, ground: Terrain, at: int, item: MissionItem) -> _Landing | None:
    """Return the landing at waypoint `at`, or None if its glide or the height of its go-around is not known."""
    setup, leg = requirements.setup, at - 1
    begin, end = requirements.points[leg], requirements.points[at]
    run, course = float(requirements.runs[leg]), float(requirements.courses[leg])
    place = home_place(setup.mission, setup.scenario.origin, ground)
    home = math.nan if place is None else place.up
    first, takeoff = first_item(requirements)
    climbed = 0.0 if takeoff is None else float(requirements.points[first, 2]) - home
    height = setup.autopilot.go_around_height(item.params[0], climbed)
    landings = _go_around_destinations(requirements, at)
    low, under = setup.route.landing_ground, float(ground.height(float(end[0]), float(end[1])))
    if height is None or math.isnan(home + low + under) or run < MIN_LEG_LENGTH_M or begin[2] <= low:
        return None
    wind = setup.scenario.wind.along(course, low)[0]
    point = np.array([end[0], end[1], low])
    return _Landing(
        glide=setup.autopilot.landing_glide(float(begin[2]) - low, run, wind, low),
        at=at,
        point=point,
        ground=under,
        course=course,
        run=run,
        high=float(begin[2]),
        airspeed=setup.autopilot.landing_airspeed(setup.airspeed, wind, low),
        pitch=_CLIMB_PITCH_RAD if takeoff is None else climb_pitch(takeoff),
        home=home,
        height=height,
        landings=landings,
        item=item,
        open=_unknown_path_text(requirements, item, landings),
    )


def _go_around_destinations(requirements: RouteRequirements, at: int) -> tuple[LandingStart, ...]:
    """Return the landing sequences to which a go-around may fly, or else the place before the landing."""
    setup = requirements.setup
    mission, origin, terrain = setup.mission, setup.scenario.origin, setup.scenario.terrain
    before = int(setup.route.items[at - 1])
    back = landing_sequence(mission, origin, terrain, before)[:1] if before >= 0 else ()
    return landing_starts(mission, origin, terrain) or back


def _unknown_path_text(requirements: RouteRequirements, item: MissionItem, landings: tuple[LandingStart, ...]) -> str:
    """Explain why the path of a go-around is not known; return "" if it is known."""
    after = next((one for one in requirements.setup.mission.items if one.seq == item.seq + 1), None)
    # This takes precedence over landing sequences (`AP_Landing::restart_landing_sequence`).
    if after is not None and after.command == Command.NAV_CONTINUE_AND_CHANGE_ALT and int(after.params[0]) in (0, 1):
        return f"{command_name(after.command)} (item {after.seq}) follows the landing, and is flown instead"
    return "" if landings else "no place before the landing is known to fly back to"


def _finding(requirements: RouteRequirements, ground: Terrain, landing: _Landing, *, required: bool) -> Finding:
    place, height = requirements.waypoint(landing.at), landing.height
    climb_text = f"it climbs to {height:.0f} m over home"
    climb_text += f", which is {landing.home + height - landing.ground:.0f} m over the landing point"
    # A go-around flies to no rally point.
    setup = requirements.setup
    world = return_world(replace(setup, mission=replace(setup.mission, rally=())))
    flown = (
        []
        if landing.open
        else _simulate_go_arounds(requirements, ground, world, landing, height, _abort_places(landing))
    )
    worst = max(flown, key=lambda one: one.badness, default=None)
    unknown = landing.open or next((one.open for one in flown if one.open), "")
    climb = Fact("climb above ground", min((one.climb for one in flown), default=math.inf), "m")
    if worst is None or (unknown and worst.is_free):
        unknown = unknown or "its glide is in the ground, or the ground below is not known"
        open_ = message("a go-around is not judged", f": {climb_text}; {unknown}")
        check = GROUND_WAY if required else ""
        return make_finding(
            "go_around", place, ok=None, reason=open_.text, faults=[open_], unit="m", check=check, facts=[climb]
        )
    if worst.is_free:
        fault = message(f"{climb_text}; {worst.room:.0f} m above ground or more on the way back")
    else:
        enough = _next_sufficient_height(requirements, ground, world, landing, worst.before)
        would = f"{enough:.0f} m would do (the first number of item {landing.item.seq})"
        fault = message(
            _brief_outcome(worst),
            f": {climb_text}, and {_outcome_text(worst)}; {would if enough > 0.0 else _NO_HEIGHT_TEXT}",
        )
    ok = worst.is_free or (False if required else None)
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
        method=f"flown by the simulated ArduPlane on a point mass from {len(flown)} places of the glide",
        facts=[climb],
    )


def _abort_places(landing: _Landing) -> Floats:
    """Return the simulated abort places up to flare or touchdown, as distances before the landing point, m, (n,)."""
    last = min(landing.run, max(landing.glide.flare_distance, EARLY_TOUCHDOWN_DISTANCE_M))
    count = min(_MAX_ABORT_PLACES, max(2, math.ceil((landing.run - last) / _ABORT_SPACING_M) + 1))
    return np.linspace(landing.run, last, count)


def _simulate_go_arounds(
    requirements: RouteRequirements,
    ground: Terrain,
    world: ReturnWorld,
    landing: _Landing,
    height: float,
    places: Sequence[float] | Floats,
) -> list[_Aborted]:
    """Simulate and judge go-arounds from the places on the glide that are above the ground.

    height: height above home at which the climb ends, m.
    places: distances before the landing point, m.
    """
    top = landing.home + height
    begins = [(float(before), landing.place(float(before))) for before in places]
    over = [up - float(ground.height(east, north)) for _, (east, north, up) in begins]
    kept = [(*one, high) for one, high in zip(begins, over, strict=True) if high > 0.0]
    if not kept:
        return []
    starts: Records = np.concatenate(
        [
            aborted_at(place, landing.course, landing.glide.slope, landing.airspeed, world.aircraft)
            for _, place, _ in kept
        ]
    )
    flown = fly_go_arounds(starts, top, landing.pitch, landing.landings, world.parameters, world.aircraft, world.around)
    return [
        _judge_go_around(
            requirements, ground, landing, _Aborted(before, high, at_once=place[2] > top), row, way, goal, top
        )
        for (before, place, high), row, way, goal in zip(kept, flown.flown, flown.ways, flown.landings, strict=True)
    ]


def _judge_go_around(
    requirements: RouteRequirements,
    ground: Terrain,
    landing: _Landing,
    state: _Aborted,
    flown: Record,
    positions: Floats,
    goal: LandingStart,
    top: float,
) -> _Aborted:
    """Return `state` completed with the judgement of its simulated go-around.

    flown: record with dtype `flight.autopilots.arduplane.rtl_point_mass.RETURN_RESULT`.
    positions: one point a second, m, (n, 3).
    goal: destination of the go-around.
    top: altitude above which the climb is over, m AMSL.
    """
    rows, ended = climb_rows(positions, top), int(flown["ended"])
    state = state._replace(lost=ended == RETURN_TIMEOUT, open=_unknown_part_text(ended, climbs=rows < len(positions)))
    if goal.lands and rows < len(positions):
        # Its path on a glide that begins anywhere is unknown; the path before is known.
        positions, ended = positions[: rows + 1], 0
        state = state._replace(lost=False, open=f"its landing sequence begins with the landing (item {goal.item})")
    if len(positions) < 2:
        # Aborted where it is to fly back to, or where the climb is over at once.
        return state._replace(room=state.over)
    step = np.diff(positions[:, :2], axis=0)
    way = Way(positions, np.concatenate([[0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]))]))
    low = path_clearance(ground.heights, ground.to_pixel.record, positions)[0]
    least = float(np.nanmin(low, initial=math.inf))
    state = state._replace(entered=first_obstacle_on(requirements, way))
    if ended == RETURN_GROUND_IMPACT or least <= 0.0:
        return state._replace(room=min(least, 0.0), after=float(flown["clearance_time"]))
    ahead = (positions[:-1, :2] - landing.point[:2]) @ (math.sin(landing.course), math.cos(landing.course)) > 0.0
    climb = float(np.nanmin(low[:rows][ahead[:rows]], initial=math.inf))
    if climb < GO_AROUND_MODEL_ERROR_M and not state.open:
        passes = (
            f"aborted {state.before:.0f} m before the landing point, it passes the ground in its climb by {climb:.0f} m"
        )
        state = state._replace(open=f"{passes}, and may be flown {GO_AROUND_MODEL_ERROR_M:.0f} m lower")
    minimum = _required_heights(ground, goal, 0.5 * (positions[:-1] + positions[1:]))[rows:]
    back = np.where(np.isnan(low[rows:]), math.inf, low[rows:])
    if not back.size:
        return state._replace(climb=climb)
    k = int(np.argmin(back - minimum))
    return state._replace(climb=climb, room=float(back[k]), needed=float(minimum[k]))


def _unknown_part_text(ended: int, *, climbs: bool) -> str:
    """Describe the unknown part of a go-around; return "" if the path is known.

    ended: status with which the simulation ended.
    climbs: True if the go-around reaches the height at which its climb ends.
    """
    if ended != RETURN_OFF_TERRAIN:
        return ""
    return "it leads to where the ground is not known" if climbs else "it does not reach its height on known ground"


def _required_heights(ground: Terrain, goal: LandingStart, points: Floats) -> Floats:
    """Return the required height above ground at points (n, 3) of the path back, m, (n,).

    Near a destination that is lower than `GO_AROUND_CLEARANCE_M`, the destination's own height is required.
    """
    minimum = np.full(len(points), GO_AROUND_CLEARANCE_M)
    for east, north, up in (one.place for one in (goal, *goal.onward)):
        high = up - float(ground.height(east, north))
        near = np.hypot(points[:, 0] - east, points[:, 1] - north) <= LINE_UP_DISTANCE_M
        if high < GO_AROUND_CLEARANCE_M:
            minimum[near] = np.minimum(minimum[near], high)
    return minimum


def _next_sufficient_height(
    requirements: RouteRequirements, ground: Terrain, world: ReturnWorld, landing: _Landing, worst: float
) -> float:
    """Return the next climb height above home at which all go-arounds are free, m; NaN if no height is sufficient.

    worst: distance before the landing point of the abort place to try first, m.

    Heights are tried in steps of `_HEIGHT_STEP_M` up to `_MAX_HEIGHT_M`.
    """
    first = _HEIGHT_STEP_M * math.ceil(landing.height / _HEIGHT_STEP_M + 1e-9)
    order = [worst, *_abort_places(landing).tolist()]
    for up in np.arange(first, _MAX_HEIGHT_M + 1.0, _HEIGHT_STEP_M).tolist():
        for before in order:
            flown = _simulate_go_arounds(requirements, ground, world, landing, up, [before])
            if not all(one.is_free and not one.open for one in flown):
                # Try the next height first at the place where this one was not enough.
                order[0] = before
                break
        else:
            return float(up)
    return math.nan


def _brief_outcome(worst: _Aborted) -> str:
    """Describe the outcome of the worst go-around in a few words."""
    if not math.isnan(worst.after):
        return "a go-around meets the ground"
    if worst.entered:
        return f"a go-around enters {worst.entered}"
    return "a go-around does not return to the line-up" if worst.lost else "a go-around comes too near to the ground"


def _outcome_text(worst: _Aborted) -> str:
    """Describe the abort and the outcome of the worst go-around."""
    where = f"aborted {worst.before:.0f} m before the landing point, {worst.over:.0f} m above ground,"
    turns = " is so high already, turns at once" if worst.at_once else ""
    if not math.isnan(worst.after):
        does = f"meets the ground {worst.after:.0f} s later"
    elif worst.entered:
        does = f"enters {worst.entered}"
    elif worst.lost:
        does = "does not return to the line-up"
    else:
        does = f"comes down to {worst.room:.0f} m above ground on the way back"
    return f"{where}{turns} and {does}" if turns else f"{where} {does}"


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
