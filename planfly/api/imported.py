"""Import and judge flight logs of other programs, fly their missions again, recover damaged logs."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Unpack

from logs.importers.columns.file_names import FOLDER_TABLE, TABLE_SUFFIX, is_column_table_name
from logs.recording.reader import FlightLog, read_log
from logs.recording.recorder import Recorder
from logs.recording.recover import recover_log
from logs.verdict.imported.model_comparison import Reflight
from logs.verdict.judge_flight import judge_flight
from logs.views.report.text import list_not_reflown, refly_lines
from planfly.api.api_function import api_function
from planfly.arguments import check_arguments
from planfly.flight_options import LogOptions
from planfly.kernel_units.unit_kernels import FLYING
from planfly.runtime.stages import stage
from planfly.workflow.imported_flights import ImportedFlight, fly_again, import_flight
from planfly.workflow.output_paths import (
    MAX_REFLOWN_PARTS,
    REFLY_FILES,
    check_output_file,
    check_output_folder,
    clean_folder,
)
from world.argument_types import checks_types
from world.errors import LogError, ScenarioError
from world.extras import requires_extra
from world.files import write_atomically

# Number of rows recorded per call; it is limited because a recorder needs many times the memory of a row.
_ROWS_PER_WRITE = 4096


@dataclass(frozen=True, slots=True)
class Reflown:
    """Result of `planfly.refly`.

    flights: each stretch of the mission with its simulation, the longest first.
    lines: lines that describe the differences between model and flight.
    files: pictures and logs of the simulated flights.
    """

    flights: tuple[Reflight, ...]
    lines: tuple[str, ...]
    files: tuple[Path, ...]


@api_function()
def read_imported(log: str | Path, **options: Unpack[LogOptions]) -> ImportedFlight:
    """Read and judge a flight from another program's log, without writing a log.

    The options are those of `import_log`.

    Raises ScenarioError for an option that does not apply to a flight from a log.
    """
    for name in ("params", "guidance", "autopilot", "airspeed", "nav", "seed"):
        if (value := dict(options)[name]) is not None:
            allowed = "not allowed for an imported flight, which is judged with the autopilot and the speeds of its log"
            raise ScenarioError.of_argument(name, value, allowed, shown="", file=log)
    return import_flight(Path(log), options)


@api_function()
def import_log(
    log: str | Path, target: str | Path | None = None, *, overwrite: bool = False, **options: Unpack[LogOptions]
) -> ImportedFlight:
    """Read a flight from another program's log, judge it against its plan, and write it as a flight log.

    log: log of ArduPilot (.BIN, .log), a ground station (.tlog) or PX4 (.ulg), a track (.gpx, .igc, .kml, .kmz), a
    table of columns (NAME.columns.toml), or a data file (.csv, .mat, .parquet, .h5) with a table next to it.
    target: the MCAP flight log to write; None writes no log.  overwrite: True replaces an existing log.
    plan: the planned mission or plan.json, which replaces the mission in the log.
    flight: number of the flight in the log, from 1; None for the flight with the longest time in AUTO.
    datum: datum of the log's altitudes if the log does not state it, "amsl" or "ellipsoid".
    scenario, terrain, fence, wind, turbulence, at, aircraft: see `planfly.fly`; without an aircraft, aircraft limits
    are not judged.  Options that set speeds are refused, because the log states the speeds.
    Raises a `planfly.PlanflyError` for bad input; then nothing is written.
    """
    if target is not None:
        check_output_file(Path(target), overwrite, Path(log))
    flight = read_imported(log, **options)
    if target is not None:
        path = Path(target)
        # The log is written completely or not at all.
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
            new_file = Path(folder) / path.name
            with Recorder(new_file, flight.setup) as recorder:
                # Write the events first, so that each event is at its time in the log.
                for event in flight.events:
                    recorder.event(event.time, event.text, event.level)
                for start in range(0, len(flight.track), _ROWS_PER_WRITE):
                    recorder.write(flight.track.rows(start, start + _ROWS_PER_WRITE))
                recorder.finish(flight.ended, flight.verdict)
            new_file.replace(path)
    return flight


@dataclass(frozen=True, slots=True)
class ColumnGuesses:
    """Result of `planfly.guess_columns`.

    table: the table that was written.
    guesses: number of lines in the table that are guesses, to be checked.
    missing: lines that list the quantities that were not found.
    """

    table: Path
    guesses: int
    missing: tuple[str, ...]


@requires_extra("data-logs")
@checks_types
def guess_columns(
    files: str | Path | Sequence[str | Path], table: str | Path, *, overwrite: bool = False
) -> ColumnGuesses:
    """Guess which column of data files holds which quantity; write the assignment to a table for review.

    The guess is based on the columns' names and values.

    files: CSV, MAT, Parquet or HDF5 files of one flight, the main one first.
    table: the table to write, ``NAME.columns.toml`` or ``columns.toml``.  overwrite: True replaces an existing one.

    Raises a `planfly.PlanflyError` for bad input; then nothing is written.
    """
    from logs.importers.columns.guesses import guess_column_table

    target = Path(table)
    if not is_column_table_name(target):
        allowed = f"expected {FOLDER_TABLE} or a name that ends with {TABLE_SUFFIX}"
        raise LogError(f"{target}: {allowed}", file=target, allowed=allowed)
    check_output_file(target, overwrite)
    text = guess_column_table([Path(file) for file in ([files] if isinstance(files, str | Path) else files)], target)
    write_atomically(target, text.encode())
    lines = text.splitlines()
    missing = tuple(line.removeprefix("# ") for line in lines if line.startswith("# Not found"))
    return ColumnGuesses(target, sum("# guess" in line for line in lines), missing)


# ----------------------------------------------------------------------
# Fly the mission of an imported flight again in JSBSim, and compare model and flight.


@api_function(*FLYING)
def refly(
    log: FlightLog | str | Path,
    out: str | Path | None = None,
    *,
    aircraft: str | Path | None = None,
    turbulence: str | None = None,
    overwrite: bool = False,
) -> Reflown:
    """Fly the mission of an imported flight again in JSBSim, in the wind of its log, and compare.

    log: a flight log that `planfly.import_log` wrote.
    out: a folder for pictures and for logs of the simulated flights; None writes no files.
    aircraft: name or folder of the aircraft to fly; None for the aircraft of the log.
    turbulence: turbulence of the simulated flight; None for the turbulence of the log.
    overwrite: True replaces results in the folder.
    Raises a `planfly.PlanflyError` for bad input; then nothing is written.
    """
    check_arguments(turbulence=turbulence)
    flight_log = log if isinstance(log, FlightLog) else read_log(log)
    if flight_log.setup.imported_log is None:
        message = f"{flight_log.source}: the flight was flown by planfly itself; expected a log by `planfly import`"
        raise LogError(message, file=flight_log.source)
    if out is not None:
        check_output_folder(Path(out), overwrite)
    with stage("flying again") as advance:
        model = str(aircraft.resolve()) if isinstance(aircraft, Path) else aircraft
        reflights = fly_again(flight_log.setup, flight_log.track, model, turbulence, advance, MAX_REFLOWN_PARTS)
    lines: list[str] = []
    for number, reflight in enumerate(reflights, 1):
        lines += [*([] if number == 1 else [""]), *refly_lines(reflight)]
    lines += list_not_reflown(reflights, flight_log.setup.imported_log.stretches, MAX_REFLOWN_PARTS)
    files: list[Path] = []
    if out is not None:
        folder = clean_folder(out, REFLY_FILES, overwrite=True)
        with stage("drawing", "drawing a flight again"):
            # Imported here: only pictures need matplotlib.
            from logs.views.compare import refly_charts
            from logs.views.drawing import draw_chart, png_bytes

            for number, reflight in enumerate(reflights, 1):
                ending = "" if number == 1 else f"-{number}"
                for name, chart in refly_charts(reflight).items():
                    files.append((folder / name).with_stem(f"{Path(name).stem}{ending}"))
                    write_atomically(files[-1], png_bytes(draw_chart(chart)))
                # The simulated flight as a flight log, for `compare` and `replay`.
                files.append(folder / f"simulated{ending}.mcap")
                verdict = judge_flight(reflight.setup, reflight.simulated, reflight.ended)
                with Recorder(files[-1], replace(reflight.setup, seed=flight_log.setup.seed)) as recorder:
                    recorder.write(reflight.simulated)
                    recorder.finish(reflight.ended, verdict)
    return Reflown(reflights, tuple(lines), tuple(files))


# ----------------------------------------------------------------------
# Recover damaged logs.


@checks_types
def recover(log: str | Path, out: str | Path | None = None, *, overwrite: bool = False) -> FlightLog | None:
    """Write the readable part of an unfinished or damaged flight log as a new log.

    out: the new log; None for ``<log>-recovered.mcap`` next to the damaged log.
    overwrite: True replaces an existing log.
    Returns the readable part of the flight, or None if the log is complete; then nothing is written.
    Raises a `planfly.PlanflyError` for bad input.

    >>> import planfly, tempfile
    >>> from logs.recording.example_log import write_example_log
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     planfly.recover(write_example_log(Path(folder) / "example.mcap")) is None
    True
    """
    target = recovered_path(log) if out is None else Path(out)
    check_output_file(target, overwrite)
    recovered_log = recover_log(Path(log))
    if recovered_log is None:
        return None
    write_atomically(target, recovered_log.data)
    return recovered_log.log


def recovered_path(log: str | Path) -> Path:
    """Return the default path for the readable part of a damaged log.

    It is ``<log>-recovered.mcap`` next to the log.

    >>> recovered_path("runs/flight.mcap").name
    'flight-recovered.mcap'
    """
    return Path(log).with_name(f"{Path(log).stem}-recovered.mcap")
