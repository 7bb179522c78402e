"""Missions that gains are searched on and reported on: random, from a seed, in winds and by aircraft of their own."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft
from flight.dynamics.fdm import Variation
from flight.simulation.setup import FlightSetup
from logs.verdict.measures.route_requirements import route_requirements
from tests.setups import MakeSetup, standard

Floats = NDArray[np.float64]

LEGS, START_AMSL = 7, 1000.0
# Steepest climb and dive in calm air, in those that the aircraft can; and below which height, m, all legs climb.
SLOPES, LOW = (0.5, 0.6), 700.0
# Airspeeds of an open mission's legs, in the aircraft's own; a tight one is flown at that.
SPEEDS = (0.92, 1.12)
# Turns of an open mission and of a tight one, rad.  Legs of an open one, m at 25 m/s; of a tight one, in the shortest
# that fits its turns, and at least so long, m at 25 m/s.
OPEN_TURNS, TIGHT_TURNS = (0.3, 0.85), (0.5, 2.0)
OPEN_LEGS, TIGHT_LEGS, SHORTEST = (700.0, 1500.0), (1.0, 1.3), 60.0
TURBULENCE = ("none", "light", "moderate", "moderate")


@dataclass(frozen=True, slots=True)
class Case:
    """A mission and the aircraft that flies it, which guidance takes for the model.

    straight: whether its legs are long enough to have straight stretches of their own.
    """

    setup: FlightSetup
    variation: Variation | None
    straight: bool


def cases(aircraft: Aircraft, make: MakeSetup, seed: int, numbers: Iterable[int]) -> list[Case]:
    """Missions with turns, slopes, speeds, wind and turbulence of their own: a third tight, a fifth at 30 Hz."""
    return [_case(aircraft, make, seed, number) for number in numbers]


def _case(aircraft: Aircraft, make: MakeSetup, seed: int, number: int) -> Case:
    random = np.random.default_rng([seed, number])
    # A turn's radius grows with the square of the speed.
    scale = (aircraft.airspeed / 25.0) ** 2
    climb, dive = make(standard()).envelope.air_angles(aircraft.airspeed, START_AMSL)
    steepest = (-SLOPES[1] * abs(dive), min(math.radians(6.0), SLOPES[0] * climb))
    # Periods without a common factor, so that each meets each.
    tight, hz = number % 3 == 2, 30 if number % 5 == 3 else 60
    turbulence = TURBULENCE[(number // 2) % len(TURBULENCE)]
    known = _variations(aircraft)
    variation = known[(number // 3) % len(known)]
    # Half of the legs at the steepest: where the slope changes in a turn, the turn is hardest.
    slopes = np.clip(2.0 * random.uniform(*steepest, size=LEGS), *steepest)
    turns = random.uniform(*(TIGHT_TURNS if tight else OPEN_TURNS), size=LEGS) * random.choice((-1.0, 1.0), size=LEGS)
    courses = random.uniform(0.0, 2.0 * math.pi) + np.cumsum(turns)
    wind = (float(random.uniform(0.0, 10.0)), float(random.uniform(0.0, 360.0)))
    runs = scale * random.uniform(*OPEN_LEGS, size=LEGS)
    speeds = aircraft.airspeed * (np.ones(LEGS) if tight else random.uniform(*SPEEDS, size=LEGS))
    shares = random.uniform(*TIGHT_LEGS, size=LEGS)

    def made(lengths: Floats, climbed: Floats) -> FlightSetup:
        return make(
            _way(courses, climbed, lengths, steepest[1]),
            speeds=speeds.tolist(),
            seed=seed * 10_000 + number,
            wind=wind,
            turbulence=turbulence,
        )

    if tight:
        # What the turns need, from level legs that are long enough for any.
        shape = route_requirements(made(np.full(LEGS, 4.0 * scale * OPEN_LEGS[1]), np.zeros(LEGS)))
        runs = np.maximum(shares * (shape.after[:-1] + shape.reversal + shape.before[1:]), scale * SHORTEST)
        # Room to settle before the first corner and after the last.
        runs[[0, -1]] += scale * OPEN_LEGS[0]
    setup = replace(made(runs, slopes), guidance_hz=cast("Any", hz))
    return Case(setup, variation, not tight)


def _way(courses: Floats, slopes: Floats, runs: Floats, climb: float) -> Floats:
    """(w, 3) waypoints of these legs; what has sunk far climbs (rad, at most), not into the ground."""
    way = [np.array([0.0, 0.0, START_AMSL])]
    for course, slope, run in zip(courses, slopes, runs, strict=True):
        up = min(abs(slope), climb) if way[-1][2] < LOW else slope
        way.append(way[-1] + run * np.array([math.sin(course), math.cos(course), math.tan(up)]))
    return np.array(way)


def _variations(aircraft: Aircraft) -> tuple[Variation | None, ...]:
    """Aircraft that differ from the model; stronger surfaces show how near a loop is to its edge."""
    if aircraft.name == "aerosonde":
        return (
            *(None, Variation(control=0.75), Variation(control=1.4)),
            *(Variation(mass=0.9), Variation(mass=1.1, drag=1.3)),
        )
    # Its mass moves a light single's climb by as much as two tenths of the Aerosonde's.
    return (None, Variation(mass=0.95), Variation(mass=1.05))
