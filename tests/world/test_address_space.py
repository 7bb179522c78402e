"""A limit of address space is told in a line, before a library that would never return is loaded."""

import os
import resource
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from logs.importers.open_log import open_log
from world import address_space
from world.address_space import (
    LLVM_MIN_FREE_BYTES,
    MIN_FREE_BYTES,
    AddressSpaceError,
    AddressSpaceGuard,
    has_address_space,
)
from world.raster import open_npz

ROOT = Path(__file__).parents[2]
LIMIT = 480_000 * 1024


def test_openblas_is_not_loaded_where_it_would_look_for_room_without_end() -> None:
    """At 480,000 kB SciPy's OpenBLAS finds none for its buffers, and held the process until it was killed."""
    done = subprocess.run(
        [sys.executable, "-m", "planfly", "fly", "a.waypoints"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (LIMIT, LIMIT)),
    )
    assert done.returncode == 1
    (said,) = done.stderr.splitlines()
    assert said.startswith(
        "planfly: not enough memory: the limit of 480,000 kB of address space (ulimit -v) leaves less than "
    )


def test_room_is_asked_for_by_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(
        address_space, "has_address_space", lambda size: asked.append(size) or size < LLVM_MIN_FREE_BYTES
    )
    finder = AddressSpaceGuard(LIMIT)
    assert finder.find_spec("scipy.linalg") is None
    with pytest.raises(AddressSpaceError, match=r"leaves less than 192 MB to import llvmlite$"):
        finder.find_spec("llvmlite.binding")
    assert asked == [MIN_FREE_BYTES, LLVM_MIN_FREE_BYTES]


def test_room_is_what_can_be_mapped() -> None:
    assert has_address_space(2**20)
    # More than the addresses that there are.
    assert not has_address_space(2**60)


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("a.gpx", "logs.importers.open_log.import_module"),
        ("a.ulg", "logs.importers.px4_log.ULog"),
        ("a.npz", "numpy.load"),
    ],
)
def test_no_file_is_blamed_for_it(name: str, place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that claims more than fits is bad input; a process that may take nothing is not."""

    def refuse(*_: object, **__: object) -> None:
        raise AddressSpaceError("no room")

    file = tmp_path / name
    with zipfile.ZipFile(file, "w"):
        pass
    if name != "a.npz":
        file.write_bytes(b"ULog\x01\x12\x35\x01" if name == "a.ulg" else b"<gpx></gpx>")
    monkeypatch.setattr(place, refuse)
    with pytest.raises(AddressSpaceError):
        open_npz(file, name) if name == "a.npz" else open_log(file)
