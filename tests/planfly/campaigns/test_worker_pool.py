"""A part of a campaign in a process of its own: what it makes, tells and raises is this one's."""

import contextlib
import multiprocessing
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

from planfly.campaigns import worker_pool
from planfly.campaigns.worker_pool import (
    SchedulerError,
    Workers,
    allow_descriptors,
    checked_address,
    child_start_method,
    connected,
    in_own_process,
    kept_workers,
)
from planfly.cli import main
from tests.planfly.campaigns.kills import is_fork_server, spawned_processes
from tests.planfly.campaigns.made_campaigns import write_short
from tests.soak import SOAK, note
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


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux alone")
@pytest.mark.parametrize(("length", "method"), [(75, "forkserver"), (76, "spawn")])
def test_processes_are_forked_where_the_path_of_a_socket_is_short(
    length: int, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # /pymp-12345678/listener-12345678 is 32 bytes long, and a socket's path has 107.
    monkeypatch.setattr(tempfile, "tempdir", "/" * length)
    assert child_start_method() == method


OPENED = """
import sys
from planfly.campaigns.worker_pool import in_own_process
from planfly.campaigns.campaign_base import open_campaign
from planfly.campaigns.dispersions import default_dispersions
if __name__ == "__main__":
    call = (lambda *given: in_own_process(open_campaign, *given)) if sys.argv[1] == "apart" else open_campaign
    call("jacksboro-air", default_dispersions())
    with open("/proc/self/status") as file:
        print(next(int(line.split()[1]) // 1024 for line in file if line.startswith("VmHWM")))
"""


@pytest.mark.skipif(not SOAK, reason="megabytes of two whole processes: in make soak")
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


# ----------------------------------------------------------------------
# Workers that stay away are started anew: what is asked of a cluster, and by a cluster whose workers all die.


class FewWorkers:
    """A cluster of two, or more, of which so many are there."""

    def __init__(self, there: int, started: int = 2) -> None:
        self.scheduler_info = {"workers": dict.fromkeys(range(there))}
        self.worker_spec = dict.fromkeys(range(started))
        self.asked: list[int] = []

    def scale(self, n: int) -> None:
        self.asked.append(n)
        self.worker_spec = dict.fromkeys(range(n))


def until(there: Callable[[], Any], seconds: float) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end and not there():
        time.sleep(0.05)
    return bool(there())


@pytest.mark.parametrize(("there", "asked"), [(0, [2, 4]), (1, [2, 3])])
def test_the_missing_are_asked_for_by_their_names_then_by_new_ones(
    there: int, asked: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker_pool, "_LOOK", 0.01)
    cluster = FewWorkers(there)
    with kept_workers(cluster, 2, patience=0.05):
        assert until(lambda: len(cluster.asked) > 1, 60.0)
    assert cluster.asked[:2] == asked


@pytest.mark.parametrize(("there", "started"), [(3, 3), (2, 4)])
def test_those_that_are_too_many_end(there: int, started: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who stayed away came back after others had been started, or may still."""
    monkeypatch.setattr(worker_pool, "_LOOK", 0.01)
    cluster = FewWorkers(there, started)
    with kept_workers(cluster, 2, patience=60.0):
        assert until(lambda: bool(cluster.asked), 60.0)
    assert cluster.asked == [2]


def test_nothing_is_asked_while_all_are_there_or_not_long_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_pool, "_LOOK", 0.01)
    whole, away = FewWorkers(2), FewWorkers(0)
    with kept_workers(whole, 2, patience=0.0), kept_workers(away, 2, patience=60.0):
        time.sleep(0.3)
    assert whole.asked == away.asked == []


@pytest.mark.skipif(not SOAK, reason="kills all workers while they start, and waits for others: in make soak")
@pytest.mark.filterwarnings("default")
def test_workers_that_all_die_while_they_start_come_back() -> None:
    moments, ages, kills = random.Random(1), dict[int, float](), 0
    with connected(Workers(2)) as client:
        end = time.monotonic() + 90.0
        gone_since = end
        while time.monotonic() < min(end, gone_since + 5.0):
            workers = spawned_processes()
            gone_since = end if workers else min(gone_since, time.monotonic())
            for number in workers:
                with contextlib.suppress(psutil.NoSuchProcess):
                    age = time.time() - psutil.Process(number).create_time()
                    if age > ages.setdefault(number, moments.uniform(0.1, 2.2)):
                        os.kill(number, signal.SIGKILL)
                        kills += 1
            time.sleep(0.02)
        assert until(lambda: len(client.nthreads()) == 2, 90.0)
    note("campaign: workers killed while they start", kills=kills, came_back=2)


# ----------------------------------------------------------------------
# Where flights may be sent, and what listens where.


def hears_interrupt(process: int) -> bool:
    """Whether the kernel would deliver it SIGINT: by the mask of its first thread."""
    status = Path(f"/proc/{process}/status").read_text(encoding="ascii")
    blocked = next(int(line.split()[1], 16) for line in status.splitlines() if line.startswith("SigBlk"))
    return not blocked >> (signal.SIGINT - 1) & 1


def imported(name: str) -> bool:
    return name in sys.modules


@pytest.mark.parametrize(
    ("address", "whole"),
    [
        ("127.0.0.1:8786", "tcp://127.0.0.1:8786"),
        ("tcp://localhost:8786", "tcp://localhost:8786"),
        ("tcp://[::1]:8786", "tcp://[::1]:8786"),
        ("tls://10.0.0.7:8786", "tls://10.0.0.7:8786"),
    ],
)
def test_loopback_and_tls_are_let_in(address: str, whole: str) -> None:
    assert checked_address(address) == whole


@pytest.mark.parametrize(
    "address", ["tcp://10.0.0.7:8786", "10.0.0.7:8786", "tcp://example.org:8786", "tcp://0.0.0.0:8786", "tcp://[::]:1"]
)
def test_plain_tcp_beyond_loopback_is_refused(address: str) -> None:
    with pytest.raises(SchedulerError, match="plain TCP beyond loopback"):
        checked_address(address)


@pytest.mark.parametrize("address", ["", "127.0.0.1", "ws://127.0.0.1:1", "tcp://:8786", "tcp://[", "tls://x"])
def test_what_is_no_address_is_told(address: str) -> None:
    with pytest.raises(SchedulerError, match="is expected"):
        checked_address(address)


@pytest.mark.filterwarnings("default")
def test_our_own_workers_listen_on_loopback_alone() -> None:
    with connected(Workers(1)) as client:
        # They have imported what takes long before a flight waits for it.
        for name in ("planfly.campaigns.flight_row", "scipy.stats"):
            assert list(client.run(imported, name).values()) == [True]
        # What a killed one leaves among temporary files goes with the cluster's own folder.
        (folder,) = client.run(tempfile.gettempdir).values()
        assert Path(folder).name.startswith("planfly-workers-")
        if sys.platform == "linux":
            # And they do not hear Ctrl-C, which reaches all of a terminal's processes, from their first moment on.
            assert [hears_interrupt(number) for number in spawned_processes()] == [False]
            assert hears_interrupt(os.getpid())
        processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
        ports = [
            connection.laddr
            for process in processes
            for connection in process.net_connections(kind="inet")
            if connection.status == psutil.CONN_LISTEN
        ]
        assert len(client.nthreads()) == 1
    assert len(ports) >= 2
    assert {address.ip for address in ports} == {"127.0.0.1"}


@pytest.mark.parametrize("error", [RuntimeError("Nanny failed\nto start."), OSError(24, "Too many open files")])
def test_workers_that_cannot_be_started_are_the_machines_fault(
    error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 1 and one line: nobody's input is wrong."""

    def none(**_: object) -> None:
        raise error

    monkeypatch.setattr("distributed.LocalCluster", none)
    mission, scenario = write_short(tmp_path)
    line = ["campaign", str(mission), "--scenario", str(scenario), "--workers", "3", "--out", str(tmp_path / "out")]
    assert main([*line, "--flights", "2"]) == 1
    told = [one for one in capsys.readouterr().err.splitlines() if one.startswith("planfly: ")]
    words = " ".join(str(error).split())
    assert told == [f"planfly: 3 workers: could not be started: {words}"]


@pytest.mark.filterwarnings("default")
def test_a_scheduler_that_is_not_there_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planfly.campaigns.worker_pool._CONNECT_SECONDS", 0.5)
    with pytest.raises(SchedulerError, match="no scheduler answers"), connected(Workers(None, "127.0.0.1:1")):
        pass


@pytest.mark.parametrize(
    ("limits", "workers", "left"), [((1024, 4096), 2, 1024), ((32, 4096), 2, 64), ((32, 64), 2, 64)]
)
def test_descriptors_are_allowed_as_far_as_they_may_be(
    limits: tuple[int, int], workers: int, left: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """32 and 16 a worker."""
    kept = list(limits)
    monkeypatch.setattr(resource, "getrlimit", lambda _: tuple(kept))
    monkeypatch.setattr(resource, "setrlimit", lambda _, new: kept.__setitem__(slice(None), new))
    allow_descriptors(workers)
    assert kept == [left, limits[1]]


def test_too_few_descriptors_for_the_workers_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (32, 63))
    with pytest.raises(OSError, match="take 64 file descriptors, and the limit is 63") as caught:
        allow_descriptors(2)
    assert caught.value.filename == "2 workers"


def fork_servers(parent: int) -> list[psutil.Process]:
    """The children of a process from which others are forked."""
    return [one for one in psutil.Process(parent).children() if is_fork_server(one)]


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux alone")
def test_the_process_that_others_are_forked_from_ends_with_its_parent() -> None:
    """Also while it imports what they need, which takes it seconds in which it does not listen."""
    program = (
        "import sys\n"
        "from planfly.campaigns.worker_pool import child_processes\n"
        "child_processes()\n"
        "print('running', flush=True)\n"
        "sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        assert parent.stdout.readline() == "running\n"
        # On a loaded machine it has not become another program yet.
        assert until(lambda: fork_servers(parent.pid), 60.0)
        (server,) = fork_servers(parent.pid)
        parent.kill()
    worked = 0.0
    with contextlib.suppress(psutil.NoSuchProcess):
        while server.status() != psutil.STATUS_ZOMBIE:
            worked = server.cpu_times().user
            time.sleep(0.01)
    # All that it imports and loads takes it 3 s.
    assert worked < 1.5
