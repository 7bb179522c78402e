"""The command line: what there is to say, and what an exit code means.  Heavy imports wait for the command."""

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from planfly import __version__

EXIT_CODES = """\
exit codes: 0 flyable; 1 our fault or the machine's; 2 bad usage or bad input (nothing was written);
3 done with a stated loss (an unfinished or damaged log); 4 not flyable, or no feasible plan"""

FLYABLE, FAULT, BAD_INPUT, LOSS, NOT_FLYABLE, INTERRUPTED = 0, 1, 2, 3, 4, 130


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One line, as for every other bad input."""
        self.exit(BAD_INPUT, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _seed(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value < 2**63:
        raise argparse.ArgumentTypeError(f"{text!r}: a whole number from 0 to 2^63 - 1 is expected")
    return value


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 < value <= 1e6:
        raise argparse.ArgumentTypeError(f"{text!r}: a number above 0, up to 1,000,000, is expected")
    return value


def _wind(text: str) -> tuple[float, float]:
    try:
        speed, source = (float(part) for part in text.split(","))
    except ValueError:
        speed, source = -1.0, 0.0
    if not (0.0 <= speed <= 40.0 and -360.0 <= source <= 360.0):
        raise argparse.ArgumentTypeError(
            f"{text!r}: SPEED,FROM is expected: m/s from 0 to 40, degrees from north that it blows from (-360..360)"
        )
    return speed, source


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
    _add_aircraft(command)
    command("scenarios", "list the embedded scenarios, one line each", "planfly scenarios")
    return parser


_Command = Callable[[str, str, str], argparse.ArgumentParser]


def _overwrite(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--overwrite", action="store_true", help="replace named targets that exist")


def _world(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenario", metavar="S", help="judge within this scenario: a TOML file or an embedded name")
    parser.add_argument("--terrain", metavar="DEM", help="elevation file (.tif, .hgt, .npz) or embedded name")


def _steering(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--guidance",
        choices=("path", "l1", "vector-field"),
        help="who steers: planfly's own (path), L1 as ArduPlane flies it, or Beard and McLain's vector field",
    )
    parser.add_argument(
        "--nav",
        choices=("perfect", "rtk", "gnss"),
        help="how well guidance knows where it is: errors of 0, 0.05 or 1.5 m on each axis",
    )


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
    run.add_argument(
        "--seed", metavar="N", type=_seed, help="of planner and turbulence (default: the scenario's, or 1)"
    )
    _steering(run)
    _overwrite(run)
    plan = command("plan", "plan only", "planfly plan jacksboro --seed 3 --out plan.json")
    plan.add_argument("scenario", metavar="SCENARIO", help="TOML file or embedded name")
    plan.add_argument("--seed", metavar="N", type=_seed, help="of the planner (default: the scenario's, or 1)")
    plan.add_argument(
        "--algorithm",
        metavar="A",
        help="the planner's algorithm, in place of the scenario's (an unknown name lists them)",
    )
    plan.add_argument("--out", metavar="FILE", help="the plan file (default: runs/<name>-seed<N>/plan.json, replaced)")
    _overwrite(plan)


def _add_export_and_fly(command: _Command) -> None:
    export = command(
        "export", "write a plan as mission files, by suffix: .waypoints, .plan",
        "planfly export plan.json mission.waypoints mission.plan",
    )  # fmt: skip
    export.add_argument("plan", metavar="PLAN.json", help="a plan that planfly made")
    export.add_argument("files", metavar="FILE", nargs="+", help="mission files to write (.waypoints, .plan)")
    _overwrite(export)
    fly = command(
        "fly", "fly a plan or any mission file, write the log, end with the verdict",
        "planfly fly mission.waypoints --terrain jacksboro --wind 8,270 --turbulence light",
    )  # fmt: skip
    fly.add_argument("mission", metavar="MISSION", help="plan.json, .waypoints or .plan")
    _world(fly)
    fly.add_argument(
        "--log", metavar="FILE", help="the flight log (default: runs/<mission>-seed<N>/flight.mcap, replaced)"
    )
    fly.add_argument("--wind", metavar="SPEED,FROM", type=_wind, help="steady wind, m/s and degrees it blows from")
    fly.add_argument("--turbulence", choices=("none", "light", "moderate"), help="in place of the scenario's")
    fly.add_argument("--seed", metavar="N", type=_seed, help="of the turbulence (default: the plan's, or 1)")
    _steering(fly)
    _overwrite(fly)


def _add_log_commands(command: _Command) -> None:
    check = command(
        "check", "judge a flight from its log alone, or a mission file by its geometry, without flying",
        "planfly check flight.mcap --json verdict.json",
    )  # fmt: skip
    check.add_argument("file", metavar="LOG.mcap|MISSION", help="a flight log, or plan.json, .waypoints, .plan")
    _world(check)
    check.add_argument("--json", metavar="FILE", help="write the verdict there")
    _overwrite(check)
    replay = command(
        "replay",
        "tell a flight again from its log alone: legs, turns, clearances, events",
        "planfly replay flight.mcap --speed 20",
    )
    replay.add_argument("log", metavar="LOG.mcap", help="a flight log")
    replay.add_argument("--speed", metavar="X", type=_positive, help="at X times real time (default: at once)")
    report = command(
        "report", "draw the figures and write report.html from a log alone", "planfly report flight.mcap --out report"
    )
    report.add_argument("log", metavar="LOG.mcap", help="a flight log")
    report.add_argument(
        "--out", metavar="DIR", help="where the files go (default: <log>-report beside the log, replaced)"
    )
    _overwrite(report)


def _add_aircraft(command: _Command) -> None:
    aircraft = command(
        "aircraft", "show an aircraft: mass, trims, modes, envelope and step responses; without a name, list them",
        "planfly aircraft aerosonde --out aerosonde",
    )  # fmt: skip
    aircraft.add_argument("name", metavar="NAME", nargs="?", help="embedded name, or a folder (with a slash)")
    aircraft.add_argument("--out", metavar="DIR", help="where the pictures go (default: runs/aircraft-NAME, replaced)")
    aircraft.add_argument("--motor-braking", action="store_true", help="let the motor brake in descents")
    _overwrite(aircraft)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    args = build_parser().parse_args(argv)
    # Imported here: pydantic and numba take longer than --help may.
    from planfly.commands import COMMANDS
    from world.errors import PlanflyError

    try:
        return COMMANDS[args.command](args)
    except PlanflyError as error:
        return _fail(BAD_INPUT, error)
    except BrokenPipeError:
        # Whoever read our output has gone; there is nobody to tell.
        sys.stderr.close()
        return FAULT
    except OSError as error:
        return _fail(FAULT, f"{error.filename or 'file'}: {error.strerror or error}")
    except KeyboardInterrupt:
        return _fail(INTERRUPTED, "interrupted")


def _fail(code: int, message: object) -> int:
    print(f"planfly: {' '.join(str(message).split())}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
