"""Repeat section V of the paper, with seeded plans of each problem in each encoding, and their table."""

import csv
import io
import itertools
import json
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, fields
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import Any

import numpy as np

from planfly.arguments import check_arguments
from planfly.runtime.process_setup import check_script_guard, end_repeated_call
from planfly.runtime.stages import stage
from planfly.workflow.make_plan import Advance, make_plan
from planfly.workflow.output_paths import check_output_folder, prepare_folder
from planfly.workflow.uav import load_uav
from planner.plan import Objectives, Violations
from planner.search.algorithms import find_algorithm
from world.argument_types import checks_types
from world.arrays import Floats
from world.files import lock_path, write_atomically
from world.interruption import children_ignore_sigint, delay_signals, end_children, end_with_parent
from world.scenario import Scenario, load_scenario, with_planner

# Numbers of threats in the problems of the paper.
PROBLEMS = (7, 15, 30, 60)
# Planner of the paper.
PAPER_ALGORITHM = "umda"
# Planners for comparison.  They are the baselines of Figs. 9-12, with two ranges of the polar encoding's angle, because
# the paper states none, and a polar encoding of planfly.
BASELINE_ALGORITHMS = ("umda-cartesian", "umda-polar", "umda-polar-45", "umda-bearing")
# The planner of the paper in a strip along the straight line, an addition of planfly that other encodings do not get.
STRIP_ALGORITHM = "umda-strip"
# Half width of the strip for each number of threats, m.
STRIP_HALF_WIDTHS_M = {7: 2500.0, 15: 2500.0, 30: 2500.0, 60: 1500.0}


@dataclass(frozen=True, slots=True, eq=False)
class SeededPlan:
    """Values of a plan that was made with one seed, for tables and figures.

    threats: number of threats in the problem.
    waypoints: world coordinates, m, (w, 3).
    violations, objectives: counts and values at the points where the paper evaluates a path, six per leg.
    certified: True if the continuous check passes and no missile reaches the path.
    kill_probability, detection_probability: values of `exposure_probability`.
    history: length ratio, kill exposure and violations of the best path after each generation, (g, 3).
    seconds: CPU time of the search, s.
    """

    threats: int
    algorithm: str
    seed: int
    waypoints: Floats
    violations: Violations
    objectives: Objectives
    certified: bool
    kill_probability: float
    detection_probability: float
    evaluations: int
    history: Floats
    seconds: float

    @property
    def safe(self) -> bool:
        """True if the plan has no violation and no kill exposure at the paper's six points per leg."""
        return not any(self.violations) and self.objectives.kill_exposure == 0.0


@dataclass(frozen=True, slots=True)
class TableRow:
    """One line of the table, on the plans of one algorithm for one problem.

    The columns of table.csv have these names.
    runs: number of seeds.
    safe: number of plans that are safe on the points of the paper.
    certified: number of plans that pass the continuous check.
    length_median, length_worst: path length ratio of the safe plans, None without a safe plan.
    kill_median, kill_worst, detection_median: the paper's sums, over all plans.
    kill_probability_worst: maximum kill probability of all plans.
    seconds_median: median CPU time of a search, s.
    """

    threats: int
    algorithm: str
    runs: int
    safe: int
    certified: int
    length_median: float | None
    length_worst: float | None
    kill_median: float
    kill_worst: float
    kill_probability_worst: float
    detection_median: float
    seconds_median: float


def problem_name(threats: int) -> str:
    """Return the name of the built-in scenario of a problem, by its number of threats."""
    return f"paper-{threats:02d}"


def exposure_probability(scenario: Scenario, waypoints: Floats, kind: str) -> float:
    """Return the probability of at least one kill or detection on a path.

    The points of the path are treated as independent.

    The points are the path's six per leg, and its end.
    The probability at a point is min(1, (scale / d)^4) for a threat at distance d within its radius.  The paper's sums
    (eq. 9, 10) over the same points have no upper bound.

    waypoints: positions, (w, 3), m.
    kind: "kill" or "detection".
    """
    fractions = np.arange(6)[:, None] / 6.0
    points = np.concatenate(
        [leg_start + fractions * (leg_end - leg_start) for leg_start, leg_end in itertools.pairwise(waypoints)]
    )
    points = np.vstack([points, waypoints[-1:]])
    threats = scenario.threats
    radius, scale = getattr(threats, f"{kind}_radius"), getattr(threats, f"{kind}_scale")
    distance = np.sqrt(((points[:, None, :] - threats.position[None]) ** 2).sum(axis=-1))
    probability = np.minimum(1.0, (scale / np.maximum(distance, 1.0)) ** 4)
    probability[(distance > radius) | (radius <= 0.0)] = 0.0
    return float(1.0 - np.prod(1.0 - probability))


