"""Lists of the threats near a place: every one that reaches it is there, and no score is changed by them."""

from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.missile_index import make_missile_index
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import make_problem
from planner.evaluation.threat_grid import make_threat_cells
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
    encoding = rotated(space, 12)
    paths = encoding.decode(rng.uniform(encoding.lower, encoding.upper, (60, encoding.lower.size)))
    for one, two in zip(evaluate(data, paths), evaluate(everything, paths), strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-15)
