"""Recognize data files and tables of columns by their names, and find the table of a data file."""

from pathlib import Path

from world.errors import LogError

# Suffixes of data files.
DATA_SUFFIXES = (".csv", ".mat", ".parquet", ".h5", ".hdf5")
# Name of a table that applies to all data files of its folder.
FOLDER_TABLE = "columns.toml"
# End of the name of a table that applies to one data file.
TABLE_SUFFIX = ".columns.toml"


def is_column_table_name(path: Path) -> bool:
    """Return True if a path is named like a table of columns: columns.toml or *.columns.toml.

    >>> [is_column_table_name(Path(name)) for name in ("flight.columns.toml", "columns.toml", "scenario.toml")]
    [True, True, False]
    """
    return path.name == FOLDER_TABLE or path.name.endswith(TABLE_SUFFIX)


def find_column_table(path: Path) -> Path:
    """Return the path of a data file's table of columns: its own table, or else the table for its folder.

    Raises LogError if neither exists.
    """
    choices = (path.with_name(f"{path.stem}{TABLE_SUFFIX}"), path.with_name(FOLDER_TABLE))
    for choice in choices:
        if choice.is_file():
            return choice
    advice = f"`planfly import {choices[0]} --columns-from {path}` writes a first table, which you then check"
    raise LogError(f"{path}: no table of columns ({choices[0].name} or {FOLDER_TABLE}): {advice}", file=path)
