"""``planfly run --refine N``: tighten, plan and fly again, keep every round."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flight.mission.from_plan import plan_mission
from logs.verdict.findings import make_finding
from logs.verdict.judge_flight import judge_flight
from logs.verdict.places import FLIGHT, Place
from logs.verdict.verdict import Verdict
from planfly.cli import main
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import make_setup
from planfly.workflow.tighten_plan import NEXT_ROUND_REMARK, refine, tighten_limits
from planfly.workflow.uav import load_uav
from tests.planfly.conftest import FIELD
from tests.synthetic import fly_path
from world.scenario import Scenario, scenario_from_spec

HILL = """\
name = "hill"
[terrain]
kind = "peaks"
@@PEAKS@@
[area]
east_m = [-500, 6000]
north_m = [-3000, 3000]
ceiling_amsl_m = 1000
[start]
east_m = 0
north_m = 0
amsl_m = 120
[destination]
east_m = 5500
north_m = 0
amsl_m = 200
[limits]
max_climb_deg = 30
max_turn_deg = 40
min_clearance_m = 60
"""


# A ridge with a way round its northern end, 1.5 km off the straight line.
RIDGE = "".join(
    f"[[terrain.peak]]\neast_m = 1500\nnorth_m = {north}\nheight_m = 180\nsigma_m = 350\n"
    for north in range(-4200, 1201, 300)
)


def rounds_of(folder: Path) -> list[dict[str, object]]:
    loaded = json.loads((folder / "rounds.json").read_text(encoding="utf-8"))
    assert isinstance(loaded, list)
    return loaded


@pytest.mark.usefixtures("blank_pictures")
def test_a_plan_over_the_hill_becomes_one_round_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "hill.toml").write_text(HILL.replace("@@PEAKS@@\n", RIDGE), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["run", str(tmp_path / "hill.toml"), "--out", str(out), "--refine", "3", "--guidance", "path"]) == 0
    rounds = rounds_of(out)
    assert 2 <= len(rounds) <= 4
    assert rounds[0]["flyable"] is False
    assert rounds[-1]["flyable"] is True
    assert rounds[-1]["next"] == "done: the plan is flyable"
    assert "limits.max_climb_deg: 30.0 to aircraft" in str(rounds[1]["changes"])
    assert json.loads((out / "verdict.json").read_text(encoding="utf-8"))["flyable"] is True
    for number in range(len(rounds) - 1):
        kept = json.loads((out / f"round-{number}" / "verdict.json").read_text(encoding="utf-8"))
        assert kept["flyable"] is False
        assert (out / f"round-{number}" / "flight.mcap").exists()
    # The scenario that a round is judged in stays the one given; only the planning is tightened.
    plan = json.loads((out / "plan.json").read_text(encoding="utf-8"))
    assert plan["scenario"]["limits"]["max_climb_deg"] == "aircraft"
    assert "rounds\n" in capsys.readouterr().out
    # Run again, the old rounds are cleared away, whatever else lies there stays.
    (out / "mine.txt").write_text("keep", encoding="utf-8")
    (tmp_path / "field.toml").write_text(f"{FIELD}[planner]\npopulation = 20\ngenerations = 5\n", encoding="utf-8")
    assert main(["run", str(tmp_path / "field.toml"), "--out", str(out), "--overwrite"]) == 0
    assert (out / "mine.txt").exists()
    assert not list(out.glob("round*"))


# A cylinder south of the straight line, 20 m less than its radius away.
MILL = {"name": "mill", "kind": "exclusion", "east_m": 2500.0, "north_m": -480.0, "radius_m": 500.0}
FLAT = {
    "name": "edge",
    "terrain": {"kind": "flat", "amsl_m": 0.0},
    "area": {"east_m": [-500.0, 6000.0], "north_m": [-3000.0, 3000.0], "ceiling_amsl_m": 600.0},
    "start": {"east_m": 0.0, "north_m": 0.0, "amsl_m": 150.0},
    "destination": {"east_m": 5000.0, "north_m": 0.0, "amsl_m": 150.0},
    "limits": {"min_clearance_m": 60.0, "max_height_m": 300.0},
    "flight": {"autopilot": "planfly"},
    "zones": [MILL],
}


def test_an_autopilot_that_strays_into_a_zones_edge_is_given_more_room() -> None:
    """It flies 16 m south of any plan, whose certificate keeps 10 m and whose search 15 m."""
    scenario = scenario_from_spec(FLAT, "edge")
    uav = load_uav(scenario)
    kept = []

    def one_round(planned_in: Scenario) -> tuple[Verdict, bool]:
        plan = make_plan(planned_in, uav, 1)
        setup = make_setup(scenario, uav, plan_mission(plan, uav.airspeed, uav.max_bank), 1, plan=plan)
        track = fly_path(setup)
        track = replace(track, position=track.position - np.array([0.0, 16.0, 0.0]))
        away = np.hypot(track.position[:, 0] - MILL["east_m"], track.position[:, 1] - MILL["north_m"])
        kept.append(float(away.min()) - MILL["radius_m"])
        verdict = judge_flight(setup, track, "completed")
        fence = tuple(item for item in verdict.findings if item.rule == "fence")
        return replace(verdict, findings=fence, flyable=all(item.ok for item in fence)), True

    _, rounds = refine(scenario, 3, one_round, lambda _: None)
    assert [entry["flyable"] for entry in rounds] == [False, True]
    assert kept[0] < 0.0 < kept[1]
    assert rounds[0]["next"] == NEXT_ROUND_REMARK
    # Ten metres, what it flew inside, and five more.
    wanted = round(10.0 - kept[0] + 5.0, 1)
    assert rounds[1]["changes"] == [f"planner.zone_margin_m: 10 to {wanted:g}"]
    assert kept[1] == pytest.approx(wanted + 5.0 - 16.0, abs=3.0)


@pytest.mark.parametrize(("planned", "tightened"), [(0.0, True), (0.01, True), (0.03, False)])
def test_a_plan_that_enters_the_zone_itself_is_no_reason_for_more_room(planned: float, tightened: bool) -> None:
    finding = make_finding(
        "fence", Place("exclusion", 0, name="mill"), ok=False, reason="", planned=planned, margin=-3.0
    )
    planned_in, changes = tighten_limits(
        scenario_from_spec(FLAT, "edge"), Verdict((finding,), False, True, ("",), "flown")
    )
    assert [(change.what, change.current, change.wanted) for change in changes] == (
        [("zone_margin_m", 10.0, 18.0)] if tightened else []
    )
    assert planned_in.planner.zone_margin_m == (18.0 if tightened else None)


@pytest.mark.parametrize(("over", "wanted"), [(3.0, 292.0), (234.0, 61.0), (236.0, None)])
def test_what_flew_too_high_is_planned_lower_as_far_as_there_is_room(over: float, wanted: float | None) -> None:
    finding = make_finding("height", FLIGHT, ok=False, reason="", margin=-over)
    planned_in, changes = tighten_limits(
        scenario_from_spec(FLAT, "edge"), Verdict((finding,), False, True, ("",), "flown")
    )
    assert [change.wanted for change in changes] == ([] if wanted is None else [wanted])
    assert planned_in.limits.max_height_m == (wanted or 300.0)
