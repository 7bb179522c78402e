"""Which leg each row of a track was flown on, as a verdict aligned them.

What guidance noted of it is left aside, so that a report's tables and a replay cannot differ from the verdict.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.track_alignment import lay_track

_ASIDE = ("velocity", "attitude", "airspeed", "controls", "wind", "current", "energy")


def find_leg_ends(setup: FlightSetup, track: Track) -> tuple[float, ...]:
    """When each leg but the last ended, s, for a track without a verdict; inf where its waypoint was not met.

    Only time and position count.  Empty for a track with fewer than two usable rows.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> find_leg_ends(log.setup, log.track)
    (20.0,)
    """
    places = replace(track, **{name: np.zeros_like(getattr(track, name)) for name in _ASIDE})
    aligned = lay_track(route_demands(setup), places)
    return () if aligned is None else aligned.leg_ends()


def with_legs(track: Track, leg_ends: Sequence[float]) -> Track:
    """Return the track with its ``leg`` column made anew of the times at which legs end, s, rising.

    leg_ends: of a `logs.verdict.findings.Verdict` or of `find_leg_ends`.  Without any, all rows are on leg 0.
    """
    ends = np.array(leg_ends, dtype=np.float64)
    return replace(track, leg=np.searchsorted(ends, track.time, side="right").astype(np.int32))
