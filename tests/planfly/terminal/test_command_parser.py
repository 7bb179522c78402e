"""Colour where a terminal wants it, and nowhere else."""

import io
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest

import planfly
from planfly.cli import build_parser
from planfly.terminal.command_parser import CommandParser, LineParser, colour_text, wants_colour
from world.errors import MissionError


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("stream", "settings", "wanted"),
    [
        (Terminal(), {"TERM": "xterm-256color"}, True),
        (Terminal(), {"TERM": "xterm", "NO_COLOR": ""}, True),
        (Terminal(), {"TERM": "xterm", "NO_COLOR": "1"}, False),
        (Terminal(), {"TERM": "dumb"}, False),
        (io.StringIO(), {"TERM": "xterm"}, False),
        (io.StringIO(), {"FORCE_COLOR": "1", "TERM": "dumb"}, True),
        (io.StringIO(), {"FORCE_COLOR": ""}, False),
        (Terminal(), {"FORCE_COLOR": "1", "NO_COLOR": "1"}, False),
    ],
)
def test_who_wants_colour(
    stream: io.StringIO, settings: dict[str, str], wanted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    assert wants_colour(stream) is wanted
    # Red is 31 of ISO 6429, and 0 ends it.
    assert colour_text("bad", "bad", stream) == ("\x1b[31mbad\x1b[0m" if wanted else "bad")


def seen(*argv: str, **settings: str) -> str:
    """What a terminal gets of a command."""
    ours, theirs = pty.openpty()
    environment = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")} | settings
    subprocess.run([sys.executable, "-m", "planfly", *argv], stdout=theirs, stderr=theirs, env=environment, check=False)
    os.close(theirs)
    text = b""
    while True:
        try:
            chunk = os.read(ours, 65536)
        except OSError:
            break
        if not chunk:
            break
        text += chunk
    os.close(ours)
    return text.decode()


def test_help_and_errors_are_coloured_on_a_terminal_alone() -> None:
    assert "\x1b[" in seen("fly", "--help", TERM="xterm-256color", COLUMNS="100")
    assert "\x1b[31m" in seen("flyy", TERM="xterm-256color")
    assert "\x1b[" not in seen("fly", "--help", TERM="dumb") + seen("flyy", TERM="xterm", NO_COLOR="1")


@pytest.mark.parametrize("command", ["export", "run"])
def test_a_coloured_help_says_the_same(command: str) -> None:
    plain = seen(command, "--help", TERM="dumb", COLUMNS="100")
    shown = seen(command, "--help", TERM="xterm-256color", COLUMNS="100")
    assert re.sub(r"\x1b\[[0-9;]*m", "", shown) == plain
    assert "\x1b[36m--overwrite\x1b[0m" in shown
    assert "\x1b[33musage:\x1b[0m planfly" in shown


# ----------------------------------------------------------------------
# Bad usage is one line that names what was meant; the help stands in groups.

Output = pytest.CaptureFixture[str]


def test_a_second_file_is_refused_with_the_way_to_judge_several(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Output
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a.plan", "b.plan"):
        (tmp_path / name).write_text("{}", encoding="utf-8")
    with pytest.raises(SystemExit) as stopped:
        build_parser().parse_args(["check", "a.plan", "b.plan"])
    assert stopped.value.code == 2
    assert capsys.readouterr().err.startswith("planfly check: b.plan: the command takes one file at a time (see ")
    with pytest.raises(MissionError, match=r"holds a.plan, b.plan; expected a .* or .plan file, one at a time$"):
        planfly.check(tmp_path)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("flyy m.plan", "planfly: 'flyy': unknown command: did you mean 'fly'? (see planfly --help)"),
        ("fly m.plan --wnd 8,270", "planfly fly: --wnd: no such option: did you mean '--wind'?"),
        # All options share their dashes: "--overwrite" is not like "--terrain".
        ("export a.plan b.plan --terrain x", "planfly export: --terrain: no such option (see planfly export --help)"),
        ("fly m.plan --terain=x", "planfly fly: --terain: no such option: did you mean '--terrain'?"),
        ("run tight --log f.mcap", "planfly run: "),
        ("check a.mcap b.mcap", "planfly check: b.mcap: no such argument (see planfly check --help)"),
        ("fly m.plan -x", "planfly fly: -x: no such option (see planfly fly --help)"),
        ("fly m.plan -- --wnd", "planfly fly: --wnd: no such argument (see planfly fly --help)"),
        ("fly --wnd -- m.plan --terain", "planfly fly: --wnd: no such option: did you mean '--wind'?"),
        ("fly m.plan -- --wnd=3 x", "planfly fly: --wnd=3: no such argument (see planfly fly --help)"),
        ("qqqq", "planfly: 'qqqq': unknown command; the commands are run, plan, "),
    ],
)
def test_what_was_meant_is_named(line: str, said: str, capsys: Output) -> None:
    with pytest.raises(SystemExit) as stopped:
        build_parser().parse_args(line.split())
    assert stopped.value.code == 2
    out = capsys.readouterr()
    assert out.out == ""
    assert out.err.startswith(said)
    assert out.err.count("\n") == 1


def test_a_parser_knows_its_long_options() -> None:
    parser = CommandParser(prog="x")
    parser.add_group("a").add_argument("--one-two", metavar="N")
    parser.add_argument("-q", "--quiet", action="store_true")
    assert set(parser.long_options()) <= {"--one-two", "--quiet"}
    assert "--one-two" in parser.long_options()


def test_commands_are_found_by_name_and_help_shows_groups() -> None:
    line = LineParser("1.0", "What it is.", "first steps: planfly go")
    go = line.add_command("go", "go there", "planfly go now", "planfly go later")
    go.extra_help = lambda: "ways:\n  on foot"
    go.add_group("how fast").add_argument("--speed", help="in m/s")
    assert line.commands == {"go": go}
    text = go.format_help()
    assert "how fast:\n  --speed" in text
    assert "example: planfly go now\n         planfly go later\n\nways:\n  on foot\n\nexit codes" in text
    assert line.parse_args(["go", "--speed", "3"]).speed == "3"


@pytest.mark.parametrize(
    "line",
    [
        "import log.BIN flight.mcap --plan a.plan",
        "import log.BIN --plan a.plan flight.mcap",
        "import --plan a.plan log.BIN flight.mcap",
        "import log.BIN --overwrite flight.mcap --plan a.plan",
        "import --overwrite log.BIN --plan a.plan --quiet flight.mcap",
    ],
)
def test_options_may_stand_between_the_arguments(line: str) -> None:
    parsed = build_parser().parse_args(line.split())
    assert (parsed.log, parsed.target, parsed.plan) == ("log.BIN", "flight.mcap", "a.plan")


def test_files_may_stand_on_both_sides_of_an_option() -> None:
    parsed = build_parser().parse_args(["export", "a.mcap", "b.kml", "--overwrite", "c.csv"])
    assert (parsed.source, parsed.files) == ("a.mcap", ["b.kml", "c.csv"])
