"""What can be reached when the engine stops?  From each start: by ArduPlane's own return, and by the best way there is.

ArduPlane does not know that its engine has stopped: its return to launch is flown without thrust by its law
(`flight.autopilots.arduplane.swift_return`), straight at its target and onto its slope.  What could be reached at all
is told by searches backwards from home, the rally points and the landing places of the mission, and from all ground
that is flat by the elevation file (`logs.verdict.returns.glide_map`).  Both keep `MARGIN` above ground all the way, and
out of kill spheres.
"""

import math
from dataclasses import dataclass, field
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.swift_return import CIRCLED, HIT, fly_returns
from flight.mission.placing import landing_places
from flight.mission.return_path import ReturnCircle, ReturnTarget
from logs.verdict.returns.glide_footprint import GlideFootprint
from logs.verdict.returns.glide_map import (
    Cells,
    Flags,
    GlideMap,
    bar_zones,
    glide_map,
    glide_slopes,
    landable,
    least_heights,
)
from logs.verdict.returns.glide_reach import heights_left, place_of
from logs.verdict.returns.judge_returns import ReturnWorld
from logs.verdict.returns.return_starts import ReturnStarts
from world.kernels import Record

Floats = NDArray[np.float64]

# Height above ground that a glide keeps, up to where it arrives, m.  The law without thrust was 13 m too high at the
# most, and the elevation file has its own error.
MARGIN = 30.0

_NOWHERE = (math.nan, math.nan, math.nan)

SiteKind = Literal["home", "rally", "landing"]
# The best that can be reached from a place, the best first: home; a rally point or a landing place of the mission; flat
# ground; nothing; or it is not known, since the aircraft is beyond the elevation data.
Reach = Literal["home", "site", "flat", "nothing", "unknown"]
REACHES: tuple[Reach, ...] = ("home", "site", "flat", "nothing", "unknown")
# How ArduPlane's own return ends without thrust: at its target; there, but lower over the ground than `MARGIN`; in the
# ground; in a kill sphere; off the elevation data; or it is not flown, for it would follow the terrain.
OwnEnd = Literal["arrives", "low", "ground", "threat", "unknown", "not flown"]
# Why nothing is judged: there is no elevation file; the model has no trim with the throttle closed; or the mission
# reaches too far for a map of it.
NotJudged = Literal["", "terrain", "trim", "far"]


class GlideSite(NamedTuple):
    """A place that somebody has chosen.

    number: of the rally point, or the mission item that lands; 0 for home.
    east, north: m.
    """

    kind: SiteKind
    number: int
    east: float
    north: float


@dataclass(frozen=True, slots=True)
class OwnGlide:
    """ArduPlane's return without thrust.

    target: where it goes.  end: what it comes to.
    over: height over the ground at its target when it gets there, m; NaN where it does not.
    clearance: least height above ground on the way, m.
    at: east, north, up where it comes down, m; NaN where it does not.
    short: from there to its target, m; NaN likewise.
    """

    target: ReturnTarget
    end: OwnEnd
    over: float
    clearance: float
    at: tuple[float, float, float]
    short: float


@dataclass(frozen=True, slots=True)
class Glide:
    """What can be reached from one place.

    time: s of the flight.  start: (3,) m.
    own: what ArduPlane's return does.
    left: for each of `Glides.sites` the height left over what the way there takes, m: negative where that is more than
        there is, -inf where no way leads there.
    flat: the same for flat ground.  flat_at: east, north and height of that, m, NaN for none.
    reach: the best of all.
    """

    time: float
    start: tuple[float, float, float]
    own: OwnGlide
    left: tuple[float, ...]
    flat: float
    flat_at: tuple[float, float, float]
    reach: Reach


@dataclass(frozen=True, slots=True)
class GlideRange:
    """Seconds in a row from which the same can be reached, and ArduPlane's return ends alike.

    first, last: s.  count: how many.  site: index of `Glides.sites` that most is left over for, -1 for none.
    least: of them the one with the least left over for what can be reached.
    """

    first: float
    last: float
    count: int
    site: int
    least: Glide


