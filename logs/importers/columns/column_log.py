"""Read quantities of a flight log by its table of columns, in SI units and rad on one clock."""

import hashlib
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from logs.importers.columns.clock_shift import find_clock_shift
from logs.importers.columns.column_table import (
    MAIN_CLOCK,
    ClockTable,
    ColumnTable,
    LogTable,
    read_column_table,
)
from logs.importers.columns.data_files import Column, DataFile, read_data_file
from logs.importers.columns.file_names import find_column_table, is_column_table_name
from logs.importers.columns.quantities import (
    ANGLES,
    QUANTITIES,
    QUATERNION,
    UNIT_ZEROS,
    UNITS,
    find_likelier_unit,
    to_default_frame,
)
from world.arrays import Flags, Floats
from world.errors import LogError
from world.files import did_you_mean

# Largest ratio between the stated and the measured rate of a clock, in either direction.
_MAX_RATE_RATIO = 1.25
# Longest log, s: checks resample it in steps of 0.2 to 1 s, which takes 100 MB for seven days.
_MAX_DURATION_S = 604_800.0
# Minimum fraction of the values in a quantity's plausible range.
_MIN_PLAUSIBLE_FRACTION = 0.98
# Largest difference of a quaternion's length from 1.
_MAX_QUATERNION_ERROR = 0.05
# Minimum correlation of the two signals that align a clock.
_MIN_CORRELATION = 0.6
# Times above this are seconds since 1970.
_UTC_AFTER_S = 3e8


@dataclass(frozen=True, slots=True)
class Series:
    """One quantity over time.

    time: times on the main clock, s, (n,).
    values: values of the quantity, (n,); NaN for rows without a value.
    """

    time: Floats
    values: Floats


@dataclass(slots=True)
class _Clock:
    """The times of the rows of a data file.

    data: the file.
    time: times in the file plus the offset that the table states, s, (n,).
    rate: mean number of rows per second.
    """

    data: DataFile
    time: Floats
    rate: float


