"""Missions from a field behind a ridge of the demo's terrain, on the command line: up from it, down to it."""

from pathlib import Path

import pytest

from planfly.cli import main
from tests.planfly.terminal.answers.checked_answers import answered

HOME = "36.2726545 -84.2614207"
# 2.5 and 4.5 km from home to the north-west, 80 m and more over the ridge between: 200 m higher than the steepest climb
# from home, 1.15 km away.
NEAR, FAR = "36.2861601 -84.2836927", "36.2969616 -84.3015158"
MISSIONS = {
    # It ends in an unlimited loiter: the return over the ridge would hit the ground.
    "air": (f"3 16 0 0 0 0 {NEAR} 517", f"3 17 0 0 250 0 {FAR} 517"),
    "take-off": ("3 22 15 0 0 0 0 0 517", f"3 16 0 0 0 0 {NEAR} 517", f"3 16 0 0 0 0 {FAR} 517"),
    "landing": (f"3 16 0 0 0 0 {FAR} 517", f"3 16 0 0 0 0 {NEAR} 300", f"3 21 0 0 0 0 {HOME} 0"),
}


@pytest.fixture
def mission(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    rows = [f"0 16 0 0 0 0 {HOME} 557", *MISSIONS[request.param]]
    file = tmp_path / "ridge.waypoints"
    file.write_text("\n".join(["QGC WPL 110", *(f"{k} 0 {row} 1" for k, row in enumerate(rows))]), encoding="utf-8")
    return str(file)


@pytest.mark.parametrize("mission", ["air"], indirect=True)
def test_a_first_waypoint_behind_a_ridge_is_not_judged_in_full(
    mission: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = "not judged in full: the flight starts in the air, but a straight climb from home to item 1 hits the ground"
    assert main(["check", mission, "--terrain", "jacksboro"]) == 3
    assert capsys.readouterr().out.splitlines()[0] == first
    assert main(["fly", mission, "--terrain", "jacksboro", "--levels", "--log", str(tmp_path / "f.mcap")]) == 3
    out = capsys.readouterr().out
    assert out.splitlines()[0] == first
    assert (
        "  open    climb-out at waypoint 0 (item 1): the flight starts in the air, but a straight climb from home"
        in out
    )
    # The flight itself is well: no autopilot is blamed.
    assert "The aircraft can" not in out
    assert "Without the autopilot (planfly's guidance, exact navigation): flyable in the air; both flights agree" in out
    assert main(["check", str(tmp_path / "f.mcap")]) == 3


@pytest.mark.parametrize("mission", ["air"], indirect=True)
def test_the_answer_counts_returns_by_outcome(mission: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The line of returns beside the verdict states the same numbers; returns over the ridge hit the ground."""
    answer = answered(capsys, 3, "check", "--geometry", mission, "--terrain", "jacksboro")
    returns = answer["returns"]
    assert returns["outcomes"]["ground"] > 0
    assert sum(returns["outcomes"].values()) == returns["returns"]
    assert returns["line"].startswith(f"all {returns['outcomes']['ground']} returns hit the ground")


@pytest.mark.parametrize(
    ("mission", "said"),
    [
        ("take-off", "climb-out at waypoint 0, item 1 (the climb from home towards item 2 hits the ground)"),
        ("landing", "approach at waypoint 2, item 3 (the glide to item 3 hits the ground)"),
    ],
    indirect=["mission"],
)
def test_a_climb_out_and_a_glide_into_a_ridge_are_not_flyable(
    mission: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", "--geometry", mission, "--terrain", "jacksboro"]) == 4
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("not flyable: ")
    assert said in first
