"""Return data, trims and modes of built-in and user-made aircraft, and make folders for new aircraft."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypedDict, Unpack, cast, overload

from aircraft.catalog import Aircraft, aircraft_names, copy_aircraft_folder, find_aircraft, load_aircraft, model_hash
from aircraft.envelope import Envelope
from aircraft.model_writer import Layout
from flight.autopilots.catalog import autopilot_classes, program_classes
from flight.dynamics.characteristics import Mode, StepResponse, TrimRow, level_flight_modes, step_responses, trim_table
from flight.dynamics.envelope_tables import load_envelope
from flight.dynamics.model_check import shipped_model
from planfly.api.api_function import api_function
from planfly.runtime.stages import stage
from planfly.workflow.output_paths import check_output_folder, expand_path_pattern, prepare_folder
from planfly.workflow.uav import check_level_flight
from world.argument_types import checks_types
from world.errors import PlanflyError
from world.files import absolute_path, write_atomically
from world.scenario_tables import names_folder


@dataclass(frozen=True, slots=True)
class AircraftNumbers:
    """Result of `planfly.describe_aircraft`.

    aircraft: metadata of the aircraft.
    model_sha256: SHA-256 of the JSBSim model.
    envelope: limits of climb and descent, by airspeed and altitude.
    trims: trimmed level flight at each airspeed.
    modes: modes of motion, keyed by airspeed, m/s.
    cruise: modes of motion at cruise speed.
    steps: responses to steps of the controls.
    lacking: one line for each file that a flight needs and the aircraft's folder lacks.
    files: pictures that were written.
    """

    aircraft: Aircraft
    model_sha256: str
    envelope: Envelope
    trims: tuple[TrimRow, ...]
    modes: Mapping[float, tuple[Mode, ...]] = field(hash=False)
    cruise: tuple[Mode, ...]
    steps: tuple[StepResponse, ...]
    lacking: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()


@overload
def aircraft() -> dict[str, Aircraft]: ...
@overload
def aircraft(name: str | Path) -> Aircraft: ...
@checks_types
def aircraft(name: str | Path | None = None) -> Aircraft | dict[str, Aircraft]:
    """Return an aircraft by name or folder, with its masses, speeds and limits in SI units and radians.

    name: name or folder; None returns all built-in aircraft, keyed by name.
    Raises a `planfly.PlanflyError` for an unknown name, and for a folder without an aircraft.

    >>> import planfly
    >>> planfly.aircraft("aerosonde").airspeed
    25.0
    >>> list(planfly.aircraft())
    ['aerosonde', 'c172x', 'ultrastick25e', 'x8', 'zagi']
    """
    if name is None:
        return {embedded_name: load_aircraft(embedded_name) for embedded_name in aircraft_names()}
    return find_aircraft(str(name.resolve()) if isinstance(name, Path) else name)


class DataSheetOptions(TypedDict, total=False):
    """Numbers of an aircraft's data sheet, and a file of autopilot parameters; see `new_aircraft`."""

    mass: float | None
    span: float | None
    area: float | None
    cruise: float | None
    stall: float | None
    top: float | None
    bank: float | None
    climb: float | None
    battery: str | None
    motor: float | None
    prop: str | None
    layout: Layout | None
    fuel: float | None
    params: str | Path | None


@api_function()
def new_aircraft(
    folder: str | Path,
    source: str | Path | None = None,
    *,
    overwrite: bool = False,
    **options: Unpack[DataSheetOptions],
) -> Aircraft:
    """Make the folder of a new aircraft.

    Without options the folder becomes a copy of another aircraft's folder.  With options it gets a model that matches
    the stated numbers, scaled from published aircraft of the same class, and a list of unknown properties.  Then mass,
    span, cruise and stall are required, and other missing numbers are estimated.

    source: aircraft to copy, a name or a folder; None copies the Aerosonde.  It cannot be combined with options.
    overwrite: True replaces the aircraft's files in an existing folder; other files in it are kept.
    mass: kg.
    span: wing span, m.
    area: wing area, m^2.
    cruise, stall, top: airspeeds of usual, slowest and fastest level flight, m/s.
    bank: maximum bank in turns, degrees.
    climb: steepest climb at cruise, degrees.
    battery: voltage and capacity, such as "14.8V,5Ah" or "14.8V,74Wh".
    motor: rpm per volt.
    prop: diameter and pitch in inches, such as "12x6".
    layout: "tail" (default), "wing" for a flying wing with elevons, "vtail" for a V-tail.
    fuel: fuel carried by an aircraft without a battery, kg.
    params: a file of ArduPlane's or PX4's parameters.  Missing values of cruise, stall, bank, climb and drag are taken
    from this file if they differ from the autopilot's defaults.
    Raises a `planfly.PlanflyError` for bad input; then nothing is made.

    >>> import planfly, tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     copied = planfly.new_aircraft(Path(place) / "mine")
    ...     made = planfly.new_aircraft(Path(place) / "foam", mass=2.1, span=1.6, cruise=15, stall=10, layout="wing")
    >>> copied.name, copied.mass
    ('mine', 11.0)
    >>> made.mass, made.airspeed, round(made.wing_area, 2)
    (2.1, 15.0, 0.32)
    """
    sheet_values = {name: value for name, value in options.items() if value is not None}
    if not sheet_values:
        source_aircraft = _load_aircraft("aerosonde" if source is None else source)
        model = shipped_model(source_aircraft) if source_aircraft.model.shipped else None
        copy_aircraft_folder(Path(folder), source_aircraft, model, overwrite=overwrite)
        return find_aircraft(str(Path(folder).absolute()))
    if source is not None:
        reason = f"cannot be combined with `{next(iter(sheet_values))}`, because a copy keeps the original's values"
        raise PlanflyError.of_argument("source", source, reason)
    from planfly.workflow.data_sheets import make_data_sheet_folder, parse_sheet

    params = options["params"]
    texts = ("battery", "prop", "layout", "params")
    sheet_numbers = {name: cast("float | None", value) for name, value in options.items() if name not in texts}
    sheet = parse_sheet(sheet_numbers, battery=options["battery"], prop=options["prop"], layout=options["layout"])
    with stage(f"making {Path(folder).name}", "making"):
        return make_data_sheet_folder(
            Path(folder), sheet, None if params is None else Path(params), overwrite=overwrite
        )


