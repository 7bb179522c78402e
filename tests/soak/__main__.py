"""python -m tests.soak [--go-on]: make ready for `make soak`, and say how long it will take.

By the last one that was run here, or on two quiet cores.  Without ``--go-on`` the figures of the last one go.
"""

import json
import sys

from tests.soak import FIGURES, SECONDS, passed_files

# By the clock, of two quiet cores: the tests, and the changes of the sources that they must notice.
TESTS, CHANGES = 90, 60


def main() -> None:
    """Print it."""
    rows = json.loads(FIGURES.read_text(encoding="utf-8")) if FIGURES.is_file() else {}
    if go_on := "--go-on" in sys.argv[1:]:
        print(f"goes on: {len(passed_files())} files of tests have passed with these sources and are left out")
    took = {} if go_on else rows.get(SECONDS, {})
    # Two processes test at a time; a file is tested by one of them.
    minutes = round(max(sum(took.values()) / 2, max(took.values(), default=0.0)) / 60.0) if took else TESTS
    print(f"make soak: about {minutes} min of tests{' as last time' if took else ''}, then {CHANGES} min of mutations")
    for file, seconds in sorted(took.items(), key=lambda item: -item[1])[:10]:
        print(f"{seconds / 60.0:8.1f} min  {file}")
    if not go_on:
        FIGURES.unlink(missing_ok=True)


if __name__ == "__main__":
    main()
