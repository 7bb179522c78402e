"""python -m tests.soak: how long `make soak` will take, by the last one that was run here or on two quiet cores."""

import json

from tests.soak import FIGURES

# By the clock, of two quiet cores: the tests, and the changes of the sources that they must notice.
TESTS, CHANGES = 90, 60


def main() -> None:
    """Print it."""
    rows = json.loads(FIGURES.read_text(encoding="utf-8")) if FIGURES.is_file() else {}
    took = rows.get("seconds by the clock", {})
    # Two processes test at a time; a file is tested by one of them.
    minutes = round(max(sum(took.values()) / 2, max(took.values(), default=0.0)) / 60.0) if took else TESTS
    print(f"make soak: about {minutes} min of tests{' as last time' if took else ''}, then {CHANGES} min of mutations")
    for file, seconds in sorted(took.items(), key=lambda item: -item[1])[:10]:
        print(f"{seconds / 60.0:8.1f} min  {file}")


if __name__ == "__main__":
    main()
