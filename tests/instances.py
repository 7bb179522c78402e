"""The hard set and random instances like it: a generator with fixed seeds, and a grid search that knows no planner.

``python -m tests.instances`` writes ``world/scenarios/hard-*.toml`` again.  The seed is the paper's year and was not
chosen by any planner's results.  Draws that the grid search cannot pass are skipped, and a file says which draw it is.
"""

import math
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from world.arrays import Flags, Floats

SEED = 2014
SCENARIOS = Path(__file__).parents[1] / "world" / "scenarios"

# The ground of the paper-* files: east, north, height, sigma (m).
PEAKS = (
    (1800, 3200, 520, 700),
    (3000, 1200, 450, 600),
    (4200, 4300, 600, 800),
    (2200, 6600, 560, 800),
    (5200, 7600, 520, 700),
    (6600, 5200, 480, 650),
    (6200, 2400, 560, 800),
    (8600, 3800, 500, 700),
    (8300, 8400, 800, 650),
)
MAP = 10_000.0
CEILING = 600.0
START = np.array([500.0, 500.0, 300.0])
DESTINATION = np.array([9600.0, 9600.0, 500.0])
CLIMB_DEG, DIVE_DEG = 20.0, 25.0
# Kill radii, uniform between these; detection radii are 1.5 times as large.
KILL_RADIUS = (450.0, 750.0)
# Threats stand so that the ends are at least this far outside their spheres, m.
AWAY = 200.0
# The paper's waypoints and population for each number of threats (section V).
SIZES = {7: (10, 120), 15: (12, 200), 30: (15, 300), 60: (20, 500)}


@dataclass(frozen=True, slots=True)
class Instance:
    """One draw: threats (m, 3) of whole metres, kill radii (m,), and which draw of its seed it was."""

    positions: Floats
    radii: Floats
    draw: int


def ground(east: Floats, north: Floats) -> Floats:
    """Height of the ground, m: the sum of the peaks in closed form."""
    total = np.zeros(np.broadcast(east, north).shape)
    for pe, pn, height, sigma in PEAKS:
        total += height * np.exp(-((east - pe) ** 2 + (north - pn) ** 2) / (2.0 * sigma**2))
    return total


