"""Missions made anew over the demo's terrain that take off, land or return through a ridge: none of them is flyable.

What stands in the way is found by plain sums over points ten metres apart, from the places alone, by more than the law,
the aircraft or the elevation could make good.  `scaled` makes ten of each in a soak, and one otherwise.
"""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from planfly.cli import main
from tests.soak import note, scaled
from world.arrays import Floats
from world.frames import to_geo
from world.scenario import load_scenario

WORLD = load_scenario("jacksboro-air")
SEED = 350
# m.  Legs between waypoints keep this height above ground, and what is met is at least so far above the way.
FREE, DEEP = 80.0, 40.0
# Steeper than an Aerosonde climbs, m per m: 5.6 m/s at 25 m/s are 0.23.
CLIMB = 0.30
# m over home that a return descends to (RTL_ALTITUDE), and m that may be lost or gained by its turn and its lag.
RETURN_HEIGHT, RETURN_ERROR = 100.0, 60.0


def ground(points: Floats) -> Floats:
    """Heights of the ground under places (n, 2), m AMSL."""
    assert WORLD.terrain is not None
    return np.asarray(WORLD.terrain.height(points[:, 0], points[:, 1]))


def line(begin: Floats, end: Floats) -> Floats:
    """Places ten metres apart, (n, 2)."""
    return np.linspace(begin, end, 2 + int(math.dist(begin, end) / 10.0))


def ahead(place: Floats, course: float, run: float) -> Floats:
    return place + run * np.array([math.sin(course), math.cos(course)])


def row(command: int, place: Floats, amsl: float) -> str:
    lat, lon = (float(value) for value in to_geo(WORLD.origin, place[0], place[1]))
    return f"0 {command} 0 0 0 0 {lat:.7f} {lon:.7f} {amsl:.1f}"


def over(places: Floats) -> float:
    """A height from which a level way is free, m AMSL."""
    return float(ground(places).max()) + FREE


def take_off(rng: np.random.Generator, home: Floats, course: float, *, item: bool = True) -> list[str] | None:
    """Up from home to a place behind a ridge that no climb clears; None for no ridge.  item: with a NAV_TAKEOFF."""
    next_place, last = ahead(home, course, rng.uniform(1500.0, 3000.0)), ahead(home, course, 5000.0)
    way = line(home, next_place)
    run = np.hypot(*(way - home).T)
    room = ground(home[None])[0] + CLIMB * run - ground(way)
    if not room[run > 200.0].min() < -DEEP:
        return None
    high = over(line(home, last))
    first = [f"0 22 15 0 0 0 0 0 {high:.1f}"] if item else []
    # An unlimited loiter: nothing returns.
    return [*first, row(16, next_place, high), row(17, last, high)]


def from_the_air(rng: np.random.Generator, home: Floats, course: float) -> list[str] | None:
    return take_off(rng, home, course, item=False)


def landing(rng: np.random.Generator, home: Floats, course: float) -> list[str] | None:
    """Down to home on a glide that a ridge stands in; None for none."""
    begin = ahead(home, course, rng.uniform(1200.0, 2500.0))
    first = ahead(home, course, 5000.0)
    way, field = line(begin, home), float(ground(home[None])[0])
    high = over(line(first, begin)[:-1])
    share = np.linspace(0.0, 1.0, len(way))
    room = high + (field - high) * share - ground(way)
    away = np.hypot(*(way - home).T)
    # No ridge within the flare, and no glide that could not be flown, which fails by itself.
    if high < field + FREE or not room[away > 150.0].min() < -DEEP or (high - field) / away[0] > 0.10 or room[0] < FREE:
        return None
    return [row(16, first, high), row(16, begin, high), row(21, home, field)]


def going_back(rng: np.random.Generator, home: Floats, course: float) -> list[str] | None:
    """Out over a ridge and back by a return that descends to 100 m over home on a straight line; None for no ridge."""
    near, far = ahead(home, course, 600.0), ahead(home, course, rng.uniform(4000.0, 7000.0))
    way, base = line(far, home), float(ground(home[None])[0])
    high = over(line(home, ahead(home, course, 8000.0)))
    straight = np.linspace(high, base + RETURN_HEIGHT, len(way))
    away = np.hypot(*(way - home).T)
    middle = (away > 800.0) & (away < away[0] - 800.0)
    # The climb to the first place is for the climb-out rule: home is level enough there.
    if not (straight - ground(way))[middle].min() < -RETURN_ERROR:
        return None
    return [row(16, near, high), row(16, far, high), "0 20 0 0 0 0 0 0 0"]


def last_item(rng: np.random.Generator, home: Floats, course: float) -> list[str] | None:
    """The same without an item that says so: ArduPlane returns after its last item."""
    rows = going_back(rng, home, course)
    return None if rows is None else rows[:-1]


Maker = Callable[[np.random.Generator, Floats, float], list[str] | None]
# Kind, maker, and the least exit code: a mission that begins in the air is at best not judged in full.
KINDS: dict[str, tuple[Maker, tuple[int, ...], str]] = {
    "take-off": (take_off, (4,), "climb-out"),
    "landing": (landing, (4,), "approach"),
    "return": (going_back, (4,), "clearance"),
    "last item": (last_item, (4,), "return"),
    "first leg": (from_the_air, (3, 4), "climb from home"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_what_leads_through_a_ridge_is_not_flyable(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, codes, said = KINDS[kind]
    rng, made, drawn = np.random.default_rng([SEED, list(KINDS).index(kind)]), 0, 0
    wanted = scaled(10, 1)
    while made < wanted:
        drawn += 1
        home, course = rng.uniform(-6000.0, 6000.0, 2), rng.uniform(0.0, 2.0 * math.pi)
        rows = make(rng, home, course)
        if rows is None:
            continue
        made += 1
        file = tmp_path / f"{made}.waypoints"
        lines = [row(16, home, float(ground(home[None])[0])), *rows]
        text = "\n".join(["QGC WPL 110", *(f"{k} 0 {one} 1" for k, one in enumerate(lines))])
        file.write_text(text, encoding="utf-8")
        code = main(["check", str(file), "--terrain", "jacksboro", "--autopilot", "ardupilot"])
        told = capsys.readouterr().out.splitlines()[0]
        assert code in codes, (text, told)
        assert said in told, (text, told)
    note(f"missions through a ridge: {kind}", made=made, drawn=drawn)
