"""Judge which places are in reach after an engine failure, by ArduPlane's own return and by the best path.

ArduPlane does not know that its engine has stopped: its return to launch is simulated without thrust by its control law
(`flight.autopilots.arduplane.rtl_point_mass`), straight at its target and onto its slope.  What can be reached at all
is found by backward searches from home, the rally points and the landing places of the mission, and from all ground
that is flat by the elevation file (`logs.verdict.returns.glide_map`).  Both keep `MARGIN` above ground on the whole
path, and stay out of kill spheres.
"""

import math
from dataclasses import dataclass, field
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.rtl_point_mass import RETURN_ARRIVED, RETURN_GROUND_IMPACT, fly_returns
from flight.mission.placing import landing_places
from flight.mission.return_path import ReturnCircle, ReturnTarget
from logs.verdict.returns.glide_footprint import GlideFootprint
from logs.verdict.returns.glide_map import Cells, GlideMap, bar_zones, glide_map, glide_slopes, landable, least_heights
from logs.verdict.returns.glide_reach import heights_left, place_of
from logs.verdict.returns.judge_returns import ReturnWorld
from logs.verdict.returns.return_starts import ReturnStarts
from world.arrays import Flags, Floats
from world.kernels import Record

# Height above ground that a glide keeps until it arrives, m.  ArduPlane's law without thrust was at most 13 m too high,
# and the elevation file has its own error.
MARGIN = 30.0

_NOWHERE = (math.nan, math.nan, math.nan)

SiteKind = Literal["home", "rally", "landing"]
# The best destination in reach from a place, best first: home; a rally point or a landing place of the mission; flat
# ground; nothing; or unknown, because the aircraft is beyond the elevation data.
Reach = Literal["home", "site", "flat", "nothing", "unknown"]
REACHES: tuple[Reach, ...] = ("home", "site", "flat", "nothing", "unknown")
# Outcome of ArduPlane's own return without thrust: at its target; at its target, but lower above ground than `MARGIN`;
# ground impact; in a kill sphere; off the elevation data; or not simulated, because it would follow the terrain.
OwnEnd = Literal["arrives", "low", "ground", "threat", "unknown", "not flown"]
# Why nothing is judged: there is no elevation file; the model has no trim with the throttle closed; or the mission
# is too large for a map.
NotJudged = Literal["", "terrain", "trim", "far"]


class GlideSite(NamedTuple):
    """Chosen place to glide to.

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

    target: its destination.  end: its outcome.
    over: height above ground at arrival over its target, m; NaN if it does not arrive.
    clearance: least height above ground on the path, m.
    at: east, north, up of the ground impact, m; NaN without one.
    short: distance from there to its target, m; NaN without an impact.
    """

    target: ReturnTarget
    end: OwnEnd
    over: float
    clearance: float
    at: tuple[float, float, float]
    short: float


@dataclass(frozen=True, slots=True)
class Glide:
    """Destinations in reach from one place.

    time: s of the flight.  start: (3,) m.
    own: outcome of ArduPlane's return.
    left: for each of `Glides.sites` the altitude left over after the path there, m: negative if the altitude is too
        low, -inf if no path leads there.
    flat: the same for flat ground.  flat_at: east, north and altitude of that ground, m, NaN if none.
    reach: the best destination.
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
    """Time range with the same destination in reach and the same outcome of ArduPlane's return.

    first, last: s.  count: number of glides.  site: index of the site in `Glides.sites` with most altitude left, or -1.
    least: the glide with the least altitude left over at its best destination.
    """

    first: float
    last: float
    count: int
    site: int
    least: Glide


@dataclass(frozen=True, slots=True)
class Glides:
    """Glides from all places on the path.

    each: by time; empty if nothing is judged.
    sites: home first, then rally points and landing places.
    airspeed: of the glides, equivalent, m/s.
    cell: side of the map's cells, m.
    fuel: True if the engine burns fuel: the drag of the stopped engine is unknown.
    not_judged: why nothing is judged.
    footprint: the map used for the glides; None if nothing is judged.
    """

    each: tuple[Glide, ...]
    sites: tuple[GlideSite, ...]
    airspeed: float
    cell: float = math.nan
    fuel: bool = False
    not_judged: NotJudged = ""
    footprint: GlideFootprint | None = field(default=None, repr=False, compare=False)

    def count(self, reach: Reach) -> int:
        """Return the number of places whose best destination is this one."""
        return sum(one.reach == reach for one in self.each)

    @property
    def arrivals(self) -> int:
        """Number of ArduPlane's own returns that arrive."""
        return sum(one.own.end == "arrives" for one in self.each)

    @property
    def somewhere(self) -> bool | None:
        """True if something is in reach from all places; None if unknown."""
        if self.count("nothing"):
            return False
        return None if not self.each or self.count("unknown") else True

    def best_site(self, one: Glide) -> int:
        """Return the index of home if in reach, otherwise of the site with most altitude left; -1 if there is none."""
        if one.reach == "home":
            return 0
        return int(np.argmax(one.left)) if one.reach == "site" else -1

    @property
    def ranges(self) -> tuple[GlideRange, ...]:
        """All glides in time ranges, by time."""
        found = []
        for (site, *_), group in groupby(self.each, lambda one: (self.best_site(one), one.reach, one.own.end)):
            ones = list(group)
            found.append(
                GlideRange(ones[0].time, ones[-1].time, len(ones), site, min(ones, key=lambda one: self.spare(one)))
            )
        return tuple(found)

    def spare(self, one: Glide) -> float:
        """Return the altitude left at the best destination, m.

        Below 0 if none is in reach, -inf without a path.
        """
        if one.reach in ("home", "site"):
            return one.left[self.best_site(one)]
        return one.flat if one.reach == "flat" else max((*one.left, one.flat))


