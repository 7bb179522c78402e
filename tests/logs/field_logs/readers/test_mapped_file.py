from pathlib import Path

import numpy as np

from logs.field_logs.readers.mapped_file import PIECE, MappedFile, pieces


def test_what_was_let_go_of_is_read_anew(tmp_path: Path) -> None:
    path = tmp_path / "a.BIN"
    wanted = np.random.default_rng(1).integers(0, 256, 100_000, dtype=np.uint8)
    path.write_bytes(wanted.tobytes())
    file = MappedFile(path)
    assert np.array_equal(file.data, wanted)
    file.let_go()
    assert np.array_equal(file.data, wanted)


def test_each_piece_is_let_go_of() -> None:
    calls: list[int] = []
    ends = list(pieces(2 * PIECE + 5, lambda: calls.append(1)))
    assert ends == [PIECE, 2 * PIECE, 2 * PIECE + 5]
    assert len(calls) == 3
