"""Read all columns of a CSV, MAT, Parquet or HDF5 file as arrays."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from logs.importers.columns.file_names import DATA_SUFFIXES
from world.errors import LogError
from world.files import missing_text
from world.wording import count_text

Column = np.ndarray[Any, Any]
# First bytes of a MAT file of version 7.3, which is an HDF5 file.
_MAT_73 = b"MATLAB 7.3"
# First bytes of an HDF5 file.
_HDF5 = b"\x89HDF"
# Characters that can separate the cells of a CSV file.
_SEPARATORS = ",;\t"
# Pattern of a CSV cell with a number or without a value.
_NUMBER = re.compile(r"\s*[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?\s*|\s*(nan|inf)?\s*", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class DataFile:
    """The columns of a data file.

    path: the file.
    columns: one-dimensional array of each column, keyed by name, in the order of the file; their lengths may differ.
    units: unit of each column, keyed by name, if a CSV file states units in a row below its header.
    """

    path: Path
    columns: dict[str, Column]
    units: dict[str, str] = field(default_factory=dict)


def read_data_file(path: Path) -> DataFile:
    """Read a data file in the format that its suffix names.

    Raises LogError for an unknown suffix, and for a file that cannot be read or has no rows.
    """
    suffix = path.suffix.lower()
    readers: dict[str, Callable[[Path], DataFile]] = {
        ".csv": _read_csv,
        ".mat": _read_mat,
        ".parquet": _read_parquet,
        ".h5": _read_hdf5,
        ".hdf5": _read_hdf5,
    }
    if suffix not in readers:
        raise LogError.at(path, "suffix", suffix or "none", f"expected {', '.join(DATA_SUFFIXES)}")
    try:
        if not path.is_file():
            raise LogError(f"{path}: {missing_text(path)}; expected {', '.join(DATA_SUFFIXES)}", file=path)
        if not path.stat().st_size:
            raise LogError(f"{path}: empty; expected columns of numbers", file=path)
        data = readers[suffix](path)
    except (LogError, MemoryError):
        raise
    # A damaged file makes these libraries raise errors of many kinds: of struct, zlib, arrow, and others.
    except Exception as error:
        reason = (str(error).splitlines() or [""])[0] or type(error).__name__
        raise LogError(f"{path}: cannot be read as a {suffix} file: {reason}", file=path) from error
    if not any(len(values) for values in data.columns.values()):
        raise LogError(f"{path}: holds no rows; expected columns of numbers", file=path)
    return data


# ----------------------------------------------------------------------
# CSV.


def _read_csv(path: Path) -> DataFile:
    """Read a CSV file with a header line.

    Remarks may precede the header, and a line with units may follow it.

    Raises LogError for a file without rows or without column names, for two columns with the same name, and for rows
    with another number of cells than the header.
    """
    import pandas as pd

    text = path.read_bytes().decode("utf-8-sig", errors="replace")
    lines = text.splitlines()
    for header_index, line in enumerate(lines):
        if line.lstrip().startswith(("#", "%")):
            # A line that begins with # or % is a remark, unless it has as many cells as the next line.
            separator = max(_SEPARATORS, key=line.count)
            next_lines = lines[header_index + 1 : header_index + 2]
            widths = [text.rstrip(f" {separator}").count(separator) for text in (line, *next_lines)]
            if widths[0] == 0 or widths[0] != widths[-1] or not next_lines:
                continue
        if line.strip():
            break
    else:
        raise LogError(f"{path}: holds no rows; expected columns of numbers", file=path)
    header = lines[header_index].lstrip("#% ")
    separator = max(_SEPARATORS, key=header.count)
    names = [name.strip().strip('"') for name in header.split(separator)]
    if all(_NUMBER.fullmatch(name) for name in names):
        raise LogError(
            f"{path}: line {header_index + 1}: {header[:40]!r}: expected the names of the columns", file=path
        )
    if len(set(names)) < len(names):
        repeated = next(name for k, name in enumerate(names) if name in names[:k])
        raise LogError.at(path, "columns", repr(repeated), "two columns have this name")
    rows = [(k, line) for k, line in enumerate(lines[header_index + 1 :], header_index + 2) if line.strip()]
    units: dict[str, str] = {}
    if rows and not any(_NUMBER.fullmatch(cell) for cell in rows[0][1].split(separator) if cell.strip()):
        cells = [cell.strip().strip('"[]()') for cell in rows.pop(0)[1].split(separator)]
        units = dict(zip(names, cells, strict=False))
    width = len(names)
    for number, line in rows:
        cell_count = line.count(separator) + 1
        # A separator at the end of each row adds an empty cell; quoted cells may contain separators.
        if (
            cell_count != width
            and '"' not in line
            and not (cell_count == width + 1 and line.rstrip().endswith(separator))
        ):
            allowed = f"expected {width}, as in the header"
            raise LogError(
                f"{path}: line {number}: {count_text(cell_count, 'cell')}: {allowed}",
                file=path,
                value=cell_count,
                allowed=allowed,
            )
    decimal = "," if separator == ";" and any("," in line for _, line in rows[:10]) else "."
    from io import StringIO

    body = "\n".join(line for _, line in rows)
    # The names are given, so that a separator at the end of a row does not make its first cell an index.
    options = {"header": None, "names": names, "index_col": False, "skipinitialspace": True, "low_memory": False}
    table = pd.read_csv(StringIO(body), sep=separator, decimal=decimal, **options)
    return DataFile(path, {str(name): _convert_numbers(table[name].to_numpy()) for name in table.columns}, units)


def _convert_numbers(values: Column) -> Column:
    """Convert integers, floats and booleans to float64; return other values unchanged."""
    return values.astype(np.float64) if values.dtype.kind in "fiub" else values


# ----------------------------------------------------------------------
# MAT, before version 7.3.


def _read_mat(path: Path) -> DataFile:
    """Read the variables of a MAT file; a file of version 7.3 is read as HDF5."""
    with path.open("rb") as file:
        head = file.read(128)
    if head.startswith(_MAT_73) or head.startswith(_HDF5):
        return _read_hdf5(path)
    from scipy.io import loadmat

    variables = loadmat(path, squeeze_me=True, struct_as_record=False)
    columns: dict[str, Column] = {}
    for name, value in variables.items():
        if not name.startswith("__"):
            labels = variables.get(f"{name}_label")
            columns |= dict(_list_mat_columns(name, value, labels))
    return DataFile(path, columns)


def _list_mat_columns(name: str, value: Any, labels: Any = None) -> Iterator[tuple[str, Column]]:
    """Yield the name and the values of each column of a MATLAB variable.

    Columns are the fields of a struct, also of nested structs, or the columns of a matrix.

    name: name of the variable.
    value: value of the variable, as loaded by scipy.
    labels: names of a matrix's columns; None if unknown.
    """
    if hasattr(value, "_fieldnames"):
        for field_name in value._fieldnames:
            yield from _list_mat_columns(f"{name}.{field_name}", getattr(value, field_name))
        return
    array = np.asarray(value)
    if array.dtype.names is not None:
        for field_name in array.dtype.names:
            yield from _list_mat_columns(f"{name}.{field_name}", array[field_name])
        return
    titles = [str(label) for label in np.atleast_1d(labels)] if labels is not None else []
    yield from _list_array_columns(name, array, titles)


def _list_array_columns(name: str, array: Column, titles: list[str] | None = None) -> Iterator[tuple[str, Column]]:
    """Yield the name and the values of each column of an array.

    An array of more than two dimensions yields nothing.  A number or an array of one dimension is one column.  In a
    matrix, rows are along the longer axis, unless the number of titles shows which axis has the columns.

    name: name of the array, with which the names of a matrix's columns start.
    titles: names of a matrix's columns; None or [] if unknown.
    """
    if array.ndim < 2:
        values = np.atleast_1d(array)
        yield name, values.astype(np.float64) if values.dtype.kind in "fiub" else values
    elif array.ndim == 2:
        has_titles = titles is not None and len(titles) in array.shape
        rows = (
            array
            if (len(titles or ()) == array.shape[1] if has_titles else array.shape[0] >= array.shape[1])
            else array.T
        )
        for k in range(rows.shape[1]):
            title = f"{name}.{titles[k]}" if has_titles and titles else f"{name}[{k}]"
            yield from _list_array_columns(title, np.ascontiguousarray(rows[:, k]))


# ----------------------------------------------------------------------
# Parquet and HDF5.


def _read_parquet(path: Path) -> DataFile:
    """Read the columns of a Parquet file."""
    import pyarrow.parquet as pq

    table = pq.read_table(path)
    columns = {}
    for name in table.column_names:
        values = table[name].to_numpy()
        columns[name] = _convert_numbers(np.asarray(values))
    return DataFile(path, columns)


def _read_hdf5(path: Path) -> DataFile:
    """Read all data sets of an HDF5 file or of a MAT file of version 7.3."""
    import h5py

    columns: dict[str, Column] = {}

    def visit(name: str, item: Any) -> None:
        """Add the columns of a data set; groups and MATLAB's internal data sets are ignored."""
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):
            return
        title, values = name.replace("/", "."), np.asarray(item[()])
        if item.attrs.get("MATLAB_class") == b"char":
            values = np.array("".join(chr(code) for code in values.ravel()))
        if values.dtype.names is not None:
            for field_name in values.dtype.names:
                columns.update(_list_array_columns(f"{title}.{field_name}", np.squeeze(values[field_name])))
        else:
            columns.update(_list_array_columns(title, np.squeeze(values)))

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return DataFile(path, columns)
