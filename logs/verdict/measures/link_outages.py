"""Measure the radio link along a path: its smallest margin, and the outages below the fade margin."""

import math
from dataclasses import dataclass

import numpy as np

from flight.mission.placing import home_point
from flight.simulation.setup import FlightSetup
from world.arrays import Floats
from world.radio import LinkPoints, RadioLink, link_points
from world.terrain import Terrain

# Time between two points of a path at which the link is computed, s.
LINK_INTERVAL_S = 1.0


@dataclass(frozen=True, slots=True)
class Outage:
    """Period in which the link is below the fade margin.

    start, end: s.
    """

    start: float
    end: float

    @property
    def duration(self) -> float:
        """Duration, s."""
        return self.end - self.start


@dataclass(frozen=True, slots=True, eq=False)
class LinkAlongPath:
    """Quality of the radio link at t points of a path.

    time: s, (t,).
    positions: m, (t, 3).
    points: quality of the link at these points.
    outages: periods below the fade margin, in order of time; an outage contains no point with an unknown margin.
    """

    time: Floats
    positions: Floats
    points: LinkPoints
    outages: tuple[Outage, ...]

    @property
    def is_known(self) -> bool:
        """True if the margin is known at every point."""
        return bool(np.isfinite(self.points.margin).all())

    @property
    def worst_point(self) -> int:
        """Index of the point with the smallest known margin; -1 if no margin is known."""
        margin = self.points.margin
        return int(np.nanargmin(margin)) if np.isfinite(margin).any() else -1

    @property
    def longest_outage(self) -> float:
        """Duration of the longest outage, s."""
        return max((outage.duration for outage in self.outages), default=0.0)

    @property
    def time_below_margin(self) -> float:
        """Total duration of the outages, s."""
        return sum(outage.duration for outage in self.outages)


def station_antenna(setup: FlightSetup, link: RadioLink, terrain: Terrain) -> Floats | None:
    """Return the position of the ground station's antenna, m, (3,).

    A station without a stated position stands at the mission's home.  Return None if there is no home either, or if the
    ground at the position is unknown.
    """
    position = link.station
    if position is None:
        home = home_point(setup.mission, setup.scenario.origin, terrain)
        if home is None:
            return None
        position = (home.east, home.north)
    ground = float(terrain.height(*position))
    return None if math.isnan(ground) else np.array([*position, ground + link.antenna_height])


def link_along_path(
    link: RadioLink, terrain: Terrain, antenna: Floats, time: Floats, positions: Floats
) -> LinkAlongPath:
    """Compute the quality of the radio link along a path, about once a second, and its outages.

    Points with a non-finite time or position are ignored.

    antenna: position of the station's antenna, m, (3,).
    time: increasing times of the path's points, s, (t,).
    positions: points of the path, m, (t, 3).
    """
    is_usable = np.isfinite(positions).all(axis=1) & np.isfinite(time)
    time, positions = time[is_usable], positions[is_usable]
    if not time.size:
        return LinkAlongPath(time, positions, link_points(link, terrain, antenna, positions), ())
    count = max(2, math.ceil((time[-1] - time[0]) / LINK_INTERVAL_S) + 1)
    times = np.linspace(time[0], time[-1], count)
    points = np.stack([np.interp(times, time, axis_positions) for axis_positions in positions.T], axis=1)
    path_link_points = link_points(link, terrain, antenna, points)
    # Periods with a negative margin; margins are interpolated linearly between known values.
    outages: list[Outage] = []
    for k in range(len(times) - 1):
        first, last = float(path_link_points.margin[k]), float(path_link_points.margin[k + 1])
        if math.isnan(first) or math.isnan(last) or (first >= 0.0 and last >= 0.0):
            continue
        duration = float(times[k + 1] - times[k])
        start = float(times[k])
        end = float(times[k + 1])
        if first >= 0.0:
            start += duration * first / (first - last)
        elif last >= 0.0:
            end -= duration * last / (last - first)
        if outages and start <= outages[-1].end:
            outages[-1] = Outage(outages[-1].start, end)
        else:
            outages.append(Outage(start, end))
    return LinkAlongPath(times, points, path_link_points, tuple(outages))
