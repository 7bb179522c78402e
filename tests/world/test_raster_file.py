"""An .npz file that is odd, damaged or too large is refused in one line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.world.made.elevation_files import WEST, assert_refused, write_npz


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"ymax": None}, "ymax: missing"),
        ({"elevation": None}, "elevation: missing"),
        ({"elevation": np.zeros(9)}, "2-D"),
        ({"elevation": np.zeros((1, 9))}, "2-D"),
        ({"elevation": np.array([["a", "b"], ["c", "d"]])}, "2-D"),
        ({"elevation": np.zeros((3, 3), dtype=complex)}, "2-D"),
        ({"elevation": np.array([[{}, {}], [{}, {}]])}, "not a readable"),  # a pickle
        ({"xmin": np.nan}, "degrees"),
        ({"xmin": WEST + 1.0, "xmax": WEST + 1.0}, "degrees"),
        ({"ymax": 460.0}, "degrees"),
        ({"xmin": np.zeros(4)}, "not a readable"),
        ({"xmin": "west"}, "not a readable"),
    ],
)
def test_odd_npz_files(changes: dict[str, Any], match: str, tmp_path: Path) -> None:
    assert_refused(write_npz(tmp_path / "t.npz", **changes), match)


def test_damaged_and_bloated_npz(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_npz(tmp_path / "t.npz")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    (tmp_path / "bad.npz").write_bytes(data)
    assert_refused(tmp_path / "bad.npz", "not a readable")
    (tmp_path / "half.npz").write_bytes(data[: len(data) // 2])
    assert_refused(tmp_path / "half.npz", "not a readable")
    monkeypatch.setattr("world.raster_file.MOST_PIXELS", 1_000_000)
    np.savez_compressed(tmp_path / "bomb.npz", elevation=np.zeros((1001, 1000)), xmin=0, xmax=1, ymin=0, ymax=1)
    assert_refused(tmp_path / "bomb.npz", "unpacked: at most")
