"""Other projects' readers open the written files without complaint, and agree on counts and values."""

import json
import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from flight.simulation.track import Track
from logs.recording.recover import recover_log
from logs.recording.state_channel import EPOCH_NS, FIELDS
from tests.clients import NODE_MODULES, beside_python, need

pytestmark = pytest.mark.client

# What `pymcap-cli doctor` reports of a clean log, all of them "info": our profile is our own, everything that is
# metadata elsewhere is an attachment here, a chunk a second is small on purpose, and the made flight here is noise.
KNOWN = {"UNKNOWN_PROFILE", "NO_METADATA", "SMALL_CHUNKS", "CHUNK_COMPRESSION_INEFFICIENT"}


def run(*command: str) -> str:
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def our_counts(path: Path) -> dict[str, int]:
    with path.open("rb") as file:
        return dict(Counter(channel.topic for _, channel, _ in make_reader(file).iter_messages()))


@pytest.fixture(params=["finished", "recovered"])
def log(request: pytest.FixtureRequest, log_file: Path, tmp_path: Path) -> Path:
    """A finished log, and one that was cut off and recovered."""
    if request.param == "finished":
        return log_file
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log_file.read_bytes()[: log_file.stat().st_size * 4 // 5])
    recovered = recover_log(cut)
    assert recovered is not None
    cut.write_bytes(recovered.data)
    return cut


def test_mcap_core_on_node_reads_every_row(log: Path, track: Track) -> None:
    node = need(shutil.which("node"), "node", "apt package nodejs")
    need(NODE_MODULES / "@mcap" / "core", "@mcap/core", "make clients")
    found = json.loads(run(node, str(Path(__file__).with_name("read_mcap.cjs")), str(NODE_MODULES), str(log)))
    assert found["counts"] == found["statistics"] == our_counts(log)
    rows = found["counts"]["/state"]
    assert [int(stamp) for stamp in found["stamps"]] == [EPOCH_NS + round(t * 1e9) for t in track.time[:rows]]
    for field in FIELDS:
        ours = field.of(getattr(track, field.source)[:rows])
        # A float32 as JavaScript reads it is the same number.
        np.testing.assert_array_equal(np.array(found["sums"][field.name]), ours.astype(np.float64), err_msg=field.name)
    assert "setup.json" in found["attachments"]


def test_rerun_finds_every_message(log: Path) -> None:
    rerun = need(beside_python("rerun"), "rerun", "pip package rerun-sdk")
    rows = re.findall(r"^(\w+) +\d+ +\d+ +(/\S+) +(.*)$", run(rerun, "mcap", "check", str(log)), re.MULTILINE)
    assert {topic for _, topic, _ in rows} == set(our_counts(log))
    assert {(state, issues.strip()) for state, _, issues in rows} == {("ok", "—")}
    listing = run(rerun, "mcap", "info", str(log))
    found = re.findall(r"^ *\d+ +(/\S+) +(\d+) ", listing, re.MULTILINE)
    assert {topic: int(count) for topic, count in found if int(count)} == our_counts(log)


def test_pymcap_doctor_finds_no_errors(log: Path) -> None:
    doctor = need(beside_python("pymcap-cli"), "pymcap-cli", "pip package pymcap-cli")
    lines = [json.loads(line) for line in run(doctor, "doctor", "--format", "jsonl", str(log)).splitlines()]
    findings = [line for line in lines if line["type"] == "finding"]
    assert {line["code"] for line in findings} <= KNOWN
    # Only of the noise that it is made of: a real flight gets three of "info" and nothing else.
    assert {line["code"] for line in findings if line["severity"] != "info"} <= {"CHUNK_COMPRESSION_INEFFICIENT"}
    (summary,) = [line for line in lines if line["type"] == "summary"]
    assert (summary["errors"], summary["complete"]) == (0, True)
    assert summary["messages"] == sum(our_counts(log).values())


def test_the_doctor_finds_a_damaged_log(log_file: Path, tmp_path: Path) -> None:
    # Otherwise the three above could agree on anything.
    doctor = need(beside_python("pymcap-cli"), "pymcap-cli", "pip package pymcap-cli")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log_file.read_bytes()[:-3000])
    result = subprocess.run([doctor, "doctor", str(cut)], capture_output=True, text=True, check=False, timeout=120)
    assert result.returncode != 0
