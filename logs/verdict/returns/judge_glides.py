"""Judge the destinations in reach after an engine failure.

Both the autopilot's own RTL and the best path are judged.

ArduPlane does not detect an engine failure: its return to launch is simulated without thrust by its control law
(`flight.autopilots.arduplane.rtl_point_mass`), straight to its target and onto its slope.  The RTL of other autopilots
is not simulated without thrust.  All destinations in reach are found by backward searches from home, the rally points
and the landing places of the mission, and from all ground that is flat by the elevation file
(`logs.verdict.returns.glide_map`).  A glide is required to keep `GLIDE_CLEARANCE_M` above ground on its whole path, and
to stay out of kill spheres.
"""

import math
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.autopilots.simulated_returns import RETURN_ARRIVED, RETURN_GROUND_IMPACT
from flight.mission.placing import landing_positions
from flight.mission.return_path import ReturnTarget
from logs.verdict.returns.glide_footprint import GlideFootprint
from logs.verdict.returns.glide_map import (
    Cells,
    GlideSlopes,
    PossibleWinds,
    exclude_zones,
    glide_slopes,
    glide_steps,
    landable_cells,
    make_glide_map,
    search_glide_altitudes,
)
from logs.verdict.returns.glide_reach import cell_position, remaining_glide_altitudes
from logs.verdict.returns.judge_returns import ReturnWorld
from logs.verdict.returns.return_starts import ReturnStarts
from world.arrays import Floats
from world.kernels import Record
from world.scenario import Scenario

# Height above ground that a glide keeps until it arrives, m.  The simulated ArduPlane's flights without thrust were at
# most 13 m too high, and the elevation file has an error, too.
GLIDE_CLEARANCE_M = 30.0
# Time after the last start for which the winds of a forecast are sampled, s.
_MAX_GLIDE_TIME_S = 600.0
# Number of samples of a forecast's wind to the east, to the north and in time, around the flight and its destinations.
_WIND_SAMPLES = (9, 9, 5)

# Glide slope that stands for no progress against the wind, m/m.
_STEEPEST_SLOPE = 1e3

_NO_POSITION = (math.nan, math.nan, math.nan)

SiteKind = Literal["home", "rally", "landing"]
# The best destination in reach from a place, best first: home; a rally point or a landing place of the mission; flat
# ground; nothing; or unknown, because the aircraft is beyond the elevation data.
Reach = Literal["home", "site", "flat", "nothing", "unknown"]
REACHES: tuple[Reach, ...] = ("home", "site", "flat", "nothing", "unknown")
# Outcome of the autopilot's own RTL without thrust: over its target; over its target, but lower above ground than
# `GLIDE_CLEARANCE_M` there or before; ground impact short of its target; in a kill sphere; off the elevation data; or
# not simulated, because it would follow the terrain, or because the autopilot's RTL without thrust is not known.
EngineOutEnd = Literal["arrives", "low", "ground", "threat", "unknown", "not flown"]
# Reason why no glide is judged: there is no elevation file; the model has no trim with the throttle closed; or the
# mission is too large for a map.
NotJudged = Literal["", "terrain", "trim", "far"]


class GlideSite(NamedTuple):
    """Home, a rally point or a landing place of the mission, as the destination of a glide.

    number: number of the rally point, or the mission item that lands; 0 for home.
    east, north: position, m.
    """

    kind: SiteKind
    number: int
    east: float
    north: float


@dataclass(frozen=True, slots=True)
class EngineOutReturn:
    """The autopilot's return to launch without thrust.

    It is simulated up to its arrival radius, and continues from there with a straight glide to its target.

    target: destination of the return.
    end: outcome.
    arrival_height: height above ground over the target, m; NaN if the aircraft does not arrive.
    clearance: minimum height above ground on the path, m.
    impact: east, north and up of the ground impact, m; NaN without an impact.
    shortfall: distance from the ground impact to the target, m; NaN without an impact.
    """

    target: ReturnTarget
    end: EngineOutEnd
    arrival_height: float
    clearance: float
    impact: tuple[float, float, float]
    shortfall: float


@dataclass(frozen=True, slots=True)
class Glide:
    """Destinations in reach from one start.

    time: flight time at the start, s.
    start: position of the start, m, (3,).
    own_return: outcome of the autopilot's return.
    home_altitude_left: altitude left on arrival at home, m; negative if the altitude is too low, -inf without a path.
    site_altitude_left: altitude left on arrival at the best rally point or landing place, m; -inf if there is none.
    site: index of that place in `Glides.sites`; -1 if no path leads to one.
    flat_altitude_left: altitude left on arrival over flat ground, m; -inf if no path leads to any.
    flat_position: east, north and altitude of that ground, m; NaN if there is none.
    reach: the best destination.
    """

    time: float
    start: tuple[float, float, float]
    own_return: EngineOutReturn
    home_altitude_left: float
    site_altitude_left: float
    site: int
    flat_altitude_left: float
    flat_position: tuple[float, float, float]
    reach: Reach


