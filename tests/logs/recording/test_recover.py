"""Recovering: an unfinished or damaged log made whole, its prefix exact, named incomplete for ever."""

from pathlib import Path

import pytest
from mcap.reader import make_reader

from logs.recording.reader import read_log
from logs.recording.recover import recover_log
from logs.verdict.judge_flight import judge_flight
from world.errors import LogError


def test_a_complete_log_needs_no_recovery(log_file: Path) -> None:
    assert recover_log(log_file) is None


def cut(log_file: Path, tmp_path: Path, share: float) -> Path:
    data = log_file.read_bytes()
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(data[: int(len(data) * share)])
    return broken


@pytest.mark.parametrize("share", [0.75, 0.8, 0.95, 0.999])
def test_a_cut_log_becomes_whole_for_any_reader(log_file: Path, tmp_path: Path, share: float) -> None:
    broken = cut(log_file, tmp_path, share)
    recovered = recover_log(broken)
    assert recovered is not None
    whole = tmp_path / "whole.mcap"
    whole.write_bytes(recovered.data)
    before, after = read_log(broken), read_log(whole)
    assert after.track.position.tobytes() == before.track.position.tobytes()
    assert after.events == before.events
    assert not after.complete
    assert after.problem == f"recovered: {before.problem}"
    assert after.ended is None
    assert after.recorded_verdict is None
    assert not judge_flight(after.setup, after.track, "completed", log_complete=after.complete).flyable
    # mcap's own reader needs the summary, which is there again; its index leads to every message.
    with whole.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        states = sum(1 for _, channel, _ in reader.iter_messages() if channel.topic == "/state")
        assert states == len(before.track)
        assert summary.statistics.message_count == sum(summary.statistics.channel_message_counts.values())
        assert {item.name for item in reader.iter_attachments()} >= {"setup.json", "recovery.json"}


def test_a_flipped_bit_keeps_the_prefix(log_file: Path, tmp_path: Path) -> None:
    data = bytearray(log_file.read_bytes())
    data[int(len(data) * 0.8)] ^= 4
    broken = tmp_path / "flipped.mcap"
    broken.write_bytes(data)
    recovered = recover_log(broken)
    assert recovered is not None
    before, full = recovered.log.track, read_log(log_file).track
    assert 0 < len(before) < len(full)
    assert before.position.tobytes() == full.position[: len(before)].tobytes()


def test_recovering_twice_changes_nothing(log_file: Path, tmp_path: Path) -> None:
    once = recover_log(cut(log_file, tmp_path, 0.8))
    assert once is not None
    again = tmp_path / "again.mcap"
    again.write_bytes(once.data)
    twice = recover_log(again)
    assert twice is not None
    assert twice.data == once.data


def test_what_is_no_log_is_refused(tmp_path: Path) -> None:
    nothing = tmp_path / "nothing.mcap"
    nothing.write_bytes(b"not a log")
    with pytest.raises(LogError, match="not an MCAP file"):
        recover_log(nothing)
