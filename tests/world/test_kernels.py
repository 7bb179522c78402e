"""Compiled functions read records and tuples by name, and are kept as long as what they are made of."""

import ctypes
import math
import os
import pickle
import subprocess
import sys
import textwrap
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba.core.registry import cpu_target

from planfly.kernel_units.unit_kernels import UNIT_KERNELS
from world.by_reference import _layout, by_reference
from world.kernel_cache import stamp
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


# A file of constants, a kernel that another file's kernel calls, and a program that is no kernel.
SOURCES = {
    "numbers_.py": "FACTOR = 2.0\n",
    "inner.py": """
        from numbers_ import FACTOR
        from world.kernels import compiled

        @compiled
        def scaled(a: float) -> float:
            \"\"\"Scaled.\"\"\"
            return a * FACTOR
        """,
    "outer.py": """
        from inner import scaled
        from world.kernels import compiled

        @compiled
        def shifted(a: float) -> float:
            return scaled(a) + 1.0
        """,
    "report.py": """
        from outer import shifted
        from world.compile_events import tell_before_compiling

        compiled_anew = []
        with tell_before_compiling(lambda: compiled_anew.append(1)):
            print(shifted(10.0), len(compiled_anew))
        """,
}


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A folder of small sources, run once."""
    for name, text in SOURCES.items():
        (tmp_path / name).write_text(textwrap.dedent(text), encoding="utf-8")
    assert _run(tmp_path) == (21.0, 2)
    return tmp_path


def _run(folder: Path) -> tuple[float, int]:
    """What the report prints: the kernels' result, and how many were compiled anew."""
    env = os.environ | {
        "NUMBA_CACHE_DIR": str(folder / "cache"),
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(folder)]),
    }
    command = [sys.executable, "-B", str(folder / "report.py")]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
    result, anew = done.stdout.split()
    return float(result), int(anew)


def _edit(folder: Path, name: str, old: str, new: str) -> None:
    text = (folder / name).read_text(encoding="utf-8")
    assert old in text
    (folder / name).write_text(text.replace(old, new), encoding="utf-8")


def test_an_edit_that_no_kernel_is_made_of_compiles_none_anew(sources: Path) -> None:
    assert _run(sources) == (21.0, 0)
    _edit(sources, "report.py", "compiled_anew = []", "# Another word.\ncompiled_anew = []")
    _edit(sources, "numbers_.py", "FACTOR", "OTHER = 5.0\nFACTOR")
    _edit(sources, "inner.py", "Scaled.", "Scaled, in other words, which take no line more.")
    os.utime(sources / "outer.py")
    assert _run(sources) == (21.0, 0)


@pytest.mark.parametrize(
    ("name", "old", "new", "result"),
    [
        ("numbers_.py", "2.0", "3.0", 31.0),
        ("inner.py", "a * FACTOR", "a + FACTOR", 13.0),
        ("inner.py", "a * FACTOR", "a * FACTOR * 10.0", 201.0),
        ("outer.py", "+ 1.0", "+ 2.0", 22.0),
    ],
)
def test_an_edit_of_a_kernel_or_a_constant_in_it_compiles_what_is_made_of_it(
    sources: Path, name: str, old: str, new: str, result: float
) -> None:
    _edit(sources, name, old, new)
    assert _run(sources) == (result, 1 if name == "outer.py" else 2)
    assert _run(sources) == (result, 0)


def test_every_constant_that_a_kernel_takes_has_a_text() -> None:
    for name in sorted({name for names in UNIT_KERNELS.values() for name in names}):
        module, _, kernel = name.rpartition(".")
        assert len(stamp(getattr(import_module(module), kernel))) == 64
    with pytest.raises(TypeError, match="no text"):
        stamp(_take_unknown)


_UNKNOWN = object()


@compiled
def _take_unknown() -> object:  # pragma: no cover - never compiled
    return _UNKNOWN


@pytest.mark.parametrize("own", ["", "mine"])
def test_kernels_are_kept_in_the_users_cache_unless_the_user_says_where(own: str, tmp_path: Path) -> None:
    env = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    env |= {"XDG_CACHE_HOME": str(tmp_path)} | ({"NUMBA_CACHE_DIR": str(tmp_path / own)} if own else {})
    code = "import world.kernels, numba; print(numba.config.CACHE_DIR)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=env, capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()).name == (own or "kernels")


class Place(NamedTuple):
    """A place, and what is measured there."""

    east: float
    values: np.ndarray


@by_reference
class Site(NamedTuple):
    """Fields of every kind."""

    place: Place
    number: int
    flag: bool
    record: Record
    table: np.ndarray


@by_reference
class Sites(NamedTuple):
    """One within another."""

    weight: float
    site: Site


@compiled
def _sum_site(site: Site) -> float:  # pragma: no cover - compiled
    total = site.place.east + site.number + site.record.leg + site.record.inner.north + (1000.0 if site.flag else 0.0)
    for k in range(site.table.shape[0]):
        total += site.table[k, 1] + site.place.values[k]
    return total


@compiled
def _sum_sites(sites: Sites) -> float:  # pragma: no cover - compiled
    return sites.weight * _sum_site(sites.site)


def _sites() -> Sites:
    record: Record = np.zeros(1, OUTER)[0]
    record.leg, record.inner.north = 4, 0.5
    # Every second number of the rows: a view whose numbers do not follow each other.
    table = np.arange(12.0).reshape(2, 6)[:, ::2]
    return Sites(2.0, Site(Place(0.25, np.array([7.0, 8.0])), 3, True, record, table))


def test_kernels_read_what_stands_behind_a_pointer() -> None:
    sites = _sites()
    of_site = 0.25 + 3 + 4 + 0.5 + 1000.0 + (2.0 + 7.0) + (8.0 + 8.0)
    assert _sum_site(sites.site) == of_site
    assert _sum_sites(sites) == 2.0 * of_site
    assert _sum_sites(sites._replace(weight=3.0)) == 3.0 * of_site
    assert _sum_sites(pickle.loads(pickle.dumps(sites))) == 2.0 * of_site


def test_what_stands_behind_a_pointer_lies_as_compiled_code_has_it() -> None:
    context = cpu_target.target_context
    reference = numba.typeof(_sites())
    laid_out = context.get_abi_sizeof(context.get_data_type(reference.held))
    assert ctypes.sizeof(_layout(_sites()).memory) == laid_out


def test_no_reference_to_what_stands_behind_a_pointer_is_lost_or_kept() -> None:
    sites = _sites()
    _sum_sites(sites)
    before = sys.getrefcount(sites), sys.getrefcount(sites.site.table)
    for _ in range(100):
        _sum_sites(sites)
    assert (sys.getrefcount(sites), sys.getrefcount(sites.site.table)) == before
