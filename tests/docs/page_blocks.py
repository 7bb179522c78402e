"""Fenced blocks of the pages, and how they are run: in order, in a folder of the page's own.

A comment on the line before a fence says what a test needs to know, in words:
``<!-- test: file NAME -->`` the reader saves the block as NAME; ``exit 4`` the exit code of its commands; ``soak`` it
takes long, and runs with PLANFLY_SOAK=1; ``parse`` it needs a client or a file of the reader's, and its options alone
are looked at; ``given NAME=PATH ...`` files of the repository stand for the reader's own.
"""

import contextlib
import io
import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from planfly.cli import build_parser, main
from tests.planfly.made_plans import DEFAULT_RUN, default_run
from tests.soak import SOAK

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))
TYPED = {"sh", "python"}
_FENCE = re.compile(r"^```(\w*)$")
_MARK = re.compile(r"^<!-- test: (.*) -->$")
# What others' programs a block may hold, which are not run.
CLIENTS = {
    *("rerun", "mavproxy.py", "make", "git", "cd", "cp", "source", "pip", "python", "dask", "eval", "python3", "curl")
}


class Block(NamedTuple):
    """A fenced block.  marks: what its comment says.  line: of its first line, from 1."""

    page: str
    line: int
    language: str
    text: str
    marks: tuple[str, ...]

    @property
    def file(self) -> str:
        """What it is to be saved as; "" for what is not."""
        return self.marks[1] if self.marks[:1] == ("file",) else ""

    @property
    def given(self) -> dict[str, Path]:
        """Files that stand for the reader's own, by the names that the page has for them."""
        pairs = (mark.split("=") for mark in self.marks if "=" in mark)
        return {name: ROOT / path for name, path in pairs}

    @property
    def exit_code(self) -> int:
        """What its commands end with."""
        return int(self.marks[self.marks.index("exit") + 1]) if "exit" in self.marks else 0

    @property
    def commands(self) -> list[list[str]]:
        """Its command lines, as words, without comments and without what a shell does next."""
        joined = re.sub(r" && .*", "", self.text.replace("\\\n", " "))
        return [words for line in joined.splitlines() if (words := shlex.split(line, comments=True))]


def blocks(page: Path) -> Iterator[Block]:
    """All fenced blocks of a page."""
    lines = page.read_text(encoding="utf-8").splitlines()
    at = 0
    while at < len(lines):
        opened = _FENCE.match(lines[at])
        if opened is None:
            at += 1
            continue
        last = lines.index("```", at + 1)
        mark = _MARK.match(lines[at - 1]) if at else None
        marks = tuple(mark[1].split()) if mark else ()
        yield Block(page.name, at + 2, opened[1], "\n".join(lines[at + 1 : last]) + "\n", marks)
        at = last + 1


class Bench:
    """Where a page's blocks are run, and what is shared between pages.

    shared: a folder that keeps what the commands of `shared_commands` wrote.
    """

    shared_commands = ("run jacksboro --seed 1",)

    def __init__(self, shared: Path) -> None:
        self._shared = shared

    def run(self, block: Block, names: dict[str, Any]) -> None:
        """Run a block in the current folder.  names: what the page's Python has so far."""
        for name, file in block.given.items():
            shutil.copy(file, name)
        if block.file:
            Path(block.file).write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            exec(compile(block.text, f"{block.page}:{block.line}", "exec"), names)
        elif block.language == "sh":
            for words in block.commands:
                self._command(block, words)

    def _command(self, block: Block, words: list[str]) -> None:
        assert words[0] == "planfly", f"{block.page}:{block.line}: {words[0]} is not run: mark the block parse"
        asked = " ".join(words[1:])
        kept = self._shared / asked.replace(" ", "_")
        if asked in self.shared_commands and kept.exists():
            shutil.copytree(kept, ".", dirs_exist_ok=True)
            return
        if asked in self.shared_commands and not SOAK:
            # The same by its defaults, which other tests have, too.
            build_parser().parse_args(words[1:])
            code, said_of_it, files = default_run()
            assert code == block.exit_code, said_of_it
            (kept / DEFAULT_RUN).mkdir(parents=True)
            for name, data in files.items():
                (kept / DEFAULT_RUN / name).write_bytes(data)
            shutil.copytree(kept, ".", dirs_exist_ok=True)
            return
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            code = main(words[1:])
        assert code == block.exit_code, f"{block.page}:{block.line}: {asked}: {code}\n{said.getvalue()}"
        if asked in self.shared_commands:
            shutil.copytree("runs", kept / "runs")


def parse(block: Block) -> None:
    """Hold the options of a block's commands against the parser.  Raises SystemExit for what it does not take."""
    for words in block.commands:
        if words[0] == "planfly":
            build_parser().parse_args(words[1:])
        else:
            assert words[0] in CLIENTS, f"{block.page}:{block.line}: {words[0]}"
