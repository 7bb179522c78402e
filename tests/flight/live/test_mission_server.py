"""Items as MISSION_ITEM_INT: the same after the wire, or refused with the item and the field."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.mission_server import (
    CONFIRMATION_COUNT,
    CONFIRMATION_PERIOD_S,
    LOCK_TIMEOUT_S,
    MAX_UPLOADED_ITEMS,
    UPLOAD_TIMEOUT_S,
    MissionServer,
    MissionType,
    Station,
    from_message,
    item_type,
    mission_lists,
    to_message,
    uploaded_mission,
)
from flight.mission.items import Command, Frame, Home, Mission, MissionItem
from tests.flight.mission_files.worldwide_mission import some_mission
from tests.soak import scaled, tally
from tests.stations import Medium, Uploader, decode, item, many_items
from world.errors import MissionError


def test_messages_come_back_the_same() -> None:
    from pymavlink.dialects.v20 import common

    link = common.MAVLink(None, srcSystem=1, srcComponent=1)
    mission = some_mission(200, seed=2)
    jump = MissionItem(201, int(Command.DO_JUMP), int(Frame.MISSION), (3.0, 2.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    unset = MissionItem(202, 16, 3, (0.0, 0.0, 0.0, math.nan), math.nan, math.nan, 100.0)
    for sent in (*mission.items, *mission.fences, *mission.rally, jump, unset):
        back = link.decode(bytearray(to_message(sent, target_system=7).pack(link)))
        assert (back.x, back.y, back.seq, back.target_system) == (sent.x, sent.y, sent.seq, 7)
        assert back.mission_type == item_type(sent)
        again = from_message(back, "station")
        assert (again.x, again.y, again.command, again.frame) == (sent.x, sent.y, sent.command, sent.frame)
        assert str(again.params) == str(sent.params)
        assert math.isnan(again.lat_deg) == math.isnan(sent.lat_deg)
    assert item_type(mission.rally[0]) == MissionType.RALLY


def test_a_bad_message_is_refused() -> None:
    from pymavlink.dialects.v20 import common

    good = to_message(some_mission(1).items[0])
    for field, value, text in (
        ("x", 910_000_000, "latitude 91"),
        ("frame", 1, "frame 1"),
        ("param1", math.inf, "p1 inf"),
        ("z", math.inf, "altitude inf"),
    ):
        message = common.MAVLink_mission_item_int_message(
            *(getattr(good, name) if name != field else value for name in good.fieldnames)
        )
        with pytest.raises(MissionError, match=f"^station: item 1: .*{text}"):
            from_message(message, "station")


# ----------------------------------------------------------------------
# Missions between stations and files: home is item 0, seq has no gaps, jumps go where they went.

HOME, OWN = Home(46.0, 8.0, 400.0), Home(47.0, 9.0, 500.0)


def waypoint(seq: int, lat: float, frame: int = 3, radius: float = 0.0) -> MissionItem:
    return MissionItem(seq, 16, frame, (0.0, radius, 0.0, 0.0), lat, 8.0, 100.0)


def lists_of(*items: MissionItem) -> dict[MissionType, tuple[MissionItem, ...]]:
    return dict.fromkeys(MissionType, ()) | {MissionType.MISSION: items}


def test_jumps_keep_their_targets_in_numbers_without_gaps() -> None:
    jump = MissionItem(9, 177, 2, (7.0, 2.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    items, fences, rally = mission_lists(Mission(HOME, (waypoint(3, 46.1), waypoint(7, 46.2), jump)))
    assert [item.seq for item in items] == [0, 1, 2, 3]
    assert (items[0].lat_deg, items[0].alt) == (46.0, 400.0)
    assert items[3].params[:2] == (2.0, 2.0)
    assert (fences, rally) == ((), ())


def test_a_listed_mission_comes_back() -> None:
    mission = Mission(HOME, (waypoint(1, 46.1), waypoint(2, 46.2)))
    back, shift = uploaded_mission(lists_of(*mission_lists(mission)[0]), OWN)
    assert (back, shift) == (mission, 0)


def test_a_station_that_sends_no_home_gets_its_own_numbers() -> None:
    """MAVSDK's mission plugin: the first item is relative and has a radius."""
    back, shift = uploaded_mission(lists_of(waypoint(0, 46.1, radius=1.0), waypoint(1, 46.2, radius=1.0)), OWN)
    assert back.home == OWN
    assert [item.seq + shift for item in back.items] == [0, 1]


