"""A flight from the ground to the ground for the rules that judge it: flown once, and bent where a test asks for it."""

import functools
import math
from dataclasses import replace

import numpy as np

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_flight
from tests.flight.autopilots.arduplane.flown_grounds import Flown, circuit, fly
from world.airfield import LandingStrip, Launch
from world.terrain import make_gridded_terrain

RAIL = Launch("catapult", math.radians(90.0), 20.0, 6.0, math.radians(12.0))
STRIP = LandingStrip(500.0, 600.0, length=600.0)


@functools.cache
def flown_circuit() -> Flown:
    """A circuit that goes well, with MINACC 15."""
    flown = fly(circuit(RAIL, STRIP, TKOFF_THR_MINACC=15.0))
    assert flown.flight.ended == "completed"
    return flown


def moved(track: Track, rows: "slice | np.ndarray", east: float = 0.0, north: float = 0.0, up: float = 0.0) -> Track:
    """The track with some rows elsewhere, m."""
    position = np.array(track.position)
    position[rows] += (east, north, up)
    return replace(track, position=position)


def with_hole(setup: FlightSetup, east: float, north: float) -> FlightSetup:
    """The setup over level ground at the sea that is not known within 60 m east and 120 m north of a place."""
    axis = np.arange(-3000.0, 4501.0, 50.0)
    heights = np.zeros((axis.size, axis.size))
    heights[np.ix_(np.abs(axis - north) < 120.0, np.abs(axis - east) < 60.0)] = math.nan
    ground = make_gridded_terrain(heights, axis, axis, source="hole", sha256="", datum="mean sea level")
    return setup.in_scenario(replace(setup.scenario, terrain=ground))


def found(setup: FlightSetup, track: Track, rule: str, ended: str = "completed") -> Finding:
    """The one finding of a rule on a flight."""
    (one,) = (item for item in judge_flight(setup, track, ended).findings if item.rule == rule)
    return one
