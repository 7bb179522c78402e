"""A part of a campaign in a process of its own: what it makes, tells and raises is this one's."""

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from planfly.campaigns.engine.own_process import in_own_process
from world.errors import MissionError

Tell = Callable[[float, float, str], None]


def by_hand(number: int, *, advance: Tell, more: int = 0) -> tuple[int, int]:
    """What was given, and where it was made."""
    advance(1.0, 2.0, "half")
    return number + more, os.getpid()


def refused(*, advance: Tell) -> None:
    """Bad input."""
    raise MissionError("a.plan: items: 0: at least 1", file="a.plan", field="items", value=0)


def killed(*, advance: Tell) -> None:
    """Gone without a word."""
    os._exit(9)


def test_what_is_made_and_told_comes_from_another_process() -> None:
    told: list[tuple[float, float, str]] = []
    made, process = in_own_process(by_hand, 3, advance=lambda *one: told.append(one), more=4)
    assert made == 7
    assert process != os.getpid()
    assert told == [(1.0, 2.0, "half")]
    assert in_own_process(by_hand, 3)[0] == 3


def test_what_is_raised_there_is_raised_here_whole() -> None:
    children = multiprocessing.active_children()
    with pytest.raises(MissionError, match=r"^a\.plan: items: 0: at least 1$") as caught:
        in_own_process(refused)
    assert (caught.value.file, caught.value.field, caught.value.value) == ("a.plan", "items", 0)
    assert multiprocessing.active_children() == children


def test_a_process_that_is_lost_is_said_to_be() -> None:
    with pytest.raises(OSError, match="a process of the campaign was lost"):
        in_own_process(killed)


OPENED = """
import sys
from planfly.campaigns.engine.own_process import in_own_process
from planfly.campaigns.flights.campaign_base import open_campaign
from planfly.campaigns.spread.spread_file import default_spread
if __name__ == "__main__":
    call = (lambda *given: in_own_process(open_campaign, *given)) if sys.argv[1] == "apart" else open_campaign
    call("jacksboro", default_spread())
    with open("/proc/self/status") as file:
        print(next(int(line.split()[1]) // 1024 for line in file if line.startswith("VmHWM")))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the largest size is read from /proc")
def test_what_planning_takes_is_gone_before_the_first_flight(tmp_path: Path) -> None:
    """Largest resident size of a process that opens the demo in another, MB, and of one that does so itself."""
    script = tmp_path / "opened.py"
    script.write_text(OPENED)
    apart, here = (
        int(subprocess.run([sys.executable, script, where], check=True, capture_output=True, text=True).stdout)
        for where in ("apart", "here")
    )
    assert apart < here - 50
