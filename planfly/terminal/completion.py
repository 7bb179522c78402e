"""What a shell proposes for an argument; `argcomplete` asks, in a process that ends after it."""

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path

Completer = Callable[..., Iterable[str]]
# Set by a shell's script where it asks.
ASKS_COMPLETION = "_ARGCOMPLETE"
SHELLS = ("bash", "zsh", "fish")
# Beside which file the embedded ones stand: their modules would load numbers first.
_ROOT = Path(__file__).parents[2]
MISSIONS = ("json", "waypoints", "plan", "txt")
FIELD_LOGS = ("BIN", "bin", "log", "tlog", "ulg", "gpx", "igc", "kml")


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
