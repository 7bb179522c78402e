"""Drawn missions with sharp turns, places visited twice, jumps and loiters: `check` gives the answer of `fly`.

`python -m tests.planfly.test_check_agrees_with_fly 300` prints how the answers of 300 missions compare.
"""

import collections
import itertools
import math
import sys
import tempfile
from pathlib import Path

import numpy as np

import planfly
from planfly.cli import main
from tests.soak import note, scaled
from world.frames import to_geo
from world.scenario import load_scenario

WORLD = load_scenario("jacksboro-air")
SEED = 6200
# m above the highest ground of a mission; low enough that some missions meet the ground.
HEIGHTS_M = (60.0, 150.0, 400.0)
LAWS = ("ardupilot", "ardupilot", "px4")


def draw_mission(seed: int) -> tuple[str, str]:
    """Return the text of a mission over the demo's ground, and the autopilot that flies it.

    Three to seven legs of 400 to 2,500 m; a third of the turns are within 15 degrees of a reversal; four in ten
    missions end where they begin, and some jump back or loiter.
    """
    rng = np.random.default_rng(seed)
    places, course = [rng.uniform(-1500.0, 1500.0, 2)], rng.uniform(-math.pi, math.pi)
    for _ in range(int(rng.integers(3, 8))):
        places.append(places[-1] + rng.uniform(400.0, 2500.0) * np.array([math.sin(course), math.cos(course)]))
        reverses = rng.random() < 1.0 / 3.0
        turn = rng.uniform(165.0, 180.0) if reverses else rng.uniform(0.0, 120.0)
        course += math.radians(turn) * rng.choice([-1.0, 1.0])
    if rng.random() < 0.4:
        places.append(places[0])
    assert WORLD.terrain is not None
    ways = np.concatenate([np.linspace(a, b, 50) for a, b in itertools.pairwise(places)])
    base = float(np.nanmax(WORLD.terrain.height(ways[:, 0], ways[:, 1]))) + rng.choice(HEIGHTS_M) - 100.0
    rows, home = [], to_geo(WORLD.origin, *places[0])
    for place in places:
        lat, lon = (float(value) for value in to_geo(WORLD.origin, place[0], place[1]))
        rows.append(f"0 16 0 0 0 0 {lat:.7f} {lon:.7f} {base + rng.uniform(0.0, 60.0):.1f}")
    if rng.random() < 0.3:
        at = int(rng.integers(1, len(rows)))
        kind, params = ((18, "2 0 120 0"), (19, "30 0 150 0"), (31, "0 120 0 0"))[int(rng.integers(3))]
        rows[at] = rows[at].replace("0 16 0 0 0 0", f"0 {kind} {params}")
    if rng.random() < 0.25:
        rows.append(f"2 177 {int(rng.integers(1, len(rows)))} 1 0 0 0 0 0")
    if rng.random() < 0.2:
        rows.append("0 20 0 0 0 0 0 0 0")
    ground = float(WORLD.terrain.height(*places[0]))
    first = f"0 1 0 16 0 0 0 0 {float(home[0]):.7f} {float(home[1]):.7f} {ground:.1f} 1"
    lines = [f"{k} 0 {row} 1" for k, row in enumerate(rows, 1)]
    return "\n".join(["QGC WPL 110", first, *lines]) + "\n", str(rng.choice(LAWS))


def test_a_mission_that_check_calls_flyable_is_one_that_fly_calls_flyable(tmp_path: Path) -> None:
    count, same = scaled(300, 3), 0
    for seed in range(SEED, SEED + count):
        file = tmp_path / "drawn.waypoints"
        text, law = draw_mission(seed)
        file.write_text(text, encoding="utf-8")
        log = ("--log", str(tmp_path / f"{seed}.mcap"))
        given = [str(file), "--terrain", "jacksboro", "--autopilot", law]
        codes = [main([command, *given, *more]) for command, more in (("check", ()), ("fly", log))]
        assert codes[0] == codes[1], text
        same += 1
    note("check and fly on drawn missions", missions=count, agree=same)


def compare_levels(count: int) -> None:
    """Print how the answers of flight and geometry compare, and each mission that geometry alone calls flyable."""
    answers: collections.Counter[tuple[str, str]] = collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "drawn.waypoints"
        for seed in range(SEED, SEED + count):
            text, law = draw_mission(seed)
            file.write_text(text, encoding="utf-8")
            flown, geometric = (
                planfly.check(str(file), terrain="jacksboro", autopilot=law, geometry=geometry)
                for geometry in (False, True)
            )
            said = tuple(
                "flyable" if one.flyable else "open" if not one.failed else "not flyable" for one in (flown, geometric)
            )
            answers[said] += 1
            if said == ("not flyable", "flyable"):
                print(seed, law, flown.headline, flush=True)
    for (flight, geometry), number in sorted(answers.items()):
        print(f"flight {flight}, geometry {geometry}: {number}")


if __name__ == "__main__":
    compare_levels(int(sys.argv[1]))
