"""Seeded plans of the paper's problems: what is planned, and the table and probabilities that they come to."""

import contextlib
import csv
import json
import multiprocessing.util
import os
import signal
from dataclasses import replace
from multiprocessing import resource_tracker
from pathlib import Path

import numpy as np
import pytest

from planfly.planning import paper
from planfly.planning.paper import (
    PROBLEMS,
    STRIP_ALGORITHM,
    STRIP_HALF_WIDTHS_M,
    exposure_probability,
    paper_file_names,
    plan_once,
    plan_section,
    problem_name,
    summarise_plans,
    table_text,
    write_tables,
)
from tests.planfly.made_plans import made_plan
from tests.setups import small_scenario
from world.interruption import Interrupted, interrupt
from world.scenario import load_scenario


def test_the_table_counts_plans_in_the_order_they_were_made() -> None:
    rows = summarise_plans(
        [
            made_plan("a", 1, 1.2, 0.0),
            made_plan("a", 2, 1.1, 0.0),
            made_plan("a", 3, 1.0, 0.5),
            made_plan("b", 1, 1.0, 0.0, bad=1),
        ]
    )
    assert [(row.algorithm, row.runs, row.safe, row.certified) for row in rows] == [("a", 3, 2, 2), ("b", 1, 0, 1)]
    assert rows[0].length_median == pytest.approx(1.15)
    assert (rows[0].length_worst, rows[0].kill_worst, rows[0].detection_median) == (1.2, 0.5, 4.0)
    assert rows[1].length_median is None
    assert problem_name(7) == "paper-07"


def test_probability_of_one_unit_by_hand() -> None:
    unit = {"east_m": 0, "north_m": 500, "amsl_m": 150, "kill_radius_m": 700, "kill_scale_m": 250}
    scenario = small_scenario(threats=[unit], start={"east_m": 0, "north_m": 0, "amsl_m": 150})
    far = np.array([[0.0, 0.0, 150.0], [60_000.0, 0.0, 150.0]])
    # One of the seven points lies within reach, at 500 m: (250 / 500)^4.
    assert exposure_probability(scenario, far, "kill") == pytest.approx(1 / 16)
    assert exposure_probability(scenario, far, "detection") == 0.0
    # Two points at that distance.
    assert exposure_probability(scenario, far[[0, 0]], "kill") == pytest.approx(1 - (15 / 16) ** 7)


def test_runs_of_another_algorithm_stand_beside_the_baselines() -> None:
    done = plan_section([7], 1, "umda-polar", jobs=1)
    assert [item.algorithm for item in done] == [
        "umda-polar",
        "umda-strip",
        "umda-cartesian",
        "umda-polar-45",
        "umda-bearing",
    ]


@pytest.mark.parametrize("threats", PROBLEMS)
def test_only_the_strip_has_a_strip(threats: int) -> None:
    scenario = load_scenario(problem_name(threats))
    assert scenario.planner.algorithm == "umda"
    assert scenario.planner.across_m is None
    start, span = scenario.start[:2], (scenario.destination - scenario.start)[:2]
    aside = plan_once(threats, STRIP_ALGORITHM, 1).waypoints[:, :2] - start
    across = np.abs(span[0] * aside[:, 1] - span[1] * aside[:, 0]) / np.hypot(*span)
    assert across.max() <= STRIP_HALF_WIDTHS_M[threats] + 1e-6


# ----------------------------------------------------------------------
# The paper's table as text, and its tables as files.

PLANS = [made_plan("a", 1, 1.2, 0.0), made_plan("a", 2, 1.1, 0.5), made_plan("b", 1, 1.0, 0.0, bad=1)]


def read_csv(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


def test_the_text_has_a_line_for_each_row_of_the_table() -> None:
    text = table_text(summarise_plans(PLANS)).splitlines()
    # One of a's two plans is safe, of length ratio 1.2; none of b's, so it has no length.
    assert text[1].split()[:6] == ["7", "a", "1/2", "1/2", "1.2000", "1.2000"]
    assert text[2].split()[:6] == ["7", "b", "0/1", "1/1", "-", "-"]
    assert text[0].split()[:4] == ["threats", "algorithm", "safe", "certified"]


def test_a_folder_has_two_pictures_for_each_problem_beside_the_tables() -> None:
    names = paper_file_names([7, 60])
    assert len(names) == len(set(names))
    assert {"paths-07.png", "encodings-07.png", "paths-60.png", "encodings-60.png", "convergence.png"} == {
        name for name in names if name.endswith(".png")
    }


def test_tables_hold_the_plans_and_only_times_csv_their_time(tmp_path: Path) -> None:
    write_tables(tmp_path, summarise_plans(PLANS), PLANS)
    rows = read_csv(tmp_path / "runs.csv")
    assert [(row["algorithm"], row["seed"], row["safe"]) for row in rows] == [
        ("a", "1", "True"),
        ("a", "2", "False"),
        ("b", "1", "False"),
    ]
    assert [float(row["length_ratio"]) for row in rows] == [1.2, 1.1, 1.0]
    assert [float(row["detection_exposure"]) for row in rows] == [2.0, 4.0, 2.0]
    data = json.loads((tmp_path / "runs.json").read_text(encoding="utf-8"))
    assert [run["kill_exposure"] for run in data["runs"]] == [0.0, 0.5, 0.0]
    assert [(row["algorithm"], row["kill_worst"]) for row in data["table"]] == [("a", 0.5), ("b", 0.0)]
    times = read_csv(tmp_path / "times.csv")
    assert [float(row["cpu_s"]) for row in times] == [0.5, 1.0, 0.5]
    slower = [replace(PLANS[0], seconds=99.0)]
    kept = {}
    for folder, plans in (("x", PLANS[:1]), ("y", slower)):
        (tmp_path / folder).mkdir()
        write_tables(tmp_path / folder, summarise_plans(plans), plans)
        kept[folder] = [(tmp_path / folder / name).read_bytes() for name in ("table.csv", "runs.csv", "runs.json")]
    assert kept["x"] == kept["y"]


def test_a_signal_while_processes_start_leaves_none_half_started(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """A process that is started and gets no task ends with a traceback."""
    results = paper._plan_in_processes([(7, "umda", seed) for seed in (1, 2, 3)], 2)
    next(results)
    resource_tracker.ensure_running()
    spawn, started = multiprocessing.util.spawnv_passfds, list[int]()

    def interrupted_spawn(*arguments: object) -> int:
        started.append(spawn(*arguments))
        interrupt(signal.SIGTERM)
        return started[-1]

    monkeypatch.setattr(multiprocessing.util, "spawnv_passfds", interrupted_spawn)
    with pytest.raises(Interrupted):
        next(results)
    for process in started:
        with contextlib.suppress(ChildProcessError):
            os.waitpid(process, 0)
    assert started
    assert capfd.readouterr().err == ""
