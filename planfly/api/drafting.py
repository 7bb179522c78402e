"""Write a first version of a new scenario."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from aircraft.catalog import find_aircraft
from planfly.arguments import check_arguments, parse_position
from planfly.runtime.stages import stage
from planfly.workflow.output_paths import check_output_file
from world.argument_types import checks_types
from world.elevation_formats import EMBEDDED
from world.errors import PlanflyError
from world.files import absolute_path, write_atomically
from world.raster import open_raster
from world.scenario import scenario_from_spec
from world.scenario_draft import GeoPosition, draft_text, make_draft
from world.scenario_file import parse_scenario
from world.scenario_tables import DEFAULT_AUTOPILOT, names_folder


@checks_types
def new_scenario(
    folder: str | Path,
    start: Sequence[float],
    destination: Sequence[float],
    *,
    terrain: str | Path | None = None,
    height: float = 120.0,
    aircraft: str | Path = "aerosonde",
    autopilot: str | None = None,
    overwrite: bool = False,
) -> Path:
    """Write a commented scenario between two positions, which can be planned and flown without changes.

    folder: the folder for FOLDER/NAME.toml, where NAME is the name of the folder; it is made if it is missing.
    start, destination: latitude and longitude, degrees.
    height: height of start and destination above ground, m.
    terrain: an elevation file, a folder of tiles, or the name of a built-in terrain; None for flat ground.
    aircraft: a name, or a folder.  autopilot: see `planfly.fly`.
    overwrite: True replaces an existing scenario.
    The area is the straight line with a margin of a third of its length, as far as the elevation file covers it.
    Returns the file.  Raises a `planfly.PlanflyError` for bad input; then nothing is written.

    >>> import planfly, tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     file = planfly.new_scenario(place + "/ridge", (36.27, -84.15), (36.33, -84.35), terrain="jacksboro")
    ...     path = planfly.plan(file)
    >>> file.name, path.safe
    ('ridge.toml', True)
    """
    check_arguments(height=height, autopilot=autopilot)
    endpoints = GeoPosition(*parse_position("start", start)), GeoPosition(*parse_position("destination", destination))
    target = Path(folder)
    name = Path(absolute_path(target)).name if ".." in target.parts else target.absolute().name
    if not name.isprintable() or not 1 <= len(name) <= 100:
        allowed = "expected a folder with a name of 1 to 100 printable characters"
        raise PlanflyError.of_argument("folder", target, allowed, shown=ascii(str(target)))
    if target.suffix == ".toml" or (target.exists() and not target.is_dir()):
        raise PlanflyError(f"{target}: expected the name of a folder, in which to write the scenario", file=target)
    file = target / f"{name}.toml"
    if target.is_dir():
        check_output_file(file, overwrite)
    elif not target.absolute().parent.is_dir():
        raise PlanflyError(f"{target}: its parent folder '{target.parent}' does not exist", file=target)
    autopilot_name, _, version = (autopilot or DEFAULT_AUTOPILOT).partition("-")
    raster_path = None if terrain is None else _make_absolute_path(terrain, is_name=terrain in EMBEDDED)
    model_path = _make_absolute_path(aircraft, is_name=isinstance(aircraft, str) and not names_folder(aircraft))
    airspeed = find_aircraft(model_path).airspeed
    with stage(f"laying out {name}", "laying out"):
        raster = None if raster_path is None else open_raster(raster_path)
        draft = make_draft(
            name,
            *endpoints,
            height,
            raster=raster,
            terrain=raster_path,
            aircraft=model_path,
            airspeed=airspeed,
            autopilot=autopilot_name,
            version=version or None,
        )
        # Parse the text as it will be read from the file, so that a fault is found before anything is written.
        scenario_from_spec(parse_scenario(draft_text(draft), str(file)), str(file))
    relative_draft = replace(
        draft,
        terrain=raster_path and _make_relative_path(target, raster_path),
        aircraft=_make_relative_path(target, model_path),
    )
    target.mkdir(exist_ok=True)
    write_atomically(file, draft_text(relative_draft))
    return file


def _make_absolute_path(path: str | Path, *, is_name: bool) -> str:
    """Return the absolute path of a file or a folder as text; a name is returned unchanged.

    is_name: True if `path` is the name of a built-in terrain or aircraft.
    """
    return str(path) if is_name else absolute_path(Path(path))


def _make_relative_path(folder: Path, path: str) -> str:
    """Convert an absolute path to a path relative to a folder; a name is returned unchanged."""
    if not Path(path).is_absolute():
        return path
    relative = os.path.relpath(path, absolute_path(folder))
    # The slash marks the text as the folder of an aircraft, not a name.
    return relative if "/" in relative else f"./{relative}"