def draw_threats(rng: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """Units on the ground anywhere on the map, to 10 m, whose missiles reach neither end."""
    positions, radii = np.empty((count, 3)), np.empty(count)
    found = 0
    while found < count:
        east, north = np.round(rng.uniform(0.0, MAP, 2) / 10.0) * 10.0
        radius = round(rng.uniform(*KILL_RADIUS) / 10.0) * 10.0
        place = np.array([east, north, ground(east, north)])
        if min(math.dist(place, START), math.dist(place, DESTINATION)) < radius + AWAY:
            continue
        positions[found], radii[found] = place, radius
        found += 1
    return positions, radii


def make_instance(seed: int, threats: int) -> Instance:
    """First draw of this seed that the grid search can pass."""
    draw = 0
    while True:
        rng = np.random.default_rng([SEED, threats, seed, draw])
        positions, radii = draw_threats(rng, threats)
        if passable(positions, radii):
            return Instance(positions, radii, draw)
        draw += 1


def places_across(pitch: float) -> Floats:
    """Return the places of a stage across the straight line (n,), m, the middle one on it."""
    half = int(math.dist(START[:2], DESTINATION[:2]) / 2.0 / pitch)
    return np.arange(-half, half + 1) * pitch


@cache
def highest_ground(stage: int, pitch: float) -> Floats:
    """Return the highest ground within a pitch of each place of a stage, m: most of what a grid search takes."""
    c, s = (DESTINATION[:2] - START[:2]) / math.dist(START[:2], DESTINATION[:2])
    across = places_across(pitch)
    east, north = START[0] + c * stage * pitch - s * across, START[1] + s * stage * pitch + c * across
    low = np.full(across.size, -np.inf)
    for i in np.linspace(-1.0, 1.0, 5):
        for j in np.linspace(-1.0, 1.0, 5):
            shift_e, shift_n = pitch * (c * i - s * j), pitch * (s * i + c * j)
            low = np.maximum(low, ground(east + shift_e, north + shift_n))
    return low


def passable(positions: Floats, radii: Floats, pitch: float = 65.0, layer: float = 11.0) -> bool:
    """Whether a grid way exists: monotone along, within slopes, 45 degree turns, terrain, missiles, ceiling and map.

    States are (course of -45, 0 or +45 degrees from the line, place across, layer); each stage goes one pitch
    along.  A cell is open if it is outside all kill spheres, grown so that steps between open cells stay outside too,
    and 15 m above the highest ground of the cells around it.
    """
    span = DESTINATION[:2] - START[:2]
    length = math.hypot(*span)
    stages = math.ceil(length / pitch)
    pitch = length / stages
    c, s = span / length
    across = places_across(pitch)
    half = len(across) // 2
    up = START[2] + np.arange(-int(START[2] / layer), int((CEILING - START[2]) / layer) + 1) * layer
    rises = (
        int(pitch * math.tan(math.radians(CLIMB_DEG)) / layer),
        int(pitch * math.tan(math.radians(DIVE_DEG)) / layer),
    )
    longest = pitch * math.sqrt(2.0 + math.tan(math.radians(DIVE_DEG)) ** 2 * 2.0)
    grown = np.sqrt(radii**2 + (longest / 2.0) ** 2)

    def open_cells(stage: int) -> Flags:
        east, north = START[0] + c * stage * pitch - s * across, START[1] + s * stage * pitch + c * across
        low = highest_ground(stage, pitch)
        cells = up[None, :] >= low[:, None] + 15.0
        cells &= ((east >= 0) & (east <= MAP) & (north >= 0) & (north <= MAP))[:, None]
        for place, radius in zip(positions, grown, strict=True):
            beside = (east - place[0]) ** 2 + (north - place[1]) ** 2
            if beside.min() < radius**2:
                cells &= beside[:, None] + (up[None, :] - place[2]) ** 2 > radius**2
        return cells

    state = np.zeros((3, across.size, up.size), dtype=bool)
    state[:, half, np.argmin(np.abs(up - START[2]))] = True
    for stage in range(1, stages + 1):
        after = np.zeros_like(state)
        cells = open_cells(stage)
        for side in (-1, 0, 1):
            # Turns of at most 45 degrees: the course before differs by one at most.
            before = state[max(0, side) : min(3, side + 3)].any(axis=0) if side else state.any(axis=0)
            spread = _climbed(before, *rises)
            moved = np.zeros_like(spread)
            to, of = slice(max(0, side), across.size + min(0, side)), slice(max(0, -side), across.size - max(0, side))
            moved[to] = spread[of]
            after[side + 1] = moved & cells
        state = after
        if not state.any():
            return False
    return bool(state[:, half, np.argmin(np.abs(up - DESTINATION[2]))].any())


def _climbed(cells: Flags, climb: int, dive: int) -> Flags:
    """Layers that one stage reaches from the given ones (across, layers)."""
    out = cells.copy()
    for step in range(1, climb + 1):
        out[:, step:] |= cells[:, :-step]
    for step in range(1, dive + 1):
        out[:, :-step] |= cells[:, step:]
    return out


def scenario_text(name: str, instance: Instance, description: str) -> str:
    """The instance as a scenario file."""
    count = len(instance.radii)
    waypoints, population = SIZES[count]
    lines = [
        f'name = "{name}"',
        f'description = "{description}"',
        "",
        "# Made by `python -m tests.instances`: the ground, start and destination of the paper-* files, a ceiling of",
        f"# 600 m, {count} units on the ground with kill radii uniform in 450..750 m and detection radii 1.5 times as",
        f"# large; slopes -25..+20 degrees.  Seed {SEED} was fixed before any planner ran; draw {instance.draw} is the",
        "# first that a coarse grid search (monotone along, within slopes and turns, no planner code) can pass.",
        "# Waypoints, population and generations are the paper's.  The area, not a strip, bounds the search.",
        "",
        "[terrain]",
        'kind = "peaks"',
        "",
    ]
    lines += _peak_lines()
    lines += [
        "[area]",
        "east_m = [0, 10000]",
        "north_m = [0, 10000]",
        "floor_amsl_m = 0",
        f"ceiling_amsl_m = {CEILING:.0f}",
        "",
    ]
    for key, point in (("start", START), ("destination", DESTINATION)):
        lines += [f"[{key}]", f"east_m = {point[0]:.0f}", f"north_m = {point[1]:.0f}", f"amsl_m = {point[2]:.0f}", ""]
    lines += [
        "[limits]",
        "max_turn_deg = 45",
        f"max_climb_deg = {CLIMB_DEG:.0f}",
        f"max_dive_deg = {DIVE_DEG:.0f}",
        "min_clearance_m = 0",
        "",
        "[planner]",
        f"waypoints = {waypoints}",
        f"population = {population}",
        "generations = 100",
        "",
        "[flight]",
        'aircraft = "aerosonde"',
        "airspeed_mps = 25",
    ]
    return "\n".join(lines + _threat_lines(instance)) + "\n"


def _peak_lines() -> list[str]:
    lines = []
    for pe, pn, height, sigma in PEAKS:
        lines += [
            "[[terrain.peak]]",
            f"east_m = {pe}",
            f"north_m = {pn}",
            f"height_m = {height}",
            f"sigma_m = {sigma}",
            "",
        ]
    return lines


def _threat_lines(instance: Instance) -> list[str]:
    lines = []
    for number, (place, radius) in enumerate(zip(instance.positions, instance.radii, strict=True), 1):
        lines += [
            "",
            "[[threats]]",
            f'name = "unit {number}"',
            f"east_m = {place[0]:.0f}",
            f"north_m = {place[1]:.0f}",
            f"kill_radius_m = {radius:.0f}",
            f"kill_scale_m = {radius / 2:.0f}",
            f"detection_radius_m = {1.5 * radius:.0f}",
            f"detection_scale_m = {0.75 * radius:.0f}",
        ]
    return lines


def random_scenario(seed: int, threats: int = 60) -> str:
    """A fresh instance of the hard family, as a scenario file's text; the hard set itself is seed 0."""
    return scenario_text(f"random-{threats}-{seed}", make_instance(seed, threats), f"random instance {seed}")


def hard_scenario(threats: int) -> str:
    """The text of ``hard-NN.toml``."""
    waypoints, population = SIZES[threats]
    description = (
        f"{threats} threats, denser and lower than the paper's: ceiling 600 m, kill radii 450..750 m; "
        f"{waypoints} waypoints, {population} paths"
    )
    return scenario_text(f"hard-{threats:02d}", make_instance(0, threats), description)


if __name__ == "__main__":
    for number in SIZES:
        target = SCENARIOS / f"hard-{number:02d}.toml"
        target.write_text(hard_scenario(number), encoding="utf-8")
        sys.stdout.write(f"{target.name}\n")
