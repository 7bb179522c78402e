"""Compare flights with JSBSim at 60 steps a second with the same flights at 120.

``python -m benchmarks.campaigns.compare_step_rates [--missions N] [--from SEED] [--aircraft NAME]`` flies missions of
`tests.field_missions`, every other one close to a limit, at both rates: unchanged, with gusts and GNSS errors, for the
verdict; in calm air and in their wind without gusts, with exact navigation, for the track.  It prints the number of
different verdicts, and the largest distance between the tracks at the same time.
"""

import argparse
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from flight.simulation.simulate import Flight, fly_to_end
from logs.verdict.judge_flight import judge_flight
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import Uav, load_uav
from tests.field_missions import FieldMission, close_mission, ordinary_mission
from world.scenario import Scenario
from world.wind import Wind

# Compared step rates, Hz.
STEP_RATES: tuple[Literal[60, 120], ...] = (120, 60)
# Largest allowed distance of a track from the track at 120 steps a second, m.
MAX_DIFFERENCE = 0.1


@dataclass(frozen=True, slots=True)
class StepRates:
    """Results of one mission at both rates.

    flyable: verdicts at 120 and at 60 steps a second.
    same: True if the same rules failed at the same places.
    calm, windy: largest distance between the tracks without gusts, m; inf if the flights ended differently.
    """

    name: str
    flyable: tuple[bool, bool]
    same: bool
    calm: float
    windy: float


def compare(seed: int, aircraft: str = "aerosonde") -> StepRates:
    """Fly the mission of a seed at both rates."""
    made = mission_of(seed, aircraft)
    uav = load_uav(made.scenario)
    setup = make_setup(made.scenario, uav, made.mission, seed=1)
    flights = [fly_to_end(Flight(replace(setup, fdm_hz=hz), uav.aircraft)) for hz in STEP_RATES]
    judged = [judge_flight(setup, flown.track, flown.ended) for flown in flights]
    failed = [{(item.rule, item.place) for item in one.findings if item.ok is False} for one in judged]
    calm, windy = (_max_distance(made, uav, speed) for speed in (0.0, made.scenario.wind.speed))
    return StepRates(made.name, (judged[0].flyable, judged[1].flyable), failed[0] == failed[1], calm, windy)


def mission_of(seed: int, aircraft: str) -> FieldMission:
    """Make the mission of a seed: ordinary for an even seed, close to a limit for an odd one."""
    flight: dict[str, Any] = {} if aircraft == "aerosonde" else {"aircraft": aircraft}
    if seed % 2 == 0:
        return ordinary_mission(seed, **flight)
    return close_mission(seed, energy=_energy, **flight)


def _energy(made: FieldMission) -> float:
    """Return the battery energy of a mission's flight, Wh."""
    uav = load_uav(made.scenario)
    return float(fly_to_end(Flight(make_setup(made.scenario, uav, made.mission, 1), uav.aircraft)).track.energy[-1])


def _max_distance(made: FieldMission, uav: Uav, wind_speed: float) -> float:
    """Return the largest distance between a mission's flights at both step rates at the same time, m.

    The flights have no gusts and exact navigation. The distance is infinite if the flights ended differently, or differ
    in length by more than one tick.

    wind_speed: m/s.
    """
    old = made.scenario.wind
    wind = Wind(wind_speed, old.from_course, old.gradient if wind_speed else 0.0, "none", None, old.reference_amsl)
    table = made.scenario.spec.wind.model_copy(update={"speed_mps": wind_speed, "turbulence": "none"})
    scenario: Scenario = replace(made.scenario, wind=wind, spec=made.scenario.spec.model_copy(update={"wind": table}))
    setup = replace(make_setup(scenario, load_uav(scenario), made.mission, seed=1), nav="perfect")
    one, other = (fly_to_end(Flight(replace(setup, fdm_hz=hz), uav.aircraft)) for hz in STEP_RATES)
    rows = min(len(one.track), len(other.track))
    # The flights may differ by one tick in length.
    if one.ended != other.ended or abs(len(one.track) - len(other.track)) > 1 or not rows:
        return float("inf")
    return float(np.linalg.norm(one.track.position[:rows] - other.track.position[:rows], axis=1).max())


def compare_all(seeds: range, aircraft: str = "aerosonde", *, loud: bool = False) -> dict[str, float]:
    """Compare all missions, and return figures by name."""
    found: list[StepRates] = []
    for seed in seeds:
        one = compare(seed, aircraft)
        found.append(one)
        if loud and (not one.same or max(one.calm, one.windy) > MAX_DIFFERENCE):
            print(f"{one.name}: flyable {one.flyable}, same findings {one.same}, {one.calm:.3f}, {one.windy:.3f} m")
    return {
        "missions": len(found),
        "flyable at 120 steps a second": sum(one.flyable[0] for one in found),
        "verdicts that differ": sum(one.flyable[0] != one.flyable[1] for one in found),
        "missions with other failed findings": sum(not one.same for one in found),
        "calm: most between the tracks, m": max(one.calm for one in found),
        "wind without gusts: most between the tracks, m": max(one.windy for one in found),
    }


def main() -> None:
    """Compare the flights of random missions at both step rates, and print a table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.campaigns.compare_step_rates")
    parser.add_argument("--missions", type=int, default=200)
    parser.add_argument("--from", dest="first", type=int, default=0, help="seed of the first mission")
    parser.add_argument("--aircraft", default="aerosonde")
    args = parser.parse_args()
    for label, value in compare_all(range(args.first, args.first + args.missions), args.aircraft, loud=True).items():
        print(f"  {label:<52}{value:10.4g}")


if __name__ == "__main__":
    main()