@dataclass(frozen=True, slots=True)
class GlideRange:
    """Time range with the same best destination and the same outcome of the autopilot's return.

    first, last: times of the first and the last start, s.
    count: number of glides.
    site: index of the best site in `Glides.sites`, or -1.
    lowest_glide: glide with the least altitude to spare at its best destination.
    """

    first: float
    last: float
    count: int
    site: int
    lowest_glide: Glide


@dataclass(frozen=True, slots=True)
class Glides:
    """Glides from all starts on the path.

    each: the glides in order of time; empty if no glide is judged.
    sites: home first, then rally points and landing places.
    airspeed: equivalent airspeed of the glides, m/s.
    cell: side of the map's cells, m.
    fuel: True if the engine burns fuel; the drag of the stopped engine is then unknown.
    not_judged: reason why no glide is judged; "" if glides are judged.
    footprint: the map used for the glides; None if no glide is judged.
    autopilot: title of the autopilot whose own return is simulated.
    airspeed_name: parameter of the airspeed; "" if no parameter states it.
    follows_terrain: True if the autopilot's own returns would follow the terrain.
    """

    each: tuple[Glide, ...]
    sites: tuple[GlideSite, ...]
    airspeed: float
    cell: float = math.nan
    fuel: bool = False
    not_judged: NotJudged = ""
    footprint: GlideFootprint | None = field(default=None, repr=False, compare=False)
    autopilot: str = ""
    airspeed_name: str = ""
    follows_terrain: bool = False

    def count(self, reach: Reach) -> int:
        """Return the number of glides whose best destination is of the kind `reach`."""
        return sum(glide.reach == reach for glide in self.each)

    @property
    def arrival_count(self) -> int:
        """Number of starts from which the autopilot's own RTL without thrust arrives."""
        return sum(glide.own_return.end == "arrives" for glide in self.each)

    @property
    def unexpected_arrival_count(self) -> int:
        """Number of starts from which the autopilot's own RTL arrives, but the search reaches no site.

        The search is more pessimistic than the simulation of the RTL.
        """
        return sum(glide.own_return.end == "arrives" and glide.reach in ("flat", "nothing") for glide in self.each)

    @property
    def always_reaches_ground(self) -> bool | None:
        """True if a glide from every start reaches ground on which a landing is possible; None if unknown."""
        if self.count("nothing"):
            return False
        return None if not self.each or self.count("unknown") else True

    def best_site(self, glide: Glide) -> int:
        """Return the index of the best site in reach; -1 if none is.

        Home is preferred; otherwise it is the site with the most altitude left on arrival.
        """
        if glide.reach == "home":
            return 0
        return glide.site if glide.reach == "site" else -1

    @property
    def ranges(self) -> tuple[GlideRange, ...]:
        """Time ranges of consecutive glides with the same destination and RTL outcome, in order of time."""
        ranges = []
        for (site, *_), group in groupby(
            self.each, lambda glide: (self.best_site(glide), glide.reach, glide.own_return.end)
        ):
            group_glides = list(group)
            ranges.append(
                GlideRange(
                    group_glides[0].time,
                    group_glides[-1].time,
                    len(group_glides),
                    site,
                    min(group_glides, key=lambda glide: self.altitude_left(glide)),
                )
            )
        return tuple(ranges)

    def altitude_left(self, glide: Glide) -> float:
        """Return the altitude left on arrival at a glide's best destination, m.

        It is negative if no destination is in reach, and -inf if no path leads to any.
        """
        altitudes_left = {
            "home": glide.home_altitude_left,
            "site": glide.site_altitude_left,
            "flat": glide.flat_altitude_left,
        }
        return altitudes_left.get(glide.reach, max(altitudes_left.values()))


# Placeholder for a flight without judged glides.
NO_GLIDES = Glides((), (), math.nan)


