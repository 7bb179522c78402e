"""The go-around rule: where a landing by ArduPlane's law leads that is aborted.

A go-around is no item of the mission: it comes when somebody commands it, anywhere on the glide.  So it is flown from
several places of the glide that the autopilot lays out, by ArduPlane's law on a point mass
(`flight.autopilots.arduplane.swift_go_around`), back to the last place before the glide, and what it meets is judged as
flown.  It climbs on the landing course to a height over home, whatever the height of the field, and only then turns:
from a field that lies higher than home it may turn into a hill at once.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.autopilots.arduplane.swift_go_around import aborted_at, fly_go_arounds
from flight.autopilots.arduplane.swift_return import HIT
from flight.autopilots.autopilot import LandingGlide
from flight.mission.ground_ways import climb_pitch
from flight.mission.items import MissionItem
from flight.mission.placing import home_place, landing_sequence, landing_starts
from flight.mission.return_path import LandingStart, nearest_landing
from logs.verdict.findings import GROUND_WAY, Finding, make_finding, message
from logs.verdict.measures.path_sweeps import path_clearance
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.ways import Way, entered_by_way, first_item, is_laid_out, landing_item
from logs.verdict.places import FLIGHT
from logs.verdict.returns.judge_returns import ReturnWorld, return_world
from logs.verdict.rule import Rule, located
from logs.verdict.tolerances import EARLY_TOUCH, GO_AROUND_ROOM, ON_THE_SPOT
from logs.verdict.wording import shortened
from world.kernels import Record, Records
from world.terrain import Terrain

Floats = NDArray[np.float64]

# Heights over home that a go-around is tried with, m.
_HEIGHT_STEP, _HIGHEST = 5.0, 1000.0
# Places of a glide that it is aborted at: so far apart (m), and this many at the most.
_APART, _MOST_PLACES = 50.0, 12
_NONE_DO = "no height would do"
# Pitch of the climb where the mission has no take-off, rad (`Plane::do_land`, ArduPlane/commands_logic.cpp).
_PITCH = math.radians(10.0)


@dataclass(frozen=True, slots=True)
class _Landing:
    """A landing that may be aborted.

    at: its waypoint.  glide: to the point (3,) m, its height that of the mission; ground: m AMSL, under the point.
    course: rad.  run: of the last leg, m.  high: at which the glide begins, m AMSL.  airspeed: on it, true, m/s.
    pitch: of the climb, rad.  height: that it goes to over home, m; home: m AMSL.
    sequence: the places that are flown to after it.  item: of the landing.
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
    sequence: tuple[LandingStart, ...]
    item: MissionItem

    def place(self, before: float) -> tuple[float, float, float]:
        """East, north and up of the glide so far before the landing point, m."""
        low = float(self.point[2])
        up = low + self.glide.flare_height + self.glide.slope * (before - self.glide.flare_distance)
        east = float(self.point[0]) - before * math.sin(self.course)
        north = float(self.point[1]) - before * math.cos(self.course)
        return east, north, max(low, min(self.high, up))


class _Aborted(NamedTuple):
    """A landing that was aborted.

    before: where, m before the landing point.  over: height above ground there, m.
    at_once: whether it is as high there as its climb goes.
    room: least height above ground once the climb is over, or of all of it where it meets the ground; NaN where that is
        not known, m.
    after: s from the abort to where it meets the ground, NaN where it does not.
    entered: the sphere or zone that it enters, "" for none.
    """

    before: float
    over: float
    at_once: bool
    room: float = math.nan
    after: float = math.nan
    entered: str = ""

    @property
    def badness(self) -> tuple[bool, bool, float]:
        """By what they are ordered, the worst last."""
        return not math.isnan(self.after), bool(self.entered), -self.room


