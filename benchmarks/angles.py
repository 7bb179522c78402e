"""Compare the flown turning angles and slopes of feasible missions, measured from the track alone, with the plan."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from flight.simulation.simulate import Flight, fly_to_end
from logs.verdict.measures.route_requirements import route_requirements
from tests.missions import feasible
from world.arrays import Floats
from world.geometry import wrap

# Shortest straight stretch of a leg that is measured, m.
STRETCH = 100.0
# Distance after the arc and blend before a leg from which it is measured, m: about a second of flight.
SETTLING = 25.0


@dataclass(frozen=True, slots=True)
class Angles:
    """Errors of the flown angles, deg: turns between two measured legs, and slopes of measured legs."""

    turns: Floats
    slopes: Floats


def angles(numbers: Iterable[int], margin: float) -> Angles:
    """Fly the feasible missions of these numbers, inside every limit by ``margin``, and measure them."""
    turns: list[float] = []
    slopes: list[float] = []
    for number in numbers:
        made = feasible(number, margin)
        flown = fly_to_end(Flight(made.setup, made.uav.aircraft))
        if flown.ended != "completed":
            raise RuntimeError(f"mission {number} {flown.ended}")
        shape = route_requirements(made.setup)
        track, courses = flown.track, []
        for leg in range(shape.legs):
            # Fit a straight line to the part of the leg between the turns and the blends of the slopes.
            along = (track.position - shape.points[leg])[:, :2] @ shape.leg_unit(leg)
            low = shape.length_after[leg] + shape.blend[leg] + SETTLING
            high = shape.runs[leg] - shape.length_before[leg + 1] - shape.blend[leg + 1]
            use = (track.leg == leg) & (along >= low) & (along <= high)
            # Direction of the line: east, north and up; NaN if that part is too short.
            step = np.full(3, np.nan)
            if use.any() and np.ptp(along[use]) >= STRETCH:
                step = np.polyfit(along[use], track.position[use], 1)[0]
                step = step / np.hypot(step[0], step[1])
            courses.append(np.arctan2(step[0], step[1]))
            slopes.append(np.arctan(step[2]) - shape.slopes[leg])
        turns += [wrap(courses[k] - courses[k - 1]) - float(shape.turns[k]) for k in range(1, shape.legs)]
    return Angles(*(np.degrees(np.abs([value for value in found if np.isfinite(value)])) for found in (turns, slopes)))
