"""Options that several commands take."""

import argparse
import os
import signal
from collections.abc import Callable
from typing import Any

import pytest

from planfly.cli import build_parser
from planfly.terminal.command_parser import CommandParser
from planfly.terminal.options import (
    add_aircraft_and_wind_options,
    add_flight_options,
    add_result_options,
    add_steering_options,
    given_options,
    watch_stop_signals,
)

# ----------------------------------------------------------------------
# Options that several commands take, and what each refuses.


def parser_with(*groups: Callable[[CommandParser], Any]) -> CommandParser:
    parser = CommandParser(prog="test")
    for group in groups:
        group(parser)
    return parser


def test_options_that_are_not_given_leave_the_scenario_as_it_is() -> None:
    args = parser_with(add_result_options, add_aircraft_and_wind_options, add_steering_options).parse_args([])
    assert not args.overwrite
    given = (args.aircraft, args.airspeed, args.wind, args.turbulence, args.params, args.guidance, args.nav)
    assert given == (None,) * len(given)


def test_a_wind_is_a_speed_and_where_it_blows_from() -> None:
    assert parser_with(add_aircraft_and_wind_options).parse_args(["--wind", "7.5,250"]).wind == (7.5, 250.0)
    with pytest.raises(SystemExit):
        parser_with(add_aircraft_and_wind_options).parse_args(["--turbulence", "severe"])


def test_the_help_states_the_gusts_of_each_turbulence() -> None:
    """MIL-F-8785C: a tenth of the wind at 20 ft, which is 15 knots in light and 30 in moderate turbulence."""
    help_text = " ".join(parser_with(add_aircraft_and_wind_options).format_help().split())
    assert f"light {0.1 * 15 * 1852 / 3600:.2f} m/s, moderate {0.1 * 30 * 1852 / 3600:.2f} m/s" in help_text


@pytest.mark.parametrize("line", ["fly m.waypoints --sitl bin/arduplane", "run tight --sitl bin/arduplane"])
def test_a_real_autopilot_flies_for_the_commands_that_fly(line: str) -> None:
    assert build_parser().parse_args(line.split()).sitl == "bin/arduplane"


@pytest.mark.parametrize("line", ["check m.plan --sitl a", "plan tight --sitl a", "serve --sitl a"])
def test_and_for_no_other(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        build_parser().parse_args(line.split())
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_run_takes_what_fly_takes_of_a_flight() -> None:
    commands = build_parser().commands
    shared = set(parser_with(add_flight_options).long_options())
    assert {"--wind", "--turbulence", "--aircraft", "--airspeed", "--params", "--nav", "--sitl"} < shared
    for name in ("run", "fly"):
        assert shared <= set(commands[name].long_options())
    # What is left is a mission's: whose scenario it is judged in, and where its log goes.
    assert set(commands["fly"].long_options()) - set(commands["run"].long_options()) == {
        "--scenario",
        "--fence",
        "--log",
    }


@pytest.mark.parametrize(
    "name", [name for name in build_parser().commands if name not in ("studio", "serve", "help", "completion")]
)
def test_every_command_with_a_result_answers_in_json_or_in_silence(name: str) -> None:
    assert {"--json", "--quiet"} <= set(build_parser().commands[name].long_options())


# ----------------------------------------------------------------------
# How a command that goes on is ended.


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_asks_to_stop_and_its_handler_comes_back(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with watch_stop_signals() as stop:
        assert not stop()
        os.kill(os.getpid(), number)
        assert stop()
    assert signal.getsignal(number) is before
    with pytest.raises(RuntimeError, match="inside"), watch_stop_signals():
        raise RuntimeError("inside")
    assert signal.getsignal(number) is before


# ----------------------------------------------------------------------
# Options of campaigns: what is taken, and one line for the rest.


@pytest.mark.parametrize(
    "words",
    [
        ("campaign", "--prove", "1.0"),
        ("campaign", "--prove", "0.49"),
        ("campaign", "--at-least", "nan"),
        ("campaign", "--flights", "0"),
        ("campaign", "--refly", "-1"),
        ("campaign", "--prove", "0.9", "--at-least", "0.9"),
        ("winds", "--directions", "3"),
        ("winds", "--directions", "73"),
        ("winds", "--most", "0.9"),
        ("winds", "--most", "41"),
        ("battery", "--reserve", "0.91"),
        ("battery", "--specific-energy", "19"),
        ("battery", "--flights", "19"),
        ("ground-risk", "--flights", "19"),
        ("ground-risk", "--max-speed", "0"),
        ("ground-risk", "--probability", "1"),
        ("ground-risk", "--population-unit", "people"),
    ],
)
def test_bad_values_get_one_line(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        build_parser().parse_args([words[0], "jacksboro", *words[1:]])
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_what_is_taken() -> None:
    args = build_parser().parse_args(
        ["campaign", "jacksboro-air", "--prove", "0.5", "--flights", "10000000", "--refly", "0"]
    )
    assert (args.prove, args.flights, args.refly) == (0.5, 10_000_000, 0)
    args = build_parser().parse_args(["winds", "x", "--directions", "72", "--most", "40"])
    assert (args.directions, args.most, args.prove) == (72, 40.0, None)


def test_a_call_states_the_keywords_that_the_options_name() -> None:
    def api(mission: str, *, seed: int = 1, out: str = "here", fence: tuple[str, ...] = ()) -> tuple[Any, ...]:
        return mission, seed, out, fence

    args = argparse.Namespace(mission="a.plan", seed=3, out=None, fence=[], json="-", overwrite=True)
    assert api(**given_options(args, api)) == ("a.plan", 3, "here", [])
    assert api(**given_options(args, api, seed=4, out="there")) == ("a.plan", 4, "there", [])
    assert api(**given_options(args, api, seed=None)) == ("a.plan", 1, "here", [])
    options = build_parser().parse_args(["fly", "a.plan", "--seed", "3", "--json", "-"]).options
    assert (options["mission"], options["seed"], options["overwrite"]) == ("a.plan", 3, False)
    assert not options.keys() & {"command", "json", "quiet", "wind", "options"}
