"""The limits that an algorithm plans within."""

from dataclasses import replace

from aircraft.path_limits import Limits
from planner.search.algorithms import Algorithm


def limits_for(algorithm: Algorithm, limits: Limits) -> Limits:
    """Limits that an algorithm plans within: those that count violations are the paper's, and know no autopilot."""
    return limits if algorithm.graded else replace(limits, tracking=None)
