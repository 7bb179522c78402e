"""Test if safe plans are flyable on fresh scenarios, by the geometry of the plan and by its flight.

``python -m benchmarks.plans_and_verdicts [--plans N] [--from NUMBER] [--plan-only] [--json FILE]`` plans random
scenarios over ground from 0 to 4,000 m, in wind, among zones and missiles, for each shipped fixed wing and each
autopilot (`tests.fresh_plans`), judges each plan without a flight, flies it, judges the flight, and counts the
differences. With ``--plan-only`` it only plans, and prints the planning time, also of scenarios without a plan.
"""

import argparse
import json
import time
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

from flight.mission.from_plan import plan_mission
from logs.verdict.judge_geometry import judge_geometry
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import fly_and_judge
from planfly.workflow.uav import load_uav
from planner.plan import Objective
from tests.fresh_plans import fresh_scenario
from world.errors import PlanflyError

# CPU time above which a plan is slow, s.
SLOW = 2.0


@dataclass(frozen=True, slots=True)
class Answer:
    """Result of one scenario.

    plan: "safe", or why there is no safe plan.  drawn, flown: the verdicts without and with a flight, "" without one.
    wrong: failures of either verdict.  seconds: CPU time of the plan, and of its flight and verdicts.  ratio: length of
    the plan relative to the straight line.  evaluations: evaluations of its search.
    """

    name: str
    turbulence: str
    plan: str
    drawn: str = ""
    flown: str = ""
    wrong: str = ""
    seconds: tuple[float, float] = (0.0, 0.0)
    ratio: float = 0.0
    evaluations: int = 0


def answer(number: int, *, judged: bool = True, flown: bool = True) -> Answer:
    """Plan the scenario of this number; judge the plan if ``judged``, fly and judge it if ``flown``."""
    scenario = fresh_scenario(number)
    whose = scenario.name, scenario.wind.turbulence
    began = time.process_time()
    uav = load_uav(scenario)
    try:
        plan = make_plan(scenario, uav, number + 1)
    except PlanflyError as error:
        return Answer(*whose, f"refused: {error}")
    planned = time.process_time()
    found = float(plan.objectives[Objective.LENGTH_RATIO]), plan.evaluations
    if not (plan.safe and judged):
        why = "; ".join(plan.certificate.problems[:2])
        said = "safe" if plan.safe else f"no plan: {why}"
        return Answer(*whose, said, "", "", "", (planned - began, 0.0), *found)
    mission = plan_mission(plan, uav.airspeed, uav.max_bank, tracking=uav.limits.tracking)
    setup = make_setup(scenario, uav, mission, number + 1, plan=plan)
    verdicts = {"drawn": judge_geometry(setup)}
    if flown:
        verdicts["flown"] = fly_and_judge(setup).verdict
    wrong = [
        f"{level} {one.rule} {one.reason}"
        for level, verdict in verdicts.items()
        for one in verdict.findings
        if one.ok is False
    ]
    spent = (planned - began, time.process_time() - planned)
    answers = {level: verdict.answer for level, verdict in verdicts.items()}
    return Answer(*whose, "safe", answers["drawn"], answers.get("flown", ""), "; ".join(wrong[:3]), spent, *found)


def main() -> None:
    """Plan and judge all scenarios, print a line for each, and count."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.plans_and_verdicts")
    parser.add_argument("--plans", type=int, default=300)
    parser.add_argument("--from", dest="first", type=int, default=0, help="number of the first scenario")
    parser.add_argument("--plan-only", action="store_true", help="neither judge nor fly the plans")
    parser.add_argument("--json", type=Path, help="file for the answers")
    args = parser.parse_args()
    # The first plan only loads the kernels.
    answer(args.first, judged=False)
    answers = []
    for number in range(args.first, args.first + args.plans):
        answers.append(answer(number, judged=not args.plan_only))
        one = answers[-1]
        told = f"{one.plan[:60]:10s} {one.drawn} {one.flown}  {one.wrong}"
        print(f"{one.name:28s} {one.seconds[0]:5.1f} s {told}", flush=True)
    safe = [one for one in answers if one.plan == "safe"]
    spent, slowest = [one.seconds[0] for one in answers], max(answers, key=lambda one: one.seconds[0])
    print(
        f"CPU of a plan: median {median(spent):.2f} s, most {max(spent):.2f} s ({slowest.name});"
        f" {sum(seconds > SLOW for seconds in spent)} take more than {SLOW:g} s"
    )
    print(f"{len(safe)} of {len(answers)} planned safely")
    if not args.plan_only:
        print(f"without a flight {dict(Counter(one.drawn for one in safe))}")
        for turbulence in ("none", "light", "moderate"):
            flown = Counter(one.flown for one in safe if one.turbulence == turbulence)
            print(f"flown in {turbulence:8s} turbulence: {dict(flown)}")
    if args.json:
        args.json.write_text(json.dumps([asdict(one) for one in answers], indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