@dataclass(frozen=True, slots=True)
class Glides:
    """Glides from everywhere on the way.

    each: by their times; none where nothing is judged.
    sites: home first, rally points and landing places.
    airspeed: that glides are flown at, equivalent, m/s.
    cell: side of the map's cells, m.
    fuel: whether the engine burns fuel: what it brakes when it stands is not known.
    not_judged: why nothing is.
    footprint: the map that they were looked up on; None where nothing is judged.
    """

    each: tuple[Glide, ...]
    sites: tuple[GlideSite, ...]
    airspeed: float
    cell: float = math.nan
    fuel: bool = False
    not_judged: NotJudged = ""
    footprint: GlideFootprint | None = field(default=None, repr=False, compare=False)

    def count(self, reach: Reach) -> int:
        """From how many places this is the best."""
        return sum(one.reach == reach for one in self.each)

    @property
    def arrivals(self) -> int:
        """How many of ArduPlane's own returns arrive."""
        return sum(one.own.end == "arrives" for one in self.each)

    @property
    def somewhere(self) -> bool | None:
        """Whether something is in reach from everywhere; None where that is not known."""
        if self.count("nothing"):
            return False
        return None if not self.each or self.count("unknown") else True

    def best_site(self, one: Glide) -> int:
        """Home where that is in reach, else the site that most is left over for; -1 for none in reach."""
        if one.reach == "home":
            return 0
        return int(np.argmax(one.left)) if one.reach == "site" else -1

    @property
    def ranges(self) -> tuple[GlideRange, ...]:
        """All in ranges of seconds, by time."""
        found = []
        for (site, *_), group in groupby(self.each, lambda one: (self.best_site(one), one.reach, one.own.end)):
            ones = list(group)
            found.append(
                GlideRange(ones[0].time, ones[-1].time, len(ones), site, min(ones, key=lambda one: self.spare(one)))
            )
        return tuple(found)

    def spare(self, one: Glide) -> float:
        """Height left over for the best that can be reached, m; below 0 where nothing can, -inf where no way leads."""
        if one.reach in ("home", "site"):
            return one.left[self.best_site(one)]
        return one.flat if one.reach == "flat" else max((*one.left, one.flat))


# Of a flight that nobody asked it of.
NOT_ASKED = Glides((), (), math.nan)


def judge_glides(world: ReturnWorld, starts: ReturnStarts) -> Glides:
    """Judge what can be reached without an engine from each start; one low in a take-off or landing is left out.

    From there the aircraft comes down straight ahead.
    """
    starts = starts.at(np.flatnonzero(~starts.low))
    parameters = world.parameters
    sites, airspeed = _sites(world), float(parameters.airspeed_min)
    fuel = world.setup.envelope.volts <= 0.0
    terrain, around = world.scenario.terrain, world.around
    if terrain is None:
        return Glides((), sites, airspeed, fuel=fuel, not_judged="terrain")
    if not world.aircraft.glides:
        return Glides((), sites, airspeed, fuel=fuel, not_judged="trim")
    if not len(starts):
        return Glides((), sites, airspeed, fuel=fuel)
    rows = starts.rows
    places = np.concatenate([np.stack([rows["east"], rows["north"]], axis=1), [site[2:] for site in sites]])
    made = glide_map(terrain, places, MARGIN, around.spheres, around.radii)
    if made is None:
        return Glides((), sites, airspeed, fuel=fuel, not_judged="far")
    ends = _own_glides(world, starts)
    bank, top = float(parameters.roll_limit), float(rows["up"].max())
    low = float(np.nanmin(made.ground)) if np.isfinite(made.ground).any() else 0.0
    slopes = glide_slopes(world.aircraft, airspeed, low, max(top, low + 1.0))

    def looked(cells: Cells) -> tuple[Floats, NDArray[np.int32], Floats]:
        needs = least_heights(made, cells, slopes, top)
        return *heights_left(rows, needs, world.aircraft, around, airspeed, bank), needs.need

    by_site = [looked(np.array([made.cell_of(site.east, site.north)])) for site in sites]
    left = [found[0] for found in by_site]
    landings = _flat_ground(world, made)
    flat, flat_cells, _ = looked(np.argwhere(landings))
    known = np.isfinite(terrain.height(rows["east"], rows["north"]))
    each = []
    for k, row in enumerate(rows):
        lefts = tuple(float(one[k]) for one in left)
        at = place_of(made, int(flat_cells[k])) if flat_cells[k] >= 0 else _NOWHERE
        start = (float(row["east"]), float(row["north"]), float(row["up"]))
        reach = _best(lefts, float(flat[k])) if known[k] else "unknown"
        each.append(Glide(float(starts.time[k]), start, ends[k], lefts, float(flat[k]), at, reach))
    chosen = np.minimum.reduce([found[2] for found in by_site])
    return Glides(tuple(each), sites, airspeed, made.cell, fuel, footprint=GlideFootprint(made, chosen, landings))


