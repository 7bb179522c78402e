"""Run the whole chain into one folder: plan, export, fly, record, judge and report, once or in rounds."""

import contextlib
import json
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Unpack

from flight.mission_files.formats import mission_kind, mission_text
from flight.mission_files.qgc_plan import stated_cruise_speed
from flight.simulation.setup import EngineChoice
from logs.recording.setup_attachments import package_versions
from logs.verdict.judge_flight import judge_plan_only
from logs.verdict.verdict import Verdict, verdict_json
from planfly.api.api_function import api_function
from planfly.api.exporting import format_judging_parameters
from planfly.api.flying import check_program
from planfly.arguments import check_arguments
from planfly.flight_options import RunOptions, load_scenario_with_options, option_defaults
from planfly.kernel_units.unit_kernels import GLIDING, PLANNING_AND_FLYING
from planfly.runtime.stages import report_replaced, stage
from planfly.workflow.make_plan import make_plan, planning_conditions
from planfly.workflow.open_flight import make_setup, mission_of_plan
from planfly.workflow.output_paths import (
    RUN_FILES,
    RUN_FOLDER,
    check_output_folder,
    expand_path_pattern,
    prepare_folder,
)
from planfly.workflow.pipeline import (
    FlightLimits,
    FlightTask,
    ReturnSummary,
    autopilot_log_path,
    fly_and_judge,
    flying_stage,
    return_summary,
)
from planfly.workflow.reference_flights import FlyReference
from planfly.workflow.tighten_plan import refine as refine_rounds
from planfly.workflow.uav import Uav, choose_seed, load_uav, with_tightened_limits
from planner.plan import Plan, plan_json
from world.files import lock_path, write_atomically
from world.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Round:
    """One round of a run.

    number: number of the round, from 0.
    changes: one line for each limit that was tightened for this round's plan.
    verdict: verdict on its flight, or on its plan if nothing was flown.
    flown: True if it was flown.
    folder: the folder of its files.
    notes: notes on the scenario's zones and the mission's route.
    has_log: True if a flight log was written.
    return_summary: returns from a few points of the flight; empty if nothing was flown.
    engine: flight model that flew, and the reason; "" if nothing was flown.
    """

    number: int
    changes: tuple[str, ...]
    verdict: Verdict
    flown: bool
    folder: Path
    notes: tuple[str, ...] = ()
    has_log: bool = False
    return_summary: ReturnSummary = field(default_factory=ReturnSummary)
    engine: str = ""

    @property
    def returns_line(self) -> str:
        """Returns from a few points of the flight, in one line; "" if nothing was flown."""
        return self.return_summary.line


@dataclass(frozen=True, slots=True)
class RunResult:
    """Result of `planfly.run`.

    scenario: name of the scenario.
    seed: seed of planner and turbulence.
    folder: the folder of the files; the files of earlier rounds are in its subfolders round-0, round-1, ...
    rounds: one or more rounds; the verdict on the last round is the answer.
    ended: reason why no further round was planned.
    """

    scenario: str
    seed: int
    folder: Path
    rounds: tuple[Round, ...]
    ended: str

    @property
    def verdict(self) -> Verdict:
        """Verdict on the last round."""
        return self.rounds[-1].verdict

    @property
    def files(self) -> tuple[Path, ...]:
        """Files in the folder, without the files in its subfolders."""
        candidates = (self.folder / name for name in (*RUN_FILES, "rounds.json"))
        return tuple(file for file in candidates if file.exists())


@dataclass(frozen=True, slots=True)
class _RunTask:
    """Settings that all rounds of a run have in common.

    scenario: the scenario in which each round is judged.
    uav: the aircraft of the scenario.
    command: the command line that repeats the run, for the report.
    folder: the folder for the results.
    program: program of an autopilot; None for planfly's own simulation.
    reference: cases in which reference flights are flown.
    limits: limits of the flight time and of the size of the log.
    every: stride of the log's rows: every n-th row is recorded.
    engine: flight model that flies.
    """

    scenario: Scenario
    uav: Uav
    seed: int
    command: str
    folder: Path
    program: Path | None
    limits: FlightLimits
    every: int
    reference: FlyReference
    engine: EngineChoice


