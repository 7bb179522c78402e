"""The vehicle: commands and missions become orders to the flying process, whatever the datagrams are."""

import gc
import os
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.flight_process import EndFlight, JudgeMission, StartFlight
from flight.mission.items import Command, Frame, MissionItem
from tests.flight.live.fake_vehicle import HEARTBEAT, FakeVehicle, command, packed
from tests.flight.live.fuzzed_datagrams import fuzzed
from tests.stations import many_items

SOAK = bool(os.environ.get("PLANFLY_SOAK"))


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


def test_any_datagram_is_survived(fake: FakeVehicle) -> None:
    """30,000 datagrams, a million in the soak: alive, no more memory, and a real upload works afterwards."""
    count, batch = (1_000_000 if SOAK else 30_000), 1000
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