def plan_once(threats: int, algorithm: str, seed: int) -> SeededPlan:
    """Plan a problem of the paper with one seed, and return the values for tables and figures.

    threats: number of threats, which names the problem.
    algorithm: name of a planner, or `STRIP_ALGORITHM`.
    """
    scenario = load_scenario(problem_name(threats))
    searched_algorithm = algorithm
    if algorithm == STRIP_ALGORITHM:
        scenario = with_planner(scenario, STRIP_ALGORITHM, across_m=STRIP_HALF_WIDTHS_M[threats])
        searched_algorithm = PAPER_ALGORITHM
    uav = load_uav(scenario)
    start_time = time.process_time()
    plan = make_plan(scenario, uav, seed, searched_algorithm)
    seconds = time.process_time() - start_time
    return SeededPlan(
        threats=threats,
        algorithm=algorithm,
        seed=seed,
        waypoints=plan.waypoints,
        violations=plan.violations,
        objectives=plan.objectives,
        certified=plan.safe,
        kill_probability=exposure_probability(scenario, plan.waypoints, "kill"),
        detection_probability=exposure_probability(scenario, plan.waypoints, "detection"),
        evaluations=plan.evaluations,
        history=plan.history,
        seconds=seconds,
    )


def plan_section(
    problems: Sequence[int], seeds: int, algorithm: str, jobs: int | None = None, advance: Advance | None = None
) -> list[SeededPlan]:
    """Make all plans of section V of the paper, ordered by problem, algorithm and seed, from seed 1 on.

    The order does not depend on the number of processes.

    problems: numbers of threats, which name the problems.
    seeds: number of seeds.
    algorithm: algorithm in place of the paper's; the strip and the baselines are always planned, too.
    jobs: number of processes; None for one per available core.
    advance: function called with the progress after each plan.
    Raises ScenarioError for an unknown algorithm.
    """
    names = [find_algorithm(algorithm, "algorithm").name]
    names += [name for name in (STRIP_ALGORITHM, *BASELINE_ALGORITHMS) if name not in names]
    tasks = [(threats, name, seed) for threats in problems for name in names for seed in range(1, seeds + 1)]
    count = min(len(tasks), jobs or usable_cores())
    plans: list[SeededPlan] = []
    if advance is not None:
        advance(0, len(tasks), f"0 of {len(tasks)} plans")
    for seeded_plan in _plan_in_processes(tasks, count):
        plans.append(seeded_plan)
        if advance is not None:
            remark = f"{seeded_plan.threats} threats, {seeded_plan.algorithm}, seed {seeded_plan.seed}"
            advance(len(plans), len(tasks), remark)
    return plans


def usable_cores() -> int:
    """Return the number of cores available to this process, or of all cores if that is unknown.

    >>> usable_cores() >= 1
    True
    """
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else os.cpu_count() or 1


def _plan_in_processes(tasks: list[tuple[int, str, int]], count: int) -> Iterator[SeededPlan]:
    """Yield the plan of each task (threats, algorithm, seed), in order, made in `count` processes.

    The first task runs in this process, to compile the kernels.
    """
    yield plan_once(*tasks[0])
    if count == 1:
        yield from (plan_once(*task) for task in tasks[1:])
        return
    pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=end_with_parent)
    try:
        # All processes are started here.
        with children_ignore_sigint(), delay_signals():
            results = pool.map(plan_once, *zip(*tasks[1:], strict=True))
        workers = active_children()
        yield from results
    except BrokenProcessPool:
        check_script_guard(workers)
        raise
    except BaseException:
        # End the processes, because their results are no longer needed.
        pool.shutdown(wait=False, cancel_futures=True)
        end_children(active_children())
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        # The semaphores of the pool are released with its last reference.
        del pool


