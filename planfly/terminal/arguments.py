"""Convert arguments of the command line to values, and complete them for a shell."""

import argparse
import contextlib
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from logs.importers.open_log import SUFFIXES
from planfly.arguments import CAMERA_FORMAT, CHOICES, RANGES, is_valid_camera, is_valid_position, is_valid_wind

# ----------------------------------------------------------------------
# Convert command line texts to values within the ranges of the API's keywords.


def number_parser(keyword: str) -> Callable[[str], Any]:
    """Return a function that parses a number and checks it against the range of an API keyword.

    >>> number_parser("seed")("3"), number_parser("max_hours")("1.5")
    (3, 1.5)
    """
    allowed_range = RANGES[keyword]

    def parse(text: str) -> float:
        """Return the number in a text; raise ArgumentTypeError if it is not in the allowed range."""
        value: float = math.nan
        if not allowed_range.integer:
            with contextlib.suppress(ValueError):
                value = float(text)
        elif text.isascii() and text.isdigit():
            value = int(text)
        if not allowed_range.allows(value):
            raise argparse.ArgumentTypeError(f"{text!r}: {allowed_range.expected}")
        return value

    return parse


def parse_wind(text: str) -> tuple[float, float]:
    """Parse SPEED,FROM: speed (m/s) of a steady wind, and direction (degrees) from which the wind blows.

    Raises argparse.ArgumentTypeError for other text.
    """
    try:
        speed, from_deg = (float(part) for part in text.split(","))
    except ValueError:
        speed, from_deg = math.nan, 0.0
    if not is_valid_wind(speed, from_deg):
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected SPEED,FROM: a speed of 0 to 40 m/s, and the direction from which the wind blows, -360"
            " to 360 degrees"
        )
    return speed, from_deg


def parse_camera(text: str) -> tuple[float, ...]:
    """Parse WxH,FOCAL or WxH,FOCAL,FRONT,SIDE.

    They are the sensor size and the focal length (mm), and the photo overlaps (percent).  Raises
    argparse.ArgumentTypeError for other text.

    >>> parse_camera("23.5x15.6,16")
    (23.5, 15.6, 16.0)
    """
    sensor, *other_parts = text.split(",")
    try:
        numbers = tuple(float(part) for part in (*sensor.lower().split("x"), *other_parts))
    except ValueError:
        numbers = ()
    if not is_valid_camera(numbers) or sensor.lower().count("x") != 1:
        raise argparse.ArgumentTypeError(f"{text!r}: expected WxH,FOCAL or WxH,FOCAL,FRONT,SIDE: {CAMERA_FORMAT}")
    return numbers


def parse_position(text: str) -> tuple[float, float]:
    """Parse LAT,LON: latitude and longitude of a position, degrees.

    Raises argparse.ArgumentTypeError for other text.
    """
    try:
        lat, lon = (float(part) for part in text.split(","))
    except ValueError:
        lat, lon = math.nan, 0.0
    if not is_valid_position(lat, lon):
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected LAT,LON: degrees north from -89 to 89, degrees east from -180 to 180"
        )
    return lat, lon


def parse_area(text: str) -> tuple[float, ...]:
    """Parse S,W,N,E: edges of an area, degrees; the API checks the order of the edges.

    Raises argparse.ArgumentTypeError for other text.
    """
    try:
        edges = tuple(float(part) for part in text.split(","))
    except ValueError:
        edges = ()
    if len(edges) != 4:
        raise argparse.ArgumentTypeError(f"{text!r}: expected S,W,N,E: south, west, north and east edge, degrees")
    return edges


def parse_autopilots(text: str) -> list[str]:
    """Parse the names of autopilots, separated by commas.

    Raise argparse.ArgumentTypeError for an unknown name.
    """
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in CHOICES["autopilot"]:
            raise argparse.ArgumentTypeError(f"{name!r}: expected one or more of {', '.join(CHOICES['autopilot'])}")
    return names


def parse_time_or_stations(text: str) -> float | str:
    """Parse a time of the flight (s), or return the addresses of ground stations unchanged.

    A text with a colon is read as addresses.
    """
    if ":" in text:
        return text
    return number_parser("end")(text)


def parse_budget(text: str) -> tuple[int | None, float | None]:
    """Parse a number of evaluations, or a number of seconds if the text ends in s.

    Returns (evaluations, seconds), one of which is None.  Raises argparse.ArgumentTypeError for other text.
    """
    try:
        if text.endswith("s"):
            return None, number_parser("seconds")(text[:-1])
        return number_parser("budget")(text), None
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected a number of evaluations (4..10^10), or of seconds such as 2.5s (up to 1,000,000s)"
        ) from None


