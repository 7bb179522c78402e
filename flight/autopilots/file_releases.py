"""Find an autopilot's release in the comments of a parameter file, and choose the simulated release."""

import re
from collections.abc import Sequence
from typing import NamedTuple, TypeVar

_Version = TypeVar("_Version", bound=str)


class FileRelease(NamedTuple):
    """Release of the autopilot that wrote a parameter file.

    release: major and minor number, such as "4.5".
    evidence: the comment or the parameter name that shows the release.
    """

    release: str
    evidence: str


# Release in a comment as QGroundControl writes it.
_QGC_COMMENT = re.compile(r"^\s*#+\s*version\s*:\s*V?(\d{1,2})\.(\d{1,2})", re.IGNORECASE | re.MULTILINE)


def release_in_comments(text: str, program: str) -> FileRelease | None:
    r"""Return the release that the comments of a parameter file state, or None if they state none.

    program: name of the program, after which a comment may state the release.

    >>> release_in_comments("# Stack: PX4 Pro\n# Version: 1.15.4 stable\n", "PX4")
    FileRelease(release='1.15', evidence='Version: 1.15')
    >>> release_in_comments("#NOTE: ArduPlane V4.5.7\n", "ArduPlane")
    FileRelease(release='4.5', evidence='ArduPlane V4.5')
    """
    in_program_name = re.compile(
        rf"^\s*#.*\b{re.escape(program)}[ :]+V?(\d{{1,2}})\.(\d{{1,2}})", re.IGNORECASE | re.MULTILINE
    )
    for pattern in (in_program_name, _QGC_COMMENT):
        if match := pattern.search(text):
            return FileRelease(f"{int(match[1])}.{int(match[2])}", match[0].lstrip("# \t").removeprefix("NOTE: "))
    return None


def nearest_release(versions: Sequence[_Version], release: tuple[int, int]) -> _Version:
    """Return the newest simulated release that is not newer than a release.

    If all simulated releases are newer, return the oldest of them.

    versions: the simulated releases, oldest first.
    release: major and minor number.

    >>> [nearest_release(("1.16", "1.17"), release) for release in ((1, 15), (1, 16), (1, 18))]
    ['1.16', '1.16', '1.17']
    """
    releases = [tuple(map(int, version.split("."))) for version in versions]
    not_newer = [version for version, numbers in zip(versions, releases, strict=True) if numbers <= release]
    return not_newer[-1] if not_newer else versions[0]


def choose_release_for_file(
    versions: Sequence[_Version],
    requested_version: _Version | None,
    writer_release: FileRelease | None,
    params: str,
    title: str,
) -> tuple[_Version, tuple[str, ...]]:
    """Return the release to simulate with a parameter file, and notes.

    There is one note if the file is from another release, otherwise none.

    versions: the simulated releases, oldest first; the newest is simulated if nothing states a release.
    requested_version: release that the user names, or None.
    writer_release: release that wrote the file.
    params: path of the file.
    title: name of the autopilot.
    """
    if writer_release is None:
        return requested_version or versions[-1], ()
    major, minor = map(int, writer_release.release.split("."))
    version = requested_version or nearest_release(versions, (major, minor))
    if version == writer_release.release:
        return version, ()
    reason = "as requested" if requested_version else "the nearest available release"
    return version, (
        f"{params} was written for {title} {writer_release.release} ({writer_release.evidence}),"
        f" but {title} {version} is simulated, {reason}",
    )
