"""A written log's attachments are named and typed as this module has it."""

from pathlib import Path

import pytest
from mcap.reader import make_reader

from logs.recording import attachment_names as names


def test_a_log_holds_exactly_these(log_file: Path) -> None:
    with log_file.open("rb") as file:
        found = {one.name: one.media_type for one in make_reader(file).iter_attachments()}
    assert found == {
        "setup.json": "application/json",
        "scenario.json": "application/json",
        "plan.json": "application/json",
        "mission.waypoints": "text/plain",
        "terrain.json": "application/json",
        "terrain-000.heights": "application/octet-stream",
        "verdict.json": "application/json",
        "result.json": "application/json",
    }
    fixed = {
        names.SETUP_FILE,
        names.SCENARIO_FILE,
        names.PLAN_FILE,
        names.MISSION_FILE,
        names.TERRAIN_FILE,
        names.VERDICT_FILE,
        names.RESULT_FILE,
    }
    assert fixed | {names.heights_name(0)} == set(found)
    assert names.RECOVERY_FILE not in found


def test_parts_of_the_terrain_sort_in_their_order() -> None:
    parts = [names.heights_name(part) for part in range(120)]
    assert sorted(parts) == parts
    assert len(set(parts)) == 120


def test_a_name_of_no_kind_has_no_media_type() -> None:
    with pytest.raises(KeyError):
        names.media_type("picture.png")
