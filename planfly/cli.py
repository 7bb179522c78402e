"""Run a command of the command line, print an error in one line, and return the exit code.

The list of commands determines the parser, the help and the dispatch.  A command is two functions of a module of
`planfly.commands`: ``add_NAME_parser`` adds its parser to the parser of the command line, and ``NAME`` takes the parsed
arguments, calls the API with the given options (``args.options``), writes the results to standard output and the
progress to standard error, and returns the exit code.  The API compiles the kernels that it needs.  All these modules
are light: the code that a command needs is imported when the command runs.
"""

import argparse
import errno
import os
import sys
from collections.abc import Callable, Sequence
from typing import NamedTuple

from planfly._version import __version__
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
from planfly.runtime.process_setup import prepare_process, with_large_stack
from planfly.terminal.arguments import COMPLETION_VARIABLE, complete_for_shell
from planfly.terminal.command_parser import (
    BAD_INPUT,
    FAULT,
    INTERRUPTED,
    CommandParser,
    LineParser,
    UsageExit,
    colour_text,
    error_text,
)
from planfly.terminal.output import (
    open_standard_streams,
    printable,
    redirect_output,
    safe_streams,
    write_error_if_requested,
    write_usage_error_if_requested,
)
from planfly.terminal.signal_watch import end_on_signals, end_process
from world.errors import CrashError, PlanflyError
from world.interruption import Interrupted


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

# First steps, at the end of the help.
_FIRST_STEPS = """\
first steps:
  planfly run jacksboro                        plan, fly, judge and report the demo
  planfly fly mission.waypoints --terrain DEM  fly a mission of your own over your elevation file
  planfly help fly                             everything about one command"""

# Errors of the machine: too many open files in the process or the system, not enough memory, and disk errors.
_MACHINE_ERRORS = (errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EIO)


# Errors that end a command with one line: bad input, errors of the machine, and interruptions.
_REPORTED_ERRORS = (PlanflyError, OSError, MemoryError, KeyboardInterrupt)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command, and return its exit code.

    argv: arguments without the program's name; None for the arguments of the process.  With None this function does not
    return: the process ends with the exit code of the command, or after SIGINT or SIGTERM.

    Bad input, errors of the machine and interruptions are reported in one line.  Errors are also written to the files
    of --json and --junit, so that files of an earlier run are not mistaken for this run's.
    """
    if argv is None:
        prepare_process()
        open_standard_streams()
        if COMPLETION_VARIABLE in os.environ:
            complete_for_shell(build_parser())
        with end_on_signals() as received_signals:
            try:
                code = with_large_stack(lambda: main(sys.argv[1:]))
            except Exception:
                if not received_signals:
                    raise
                # An interrupted compiler may fail with any error.
                code = _report_error(128 + received_signals[0], "interrupted")
        # End the process directly, because the shutdown of an interpreter with compiled code takes up to a second.
        end_process(code)
    command_parser = None
    try:
        with safe_streams():
            parser = build_parser()
            try:
                args = parser.parse_args(argv)
            except UsageExit as usage:
                write_usage_error_if_requested(argv, usage.line, parser.commands)
                raise
            command_parser = parser.commands[args.command]
            with redirect_output(args):
                try:
                    return COMMANDS_BY_NAME[args.command].run(args)
                except _REPORTED_ERRORS as error:
                    write_error_if_requested(args, *_exit_code_and_text(error, command_parser))
                    raise
                except Exception as error:
                    # An error of planfly itself; Python prints its traceback and ends with exit code 1.
                    write_error_if_requested(args, FAULT, f"internal error: {type(error).__name__}: {error}")
                    raise
    except _REPORTED_ERRORS as error:
        return _report_error(*_exit_code_and_text(error, command_parser))


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
        command.add_parser(parser)
    return parser


def _exit_code_and_text(error: BaseException, parser: CommandParser | None = None) -> tuple[int, str]:
    """Return the exit code of the command, and the line to print, for one of `_REPORTED_ERRORS`.

    parser: parser of the command, whose options replace keywords in the text of a PlanflyError.
    """
    if isinstance(error, PlanflyError):
        # Errors of the machine are, for example, too many open files or a disk error.
        cause = error.__cause__
        is_machine_error = isinstance(cause, OSError) and cause.errno in _MACHINE_ERRORS
        code = FAULT if isinstance(error, CrashError) or is_machine_error else BAD_INPUT
        return code, str(error) if parser is None else error_text(error, parser)
    if isinstance(error, OSError):
        return FAULT, f"{error.filename or 'file'}: {error.strerror or error}"
    if isinstance(error, MemoryError):
        text = str(error)
        return FAULT, f"not enough memory: {text}" if text and "bad_alloc" not in text else "not enough memory"
    return 128 + error.number if isinstance(error, Interrupted) else INTERRUPTED, "interrupted"


def _report_error(code: int, message: object) -> int:
    """Print an error in one line on standard error, and return the exit code."""
    print(colour_text(f"planfly: {printable(str(message))}", "bad", sys.stderr), file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
