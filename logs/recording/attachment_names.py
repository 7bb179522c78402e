"""The attachments of a flight log: their names and media types.

`setup.json` lists those that make up the setup; what flights beside it gave, a verdict, a result and a recovery note
come after the flight.
"""

from pathlib import PurePath
from typing import Final

SETUP_FILE: Final = "setup.json"
SCENARIO_FILE: Final = "scenario.json"
PLAN_FILE: Final = "plan.json"
MISSION_FILE: Final = "mission.waypoints"
TERRAIN_FILE: Final = "terrain.json"
BESIDE_FILE: Final = "beside.json"
VERDICT_FILE: Final = "verdict.json"
RESULT_FILE: Final = "result.json"
RECOVERY_FILE: Final = "recovery.json"

_MEDIA_TYPES: Final = {
    ".json": "application/json",
    ".waypoints": "text/plain",
    ".heights": "application/octet-stream",
}


def heights_name(part: int) -> str:
    """Name of a part of the terrain's heights; parts count from 0."""
    return f"terrain-{part:03d}.heights"


def media_type(name: str) -> str:
    """Media type of an attachment, by its name's suffix."""
    return _MEDIA_TYPES[PurePath(name).suffix]
