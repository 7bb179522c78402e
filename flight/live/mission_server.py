"""Implement the vehicle's side of the MAVLink mission protocol.

This is a state machine without a socket and without a clock.

A mission, a fence and rally points are each accepted whole or not at all: an upload is collected next to the current
list and replaces it only when its last item has arrived and every item is valid. One station uploads at a time;
another station is denied until the first has been silent for `LOCK_TIMEOUT_S` (mavlink.io, "Mission Protocol").
pymavlink has the messages and a station's lists (`mavwp`), but not the vehicle's side.
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
    renumber_items,
    round_to_grid,
)
from world.errors import MissionError

# ----------------------------------------------------------------------
# Mission items as messages: create and parse MISSION_ITEM_INT, parse MISSION_ITEM (MAVLink mission protocol).
#
# Only the INT form is created: the float MISSION_ITEM moves a waypoint by up to 0.5 m. pymavlink is imported when a
# message is created, so that reading files does not wait for it.

_INT32_MAX = 2**31 - 1


class MissionType(IntEnum):
    """MAV_MISSION_TYPE: the list of the vehicle to which an item belongs."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


def item_type(item: MissionItem) -> MissionType:
    """Return the list to which an item belongs, judged by its command."""
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
    """Convert an item to a MISSION_ITEM_INT message; latitude and longitude are rounded to 1e-7 degrees.

    target_system, target_component: MAVLink ids of the receiver.
    current: True for the item that is flown now.
    seq: number of the item in the message; None for the item's own number.
    mission_type: list that the item belongs to; None to judge it by the item's command.

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
    """Convert a MISSION_ITEM_INT or MISSION_ITEM message to an item.

    source: name of the sender in messages.

    INT32_MAX in an integer x or y means "unset" in MAVLink, and becomes NaN. A latitude or longitude that is a float is
    rounded to 1e-7 degrees. Raises MissionError with one line that names item, field, value, and allowed values.
    """
    command, frame = int(message.command), int(message.frame)
    has_coordinates = is_located(command, frame)
    if message.get_type() == "MISSION_ITEM":
        lat, lon = (round_to_grid(value) if has_coordinates else value + 0.0 for value in (message.x, message.y))
    else:
        scale = 1e7 if has_coordinates else 1.0
        lat, lon = (math.nan if value == _INT32_MAX else value / scale for value in (message.x, message.y))
    params = tuple(float(value) for value in (message.param1, message.param2, message.param3, message.param4))
    p1, p2, p3, p4 = (value + 0.0 for value in params)
    item = MissionItem(
        int(message.seq), command, frame, (p1, p2, p3, p4), lat, lon, float(message.z), bool(message.autocontinue)
    )
    for name, value in (*zip(("p1", "p2", "p3", "p4"), params, strict=True), ("altitude", item.alt)):
        if math.isinf(value):
            problem = ItemProblem(name, value, "a finite number, or NaN for unset")
            raise MissionError(**problem.error_arguments(source, f"{source}: item {item.seq}"))
    item_fault = item_problem(item)
    if item_fault is not None:
        raise MissionError(**item_fault.error_arguments(source, f"{source}: item {item.seq}"))
    return item


# ----------------------------------------------------------------------
# Conversion between the stations' numbers and the flown mission: home, seq and jumps.


def uploaded_mission(lists: dict[MissionType, tuple[MissionItem, ...]], vehicle_home: Home) -> tuple[Mission, int]:
    """Return the mission in uploaded lists, and the offset from its item numbers to the stations' numbers.

    vehicle_home: the vehicle's home, for a mission without home.

    As in ArduPilot, item 0 is home if it is a waypoint with an altitude above mean sea level or without parameters. The
    offset is then 0. The `mission` plugin of MAVSDK sends no home: its item 0 is a waypoint with a height above home
    and a radius. The offset is then -1, because the mission's items are numbered from 1.
    """
    items = lists[MissionType.MISSION]
    home = vehicle_home
    home_item = items[0] if items else None
    if (
        home_item is not None
        and home_item.command == Command.NAV_WAYPOINT
        and is_located(home_item.command, home_item.frame)
        and (home_item.frame in AMSL or not any(home_item.params))
    ):
        home = Home(home_item.lat_deg, home_item.lon_deg, home_item.alt) if home_item.has_position else vehicle_home
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
    return renumber_items(mission), shift


def mission_lists(mission: Mission) -> tuple[tuple[MissionItem, ...], ...]:
    """Return a mission's lists of items, fences and rally points as stations number them, from 0.

    Home is item 0. Jumps lead to the new numbers; a jump to a missing item leads to number 65535.

    >>> place = MissionItem(4, 16, 0, (0.0,) * 4, 46.0, 8.0, 75.0)
    >>> items, fences, rally = mission_lists(Mission(Home(46.0, 8.0, 0.0), (place, replace(place, seq=7))))
    >>> [item.seq for item in items], fences, rally
    ([0, 1, 2], (), ())
    """
    home = mission.home
    home_item = MissionItem(0, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, 0.0, 0.0, 0.0)
    if home is not None:
        home_item = replace(home_item, lat_deg=home.lat_deg, lon_deg=home.lon_deg, alt=home.alt)
    number_by_seq = {item.seq: number for number, item in enumerate(mission.items, 1)}
    items = [home_item]
    for item in mission.items:
        params = item.params
        if item.command == Command.DO_JUMP:
            params = (float(number_by_seq.get(int(params[0]), 65535)), *params[1:])
        items.append(replace(item, seq=number_by_seq[item.seq], params=params))
    return (
        tuple(items),
        tuple(replace(item, seq=number) for number, item in enumerate(mission.fences)),
        tuple(replace(item, seq=number) for number, item in enumerate(mission.rally)),
    )


def start_problem(mission: Mission, first_seq: int, *, in_flight: bool = False) -> str:
    """Return the reason why a mission cannot be flown from an item on, or "" if it can.

    first_seq: number (seq) of the item.
    in_flight: True if the first leg will be the leg from the aircraft to the item.

    >>> place = MissionItem(1, 16, 0, (0.0,) * 4, 46.0, 8.0, 75.0)
    >>> mission = Mission(None, (place, replace(place, seq=2), replace(place, seq=3)))
    >>> start_problem(mission, 2), start_problem(mission, 3)
    ('', 'the mission has no leg after this item')
    """
    if not mission.items or not 0 <= first_seq <= mission.items[-1].seq:
        return "the mission has no such item"
    positions = [item for item in mission.items if item.seq >= first_seq and item.has_position]
    min_position_count = 1 if in_flight else 2
    return (
        ""
        if first_seq <= mission.items[0].seq or len(positions) >= min_position_count
        else "the mission has no leg after this item"
    )


def mission_from_item(mission: Mission, first_seq: int) -> Mission:
    """Return the part of a mission from an item on, preceded by the last speed change before the item.

    first_seq: number (seq) of the item. Items keep their numbers.

    >>> place = MissionItem(1, 16, 0, (0.0,) * 4, 46.0, 8.0, 75.0)
    >>> speed = MissionItem(2, 178, 2, (0.0, 22.0, -1.0, 0.0), 0.0, 0.0, 0.0)
    >>> mission = Mission(None, (place, speed, replace(place, seq=3), replace(place, seq=4)))
    >>> [item.seq for item in mission_from_item(mission, 4).items], mission_from_item(mission, 1) == mission
    ([2, 4], True)
    """
    earlier_items = [item for item in mission.items if item.seq < first_seq]
    speed_items = [item for item in earlier_items if item.command == Command.DO_CHANGE_SPEED][-1:]
    return replace(mission, items=(*speed_items, *(item for item in mission.items if item.seq >= first_seq)))


# Maximum number of items of an upload: limits the memory that a station can use to about 2 MB per list.
MAX_UPLOADED_ITEMS = 5_000
# Minimum time before a request is repeated, s. The first repetition comes after 1.5 times the time that the last item
# took, and each further one after twice the previous time, up to `MAX_RETRY_PERIOD_S`. Faster repetition could make a
# slow station give up: MAVSDK gives up at the sixth request for an item.
MIN_RETRY_PERIOD_S = 0.05
# Maximum time before a request is repeated, s.
MAX_RETRY_PERIOD_S = 0.4
# Number of extra requests for an upload's last item. The last ACK may be lost while the station waits for it, as MAVSDK
# does for five times 0.5 s. If other messages of the upload were lost, the last item is therefore requested again until
# the station sends another message. On a good link the item is not requested again, because MAVSDK would take the
# second ACK for the ACK of its next upload.
CONFIRMATION_COUNT = 4
# Interval of these requests, s.
CONFIRMATION_PERIOD_S = 0.4
# Time within which a repeated last item is a duplicate, s: it gets no second ACK, which would end the next upload.
DUPLICATE_ITEM_TIME_S = 0.3
# Number of unanswered requests for a first item before MISSION_REQUEST replaces MISSION_REQUEST_INT.
_INT_REQUEST_ATTEMPTS = 4
# Silence of a station after which another one may upload, s.
LOCK_TIMEOUT_S = 1.0
# Silence after which an upload is abandoned, s.
UPLOAD_TIMEOUT_S = 8.0

# `current` of an item with a position to fly to now.
_GO_TO_POSITION = 2
# `current` of an item with an altitude to fly at now.
_GO_TO_ALTITUDE = 3
_GO_TO_VALUES = (_GO_TO_POSITION, _GO_TO_ALTITUDE)
_FLOAT_WARNING = "the upload came as MISSION_ITEM, whose float positions are up to 0.5 m off; MISSION_ITEM_INT is exact"
_FENCE_RETURN = 5000
_ALLOWED_COMMANDS = {
    MissionType.FENCE: FENCES | {_FENCE_RETURN},
    MissionType.RALLY: frozenset({int(Command.NAV_RALLY_POINT)}),
}
_TITLES = {MissionType.MISSION: "mission", MissionType.FENCE: "fence", MissionType.RALLY: "rally points"}


@dataclass(frozen=True, slots=True)
class Station:
    """Sender of a message: its address, and the system and component in the message."""

    address: Hashable
    system: int
    component: int


@dataclass(frozen=True, slots=True)
class MissionReply:
    """A message of the mission protocol for one station; text: for all stations, "" for no text."""

    station: Station
    message: Any
    text: str = ""


@dataclass(slots=True)
class _Upload:
    """An upload in progress.

    last_message_time: s of the caller's clock.
    last_request_time, first_request_time: times of the last and first request for the current item, s of that clock.
    wait: time until the next request, s.
    was_repeated: True if any request was repeated.
    unanswered_count: number of requests for the first item before it arrived.
    has_floats: True if items arrive as MISSION_ITEM.
    """

    station: Station
    count: int
    last_message_time: float
    last_request_time: float
    first_request_time: float
    wait: float = MIN_RETRY_PERIOD_S
    was_repeated: bool = False
    unanswered_count: int = 0
    has_floats: bool = False
    items: list[MissionItem] = field(default_factory=list)


@dataclass(slots=True)
class _FinishedUpload:
    """An upload that was accepted.

    last_request_time: time of the last request for the upload's last item, s.
    last_ack_time: time of the last ACK, s.
    remaining_count: number of remaining requests for that item.
    """

    station: Station
    count: int
    last_request_time: float
    last_ack_time: float
    remaining_count: int


@dataclass(slots=True)
class MissionServer:
    """Server for uploads and downloads of the vehicle's lists of items: mission, fence and rally points.

    lists: the vehicle's items, seq from 0 on; item 0 of a mission may be home.
    changed: lists that an upload replaced since the caller last cleared this set.
    locked: reason why the mission must not change now, or "".
    go_to: function that flies to an item's position and altitude, and loiters there; latitude and longitude are NaN
        for the aircraft's position. It returns the reason for a refusal, or "".
    """

    lists: dict[MissionType, tuple[MissionItem, ...]] = field(default_factory=lambda: dict.fromkeys(MissionType, ()))
    changed: set[MissionType] = field(default_factory=set)
    locked: str = ""
    go_to: Callable[[MissionItem], str] = lambda item: "go-to denied: not in flight"
    _uploads: dict[MissionType, _Upload] = field(default_factory=dict)
    # Station of the last finished upload of each list: its final ACK is repeated if its last item arrives again.
    _finished: dict[MissionType, _FinishedUpload] = field(default_factory=dict)

    def handle(self, message: Any, station: Station, now: float) -> list[MissionReply]:
        """Return the replies to a message of the protocol; other messages get no reply.

        now: time of any clock that never goes back, s.
        """
        if message.get_type() in _HANDLERS and message.get_type() not in _ITEM_MESSAGES:
            # A station that sends other messages needs no last items again.
            for finished in self._finished.values():
                if finished.station == station:
                    finished.remaining_count = 0
        try:
            mission_type = MissionType(getattr(message, "mission_type", 0))
        except ValueError:
            if message.get_type() == "MISSION_CLEAR_ALL" and message.mission_type == mavlink.MAV_MISSION_TYPE_ALL:
                return self._clear_lists(station, tuple(MissionType), mavlink.MAV_MISSION_TYPE_ALL, now)
            if message.get_type() in _HANDLERS:
                return [self._ack(station, mavlink.MAV_MISSION_UNSUPPORTED, int(message.mission_type))]
            return []
        handler = _HANDLERS.get(message.get_type())
        return handler(self, message, station, mission_type, now) if handler else []

    def tick(self, now: float) -> list[MissionReply]:
        """Return the messages that are due: repeated requests for items, and the end of abandoned uploads.

        now: time of the clock that `handle` uses, s.
        """
        replies = []
        for mission_type, upload in list(self._uploads.items()):
            if now - upload.last_message_time > UPLOAD_TIMEOUT_S:
                del self._uploads[mission_type]
                title, received_count = _TITLES[mission_type], len(upload.items)
                text = f"{title} upload abandoned after item {received_count} of {upload.count}; no change"
                replies.append(self._ack(upload.station, mavlink.MAV_MISSION_OPERATION_CANCELLED, mission_type, text))
            elif now - upload.last_request_time >= upload.wait:
                upload.wait = min(2.0 * upload.wait, MAX_RETRY_PERIOD_S)
                upload.was_repeated = True
                upload.unanswered_count += not upload.items
                replies.append(self._request_next_item(upload, mission_type, now))
        for mission_type, finished in self._finished.items():
            if finished.remaining_count > 0 and now - finished.last_request_time >= CONFIRMATION_PERIOD_S:
                finished.remaining_count -= 1
                finished.last_request_time = now
                replies.append(_item_request(finished.station, finished.count - 1, mission_type))
        return replies

    def _start_upload(
        self, message: Any, station: Station, mission_type: MissionType, now: float
    ) -> list[MissionReply]:
        """Start an upload and request its first item (MISSION_COUNT); a count of 0 clears the list."""
        count = int(message.count)
        refusal = self._upload_refusal(station, mission_type, now)
        if refusal:
            return [self._ack(station, mavlink.MAV_MISSION_DENIED, mission_type, refusal)]
        if count > MAX_UPLOADED_ITEMS:
            text = f"{count} items: at most {MAX_UPLOADED_ITEMS} are stored"
            return [self._ack(station, mavlink.MAV_MISSION_NO_SPACE, mission_type, text)]
        # The uploads of other, silent stations are dropped.
        self._uploads = {
            mission_type: upload for mission_type, upload in self._uploads.items() if upload.station == station
        }
        if count == 0:
            return self._clear_lists(station, (mission_type,), mission_type, now)
        # MISSION_COUNT always begins a new upload: a station that starts over with the same count must not have its
        # items mixed.
        upload = self._uploads[mission_type] = _Upload(station, count, now, now, now)
        self._finished.pop(mission_type, None)
        return [self._request_next_item(upload, mission_type, now)]

    def _receive_item(
        self, message: Any, station: Station, mission_type: MissionType, now: float
    ) -> list[MissionReply]:
        """Store an item of an upload; request the next item, or replace the list after the last item.

        message: MISSION_ITEM_INT or MISSION_ITEM.
        mission_type: list to which the item belongs.

        Without an upload, an item is a command to fly to its position, or a repeated last item, which is acknowledged
        again.
        """
        upload = self._uploads.get(mission_type)
        if message.current in _GO_TO_VALUES and (upload is None or upload.station != station):
            # Fly to the position or altitude of an item that a station sends outside an upload.
            try:
                item = from_message(message, "go-to")
            except MissionError as error:
                return [self._ack(station, mavlink.MAV_MISSION_INVALID, mission_type, str(error))]
            if message.current != _GO_TO_POSITION:
                item = replace(item, lat_deg=math.nan, lon_deg=math.nan)
            problem = self.go_to(item)
            result = mavlink.MAV_MISSION_DENIED if problem else mavlink.MAV_MISSION_ACCEPTED
            return [self._ack(station, result, mission_type, problem)]
        if upload is None or upload.station != station:
            finished = self._finished.get(mission_type)
            is_last_item = finished is not None and (finished.station, finished.count) == (station, message.seq + 1)
            if finished is not None and is_last_item and now - finished.last_ack_time >= DUPLICATE_ITEM_TIME_S:
                # The station repeats its last item, because the ACK was lost.
                finished.last_ack_time = now
                return [self._ack(station, mavlink.MAV_MISSION_ACCEPTED, mission_type)]
            return []
        upload.last_message_time = now
        if message.seq != len(upload.items):
            # A duplicate, or an item out of order; the missing one is requested again in time.
            return []
        try:
            item = from_message(message, _TITLES[mission_type])
        except MissionError as error:
            # The result names an invalid latitude, an invalid longitude, or any other fault.
            degree_scale = 1.0 if message.get_type() == "MISSION_ITEM" else 1e7
            result = mavlink.MAV_MISSION_INVALID
            if abs(message.x) > 90.0 * degree_scale:
                result = mavlink.MAV_MISSION_INVALID_PARAM5_X
            elif abs(message.y) > 180.0 * degree_scale:
                result = mavlink.MAV_MISSION_INVALID_PARAM6_Y
            return [self._reject_upload(upload, mission_type, int(result), str(error))]
        is_allowed = (
            item.command in _ALLOWED_COMMANDS[mission_type]
            if mission_type in _ALLOWED_COMMANDS
            else item.command not in _ALLOWED_COMMANDS[MissionType.FENCE]
        )
        placement_problem = (
            ""
            if is_allowed
            else f"{_TITLES[mission_type]}: item {item.seq}: command {item.command} does not belong there"
        )
        if placement_problem:
            return [self._reject_upload(upload, mission_type, mavlink.MAV_MISSION_UNSUPPORTED, placement_problem)]
        upload.items.append(item)
        upload.has_floats = message.get_type() == "MISSION_ITEM"
        upload.wait = min(max(MIN_RETRY_PERIOD_S, 1.5 * (now - upload.first_request_time)), MAX_RETRY_PERIOD_S)
        upload.first_request_time = now
        if len(upload.items) < upload.count:
            return [self._request_next_item(upload, mission_type, now)]
        del self._uploads[mission_type]
        self.lists[mission_type] = tuple(upload.items)
        self.changed.add(mission_type)
        self._finished[mission_type] = _FinishedUpload(
            station, upload.count, now, now, CONFIRMATION_COUNT if upload.was_repeated else 0
        )
        is_float = message.get_type() == "MISSION_ITEM"
        return [self._ack(station, mavlink.MAV_MISSION_ACCEPTED, mission_type, _FLOAT_WARNING if is_float else "")]

    def _item_count_reply(
        self, _message: Any, station: Station, mission_type: MissionType, _now: float
    ) -> list[MissionReply]:
        """Return the number of items of a list, the answer to MISSION_REQUEST_LIST."""
        count = len(self.lists[mission_type])
        return [
            MissionReply(
                station,
                mavlink.MAVLink_mission_count_message(station.system, station.component, count, int(mission_type)),
            )
        ]

    def _item_reply(self, message: Any, station: Station, mission_type: MissionType, _now: float) -> list[MissionReply]:
        """Return an item of a list, the answer to MISSION_REQUEST_INT or MISSION_REQUEST."""
        items = self.lists[mission_type]
        if not message.seq < len(items):
            return [self._ack(station, mavlink.MAV_MISSION_INVALID_SEQUENCE, mission_type)]
        item = to_message(
            items[message.seq],
            target_system=station.system,
            target_component=station.component,
            seq=message.seq,
            mission_type=mission_type,
        )
        return [MissionReply(station, item)]

    def _clear_lists(
        self, station: Station, mission_types: tuple[MissionType, ...], acknowledged_type: int, now: float
    ) -> list[MissionReply]:
        """Clear lists and acknowledge it; clear no list if one of them must not change now.

        acknowledged_type: MAV_MISSION_TYPE that the acknowledgement states.
        """
        for mission_type in mission_types:
            refusal = self._upload_refusal(station, mission_type, now)
            if refusal:
                return [self._ack(station, mavlink.MAV_MISSION_DENIED, acknowledged_type, refusal)]
        for mission_type in mission_types:
            self._uploads.pop(mission_type, None)
            self._finished.pop(mission_type, None)
            if self.lists[mission_type]:
                self.lists[mission_type] = ()
                self.changed.add(mission_type)
        return [self._ack(station, mavlink.MAV_MISSION_ACCEPTED, acknowledged_type)]

    def _cancel_upload(
        self, message: Any, station: Station, mission_type: MissionType, now: float
    ) -> list[MissionReply]:
        """Discard the upload of a station that cancels it (MISSION_ACK with an error).

        After some unanswered requests the vehicle sends MISSION_REQUEST instead of MISSION_REQUEST_INT. A station that
        refuses MISSION_REQUEST as unsupported gets MISSION_REQUEST_INT again.
        """
        upload = self._uploads.get(mission_type)
        if upload is None or upload.station != station or message.type == mavlink.MAV_MISSION_ACCEPTED:
            return []
        if message.type == mavlink.MAV_MISSION_UNSUPPORTED and upload.unanswered_count >= _INT_REQUEST_ATTEMPTS:
            # The station accepts only MISSION_REQUEST_INT, and did not receive the earlier requests.
            upload.unanswered_count = 0
            return [self._request_next_item(upload, mission_type, now)]
        del self._uploads[mission_type]
        return []

    def _upload_refusal(self, station: Station, mission_type: MissionType, now: float) -> str:
        """Return the reason why a station must not change a list now, or "" if it may."""
        if self.locked and mission_type == MissionType.MISSION:
            return self.locked
        for upload in self._uploads.values():
            if upload.station != station and now - upload.last_message_time <= LOCK_TIMEOUT_S:
                return f"another station (system {upload.station.system}) is uploading"
        return ""

    def _request_next_item(self, upload: _Upload, mission_type: MissionType, now: float) -> MissionReply:
        """Return the request for the next item of an upload."""
        upload.last_request_time = now
        if upload.unanswered_count >= _INT_REQUEST_ATTEMPTS or upload.has_floats:
            return _item_request(
                upload.station, len(upload.items), mission_type, mavlink.MAVLink_mission_request_message
            )
        return _item_request(upload.station, len(upload.items), mission_type)

    def _reject_upload(self, upload: _Upload, mission_type: MissionType, result: int, text: str) -> MissionReply:
        """Discard an upload, and return the ACK with a MAV_MISSION_RESULT and the reason."""
        del self._uploads[mission_type]
        return self._ack(upload.station, result, mission_type, f"{text}; nothing changed")

    def _ack(self, station: Station, result: int, mission_type: int, text: str = "") -> MissionReply:
        """Return a MISSION_ACK for a station, with a text for all stations.

        result: MAV_MISSION_RESULT.
        mission_type: MAV_MISSION_TYPE that the message states.
        """
        message = mavlink.MAVLink_mission_ack_message(station.system, station.component, result, int(mission_type))
        return MissionReply(station, message, text)


def _item_request(
    station: Station,
    seq: int,
    mission_type: MissionType,
    message_class: Any = mavlink.MAVLink_mission_request_int_message,
) -> MissionReply:
    """Return the request for an item of an upload.

    seq: number of the item.
    message_class: class of the request, MISSION_REQUEST_INT or MISSION_REQUEST.
    """
    return MissionReply(station, message_class(station.system, station.component, seq, int(mission_type)))


_ITEM_MESSAGES = ("MISSION_ITEM_INT", "MISSION_ITEM")
_HANDLERS = {
    "MISSION_COUNT": MissionServer._start_upload,
    "MISSION_ITEM_INT": MissionServer._receive_item,
    "MISSION_ITEM": MissionServer._receive_item,
    "MISSION_REQUEST_LIST": MissionServer._item_count_reply,
    "MISSION_REQUEST_INT": MissionServer._item_reply,
    "MISSION_REQUEST": MissionServer._item_reply,
    "MISSION_CLEAR_ALL": lambda server, _message, station, mission_type, now: server._clear_lists(
        station, (mission_type,), mission_type, now
    ),
    "MISSION_ACK": MissionServer._cancel_upload,
}
