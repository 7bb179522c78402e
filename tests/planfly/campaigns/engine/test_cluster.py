"""Where flights may be sent, and what listens where."""

import os
import signal
import sys
from pathlib import Path

import psutil
import pytest

from planfly.campaigns.engine.cluster import SchedulerError, Workers, checked_address, connected
from tests.planfly.campaigns.kills import spawned_processes


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
        for name in ("planfly.campaigns.flights.flight_row", "scipy.stats"):
            assert list(client.run(imported, name).values()) == [True]
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


@pytest.mark.filterwarnings("default")
def test_a_scheduler_that_is_not_there_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planfly.campaigns.engine.cluster._CONNECT_SECONDS", 0.5)
    with pytest.raises(SchedulerError, match="no scheduler answers"), connected(Workers(None, "127.0.0.1:1")):
        pass