def go_around_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None = None, *, geometric: bool = False
) -> list[Finding]:
    """One finding of a mission that lands and has a home: a warning where a go-around comes near to the ground.

    Where the scenario requires that it may be aborted, it fails there, and is left open where it is not judged.
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
        "a go-around is not judged", ": it takes ArduPlane's law, a home, known ground and a glide to land by"
    )
    return [make_finding("go_around", FLIGHT, ok=None, reason=reason.text, faults=[reason], check=GROUND_WAY)]


def _landing(requirements: RouteRequirements, ground: Terrain, at: int, item: MissionItem) -> _Landing | None:
    """The landing at a waypoint; None where its glide or its go-around is not known."""
    setup, leg = requirements.setup, at - 1
    begin, end = requirements.points[leg], requirements.points[at]
    run, course = float(requirements.runs[leg]), float(requirements.courses[leg])
    place = home_place(setup.mission, setup.scenario.origin, ground)
    home = math.nan if place is None else place.up
    first, takeoff = first_item(requirements)
    climbed = 0.0 if takeoff is None else float(requirements.points[first, 2]) - home
    height = setup.autopilot.go_around_height(item.params[0], climbed)
    low, under = setup.route.landing_ground, float(ground.height(float(end[0]), float(end[1])))
    if height is None or math.isnan(home + low + under) or run < ON_THE_SPOT or begin[2] <= low:
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
        pitch=_PITCH if takeoff is None else climb_pitch(takeoff),
        home=home,
        height=height,
        sequence=_sequence(requirements, at, point),
        item=item,
    )


def _sequence(requirements: RouteRequirements, at: int, point: Floats) -> tuple[LandingStart, ...]:
    """The places that a go-around flies to: of the nearest landing sequence, or the one before the landing."""
    setup = requirements.setup
    mission, origin, terrain = setup.mission, setup.scenario.origin, setup.scenario.terrain
    here = (float(point[0]), float(point[1]), float(point[2]))
    start = nearest_landing(here, landing_starts(mission, origin, terrain))
    if start is not None and not start.lands:
        return (start, *start.onward)
    before = int(setup.route.items[at - 1])
    return landing_sequence(mission, origin, terrain, before)[:1] if before >= 0 else ()


def _finding(requirements: RouteRequirements, ground: Terrain, landing: _Landing, *, required: bool) -> Finding:
    place, height = requirements.waypoint(landing.at), landing.height
    said = f"it climbs to {height:.0f} m over home"
    said += f", which is {landing.home + height - landing.ground:.0f} m over the landing point"
    # No rally point is flown to, wherever they are.
    setup = requirements.setup
    world = return_world(replace(setup, mission=replace(setup.mission, rally=())))
    needed = _needed(ground, landing)
    flown = _fly(requirements, ground, world, landing, height, _places(landing)) if landing.sequence else []
    known = [one for one in flown if not math.isnan(one.room)]
    worst = max(known, key=lambda one: one.badness, default=None)
    unknown = "" if len(known) == len(flown) > 0 else "it leads to where the ground is not known"
    if not landing.sequence:
        unknown = "no place before the landing is known to fly back to"
    elif not flown:
        unknown = "its glide is in the ground, or the ground below is not known"
    if worst is None or (unknown and _is_free(worst, needed)):
        open_ = message("a go-around is not judged", f": {said}; {unknown}")
        check = GROUND_WAY if required else ""
        return make_finding("go_around", place, ok=None, reason=open_.text, faults=[open_], unit="m", check=check)
    enough = math.nan
    if _is_free(worst, needed):
        fault = message(f"{said}; {worst.room:.0f} m above ground or more on the way back")
    else:
        enough = _enough(requirements, ground, world, landing, worst.before)
        would = f"{enough:.0f} m would do (the first number of item {landing.item.seq})"
        fault = message(_brief(worst), f": {said}, and {_described(worst)}; {would if enough > 0.0 else _NONE_DO}")
    ok = _is_free(worst, needed) or (False if required else None)
    return make_finding(
        "go_around",
        place,
        ok=ok,
        reason=fault.text,
        faults=[] if ok else [fault],
        planned=worst.room,
        limit=needed,
        source="check",
        tolerance=0.0,
        margin=None if worst.entered else worst.room - needed,
        unit="m",
        method=f"flown by ArduPlane's law on a point mass from {len(flown)} places of the glide",
    )


def _places(landing: _Landing) -> Floats:
    """Where on the glide it is aborted: (n,) m before the landing point, to where the flare begins or it lands."""
    last = min(landing.run, max(landing.glide.flare_distance, EARLY_TOUCH))
    count = min(_MOST_PLACES, max(2, math.ceil((landing.run - last) / _APART) + 1))
    return np.linspace(landing.run, last, count)


def _fly(
    requirements: RouteRequirements,
    ground: Terrain,
    world: ReturnWorld,
    landing: _Landing,
    height: float,
    places: Sequence[float] | Floats,
) -> list[_Aborted]:
    """Go-arounds to a height over home (m) from places (m before the landing point) that are above the ground."""
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
    flown = fly_go_arounds(starts, top, landing.pitch, landing.sequence, world.parameters, world.aircraft, world.around)
    return [
        _judged(requirements, ground, _Aborted(before, high, at_once=place[2] > top), row, way, top)
        for (before, place, high), row, way in zip(kept, flown.flown, flown.ways, strict=True)
    ]


def _judged(
    requirements: RouteRequirements, ground: Terrain, begun: _Aborted, flown: Record, positions: Floats, top: float
) -> _Aborted:
    """What a go-around comes to.

    flown: of `flight.autopilots.arduplane.swift_return.RETURN_FLOWN`.  positions: (n, 3) m, a second apart.
    top: height above which its climb is over, m AMSL.
    """
    if len(positions) < 2:
        # Aborted where it is to fly back to.
        return begun._replace(room=begun.over)
    step = np.diff(positions[:, :2], axis=0)
    way = Way(positions, np.concatenate([[0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]))]))
    entered, above = entered_by_way(requirements, way), positions[:-1, 2] > top
    low = path_clearance(ground.heights, ground.to_pixel.record, positions)[0]
    least = float(np.nanmin(low, initial=math.inf))
    if flown["ended"] == HIT or least <= 0.0:
        return begun._replace(room=min(least, 0.0), after=float(flown["clearance_time"]), entered=entered)
    # Where ground is not known, nor is the least height above it.
    over = low[int(np.argmax(above)) :] if above.any() else low
    return begun._replace(room=float(over.min()), entered=entered)


def _needed(ground: Terrain, landing: _Landing) -> float:
    """Height above ground that is asked of the way back: that of the landing sequence's lowest place, if it is less."""
    places = [one.place for one in landing.sequence]
    return min(GO_AROUND_ROOM, *(up - float(ground.height(east, north)) for east, north, up in places))


