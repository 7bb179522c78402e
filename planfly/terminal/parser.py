"""The parser of the command line.  It imports nothing heavy: ``planfly --help`` answers at once."""

import argparse
from collections.abc import Callable
from typing import NoReturn

from planfly import __version__
from planfly.terminal.argument_types import (
    budget,
    count,
    flight_time,
    leg,
    port,
    positive,
    positive_count,
    problems,
    seed,
    speedup,
    threat,
    time_or_stations,
)
from planfly.terminal.campaign_options import add_campaigns
from planfly.terminal.exit_codes import BAD_INPUT, EXIT_CODES
from planfly.terminal.field_parser import LOGS, add_field_commands
from planfly.terminal.parser_options import (
    fence_option,
    field_log_options,
    flown_by_options,
    limit_options,
    overwrite_option,
    own_link_options,
    pilot_options,
    program_option,
    steering_options,
    world_options,
)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One line, as for every other bad input."""
        self.exit(BAD_INPUT, f"{self.prog}: {message} (see {self.prog} --help)\n")


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    parser = _Parser(
        prog="planfly",
        description="Will this plan really fly?  Plans a fixed-wing path over terrain and threats, flies it (or any "
        "mission file) in JSBSim, and gives a verdict with numbers.",
        epilog="example: planfly run jacksboro\n\n" + EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"planfly {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=_Parser)

    def command(name: str, summary: str, example: str) -> argparse.ArgumentParser:
        return commands.add_parser(
            name,
            help=summary,
            description=summary[0].upper() + summary[1:] + ".",
            epilog=f"example: {example}\n\n{EXIT_CODES}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )

    _add_run_and_plan(command)
    _add_export_and_fly(command)
    _add_log_commands(command)
    add_field_commands(command)
    _add_serve(command)
    _add_paper(command)
    add_campaigns(command)
    _add_aircraft(command)
    command("scenarios", "list the embedded scenarios, one line each", "planfly scenarios")
    return parser


_Command = Callable[[str, str, str], argparse.ArgumentParser]


def _add_run_and_plan(command: _Command) -> None:
    run = command("run", "plan, export, fly, log, judge and report", "planfly run jacksboro --seed 3 --out my-run")
    run.add_argument(
        "scenario",
        metavar="SCENARIO",
        nargs="?",
        default="jacksboro",
        help="TOML file or embedded name (default: jacksboro)",
    )
    run.add_argument("--out", metavar="DIR", help="where the files go (default: runs/<name>-seed<N>, replaced)")
    run.add_argument("--seed", metavar="N", type=seed, help="of planner and turbulence (default: the scenario's, or 1)")
    run.add_argument(
        "--refine",
        metavar="N",
        type=count,
        default=0,
        help="where it does not fly, tighten and try again, up to N times",
    )
    steering_options(run)
    program_option(run)
    limit_options(run)
    overwrite_option(run)
    # Names and summaries only: what they stand for is imported with the command.
    from planner.search.algorithms import algorithm_lines

    plan = command(
        "plan",
        "plan only, or again in flight",
        "planfly plan jacksboro --seed 3 --out plan.json\n"
        "         planfly plan jacksboro --from plan.json --at-leg 4 --add-threat=-2000,1500,800,1500\n\n"
        f"algorithms:\n{algorithm_lines()}",
    )
    plan.add_argument("scenario", metavar="SCENARIO", help="TOML file or embedded name")
    plan.add_argument("--seed", metavar="N", type=seed, help="of the planner (default: the scenario's, or 1)")
    plan.add_argument(
        "--algorithm",
        metavar="A",
        help="the planner's algorithm, in place of the scenario's (see below)",
    )
    plan.add_argument(
        "--budget",
        metavar="N|Xs",
        type=budget,
        help="end after N evaluations or X seconds with the best plan so far (as Ctrl-C does); a plan under a budget "
        "in seconds may differ from run to run",
    )
    plan.add_argument("--from", dest="old", metavar="PLAN.json", help="plan again in flight: the plan being flown")
    plan.add_argument("--at-leg", metavar="K", type=leg, help="with --from: legs before K are flown and stay")
    plan.add_argument(
        "--add-threat",
        metavar="EAST,NORTH,KILL,DETECTION",
        type=threat,
        action="append",
        help="with --from: a threat that has popped up, in m; --add-threat=-... where EAST is negative; repeatable",
    )
    pilot_options(plan)
    plan.add_argument("--out", metavar="FILE", help="the plan file (default: runs/<name>-seed<N>/plan.json, replaced)")
    overwrite_option(plan)


def _add_export_and_fly(command: _Command) -> None:
    export = command(
        "export",
        "write a plan, mission or log in the form that a suffix names",
        "planfly export plan.json mission.waypoints mission.fence mission.plan plan.kml",
    )  # fmt: skip
    export.add_argument(
        "plan", metavar="PLAN.json|MISSION|LOG.mcap", help="a plan that planfly made, a mission file, or a flight log"
    )
    export.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="files to write: .waypoints, .plan, .fence, .rally, .kml, .gpx;"
        " of a log also .csv, .parquet (extra planfly[parquet]), .tlog (MAVLink), .ulg (PX4)",
    )
    fence_option(export)
    overwrite_option(export)
    fly = command(
        "fly", "fly a plan or any mission file, write the log, end with the verdict",
        "planfly fly mission.waypoints --terrain jacksboro --wind 8,270 --turbulence light",
    )  # fmt: skip
    fly.add_argument("mission", metavar="MISSION", help="plan.json, .waypoints or .plan")
    world_options(fly)
    flown_by_options(fly)
    fly.add_argument(
        "--log", metavar="FILE", help="the flight log (default: runs/<mission>-seed<N>/flight.mcap, replaced)"
    )
    fly.add_argument("--seed", metavar="N", type=seed, help="of the turbulence (default: the plan's, or 1)")
    fly.add_argument(
        "--log-hz", metavar="HZ", type=int, choices=(60, 30, 20, 10), default=60,
        help="rows a second in the log: 60 (default), 30, 20 or 10; the verdict is that of these rows",
    )  # fmt: skip
    steering_options(fly)
    program_option(fly)
    limit_options(fly)
    overwrite_option(fly)


def _add_log_commands(command: _Command) -> None:
    check = command(
        "check", "judge a flight from its log, of the field too, or a mission file by its geometry, without flying",
        "planfly check flight.mcap --json verdict.json",
    )  # fmt: skip
    check.add_argument(
        "file", metavar="LOG|MISSION", help=f"a flight log (.mcap, or {LOGS}), or plan.json, .waypoints, .plan"
    )
    field_log_options(check)
    world_options(check)
    flown_by_options(check)
    pilot_options(check)
    check.add_argument("--json", metavar="FILE", help="write the verdict there")
    overwrite_option(check)
    _add_replay_and_recover(command)
    report = command(
        "report",
        "draw the figures and write report.html from a log alone, or write the layout for Foxglove",
        "planfly report flight.mcap --out report --svg",
    )
    report.add_argument("log", metavar="LOG.mcap", nargs="?", help="a flight log")
    report.add_argument(
        "--out", metavar="DIR", help="where the files go (default: <log>-report beside the log, replaced)"
    )
    report.add_argument("--svg", action="store_true", help="write the figures as SVG, too")
    report.add_argument("--layout", metavar="FILE", help="write the layout file for Foxglove there, and nothing else")
    overwrite_option(report)
    compare = command(
        "compare", "lay two flights over each other: a table of differences, and pictures",
        "planfly compare calm.mcap windy.mcap --out both",
    )  # fmt: skip
    compare.add_argument("first", metavar="A.mcap", help="a flight log")
    compare.add_argument("second", metavar="B.mcap", help="another")
    compare.add_argument(
        "--out", metavar="DIR", help="write pictures and compare.html there (default: the table alone)"
    )
    compare.add_argument("--svg", action="store_true", help="write the pictures as SVG, too")
    overwrite_option(compare)


def _add_replay_and_recover(command: _Command) -> None:
    replay = command(
        "replay",
        "replay a flight from its log alone: on a terminal as instruments, elsewhere as a timeline",
        "planfly replay flight.mcap --speed 20 --from 60",
    )
    replay.add_argument("log", metavar="LOG.mcap", help="a flight log")
    replay.add_argument(
        "--speed",
        metavar="X",
        type=positive,
        help="at X times real time (default: 1 on a terminal and into Foxglove; a film of 20 s; else at once)",
    )
    replay.add_argument("--at-once", action="store_true", help="the timeline at once, on a terminal too")
    replay.add_argument("--from", dest="start", metavar="S", type=flight_time, help="from this time of the flight, s")
    replay.add_argument(
        "--to",
        metavar="S|IP:PORT,...",
        type=time_or_stations,
        help="to this time of the flight, s; or play the log into the ground stations that listen there",
    )
    own_link_options(replay, bind="127.0.0.1:0")
    replay.add_argument(
        "--wait", metavar="S", type=positive, help="wait S seconds for a ground station (10) or Foxglove (without end)"
    )
    replay.add_argument(
        "--movie", metavar="FILE|DIR", help="draw it: FILE.gif, FILE.mp4 (needs ffmpeg), or DIR for PNG frames"
    )
    replay.add_argument(
        "--foxglove", action="store_true",
        help="play it to Foxglove on this machine over WebSocket; needs the extra planfly[foxglove], and a viewer that"
        " speaks foxglove.sdk.v1 (Foxglove since 2025, Lichtblick after 1.21)",
    )  # fmt: skip
    replay.add_argument("--port", metavar="N", type=port, default=8765, help="of --foxglove (8765; 0: a free one)")
    overwrite_option(replay)
    recover = command(
        "recover", "make an unfinished or damaged log whole again, as far as it can be read",
        "planfly recover flight.mcap --out whole.mcap",
    )  # fmt: skip
    recover.add_argument("log", metavar="LOG.mcap", help="a flight log")
    recover.add_argument("--out", metavar="FILE", help="the new log (default: <log>-recovered.mcap beside it)")
    overwrite_option(recover)


def _add_serve(command: _Command) -> None:
    serve = command(
        "serve", "be a MAVLink vehicle that a ground station uploads to, arms, starts and watches",
        "planfly serve mission.waypoints --terrain jacksboro",
    )  # fmt: skip
    serve.add_argument("mission", metavar="MISSION", nargs="?", help="plan.json, .waypoints or .plan to begin with")
    world_options(serve)
    steering_options(serve)
    serve.add_argument(
        "--to", metavar="IP:PORT,...", default="127.0.0.1:14550",
        help="where ground stations listen (default: 127.0.0.1:14550)",
    )  # fmt: skip
    own_link_options(serve, bind="127.0.0.1:14580")
    serve.add_argument(
        "--speed", metavar="X", type=speedup, default=1.0, help="fly at X times real time, 0.1 to 100 (default: 1)"
    )
    serve.add_argument(
        "--log", metavar="DIR", default="runs/serve", help="folder of the flight logs (default: runs/serve)"
    )


def _add_paper(command: _Command) -> None:
    paper = command(
        "paper",
        "plan the paper's section V again: tables and figures of seeded plans in three encodings",
        "planfly paper --problems 7,60 --runs 5 --out my-paper",
    )
    paper.add_argument(
        "--problems", metavar="N,...", type=problems, default=(7, 15, 30, 60), help="threats (default: 7,15,30,60)"
    )
    paper.add_argument("--runs", metavar="N", type=positive_count, default=15, help="seeds 1..N of each (default: 15)")
    paper.add_argument(
        "--algorithm", metavar="A", default="umda", help="in place of the paper's umda, beside the two baselines"
    )
    paper.add_argument("--jobs", metavar="N", type=positive_count, help="processes (default: one a core)")
    paper.add_argument("--out", metavar="DIR", help="where tables and figures go (default: runs/paper, replaced)")
    overwrite_option(paper)


def _add_aircraft(command: _Command) -> None:
    aircraft = command(
        "aircraft", "show an aircraft: mass, trims, modes, envelope and step responses; without a name, list them",
        "planfly aircraft aerosonde --out aerosonde",
    )  # fmt: skip
    aircraft.add_argument("name", metavar="NAME", nargs="?", help="embedded name, or a folder (with a slash)")
    aircraft.add_argument("--out", metavar="DIR", help="where the pictures go (default: runs/aircraft-NAME, replaced)")
    aircraft.add_argument("--motor-braking", action="store_true", help="let the motor brake in descents")
    overwrite_option(aircraft)
