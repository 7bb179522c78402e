"""Limit the number of waypoints, because gusts can make an autopilot orbit a waypoint.

PX4 flies on at a waypoint only within NAV_FW_ALT_RAD of its altitude; otherwise it orbits the waypoint.  Moderate
turbulence sometimes displaces light aircraft by more than this, and an orbit leaves the airspace for which the plan was
checked.  Therefore the expected number of orbits per flight must not exceed `MAX_EXPECTED_ORBITS`.  A plan that needs
more waypoints is rejected with the reason.
"""

from collections.abc import Callable
from dataclasses import replace

from aircraft.path_limits import Limits
from aircraft.tracking import corridor_half_width
from flight.autopilots.autopilot import Autopilot
from flight.mission.from_plan import corner_speeds
from logs.verdict.trials import first_that_passes
from planfly.workflow.uav import Uav
from planner.plan import Plan
from planner.search.fewer_waypoints import drop_waypoints
from world.geometry import turning_angles
from world.scenario import Scenario

# Maximum expected number of orbits in a flight; about every second orbit leaves the corridor (of 186 flights, with 58
# waypoints passed too high or too low, 30 failed).
MAX_EXPECTED_ORBITS = 0.03
# Distance by which gusts increase the excursion at a corner, m; in 8 flights it grew from 28 m to at most 36 m.
GUST_CORNER_MARGIN_M = 8.0
# Values of the autopilot's altitude parameter that are tried as a remedy, m.
_TRIED_ALTITUDE_RADII_M = range(5, 105, 5)


def limit_waypoint_orbits(
    plan: Plan,
    uav: Uav,
    search: Callable[[Scenario], Plan] | None = None,
    search_limits: Limits | None = None,
    *,
    keeps_waypoints: bool = False,
) -> Plan:
    """Return a plan with few enough waypoints that gusts rarely make the aircraft orbit at one of them.

    This is the given plan if it has few enough waypoints, otherwise a plan with fewer waypoints.  In gusts its corners
    must stay in the corridor, too.  If no such plan is found, the given plan is returned as not safe, with the reason
    in its certificate.

    search: function that plans a changed scenario as the plan was made; None to search for no other path.
    search_limits: limits within which the plan was made; None for the limits of the aircraft.
    keeps_waypoints: True to keep the waypoints of the plan; a plan with too many is then returned as not safe.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.search.plan_path import plan_path
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> uav = load_uav(scenario)
    >>> plan = plan_path(scenario, uav.limits, seed=1)
    >>> limit_waypoint_orbits(plan, uav) is plan
    True
    """
    autopilot, limits = uav.autopilot, uav.limits.with_margin()
    orbits = expected_orbits(plan, autopilot, limits)
    if not plan.safe or orbits == 0.0:
        return plan
    turbulence = plan.scenario.wind.turbulence
    if orbits <= MAX_EXPECTED_ORBITS:
        # A plan with the usual number of waypoints has no corner that is too sharp.
        if len(plan.waypoints) >= plan.scenario.planner.waypoints or _is_safe_in_gusts(plan, uav):
            return plan
        excursions = _corner_excursions(plan, uav)
        corner, max_excursion = max(enumerate(excursions, 1), key=lambda entry: entry[1])
        problem_text = (
            f"in {turbulence} turbulence, {autopilot.title} is expected up to {max_excursion:.0f} m from the legs at"
            f" the corner of waypoint {corner}, but the corridor allows only {_plan_corridor_half_width(plan, uav):.0f}"
            " m"
        )
        return _with_problem(plan, problem_text)
    shorter_plan = plan if keeps_waypoints else drop_waypoints(plan, limits if search_limits is None else search_limits)
    if _is_safe_in_gusts(shorter_plan, uav):
        return shorter_plan
    remaining_orbits = expected_orbits(shorter_plan, autopilot, limits)
    count = len(shorter_plan.waypoints) - 2
    # If the plan has more waypoints than the scenario states, a search with that number has found no safe path.
    if search is not None and len(plan.waypoints) <= plan.scenario.planner.waypoints:
        # Assume the orbit probability per waypoint of this path; it may be lower on another path.
        allowed_count, scenario = max(1, int(MAX_EXPECTED_ORBITS * count / remaining_orbits)), plan.scenario
        planner_table = scenario.planner.model_copy(update={"waypoints": allowed_count + 2})
        other_plan = replace(search(replace(scenario, planner=planner_table)), scenario=scenario)
        if other_plan.safe and _is_safe_in_gusts(other_plan, uav):
            return other_plan
    # The remedy is a value of the autopilot's altitude parameter, or less turbulence.
    name = autopilot.deviations.altitude_parameter
    radius = first_that_passes(
        _TRIED_ALTITUDE_RADII_M,
        lambda value: (
            expected_orbits(plan, autopilot.with_parameters(**{name: float(value)}), limits) <= MAX_EXPECTED_ORBITS
        ),
    )
    remedy = "Less turbulence" if radius is None else f"{name} of {radius} m"
    problem_text = (
        f"in {turbulence} turbulence, {autopilot.title} circles at a waypoint if gusts push it off the waypoint's"
        f" altitude. This is expected in {min(orbits, 1.0):.0%} of the flights over {len(plan.waypoints) - 2}"
        f" waypoints, but only {MAX_EXPECTED_ORBITS:.0%} is accepted as safe. {remedy} would help"
    )
    return _with_problem(plan, problem_text)