def _is_free(one: _Aborted, needed: float) -> bool:
    return math.isnan(one.after) and not one.entered and one.room >= needed


def _enough(
    requirements: RouteRequirements, ground: Terrain, world: ReturnWorld, landing: _Landing, worst: float
) -> float:
    """The next height over home (m) that would do, in steps; NaN where none does.  worst: place to be tried first."""
    needed, first = _needed(ground, landing), _HEIGHT_STEP * math.ceil(landing.height / _HEIGHT_STEP + 1e-9)
    order = [worst, *_places(landing).tolist()]
    for up in np.arange(first, _HIGHEST + 1.0, _HEIGHT_STEP).tolist():
        for before in order:
            flown = _fly(requirements, ground, world, landing, up, [before])
            if not all(_is_free(one, needed) for one in flown):
                # Where one height does not do, the next is tried first.
                order[0] = before
                break
        else:
            return float(up)
    return math.nan


def _brief(worst: _Aborted) -> str:
    """What becomes of the worst, in a few words."""
    if not math.isnan(worst.after):
        return "a go-around meets the ground"
    return f"a go-around enters {worst.entered}" if worst.entered else "a go-around comes too near to the ground"


def _described(worst: _Aborted) -> str:
    """What becomes of the worst, in words."""
    where = f"aborted {worst.before:.0f} m before the landing point, {worst.over:.0f} m above ground,"
    turns = " is so high already, turns at once" if worst.at_once else ""
    if not math.isnan(worst.after):
        does = f"meets the ground {worst.after:.0f} s later"
    elif worst.entered:
        does = f"enters {worst.entered}"
    else:
        does = f"comes down to {worst.room:.0f} m above ground on the way back"
    return f"{where}{turns} and {does}" if turns else f"{where} {does}"


RULE = Rule(
    name="go_around",
    title="go-around",
    noun="go-around",
    asks="Would a go-around from anywhere on the glide stay clear of ground, missiles and zones?",
    margin=None,
    tolerances=("GO_AROUND_ROOM", "EARLY_TOUCH", "ON_THE_SPOT"),
    judge=go_around_findings,
    phrase=lambda item: located("go-around", item, shortened(item.brief)),
    warns=True,
)
