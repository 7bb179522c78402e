"""Compare the cost of the stages: bare JSBSim, the closed loop, recording, judging, reading, reporting.

Seconds are CPU seconds, the smallest of a few rounds, to reduce the effect of other work on the machine.  Flights with
and without a log alternate, so that a busy machine slows them all down.
"""

import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import median_cpu
from flight.dynamics.fdm import Fdm
from flight.mission.from_plan import plan_mission
from flight.simulation.setup import FDM_HZ, FlightSetup
from flight.simulation.simulate import BLOCK_DURATION_S, Flight, fly_to_end
from logs.recording.reader import read_log
from logs.recording.recorder import Recorder
from logs.verdict.judge_flight import judge_flight
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import BATCH_S
from planfly.workflow.uav import Uav, load_uav
from world.scenario import load_scenario

# Number of rounds.
ROUNDS = 5


def run() -> dict[str, Any]:
    """Measure, print a table, and return it."""
    scenario = load_scenario("jacksboro-air")
    uav = load_uav(scenario)
    plan = make_plan(scenario, uav, 1)
    mission = plan_mission(plan, uav.airspeed, uav.max_bank)
    setup = make_setup(scenario, uav, mission, 1, plan=plan)
    flown = fly_to_end(Flight(setup, uav.aircraft))
    seconds = float(flown.track.time[-1])
    steps = round(seconds * FDM_HZ)

    def bare() -> None:
        """Step JSBSim alone, without guidance."""
        fdm = Fdm(uav.aircraft, rate_hz=FDM_HZ)
        trim = fdm.start(36.5, -84.2, 600.0, 0.0, uav.airspeed)
        fdm.write(np.array(trim.commands()))
        fdm.step(steps)

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        times = recording(setup, uav, folder)
        hour, hours = long_flight(folder)
        size = hour.stat().st_size / hours / 1e6
        out = ("--out", str(folder / "report"), "--overwrite")
        times |= {
            "bare JSBSim": median_cpu(bare, ROUNDS),
            "judging": median_cpu(lambda: judge_flight(setup, flown.track, "completed"), ROUNDS),
            "planning": median_cpu(lambda: make_plan(scenario, uav, 1), ROUNDS),
            "whole `planfly run`, new process": in_child("run", "--out", str(folder / "run"), "--overwrite"),
            "`planfly --help`, new process": in_child("--help"),
            "reading the long log": median_cpu(lambda: read_log(hour), 3),
            "`planfly check` of the long log": in_child("check", str(hour)),
            "`planfly report` of the long log": in_child("report", str(hour), *out),
        }
        page = (folder / "report" / "report.html").stat().st_size / 1e6

    flight = times["flight"]
    ratios = {
        "closed loop at 60 Hz / bare JSBSim at 120 Hz": flight / times["bare JSBSim"],
        "recording at 20 Hz / flight": times["flight, recorded at 20 Hz"] / flight - 1.0,
        "recording at 60 Hz / flight": times["flight, recorded at 60 Hz"] / flight - 1.0,
        "judging / flight": times["judging"] / flight,
        "flight time / time to fly it": seconds / flight,
        "flight time / whole run": seconds / times["whole `planfly run`, new process"],
    }
    print(f"jacksboro-air, seed 1: {seconds:.0f} s of flight, {len(flown.track)} rows; CPU, median of {ROUNDS}")
    for label, value in times.items():
        print(f"  {label:<48}{value:9.3f} s")
    for label, value in ratios.items():
        print(f"  {label:<48}{value:9.2f}")
    print(f"  {'the long log, hours of flight':<48}{hours:9.2f}")
    print(f"  {'its size per flight hour, 60 Hz':<48}{size:9.1f} MB")
    print(f"  {'its report.html':<48}{page:9.1f} MB")
    return {"seconds": times, "ratios": ratios, "log_mb_per_hour": size, "long_log_hours": hours, "report_mb": page}


def recording(setup: FlightSetup, uav: Uav, folder: Path, rounds: int = 2 * ROUNDS) -> dict[str, float]:
    """Measure the flight without a log, and with a log at 20 Hz and 60 Hz, in turn.

    Returns the smallest CPU time of each, s.

    The cost of recording is a small difference of these, which would be lost in medians on a busy machine.
    """
    log = folder / "flight.mcap"

    def fly(every: int) -> None:
        """Fly and record every n-th row."""
        with Recorder(log, setup, every=every, batch=BATCH_S) as recorder:
            flight, ended = Flight(setup, uav.aircraft), ""
            while not ended:
                rows, ended = flight.fly_block(round(BLOCK_DURATION_S / flight.dt))
                recorder.write_rows(rows)
            recorder.finish(ended, None)

    work: dict[str, Callable[[], object]] = {
        "flight": lambda: fly_to_end(Flight(setup, uav.aircraft)),
        "flight, recorded at 20 Hz": lambda: fly(3),
        "flight, recorded at 60 Hz": lambda: fly(1),
    }
    spent: dict[str, list[float]] = {label: [] for label in work}
    for _ in range(rounds):
        for label, part in work.items():
            started = time.process_time()
            part()
            spent[label].append(time.process_time() - started)
    return {label: min(found) for label, found in spent.items()}


def planfly(*argv: str) -> None:
    """Run a command in a separate process."""
    subprocess.run([sys.executable, "-m", "planfly", *argv], check=True, capture_output=True)


def in_child(*argv: str, rounds: int = 2) -> float:
    """Return the CPU time of a command, including its start, s."""
    spent = []
    for _ in range(rounds):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        planfly(*argv)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return statistics.median(spent)


def long_flight(folder: Path, legs: int = 20) -> tuple[Path, float]:
    """Fly legs of about 3 minutes above the demo's ridges, in wind and turbulence.

    Return the log and its hours.
    """
    corners = ([(36.273, -84.28), (36.273, -84.22), (36.313, -84.22), (36.313, -84.28)] * legs)[:legs]
    lines = ["QGC WPL 110", "0\t1\t0\t16\t0\t0\t0\t0\t36.273\t-84.28\t1150\t1"]
    lines += [f"{k}\t0\t0\t16\t0\t0\t0\t0\t{lat}\t{lon}\t1200\t1" for k, (lat, lon) in enumerate(corners, 1)]
    mission, log = folder / "laps.waypoints", folder / "laps.mcap"
    mission.write_text("\n".join(lines) + "\n", encoding="utf-8")
    weather = ("--wind", "5,250", "--turbulence", "light")
    planfly("fly", str(mission), "--terrain", "jacksboro", *weather, "--log", str(log))
    return log, read_log(log).end_time / 3600.0
