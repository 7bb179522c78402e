"""``planfly returns --sitl``: the worst returns by a program; what counts where it and the law disagree."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planfly
from flight.simulation.setup import FlightSetup
from logs.verdict.returns.judge_returns import judge_returns, make_return_world, worst_first_key
from logs.verdict.returns.return_starts import planned_starts
from planfly.cli import main
from planfly.rtl import jsbsim_returns as return_flights
from planfly.rtl import sitl_returns as program_returns
from planfly.rtl.sitl_returns import ProgramReturn, ProgramReturns, choose_worst_returns
from planfly.workflow.open_flight import open_flight
from planfly.workflow.pipeline import FlightTask, FlownMission
from tests.autopilots import need_arduplane, shorten_run_in, write_fake, write_fake_px4
from tests.logs.verdict.returns.hill import SCENARIO, hill_setup, mission_text
from tests.logs.verdict.returns.valley import valley_mission
from tests.soak import SOAK

# A mound, 90 m high, 400 m from home, and a mission behind it at 180 m: a straight slope from there to 100 m over home
# passes it at some 125 m, and what sinks to 20 m at once does not.
_PEAK = "east_m = 400\nnorth_m = 0\nheight_m = 90\nsigma_m = 200\n"
MOUND = SCENARIO.partition("[[terrain.peak]]")[0] + "[[terrain.peak]]\n" + _PEAK


@pytest.fixture
def mound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "mound.toml").write_text(MOUND, encoding="utf-8")
    (tmp_path / "mound.waypoints").write_text(mission_text(1150.0, 1300.0, amsl=180.0), encoding="utf-8")
    (tmp_path / "flat.toml").write_text(MOUND.replace("= 400", "= 8000"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    if not SOAK:
        shorten_run_in(monkeypatch)
        monkeypatch.setattr(return_flights, "LEAD_IN_LENGTH_M", 200.0)
    return tmp_path


ASKED = ["returns", "mound.waypoints", "--scenario", "mound.toml", "--every", "3", "--points", "1", "--json", "a.json"]


@pytest.mark.usefixtures("unrendered")
def test_a_return_that_a_program_flies_as_the_law_does_agrees(
    mound: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Outside the soak by the law itself: a program circles at home for five minutes."""
    if not SOAK:
        fly = program_returns.fly_and_judge

        def by_law(setup: FlightSetup, task: FlightTask) -> FlownMission:
            return fly(setup, replace(task, autopilot=None))

        monkeypatch.setattr(program_returns, "fly_and_judge", by_law)
    flat = [word.replace("mound.toml", "flat.toml") for word in ASKED]
    assert main([*flat, "--sitl", str(write_fake(mound)), "--out", "drawn"]) == 0
    assert " itself: all of them agree with the simulation" in capsys.readouterr().out
    (one,) = json.loads((mound / "a.json").read_text(encoding="utf-8"))["by_program"]["returns"]
    assert (one["agrees"], one["worse"], one["reason"]) == (True, False, "")
    assert one["program"]["kind"] == one["law"]["kind"] == "safe"
    assert one["program"]["target"] == "home"
    # Its log is a flight like any other, which ends in its circle at home.
    assert Path(one["log"]) == Path("drawn/worst-return-1.mcap")
    assert planfly.read_log(mound / one["log"]).ended == "completed"


@pytest.mark.usefixtures("unrendered")
def test_harm_that_a_program_does_counts_where_the_law_does_none(
    mound: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*ASKED, "--sitl", str(write_fake(mound, "dives-home")), "--out", "drawn"]) == 4
    out = capsys.readouterr().out
    assert "1 of 2 returns hits the ground" in out
    program = "1 of the worst returns also flown by ArduPlane V0.0-fake (0badc0de) itself"
    assert f"{program}: 0 of them agree with the simulation; 1 ended worse than in the simulation" in out
    assert "the program's outcome applies, because it is worse" in out
    answer = json.loads((mound / "a.json").read_text(encoding="utf-8"))
    (one,) = answer["by_program"]["returns"]
    assert (one["law"]["kind"], one["program"]["kind"], one["worse"]) == ("safe", "ground", True)
    assert answer["ranges"][0]["kind"] == "ground"
    # On the mound.
    assert 0.0 < answer["ranges"][0]["clearance_east_m"] < 600.0
    assert (mound / "drawn" / "worst-return-1.BIN").read_bytes() == b"\xa3\x95fake"
    assert planfly.read_log(mound / one["log"]).ended == "ground contact"


