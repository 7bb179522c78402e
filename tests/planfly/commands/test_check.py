"""``planfly check``: PX4's rules by name, and a climb on the spot, which is judged and not refused."""

import json
from pathlib import Path

import pytest

from planfly.cli import main

MISSIONS = Path(__file__).parents[2] / "flight" / "missions"
MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t100\t1
1\t0\t3\t16\t0\t0\t0\t0\t46.00\t8.00\t200\t1
2\t0\t3\t16\t0\t0\t0\t0\t46.01\t8.00\t200\t1
3\t0\t3\t16\t0\t0\t0\t0\t46.01\t8.00\t{up}\t1
4\t0\t3\t16\t0\t0\t0\t0\t46.02\t8.01\t{up}\t1
"""


@pytest.mark.parametrize(("up", "verb"), [(350, "climbs"), (80, "falls"), (1434, "climbs"), (210.5, "climbs")])
def test_a_climb_on_the_spot_is_judged_and_not_flyable(
    up: float, verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mission = tmp_path / "up.waypoints"
    mission.write_text(MISSION.format(up=up), encoding="utf-8")
    assert main(["check", str(mission), "--json", str(tmp_path / "verdict.json")]) == 4
    verdict = json.loads((tmp_path / "verdict.json").read_text(encoding="utf-8"))
    failed = [item for item in verdict["findings"] if item["ok"] is False]
    assert [(item["rule"], item["where"]) for item in failed] == [("slope", "leg 1")]
    rise, angle = abs(up - 200), "89.9" if up == 210.5 else "90.0"
    assert abs(failed[0]["planned"]) == pytest.approx(float(angle), abs=0.1)
    assert f"leg 1 {verb} {rise:g} m on the spot, {angle}°; at 2" in failed[0]["reason"]
    assert "m long; it goes nowhere now" in failed[0]["suggestion"]
    assert main(["fly", str(mission), "--log", str(tmp_path / "flight.mcap")]) == 4
    assert "on the spot" in capsys.readouterr().out


@pytest.mark.parametrize("up", [201.5, 209.5, 190.5])
def test_a_step_on_the_spot_is_flown_within_its_own_height(up: float, tmp_path: Path) -> None:
    """Ten metres are a step, whatever their slope."""
    mission = tmp_path / "up.waypoints"
    mission.write_text(MISSION.format(up=up), encoding="utf-8")
    assert main(["check", str(mission)]) == 0


def test_check_names_px4s_rules(tmp_path: Path) -> None:
    target = tmp_path / "v.json"
    assert main(["check", str(MISSIONS / "mission_planner_land.waypoints"), "--json", str(target)]) == 4
    findings = json.loads(target.read_text())["findings"]
    reasons = {item["reason"]: item["ok"] for item in findings if item["rule"] == "mission" and item["ok"] is not True}
    # A landing steeper than PX4's parameter has it is PX4's to refuse; a spline no fixed wing's autopilot flies.
    assert [ok for reason, ok in reasons.items() if "(PX4 checkFixedWindLandApproach)" in reason] == [None]
    assert [ok for reason, ok in reasons.items() if "(PX4 checkMissionItemValidity)" in reason] == [False]
