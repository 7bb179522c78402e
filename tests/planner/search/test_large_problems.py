"""Many threats, much ground, long paths: planned within bounds of memory and evaluations."""

import resource
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.search.plan_path import plan_path
from tests.soak import SOAK, note
from world.scenario import Scenario, scenario_from_spec

THREATS, SIDE, WAYPOINTS, POPULATION = (10_000, 10_000, 200, 5000) if SOAK else (2000, 1200, 60, 400)


def wide(tmp_path: Path) -> Scenario:
    """An undulating tile of SIDE x SIDE pixels of 30 m as an .npz file, with threats at the paper's coverage."""
    rng = np.random.default_rng(7)
    rows = np.arange(SIDE, dtype=np.float32)
    heights = (120 + 80 * np.sin(rows[:, None] / 60) * np.cos(rows[None, :] / 75)).astype(np.float32)
    lat, lon = np.linspace(45.0, 45.0 + SIDE * 30 / 111_200, SIDE), np.linspace(8.0, 8.0 + SIDE * 30 / 78_700, SIDE)
    path = tmp_path / "tile.npz"
    np.savez(path, elevation=heights, xmin=lon[0], xmax=lon[-1], ymin=lat[0], ymax=lat[-1])
    half = 0.4 * SIDE * 30.0
    radius = 0.62 * half / np.sqrt(THREATS)
    threats: list[dict[str, Any]] = []
    while len(threats) < THREATS:
        east, north = rng.uniform(-half, half, 2)
        if min(np.hypot(east + 0.8 * half, north), np.hypot(east - 0.8 * half, north)) > 3 * radius:
            threats.append(
                {
                    "east_m": float(east),
                    "north_m": float(north),
                    "kill_radius_m": float(radius),
                    "kill_scale_m": float(radius / 4),
                    "detection_radius_m": float(1.5 * radius),
                    "detection_scale_m": float(radius / 2),
                }
            )
    spec = {
        "name": "wide",
        "terrain": {"kind": "dem", "path": str(path)},
        "area": {"east_m": [-half, half], "north_m": [-half, half], "ceiling_amsl_m": 500},
        "start": {"east_m": -0.8 * half, "north_m": 0, "height_m": 150},
        "destination": {"east_m": 0.8 * half, "north_m": 0, "height_m": 150},
        "threats": threats,
        "limits": {"max_turn_deg": 60, "max_climb_deg": 20, "max_dive_deg": 20},
        "planner": {"waypoints": WAYPOINTS, "population": POPULATION, "generations": 3},
    }
    return scenario_from_spec(spec, "wide", base=tmp_path)


def peak() -> int:
    """Most memory that this process has held, bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


@pytest.mark.parametrize("algorithm", ["fda-seeded", "umda-seeded", "umda"])
def test_a_large_problem_is_planned(
    tmp_path: Path,
    make_limits: Callable[[Scenario], Limits],
    algorithm: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    before, began = peak(), time.process_time()
    scenario = wide(tmp_path)
    assert scenario.terrain is not None
    assert scenario.terrain.heights.dtype == np.float32
    plan = plan_path(scenario, make_limits(scenario), seed=1, algorithm=algorithm)
    note(
        f"planner: large problem, {algorithm}",
        threats=THREATS,
        pixels=SIDE**2,
        waypoints=WAYPOINTS,
        population=POPULATION,
        feasible=int(plan.feasible),
        cpu_s=round(time.process_time() - began),
        peak_mb=round(peak() / 1e6),
    )
    if SOAK:
        with capsys.disabled():
            print(
                f"\n{algorithm}: {THREATS} threats, {SIDE} x {SIDE} pixels, {WAYPOINTS} waypoints, population "
                f"{POPULATION}: {plan.evaluations} evaluations, {time.process_time() - began:.0f} s CPU, peak memory "
                f"{before / 1e6:.0f} MB before, {peak() / 1e6:.0f} MB after, feasible: {plan.feasible}"
            )
    # The file as it was read, the window of it, and one copy; then the population, some dozens of times.
    assert peak() - before < 3 * 4 * SIDE**2 + 60 * 8 * 3 * WAYPOINTS * POPULATION + 500e6
    # The default goes through generations of a population where its seeds gave no safe path; here they give one.
    if algorithm != "fda-seeded":
        assert plan.evaluations >= POPULATION
    if algorithm == "umda":
        # The paper's planner finds nothing of this length; it runs to its end, and says so.
        assert plan.ended == "completed"
        assert not plan.feasible
        return
    assert plan.waypoints.shape == (WAYPOINTS, 3)
    assert plan.feasible, plan.certificate.problems
    distance = np.inf
    for a, b in zip(plan.waypoints[:-1], plan.waypoints[1:], strict=True):
        points = np.linspace(a, b, 60)
        near = np.abs(scenario.threats.position[:, :2] - a[:2]).max(axis=1) < 20_000
        gaps = np.linalg.norm(points[:, None] - scenario.threats.position[near][None], axis=2)
        distance = min(distance, float((gaps - scenario.threats.kill_radius[near]).min(initial=np.inf)))
    assert distance >= plan.certificate.kill_distance - 1e-6
