"""A container that is cut, damaged, hostile or none is never taken for what was recorded."""

import struct
import tracemalloc
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from mcap.writer import Writer

from flight.simulation.track import Track
from logs.recording.reader import read_log
from tests.logs.log_copies import prefix_of, same
from tests.logs.recording.containers.framing import framed
from tests.soak import SOAK, note, scaled
from world.errors import LogError


def _cuts(size: int, last: int) -> Iterator[int]:
    rng = np.random.default_rng(2)
    if SOAK:
        # Every byte of what stands from its last chunk on, and so many others.
        yield from sorted(rng.integers(0, last, size=scaled(10_000, 60)).tolist())
        yield from range(last, size)
        return
    yield from range(40)
    yield from sorted(rng.integers(40, size, size=60).tolist())
    yield from range(size - 40, size)


def _last_chunk(data: bytes) -> int:
    """Where the last chunk begins."""
    at, last = len(MAGIC), 0
    for opcode, content in framed(data):
        last = at if opcode == 6 else last
        at += 9 + len(content)
    return last


def test_a_truncated_file_gives_its_whole_chunks(tmp_path: Path, log_file: Path, track: Track, setup: Any) -> None:
    data = log_file.read_bytes()
    path = tmp_path / "cut.mcap"
    lengths = []
    for cut in _cuts(len(data), _last_chunk(data)):
        path.write_bytes(data[:cut])
        try:
            log = read_log(path)
        except LogError:
            lengths.append(0)
            continue
        assert not log.complete
        assert log.problem
        prefix_of(track, log.track)
        same(log.setup, setup)
        lengths.append(len(log.track))
    assert lengths == sorted(lengths)
    assert lengths[0] == 0
    assert lengths[-1] == len(track)
    note("log cut", cuts=len(lengths), silent=0)


@pytest.mark.parametrize("finished", [True, False])
def test_no_flipped_bit_is_taken_for_data(
    tmp_path: Path, log_file: Path, track: Track, setup: Any, finished: bool
) -> None:
    whole = bytearray(log_file.read_bytes())
    if not finished:
        del whole[-3000:]
    rng = np.random.default_rng(3)
    path = tmp_path / "bit.mcap"
    # All over the file, and densely in its last part, where the chunks with the rows are.
    # Twice so many, of a finished log and of an unfinished one.
    flips = scaled(25_000, 15)
    positions = [*rng.integers(0, len(whole), size=flips), *rng.integers(len(whole) - 90_000, len(whole), size=flips)]
    for position in [*positions, *range(0, scaled(60, 15))]:
        data = bytearray(whole)
        data[position] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        try:
            log = read_log(path)
        except LogError:
            continue
        assert not log.complete, f"byte {position}"
        prefix_of(track, log.track)
        same(log.setup, setup)
    note(f"log with a flipped bit, finished: {finished}", flips=len(positions) + 60, silent=0)


MAGIC = b"\x89MCAP0\r\n"


def mcap_record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def chunk_record(data: bytes, size: int, crc: int) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, crc) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(data))
    return mcap_record(6, head + data)


@pytest.mark.parametrize("declared", [2**30, 1000])
def test_a_chunk_bomb_is_refused_before_it_grows(tmp_path: Path, declared: int) -> None:
    compressor = zstandard.ZstdCompressor(level=1).compressobj(size=2**30)
    block = bytes(2**22)
    bomb = b"".join(compressor.compress(block) for _ in range(256)) + compressor.flush()
    assert len(bomb) < 120_000
    path = tmp_path / "bomb.mcap"
    header = mcap_record(1, struct.pack("<I", 0) * 2)
    path.write_bytes(MAGIC + header + chunk_record(bomb, declared, 1))
    tracemalloc.start()
    with pytest.raises(LogError, match=r"1,073,741,824 bytes: at most|does not decompress to the 1,000"):
        read_log(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6


def test_many_small_bombs_are_refused(tmp_path: Path) -> None:
    # A record of a kind that readers skip.
    block = mcap_record(0x80, bytes(2**25))
    data = zstandard.ZstdCompressor().compress(block)
    record_ = chunk_record(data, len(block), zlib.crc32(block))
    path = tmp_path / "bombs.mcap"
    path.write_bytes(MAGIC + record_ * 1000)
    with pytest.raises(LogError, match="chunks grow to"):
        read_log(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty"),
        (b"QGC WPL 110\n", "not an MCAP file"),
        (MAGIC, "no complete chunk"),
        (MAGIC + b"\x06" + b"\xff" * 8, "at most 67,108,864 are read"),
        (MAGIC + b"\x00" * 100, "no complete chunk"),
        (MAGIC + mcap_record(9, b"\xff" * 30), "cannot be read"),
        (MAGIC + mcap_record(6, b"\xff" * 30), "cannot be read"),
        (bytes(range(256)) * 50, "not an MCAP file"),
    ],
)
def test_what_is_no_log_is_refused_in_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "bad.mcap"
    path.write_bytes(content)
    with pytest.raises(LogError, match=message) as caught:
        read_log(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("chunked", [False, True])
@pytest.mark.parametrize("holds", ["nothing", "an attachment", "a message"])
def test_a_whole_file_of_others_is_told_as_one(tmp_path: Path, chunked: bool, holds: str) -> None:
    """As the mcap project's own writer writes it."""
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=chunked)
        writer.start(profile="", library="another program")
        if holds == "an attachment":
            writer.add_attachment(1, 1, "camera.txt", "text/plain", b"calibrated")
        if holds == "a message":
            schema = writer.register_schema("text", "jsonschema", b"{}")
            channel = writer.register_channel("/text", "json", schema)
            writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    with pytest.raises(LogError) as caught:
        read_log(path)
    assert str(caught.value) == f"{path}: not a planfly log: an MCAP file without setup.json"
