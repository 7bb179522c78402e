"""Arguments of the command line as values, and what a shell proposes for them."""

import argparse
import math
from collections.abc import Callable, Iterable
from pathlib import Path

from logs.importers.open_log import SUFFIXES

# ----------------------------------------------------------------------
# Texts of the command line as values: each refuses what it cannot take, saying what it expects.


def seed(text: str) -> int:
    """Seed: a whole number."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value < 2**63:
        raise argparse.ArgumentTypeError(f"{text!r}: a whole number from 0 to 2^63 - 1 is expected")
    return value


def count(text: str) -> int:
    """Rounds, 0 to 20."""
    if not (text.isascii() and text.isdigit() and int(text) <= 20):
        raise argparse.ArgumentTypeError(f"{text!r}: a whole number from 0 to 20 is expected")
    return int(text)


def positive(text: str) -> float:
    """Number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 < value <= 1e6:
        raise argparse.ArgumentTypeError(f"{text!r}: a number above 0, up to 1,000,000, is expected")
    return value


def speedup(text: str) -> float:
    """Times real time that a served flight may fly at."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.1 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f"{text!r}: a number from 0.1 to 100 is expected")
    return value


def wind(text: str) -> tuple[float, float]:
    """SPEED,FROM of a steady wind: m/s and degrees."""
    try:
        speed, source = (float(part) for part in text.split(","))
    except ValueError:
        speed, source = -1.0, 0.0
    if not (0.0 <= speed <= 40.0 and -360.0 <= source <= 360.0):
        raise argparse.ArgumentTypeError(
            f"{text!r}: SPEED,FROM is expected: m/s from 0 to 40, degrees from north that it blows from (-360..360)"
        )
    return speed, source


def flight_time(text: str) -> float:
    """Time of a flight, s."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1e7:
        raise argparse.ArgumentTypeError(f"{text!r}: seconds, from 0 to 10,000,000, are expected")
    return value


def time_or_stations(text: str) -> float | str:
    """A time of the flight, or where ground stations listen: an address has a colon."""
    return text if ":" in text else flight_time(text)


def budget(text: str) -> tuple[int | None, float | None]:
    """Evaluations, or seconds where the text ends in s."""
    try:
        if text.endswith("s"):
            seconds = float(text[:-1])
            if 0.0 < seconds <= 1e6:
                return None, seconds
        elif 4 <= int(text) <= 10**10:
            return int(text), None
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(
        f"{text!r}: a number of evaluations (4..10^10), or of seconds such as 2.5s (up to 1,000,000s), is expected"
    )


def leg(text: str) -> int:
    """Leg of a plan, from 0."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value <= 10_000:
        raise argparse.ArgumentTypeError(f"{text!r}: a leg's number is expected, from 0")
    return value


def threat(text: str) -> tuple[float, float, float, float]:
    """EAST,NORTH,KILL,DETECTION of a pop-up threat, m."""
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
    """Numbers of threats out of the paper's four."""
    allowed = (7, 15, 30, 60)
    parts = [part.strip() for part in text.split(",")]
    numbers = sorted({int(part) for part in parts if part.isdecimal()})
    if not all(part.isdecimal() for part in parts) or not set(numbers) <= set(allowed):
        raise argparse.ArgumentTypeError(f"{text!r}: numbers of threats out of 7,15,30,60 are expected")
    return tuple(numbers)


def positive_count(text: str) -> int:
    """Whole number from 1."""
    value = int(text) if text.isdecimal() else 0
    if not 1 <= value <= 1000:
        raise argparse.ArgumentTypeError(f"{text!r}: a whole number from 1 to 1,000 is expected")
    return value


def port(text: str) -> int:
    """Number of a TCP port, or 0."""
    value = int(text) if text.isdecimal() else -1
    if not 0 <= value <= 65535:
        raise argparse.ArgumentTypeError(f"{text!r}: a port, 0..65535, is expected")
    return value


# ----------------------------------------------------------------------
# What a shell proposes for an argument; `argcomplete` asks, in a process that ends after it.

Completer = Callable[..., Iterable[str]]
# Set by a shell's script where it asks.
ASKS_COMPLETION = "_ARGCOMPLETE"
SHELLS = ("bash", "zsh", "fish")
# Beside which file the embedded ones stand: their modules would load numbers first.
_ROOT = Path(__file__).parents[2]
MISSIONS = ("json", "waypoints", "plan", "txt")
IMPORTED_LOGS = ("BIN", "log", *(suffix[1:] for suffix in SUFFIXES))


def completed(action: argparse.Action, completer: Completer) -> argparse.Action:
    """An argument that a completer proposes values for."""
    # argcomplete's own way of telling it.
    action.completer = completer  # type: ignore[attr-defined]
    return action


def files(*suffixes: str) -> Completer:
    """Proposes files of these suffixes, and folders."""

    def propose(prefix: str, **_about: object) -> Iterable[str]:
        from argcomplete.completers import FilesCompleter

        found: Iterable[str] = FilesCompleter(suffixes)(prefix)
        return found

    return propose


def scenario_words(prefix: str, **_about: object) -> list[str]:
    """Names of the scenarios that come with planfly, and scenario files.

    >>> scenario_words("jack")
    ['jacksboro']
    """
    names = sorted(file.stem for file in (_ROOT / "world" / "scenarios").glob("*.toml"))
    return [*(name for name in names if name.startswith(prefix)), *files("toml")(prefix)]


def aircraft_words(prefix: str, **_about: object) -> list[str]:
    """Names of the aircraft that come with planfly, and folders.

    >>> aircraft_words("aero")
    ['aerosonde']
    """
    names = sorted(file.stem for file in (_ROOT / "aircraft").glob("*/*.toml") if file.stem == file.parent.name)
    return [*(name for name in names if name.startswith(prefix)), *files("no-suffix")(prefix)]


def mission_or_scenario_words(prefix: str, **about: object) -> list[str]:
    """Scenarios, plans and missions."""
    return [*scenario_words(prefix, **about), *files(*MISSIONS)(prefix)]


def answer_shell(parser: argparse.ArgumentParser) -> None:
    """Print what completes the line that a shell has asked about, and end the process."""
    import argcomplete

    argcomplete.autocomplete(parser, always_complete_options="long")


def shell_script(shell: str) -> str:
    """The script that has a shell ask planfly.  shell: one of `SHELLS`."""
    from argcomplete.shell_integration import shellcode

    script: str = shellcode(["planfly"], shell=shell)
    return script
