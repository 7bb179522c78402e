"""The options of commands that take logs."""

import re
import subprocess
import sys

import pytest

from planfly.cli import COMMANDS, build_parser

NAMES = [command.name for command in COMMANDS]


def test_defaults_and_places_of_logs() -> None:
    parse = build_parser().parse_args
    assert parse(["compare", "a.mcap", "b.mcap"]).second == "b.mcap"
    replay = parse(["replay", "a.mcap", "--to", "127.0.0.1:14550"])
    assert (replay.to, replay.bind, replay.port, replay.speed) == ("127.0.0.1:14550", "127.0.0.1:0", 8765, None)
    assert parse(["replay", "a.mcap", "--to", "90"]).to == 90.0
    assert parse(["report", "--layout", "l.json"]).log is None


def test_a_log_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        build_parser().parse_args(["recover"])
    assert "LOG.mcap" in capsys.readouterr().err


def test_import_takes_a_log_and_a_target() -> None:
    args = build_parser().parse_args(["import", "a.tlog", "a.mcap", "--terrain", "dem.tif"])
    assert (args.command, args.log, args.target, args.terrain) == ("import", "a.tlog", "a.mcap", "dem.tif")


def test_refly_takes_a_flight() -> None:
    args = build_parser().parse_args(["refly", "a.mcap", "--turbulence", "light"])
    assert (args.log, args.turbulence, args.out) == ("a.mcap", "light", None)


def test_flights_are_numbered_from_1(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        build_parser().parse_args(["check", "a.BIN", "--flight", "0"])
    assert "a whole number from 1" in capsys.readouterr().err


# ----------------------------------------------------------------------
# The parser knows every command, its defaults, and answers bad usage in a line.


def test_help_describes_every_command_and_no_other(capsys: pytest.CaptureFixture[str]) -> None:
    for name in NAMES:
        with pytest.raises(SystemExit) as stopped:
            build_parser().parse_args([name, "--help"])
        assert stopped.value.code == 0
        text = capsys.readouterr().out
        assert f"example: planfly {name}" in text
        assert "exit codes: 0 flyable" in text
    with pytest.raises(SystemExit):
        build_parser().parse_args(["--help"])
    text = capsys.readouterr().out
    listed = [line.split()[0] for line in text.splitlines() if re.match("  [a-z][a-z-]+  ", line)]
    assert sorted(listed) == sorted(NAMES)


def test_the_example_of_each_command_is_one_that_it_takes(capsys: pytest.CaptureFixture[str]) -> None:
    for name in NAMES:
        with pytest.raises(SystemExit):
            build_parser().parse_args([name, "--help"])
        (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("example: ")]
        words = line.split()
        assert words[1] == "planfly"
        assert build_parser().parse_args(words[2:]).command == name


def test_defaults_are_those_of_the_help() -> None:
    run = build_parser().parse_args(["run"])
    assert (run.scenario, run.seed, run.refine, run.overwrite) == ("jacksboro", None, 0, False)
    serve = build_parser().parse_args(["serve"])
    assert (serve.to, serve.bind, serve.speed) == ("127.0.0.1:14550", "127.0.0.1:14580", 1.0)
    paper = build_parser().parse_args(["paper"])
    assert (paper.problems, paper.runs, paper.algorithm) == ((7, 15, 30, 60), 15, "umda")
    assert build_parser().parse_args(["fly", "m.plan", "--log-hz", "30"]).log_hz == 30


@pytest.mark.parametrize("argv", [[], ["land"], ["fly"], ["fly", "m.plan", "--log-hz", "15"], ["paper", "--jobs", "0"]])
def test_bad_usage_ends_with_2_and_one_line(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        build_parser().parse_args(argv)
    assert stopped.value.code == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert "--help)" in printed.err


def test_the_parser_loads_nothing_heavy() -> None:
    code = (
        "import sys; from planfly.cli import build_parser; build_parser(); "
        "print([name for name in ('numpy', 'numba', 'pydantic', 'matplotlib', 'jsbsim') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "[]\n"
