from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from logs.importers.columns.data_files import read_data_file
from world.errors import LogError

TIME = np.arange(5.0)
ROLL = np.array([1.0, -2.5, 3.0, np.nan, 0.25])


def as_csv(path: Path) -> None:
    pd.DataFrame({"t": TIME, "roll": ROLL}).to_csv(path, index=False)


def as_semicolons(path: Path) -> None:
    path.write_text("# a flight\n\nt;roll\ns;deg\n0;1,0\n1;-2,5\n2;3,0\n3;\n4;0,25\n", encoding="utf-8-sig")


def as_remark(path: Path) -> None:
    path.write_text("# t, roll\n0, 1.0,\n1, -2.5,\n2, 3.0,\n3, nan,\n4, 2.5e-1,\n")


def as_mat(path: Path) -> None:
    savemat(path, {"t": TIME, "roll": ROLL.reshape(-1, 1)}, do_compression=True)


def as_mat_73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"], file["roll"] = TIME.reshape(1, -1), ROLL.reshape(1, -1)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512)
    path.write_bytes(head + path.read_bytes()[512:])


def as_parquet(path: Path) -> None:
    pd.DataFrame({"t": TIME, "roll": ROLL}).to_parquet(path)


def as_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["t"], file["roll"] = TIME, ROLL


WRITERS = [
    (as_csv, ".csv"),
    (as_semicolons, ".csv"),
    (as_remark, ".csv"),
    (as_mat, ".mat"),
    (as_mat_73, ".mat"),
    (as_parquet, ".parquet"),
    (as_hdf5, ".h5"),
    (as_hdf5, ".hdf5"),
]


@pytest.mark.parametrize(("write", "suffix"), WRITERS)
def test_each_format_holds_the_same_columns(tmp_path: Path, write, suffix: str) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / f"a{suffix}"
    write(path)
    columns = read_data_file(path).columns
    assert list(columns) == ["t", "roll"] or sorted(columns) == ["roll", "t"]
    assert columns["t"].tolist() == TIME.tolist()
    assert columns["roll"] == pytest.approx(ROLL, nan_ok=True)


@pytest.mark.parametrize(("write", "suffix"), [(as_mat, ".mat"), (as_parquet, ".parquet"), (as_hdf5, ".h5")])
@pytest.mark.parametrize("part", [0.3, 0.7, 0.97])
def test_a_truncated_file_is_refused_in_one_line(tmp_path: Path, write, suffix: str, part: float) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / f"a{suffix}"
    write(path)
    data = path.read_bytes()
    path.write_bytes(data[: int(part * len(data))])
    with pytest.raises(LogError) as refused:
        read_data_file(path)
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("\n\n", "holds no rows"),
        ("t,roll\n", "holds no rows"),
        ("t,roll\n1,2\n1,2,3\n", "line 3: 3 cells: expected 2, as in the header"),
        ("t,roll\n1,2\n1\n", "line 3: 1 cell: expected 2, as in the header"),
        ("1,2\n3,4\n", "line 1: '1,2': expected the names of the columns"),
        ("t,t\n1,2\n", "columns: 't': two columns have this name"),
    ],
)
def test_a_csv_file_without_regular_rows_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(LogError, match=said):
        read_data_file(path)


def test_units_below_the_header_are_kept(tmp_path: Path) -> None:
    as_semicolons(tmp_path / "a.csv")
    assert read_data_file(tmp_path / "a.csv").units == {"t": "s", "roll": "deg"}


def test_structs_matrices_and_labels_become_names(tmp_path: Path) -> None:
    rows = np.arange(12.0).reshape(4, 3)
    labels = np.array(["LineNo", "TimeMS", "Roll"], dtype=object)
    savemat(tmp_path / "a.mat", {"ATT": rows, "ATT_label": labels, "d": {"p": TIME, "m": {"v": ROLL}}, "xyz": rows.T})
    columns = read_data_file(tmp_path / "a.mat").columns
    assert columns["ATT.Roll"].tolist() == [2.0, 5.0, 8.0, 11.0]
    assert columns["d.p"].tolist() == TIME.tolist()
    assert columns["d.m.v"][1] == -2.5
    # The longer axis is the one of the rows.
    assert columns["xyz[1]"].tolist() == [1.0, 4.0, 7.0, 10.0]
