"""List the files that the page may open, which are in the folder of the file that the command named."""

import contextlib
from pathlib import Path

from planfly.studio.documents import DROPPED_SUFFIXES, MAP_SUFFIXES
from planfly.studio.settings import PARAMETER_FILES
from planfly.studio.view_model import Json
from world.errors import MissionError

# Maximum number of files that are listed.
_MAX_FILES = 200
_READABLE_SUFFIXES = (*DROPPED_SUFFIXES, *PARAMETER_FILES)
_LISTED_SUFFIXES = tuple(suffix for suffix in _READABLE_SUFFIXES if suffix not in MAP_SUFFIXES)
# Bytes that identify a plan or a mission, for suffixes that other files also have.
_MISSION_MARKS = {".json": b"planfly.plan/", ".txt": b"QGC WPL"}
# Size of the part of a file that is searched for these bytes.
_SEARCHED_BYTES = 2**20


def folder_message(folder: Path | None) -> Json:
    """Return a message for the page with the files of a folder, by name.

    Files are missions, plans, logs and parameter files.

    At most `_MAX_FILES` are listed.  Links to files in other folders are left out, and so are text files and JSON
    documents without a mission.  The list is empty for no folder, and for one that cannot be read.

    >>> folder_message(Path("no such folder"))["files"]
    []
    """
    if folder is None:
        return {"folder": "", "files": []}
    files: list[Path] = []
    try:
        resolved_folder = folder.resolve(strict=True)
        for file in sorted(resolved_folder.iterdir()):
            suffix = file.suffix.lower()
            if suffix not in _LISTED_SUFFIXES or not file.is_file():
                continue
            mark = _MISSION_MARKS.get(suffix, b"")
            # Unreadable files are left out.
            with contextlib.suppress(OSError), file.open("rb") as stream:
                if mark in stream.read(_SEARCHED_BYTES if mark else 0):
                    files.append(file)
    except OSError:
        return {"folder": "", "files": []}
    return {
        "folder": home_relative_text(resolved_folder),
        "files": [file.name for file in files[:_MAX_FILES] if file.resolve().parent == resolved_folder],
    }


def home_relative_text(path: Path) -> str:
    """Return the full path as text, with ~ for the user's home folder.

    >>> home_relative_text(Path.home() / "missions"), home_relative_text(Path("/srv"))
    ('~/missions', '/srv')
    """
    full_path, home = path.resolve(), Path.home().resolve()
    return str("~" / full_path.relative_to(home)) if full_path.is_relative_to(home) else str(full_path)


def find_file_in_folder(folder: Path | None, name: str) -> Path:
    """Return the full path of a file in the folder or its subfolders.

    name: path of the file relative to the folder.
    Raises MissionError for a file that does not exist, is outside the folder, or has an unknown type.

    >>> find_file_in_folder(Path("/tmp"), "../etc/passwd")
    Traceback (most recent call last):
        ...
    world.errors.MissionError: open: name: '../etc/passwd': expected a file in /tmp
    """
    if folder is None:
        allowed = "the studio was started without a file, so there is no folder to open from: drop the file here"
        raise MissionError.at("open", "name", name[:60], allowed, shown=repr(name[:60]))
    try:
        resolved_folder = folder.resolve(strict=True)
        path = (resolved_folder / name).resolve()
        is_inside = path.is_relative_to(resolved_folder) and ".." not in Path(name).parts
        is_missing = is_inside and not path.exists()
    except (OSError, ValueError, RuntimeError):
        is_inside = is_missing = False
    if is_missing or not is_inside or not path.is_file():
        place = home_relative_text(folder)
        allowed = f"no such file in {place}" if is_missing else f"expected a file in {place}"
        raise MissionError.at("open", "name", name[:60], allowed, shown=repr(name[:60]))
    if path.suffix.lower() not in _READABLE_SUFFIXES:
        raise MissionError.at(
            "open", "suffix", path.suffix, f"expected one of {', '.join(_READABLE_SUFFIXES)}", shown=repr(path.suffix)
        )
    return path
