"""Sizes that lie in a `.ulg`: formats without end, arrays, topics, and the lengths of keys and records."""

import contextlib
import struct
import time
from pathlib import Path

import numpy as np
import pytest

from logs.importers.px4_formats import MAX_FIELDS, MessageFormats
from logs.importers.px4_log import read_px4
from tests.logs.importers.written_logs import px4
from tests.soak import at_most
from world.errors import LogError


def record(letter: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(letter)) + body


def places(data: bytes) -> list[tuple[int, str]]:
    """Where each record stands, and its letter."""
    found, at = [], 16
    while at < len(data):
        found.append((at, chr(data[at + 2])))
        at += 3 + struct.unpack_from("<H", data, at)[0]
    return found


def with_formats(data: bytes, formats: list[str], topic: str, times: int = 1) -> bytes:
    """A log with formats in front of its own, and a topic of one of them that it says to hold."""
    first = {letter: at for at, letter in reversed(places(data))}
    stated = b"".join(record("F", text.encode()) for text in formats)
    held = b"".join(record("A", struct.pack("<BH", 0, 900 + k) + topic.encode()) for k in range(times))
    return data[: first["F"]] + stated + data[first["F"] : first["A"]] + held + data[first["A"] :]


TWICE = [f"n{k}:n{k + 1} a;n{k + 1} b;" for k in range(40)] + ["n40:uint64_t timestamp;"]
ARRAYS = [f"n{k}:n{k + 1}[50000] a;" for k in range(3)] + ["n3:uint64_t timestamp;"]
GROWN: dict[str, tuple[list[str], str, int]] = {
    "forty that hold the next twice": (TWICE, "n0", 1),
    "arrays of arrays": (ARRAYS, "n0", 1),
    "one that holds itself": (["n:uint64_t timestamp;n again;"], "n", 1),
    "two that hold each other": (["a:uint64_t timestamp;b x;", "b:a x;"], "a", 1),
    "many topics of a wide one": (["n:uint64_t timestamp;float[60000] x;"], "n", 20),
    "an array of 4e8": (["n:uint64_t timestamp;float[400000000] x;"], "n", 1),
}


@pytest.mark.parametrize("case", GROWN)
def test_formats_that_grow_are_refused_before_they_do(case: str, tmp_path: Path) -> None:
    path = px4(tmp_path / "a.ulg")
    path.write_bytes(with_formats(path.read_bytes(), *GROWN[case]))
    started = time.process_time()
    with pytest.raises(LogError) as caught:
        read_px4(path)
    assert str(caught.value) == (
        f"{path}: not a readable PX4 log: the formats of its messages have more than {MAX_FIELDS:,} fields"
    )
    assert time.process_time() - started < at_most(3.0)


def test_fields_are_counted_with_those_that_are_nested() -> None:
    formats = MessageFormats("a.ulg")
    for text in ("one:uint64_t timestamp;float[3] a;uint8_t[2] _padding0;", "two:uint64_t timestamp;one[4] x;one y;"):
        formats.add_format(text)
    # 1 + 3 + 2; 1 + 4 * 6 + 6.
    assert [formats.count_fields(name) for name in ("one", "two", "unknown")] == [6, 31, 1]
    for _ in range(MAX_FIELDS // 31):
        formats.add_topic("two")
    with pytest.raises(LogError):
        formats.add_topic("two")
    # A format that is stated anew counts as it is now.
    formats.add_format("one:uint64_t timestamp;")
    assert formats.count_fields("two") == 6


@pytest.mark.parametrize("letter", ["I", "M", "P", "Q"])
@pytest.mark.parametrize(("length", "key"), [(255, b"int32_t a"), (16, b"char[1000000] ab"), (0, b"")])
def test_keys_of_any_length_end_no_reading(letter: str, length: int, key: bytes, tmp_path: Path) -> None:
    """A text where a parameter's number is expected ended it with a traceback."""
    path = px4(tmp_path / "a.ulg")
    data, whole = path.read_bytes(), read_px4(path)
    at = next(at for at, found in places(data) if found == "F")
    body = (b"\0" if letter in "MQ" else b"") + bytes([length]) + key + b"abc"
    path.write_bytes(data[:at] + record(letter, body) + data[at:])
    log = read_px4(path)
    assert np.array_equal(log.series["position"].values, whole.series["position"].values)
    assert log.parameters == whole.parameters


@pytest.mark.parametrize("size", [0, 1, 65_535])
def test_a_record_of_another_size_is_damage_or_a_line(size: int, tmp_path: Path) -> None:
    path = px4(tmp_path / "a.ulg")
    data = path.read_bytes()
    found = places(data)
    for at, letter in [*found[:20:3], *found[20::400], found[-1]]:
        path.write_bytes(data[:at] + struct.pack("<H", size) + data[at + 2 :])
        # Refused where nothing says any more where it flew.
        with contextlib.suppress(LogError):
            log = read_px4(path)
            assert log.damage.places or log.damage.cut, (at, letter)
