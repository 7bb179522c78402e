"""--json FILE, --json - and --quiet: where lines and answers go, and what is refused before anything begins."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from logs.recording.example_log import write_example_log
from planfly.cli import main

Output = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, blank_pictures: None) -> None:
    monkeypatch.chdir(tmp_path)


def test_lines_stand_beside_an_answer_on_standard_output(capsys: Output) -> None:
    write_example_log(Path("a.mcap"))
    main(["replay", "a.mcap", "--json", "-"])
    out = capsys.readouterr()
    json.loads(out.out)
    assert "take-off" in out.err or " s  " in out.err


def test_quiet_prints_nothing_but_the_answer_that_is_asked_for(capsys: Output) -> None:
    write_example_log(Path("a.mcap"))
    assert main(["report", "a.mcap", "--out", "pages", "--quiet"]) == 4
    out = capsys.readouterr()
    assert (out.out, out.err) == ("", "")
    assert Path("pages/report.html").exists()
    assert main(["check", "a.mcap", "--quiet", "--json", "-"]) == 4
    out = capsys.readouterr()
    assert (json.loads(out.out)["flyable"], out.err) == (False, "")
    # Errors are said whatever is asked.
    assert main(["check", "none.mcap", "--quiet"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_progress_speaks_again_after_a_quiet_command(capsys: Output) -> None:
    write_example_log(Path("a.mcap"))
    main(["report", "a.mcap", "--quiet"])
    main(["report", "a.mcap"])
    assert "drawing: done" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--json", "a.mcap", "--overwrite"], "a.mcap: is the input itself"),
        (["--json", "there.json"], "there.json: exists; --overwrite replaces it"),
        (["--json", "none/v.json"], "its folder none does not exist"),
        (["--json", "."], "is a folder"),
    ],
)
def test_a_file_that_cannot_take_the_answer_is_refused_first(more: list[str], said: str, capsys: Output) -> None:
    write_example_log(Path("a.mcap"))
    Path("there.json").write_text("mine", encoding="utf-8")
    before = {path.name: path.read_bytes() for path in Path().iterdir()}
    assert main(["report", "a.mcap", "--out", "pages", *more]) == 2
    out = capsys.readouterr()
    assert said in out.err
    assert out.out == ""
    assert {path.name: path.read_bytes() for path in Path().iterdir()} == before


def test_an_error_leaves_standard_output_empty(capsys: Output) -> None:
    assert main(["check", "none.mcap", "--json", "-"]) == 2
    assert capsys.readouterr().out == ""


def test_a_reader_that_leaves_does_not_matter() -> None:
    write_example_log(Path("a.mcap"))
    line = f"{sys.executable} -m planfly check a.mcap --quiet --json - | head -c 1; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, env=dict(os.environ), check=False)
    assert (done.returncode, done.stdout, done.stderr) == (4, "{", "")
