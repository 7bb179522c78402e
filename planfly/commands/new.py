"""``planfly new``: write a first version of a new scenario, and try to plan a path in it."""

import argparse
import shlex

import planfly
from planfly.arguments import CHOICES
from planfly.terminal.arguments import aircraft_words, completed, number, place
from planfly.terminal.command_parser import LineParser, coloured
from planfly.terminal.exit_codes import FLYABLE, NOT_FLYABLE
from planfly.terminal.options import call, result_options, terrain_option
from planfly.terminal.output import give_answer


def new_options(line: LineParser) -> None:
    """Add the parser of ``planfly new``."""
    parser = line.command(
        "new",
        "write a commented scenario for a flight from one place to another, and plan it once",
        "planfly new ./site --from 46.52,8.01 --to 46.60,8.12 --terrain dem.tif",
        "planfly new ./site --from 46.52,8.01 --to 46.60,8.12 --aircraft x8 --height 100",
    )
    parser.add_argument("folder", metavar="FOLDER", help="folder for the scenario file, which gets the folder's name")
    way = parser.group("the way")
    for option, keyword in (("--from", "start"), ("--to", "destination")):
        way.add_argument(
            option, dest=keyword, metavar="LAT,LON", type=place, required=True, help="latitude and longitude, degrees"
        )
    way.add_argument(
        "--height",
        metavar="M",
        type=number("height"),
        default=120.0,
        help="height of both ends above ground, m (default: 120)",
    )
    terrain_option(parser.group("where it flies"))
    flown = parser.group("aircraft and autopilot")
    completed(
        flown.add_argument(
            "--aircraft",
            metavar="AIRCRAFT",
            default="aerosonde",
            help="a name that planfly aircraft lists, or a folder (default: aerosonde)",
        ),
        aircraft_words,
    )
    flown.add_argument("--autopilot", choices=CHOICES["autopilot"], help="simulated autopilot (default: ardupilot)")
    result_options(parser)


def new(args: argparse.Namespace) -> int:
    """Write the scenario, and plan a path in it; return 4 if the plan is not safe, but keep the file."""
    from planner.plan import Objective

    file = call(planfly.new_scenario, args)
    print(f"scenario  {file}")
    if args.terrain is None:
        print("ground    flat, at mean sea level: no elevation file was named (--terrain DEM)")
    made = planfly.plan(file)
    code = FLYABLE if made.safe else NOT_FLYABLE
    if made.safe:
        ratio = float(made.objectives[Objective.LENGTH_RATIO])
        safe = coloured("plans     safe", "good")
        print(f"{safe}: {len(made.waypoints)} waypoints, {ratio:.3f} times the straight line")
    else:
        print(coloured("plans     no safe path", "bad"))
        for said in (*made.certificate.problems, *planfly.what_blocks(made)):
            print(f"  {said}")
    print(f"next      planfly run {shlex.quote(str(file))}")

    def answer() -> object:
        from planfly.terminal.answers import NewAnswer

        return NewAnswer(exit_code=code, file=str(file), safe=made.safe, waypoints=len(made.waypoints))

    give_answer(args, answer)
    return code
