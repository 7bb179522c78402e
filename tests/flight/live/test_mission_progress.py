"""The numbers that stations have for what is flown: as they sent the items, with or without a home among them."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.telemetry import ACTIVE
from tests.flight.live.fake_vehicle import FakeVehicle
from tests.stations import item

PLACES = [item(k, 460_000_000, 80_000_000 + 50_000 * k, 100.0) for k in range(4)]


def reached(fake: FakeVehicle) -> list[tuple[str, int]]:
    """What stations hear of three waypoints, items 1 and 2 of the judged mission."""
    out: list[object] = []
    fake.link.send = lambda message, peer: out.append(message)
    fake.vehicle.arming.mission_state = ACTIVE
    progress = fake.vehicle._progress
    progress.started()
    for leg in (0, 0, 1):
        progress.on_leg(leg)
    return [(m.get_type(), m.seq) for m in out if m.get_type() in ("MISSION_CURRENT", "MISSION_ITEM_REACHED")]


def test_items_are_reached_once_and_the_next_is_current(fake: FakeVehicle) -> None:
    fake.upload(PLACES)
    said = [("MISSION_ITEM_REACHED", 1), ("MISSION_CURRENT", 2), ("MISSION_ITEM_REACHED", 2), ("MISSION_CURRENT", 2)]
    assert reached(fake) == said


def test_without_a_home_numbers_are_one_less(fake: FakeVehicle) -> None:
    """MAVSDK's mission plugin sends none: its item 0 is flown."""
    relative = [
        mavlink.MAVLink_mission_item_int_message(
            1, 1, k, 6, 16, 0, 1, 0, 9, 0, 0, 460_000_000, 80_000_000 + 50_000 * k, 100.0, 0
        )
        for k in range(4)
    ]
    fake.upload(relative)
    assert [seq for _, seq in reached(fake)] == [0, 1, 1, 1]