@api_function(*PLANNING_AND_FLYING, *GLIDING)
def run(
    scenario: Scenario | str | Path = "jacksboro",
    *,
    seed: int | None = None,
    refine: int = 0,
    out: str | Path = RUN_FOLDER,
    overwrite: bool = False,
    on_round: Callable[[Round], None] | None = None,
    **options: Unpack[RunOptions],
) -> RunResult:
    """Plan, export, fly, record, judge and report into one folder.

    scenario: a built-in scenario's name, a TOML file's path, or a `Scenario`.
    seed: seed of planner and turbulence; None takes the seed of the scenario, or 1.
    refine: maximum number of additional rounds, up to 20, each planned within limits tightened by the failures of the
    previous flight.
    out: the folder, in whose name {name} and {seed} stand for the scenario's name and the seed.
    overwrite: True replaces results in the folder; in the default folder they are always replaced.
    on_round: called with each round when it has ended.
    For the other keywords, see `planfly.fly`.
    Raises a `planfly.PlanflyError` for bad input, before anything is written.

    >>> import planfly, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     result = planfly.run("tight", seed=1, out=folder)
    ...     result.verdict.flyable, len(result.rounds), [file.name for file in result.files][:3]
    (False, 1, ['plan.json', 'mission.waypoints', 'mission.plan'])
    """
    limits = FlightLimits(options["max_hours"], options["max_log"])
    check_arguments(seed=seed, refine=refine)
    program = None if options["sitl"] is None else check_program(options["sitl"])
    world = load_scenario_with_options(scenario, options, program)
    chosen_seed, uav = choose_seed(world, seed), load_uav(world)
    folder = expand_path_pattern(out, world.name, chosen_seed)
    check_output_folder(folder, overwrite or out == RUN_FOLDER)
    scenario_name = world.name if isinstance(scenario, Scenario) else str(scenario)
    defaults = {"refine": 0, **option_defaults(RunOptions)}
    changed_options = {name: value for name, value in {"refine": refine, **options}.items() if value != defaults[name]}
    repeat_command = run_command_line(scenario_name, chosen_seed, changed_options)
    reference: FlyReference = "always" if options["levels"] else "failed"
    task = _RunTask(
        world,
        uav,
        chosen_seed,
        repeat_command,
        folder,
        program,
        limits,
        60 // options["log_hz"],
        reference,
        options["engine"],
    )
    with contextlib.ExitStack() as locks:
        return _fly_rounds(task, refine, locks, on_round)


def run_command_line(scenario: str, seed: int, options: Mapping[str, Any]) -> str:
    """Return the command line of ``planfly run`` with the given options, keyed by keyword.

    >>> run_command_line("tight", 3, {"wind": (8.0, 270.0), "autopilot": "px4", "params": "my file.parm"})
    "planfly run tight --seed 3 --wind 8,270 --autopilot px4 --params 'my file.parm'"
    """
    parts = [f"planfly run {shlex.quote(scenario)} --seed {seed}"]
    for name, value in options.items():
        parts.append(f"--{name.replace('_', '-')}")
        if name == "wind":
            parts.append("{:g},{:g}".format(*value))
        elif value is not True:
            parts.append(shlex.quote(str(value)))
    return " ".join(parts)