def _best(left: tuple[float, ...], flat: float) -> Reach:
    if left[0] >= 0.0:
        return "home"
    if any(one >= 0.0 for one in left):
        return "site"
    return "flat" if flat >= 0.0 else "nothing"


def _sites(world: ReturnWorld) -> tuple[GlideSite, ...]:
    """Home, rally points, and where the mission lands."""
    mission, origin = world.setup.mission, world.scenario.origin
    return (
        GlideSite("home", 0, world.home.east, world.home.north),
        *(GlideSite("rally", one.number or k, one.east, one.north) for k, one in enumerate(world.rally, 1)),
        *(GlideSite("landing", item, east, north) for item, east, north in landing_places(mission, origin)),
    )


def _flat_ground(world: ReturnWorld, made: GlideMap) -> Flags:
    """Cells (n, e) that could be landed on: flat, and in no exclusion zone that reaches down to the ground."""
    flat = landable(made)
    bar_zones(made, flat, world.airspace.records, MARGIN)
    return flat


# ----------------------------------------------------------------------
# ArduPlane's own return.


def _own_glides(world: ReturnWorld, starts: ReturnStarts) -> list[OwnGlide]:
    """ArduPlane's returns without thrust; one that goes on to land is flown as far as its circle."""
    targets = [world.target(row) for row in starts.rows]
    if "terrain" in world.open:
        return [OwnGlide(one, "not flown", math.nan, math.nan, _NOWHERE, math.nan) for one in targets]
    radius = ArduPlane(world.parameters).return_rules.radius
    circles = [None if one.straight else ReturnCircle(*one.position, radius, one.slope_base) for one in targets]
    landings = [one.landing._replace(onward=()) if one.landing and one.straight else None for one in targets]
    flown = fly_returns(
        starts.rows, circles, world.parameters, world.aircraft, world.around, landings=landings, engine_out=True
    ).flown
    return [_own_glide(world, target, row) for target, row in zip(targets, flown, strict=True)]


def _own_glide(world: ReturnWorld, target: ReturnTarget, flown: Record) -> OwnGlide:
    clearance = float(flown["clearance_before"])
    over, short, at = math.nan, math.nan, _NOWHERE
    if flown["ended"] == CIRCLED and world.scenario.terrain is not None:
        over = float(flown["circle_up"] - world.scenario.terrain.height(*target.position[:2]))
    if flown["ended"] == HIT:
        at = (float(flown["clearance_east"]), float(flown["clearance_north"]), float(flown["clearance_up"]))
        short = math.dist(at[:2], target.position[:2])
    return OwnGlide(target, _own_end(flown, clearance, over), over, clearance, at, short)


def _own_end(flown: Record, clearance: float, over: float) -> OwnEnd:
    if flown["ended"] == HIT:
        return "ground"
    if flown["outside"] <= 0.0:
        return "threat"
    if flown["ended"] != CIRCLED:
        return "unknown"
    return "arrives" if min(clearance, over) >= MARGIN else "low"
