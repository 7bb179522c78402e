"""Plain processes fly a campaign: each flight comes back once, whichever process dies, and none is left behind."""

import contextlib
import itertools
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from planfly.campaigns import local_pool
from planfly.campaigns.campaign_base import CampaignBase, GivenWind
from planfly.campaigns.flight_requests import LOST_REASON, FlightRequest, FlyOne
from planfly.campaigns.flight_row import FlightRow, make_lost_row
from planfly.campaigns.local_pool import MAX_FAILED_STARTS, LocalPool
from planfly.campaigns.tables import is_same_flight
from tests.planfly.campaigns.kills import spawned_processes, start_client
from tests.planfly.campaigns.made_campaigns import made_flight
from tests.soak import only_in_soak, some
from world.errors import MissionError


def requests(count: int) -> Callable[[], FlightRequest | None]:
    """Give so many flights, in order."""
    indices = iter(range(count))
    return lambda: next((FlightRequest(k) for k in indices), None)


@contextlib.contextmanager
def pool(count: int, base: CampaignBase, fly: FlyOne) -> Iterator[LocalPool]:
    """Make a pool whose processes have ended when it is closed."""
    before = set(spawned_processes())
    with contextlib.closing(LocalPool(count, base, fly)) as made:
        yield made
    assert set(spawned_processes()) == before


