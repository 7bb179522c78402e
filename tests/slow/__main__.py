"""Choose the slow cases anew from the times of a run: ``python -m tests.slow TIMES``."""

import sys
from pathlib import Path

from tests.slow import CASES_FILE, choose_cases

cases = choose_cases(Path(sys.argv[1]).read_text(encoding="utf-8"))
CASES_FILE.write_text("\n".join(cases) + "\n", encoding="utf-8")
print(f"{len(cases)} slow cases in {CASES_FILE}")