def summarise_plans(plans: Sequence[SeededPlan]) -> list[TableRow]:
    """Return the rows of the paper's table, one for each problem and algorithm, in the order of planning.

    Lengths are None if no plan is safe.
    """
    groups: dict[tuple[int, str], list[SeededPlan]] = {}
    for seeded_plan in plans:
        groups.setdefault((seeded_plan.threats, seeded_plan.algorithm), []).append(seeded_plan)
    rows = []
    for (threats, algorithm), group in groups.items():
        lengths = [seeded_plan.objectives.length_ratio for seeded_plan in group if seeded_plan.safe]
        kills = [seeded_plan.objectives.kill_exposure for seeded_plan in group]
        rows.append(
            TableRow(
                threats=threats,
                algorithm=algorithm,
                runs=len(group),
                safe=sum(seeded_plan.safe for seeded_plan in group),
                certified=sum(seeded_plan.certified for seeded_plan in group),
                length_median=float(np.median(lengths)) if lengths else None,
                length_worst=max(lengths) if lengths else None,
                kill_median=float(np.median(kills)),
                kill_worst=float(max(kills)),
                kill_probability_worst=float(max(seeded_plan.kill_probability for seeded_plan in group)),
                detection_median=float(np.median([seeded_plan.objectives.detection_exposure for seeded_plan in group])),
                seconds_median=float(np.median([seeded_plan.seconds for seeded_plan in group])),
            )
        )
    return rows


# ----------------------------------------------------------------------
# Print the table on the terminal, and write JSON, CSV and figures into a folder.

PAPER_SCHEMA = "planfly.planning.paper/1"
# Files that any command may write; older files of these names are cleared first.
TABLE_FILES = ("table.csv", "runs.csv", "runs.json", "times.csv", "convergence.png")


def paper_file_names(problems: Sequence[int]) -> list[str]:
    """Return the names of all files that are written for some problems.

    problems: numbers of threats, which name the problems.
    """
    pictures = [f"{kind}-{threats:02d}.png" for threats in problems for kind in ("paths", "encodings")]
    return [*TABLE_FILES, *pictures]


def table_text(rows: Sequence[TableRow]) -> str:
    """Return the paper's table as text for a terminal."""
    header = (
        f"{'threats':>7}  {'algorithm':<15}{'safe':>7}{'certified':>11}  {'PLR median':>10}  {'worst':>6}"
        f"  {'PKill median':>12}  {'worst':>6}  {'PRD median':>10}  {'CPU s':>6}"
    )
    lines = [header]
    for row in rows:
        safe, certified = f"{row.safe}/{row.runs}", f"{row.certified}/{row.runs}"
        lines.append(
            f"{row.threats:>7}  {row.algorithm:<15}{safe:>7}{certified:>11}  {_number_text(row.length_median, 4):>10}  "
            f"{_number_text(row.length_worst, 4):>6}  {row.kill_median:>12.3g}  {row.kill_worst:>6.3g}  "
            f"{row.detection_median:>10.3g}  {row.seconds_median:>6.2f}"
        )
    lines += [
        "safe: no violation and no kill exposure at the paper's six points of each leg; certified: safe along the "
        "whole path.",
        "PLR: over the safe runs; PKill and PRD: the paper's sums, over all runs; CPU s: median time of a run.",
    ]
    return "\n".join(lines)


def _number_text(value: float | None, digits: int) -> str:
    """Return a number as text with a number of decimals (`digits`); "-" for None."""
    return "-" if value is None else f"{value:.{digits}f}"


def write_tables(folder: Path, rows: Sequence[TableRow], plans: Sequence[SeededPlan]) -> None:
    """Write table.csv, runs.csv, runs.json and times.csv into a folder.

    Runs with the same seeds differ only in times.csv.
    """
    columns = [field.name for field in fields(TableRow) if field.name != "seconds_median"]
    write_atomically(
        folder / "table.csv", _csv_text(columns, ([getattr(row, name) for name in columns] for row in rows))
    )
    write_atomically(
        folder / "runs.csv", _csv_text(_PLAN_COLUMNS, (list(_plan_row(seeded_plan).values()) for seeded_plan in plans))
    )
    times = (
        [seeded_plan.threats, seeded_plan.algorithm, seeded_plan.seed, f"{seeded_plan.seconds:.3f}"]
        for seeded_plan in plans
    )
    write_atomically(folder / "times.csv", _csv_text(["threats", "algorithm", "seed", "cpu_s"], times))
    table_rows = [{key: value for key, value in asdict(row).items() if key != "seconds_median"} for row in rows]
    runs = [
        _plan_row(seeded_plan)
        | {
            "waypoints_east_north_amsl_m": seeded_plan.waypoints.tolist(),
            "history_length_kill_violations": seeded_plan.history.tolist(),
        }
        for seeded_plan in plans
    ]
    text = json.dumps({"schema": PAPER_SCHEMA, "table": table_rows, "runs": runs}, allow_nan=False, indent=1)
    write_atomically(folder / "runs.json", text + "\n")


