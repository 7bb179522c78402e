"""Which leg each row of a track was flown on, worked out from the route and the track as a check does.

What guidance noted of it is left aside, so that a report's tables and a replay cannot differ from the verdict.
"""

import math
from dataclasses import replace

import numpy as np

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.track_alignment import lay_track

_ASIDE = ("velocity", "attitude", "airspeed", "controls", "wind", "current", "energy")


def with_legs(setup: FlightSetup, track: Track) -> Track:
    """Return the track with its ``leg`` column made anew: a leg ends at the row nearest to its waypoint's apex.

    Only time and position count.  After the last waypoint that was met its leg goes on; a track with fewer than two
    usable rows is all on leg 0.
    """
    places = replace(track, **{name: np.zeros_like(getattr(track, name)) for name in _ASIDE})
    aligned = lay_track(route_demands(setup), places)
    if aligned is None:
        return replace(track, leg=np.zeros(len(track), dtype=np.int32))
    ends = np.where(aligned.passed, aligned.track.time[aligned.rows], math.inf)[1:-1]
    return replace(track, leg=np.searchsorted(ends, track.time, side="right").astype(np.int32))
