"""Make plans whose slopes and turns can be flown in the local wind of a forecast.

The planner limits slopes and turns in one mean wind for the whole map.  The wind of a forecast differs from it by
place, height and time: a stronger tailwind flattens the slopes that the aircraft can fly, and widens its turns.
Therefore the finished plan is judged in the wind of each leg, as the verdict does.  If a leg or a turn fails, another
plan is searched for that leaves climb, sink and bank unused, so that it holds at the higher ground speed.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aircraft.path_limits import Limits
from logs.verdict.findings import Finding
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.rules.registry import RULES
from logs.verdict.wording import place_text
from planfly.workflow.open_flight import make_setup, mission_of_plan
from planfly.workflow.uav import Uav
from planner.plan import Plan
from world.arrays import Floats
from world.scenario import Scenario

# Rules on slopes and turns, which the planner limits in the mean wind.
_RULES = ("turn", "slope", "climbout", "approach")
# Number of searches for the ground speeds along the last path; later searches assume the highest one on the map.
_PATH_SEARCHES = 2
# Number of values of east, north, altitude and time at which the wind of the map is looked up.
_MAP_SAMPLES = (9, 9, 9, 5)
# Number of courses that are compared at each of these samples.
_COURSE_COUNT = 36
# Longest time after take-off for which winds are compared, as a multiple of the duration of the first path.
_MAX_DURATION_RATIO = 1.5
# Lower limit of the ground speed in the mean wind, m/s, so that the ratio stays finite.
_MIN_GROUND_SPEED_MPS = 1.0


def ensure_local_wind(plan: Plan, uav: Uav, search: Callable[[Uav], Plan] | None = None) -> Plan:
    """Return a plan whose slopes and turns can be flown in the local wind of its scenario's forecast.

    This is the given plan, or another plan that `search` finds.  If no such plan is found, the given plan is returned
    as not safe, with the reasons in its certificate.  Without a forecast, the given plan is returned.

    search: function that plans the same scenario for a UAV with other limits; None to search for no other path.

    Raises ForecastError if the flight of a plan leaves the box, the levels or the times of the forecast.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.search.plan_path import plan_path
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> uav = load_uav(scenario)
    >>> plan = plan_path(scenario, uav.limits, seed=1)
    >>> ensure_local_wind(plan, uav) is plan
    True
    """
    scenario = plan.scenario
    if scenario.wind.forecast is None:
        return plan
    requirements = _plan_requirements(plan, uav)
    failures = _wind_failures(plan, requirements)
    if not plan.safe or not failures:
        return plan
    ratio, searches = 1.0, 0
    map_ratio = max_ground_speed_ratio(scenario, uav.limits.airspeed, float(requirements.path.times[-1]))
    while search is not None and ratio < map_ratio:
        path_ratio = ratio
        if searches < _PATH_SEARCHES:
            path, airspeed = requirements.path, float(requirements.route.leg_airspeeds.min())
            steps = np.diff(path.points, axis=0)
            samples = np.column_stack([path.points[:-1] + 0.5 * steps, 0.5 * (path.times[:-1] + path.times[1:])])
            path_ratio = _ground_speed_ratio(
                requirements.setup.scenario, airspeed, samples, np.arctan2(steps[:, 0], steps[:, 1])
            )
        ratio = path_ratio if ratio < path_ratio < map_ratio else map_ratio
        searches = searches + 1
        other_plan = search(replace(uav, limits=limits_at_ground_speed(uav.limits, ratio)))
        if not other_plan.safe:
            break
        requirements = _plan_requirements(other_plan, uav)
        if not _wind_failures(other_plan, requirements):
            return other_plan
    certificate = plan.certificate
    reasons = (
        failure.reason if failure.placed else f"{place_text(failure.place)}: {failure.reason}" for failure in failures
    )
    problems = tuple(f"in the local wind of the forecast: {reason}" for reason in reasons)
    return replace(plan, certificate=replace(certificate, problems=(*certificate.problems, *problems)))


def _plan_requirements(plan: Plan, uav: Uav) -> RouteRequirements:
    """Return the route requirements of a plan's mission.

    Raises ForecastError as `ensure_local_wind` does.
    """
    return route_requirements(make_setup(plan.scenario, uav, mission_of_plan(plan, uav), plan.seed, plan=plan))


def _wind_failures(plan: Plan, requirements: RouteRequirements) -> list[Finding]:
    """Return the failed findings on a plan's slopes and turns, except on legs that are already flown."""
    judges = [judge for name in _RULES if (judge := RULES[name].judge) is not None]
    findings = [finding for judge in judges for finding in judge(requirements, None, geometric=True)]
    return [finding for finding in findings if finding.ok is False and (finding.place.index or 0) >= plan.flown_legs]


