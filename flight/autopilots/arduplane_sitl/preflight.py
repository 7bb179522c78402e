"""What an autopilot is told before it flies, in order, while the physics holds the aircraft on its rail.

A conversation is a generator: each time it is resumed a little more of the autopilot's time has passed, and it takes
what has been told meanwhile.
"""

import math
import time
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.arduplane_sitl.link import AutopilotLink
from flight.live.mission_server import MissionType, to_message
from flight.mission.items import Command, Frame, Home, MissionItem, command_name, on_grid
from flight.mission.itinerary import loiter_of
from flight.mission.route import Route
from flight.simulation.setup import FlightSetup
from world.errors import FlightError
from world.frames import GeoOrigin, to_geo

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# The mission that an autopilot is given to fly: the items that the route is made of, and one place more.
#
# What a flight from air to air cannot hold is made a waypoint where the route has it: a take-off, a landing.  A place
# more, 1 km straight on after the last, keeps the autopilot on its course to the route's end: it takes a waypoint as
# reached a radius early, and returns to launch after the last.  A mission that ends with a return to launch has that at
# its end, and its rally points go with it; one that ends with a loiter without end has that, of which the flight's own
# clock counts a minute.


# From the end of the route to the place more, m.
STRAIGHT_ON = 1000.0
# Home stands this far (m) below the start where the mission has none, and where its own is nearer than `_NEAR` (m) to
# the start's height: within 10 m of home ArduPlane holds the throttle back, as before a take-off.
_BELOW, _NEAR = 100.0, 15.0
_KEPT = (Command.DO_JUMP, Command.DO_CHANGE_SPEED)


@dataclass(frozen=True, slots=True)
class UploadedMission:
    """What goes to the autopilot.

    home: its home; alt is AMSL.
    items: numbered from 1; the last is the place more, a return to launch, or a loiter without end.
    rally: the points that a return may go to, numbered from 0; none without a return.
    """

    home: Home
    items: tuple[MissionItem, ...]
    rally: tuple[MissionItem, ...] = ()


def uploaded_mission(setup: FlightSetup) -> UploadedMission:
    """The mission of a setup as the autopilot gets it, all heights above mean sea level but those of rally points."""
    route, origin = setup.route, setup.scenario.origin
    kept: list[MissionItem] = []
    for item in setup.mission.items:
        rows = np.flatnonzero(route.items == item.seq)
        if item.command == Command.NAV_RETURN_TO_LAUNCH:
            kept += [item] if rows.size else []
        elif rows.size:
            kept.append(_place(item, route, rows, origin, kept))
        elif item.command in _KEPT:
            kept.append(item)
    if not any(item.has_position for item in kept):
        kept = _of_route(route, origin)
    elif route.items[-1] == -1 and kept[-1].command != Command.NAV_LOITER_UNLIM:
        kept.append(_waypoint(kept[-1].seq + 1, route.waypoints[-1], 0.0, origin))
    if route.return_from >= 0 or kept[-1].command == Command.NAV_LOITER_UNLIM:
        return UploadedMission(_home(setup), _renumbered(kept), setup.mission.rally)
    kept.append(_waypoint(kept[-1].seq + 1, _straight_on(route), 0.0, origin))
    return UploadedMission(_home(setup), _renumbered(kept))


def _place(
    item: MissionItem, route: Route, rows: NDArray[np.intp], origin: GeoOrigin, before: list[MissionItem]
) -> MissionItem:
    """A place of the mission: a loiter about its own centre, anything else as a waypoint where the route has it."""
    last = route.waypoints[rows[-1]]
    loiter = loiter_of(item)
    if loiter is None:
        return _waypoint(item.seq, last, float(route.acceptance[rows[-1]]), origin)
    lat, lon = item.lat_deg, item.lon_deg
    if not item.has_position:
        centre = next(place for place in reversed(before) if place.has_position)
        lat, lon = centre.lat_deg, centre.lon_deg
    p1, p2, p3, p4 = (0.0 if math.isnan(value) else value for value in item.params)
    return MissionItem(item.seq, int(item.command), int(Frame.GLOBAL), (p1, p2, p3, p4), lat, lon, float(last[2]))


