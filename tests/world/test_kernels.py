"""Compiled functions read and set records by name, and their cache belongs to one version of the sources."""

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import world.kernels
from world.kernels import Record, compiled, field_names, inlined, record_dtype

ROOT = Path(__file__).parents[2]
INNER = record_dtype("east", "north")
OUTER = record_dtype("first", ("leg", np.int64), ("inner", INNER), ("done", np.bool_), ("row", np.float64, (3,)))


@compiled
def _mark(record: Record, east: float) -> float:  # pragma: no cover - compiled
    record.inner.east = east
    record.leg += 2
    record.done = True
    record.row[1] = record.first
    return record.inner.north + record.leg


@compiled
def _divide(a: float, b: float) -> float:  # pragma: no cover - compiled
    return a / b


@inlined
def _twice(a: float) -> float:  # pragma: no cover - compiled
    return 2.0 * a


@compiled
def _add_twice(values: np.ndarray, out: np.ndarray) -> None:  # pragma: no cover - compiled
    for k in range(values.size):
        out[k] += _twice(values[k])


def test_compiled_code_reads_and_sets_the_fields_that_python_sees() -> None:
    record: Record = np.zeros(1, OUTER)[0]
    record.first, record.inner.north, record.leg = 5.0, 7.0, 1
    assert _mark(record, -3.0) == 7.0 + 3
    assert (record.inner.east, record.inner.north, record.leg, bool(record.done)) == (-3.0, 7.0, 3, True)
    assert record.row.tolist() == [0.0, 5.0, 0.0]
    assert record.first == 5.0


def test_fields_keep_their_order_and_stand_where_a_processor_reads_them() -> None:
    assert field_names(OUTER) == ("first", "leg", "inner", "done", "row")
    offsets = [OUTER.fields[name][1] for name in field_names(OUTER)]  # type: ignore[index]  # numpy allows none at all
    assert offsets == sorted(offsets)
    assert all(offset % 8 == 0 for name, offset in zip(field_names(OUTER), offsets, strict=True) if name != "done")
    assert field_names(np.dtype(np.float64)) == ()  # type: ignore[arg-type]  # a number has no fields


def test_a_division_by_zero_is_infinite_or_no_number() -> None:
    assert _divide(1.0, 0.0) == math.inf
    assert _divide(-1.0, 0.0) == -math.inf
    assert math.isnan(_divide(0.0, 0.0))


def test_views_are_filled_through_a_function_that_is_copied_in() -> None:
    out = np.array([1.0, 1.0])
    _add_twice(np.array([3.0, -4.0]), out)
    assert out.tolist() == [7.0, -7.0]


@pytest.fixture
def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small tree of sources whose hash is taken."""
    for name in ("world/kernels.py", "planner/search/one.py", "tests/test_one.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x = 1\n", encoding="utf-8")
    monkeypatch.setattr(world.kernels, "__file__", str(tmp_path / "world" / "kernels.py"))
    return tmp_path


@pytest.mark.parametrize("room", ["aircraft", "world", "planner/search", "flight", "logs"])
def test_the_hash_follows_every_source_that_kernels_are_made_of(sources: Path, room: str) -> None:
    before = world.kernels._sources_hash()
    assert world.kernels._sources_hash() == before
    file = sources / room / "two.py"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("y = 1\n", encoding="utf-8")
    added = world.kernels._sources_hash()
    file.write_text("y = 2\n", encoding="utf-8")
    edited = world.kernels._sources_hash()
    file.rename(file.with_name("three.py"))
    renamed = world.kernels._sources_hash()
    assert len({before, added, edited, renamed}) == 4
    file.with_name("three.py").unlink()
    assert world.kernels._sources_hash() == before


def test_the_hash_does_not_follow_tests_and_prose(sources: Path) -> None:
    before = world.kernels._sources_hash()
    (sources / "tests" / "test_one.py").write_text("x = 2\n", encoding="utf-8")
    (sources / "world" / "README.md").write_text("prose\n", encoding="utf-8")
    assert world.kernels._sources_hash() == before


@pytest.mark.parametrize("own", ["", "mine"])
def test_kernels_are_kept_under_the_hash_unless_the_user_says_where(own: str, tmp_path: Path) -> None:
    env = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    env |= {"XDG_CACHE_HOME": str(tmp_path)} | ({"NUMBA_CACHE_DIR": str(tmp_path / own)} if own else {})
    code = "import world.kernels, numba; print(world.kernels._sources_hash(), numba.config.CACHE_DIR)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=env, capture_output=True, text=True, check=True)
    digest, folder = done.stdout.split()
    assert len(digest) == 16
    assert Path(folder).name == (own or f"kernels-{digest}")
