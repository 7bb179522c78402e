from pathlib import Path

import pytest

from planfly.commands.field_logs.field_options import field_options
from planfly.terminal.parser import build_parser
from world.errors import ScenarioError


def test_options_become_what_a_person_says() -> None:
    line = ["check", "a.BIN", "--plan", "p.plan", "--flight", "2", "--datum", "amsl", "--aircraft", "c172x"]
    options = field_options(build_parser().parse_args([*line, "--wind", "5,270"]))
    assert (options.plan, options.number, options.datum) == (Path("p.plan"), 2, "amsl")
    assert (options.aircraft, options.wind_given, options.scenario) == ("c172x", True, None)


@pytest.mark.parametrize("given", [["--params", "a.parm"], ["--guidance", "l1"], ["--airspeed", "20"]])
def test_what_a_flown_log_cannot_take_is_refused(given: list[str]) -> None:
    with pytest.raises(ScenarioError, match=f"a.BIN: {given[0]}: a flight of the field"):
        field_options(build_parser().parse_args(["check", "a.BIN", *given]))
