"""Make random missions for the tuning of gains, each with its own wind and aircraft variation."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from aircraft.catalog import Aircraft
from flight.dynamics.fdm import Variation
from flight.simulation.setup import FlightSetup
from logs.verdict.measures.route_requirements import route_requirements
from tests.setups import MakeSetup, standard
from world.arrays import Floats

# Number of legs.
LEGS = 7
# Altitude of the start, m AMSL.
START_AMSL = 1000.0
# Steepest climb and dive in calm air, as fractions of the aircraft's limits.
SLOPES = (0.5, 0.6)
# Altitude below which all legs climb, m AMSL.
LOW = 700.0
# Range of airspeeds on the legs of an open mission, relative to the aircraft's airspeed, which tight missions use.
SPEEDS = (0.92, 1.12)
# Range of turns of an open mission, rad.
OPEN_TURNS = (0.3, 0.85)
# Range of turns of a tight mission, rad.
TIGHT_TURNS = (0.5, 2.0)
# Range of leg lengths of an open mission, m at 25 m/s.
OPEN_LEGS = (700.0, 1500.0)
# Range of leg lengths of a tight mission, relative to the shortest leg that holds its turns.
TIGHT_LEGS = (1.0, 1.3)
# Shortest leg of a tight mission, m at 25 m/s.
SHORTEST = 60.0
# Turbulence levels of the missions.
TURBULENCE = ("none", "light", "moderate", "moderate")


@dataclass(frozen=True, slots=True)
class Case:
    """Mission and variation of the aircraft that flies it; guidance assumes the model.

    straight: True if the legs are long enough to have straight stretches.
    """

    setup: FlightSetup
    variation: Variation | None
    straight: bool


def cases(aircraft: Aircraft, make: MakeSetup, seed: int, numbers: Iterable[int]) -> list[Case]:
    """Make missions with random turns, slopes, speeds, wind and turbulence.

    A third of them is tight, and a fifth runs at 30 Hz.
    """
    return [_case(aircraft, make, seed, number) for number in numbers]


def _case(aircraft: Aircraft, make: MakeSetup, seed: int, number: int) -> Case:
    """Make one mission of a seed by its number."""
    random = np.random.default_rng([seed, number])
    # The radius of a turn is proportional to the square of the speed.
    scale = (aircraft.airspeed / 25.0) ** 2
    climb, dive = make(standard()).envelope.air_angles(aircraft.airspeed, START_AMSL)
    steepest = (-SLOPES[1] * abs(dive), min(math.radians(6.0), SLOPES[0] * climb))
    # Periods without a common factor, so that all combinations occur.
    tight, hz = number % 3 == 2, 30 if number % 5 == 3 else 60
    turbulence = TURBULENCE[(number // 2) % len(TURBULENCE)]
    # Stronger surfaces show how near a loop is to its stability limit. The Cessna's variation of mass changes its climb
    # as much as two tenths change the Aerosonde's climb.
    known: tuple[Variation | None, ...] = (None, Variation(mass=0.95), Variation(mass=1.05))
    if aircraft.name == "aerosonde":
        masses = (Variation(mass=0.9), Variation(mass=1.1, drag=1.3))
        known = (None, Variation(control=0.75), Variation(control=1.4), *masses)
    variation = known[(number // 3) % len(known)]
    # Half of the legs at the steepest slope: turns with a change of slope are the hardest.
    slopes = np.clip(2.0 * random.uniform(*steepest, size=LEGS), *steepest)
    turns = random.uniform(*(TIGHT_TURNS if tight else OPEN_TURNS), size=LEGS) * random.choice((-1.0, 1.0), size=LEGS)
    courses = random.uniform(0.0, 2.0 * math.pi) + np.cumsum(turns)
    wind = (float(random.uniform(0.0, 10.0)), float(random.uniform(0.0, 360.0)))
    runs = scale * random.uniform(*OPEN_LEGS, size=LEGS)
    speeds = aircraft.airspeed * (np.ones(LEGS) if tight else random.uniform(*SPEEDS, size=LEGS))
    shares = random.uniform(*TIGHT_LEGS, size=LEGS)

    def made(lengths: Floats, climbed: Floats) -> FlightSetup:
        """Make the setup of legs with these lengths, m, and slopes, rad."""
        waypoints = [np.array([0.0, 0.0, START_AMSL])]
        for course, slope, run in zip(courses, climbed, lengths, strict=True):
            # A leg that begins below `LOW` climbs, at most at the steepest climb, to stay above the ground.
            up = min(abs(slope), steepest[1]) if waypoints[-1][2] < LOW else slope
            waypoints.append(waypoints[-1] + run * np.array([math.sin(course), math.cos(course), math.tan(up)]))
        return make(
            np.array(waypoints),
            speeds=speeds.tolist(),
            seed=seed * 10_000 + number,
            wind=wind,
            turbulence=turbulence,
        )

    if tight:
        # Lengths that the turns need, from level legs that are long enough for any turn.
        shape = route_requirements(made(np.full(LEGS, 4.0 * scale * OPEN_LEGS[1]), np.zeros(LEGS)))
        runs = np.maximum(
            shares * (shape.length_after[:-1] + shape.reversal + shape.length_before[1:]), scale * SHORTEST
        )
        # Room to settle before the first corner and after the last.
        runs[[0, -1]] += scale * OPEN_LEGS[0]
    setup = replace(made(runs, slopes), guidance_hz=cast("Any", hz))
    return Case(setup, variation, not tight)
