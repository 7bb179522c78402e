"""List the commands, from which the parser, the help and the dispatch are made.

A command is two functions of a module of this package: ``add_NAME_parser`` adds its parser to the parser of the
command line, and ``NAME`` takes the parsed arguments, calls the API (`planfly.terminal.options.call_api`), writes the
results to standard output and the progress to standard error, and returns the exit code. The API compiles the kernels
that it needs. All modules are light: the code that a command needs is imported when the command runs.
"""

import argparse
from collections.abc import Callable
from typing import NamedTuple

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
    """

    name: str
    section: str
    add_parser: Callable[[LineParser], None]
    run: Callable[[argparse.Namespace], int]


# Section titles of the help.
_PLAN_AND_FLY = "plan and fly"
_JUDGE_AND_SHOW = "judge and show"
_AUTOPILOT_LOGS = "logs of autopilots"
_MANY_FLIGHTS = "many flights"
_AIRCRAFT = "aircraft, scenarios and terrain"
_HELP = "help"

# All commands, in the order of the help.
COMMANDS = (
    Command("run", _PLAN_AND_FLY, run.add_run_parser, run.run),
    Command("plan", _PLAN_AND_FLY, plan.add_plan_parser, plan.plan),
    Command("export", _PLAN_AND_FLY, export.add_export_parser, export.export),
    Command("fly", _PLAN_AND_FLY, fly.add_fly_parser, fly.fly),
    Command("studio", _PLAN_AND_FLY, studio.add_studio_parser, studio.studio),
    Command("serve", _PLAN_AND_FLY, serve.add_serve_parser, serve.serve),
    Command("check", _JUDGE_AND_SHOW, check.add_check_parser, check.check),
    Command("returns", _JUDGE_AND_SHOW, returns.add_returns_parser, returns.returns),
    Command("link", _JUDGE_AND_SHOW, link.add_link_parser, link.link),
    Command("survey", _JUDGE_AND_SHOW, survey.add_survey_parser, survey.survey),
    Command("report", _JUDGE_AND_SHOW, report.add_report_parser, report.report),
    Command("compare", _JUDGE_AND_SHOW, compare.add_compare_parser, compare.compare),
    Command("replay", _JUDGE_AND_SHOW, replay.add_replay_parser, replay.replay),
    Command("recover", _JUDGE_AND_SHOW, recover.add_recover_parser, recover.recover),
    Command("import", _AUTOPILOT_LOGS, imported_logs.add_import_log_parser, imported_logs.import_log),
    Command("refly", _AUTOPILOT_LOGS, imported_logs.add_refly_parser, imported_logs.refly),
    Command("predict", _AUTOPILOT_LOGS, predict.add_predict_parser, predict.predict),
    Command("campaign", _MANY_FLIGHTS, campaigns.add_campaign_parser, campaigns.campaign),
    Command("winds", _MANY_FLIGHTS, campaigns.add_winds_parser, campaigns.winds),
    Command("battery", _MANY_FLIGHTS, battery.add_battery_parser, battery.battery),
    Command("window", _MANY_FLIGHTS, window.add_window_parser, window.window),
    Command("ground-risk", _MANY_FLIGHTS, ground_risk.add_ground_risk_parser, ground_risk.ground_risk),
    Command("paper", _MANY_FLIGHTS, paper.add_paper_parser, paper.paper),
    Command("aircraft", _AIRCRAFT, aircraft.add_aircraft_parser, aircraft.aircraft),
    Command("scenarios", _AIRCRAFT, shell.add_scenarios_parser, shell.scenarios),
    Command("new", _AIRCRAFT, new.add_new_parser, new.new),
    Command("terrain", _AIRCRAFT, terrain.add_terrain_parser, terrain.terrain),
    Command("help", _HELP, shell.add_show_help_parser, shell.show_help),
    Command("completion", _HELP, shell.add_completion_parser, shell.completion),
)
# The same by name.
COMMANDS_BY_NAME = {command.name: command for command in COMMANDS}