def limits_at_ground_speed(limits: Limits, ratio: float) -> Limits:
    """Return limits within which a plan can be flown at a higher ground speed than in the mean wind.

    Slopes over the ground are inversely proportional to the ground speed; radii are proportional to its square.

    ratio: ratio of the higher ground speed to the ground speed in the mean wind.
    """

    def flatten(angles: Floats) -> Floats:
        """Reduce climb or dive angles (rad) to those at the higher ground speed."""
        return np.where(angles > 0.0, np.arcsin(np.sin(angles) / ratio), angles)

    envelope, tracking = limits.envelope, limits.tracking
    if tracking is not None:
        tracking = replace(tracking, climb_rate=tracking.climb_rate / ratio, sink_rate=tracking.sink_rate / ratio)
    return replace(
        limits,
        envelope=replace(envelope, climb=flatten(envelope.climb), descent=flatten(envelope.descent)),
        max_bank=math.atan(math.tan(limits.max_bank) / ratio**2),
        tracking=tracking,
    )


def max_ground_speed_ratio(scenario: Scenario, airspeed: float, duration: float) -> float:
    """Return the largest ratio of local-wind to mean-wind ground speed on the whole map, at least 1.

    Sampled courses, positions, altitudes between floor and ceiling, and times of a flight are compared.

    airspeed: true airspeed, m/s.
    duration: duration of the flight, s.
    """
    (west, east), (south, north) = scenario.bounds.tolist()
    edges = ((west, east), (south, north), (scenario.floor, scenario.ceiling), (0.0, _MAX_DURATION_RATIO * duration))
    axes = [np.linspace(*edge, count) for edge, count in zip(edges, _MAP_SAMPLES, strict=True)]
    samples = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 4)
    courses = np.linspace(0.0, 2.0 * math.pi, _COURSE_COUNT, endpoint=False)
    return _ground_speed_ratio(scenario, airspeed, samples, courses[:, np.newaxis])


def _ground_speed_ratio(scenario: Scenario, airspeed: float, samples: Floats, courses: Floats) -> float:
    """Return the largest ratio of local-wind to mean-wind ground speed at samples, at least 1.

    samples: (n, 4) east, north and altitude, m, and time after take-off, s.
    courses: course at each sample, rad, (n,), or (c, 1) to combine each of c courses with each sample.
    airspeed: true airspeed, m/s.
    """
    local_winds = scenario.wind_velocities(samples[:, :3], samples[:, 3])
    mean_winds = scenario.wind.velocities_at(np.ascontiguousarray(samples[:, 2]))
    sin, cos = np.sin(courses), np.cos(courses)
    ground_speeds = []
    for winds in (local_winds, mean_winds):
        wind_east, wind_north = winds[:, 0], winds[:, 1]
        crosswinds = wind_east * cos - wind_north * sin
        speeds_on_course = np.sqrt(np.maximum(0.0, airspeed**2 - crosswinds**2))
        ground_speeds.append(speeds_on_course + wind_east * sin + wind_north * cos)
    local_speeds, mean_speeds = ground_speeds
    return max(1.0, float((local_speeds / np.maximum(mean_speeds, _MIN_GROUND_SPEED_MPS)).max()))
