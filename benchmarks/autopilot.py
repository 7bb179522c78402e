"""Measure how fast ArduPlane and PX4 themselves fly in planfly's physics, and where the time is spent.

``python -m benchmarks autopilot``.  A program that is not available is reported and not measured.
"""

import os
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane_sitl.flight import AutopilotFlight
from flight.autopilots.px4.parameters import Px4Parameters
from flight.autopilots.px4_sitl.autopilot import Px4Sitl
from flight.autopilots.px4_sitl.flight import Px4Flight
from flight.autopilots.sitl.flight import SitlFlight
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import fly_to_end
from tests.autopilots import arduplane_program, find_arduplane, find_px4
from tests.setups import setup_maker, standard

# Number of flights.
ROUNDS = 3


@dataclass(frozen=True, slots=True)
class AutopilotCost:
    """Cost of one flight, a mission of 13 km.

    times_real: simulated time from the boot relative to wall-clock time.
    in_flight: the same from the first waypoint.
    before: wall-clock time from the boot to the first waypoint, s.
    ours, theirs: CPU time of planfly's process and of the autopilot's process, s per second of flight.
    """

    times_real: float
    in_flight: float
    before: float
    ours: float
    theirs: float


def autopilot_cost(make_flight: Callable[[int], SitlFlight], seed: int) -> AutopilotCost:
    """Fly once, in a wind of 5 m/s and light turbulence."""
    cpu, started = os.times(), time.perf_counter()
    with make_flight(seed) as flight:
        flight.prepare()
        begun, before = flight.autopilot_time, time.perf_counter() - started
        fly_to_end(flight)
        spent, flown = time.perf_counter() - started, flight.autopilot_time
    after = os.times()
    ours = after.user + after.system - cpu.user - cpu.system
    theirs = after.children_user + after.children_system - cpu.children_user - cpu.children_system
    return AutopilotCost(flown / spent, (flown - begun) / (spent - before), before, ours / flown, theirs / flown)


def run() -> dict[str, Any]:
    """Print and return the figures of the median flight, by name of the program."""
    aerosonde = load_aircraft("aerosonde")

    def mission(seed: int) -> FlightSetup:
        """Make the setup of the mission with a seed."""
        return setup_maker(aerosonde)(standard(), wind=(5.0, 250.0), turbulence="light", seed=seed)

    def arduplane(program: Path, seed: int) -> SitlFlight:
        """Make a flight of the mission by ArduPlane's program."""
        return AutopilotFlight(mission(seed), aerosonde, arduplane_program(program), {})

    def px4(program: Path, seed: int) -> SitlFlight:
        """Make a flight of the mission by PX4's program."""
        autopilot = Px4Sitl(Px4Parameters.load(aerosonde), binary=program)
        return Px4Flight(replace(mission(seed), autopilot=autopilot), aerosonde, autopilot)

    found: dict[str, Any] = {}
    for name, program, make_flight, goal in (
        ("ArduPlane", find_arduplane(), arduplane, 20),
        ("PX4", find_px4(), px4, 15),
    ):
        if program is None:
            print(f"\nautopilot: no {name} at hand (PLANFLY_{name.upper()} names one): nothing measured")
            continue
        costs = [autopilot_cost(partial(make_flight, program), seed) for seed in range(1, ROUNDS + 1)]
        median = sorted(costs, key=lambda cost: cost.in_flight)[len(costs) // 2]
        print(f"\n{name} itself in our physics, 13 km in 5 m/s and light turbulence (median of three)")
        print(f"  times real time, from the boot on         {median.times_real:.1f}")
        print(f"  times real time, from the first waypoint  {median.in_flight:.1f} ({goal})")
        print(f"  before the first waypoint {statistics.median(cost.before for cost in costs):.1f} s")
        print(f"  CPU a second of flight: ours {1e3 * median.ours:.1f} ms, {name}'s {1e3 * median.theirs:.1f} ms")
        found[name] = asdict(median)
    return found
