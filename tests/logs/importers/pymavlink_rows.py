"""What pymavlink alone reads of a dataflash log: rows by message, in its own units."""

from pathlib import Path
from typing import Any

from pymavlink import DFReader

FLIGHTS = Path(__file__).parent / "flights"


def read_rows(path: Path, *names: str) -> dict[str, list[Any]]:
    """All messages of some names."""
    reader = DFReader.DFReader_binary(str(path))
    rows: dict[str, list[Any]] = {name: [] for name in names}
    while (message := reader.recv_match(type=list(names))) is not None:
        rows.setdefault(message.get_type(), []).append(message)
    reader.close()
    return rows


def mission_lines(path: Path) -> list[list[float]]:
    """The numbers of a `.waypoints` file's lines, home first."""
    return [[float(field) for field in line.split()] for line in path.read_text().splitlines()[1:]]
