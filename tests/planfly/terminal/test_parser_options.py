"""Options that several commands take, and what each refuses."""

import argparse
from collections.abc import Callable

import pytest

from planfly.terminal.parser import build_parser
from planfly.terminal.parser_options import flown_by_options, overwrite_option, steering_options


def parser_with(*groups: Callable[[argparse.ArgumentParser], None]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="test", exit_on_error=False)
    for group in groups:
        group(parser)
    return parser


def test_options_that_are_not_given_leave_the_scenario_as_it_is() -> None:
    args = parser_with(overwrite_option, flown_by_options, steering_options).parse_args([])
    assert not args.overwrite
    given = (args.aircraft, args.airspeed, args.wind, args.turbulence, args.params, args.guidance, args.nav)
    assert given == (None,) * len(given)


def test_a_wind_is_a_speed_and_where_it_blows_from() -> None:
    assert parser_with(flown_by_options).parse_args(["--wind", "7.5,250"]).wind == (7.5, 250.0)
    with pytest.raises(argparse.ArgumentError):
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
