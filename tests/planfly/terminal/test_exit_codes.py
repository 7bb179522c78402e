"""Exit codes are those of the README, of the page of the command line, and of the help."""

import re
from pathlib import Path

import pytest

from planfly.terminal import command_parser

ROOT = Path(__file__).parents[3]
PAGES = (ROOT / "README.md", ROOT / "docs" / "commands.md")
# By the sentence that the pages have for each; 130 and 143 are what a shell gives a command that a signal ended.
MEANT = {
    "flyable, or flown as planned": command_parser.FLYABLE,
    "internal or system error": command_parser.FAULT,
    "incorrect usage or invalid input": command_parser.BAD_INPUT,
    "finished, but part of a log is unreadable": command_parser.INCOMPLETE,
    "not flyable, not flown as planned, or no feasible plan": command_parser.NOT_FLYABLE,
    "stopped by SIGINT (Ctrl-C), 143 by SIGTERM": command_parser.INTERRUPTED,
}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_pages_and_help_state_each_code(page: Path) -> None:
    stated = re.sub(r"\s+", " ", page.read_text(encoding="utf-8"))
    told = stated[stated.index("Exit codes: ") :]
    printed = re.sub(r"\s+", " ", command_parser.EXIT_CODES)
    for meaning, code in MEANT.items():
        assert f" {code} {meaning}" in told
        assert f" {code} {meaning}" in printed
    assert sorted(MEANT.values()) == [0, 1, 2, 3, 4, 128 + 2]