def _of_route(route: Route, origin: GeoOrigin) -> list[MissionItem]:
    """Items of a route that was made without a mission: its waypoints, and its speeds where they change."""
    items: list[MissionItem] = []
    speed = math.nan
    for k, point in enumerate(route.waypoints):
        items.append(_waypoint(len(items) + 1, point, float(route.acceptance[k]), origin))
        if k < len(route.airspeed) and route.airspeed[k] != speed:
            speed = float(route.airspeed[k])
            change = (0.0, speed, -1.0, 0.0)
            items.append(
                MissionItem(len(items) + 1, int(Command.DO_CHANGE_SPEED), int(Frame.MISSION), change, 0.0, 0.0, 0.0)
            )
    return items


def _waypoint(seq: int, point: Floats, acceptance: float, origin: GeoOrigin) -> MissionItem:
    lat, lon = to_geo(origin, point[0], point[1])
    place = (on_grid(float(lat)), on_grid(float(lon)), float(point[2]))
    return MissionItem(seq, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0, acceptance, 0.0, 0.0), *place)


def _straight_on(route: Route) -> Floats:
    east, north, _ = route.waypoints[-1] - route.waypoints[-2]
    step = STRAIGHT_ON / math.hypot(east, north)
    further: Floats = route.waypoints[-1] + np.array([step * east, step * north, 0.0])
    return further


def _renumbered(kept: list[MissionItem]) -> tuple[MissionItem, ...]:
    """Items numbered from 1, jumps to the first that was kept from their target on."""
    items = []
    for number, item in enumerate(kept, 1):
        params = item.params
        if item.command == Command.DO_JUMP:
            target = next((k for k, other in enumerate(kept, 1) if other.seq >= params[0]), len(kept))
            params = (float(target), *params[1:])
        items.append(replace(item, seq=number, params=params))
    return tuple(items)


def _home(setup: FlightSetup) -> Home:
    """The mission's home, or the start's place; at a height that lets the motor run from the start.

    A return to launch counts its heights from home: there it is the mission's.
    """
    start = setup.route.waypoints[0]
    home = setup.mission.home
    if home is None:
        lat, lon = to_geo(setup.scenario.origin, start[0], start[1])
        home = Home(on_grid(float(lat)), on_grid(float(lon)), math.nan)
    if setup.route.return_to is not None and not math.isnan(home.alt):
        return home
    near = math.isnan(home.alt) or abs(home.alt - start[2]) < _NEAR
    return replace(home, alt=float(start[2]) - _BELOW) if near else home


Talk = Generator[None, None, None]

SYSTEM, COMPONENT = 1, mavlink.MAV_COMP_ID_AUTOPILOT1
# ArduPlane's numbers of its modes.
AUTO = 10
# How long (s of its own time) an autopilot may take: to speak, to know where it is, to answer, to take a mission.
SPEAKS, KNOWS, ANSWERS, TAKES = 30.0, 60.0, 5.0, 30.0
# Asked for again after so long, s.
_AGAIN = 1.0
# Messages take their time by the clock, however fast the autopilot's goes: at least so long is waited, s.
_BY_THE_CLOCK = 0.5
# Parameters that are asked for at a time: ArduPilot keeps no more than some twenty questions.
_AT_ONCE = 10
_EKF_NEEDED = (
    mavlink.ESTIMATOR_ATTITUDE
    | mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_POS_HORIZ_ABS
    | mavlink.ESTIMATOR_POS_VERT_ABS
)
_EKF_LOST = mavlink.ESTIMATOR_CONST_POS_MODE
# Messages that are wanted, and how often, microseconds.
_WANTED = {mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: 200_000, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 100_000}
_RESULTS = {number: entry.name for number, entry in mavlink.enums["MAV_RESULT"].items()}
_MISSION_RESULTS = {number: entry.name for number, entry in mavlink.enums["MAV_MISSION_RESULT"].items()}
# Forces arming: what is checked before a take-off does not hold in the air.
_FORCE = 21196


