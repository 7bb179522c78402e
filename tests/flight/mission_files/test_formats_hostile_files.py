"""Hostile mission files, each within 2 s and 300 MiB: a refusal in one line, or a stated warning."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.flight.mission_files.malformed_files import BAD_BYTES, BAD_PLAN, BAD_WPL, HOME_LINE, plan_data, wpl

SECONDS, MEBIBYTES = 2.0, 300.0

_LINE = "1\t0\t3\t16\t0\t0\t0\t0\t36.5\t-84.2\t300\t1\n"
_HEAD = f"QGC WPL 110\n{HOME_LINE}\n"

# Beyond the malformed files of the other test: large, deep, and not what they say they are.
LARGE: dict[str, bytes] = {
    "million-lines.waypoints": b"QGC WPL 110\n" + b"0 1 0\n" * 1_000_000,
    "million-comments.waypoints": b"QGC WPL 110\n" + b"# no more\n" * 1_000_000,
    "million-empty.waypoints": b"QGC WPL 110\n" + b"\n" * 10_000_000,
    "carriage-returns.waypoints": b"\r" * 16_000_000,
    "70000-items.waypoints": (_HEAD + "".join(f"{k}{_LINE[1:]}" for k in range(1, 70_001))).encode(),
    "one-long-line.waypoints": b"QGC WPL 110\n" + b"1\t" * 8_000_000,
    "long-number.waypoints": (_HEAD + _LINE.replace("36.5", "3" * 1_000_000)).encode(),
    "huge-integer.waypoints": (_HEAD + "9" * 100_000 + _LINE[1:]).encode(),
    "truncated.waypoints": (_HEAD + _LINE[:20]).encode(),
    "swapped.waypoints": (_HEAD + _LINE.replace("36.5\t-84.2", "-112.2\t36.5")).encode(),
    "utf-32.waypoints": "QGC WPL 110\n".encode("utf-32"),
    "utf-16-no-mark.waypoints": "QGC WPL 110\n".encode("utf-16-le"),
    "negative-turns.waypoints": (_HEAD + "1 0 3 18 -5 0 80 0 36.5 -84.2 300 1\n").encode(),
    "fence-of-two.fence": b"QGC WPL 110\n0 0 0 5001 3 0 0 0 36.5 -84.2 0 1\n1 0 0 5001 3 0 0 0 36.6 -84.2 0 1\n",
    "fence-nan.fence": b"QGC WPL 110\n0 0 0 5004 nan 0 0 0 36.5 -84.2 0 1\n",
    "rally-91.rally": b"QGC WPL 110\n0 0 3 5100 0 0 0 0 91 -84.2 100 1\n",
    "deep.plan": b'{"fileType":' + b"[" * 5_000_000,
    "deep-objects.plan": b'{"a":' * 2_000_000,
    "many-items.plan": json.dumps(plan_data()).replace('"items": [', '"items": [' + "0," * 2_000_000).encode(),
    "huge-integer.plan": json.dumps(plan_data()).replace("36.5", "9" * 10_000).encode(),
    "long-string.plan": json.dumps(plan_data(type="x" * 8_000_000)).encode(),
    "nested-survey.plan": json.dumps(
        plan_data(
            type="ComplexItem",
            complexItemType="survey",
            TransectStyleComplexItem={"Items": [{"type": "ComplexItem", "complexItemType": "survey"}]},
        )
    ).encode(),
    "surrogate.plan": b'{"fileType": "\\ud800"}',
}
# Files that can be read, with a warning.
ODD: dict[str, bytes] = {
    "no-current.waypoints": ("QGC WPL 110\n" + HOME_LINE.replace("0\t1", "0\t0", 1) + "\n" + _LINE).encode(),
    "gap.waypoints": (_HEAD + _LINE + "9" + _LINE[1:]).encode(),
    "zero-zero.waypoints": (_HEAD + _LINE.replace("36.5\t-84.2", "0\t0") + "2" + _LINE[1:]).encode(),
    "no-home.waypoints": ("QGC WPL 110\n" + _LINE.replace("1\t0", "1\t1", 1)).encode(),
    "fence-version.plan": json.dumps(plan_data() | {"geoFence": {"version": 7}}).encode(),
}

_CHILD = """
import json, re, resource, sys, time
from pathlib import Path
from flight.mission_files.formats import read_mission
from world.errors import MissionError
resource.setrlimit(resource.RLIMIT_CPU, (100, 100))
out = {}
for path in sorted(Path(sys.argv[1]).iterdir()):
    start = time.process_time()
    try:
        said = [1, list(read_mission(path).warnings)]
    except MissionError as error:
        said = [0, str(error)]
    seconds = time.process_time() - start
    # Not ru_maxrss: that holds the parent's memory from before exec.
    high = int(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text()).group(1)) / 1024
    out[path.name] = [seconds, high, *said]
print(json.dumps(out))
"""


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[object]]:
    """Each file's CPU seconds, the process's greatest MiB so far, and what was said, read one after another."""
    folder = tmp_path_factory.mktemp("hostile")
    for case, (text, _) in BAD_WPL.items():
        (folder / f"wpl-{case}.waypoints").write_text(text, encoding="utf-8", newline="")
    for case, (data, _) in BAD_PLAN.items():
        (folder / f"plan-{case}.plan").write_text(data if isinstance(data, str) else json.dumps(data), encoding="utf-8")
    for case, (raw, _) in BAD_BYTES.items():
        (folder / f"bytes-{case}.waypoints").write_bytes(raw)
    for name, raw in (LARGE | ODD).items():
        (folder / name).write_bytes(raw)
    done = subprocess.run(
        [sys.executable, "-c", _CHILD, str(folder)], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    found: dict[str, list[object]] = json.loads(done.stdout)
    assert len(found) >= 45
    return found


def test_every_hostile_file_is_refused_or_warned_about(read: dict[str, list[object]]) -> None:
    for name, (_, _, was_read, said) in read.items():
        if name in ODD:
            assert was_read, name
            assert said, f"{name}: no warning"
            continue
        assert not was_read, name
        assert isinstance(said, str)
        assert name in said
        assert len(said.splitlines()) == 1, name
        assert len(said) < 600, name


def test_none_takes_long_or_much(read: dict[str, list[object]]) -> None:
    slow = {name: seconds for name, (seconds, *_) in read.items() if not float(str(seconds)) < SECONDS}
    assert not slow
    assert max(float(str(row[1])) for row in read.values()) < MEBIBYTES


@pytest.mark.parametrize("column", range(12))
def test_a_bad_column_is_named(column: int, tmp_path: Path) -> None:
    """The line and the field of a value that is none, in every column."""
    from flight.mission_files.formats import read_mission
    from world.errors import MissionError

    names = ["seq", "current", "frame", "command", "p1", "p2", "p3", "p4"]
    names += ["latitude", "longitude", "altitude", "autocontinue"]
    file = tmp_path / "a.waypoints"
    file.write_text(wpl(at={column: "1e999"}))
    with pytest.raises(MissionError, match=rf":3: {names[column]} '1e999'"):
        read_mission(file)
