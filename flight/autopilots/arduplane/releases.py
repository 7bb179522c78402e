"""Find the ArduPlane release of a program, of a flight log and of a parameter file.

A ground station may write the release as a comment at the head of a parameter file. In other files the names show it,
because 4.7 renamed parameters (`conversion_table` in ArduPlane/Parameters.cpp).
"""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple, get_args

from flight.autopilots.arduplane.parameters import TABLE
from flight.autopilots.arduplane.renamed_parameters import NAMES_BEFORE_4_7, NAMES_SINCE_4_7, describe_renamed
from flight.autopilots.file_releases import FileRelease, choose_release_for_file, nearest_release, release_in_comments
from flight.autopilots.parameter_files import MAX_BYTES, parse_parameters
from world.errors import ParameterError
from world.files import read_small_file, utf8_text
from world.scenario_tables import NEWEST_ARDUPLANE, ArduPlaneVersion

_VERSIONS: tuple[ArduPlaneVersion, ...] = get_args(ArduPlaneVersion)
# Release in the name of a program, such as "ArduPlane V4.6.3 (3fc7011a)".
_PROGRAM_RELEASE = re.compile(r"\bV?(\d{1,2})\.(\d{1,2})")


def simulated_release(program: str) -> ArduPlaneVersion:
    """Return the simulated release for a program: the newest that is not newer than the program.

    For a program older than every simulated release, return the oldest simulated release. For a program that states no
    release, return the newest.

    >>> programs = ("ArduPlane V4.5.7", "ArduPlane V4.6.3 (3fc7011a)", "ArduPlane V4.7.0-dev", "ArduPilot")
    >>> [simulated_release(program) for program in programs]
    ['4.6', '4.6', '4.7', '4.7']
    """
    match = _PROGRAM_RELEASE.search(program)
    return NEWEST_ARDUPLANE if match is None else nearest_release(_VERSIONS, (int(match[1]), int(match[2])))


def release_difference_note(program: str) -> str:
    """Return a note if a log's firmware is of another ArduPlane release than the simulated one.

    The result is "" if the releases are the same, or if the firmware states no release.

    program: name and version of the firmware, as in the log.

    >>> release_difference_note("ArduPlane V4.5.7"), release_difference_note("ArduPlane V4.7.3")
    ('flown by ArduPlane 4.5, but simulated with 4.6', '')
    """
    match = _PROGRAM_RELEASE.search(program)
    if match is None or f"{int(match[1])}.{int(match[2])}" == simulated_release(program):
        return ""
    return f"flown by ArduPlane {int(match[1])}.{int(match[2])}, but simulated with {simulated_release(program)}"


def file_release(text: str, names: Iterable[str]) -> FileRelease | None:
    r"""Return the release that wrote a parameter file, or None if unknown.

    The release in a comment has priority over the release that the parameter names indicate. The names indicate no
    release if the file has names of both 4.6 and 4.7, or of neither.

    >>> file_release("#NOTE: ArduPlane V4.5.7\nALT_SLOPE_MIN 15", ["ALT_SLOPE_MIN"])
    FileRelease(release='4.5', evidence='ArduPlane V4.5')
    >>> file_release("", ["WP_RADIUS", "GLIDE_SLOPE_MIN"])
    FileRelease(release='4.6', evidence='GLIDE_SLOPE_MIN')
    >>> file_release("", ["ALT_SLOPE_MIN", "GLIDE_SLOPE_MIN"]) is None
    True
    """
    if (commented := release_in_comments(text, "ArduPlane")) is not None:
        return commented
    file_names = list(names)
    newer = [name for name in file_names if name in NAMES_SINCE_4_7]
    older = [name for name in file_names if name in NAMES_BEFORE_4_7]
    if bool(newer) == bool(older):
        return None
    return FileRelease("4.7", newer[0]) if newer else FileRelease("4.6", older[0])


class ReleaseChoice(NamedTuple):
    """Release that is simulated, and a note on a parameter file of another release."""

    version: ArduPlaneVersion
    notes: tuple[str, ...] = ()


def choose_release(requested_version: ArduPlaneVersion | None, params: str) -> ReleaseChoice:
    """Return the release to simulate with a parameter file.

    It is the requested release, or else the file's release, or else the newest release.

    The result has a note if parameters of the file have another name in this release.

    params: path of the parameter file. Raises ParameterError if it cannot be read.
    """
    file = Path(params)
    text = utf8_text(read_small_file(file, MAX_BYTES, "parameter", ParameterError), file, ParameterError)
    names = list(parse_parameters(text, params))
    writer_release = file_release(text, names)
    version, notes = choose_release_for_file(_VERSIONS, requested_version, writer_release, params, "ArduPlane")
    if renamed := describe_renamed(names, TABLE.by_any_name, version):
        notes = (*notes, f"{params}: {renamed}")
    return ReleaseChoice(version, notes)
