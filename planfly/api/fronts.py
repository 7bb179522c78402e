"""Plan a Pareto front, and write its plans, a table and pictures."""

import csv
import io
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Unpack

from planfly.api.api_function import api_function
from planfly.api.planning import stop_condition
from planfly.arguments import RANGES, check_arguments
from planfly.flight_options import FlightOptions, load_scenario_with_options
from planfly.kernel_units.unit_kernels import FRONT_PLANNING
from planfly.planning.pareto_plans import make_pareto_plans
from planfly.runtime.stages import stage
from planfly.workflow.output_paths import RUN_FOLDER, clean_folder, expand_path_pattern
from planfly.workflow.uav import choose_seed, load_uav
from planner.plan import plan_json
from planner.search.plan_front import Front, FrontPlan
from world.files import write_atomically
from world.scenario import Scenario

# Default folder of a front.
FRONT_FOLDER = f"{RUN_FOLDER}-front"
# Name and version of the format of front.json.
TABLE_SCHEMA = "planfly.front/1"
# Energy of one watt hour, J.
WATT_HOUR_J = 3600.0
# Columns of the table of a front.
COLUMNS = ("plan", "length_m", "exposure_s", "clearance_m", "energy_wh", "time_s")
# Files of the pictures of a front.
PICTURES = ("front-map.png", "front-values.png")
# All files of a front that planfly may write.
FRONT_FILES = (
    *(f"plan-{number}.json" for number in range(1, int(RANGES["front"].high) + 1)),
    *("front.csv", "front.json", *PICTURES),
)


@api_function(*FRONT_PLANNING)
def plan_front(
    scenario: Scenario | str | Path,
    count: int = 20,
    *,
    seed: int | None = None,
    seconds: float | None = None,
    out: str | Path | None = None,
    overwrite: bool = True,
    stop: Callable[[], bool] | None = None,
    **options: Unpack[FlightOptions],
) -> Front:
    """Plan a Pareto front: safe plans, none of which is better than another in every criterion.

    The criteria are length, exposure to radars, minimum height above ground, and energy.  Time replaces energy if the
    scenario's ``[planner] objective`` is "time" or the power of the aircraft is unknown.  Each plan has its own
    certificate and is safe.  Each plan gains more than 0.1 % in length or energy, 1 % in exposure or 1 m in height over
    the plans selected before it.  There may be fewer plans than requested; the front is empty if no safe plan is found.

    count: maximum number of plans, 2 to 100.
    out: a folder for plan-1.json, plan-2.json, ..., the shortest first, their table as front.csv and front.json, and
    two pictures.  In its name, {name} and {seed} stand for the scenario's name and the seed.
    For the other keywords, see `planfly.plan`.

    >>> import planfly
    >>> front = planfly.plan_front("tight", 3, seed=1)
    >>> 1 <= len(front.plans) <= 3, all(one.plan.safe for one in front.plans)
    (True, True)
    """
    check_arguments(front=count, seed=seed, seconds=seconds)
    world = load_scenario_with_options(scenario, options)
    chosen_seed = choose_seed(world, seed)
    uav = load_uav(world)
    folder = None
    if out is not None:
        folder = clean_folder(expand_path_pattern(out, world.name, chosen_seed), FRONT_FILES, overwrite=overwrite)
    with stage(f"planning a front of {world.name}", "planning a front") as advance:
        front = make_pareto_plans(world, uav, chosen_seed, count, advance, stop=stop_condition(seconds, stop))
    if folder is not None:
        _write_front(front, world, folder)
    return front


def _write_front(front: Front, world: Scenario, folder: Path) -> None:
    """Write the plans, tables and pictures of a front into a folder.

    For a front without plans, only the tables are written, without rows.
    """
    for number, front_plan in enumerate(front.plans, 1):
        write_atomically(folder / f"plan-{number}.json", plan_json(front_plan.plan))
    rows = table_rows(front)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([["" if value is None else value for value in row.values()] for row in rows])
    write_atomically(folder / "front.csv", text.getvalue())
    data = {
        "schema": TABLE_SCHEMA,
        "scenario": world.name,
        "objectives": [
            "length_m",
            "exposure_s",
            "clearance_m",
            f"{front.fourth}_{'s' if front.fourth == 'time' else 'wh'}",
        ],
        "asked": front.asked,
        "default": {key: value for key, value in _make_table_row(0, front.default).items() if key != "plan"},
        "plans": [row | {"file": f"plan-{row['plan']}.json"} for row in rows],
    }
    write_atomically(folder / "front.json", json.dumps(data, indent=1, allow_nan=False) + "\n")
    if front.plans:
        # Imported here: matplotlib takes most of a second.
        from logs.views.draw_map import draw_map
        from logs.views.drawing import draw_chart, png_bytes
        from logs.views.fronts import front_chart, front_map

        write_atomically(folder / PICTURES[0], png_bytes(draw_map(front_map(front))))
        write_atomically(folder / PICTURES[1], png_bytes(draw_chart(front_chart(front))))


def table_rows(front: Front) -> list[dict[str, Any]]:
    """Return a row for each plan of a front, with the keys `COLUMNS`.

    An unknown value, such as energy, is None.
    """
    return [_make_table_row(number, front_plan) for number, front_plan in enumerate(front.plans, 1)]


def _make_table_row(number: int, front_plan: FrontPlan) -> dict[str, Any]:
    """Return the row of one plan, keyed by `COLUMNS`.

    number: number of the plan, from 1.
    """
    values = (
        front_plan.length,
        front_plan.exposure,
        front_plan.clearance,
        front_plan.energy / WATT_HOUR_J,
        front_plan.time,
    )
    digits = (1, 3, 2, 3, 2)
    rounded_values = [
        round(value, decimals) if math.isfinite(value) else None for value, decimals in zip(values, digits, strict=True)
    ]
    return dict(zip(COLUMNS, (number, *rounded_values), strict=True))
