"""``planfly ground-risk``: find the volumes and the ground risk class of a mission by SORA 2.5."""

import argparse
from typing import TYPE_CHECKING

from planfly.arguments import CHOICES
from planfly.commands.campaigns import add_flights_options
from planfly.terminal.arguments import file_completer, number_parser, with_completer
from planfly.terminal.command_parser import FLYABLE, INCOMPLETE, LineParser, colour_text
from planfly.terminal.options import add_result_options
from planfly.terminal.output import write_json_if_requested

if TYPE_CHECKING:
    from planfly import GroundRiskResult
    from planfly.terminal.ground_risk_answers import GroundRiskAnswer


def add_ground_risk_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly ground-risk``."""
    parser = command_line.add_command(
        "ground-risk",
        "find flight geography, contingency volume, ground risk buffer and intrinsic ground risk class by SORA 2.5,"
        " from many simulated flights, their returns and falls, and from the formulas of SORA",
        "planfly ground-risk mission.waypoints --terrain dem.tif --population GHS_POP.tif --out risk",
        extra="campaigns",
    )
    add_flights_options(parser)
    group = parser.add_group("the ground risk")
    with_completer(
        group.add_argument(
            "--population",
            metavar="FILE",
            help="GeoTIFF of the population density or count, such as GHS-POP or WorldPop",
        ),
        file_completer("tif", "tiff"),
    )
    group.add_argument(
        "--population-unit",
        choices=CHOICES["population_unit"],
        help="unit of the numbers in --population: people per cell (default) or per km2",
    )
    group.add_argument(
        "--controlled",
        action="store_true",
        help="only people who are involved in the flight are in the area below",
    )
    for name, unit, text in (
        ("max_speed", "M/S", "maximum speed of the aircraft, m/s (default: the highest airspeed of its model)"),
        ("probability", "P", "fraction of the flights that stay inside the flight geography (default: 0.95)"),
        ("every", "S", "time between the starts of two simulated returns along the flight, s (default: 10)"),
    ):
        group.add_argument(f"--{name.replace('_', '-')}", metavar=unit, type=number_parser(name), help=text)
    group.add_argument(
        "--glide",
        action="store_true",
        help="also make the ground risk buffer wide enough for glides after an engine failure",
    )
    group.add_argument(
        "--flights",
        metavar="N",
        type=number_parser("sample_flights"),
        help="number of flights, 20 to 100,000 (default: 100)",
    )
    add_result_options(
        parser,
        "folder for the files: a page (report.html), the volumes as KML and GeoJSON, a map and a table (default: no"
        " files)",
    )


def ground_risk(args: argparse.Namespace) -> int:
    """Find the ground risk class of a mission; return the exit code.

    The exit code is 0 if the class is judged, and 3 if it is not, because the population is not known.
    """
    from logs.verdict.conditions import flown_condition_lines
    from planfly.api import ground_risk as ground_risk_api
    from planfly.campaigns.ground_risk_text import answer_line, risk_lines

    result = ground_risk_api.ground_risk(**args.options)
    code = FLYABLE if result.is_judged else INCOMPLETE
    print(f"risk      {colour_text(answer_line(result), 'good' if result.is_judged else 'warning')}")
    for text in (*flown_condition_lines(result.base.conditions()), *risk_lines(result)):
        print(f"  {text}")
    for path in result.files:
        print(f"  written {path}")
    write_json_if_requested(args, lambda: _json_answer(str(args.target), result, code))
    return code


def _json_answer(target: str, result: "GroundRiskResult", code: int) -> "GroundRiskAnswer":
    """Return the answer of ``planfly ground-risk`` for --json."""
    from planfly.campaigns.ground_risk_text import answer_line
    from planfly.terminal.ground_risk_answers import GroundRiskAnswer, PopulationEntry

    population = result.population
    return GroundRiskAnswer(
        exit_code=code,
        what=target,
        headline=answer_line(result),
        is_judged=result.is_judged,
        ground_risk_class=result.ground_class,
        dimension_m=result.aircraft.wing_span,
        max_speed_mps=result.speed,
        mass_kg=result.aircraft.mass,
        probability=result.goal.probability,
        flights=len(result.rows),
        completed=sum(row.ended == "completed" for row in result.rows),
        geography_half_width_m=result.half_width,
        geography_height_m=result.flown.height,
        flown_contingency_width_m=result.flown.contingency_width,
        flown_contingency_height_m=result.flown.contingency_height,
        formula_contingency_width_m=result.formula.width,
        formula_contingency_height_m=result.formula.height,
        flown_buffer_m=result.flown.buffer_width,
        one_to_one_buffer_m=result.one_to_one_buffer,
        ballistic_buffer_m=result.ballistic_buffer,
        glide_buffer_m=result.glide_buffer,
        volume_area_km2=result.volume.area / 1e6,
        footprint_area_km2=result.footprint.area / 1e6,
        population=None
        if population is None
        else PopulationEntry(
            source=population.source,
            known_fraction=population.known_fraction,
            max_density_per_km2=population.max_density,
            mean_density_per_km2=population.mean_density,
            max_lat_deg=population.max_position[0],
            max_lon_deg=population.max_position[1],
            cell_size_m=population.cell_size,
        ),
        entered_zones=list(result.entered_zones),
        conditions=result.base.conditions(),
        files=[str(path) for path in result.files],
    )
