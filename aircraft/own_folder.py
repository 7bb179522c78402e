"""A folder for an aircraft of one's own, made from one that is known."""

import re
from pathlib import Path

from aircraft.catalog import Aircraft
from world.atomic_files import write_folder
from world.errors import FlightError

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
# Names of files that every folder has.
_TAKEN = ("ardupilot", "gains", "README")
_SUFFIXES = frozenset({".xml", ".toml", ".parm", ".md"})
_SHIPPED = re.compile(r"^(\s*shipped_by_jsbsim\s*=\s*)true\b", re.MULTILINE)


def make_own_folder(folder: Path, source: Aircraft) -> tuple[str, ...]:
    """Make a folder that holds the same aircraft under the folder's name: whole, or not at all.

    A model that JSBSim ships stays JSBSim's, and is named in the metadata.  Returns the names of its files, sorted.
    Raises FlightError for a folder that exists, that has no place to stand, or whose name is none for a model, and
    OSError where it cannot be written.

    >>> from tempfile import TemporaryDirectory
    >>> from aircraft.catalog import load_aircraft, read_aircraft
    >>> with TemporaryDirectory() as home:
    ...     print(make_own_folder(Path(home) / "mine", load_aircraft("c172x")))
    ...     read_aircraft(Path(home) / "mine").mass
    ('README.md', 'ardupilot.parm', 'ardupilot.toml', 'gains.toml', 'mine.toml')
    1124.9
    """
    target = folder.absolute()
    if _NAME.fullmatch(target.name) is None or target.name in _TAKEN:
        allowed = f"a folder's name of letters, digits, '.', '_' and '-' is expected, none of {', '.join(_TAKEN)}"
        raise FlightError(f"{folder}: {allowed}", file=folder, value=target.name, allowed=allowed)
    if target.exists() or target.is_symlink():
        raise FlightError(f"{folder}: exists; name a folder that does not", file=folder)
    if not target.parent.is_dir():
        raise FlightError(f"{folder}: its folder {target.parent} does not exist", file=folder)
    files = _renamed(source, target.name)
    write_folder(target, files)
    return tuple(sorted(files))


def _renamed(source: Aircraft, name: str) -> dict[str, bytes]:
    """What the folder holds, by path within it: the aircraft's files, its own two under the new name."""
    folders = [source.folder, *(folder for folder in source.model_folders if source.folder in folder.parents)]
    found = [file for folder in folders if folder.is_dir() for file in folder.iterdir()]
    files = {}
    for file in found:
        if file.suffix not in _SUFFIXES or not file.is_file():
            continue
        where = file.relative_to(source.folder)
        own = where if where.stem != source.name else where.with_name(f"{name}{where.suffix}")
        files[str(own)] = file.read_bytes()
    metadata = files[f"{name}.toml"].decode("utf-8").replace(f"{source.name}.xml", f"{name}.xml")
    files[f"{name}.toml"] = _SHIPPED.sub(rf'\g<1>"{source.name}"', metadata).encode()
    return files
