"""Campaigns of drawn missions with returns, loiters, jumps and flights that end early: each ends in a report.

The flights of one campaign differ in their legs: circles of a loiter, laps of a jump, the place of an early end.
"""

import json
from pathlib import Path

import pytest

from planfly.cli import main
from tests.planfly.test_check_agrees_with_fly import draw_mission
from tests.soak import only_in_soak

FIRST_SEED = 6500
CAMPAIGN_COUNT = 20
FLIGHT_COUNT = 6
LOITER_ITEM = "19 30 0 150 0"
JUMP_ITEM = "177 2 1 0 0 0 0 0"
RTL_ITEM = "20 0 0 0 0 0 0 0"


def draw_campaign_mission(seed: int) -> tuple[str, str]:
    """Return a drawn mission that holds one kind of item that varies the legs, and its autopilot.

    The kinds take turns: a return, a loiter and a return, a jump and a return, and the mission as drawn, whose flights
    often end early.
    """
    text, autopilot = draw_mission(seed)
    lines = text.splitlines()
    kind = seed % 4
    if kind == 1:
        number, _, rest = lines[3].split(" ", 2)
        lines[3] = f"{number} 0 {rest.replace('0 16 0 0 0 0', '0 ' + LOITER_ITEM, 1)}"
    if kind == 2:
        lines.append(f"{len(lines) - 1} 0 2 {JUMP_ITEM} 1")
    if kind < 3 and not any(f" {RTL_ITEM} " in line for line in lines):
        lines.append(f"{len(lines) - 1} 0 0 {RTL_ITEM} 1")
    return "\n".join(lines) + "\n", autopilot


@only_in_soak
@pytest.mark.parametrize("seed", range(FIRST_SEED, FIRST_SEED + CAMPAIGN_COUNT))
def test_a_campaign_of_a_drawn_mission_ends_in_a_report_of_all_flights(tmp_path: Path, seed: int) -> None:
    text, autopilot = draw_campaign_mission(seed)
    mission, folder, answer = tmp_path / "drawn.waypoints", tmp_path / "campaign", tmp_path / "answer.json"
    mission.write_text(text, encoding="utf-8")
    options = ["--terrain", "jacksboro", "--autopilot", autopilot, "--turbulence", "light", "--workers", "1"]
    code = main(
        [
            "campaign",
            str(mission),
            *options,
            "--flights",
            str(FLIGHT_COUNT),
            "--out",
            str(folder),
            "--json",
            str(answer),
        ]
    )
    assert code == 0, text
    counts = json.loads(answer.read_text(encoding="utf-8"))
    assert counts["flights"] == FLIGHT_COUNT
    report = (folder / "report.html").read_text(encoding="utf-8")
    assert f"{FLIGHT_COUNT} flights" in report
