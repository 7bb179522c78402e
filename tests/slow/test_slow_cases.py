"""The list of slow cases holds cases that exist."""

import re
from pathlib import Path

from tests.slow import RUN_ALWAYS, slow_cases

ROOT = Path(__file__).parents[2]


def test_each_slow_case_is_a_test_of_its_file() -> None:
    for case in slow_cases() | RUN_ALWAYS:
        file, _, function = case.split("[")[0].partition("::")
        assert re.search(rf"^def {function}\(", (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE), case


def test_no_slow_case_is_also_run_always() -> None:
    assert not slow_cases() & RUN_ALWAYS
