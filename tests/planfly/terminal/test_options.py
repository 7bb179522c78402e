"""The option that has a real autopilot fly: its program is checked first."""

import argparse
import math
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from planfly.terminal.command_parser import CommandParser
from planfly.terminal.options import (
    autopilot_program,
    flight_options,
    flown_by_options,
    link_access,
    result_options,
    scenario_change,
    steering_options,
    stop_signals,
)
from planfly.terminal.parser import build_parser
from tests.setups import small_scenario
from world.errors import FlightError


def test_without_the_option_there_is_none() -> None:
    assert autopilot_program(argparse.Namespace(autopilot=None)) is None


def test_a_program_is_looked_at_first(tmp_path: Path) -> None:
    given = argparse.Namespace(autopilot=str(tmp_path / "none"))
    with pytest.raises(FlightError, match="none: no such file"):
        autopilot_program(given)
    file = tmp_path / "program"
    file.write_text("#!/bin/sh\n", encoding="utf-8")
    with pytest.raises(FlightError, match="not executable"):
        autopilot_program(argparse.Namespace(autopilot=str(file)))
    file.chmod(0o755)
    assert autopilot_program(argparse.Namespace(autopilot=str(file))) == file


# ----------------------------------------------------------------------
# Options that several commands take, and what each refuses.


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


# ----------------------------------------------------------------------
# Who may talk to a vehicle, from the command line, and how its command is ended.


def options(**changes: str | None) -> argparse.Namespace:
    return argparse.Namespace(
        **({"bind": "127.0.0.1:14580", "to": "127.0.0.1:14550", "allow": None, "sign_key": None} | changes)
    )


def test_addresses_are_split_and_normalised() -> None:
    access = link_access(options(bind="0.0.0.0:0", to="127.0.0.1:14550, [::1]:65535", allow="192.168.1.7, 10.0.0.2,"))
    assert access.bind == ("0.0.0.0", 0)
    assert access.to == (("127.0.0.1", 14550), ("::1", 65535))
    assert access.allowed == {"192.168.1.7", "10.0.0.2"}
    assert access.key is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bind": "127.0.0.1"}, "--bind 127.0.0.1: IP:PORT is expected"),
        ({"bind": "127.0.0.1:65536"}, "--bind 127.0.0.1:65536: IP:PORT is expected"),
        ({"to": "127.0.0.1:14550,"}, "--to : IP:PORT is expected"),
        ({"to": "14550"}, "--to 14550: IP:PORT is expected, such as 127.0.0.1:14550"),
        ({"to": "localhost:14550"}, "--to localhost: an IP address is expected"),
        ({"allow": "me"}, "--allow me: an IP address is expected"),
        # The link's own rule: nobody beyond this machine without a key or a list.
        ({"bind": "0.0.0.0:14580"}, "--bind 0.0.0.0:14580: beyond this machine"),
    ],
)
def test_what_is_no_address_names_its_option(changes: dict[str, str], message: str) -> None:
    with pytest.raises(FlightError) as caught:
        link_access(options(**changes))
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_asks_to_stop_and_its_handler_comes_back(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with stop_signals() as stopped:
        assert not stopped()
        os.kill(os.getpid(), number)
        assert stopped()
    assert signal.getsignal(number) is before
    with pytest.raises(RuntimeError, match="inside"), stop_signals():
        raise RuntimeError("inside")
    assert signal.getsignal(number) is before


# ----------------------------------------------------------------------
# Options change what they name in a scenario, and nothing else.

NONE = {"aircraft": None, "airspeed": None}


def changed(**options: Any) -> Any:
    return scenario_change(argparse.Namespace(**(NONE | options)))(
        small_scenario(wind={"speed_mps": 3.0, "from_deg": 200.0, "turbulence": "light"})
    )


def test_without_options_the_scenario_stays() -> None:
    plain = changed()
    assert (plain.wind.speed, plain.wind.turbulence) == (3.0, "light")
    assert math.degrees(plain.wind.from_course) % 360.0 == pytest.approx(200.0)
    assert (plain.flight.aircraft, plain.flight.airspeed_mps) == ("aerosonde", None)


def test_each_option_changes_what_it_names() -> None:
    flown = changed(aircraft="c172x", airspeed=45.0, guidance="l1", nav="gnss")
    assert (flown.flight.aircraft, flown.flight.airspeed_mps) == ("c172x", 45.0)
    assert (flown.flight.guidance, flown.flight.nav) == ("l1", "gnss")
    assert flown.wind.speed == 3.0
    windy = changed(wind=(7.0, 90.0), turbulence="moderate")
    assert (windy.wind.speed, windy.wind.turbulence) == (7.0, "moderate")
    # Wind from the east blows to the west.
    assert windy.wind.at(100.0) == pytest.approx((-7.0, 0.0), abs=1e-12)
    gusty = changed(wind=None, turbulence="none")
    assert (gusty.wind.speed, gusty.wind.turbulence) == (3.0, "none")


def test_parameters_mean_arduplane_and_a_law_of_guidance_takes_its_place() -> None:
    flown = changed(params="mine.parm").flight
    assert flown.steering == ("ardupilot", "path", "gnss")
    assert flown.params == str(Path("mine.parm").resolve())
    again = scenario_change(argparse.Namespace(guidance="l1"))(changed(params="mine.parm")).flight
    assert (again.params, again.steering) == (None, ("ideal", "l1", "perfect"))
    assert changed(params="mine.parm", nav="rtk").flight.steering.nav == "rtk"


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
    ],
)
def test_bad_values_get_one_line(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        build_parser().parse_args([words[0], "jacksboro", *words[1:]])
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_what_is_taken() -> None:
    args = build_parser().parse_args(
        ["campaign", "jacksboro", "--prove", "0.5", "--flights", "10000000", "--refly", "0"]
    )
    assert (args.prove, args.flights, args.refly) == (0.5, 10_000_000, 0)
    args = build_parser().parse_args(["winds", "x", "--directions", "72", "--most", "40"])
    assert (args.directions, args.most, args.prove) == (72, 40.0, 0.99)
