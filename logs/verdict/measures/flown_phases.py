"""The phases of a flight from the ground and to it: its take-off, its part in the air, and its landing.

The usual rules judge the part in the air, whose route begins where the take-off ended, as the autopilot's own first leg
does, and ends at the last waypoint before the landing point.  Phases are found by places and heights alone.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flight.mission.ground_ways import GroundWays, airborne_route
from flight.simulation.track import Track
from logs.verdict.measures.route_requirements import FlownGround, RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack, align_track

Flags = NDArray[np.bool_]

# So long after it has passed its last waypoint the part in the air ends, s: an autopilot turns before it.
_PASSED_BY = 2.0


def flown_phases(whole: RouteRequirements, track: Track) -> tuple[RouteRequirements, AlignedTrack | None]:
    """Requirements of a flight's part in the air, and its track laid beside it.

    whole: of the whole route; they are those of a flight that is in the air all the time.
    """
    ways = whole.setup.ground_ways
    if not ways:
        return whole, align_track(whole, track)
    begun = _begun(track, ways)
    first = np.asarray(track.position[begun], dtype=np.float64) if ways.take_off is not None else None
    setup = whole.setup
    in_air = replace(setup, route=airborne_route(setup.route, ways, first))
    requirements = route_requirements(in_air, envelope=whole.envelope)
    flying = track.rows(begun, len(track))
    aligned, left = align_track(requirements, flying), len(track) - 1
    if ways.approach is not None and aligned is not None and aligned.passed[-1]:
        passed = float(aligned.track.time[aligned.rows[-1]])
        left = min(left, int(np.searchsorted(track.time, passed)))
        until = int(np.searchsorted(track.time, passed + _PASSED_BY, side="right"))
        aligned = align_track(requirements, track.rows(begun, until))
    ground = FlownGround(ways, whole, track, begun, left)
    return replace(requirements, ground=ground), aligned


def _begun(track: Track, ways: GroundWays) -> int:
    """The row at which the take-off had ended: the last for one that did not come to its height, 0 for none."""
    if ways.take_off is None:
        return 0
    above = track.position[:, 2] > ways.take_off.top
    return int(np.argmax(above)) if above.any() else len(track) - 1


def by_the_ground(track: Track, ways: GroundWays) -> Flags:
    """Which rows (t,) are of a take-off that is flown, or of the leg of a landing that is.

    >>> from logs.recording.example_log import example_log
    >>> bool(by_the_ground(example_log().track, GroundWays()).any())
    False
    """
    found = np.arange(len(track)) < _begun(track, ways)
    if ways.approach is not None:
        found |= track.leg >= ways.approach.leg
    return np.asarray(found)


def leg_ends(requirements: RouteRequirements, aligned: AlignedTrack) -> tuple[float, ...]:
    """When each leg of the whole route but the last ended, s: `AlignedTrack.leg_ends`, and when the landing began."""
    ground, ends = requirements.ground, aligned.leg_ends()
    if ground is None or ground.ways.approach is None:
        return ends
    return (*ends, float(ground.track.time[ground.left]) if aligned.passed[-1] else float("inf"))
