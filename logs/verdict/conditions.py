"""What a verdict is for, in the lines after the answer: whose aircraft, at which speed, in which weather and world."""

import math
from contextlib import suppress

from aircraft.catalog import find_aircraft
from flight.simulation.setup import FlightSetup
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