# ----------------------------------------------------------------------
# The mission protocol, without sockets: whole or nothing, one station at a time, on any link.

ONE, TWO = Station("one", 255, 190), Station("two", 254, 190)


def held(server: MissionServer, kind: MissionType = MissionType.MISSION) -> list[tuple[int, int, float]]:
    return [(one.x, one.y, one.alt) for one in server.lists[kind]]


def wanted(items: list) -> list[tuple[int, int, float]]:
    return [(one.x, one.y, one.z) for one in items]


def test_a_thousand_items_arrive_as_they_were_sent() -> None:
    server, items = MissionServer(), many_items(1000)
    one = Uploader(ONE, items)
    Medium(server, [one]).run(60.0)
    assert one.result == mavlink.MAV_MISSION_ACCEPTED
    assert held(server) == wanted(items)
    assert server.changed == {MissionType.MISSION}


@pytest.mark.parametrize("seed", range(scaled(20, 2)))
def test_a_thousand_items_survive_a_bad_link(seed: int) -> None:
    """30 % lost, doubled and reordered each way: all or, until then, nothing."""
    server, items, old = MissionServer(), many_items(1000, mark=seed), many_items(5, mark=99)
    Medium(server, [Uploader(ONE, old)]).run(5.0)
    one = Uploader(ONE, items)
    medium = Medium(server, [one], 0.3, 0.3, (0.001, 0.04), seed, now=20.0)

    def whole() -> None:
        assert len(server.lists[MissionType.MISSION]) in (5, 1000)

    medium.whole = whole
    medium.run(400.0)
    assert one.result == mavlink.MAV_MISSION_ACCEPTED
    assert held(server) == wanted(items)
    assert medium.sent > 4000
    tally("uploads of 1,000 items at 30 % loss each way", uploads=1, whole=1, datagrams=medium.sent)


@pytest.mark.parametrize("seed", range(100))
def test_of_two_stations_at_once_one_wins(seed: int) -> None:
    """One wins and the other is denied, on a link that loses and reorders; never a mixture."""
    server = MissionServer()
    first, second = many_items(12, mark=1), many_items(12, mark=2)
    one, two = Uploader(ONE, first), Uploader(TWO, second)
    loss = 0.1 if seed % 2 else 0.0
    Medium(server, [one, two], loss, loss, (0.001, 0.02), seed).run(60.0)
    results = {one.result, two.result}
    assert held(server) in (wanted(first), wanted(second))
    if loss == 0.0:
        assert results == {mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_DENIED}
        winner = first if one.result == mavlink.MAV_MISSION_ACCEPTED else second
        assert held(server) == wanted(winner)
    # On a bad link the denied one may start again after the first is done; then the last accepted is what is held.
    assert mavlink.MAV_MISSION_ACCEPTED in results


def send(server: MissionServer, message: object, who: Station, now: float) -> list:
    return server.handle(decode(message, who.system, who.component), who, now)


def test_half_an_upload_changes_nothing_and_the_lock_expires() -> None:
    server = MissionServer()
    Medium(server, [Uploader(ONE, many_items(3))]).run(5.0)
    before = server.lists[MissionType.MISSION]
    send(server, mavlink.MAVLink_mission_count_message(1, 1, 9, 0), ONE, 10.0)
    send(server, item(0, 1, 1, 5.0), ONE, 10.0)
    denied = send(server, mavlink.MAVLink_mission_count_message(1, 1, 2, 0), TWO, 10.0 + 0.9 * LOCK_TIMEOUT_S)
    assert denied[0].message.type == mavlink.MAV_MISSION_DENIED
    assert "system 255" in denied[0].text
    assert server.lists[MissionType.MISSION] == before
    taken = send(server, mavlink.MAVLink_mission_count_message(1, 1, 2, 0), TWO, 10.0 + 1.1 * LOCK_TIMEOUT_S)
    assert taken[0].message.get_type() == "MISSION_REQUEST_INT"
    late = 10.0 + 1.1 * LOCK_TIMEOUT_S + UPLOAD_TIMEOUT_S + 0.1
    assert server.tick(late)[0].message.type == mavlink.MAV_MISSION_OPERATION_CANCELLED
    assert server.tick(late + 2.0 * UPLOAD_TIMEOUT_S) == []  # no upload is in progress any longer
    assert server.lists[MissionType.MISSION] == before


