"""Exposure to the missiles beside a line, against plain sums over all of them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.evaluation.missile_index import kill_density, make_missile_index
from planner.evaluation.problem_arrays import THREAT
from world.geometry import segment_exposure

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
