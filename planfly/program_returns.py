"""The worst returns, flown by ArduPlane's own program beside its law.

Each is a flight of its own, on the mission by which `planfly.return_flights` flies one by the law.  What the program
does of it counts where it is worse than what the law has; it makes nothing better.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.swift_return import CIRCLED, HIT, NEVER, OFF_GROUND, RETURN_FLOWN
from flight.autopilots.arduplane_sitl.autopilot import ArduPlaneSitl
from flight.autopilots.catalog import program_autopilot
from flight.mission.return_path import ReturnTarget
from flight.simulation.track import Track
from logs.verdict.returns.judge_returns import (
    KINDS,
    ReturnFlown,
    Returns,
    ReturnWorld,
    badness,
    doubt,
    is_steady,
    kind_of,
    zone_met,
)
from logs.verdict.returns.return_starts import ReturnStarts
from logs.verdict.returns.returns_text import measured_text
from planfly.pipeline import fly_and_judge
from planfly.return_flights import LEAD, from_start, met_on_way, return_setup
from planfly.stages import stage
from world.errors import ArgumentError, MissionError
from world.kernels import Record
from world.scenario import Scenario

Floats = NDArray[np.float64]

# The way in to a return's start is this high over the ground all along, m, or it is not flown.
_WAY_IN = 20.0
# So near (m) to a place, or headed for it within this angle (rad), a return has gone there.
_THERE, _HEADED = 500.0, math.radians(10.0)
# Rows of a second of a track.
_SECOND = 60


@dataclass(frozen=True, slots=True)
class ProgramReturn:
    """One return by the law and by the program.

    law: as it was judged.  flown: what the program made of it; None where it could not be flown.
    reason: why it could not be; "" where it was.  log: kept of the flight; None for none.
    """

    law: ReturnFlown
    flown: ReturnFlown | None = None
    reason: str = ""
    log: Path | None = None

    @property
    def agrees(self) -> bool:
        """Whether both go to the same place and come to the same."""
        return self.flown is not None and (self.flown.kind, self.flown.target.name) == (
            self.law.kind,
            self.law.target.name,
        )

    @property
    def worse(self) -> bool:
        """Whether the program does harm that the law does not."""
        return self.flown is not None and KINDS.index(self.flown.kind) < KINDS.index(self.law.kind)


@dataclass(frozen=True, slots=True)
class ProgramReturns:
    """Returns that a program flew.

    program: what it calls itself; "" where it flew none.  each: the worst first.
    """

    program: str
    each: tuple[ProgramReturn, ...]

    @property
    def flown(self) -> tuple[ProgramReturn, ...]:
        """Those that it could fly."""
        return tuple(one for one in self.each if one.flown is not None)

    def headline(self) -> str:
        """All of them in a line.

        >>> ProgramReturns("", ()).headline()
        'by the program: no return could be flown'
        """
        if not self.flown:
            return "by the program: no return could be flown"
        same = sum(one.agrees for one in self.flown)
        worse = sum(one.worse for one in self.flown)
        compared = "all of them as by the law" if same == len(self.flown) else f"{same} of them as by the law"
        compared += f"; {worse} worse than by the law, which errs there" if worse else ""
        return f"by {self.program} itself: {len(self.flown)} of the worst flown, {compared}"

    def lines(self, returns: Returns, scenario: Scenario) -> list[str]:
        """Each in a line: where it begins, what it comes to by the law and by the program, and whether they agree."""
        out = []
        for one in self.each:
            east, north, _ = one.law.start
            begins = f"{one.law.time:.0f} s, from {east:.0f} m east, {north:.0f} m north"
            law = measured_text(one.law, returns.limit, scenario)
            if one.flown is None:
                out.append(f"{begins}: by the law {law}; not flown by the program: {one.reason}")
                continue
            agree = (
                "they agree" if one.agrees else "the program's counts" if one.worse else "the law's, the worse, counts"
            )
            flown = measured_text(one.flown, returns.limit, scenario)
            out.append(f"{begins}: by the law {law}; by the program {flown}: {agree}")
        return out

    def put_right(self, returns: Returns) -> Returns:
        """Returns with what the program flew in the place of what the law has, where that is worse."""
        worse = {id(one.law): one.flown for one in self.each if one.worse}
        return replace(returns, each=tuple(worse.get(id(one)) or one for one in returns.each))


def refuse_program(program: Path) -> None:
    """Raise ArgumentError for a program whose returns nothing is known of to compare with."""
    kind = program_autopilot(program)
    if not issubclass(kind, ArduPlaneSitl):
        allowed = f"ArduPlane's program is expected: how {kind.title} returns is not flown here"
        raise ArgumentError.of_argument("autopilot", str(program), allowed)


def worst_apart(
    world: ReturnWorld, starts: ReturnStarts, returns: Returns, points: int
) -> list[tuple[ReturnFlown, int]]:
    """So many of the worst returns that a flight can begin at, the worst first, each with the number of its start.

    Their starts are further apart than half of their share of the way: neighbouring seconds show the same.
    """
    rows = starts.rows
    place = np.column_stack([rows["east"], rows["north"]])
    apart = 0.5 * float(np.hypot(*np.diff(place, axis=0).T).sum()) / points if len(starts) > 1 else 0.0
    number = {float(time): k for k, time in enumerate(starts.time)}
    chosen: list[tuple[ReturnFlown, int]] = []
    for one in sorted(returns.each, key=_worst_first):
        k = number[one.time]
        near = any(np.hypot(*(place[k] - place[other])) < apart for _, other in chosen)
        if near or starts.low[k] or not is_steady(world, rows[k]) or not _is_clear(world, rows[k]):
            continue
        chosen.append((one, k))
        if len(chosen) == points:
            break
    return chosen


def _worst_first(one: ReturnFlown) -> tuple[int, float]:
    """As `badness`; of safe ones the nearest to a limit first."""
    return (KINDS.index("safe"), doubt(one)) if one.safe else badness(one)


def _is_clear(world: ReturnWorld, row: Record) -> bool:
    """Whether the straight way in to a start is over the ground."""
    if world.scenario.terrain is None:
        return True
    velocity = np.array([float(row[f"velocity_{name}"]) for name in ("east", "north", "up")])
    begin = np.array([float(row[name]) for name in ("east", "north", "up")])
    back = np.linspace(0.0, LEAD / max(1.0, math.hypot(*velocity[:2])), 26)
    way = begin - back[:, None] * velocity
    return bool((way[:, 2] - world.scenario.terrain.height(way[:, 0], way[:, 1])).min() > _WAY_IN)


def fly_by_program(
    world: ReturnWorld, starts: ReturnStarts, returns: Returns, program: Path, points: int, folder: Path | None
) -> ProgramReturns:
    """Fly so many of the worst returns by ArduPlane's program, in the mean wind, with exact navigation.

    folder: where the logs of the flights are written, ours and the program's; None for nowhere.
    Raises FlightError for a program that does not start, or breaks off.
    """
    flown, version = [], ""
    for number, (one, k) in enumerate(worst_apart(world, starts, returns, points), 1):
        log = None if folder is None else folder / f"worst-return-{number}.mcap"
        with stage(f"flying return {number} of {points} by the program", "flying a return by a program") as advance:
            try:
                setup, airframe = return_setup(world, starts.rows[k], one.target.landing)
            except MissionError as error:
                flown.append(ProgramReturn(one, reason=str(error)))
                continue
            judged = fly_and_judge(setup, airframe, log, advance, autopilot=program, reference="never")
        version = judged.setup.autopilot.version
        found = _as_flown(world, one, starts.rows[k], judged.track, judged.ended)
        reason = "" if found else f"it does not come to where the return begins ({judged.ended})"
        flown.append(ProgramReturn(one, found, reason, log))
    return ProgramReturns(version, tuple(flown))


def _as_flown(world: ReturnWorld, law: ReturnFlown, start: Record, track: Track, ended: str) -> ReturnFlown | None:
    """What a flight made of a return that the law has flown, too; None where it did not come to its start."""
    whole = from_start(track, start)
    if whole is None:
        return None
    begin = len(track) - len(whole)
    position = _to_landing(law.target, whole)
    target = _went_to(world, law.target, position)
    met = met_on_way(world, position)
    hits = ended == "ground contact" and len(position) == len(whole)
    arrives = hits or bool(np.hypot(*(position[-1, :2] - np.array(_end_of(target)[:2]))) < _THERE)
    record: Record = np.zeros(1, RETURN_FLOWN)[0]
    clearance = min(0.0, met.clearance) if hits else met.clearance
    record["ended"] = HIT if hits or clearance <= 0.0 else CIRCLED if arrives else NEVER
    if math.isnan(clearance):
        record["ended"] = OFF_GROUND
    record["clearance"], record["outside"], record["threat"] = clearance, met.outside, met.threat
    used = float(track.energy[begin + len(position) - 1] - track.energy[begin])
    left = law.left + law.energy - used
    zone = zone_met(world, position[::_SECOND]) if world.airspace.zones else -1
    return replace(
        law,
        target=target,
        kind=kind_of(world, record, zone, left, law.floor),
        clearance=clearance,
        clearance_at=met.at,
        outside=met.outside,
        threat=met.threat,
        zone=zone,
        energy=used,
        left=left,
    )


def _end_of(target: ReturnTarget) -> tuple[float, float, float]:
    """The last place up to which a return is judged: its circle's middle, or the last place before the landing."""
    if target.landing is None:
        return target.position
    return (target.landing, *target.landing.onward)[-1].place


