from pathlib import Path

from logs.field_logs.readers.telemetry_frames import TelemetryReader, looks_like_telemetry
from tests.logs.field_logs.written_logs import telemetry

ATTITUDE = 30


def read(data: bytes) -> tuple[int, TelemetryReader]:
    reader = TelemetryReader(memoryview(data), frozenset({ATTITUDE}))
    return len(list(reader.messages())), reader


def test_wanted_messages_alone_are_decoded(tmp_path: Path) -> None:
    count, reader = read(telemetry(tmp_path / "a.tlog").read_bytes())
    assert count == 460
    assert not reader.damage().lossy


def test_a_checksum_that_fails_is_counted(tmp_path: Path) -> None:
    data = bytearray(telemetry(tmp_path / "a.tlog").read_bytes())
    # A packet of MAVLink 2: ten bytes before the payload, the message's number from the eighth on.
    half = len(data) // 2
    at = next(k for k in range(half, len(data)) if data[k] == 0xFD and data[k + 7 : k + 10] == bytes([ATTITUDE, 0, 0]))
    data[at + 12] ^= 1
    count, reader = read(bytes(data))
    assert (count, reader.damage().unreadable) == (459, 1)


def test_bytes_that_are_no_packet_are_passed_over_and_counted(tmp_path: Path) -> None:
    data = telemetry(tmp_path / "a.tlog").read_bytes()
    _, reader = read(b"\x01" * 37 + data)
    assert (reader.damage().places, reader.damage().size) == (1, 37)


def test_a_cut_is_told(tmp_path: Path) -> None:
    _, reader = read(telemetry(tmp_path / "a.tlog").read_bytes()[:-7])
    assert reader.damage().cut


def test_a_telemetry_log_is_known_by_its_first_bytes(tmp_path: Path) -> None:
    assert looks_like_telemetry(telemetry(tmp_path / "a.tlog").read_bytes())
    assert not looks_like_telemetry(b"\x00" * 20)
    assert not looks_like_telemetry(b"\x00")
