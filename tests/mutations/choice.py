"""Which mutants there are, and which of them a shorter run tries."""

import math
from collections.abc import Collection

from tests.mutations.generated import limit_mutants, walked_mutants
from tests.mutations.listed import listed_mutants
from tests.mutations.mutant import ROOT, Mutant

ROOMS = ("physics", "limits", "rules", "measures")
# Of the mutants of a shorter run that are no hand-made ones: shares by room.
SHARES = {"limits": 0.5, "rules": 0.25, "measures": 0.25}


def room_mutants(room: str) -> list[Mutant]:
    """Generated mutants of a room, shuffled alike each time."""
    if room == "limits":
        found = limit_mutants()
    else:
        files = sorted((ROOT / "logs" / "verdict" / room).glob("*.py"))
        found = [mutant for file in files for mutant in walked_mutants(room, str(file.relative_to(ROOT)))]
    sources = {mutant.file: (ROOT / mutant.file).read_bytes() for mutant in found}
    return sorted(found, key=lambda mutant: (mutant.order(sources[mutant.file]), mutant.start))


def chosen_mutants(count: int | None, rooms: Collection[str] = ROOMS) -> list[Mutant]:
    """So many mutants of some rooms, None for all: every hand-made one, and of the rest the first of each room.

    By `SHARES`, as far as a room has as many.
    """
    found = [mutant for mutant in listed_mutants() if mutant.room in rooms]
    shares = {room: share for room, share in SHARES.items() if room in rooms}
    left = None if count is None else max(0, count - len(found))
    for room, share in shares.items():
        most = None if left is None else math.ceil(left * share / sum(shares.values()))
        found += room_mutants(room)[:most]
    return found[:count]
