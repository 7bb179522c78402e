"""Plan a path."""

import time
from pathlib import Path

from planfly import pipeline
from planfly.airframe import choose_seed, load_airframe
from planfly.api.changed_scenario import Wind, changed_scenario, opened_scenario
from planfly.first_start.announcing import announcing
from planfly.kernel_units.unit_kernels import BOTH, PLANNING
from planner.plan import Plan, plan_json
from planner.search.plan_path import plan_path
from world.atomic_files import write_whole
from world.scenario import Scenario, embedded_scenarios
from world.scenario_types import Guidance, Navigation
from world.scenario_variants import with_planner

plan_then_fly = announcing(*BOTH)(pipeline.plan_then_fly)


@announcing(*PLANNING)
def plan(
    scenario: Scenario | str | Path,
    *,
    seed: int | None = None,
    algorithm: str | None = None,
    budget: int | None = None,
    seconds: float | None = None,
    wind: Wind | None = None,
    turbulence: str | None = None,
    aircraft: str | Path | None = None,
    airspeed: float | None = None,
    params: str | Path | None = None,
    guidance: Guidance | None = None,
    nav: Navigation | None = None,
    out: str | Path | None = None,
) -> Plan:
    """Plan a path across a scenario's terrain and threats, within what its aircraft can fly.

    scenario: an embedded name (`planfly.scenarios()` lists them), a TOML file's path, or a `Scenario`.
    seed: of the search; None takes the scenario's, or 1.
    algorithm: a name of ``planfly plan --help``; None for the default.
    budget: evaluations at most.  seconds: time at most; the best path so far is given then.
    wind: speed, m/s, and where it comes from, degrees; turbulence: "none", "light" or "moderate".
    aircraft: a name, or a folder.  airspeed: m/s.  params: a file of ArduPlane's parameters.
    guidance: planfly's own law ("path", "l1", "vector-field") in place of ArduPlane's.  nav: "perfect", "rtk", "gnss".
    out: where to write it as plan.json, replaced if it exists.

    No feasible path is a plan that says so (`Plan.feasible`, `Plan.safe`), not an error; bad input raises a
    `planfly.PlanflyError`.

    >>> import planfly
    >>> path = planfly.plan("tight", seed=1)
    >>> path
    <Plan tight: 22 waypoints, safe, ...>
    >>> path.waypoints.shape
    (22, 3)
    """
    world = changed_scenario(
        opened_scenario(scenario), wind=wind, turbulence=turbulence, aircraft=aircraft, airspeed=airspeed,
        params=params, guidance=guidance, nav=nav,
    )  # fmt: skip
    if budget is not None:
        world = with_planner(world, "budget", budget=budget)
    until = None if seconds is None else time.monotonic() + seconds
    made = plan_path(
        world,
        load_airframe(world).limits,
        seed=choose_seed(world, seed),
        algorithm=algorithm,
        stop=lambda: "budget" if until is not None and time.monotonic() >= until else "",
    )
    if out is not None:
        write_whole(Path(out), plan_json(made))
    return made


def scenarios() -> dict[str, str]:
    """Name and description of each embedded scenario.

    >>> import planfly
    >>> list(planfly.scenarios())[0]
    'jacksboro'
    """
    return {name: spec.description for name, spec in embedded_scenarios().items()}
