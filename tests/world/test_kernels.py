"""Compiled functions read records and tuples by name, and are kept as long as what they are made of."""

import ctypes
import math
import os
import pickle
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba.core.registry import cpu_target

from planfly.kernel_units.unit_kernels import UNIT_KERNELS
from world.by_reference import _get_layout, by_reference
from world.kernel_cache import PACKAGES, kernel_sources, sources_digest
from world.kernels import Record, compiled, field_names, inlined, inner, read_only, record_dtype

ROOT = Path(__file__).parents[2]
INNER = record_dtype("east", "north")
OUTER = record_dtype("first", ("leg", np.int64), ("inner", INNER), ("done", np.bool_), ("row", np.float64, (3,)))


@compiled
def _mark(record: Record, east: float) -> float:
    record.inner.east = east
    record.leg += 2
    record.done = True
    record.row[1] = record.first
    return record.inner.north + record.leg


@compiled
def _divide(a: float, b: float) -> float:
    return a / b


@inlined
def _twice(a: float) -> float:
    return 2.0 * a


@inner
def _thrice(a: float) -> float:
    return 3.0 * a


@compiled
def _add_twice(values: np.ndarray, out: np.ndarray) -> None:
    for k in range(values.size):
        out[k] += _twice(values[k])


def test_what_python_calls_inner_functions_by_is_kept_of_each() -> None:
    for kernel, product in ((_twice, 10.0), (_thrice, 15.0)):
        assert kernel(5.0) == product
        del vars(kernel)["_wrapper"]
        assert kernel(5.0) == product
        around: Any = vars(kernel)["_wrapper"]
        assert sum(around.stats.cache_hits.values()) == 1


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


# Two kernels, a constant that reaches one of them through another file, a package's module, and what is no kernel.
SOURCES = {
    "world/numbers_.py": "FACTOR = 2.0\n",
    "world/factors.py": "from world.numbers_ import FACTOR\n\nTWICE = 2.0 * FACTOR\n",
    "planner/inner.py": "from world.factors import (\n    TWICE,\n)\n\n\n@compiled\ndef scaled(a):\n    return TWICE\n",
    "flight/outer.py": "from planner import inner\n\n\n@inlined\ndef shifted(a):\n    return inner.scaled(a) + 1.0\n",
    "logs/report.py": "from flight.outer import shifted\n\nprint(shifted(10.0))\n",
    "world/waves.py": "@inner\ndef wave(a):\n    return a\n",
    "world/folds.py": "@compiled_inline\ndef fold(a):\n    return a\n",
}


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A folder of small packages."""
    for name, text in SOURCES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("name", SOURCES)
def test_kernels_are_kept_until_a_file_that_they_are_made_of_changes(name: str, sources: Path) -> None:
    before = sources_digest(sources)
    assert sources_digest(sources) == before
    with (sources / name).open("a", encoding="utf-8") as file:
        file.write("ANOTHER = 5.0\n")
    assert (sources_digest(sources) == before) == (name == "logs/report.py")


def test_a_new_kernel_counts_and_another_file_does_not(sources: Path) -> None:
    before = sources_digest(sources)
    (sources / "logs" / "words.py").write_text("WORDS = 1\n", encoding="utf-8")
    assert sources_digest(sources) == before
    (sources / "logs" / "words.py").write_text("@compiled\ndef words(a):\n    return a\n", encoding="utf-8")
    assert sources_digest(sources) != before


def test_what_a_kernel_takes_from_other_files_is_found_by_its_imports() -> None:
    """A file that kernels are made of imports ours by ``from ... import`` at its beginning, and nothing of reports."""
    files = kernel_sources(ROOT)
    assert not [name for name in files if name.startswith(("logs/views/report/", "logs/verdict/rules/"))]
    ours = "|".join(PACKAGES)
    other = re.compile(rf"^(?:import (?:{ours})\b|from \.)".encode(), re.MULTILINE)
    assert [name for name, content in files.items() if other.search(content)] == []
    for unit in UNIT_KERNELS.values():
        for kernel in unit:
            assert kernel.rpartition(".")[0].replace(".", "/") + ".py" in files


@pytest.mark.parametrize("own", ["", "mine"])
def test_kernels_are_kept_in_the_users_cache_unless_the_user_says_where(own: str, tmp_path: Path) -> None:
    env = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    env |= {"XDG_CACHE_HOME": str(tmp_path)} | ({"NUMBA_CACHE_DIR": str(tmp_path / own)} if own else {})
    code = "import world.kernels, numba; print(numba.config.CACHE_DIR)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=env, capture_output=True, text=True, check=True)
    folder = Path(done.stdout.strip())
    # Of other sources none is taken, whoever chose the place.
    assert folder.name == f"kernels-{sources_digest(ROOT)}"
    assert folder.parent == (tmp_path / own if own else tmp_path / "planfly")


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
def _sum_site(site: Site) -> float:
    total = site.place.east + site.number + site.record.leg + site.record.inner.north + (1000.0 if site.flag else 0.0)
    for k in range(site.table.shape[0]):
        total += site.table[k, 1] + site.place.values[k]
    return total


@compiled
def _sum_sites(sites: Sites) -> float:
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


@inner
def _power(base: float, exponent: int) -> float:
    power = 1.0
    for _ in range(exponent):
        power *= base
    return power


def test_a_kernel_of_kernels_is_compiled_once_for_all_literal_numbers_and_can_be_called_from_python() -> None:
    # Not kept: from the cache it would come with what it calls.
    sum_powers = numba.njit(lambda base, last: _power(base, 2) + _power(base, 3) + _power(base, last))
    assert sum_powers(2.0, 5) == 2.0**2 + 2.0**3 + 2.0**5
    assert _power.dispatcher.signatures == [(numba.float64, numba.int64)]  # type: ignore[attr-defined]
    assert _power(3.0, 4) == 81.0
    assert _power.__name__ == "_power"


def test_what_stands_behind_a_pointer_lies_as_compiled_code_has_it() -> None:
    context = cpu_target.target_context
    reference = numba.typeof(_sites())
    laid_out = context.get_abi_sizeof(context.get_data_type(reference.tuple_type))
    assert ctypes.sizeof(_get_layout(_sites()).memory) == laid_out


def test_arrays_that_can_be_written_make_no_other_kernel_behind_a_pointer() -> None:
    """As a scenario's are once another process has sent it."""
    place, frozen = Place(0.25, np.zeros(2)), Place(0.25, read_only(np.zeros(2)))
    site = Site(place, 3, True, np.zeros(1, OUTER)[0], np.zeros((2, 3)))
    assert numba.typeof(site) == numba.typeof(site._replace(place=frozen, table=read_only(site.table)))


def test_no_reference_to_what_stands_behind_a_pointer_is_lost_or_kept() -> None:
    sites = _sites()
    _sum_sites(sites)
    before = sys.getrefcount(sites), sys.getrefcount(sites.site.table)
    for _ in range(100):
        _sum_sites(sites)
    assert (sys.getrefcount(sites), sys.getrefcount(sites.site.table)) == before