def _to_landing(target: ReturnTarget, position: Floats) -> Floats:
    """A way (t, 3) up to where it is judged: one to a landing sequence ends at the last place before the landing."""
    if target.landing is None:
        return position
    return position[: int(np.argmin(np.linalg.norm(position - np.array(_end_of(target)), axis=1))) + 1]


def _went_to(world: ReturnWorld, law: ReturnTarget, position: Floats) -> ReturnTarget:
    """Where a way (t, 3) leads: of all places that a return may go to, the one where it ends, or that it heads for.

    The law's where it leads to none of them.
    """
    last, before = position[-1, :2], position[max(0, len(position) - 5 * _SECOND), :2]
    course = math.atan2(*(last - before))
    best, least = law, math.inf
    for target in (law, *_others(world, law)):
        off = np.array(_end_of(target)[:2]) - last
        away = math.hypot(*off)
        turned = abs(math.remainder(math.atan2(*off) - course, math.tau))
        # One that it ends at comes before any that it heads for.
        rank = away / _THERE if away < _THERE else 1.0 + turned / _HEADED
        if rank < min(least, 2.0):
            best, least = target, rank
    return best


def _others(world: ReturnWorld, law: ReturnTarget) -> Iterator[ReturnTarget]:
    """Home and all rally points but the law's target, as targets."""
    home = ArduPlane(world.parameters).return_rules.height + world.home.up
    places = [
        ("home", (world.home.east, world.home.north, home)),
        *((f"rally point {one.number or k}", (one.east, one.north, one.up)) for k, one in enumerate(world.rally, 1)),
    ]
    for name, place in places:
        if name != law.name:
            yield ReturnTarget(place, name, "", math.nan)
