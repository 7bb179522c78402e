"""Options that several commands take, and what each refuses."""

from collections.abc import Callable
from typing import Any

import pytest

from planfly.terminal.command_parser import CommandParser
from planfly.terminal.parser import build_parser
from planfly.terminal.parser_options import flight_options, flown_by_options, result_options, steering_options


def parser_with(*groups: Callable[[CommandParser], Any]) -> CommandParser:
    parser = CommandParser(prog="test")
    for group in groups:
        group(parser)
    return parser


def test_options_that_are_not_given_leave_the_scenario_as_it_is() -> None:
    args = parser_with(result_options, flown_by_options, steering_options).parse_args([])
    assert not args.overwrite
    given = (args.aircraft, args.airspeed, args.wind, args.turbulence, args.params, args.guidance, args.nav)
    assert given == (None,) * len(given)


def test_a_wind_is_a_speed_and_where_it_blows_from() -> None:
    assert parser_with(flown_by_options).parse_args(["--wind", "7.5,250"]).wind == (7.5, 250.0)
    with pytest.raises(SystemExit):
        parser_with(flown_by_options).parse_args(["--turbulence", "severe"])


@pytest.mark.parametrize("line", ["fly m.waypoints --autopilot bin/arduplane", "run tight --autopilot bin/arduplane"])
def test_a_real_autopilot_flies_for_the_commands_that_fly(line: str) -> None:
    assert build_parser().parse_args(line.split()).autopilot == "bin/arduplane"


@pytest.mark.parametrize("line", ["check m.plan --autopilot a", "plan tight --autopilot a", "serve --autopilot a"])
def test_and_for_no_other(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        build_parser().parse_args(line.split())
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_run_takes_what_fly_takes_of_a_flight() -> None:
    commands = build_parser().commands
    shared = set(parser_with(flight_options).options())
    assert {"--wind", "--turbulence", "--aircraft", "--airspeed", "--params", "--nav", "--autopilot"} < shared
    for name in ("run", "fly"):
        assert shared <= set(commands[name].options())
    # What is left is a mission's: whose scenario it is judged in, and where its log goes.
    assert set(commands["fly"].options()) - set(commands["run"].options()) == {"--scenario", "--fence", "--log"}


@pytest.mark.parametrize(
    "name", [name for name in build_parser().commands if name not in ("serve", "help", "completion")]
)
def test_every_command_with_a_result_answers_in_json_or_in_silence(name: str) -> None:
    assert {"--json", "--quiet"} <= set(build_parser().commands[name].options())
