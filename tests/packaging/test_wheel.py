"""What is installed: everything that is needed, in another folder, on every Python that is there."""

import json
import os
import re
import shutil
import subprocess
import sys
import venv
import zipfile
from email import message_from_bytes
from email.message import Message
from importlib.metadata import distributions, packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from tests.packaging.conftest import PACKAGES, ROOT
from tests.soak import SOAK, only_in_soak
from world.extras import EXTRAS

VERSIONS = ("3.11", "3.12", "3.13")
# The oldest Python that a fresh machine brings: Debian 12's.
DEBIANS = "3.11.2"


@pytest.fixture(scope="module")
def metadata(wheel: Path) -> Message:
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        return message_from_bytes(archive.read(name))


@only_in_soak
def test_a_package_index_shows_it(wheel: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "twine", "check", "--strict", wheel], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout


def test_every_pinned_version_installs_on_debians_python() -> None:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = dict(line.split("==") for line in lines if "==" in line)
    here = {canonicalize_name(one.name): one for one in distributions() if one.name}
    refused = {}
    for name in pinned:
        one = here.get(canonicalize_name(name))
        needs = one and one.metadata.get("Requires-Python")
        if needs and not SpecifierSet(needs).contains(DEBIANS):
            refused[name] = needs
    assert refused == {}


def test_it_says_who_and_for_what(metadata: Message) -> None:
    assert metadata["Author"] == "The planfly developers"
    assert metadata["License-Expression"] == "BSD-3-Clause"
    classifiers = metadata.get_all("Classifier", [])
    assert {f"Programming Language :: Python :: {version}" for version in VERSIONS} <= set(classifiers)
    assert metadata["Description-Content-Type"] == "text/markdown"


def test_its_page_needs_no_file_beside_it_and_names_those_of_the_sources(metadata: Message) -> None:
    text = str(metadata.get_payload())
    assert "![" not in text
    assert all(address.startswith(("https://", "#")) for address in re.findall(r"\]\(([^)\s]+)\)", text))
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    linked = {address.partition("#")[0] for address in re.findall(r"[^!]\[[^\]]*\]\(((?!https?:|#)[^)\s]+)\)", readme)}
    assert len(linked) > 15
    for name in linked:
        assert f"`{name}`" in text
        assert (ROOT / name).is_file()


def test_no_address_is_named_that_does_not_exist(metadata: Message) -> None:
    """planfly has no repository, no pages and no place in a package index that anybody could open."""
    assert metadata.get_all("Project-URL", []) == []
    assert metadata["Home-page"] is None
    names = ("README.md", "CITATION.cff", "CHANGELOG.md", "CONTRIBUTING.md", "pyproject.toml", "setup.py")
    pages = [ROOT / name for name in names] + sorted((ROOT / "docs").rglob("*.md"))
    pages += [file for package in PACKAGES for file in (ROOT / package).rglob("*.py")]
    named = re.compile(r"\.(com|org|net|io)/planfly|planfly\.(org|io|dev|com|readthedocs)\b|pip install planfly\b")
    assert named.search("see https://github.com/planfly/planfly")
    assert {file.name for file in pages if named.search(file.read_text(encoding="utf-8"))} == set()


# ----------------------------------------------------------------------
# The base and the extras.


def requirements(metadata: Message, extra: str) -> set[str]:
    """Packages that an extra adds, by the wheel's metadata, of extras that it names, too."""
    found = set()
    for line in metadata.get_all("Requires-Dist", []):
        one = Requirement(line)
        if one.marker is not None and one.marker.evaluate({"extra": extra}):
            of_others = set[str]().union(*(requirements(metadata, other) for other in one.extras))
            found |= of_others or {canonicalize_name(one.name)}
    return found


def test_the_extras_are_those_of_the_list(metadata: Message) -> None:
    assert set(metadata.get_all("Provides-Extra", [])) == {*EXTRAS, "all", "test", "docs", "bench"}
    here = {name: canonicalize_name(ones[0]) for name, ones in packages_distributions().items()}
    # Named otherwise than what is imported of it, where it is not installed.
    here.setdefault("imageio_ffmpeg", "imageio-ffmpeg")
    for extra in EXTRAS.values():
        assert requirements(metadata, extra.name) == {here[module] for module in extra.modules}, extra.name
    assert requirements(metadata, "all") == set().union(*(requirements(metadata, name) for name in EXTRAS))


def test_no_package_is_both_in_the_base_and_in_an_extra(metadata: Message) -> None:
    needed = [Requirement(line) for line in metadata.get_all("Requires-Dist", [])]
    base = {canonicalize_name(one.name) for one in needed if one.marker is None}
    assert len(base) > 15
    assert base & requirements(metadata, "all") == set()


