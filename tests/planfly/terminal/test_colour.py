"""Colour where a terminal wants it, and nowhere else."""

import io
import os
import pty
import subprocess
import sys

import pytest

from planfly.terminal.colour import coloured, wants_colour


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("stream", "settings", "wanted"),
    [
        (Terminal(), {"TERM": "xterm-256color"}, True),
        (Terminal(), {"TERM": "xterm", "NO_COLOR": ""}, True),
        (Terminal(), {"TERM": "xterm", "NO_COLOR": "1"}, False),
        (Terminal(), {"TERM": "dumb"}, False),
        (io.StringIO(), {"TERM": "xterm"}, False),
        (io.StringIO(), {"FORCE_COLOR": "1", "TERM": "dumb"}, True),
        (io.StringIO(), {"FORCE_COLOR": ""}, False),
        (Terminal(), {"FORCE_COLOR": "1", "NO_COLOR": "1"}, False),
    ],
)
def test_who_wants_colour(
    stream: io.StringIO, settings: dict[str, str], wanted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    assert wants_colour(stream) is wanted
    # Red is 31 of ISO 6429, and 0 ends it.
    assert coloured("bad", "bad", stream) == ("\x1b[31mbad\x1b[0m" if wanted else "bad")


def seen(*argv: str, **settings: str) -> str:
    """What a terminal gets of a command."""
    ours, theirs = pty.openpty()
    environment = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")} | settings
    subprocess.run([sys.executable, "-m", "planfly", *argv], stdout=theirs, stderr=theirs, env=environment, check=False)
    os.close(theirs)
    text = b""
    while True:
        try:
            chunk = os.read(ours, 65536)
        except OSError:
            break
        if not chunk:
            break
        text += chunk
    os.close(ours)
    return text.decode()


def test_help_and_errors_are_coloured_on_a_terminal_alone() -> None:
    assert "\x1b[" in seen("fly", "--help", TERM="xterm-256color", COLUMNS="100")
    assert "\x1b[31m" in seen("flyy", TERM="xterm-256color")
    assert "\x1b[" not in seen("fly", "--help", TERM="dumb") + seen("flyy", TERM="xterm", NO_COLOR="1")


def test_a_coloured_help_says_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    import re

    plain = seen("run", "--help", TERM="dumb", COLUMNS="100")
    coloured_help = seen("run", "--help", TERM="xterm-256color", COLUMNS="100")
    words = [re.sub(r"\x1b\[[0-9;]*m", "", text).split() for text in (plain, coloured_help)]
    assert [word.lower() for word in words[0]] == [word.lower() for word in words[1]]
