"""A mission's items in flying order: jumps unrolled, speeds assigned, a note for all that is not flown as written."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

from flight.mission.items import (
    CAMERA,
    LANDINGS,
    OVER_TERRAIN,
    PLACES,
    TAKEOFFS,
    Command,
    Frame,
    Home,
    ItemProblem,
    Mission,
    MissionItem,
    Notes,
    command_name,
)
from world.errors import MissionError

# A mission unrolls to no more places than this, and no more items are walked through on the way.
MAX_STOPS = 10_000
_MAX_STEPS = 200_000

# A loiter without end is flown for this long, s, and the mission ends there.
UNLIMITED = 60.0

# Noted of items behind a mission's end.
NEVER_REACHED = "never reached"
# Noted of a landing item, but where its landing is flown.
LANDING_NOTE = "not flown to the ground; the flight ends above it at the last height"


@dataclass(frozen=True, slots=True)
class Loiter:
    """A circle to fly.

    radius: m, positive to the right, 0 for the aircraft's own.
    turns, seconds: how long, 0 for what does not count; neither is shortened, and the circle is left on the first
        tangent to the next position after them.
    timed: whether the item is one for a time, be that none.
    to_height: until the item's height is reached.
    endless: whether the item asks for a circle without end, of which ``seconds`` are flown.
    on_course: whether the item asks to leave it on the course to what follows, as PX4 reads it; ArduPlane always does.
    on_tangent: whether it asks for a line there that begins on its rim (PX4) or where it is left (ArduPlane).
    """

    radius: float
    turns: float = 0.0
    seconds: float = 0.0
    timed: bool = False
    to_height: bool = False
    endless: bool = False
    on_course: bool = False
    on_tangent: bool = False

    def sweep(self, airspeed: float, radius: float) -> float:
        """Angle to fly around at least, rad.  In wind a circle over the ground takes longer than the air distance."""
        return max(2.0 * math.pi * self.turns, self.seconds * airspeed / radius)


def loiter_of(item: MissionItem) -> Loiter | None:
    """Circle that an item asks for; None for any other command."""
    p1, p2, p3, p4 = (0.0 if math.isnan(value) else value for value in item.params)
    if item.command == Command.NAV_LOITER_UNLIM:
        return Loiter(p3, seconds=UNLIMITED, endless=True)
    if item.command == Command.NAV_LOITER_TURNS:
        return Loiter(p3, turns=p1, on_tangent=p4 > 0.0)
    if item.command == Command.NAV_LOITER_TIME:
        return Loiter(p3, seconds=p1, timed=True, on_course=p2 > 0.0, on_tangent=p4 > 0.0)
    if item.command == Command.NAV_LOITER_TO_ALT:
        # Its radius is the second parameter.
        return Loiter(p2, to_height=True, on_course=p1 > 0.0, on_tangent=p4 > 0.0)
    return None


class Gate(NamedTuple):
    """A CONDITION_GATE on the way to a stop: what the mission orders after it counts from when it is passed.

    item: the mission item's seq.  airspeed: m/s until it is passed, NaN for the aircraft's own.
    """

    item: int
    lat_deg: float
    lon_deg: float
    airspeed: float


@dataclass(frozen=True, slots=True)
class ItineraryStop:
    """A position to fly to.

    item: the mission item's seq, -1 where no item asks for it.
    command: the item's MAV_CMD.
    alt: m in the item's frame, NaN to keep the last height.
    frame: the item's MAV_FRAME.
    airspeed: m/s on the leg that ends here, NaN for the aircraft's own.
    acceptance: radius, m, 0 where none is stated.
    loiter: the circle flown about it, None for none.
    airspeed_by_value: as ``airspeed`` by an autopilot that reads items as PX4 does.
    gates: on the way to it, in order.
    """

    item: int
    command: int
    lat_deg: float
    lon_deg: float
    alt: float
    frame: int
    airspeed: float
    acceptance: float = 0.0
    loiter: Loiter | None = None
    airspeed_by_value: float = math.nan
    gates: tuple[Gate, ...] = ()


@dataclass(frozen=True, slots=True)
class Itinerary:
    """Where a mission goes: at least one stop.

    home: the mission's, or the first position item with height NaN.
    has_home: whether it is the mission's.
    takeoff: the item that the flight starts with, None for none.
    notes: what is not flown as written, with item numbers.
    endless: seq of a jump without end, -1 for none.
    landing: the place to land at, None for none; the flight ends above it.
    notes_by_value: as ``notes`` by an autopilot that reads items as PX4 does: of a change of speed the value alone, and
        gates.
    """

    stops: tuple[ItineraryStop, ...]
    home: Home
    has_home: bool
    takeoff: MissionItem | None
    notes: tuple[str, ...]
    endless: int = -1
    landing: ItineraryStop | None = None
    notes_by_value: tuple[str, ...] = ()

    @property
    def returns(self) -> bool:
        """Whether it ends with a return to launch; the last stop is then home, at the height before it."""
        return self.stops[-1].command == Command.NAV_RETURN_TO_LAUNCH


def make_itinerary(mission: Mission) -> Itinerary:
    """Walk through the mission as an autopilot would.

    Raises MissionError for a mission without a position, a jump to an item that is not there, and a mission that
    unrolls to more than `MAX_STOPS` places.
    """
    walk = _Walk(mission)
    reached = set()
    for item in _in_flying_order(mission, walk):
        reached.add(item.seq)
        walk.visit(item)
        if len(walk.stops) > MAX_STOPS:
            raise MissionError(
                f"{mission.source}: item {item.seq}: more than {MAX_STOPS:,} places to fly to, jumps unrolled",
                file=mission.source,
                field=f"item {item.seq}",
            )
        if walk.ended:
            break
    for gate in walk.gates:
        walk.notes.by_value.add("CONDITION_GATE: nothing to fly to comes after it, so it is passed at once", gate.item)
    for item in mission.items:
        if item.seq not in reached and not (walk.ended and item.command == Command.DO_JUMP):
            walk.notes.add(NEVER_REACHED, item.seq)
    if not walk.stops:
        raise MissionError(f"{mission.source}: no item with a position: at least two are expected", file=mission.source)
    return Itinerary(
        stops=tuple(walk.stops),
        home=walk.home,
        has_home=walk.has_home,
        takeoff=walk.takeoff,
        notes=walk.notes.usual.lines(),
        endless=walk.endless,
        landing=walk.landing,
        notes_by_value=walk.notes.by_value.lines(),
    )


def _in_flying_order(mission: Mission, walk: "_Walk") -> Iterator[MissionItem]:
    """Items with jumps followed; a jump's counter is never reset, as in ArduPilot.  One without end is taken once."""
    index = {item.seq: k for k, item in enumerate(mission.items)}
    jumped: dict[int, int] = {}
    k = steps = 0
    while k < len(mission.items):
        item = mission.items[k]
        steps += 1
        if steps > _MAX_STEPS:
            raise MissionError(
                f"{mission.source}: item {item.seq}: jumps lead through more than {_MAX_STEPS:,} items",
                file=mission.source,
                field=f"item {item.seq}",
            )
        k += 1
        yield item
        if item.command != Command.DO_JUMP:
            continue
        target, repeats = int(item.params[0]), int(item.params[1])
        if target not in index:
            problem = ItemProblem("DO_JUMP p1", target, f"the mission has no item {target}")
            raise MissionError(**problem.at(mission.source, f"{mission.source}: item {item.seq}"))
        if repeats < 0 and item.seq in jumped:
            walk.notes.add("DO_JUMP without end: taken once; the flight ends there", item.seq)
            walk.endless = item.seq
            return
        if repeats < 0 or jumped.get(item.seq, 0) < repeats:
            jumped[item.seq] = jumped.get(item.seq, 0) + 1
            k = index[target]


