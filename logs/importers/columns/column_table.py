"""Read and check a table of columns.

It is a TOML file that states which column of which data file has each quantity.  Each class stands for one part of the
file; square brackets show its place in the file.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from logs.importers.columns.quantities import QUANTITIES, UNITS
from world.errors import LogError
from world.files import did_you_mean, read_small_file, toml_table
from world.scenario_file import first_fault

# Name of the clock of columns that name no clock.
MAIN_CLOCK = "main"
_MAX_BYTES = 2**20


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, populate_by_name=True)


class AlignTable(_Table):
    """[clocks.NAME.align]: two signals whose correlation gives the clock's offset from the main clock.

    column: column on this clock.
    with: quantity that varies with the column, or column on the main clock that does.
    within_s: largest offset, s.
    """

    column: str
    partner: Annotated[str, Field(alias="with")]
    within_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 120.0


class ClockTable(_Table):
    """[clocks.NAME]: the times of the rows of a data file.

    file: data file, relative to the table; None for the table's file.
    column: column of times; None to compute the times from `rate`.
    unit: unit of the column of times.
    rate: rows per second.
    offset_s: time to add to all times, s.
    align: signals from which the offset from the main clock is found.
    """

    file: str | None = None
    column: str | None = None
    unit: str = "s"
    rate: Annotated[float, Field(gt=0.0, le=10_000.0)] | None = None
    offset_s: float = 0.0
    align: AlignTable | None = None


class ConditionTable(_Table):
    """The condition ``when`` of a column.

    Only rows in which another column of its clock has this value are used.
    """

    column: str
    value: float | str


class ColumnTable(_Table):
    """An entry of [columns]: the column, or the constant value, of a quantity.

    The quantity is ``sign * (scale * column + offset)`` in ``unit`` and ``frame``.

    rate: measurements per second, if fewer than rows; only rows in which the value changes are then used.
    when: condition for the rows to use.
    """

    column: str | None = None
    value: float | None = None
    clock: str = MAIN_CLOCK
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0
    sign: Literal[-1, 1] = 1
    frame: str = ""
    rate: Annotated[float, Field(gt=0.0, le=10_000.0)] | None = None
    when: ConditionTable | None = None

    @model_validator(mode="after")
    def _check_source(self) -> "ColumnTable":
        """Raise ValueError if the entry has neither a column nor a constant, or both."""
        if (self.column is None) == (self.value is None):
            raise ValueError("expected either `column`, the name of a column, or `value`, a constant")
        return self


class ModesTable(_Table):
    """[modes]: the flight modes.

    names: names of the values of the quantity `mode`, keyed by value.
    automatic: values of `mode` in which the vehicle follows its mission.
    """

    names: dict[str, str] = {}
    automatic: list[float | str] = []


def _as_list(entry: Any) -> Any:
    """Return a list unchanged, and any other entry as a list of one."""
    return entry if isinstance(entry, list) else [entry]


Entries = Annotated[list[ColumnTable], BeforeValidator(_as_list), Field(min_length=1)]


class LogTable(_Table):
    """The table of columns of one flight log.

    file: data file, relative to the table; ignored if the log is opened by the name of another data file.
    program: name of the program that flew, such as "ArduPlane V4.5.0".
    mission: mission file that the vehicle followed, relative to the table.
    parameter_columns: columns with names and values of the autopilot's parameters, in addition to [parameters].
    span_s: first and last time to read, on the main clock, s.
    clocks: clocks, keyed by name.
    columns: entries of each quantity, keyed by the name of the quantity.
    modes: flight modes.
    parameters: values of the autopilot's parameters, keyed by name.
    """

    file: str | None = None
    program: str = ""
    mission: str | None = None
    parameter_columns: tuple[str, str] | None = None
    span_s: tuple[float, float] | None = None
    clocks: dict[str, ClockTable] = {}
    columns: dict[str, Entries]
    modes: ModesTable = ModesTable()
    parameters: dict[str, float] = {}

    @model_validator(mode="after")
    def _check_entries(self) -> "LogTable":
        """Raise ValueError for an unknown quantity, unit, frame or clock, and for inconsistent entries."""
        for quantity, entries in self.columns.items():
            if quantity not in QUANTITIES:
                known = did_you_mean(quantity, QUANTITIES) or f": expected one of {', '.join(QUANTITIES)}"
                raise ValueError(f"columns.{quantity}: unknown quantity{known}")
            for entry in entries:
                entry_field, known_quantity = f"columns.{quantity}", QUANTITIES[quantity]
                if entry.unit or "" not in UNITS[known_quantity.dimension]:
                    _check_choice(f"{entry_field}.unit", entry.unit, UNITS[known_quantity.dimension])
                if entry.frame:
                    _check_choice(f"{entry_field}.frame", entry.frame, known_quantity.frames)
                if entry.value is None and entry.clock not in self.clocks:
                    _check_choice(f"{entry_field}.clock", entry.clock, self.clocks)
        for name, clock in self.clocks.items():
            _check_choice(f"clocks.{name}.unit", clock.unit, UNITS["time"])
            if clock.column is None and clock.rate is None:
                raise ValueError(f"clocks.{name}: expected `column`, the column of times, or `rate`, rows per second")
            if name == MAIN_CLOCK and clock.align is not None:
                raise ValueError(f"clocks.{name}.align: not allowed: the other clocks are aligned to this clock")
            partners = self.columns.get(clock.align.partner, []) if clock.align is not None else []
            if any(entry.value is None and self.clocks[entry.clock].align is not None for entry in partners):
                raise ValueError(f"clocks.{name}.align.with: expected a quantity whose clock has no `align`")
        if self.span_s is not None and not self.span_s[0] < self.span_s[1]:
            raise ValueError(f"span_s: {list(self.span_s)}: expected a start before an end")
        return self


def _check_choice(field: str, value: str, allowed: Iterable[str]) -> None:
    """Raise ValueError if a value is not one of the allowed values.

    field: key in the table, with which the message starts.
    """
    choices = tuple(allowed)
    if value not in choices:
        expected = f"expected {', '.join(choices)}" if choices else "none is allowed here"
        raise ValueError(f"{field}: {value or 'missing'}: {expected}")


def read_column_table(path: Path) -> LogTable:
    """Read and check a table of columns.

    Raises LogError for a file that cannot be read and for a wrong entry; the message states file, key, value and the
    allowed values.
    """
    text = read_small_file(path, _MAX_BYTES, "table of columns", LogError)
    try:
        data = toml_table(text.decode("utf-8-sig"))
    except ValueError as error:
        raise LogError(f"{path}: not valid TOML: {str(error).splitlines()[0]}", file=path) from error
    try:
        return LogTable.model_validate(data)
    except ValidationError as error:
        raise LogError(**first_fault(error, data, LogTable).at(str(path))) from error
