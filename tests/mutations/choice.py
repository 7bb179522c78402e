"""Which mutants there are, and which of them a shorter run tries."""

import math

from tests.mutations.generated import limit_mutants, walked_mutants
from tests.mutations.listed import listed_mutants
from tests.mutations.mutant import ROOT, Mutant

# Of the mutants of a shorter run that are no hand-made ones: shares by room.
SHARES = {"limits": 0.5, "rules": 0.25, "measures": 0.25}


def all_mutants() -> list[Mutant]:
    """Every mutant: the hand-made ones first, then limits, rules and measures, each in an order of its own."""
    found = listed_mutants()
    for room in SHARES:
        found += room_mutants(room)
    return found


def room_mutants(room: str) -> list[Mutant]:
    """Generated mutants of a room, shuffled alike each time."""
    if room == "limits":
        found = limit_mutants()
    else:
        files = sorted((ROOT / "logs" / "verdict" / room).glob("*.py"))
        found = [mutant for file in files for mutant in walked_mutants(room, str(file.relative_to(ROOT)))]
    sources = {mutant.file: (ROOT / mutant.file).read_bytes() for mutant in found}
    return sorted(found, key=lambda mutant: (mutant.order(sources[mutant.file]), mutant.start))


def chosen_mutants(count: int | None) -> list[Mutant]:
    """So many mutants, None for all: every hand-made one, and of the rest the first of each room by `SHARES`."""
    if count is None:
        return all_mutants()
    found = listed_mutants()[:count]
    left = count - len(found)
    for room, share in SHARES.items():
        found += room_mutants(room)[: math.ceil(share * left)]
    return found[:count]
