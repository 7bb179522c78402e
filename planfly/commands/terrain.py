"""``planfly terrain``: write the terrain of an area, from local tiles or from a server."""

import argparse
import shlex

import planfly
from planfly.terminal.arguments import MISSIONS, area, files, number, with_completer
from planfly.terminal.command_parser import LineParser
from planfly.terminal.exit_codes import FLYABLE
from planfly.terminal.options import call, result_options
from planfly.terminal.output import give_answer
from planfly.terminal.results import print_warnings

# Maximum number of degree cells without data that are listed.
_MAX_NAMED = 4


def terrain_options(line: LineParser) -> None:
    """Add the parser of ``planfly terrain``."""
    parser = line.command(
        "terrain",
        "write the ground of an area as a GeoTIFF, from a folder of tiles or the Copernicus DEM's server",
        "planfly terrain --around field.waypoints --out dem.tif",
        "planfly terrain --box 46.4,7.9,46.7,8.3 --source ./tiles --out dem.tif",
    )
    area_group = parser.group("the area")
    with_completer(
        area_group.add_argument(
            "--around", metavar="MISSION", help=".waypoints or .plan file, all of whose positions are covered"
        ),
        files(*MISSIONS),
    )
    area_group.add_argument("--box", metavar="S,W,N,E", type=area, help="edges of the area, degrees")
    area_group.add_argument(
        "--margin", metavar="KM", type=number("margin"), default=3.0, help="margin around the area, km (default: 3)"
    )
    tile_group = parser.group("the tiles")
    tile_group.add_argument(
        "--source",
        metavar="DIR|URL",
        help="a folder of tiles or an elevation file; or a server of GLO-30 tiles of the Copernicus DEM (default: the "
        "public one in Amazon's registry of open data, from which the needed parts are fetched and kept)",
    )
    tile_group.add_argument(
        "--sea",
        action="store_true",
        help="treat missing 1-degree tiles as sea at 0 m (default: no data, because the tiles of some countries are "
        "not published)",
    )
    result_options(parser, "the file to write (default: dem.tif)", "FILE")


def terrain(args: argparse.Namespace) -> int:
    """Write the terrain of an area."""
    cut = call(planfly.terrain, args, out=args.out or "dem.tif")
    rows, cols = cut.shape
    tiles = cut.tiles[0] if len(cut.tiles) == 1 else f"{len(cut.tiles)} tiles"
    print(f"terrain   {cut.file}: {rows:,} x {cols:,} pixels from {tiles}")
    if cut.fetched:
        print(f"fetched   {cut.fetched / 1e6:.1f} MB")
    if cut.absent:
        corner_text = ", ".join(f"{lat} {lon}" for lat, lon in cut.absent[:_MAX_NAMED])
        more_text = f" and {len(cut.absent) - _MAX_NAMED} more" if len(cut.absent) > _MAX_NAMED else ""
        absent_text = "treated as sea, at 0 m" if args.sea else "open sea, or not published (--sea treats it as sea)"
        print_warnings([f"no tile at {corner_text}{more_text} (south-west corners, degrees): {absent_text}"])
    if cut.empty:
        print_warnings([f"{cut.empty:,} of {rows * cols:,} pixels have no data"])
    print(f"next      planfly fly MISSION --terrain {shlex.quote(str(cut.file))}")

    def answer() -> object:
        from planfly.terminal.answers import TerrainAnswer

        return TerrainAnswer(
            exit_code=FLYABLE,
            file=str(cut.file),
            rows=rows,
            columns=cols,
            tiles=list(cut.tiles),
            absent=[list(degree) for degree in cut.absent],
            empty_pixels=cut.empty,
            fetched_bytes=cut.fetched,
        )

    give_answer(args, answer)
    return FLYABLE
