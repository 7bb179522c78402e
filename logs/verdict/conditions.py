"""What a verdict is for, in the lines after the answer: whose aircraft, at which speed, in which weather and world."""

import math
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import find_aircraft
from flight.simulation.setup import FlightSetup
from logs.verdict.measures.route_requirements import surveys_of
from world.errors import FlightError

_NAV = {
    "perfect": "exact",
    "rtk": "with RTK's error (0.05 m on each axis)",
    "gnss": "with GNSS's error (1.5 m on each axis)",
}


def condition_lines(setup: FlightSetup) -> list[str]:
    """The aircraft and its speed, and whether anybody named it; the weather and the ground."""
    return [_aircraft_line(setup), _weather_line(setup)]


def navigation_text(setup: FlightSetup) -> str:
    """How well the autopilot knows where it is, in words."""
    return f"navigation {_NAV[setup.nav]}"


def _aircraft_line(setup: FlightSetup) -> str:
    table = setup.scenario.flight
    mass = ""
    # A log's aircraft need not be on this machine.
    with suppress(FlightError):
        mass = f", {find_aircraft(setup.aircraft).mass:.3g} kg"
    whose = "its cruise speed" if table.airspeed_mps is None else "as stated"
    line = f"Aircraft: {setup.aircraft}{mass}, {setup.airspeed:.3g} m/s true airspeed ({whose})"
    if not table.aircraft_by_default:
        return line
    return f"{line}; nobody named an aircraft, so it is the default (--aircraft names yours)"


def _weather_line(setup: FlightSetup) -> str:
    wind, terrain = setup.scenario.wind, setup.scenario.terrain
    blows = "no wind"
    if wind.speed > 0.0:
        blows = f"wind {wind.speed:.3g} m/s from {math.degrees(wind.from_course) % 360.0:.0f} degrees"
    turbulence = "no turbulence" if wind.turbulence == "none" else f"{wind.turbulence} turbulence"
    ground = "no terrain" if terrain is None else f"terrain {terrain.source}, heights above {terrain.datum}"
    return f"Conditions: {blows}, {turbulence}; {ground}"


# Legs count as beside each other where their courses differ, or are opposite, by no more than this, and where at least
# half of the shorter one lies beside the longer.
_PARALLEL = math.radians(15.0)
# m.  Legs closer to each other are one line.
_SAME_LINE = 1.0


def corridor_line(setup: FlightSetup) -> str:
    """That a corridor which nobody stated is wider than the gap between lines of a survey; "" where it is not.

    A flight that keeps to such a corridor may have flown beside its lines all along.
    """
    limits, autopilot = setup.scenario.limits, setup.autopilot
    # How far a survey's lines were kept to is judged line by line.
    if surveys_of(setup):
        return ""
    gap = least_gap(setup.route.waypoints)
    if limits.corridor_m is not None or gap is None or gap[0] >= setup.corridor:
        return ""
    metres, leg = gap
    radius = autopilot.acceptance_radius
    origin = "planfly's default" if not radius else f"by {autopilot.title}'s acceptance radius of {radius:.0f} m"
    return (
        f"Corridor: {setup.corridor:.0f} m to either side, {origin}, is wider than the {metres:.0f} m between legs"
        f" {leg} and {leg + 2}: keeping to it does not show that the lines were flown ([limits] corridor_m states one)"
    )


def least_gap(waypoints: NDArray[np.float64]) -> tuple[float, int] | None:
    """The least distance (m) between a leg and the next but one where they lie side by side, and the first's number.

    waypoints: (w, 3) m.  None where no two legs do.

    >>> lines = np.array([[0, 0, 0], [0, 900, 0], [40, 900, 0], [40, 0, 0]], dtype=float)
    >>> least_gap(lines)
    (40.0, 0)
    >>> least_gap(lines[:3]) is None
    True
    """
    found: list[tuple[float, int]] = []
    for k in range(len(waypoints) - 3):
        (start, end), (back, on) = waypoints[k : k + 2, :2], waypoints[k + 2 : k + 4, :2]
        one, other = end - start, on - back
        run, length = float(np.hypot(*one)), float(np.hypot(*other))
        if run <= 0.0 or length <= 0.0:
            continue
        along = one / run
        if abs(float(along @ other)) / length < math.cos(_PARALLEL):
            continue
        reach = sorted((float((back - start) @ along), float((on - start) @ along)))
        if min(run, reach[1]) - max(0.0, reach[0]) >= 0.5 * min(run, length):
            middle = 0.5 * (back + on) - start
            found.append((abs(float(along[0] * middle[1] - along[1] * middle[0])), k))
    # A line that is flown twice is no survey.
    return min((one for one in found if one[0] >= _SAME_LINE), default=None)
