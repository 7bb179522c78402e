"""Where the tests' flights of a real autopilot are, and the example's plan as a file."""

from pathlib import Path

from flight.mission_files.formats import mission_text
from logs.importers.raw_log import example_raw_log

FLIGHTS = Path(__file__).parents[2] / "logs" / "importers" / "flights"


def example_plan(folder: Path) -> Path:
    """The example's mission as a `.waypoints` file."""
    path = folder / "plan.waypoints"
    path.write_text(mission_text(example_raw_log().missions[0].mission, "waypoints"))
    return path
