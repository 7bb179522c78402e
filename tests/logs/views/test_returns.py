"""Returns and glides in pictures: every layer where the data puts it, over the hill between the way's end and home."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from logs import theme
from logs.verdict.returns.drawn_returns import DrawnReturns
from logs.verdict.returns.glides_text import reached_text
from logs.verdict.returns.judge_glides import REACHES
from logs.verdict.returns.judge_returns import KINDS
from logs.verdict.returns.returns_text import segment_text
from logs.views.charts import Layer, legend_entries
from logs.views.figures import return_views, view_json
from logs.views.glides import glide_chart
from logs.views.returns import return_heights_chart, returns_map, worst_returns_chart
from tests.logs.verdict.returns.hill import hill_drawn, hill_setup


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> tuple[FlightSetup, DrawnReturns]:
    threat = (
        '[[threats]]\nname = "post"\neast_m = 900\nnorth_m = 0\namsl_m = 300\nkill_radius_m = 120\nkill_scale_m = 50\n'
    )
    setup = hill_setup(tmp_path_factory.mktemp("hill"), threat)
    return setup, hill_drawn(setup)


def by_role(layers: tuple[Layer, ...], role: str) -> list[Layer]:
    return [layer for layer in layers if layer.role == role]


def test_every_kind_has_a_look_and_a_name_of_its_own() -> None:
    assert {f"return-{kind}" for kind in KINDS} | {f"reach-{reach}" for reach in REACHES} <= set(theme.LOOKS)
    assert len({segment_text(kind) for kind in KINDS}) == len(KINDS)
    assert len({reached_text(reach) for reach in REACHES}) == len(REACHES)
    looks = [theme.LOOKS[f"return-{kind}"] for kind in KINDS]
    assert len({(look.light, look.dash) for look in looks}) == len(looks)
    # Without colours too, they differ from what is safe.
    assert all(look.dash for kind, look in zip(KINDS, looks, strict=True) if kind != "safe")


def test_the_way_is_coloured_where_returns_begin(shown: tuple[FlightSetup, DrawnReturns]) -> None:
    setup, drawn = shown
    layers = returns_map(setup, drawn).panel.layers
    for kind in KINDS:
        ones = [one for found, group in drawn.segments_by_outcome for one in group if found == kind]
        found = by_role(layers, f"return-{kind}")
        assert len(found) == bool(ones)
        for layer in found:
            known = np.isfinite(layer.x)
            assert layer.x[known].tolist() == [one.start[0] for one in ones]
            assert layer.y[known].tolist() == [one.start[1] for one in ones]
            assert len(layer.hover_texts) == len(layer.x)
            assert layer.hover_texts[0].startswith(f"{ones[0].time:.0f} s: to home: ")
    kinds = {kind for kind, _ in drawn.segments_by_outcome}
    assert {"safe", "ground", "threat"} <= kinds


def test_the_worst_are_numbered_where_they_go_wrong(shown: tuple[FlightSetup, DrawnReturns]) -> None:
    setup, drawn = shown
    panel = returns_map(setup, drawn).panel
    assert len(by_role(panel.layers, "return-way")) == len(drawn.worst) == 2
    numbers = [(label.text, label.x, label.y) for label in panel.labels if label.rank == "number"]
    assert numbers == [
        (str(k), float(one.marked_position[0]), float(one.marked_position[1])) for k, one in enumerate(drawn.worst, 1)
    ]
    (ring,) = [layer for layer in panel.layers if layer.kind == "rings"]
    assert ring.x.tolist() == [one.marked_position[0] for one in drawn.worst if not one.simulated.safe]
    assert ("home", 0.0, 0.0) in [(label.text, round(label.x, 3), round(label.y, 3)) for label in panel.labels]


def test_the_worst_in_profile_stand_over_their_ground(shown: tuple[FlightSetup, DrawnReturns]) -> None:
    setup, drawn = shown
    chart = worst_returns_chart(setup, drawn)
    assert chart is not None
    assert len(chart.panels) == len(drawn.worst)
    assert len({panel.span for panel in chart.panels}) == 1
    for panel, worst in zip(chart.panels, drawn.worst, strict=True):
        (way,) = by_role(panel.layers, "return-way")
        assert way.y.tolist() == worst.path[:, 2].tolist()
        run = sum(math.dist(a[:2], b[:2]) for a, b in zip(worst.path[:-1], worst.path[1:], strict=True))
        assert way.x[-1] == pytest.approx(run / 1000.0)
        (ground,) = by_role(panel.layers, "terrain")
        terrain = setup.scenario.terrain
        assert terrain is not None
        assert ground.y == pytest.approx(terrain.height(worst.path[:, 0], worst.path[:, 1]))
        (ring,) = [layer for layer in panel.layers if layer.kind == "rings"]
        assert ring.y.tolist() == [worst.marked_position[2]]
    # From the worst's begin to the hill's top.
    hits = next(k for k, one in enumerate(drawn.worst) if one.simulated.kind == "ground")
    ring = next(layer for layer in chart.panels[hits].layers if layer.kind == "rings")
    assert ring.x[0] == pytest.approx((drawn.worst[hits].simulated.start[0] - 3000.0) / 1000.0, abs=0.7)


def test_heights_and_what_is_left_over_stand_at_their_times(shown: tuple[FlightSetup, DrawnReturns]) -> None:
    setup, drawn = shown
    chart = return_heights_chart(setup, drawn, None)
    assert chart is not None
    assert chart.timed
    heights, left = chart.panels
    (least,) = by_role(heights.layers, "limit")
    assert (least.x is drawn.min_safe_altitudes.time, least.y is drawn.min_safe_altitudes.altitude) == (True, True)
    coloured = [layer for layer in heights.layers if layer.role.startswith("return-")]
    at = np.vstack([np.column_stack([layer.x, layer.y]) for layer in coloured])
    at = at[np.isfinite(at[:, 0])]
    assert set(at[:, 0].tolist()) == {one.time for one in drawn.returns.each}
    assert at[:, 1] == pytest.approx(600.0)
    (home,), (flat,) = by_role(left.layers, "left-home"), by_role(left.layers, "left-flat")
    lefts = [one.home_altitude_left if math.isfinite(one.home_altitude_left) else math.nan for one in drawn.glides.each]
    assert home.y == pytest.approx(lefts, nan_ok=True)
    assert flat.x.tolist() == [one.time for one in drawn.glides.each]
    assert left.limits == (("nothing to spare", 0.0),)
    assert not by_role(left.layers, "left-site")


def test_the_glides_map_has_its_footprint_under_the_way(shown: tuple[FlightSetup, DrawnReturns]) -> None:
    setup, drawn = shown
    chart = glide_chart(setup, drawn)
    assert chart is not None
    roles = [layer.role for layer in chart.panel.layers]
    assert roles.index("glide-near") < roles.index("landable") < roles.index("reach-home")
    assert {"reach-home", "reach-flat"} <= set(roles)
    (near,) = by_role(chart.panel.layers, "glide-near")
    # 150 m are 30 m above ground and 120 m to glide: some 1.3 km west of home; in the east the hill's top counts, too.
    assert np.nanmin(near.x) == pytest.approx(-1270.0, abs=150.0)
    entries = [entry.text for entry in legend_entries([chart.panel])]
    assert "home in reach from 150 m above ground" in entries


def test_figures_that_have_no_data_are_left_out(shown: tuple[FlightSetup, DrawnReturns], tmp_path: Path) -> None:
    setup, drawn = shown
    views = return_views(setup, drawn, None)
    assert list(views) == ["returns", "worst-returns", "return-heights", "glide"]
    for view in views.values():
        assert len(json.dumps(view_json(view))) > 500
    none = DrawnReturns(drawn.returns, drawn.worst, drawn.min_safe_altitudes)
    assert list(return_views(setup, none, None)) == ["returns", "worst-returns", "return-heights"]
