"""The vehicle's side of the MAVLink mission protocol, as a state machine: no socket, no clock of its own.

A mission, a fence and rally points are each taken whole or not at all: an upload is collected beside the list that is
there and replaces it only when its last item is in and every item is valid.  One station uploads at a time; another is
denied until the first has been silent for `LOCK` seconds.  (mavlink.io, "Mission Protocol".)  pymavlink has the
messages and a station's lists (`mavwp`), and nothing of the vehicle's side.
"""

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.mission.items import (
    AMSL,
    FENCES,
    Command,
    Frame,
    Home,
    ItemProblem,
    Mission,
    MissionItem,
    is_located,
    item_problem,
    on_grid,
    renumbered,
)
from world.errors import MissionError

# ----------------------------------------------------------------------
# Mission items on the wire: MISSION_ITEM_INT made and parsed, MISSION_ITEM parsed (MAVLink mission protocol).
#
# Made in the INT form alone: the float MISSION_ITEM moves a waypoint by up to 0.5 m.  pymavlink is imported when a
# message is made, so that reading files does not wait for it.

_INT32_MAX = 2**31 - 1


class MissionType(IntEnum):
    """MAV_MISSION_TYPE: which of a vehicle's three lists an item belongs to."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


def item_type(item: MissionItem) -> MissionType:
    """List that an item belongs to, by its command."""
    if item.command in FENCES:
        return MissionType.FENCE
    return MissionType.RALLY if item.command == Command.NAV_RALLY_POINT else MissionType.MISSION


def to_message(
    item: MissionItem,
    *,
    target_system: int = 1,
    target_component: int = 1,
    current: bool = False,
    seq: int | None = None,
    mission_type: MissionType | None = None,
) -> Any:
    """MISSION_ITEM_INT of an item: x and y are rounded to 1e-7 degrees, never truncated.

    seq: None keeps the item's own number.  mission_type: None takes the one of its command.

    >>> message = to_message(MissionItem(3, 16, 0, (0.0,) * 4, 46.0, 8.0, 500.0))
    >>> message.get_type(), message.seq, message.x
    ('MISSION_ITEM_INT', 3, 460000000)
    """
    from pymavlink.dialects.v20 import common

    return common.MAVLink_mission_item_int_message(
        target_system,
        target_component,
        item.seq if seq is None else seq,
        int(item.frame),
        int(item.command),
        int(current),
        int(item.autocontinue),
        *item.params,
        item.x,
        item.y,
        item.alt,
        int(item_type(item) if mission_type is None else mission_type),
    )


def from_message(message: Any, source: str) -> MissionItem:
    """Item of a MISSION_ITEM_INT or MISSION_ITEM message; ``source`` names the sender in messages.

    INT32_MAX in an integer x or y is NaN (MAVLink's "unset").  A float's latitude and longitude go to the nearest
    1e-7 degrees.  Raises MissionError, one line: item, field, value, what is allowed.
    """
    command, frame = int(message.command), int(message.frame)
    located = is_located(command, frame)
    if message.get_type() == "MISSION_ITEM":
        lat, lon = (on_grid(value) if located else value + 0.0 for value in (message.x, message.y))
    else:
        scale = 1e7 if located else 1.0
        lat, lon = (math.nan if value == _INT32_MAX else value / scale for value in (message.x, message.y))
    params = tuple(float(value) for value in (message.param1, message.param2, message.param3, message.param4))
    p1, p2, p3, p4 = (value + 0.0 for value in params)
    item = MissionItem(
        int(message.seq), command, frame, (p1, p2, p3, p4), lat, lon, float(message.z), bool(message.autocontinue)
    )
    for name, value in (*zip(("p1", "p2", "p3", "p4"), params, strict=True), ("altitude", item.alt)):
        if math.isinf(value):
            problem = ItemProblem(name, value, "a finite number, or NaN for unset")
            raise MissionError(**problem.at(source, f"{source}: item {item.seq}"))
    fault = item_problem(item)
    if fault is not None:
        raise MissionError(**fault.at(source, f"{source}: item {item.seq}"))
    return item


# ----------------------------------------------------------------------
# Missions as stations number them, and as they are flown: home, seq and jumps from one to the other.


def uploaded(lists: dict[MissionType, tuple[MissionItem, ...]], own: Home) -> tuple[Mission, int]:
    """Mission of the lists, and what to add to its items' seq for the numbers that stations know.

    Item 0 is home, as ArduPilot has it, if it is a waypoint above mean sea level, or one with no parameter set:
    MAVSDK's `mission` plugin sends no home, and its waypoints are relative and have a radius.
    ``own``: the vehicle's home, for a mission that brings none.
    """
    items = lists[MissionType.MISSION]
    home = own
    if items and _is_home(items[0]):
        first = items[0]
        home = Home(first.lat_deg, first.lon_deg, first.alt) if first.has_position else own
        items = items[1:]
        shift = 0
    else:
        shift = -1
    mission = Mission(
        home=home,
        items=items,
        fences=tuple(item for item in lists[MissionType.FENCE] if item.command in FENCES),
        rally=lists[MissionType.RALLY],
        source="upload",
    )
    return renumbered(mission), shift


def _is_home(item: MissionItem) -> bool:
    if item.command != Command.NAV_WAYPOINT or not is_located(item.command, item.frame):
        return False
    return item.frame in AMSL or not any(item.params)


def listed(mission: Mission) -> tuple[tuple[MissionItem, ...], ...]:
    """Lists of a mission as stations see them: home first, seq without gaps, jumps moved with their targets.

    >>> place = MissionItem(4, 16, 0, (0.0,) * 4, 46.0, 8.0, 75.0)
    >>> items, fences, rally = listed(Mission(Home(46.0, 8.0, 0.0), (place, replace(place, seq=7))))
    >>> [item.seq for item in items], fences, rally
    ([0, 1, 2], (), ())
    """
    home = mission.home
    first = MissionItem(0, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, 0.0, 0.0, 0.0)
    if home is not None:
        first = replace(first, lat_deg=home.lat_deg, lon_deg=home.lon_deg, alt=home.alt)
    numbers = {item.seq: k for k, item in enumerate(mission.items, 1)}
    items = [first]
    for item in mission.items:
        params = item.params
        if item.command == Command.DO_JUMP:
            params = (float(numbers.get(int(params[0]), 65535)), *params[1:])
        items.append(replace(item, seq=numbers[item.seq], params=params))
    return (
        tuple(items),
        tuple(replace(item, seq=k) for k, item in enumerate(mission.fences)),
        tuple(replace(item, seq=k) for k, item in enumerate(mission.rally)),
    )


def start_problem(mission: Mission, first: int, *, in_flight: bool = False) -> str:
    """Why a mission cannot be flown from the item of this seq on; "" if it can.

    in_flight: whether the way there from where the aircraft is will be its first leg.

    >>> place = MissionItem(1, 16, 0, (0.0,) * 4, 46.0, 8.0, 75.0)
    >>> way = Mission(None, (place, replace(place, seq=2), replace(place, seq=3)))
    >>> start_problem(way, 2), start_problem(way, 3)
    ('', 'from there on no leg is left to fly')
    """
    if not mission.items or not 0 <= first <= mission.items[-1].seq:
        return "the mission has no such item"
    places = [item for item in mission.items if item.seq >= first and item.has_position]
    least = 1 if in_flight else 2
    return "" if first <= mission.items[0].seq or len(places) >= least else "from there on no leg is left to fly"


def flown_from(mission: Mission, first: int) -> Mission:
    """Mission from the item of this seq on, at the speed that the items before it have set; its numbers are kept.

    >>> place = MissionItem(1, 16, 0, (0.0,) * 4, 46.0, 8.0, 75.0)
    >>> speed = MissionItem(2, 178, 2, (0.0, 22.0, -1.0, 0.0), 0.0, 0.0, 0.0)
    >>> way = Mission(None, (place, speed, replace(place, seq=3), replace(place, seq=4)))
    >>> [item.seq for item in flown_from(way, 4).items], flown_from(way, 1) == way
    ([2, 4], True)
    """
    before = [item for item in mission.items if item.seq < first]
    speeds = [item for item in before if item.command == Command.DO_CHANGE_SPEED][-1:]
    return replace(mission, items=(*speeds, *(item for item in mission.items if item.seq >= first)))


# Most items that an upload may announce: bounds what a station can make the vehicle hold (some 2 MB a list).
MAX_UPLOADED = 5_000
# A request is sent again after `RETRY` s, or half as long again as the item before took, then after twice as long each
# time, up to `SLOWEST_RETRY`.  A station that is only slow counts them: MAVSDK gives up at the sixth for an item.
RETRY, SLOWEST_RETRY = 0.05, 0.4
# An upload's last ACK may be lost, and the station wait for it in silence, as MAVSDK does for five times 0.5 s.  Where
# other messages of the upload were lost, its last item is asked for again so often, this long apart (s), until it says
# something else.  Not on a good link: who has the ACK has no use for it, and MAVSDK takes it for its next upload's.
CONFIRMATIONS, CONFIRM = 4, 0.4
# A last item that comes twice within this time is a duplicate and gets no ACK again: that would end the next upload, s.
ACK_AGAIN = 0.3
# So many requests for a first item that nobody answers are followed by those of before MISSION_REQUEST_INT.
_OLD_REQUESTS = 4
# After this silence another station may take over; after the longer one the upload is given up, s.
LOCK, UPLOAD_TIMEOUT = 1.0, 8.0

# `current` of an item that is no mission's but a place to fly to now, or a height to take.
_PLACE, _HEIGHT = 2, 3
_GUIDED = (_PLACE, _HEIGHT)
_FLOATS = "the upload came as MISSION_ITEM, whose positions are floats: up to 0.5 m off; MISSION_ITEM_INT is exact"
_FENCE_RETURN = 5000
_ALLOWED = {
    MissionType.FENCE: FENCES | {_FENCE_RETURN},
    MissionType.RALLY: frozenset({int(Command.NAV_RALLY_POINT)}),
}
_NAMES = {MissionType.MISSION: "mission", MissionType.FENCE: "fence", MissionType.RALLY: "rally points"}


@dataclass(frozen=True, slots=True)
class Station:
    """Who sent a message: where it came from, and the system and component that it names."""

    address: Hashable
    system: int
    component: int


@dataclass(frozen=True, slots=True)
class MissionReply:
    """A message of the mission protocol for one station; text: for all of them as well, "" for none."""

    station: Station
    message: Any
    text: str = ""


@dataclass(slots=True)
class _Upload:
    """An upload in progress.

    heard: when it last sent something; first_asked, asked: when the item that is due was first and last asked for, s of
    the caller's clock.  wait: how long to wait for it, s.  repeated: whether any request had to be sent again.
    asked_in_vain: how often the first item was, before any came.  floats: whether items come as MISSION_ITEM.
    """

    station: Station
    count: int
    heard: float
    asked: float
    first_asked: float
    wait: float = RETRY
    repeated: bool = False
    asked_in_vain: int = 0
    floats: bool = False
    items: list[MissionItem] = field(default_factory=list)


@dataclass(slots=True)
class _Finished:
    """An upload that was accepted.

    asked, acknowledged: when its last item was last asked for, and its ACK last sent, s.  left: how often the item may
    still be asked for.
    """

    station: Station
    count: int
    asked: float
    acknowledged: float
    left: int


def _nowhere(_item: MissionItem) -> str:
    return "go-to denied: not in flight"


@dataclass(slots=True)
class MissionServer:
    """Three lists of items and their transfers.

    lists: what the vehicle holds, seq from 0 on; item 0 of a mission may be home.  changed: the lists that an upload
    replaced since the caller last cleared it.  locked: a reason why the mission may not change now, "" if it may.
    go_to: flies to an item's place, at its height, and circles there; latitude and longitude are NaN for where the
    aircraft is.  Returns why it does not, "" if it does.
    """

    lists: dict[MissionType, tuple[MissionItem, ...]] = field(default_factory=lambda: dict.fromkeys(MissionType, ()))
    changed: set[MissionType] = field(default_factory=set)
    locked: str = ""
    go_to: Callable[[MissionItem], str] = _nowhere
    _uploads: dict[MissionType, _Upload] = field(default_factory=dict)
    # Who finished which list last: its final ACK is repeated if its last item comes again.
    _finished: dict[MissionType, _Finished] = field(default_factory=dict)

    def handle(self, message: Any, station: Station, now: float) -> list[MissionReply]:
        """Answer a message of the protocol; any other gets nothing.  ``now``: s, any clock that never goes back."""
        if message.get_type() in _HANDLERS and message.get_type() not in _ITEMS:
            self._moved_on(station)
        try:
            kind = MissionType(getattr(message, "mission_type", 0))
        except ValueError:
            if message.get_type() == "MISSION_CLEAR_ALL" and message.mission_type == mavlink.MAV_MISSION_TYPE_ALL:
                return self._clear(station, tuple(MissionType), mavlink.MAV_MISSION_TYPE_ALL, now)
            if message.get_type() in _HANDLERS:
                return [self._ack(station, mavlink.MAV_MISSION_UNSUPPORTED, int(message.mission_type))]
            return []
        handler = _HANDLERS.get(message.get_type())
        return handler(self, message, station, kind, now) if handler else []

    def tick(self, now: float) -> list[MissionReply]:
        """Ask again for what did not come, or may not have arrived; give up uploads that have gone silent."""
        replies = []
        for kind, upload in list(self._uploads.items()):
            if now - upload.heard > UPLOAD_TIMEOUT:
                del self._uploads[kind]
                text = (
                    f"{_NAMES[kind]} upload given up after item {len(upload.items)} of {upload.count}; nothing changed"
                )
                replies.append(self._ack(upload.station, mavlink.MAV_MISSION_OPERATION_CANCELLED, kind, text))
            elif now - upload.asked >= upload.wait:
                upload.wait = min(2.0 * upload.wait, SLOWEST_RETRY)
                upload.repeated = True
                upload.asked_in_vain += not upload.items
                replies.append(self._request(upload, kind, now))
        for kind, done in self._finished.items():
            if done.left > 0 and now - done.asked >= CONFIRM:
                done.left -= 1
                done.asked = now
                replies.append(_request(done.station, done.count - 1, kind))
        return replies

    def _count(self, message: Any, station: Station, kind: MissionType, now: float) -> list[MissionReply]:
        count = int(message.count)
        refusal = self._refusal(station, kind, now)
        if refusal:
            return [self._ack(station, mavlink.MAV_MISSION_DENIED, kind, refusal)]
        if count > MAX_UPLOADED:
            text = f"{count} items: at most {MAX_UPLOADED} are stored"
            return [self._ack(station, mavlink.MAV_MISSION_NO_SPACE, kind, text)]
        self._drop_other_uploads(station)
        if count == 0:
            return self._clear(station, (kind,), kind, now)
        # A count always starts anew: a station that starts over with as many items must not have them mixed.
        upload = self._uploads[kind] = _Upload(station, count, now, now, now)
        self._finished.pop(kind, None)
        return [self._request(upload, kind, now)]

    def _guided(self, message: Any, station: Station, kind: MissionType) -> MissionReply:
        try:
            item = from_message(message, "go-to")
        except MissionError as error:
            return self._ack(station, mavlink.MAV_MISSION_INVALID, kind, str(error))
        if message.current != _PLACE:
            item = replace(item, lat_deg=math.nan, lon_deg=math.nan)
        problem = self.go_to(item)
        result = mavlink.MAV_MISSION_DENIED if problem else mavlink.MAV_MISSION_ACCEPTED
        return self._ack(station, result, kind, problem)

    def _item(self, message: Any, station: Station, kind: MissionType, now: float) -> list[MissionReply]:
        upload = self._uploads.get(kind)
        if message.current in _GUIDED and (upload is None or upload.station != station):
            return [self._guided(message, station, kind)]
        if upload is None or upload.station != station:
            done = self._finished.get(kind)
            known = done is not None and (done.station, done.count) == (station, message.seq + 1)
            if done is not None and known and now - done.acknowledged >= ACK_AGAIN:
                # Its last item again: the ACK was lost.
                done.acknowledged = now
                return [self._ack(station, mavlink.MAV_MISSION_ACCEPTED, kind)]
            return []
        upload.heard = now
        if message.seq != len(upload.items):
            # A duplicate, or one that was overtaken; what is missing is asked for again in time.
            return []
        try:
            item = from_message(message, _NAMES[kind])
        except MissionError as error:
            return [self._fail(upload, kind, _result_of(message), str(error))]
        wrong = _misplaced(item, kind)
        if wrong:
            return [self._fail(upload, kind, mavlink.MAV_MISSION_UNSUPPORTED, wrong)]
        upload.items.append(item)
        upload.floats = message.get_type() == "MISSION_ITEM"
        upload.wait = min(max(RETRY, 1.5 * (now - upload.first_asked)), SLOWEST_RETRY)
        upload.first_asked = now
        if len(upload.items) < upload.count:
            return [self._request(upload, kind, now)]
        del self._uploads[kind]
        self.lists[kind] = tuple(upload.items)
        self.changed.add(kind)
        self._finished[kind] = _Finished(station, upload.count, now, now, CONFIRMATIONS if upload.repeated else 0)
        floats = message.get_type() == "MISSION_ITEM"
        return [self._ack(station, mavlink.MAV_MISSION_ACCEPTED, kind, _FLOATS if floats else "")]

    def _list(self, _message: Any, station: Station, kind: MissionType, _now: float) -> list[MissionReply]:
        count = len(self.lists[kind])
        return [
            MissionReply(
                station, mavlink.MAVLink_mission_count_message(station.system, station.component, count, int(kind))
            )
        ]

    def _wanted(self, message: Any, station: Station, kind: MissionType, _now: float) -> list[MissionReply]:
        items = self.lists[kind]
        if not message.seq < len(items):
            return [self._ack(station, mavlink.MAV_MISSION_INVALID_SEQUENCE, kind)]
        item = to_message(
            items[message.seq],
            target_system=station.system,
            target_component=station.component,
            seq=message.seq,
            mission_type=kind,
        )
        return [MissionReply(station, item)]

    def _clear_one(self, message: Any, station: Station, kind: MissionType, now: float) -> list[MissionReply]:
        return self._clear(station, (kind,), kind, now)

    def _clear(self, station: Station, kinds: tuple[MissionType, ...], named: int, now: float) -> list[MissionReply]:
        for kind in kinds:
            refusal = self._refusal(station, kind, now)
            if refusal:
                return [self._ack(station, mavlink.MAV_MISSION_DENIED, named, refusal)]
        for kind in kinds:
            self._uploads.pop(kind, None)
            self._finished.pop(kind, None)
            if self.lists[kind]:
                self.lists[kind] = ()
                self.changed.add(kind)
        return [self._ack(station, mavlink.MAV_MISSION_ACCEPTED, named)]

    def _stopped(self, message: Any, station: Station, kind: MissionType, now: float) -> list[MissionReply]:
        """Let a station that gives up (MISSION_ACK with an error) free the lock."""
        upload = self._uploads.get(kind)
        if upload is None or upload.station != station or message.type == mavlink.MAV_MISSION_ACCEPTED:
            return []
        if message.type == mavlink.MAV_MISSION_UNSUPPORTED and upload.asked_in_vain >= _OLD_REQUESTS:
            # It knows MISSION_REQUEST_INT alone, and did not get those.
            upload.asked_in_vain = 0
            return [self._request(upload, kind, now)]
        del self._uploads[kind]
        return []

    def _moved_on(self, station: Station) -> None:
        """Ask a station that speaks of something else for nothing that is finished."""
        for done in self._finished.values():
            if done.station == station:
                done.left = 0

    def _refusal(self, station: Station, kind: MissionType, now: float) -> str:
        if self.locked and kind == MissionType.MISSION:
            return self.locked
        for upload in self._uploads.values():
            if upload.station != station and now - upload.heard <= LOCK:
                return f"another station (system {upload.station.system}) is uploading"
        return ""

    def _drop_other_uploads(self, station: Station) -> None:
        """Forget the uploads of other stations, which have gone silent, when one takes the lock."""
        self._uploads = {kind: upload for kind, upload in self._uploads.items() if upload.station == station}

    def _request(self, upload: _Upload, kind: MissionType, now: float) -> MissionReply:
        upload.asked = now
        if upload.asked_in_vain >= _OLD_REQUESTS or upload.floats:
            return _request(upload.station, len(upload.items), kind, mavlink.MAVLink_mission_request_message)
        return _request(upload.station, len(upload.items), kind)

    def _fail(self, upload: _Upload, kind: MissionType, result: int, text: str) -> MissionReply:
        del self._uploads[kind]
        return self._ack(upload.station, result, kind, f"{text}; nothing changed")

    def _ack(self, station: Station, result: int, kind: int, text: str = "") -> MissionReply:
        message = mavlink.MAVLink_mission_ack_message(station.system, station.component, result, int(kind))
        return MissionReply(station, message, text)


def _request(
    station: Station, seq: int, kind: MissionType, form: Any = mavlink.MAVLink_mission_request_int_message
) -> MissionReply:
    return MissionReply(station, form(station.system, station.component, seq, int(kind)))


def _misplaced(item: MissionItem, kind: MissionType) -> str:
    """Why an item does not belong into a list; "" if it does."""
    fits = item.command in _ALLOWED[kind] if kind in _ALLOWED else item.command not in _ALLOWED[MissionType.FENCE]
    return "" if fits else f"{_NAMES[kind]}: item {item.seq}: command {item.command} does not belong there"


def _result_of(message: Any) -> int:
    """MAV_MISSION_RESULT for an item that `from_message` refused: which number it was about."""
    degree = 1.0 if message.get_type() == "MISSION_ITEM" else 1e7
    if abs(message.x) > 90.0 * degree:
        return int(mavlink.MAV_MISSION_INVALID_PARAM5_X)
    if abs(message.y) > 180.0 * degree:
        return int(mavlink.MAV_MISSION_INVALID_PARAM6_Y)
    return int(mavlink.MAV_MISSION_INVALID)


_ITEMS = ("MISSION_ITEM_INT", "MISSION_ITEM")
_HANDLERS = {
    "MISSION_COUNT": MissionServer._count,
    "MISSION_ITEM_INT": MissionServer._item,
    "MISSION_ITEM": MissionServer._item,
    "MISSION_REQUEST_LIST": MissionServer._list,
    "MISSION_REQUEST_INT": MissionServer._wanted,
    "MISSION_REQUEST": MissionServer._wanted,
    "MISSION_CLEAR_ALL": MissionServer._clear_one,
    "MISSION_ACK": MissionServer._stopped,
}
