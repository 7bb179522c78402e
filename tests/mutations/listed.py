"""Mutants by hand, as `listed.toml` has them: limits undone where they are applied, physics with a wrong sign."""

import tomllib
from pathlib import Path

from tests.mutations.mutant import Mutant, replacing


def listed_mutants() -> list[Mutant]:
    """All of the file.  Raises ValueError for one whose text is not in its source, or there more than once."""
    tables = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))["mutant"]
    return [replacing(table["part"], table["file"], table["old"], table["new"]) for table in tables]
