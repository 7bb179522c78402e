"""The parser of the command line.  It imports nothing heavy: ``planfly --help`` answers at once."""

from planfly import __version__
from planfly.terminal.argument_types import budget, count, leg, positive_count, problems, seed, speedup, threat
from planfly.terminal.campaign_options import add_campaigns
from planfly.terminal.command_parser import CommandParser, LineParser, OptionTaker
from planfly.terminal.completion import (
    MISSIONS,
    SHELLS,
    aircraft_words,
    completed,
    files,
    scenario_words,
)
from planfly.terminal.field_parser import add_field_commands
from planfly.terminal.log_parser import add_log_commands
from planfly.terminal.parser_options import (
    fence_option,
    flight_options,
    flown_by_options,
    json_option,
    own_link_options,
    pilot_options,
    result_options,
    steering_options,
    terrain_option,
    world_options,
)

_FIRST_STEPS = """\
first steps:
  planfly run jacksboro                        plan, fly, judge and report the demo
  planfly fly mission.waypoints --terrain DEM  fly a mission of your own over your elevation file
  planfly help fly                             all that a command takes"""
_COMPLETION = """\
to complete in this shell, and in those to come:
  bash   eval "$(planfly completion bash)", in ~/.bashrc
  zsh    eval "$(planfly completion zsh)", in ~/.zshrc after compinit
  fish   planfly completion fish > ~/.config/fish/completions/planfly.fish"""


def build_parser() -> LineParser:
    """The parser of the whole command line."""
    line = LineParser(
        __version__,
        "Will this plan really fly?  Plans a fixed-wing path over terrain and threats,\n"
        "flies it (or any mission file) in JSBSim, and gives a verdict with numbers.",
        _FIRST_STEPS,
    )
    _add_run(line)
    _add_plan(line)
    _add_export(line)
    _add_fly(line)
    add_log_commands(line)
    add_field_commands(line)
    _add_serve(line)
    add_campaigns(line.command)
    _add_paper(line)
    _add_aircraft(line)
    listing = line.command("scenarios", "list the embedded scenarios, one line each", "planfly scenarios")
    json_option(listing.group("results"), "scenarios")
    _add_own(line)
    return line


def _add_run(line: LineParser) -> None:
    run = line.command(
        "run",
        "plan, export, fly, log, judge and report",
        "planfly run jacksboro --seed 3 --out my-run",
        "planfly run tight --wind 8,270 --turbulence light --refine 3",
    )
    _scenario(run, nargs="?", default="jacksboro", help="TOML file or embedded name (default: jacksboro)")
    planning = run.group("planning")
    planning.add_argument(
        "--seed", metavar="N", type=seed, help="seed of planner and turbulence (default: the scenario's, or 1)"
    )
    planning.add_argument(
        "--refine",
        metavar="N",
        type=count,
        default=0,
        help="where it does not fly, tighten and try again, up to N times (default: 0)",
    )
    terrain_option(planning)
    flight_options(run)
    _log_rate(run.group("the log"))
    result_options(run, "where the files go (default: runs/<name>-seed<N>, replaced)")


def _scenario(parser: CommandParser, **settings: object) -> None:
    completed(parser.add_argument("scenario", metavar="SCENARIO", **settings), scenario_words)  # type: ignore[arg-type]


def _log_rate(group: OptionTaker) -> None:
    group.add_argument(
        "--log-hz", metavar="HZ", type=int, choices=(60, 30, 20, 10), default=60,
        help="rows a second in the log: 60 (default), 30, 20 or 10; the verdict is that of these rows",
    )  # fmt: skip


def _add_plan(line: LineParser) -> None:
    # Names and summaries only: what they stand for is imported with the command.
    from planner.search.algorithms import algorithm_lines

    plan = line.command(
        "plan",
        "plan only, or again in flight",
        "planfly plan jacksboro --seed 3 --out plan.json",
        "planfly plan jacksboro --from plan.json --at-leg 4 --add-threat=-2000,1500,800,1500",
        more=f"algorithms:\n{algorithm_lines()}",
    )
    _scenario(plan, help="TOML file or embedded name")
    planning = plan.group("planning")
    planning.add_argument("--seed", metavar="N", type=seed, help="seed of the planner (default: the scenario's, or 1)")
    planning.add_argument(
        "--algorithm",
        metavar="A",
        help="the planner's algorithm, in place of the scenario's (see below)",
    )
    planning.add_argument(
        "--budget",
        metavar="N|Xs",
        type=budget,
        help="end after N evaluations or X seconds with the best plan so far (as Ctrl-C does); a plan under a budget "
        "in seconds may differ from run to run",
    )
    again = plan.group("planning again in flight")
    completed(
        again.add_argument("--from", dest="old", metavar="PLAN.json", help="the plan that is being flown"),
        files("json"),
    )
    again.add_argument("--at-leg", metavar="K", type=leg, help="legs before K are flown and stay")
    again.add_argument(
        "--add-threat",
        metavar="EAST,NORTH,KILL,DETECTION",
        type=threat,
        action="append",
        help="a threat that has popped up, in m; --add-threat=-... where EAST is negative; repeatable",
    )
    flown_by_options(plan)
    pilot_options(plan)
    result_options(plan, "the plan file (default: runs/<name>-seed<N>/plan.json, replaced)", "FILE")


