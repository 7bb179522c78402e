from pathlib import Path

import numpy as np

from logs.importers.dataflash_frames import PIECE_BYTES, MappedFile, index_dataflash, iterate_piece_ends
from tests.logs.importers.written_logs import dataflash


def test_what_was_let_go_of_is_read_anew(tmp_path: Path) -> None:
    path = tmp_path / "a.BIN"
    wanted = np.random.default_rng(1).integers(0, 256, 100_000, dtype=np.uint8)
    path.write_bytes(wanted.tobytes())
    file = MappedFile(path)
    assert np.array_equal(file.data, wanted)
    file.release_memory()
    assert np.array_equal(file.data, wanted)


def test_each_piece_is_let_go_of() -> None:
    calls: list[int] = []
    ends = list(iterate_piece_ends(2 * PIECE_BYTES + 5, lambda: calls.append(1)))
    assert ends == [PIECE_BYTES, 2 * PIECE_BYTES, 2 * PIECE_BYTES + 5]
    assert len(calls) == 3


NAMES = ("POS", "ATT", "MSG")


def index_of(data: bytes):
    return index_dataflash(np.frombuffer(data, np.uint8), NAMES)


def test_every_message_is_found(tmp_path: Path) -> None:
    found = index_of(dataflash(tmp_path / "a.BIN").read_bytes())
    assert len(found.messages("POS")) == 460
    assert found.messages("MSG").texts("Message") == ["ArduPlane V4.5.0 (abcdef)"]
    assert not found.damage.lossy
    assert not found.damage.cut
    # Of what was not asked for only the name is known.
    assert len(found.messages("GPS")) == 0
    assert "GPS" in found.names


def test_a_message_that_is_cut_out_in_part_is_lost_and_told(tmp_path: Path) -> None:
    data = dataflash(tmp_path / "a.BIN").read_bytes()
    at = len(data) // 2
    found = index_of(data[:at] + data[at + 10 :])
    assert found.damage.places == 1
    assert 0 < found.damage.size < 200
    assert len(found.messages("POS")) >= 459


def test_a_log_that_ends_within_a_message_says_so(tmp_path: Path) -> None:
    data = dataflash(tmp_path / "a.BIN").read_bytes()
    assert index_of(data[:-5]).damage.cut
    assert not index_of(data[:-5]).damage.lossy


def test_the_rest_of_the_last_page_is_no_damage(tmp_path: Path) -> None:
    data = dataflash(tmp_path / "a.BIN").read_bytes()
    assert not index_of(data + b"\xff" * 200).damage.lossy
    assert index_of(data + b"\xff" * 2000).damage.lossy


def test_a_format_that_is_none_is_left_out_and_counted(tmp_path: Path) -> None:
    data = bytearray(dataflash(tmp_path / "a.BIN").read_bytes())
    at = data.index(b"ATT\x00Qccc")
    data[at + 4 : at + 8] = b"????"
    found = index_of(bytes(data))
    assert found.damage.unreadable == 1
    assert len(found.messages("ATT")) == 0
    assert len(found.messages("POS")) == 460


def test_a_log_without_a_wanted_message_is_empty(tmp_path: Path) -> None:
    data = np.fromfile(dataflash(tmp_path / "a.BIN"), np.uint8)
    assert index_dataflash(data, ("IMU",)).starts == {}
