"""Find the volumes and the ground risk class of a mission by SORA 2.5.

They follow from many flights and from formulas.
"""

from dataclasses import replace
from pathlib import Path
from typing import Unpack

from planfly.api.api_function import api_function
from planfly.api.campaigns import answer_command_line, make_workers, open_sample
from planfly.arguments import check_arguments
from planfly.campaigns.find_ground_risk import GroundRiskGoal, GroundRiskResult, find_ground_risk
from planfly.flight_options import SampleOptions
from planfly.kernel_units.unit_kernels import PLANNING_AND_FLYING
from planfly.runtime.stages import stage
from planfly.workflow.output_paths import check_output_folder, replace_files
from planner.plan import Plan
from world.extras import requires_extra
from world.population import PopulationUnit
from world.scenario import Scenario


@requires_extra("campaigns")
@api_function(*PLANNING_AND_FLYING)
def ground_risk(
    target: Plan | Scenario | str | Path,
    *,
    population: str | Path | None = None,
    population_unit: PopulationUnit = "per-cell",
    controlled: bool = False,
    max_speed: float | None = None,
    probability: float = 0.95,
    glide: bool = False,
    every: float = 10.0,
    out: str | Path | None = None,
    overwrite: bool = True,
    **options: Unpack[SampleOptions],
) -> GroundRiskResult:
    """Find a mission's volumes and intrinsic ground risk class by SORA 2.5, by flights and formulas.

    The flights vary as in `planfly.campaign`.  From each flight, returns to launch and falls to the ground are
    simulated.

    target: a built-in scenario's name, a scenario's TOML file, a `Scenario`, a `Plan`, or a plan.json, .waypoints or
    .plan file.
    population: a GeoTIFF of the population, such as GHS-POP or WorldPop; without it the class is undecided.
    population_unit: unit of the population's numbers, people "per-cell" or "per-km2".
    controlled: True for a controlled ground area, where only involved people are.
    max_speed: highest speed of the aircraft, m/s; None for the highest airspeed of its model.
    probability: fraction of the flights that the flight geography contains.
    glide: True to include glides after an engine failure in the ground risk buffer.
    every: time between the starts of two returns, s.
    out: folder for ``ground-risk.kml``, ``.geojson``, ``.png`` and ``.md``, and ``report.html``; None writes no files.
    overwrite: True replaces existing files.
    flights: number of flights.  spread, seed, workers, scheduler: see `planfly.campaign`.  For the other options, see
    `planfly.fly`.
    A script must call this function under ``if __name__ == "__main__":``, because workers import the script.
    Raises a `planfly.PlanflyError` for bad input, which is also a ValueError for a number out of its range.

    >>> ground_risk("paper-07", max_speed=0.0)
    Traceback (most recent call last):
    ...
    world.errors.ArgumentError: max_speed 0.0: expected a speed from 1 to 300 m/s
    """
    check_arguments(population_unit=population_unit, max_speed=max_speed, probability=probability, every=every)
    check_arguments(sample_flights=options["flights"])
    workers_used = make_workers(options["workers"], options["scheduler"], options["seed"])
    if out is not None:
        check_output_folder(Path(out), overwrite)
    base = open_sample(target, options)
    population = None if population is None else Path(population)
    goal = GroundRiskGoal(
        probability=probability,
        flights=options["flights"],
        interval=every,
        glide=glide,
        speed=max_speed,
        controlled=controlled,
        population=population,
        unit=population_unit,
    )
    with stage("flying", "flying for the ground risk") as advance:
        result = find_ground_risk(base, goal, workers_used, advance)
    goal_options = {
        "population": population,
        "population_unit": None if population is None else population_unit,
        "controlled": controlled,
        "max_speed": max_speed,
        "probability": probability,
        "glide": glide,
        "every": every,
    }
    command = answer_command_line("ground-risk", target, base, options, goal_options)
    return result if out is None else _write_files(result, Path(out), command, overwrite=overwrite)


def _write_files(result: GroundRiskResult, folder: Path, command: str, *, overwrite: bool) -> GroundRiskResult:
    """Write volumes, map, table and page of a result into a folder; return the result with the files.

    command: command line that repeats the search, for the page; "" to show none.
    """
    # Imported here: only pictures need matplotlib.
    from logs.views.drawing import png_bytes
    from logs.views.exports.risk_files import risk_geojson, risk_kml
    from logs.views.figures import draw
    from logs.views.ground_risk import RiskVolume, ground_risk_map
    from planfly.campaigns.answer_pages import ground_risk_page
    from planfly.campaigns.ground_risk_text import table_text

    setup = result.base.nominal_setup()
    volumes = (
        RiskVolume("flight geography", "flight-geography", result.geography, result.flown.height),
        RiskVolume(
            "operational volume: flight geography and contingency volume",
            "contingency-volume",
            result.volume,
            result.volume_height,
        ),
        RiskVolume("operational volume and ground risk buffer", "ground-risk-buffer", result.footprint, height=None),
    )
    properties = {"mission": result.base.name, "ground_risk_class": result.ground_class}
    with stage("drawing", "drawing the ground risk"):
        figure = draw(ground_risk_map(setup, volumes, result.population))
        contents: dict[str, str | bytes] = {
            "ground-risk.kml": risk_kml(setup, volumes),
            "ground-risk.geojson": risk_geojson(setup, volumes, properties),
            "ground-risk.png": png_bytes(figure),
            "ground-risk.md": table_text(result),
            "report.html": ground_risk_page(result, figure, command).render(),
        }
    return replace(result, files=replace_files(folder, contents, overwrite=overwrite))
