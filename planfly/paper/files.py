"""What ``planfly paper`` leaves: the table on the terminal, and JSON, CSV and figures in a folder."""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from planfly.paper.seeded_plans import SeededPlan, TableRow, problem_name
from planner.plan import Objective, Violation
from world.atomic_files import write_whole
from world.scenario import load_scenario

PAPER_SCHEMA = "planfly.paper/1"
# Files that any command may write; older ones of these names are cleared first.
FILES = ("table.csv", "runs.csv", "runs.json", "times.csv", "convergence.png")


def file_names(problems: Sequence[int]) -> list[str]:
    """Every file of a folder for these problems."""
    pictures = [f"{kind}-{threats:02d}.png" for threats in problems for kind in ("paths", "encodings")]
    return [*FILES, *pictures]


def table_text(rows: Sequence[TableRow]) -> str:
    """The table for a terminal."""
    head = (
        f"{'threats':>7}  {'algorithm':<15}{'safe':>7}{'certified':>11}  {'PLR median':>10}  {'worst':>6}"
        f"  {'PKill median':>12}  {'worst':>6}  {'PRD median':>10}  {'CPU s':>6}"
    )
    lines = [head]
    for row in rows:
        safe, certified = f"{row.safe}/{row.runs}", f"{row.certified}/{row.runs}"
        lines.append(
            f"{row.threats:>7}  {row.algorithm:<15}{safe:>7}{certified:>11}  {_number(row.length_median, 4):>10}  "
            f"{_number(row.length_worst, 4):>6}  {row.kill_median:>12.3g}  {row.kill_worst:>6.3g}  "
            f"{row.detection_median:>10.3g}  {row.seconds_median:>6.2f}"
        )
    lines += [
        "safe: no violation and no kill exposure on the paper's six points a leg; certified: so along the whole path.",
        "PLR: of the safe runs; PKill and PRD: the paper's sums, of all runs; CPU s: median of one run.",
    ]
    return "\n".join(lines)


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def write_tables(folder: Path, rows: Sequence[TableRow], plans: Sequence[SeededPlan]) -> None:
    """table.csv, runs.csv and runs.json, the same bytes for the same seeds; times.csv, which is not."""
    columns = [item.name for item in fields(TableRow) if item.name != "seconds_median"]
    write_whole(folder / "table.csv", _csv(columns, ([getattr(row, name) for name in columns] for row in rows)))
    write_whole(folder / "runs.csv", _csv(_PLAN_COLUMNS, (list(_plan_row(item).values()) for item in plans)))
    times = ([item.threats, item.algorithm, item.seed, f"{item.seconds:.3f}"] for item in plans)
    write_whole(folder / "times.csv", _csv(["threats", "algorithm", "seed", "cpu_s"], times))
    kept = [{key: value for key, value in asdict(row).items() if key != "seconds_median"} for row in rows]
    runs = [
        _plan_row(item)
        | {
            "waypoints_east_north_amsl_m": item.waypoints.tolist(),
            "history_length_kill_violations": item.history.tolist(),
        }
        for item in plans
    ]
    text = json.dumps({"schema": PAPER_SCHEMA, "table": kept, "runs": runs}, allow_nan=False, indent=1)
    write_whole(folder / "runs.json", text + "\n")


def _plan_row(item: SeededPlan) -> dict[str, Any]:
    row: dict[str, Any] = {
        "threats": item.threats,
        "algorithm": item.algorithm,
        "seed": item.seed,
        "safe": item.safe,
        "certified": item.certified,
    }
    row |= {f"violations_{kind.name.lower()}": item.violations[kind] for kind in Violation}
    row |= {kind.name.lower(): item.objectives[kind] for kind in Objective}
    return row | {
        "kill_probability": item.kill_probability,
        "detection_probability": item.detection_probability,
        "evaluations": item.evaluations,
    }


_PLAN_COLUMNS = [
    "threats",
    "algorithm",
    "seed",
    "safe",
    "certified",
    *(f"violations_{kind.name.lower()}" for kind in Violation),
    *(kind.name.lower() for kind in Objective),
    "kill_probability",
    "detection_probability",
    "evaluations",
]


def _csv(columns: Sequence[str], rows: Any) -> str:
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return buffer.getvalue()


def write_figures(folder: Path, plans: Sequence[SeededPlan]) -> None:
    """Figures as the paper's 5-8 (paths), 9-12 (encodings) and the convergence over generations."""
    from logs.figures.draw_all import write_png
    from logs.figures.paper import PaperPath, draw_convergence, draw_encodings, draw_paths

    by_problem: dict[int, dict[str, list[SeededPlan]]] = {}
    for item in plans:
        by_problem.setdefault(item.threats, {}).setdefault(item.algorithm, []).append(item)
    for threats, groups in by_problem.items():
        scenario = load_scenario(problem_name(threats))
        first = next(iter(groups))
        lines = {
            name: [PaperPath(item.waypoints, item.objectives[Objective.LENGTH_RATIO], item.safe) for item in group]
            for name, group in groups.items()
        }
        write_png(draw_paths(scenario, first, lines[first]), folder / f"paths-{threats:02d}.png")
        chosen = {name: group[0] for name, group in lines.items()}
        write_png(draw_encodings(scenario, chosen, seed=1), folder / f"encodings-{threats:02d}.png")
    histories = {
        threats: {name: [item.history for item in group] for name, group in groups.items()}
        for threats, groups in by_problem.items()
    }
    write_png(draw_convergence(histories), folder / "convergence.png")