def test_no_program_but_arduplanes_is_flown(mound: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for program, said in (
        (write_fake_px4(mound), "expected an ArduPlane executable; returns by a real PX4 are not supported"),
        (mound / "none", "no such file"),
    ):
        assert main(["returns", "mound.waypoints", "--sitl", str(program)]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert said in captured.err
        assert len(captured.err.strip().splitlines()) == 1


def test_the_worst_are_far_apart_and_what_is_worse_counts(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    world, starts = make_return_world(setup), planned_starts(setup, 2.0)
    returns = judge_returns(world, starts, 2.0)
    chosen = choose_worst_returns(world, starts, returns, 4)
    assert len(chosen) == 4
    assert chosen[0][0] == min(returns.each, key=worst_first_key)
    east = [one.start[0] for one, _ in chosen]
    # Half of a fourth of 6.5 km.
    assert min(abs(a - b) for k, a in enumerate(east) for b in east[:k]) > 0.95 * 6500.0 / 8.0
    assert all(float(starts.rows[k]["east"]) == one.start[0] for one, k in chosen)
    # 20 m over the ground all the way in, or none begins there.
    buried = replace(starts, rows=starts.rows.copy())
    buried.rows["up"] = 15.0
    assert choose_worst_returns(world, buried, returns, 4) == []
    safe, ground = (next(one for one in returns.each if one.kind == kind) for kind in ("safe", "ground"))
    hit = replace(safe, kind="ground", clearance=-3.0)
    both = ProgramReturns("it", (ProgramReturn(safe, hit), ProgramReturn(ground, replace(ground, kind="safe"))))
    right = both.with_worse_results(returns)
    assert right.count("ground") == returns.count("ground") + 1
    assert right.count("safe") == returns.count("safe") - 1
    assert [one.worse for one in both.pairs] == [True, False]
    assert "the simulated outcome applies, because it is worse" in both.lines(returns, setup.scenario)[1]


def test_a_program_may_fly_a_low_approach(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The required height applies up to the first item of the landing sequence, as in the simulation."""
    fly = program_returns.fly_and_judge
    monkeypatch.setattr(program_returns, "fly_and_judge", lambda setup, task: fly(setup, replace(task, autopilot=None)))
    setup = open_flight(valley_mission(tmp_path), {"terrain": "jacksboro"})
    world, starts = make_return_world(setup).with_parameters(RTL_AUTOLAND=2), planned_starts(setup, 20.0)
    returns = judge_returns(world, starts.subset(np.array([1])), 20.0)
    (pair,) = program_returns.fly_with_autopilot(world, starts, returns, tmp_path / "program", 1, None).pairs
    assert pair.flown is not None
    assert (pair.simulated.kind, pair.flown.kind) == ("safe", "safe")
    assert pair.flown.clearance == pytest.approx(pair.simulated.clearance, abs=15.0)
    assert pair.agrees


@pytest.mark.client
def test_arduplane_returns_as_its_law_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From behind the hill into it, and from before it home."""
    (tmp_path / "hill.toml").write_text(SCENARIO, encoding="utf-8")
    (tmp_path / "hill.waypoints").write_text(mission_text(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    found = planfly.returns("hill.waypoints", scenario="hill.toml", every=10, sitl=need_arduplane(), points=2)
    assert found.by_program is not None
    assert found.by_program.pairs[0].simulated.kind == "ground"
    assert all(one.agrees for one in found.by_program.pairs), found.program_lines
