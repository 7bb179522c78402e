"""Settings that hold for all tests."""

import os
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import settings

from tests.soak import SOAK, note

# The first example of a test may compile kernels, or share its core with another test: neither is the kernel's fault.
settings.register_profile("planfly", deadline=None)
settings.load_profile("planfly")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of files that have more to do in a soak."""
    for item in items:
        if {"SOAK", "scaled"} & vars(getattr(item, "module", object)).keys():
            item.add_marker("soak")


@pytest.fixture(autouse=True, scope="module")
def _what_a_file_takes(request: pytest.FixtureRequest) -> Iterator[None]:
    """Note the seconds that a file of tests takes, its processes included, in a soak."""
    wall, before = time.monotonic(), sum(os.times()[:4])
    yield
    file = str(request.node.nodeid)
    note("seconds by the clock", **{file: round(time.monotonic() - wall, 1)})
    note("seconds of a core", **{file: round(sum(os.times()[:4]) - before, 1)})


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Note how many cases of each test passed and failed, in a soak."""
    if not SOAK:
        return
    for outcome in ("passed", "failed", "error"):
        reports = [one for one in terminalreporter.stats.get(outcome, ()) if outcome != "passed" or one.when == "call"]
        cases = Counter(report.nodeid.split("[")[0] for report in reports)
        if cases:
            note(f"cases {outcome}", **cases)
