"""``planfly new``: write a first version of a new scenario, and try to plan a path in it."""

import argparse
import shlex

from planfly.arguments import CHOICES
from planfly.terminal.arguments import complete_aircraft, number_parser, parse_position, with_completer
from planfly.terminal.command_parser import FLYABLE, NOT_FLYABLE, LineParser, colour_text
from planfly.terminal.options import add_result_options, add_terrain_option
from planfly.terminal.output import write_json_if_requested


def add_new_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly new``."""
    parser = command_line.add_command(
        "new",
        "write a commented scenario for a flight from one place to another, and plan it once",
        "planfly new ./site --from 46.52,8.01 --to 46.60,8.12 --terrain dem.tif",
        "planfly new ./site --from 46.52,8.01 --to 46.60,8.12 --aircraft x8 --height 100",
    )
    parser.add_argument(
        "folder", metavar="FOLDER", help="folder to make for the scenario file; the file gets the folder's name"
    )
    route_group = parser.add_group("route")
    for option, keyword in (("--from", "start"), ("--to", "destination")):
        route_group.add_argument(
            option,
            dest=keyword,
            metavar="LAT,LON",
            type=parse_position,
            required=True,
            help=f"position of the {keyword}: latitude and longitude, degrees",
        )
    route_group.add_argument(
        "--height",
        metavar="M",
        type=number_parser("height"),
        default=120.0,
        help="height of start and destination above ground, m (default: 120)",
    )
    add_terrain_option(parser.add_group("where it flies"))
    flight_group = parser.add_group("aircraft and autopilot")
    with_completer(
        flight_group.add_argument(
            "--aircraft",
            metavar="AIRCRAFT",
            default="aerosonde",
            help="an aircraft listed by 'planfly aircraft', or the folder of one (default: aerosonde)",
        ),
        complete_aircraft,
    )
    flight_group.add_argument(
        "--autopilot", choices=CHOICES["autopilot"], help="simulated autopilot (default: ardupilot)"
    )
    add_result_options(parser)


def new(args: argparse.Namespace) -> int:
    """Write the scenario, and plan a path in it.

    Returns the exit code: 0, or 4 if the plan is not safe; the file is kept in both cases.
    """
    from planfly.api import drafting, planning

    file = drafting.new_scenario(**args.options)
    print(f"scenario  {file}")
    if args.terrain is None:
        print("ground    flat, at mean sea level: no elevation file was named (--terrain DEM)")
    plan = planning.plan(file)
    code = FLYABLE if plan.safe else NOT_FLYABLE
    if plan.safe:
        ratio = plan.objectives.length_ratio
        safe_text = colour_text("plans     safe", "good")
        print(f"{safe_text}: {len(plan.waypoints)} waypoints, {ratio:.3f} times as long as the straight line")
    else:
        print(colour_text("plans     no safe path", "bad"))
        for problem in (*plan.certificate.problems, *planning.what_blocks(plan)):
            print(f"  {problem}")
    print(f"next      planfly run {shlex.quote(str(file))}")

    def json_answer() -> object:
        """Return the answer of ``planfly new`` for --json."""
        from planfly.terminal.answers import NewAnswer

        return NewAnswer(exit_code=code, file=str(file), safe=plan.safe, waypoints=len(plan.waypoints))

    write_json_if_requested(args, json_answer)
    return code