def judge_glides(world: ReturnWorld, starts: ReturnStarts) -> Glides:
    """Judge the destinations that each start can reach after an engine failure.

    Low starts in take-offs and landings are omitted, because the aircraft then descends straight ahead.
    """
    starts = starts.subset(np.flatnonzero(~starts.is_low))
    no_glides = _empty_glides(world)
    sites, airspeed = no_glides.sites, no_glides.airspeed
    terrain, environment, aircraft = world.scenario.terrain, world.environment, world.aircraft
    if terrain is None or not aircraft.glides:
        return replace(no_glides, not_judged="terrain" if terrain is None else "trim")
    rows = starts.rows
    if not len(rows):
        return no_glides
    positions = np.concatenate([np.stack([rows["east"], rows["north"]], axis=1), [site[2:] for site in sites]])
    grid = make_glide_map(terrain, positions, GLIDE_CLEARANCE_M, environment.spheres, environment.radii)
    if grid is None:
        return replace(no_glides, not_judged="far")
    bank, max_altitude = float(world.autopilot.turns.max_bank), float(rows["up"].max())
    min_ground_altitude = float(np.nanmin(grid.ground)) if np.isfinite(grid.ground).any() else 0.0
    top_altitude = max(max_altitude, min_ground_altitude + 1.0)
    winds = None if world.scenario.wind.field is None else _possible_winds(world.scenario, positions, starts.time)
    slopes = glide_slopes(aircraft, airspeed, min_ground_altitude, top_altitude, winds)

    def search_glides_to(cells: Cells) -> tuple[Floats, NDArray[np.int32], Floats]:
        """Return each start's altitude left on arrival, m, its cell, and the minimum altitudes, m.

        The minimum altitudes are a map.

        cells: rows and columns of the destinations, (c, 2).
        """
        altitudes = search_glide_altitudes(grid, cells, slopes, max_altitude)
        lefts, reached_cells = remaining_glide_altitudes(rows, altitudes, aircraft, environment, airspeed, bank)
        return lefts, reached_cells, altitudes.min_altitude

    # Without a known path, none of the autopilot's own returns is simulated.  A return that continues with a landing is
    # simulated only up to its loiter.
    targets = [world.target(row) for row in rows]
    engine_out_returns = [
        EngineOutReturn(target, "not flown", math.nan, math.nan, _NO_POSITION, math.nan) for target in targets
    ]
    if world.is_simulated and world.autopilot.returns.flies_without_engine:
        flown = world.fly(rows, targets, store_positions=True, engine_out=True)
        engine_out_returns = [
            _engine_out_return(world, target, row, track[-1], slopes)
            for target, row, track in zip(targets, flown.results, flown.tracks, strict=True)
        ]
    # One search for home, and one for all other sites, which finds the best of them for each start.
    site_cells = np.array([grid.cell_at(site.east, site.north) for site in sites])
    home_altitudes_left, _, home_min_altitudes = search_glides_to(site_cells[:1])
    site_altitudes_left, reached_cells, site_min_altitudes = search_glides_to(site_cells[1:])
    site_by_cell = {
        int(np.ravel_multi_index(tuple(cell), grid.floor.shape)): k for k, cell in enumerate(site_cells) if k
    }
    # Cells on which a landing is possible: flat, and in no exclusion zone that reaches down to `GLIDE_CLEARANCE_M`.
    is_landable = landable_cells(grid)
    exclude_zones(grid, is_landable, world.airspace.records, GLIDE_CLEARANCE_M)
    flat_altitudes_left, flat_cells, _ = search_glides_to(np.argwhere(is_landable))
    is_known = np.isfinite(terrain.height(rows["east"], rows["north"]))
    glides = []
    for k, row in enumerate(rows):
        altitudes_left = (float(home_altitudes_left[k]), float(site_altitudes_left[k]), float(flat_altitudes_left[k]))
        kinds: tuple[Reach, ...] = ("home", "site", "flat")
        reached = [kind for kind, left in zip(kinds, altitudes_left, strict=True) if left >= 0.0]
        glides.append(
            Glide(
                time=float(starts.time[k]),
                start=(float(row["east"]), float(row["north"]), float(row["up"])),
                own_return=engine_out_returns[k],
                home_altitude_left=altitudes_left[0],
                site_altitude_left=altitudes_left[1],
                site=site_by_cell.get(int(reached_cells[k]), -1),
                flat_altitude_left=altitudes_left[2],
                flat_position=cell_position(grid, int(flat_cells[k])) if flat_cells[k] >= 0 else _NO_POSITION,
                reach="unknown" if not is_known[k] else reached[0] if reached else "nothing",
            )
        )
    footprint = GlideFootprint(grid, np.minimum(home_min_altitudes, site_min_altitudes), is_landable)
    return replace(no_glides, each=tuple(glides), cell=grid.cell, footprint=footprint)