# Placeholder for a flight without judged glides.
NOT_ASKED = Glides((), (), math.nan)


def judge_glides(world: ReturnWorld, starts: ReturnStarts) -> Glides:
    """Judge which places each start can reach without an engine, except starts in low take-offs and landings.

    From a low start the aircraft descends straight ahead.
    """
    starts = starts.at(np.flatnonzero(~starts.low))
    parameters = world.parameters
    sites, airspeed = _glide_sites(world), float(parameters.airspeed_min)
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

    def search_from(cells: Cells) -> tuple[Floats, NDArray[np.int32], Floats]:
        needs = least_heights(made, cells, slopes, top)
        return *heights_left(rows, needs, world.aircraft, around, airspeed, bank), needs.need

    by_site = [search_from(np.array([made.cell_of(site.east, site.north)])) for site in sites]
    left = [found[0] for found in by_site]
    landings = _flat_ground(world, made)
    flat, flat_cells, _ = search_from(np.argwhere(landings))
    known = np.isfinite(terrain.height(rows["east"], rows["north"]))
    each = []
    for k, row in enumerate(rows):
        lefts = tuple(float(one[k]) for one in left)
        at = place_of(made, int(flat_cells[k])) if flat_cells[k] >= 0 else _NOWHERE
        start = (float(row["east"]), float(row["north"]), float(row["up"]))
        reach = _best_reach(lefts, float(flat[k])) if known[k] else "unknown"
        each.append(Glide(float(starts.time[k]), start, ends[k], lefts, float(flat[k]), at, reach))
    chosen = np.minimum.reduce([found[2] for found in by_site])
    return Glides(tuple(each), sites, airspeed, made.cell, fuel, footprint=GlideFootprint(made, chosen, landings))


def _best_reach(left: tuple[float, ...], flat: float) -> Reach:
    if left[0] >= 0.0:
        return "home"
    if any(one >= 0.0 for one in left):
        return "site"
    return "flat" if flat >= 0.0 else "nothing"


def _glide_sites(world: ReturnWorld) -> tuple[GlideSite, ...]:
    """Return home, rally points, and the mission's landing places."""
    mission, origin = world.setup.mission, world.scenario.origin
    return (
        GlideSite("home", 0, world.home.east, world.home.north),
        *(GlideSite("rally", one.number or k, one.east, one.north) for k, one in enumerate(world.rally, 1)),
        *(GlideSite("landing", item, east, north) for item, east, north in landing_places(mission, origin)),
    )


def _flat_ground(world: ReturnWorld, made: GlideMap) -> Flags:
    """Return cells (n, e) for landing: flat, and in no exclusion zone that reaches down to the ground."""
    flat = landable(made)
    bar_zones(made, flat, world.airspace.records, MARGIN)
    return flat


# ----------------------------------------------------------------------
# ArduPlane's own return.


def _own_glides(world: ReturnWorld, starts: ReturnStarts) -> list[OwnGlide]:
    """Simulate ArduPlane's returns without thrust.

    A return that goes on to land is flown as far as its loiter.
    """
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
    if flown["ended"] == RETURN_ARRIVED and world.scenario.terrain is not None:
        over = float(flown["circle_up"] - world.scenario.terrain.height(*target.position[:2]))
    if flown["ended"] == RETURN_GROUND_IMPACT:
        at = (float(flown["clearance_east"]), float(flown["clearance_north"]), float(flown["clearance_up"]))
        short = math.dist(at[:2], target.position[:2])
    return OwnGlide(target, _own_end(flown, clearance, over), over, clearance, at, short)


def _own_end(flown: Record, clearance: float, over: float) -> OwnEnd:
    if flown["ended"] == RETURN_GROUND_IMPACT:
        return "ground"
    if flown["outside"] <= 0.0:
        return "threat"
    if flown["ended"] != RETURN_ARRIVED:
        return "unknown"
    return "arrives" if min(clearance, over) >= MARGIN else "low"
