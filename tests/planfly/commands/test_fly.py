"""``planfly fly``: its options, a thinner log, and a disk that is full."""

import json
import resource
import shlex
from pathlib import Path
from xml.etree import ElementTree

import pytest

from logs.recording.reader import read_log
from planfly.cli import main

SHORT = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t0\t1
1\t0\t3\t16\t0\t0\t0\t0\t46.0\t8.0\t100\t1
2\t0\t3\t16\t0\t0\t0\t0\t46.005\t8.0\t100\t1
"""


def test_aircraft_and_airspeed_replace_the_scenarios(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name, log = str(tmp_path / "short.waypoints"), tmp_path / "f.mcap"
    Path(name).write_text(SHORT, encoding="ascii")
    assert main(["fly", name, "--aircraft", "aerosonde", "--airspeed", "21", "--log", str(log)]) == 0
    assert (read_log(log).setup.route.leg_airspeeds == 21.0).all()
    # The next step is a line that a shell takes as it stands.
    assert capsys.readouterr().out.splitlines()[-1] == f"next      planfly report {shlex.quote(str(log))}"
    for options, message in (
        (["--aircraft", "boeing"], "planfly: --aircraft boeing: no aircraft called 'boeing'"),
        (["--aircraft", "./nothere"], "planfly: --aircraft ./nothere: nothere/nothere.toml: No such file"),
        (["--scenario", "tight", "--aircraft", "boeing"], "planfly: --aircraft boeing: no aircraft called 'boeing'"),
        (["--scenario", "tight", "--airspeed", "70"], "planfly: --airspeed 70: allowed 18..31 m/s for aerosonde"),
        (["--airspeed", "70"], "planfly: --airspeed 70: allowed 18..31 m/s for aerosonde"),
        (["--airspeed", "28"], None),
        (["--airspeed", "-3"], "a number above 0"),
    ):
        try:
            code = main(["check", name, *options])
        except SystemExit as stop:
            code = int(str(stop.code))
        printed = capsys.readouterr().err
        assert (code == 2) == (message is not None)
        assert message is None or message in printed
    assert main(["check", str(log), "--airspeed", "20"]) == 2
    assert "--airspeed: not allowed with a log" in capsys.readouterr().err


def test_a_thinner_log_is_judged_as_it_is(flight: Path, tmp_path: Path) -> None:
    log = tmp_path / "thin.mcap"
    code = main(["fly", str(flight / "plan.json"), "--log", str(log), "--log-hz", "20"])
    thin, full = read_log(log), read_log(flight / "flight.mcap")
    assert len(thin.track) in (len(full.track) // 3 + 1, len(full.track) // 3 + 2)
    assert thin.track.time[-1] == full.track.time[-1]
    assert main(["check", str(log), "--json", str(tmp_path / "v.json")]) == code
    assert thin.recorded_verdict is not None
    answer = json.loads((tmp_path / "v.json").read_text(encoding="utf-8"))
    assert answer.pop("returns")["line"]
    # The first line that the command prints.
    assert answer.pop("headline") == thin.recorded_verdict["summary"].splitlines()[0]
    assert answer == thin.recorded_verdict | {"exit_code": code}


def test_a_full_disk_is_one_line_and_leaves_a_readable_log(
    flight: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A limit on the size of files stands for the disk: it fails in the middle of the flight."""
    log = tmp_path / "full.mcap"
    kept = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, ((flight / "flight.mcap").stat().st_size // 2, kept[1]))
    try:
        assert main(["fly", str(flight / "plan.json"), "--log", str(log)]) == 1
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, kept)
    said = capsys.readouterr().err.splitlines()
    assert [line for line in said if line.startswith("planfly: ")] == [f"planfly: {log}: File too large"]
    assert said[-1].startswith("planfly: ")
    read = read_log(log)
    assert not read.complete
    full = read_log(flight / "flight.mcap").track
    assert 10 < len(read.track) < len(full)
    assert read.track.position.tobytes() == full.position[: len(read.track)].tobytes()


def test_a_log_that_is_replaced_and_a_verdict_for_continuous_integration(
    flight: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    argv = ["fly", str(flight / "plan.json"), "--junit", "r.xml"]
    code = main(argv)
    assert "exists and is replaced" not in capsys.readouterr().err
    suite = ElementTree.parse("r.xml").getroot()[0]
    assert (int(suite.get("failures", "-1")) > 0) == (code == 4)
    # A file that was named is not replaced, a log that nobody named is, and is said to be.
    assert main(argv) == 2
    assert capsys.readouterr().err == "planfly: r.xml: exists; --overwrite replaces it\n"
    assert main([*argv, "--overwrite"]) == code
    assert "flight.mcap exists and is replaced\n" in capsys.readouterr().err
