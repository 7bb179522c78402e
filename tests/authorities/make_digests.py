"""Makes ``digests.json`` from the folders of runs: ``python -m tests.authorities.make_digests FOLDER COMMIT``.

FOLDER holds what these commands left there, each with ``--out FOLDER/NAME``: ``planfly run jacksboro-air --seed 1`` to
3 (jacksboro-air-1 to -3), ``planfly run steep --seed 1`` (steep), ``planfly run tight --seed 1`` (tight) and ``planfly
paper --problems 7,60 --runs 3`` (paper).  Bytes of plan.json hold the scenario's name, which was ``jacksboro`` before.

What `tests.test_same_results` holds every later version to.  The tables of the paper are still those of b610875, the
last commit before modules were moved into their rooms; plans, and with them missions and tracks, are the default
planner's since it shortens paths, and verdicts tell of harm.
"""

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from flight.simulation.track import Track
from logs.recording.reader import read_log

FILE = Path(__file__).with_name("digests.json")
RUNS = {"jacksboro-air-1": 1, "jacksboro-air-2": 2, "jacksboro-air-3": 3, "steep": 1, "tight": 1}
PLAN_FILES = ("plan.json", "mission.waypoints", "mission.plan")
PAPER_FILES = ("runs.csv", "table.csv", "runs.json")
# What a verdict says of each finding: numbers and words.
SAID = (
    *("rule", "where", "planned", "flown", "limit", "limit_source", "tolerance", "margin", "unit", "method", "ok"),
    *("reason", "suggestion"),
)


def digest(data: bytes) -> str:
    """SHA-256 as hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def track_digests(track: Track) -> dict[str, str]:
    """The digest of each of a track's columns."""
    columns = {name: np.ascontiguousarray(getattr(track, name)) for name in Track.__dataclass_fields__}
    return {name: digest(column.tobytes()) for name, column in columns.items()}


def verdict_digest(verdict: dict[str, Any]) -> str:
    """The digest of what a ``verdict.json`` says, whatever else its schema holds."""
    findings = [[finding[key] for key in SAID] for finding in verdict["findings"]]
    said = [verdict["level"], verdict["flyable"], verdict["complete"], verdict["summary"], findings]
    return digest(json.dumps(said).encode())


def run_digests(folder: Path) -> dict[str, Any]:
    """The digests of one run's folder."""
    return {
        **{name: digest((folder / name).read_bytes()) for name in PLAN_FILES},
        "track": track_digests(read_log(folder / "flight.mcap").track),
        "verdict": verdict_digest(json.loads((folder / "verdict.json").read_text(encoding="utf-8"))),
    }


def main() -> None:
    """Write the file."""
    folder, commit = Path(sys.argv[1]), sys.argv[2]
    digests = {
        "commit": commit,
        "runs": {name: run_digests(folder / name) for name in RUNS},
        "paper": {name: digest((folder / "paper" / name).read_bytes()) for name in PAPER_FILES},
    }
    FILE.write_text(json.dumps(digests, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
