"""Lists of the threats near a place: every one that reaches it is there, and no score is changed by them."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated_encoding
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import THREAT, make_problem
from planner.evaluation.threat_index import kill_density, make_missile_index, make_threat_cells
from world.geometry import segment_exposure
from world.scenario import Scenario


def test_cells_hold_every_threat_that_reaches_them() -> None:
    rng = np.random.default_rng(1)
    bounds = np.array([[-5000.0, 5000.0], [-3000.0, 3000.0]])
    position = np.column_stack([rng.uniform(-7000, 7000, (300, 2)), np.zeros(300)])
    radius = rng.uniform(0, 600, 300) * (rng.random(300) < 0.9)
    cells = make_threat_cells(position, radius, bounds)
    for place in rng.uniform(-8000, 8000, (2000, 2)):
        col, row = np.floor((place - [cells.west, cells.south]) / cells.side).astype(int)
        inside = 0 <= col < cells.columns and 0 <= row < cells.rows
        cell = cells.cells[row * cells.columns + col if inside else cells.columns * cells.rows]
        listed = set(cells.units[cell["first"] : cell["first"] + cell["count"]].tolist())
        away = np.hypot(*(position[:, :2] - place).T)
        assert set(np.flatnonzero((away <= radius) & (radius > 0)).tolist()) <= listed


@pytest.mark.parametrize("evaluate", [paper_scores, graded_scores])
def test_cells_change_no_score(
    evaluate: Callable[..., tuple[np.ndarray, np.ndarray]],
    small: Callable[..., Scenario],
    make_limits: Callable[[Scenario], Limits],
) -> None:
    """Against the same scores with one cell for everything, which asks every threat."""
    rng = np.random.default_rng(3)
    threats = [
        {
            "east_m": float(east),
            "north_m": float(north),
            "kill_radius_m": float(radius),
            "kill_scale_m": 100.0,
            "detection_radius_m": float(2 * radius),
            "detection_scale_m": 200.0,
        }
        for east, north, radius in zip(
            rng.uniform(500, 5500, 80), rng.uniform(-2900, 2900, 80), rng.uniform(50, 300, 80), strict=True
        )
    ]
    scenario = small(threats=threats)
    data = make_problem(scenario, make_limits(scenario)).search
    space = make_problem(scenario, make_limits(scenario)).space
    far = np.array([[1e8, 1e8 + 1.0], [1e8, 1e8 + 1.0]])
    units = scenario.threats
    everything = data._replace(
        threat_cells=make_threat_cells(units.position, units.detection_radius, far),
        missiles=make_missile_index(data.threats, side=1e9),
    )
    encoding = rotated_encoding(space, 12)
    paths = encoding.decode(rng.uniform(encoding.lower, encoding.upper, (60, encoding.lower.size)))
    for one, two in zip(evaluate(data, paths), evaluate(everything, paths), strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-15)


# ----------------------------------------------------------------------
# Exposure to the missiles beside a line, against plain sums over all of them.

MARGIN = 15.0


def threats_of(rng: np.random.Generator, count: int, largest: float) -> np.ndarray:
    """Missiles of radii from 20 m up, some without any, in a few places twice."""
    place = np.column_stack([rng.uniform(-5000.0, 5000.0, (count, 2)), rng.uniform(0.0, 600.0, count)])
    place[: count // 10] = place[-(count // 10) - 1 : -1]
    radius = np.exp(rng.uniform(math.log(20.0), math.log(largest), count)) * (rng.random(count) < 0.9)
    out = np.zeros(count, dtype=THREAT)
    out["east"], out["north"], out["up"] = place.T
    out["kill_radius"], out["kill_scale"] = radius, rng.uniform(10.0, 300.0, count)
    return out


def line_of(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, np.ndarray]:
    a = np.append(rng.uniform(-7000.0, 7000.0, 2), rng.uniform(0.0, 800.0))
    step = np.append(rng.normal(0.0, 1500.0, 2), rng.normal(0.0, 300.0))
    changes = {
        "any": step,
        "eastward": step * [1.0, 0.0, 1.0],
        "northward": step * [0.0, 1.0, 1.0],
        "upright": step * [0.0, 0.0, 1.0],
        "none": 0.0 * step,
        "short": 0.01 * step,
    }
    return a, a + changes[kind]


@settings(max_examples=120, deadline=None)
@given(
    st.integers(0, 10_000),
    st.sampled_from([(1, 3000.0), (3, 3000.0), (200, 3000.0), (4000, 150.0)]),
    st.sampled_from(["any", "eastward", "northward", "upright", "none", "short"]),
)
def test_kill_density_is_that_of_all_missiles(seed: int, many: tuple[int, float], kind: str) -> None:
    rng = np.random.default_rng(seed)
    threats = threats_of(rng, *many)
    armed = threats[threats["kill_radius"] > 0.0]
    centres = np.stack([armed["east"], armed["north"], armed["up"]], axis=1)
    missiles = make_missile_index(threats)
    assert len(missiles.missiles) == len(armed)

    def nearest(p: np.ndarray, part: np.ndarray) -> np.ndarray:
        """Distance from each missile's sphere to the line from p."""
        along = np.clip((centres - p) @ part / max(part @ part, 1e-300), 0.0, 1.0)
        return np.linalg.norm(p + along[:, None] * part - centres, axis=1) - armed["kill_radius"] - MARGIN

    for _ in range(10):
        a, b = line_of(rng, kind)
        length = float(np.linalg.norm(b - a))
        first, last, within = rng.uniform(0.0, 400.0, 3) * [1.0, 1.0, 0.1]
        dose, near_a, near_b = kill_density(missiles, MARGIN, within, *a, *b, first, last, 0.0, 0.0)
        inside = nearest(a, b - a) < 1.0
        expected = sum(
            segment_exposure(a, b, centre, unit["kill_radius"] + MARGIN, unit["kill_scale"])[1]
            for centre, unit in zip(centres[inside], armed[inside], strict=True)
        )
        assert dose == pytest.approx(expected, rel=1e-9, abs=1e-15)
        for got, p, q, length_there in ((near_a, a, b, first), (near_b, b, a, last)):
            part = (q - p) * min(1.0, length_there / length if length > 0.0 else 1.0)
            true = float(nearest(p, part).min(initial=math.inf))
            # Right if less than `within`, and beyond it no nearer than that.
            assert got == pytest.approx(true, abs=1e-6) if true < within else got >= within - 1e-6


