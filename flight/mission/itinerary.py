"""List a mission's stops in flying order, with jumps unrolled and a speed for each leg.

ArduPlane and PX4 reach the same stops in the same order, but run the commands between them at different times. PX4 runs
each command at its position in the list (`MissionBase::advance_mission`). ArduPlane runs the first command before the
leg to the next stop, and the others one after another on that leg. It follows jumps according to the state of their
counters at that time (`AP_Mission::advance_current_nav_cmd`, `advance_current_do_cmd`): commands after a jump that has
just been taken for the last time run one loop early (ArduPilot #30376).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from flight.mission.commands import CAMERA_REASON, MARKS, Command, Treatment, command_support
from flight.mission.items import (
    AMSL,
    CAMERA_SWITCHES,
    JUMPS,
    LANDINGS,
    OVER_HOME,
    OVER_TERRAIN,
    PLACES,
    TAKEOFFS,
    Frame,
    Home,
    ItemProblem,
    Mission,
    MissionItem,
    Notes,
    command_name,
    is_navigation,
)
from world.errors import MissionError

# East, north, up, m.
Position = tuple[float, float, float]
# Maximum number of stops of an unrolled mission.
MAX_STOPS = 10_000
# Maximum number of items passed while a mission is unrolled.
_MAX_STEPS = 200_000
# Number of jumps that ArduPlane counts (`AP_MISSION_MAX_NUM_DO_JUMP_COMMANDS`).
_MAX_COUNTED_JUMPS = 100
# The same number on a board with little memory.
_MAX_COUNTED_JUMPS_SMALL_BOARD = 15
# Number of jumps in a row at which PX4 finds no item (`MAX_JUMP_ITERATION`).
_MAX_JUMPS_IN_A_ROW = 10
# Number of jumps in a row at which ArduPlane finds no item (`AP_Mission::get_next_cmd`, `max_loops`).
_MAX_JUMPS_IN_A_ROW_ARDUPLANE = 65
# Number of commands before a navigation item at which ArduPlane ends the mission: the first is run, and 255 more are
# passed (`AP_Mission::advance_current_nav_cmd`, `max_loops`).
_MAX_COMMANDS_IN_A_ROW_ARDUPLANE = 257

# Minimum simulated duration of an unlimited loiter, s; at least one lap is flown, and the mission ends there.
ENDLESS_LOITER_TIME_S = 60.0

# Note on items after a mission's end.
NEVER_REACHED = "never reached"
# Note on a landing item whose landing is not simulated.
LANDING_NOTE = (
    "is not flown to the ground. The flight ends above the landing point, at the altitude of the previous item"
)


@dataclass(frozen=True, slots=True)
class Loiter:
    """A loiter to fly.

    radius: m, positive to the right; 0 for the autopilot's default radius.
    turns, seconds: minimum duration, 0 if it does not apply; the aircraft then leaves the circle on the first tangent
        to the next position.
    timed: True if the item states a time, even 0.
    to_altitude: True if the loiter lasts until the item's altitude is reached.
    endless: True if the item states an unlimited loiter, of which ``seconds`` and at least one lap are simulated.
    exits_on_course: True if the item states an exit on the course to the next stop. Only PX4 reads it; ArduPlane always
        exits on that course.
    exits_on_tangent: True if the item states that the line to the next stop starts on the circle (PX4) or at the exit
        (ArduPlane).
    """

    radius: float
    turns: float = 0.0
    seconds: float = 0.0
    timed: bool = False
    to_altitude: bool = False
    endless: bool = False
    exits_on_course: bool = False
    exits_on_tangent: bool = False

    def min_sweep(self, airspeed: float, radius: float) -> float:
        """Return the angle around the circle that the loiter's turns and its time require, rad.

        airspeed: m/s.
        radius: radius of the circle, m.

        The result is the larger of the angle for the turns and the angle for the time. The latter is computed without
        wind. In wind a lap takes longer, so the aircraft covers a smaller angle in this time.
        """
        min_turns = 1.0 if self.endless else self.turns
        return max(2.0 * math.pi * min_turns, self.seconds * airspeed / radius)


def arduplane_turns(stated_turns: float) -> float:
    """Return the number of turns that ArduPlane flies for a stated number of turns.

    Above 1 the number is rounded down; the maximum is 255, because `AP_Mission::mavlink_int_to_mission_cmd` stores the
    number in a byte.

    >>> [arduplane_turns(turns) for turns in (0.5, 1.0, 2.5, 300.0)]
    [0.5, 1.0, 2.0, 255.0]
    """
    return stated_turns if stated_turns <= 1.0 else float(min(_MAX_BYTE_TURNS, math.floor(stated_turns)))


def stated_loiter(item: MissionItem) -> Loiter | None:
    """Return the loiter that an item states; None if the item is not a loiter."""
    param1, param2, param3, param4 = (0.0 if math.isnan(value) else value for value in item.params)
    if item.command == Command.NAV_LOITER_UNLIM:
        return Loiter(param3, seconds=ENDLESS_LOITER_TIME_S, endless=True)
    if item.command == Command.NAV_LOITER_TURNS:
        return Loiter(param3, turns=arduplane_turns(param1), exits_on_tangent=param4 > 0.0)
    if item.command == Command.NAV_LOITER_TIME:
        return Loiter(param3, seconds=param1, timed=True, exits_on_course=param2 > 0.0, exits_on_tangent=param4 > 0.0)
    if item.command == Command.NAV_LOITER_TO_ALT:
        # Its radius is the second parameter.
        return Loiter(param2, to_altitude=True, exits_on_course=param1 > 0.0, exits_on_tangent=param4 > 0.0)
    return None


# Largest number of turns in a byte.
_MAX_BYTE_TURNS = 255

# Longest distance that ArduPlane flies on beyond a waypoint, m: it is stored as whole metres in a byte.
_MAX_PASS_BY_M = 255
# Lowest altitude above 0 that ArduPlane stores, m.
_ALTITUDE_STEP_M = 0.01


def pass_by_distance(item: MissionItem) -> float:
    """Return the distance that ArduPlane flies past a waypoint before it turns, m.

    The distance is the third parameter of NAV_WAYPOINT in whole metres (`AP_Mission::mavlink_int_to_mission_cmd`). For
    any other item it is 0.

    >>> parameters = [(0.0, 0.0, distance, 0.0) for distance in (150.9, 300.0, math.nan, -50.0)]
    >>> [pass_by_distance(MissionItem(1, 16, 0, params, 36.5, 8.0, 700.0)) for params in parameters]
    [150.0, 255.0, 0.0, 0.0]
    """
    stated_distance = item.params[2]
    return (
        float(min(_MAX_PASS_BY_M, int(stated_distance)))
        if item.command == Command.NAV_WAYPOINT and stated_distance >= 1.0
        else 0.0
    )


class OpenItem(NamedTuple):
    """An item that changes the flight path in a way that is not simulated.

    item: seq of the mission item.
    text: command of the item, and the part that is not simulated.
    """

    item: int
    text: str


# Why a survey of gates alone is not flown.
GATES_ARE_NO_WAYPOINTS = "no autopilot flies to a gate (CONDITION_GATE): a survey with gates needs turn-arounds"


class Gate(NamedTuple):
    """A CONDITION_GATE on the leg to a stop: later commands take effect when the aircraft passes the gate.

    item: seq of the mission item.
    airspeed: airspeed until the gate is passed, m/s; NaN for the autopilot's default.
    switches_camera: True if a command at the gate switches the camera.
    """

    item: int
    lat_deg: float
    lon_deg: float
    airspeed: float
    switches_camera: bool = False


# Seq of a stop without a mission item.
NO_ITEM = -1


@dataclass(frozen=True, slots=True)
class RoutePoint:
    """Stop of a mission's itinerary, or waypoint of its route.

    A loiter stop becomes several waypoints.

    The position is None until `flight.mission.placing` has placed the stop on the map.

    item: seq of the mission item, `NO_ITEM` for a stop without an item.
    command: MAV_CMD of the item.
    alt: m in the item's frame, NaN to keep the last altitude.
    frame: MAV_FRAME of the item.
    airspeed: airspeed on the leg to the stop, m/s; NaN for the autopilot's default.
    acceptance_radius: m; 0 if not stated.
    loiter: loiter about the stop, or None.
    px4_airspeed: airspeed on that leg as PX4 reads the items, m/s.
    gates: gates on the leg to the stop, in order.
    min_ground_speed: ground speed for which ArduPlane raises its airspeed on that leg, m/s; 0 or less for none, NaN for
        the autopilot's default.
    home_up: altitude of home on that leg, m AMSL; NaN if the mission's home does not state it.
    stop: number of the stop in flying order; all points of a loiter have the same.
    position: east, north, up, m AMSL, or None.
    arc_radius: radius of the turn there, m, 0 for the radius at the bank limit; while a loiter is laid out, the radius
        of its circle about the position, negative to the left.
    """

    item: int
    command: int
    lat_deg: float
    lon_deg: float
    alt: float
    frame: int
    airspeed: float
    acceptance_radius: float = 0.0
    loiter: Loiter | None = None
    px4_airspeed: float = math.nan
    gates: tuple[Gate, ...] = ()
    min_ground_speed: float = math.nan
    home_up: float = math.nan
    stop: int = -1
    position: Position | None = None
    arc_radius: float = 0.0

    def placed_at(self, position: Position, arc_radius: float = 0.0) -> "RoutePoint":
        """Return a copy at a map position (east, north, up, m), with a turn radius, m, negative to the left."""
        return replace(self, position=position, arc_radius=arc_radius)

    @property
    def map_position(self) -> Position:
        """Position on the map. Raises ValueError for a stop without a position."""
        if self.position is None:
            raise ValueError(f"item {self.item} is not placed on the map")
        return self.position

    @property
    def east(self) -> float:
        """East of the origin of the map, m."""
        return self.map_position[0]

    @property
    def north(self) -> float:
        """North of the origin of the map, m."""
        return self.map_position[1]

    @property
    def up(self) -> float:
        """Altitude, m AMSL."""
        return self.map_position[2]

    def distance_to(self, other: "RoutePoint") -> float:
        """Return the distance on the map to another point, m."""
        return math.hypot(other.east - self.east, other.north - self.north)


@dataclass(frozen=True, slots=True)
class Itinerary:
    """Stops of a mission in flying order, at least one.

    home: the mission's home, or the first position item with altitude NaN.
    has_home: True if the mission states its home.
    takeoff: take-off item at the start of the flight, or None.
    notes: items that are not flown as written, with their numbers, for ArduPlane.
    endless_jump: seq of a jump without end, or None.
    landing: landing point, or None; the flight ends above it.
    px4_notes: the same notes for PX4, which reads only the value of a speed change, and gates.
    open_items, px4_open_items: items that leave the verdict undecided for ArduPlane and for PX4.
    last_home: home at the mission's end, the target of an RTL; it differs from ``home`` after a DO_SET_HOME.
    passes_exhausted_jump: True if a jump is passed again after its last repeat, where ArduPlane 4.7 takes it again.
    unreached: seqs of the items that are never reached.
    """

    stops: tuple[RoutePoint, ...]
    home: Home
    has_home: bool
    takeoff: MissionItem | None
    notes: tuple[str, ...]
    endless_jump: int | None = None
    landing: RoutePoint | None = None
    px4_notes: tuple[str, ...] = ()
    open_items: tuple[OpenItem, ...] = ()
    px4_open_items: tuple[OpenItem, ...] = ()
    last_home: Home | None = None
    passes_exhausted_jump: bool = False
    unreached: tuple[int, ...] = ()

    @property
    def ends_with_rtl(self) -> bool:
        """True if the mission ends with an RTL.

        The last stop is then home, at the altitude of the previous stop.
        """
        return self.stops[-1].command == Command.NAV_RETURN_TO_LAUNCH


def make_itinerary(mission: Mission, *, resets_jump_counters: bool = False) -> Itinerary:
    """Return the sequence of stops that an autopilot flies for a mission, with jumps and commands applied.

    resets_jump_counters: True to reset the counter of a jump after its last repeat, as ArduPlane 4.7 does.

    Raises MissionError if no item has a position, if a jump leads to a missing item, or if the result has more than
    `MAX_STOPS` stops.
    """
    builder, steps = _ItineraryBuilder(mission), _Steps(mission, resets_jump_counters)
    for step in steps:
        builder.process_step(step)
        if len(builder.stops) > MAX_STOPS:
            seq = step.target.seq if step.target is not None else mission.items[-1].seq
            raise MissionError(
                f"{mission.source}: item {seq}: more than {MAX_STOPS:,} positions to fly to, with all jumps unrolled",
                file=mission.source,
                field=f"item {seq}",
            )
        if builder.has_ended:
            break
    if steps.endless is not None:
        name = command_name(mission.items[steps.index[steps.endless]].command)
        builder.notes.add(
            f"{name} repeats indefinitely, so the simulated flight flies its items once more and then ends",
            steps.endless,
        )
    _add_command_limits(mission, steps, builder)
    for gate in builder.gates:
        builder.notes.px4.add("CONDITION_GATE is passed at once, because no waypoint follows it", gate.item)
    unreached = [
        item.seq
        for item in mission.items
        if item.seq not in steps.reached and not (builder.has_ended and item.command in JUMPS)
    ]
    for seq in unreached:
        builder.notes.add(NEVER_REACHED, seq)
    if not builder.stops:
        raise _error_without_position(mission)
    return Itinerary(
        stops=tuple(builder.stops),
        home=builder.first_home,
        has_home=builder.has_home,
        takeoff=builder.takeoff,
        notes=builder.notes.arduplane.lines(),
        endless_jump=steps.endless,
        landing=builder.landing,
        px4_notes=builder.notes.px4.lines(),
        open_items=tuple(builder.open_items),
        px4_open_items=tuple(builder.px4_open_items),
        last_home=builder.home,
        passes_exhausted_jump=steps.passes_exhausted_jump,
        unreached=tuple(unreached),
    )


def _add_command_limits(mission: Mission, steps: "_Steps", builder: "_ItineraryBuilder") -> None:
    """Add open items and notes where an autopilot runs fewer jumps or commands than the mission has.

    steps: finished iteration over the mission's items.
    builder: receives the open items and notes.
    """
    jumps = [item.seq for item in mission.items if item.command in JUMPS and item.seq in steps.reached]
    if len(jumps) > _MAX_COUNTED_JUMPS:
        text = f"DO_JUMP is flown, but ArduPlane skips jumps beyond the first {_MAX_COUNTED_JUMPS}"
        builder.add_open_item(text, jumps[_MAX_COUNTED_JUMPS], px4=False)
    elif len(jumps) > _MAX_COUNTED_JUMPS_SMALL_BOARD:
        board_text = f"a board with little memory skips jumps beyond the first {_MAX_COUNTED_JUMPS_SMALL_BOARD}"
        builder.notes.arduplane.add(f"the mission has {len(jumps)} jumps, but {board_text}")
    if _MAX_JUMPS_IN_A_ROW in steps.jump_chains:
        text = f"DO_JUMP is flown, but PX4 ends the mission after {_MAX_JUMPS_IN_A_ROW} jumps in a row"
        builder.add_open_item(text, steps.jump_chains[_MAX_JUMPS_IN_A_ROW], arduplane=False)
    if _MAX_JUMPS_IN_A_ROW_ARDUPLANE in steps.jump_chains:
        text = f"DO_JUMP: flown, but ArduPlane ends the mission after {_MAX_JUMPS_IN_A_ROW_ARDUPLANE} jumps in a row"
        builder.add_open_item(text, steps.jump_chains[_MAX_JUMPS_IN_A_ROW_ARDUPLANE], px4=False)
    if steps.long_command_chain >= 0:
        count_text = f"{_MAX_COMMANDS_IN_A_ROW_ARDUPLANE} commands without a waypoint"
        text = f"{count_text}: flown, but ArduPlane ends the mission"
        builder.add_open_item(text, steps.long_command_chain, px4=False)


class _Step(NamedTuple):
    """The next navigation item, and the commands before it.

    commands: commands before the item, following jumps, as PX4 runs them.
    command_before_leg: command that ArduPlane runs before the leg to the item, or None.
    commands_on_leg: commands that ArduPlane runs on the leg to the item.
    target: the navigation item; None at the mission's end.
    """

    commands: tuple[MissionItem, ...]
    command_before_leg: MissionItem | None
    commands_on_leg: tuple[MissionItem, ...]
    target: MissionItem | None


class _Steps:
    """Iterator over the navigation items of a mission, following jumps.

    After its last repeat a jump is skipped by ArduPlane 4.6 and PX4, but ArduPlane 4.7 resets its counter
    (`AP_Mission::get_next_cmd`).

    passes_exhausted_jump: True if a jump is passed again after its last repeat.
    reached: numbers of the items reached, including jumps.
    endless: seq of the jump without end at which the iteration ended, or None; such a jump is taken once.
    jump_chains: lengths of jump chains at which an autopilot ends the mission, each with the seq of the first jump that
        makes a chain so long: {10: 7} if item 7 is the first jump that is the tenth in a row.
    long_command_chain: seq of the command at which ArduPlane ends the mission, -1 for none.
    """

    def __init__(self, mission: Mission, resets_jump_counters: bool) -> None:
        self.mission, self.items = mission, mission.items
        self._resets_jump_counters, self._exhausted = resets_jump_counters, set[int]()
        self.passes_exhausted_jump = False
        self.index = {item.seq: k for k, item in enumerate(mission.items)}
        self.tags: dict[int, int] = {}
        for k, item in enumerate(mission.items):
            if item.command == Command.JUMP_TAG:
                # The first tag with a number applies, wherever the jump is (`AP_Mission::get_index_of_jump_tag`).
                self.tags.setdefault(int(item.params[0]), k)
        self.jump_counts: dict[int, int] = {}
        self.reached: set[int] = set()
        self.jump_chains: dict[int, int] = {}
        self.endless: int | None = None
        self.long_command_chain, self._step_count = -1, 0

    def __iter__(self) -> Iterator[_Step]:
        """Yield a step for each navigation item, and a last step without a target for the mission's end."""
        index: int | None = 0
        while index is not None:
            passed_indices: list[int] = []
            index = self._next_item(index, counting=True)
            while index is not None and not is_navigation(self.items[index].command):
                passed_indices.append(index)
                if len(passed_indices) == _MAX_COMMANDS_IN_A_ROW_ARDUPLANE and self.long_command_chain < 0:
                    self.long_command_chain = self.items[index].seq
                index = self._next_item(index + 1, counting=True)
            # ArduPlane has run the first command before the leg, and looks ahead for the others without counting jumps.
            leg_commands: list[int] = []
            if passed_indices and index is not None:
                ahead = self._next_item(passed_indices[0] + 1, counting=False)
                while ahead is not None and ahead not in leg_commands and not is_navigation(self.items[ahead].command):
                    leg_commands.append(ahead)
                    ahead = self._next_item(ahead + 1, counting=False)
            self.reached |= {self.items[command].seq for command in leg_commands}
            yield _Step(
                tuple(self.items[command] for command in passed_indices),
                self.items[passed_indices[0]] if passed_indices else None,
                tuple(self.items[command] for command in leg_commands),
                None if index is None else self.items[index],
            )
            index = None if index is None else index + 1

    def _next_item(self, index: int, *, counting: bool) -> int | None:
        """Return the index of the next item that is not a jump; None at the mission's end (`get_next_cmd`).

        index: index of the first item to look at; jumps from there on are followed.
        counting: True to advance the jump counters and record the items reached, as ArduPlane does when it reaches a
            navigation item; False to look ahead without a change.

        A jump without end is taken once; the second time, `endless` is set and the result is None.
        """
        first_jump, chain_length = -1, 0
        while index < len(self.items):
            item = self.items[index]
            if counting:
                self.reached.add(item.seq)
                self._step_count += 1
                if self._step_count > _MAX_STEPS:
                    raise MissionError(
                        f"{self.mission.source}: item {item.seq}: jumps lead through more than {_MAX_STEPS:,} items",
                        file=self.mission.source,
                        field=f"item {item.seq}",
                    )
            if item.command not in JUMPS:
                return index
            is_tag_jump, number, repeats = item.command == Command.DO_JUMP_TAG, int(item.params[0]), int(item.params[1])
            index_by_number = self.tags if is_tag_jump else self.index
            if number not in index_by_number:
                missing_name = f"JUMP_TAG {number}" if is_tag_jump else f"item {number}"
                problem = ItemProblem(f"{command_name(item.command)} p1", number, f"the mission has no {missing_name}")
                location = f"{self.mission.source}: item {item.seq}"
                raise MissionError(**problem.error_arguments(self.mission.source, location))
            target = index_by_number[number]
            chain_length += 1
            if counting and chain_length in (_MAX_JUMPS_IN_A_ROW, _MAX_JUMPS_IN_A_ROW_ARDUPLANE):
                self.jump_chains.setdefault(chain_length, item.seq)
            if not counting and index == first_jump:
                return None
            first_jump = index if first_jump < 0 else first_jump
            if counting and repeats < 0 and index in self.jump_counts:
                self.endless = item.seq
                return None
            if repeats < 0 or self.jump_counts.get(index, 0) < repeats:
                if counting:
                    self.jump_counts[index] = self.jump_counts.get(index, 0) + 1
                index = target
            else:
                if counting and repeats > 0:
                    self.passes_exhausted_jump |= index in self._exhausted
                    self._exhausted.add(index)
                    self.jump_counts[index] = 0 if self._resets_jump_counters else repeats
                index += 1
        return None


