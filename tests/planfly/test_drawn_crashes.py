"""Drawn missions that meet the ground or a zone on the way, half of them loops that end with a return to launch.

Leg, item and place of the event are found from the drawn places, the ground and the raw track by plain sums: nothing of
planfly's alignment is used.  `scaled` makes 100 in a soak, and a few otherwise.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import planfly
from logs.verdict.findings import Finding
from tests.soak import scaled
from world.arrays import Floats
from world.frames import to_geo, to_map
from world.scenario import load_scenario

WORLD = load_scenario("jacksboro-air")
SEED = 620
COUNT = scaled(100, 4)
# m.  What is met lies so far from the ends of its leg; a free way stays so high above ground; what is met rises as much
# over the way.
FROM_ENDS, FREE, DEEP = 250.0, 35.0, 15.0
# m.  Radius of a drawn zone, and by how much the flight may be beside and above its legs.
ZONE, ASIDE = 120.0, 60.0


@dataclass(frozen=True)
class Drawn:
    """A mission.

    places: (w, 2) m, home first.  up: m AMSL.  leg: on which something is met.  zone: its middle, m; None for ground.
    """

    places: Floats
    up: float
    leg: int
    returns: bool
    zone: Floats | None


def ground(points: Floats) -> Floats:
    assert WORLD.terrain is not None
    return np.asarray(WORLD.terrain.height(points[:, 0], points[:, 1]))


def along(a: Floats, b: Floats) -> Floats:
    return np.linspace(a, b, 2 + int(math.dist(a, b) / 5.0))


def met_on(places: Floats, up: float) -> int | None:
    """The leg on which a level way meets the ground, well between its ends; None for none, or where it is not clear."""
    for leg in range(len(places) - 1):
        points = along(places[leg], places[leg + 1])
        over = up - ground(points)
        if np.isnan(over).any():
            return None
        below = np.flatnonzero(over <= 0.0)
        if not below.size:
            if over.min() < FREE:
                return None
            continue
        first = points[below[0]]
        clear = min(math.dist(first, places[leg]), math.dist(first, places[leg + 1])) > FROM_ENDS
        return leg if clear and over.min() < -DEEP else None
    return None


def draw(k: int) -> Drawn:
    """The k-th mission: every other one a loop with a return to launch, every fourth with a zone in place of ground."""
    rng = np.random.default_rng([SEED, k])
    returns, zoned = k % 2 == 1, k % 4 in (2, 3) and k % 8 < 4
    (west, east), (south, north) = WORLD.bounds[0], WORLD.bounds[1]
    while True:
        places = [rng.uniform((west + 3000.0, south + 3000.0), (east - 3000.0, north - 3000.0))]
        course = rng.uniform(0.0, 2.0 * math.pi)
        side = rng.choice((-1.0, 1.0))
        for _ in range(int(rng.integers(3, 6))):
            step = rng.uniform(900.0, 3500.0) * np.array([math.sin(course), math.cos(course)])
            places.append(places[-1] + step)
            course += side * math.radians(rng.uniform(20.0, 100.0)) * (1.0 if returns else rng.choice((-1.0, 1.0)))
        if returns:
            places.append(places[0] + 30.0)
        drawn = np.array(places)
        if (drawn < (west + 500.0, south + 500.0)).any() or (drawn > (east - 500.0, north - 500.0)).any():
            continue
        up = float(ground(drawn[:1])[0]) + rng.uniform(90.0, 200.0)
        turns = np.abs(np.diff(np.unwrap(np.arctan2(*np.diff(drawn, axis=0).T))))
        if turns.max() > math.radians(120.0) or np.hypot(*np.diff(drawn, axis=0).T).min() < 800.0:
            continue
        if not zoned:
            leg = met_on(drawn, up)
            if leg:
                return Drawn(drawn, up, leg, returns, None)
            continue
        up = max(float(np.nanmax(ground(along(a, b)))) for a, b in pairwise(drawn)) + 150.0
        leg = int(rng.integers(1, len(drawn) - 1))
        middle = drawn[leg] + rng.uniform(0.4, 0.6) * (drawn[leg + 1] - drawn[leg])
        others = [along(drawn[n], drawn[n + 1]) for n in range(len(drawn) - 1) if n != leg]
        back = [along(drawn[-1], drawn[0])] if returns else []
        if min(np.hypot(*(points - middle).T).min() for points in (*others, *back)) > ZONE + 300.0:
            return Drawn(drawn, up, leg, returns, middle)


def row(number: int, command: int, place: Floats, up: float, p1: float = 0.0) -> str:
    lat, lon = (float(value) for value in to_geo(WORLD.origin, place[0], place[1]))
    return f"{number}\t{int(number == 0)}\t0\t{command}\t{p1}\t0\t0\t0\t{lat:.7f}\t{lon:.7f}\t{up:.1f}\t1"


def write(drawn: Drawn, folder: Path) -> tuple[Path, list[Path]]:
    """The mission, items from 1 on, and its fence."""
    home = row(0, 16, drawn.places[0], float(ground(drawn.places[:1])[0]))
    rows = [home, *(row(n, 16, place, drawn.up) for n, place in enumerate(drawn.places, 1))]
    if drawn.returns:
        rows.append(f"{len(rows)}\t0\t0\t20\t0\t0\t0\t0\t0\t0\t0\t1")
    mission = folder / "drawn.waypoints"
    mission.write_text("\n".join(["QGC WPL 110", *rows, ""]), encoding="utf-8")
    if drawn.zone is None:
        return mission, []
    fence = folder / "drawn-fence.waypoints"
    circle = row(1, 5004, drawn.zone, 0.0, ZONE)
    fence.write_text("\n".join(["QGC WPL 110", home, circle, ""]), encoding="utf-8")
    return mission, [fence]


@pytest.mark.parametrize("k", range(COUNT))
def test_an_event_is_named_by_its_leg_item_and_place(k: int, tmp_path: Path) -> None:
    drawn = draw(k)
    mission, fence = write(drawn, tmp_path)
    flown = planfly.fly(mission, terrain="jacksboro", fence=fence)
    origin = flown.setup.scenario.origin
    geo = [to_geo(WORLD.origin, *place) for place in drawn.places]
    places = np.array([to_map(origin, float(lat), float(lon)) for lat, lon in geo])
    a, b, item = places[drawn.leg], places[drawn.leg + 1], drawn.leg + 2
    name, position = f"leg {drawn.leg} (to item {item})", flown.track.position
    assert not flown.verdict.flyable
    if drawn.zone is not None:
        middle = np.array(to_map(origin, *(float(value) for value in to_geo(WORLD.origin, *drawn.zone))))
        inside = np.flatnonzero(np.hypot(*(position[:, :2] - middle).T) < ZONE)
        (zone,) = (one for one in flown.verdict.findings if one.rule == "fence" and one.ok is False)
        where = event(zone.reason.partition("enters it at ")[2], name)
        assert math.dist(where, position[inside[0], :2]) < 2.0
        return
    # The flight is over, beside the leg that was drawn into the ground, and on it.
    end = position[-1]
    terrain = flown.setup.scenario.terrain
    assert terrain is not None
    assert end[2] - float(terrain.height(end[:1], end[1:2])[0]) < 1.0
    unit = (b - a) / math.dist(a, b)
    run, aside = float((end[:2] - a) @ unit), float((end[:2] - a) @ (unit[1], -unit[0]))
    assert abs(aside) < ASIDE
    assert 0.0 < run < math.dist(a, b)
    contact, short = (find(flown.verdict.findings, rule) for rule in ("departure", "clearance"))
    assert math.dist(event(contact.reason.partition("ground contact at ")[2], name), end[:2]) < 2.0
    assert (short.place.number, short.place.to_item) == (drawn.leg, item)
    assert any(change.what == "height" and change.place == short.place for one in short.suggestions for change in one)
    for one in flown.verdict.findings:
        ahead = one.place.number is not None and one.place.number > drawn.leg
        if one.place.kind == "leg" and ahead:
            assert one.ok is None, one
        if one.place.kind == "waypoint" and one.rule == "waypoint":
            assert (one.ok is True) is not ahead, one


def find(findings: tuple[Finding, ...], rule: str) -> Finding:
    """The finding of a rule that failed, of which there is one."""
    (found,) = (one for one in findings if one.rule == rule and one.ok is False)
    return found


def event(text: str, name: str) -> Floats:
    """East and north of an event's text, m, which names its leg as well."""
    assert name in text
    east, north = (float(text.partition(f"{axis} ")[2].partition(" m")[0]) for axis in ("east", "north"))
    return np.array([east, north])
