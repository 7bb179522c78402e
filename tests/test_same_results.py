"""The same plans, missions, tracks and verdicts as digests kept of earlier versions say, byte for byte."""

import json
from pathlib import Path
from typing import Any

import pytest

import planfly
from flight.mission_files.formats import mission_text
from logs.recording.reader import read_log
from logs.verdict.verdict import verdict_json
from planfly.cli import main
from planner.plan import plan_json
from tests.authorities.make_digests import FILE, PAPER_FILES, RUNS, digest, track_digests, verdict_digest
from tests.soak import SOAK

KEPT: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", [name for name in RUNS if SOAK or name not in ("jacksboro-air-2", "jacksboro-air-3")])
def test_plan_missions_track_and_verdict_of_a_run(name: str, tmp_path: Path) -> None:
    log = tmp_path / "flight.mcap"
    done = planfly.plan_then_fly(name.removesuffix(f"-{RUNS[name]}"), seed=RUNS[name], log=log)
    kept = KEPT["runs"][name]
    assert done.plan.safe
    assert done.verdict.flyable is name.startswith("jacksboro"), done.verdict.summary
    assert digest(plan_json(done.plan).encode()) == kept["plan.json"]
    assert digest(mission_text(done.mission, "waypoints").encode()) == kept["mission.waypoints"]
    assert digest(mission_text(done.mission, "plan").encode()) == kept["mission.plan"]
    assert track_digests(read_log(log).track) == kept["track"]
    assert verdict_digest(json.loads(verdict_json(done.verdict))) == kept["verdict"]


@pytest.mark.skipif(
    not SOAK,
    reason="tables of one of these problems are compared byte for byte in the tests of the command: in make soak",
)
def test_tables_of_the_paper(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The figures are no table, and take longer than they do.
    monkeypatch.setattr("planfly.planning.paper.write_figures", lambda *_: None)
    assert main(["paper", "--problems", "7,60", "--runs", "3", "--out", str(tmp_path / "paper")]) == 0
    assert {name: digest((tmp_path / "paper" / name).read_bytes()) for name in PAPER_FILES} == KEPT["paper"]