def test_starting_over_mixes_nothing() -> None:
    server = MissionServer()
    count = mavlink.MAVLink_mission_count_message(1, 1, 4, 0)
    send(server, count, ONE, 0.0)
    for old in many_items(2, mark=5):
        send(server, old, ONE, 0.1)
    items = many_items(4, mark=6)
    Medium(server, [Uploader(ONE, items)], now=0.2).run(5.0)
    assert held(server) == wanted(items)


def test_the_final_ack_is_repeated() -> None:
    server, items = MissionServer(), many_items(3)
    Medium(server, [Uploader(ONE, items)]).run(5.0)
    again = send(server, items[-1], ONE, 6.0)
    assert [reply.message.type for reply in again] == [mavlink.MAV_MISSION_ACCEPTED]
    assert send(server, items[-1], TWO, 6.0) == []
    assert send(server, items[0], ONE, 6.0) == []


@pytest.mark.parametrize("seed", range(scaled(200, 60)))
def test_a_station_that_only_waits_hears_of_the_end(seed: int) -> None:
    """MAVSDK sends no item twice unasked: with its ACK lost it waits, and gives up after 2.5 s."""
    server, items = MissionServer(), many_items(40)
    one = Uploader(ONE, items, patience=0.5, mavsdk=True)
    Medium(server, [one], 0.1, 0.0, (0.001, 0.02), seed).run(60.0)
    assert one.result == mavlink.MAV_MISSION_ACCEPTED
    assert held(server) == wanted(items)


def upload(server: MissionServer, items: list, now: float, *, late: float = 0.0) -> None:
    """Send a whole upload, each item so long after it was asked for."""
    send(server, mavlink.MAVLink_mission_count_message(1, 1, len(items), 0), ONE, now)
    for one in items:
        asked = now
        while now < asked + late:
            now += 0.005
            server.tick(now)
        send(server, one, ONE, now)


def confirmations(server: MissionServer, now: float) -> int:
    return sum(len(server.tick(now + 0.005 * k)) for k in range(1, 1000))


def test_only_a_station_on_a_bad_link_that_is_silent_is_asked_again() -> None:
    server, items = MissionServer(), many_items(3)
    upload(server, items, 0.0)
    assert confirmations(server, 0.0) == 0
    upload(server, items, 10.0, late=0.06)
    assert [reply.message.seq for reply in server.tick(11.0)] == [2]
    assert server.tick(11.1) == []
    send(server, mavlink.MAVLink_mission_request_list_message(1, 1, 0), ONE, 11.2)
    assert confirmations(server, 11.2) == 0
    upload(server, items, 20.0, late=0.06)
    # Within the 2.5 s that MAVSDK waits.
    assert confirmations(server, 20.2) == CONFIRMATION_COUNT
    assert CONFIRMATION_COUNT * CONFIRMATION_PERIOD_S < 2.5


def test_a_duplicate_of_the_last_item_gets_no_second_ack() -> None:
    """MAVSDK would take it for its next upload's, and fail."""
    server, items = MissionServer(), many_items(3)
    upload(server, items, 0.0)
    assert send(server, items[-1], ONE, 0.2) == []
    assert len(send(server, items[-1], ONE, 0.4)) == 1
    assert send(server, items[-1], ONE, 0.5) == []


def test_a_slow_station_is_not_pressed() -> None:
    """A stall of a second brings fewer requests than MAVSDK counts before it gives up; a slow link soon brings none."""
    server = MissionServer()
    send(server, mavlink.MAVLink_mission_count_message(1, 1, 9, 0), ONE, 0.0)
    assert 2 <= sum(len(server.tick(0.005 * k)) for k in range(201)) <= 4
    now, asked = 1.0, []
    for one in many_items(8):
        send(server, one, ONE, now)
        asked.append(sum(len(server.tick(now + 0.005 * k)) for k in range(1, 50)))
        now += 0.25
    assert asked[1:] == [0] * 7


@pytest.mark.parametrize("delay", [0.02, 0.1, 0.2])
def test_fence_and_mission_follow_each_other_on_a_slow_link(delay: float) -> None:
    server = MissionServer()
    for kind, command in ((MissionType.FENCE, 5004), (MissionType.MISSION, 16), (MissionType.MISSION, 16)):
        items = [item(k, 460_000_000 + k, 80_000_000, 50.0, command=command, kind=kind, p1=50.0) for k in range(5)]
        one = Uploader(ONE, items, kind=kind, patience=0.5, mavsdk=True)
        Medium(server, [one], delay=(delay, delay)).run(60.0)
        assert one.result == mavlink.MAV_MISSION_ACCEPTED


