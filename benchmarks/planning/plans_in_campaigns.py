"""Fly campaigns of plans that `planfly plan` calls safe, and count the flyable flights of each.

``python -m benchmarks.planning.plans_in_campaigns [--flights N] [--fresh N] [--only NAME ...] [--workers N]
[--json FILE]`` plans four built-in scenarios and fresh ones, and flies each safe plan N times with the default
dispersions in the scenario's own wind and turbulence.  Every other fresh scenario begins on the ground and ends with a
landing.  Scenarios for which no safe plan is found are skipped, so that the same number of plans is flown.
"""

import argparse
import json
import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import planfly
from logs.verdict.wording import place_text
from planfly.api.planning import what_may_fail
from planfly.campaigns.statistics.decision import wilson
from planner.plan import Plan
from tests.autopilot_plans import plan_scenario
from tests.fresh_plans import AIRCRAFT, AUTOPILOTS, fresh_scenario
from tests.ground_missions import draw_field
from world.errors import PlanflyError
from world.scenario import Scenario, scenario_from_spec

BUILT_IN = ("jacksboro", "jacksboro-air", "steep", "tight")
# Number of the first fresh scenario; no other benchmark or test uses numbers this high.
FIRST = 69_001
# Seed of the strips, aircraft and winds of the fresh landings.
SEED = 6904
# Cruise speeds, m/s, of which the wind of a landing is a fraction.
CRUISE_MPS = {"aerosonde": 25.0, "x8": 18.0, "zagi": 15.0, "ultrastick25e": 17.0}
# Largest wind of a landing relative to the cruise speed.
MAX_WIND_FRACTION = 0.4
STRIP_LENGTHS_M = (200.0, 300.0, 400.0)
# Standard deviation of the surveyed height of a strip, m; None for a height from the elevation file only.
SURVEYS_M = (0.5, None)
# Flyable flights of 100 that a safe plan must reach.
REQUIRED_PERCENT = 95.0


@dataclass(frozen=True, slots=True)
class Held:
    """Campaign of one plan.

    low, high: Wilson's interval of the probability at 95 %.
    failed: failed flights by rule, with the places.
    stated: what the plan itself says about failures to expect.
    """

    name: str
    flights: int
    flyable: int
    low: float
    high: float
    failed: dict[str, dict[str, Any]]
    stated: tuple[str, ...]
    seconds: float

    @property
    def percent(self) -> float:
        """Flyable flights of 100."""
        return 100.0 * self.flyable / self.flights


def air_scenario(number: int) -> Scenario:
    """Return a scenario in the air.

    An odd number gives a scenario of `fresh_scenario`, an even number one of `plan_scenario`.  The ground is the
    shipped tile, hills and a plain in turn, or made ground up to 4,000 m.
    """
    if number % 2:
        return fresh_scenario(number // 2)
    scenario = plan_scenario(number // 2, AUTOPILOTS[number // 2 % len(AUTOPILOTS)])
    return replace(scenario, name=f"{scenario.name} {scenario.flight.autopilot}")


def landing_scenario(number: int) -> Scenario:
    """Return a scenario with take-off and landing.

    Its aircraft is each one in turn; its autopilot is ArduPlane, which flies landings.
    """
    rng = np.random.default_rng([SEED, number])
    aircraft = AIRCRAFT[number % len(AIRCRAFT)]
    field = draw_field(number, flight={"aircraft": aircraft, "autopilot": "ardupilot"})
    spec = field.to_json()
    survey = SURVEYS_M[int(rng.integers(len(SURVEYS_M)))]
    spec["landing"] |= {"length_m": float(rng.choice(STRIP_LENGTHS_M)), "height_sd_m": survey}
    spec["wind"]["speed_mps"] = float(rng.uniform(0.0, MAX_WIND_FRACTION)) * CRUISE_MPS[aircraft]
    described = "surveyed" if survey is not None else "unsurveyed"
    name = f"{field.name} {aircraft} {spec['landing']['length_m']:.0f} m {described}"
    return scenario_from_spec(spec | {"name": name}, name)


def safe_plans(fresh: int) -> Iterator[tuple[str, Plan]]:
    """Yield the built-in scenarios and the fresh ones with their plans, if `plan` calls them safe."""
    for name in BUILT_IN:
        yield name, planfly.plan(name)
    for draw, count in ((air_scenario, fresh - fresh // 2), (landing_scenario, fresh // 2)):
        number, made = FIRST, 0
        while made < count:
            scenario, number = draw(number), number + 1
            try:
                plan = planfly.plan(scenario)
            except PlanflyError as error:
                print(f"  {scenario.name}: refused: {error}", flush=True)
                continue
            if plan.safe:
                made += 1
                yield scenario.name, plan
            else:
                print(f"  {scenario.name}: no safe plan: {'; '.join(plan.certificate.problems[:1])}", flush=True)


def hold(name: str, plan: Plan, flights: int, workers: int) -> Held:
    """Fly a campaign of one plan."""
    began = time.perf_counter()
    result = planfly.campaign(plan, flights=flights, workers=workers)
    tally = result.summary.estimate.tally
    failed = {
        one.rule: {"flights": one.flights, "places": {place_text(place): count for place, count in one.places[:4]}}
        for one in result.summary.by_rule
    }
    interval = wilson(tally.flyable, tally.flown)
    return Held(name, tally.flown, tally.flyable, *interval, failed, what_may_fail(plan), time.perf_counter() - began)


def line(held: Held) -> str:
    """Return the line of one campaign.

    "!" marks too few flyable flights, and "s" a campaign whose plan says so.
    """
    causes = "; ".join(
        f"{rule} {one['flights']} ({', '.join(f'{place} {count}' for place, count in one['places'].items())})"
        for rule, one in held.failed.items()
    )
    mark = " " if held.percent >= REQUIRED_PERCENT else "s" if held.stated else "!"
    return f"{mark} {held.name:44s} {held.flyable:3d} of {held.flights}  {held.low:.3f} to {held.high:.3f}  {causes}"


def main() -> None:
    """Fly all campaigns, print a line for each, and sum up."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning.plans_in_campaigns")
    parser.add_argument("--flights", type=int, default=100, help="flights of each plan")
    parser.add_argument("--fresh", type=int, default=30, help="number of fresh scenarios")
    parser.add_argument("--only", nargs="*", default=[], help="only scenarios whose name contains one of these")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--json", type=Path, default=Path("runs") / "plans_in_campaigns.json", help="file for the rows")
    args = parser.parse_args()
    rows = []
    for name, plan in safe_plans(args.fresh):
        if not args.only or any(part in name for part in args.only):
            rows.append(hold(name, plan, args.flights, args.workers))
            print(line(rows[-1]), flush=True)
    worst = min((held.percent for held in rows), default=math.nan)
    count = sum(held.percent >= REQUIRED_PERCENT for held in rows)
    silent = [held for held in rows if held.percent < REQUIRED_PERCENT and not held.stated]
    print(
        f"{count} of {len(rows)} plans hold in at least {REQUIRED_PERCENT:g} % of their flights; worst {worst:.0f} %;"
        f" {len(silent)} fail more often without saying so, worst"
        f" {min((held.percent for held in silent), default=math.nan):.0f} %"
    )
    args.json.parent.mkdir(parents=True, exist_ok=True)
    args.json.write_text(json.dumps([asdict(held) for held in rows], indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
