"""OMPL's Informed RRT* on a scenario: ``python -m benchmarks.ompl_peer NAME SEED SECONDS [RATIO]`` prints JSON.

States are points of the map between floor and ceiling; a motion is valid if its leg meets slope, terrain and map and
no missile reaches it, by the same compiled evaluation and margins that our search uses.  A tree of straight motions
knows no turns: each path that is shorter than the last is certified, and the last that passes is reported.

The planner is asked after each of its steps whether its best cost has fallen; if it has, the path is certified, and
the search goes on.  Seconds are CPU time of the process without those certificates: they are ours.  With RATIO it ends
with the first certified path of at most that length ratio.
"""

import math
import sys
import time

import numpy as np
from numpy.typing import NDArray
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from benchmarks.peers import Found, as_json, found
from benchmarks.task import Task, graded_scores, is_safe, make_task

Floats = NDArray[np.float64]

# Steps of the planner between looks at the clock; to its best cost it looks after each.
STEPS = 20


class Motions(ob.MotionValidator):
    """Checks motions in the direction of the mission; counts them, and the time they take."""

    def __init__(self, information: object, task: Task) -> None:
        super().__init__(information)
        self.data = task.problem.search
        step = task.scenario.destination - task.scenario.start
        self.east, self.north = float(step[0]), float(step[1])
        self.leg = np.zeros((1, 2, 3))
        self.count, self.nanoseconds = 0, 0

    def checkMotion(self, one: list[float], two: list[float]) -> bool:
        """The library's callback."""
        began = time.process_time_ns()
        # Climb and dive limits differ, and rewiring turns motions round: all are evaluated as they would be flown.
        forward = (two[0] - one[0]) * self.east + (two[1] - one[1]) * self.north >= 0.0
        valid = self.is_valid(one, two) if forward else self.is_valid(two, one)
        self.count += 1
        self.nanoseconds += time.process_time_ns() - began
        return valid

    def is_valid(self, one: list[float], two: list[float]) -> bool:
        """Whether the leg violates nothing and no missile reaches it."""
        for row, state in enumerate((one, two)):
            for axis in range(3):
                self.leg[0, row, axis] = state[axis]
        violations, objectives = graded_scores(self.data, self.leg)
        return not violations.any() and float(objectives[0, 1]) == 0.0


class Watch:
    """Ends a stretch of the search when its best cost falls, or at a time."""

    def __init__(self, planner: og.InformedRRTstar, seconds: float) -> None:
        self.planner, self.seconds = planner, seconds
        self.best, self.steps, self.certifying = math.inf, 0, 0.0
        self.began = time.process_time()

    def spent(self) -> float:
        """CPU s since the search began, without our certificates."""
        return time.process_time() - self.began - self.certifying

    def __call__(self) -> bool:
        """Whether to end this stretch; the library's callback."""
        self.steps += 1
        cost = float(self.planner.bestCost().value())
        if cost < self.best:
            self.best = cost
            return True
        return self.steps % STEPS == 0 and self.spent() >= self.seconds


class Anywhere(ob.StateValidityChecker):
    """States need no check of their own: every motion is checked whole."""

    def isValid(self, _state: object) -> bool:
        """The library's callback."""
        return True


def plan(task: Task, seed: int, seconds: float, ratio: float = 0.0) -> Found:
    """Run for so many seconds of CPU, compiled code warm, or to a certified path of this length ratio.

    trace: each certified path that is shorter than those before it.
    """
    ou.noOutputHandler()
    ou.RNG.setSeed(seed)
    space = ob.RealVectorStateSpace(3)
    box = ob.RealVectorBounds(3)
    data = task.problem.search
    low, high = [data.west, data.south, data.floor], [data.east, data.north, data.ceiling]
    for axis in range(3):
        box.setLow(axis, float(low[axis]))
        box.setHigh(axis, float(high[axis]))
    space.setBounds(box)
    setup = og.SimpleSetup(space)
    information = setup.getSpaceInformation()
    states = Anywhere(information)
    motions = Motions(information, task)
    setup.setStateValidityChecker(states)
    information.setMotionValidator(motions)
    ends = [space.allocState(), space.allocState()]
    for state, point in zip(ends, (task.scenario.start, task.scenario.destination), strict=True):
        for axis in range(3):
            state[axis] = float(point[axis])
    setup.setStartAndGoalStates(ends[0], ends[1], 1.0)
    planner = og.InformedRRTstar(information)
    setup.setPlanner(planner)
    setup.setup()
    motions.is_valid(ends[0], ends[1])
    path, shortest = np.stack([task.scenario.start, task.scenario.destination]), math.inf
    is_safe(task.certificate(path))
    motions.count, motions.nanoseconds = 0, 0
    trace: list[tuple[float, float]] = []
    watch = Watch(planner, seconds)
    spent = 0.0
    while spent < seconds and not shortest <= ratio:
        # A condition that has ended one stretch ends every later one: each gets its own.
        setup.solve(ob.PlannerTerminationCondition(watch))
        spent = watch.spent()
        if not setup.haveExactSolutionPath():
            continue
        before = time.process_time()
        latest = np.array([[state[axis] for axis in range(3)] for state in setup.getSolutionPath().getStates()])
        latest[-1] = task.scenario.destination
        safe, length = is_safe(task.certificate(latest)), task.length_ratio(latest)
        if safe and length < shortest:
            shortest = length
            trace.append((spent, length))
        if safe or math.isinf(shortest):
            path = latest
        watch.certifying += time.process_time() - before
    return found(task, path, spent, motions.count, motions.nanoseconds / 1e9, trace)


if __name__ == "__main__":
    print(as_json(plan(make_task(sys.argv[1]), int(sys.argv[2]), *(float(text) for text in sys.argv[3:]))))
