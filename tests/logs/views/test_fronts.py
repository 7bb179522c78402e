"""Pictures of a front: every plan where its values put it, the best of each objective by name."""

from dataclasses import replace

import numpy as np
import pytest

from logs.recording.example_log import example_log
from logs.views.fronts import front_chart, front_map
from planner.plan import Certificate, Plan
from planner.search.plan_front import Front, FrontPlan


@pytest.fixture(scope="module")
def front() -> Front:
    setup = example_log().setup
    certificate = Certificate(0.1, np.inf, 0.1, 9.0, 10.0, 50.0, ())
    path = np.array(setup.route.positions)
    plan = Plan(setup.scenario, path, np.zeros(4), np.ones(4), certificate, 7, "umda", 60, np.zeros((0, 3)))
    # Shortest and least energy; nothing; least exposed; highest.
    rows = [(9e3, 8.0, 60.0, 400.0, 3.6e5), (9.1e3, 7.0, 61.0, 401.0, 3.7e5), (9.2e3, 1.0, 60.0, 402.0, 3.8e5)]
    rows.append((9.3e3, 9.0, 99.0, 403.0, 3.9e5))
    plans = tuple(FrontPlan(replace(plan, waypoints=path + 10.0 * k), *row) for k, row in enumerate(rows))
    return Front(plans, 4, "energy", plans[0], np.array([2e4, 10.0, 0.0, 9e5]), 99)


def test_each_plan_stands_at_its_values_in_each_panel(front: Front) -> None:
    chart = front_chart(front)
    exposure, height, energy, seconds = chart.panels
    for panel, values in (
        (exposure, [8, 7, 1, 9]),
        (height, [60, 61, 60, 99]),
        (energy, [100, 102.778, 105.556, 108.333]),
    ):
        places = {(round(x, 3), round(y, 3)) for layer in panel.layers for x, y in zip(layer.x, layer.y, strict=True)}
        assert places == {(round(9.0 + 0.1 * k, 3), value) for k, value in enumerate(values)}
    assert [layer.name for layer in seconds.layers] == [
        "other plans",
        "1: shortest",
        "3: least exposed",
        "4: highest above ground",
    ]


def test_a_plan_alone_stands_on_axes_that_show_what_matters(front: Front) -> None:
    """9 km, of whose hundredth 3 % are left on either side, and 1 s, m or Wh: no plan differs by less."""
    chart = front_chart(replace(front, plans=front.plans[:1]))
    assert chart.axis_range == pytest.approx((9.0 - 0.0027, 9.0 + 0.0027))
    assert [panel.min_span for panel in chart.panels] == [1.0] * 4
    assert [[layer.name for layer in panel.layers] for panel in chart.panels] == [["1: shortest"]] * 4


def test_every_plan_is_a_line_of_the_map(front: Front) -> None:
    lines = [layer for layer in front_map(front).panel.layers if layer.role.startswith("front-")]
    assert [layer.name for layer in lines] == [
        "other plans",
        "1: shortest",
        "3: least exposed",
        "4: highest above ground",
    ]
    np.testing.assert_allclose(
        [layer.x[0] for layer in lines], front.plans[0].plan.waypoints[0, 0] + [10.0, 0.0, 20.0, 30.0]
    )