def test_every_file_of_the_packages_is_in_it(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        held = set(archive.namelist())
    made = ("__pycache__", ".nbi", ".nbc", ".pyc")
    files = {
        file.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for file in (ROOT / package).rglob("*")
        if file.is_file() and not any(part in file.as_posix() for part in made)
    }
    assert {"world/elevation/jacksboro.npz", "world/elevation/README.md", "planfly/py.typed"} <= files
    assert files - held == set()
    assert not any(name.startswith("tests/") for name in held)


def run(python: Path, folder: Path, *arguments: str, without_path: bool = False) -> "subprocess.CompletedProcess[str]":
    """without_path: without the programs of this machine, such as ffmpeg."""
    left_out = {"PYTHONPATH", *(["PATH"] if without_path else [])}
    environment = {name: value for name, value in os.environ.items() if name not in left_out}
    return subprocess.run(
        [python, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def python_of(place: Path) -> Path:
    return place / ("Scripts" if sys.platform == "win32" else "bin") / "python"


def test_it_runs_from_another_folder_in_an_environment_of_its_own(wheel: Path, tmp_path: Path) -> None:
    place, folder = tmp_path / "venv", tmp_path / "elsewhere"
    folder.mkdir()
    venv.create(place, symlinks=sys.platform != "win32")
    (packages,) = place.glob("lib/python*/site-packages")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(packages)
    # What it depends on, as this environment has it; an editable planfly there is found by a hook, not by its folder.
    (packages / "dependencies.pth").write_text("\n".join(path for path in sys.path if "site-packages" in path))
    python = python_of(place)
    code = (
        "import planfly, world.raster\nfrom planfly.cli import main\nmain(['scenarios'])\n"
        "print(planfly.__file__)\nprint(world.raster.open_raster('jacksboro').shape)"
    )
    done = run(python, folder, "-c", code)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("jacksboro")
    *_, where, shape = done.stdout.splitlines()
    assert Path(where).is_relative_to(place)
    assert shape == "(344, 403)"
    assert list(folder.iterdir()) == []


def interpreters() -> dict[str, Path]:
    """Pythons of this machine by version, on its path or as pyenv keeps them."""
    found = {}
    for version in VERSIONS:
        here = shutil.which(f"python{version}")
        kept = sorted(Path("~/.pyenv/versions").expanduser().glob(f"{version}.*/bin/python"))
        if sys.version_info[:2] == tuple(map(int, version.split("."))):
            found[version] = Path(sys.executable)
        elif kept or here:
            found[version] = kept[-1] if kept else Path(str(here))
    return found


# What the base may take, MB, with the bytecode that pip compiles of it all, and without pip and setuptools themselves,
# which an environment brings.
MAX_MEGABYTES = 570
# A command of each extra, by which it is missed.
MISSED = {
    "campaigns": "campaign paper-07",
    "live": "serve",
    "studio": "studio",
    "foxglove": "replay out/flight.mcap --foxglove",
    "films": "replay out/flight.mcap --movie a.mp4",
    "tables": "export out/flight.mcap a.parquet",
    "px4-logs": "check a.ulg",
    "data-logs": "check a.csv",
    "identification": "aircraft --identify a.BIN --mass 13 --span 2.9 --out mine",
    "forecast": "fly out/plan.json --forecast a.nc --at 2026-05-01T06:00Z",
    "grib": "fly out/plan.json --forecast a.grib2 --at 2026-05-01T06:00Z",
}


def megabytes(place: Path) -> float:
    """The files that were installed into an environment, MB."""
    (packages,) = place.glob("lib/python*/site-packages")
    brought = ("pip", "setuptools", "pkg_resources", "_distutils_hack", "wheel")
    files = [
        file
        for one in packages.iterdir()
        if re.split("[-.]", one.name)[0] not in brought
        for file in ([one] if one.is_file() else one.rglob("*"))
        if file.is_file()
    ]
    return sum(file.stat().st_size for file in files) / 1e6


@pytest.mark.skipif(
    not SOAK and "PLANFLY_WHEELS" not in os.environ,
    reason="installs everything anew for each Python: minutes; make wheels, which CI calls, too",
)
@pytest.mark.parametrize("version", sorted(interpreters()))
def test_the_base_installs_flies_and_misses_each_extra_on(version: str, wheel: Path, tmp_path: Path) -> None:
    place, folder = tmp_path / "venv", tmp_path / "elsewhere"
    folder.mkdir()
    subprocess.run([interpreters()[version], "-m", "venv", place], check=True)
    python = python_of(place)
    constraints = ("--constraint", str(ROOT / "constraints.txt"))
    done = run(python, folder, "-m", "pip", "install", "--quiet", *constraints, str(wheel))
    assert done.returncode == 0, done.stderr
    taken = megabytes(place)
    assert 100.0 < taken < MAX_MEGABYTES, f"{taken:.0f} MB"
    done = run(python, folder, "-m", "planfly", "run", "paper-07", "--seed", "1", "--out", "out")
    assert done.returncode == 0, done.stderr
    there = json.loads((folder / "out" / "verdict.json").read_text())
    assert there["flyable"]
    assert {file.name for file in folder.iterdir()} == {"out"}
    (folder / "a.ulg").write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8))
    (folder / "a.csv").write_text("t,roll\n0,1\n")
    (folder / "a.nc").write_bytes(b"\x89HDF\r\n\x1a\n")
    (folder / "a.grib2").write_bytes(b"GRIB")
    before = sorted(folder.rglob("*"))
    # A cluster's extra is missed where that of campaigns is there.
    assert set(MISSED) == set(EXTRAS) - {"cluster"}
    for extra, command in MISSED.items():
        done = run(python, folder, "-m", "planfly", *command.split(), without_path=True)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), f"{command}: {done.stderr}"
        assert done.stderr.endswith(f"the extra '{extra}': pip install 'planfly[{extra}]'\n")
    assert sorted(folder.rglob("*")) == before