def _add_export(line: LineParser) -> None:
    export = line.command(
        "export",
        "write a plan, mission or log in the form that a suffix names",
        "planfly export plan.json mission.waypoints mission.fence mission.plan plan.kml",
    )
    completed(
        export.add_argument(
            "plan", metavar="PLAN.json|MISSION|LOG.mcap",
            help="a plan that planfly made, a mission file, or a flight log",
        ),
        files("mcap", *MISSIONS),
    )  # fmt: skip
    export.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="files to write: .waypoints, .plan, .fence, .rally, .kml, .gpx;"
        " of a log also .csv, .parquet (extra planfly[tables]), .tlog (MAVLink), .ulg (PX4)",
    )
    fence_option(export)
    result_options(export)


def _add_fly(line: LineParser) -> None:
    fly = line.command(
        "fly",
        "fly a plan or any mission file, write the log, end with the verdict",
        "planfly fly mission.waypoints --terrain jacksboro --wind 8,270 --turbulence light",
    )
    completed(fly.add_argument("mission", metavar="MISSION", help="plan.json, .waypoints or .plan"), files(*MISSIONS))
    world_options(fly)
    flight_options(fly)
    log = fly.group("the log")
    log.add_argument("--seed", metavar="N", type=seed, help="seed of the turbulence (default: the plan's, or 1)")
    log.add_argument(
        "--log", metavar="FILE", help="the flight log (default: runs/<mission>-seed<N>/flight.mcap, replaced)"
    )
    _log_rate(log)
    result_options(fly)


def _add_serve(line: LineParser) -> None:
    serve = line.command(
        "serve",
        "be a MAVLink vehicle that a ground station uploads to, arms, starts and watches",
        "planfly serve mission.waypoints --terrain jacksboro",
    )
    completed(
        serve.add_argument("mission", metavar="MISSION", nargs="?", help="a mission file to begin with"),
        files(*MISSIONS),
    )
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


def _add_paper(line: LineParser) -> None:
    paper = line.command(
        "paper",
        "plan the paper's section V again: tables and figures of seeded plans in three encodings",
        "planfly paper --problems 7,60 --runs 5 --out my-paper",
    )
    paper.add_argument(
        "--problems", metavar="N,...", type=problems, default=(7, 15, 30, 60), help="threats (default: 7,15,30,60)"
    )
    paper.add_argument("--runs", metavar="N", type=positive_count, default=15, help="seeds 1..N of each (default: 15)")
    paper.add_argument(
        "--algorithm", metavar="A", default="umda", help="beside the two baselines (default: umda, the paper's)"
    )
    paper.add_argument("--jobs", metavar="N", type=positive_count, help="processes (default: one a core)")
    result_options(paper, "where tables and figures go (default: runs/paper, replaced)")


def _add_aircraft(line: LineParser) -> None:
    aircraft = line.command(
        "aircraft",
        "show an aircraft: mass, trims, modes, envelope and step responses; without a name, list them",
        "planfly aircraft aerosonde --out aerosonde",
        "planfly aircraft --new ./mine --from aerosonde",
    )
    completed(
        aircraft.add_argument("name", metavar="NAME", nargs="?", help="embedded name, or a folder (with a slash)"),
        aircraft_words,
    )
    aircraft.add_argument("--motor-braking", action="store_true", help="let the motor brake in descents")
    own = aircraft.group("an aircraft of your own")
    own.add_argument("--new", metavar="FOLDER", help="make its folder, which must not be there yet")
    completed(
        own.add_argument(
            "--from", dest="source", metavar="NAME", help="with --new: the aircraft to begin with (default: aerosonde)"
        ),
        aircraft_words,
    )
    result_options(aircraft, "where the pictures go (default: runs/aircraft-NAME, replaced)")


def _add_own(line: LineParser) -> None:
    """What is about planfly itself."""
    helping = line.command(
        "help", "tell all of a command, or which commands there are", "planfly help fly", "planfly help fly --schema"
    )
    completed(
        helping.add_argument("topic", metavar="COMMAND", nargs="?", help="a command (default: all of them)"),
        lambda prefix, **_: [name for name in line.commands if name.startswith(prefix)],
    )
    helping.add_argument("--schema", action="store_true", help="the JSON schema of what the command's --json writes")
    completion = line.command(
        "completion",
        "print the script by which a shell completes planfly's commands, options and names",
        "planfly completion bash",
        more=_COMPLETION,
    )
    completion.add_argument("shell", choices=SHELLS, metavar="SHELL", help="bash, zsh or fish")