def test_no_missiles_at_all() -> None:
    missiles = make_missile_index(np.zeros(0, dtype=THREAT))
    assert kill_density(missiles, MARGIN, 30.0, *np.zeros(3), *np.ones(3), 1.0, 1.0, 0.0, 0.0) == (
        0.0,
        math.inf,
        math.inf,
    )


@pytest.mark.parametrize("over", [300.0, -300.0])
def test_a_flight_below_or_above_its_leg_comes_nearer(over: float) -> None:
    """A level leg 400 m beside a missile of 480 m and 300 m over or under it keeps 500 - 480 = 20 m."""
    unit = np.zeros(1, dtype=THREAT)
    unit["kill_radius"], unit["kill_scale"] = 480.0, 100.0
    missiles = make_missile_index(unit)
    line = (-2000.0, 400.0, over, 2000.0, 400.0, over)
    # 24 m lower (higher) it is math.hypot(400, 276) = 486 m away, 27 m so 484.4; the margin takes 5 m.
    for shift, hit in ((24.0, False), (27.0, True)):
        toward = (shift, 0.0) if over > 0.0 else (0.0, shift)
        assert (kill_density(missiles, 5.0, 0.0, *line, 0.0, 0.0, *toward)[0] > 0.0) == hit
        assert kill_density(missiles, 5.0, 0.0, *line, 0.0, 0.0, *toward[::-1])[0] == 0.0
    # A leg that may be flown as low as the missile comes no nearer than that.
    assert kill_density(missiles, -85.0, 0.0, *line, 0.0, 0.0, 2000.0, 2000.0)[0] == 0.0
