"""``planfly terrain``: the ground of an area, from tiles that are there or from a server."""

import argparse

import planfly
from planfly.terminal.arguments import MISSIONS, area, completed, files, number
from planfly.terminal.command_parser import LineParser
from planfly.terminal.exit_codes import FLYABLE
from planfly.terminal.options import call, result_options
from planfly.terminal.output import give_answer

# How many degrees of sea are named.
_NAMED = 4


def terrain_options(line: LineParser) -> None:
    """The parser of ``planfly terrain``."""
    parser = line.command(
        "terrain",
        "get the ground of an area as a GeoTIFF, from a folder of tiles or the Copernicus DEM's server",
        "planfly terrain --around field.waypoints --out dem.tif",
        "planfly terrain --box 46.4,7.9,46.7,8.3 --source ./tiles --out dem.tif",
    )
    where = parser.group("the area")
    completed(
        where.add_argument("--around", metavar="MISSION", help=".waypoints or .plan: all of its places"),
        files(*MISSIONS),
    )
    where.add_argument("--box", metavar="S,W,N,E", type=area, help="its edges, degrees")
    where.add_argument(
        "--margin", metavar="KM", type=number("margin"), default=3.0, help="ground beside them, km (default: 3)"
    )
    parser.group("the tiles").add_argument(
        "--source", metavar="DIR|URL",
        help="a folder of tiles or an elevation file; or a server of GLO-30 tiles of the Copernicus DEM (default: the "
        "public one in Amazon's registry of open data, of which the parts that are needed are fetched, and kept)",
    )  # fmt: skip
    result_options(parser, "the file to write (default: dem.tif)", "FILE")


def terrain(args: argparse.Namespace) -> int:
    """Write it."""
    made = call(planfly.terrain, args, out=args.out or "dem.tif")
    rows, cols = made.shape
    print(f"terrain   {made.file}: {rows:,} x {cols:,} pixels from {len(made.tiles)} {_tiles(len(made.tiles))}")
    if made.fetched:
        print(f"fetched   {made.fetched / 1e6:.1f} MB")
    if made.sea:
        named = ", ".join(f"{lat} {lon}" for lat, lon in made.sea[:_NAMED])
        more = f" and {len(made.sea) - _NAMED} more" if len(made.sea) > _NAMED else ""
        print(f"sea       no tile at {named}{more} (south-west corners, degrees): 0 m there")
    print(f"next      planfly fly MISSION --terrain {made.file}")

    def answer() -> object:
        from planfly.terminal.answers import TerrainAnswer

        return TerrainAnswer(
            exit_code=FLYABLE, file=str(made.file), rows=rows, columns=cols, tiles=list(made.tiles),
            sea=[list(degree) for degree in made.sea], fetched_bytes=made.fetched,
        )  # fmt: skip

    give_answer(args, answer)
    return FLYABLE


def _tiles(count: int) -> str:
    return "tile" if count == 1 else "tiles"
