"""Compare the verdict on the flight of an autopilot's model with the verdict on the autopilot's own flight.

``python -m benchmarks.verdict_agreement [--autopilot NAME] [--missions N] [--from SEED] [--json FILE]`` makes
missions that keep one limit narrowly, or exceed it (`tests.field_missions.close_mission`), flies each with the model,
with GNSS errors, and with the program that PLANFLY_ARDUPLANE (or PLANFLY_PX4) names, both in the same air, judges both
flights by the same rules, and counts the differences.  ``--ordinary N`` instead flies ordinary missions with the model
alone, and counts those that are not flyable.
"""

import argparse
import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from logs.verdict.judge_flight import judge_flight
from logs.verdict.verdict import Verdict
from planfly.arguments import CHOICES
from planfly.flight_options import flight_entries
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import FlightTask, fly_and_judge
from planfly.workflow.uav import Uav, load_uav
from tests.field_missions import GROUND, FieldMission, close_mission, ordinary_mission

# Loss of clearance, or depth in a sphere, from which a violation is grave, m.
GRAVE = 1.0


@dataclass(frozen=True, slots=True)
class Answer:
    """Verdicts on two flights of a mission.

    law, real: first line of the verdict on the model's flight and on the program's flight.
    agree: True if both are flyable or both are not.
    harmed: True if the model's flight is flyable, and the program's flight lost clearance or entered a sphere by more
        than a metre.
    """

    name: str
    law: str
    real: str
    agree: bool
    harmed: bool


def setup_of(made: FieldMission) -> tuple[FlightSetup, Uav]:
    """Make the setup of a mission, with GNSS errors as in a scenario."""
    uav = load_uav(made.scenario)
    return make_setup(made.scenario, uav, made.mission, seed=1), uav


def by_law(made: FieldMission) -> tuple[Verdict, float]:
    """Return the verdict on the model's flight, and its energy, Wh."""
    setup, uav = setup_of(made)
    flown = fly_to_end(Flight(setup, uav.aircraft))
    return judge_flight(setup, flown.track, flown.ended), float(flown.track.energy[-1])


def by_program(made: FieldMission, program: Path) -> tuple[Verdict, bool]:
    """Return the verdict on the program's flight, and True if it has a grave violation.

    A violation of the clearance or of a sphere is grave if it exceeds `GRAVE`.
    """
    setup, _ = setup_of(made)
    flown = fly_and_judge(setup, FlightTask(autopilot=program))
    threats, position = made.scenario.threats, flown.track.position
    away = np.sqrt(((position[:, None] - threats.position[None]) ** 2).sum(axis=2)) - threats.kill_radius
    least = made.scenario.limits.min_clearance_m - GRAVE
    low = float(position[:, 2].min()) - GROUND < least
    return flown.verdict, low or bool((away < -GRAVE).any())


def compare(seed: int, autopilot_name: str, program: Path) -> Answer:
    """Fly the mission of a seed with the model and with the program, and compare the verdicts."""
    flight = {name: value for name, value in flight_entries({"autopilot": autopilot_name}).items() if value is not None}
    made = close_mission(seed, energy=lambda ordinary: by_law(ordinary)[1], **flight)
    (law, _), (real, lost) = by_law(made), by_program(made, program)
    agree = law.flyable == real.flyable
    return Answer(made.name, law.headline, real.headline, agree, law.flyable and lost)


def main() -> None:
    """Fly, print, and sum up."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.verdict_agreement")
    parser.add_argument(
        "--autopilot", choices=CHOICES["autopilot"], default="ardupilot", help="autopilot whose model is compared"
    )
    parser.add_argument("--missions", type=int, default=100)
    parser.add_argument("--from", dest="first", type=int, default=0, help="seed of the first mission")
    parser.add_argument("--ordinary", type=int, help="number of ordinary missions, flown by the model alone")
    parser.add_argument("--json", type=Path, help="also write every answer there")
    args = parser.parse_args()
    if args.ordinary is not None:
        # Count the ordinary missions that the verdict on the model's flight refuses.
        refused = 0
        for seed in range(args.first, args.first + args.ordinary):
            made = ordinary_mission(seed)
            verdict, _ = by_law(made)
            if not verdict.flyable:
                refused += 1
                print(f"{made.name}  {verdict.headline}", flush=True)
        print(f"{refused} of {args.ordinary} ordinary missions not flyable by the model")
        return
    program = Path(os.environ["PLANFLY_PX4" if args.autopilot.startswith("px4") else "PLANFLY_ARDUPLANE"])
    answers = []
    for seed in range(args.first, args.first + args.missions):
        answers.append(compare(seed, args.autopilot, program))
        one = answers[-1]
        print(f"{one.name:14s} {'same' if one.agree else 'DIFFER'}  model: {one.law}  program: {one.real}", flush=True)
    print(
        f"{sum(one.agree for one in answers)} of {len(answers)} agree;"
        f" {sum(one.harmed for one in answers)} flyable by the model, but harmed by the program;"
        f" not flyable by the program: {sum(not one.real.startswith('flyable') for one in answers)}"
    )
    if args.json:
        args.json.write_text(json.dumps([asdict(one) for one in answers], indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