@pytest.mark.parametrize(
    ("wrong", "kind", "result"),
    [
        (item(1, 910_000_000, 0, 5.0), 0, mavlink.MAV_MISSION_INVALID_PARAM5_X),
        (item(1, 10, 1_810_000_000, 5.0), 0, mavlink.MAV_MISSION_INVALID_PARAM6_Y),
        (item(1, 10, 10, float("inf")), 0, mavlink.MAV_MISSION_INVALID),
        (item(1, 10, 10, 5.0, frame=99), 0, mavlink.MAV_MISSION_INVALID),
        (item(1, 10, 10, 5.0, command=5004, p1=50.0), 0, mavlink.MAV_MISSION_UNSUPPORTED),
        (item(1, 10, 10, 5.0, kind=1), 1, mavlink.MAV_MISSION_UNSUPPORTED),
        (item(1, 10, 10, 5.0, command=5004, kind=1, p1=-1.0), 1, mavlink.MAV_MISSION_INVALID),
        (item(1, 10, 10, 5.0, kind=2), 2, mavlink.MAV_MISSION_UNSUPPORTED),
    ],
)
def test_an_invalid_item_refuses_the_whole(wrong: object, kind: int, result: int) -> None:
    good = {
        0: item(0, 1, 1, 5.0),
        1: item(0, 1, 1, 5.0, command=5004, kind=1, p1=9.0),
        2: item(0, 1, 1, 5.0, command=5100, kind=2),
    }
    server = MissionServer()
    one = Uploader(ONE, [good[kind], wrong], kind)
    medium = Medium(server, [one])
    medium.run(5.0)
    assert one.result == result
    assert server.lists[MissionType(kind)] == ()
    assert "item 1" in medium.texts[0]
    assert medium.texts[0].endswith("nothing changed")


def test_one_station_uploads_three_lists_at_once() -> None:
    server = MissionServer()
    items = [
        many_items(40),
        [item(k, 10 + k, 20, 0.0, command=5004, kind=1, p1=50.0) for k in range(9)],
        [item(k, 30 + k, 40, 80.0, command=5100, kind=2, frame=3) for k in range(3)],
    ]
    uploaders = [Uploader(ONE, one, kind) for kind, one in enumerate(items)]
    Medium(server, uploaders, 0.1, 0.1, (0.001, 0.02)).run(60.0)
    assert [one.result for one in uploaders] == [0, 0, 0]
    assert [held(server, kind) for kind in MissionType] == [wanted(one) for one in items]


def test_download_gives_the_integers_back() -> None:
    server, items = MissionServer(), many_items(7)
    Medium(server, [Uploader(ONE, items)]).run(5.0)
    (count,) = send(server, mavlink.MAVLink_mission_request_list_message(1, 1, 0), TWO, 9.0)
    assert count.message.count == 7
    for k, one in enumerate(items):
        (reply,) = send(server, mavlink.MAVLink_mission_request_int_message(1, 1, k, 0), TWO, 9.0)
        assert (reply.message.seq, reply.message.x, reply.message.y, reply.message.z) == (k, one.x, one.y, one.z)
        assert (reply.message.target_system, reply.message.frame) == (254, 0)
    (beyond,) = send(server, mavlink.MAVLink_mission_request_int_message(1, 1, 7, 0), TWO, 9.0)
    assert beyond.message.type == mavlink.MAV_MISSION_INVALID_SEQUENCE


def test_a_locked_or_too_large_upload_is_denied() -> None:
    server = MissionServer()
    Medium(server, [Uploader(ONE, many_items(3))]).run(5.0)
    server.locked = "in flight"
    for message in (
        mavlink.MAVLink_mission_clear_all_message(1, 1, 255),
        mavlink.MAVLink_mission_count_message(1, 1, 2, 0),
    ):
        assert send(server, message, ONE, 9.0)[0].message.type == mavlink.MAV_MISSION_DENIED
    assert (
        send(server, mavlink.MAVLink_mission_count_message(1, 1, 2, 2), ONE, 9.0)[0].message.get_type().endswith("INT")
    )
    server.locked = ""
    big = send(server, mavlink.MAVLink_mission_count_message(1, 1, MAX_UPLOADED_ITEMS + 1, 0), ONE, 20.0)
    assert big[0].message.type == mavlink.MAV_MISSION_NO_SPACE
    assert len(server.lists[MissionType.MISSION]) == 3
    assert send(server, mavlink.MAVLink_mission_clear_all_message(1, 1, 255), ONE, 40.0)[0].message.type == 0
    assert server.lists == dict.fromkeys(MissionType, ())
    assert send(server, mavlink.MAVLink_mission_count_message(1, 1, 2, 77), ONE, 41.0)[0].message.type == 3