class ColumnLog:
    """A flight log in data files that a table of columns describes.

    path: path of the table, or of a data file with a table next to it.
    """

    def __init__(self, path: Path) -> None:
        """Read the table of columns and the data files.

        Raises LogError if a file cannot be read, or if a data file lacks a column that the table names.
        """
        table_path = path if is_column_table_name(path) else find_column_table(path)
        self.path, self.table_path = path, table_path
        self.table: LogTable = read_column_table(table_path)
        self._files: dict[Path, DataFile] = {}
        self._clocks: dict[str, _Clock] = {}
        self._shifts: dict[str, float] = {}
        self.utc_start = math.nan
        for quantity, entries in self.table.columns.items():
            for entry in entries:
                if entry.column is not None:
                    data = self._open_data_file(self.table.clocks[entry.clock])
                    self._find_column(data, entry.column, f"columns.{quantity}.column")

    @property
    def sha256(self) -> str:
        """SHA-256 of the log: of the bytes of the table and of `data_sha256`."""
        return hashlib.sha256(self.table_path.read_bytes() + self.data_sha256.encode()).hexdigest()

    @property
    def data_sha256(self) -> str:
        """SHA-256 of the bytes of all data files, in the order of their paths.

        It stays the same if the table is edited, and so shows from which log an aircraft was identified.
        """
        digest = hashlib.sha256()
        for path in sorted({self._find_data_path(clock) for clock in self.table.clocks.values()}):
            digest.update(path.read_bytes())
        return digest.hexdigest()

    def has(self, *quantities: str) -> bool:
        """Return True if the table has all these quantities; roll, pitch and yaw may come from a quaternion."""
        named = self.table.columns.keys()
        return all(quantity in named or self._is_from_quaternion(quantity) for quantity in quantities)

    def _is_from_quaternion(self, quantity: str) -> bool:
        """Return True for an angle that must be computed from the quaternion, as it has no column."""
        named = self.table.columns.keys()
        return quantity in ANGLES and quantity not in named and named >= set(QUATERNION)

    def column(self, quantity: str) -> str:
        """Return the column of a quantity's first entry, or the quantity's name for a constant.

        For an angle from the quaternion, it is the column of the quaternion's first component.
        """
        source = QUATERNION[0] if self._is_from_quaternion(quantity) else quantity
        return self.table.columns[source][0].column or quantity

    def unit(self, quantity: str) -> str:
        """Return the unit of a quantity's first entry in the table."""
        return self.table.columns[quantity][0].unit

    def frame(self, quantity: str) -> str:
        """Return the frame (axes, such as "NED") of a quantity's first entry, or the default frame."""
        return self.table.columns[quantity][0].frame or QUANTITIES[quantity].frames[0]

    def series(self, quantity: str) -> Series:
        """Read a quantity in SI units and radians, in its default frame.

        If a quantity has several entries, each row has the value of the first entry whose condition the row meets.

        Raises LogError for a missing column, text in place of numbers, implausible values, and entries with different
        numbers of rows.
        """
        if self._is_from_quaternion(quantity):
            return self._compute_angle(quantity)
        entries = self.table.columns[quantity]
        parts = [self._read_entry(quantity, entry) for entry in entries]
        if len(parts) == 1:
            return parts[0]
        time = parts[0].time
        values = parts[0].values.copy()
        for entry, part in zip(entries[1:], parts[1:], strict=True):
            if len(part.time) != len(time):
                raise self._make_error(f"columns.{quantity}.clock", entry.clock, "expected one clock for all entries")
            values = np.where(np.isfinite(values), values, part.values)
        return Series(time, values)

    def _compute_angle(self, angle: str) -> Series:
        """Compute roll, pitch or yaw, rad, from the logged attitude quaternion.

        The quaternion rotates from body axes FRD to NED, or from FLU to ENU.  Raises LogError if its components have
        different times, or if more than a few percent of its norms differ clearly from 1.
        """
        parts = [self.series(name) for name in QUATERNION]
        time = parts[0].time
        if any(not np.array_equal(part.time, time) for part in parts):
            allowed = "expected the clock of quaternion_w"
            raise self._make_error("columns.quaternion_x.clock", self.column("quaternion_x"), allowed)
        w, x, y, z = (part.values for part in parts)
        norms = np.sqrt(w * w + x * x + y * y + z * z)
        known = norms[np.isfinite(norms)]
        if known.size and np.mean(np.abs(known - 1.0) < _MAX_QUATERNION_ERROR) < _MIN_PLAUSIBLE_FRACTION:
            shown = f"{self.column('quaternion_w')} and the other parts have a length of {np.median(known):.3g}"
            raise self._make_error("columns.quaternion_w", shown, "expected 1")
        angles = {
            "roll": lambda: np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            "pitch": lambda: np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
            "yaw": lambda: np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        }
        factor, offset = to_default_frame(angle, self.frame("quaternion_w"))
        return Series(time, factor * angles[angle]() + offset)

    def raw_values(self, quantity: str) -> tuple[Floats, Column]:
        """Return the times (s) and the unconverted values of a quantity's first entry.

        The values may be texts, such as names of modes.
        """
        entry = self.table.columns[quantity][0]
        clock = self._get_clock(entry.clock)
        return self._align_times(entry.clock), self._find_column_on_clock(
            clock, entry.column or "", f"columns.{quantity}.column", entry.clock
        )

    def parameters(self) -> dict[str, float]:
        """Return the autopilot's parameters, keyed by name, from the parameter columns and from [parameters].

        A value in [parameters] takes precedence.  Values in the columns that are not finite are left out.  Raises
        LogError if the columns of names and values differ in length.
        """
        if self.table.parameter_columns is None:
            return dict(self.table.parameters)
        data = self._open_data_file(next(iter(self.table.clocks.values())))
        names, values = (
            self._find_column(data, column, "parameter_columns") for column in self.table.parameter_columns
        )
        if len(names) != len(values):
            raise self._make_error(
                "parameter_columns", f"{len(names)} names", f"{len(values)} values: expected equal numbers"
            )
        numbers = _parse_numbers(values, self._locate_column(data, self.table.parameter_columns[1]))
        stored = {decode_cell(name): value for name, value in zip(names, numbers.tolist(), strict=True)}
        return {name: value for name, value in stored.items() if math.isfinite(value)} | self.table.parameters

    # ------------------------------------------------------------------
    # Files and clocks.

    def _make_error(self, field: str, value: Any, allowed: str) -> LogError:
        """Return the error for a wrong value in the table.

        field: key in the table, such as "columns.roll.unit".
        allowed: text on the allowed values.
        """
        return LogError.at(self.table_path, field, value, allowed)

    def _find_data_path(self, clock: ClockTable) -> Path:
        """Return the path of a clock's data file.

        It is the file that the clock names, else the data file from which the log was opened, else the file that the
        table names.  Raises LogError if there is none.
        """
        if clock.file is not None:
            return self.table_path.parent / clock.file
        if self.path != self.table_path:
            return self.path
        if self.table.file is None:
            raise LogError(
                f"{self.table_path}: file: missing; expected the path of the data file",
                file=self.table_path,
                field="file",
            )
        return self.table_path.parent / self.table.file

    def _open_data_file(self, clock: ClockTable) -> DataFile:
        """Return the contents of a clock's data file, which is read at the first call."""
        path = self._find_data_path(clock)
        if path not in self._files:
            self._files[path] = read_data_file(path)
        return self._files[path]

    def _get_clock(self, name: str) -> _Clock:
        """Return the clock with a name; its times are read only at the first call."""
        if name not in self._clocks:
            self._clocks[name] = self._read_clock(name, self.table.clocks[name])
        return self._clocks[name]

    def _read_clock(self, name: str, clock: ClockTable) -> _Clock:
        """Read the times of a clock.

        Without a column of times, compute them from the number of rows and the rate.

        Raises LogError for missing or decreasing times, fewer than two different times, too long a log, and a stated
        rate that contradicts the times.
        """
        data, field = self._open_data_file(clock), f"clocks.{name}"
        if clock.column is None:
            column_names = [
                entry.column
                for entries in self.table.columns.values()
                for entry in entries
                if entry.column is not None and entry.clock == name
            ]
            lengths = [len(self._find_column(data, column)) for column in column_names]
            rate = clock.rate or 1.0
            return _Clock(data, np.arange(max(lengths, default=0)) / rate + clock.offset_s, rate)
        values = self._find_column(data, clock.column, f"{field}.column")
        if clock.unit == "iso" or values.dtype.kind == "M":
            import pandas as pd

            # Seconds since 1970; a text without a time zone is UTC.
            is_date = values.dtype.kind == "M"
            texts = values if is_date else [decode_cell(value) for value in values]
            try:
                stamps = pd.to_datetime(texts, utc=True, format=None if is_date else "ISO8601")
            except (ValueError, TypeError) as error:
                place, reason = self._locate_column(data, clock.column), str(error).splitlines()[0]
                message = f"{place}: {reason}: expected dates such as 2026-11-27T10:15:02.5"
                raise LogError(message, file=place) from None
            time = np.asarray(stamps.astype("datetime64[ns, UTC]").astype("int64"), np.float64) * 1e-9
        else:
            time = _parse_numbers(values, self._locate_column(data, clock.column)) * UNITS["time"][clock.unit]
        missing_rows = np.flatnonzero(~np.isfinite(time))
        if missing_rows.size:
            k = int(missing_rows[0])
            raise LogError.at(data.path, f"{clock.column}[{k}]", time[k], "expected a time in every row")
        decreasing_rows = np.flatnonzero(np.diff(time) < 0.0)
        if decreasing_rows.size:
            k = int(decreasing_rows[0]) + 1
            allowed = f"after {time[k - 1]:.6g} s:expected increasing times"
            raise LogError.at(data.path, f"{clock.column}[{k}]", f"{time[k]:.6g} s", allowed)
        if len(time) < 2 or time[-1] <= time[0]:
            raise LogError.at(data.path, clock.column, len(time), "expected at least two rows at different times")
        duration = float(time[-1] - time[0])
        if duration > _MAX_DURATION_S:
            allowed = f"expected at most {_MAX_DURATION_S:.0f} s from the first row to the last"
            raise LogError.at(data.path, clock.column, f"{duration:.6g} s", allowed)
        rate = float(len(time) - 1) / duration
        steps = np.diff(time)
        usual_rate = float(1.0 / np.median(steps[steps > 0.0]))
        if clock.rate is not None and not 1.0 / _MAX_RATE_RATIO <= usual_rate / clock.rate <= _MAX_RATE_RATIO:
            allowed = f"the times in {clock.column} have {usual_rate:.3g} rows a second: check the unit ({clock.unit})"
            raise self._make_error(f"{field}.rate", f"{clock.rate:g} Hz", allowed)
        return _Clock(data, time + clock.offset_s, rate)

    @cached_property
    def start(self) -> float:
        """Time on the main clock that becomes time 0, s.

        It is the clock's first time if the clock counts from 1970, otherwise 0.  In the first case, `utc_start` is set
        to it.
        """
        first = float(self._get_clock(self._main_clock).time[0])
        if first > _UTC_AFTER_S:
            self.utc_start = first
            return first
        return 0.0

    @property
    def _main_clock(self) -> str:
        """Name of the main clock: "main", or else the name of the first clock."""
        return MAIN_CLOCK if MAIN_CLOCK in self.table.clocks else next(iter(self.table.clocks))

    def _align_times(self, name: str) -> Floats:
        """Return the times of a clock, converted to the main clock, s.

        Raises LogError for a clock without `align` that has no time in common with the main clock.
        """
        time, main = self._get_unaligned_times(name), self._get_unaligned_times(self._main_clock)
        if self.table.clocks[name].align is None and (time[0] > main[-1] or time[-1] < main[0]):
            spans = f"{time[0]:.6g} to {time[-1]:.6g} s, {self._main_clock} from {main[0]:.6g} to {main[-1]:.6g} s"
            allowed = f"runs from {spans}, without overlap: use one clock, or set `offset_s` or `align`"
            raise self._make_error(f"clocks.{name}", self.table.clocks[name].column or "rows", allowed)
        return self._get_unaligned_times(name) + self._align_clock(name)

    def _get_unaligned_times(self, name: str) -> Floats:
        """Return the times of a clock without the shift of its `align`, s.

        Times that count from 1970 become seconds since `start`.
        """
        time = self._get_clock(name).time
        return time - self.start if time[0] > _UTC_AFTER_S else time

    def _align_clock(self, name: str) -> float:
        """Return the shift that aligns a clock with the main clock, to be added to its times, s.

        It is 0 without `align`.  At this shift, the two signals that `align` names correlate best.  Raises LogError if
        their correlation is too small at every shift.
        """
        align = self.table.clocks[name].align
        if align is None:
            return 0.0
        if name not in self._shifts:
            clock, field = self._get_clock(name), f"clocks.{name}.align"
            values = _parse_numbers(
                self._find_column_on_clock(clock, align.column, f"{field}.column", name),
                self._locate_column(clock.data, align.column),
            )
            # The signal to align with is a quantity, or a column with the main clock.
            if align.partner in self.table.columns:
                partner = self.series(align.partner)
            else:
                main = self._get_clock(self._main_clock)
                column = self._find_column_on_clock(main, align.partner, f"{field}.with", self._main_clock)
                place = self._locate_column(main.data, align.partner)
                partner = Series(self._align_times(self._main_clock), _parse_numbers(column, place))
            is_known, is_partner_known = np.isfinite(values), np.isfinite(partner.values)
            time = self._get_unaligned_times(name)[is_known]
            partner_time, partner_values = partner.time[is_partner_known], partner.values[is_partner_known]
            best = find_clock_shift(time, values[is_known], partner_time, partner_values, align.within_s)
            if best.correlation < _MIN_CORRELATION:
                message = f"{align.column} and {align.partner} have a correlation of at most {best.correlation:.2f}"
                requirement = f"expected at least {_MIN_CORRELATION:g} at a shift of at most {align.within_s:g} s"
                raise LogError(
                    f"{self.table_path}: {field}: {message}; {requirement}", file=self.table_path, field=field
                )
            self._shifts[name] = best.shift
        return self._shifts[name]

    # ------------------------------------------------------------------
    # Columns.

    def _find_column(self, data: DataFile, name: str, field: str = "") -> Column:
        """Return a column of a data file by name.

        Raises LogError, with a similar name as a hint, if the file does not have the column.

        field: key of the table that names the column.
        """
        if name not in data.columns:
            hint = did_you_mean(name, data.columns) or f": it has {', '.join(list(data.columns)[:12])}"
            raise self._make_error(field or "column", name, f"no such column in {data.path.name}{hint}")
        return data.columns[name]

    def _find_column_on_clock(self, clock: _Clock, name: str, field: str, clock_name: str) -> Column:
        """Return a column of the data file of a clock.

        Raises LogError if the file lacks the column, or if column and clock have different numbers of rows.

        field: key of the table that names the column.
        clock_name: name of the clock for the message.
        """
        values = self._find_column(clock.data, name, field)
        if len(values) != len(clock.time):
            allowed = f"{len(values)} rows, but the clock {clock_name} has {len(clock.time)}: expected equal numbers"
            raise self._make_error(field, name, allowed)
        return values

    def _locate_column(self, data: DataFile, name: str) -> str:
        """Return the path of a data file and the name of a column, as the start of a message."""
        return f"{data.path}: {name}"

    def _read_entry(self, quantity: str, entry: ColumnTable) -> Series:
        """Read one entry of a quantity, in SI units, radians and the default frame.

        A constant has a row for each time of the main clock.  Otherwise, only rows in the table's time span are
        returned, and rows that do not meet the entry's condition are NaN.  If the entry states a rate, only rows in
        which the value changes are returned.

        Raises LogError for implausible values, values that change more often than the stated rate, and a time span
        without rows.
        """
        if entry.value is not None:
            time = self._align_times(self._main_clock)
            return Series(time, np.full(len(time), self._convert(quantity, entry, np.array([entry.value]))[0]))
        field = f"columns.{quantity}"
        clock = self._get_clock(entry.clock)
        column = self._find_column_on_clock(clock, entry.column or "", f"{field}.column", entry.clock)
        raw = _parse_numbers(column, self._locate_column(clock.data, entry.column or ""))
        values = self._convert(quantity, entry, raw)
        if entry.when is not None:
            partner = self._find_column_on_clock(clock, entry.when.column, f"{field}.when.column", entry.clock)
            wanted = entry.when.value
            is_equal = (
                np.asarray([decode_cell(value) == wanted for value in partner], np.bool_)
                if isinstance(wanted, str)
                else np.asarray(partner == wanted, np.bool_)
            )
            values = np.where(is_equal, values, np.nan)
        self._check_plausible(quantity, entry, values)
        time = self._align_times(entry.clock)
        if entry.rate is not None:
            # The measurements of a column that is written more often than it is measured are the rows in which its
            # value changes.
            is_changed: Flags = np.concatenate([[True], np.diff(values) != 0.0]) & np.isfinite(values)
            rate = is_changed.sum() / max(1e-9, float(np.ptp(time)))
            stated_rate = entry.rate or 0.0
            if rate > _MAX_RATE_RATIO * stated_rate:
                problem = f"the value changes {rate:.3g} times a second"
                raise self._make_error(f"columns.{quantity}.rate", f"{stated_rate:g} Hz", problem)
            time, values = time[is_changed], values[is_changed]
        if self.table.span_s is not None:
            start, end = self.table.span_s
            is_in_span = (time >= start) & (time <= end)
            if not is_in_span.any():
                allowed = f"{quantity} has no rows in this span, only from {time[0]:.6g} to {time[-1]:.6g} s"
                raise self._make_error("span_s", f"{start:g} to {end:g} s", allowed)
            time, values = time[is_in_span], values[is_in_span]
        return Series(time, values)

    def _convert(self, quantity: str, entry: ColumnTable, raw: Floats) -> Floats:
        """Convert the numbers in a column to SI units, radians and the default frame, as the entry describes."""
        factor = UNITS[QUANTITIES[quantity].dimension][entry.unit]
        frame_factor, frame_offset = to_default_frame(quantity, entry.frame)
        scaled = entry.sign * (entry.scale * raw + entry.offset)
        return np.asarray(frame_factor * (factor * scaled + UNIT_ZEROS.get(entry.unit, 0.0)) + frame_offset)

    def _check_plausible(self, quantity: str, entry: ColumnTable, values: Floats) -> None:
        """Raise LogError if an entry has no values, or too many of them are implausible.

        The message names the unit in which they would be plausible, if there is one.

        values: values in SI units, radians and the default frame.
        """
        known = values[np.isfinite(values)]
        if not known.size:
            raise self._make_error(f"columns.{quantity}", entry.column, "holds no numbers in the rows that are read")
        limits = QUANTITIES[quantity]
        if limits.dimension == "mode":
            return
        is_plausible = (known >= limits.low) & (known <= limits.high)
        if is_plausible.mean() >= _MIN_PLAUSIBLE_FRACTION:
            return
        factor = UNITS[limits.dimension][entry.unit]
        largest = float(known[np.argmax(np.abs(known))])
        zero = UNIT_ZEROS.get(entry.unit, 0.0)
        unit = find_likelier_unit(quantity, entry.unit, float(np.quantile(np.abs(known - zero), 0.98)) / factor)
        hint = f"; is it in {unit}?" if unit else ""
        shown = f"{(largest - zero) / factor:.4g} {entry.unit}".rstrip()
        bounds = " to ".join(f"{(limit - zero) / factor:.4g}" for limit in (limits.low, limits.high))
        allowed = f"expected {bounds} {entry.unit}".rstrip()
        raise self._make_error(f"columns.{quantity}", f"{entry.column} has {shown}", f"{allowed}{hint}")


def decode_cell(value: Any) -> str:
    """Convert a cell of a text column to text; bytes are decoded as UTF-8."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _parse_numbers(values: Column, place: str) -> Floats:
    """Convert a column to numbers; empty texts and missing values become NaN.

    Raises LogError for a text that is not a number.

    place: file and column, with which the message starts.
    """
    if values.dtype.kind in "fiub":
        return values.astype(np.float64)
    numbers = np.full(len(values), np.nan)
    for k, value in enumerate(values):
        text = decode_cell(value).strip() if value is not None else ""
        if text:
            try:
                numbers[k] = float(text)
            except ValueError:
                raise LogError(f"{place}[{k}]: {text[:40]!r}: expected a number", file=place.split(":")[0]) from None
    return numbers
