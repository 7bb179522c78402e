"""The parser of the command line.  It imports nothing heavy: ``planfly --help`` answers at once."""

from planfly import __version__
from planfly.terminal.arguments import (
    IMPORTED_LOGS,
    MISSIONS,
    SHELLS,
    aircraft_words,
    budget,
    completed,
    count,
    files,
    flight_time,
    leg,
    port,
    positive,
    positive_count,
    problems,
    scenario_words,
    seed,
    speedup,
    threat,
    time_or_stations,
)
from planfly.terminal.command_parser import CommandParser, LineParser, OptionTaker
from planfly.terminal.options import (
    add_campaigns,
    fence_option,
    flight_options,
    flown_by_options,
    imported_log_options,
    json_option,
    own_link_options,
    pilot_options,
    result_options,
    steering_options,
    terrain_option,
    turbulence_option,
    world_options,
)

# ----------------------------------------------------------------------
# The parsers of the commands that take imported logs.

LOGS = "LOG.BIN|.tlog|.ulg|.gpx|.igc|.kml|.kmz"


def add_field_commands(line: LineParser) -> None:
    """``import`` and ``refly``."""
    importing = line.command(
        "import",
        "turn another program's flight log into one of planfly's, and judge the flight against its plan",
        "planfly import 00000042.BIN flight.mcap --terrain dem.tif --aircraft aerosonde",
    )
    completed(
        importing.add_argument("log", metavar=LOGS, help="a log of ArduPilot, of a ground station, of PX4, or a track"),
        files(*IMPORTED_LOGS),
    )
    importing.add_argument("target", metavar="FLIGHT.mcap", help="the flight log to write")
    imported_log_options(importing)
    world_options(importing)
    flown_by_options(importing)
    result_options(importing)
    refly = line.command(
        "refly",
        "fly the mission of an imported flight again in JSBSim, in the wind of its log: where the two differ",
        "planfly refly flight.mcap --out refly",
    )
    completed(refly.add_argument("log", metavar="FLIGHT.mcap", help="a flight log that import wrote"), files("mcap"))
    completed(
        refly.add_argument(
            "--aircraft", metavar="AIRCRAFT", help="the aircraft that flies it again (default: the log's)"
        ),
        aircraft_words,
    )
    turbulence_option(refly)
    result_options(refly, "where the pictures go (default: <log>-refly beside it, replaced)")


# ----------------------------------------------------------------------
# The parsers of the commands that take flight logs.


def add_log_commands(line: LineParser) -> None:
    """``check``, ``replay``, ``recover``, ``report`` and ``compare``."""
    check = line.command(
        "check",
        "judge a flight from its log (planfly's, or another program's), or a mission file by its geometry alone",
        "planfly check flight.mcap --json verdict.json",
        "planfly check mission.waypoints --terrain jacksboro --json -",
    )
    completed(
        check.add_argument(
            "file", metavar="LOG|MISSION", help=f"a flight log (.mcap, or {LOGS}), or plan.json, .waypoints, .plan"
        ),
        files("mcap", *MISSIONS, *IMPORTED_LOGS),
    )
    imported_log_options(check)
    world_options(check)
    flown_by_options(check)
    pilot_options(check)
    result_options(check)
    _add_replay(line)
    recover = line.command(
        "recover",
        "make an unfinished or damaged log whole again, as far as it can be read",
        "planfly recover flight.mcap --out whole.mcap",
    )
    _log(recover)
    result_options(recover, "the new log (default: <log>-recovered.mcap beside it)", "FILE")
    report = line.command(
        "report",
        "draw the figures and write report.html from a log alone, or write the layout for Foxglove",
        "planfly report flight.mcap --out report --svg",
    )
    completed(report.add_argument("log", metavar="LOG.mcap", nargs="?", help="a flight log"), files("mcap"))
    report.add_argument("--svg", action="store_true", help="write the figures as SVG, too")
    report.add_argument("--layout", metavar="FILE", help="write the layout file for Foxglove there, and nothing else")
    result_options(report, "where the files go (default: <log>-report beside the log, replaced)")
    compare = line.command(
        "compare",
        "lay two flights over each other: a table of differences, and pictures",
        "planfly compare calm.mcap windy.mcap --out both",
    )
    _log(compare, "first", "A.mcap")
    _log(compare, "second", "B.mcap", "another")
    compare.add_argument("--svg", action="store_true", help="write the pictures as SVG, too")
    result_options(compare, "write pictures and compare.html there (default: the table alone)")


def _log(parser: CommandParser, name: str = "log", metavar: str = "LOG.mcap", what: str = "a flight log") -> None:
    completed(parser.add_argument(name, metavar=metavar, help=what), files("mcap"))


def _add_replay(line: LineParser) -> None:
    replay = line.command(
        "replay",
        "replay a flight from its log alone: on a terminal as instruments, elsewhere as a timeline",
        "planfly replay flight.mcap --speed 20 --from 60",
        "planfly replay flight.mcap --to 127.0.0.1:14550",
    )
    _log(replay)
    part = replay.group("which part, how fast")
    part.add_argument("--from", dest="start", metavar="S", type=flight_time, help="from this time of the flight, s")
    part.add_argument(
        "--to",
        metavar="S|IP:PORT,...",
        type=time_or_stations,
        help="to this time of the flight, s; or play the log into the ground stations that listen there",
    )
    part.add_argument(
        "--speed",
        metavar="X",
        type=positive,
        help="at X times real time (default: 1 on a terminal and into Foxglove; a film of 20 s; else at once)",
    )
    part.add_argument("--at-once", action="store_true", help="the timeline at once, on a terminal too")
    other = replay.group("other ways to see it")
    other.add_argument(
        "--movie", metavar="FILE|DIR", help="draw it: FILE.gif, FILE.mp4 (needs ffmpeg), or DIR for PNG frames"
    )
    other.add_argument(
        "--foxglove",
        action="store_true",
        help="play it to Foxglove on this machine over WebSocket; needs the extra planfly[foxglove], and a viewer that"
        " speaks foxglove.sdk.v1 (Foxglove since 2025, Lichtblick after 1.21)",
    )
    other.add_argument("--port", metavar="N", type=port, default=8765, help="of --foxglove (default: 8765; 0: any)")
    other.add_argument(
        "--wait", metavar="S", type=positive,
        help="wait S seconds for a ground station (default: 10) or Foxglove (default: without end)",
    )  # fmt: skip
    own_link_options(replay, bind="127.0.0.1:0")
    result_options(replay)


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