class _AutopilotNotes:
    """Notes for ArduPlane and for PX4, which read some items differently."""

    def __init__(self) -> None:
        self.arduplane, self.px4 = Notes(), Notes()

    def add(self, text: str, seq: int | None = None) -> None:
        """Add a note for both autopilots."""
        self.arduplane.add(text, seq)
        self.px4.add(text, seq)


class _ItineraryBuilder:
    """Builder of an itinerary: its state is the speed and home that apply to the next stop."""

    def __init__(self, mission: Mission) -> None:
        self.source = mission.source
        self.last_seq = mission.items[-1].seq if mission.items else -1
        self.airspeed = self.px4_airspeed = self.min_ground_speed = math.nan
        self.notes = _AutopilotNotes()
        # Dictionaries as ordered sets.
        self.open_items: dict[OpenItem, None] = {}
        self.px4_open_items: dict[OpenItem, None] = {}
        self.stops: list[RoutePoint] = []
        self.takeoff: MissionItem | None = None
        self.gates: list[Gate] = []
        self.has_ended = False
        self.landing: RoutePoint | None = None
        self.has_home = mission.home is not None
        home = mission.home
        if home is None:
            # The position of the first item that has one, as a home of unknown altitude.
            has_stop = (item for item in mission.items if item.command in PLACES | TAKEOFFS | LANDINGS)
            first_item = next((item for item in has_stop if item.has_position), None)
            if first_item is None:
                raise _error_without_position(mission)
            home = Home(first_item.lat_deg, first_item.lon_deg, math.nan)
        self.first_home = self.home = home

    def process_step(self, step: _Step) -> None:
        """Run the commands before a navigation item as both autopilots do, then add the item's stops.

        PX4 runs each command where it stands in the list. ArduPlane runs one command before the leg, and the others on
        the leg; after a jump these may be commands of the next loop.
        """
        for item in step.commands:
            self._run_as_px4(item)
        arduplane_commands = () if step.command_before_leg is None else (step.command_before_leg, *step.commands_on_leg)
        for index, item in enumerate(arduplane_commands):
            # A home that is set on a leg does not change the altitude of the item at the end of the leg.
            if index == 0 or item.command != Command.DO_SET_HOME:
                self._run_as_arduplane(item, arduplane_commands[index + 1 :])
        for item in step.commands_on_leg:
            if item not in step.commands:
                self.notes.arduplane.add(
                    f"{command_name(item.command)} is flown one loop early, as in ArduPlane", item.seq
                )
        target = step.target
        if target is not None and not target.autocontinue:
            self._note_wait(target)
        if target is None:
            for item in step.commands[1:]:
                text = f"{command_name(item.command)} is not run, because no waypoint follows it"
                self.notes.arduplane.add(text, item.seq)
        elif target.command in TAKEOFFS:
            self._add_take_off(target)
        elif target.command in PLACES:
            self._add_stop(target)
        elif target.command == Command.NAV_RETURN_TO_LAUNCH:
            if not self.has_home and self.home is self.first_home:
                self.add_open_item("NAV_RETURN_TO_LAUNCH without a home is not flown", target.seq)
            elif not self.stops:
                self.add_open_item("NAV_RETURN_TO_LAUNCH before the start is not flown", target.seq)
            else:
                # The RTL ends the mission. The autopilot chooses destination and altitude:
                # `flight.mission.return_path`. Earlier speed changes do not apply to the RTL.
                home = replace(target, lat_deg=self.home.lat_deg, lon_deg=self.home.lon_deg, alt=math.nan)
                self.stops.append(replace(self._make_stop(home), airspeed=math.nan, px4_airspeed=math.nan))
                self.has_ended = True
        elif target.command in LANDINGS:
            self._add_landing(target)
        else:
            self._note_unsimulated_command(target, as_px4=False)
            self._note_unsimulated_command(target, as_px4=True)
        for item in arduplane_commands[1:]:
            if item.command == Command.DO_SET_HOME:
                self._set_home(item)

    def add_open_item(self, text: str, seq: int, *, arduplane: bool = True, px4: bool = True) -> None:
        """Record an item that changes the path and is not simulated, for one or both autopilots.

        text: command of the item, and the part that is not simulated.
        seq: number of the item.
        arduplane, px4: True to record it for this autopilot.
        """
        for applies, notes, open_items in (
            (arduplane, self.notes.arduplane, self.open_items),
            (px4, self.notes.px4, self.px4_open_items),
        ):
            if applies:
                notes.add(text, seq)
                open_items[OpenItem(seq, text)] = None

    def _run_as_arduplane(self, item: MissionItem, later_commands: Sequence[MissionItem]) -> None:
        """Run a command as ArduPlane does.

        later_commands: commands that ArduPlane runs after this command on the same leg.
        """
        if item.command == Command.DO_CHANGE_SPEED:
            self._change_speed_as_arduplane(item)
        elif item.command == Command.DO_SET_HOME:
            self._set_home(item)
        elif item.command == Command.CONDITION_GATE:
            self.add_open_item(f"{command_name(item.command)} is not flown", item.seq, px4=False)
        elif item.command in (Command.CONDITION_DELAY, Command.CONDITION_DISTANCE):
            delayed = [
                command
                for command in later_commands
                if command.command in (Command.DO_CHANGE_SPEED, Command.DO_SET_HOME)
            ]
            text = f"{command_name(item.command)} is not flown"
            if delayed:
                delay_text = f"; {command_name(delayed[0].command)} (item {delayed[0].seq}) is flown without the delay"
                self.add_open_item(text + delay_text, item.seq, px4=False)
            else:
                self.notes.arduplane.add(text, item.seq)
        else:
            self._note_unsimulated_command(item, as_px4=False)

    def _run_as_px4(self, item: MissionItem) -> None:
        """Run a command as PX4 does."""
        if not item.autocontinue:
            self._note_wait(item)
        if item.command == Command.DO_CHANGE_SPEED:
            # As in PX4's `navigator_main.cpp`, VEHICLE_CMD_DO_CHANGE_SPEED.
            speed_type, speed, throttle = item.params[:3]
            self.px4_airspeed = speed if speed > 0.0 else math.nan
            if not speed > 0.0:
                text = f"DO_CHANGE_SPEED to {speed:g} m/s returns to PX4's default airspeed"
                self.notes.px4.add(text, item.seq)
                if throttle > 0.0:
                    self.notes.px4.add("DO_CHANGE_SPEED's throttle is not flown", item.seq)
            elif speed_type != 0.0:
                text = f"DO_CHANGE_SPEED of type {speed_type:g} is flown as airspeed, because PX4 ignores the type"
                self.notes.px4.add(text, item.seq)
        elif item.command == Command.CONDITION_GATE:
            # PX4 passes a gate at once if it has no position or precedes the start.
            if item.has_position and self.stops:
                self.gates.append(Gate(item.seq, item.lat_deg, item.lon_deg, self.px4_airspeed))
            else:
                self.notes.px4.add(f"{command_name(item.command)} is passed at once", item.seq)
        else:
            if item.command in CAMERA_SWITCHES and self.gates:
                self.gates[-1] = self.gates[-1]._replace(switches_camera=True)
            self._note_unsimulated_command(item, as_px4=True)

    def _note_unsimulated_command(self, item: MissionItem, *, as_px4: bool) -> None:
        """Record a command that is not simulated: an open item if it may change the path, otherwise a note.

        An open item leaves the verdict on the mission unresolved (see `add_open_item`). Markers and camera switches get
        neither.

        as_px4: True for PX4's treatment of the command, False for ArduPlane's.
        """
        name, support = command_name(item.command), command_support(item.command)
        treatment = support.px4 if as_px4 else support.arduplane
        notes = self.notes.px4 if as_px4 else self.notes.arduplane
        if treatment == Treatment.OPEN:
            self.add_open_item(f"{name} is not flown; {support.reason}", item.seq, arduplane=not as_px4, px4=as_px4)
        elif item.command in MARKS or item.command in CAMERA_SWITCHES:
            # A marker command (such as DO_LAND_START or JUMP_TAG) needs no note, because it does nothing by itself. The
            # survey rule judges camera switches.
            return
        elif support.reason == CAMERA_REASON:
            notes.add(f"{name} only controls the camera", item.seq)
        else:
            notes.add(f"{name} is not flown", item.seq)

    def _note_wait(self, item: MissionItem) -> None:
        """Add a note for an item after which PX4 waits (`MissionBase::on_active`); ArduPlane does not wait."""
        self.notes.arduplane.add("autocontinue 0 is ignored, as in ArduPlane", item.seq)
        if item.seq == self.last_seq:
            self.notes.px4.add("autocontinue 0 has no effect on the last item", item.seq)
        else:
            self.add_open_item(
                "autocontinue is 0, so PX4 would wait, but the simulated flight continues", item.seq, arduplane=False
            )

    def _make_stop(self, item: MissionItem, acceptance: float = 0.0) -> RoutePoint:
        """Return the stop of an item, with the current speeds and home, and the gates since the last stop.

        acceptance: acceptance radius that the item states, m; 0 for none.
        """
        lat = item.lat_deg
        lon = item.lon_deg
        loiter = stated_loiter(item)
        alt = item.alt
        frame = item.frame
        gates, self.gates = tuple(self.gates), []
        if self.home is not self.first_home and frame in OVER_HOME:
            alt, frame = self.home.alt + alt, int(Frame.GLOBAL)
        return RoutePoint(
            *(item.seq, item.command, lat, lon, alt, frame),
            *(self.airspeed, acceptance, loiter, self.px4_airspeed, gates),
            min_ground_speed=self.min_ground_speed,
            home_up=self.home.alt,
        )

    def _add_take_off(self, item: MissionItem) -> None:
        """Add the stop of a take-off.

        A take-off at the start adds a stop above home, and a stop at its own position if that differs from home. After
        other stops, a take-off with a position is flown as a waypoint, and a vertical one or one without a position is
        not flown. Raises MissionError for a take-off at the start without an altitude.
        """
        name = command_name(item.command)
        is_vertical = item.command == Command.NAV_VTOL_TAKEOFF
        if self.stops:
            if item.has_position and not is_vertical:
                self.add_open_item(f"{name} in the air is flown through as a waypoint", item.seq)
                self.stops.append(self._make_stop(item))
            else:
                self.add_open_item(f"{name} in the air is not flown", item.seq)
            return
        if math.isnan(item.alt):
            message = f"{self.source}: item {item.seq}: {name} has no altitude: expected a number"
            raise MissionError(message, file=self.source, field="altitude", allowed="expected a number")
        self.takeoff = item
        if item.frame in OVER_TERRAIN:
            # `Plane::do_takeoff` subtracts home's altitude from the item's number, and `Plane::verify_takeoff` compares
            # the result with the height over home.
            text = f"{name} above terrain is flown as written, but ArduPlane reads its height as an altitude AMSL"
            self.add_open_item(text, item.seq, px4=False)
        if is_vertical:
            self.add_open_item(f"{name} is not flown straight up", item.seq)
        home = self.first_home
        over_home = replace(self._make_stop(item), lat_deg=home.lat_deg, lon_deg=home.lon_deg)
        has_own_position = item.has_position and (item.lat_deg, item.lon_deg) != (home.lat_deg, home.lon_deg)
        if has_own_position and is_vertical:
            # ArduPlane climbs vertically and continues at that altitude (QuadPlane::takeoff_controller and
            # verify_vtol_takeoff); its fixed wings skip the item.
            self.notes.add(f"the position of {name} is not flown to, as in ArduPlane; PX4 would fly to it", item.seq)
        if has_own_position and not is_vertical:
            self.stops += [replace(over_home, item=NO_ITEM), self._make_stop(item)]
        else:
            self.stops.append(over_home)

    def _add_stop(self, item: MissionItem) -> None:
        """Add the stop of a waypoint or loiter, and a note on each part that is not flown as written.

        An item without a position has no stop, only a note, unless it is a loiter after another stop. An endless loiter
        ends the mission.
        """
        name = command_name(item.command)
        is_later_loiter = stated_loiter(item) is not None and bool(self.stops)
        if is_later_loiter and item.alt == 0.0 and item.frame in OVER_HOME | OVER_TERRAIN:
            # `Location::sanitize`, which ArduPlane's `do_loiter_*` call, takes such an altitude for the present one.
            text = f"{name} at a height of 0 m is flown at the altitude of the previous item, as in ArduPlane"
            self.notes.arduplane.add(text, item.seq)
            self.add_open_item(text, item.seq, arduplane=False)
            item = replace(item, alt=math.nan)
        if not item.has_position and is_later_loiter:
            text = f"{name} without a position is flown around the previous position"
            self.notes.arduplane.add(text, item.seq)
            # PX4 reads 0, 0 as a position.
            self.add_open_item(text, item.seq, arduplane=False)
            alt = math.nan if item.frame == Frame.MISSION else item.alt
            item = replace(item, lat_deg=self.stops[-1].lat_deg, lon_deg=self.stops[-1].lon_deg, alt=alt)
        elif not item.has_position:
            self.add_open_item(
                f"{name} without a position is not flown (the autopilot would use its current position)",
                item.seq,
            )
            return
        if item.command == Command.NAV_WAYPOINT:
            if item.params[0] > 0.0:
                # Fixed-wing aircraft do not hold: ArduPlane stores no time, PX4 (`MissionBlock::get_time_inside`) reads
                # none.
                self.notes.add("NAV_WAYPOINT with a time to hold is flown through without a hold", item.seq)
            if pass_by := pass_by_distance(item):
                self.notes.arduplane.add(
                    f"after {name} the flight continues straight for {pass_by:.0f} m, as in ArduPlane", item.seq
                )
            elif item.params[2] <= -1.0:
                # Converting a negative number to an unsigned one gives 0 on ARM and 255 on a PC; PX4 does not read it.
                distance_text = f"{item.params[2]:g} m to fly on beyond it"
                text = f"{name} with {distance_text} is flown with 0 m, but ArduPlane may fly 255 m"
                self.add_open_item(text, item.seq, px4=False)
        elif item.command == Command.NAV_SPLINE_WAYPOINT:
            self.add_open_item(f"{name} is flown as a straight waypoint", item.seq)
        elif item.command == Command.NAV_LOITER_UNLIM:
            duration_text = f"{ENDLESS_LOITER_TIME_S:.0f} s and at least one lap"
            self.notes.add(f"{name} is flown for {duration_text}; the mission ends there", item.seq)
            self.has_ended = True
        elif item.command == Command.NAV_LOITER_TURNS and (turns := arduplane_turns(item.params[0])) != item.params[0]:
            self.notes.arduplane.add(
                f"{name} with {item.params[0]:g} turns is flown as {turns:g}, as in ArduPlane", item.seq
            )
        elif stated_loiter(item) is None:
            self.add_open_item(f"{name} is flown through as a waypoint", item.seq)
        if math.isnan(item.alt):
            self.notes.add(f"{name} without an altitude is flown at the altitude of the previous item", item.seq)
        radius = item.params[1] if item.command in (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT) else 0.0
        self.stops.append(self._make_stop(item, radius if radius > 0.0 else 0.0))

    def _add_landing(self, item: MissionItem) -> None:
        """Add a landing, which ends the mission above the landing point."""
        name = command_name(item.command)
        if not self.stops:
            self.add_open_item(f"{name} before the start is not flown", item.seq)
            return
        self.has_ended = True
        if item.has_position:
            self.notes.add(f"{name} {LANDING_NOTE}", item.seq)
            if self.stops[-1].frame in OVER_TERRAIN or item.frame in OVER_TERRAIN:
                # `AP_Landing::type_slope_setup_landing_glide_slope` compares the altitudes of both items.
                text = f"{name} with an approach above terrain is flown on another glide path than ArduPlane's"
                self.add_open_item(text, item.seq, px4=False)
            self.landing = self._make_stop(item)
            self.stops.append(replace(self.landing, alt=math.nan))
        else:
            self.add_open_item(
                f"{name} without a position is not flown; the flight ends at the previous position", item.seq
            )
        if item.command == Command.NAV_VTOL_LAND:
            self.add_open_item(f"{name} is not flown straight down", item.seq)

    def _set_home(self, item: MissionItem) -> None:
        """Apply a DO_SET_HOME to all later altitudes and RTLs, as ArduPlane does (`Plane::do_set_home`)."""
        name = command_name(item.command)
        if item.params[0] == 1.0:
            if self.stops:
                self.add_open_item(f"{name} to the aircraft's current position is not flown", item.seq, px4=False)
            else:
                self.notes.arduplane.add(f"{name} before the start sets home to the position of the aircraft", item.seq)
            return
        if not item.has_position and abs(item.alt) >= _ALTITUDE_STEP_M:
            # `AP_AHRS::set_home` ignores a home only if its altitude is 0, too.
            self.add_open_item(f"{name} to 0° N 0° E is not flown", item.seq, px4=False)
            return
        if not item.has_position:
            self.notes.arduplane.add(f"{name} without a position is ignored, as in ArduPlane", item.seq)
            return
        altitude = item.alt + self.home.alt if item.frame in OVER_HOME else item.alt if item.frame in AMSL else math.nan
        if math.isnan(altitude):
            self.add_open_item(f"{name} to an unknown altitude is not flown", item.seq, px4=False)
            return
        self.home = Home(item.lat_deg, item.lon_deg, altitude)

    def _change_speed_as_arduplane(self, item: MissionItem) -> None:
        """Apply a DO_CHANGE_SPEED as ArduPlane does (`Plane::do_change_speed`)."""
        speed_type, speed, throttle = item.params[:3]
        notes = self.notes.arduplane
        sets_speed = speed_type == 1.0 or (speed_type == 0.0 and (speed > 0.0 or speed == -2.0))
        if throttle > 0.0 and not sets_speed:
            # Without a speed the item changes TRIM_THROTTLE.
            self.add_open_item("DO_CHANGE_SPEED's throttle is not flown", item.seq, px4=False)
        elif throttle > 0.0:
            notes.add("DO_CHANGE_SPEED's throttle is ignored", item.seq)
        if speed_type not in (0.0, 1.0):
            notes.add(
                f"DO_CHANGE_SPEED of type {speed_type:g}, neither airspeed nor ground speed, is ignored", item.seq
            )
        elif speed_type == 1.0:
            # The airspeed is unchanged.
            self.min_ground_speed = 0.0 if math.isnan(speed) else speed
            notes.add(f"DO_CHANGE_SPEED (ground speed) sets MIN_GROUNDSPEED to {self.min_ground_speed:g} m/s", item.seq)
        elif speed == -2.0:
            self.airspeed = math.nan
        elif speed > 0.0:
            self.airspeed = speed
        elif speed != -1.0:
            notes.add(f"DO_CHANGE_SPEED to {speed:g} m/s is ignored", item.seq)


def _error_without_position(mission: Mission) -> MissionError:
    """Return the error for a mission without a position to fly to; a gate is not such a position."""
    has_gates = any(item.command == Command.CONDITION_GATE for item in mission.items)
    reason = f"; {GATES_ARE_NO_WAYPOINTS}" if has_gates else ""
    return MissionError(
        f"{mission.source}: no item has a position to fly to; expected at least two{reason}", file=mission.source
    )
