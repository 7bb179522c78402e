"""Settings that hold for all tests."""

import os
import sys
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import settings

from flight.dynamics import model_check
from planfly.runtime import first_start
from planfly.runtime.process_setup import prepare_process
from planfly.terminal import output
from tests.kernels import note_of_compiled
from tests.shared import remove_made
from tests.slow import measured, slow_cases
from tests.soak import CORE_SECONDS, SECONDS, SOAK, begin_file, end_file, note, passed_files, scaled

# Looking for garbage among all that tests import takes a tenth of their time.
prepare_process()

# The first example of a test may compile kernels, or share its core with another test: neither is the kernel's fault.
settings.register_profile("planfly", deadline=None, max_examples=scaled(100, 50))
settings.load_profile("planfly")

# Files that compile kernels for more than a second, as no command does.  They come first: nobody waits for them later,
# and no two processes of a run compile the same.
COMPILING = (
    "planner/search/test_embedded_scenarios.py",
    "planner/seeding/test_grids.py",
    "planner/search/test_replan.py",
    "planner/search/test_generations.py",
    "planner/search/test_plan_front.py",
    "flight/autopilots/arduplane/test_ground_law.py",
    "planner/optimisers/test_optimisers.py",
    "flight/simulation/test_same_bytes_in_any_process.py",
    "logs/verdict/measures/test_zone_visits.py",
    "planner/optimisers/test_niche_sampling.py",
    "planner/evaluation/test_terrain_clearance.py",
    "logs/verdict/rules/test_height_rule.py",
    "flight/autopilots/planfly/test_law.py",
    "logs/verdict/measures/test_path_moves.py",
    "planner/airspace/test_zone_distances.py",
    "planner/evaluation/test_airspace_scores.py",
    "logs/importers/test_dataflash_frames.py",
    "logs/verdict/measures/limits/test_path_sweeps_limits.py",
    "logs/views/report/test_compare.py",
)


@pytest.fixture(autouse=True, scope="session")
def _no_estimates_of_other_runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test's progress depends on what this machine did before, or on how quick it is."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(output, "_durations_file", lambda: tmp_path_factory.getbasetemp() / "none" / "durations.json")
        patch.setattr(output, "_write_duration", lambda *_: None)
        patch.setattr(output, "_REFRESH_INTERVAL_S", 86_400.0)
        yield


@pytest.fixture(autouse=True, scope="session")
def _units_are_compiled_once() -> Iterator[None]:
    """Have no command compile all of its units for the one kernel that is missing, where `tests.kernels` did before.

    Two processes would read all that is in the cache.  What they do is tried in tests/planfly/runtime.
    """
    with pytest.MonkeyPatch.context() as patch:
        if note_of_compiled().exists():
            patch.setattr(first_start, "compile_units", lambda *_: None)
        yield


@pytest.fixture(autouse=True, scope="session")
def _models_are_tried_here() -> Iterator[None]:
    """A model's first run is this process's own: in a process before it, it takes half a second for each folder.

    That one is tried in tests/flight/dynamics/test_model_check.py, and everywhere in a soak.
    """
    with pytest.MonkeyPatch.context() as patch:
        if not SOAK:
            patch.setattr(model_check, "_run_trial", lambda *_: (0, ""))
        yield


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark slow cases and tests with more to do in a soak, leave out files that a soak has passed, and sort."""
    slow = slow_cases()
    for item in items:
        if item.nodeid in slow:
            item.add_marker("slow")
        if {"SOAK", "only_in_soak", "scaled", "some"} & vars(getattr(item, "module", object)).keys():
            item.add_marker("soak")
    if passed := passed_files():
        config.hook.pytest_deselected(items=[item for item in items if _file(item.nodeid) in passed])
        items[:] = [item for item in items if _file(item.nodeid) not in passed]
    items.sort(key=lambda item: not _file(item.nodeid).endswith(COMPILING))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Measure how long each case takes, if PLANFLY_TEST_TIMES names a file."""
    with measured(item.nodeid):
        return (yield)


def _file(nodeid: str) -> str:
    return nodeid.split("::")[0]


@pytest.fixture(autouse=True, scope="module")
def _what_a_file_takes(request: pytest.FixtureRequest) -> Iterator[None]:
    """Note the seconds that a file of tests takes, its processes included, in a soak."""
    wall, before, failed = time.monotonic(), sum(os.times()[:4]), request.session.testsfailed
    file = str(request.node.nodeid)
    begin_file(file)
    yield
    note(SECONDS, **{file: round(time.monotonic() - wall, 1)})
    note(CORE_SECONDS, **{file: round(sum(os.times()[:4]) - before, 1)})
    if request.session.testsfailed == failed:
        end_file(file)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Remove what the processes of a run have shared, once one of them has ended: all end together."""
    remove_made(node.workerinput["testrunuid"])


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """End one of a run's processes at once: the run would wait 10 s for the threads that clients have left in it."""
    if hasattr(config, "workerinput"):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Note how many cases of each test passed and failed, in a soak."""
    if not SOAK:
        return
    for outcome in ("passed", "failed", "error"):
        reports = [one for one in terminalreporter.stats.get(outcome, ()) if outcome != "passed" or one.when == "call"]
        cases = Counter(report.nodeid.split("[")[0] for report in reports)
        if cases:
            note(f"cases {outcome}", **cases)