@api_function()
def describe_aircraft(
    name: str | Path, *, motor_braking: bool = False, out: str | Path | None = None, overwrite: bool = False
) -> AircraftNumbers:
    """Compute trims, modes, envelope and step responses of an aircraft; draw them if a folder is named.

    name: name of a built-in aircraft, or a folder.
    motor_braking: True to let the motor brake in descents.
    out: a folder for ``envelope.png``, ``trims.png`` and ``steps.png``, in whose name {name} stands for the aircraft's
    name; None writes no pictures.
    overwrite: True replaces existing pictures.
    Raises a `planfly.PlanflyError` for bad input; then nothing is written.

    >>> import planfly
    >>> numbers = planfly.describe_aircraft("aerosonde")
    >>> numbers.envelope.level_speeds(0.0)
    (15.9..., 32.4...)
    """
    aircraft_entry = _load_aircraft(name)
    model_sha256 = model_hash(aircraft_entry)
    # This also refuses invalid settings files.
    autopilot_kinds = (*autopilot_classes().values(), *program_classes())
    missing_files = tuple(
        missing_file
        for autopilot_kind in autopilot_kinds
        for missing_file in autopilot_kind.missing_files(aircraft_entry)
    )
    folder = None if out is None else expand_path_pattern(out, aircraft_entry.name, 0)
    if folder is not None:
        check_output_folder(folder, overwrite)
    # Compute all results before writing any file.
    with stage(f"trimming {aircraft_entry.name}", "trimming"):
        envelope = load_envelope(aircraft_entry, motor_braking=motor_braking)
        check_level_flight(aircraft_entry, envelope)
        trims = trim_table(aircraft_entry)
        modes = {row.trim.airspeed: level_flight_modes(aircraft_entry, row.trim.airspeed) for row in trims}
        cruise, steps = level_flight_modes(aircraft_entry, aircraft_entry.airspeed), step_responses(aircraft_entry)
    files: tuple[Path, ...] = ()
    if folder is not None:
        # Imported here: only pictures need matplotlib.
        from logs.views.aircraft import draw_envelope, draw_step_responses, draw_trims
        from logs.views.drawing import png_bytes

        with stage("drawing", "drawing an aircraft"):
            pictures = {
                "envelope.png": png_bytes(draw_envelope(aircraft_entry, envelope)),
                "trims.png": png_bytes(draw_trims(aircraft_entry, trims, modes)),
                "steps.png": png_bytes(draw_step_responses(aircraft_entry, steps)),
            }
        prepare_folder(folder, tuple(pictures))
        for file, data in pictures.items():
            write_atomically(folder / file, data)
        files = tuple(folder / file for file in pictures)
    return AircraftNumbers(aircraft_entry, model_sha256, envelope, trims, modes, cruise, steps, missing_files, files)


def _load_aircraft(name: str | Path) -> Aircraft:
    """Load an aircraft by its built-in name or from its folder.

    name: a `Path`, or a text with a slash, is a folder.

    Raises PlanflyError for an unknown name, and for a folder that is missing or has no aircraft.
    """
    text = str(name.absolute()) if isinstance(name, Path) else name
    if not names_folder(text):
        return find_aircraft(text)
    if not Path(text).exists():
        message = f"{text}: no such folder; planfly aircraft --new {shlex.quote(text)} makes it"
        raise PlanflyError(message, file=text)
    return find_aircraft(absolute_path(Path(text)))
