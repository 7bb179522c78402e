"""Fly default plans on three terrains with an autopilot's model or the program itself, and count violations.

``python -m benchmarks.planned_for_autopilots [--autopilot NAME] [--plans N] [--from NUMBER] [--sitl PATH]`` plans
random scenarios (`tests.autopilot_plans`: winds of 0 to 10 m/s, none to moderate turbulence, GNSS errors) for an
autopilot, flies each, and prints the margins of the certificate and of the flight, and at the end the number of
violations, with a separate number for moderate turbulence.
"""

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path

from flight.mission.from_plan import plan_mission
from planfly.arguments import CHOICES
from planfly.flight_options import flight_entries
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import FlightTask, fly_and_judge
from planfly.workflow.uav import load_uav
from tests.autopilot_plans import CLEARANCE, Harm, harm_of, plan_scenario
from world.scenario import with_flight


@dataclass(frozen=True, slots=True)
class Flown:
    """Plan and its flight.

    wrong: what went wrong, "" if nothing did.
    harm: margins of the flight; None without a plan.
    longer: length of the plan relative to a plan without reserve for the tracking error.
    """

    wrong: str
    harm: Harm | None
    longer: float
    turbulence: str


def fly(number: int, autopilot: str, sitl: Path | None) -> Flown:
    """Plan and fly the scenario of this number, and print a line about it.

    autopilot: autopilot that the plan is made for.
    sitl: program that flies the plan; None to fly it with the autopilot's model.
    """
    scenario = with_flight(plan_scenario(number), **flight_entries({"autopilot": autopilot}))
    uav = load_uav(scenario)
    plan = make_plan(scenario, uav, number + 1)
    if not plan.safe:
        print(f"{scenario.name:10s} no plan: {'; '.join(plan.certificate.problems[:2])}", flush=True)
        return Flown("no plan", None, math.nan, scenario.wind.turbulence)
    exact = replace(uav, limits=replace(uav.limits, tracking=None))
    longer = float(plan.objectives[0] / make_plan(scenario, exact, number + 1).objectives[0])
    mission = plan_mission(plan, uav.airspeed, uav.max_bank, tracking=uav.limits.tracking)
    setup = make_setup(scenario, uav, mission, number + 1, plan=plan)
    judged = fly_and_judge(setup, FlightTask(autopilot=sitl))
    harm = harm_of(scenario, plan.waypoints, judged.track)
    parts = [harm.text(scenario), "" if judged.ended == "completed" else judged.ended]
    parts += [f"{found.rule}: {found.reason}" for found in judged.verdict.findings if found.ok is False]
    wrong = "; ".join(part for part in parts if part)
    promised, wind = plan.certificate, scenario.wind
    print(
        f"{scenario.name:10s} wind {wind.speed:4.1f} {wind.turbulence:8s} length x {longer:.4f}"
        f" clearance {promised.clearance:6.1f} {harm.clearance - CLEARANCE:6.1f}"
        f" spheres {promised.kill_distance:7.1f} {harm.sphere:7.1f} off the legs {harm.aside:5.1f}  {wrong}",
        flush=True,
    )
    return Flown(wrong, harm, longer, wind.turbulence)


def main() -> None:
    """Fly, print, and sum up."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planned_for_autopilots")
    parser.add_argument(
        "--autopilot", choices=CHOICES["autopilot"], default="ardupilot", help="autopilot that the plans are made for"
    )
    parser.add_argument("--plans", type=int, default=100)
    parser.add_argument("--from", dest="first", type=int, default=0, help="number of the first scenario")
    parser.add_argument("--sitl", type=Path, help="the program of the autopilot itself (default: its model)")
    args = parser.parse_args()
    flown = [fly(number, args.autopilot, args.sitl) for number in range(args.first, args.first + args.plans)]
    made = [one for one in flown if one.harm is not None]
    longer = sorted(one.longer for one in made)
    print(
        f"{len(made)} of {len(flown)} planned, {sum(one.wrong != '' for one in made)} not flyable,"
        f" of those in moderate turbulence {sum(one.wrong != '' for one in made if one.turbulence == 'moderate')};"
        f" least clearance margin {min(one.harm.clearance for one in made if one.harm) - CLEARANCE:.1f} m,"
        f" least distance to a sphere {min(one.harm.sphere for one in made if one.harm):.1f} m;"
        f" plans longer by the reserve: median {longer[len(longer) // 2]:.4f}, most {longer[-1]:.4f}"
    )


if __name__ == "__main__":
    main()