def float_item(seq: int, lat: float, current: int = 0) -> object:
    return mavlink.MAVLink_mission_item_message(1, 1, seq, 0, 16, current, 1, 0, 12, 0, 0, lat, 8.0000004, 100.0, 0)


def asked(replies: list) -> list[str]:
    return [reply.message.get_type() for reply in replies]


def test_an_upload_of_float_items_is_taken_and_said_to_be_inexact() -> None:
    """Positions to the nearest 1e-7 degrees of what a float holds; the next item is asked for in the sender's form."""
    server = MissionServer()
    send(server, mavlink.MAVLink_mission_count_message(1, 1, 2, 0), ONE, 0.0)
    assert asked(send(server, float_item(0, 46.25), ONE, 0.01)) == ["MISSION_REQUEST"]
    (done,) = send(server, float_item(1, -46.3), ONE, 0.02)
    assert (done.message.get_type(), done.message.type) == ("MISSION_ACK", mavlink.MAV_MISSION_ACCEPTED)
    assert "MISSION_ITEM_INT is exact" in done.text
    first, second = server.lists[MissionType.MISSION]
    # 46.25 and 8 are floats; of -46.3 the nearest is -46.299999237...
    assert (first.x, first.y, second.x, first.params) == (462_500_000, 80_000_000, -462_999_992, (0.0, 12.0, 0.0, 0.0))
    assert (first.lon_deg, second.lat_deg) == (8.0, -46.2999992), "on the grid of 1e-7 degrees"
    send(server, mavlink.MAVLink_mission_count_message(1, 1, 2, 0), ONE, 5.0)
    assert send(server, float_item(0, 90.5), ONE, 5.0)[0].message.type == mavlink.MAV_MISSION_INVALID_PARAM5_X


def test_a_station_that_knows_only_mission_request_is_asked_by_it() -> None:
    """After four requests that nobody answers; who refuses that one gets MISSION_REQUEST_INT again."""
    server, seen, now = MissionServer(), [], 0.0
    send(server, mavlink.MAVLink_mission_count_message(1, 1, 1, 0), ONE, now)
    while len(seen) < 5:
        now += 0.01
        seen += asked(server.tick(now))
    assert seen == ["MISSION_REQUEST_INT"] * 3 + ["MISSION_REQUEST"] * 2
    unsupported = mavlink.MAVLink_mission_ack_message(1, 1, mavlink.MAV_MISSION_UNSUPPORTED, 0)
    assert asked(send(server, unsupported, ONE, now)) == ["MISSION_REQUEST_INT"]
    assert send(server, many_items(1)[0], ONE, now)[0].message.type == mavlink.MAV_MISSION_ACCEPTED


@pytest.mark.parametrize(("current", "located"), [(2, True), (3, False)])
def test_a_guided_item_is_flown_to_and_is_no_item_of_the_mission(current: int, located: bool) -> None:
    """Mission Planner's "fly to here" and its change of height."""
    asked_for: list[MissionItem] = []
    server = MissionServer(go_to=lambda one: asked_for.append(one) or "")
    (reply,) = send(server, float_item(0, 46.25, current), ONE, 0.0)
    assert (reply.message.type, reply.text) == (mavlink.MAV_MISSION_ACCEPTED, "")
    (place,) = asked_for
    assert (place.lat_deg == 46.25, math.isnan(place.lat_deg)) == (located, not located)
    assert server.lists[MissionType.MISSION] == ()
    (reply,) = send(MissionServer(), float_item(0, 46.25, current), ONE, 0.0)
    assert (reply.message.type, reply.text) == (mavlink.MAV_MISSION_DENIED, "go-to denied: not in flight")
    (reply,) = send(server, float_item(0, 146.25, current), ONE, 0.0)
    assert (reply.message.type, len(asked_for)) == (mavlink.MAV_MISSION_INVALID, 1)
