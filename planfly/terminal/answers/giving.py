"""Where a command's lines and its answer go: ``--json FILE``, ``--json -`` and ``--quiet``."""

import argparse
import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import TextIO

from planfly.terminal.progress import silent_progress
from planfly.terminal.targets import refuse_existing
from world.atomic_files import write_whole
from world.errors import PlanflyError

STANDARD_OUTPUT = "-"
# The standard output of the command under way, while what it prints goes elsewhere.
_output: ContextVar[TextIO | None] = ContextVar("output", default=None)


@contextlib.contextmanager
def asked_output(args: argparse.Namespace) -> Iterator[None]:
    """Print a command's lines where its options ask: nowhere, or beside standard output where the answer goes there.

    Raises PlanflyError for a file to answer into that exists, or that the command reads.
    """
    answer, quiet = getattr(args, "json", None), getattr(args, "quiet", False)
    if answer not in (None, STANDARD_OUTPUT):
        _refuse_inputs(Path(answer), args)
        refuse_existing(Path(answer), args.overwrite if hasattr(args, "overwrite") else False)
    token = _output.set(sys.stdout)
    try:
        with contextlib.ExitStack() as opened:
            if quiet:
                opened.enter_context(silent_progress())
                nowhere = opened.enter_context(Path(os.devnull).open("w", encoding="utf-8"))
                opened.enter_context(contextlib.redirect_stdout(nowhere))
            elif answer == STANDARD_OUTPUT:
                opened.enter_context(contextlib.redirect_stdout(sys.stderr))
            yield
    finally:
        _output.reset(token)


def give_answer(args: argparse.Namespace, answer: Callable[[], object | str]) -> None:
    """Write what a command answers, where it was asked for; it is made only then.

    answer: gives the data of `planfly.terminal.answers.schemas.ANSWERS`, or its text.
    """
    target = getattr(args, "json", None)
    if target is None:
        return
    # Imported here: nobody else needs schemas.
    from planfly.terminal.answers.schemas import answer_text

    made = answer()
    text = made if isinstance(made, str) else answer_text(made)
    if target == STANDARD_OUTPUT:
        print(text, end="", file=_output.get() or sys.stdout)
    else:
        write_whole(Path(target), text)


def _refuse_inputs(target: Path, args: argparse.Namespace) -> None:
    """Refuse to answer into a file that the command line names otherwise, too."""
    named = [value for key, value in vars(args).items() if isinstance(value, str) and key not in ("json", "command")]
    for name in named:
        with contextlib.suppress(OSError):
            if target.exists() and target.samefile(name):
                raise PlanflyError(f"{target}: is the input itself; name another file to write", file=target)
