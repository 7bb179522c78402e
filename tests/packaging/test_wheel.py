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
from importlib.metadata import distributions
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from tests.packaging.conftest import PACKAGES, ROOT
from tests.soak import SOAK

VERSIONS = ("3.11", "3.12", "3.13")
# The oldest Python that a fresh machine brings: Debian 12's.
DEBIANS = "3.11.2"


@pytest.fixture(scope="module")
def metadata(wheel: Path) -> Message:
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        return message_from_bytes(archive.read(name))


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


def test_it_says_who_where_and_for_what(metadata: Message) -> None:
    assert metadata["Author"] == "The planfly developers"
    assert metadata["License-Expression"] == "BSD-3-Clause"
    assert {line.partition(",")[0] for line in metadata.get_all("Project-URL", [])} == {
        *("Repository", "Changelog", "Issues"),
    }
    classifiers = metadata.get_all("Classifier", [])
    assert {f"Programming Language :: Python :: {version}" for version in VERSIONS} <= set(classifiers)
    assert metadata["Description-Content-Type"] == "text/markdown"


def test_its_page_needs_no_file_beside_it(metadata: Message) -> None:
    text = str(metadata.get_payload())
    links = re.findall(r"(!?)\[[^\]]*\]\(([^)\s]+)\)", text)
    pictures = [address for picture, address in links if picture]
    assert pictures
    assert all(re.match(r"https://[^/]+/.+/raw/v[\d.]+/.+\.png$", address) for address in pictures)
    assert all(address.startswith(("https://", "#")) for _, address in links)
    # Each leads to a file that is there.
    for address in pictures:
        assert (ROOT / address.partition("/raw/v")[2].partition("/")[2]).is_file()


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


def run(python: Path, folder: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
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
    done = run(python, folder, "-m", "planfly", "scenarios")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("jacksboro")
    code = "import planfly, world.raster\nprint(planfly.__file__)\nprint(world.raster.open_raster('jacksboro').shape)"
    where, shape = run(python, folder, "-c", code).stdout.splitlines()
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


@pytest.mark.skipif(
    not SOAK and "PLANFLY_WHEELS" not in os.environ,
    reason="installs everything anew for each Python: minutes; make wheels, which CI calls, too",
)
@pytest.mark.parametrize("version", sorted(interpreters()))
def test_it_installs_and_flies_on(version: str, wheel: Path, tmp_path: Path) -> None:
    place, folder = tmp_path / "venv", tmp_path / "elsewhere"
    folder.mkdir()
    subprocess.run([interpreters()[version], "-m", "venv", place], check=True)
    python = python_of(place)
    constraints = ("--constraint", str(ROOT / "constraints.txt"))
    done = run(python, folder, "-m", "pip", "install", "--quiet", *constraints, str(wheel))
    assert done.returncode == 0, done.stderr
    done = run(python, folder, "-m", "planfly", "run", "paper-07", "--seed", "1", "--out", "out")
    assert done.returncode == 0, done.stderr
    there = json.loads((folder / "out" / "verdict.json").read_text())
    assert there["flyable"]
    assert {file.name for file in folder.iterdir()} == {"out"}
