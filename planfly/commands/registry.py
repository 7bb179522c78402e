"""List the commands, from which the parser, the help, the schemas and the dispatch are made.

A command is two functions of a module of this package: ``add_NAME_parser`` adds its parser to the parser of the
command line, and ``NAME`` takes the parsed arguments, calls the API (`planfly.terminal.options.call_api`), writes the
results to standard output and the progress to standard error, and returns the exit code. The API compiles the kernels
that it needs. All modules are light: the code that a command needs is imported when the command runs.
"""

import argparse
import json
from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple

from planfly.commands import (
    aircraft,
    battery,
    campaigns,
    check,
    compare,
    export,
    fly,
    ground_risk,
    imported_logs,
    link,
    new,
    paper,
    plan,
    predict,
    recover,
    replay,
    report,
    returns,
    run,
    serve,
    shell,
    studio,
    survey,
    terrain,
    window,
)
from planfly.terminal.command_parser import LineParser


class Command(NamedTuple):
    """A command of planfly.

    section: the heading above the command in ``planfly --help``.
    add_parser: adds the parser of the command to that of the command line.
    run: executes the command, and returns the exit code.
    answer: class of the answer with --json, in `planfly.terminal.answers`, or "MODULE.CLASS" in `planfly.terminal`; ""
        for a command without --json.
    """

    name: str
    section: str
    add_parser: Callable[[LineParser], None]
    run: Callable[[argparse.Namespace], int]
    answer: str = ""


# Section titles of the help.
_PLAN_AND_FLY = "plan and fly"
_JUDGE_AND_SHOW = "judge and show"
_AUTOPILOT_LOGS = "logs of autopilots"
_MANY_FLIGHTS = "many flights"
_AIRCRAFT = "aircraft, scenarios and terrain"
_HELP = "help"

# All commands, in the order of the help.
COMMANDS = (
    Command("run", _PLAN_AND_FLY, run.add_run_parser, run.run, "RunAnswer"),
    Command("plan", _PLAN_AND_FLY, plan.add_plan_parser, plan.plan, "plan_answers.PlanDocument"),
    Command("export", _PLAN_AND_FLY, export.add_export_parser, export.export, "ExportAnswer"),
    Command("fly", _PLAN_AND_FLY, fly.add_fly_parser, fly.fly, "FlyAnswer"),
    Command("studio", _PLAN_AND_FLY, studio.add_studio_parser, studio.studio),
    Command("serve", _PLAN_AND_FLY, serve.add_serve_parser, serve.serve),
    Command("check", _JUDGE_AND_SHOW, check.add_check_parser, check.check, "verdict_answers.CheckDocument"),
    Command("returns", _JUDGE_AND_SHOW, returns.add_returns_parser, returns.returns, "returns_answers.ReturnsAnswer"),
    Command("link", _JUDGE_AND_SHOW, link.add_link_parser, link.link, "link_answers.LinkAnswer"),
    Command("survey", _JUDGE_AND_SHOW, survey.add_survey_parser, survey.survey, "survey_answers.SurveyAnswer"),
    Command("report", _JUDGE_AND_SHOW, report.add_report_parser, report.report, "ReportAnswer"),
    Command("compare", _JUDGE_AND_SHOW, compare.add_compare_parser, compare.compare, "CompareDocument"),
    Command("replay", _JUDGE_AND_SHOW, replay.add_replay_parser, replay.replay, "ReplayAnswer"),
    Command("recover", _JUDGE_AND_SHOW, recover.add_recover_parser, recover.recover, "RecoverAnswer"),
    Command("import", _AUTOPILOT_LOGS, imported_logs.add_import_log_parser, imported_logs.import_log, "ImportAnswer"),
    Command("refly", _AUTOPILOT_LOGS, imported_logs.add_refly_parser, imported_logs.refly, "ReflyAnswer"),
    Command("predict", _AUTOPILOT_LOGS, predict.add_predict_parser, predict.predict, "PredictAnswer"),
    Command("campaign", _MANY_FLIGHTS, campaigns.add_campaign_parser, campaigns.campaign, "CampaignDocument"),
    Command("winds", _MANY_FLIGHTS, campaigns.add_winds_parser, campaigns.winds, "WindsDocument"),
    Command("battery", _MANY_FLIGHTS, battery.add_battery_parser, battery.battery, "battery_answers.BatteryAnswer"),
    Command("window", _MANY_FLIGHTS, window.add_window_parser, window.window, "window_answers.WindowAnswer"),
    Command(
        "ground-risk",
        _MANY_FLIGHTS,
        ground_risk.add_ground_risk_parser,
        ground_risk.ground_risk,
        "ground_risk_answers.GroundRiskAnswer",
    ),
    Command("paper", _MANY_FLIGHTS, paper.add_paper_parser, paper.paper, "PaperAnswer"),
    Command("aircraft", _AIRCRAFT, aircraft.add_aircraft_parser, aircraft.aircraft, "AircraftAnswer"),
    Command("scenarios", _AIRCRAFT, shell.add_scenarios_parser, shell.scenarios, "ScenariosAnswer"),
    Command("new", _AIRCRAFT, new.add_new_parser, new.new, "NewAnswer"),
    Command("terrain", _AIRCRAFT, terrain.add_terrain_parser, terrain.terrain, "TerrainAnswer"),
    Command("help", _HELP, shell.add_show_help_parser, shell.show_help),
    Command("completion", _HELP, shell.add_completion_parser, shell.completion),
)
# The same by name.
COMMANDS_BY_NAME = {command.name: command for command in COMMANDS}

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
