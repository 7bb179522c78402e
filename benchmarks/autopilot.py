"""How fast a real autopilot flies in our physics, and where the time goes, as numbers.

Where no ArduPlane is at hand the part says so and measures nothing.
"""

import os
import statistics
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane_sitl.flight import AutopilotFlight
from flight.simulation.simulate import fly_to_end
from tests.autopilots import find_arduplane
from tests.setups import setup_maker, standard

ROUNDS = 3


@dataclass(frozen=True, slots=True)
class AutopilotCost:
    """One flight, a mission of 13 km; seconds by the clock, or of a processor, a second of flight.

    times_real: seconds of the exchange, from the boot on, over seconds by the clock.
    before: s by the clock, from the boot to the first waypoint.
    ours, theirs: CPU of our process and of the autopilot's.
    """

    times_real: float
    before: float
    ours: float
    theirs: float


def autopilot_cost(program: Path, seed: int) -> AutopilotCost:
    """Fly once, in 5 m/s and light turbulence."""
    aerosonde = load_aircraft("aerosonde")
    setup = setup_maker(aerosonde)(standard(), wind=(5.0, 250.0), turbulence="light", seed=seed)
    cpu, started = os.times(), time.perf_counter()
    with AutopilotFlight(setup, aerosonde, program, {}) as flight:
        flight.prepare()
        before = time.perf_counter() - started
        fly_to_end(flight)
        spent, flown = time.perf_counter() - started, flight.exchanged
    after = os.times()
    ours = after.user + after.system - cpu.user - cpu.system
    theirs = after.children_user + after.children_system - cpu.children_user - cpu.children_system
    return AutopilotCost(flown / spent, before, ours / flown, theirs / flown)


def run() -> dict[str, Any]:
    """Print and return the median flight's figures."""
    program = find_arduplane()
    if program is None:
        print("\nautopilot: no ArduPlane at hand (PLANFLY_ARDUPLANE names one): nothing measured")
        return {}
    costs = [autopilot_cost(program, seed) for seed in range(1, ROUNDS + 1)]
    median = sorted(costs, key=lambda cost: cost.times_real)[len(costs) // 2]
    print("\na real ArduPlane in our physics, 13 km in 5 m/s and light turbulence (median of three)")
    print(f"  times real time        {median.times_real:.0f} (20)")
    print(f"  before the first waypoint {statistics.median(cost.before for cost in costs):.1f} s")
    print(f"  CPU a second of flight: ours {1e3 * median.ours:.1f} ms, ArduPlane's {1e3 * median.theirs:.1f} ms")
    return asdict(median)
