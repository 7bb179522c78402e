"""Which mutants there are, and which of them a shorter run tries."""

import math
from collections.abc import Collection

from tests.mutations.generated import limit_mutants, walked_mutants
from tests.mutations.listed import listed_mutants
from tests.mutations.mutant import ROOT, Mutant

PARTS = ("physics", "limits", "rules", "measures")
# Of the mutants of a shorter run that are no hand-made ones: shares by part.
SHARES = {"limits": 0.5, "rules": 0.25, "measures": 0.25}


def part_mutants(part: str) -> list[Mutant]:
    """Generated mutants of a part, shuffled alike each time."""
    if part == "limits":
        found = limit_mutants()
    else:
        files = sorted((ROOT / "logs" / "verdict" / part).glob("*.py"))
        found = [mutant for file in files for mutant in walked_mutants(part, str(file.relative_to(ROOT)))]
    sources = {mutant.file: (ROOT / mutant.file).read_bytes() for mutant in found}
    return sorted(found, key=lambda mutant: (mutant.order(sources[mutant.file]), mutant.start))


def chosen_mutants(count: int | None, parts: Collection[str] = PARTS) -> list[Mutant]:
    """So many mutants of some parts, None for all: every hand-made one, and of the rest the first of each part.

    By `SHARES`, as far as a part has as many.
    """
    found = [mutant for mutant in listed_mutants() if mutant.part in parts]
    shares = {part: share for part, share in SHARES.items() if part in parts}
    left = None if count is None else max(0, count - len(found))
    for part, share in shares.items():
        most = None if left is None else math.ceil(left * share / sum(shares.values()))
        found += part_mutants(part)[:most]
    return found[:count]
