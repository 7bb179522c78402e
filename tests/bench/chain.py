"""The whole chain, stage by stage: `planfly run jacksboro --seed 1`."""

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from flight.export import plan_mission
from flight.fdm import Fdm
from flight.simulate import FDM_HZ, simulate
from logs.check import judge_flight
from logs.reader import read_log
from logs.recorder import Recorder
from planfly.pipeline import load_vehicle, make_plan, make_setup
from tests.bench.timing import ROUNDS, best
from world.scenario import load_scenario


def run() -> dict[str, Any]:
    """Measure, print a table, and return it."""
    scenario = load_scenario("jacksboro")
    vehicle = load_vehicle(scenario)
    plan = make_plan(scenario, vehicle, 1)
    mission = plan_mission(plan, vehicle.airspeed, vehicle.max_bank)
    setup = make_setup(scenario, vehicle, mission, 1, plan=plan)
    flown = simulate(setup, vehicle.aircraft)
    seconds = float(flown.track.time[-1])
    steps = round(seconds * FDM_HZ)

    def bare() -> None:
        fdm = Fdm(vehicle.aircraft, rate_hz=FDM_HZ)
        trim = fdm.start(36.5, -84.2, 600.0, 0.0, vehicle.airspeed)
        fdm.write(np.array(trim.commands()))
        fdm.step(steps)

    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "flight.mcap"

        def record() -> None:
            with Recorder(log, setup) as recorder:
                rows = len(flown.track)
                for start in range(0, rows, 60):
                    recorder.write(flown.track.rows(start, min(rows, start + 60)))
                recorder.finish("completed", None)

        times = {
            "bare JSBSim": best(bare),
            "flight": best(lambda: simulate(setup, vehicle.aircraft)),
            "recording": best(record),
            "reading the log": best(lambda: read_log(log)),
            "judging": best(lambda: judge_flight(setup, flown.track, "completed")),
            "planning": best(lambda: make_plan(scenario, vehicle, 1)),
            "whole `planfly run`, new process": best(lambda: _run(Path(folder)), 2),
            "`planfly --help`, new process": best(_help, 3),
        }
        size = log.stat().st_size

    ratios = {
        "closed loop at 60 Hz / bare JSBSim at 120 Hz": times["flight"] / times["bare JSBSim"],
        "recording at 60 Hz / flight": times["recording"] / times["flight"],
        "judging / flight": times["judging"] / times["flight"],
        "flight time / time to fly it": seconds / times["flight"],
        "flight time / whole run": seconds / times["whole `planfly run`, new process"],
    }
    hourly = size * 3600 / seconds / 1e6
    print(f"\nThe chain: jacksboro, seed 1: {seconds:.0f} s of flight, {len(flown.track)} rows; best of {ROUNDS}")
    for name, value in times.items():
        print(f"  {name:<48}{value:9.3f} s")
    for name, value in ratios.items():
        print(f"  {name:<48}{value:9.2f}")
    print(f"  {'log size per flight hour, 60 Hz':<48}{hourly:9.1f} MB")
    return {"seconds": times, "ratios": ratios, "log_mb_per_hour": hourly}


def _run(folder: Path) -> None:
    command = [sys.executable, "-m", "planfly", "run", "--out", str(folder / "run"), "--overwrite"]
    subprocess.run(command, check=True, capture_output=True)


def _help() -> None:
    subprocess.run([sys.executable, "-m", "planfly", "--help"], check=True, capture_output=True)