def _plan_row(seeded_plan: SeededPlan) -> dict[str, Any]:
    """Return the values of a plan for its row in runs.csv and runs.json, keyed by column."""
    row: dict[str, Any] = {
        "threats": seeded_plan.threats,
        "algorithm": seeded_plan.algorithm,
        "seed": seeded_plan.seed,
        "safe": seeded_plan.safe,
        "certified": seeded_plan.certified,
    }
    row |= {f"violations_{name}": count for name, count in seeded_plan.violations._asdict().items()}
    return row | {
        **seeded_plan.objectives._asdict(),
        "kill_probability": seeded_plan.kill_probability,
        "detection_probability": seeded_plan.detection_probability,
        "evaluations": seeded_plan.evaluations,
    }


_PLAN_COLUMNS = [
    "threats",
    "algorithm",
    "seed",
    "safe",
    "certified",
    *(f"violations_{name}" for name in Violations._fields),
    *Objectives._fields,
    "kill_probability",
    "detection_probability",
    "evaluations",
]


def _csv_text(columns: Sequence[str], rows: Any) -> str:
    """Return CSV text with a header of column names.

    rows: iterable of rows, each with its values in the order of the columns.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return buffer.getvalue()


def write_figures(folder: Path, plans: Sequence[SeededPlan]) -> None:
    """Draw the paper's figures 5-8 (paths) and 9-12 (encodings) as PNG files.

    The convergence over generations is drawn, too.
    """
    from logs.views.drawing import write_png
    from logs.views.paper import PaperPath, draw_convergence, draw_encodings, draw_paths

    by_problem: dict[int, dict[str, list[SeededPlan]]] = {}
    for seeded_plan in plans:
        by_problem.setdefault(seeded_plan.threats, {}).setdefault(seeded_plan.algorithm, []).append(seeded_plan)
    for threats, groups in by_problem.items():
        scenario = load_scenario(problem_name(threats))
        first_algorithm = next(iter(groups))
        lines = {
            name: [
                PaperPath(seeded_plan.waypoints, seeded_plan.objectives.length_ratio, seeded_plan.safe)
                for seeded_plan in group
            ]
            for name, group in groups.items()
        }
        write_png(draw_paths(scenario, first_algorithm, lines[first_algorithm]), folder / f"paths-{threats:02d}.png")
        first_paths = {name: group[0] for name, group in lines.items()}
        write_png(draw_encodings(scenario, first_paths, seed=1), folder / f"encodings-{threats:02d}.png")
    histories = {
        threats: {name: [seeded_plan.history for seeded_plan in group] for name, group in groups.items()}
        for threats, groups in by_problem.items()
    }
    write_png(draw_convergence(histories), folder / "convergence.png")


# ----------------------------------------------------------------------
# Plan, and write everything in one call.


@dataclass(frozen=True, slots=True)
class PaperTables:
    """Result of `planfly.paper_tables`.

    rows: rows of the table, one for each problem and algorithm.
    plans: the plans in the table.
    """

    rows: tuple[TableRow, ...]
    plans: tuple[SeededPlan, ...]


@checks_types
def paper_tables(
    problems: Sequence[int] = PROBLEMS,
    *,
    runs: int = 15,
    algorithm: str = PAPER_ALGORITHM,
    jobs: int | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
) -> PaperTables:
    """Repeat section V of the paper, with seeded plans of its problems in three encodings.

    problems: numbers of threats, out of 7, 15, 30 and 60.
    runs: number of seeds for each problem and algorithm, from 1 on.
    algorithm: name of the algorithm that is planned in addition to the baselines.
    jobs: number of processes; None for one per core.
    out: folder for tables and figures; None writes no files.
    overwrite: True replaces existing results.

    A script must call this function under ``if __name__ == "__main__":``, because its processes import the script.
    Raises a `planfly.PlanflyError` for bad input.
    """
    end_repeated_call()
    check_arguments(problems=tuple(problems), runs=runs, jobs=jobs)
    folder = None if out is None else Path(out)
    if folder is not None:
        check_output_folder(folder, overwrite)
    with stage("planning", "planning the paper's problems") as advance:
        plans = plan_section(problems, runs, algorithm, jobs, advance)
    rows = summarise_plans(plans)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        with lock_path(folder):
            prepare_folder(folder, tuple(paper_file_names(PROBLEMS)))
            write_tables(folder, rows, plans)
            with stage("drawing", "drawing the paper's figures"):
                write_figures(folder, plans)
    return PaperTables(tuple(rows), tuple(plans))