def _fly_rounds(
    task: _RunTask, refine: int, locks: contextlib.ExitStack, on_round: Callable[[Round], None] | None
) -> RunResult:
    """Plan and fly rounds until a flight is flyable, or the maximum number of rounds is reached.

    After a failed flight, the next round is planned within tighter limits.

    refine: maximum number of additional rounds.
    locks: exit stack that holds the lock of the folder from the first plan on.
    """
    scenario, uav, folder = task.scenario, task.uav, task.folder
    flown_rounds: list[Round] = []

    def plan_and_fly_round(planning_scenario: Scenario) -> tuple[Verdict, bool]:
        """Plan and fly one round; return its verdict, and True if it was flown.

        planning_scenario: scenario with the limits of this round.
        """
        planning_uav = uav if planning_scenario is scenario else with_tightened_limits(uav, planning_scenario)
        with stage(f"planning {scenario.name}", "planning") as advance:
            plan = make_plan(planning_scenario, planning_uav, task.seed, advance=advance)
        if not flown_rounds:
            folder.mkdir(parents=True, exist_ok=True)
            locks.enter_context(lock_path(folder))
            if task.program is not None:
                report_replaced(folder / "flight.mcap", autopilot_log_path(folder / "flight.mcap", task.program))
            prepare_folder(folder)
        flown_rounds.append(_record_round(task, plan, len(flown_rounds)))
        if on_round is not None:
            on_round(flown_rounds[-1])
        return flown_rounds[-1].verdict, flown_rounds[-1].flown

    def move_round_results(number: int) -> None:
        """Move the results of a round to its own subfolder before the next round."""
        round_folder = folder / f"round-{number}"
        round_folder.mkdir(exist_ok=True)
        for name in RUN_FILES:
            if (folder / name).exists():
                (folder / name).replace(round_folder / name)

    _, round_entries = refine_rounds(scenario, refine, plan_and_fly_round, move_round_results)
    if refine:
        write_atomically(folder / "rounds.json", json.dumps(round_entries, indent=1) + "\n")
    *earlier_rounds, last_round = (
        replace(flown_round, changes=tuple(round_entry["changes"]))
        for flown_round, round_entry in zip(flown_rounds, round_entries, strict=True)
    )
    rounds = (
        *(replace(flown_round, folder=folder / f"round-{flown_round.number}") for flown_round in earlier_rounds),
        last_round,
    )
    return RunResult(scenario.name, task.seed, folder, rounds, round_entries[-1]["next"])


def _record_round(task: _RunTask, plan: Plan, number: int) -> Round:
    """Write a plan, its mission and its verdict into the run's folder.

    If the plan is feasible, fly and report it.

    number: number of the round, from 0.
    """
    # Imported here: only the report needs matplotlib.
    from logs.views.report.page import write_report

    folder, uav = task.folder, task.uav
    write_atomically(folder / "plan.json", plan_json(plan))
    mission = mission_of_plan(plan, uav, "mission.waypoints")
    mission = replace(mission, autopilot=uav.autopilot.name)
    rally = [folder / "mission.rally"] if mission.rally else []
    written = replace(mission, cruise_speed=stated_cruise_speed(mission) or uav.airspeed)
    for target in (folder / "mission.waypoints", folder / "mission.plan", *rally):
        write_atomically(target, mission_text(written, mission_kind(target)))
    if plan.procedures is not None and uav.autopilot.parameters is not None:
        write_atomically(folder / "mission.parm", format_judging_parameters(mission, uav.autopilot)[0])
    if not plan.feasible:
        verdict = judge_plan_only(plan, planning_conditions(task.scenario, uav))
        write_atomically(folder / "verdict.json", verdict_json(verdict))
        return Round(number, (), verdict, flown=False, folder=folder)
    setup = make_setup(task.scenario, uav, mission, task.seed, plan=plan, engine=task.engine)
    with flying_stage(setup) as advance:
        flight_task = FlightTask(
            folder / "flight.mcap",
            advance,
            every=task.every,
            autopilot=task.program,
            reference=task.reference,
            returns=True,
            limits=task.limits,
        )
        flight = fly_and_judge(setup, flight_task)
    write_atomically(folder / "verdict.json", verdict_json(flight.verdict))
    summary = flight.returns or return_summary(flight.setup, flight.track)
    with stage("drawing", "drawing a report"):
        write_report(
            folder,
            flight.setup,
            flight.track,
            flight.verdict,
            ended=flight.ended,
            versions=package_versions(),
            command=task.command,
            events=flight.events,
            returns=summary.data_for_pictures(),
        )
    notes = (*setup.scenario.notes, *setup.notes)
    has_log = len(flight.track) > 0
    return Round(
        number,
        (),
        flight.verdict,
        flown=True,
        folder=folder,
        notes=notes,
        has_log=has_log,
        return_summary=summary,
        engine=flight.engine,
    )
