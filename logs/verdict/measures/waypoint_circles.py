"""Find waypoints at which an autopilot circled to reach their altitude."""

import math
from collections.abc import Mapping
from itertools import islice

import numpy as np

from logs.verdict.measures.acceptance import acceptance_limit
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.wording import place_text

# An aircraft circles at a waypoint if its course changes by at least this, rad.  A smaller change hardly leaves the
# legs.
_MIN_CIRCLE_RAD = 0.5 * math.pi
# Maximum number of circles that a text names.
_MAX_NAMED = 4


def waypoint_circles(requirements: RouteRequirements, aligned: AlignedTrack) -> dict[int, float]:
    """Return the altitude error on arrival by the waypoint at which the aircraft circled.

    The error is in m, positive above.

    Some autopilots circle at a plain waypoint until they are within their altitude tolerance.  Return {} for an
    autopilot that flies on at any altitude.
    """
    setup, route, track = requirements.setup, requirements.setup.route, aligned.track
    if not setup.autopilot.deviations.altitude_parameter:
        return {}
    circles, begin = dict[int, float](), 0
    for waypoint in range(1, len(route.points)):
        if not aligned.passed[waypoint - 1] or waypoint - 1 in route.rtl_legs:
            break
        if route.arc_radii[waypoint] > 0.0:
            begin = max(begin, int(aligned.rows[waypoint]))
            continue
        stop = int(aligned.rows[min(waypoint + 2, requirements.legs)]) + 1 if aligned.passed[waypoint] else len(track)
        offsets = track.position[begin : max(stop, begin + 1)] - requirements.points[waypoint]
        is_off = np.abs(offsets[:, 2]) > setup.autopilot.loiters.altitude_tolerance
        is_near = np.hypot(offsets[:, 0], offsets[:, 1]) <= acceptance_limit(requirements, waypoint)[0]
        is_past = offsets[:, :2] @ requirements.leg_unit(waypoint - 1) > 0.0
        is_reached = (is_near | is_past) & ~is_off
        end = int(np.argmax(is_reached)) if is_reached.any() else len(offsets) - 1
        rows_off = np.flatnonzero(is_off[:end] & is_near[:end])
        if rows_off.size and np.ptp(aligned.course[begin + int(rows_off[0]) : begin + end]) >= _MIN_CIRCLE_RAD:
            circles[waypoint] = float(offsets[rows_off[0], 2])
        begin += end
    return circles


def circles_text(requirements: RouteRequirements, circles: Mapping[int, float]) -> str:
    """State where an autopilot circled, its altitude errors, and the parameter that limits them.

    Return "" without circles.
    """
    if not circles:
        return ""
    autopilot = requirements.setup.autopilot
    places = [
        f"{place_text(requirements.waypoint_place(waypoint))} (height error {height_error:+.0f} m)"
        for waypoint, height_error in islice(circles.items(), _MAX_NAMED)
    ]
    more_text = f" and {len(circles) - _MAX_NAMED} more" if len(circles) > _MAX_NAMED else ""
    return (
        f"{autopilot.title} circled at {', '.join(places)}{more_text}: {autopilot.deviations.altitude_parameter} allows"
        f" {autopilot.loiters.altitude_tolerance:g} m"
    )
