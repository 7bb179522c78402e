"""The chain: flight, log, verdict and a whole run, as ratios measured side by side."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
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
from world.scenario import load_scenario

ROUNDS = 5


def best(work: Callable[[], object], rounds: int = ROUNDS, clock: Callable[[], float] = time.perf_counter) -> float:
    """The shortest of a few runs, s: the one that the machine disturbed least.

    clock: `time.process_time` for what is compared with a share of something else, on a machine that others use.
    """
    spent = []
    for _ in range(rounds):
        started = clock()
        work()
        spent.append(clock() - started)
    return min(spent)


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

        # As the flight hands them on: a second at a time.
        rows = len(flown.track)
        blocks = [flown.track.rows(start, min(rows, start + 60)) for start in range(0, rows, 60)]

        def record(every: int = 1) -> None:
            with Recorder(log, setup, every=every, batch=30) as recorder:
                for block in blocks:
                    recorder.write(block)
                recorder.finish("completed", None)

        times = {
            "bare JSBSim": best(bare),
            "flight": best(lambda: simulate(setup, vehicle.aircraft), clock=time.process_time),
            "recording, 20 Hz": best(lambda: record(3), clock=time.process_time),
            "recording": best(record, clock=time.process_time),
            "reading the log": best(lambda: read_log(log)),
            "judging": best(lambda: judge_flight(setup, flown.track, "completed")),
            "planning": best(lambda: make_plan(scenario, vehicle, 1)),
            "whole `planfly run`, new process": best(lambda: _run(Path(folder)), 2),
            "`planfly --help`, new process": best(_help, 3),
        }
        size = log.stat().st_size
        hour, hours = _long_flight(Path(folder))
        times["`planfly check` of a long log"] = best(lambda: _planfly("check", str(hour)), 2)
        out = str(Path(folder) / "report")
        times["`planfly report` of a long log"] = best(
            lambda: _planfly("report", str(hour), "--out", out, "--overwrite"), 2
        )

    ratios = {
        "closed loop at 60 Hz / bare JSBSim at 120 Hz": times["flight"] / times["bare JSBSim"],
        "recording at 20 Hz / flight": times["recording, 20 Hz"] / times["flight"],
        "recording at 60 Hz / flight": times["recording"] / times["flight"],
        "judging / flight": times["judging"] / times["flight"],
        "flight time / time to fly it": seconds / times["flight"],
        "flight time / whole run": seconds / times["whole `planfly run`, new process"],
    }
    print(f"jacksboro, seed 1: {seconds:.0f} s of flight, {len(flown.track)} rows; best of {ROUNDS}")
    for name, value in times.items():
        print(f"  {name:<48}{value:9.3f} s")
    for name, value in ratios.items():
        print(f"  {name:<48}{value:9.2f}")
    hourly = size * 3600 / seconds / 1e6
    print(f"  {'log size per flight hour, 60 Hz':<48}{hourly:9.1f} MB")
    print(f"  {'the long log, hours of flight':<48}{hours:9.2f}")
    return {"seconds": times, "ratios": ratios, "log_mb_per_hour": hourly, "long_log_hours": hours}


def _run(folder: Path) -> None:
    command = [sys.executable, "-m", "planfly", "run", "--out", str(folder / "run"), "--overwrite"]
    subprocess.run(command, check=True, capture_output=True)


def _planfly(*argv: str) -> None:
    subprocess.run([sys.executable, "-m", "planfly", *argv], check=True, capture_output=True)


def _long_flight(folder: Path) -> tuple[Path, float]:
    """Fly five laps above the demo's ridges, in wind and turbulence: the log, and the hours in it."""
    corners = [(36.56, -84.28), (36.56, -84.22), (36.60, -84.22), (36.60, -84.28)] * 5
    lines = ["QGC WPL 110", "0\t1\t0\t16\t0\t0\t0\t0\t36.58\t-84.25\t1150\t1"]
    lines += [f"{k}\t0\t0\t16\t0\t0\t0\t0\t{lat}\t{lon}\t1200\t1" for k, (lat, lon) in enumerate(corners, 1)]
    mission, log = folder / "laps.waypoints", folder / "laps.mcap"
    mission.write_text("\n".join(lines) + "\n", encoding="utf-8")
    weather = ("--wind", "5,250", "--turbulence", "light")
    _planfly("fly", str(mission), "--terrain", "jacksboro", *weather, "--log", str(log))
    return log, read_log(log).end_time / 3600.0


def _help() -> None:
    subprocess.run([sys.executable, "-m", "planfly", "--help"], check=True, capture_output=True)
