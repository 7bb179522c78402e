"""``planfly terrain``: write the terrain of an area, from local tiles or from a server."""

import argparse
import shlex

import planfly
from planfly.terminal.arguments import MISSIONS, area, completed, files, number
from planfly.terminal.command_parser import LineParser
from planfly.terminal.exit_codes import FLYABLE
from planfly.terminal.options import call, result_options
from planfly.terminal.output import give_answer
from planfly.terminal.results import print_warnings

# Maximum number of degree cells without data that are listed.
_NAMED = 4


def terrain_options(line: LineParser) -> None:
    """Add the parser of ``planfly terrain``."""
    parser = line.command(
        "terrain",
        "write the ground of an area as a GeoTIFF, from a folder of tiles or the Copernicus DEM's server",
        "planfly terrain --around field.waypoints --out dem.tif",
        "planfly terrain --box 46.4,7.9,46.7,8.3 --source ./tiles --out dem.tif",
    )
    where = parser.group("the area")
    completed(
        where.add_argument("--around", metavar="MISSION", help=".waypoints or .plan file: cover all of its places"),
        files(*MISSIONS),
    )
    where.add_argument("--box", metavar="S,W,N,E", type=area, help="edges of the area, degrees")
    where.add_argument(
        "--margin", metavar="KM", type=number("margin"), default=3.0, help="margin around the area, km (default: 3)"
    )
    tiles = parser.group("the tiles")
    tiles.add_argument(
        "--source",
        metavar="DIR|URL",
        help="a folder of tiles or an elevation file; or a server of GLO-30 tiles of the Copernicus DEM (default: the "
        "public one in Amazon's registry of open data, from which the needed parts are fetched and kept)",
    )
    tiles.add_argument(
        "--sea",
        action="store_true",
        help="treat missing 1-degree tiles as sea at 0 m (default: no data, because some countries' tiles are not "
        "published)",
    )
    result_options(parser, "the file to write (default: dem.tif)", "FILE")


def terrain(args: argparse.Namespace) -> int:
    """Write the terrain of an area."""
    made = call(planfly.terrain, args, out=args.out or "dem.tif")
    rows, cols = made.shape
    tiles = made.tiles[0] if len(made.tiles) == 1 else f"{len(made.tiles)} tiles"
    print(f"terrain   {made.file}: {rows:,} x {cols:,} pixels from {tiles}")
    if made.fetched:
        print(f"fetched   {made.fetched / 1e6:.1f} MB")
    if made.absent:
        named = ", ".join(f"{lat} {lon}" for lat, lon in made.absent[:_NAMED])
        more = f" and {len(made.absent) - _NAMED} more" if len(made.absent) > _NAMED else ""
        taken = "treated as sea, at 0 m" if args.sea else "open sea, or not published (--sea treats it as sea)"
        print_warnings([f"no tile at {named}{more} (south-west corners, degrees): {taken}"])
    if made.empty:
        print_warnings([f"{made.empty:,} of {rows * cols:,} pixels have no data"])
    print(f"next      planfly fly MISSION --terrain {shlex.quote(str(made.file))}")

    def answer() -> object:
        from planfly.terminal.answers import TerrainAnswer

        return TerrainAnswer(
            exit_code=FLYABLE,
            file=str(made.file),
            rows=rows,
            columns=cols,
            tiles=list(made.tiles),
            absent=[list(degree) for degree in made.absent],
            empty_pixels=made.empty,
            fetched_bytes=made.fetched,
        )

    give_answer(args, answer)
    return FLYABLE