def _with_problem(plan: Plan, problem: str) -> Plan:
    """Return a plan with a problem added to its certificate, which makes the plan not safe."""
    certificate = plan.certificate
    return replace(plan, certificate=replace(certificate, problems=(*certificate.problems, problem)))


def _is_safe_in_gusts(plan: Plan, uav: Uav) -> bool:
    """Return True if at most `MAX_EXPECTED_ORBITS` orbits are expected.

    All corners must stay in the corridor, too.
    """
    if expected_orbits(plan, uav.autopilot, uav.limits.with_margin()) > MAX_EXPECTED_ORBITS:
        return False
    return max(_corner_excursions(plan, uav), default=0.0) <= _plan_corridor_half_width(plan, uav)


def _plan_corridor_half_width(plan: Plan, uav: Uav) -> float:
    """Return the maximum distance from the legs that a flight of the plan may have, m."""
    return corridor_half_width(plan.scenario.limits.corridor_m, uav.autopilot.turns.acceptance_radius)


def _corner_excursions(plan: Plan, uav: Uav) -> list[float]:
    """Return the largest distance from the legs at each corner in gusts, m.

    Return [] if the limits have no tracking error.
    """
    limits = uav.limits
    if (tracking := limits.tracking) is None:
        return []
    turns = turning_angles(plan.waypoints)
    speeds = corner_speeds(plan.scenario, plan.waypoints, limits.airspeed)
    return [
        tracking.corner_excursion(float(turn), speed) + GUST_CORNER_MARGIN_M
        for turn, speed in zip(turns, speeds, strict=True)
    ]


def expected_orbits(plan: Plan, autopilot: Autopilot, limits: Limits) -> float:
    """Return the expected number of orbits at the inner waypoints of a plan in one flight.

    On a leg that climbs or sinks, less of the aircraft's climb or sink rate remains to counteract gusts.
    """
    turbulence, orbits = plan.scenario.wind.turbulence, 0.0
    for rate, waypoint in zip(
        limits.leg_climb_rates(plan.waypoints)[:-1, 1].tolist(), plan.waypoints[1:-1], strict=True
    ):
        climb, sink = limits.max_climb_and_sink_rates(float(waypoint[2]))
        orbits += autopilot.deviations.altitude_miss_probability(
            climb - max(0.0, rate), sink - max(0.0, -rate), turbulence
        )
    return orbits


def max_waypoints_in_gusts(plan: Plan, uav: Uav) -> int:
    """Return the maximum number of waypoints, including the ends, for alternatives to a safe plan.

    Alternatives are assumed to fly level, so that the probability of an orbit is the same at each of their waypoints.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.search.plan_path import plan_path
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> uav = load_uav(scenario)
    >>> max_waypoints_in_gusts(plan_path(scenario, uav.limits, seed=1), uav)
    22
    """
    scenario, count = plan.scenario, len(plan.waypoints)
    climb, sink = uav.limits.with_margin().max_climb_and_sink_rates(float(plan.waypoints[:, 2].max()))
    probability = uav.autopilot.deviations.altitude_miss_probability(climb, sink, scenario.wind.turbulence)
    if probability == 0.0:
        return count
    return max(count, min(scenario.planner.waypoints, 2 + int(MAX_EXPECTED_ORBITS / probability)))