def parse_threat(text: str) -> tuple[float, float, float, float]:
    """Parse EAST,NORTH,KILL,DETECTION: position, kill radius and detection radius of a pop-up threat, m.

    Raises argparse.ArgumentTypeError for other text.
    """
    try:
        east, north, kill, detection = (float(part) for part in text.split(","))
    except ValueError:
        east = math.nan
    if not (math.isfinite(east) and math.isfinite(north) and kill >= 0.0 and detection >= 0.0):
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected EAST,NORTH,KILL,DETECTION: four numbers in m; a radius of 0 means no such range"
        )
    return east, north, kill, detection


def parse_problems(text: str) -> tuple[int, ...]:
    """Parse threat counts separated by commas, such as "7,15", and return them sorted without duplicates.

    Raises argparse.ArgumentTypeError for other counts than those of the four problems in the paper: 7, 15, 30 and 60.
    """
    parts = [part.strip() for part in text.split(",")]
    numbers = sorted({int(part) for part in parts if part.isdecimal()})
    if not all(part.isdecimal() for part in parts) or not set(numbers) <= set(CHOICES["problems"]):
        raise argparse.ArgumentTypeError(f"{text!r}: expected one or more of 7,15,30,60 threats")
    return tuple(numbers)


# ----------------------------------------------------------------------
# Complete arguments for a shell.  `argcomplete` requests completions in a process that then ends.

# Function that proposes values for a word that has been typed in part.
Completer = Callable[..., Iterable[str]]
# Environment variable that the script of a shell sets to request completions.
COMPLETION_VARIABLE = "_ARGCOMPLETE"
# Supported shells.
SHELLS = ("bash", "zsh", "fish")
# Root folder of the embedded files.  It is computed because importing their modules would load NumPy.
_ROOT = Path(__file__).parents[2]
# Suffixes of plans and mission files.
MISSION_SUFFIXES = ("json", "waypoints", "plan", "txt")
# Suffixes of the logs of other programs.
IMPORTED_LOG_SUFFIXES = ("BIN", "log", *(suffix[1:] for suffix in SUFFIXES))


def with_completer(action: argparse.Action, completer: Completer) -> argparse.Action:
    """Attach a function that completes an argument in the shell, and return the argument."""
    # argcomplete reads this attribute.
    action.completer = completer  # type: ignore[attr-defined]
    return action


def file_completer(*suffixes: str) -> Completer:
    """Return a completer for folders and for files with the given suffixes (without the dot)."""

    def propose(prefix: str, **_context: object) -> Iterable[str]:
        """Return the files with these suffixes, and the folders, that start with a prefix."""
        from argcomplete.completers import FilesCompleter

        return FilesCompleter(suffixes)(prefix)

    return propose


def complete_scenario(prefix: str, **_context: object) -> list[str]:
    """Return the names of the built-in scenarios and the scenario files that start with `prefix`.

    >>> complete_scenario("jack")
    ['jacksboro', 'jacksboro-air', 'jacksboro-field']
    """
    names = sorted(file.stem for file in (_ROOT / "world" / "scenarios").glob("*.toml"))
    return [*(name for name in names if name.startswith(prefix)), *file_completer("toml")(prefix)]


def complete_aircraft(prefix: str, **_context: object) -> list[str]:
    """Return the names of the built-in aircraft and the folders that start with `prefix`.

    >>> complete_aircraft("aero")
    ['aerosonde']
    """
    names = sorted(file.stem for file in (_ROOT / "aircraft").glob("*/*.toml") if file.stem == file.parent.name)
    # No file has this suffix, so that only folders are proposed.
    return [*(name for name in names if name.startswith(prefix)), *file_completer("no-suffix")(prefix)]


def complete_mission_or_scenario(prefix: str, **context: object) -> list[str]:
    """Return the scenarios, plans and missions that start with `prefix`."""
    return [*complete_scenario(prefix, **context), *file_completer(*MISSION_SUFFIXES)(prefix)]


def complete_for_shell(parser: argparse.ArgumentParser) -> None:
    """If a shell has requested completions, print them and end the process; otherwise do nothing."""
    import argcomplete

    argcomplete.autocomplete(parser, always_complete_options="long")


def shell_script(shell: str) -> str:
    """Return the script with which a shell requests completions from planfly.  shell: one of `SHELLS`."""
    from argcomplete.shell_integration import shellcode

    return shellcode(["planfly"], shell=shell)
