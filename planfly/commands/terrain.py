"""``planfly terrain``: write the terrain of an area, from local tiles or from a server."""

import argparse
import shlex

from planfly.terminal.arguments import MISSION_SUFFIXES, file_completer, number_parser, parse_area, with_completer
from planfly.terminal.command_parser import FLYABLE, LineParser
from planfly.terminal.options import add_result_options
from planfly.terminal.output import print_warnings, write_json_if_requested

# Maximum number of degree cells without data that are listed.
_MAX_LISTED_CELLS = 4


def add_terrain_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly terrain``."""
    parser = command_line.add_command(
        "terrain",
        "write the terrain of an area as a GeoTIFF, from a folder of tiles or the Copernicus DEM's server",
        "planfly terrain --around field.waypoints --out dem.tif",
        "planfly terrain --box 46.4,7.9,46.7,8.3 --source ./tiles --out dem.tif",
    )
    area_group = parser.add_group("the area")
    with_completer(
        area_group.add_argument(
            "--around", metavar="MISSION", help="mission (.waypoints or .plan) that the area has to contain"
        ),
        file_completer(*MISSION_SUFFIXES),
    )
    area_group.add_argument(
        "--box",
        metavar="S,W,N,E",
        type=parse_area,
        help="southern, western, northern and eastern edge of the area, degrees",
    )
    area_group.add_argument(
        "--margin",
        metavar="KM",
        type=number_parser("margin"),
        default=3.0,
        help="margin around the area, km (default: 3)",
    )
    tile_group = parser.add_group("the tiles")
    tile_group.add_argument(
        "--source",
        metavar="DIR|URL",
        help="a folder of tiles, an elevation file, or a server of the Copernicus DEM's GLO-30 tiles (default: the "
        "public server in Amazon's registry of open data). Fetched parts of tiles are kept for later runs",
    )
    tile_group.add_argument(
        "--sea",
        action="store_true",
        help=(
            "treat missing 1-degree tiles as sea at 0 m (default: no data, because the tiles of some "
            "countries are not published)"
        ),
    )
    add_result_options(parser, "the file to write (default: dem.tif)", "FILE")


def terrain(args: argparse.Namespace) -> int:
    """Write the terrain of an area, and warn about missing tiles and pixels without data.

    Return the exit code 0.
    """
    from planfly.api import cutting_terrain

    result = cutting_terrain.terrain(**args.options | {"out": args.out or "dem.tif"})
    rows, cols = result.shape
    tiles = result.tiles[0] if len(result.tiles) == 1 else f"{len(result.tiles)} tiles"
    print(f"terrain   {result.file}: {rows:,} x {cols:,} pixels from {tiles}")
    if result.fetched:
        print(f"fetched   {result.fetched / 1e6:.1f} MB")
    if result.absent:
        corner_text = ", ".join(f"{lat} {lon}" for lat, lon in result.absent[:_MAX_LISTED_CELLS])
        more_text = (
            f" and {len(result.absent) - _MAX_LISTED_CELLS} more" if len(result.absent) > _MAX_LISTED_CELLS else ""
        )
        absent_text = (
            "Treated as sea at 0 m" if args.sea else ("Open sea, or tiles not published (--sea treats both as sea)")
        )
        print_warnings(
            [(f"there are no tiles with the south-west corners {corner_text}{more_text} (degrees). {absent_text}")]
        )
    if result.empty:
        print_warnings([f"{result.empty:,} of {rows * cols:,} pixels have no data"])
    print(f"next      planfly fly MISSION --terrain {shlex.quote(str(result.file))}")

    def json_answer() -> object:
        """Return the answer of ``planfly terrain`` for --json."""
        from planfly.terminal.answers import TerrainAnswer

        return TerrainAnswer(
            exit_code=FLYABLE,
            file=str(result.file),
            rows=rows,
            columns=cols,
            tiles=list(result.tiles),
            absent=[list(degree) for degree in result.absent],
            empty_pixels=result.empty,
            fetched_bytes=result.fetched,
        )

    write_json_if_requested(args, json_answer)
    return FLYABLE
