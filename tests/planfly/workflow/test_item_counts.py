"""Missions of more items than a common board stores: a note, for the autopilot that flies."""

from typing import Any

import pytest

from flight.mission.items import Mission, MissionItem
from planfly.workflow.open_flight import _item_count_notes


@pytest.mark.parametrize(
    ("dialect", "count", "limit"),
    # `StorageManager` of ArduPilot on a Pixhawk; `NUM_MISSIONS_SUPPORTED` of PX4; planfly's own guidance has no board.
    [("ardupilot", 724, None), ("ardupilot", 725, 724), ("px4", 500, None), ("px4", 501, 500), ("planfly", 9000, None)],
)
def test_a_mission_that_a_common_board_does_not_store_is_noted(dialect: Any, count: int, limit: int | None) -> None:
    items = tuple(MissionItem(k, 16, 3, (0.0, 0.0, 0.0, 0.0), 46.0, 8.0, 100.0) for k in range(count))
    notes = _item_count_notes(Mission(None, items), dialect)
    assert len(notes) == (limit is not None)
    assert all(note.startswith(f"{count} items: ") and f" stores {limit}," in note for note in notes)