class _Since:
    """Time since a moment, of the autopilot and by the clock."""

    def __init__(self, now: Callable[[], float], clock: Callable[[], float]) -> None:
        self._now, self._clock = now, clock
        self._moments = now(), clock()

    def longer_than(self, seconds: float) -> bool:
        """Whether more of the autopilot's time has passed, and enough by the clock."""
        began, by_clock = self._moments
        return self._now() - began > seconds and self._clock() - by_clock > min(seconds, _BY_THE_CLOCK)


class _Awaited(NamedTuple):
    """Something that an autopilot has to come to.

    field: its name.  seconds: within so many.  failed: what is said where it does not.
    """

    field: str
    seconds: float
    failed: str


class Preflight:
    """The conversation with one autopilot.

    link: to it.  now: its own time, s.  clock: anybody's, s.
    """

    def __init__(
        self, link: AutopilotLink, now: Callable[[], float], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._link, self._now, self._clock = link, now, clock
        self._news = link.news

    def meet(self, parameters: Iterable[str]) -> Talk:
        """Learn who it is and which of these parameters it has; raises FlightError for what is no ArduPlane."""
        news = self._news
        heard = _Awaited("heartbeat", SPEAKS, "said nothing over MAVLink")
        yield from self._until(lambda: news.vehicle is not None, heard, self._say_hello)
        if news.vehicle != mavlink.MAV_TYPE_FIXED_WING:
            raise FlightError(
                f"is no ArduPlane: its heartbeat says vehicle type {news.vehicle}; 1, a fixed wing, flies",
                field="vehicle type", value=news.vehicle, allowed="1, a fixed wing, flies",
            )  # fmt: skip
        for message, interval in _WANTED.items():
            self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message, interval)
        self._command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        self._command(mavlink.MAV_CMD_DO_SEND_BANNER)
        names = list(parameters)
        for k in range(0, len(names), _AT_ONCE):
            yield from self._ask_for(names[k : k + _AT_ONCE])

    def prepare(self, mission: UploadedMission) -> Talk:
        """Wait until it knows where it is, hand over the mission, and set it on its way in AUTO.

        Raises FlightError where it does not come to know, or refuses.
        """
        news = self._news
        yield from self._until(
            lambda: news.ekf & _EKF_NEEDED == _EKF_NEEDED and not news.ekf & _EKF_LOST,
            _Awaited("EKF", KNOWS, "did not come to know where it is (EKF)"),
            lambda: self._command(
                mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
                mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
                _WANTED[mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT],
            ),
        )
        yield from self._upload([_home_item(mission.home), *mission.items], MissionType.MISSION)
        if mission.rally:
            yield from self._upload(list(mission.rally), MissionType.RALLY)
        yield from self._obeys(Command.DO_SET_HOME, lambda: self._set_home(mission.home), "home")
        yield from self._obeys(
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
            lambda: self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, _FORCE),
            "arming",
        )
        yield from self._obeys(
            Command.DO_SET_MODE,
            lambda: self._command(Command.DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, AUTO),
            "AUTO",
        )
        under_way = _Awaited("AUTO", ANSWERS, "is not in AUTO, armed")
        yield from self._until(lambda: news.mode == AUTO and news.armed, under_way)

    def _until(self, done: Callable[[], bool], awaited: _Awaited, again: Callable[[], None] | None = None) -> Talk:
        """Wait until something holds, asking for it each second; raise FlightError where it does not come to."""
        started, asked = self._since(), None
        while not done():
            if started.longer_than(awaited.seconds):
                message = f"{awaited.failed} within {awaited.seconds:.0f} s{self._last_text()}"
                raise FlightError(message, field=awaited.field)
            if again is not None and (asked is None or asked.longer_than(_AGAIN)):
                asked = self._since()
                again()
            yield

    def _since(self) -> _Since:
        return _Since(self._now, self._clock)

    def _last_text(self) -> str:
        return f"; it last said: {self._news.texts[-1]}" if self._news.texts else ""

    def _say_hello(self) -> None:
        self._link.send(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
            )
        )

    def _command(self, command: int, *params: float) -> None:
        numbers = [float(value) for value in (*params, *(0.0,) * (7 - len(params)))]
        self._link.send(mavlink.MAVLink_command_long_message(SYSTEM, COMPONENT, int(command), 0, *numbers))

    def _set_home(self, home: Home) -> None:
        place = MissionItem(0, int(Command.DO_SET_HOME), int(Frame.GLOBAL), (0.0,) * 4, home.lat_deg, home.lon_deg, 0.0)
        self._link.send(
            mavlink.MAVLink_command_int_message(
                SYSTEM, COMPONENT, int(Frame.GLOBAL), int(Command.DO_SET_HOME), 0, 0,
                0.0, 0.0, 0.0, 0.0, place.x, place.y, home.alt,
            )
        )  # fmt: skip

    def _obeys(self, command: int, ask: Callable[[], None], what: str) -> Talk:
        acknowledged = self._news.acknowledged
        acknowledged.pop(int(command), None)
        yield from self._until(
            lambda: acknowledged.get(int(command)) == mavlink.MAV_RESULT_ACCEPTED,
            _Awaited(what, ANSWERS, f"refused {what} ({command_name(int(command))})"),
            ask,
        )

    def _ask_for(self, names: list[str]) -> Talk:
        """Read parameters; those that it does not have are not answered."""
        for name in names:
            self._link.send(mavlink.MAVLink_param_request_read_message(SYSTEM, COMPONENT, name.encode("ascii"), -1))
        started, known = self._since(), self._news.parameters
        while not (known.keys() >= set(names) or started.longer_than(_AGAIN)):
            yield

    def _upload(self, items: list[MissionItem], kind: MissionType) -> Talk:
        """Hand over a list (MAVLink mission protocol), again while there is no space for it yet."""
        started = self._since()
        what = "mission" if kind == MissionType.MISSION else "rally points"
        while True:
            yield from self._offer(items, kind)
            result = self._news.mission_result
            if result == mavlink.MAV_MISSION_ACCEPTED:
                return
            if result != mavlink.MAV_MISSION_NO_SPACE or started.longer_than(TAKES):
                asked = self._news.requested
                item = (
                    ""
                    if asked is None or asked >= len(items)
                    else (f" at item {asked} ({command_name(items[asked].command)})")
                )
                name = "no answer" if result is None else _MISSION_RESULTS.get(result, str(result))
                message = f"refused the {what}{item}: {name}{self._last_text()}"
                raise FlightError(message, field=what, value=name)
            yield from self._wait(_AGAIN)

    def _offer(self, items: list[MissionItem], kind: MissionType) -> Talk:
        """Count, then each item that is asked for, until the upload is acknowledged or nothing more comes."""
        news, link = self._news, self._link
        news.requested = news.mission_result = None
        link.send(mavlink.MAVLink_mission_count_message(SYSTEM, COMPONENT, len(items), kind))
        last, answered = None, self._since()
        while news.mission_result is None and not answered.longer_than(ANSWERS):
            if news.requested is not None and (news.requested != last or answered.longer_than(_AGAIN)):
                last, answered = news.requested, self._since()
                if last < len(items):
                    link.send(to_message(items[last], target_component=COMPONENT, seq=last))
            yield

    def _wait(self, seconds: float) -> Talk:
        began = self._now()
        while self._now() - began < seconds:
            yield


def _home_item(home: Home) -> MissionItem:
    return MissionItem(
        0, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, home.lat_deg, home.lon_deg, home.alt
    )


def version_text(texts: list[str], number: int | None) -> str:
    """What an autopilot calls itself: of its messages the one with its name, else of its version's number.

    >>> version_text(["Initialising", "ArduPlane V4.6.0-dev (0123abcd)"], None)
    'ArduPlane V4.6.0-dev (0123abcd)'
    >>> version_text([], 0x040503FF)
    'ArduPlane 4.5.3'
    """
    named = [text for text in texts if text.startswith("ArduPlane")]
    if named:
        return named[0]
    if number is None:
        return "ArduPlane, version unknown"
    return f"ArduPlane {number >> 24 & 255}.{number >> 16 & 255}.{number >> 8 & 255}"
