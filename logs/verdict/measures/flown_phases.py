"""Split a flight that includes ground phases into take-off, airborne part and landing.

The usual rules judge the airborne part.  The route of this part begins where the take-off ended, like the autopilot's
own first leg, and ends at the last waypoint before the landing point.  Only positions and times are used to find the
phases.
"""

from dataclasses import replace

import numpy as np

from flight.mission.ground_ways import GroundPhases, airborne_route
from flight.simulation.track import Track
from logs.verdict.measures.route_requirements import FlownGround, RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack, align_track
from world.arrays import Flags

# Time after the last waypoint at which the airborne part ends, s: an autopilot turns before the waypoint.
_END_DELAY_S = 2.0


def flown_phases(whole_requirements: RouteRequirements, track: Track) -> tuple[RouteRequirements, AlignedTrack | None]:
    """Return the requirements and the aligned track of a flight's airborne part.

    The track is None if it is unusable.
    whole_requirements: requirements of the whole route, returned unchanged for a flight without ground phases.
    """
    procedures = whole_requirements.setup.ground_phases
    if not procedures:
        return whole_requirements, align_track(whole_requirements, track)
    start = _takeoff_end_row(track, procedures)
    start_point = np.asarray(track.position[start], dtype=np.float64) if procedures.take_off is not None else None
    setup = whole_requirements.setup
    airborne_setup = replace(setup, route=airborne_route(setup.route, procedures, start_point))
    requirements = route_requirements(airborne_setup, envelope=whole_requirements.envelope)
    airborne_track = track.rows(start, len(track))
    aligned, landing_row = align_track(requirements, airborne_track), len(track) - 1
    if procedures.approach is not None and aligned is not None and aligned.passed[-1]:
        passed_time = float(aligned.track.time[aligned.rows[-1]])
        landing_row = min(landing_row, int(np.searchsorted(track.time, passed_time)))
        end_row = int(np.searchsorted(track.time, passed_time + _END_DELAY_S, side="right"))
        aligned = align_track(requirements, track.rows(start, end_row))
    ground_phases = FlownGround(procedures, whole_requirements, track, start, landing_row)
    return replace(requirements, ground_phases=ground_phases), aligned


def _takeoff_end_row(track: Track, procedures: GroundPhases) -> int:
    """Return the row at which the take-off ended; 0 without a take-off, the last row if it never ended."""
    if procedures.take_off is None:
        return 0
    is_above = track.position[:, 2] > procedures.take_off.end_altitude
    return int(np.argmax(is_above)) if is_above.any() else len(track) - 1


def ground_phase_rows(track: Track, procedures: GroundPhases) -> Flags:
    """Return a mask (t,): True for each row in a flown take-off or on the landing leg.

    >>> from logs.recording.example_log import example_log
    >>> bool(ground_phase_rows(example_log().track, GroundPhases()).any())
    False
    """
    is_ground_phase = np.arange(len(track)) < _takeoff_end_row(track, procedures)
    if procedures.approach is not None:
        is_ground_phase |= track.leg >= procedures.approach.leg
    return np.asarray(is_ground_phase)


def leg_ends(requirements: RouteRequirements, aligned: AlignedTrack) -> tuple[float, ...]:
    """Return the end time (s) of each leg except the last, for the whole route including its landing."""
    ground_phases, end_times = requirements.ground_phases, aligned.leg_ends()
    if ground_phases is None or ground_phases.procedures.approach is None:
        return end_times
    return (
        *end_times,
        float(ground_phases.track.time[ground_phases.landing_start_row]) if aligned.passed[-1] else float("inf"),
    )
