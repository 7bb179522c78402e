"""``--flights N`` of `planfly plan` and `planfly run`: dispersed flights of the finished plan."""

import json
from pathlib import Path
from typing import Any

import pytest

import planfly
from planfly import CampaignResult, Plan
from planfly.cli import main
from planner.plan import read_plan


def plan_answer(tmp_path: Path, *argv: str) -> tuple[int, dict[str, Any]]:
    answer = tmp_path / "answer.json"
    code = main(["plan", *argv, "--out", str(tmp_path / "plan.json"), "--overwrite", "--json", str(answer)])
    return code, json.loads(answer.read_text(encoding="utf-8"))


def test_a_plan_that_does_not_hold_ends_with_4(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The aircraft cannot turn as `tight` requires: none of 4 flights, so that P is at most 0.60 at 95 %.

    1 - 0.025^(1/4) = 0.602.
    """
    code, answer = plan_answer(tmp_path, "tight", "--flights", "4")
    text = capsys.readouterr().out
    assert code == 4
    assert answer["safe"] is True
    assert answer["exit_code"] == 4
    dispersed = answer["dispersed"]
    assert isinstance(dispersed, dict)
    assert (dispersed["flights"], dispersed["flyable"], dispersed["holds"]) == (4, 0, False)
    assert dispersed["interval"] == [0.0, pytest.approx(0.602, abs=0.001)]
    assert {entry["rule"] for entry in dispersed["failed_by_rule"]} >= {"turn"}
    assert (
        "the plan succeeds in 0 of 4 flights with the default dispersions (95 % interval of the probability:"
        " 0.00 to 0.60)"
    ) in text
    assert "; a probability of 0.95 is required" in text
    assert "would help  " in text
    assert "without dispersions" not in text


def test_without_flights_a_plan_says_that_it_is_not_judged_over_dispersions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, answer = plan_answer(tmp_path, "jacksboro-air")
    assert code == 0
    assert (answer["dispersed"], answer["expected_failures"]) == (None, [])
    assert "without dispersions" in "\n".join(capsys.readouterr().out.splitlines()[:6])


def test_a_safe_plan_beyond_the_aircraft_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, answer = plan_answer(tmp_path, "steep")
    assert code == 0
    (text,) = answer["expected_failures"]
    assert f"  note    {text}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("argv", "word"),
    [
        (("plan", "tight", "--front", "3", "--flights", "4"), "--front"),
        (("run", "tight", "--sitl", "arduplane", "--flights", "4"), "--sitl"),
        (("plan", "tight", "--flights", "0"), "--flights"),
    ],
)
def test_flights_that_cannot_be_flown_are_refused_before_anything_is_planned(
    argv: tuple[str, ...], word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = main([*argv, "--out", str(tmp_path / "out")])
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    assert code == 2
    assert word in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("blank_pictures")
def test_a_run_flies_its_last_plan_within_the_limits_of_the_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--refine 1` plans `tight` again within the aircraft's turns; the scenario allows 135 degrees."""
    flown: list[Plan] = []
    campaign = planfly.campaign

    def spy(plan: Plan, *, flights: int) -> CampaignResult:
        flown.append(plan)
        return campaign(plan, flights=flights)

    monkeypatch.setattr(planfly, "campaign", spy)
    out = tmp_path / "run"
    assert main(["run", "tight", "--refine", "1", "--flights", "2", "--out", str(out)]) == 4
    assert "flights   the plan succeeds in " in capsys.readouterr().out
    (plan,) = flown
    written = read_plan(out / "plan.json")
    assert (plan.waypoints == written.waypoints).all()
    assert plan.scenario.limits.max_turn_deg == 135.0
    assert written.scenario.limits.max_turn_deg == "aircraft"
