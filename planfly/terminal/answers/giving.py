"""Where a command's lines and its answer go: ``--json FILE``, ``--json -`` and ``--quiet``."""

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import Any, TextIO

from pydantic import TypeAdapter

from planfly.terminal.answers import answer_data
from planfly.terminal.answers.answer_data import AircraftAnswer, CampaignDocument, VerdictDocument, WindsDocument
from planfly.terminal.output import silent_progress
from planfly.terminal.results import refuse_existing
from world.errors import PlanflyError
from world.files import write_whole

# ----------------------------------------------------------------------
# The answer of each command that has ``--json``, and its JSON schema.

ANSWERS: dict[str, type[Any]] = {
    "run": answer_data.RunAnswer,
    "plan": answer_data.PlanAnswer,
    "export": answer_data.ExportAnswer,
    "fly": answer_data.FlyAnswer,
    "check": VerdictDocument,
    "replay": answer_data.ReplayAnswer,
    "recover": answer_data.RecoverAnswer,
    "report": answer_data.ReportAnswer,
    "compare": answer_data.CompareAnswer,
    "import": answer_data.ImportAnswer,
    "refly": answer_data.ReflyAnswer,
    "paper": answer_data.PaperAnswer,
    "campaign": CampaignDocument,
    "winds": WindsDocument,
    "aircraft": AircraftAnswer,
    "scenarios": answer_data.ScenariosAnswer,
}
_DRAFT = "https://json-schema.org/draft/2020-12/schema"


def answer_schema(command: str) -> dict[str, Any]:
    """The JSON schema, draft 2020-12, of a command's answer.

    >>> sorted(answer_schema("scenarios")["properties"])
    ['exit_code', 'scenarios', 'schema']
    """
    made = TypeAdapter(ANSWERS[command]).json_schema(mode="serialization")
    return {"$schema": _DRAFT, **made, "title": f"planfly {command} --json"}


def schema_text(command: str) -> str:
    """The schema as the text of a file."""
    return json.dumps(answer_schema(command), indent=1) + "\n"


def answer_text(answer: object) -> str:
    """An answer as the text of a file; what is no number is null."""
    return TypeAdapter(type(answer)).dump_json(answer, indent=1).decode() + "\n"


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

    answer: gives the data of `planfly.terminal.answers.giving.ANSWERS`, or its text.
    """
    target = getattr(args, "json", None)
    if target is None:
        return
    # Imported here: nobody else needs schemas.

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
