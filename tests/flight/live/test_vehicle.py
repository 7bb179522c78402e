"""The vehicle: commands and missions become orders to the flying process, whatever the datagrams are."""

import gc
import itertools
import os
import socket
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.flight_process import EndFlight, JudgeMission, StartFlight
from flight.mission.items import Command, Frame, MissionItem
from tests.flight.live.fake_vehicle import HEARTBEAT, FakeVehicle, command, packed
from tests.flight.live.fuzzed_datagrams import fuzzed
from tests.soak import note, scaled
from tests.stations import many_items


def test_armed_and_auto_start_the_flight(fake: FakeVehicle) -> None:
    fake.upload(many_items(3))
    assert isinstance(fake.orders[0], JudgeMission)
    fake.send(command(400, 1.0), command(176, 1.0, 10.0))
    assert isinstance(fake.orders[-1], StartFlight)
    assert fake.vehicle.status.flying
    fake.send(command(400, 0.0))
    assert fake.vehicle.status.armed
    fake.send(command(400, 0.0, 21196.0))
    assert isinstance(fake.orders[-1], EndFlight)


def test_what_is_not_flyable_is_not_armed_unless_forced(fake: FakeVehicle) -> None:
    fake.flyable = False
    fake.upload(many_items(3))
    fake.send(command(400, 1.0))
    assert not fake.vehicle.status.armed
    assert "PFLY_FORCE" in fake.shown[-1]
    fake.send(mavlink.MAVLink_param_set_message(1, 1, b"PFLY_FORCE", 1.0, 9), command(400, 1.0))
    assert fake.vehicle.status.armed


def test_a_mission_taken_back_while_it_is_judged_is_not_flown(fake: FakeVehicle) -> None:
    fake.send(HEARTBEAT, mavlink.MAVLink_mission_count_message(1, 1, 3, 0), *many_items(3)[:2])
    fake.link.take(b"", ("127.0.0.1", 5))
    for message in (many_items(3)[2], command(400, 1.0), mavlink.MAVLink_mission_clear_all_message(1, 1, 0)):
        ((found, peer),) = fake.link.take(packed(message), ("127.0.0.1", 5))
        fake.vehicle._from_station(found, peer, 0.0)
    fake.turn()
    fake.turn()
    fake.send(command(176, 1.0, 10.0))
    assert not fake.vehicle.status.flying
    assert not any(isinstance(order, StartFlight) for order in fake.orders)


def test_a_fence_from_a_file_belongs_to_the_mission_that_is_uploaded_next(fake: FakeVehicle) -> None:
    circle = MissionItem(0, Command.NAV_FENCE_CIRCLE_EXCLUSION, Frame.GLOBAL, (200.0, 0.0, 0.0, 0.0), 46.0, 8.0, 0.0)
    fake.vehicle.load_fence([circle])
    fake.turn()
    assert fake.orders == []
    fake.upload(many_items(3))
    assert isinstance(fake.orders[0], JudgeMission)
    assert fake.orders[0].mission.fences == (circle,)


def resident() -> int:
    """Memory of this process, bytes."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_any_datagram_is_survived_through_a_socket(fake: FakeVehicle) -> None:
    """4,000 datagrams from two addresses, a million in the soak: none is lost on the way, and memory stays."""
    count, batch = scaled(1_000_000, 4_000), 100
    senders = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    try:
        for host, sender in zip(("127.0.0.1", "127.0.0.2"), senders, strict=True):
            sender.bind((host, 0))
        before = begun = 0
        for k in itertools.count():
            # Which messages there are, and so what chance sends, is pymavlink's.
            if k >= count // batch and (begun or k >= 10 * count // batch):
                break
            for n, data in enumerate((packed(HEARTBEAT), packed(HEARTBEAT), *fuzzed(batch, k))):
                senders[n % 2].sendto(data, fake.link.address)
            fake.turn()
            if k == min(9, count // batch // 3):
                gc.collect()
                before = resident()
            begun += any(isinstance(order, JudgeMission) for order in fake.orders)
        gc.collect()
        grown = resident() - before
        assert grown <= 10 * 2**20
        assert begun > 0, "the fuzz is to reach the missions"
        port = f":{fake.link.address[1]:04X} "
        (line,) = [line for line in Path("/proc/net/udp").read_text("ascii").splitlines() if port in line[:30]]
        lost = int(line.split()[-1])
        assert lost == 0
        note("datagrams through a socket", count=count, lost=lost, memory_grown_kib=grown // 1024)
    finally:
        for sender in senders:
            sender.close()


def test_any_datagram_is_survived(fake: FakeVehicle) -> None:
    """30,000 datagrams, a million in the soak: alive, no more memory, and a real upload works afterwards."""
    count, batch = scaled(1_000_000, 30_000), 1000
    before = judged = 0
    for k in range(count // batch):
        for port in (5, 6):
            fake.send(HEARTBEAT, port=port)
        data = fuzzed(batch, k)
        fake.feed(data[::2], 5)
        fake.feed(data[1::2], 6)
        judged += any(isinstance(order, JudgeMission) for order in fake.orders)
        if k == min(9, count // batch // 3):
            gc.collect()
            before = resident()
    gc.collect()
    note("datagrams to the vehicle", count=count, memory_grown_kib=(resident() - before) // 1024)
    assert resident() - before <= 10 * 2**20
    assert judged > 0, "the fuzz is to reach the missions"
    # Whatever it left behind: the flight is over, and both stations silent for a while.
    fake.vehicle.arming.flight_ended(False)
    fake.link.peers.clear()
    fake.vehicle.server.tick(fake.vehicle._clock() + 100.0)
    fake.orders.clear()
    items = many_items(50)
    fake.upload(items, port=7)
    fake.turn()
    lists = fake.vehicle.server.lists
    assert [(one.x, one.y) for one in next(iter(lists.values()))] == [(one.x, one.y) for one in items]
    assert any(isinstance(order, JudgeMission) for order in fake.orders)
