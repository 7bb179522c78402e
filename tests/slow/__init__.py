"""Tests that `make test` leaves out because they take long; `make slow` and CI run them.

``tests/slow/cases.txt`` lists them, a case on a line.  To choose them anew, on a quiet machine with compiled kernels:

    PLANFLY_TEST_TIMES=build/test-times.txt .venv/bin/python -m pytest -n 3 --dist loadfile
    .venv/bin/python -m tests.slow build/test-times.txt
"""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

CASES_FILE = Path(__file__).with_name("cases.txt")
# A longer case, of processor time or by the clock, is slow: 9 % of the cases take three quarters of the time.
SLOW_CPU_S = 0.3
SLOW_CLOCK_S = 2.0
# Slow cases that `make test` runs all the same: of each command, file format and page one that does the whole job.
RUN_ALWAYS = frozenset(
    {
        "tests/docs/test_pages_run.py::test_the_blocks_of_a_page_run[README]",
        "tests/docs/test_pages_run.py::test_the_blocks_of_a_page_run[first-flight]",
        "tests/logs/views/report/test_page_in_browser.py::test_the_first_screen_answers_and_the_page_is_short[1400]",
        "tests/planfly/api/test_reporting.py::test_a_plan_a_flight_and_files_are_exported",
        "tests/planfly/campaigns/test_local_pool.py::"
        "test_each_flight_comes_back_once_as_one_process_flies_it_and_nothing_listens",
        "tests/planfly/commands/test_campaign.py::test_it_leaves_its_files_and_says_undecided",
        "tests/planfly/commands/test_check.py::test_legs_have_their_items_and_limits_their_owner_through_a_jump",
        "tests/planfly/commands/test_export.py::test_a_plan_in_every_form",
        "tests/planfly/commands/test_fly.py::test_a_log_that_is_replaced_and_a_verdict_for_continuous_integration",
        "tests/planfly/commands/test_fly_autopilot.py::test_a_flight_is_logged_judged_and_judged_again",
        "tests/planfly/commands/test_identify.py::test_moments_are_estimated_from_10_rows_a_second[10.0-True]",
        "tests/planfly/commands/test_plan.py::test_a_landing_that_cannot_be_flown_is_said_and_ends_with_4",
        "tests/planfly/commands/test_report.py::test_the_layout_is_written_alone_and_pictures_on_request",
        "tests/planfly/commands/test_returns.py::test_a_mission_and_its_log_say_the_same",
        "tests/planfly/commands/test_run.py::test_the_exported_mission_flies_in_its_scenario[waypoints]",
        "tests/planfly/commands/test_run.py::test_plans_that_do_not_fly[steep-slope]",
        "tests/planfly/commands/test_survey.py::test_a_flight_and_its_log_say_the_same",
        "tests/planfly/commands/test_winds.py::test_a_short_mission_has_its_chart_stopped_or_not",
        "tests/planfly/studio/test_page.py::test_it_opens_with_the_mission_and_asks_for_nothing_elsewhere",
        "tests/test_same_results.py::test_plan_missions_track_and_verdict_of_a_run[tight]",
    }
)
# File for the times of all cases of a run, if set.
_TIMES_FILE = os.environ.get("PLANFLY_TEST_TIMES")


def slow_cases() -> set[str]:
    """Return the node ids of the slow cases."""
    return set(CASES_FILE.read_text(encoding="utf-8").splitlines())


@contextmanager
def measured(nodeid: str) -> Iterator[None]:
    """Append the seconds that a case takes, of processor time and by the clock, to PLANFLY_TEST_TIMES."""
    cpu, clock = sum(os.times()[:4]), time.monotonic()
    yield
    if _TIMES_FILE:
        line = f"{sum(os.times()[:4]) - cpu:.2f} {time.monotonic() - clock:.2f} {nodeid}\n"
        with Path(_TIMES_FILE).open("a", encoding="utf-8") as file:
            file.write(line)


def choose_cases(times: str) -> list[str]:
    """Return the node ids of the slow cases among lines "CPU seconds, clock seconds, node id".

    A case that takes no time itself may be charged for a process of an earlier case that ended then; it is not slow.

    >>> choose_cases("2.0 3.1 a.py::test_b[1 2]\\n0.1 0.1 a.py::test_c\\n9.0 0.1 a.py::test_d")
    ['a.py::test_b[1 2]']
    """
    cases = []
    for line in times.splitlines():
        cpu, clock, nodeid = line.split(" ", 2)
        slow = (float(cpu) >= SLOW_CPU_S and float(clock) >= SLOW_CPU_S) or float(clock) >= SLOW_CLOCK_S
        if slow and nodeid not in RUN_ALWAYS:
            cases.append(nodeid)
    return sorted(cases)
