"""Arguments of the command line as values, and their completion by a shell."""

import argparse
import contextlib
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from logs.importers.open_log import SUFFIXES
from planfly.arguments import CAMERA, CHOICES, RANGES, is_camera, is_place, is_wind

# ----------------------------------------------------------------------
# Conversion of command line texts to values, within the ranges of the keywords of the API.


def number(keyword: str) -> Callable[[str], Any]:
    """Return a converter from text to a number in the range of a keyword of the API.

    >>> number("seed")("3"), number("max_hours")("1.5")
    (3, 1.5)
    """
    allowed = RANGES[keyword]

    def parse(text: str) -> float:
        value: float = math.nan
        if not allowed.integer:
            with contextlib.suppress(ValueError):
                value = float(text)
        elif text.isascii() and text.isdigit():
            value = int(text)
        if not allowed.allows(value):
            raise argparse.ArgumentTypeError(f"{text!r}: {allowed.expected}")
        return value

    return parse


def wind(text: str) -> tuple[float, float]:
    """Convert SPEED,FROM of a steady wind: m/s and degrees."""
    try:
        speed, source = (float(part) for part in text.split(","))
    except ValueError:
        speed, source = math.nan, 0.0
    if not is_wind(speed, source):
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected SPEED,FROM: 0 to 40 m/s, and the degrees that the wind blows from (-360..360)"
        )
    return speed, source


def camera(text: str) -> tuple[float, ...]:
    """Convert WxH,FOCAL or WxH,FOCAL,FRONT,SIDE: mm of sensor and focal length, and percent of overlap.

    >>> camera("23.5x15.6,16")
    (23.5, 15.6, 16.0)
    """
    sensor, *others = text.split(",")
    try:
        numbers = tuple(float(part) for part in (*sensor.lower().split("x"), *others))
    except ValueError:
        numbers = ()
    if not is_camera(numbers) or sensor.lower().count("x") != 1:
        raise argparse.ArgumentTypeError(f"{text!r}: WxH,FOCAL or WxH,FOCAL,FRONT,SIDE is expected: {CAMERA}")
    return numbers


def place(text: str) -> tuple[float, float]:
    """Convert LAT,LON: degrees."""
    try:
        lat, lon = (float(part) for part in text.split(","))
    except ValueError:
        lat, lon = math.nan, 0.0
    if not is_place(lat, lon):
        raise argparse.ArgumentTypeError(
            f"{text!r}: LAT,LON is expected: degrees north from -89 to 89, degrees east from -180 to 180"
        )
    return lat, lon


def area(text: str) -> tuple[float, ...]:
    """Convert S,W,N,E: degrees; the API checks that they are an area."""
    try:
        edges = tuple(float(part) for part in text.split(","))
    except ValueError:
        edges = ()
    if len(edges) != 4:
        raise argparse.ArgumentTypeError(f"{text!r}: S,W,N,E is expected: south, west, north and east edge, degrees")
    return edges


def autopilots(text: str) -> list[str]:
    """Convert names of autopilots separated by commas."""
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in CHOICES["autopilot"]:
            raise argparse.ArgumentTypeError(f"{name!r}: {', '.join(CHOICES['autopilot'])} is expected")
    return names


def time_or_stations(text: str) -> float | str:
    """Convert a time of the flight, or the addresses of ground stations: an address has a colon."""
    if ":" in text:
        return text
    return number("end")(text)


def budget(text: str) -> tuple[int | None, float | None]:
    """Convert a number of evaluations, or of seconds if the text ends in s."""
    try:
        if text.endswith("s"):
            return None, number("seconds")(text[:-1])
        return number("budget")(text), None
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(
            f"{text!r}: a number of evaluations (4..10^10), or of seconds such as 2.5s (up to 1,000,000s), is expected"
        ) from None


def threat(text: str) -> tuple[float, float, float, float]:
    """Convert EAST,NORTH,KILL,DETECTION of a pop-up threat, m."""
    try:
        east, north, kill, detection = (float(part) for part in text.split(","))
    except ValueError:
        east = math.nan
    if not (math.isfinite(east) and math.isfinite(north) and kill >= 0.0 and detection >= 0.0):
        raise argparse.ArgumentTypeError(
            f"{text!r}: EAST,NORTH,KILL,DETECTION is expected: four numbers in m, a radius of 0 for none"
        )
    return east, north, kill, detection


def problems(text: str) -> tuple[int, ...]:
    """Convert numbers of threats, each one of the four of the paper."""
    parts = [part.strip() for part in text.split(",")]
    numbers = sorted({int(part) for part in parts if part.isdecimal()})
    if not all(part.isdecimal() for part in parts) or not set(numbers) <= set(CHOICES["problems"]):
        raise argparse.ArgumentTypeError(f"{text!r}: numbers of threats out of 7,15,30,60 are expected")
    return tuple(numbers)


# ----------------------------------------------------------------------
# Completion of arguments by a shell; `argcomplete` asks for it, in a process that then ends.

# Function that proposes values for the beginning of a word.
Completer = Callable[..., Iterable[str]]
# Environment variable that the script of a shell sets to ask for completions.
ASKS_COMPLETION = "_ARGCOMPLETE"
# Supported shells.
SHELLS = ("bash", "zsh", "fish")
# Root of the embedded files; importing their modules instead would load NumPy.
_ROOT = Path(__file__).parents[2]
# Suffixes of plans and mission files.
MISSIONS = ("json", "waypoints", "plan", "txt")
# Suffixes of the logs of other programs.
IMPORTED_LOGS = ("BIN", "log", *(suffix[1:] for suffix in SUFFIXES))


def completed(action: argparse.Action, completer: Completer) -> argparse.Action:
    """Return an argument after attaching the completer for its values."""
    # argcomplete reads this attribute.
    action.completer = completer  # type: ignore[attr-defined]
    return action


def files(*suffixes: str) -> Completer:
    """Return a completer for files with these suffixes, and for folders."""

    def propose(prefix: str, **_about: object) -> Iterable[str]:
        from argcomplete.completers import FilesCompleter

        return FilesCompleter(suffixes)(prefix)

    return propose


def scenario_words(prefix: str, **_about: object) -> list[str]:
    """Return the names of embedded scenarios, and scenario files.

    >>> scenario_words("jack")
    ['jacksboro', 'jacksboro-air', 'jacksboro-field']
    """
    names = sorted(file.stem for file in (_ROOT / "world" / "scenarios").glob("*.toml"))
    return [*(name for name in names if name.startswith(prefix)), *files("toml")(prefix)]


def aircraft_words(prefix: str, **_about: object) -> list[str]:
    """Return the names of embedded aircraft, and folders.

    >>> aircraft_words("aero")
    ['aerosonde']
    """
    names = sorted(file.stem for file in (_ROOT / "aircraft").glob("*/*.toml") if file.stem == file.parent.name)
    return [*(name for name in names if name.startswith(prefix)), *files("no-suffix")(prefix)]


def mission_or_scenario_words(prefix: str, **about: object) -> list[str]:
    """Return scenarios, plans and missions."""
    return [*scenario_words(prefix, **about), *files(*MISSIONS)(prefix)]


def answer_shell(parser: argparse.ArgumentParser) -> None:
    """Print the completions that a shell has asked for, and end the process."""
    import argcomplete

    argcomplete.autocomplete(parser, always_complete_options="long")


def shell_script(shell: str) -> str:
    """Return the script that lets a shell ask planfly for completions.  shell: one of `SHELLS`."""
    from argcomplete.shell_integration import shellcode

    return shellcode(["planfly"], shell=shell)
