"""List the commands, from which the parser, the help, the schemas and the dispatch are made.

A command is a module of this package with two functions: ``add_NAME_parser`` adds its parser to the parser of the
command line, and ``NAME`` takes the parsed arguments, calls the API (`call_api`), writes the results to standard output
and the progress to standard error, and returns the exit code. The API compiles the kernels that it needs.
All modules are light: the code that a command needs is imported when the command runs.
"""

import argparse
import inspect
import json
from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple, TypeVar

from planfly._version import __version__
from planfly.terminal.command_parser import LineParser

Result = TypeVar("Result")


class Command(NamedTuple):
    """A command of planfly.

    section: the heading above the command in ``planfly --help``.
    answer: class of the answer with --json, in `planfly.terminal.answers`, or "MODULE.CLASS" in `planfly.terminal`; ""
        for a command without --json.
    module, function: names in this package; "" if they equal the name of the command.
    """

    name: str
    section: str
    answer: str = ""
    module: str = ""
    function: str = ""

    def load(self, name_format: str = "{}") -> Any:
        """Import the command's module, and return the function of this command.

        name_format: "{}" for the function that executes the command, "add_{}_parser" for the one that adds its parser.
        """
        module = import_module(f"planfly.commands.{self.module or self.name}")
        return getattr(module, name_format.format(self.function or self.name))


# Section titles of the help.
_PLAN_AND_FLY = "plan and fly"
_JUDGE_AND_SHOW = "judge and show"
_AUTOPILOT_LOGS = "logs of autopilots"
_MANY_FLIGHTS = "many flights"
_AIRCRAFT = "aircraft, scenarios and terrain"
_HELP = "help"

# All commands, in the order of the help.
COMMANDS = (
    Command("run", _PLAN_AND_FLY, "RunAnswer"),
    Command("plan", _PLAN_AND_FLY, "plan_answers.PlanDocument"),
    Command("export", _PLAN_AND_FLY, "ExportAnswer"),
    Command("fly", _PLAN_AND_FLY, "FlyAnswer"),
    Command("studio", _PLAN_AND_FLY),
    Command("serve", _PLAN_AND_FLY),
    Command("check", _JUDGE_AND_SHOW, "verdict_answers.CheckDocument"),
    Command("returns", _JUDGE_AND_SHOW, "returns_answers.ReturnsAnswer"),
    Command("link", _JUDGE_AND_SHOW, "link_answers.LinkAnswer"),
    Command("survey", _JUDGE_AND_SHOW, "survey_answers.SurveyAnswer"),
    Command("report", _JUDGE_AND_SHOW, "ReportAnswer"),
    Command("compare", _JUDGE_AND_SHOW, "CompareDocument"),
    Command("replay", _JUDGE_AND_SHOW, "ReplayAnswer"),
    Command("recover", _JUDGE_AND_SHOW, "RecoverAnswer"),
    Command("import", _AUTOPILOT_LOGS, "ImportAnswer", "imported_logs", "import_log"),
    Command("refly", _AUTOPILOT_LOGS, "ReflyAnswer", "imported_logs"),
    Command("predict", _AUTOPILOT_LOGS, "PredictAnswer"),
    Command("campaign", _MANY_FLIGHTS, "CampaignDocument", "campaigns"),
    Command("winds", _MANY_FLIGHTS, "WindsDocument", "campaigns"),
    Command("battery", _MANY_FLIGHTS, "battery_answers.BatteryAnswer"),
    Command("window", _MANY_FLIGHTS, "window_answers.WindowAnswer"),
    Command("ground-risk", _MANY_FLIGHTS, "ground_risk_answers.GroundRiskAnswer", "ground_risk", "ground_risk"),
    Command("paper", _MANY_FLIGHTS, "PaperAnswer"),
    Command("aircraft", _AIRCRAFT, "AircraftAnswer"),
    Command("scenarios", _AIRCRAFT, "ScenariosAnswer", "shell"),
    Command("new", _AIRCRAFT, "NewAnswer"),
    Command("terrain", _AIRCRAFT, "TerrainAnswer"),
    Command("help", _HELP, module="shell", function="show_help"),
    Command("completion", _HELP, module="shell"),
)
# The same by name.
COMMANDS_BY_NAME = {command.name: command for command in COMMANDS}

_FIRST_STEPS = """\
first steps:
  planfly run jacksboro                        plan, fly, judge and report the demo
  planfly fly mission.waypoints --terrain DEM  fly a mission of your own over your elevation file
  planfly help fly                             everything about one command"""


def build_parser() -> LineParser:
    """Return the parser for the whole command line."""
    parser = LineParser(
        __version__,
        "Will this plan really fly?  Plans a fixed-wing path over terrain and threats,\n"
        "flies it (or any mission file) in JSBSim, and gives a verdict with numbers.",
        _FIRST_STEPS,
    )
    for command in COMMANDS:
        parser.start_section(command.section)
        command.load("add_{}_parser")(parser)
    return parser


def call_api(function: Callable[..., Result], args: argparse.Namespace, **overrides: Any) -> Result:
    """Call a function of the API with the options that match its keywords, and return its result.

    An option that was not given (None) leaves its keyword at the default.
    overrides: keywords that override the options.

    >>> call_api(lambda *, seed=1, out="here": (seed, out), argparse.Namespace(seed=3, out=None, json=None))
    (3, 'here')
    """
    parameters = inspect.signature(function).parameters
    options = {name: value for name, value in vars(args).items() if name in parameters} | overrides
    return function(**{name: value for name, value in options.items() if value is not None})


# ----------------------------------------------------------------------
# Make JSON schemas of the answers of commands.

# Identifier of JSON Schema, draft 2020-12.
_JSON_SCHEMA_DRAFT = "https://json-schema.org/draft/2020-12/schema"


def commands_with_json() -> list[str]:
    """Return the names of the commands with the option ``--json``."""
    return [command.name for command in COMMANDS if command.answer]


def answer_schema(name: str) -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a command's answer.

    Raises KeyError for a command without an answer.

    >>> sorted(answer_schema("scenarios")["properties"])
    ['exit_code', 'scenarios', 'schema']
    """
    # Imported here: only this function needs schemas.
    from pydantic import TypeAdapter

    if name not in commands_with_json():
        raise KeyError(name)
    module, _, answer = COMMANDS_BY_NAME[name].answer.rpartition(".")
    answers = import_module(f"planfly.terminal.{module or 'answers'}")
    schema = TypeAdapter(getattr(answers, answer)).json_schema(mode="serialization")
    return {"$schema": _JSON_SCHEMA_DRAFT, **schema, "title": f"planfly {name} --json"}


def answer_objects(schema: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the schemas of the objects that an answer may be.

    There are several if the options choose between several objects.

    >>> [one["properties"]["schema"]["const"] for one in answer_objects(answer_schema("check"))]
    ['planfly.verdict/3', 'planfly.verdicts/1']
    """
    refs = [option["$ref"].rpartition("/")[2] for option in schema.get("anyOf", ())]
    return [schema["$defs"][ref] for ref in refs] or [schema]


def schema_text(name: str) -> str:
    """Return the JSON schema of a command's answer as the text of a file."""
    return json.dumps(answer_schema(name), indent=1) + "\n"