def _empty_glides(world: ReturnWorld) -> Glides:
    """Return a `Glides` without any glide, but with sites, airspeed and autopilot."""
    # Home, the rally points and the mission's landing places.
    mission, origin = world.setup.mission, world.scenario.origin
    return Glides(
        (),
        (
            GlideSite("home", 0, world.home.east, world.home.north),
            *(GlideSite("rally", point.number or k, point.east, point.north) for k, point in enumerate(world.rally, 1)),
            *(GlideSite("landing", item, east, north) for item, east, north in landing_positions(mission, origin)),
        ),
        world.min_airspeed,
        fuel=world.setup.envelope.volts <= 0.0,
        autopilot=world.autopilot.title,
        airspeed_name=world.min_airspeed_name,
        follows_terrain="terrain" in world.unjudged_parts,
    )


# ----------------------------------------------------------------------
# The autopilot's own return to launch without thrust, and the winds of a forecast.


def _possible_winds(scenario: Scenario, positions: Floats, times: Floats) -> PossibleWinds:
    """Return a function that samples a forecast's winds around the flight and its destinations.

    positions: east and north of starts and destinations, m, (n, 2).
    times: times of the starts, s; the samples also cover the longest glide after the last start.
    """
    low, high = positions.min(axis=0), positions.max(axis=0)
    first, last = float(times.min()), float(times.max()) + _MAX_GLIDE_TIME_S
    edges = ((low[0], high[0]), (low[1], high[1]), (first, last))
    axes = [np.linspace(*edge, count) for edge, count in zip(edges, _WIND_SAMPLES, strict=True)]

    def winds_at(altitudes: Floats) -> Floats:
        """Return the winds at h altitudes (m AMSL), at all sampled places and times, m/s, (s, h, 2)."""
        east, north, time, amsl = (axis.ravel() for axis in np.meshgrid(*axes, altitudes, indexing="ij"))
        return scenario.wind_velocities(np.column_stack([east, north, amsl]), time).reshape(-1, len(altitudes), 2)

    return winds_at


def _engine_out_return(
    world: ReturnWorld, target: ReturnTarget, result: Record, last_position: Floats, slopes: GlideSlopes
) -> EngineOutReturn:
    """Convert a result of a return without thrust (dtype `RETURN_RESULT`) to an `EngineOutReturn`.

    last_position: last stored position of the simulation, m, (3,); from there an arriving return glides to its target.
    """
    clearance, sphere_distance = float(result["clearance_before_arrival"]), float(result["sphere_distance"])
    arrival_height, impact = math.nan, _NO_POSITION
    if result["outcome"] == RETURN_GROUND_IMPACT:
        impact = (float(result["clearance_east"]), float(result["clearance_north"]), float(result["clearance_up"]))
    elif result["outcome"] == RETURN_ARRIVED and world.scenario.terrain is not None:
        # A straight glide to the target, with one position about each meter.
        offset = np.array(target.position[:2]) - last_position[:2]
        courses = np.array(glide_steps()[0]["course"])
        course = int(np.argmax(np.cos(courses - math.atan2(offset[0], offset[1]))))
        table_row = round((float(last_position[2]) - slopes.first_altitude) / slopes.altitude_step)
        # Without progress against the wind, the aircraft sinks where it is.
        slope = float(slopes.table[course, min(max(table_row, 0), slopes.table.shape[1] - 1)])
        distance = float(np.hypot(*offset))
        fractions = np.linspace(0.0, 1.0, math.ceil(distance) + 1)
        drop = min(slope, _STEEPEST_SLOPE) * distance
        path = last_position + fractions[:, np.newaxis] * np.array([*offset, -drop])
        heights = path[:, 2] - world.scenario.terrain.height(path[:, 0], path[:, 1])
        clearance, arrival_height = min(clearance, float(heights.min())), float(heights[-1])
        for sphere, radius in zip(world.environment.spheres, world.environment.radii, strict=True):
            if radius > 0.0:
                sphere_distance = min(sphere_distance, float(np.linalg.norm(path - sphere, axis=1).min() - radius))
        if heights.min() <= 0.0:
            east, north, up = path[int(np.argmax(heights <= 0.0))]
            impact, arrival_height = (float(east), float(north), float(up)), math.nan
    shortfall = math.dist(impact[:2], target.position[:2])
    if sphere_distance <= 0.0 and result["outcome"] != RETURN_GROUND_IMPACT:
        end: EngineOutEnd = "threat"
    elif not math.isnan(shortfall):
        end = "ground"
    else:
        end = (
            "unknown"
            if result["outcome"] != RETURN_ARRIVED or math.isnan(arrival_height)
            else ("arrives" if min(clearance, arrival_height) >= GLIDE_CLEARANCE_M else "low")
        )
    return EngineOutReturn(target, end, arrival_height, clearance, impact, shortfall)