def fly_with_a_look_at_sockets(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """A flight that fails if this process or its parent listens on any socket of its own."""
    for process in (psutil.Process(), psutil.Process().parent()):
        assert process is not None
        for one in process.net_connections(kind="all"):
            assert one.status != psutil.CONN_LISTEN, one
            assert not (one.family.name == "AF_UNIX" and one.laddr), one
            assert one.type.name != "SOCK_DGRAM", one
    return made_flight(base, index, wind)


@pytest.fixture(scope="module")
def two(base: CampaignBase) -> Iterator[LocalPool]:
    """A pool of two processes that several tests ask one after the other: each process takes seconds to start."""
    with pool(2, base, fly_with_a_look_at_sockets) as made:
        yield made


def test_each_flight_comes_back_once_as_one_process_flies_it_and_nothing_listens(
    two: LocalPool, base: CampaignBase
) -> None:
    listening, flown = listeners(), []
    for one in two.fly(requests(12)):
        flown.append(one)
        assert listeners() == listening
    # It can be asked again, and its processes are the same.
    workers = {one.row.worker for one in flown}
    assert {one.row.worker for one in two.fly(requests(4))} <= workers
    assert sorted(one.request.index for one in flown) == list(range(12))
    assert all(is_same_flight(row, made_flight(base, request.index)) for request, row in flown)
    assert len(workers) == 2
    assert all(worker.startswith("process ") for worker in workers)


def listeners() -> list[object]:
    """Sockets on which this process and its children wait for somebody, Unix sockets with a name among them."""
    found: list[object] = []
    for process in (psutil.Process(), *psutil.Process().children(recursive=True)):
        with contextlib.suppress(psutil.NoSuchProcess):
            for one in process.net_connections(kind="all"):
                named = one.family.name == "AF_UNIX" and bool(one.laddr)
                if one.status == psutil.CONN_LISTEN or named:
                    found.append((process.pid, one.laddr))
    return found


def test_flights_are_asked_for_when_a_process_is_free_and_no_sooner(two: LocalPool) -> None:
    asked = itertools.count()
    seen = []
    for number, _ in zip(range(6), two.fly(lambda: FlightRequest(next(asked))), strict=False):
        seen.append(number)
    # Two fly, and each that is done is followed by one.
    assert next(asked) <= len(seen) + 2


def test_a_process_that_was_killed_between_two_flights_is_replaced(two: LocalPool) -> None:
    assert len(list(two.fly(requests(2)))) == 2
    killed = spawned_processes()[0]
    os.kill(killed, signal.SIGKILL)
    psutil.wait_procs([psutil.Process(killed)] if psutil.pid_exists(killed) else [], 5.0)
    assert sorted(one.request.index for one in two.fly(requests(4))) == [0, 1, 2, 3]
    assert len(spawned_processes()) == 2


# How often a flight kills its process.
KILLS = {3: 1, 4: 9}


def fly_killed(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """Make a flight, but kill the process of those of `KILLS` the first so many times."""
    for number in range(KILLS.get(index, 0)):
        flag = Path(os.environ["PLANFLY_TEST_FLAGS"]) / f"{index}-{number}"
        if not flag.exists():
            flag.touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return made_flight(base, index, wind)


@only_in_soak
def test_a_flight_that_kills_its_process_is_flown_twice_again_and_then_lost_and_no_other_is(
    base: CampaignBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLANFLY_TEST_FLAGS", str(tmp_path))
    with pool(1, base, fly_killed) as made:
        rows = {one.request.index: one.row for one in made.fly(requests(8))}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["3-0", "4-0", "4-1", "4-2"]
    assert rows.pop(4) == make_lost_row(base, 4, LOST_REASON)
    assert sorted(rows) == [0, 1, 2, 3, 5, 6, 7]
    assert all(is_same_flight(row, made_flight(base, k)) for k, row in rows.items())


def end_at_once(_copy: object) -> None:
    """A process that ends while it starts."""
    os._exit(9)


def test_processes_that_never_start_are_one_line(base: CampaignBase, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_pool, "_initialise_worker", end_at_once)
    monkeypatch.setattr(local_pool, "MAX_FAILED_STARTS", 2)
    assert MAX_FAILED_STARTS > 2
    with pool(1, base, made_flight) as made, pytest.raises(OSError, match="could not be started") as caught:
        list(made.fly(requests(2)))
    assert caught.value.filename == "1 workers"


def refused_flight(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """Flight 0 finds bad input, and all others a fault of ours."""
    if index == 0:
        raise MissionError("a.plan: items: 0: at least 1", file="a.plan", field="items", value=0)
    raise ZeroDivisionError("by nothing")


def test_bad_input_is_raised_whole_and_a_fault_with_the_flights_number(base: CampaignBase) -> None:
    with pool(1, base, refused_flight) as made:
        with pytest.raises(MissionError, match=r"^a\.plan: items: 0: at least 1$") as caught:
            list(made.fly(requests(1)))
        assert (caught.value.file, caught.value.field, caught.value.value) == ("a.plan", "items", 0)
        one = iter([FlightRequest(7)])
        with pytest.raises(RuntimeError, match=r"^flight 7: ZeroDivisionError: by nothing$"):
            list(made.fly(lambda: next(one, None)))


def sleeping_flight(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """Flight 0 comes back at once, and no other one."""
    if index:
        time.sleep(600.0)
    return made_flight(base, index, wind)


def hears_ctrl_c(process: int) -> bool:
    """Return True if a process does not block SIGINT."""
    status = Path(f"/proc/{process}/status").read_text(encoding="ascii")
    blocked = next(int(line.split()[1], 16) for line in status.splitlines() if line.startswith("SigBlk"))
    return not blocked >> (signal.SIGINT - 1) & 1


@only_in_soak
def test_flights_that_nobody_waits_for_end_with_their_processes_and_others_take_their_place(
    base: CampaignBase,
) -> None:
    """And no process hears Ctrl-C."""
    with pool(2, base, sleeping_flight) as made:
        flying = made.fly(requests(9))
        assert next(flying).request.index == 0
        if sys.platform == "linux":
            assert not any(hears_ctrl_c(worker) for worker in spawned_processes())
        began = time.monotonic()
        flying.close()  # type: ignore[attr-defined]  # A generator, which is what it is typed to be used as.
        assert time.monotonic() - began < 5.0
        assert [one.request.index for one in made.fly(requests(1))] == [0]


# Ctrl-C of a whole campaign, after which no process is left: tests/planfly/misuse/test_interruptions.py.
@only_in_soak
@pytest.mark.parametrize("number", some([signal.SIGKILL, signal.SIGINT], 2))
def test_workers_end_with_the_process_that_leads_them(number: signal.Signals, tmp_path: Path) -> None:
    client = start_client("campaign", tmp_path, 100_000)
    assert client.stdout is not None
    client.stdout.readline()
    children = psutil.Process(client.pid).children(recursive=True)
    assert sum("spawn_main" in " ".join(one.cmdline()) for one in children) == 2
    client.send_signal(number)
    client.stdout.close()
    client.wait(10.0)
    _, alive = psutil.wait_procs(children, 5.0)
    assert alive == []
