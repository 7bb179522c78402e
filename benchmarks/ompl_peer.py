"""Run OMPL's Informed RRT* on a scenario: ``python -m benchmarks.ompl_peer NAME SEED SECONDS [RATIO]`` prints JSON.

States are points of the map between floor and ceiling; a motion is valid if its leg meets slope, terrain and map limits
and no missile reaches it, by the same compiled evaluation and margins as in planfly's search.  A tree of straight
motions ignores turns: each path that is shorter than the last one is certified, and the last certified path is
reported.

After each step of the planner its best cost is checked; if it has decreased, the path is certified, and the search
continues.  Seconds are CPU time of the process without these certificates, which are planfly's work.  With RATIO it
ends with the first certified path of at most that length ratio.
"""

import math
import sys
import time

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from benchmarks.peers import Found, as_json, found
from benchmarks.task import Task, graded_scores, is_safe, make_task

# Number of steps of the planner between readings of the clock; its best cost is checked after each step.
STEPS = 20


class Motions(ob.MotionValidator):
    """Validator of motions in the direction of the mission, which counts them and their time."""

    def __init__(self, information: object, task: Task) -> None:
        super().__init__(information)
        self.data = task.problem.search
        step = task.scenario.destination - task.scenario.start
        self.east, self.north = float(step[0]), float(step[1])
        self.leg = np.zeros((1, 2, 3))
        self.count, self.nanoseconds = 0, 0

    def checkMotion(self, one: list[float], two: list[float]) -> bool:
        """Check a motion (callback of the library)."""
        began = time.process_time_ns()
        # Climb and dive limits differ, and rewiring reverses motions: all are evaluated in the direction of flight.
        forward = (two[0] - one[0]) * self.east + (two[1] - one[1]) * self.north >= 0.0
        valid = self.is_valid(one, two) if forward else self.is_valid(two, one)
        self.count += 1
        self.nanoseconds += time.process_time_ns() - began
        return valid

    def is_valid(self, one: list[float], two: list[float]) -> bool:
        """Return True if the leg violates nothing and no missile reaches it."""
        for row, state in enumerate((one, two)):
            for axis in range(3):
                self.leg[0, row, axis] = state[axis]
        violations, objectives = graded_scores(self.data, self.leg)
        return not violations.any() and float(objectives[0, 1]) == 0.0


class Watch:
    """Termination condition that ends a part of the search when its best cost decreases, or at a time."""

    def __init__(self, planner: og.InformedRRTstar, seconds: float) -> None:
        self.planner, self.seconds = planner, seconds
        self.best, self.steps, self.certifying = math.inf, 0, 0.0
        self.began = time.process_time()

    def spent(self) -> float:
        """Return the CPU time since the search began, without planfly's certificates, s."""
        return time.process_time() - self.began - self.certifying

    def __call__(self) -> bool:
        """Return True to end this part of the search (callback of the library)."""
        self.steps += 1
        cost = float(self.planner.bestCost().value())
        if cost < self.best:
            self.best = cost
            return True
        return self.steps % STEPS == 0 and self.spent() >= self.seconds


class Anywhere(ob.StateValidityChecker):
    """Validator of states, which are always valid, as every motion is checked completely."""

    def isValid(self, _state: object) -> bool:
        """Accept a state (callback of the library)."""
        return True


def plan(task: Task, seed: int, seconds: float, ratio: float = 0.0) -> Found:
    """Run for a CPU time, s, with compiled code loaded, or to a certified path of this length ratio.

    The trace of the result has each certified path that is shorter than all earlier ones.
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
        # A condition that has ended one part stays fulfilled, so that each part gets a new one.
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
