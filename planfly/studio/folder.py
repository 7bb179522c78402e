"""List the files that the page may open, which are in the folder of the file that the command named."""

from pathlib import Path

from planfly.studio.documents import DROPPED
from planfly.studio.settings import PARAMETER_FILES
from planfly.studio.view_model import Json
from world.errors import MissionError

# Maximum number of files that are listed.
_MAX_FILES = 200
_READABLE_SUFFIXES = (*DROPPED, *PARAMETER_FILES)


def folder_json(folder: Path | None) -> Json:
    """List the missions, plans, logs and parameter files of a folder, without links that lead out of the folder.

    >>> folder_json(Path("no such folder"))["files"]
    []
    """
    if folder is None:
        return {"folder": "", "files": []}
    try:
        inside = folder.resolve(strict=True)
        found = sorted(one for one in inside.iterdir() if one.suffix.lower() in _READABLE_SUFFIXES and one.is_file())
    except OSError:
        return {"folder": "", "files": []}
    return {
        "folder": shown_path(inside),
        "files": [one.name for one in found[:_MAX_FILES] if one.resolve().parent == inside],
    }


def shown_path(path: Path) -> str:
    """Return the full path as users write it, with ~ for their home folder.

    >>> shown_path(Path.home() / "missions"), shown_path(Path("/srv"))
    ('~/missions', '/srv')
    """
    whole, home = path.resolve(), Path.home().resolve()
    return str("~" / whole.relative_to(home)) if whole.is_relative_to(home) else str(whole)


def file_inside(folder: Path | None, name: str) -> Path:
    """Return a file by its path in the folder.  Raises MissionError if the file is outside or of another type.

    >>> file_inside(Path("/tmp"), "../etc/passwd")
    Traceback (most recent call last):
        ...
    world.errors.MissionError: open: name: '../etc/passwd': expected a file in /tmp
    """
    if folder is None:
        allowed = "the command named no file, so there is no folder to open from: drop the file here"
        raise MissionError.at("open", "name", name[:60], allowed, shown=repr(name[:60]))
    try:
        inside = folder.resolve(strict=True)
        path = (inside / name).resolve(strict=True)
        there = path.is_file() and path.is_relative_to(inside) and ".." not in Path(name).parts
    except (OSError, ValueError, RuntimeError):
        there = False
    if not there:
        raise MissionError.at("open", "name", name[:60], f"expected a file in {folder}", shown=repr(name[:60]))
    if path.suffix.lower() not in _READABLE_SUFFIXES:
        raise MissionError.at(
            "open", "suffix", path.suffix, f"allowed {', '.join(_READABLE_SUFFIXES)}", shown=repr(path.suffix)
        )
    return path
