"""Run a unit of work to compile its kernels, and report the kernels that are ready."""

import functools
import tomllib
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane.tracking_error import tracking_error
from flight.dynamics.envelope_tables import load_envelope
from flight.mission_files.formats import parse_mission
from flight.simulation.setup import make_limits
from logs.recording.recorder import Recorder
from planfly.kernel_units.unit_kernels import UNIT_KERNELS
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import fly_and_judge, return_summary
from planfly.workflow.uav import Uav, load_uav, scenario_aircraft
from planner.evaluation.problem import make_problem
from planner.search.kernel_calls import FRONT, PARTS, SAMPLE_COUNT, call_kernels
from planner.search.search_state import SCORE_COLUMNS, best_first
from world.compile_events import notify_before_compiling
from world.scenario import Scenario, scenario_from_spec

# ----------------------------------------------------------------------
# Units of work: each calls kernels that no other unit calls, with the argument types that all commands use.

# Scenario of the units, as TOML.
SCENARIO_TEXT = """
name = "field"
[terrain]
kind = "flat"
amsl_m = 0
[area]
east_m = [-3000, 3000]
north_m = [-3000, 3000]
ceiling_amsl_m = 600
[start]
east_m = -1500
north_m = 0
height_m = 100
[destination]
east_m = 1500
north_m = 0
height_m = 100
[[threats]]
name = "post"
east_m = 0
north_m = 0
amsl_m = 50
kill_radius_m = 100
kill_scale_m = 50
[wind]
speed_mps = 3
from_deg = 250
turbulence = "light"
[limits]
min_clearance_m = 50
"""
# Mission of the units, as a .waypoints file.
MISSION_TEXT = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t0.0\t1
1\t0\t3\t16\t0\t0\t0\t0\t46.0\t8.0\t100.0\t1
2\t0\t3\t16\t0\t0\t0\t0\t46.004\t8.0\t110.0\t1
3\t0\t3\t16\t0\t0\t0\t0\t46.004\t8.006\t110.0\t1
"""


def _make_scenario() -> Scenario:
    """Return a small scenario whose only purpose is to compile kernels."""
    return scenario_from_spec(tomllib.loads(SCENARIO_TEXT), "field")


def _make_scenario_and_uav() -> tuple[Scenario, Uav]:
    """Return the scenario of `_make_scenario` and its UAV."""
    scenario = _make_scenario()
    return scenario, load_uav(scenario)


def _compile_problem_kernels() -> None:
    """Compile the kernels that prepare a planning problem."""
    scenario = _make_scenario()
    aircraft = scenario_aircraft(scenario)
    limits = make_limits(scenario, load_envelope(aircraft), aircraft.airspeed, aircraft.max_bank)
    make_problem(scenario, limits)


def _compile_tracking_kernels() -> None:
    """Compile the kernels of ArduPlane's tracking error."""
    tracking_error(ArduPilotParameters.defaults(), load_aircraft("aerosonde").airspeed, "gnss")


def _compile_rank_kernels() -> None:
    """Compile the kernels that rank the scores of paths."""
    best_first(np.zeros((SAMPLE_COUNT, SCORE_COLUMNS)))


def _compile_planner_kernels(part: str) -> None:
    """Compile the kernels of one part of the planner.

    part: a name in `PARTS`, or `FRONT`.
    """
    scenario, uav = _make_scenario_and_uav()
    call_kernels(part, scenario, uav.limits)


def _compile_flight_kernels() -> None:
    """Compile the kernels that fly, judge and record a mission."""
    scenario, uav = _make_scenario_and_uav()
    setup = make_setup(scenario, uav, parse_mission(MISSION_TEXT, "field.waypoints"), 1)
    flight = fly_and_judge(setup)
    return_summary(setup, flight.track)
    with TemporaryDirectory() as folder, Recorder(Path(folder) / "flight.mcap", setup) as recorder:
        recorder.write(flight.track)
        recorder.finish(flight.ended, flight.verdict)


def _compile_glide_kernels() -> None:
    """Compile the kernels that judge simulated returns to launch, and glides."""
    scenario, uav = _make_scenario_and_uav()
    setup = make_setup(scenario, uav, parse_mission(MISSION_TEXT, "field.waypoints"), 1)
    return_summary(setup, track=None).data_for_pictures()


# Function of each unit by name.
UNITS: dict[str, Callable[[], None]] = {
    "problem": _compile_problem_kernels,
    "tracking": _compile_tracking_kernels,
    "ranks": _compile_rank_kernels,
    **{part: functools.partial(_compile_planner_kernels, part) for part in (*PARTS, FRONT)},
    "flight": _compile_flight_kernels,
    "glides": _compile_glide_kernels,
}


def run_unit(unit: str, report: Callable[[str], None]) -> None:
    """Run a unit of work, which compiles its kernels.

    unit: name in `UNITS`.
    report: called with ``ready KERNEL`` for each kernel that has been compiled or loaded.
    Raises KeyError for an unknown unit.
    """
    pending = list(UNIT_KERNELS[unit])

    def report_ready() -> None:
        """Report the pending kernels that are now compiled."""
        for name in [kernel for kernel in pending if is_ready(kernel)]:
            pending.remove(name)
            report(f"ready {name}")

    with notify_before_compiling(report_ready):
        UNITS[unit]()
    report_ready()


def is_ready(kernel: str) -> bool:
    """Return True if a kernel has been compiled, or loaded from the cache, in this process.

    kernel: "module.name".

    >>> is_ready("world.terrain.steepest_slopes") in (True, False)
    True
    """
    module, _, name = kernel.rpartition(".")
    # A documented attribute of numba's dispatchers: the argument types that they are compiled for.
    return bool(getattr(import_module(module), name).signatures)