class _BothNotes:
    """Notes for both ways to read a change of speed, which differ by what they say of that."""

    def __init__(self) -> None:
        self.usual, self.by_value = Notes(), Notes()

    def add(self, text: str, seq: int | None = None) -> None:
        """Note something that holds either way."""
        self.usual.add(text, seq)
        self.by_value.add(text, seq)


class _Walk:
    """Stops, speed and notes after the items so far."""

    def __init__(self, mission: Mission) -> None:
        self.source = mission.source
        self.airspeed = self.airspeed_by_value = math.nan
        self.notes = _BothNotes()
        self.stops: list[ItineraryStop] = []
        self.takeoff: MissionItem | None = None
        self.gates: list[Gate] = []
        self.ended, self.endless = False, -1
        self.landing: ItineraryStop | None = None
        self.has_home = mission.home is not None
        self.home = mission.home or _first_position(mission)

    def visit(self, item: MissionItem) -> None:
        """Take one item into account."""
        if not item.autocontinue:
            self.notes.add("autocontinue is 0, where the mission would wait: flown on", item.seq)
        if item.command in TAKEOFFS:
            self._take_off(item)
        elif item.command in PLACES:
            self._go(item)
        elif item.command == Command.NAV_RETURN_TO_LAUNCH:
            self._return(item)
        elif item.command in LANDINGS:
            self._land(item)
        elif item.command == Command.DO_CHANGE_SPEED:
            self._change_speed(item)
        elif item.command == Command.DO_LAND_START:
            self.notes.add("DO_LAND_START: a mark, nothing to fly", item.seq)
        elif item.command == Command.CONDITION_GATE:
            self._gate(item)
        elif item.command in CAMERA:
            self.notes.add(f"{command_name(item.command)}: the camera's, nothing to fly", item.seq)
        elif item.command != Command.DO_JUMP:
            self.notes.add(f"{command_name(item.command)}: not flown", item.seq)

    def _stop(self, item: MissionItem, acceptance: float = 0.0) -> ItineraryStop:
        lat, lon, loiter = item.lat_deg, item.lon_deg, loiter_of(item)
        gates, self.gates = tuple(self.gates), []
        return ItineraryStop(
            *(item.seq, item.command, lat, lon, item.alt, item.frame),
            *(self.airspeed, acceptance, loiter, self.airspeed_by_value, gates),
        )

    def _gate(self, item: MissionItem) -> None:
        """Note a gate.  ArduPlane has none; PX4 passes one without a place, or before the start, at once."""
        self.notes.usual.add(f"{command_name(item.command)}: not flown", item.seq)
        if item.has_position and self.stops:
            self.gates.append(Gate(item.seq, item.lat_deg, item.lon_deg, self.airspeed_by_value))
        else:
            self.notes.by_value.add(f"{command_name(item.command)}: passed at once", item.seq)

    def _take_off(self, item: MissionItem) -> None:
        name = command_name(item.command)
        vertical = item.command == Command.NAV_VTOL_TAKEOFF
        if self.stops:
            if item.has_position and not vertical:
                self.notes.add(f"{name} in the air: flown through as a waypoint", item.seq)
                self.stops.append(self._stop(item))
            else:
                self.notes.add(f"{name} in the air: not flown", item.seq)
            return
        if math.isnan(item.alt):
            message = f"{self.source}: item {item.seq}: {name} has no altitude: a number is expected"
            raise MissionError(message, file=self.source, field="altitude", allowed="a number is expected")
        self.takeoff = item
        over_home = replace(self._stop(item), lat_deg=self.home.lat_deg, lon_deg=self.home.lon_deg)
        goes_on = item.has_position and (item.lat_deg, item.lon_deg) != (self.home.lat_deg, self.home.lon_deg)
        if goes_on and vertical:
            # ArduPlane climbs where it stands and goes on at the height (QuadPlane::takeoff_controller and
            # verify_vtol_takeoff); a fixed wing of it passes the item over.
            self.notes.add(f"{name}: its place is not flown to, as in ArduPlane; PX4 would", item.seq)
        if goes_on and not vertical:
            self.stops += [replace(over_home, item=-1), self._stop(item)]
        else:
            self.stops.append(over_home)

    def _go(self, item: MissionItem) -> None:
        name = command_name(item.command)
        if not item.has_position and loiter_of(item) is not None and self.stops:
            self.notes.add(f"{name} without a position: flown about the place before", item.seq)
            alt = math.nan if item.frame == Frame.MISSION else item.alt
            item = replace(item, lat_deg=self.stops[-1].lat_deg, lon_deg=self.stops[-1].lon_deg, alt=alt)
        elif not item.has_position:
            self.notes.add(
                f"{name} without a position, which means the place where the aircraft is: not flown", item.seq
            )
            return
        if item.command == Command.NAV_WAYPOINT:
            if item.params[0] > 0.0:
                self.notes.add("NAV_WAYPOINT with a time to hold: flown through", item.seq)
        elif item.command == Command.NAV_SPLINE_WAYPOINT:
            self.notes.add(f"{name}: flown as a straight waypoint", item.seq)
        elif item.command == Command.NAV_LOITER_UNLIM:
            self.notes.add(f"{name}: flown for {UNLIMITED:.0f} s; the mission ends there", item.seq)
            self.ended = True
        elif loiter_of(item) is None:
            self.notes.add(f"{name}: flown through as a waypoint", item.seq)
        if math.isnan(item.alt):
            self.notes.add(f"{name} without an altitude: keeps the last height", item.seq)
        elif item.frame in OVER_TERRAIN:
            self.notes.add("height above terrain: held at the waypoint, the legs between are straight", item.seq)
        radius = item.params[1] if item.command in (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT) else 0.0
        self.stops.append(self._stop(item, radius if radius > 0.0 else 0.0))

    def _return(self, item: MissionItem) -> None:
        if not self.has_home:
            self.notes.add("NAV_RETURN_TO_LAUNCH without a home: ignored", item.seq)
        elif not self.stops:
            self.notes.add("NAV_RETURN_TO_LAUNCH before the start: ignored", item.seq)
        else:
            # Where to and how high is for who flies: `flight.mission.return_path`.  No speed that was set counts there.
            home = replace(item, lat_deg=self.home.lat_deg, lon_deg=self.home.lon_deg, alt=math.nan)
            self.stops.append(replace(self._stop(home), airspeed=math.nan, airspeed_by_value=math.nan))
            self.ended = True

    def _land(self, item: MissionItem) -> None:
        name = command_name(item.command)
        if not self.stops:
            self.notes.add(f"{name} before the start: ignored", item.seq)
            return
        self.ended = True
        if item.has_position:
            self.notes.add(f"{name}: {LANDING_NOTE}", item.seq)
            self.landing = self._stop(item)
            self.stops.append(replace(self.landing, alt=math.nan))
        else:
            self.notes.add(f"{name} without a position: not flown; the flight ends at the place before", item.seq)

    def _change_speed(self, item: MissionItem) -> None:
        self._change_by_value(item)
        kind, speed, throttle = item.params[:3]
        notes = self.notes.usual
        if kind not in (0.0, 1.0):
            notes.add(f"DO_CHANGE_SPEED of type {kind:g}, neither airspeed nor ground speed: ignored", item.seq)
            return
        if speed == -2.0:
            self.airspeed = math.nan
        elif speed > 0.0:
            self.airspeed = speed
            if kind == 1.0:
                notes.add("DO_CHANGE_SPEED of ground speed: flown as airspeed", item.seq)
        elif speed != -1.0:
            notes.add(f"DO_CHANGE_SPEED to {speed:g} m/s: ignored", item.seq)
        if throttle > 0.0:
            notes.add("DO_CHANGE_SPEED's throttle: ignored", item.seq)

    def _change_by_value(self, item: MissionItem) -> None:
        """Read a change of speed as PX4 does (`navigator_main.cpp`, VEHICLE_CMD_DO_CHANGE_SPEED)."""
        kind, speed, throttle = item.params[:3]
        notes = self.notes.by_value
        if speed > 0.0:
            self.airspeed_by_value = speed
            if kind != 0.0:
                notes.add(f"DO_CHANGE_SPEED of type {kind:g}: flown as airspeed, for no type is read", item.seq)
            return
        self.airspeed_by_value = math.nan
        notes.add(f"DO_CHANGE_SPEED to {speed:g} m/s: back to the autopilot's own airspeed", item.seq)
        if throttle > 0.0:
            notes.add("DO_CHANGE_SPEED's throttle: not flown", item.seq)


def _first_position(mission: Mission) -> Home:
    """Place of the first item that has one, at a height not known."""
    for item in mission.items:
        if item.command in PLACES | TAKEOFFS | LANDINGS and item.has_position:
            return Home(item.lat_deg, item.lon_deg, math.nan)
    raise MissionError(f"{mission.source}: no item with a position: at least two are expected", file=mission.source)
