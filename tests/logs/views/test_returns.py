"""Returns and glides in pictures: every layer where the data puts it, over the hill between the way's end and home."""

import json
import math
from dataclasses import replace
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
from logs.views.returns import return_heights_chart, returns_map, split_judged_path, worst_returns_chart
from tests.logs.made_flight import make_setup, make_track
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
    assert {f"return-{kind}" for kind in KINDS} | {f"reach-{reach}" for reach in REACHES} <= set(theme.ROLE_STYLES)
    assert len({segment_text(kind) for kind in KINDS}) == len(KINDS)
    assert len({reached_text(reach) for reach in REACHES}) == len(REACHES)
    looks = [theme.ROLE_STYLES[f"return-{kind}"] for kind in KINDS]
    assert len({(look.light, look.dash) for look in looks}) == len(looks)
    # Without colours too, they differ from what is safe.
    assert all(look.dash for kind, look in zip(KINDS, looks, strict=True) if kind != "safe")


def test_the_way_is_coloured_where_returns_begin(shown: tuple[FlightSetup, DrawnReturns]) -> None:
    setup, drawn = shown
    layers = returns_map(setup, drawn, None).panel.layers
    starts = {one.start[0]: one for one in drawn.worst_by_start}
    for kind in KINDS:
        ones = [one for found, group in drawn.segments_by_outcome for one in group if found == kind]
        found = by_role(layers, f"return-{kind}")
        assert len(found) == bool(ones)
        for layer in found:
            # The path leads straight along a circle of latitude: each point has the look of the nearest start.
            known = np.flatnonzero(np.isfinite(layer.x))
            assert np.abs(layer.y[known]).max() < 4.0
            assert len(layer.hover_texts) == len(layer.x)
            for k in known[:-1]:
                distances = {east: abs(east - layer.x[k]) for east in starts}
                # Half way between two starts, both are the nearest.
                nearest = [one for east, one in starts.items() if distances[east] < min(distances.values()) + 1e-6]
                told = [layer.hover_texts[k].startswith(f"{one.time:.0f} s: to home: ") for one in nearest]
                # A segment reaches to the next one, half way between two starts.
                assert any(one.kind == kind and begins for one, begins in zip(nearest, told, strict=True)) or (
                    k + 2 not in known
                )
    kinds = {kind for kind, _ in drawn.segments_by_outcome}
    assert {"safe", "ground", "threat"} <= kinds


def test_the_worst_are_numbered_where_they_go_wrong(shown: tuple[FlightSetup, DrawnReturns]) -> None:
    setup, drawn = shown
    panel = returns_map(setup, drawn, None).panel
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
    times = [one.time for one in drawn.returns.each]
    assert at[:, 0].min() == min(times)
    # The last start is less than 10 s before the end, and stands for at most 5 s after it.
    assert max(times) - 0.3 <= at[:, 0].max() <= max(times) + 5.0
    assert at[:, 1] == pytest.approx(600.0)
    (home,), (flat,) = by_role(left.layers, "left-home"), by_role(left.layers, "left-flat")
    lefts = [one.home_altitude_left if math.isfinite(one.home_altitude_left) else math.nan for one in drawn.glides.each]
    assert home.y == pytest.approx(lefts, nan_ok=True)
    assert flat.x.tolist() == [one.time for one in drawn.glides.each]
    assert left.limits == (("nothing to spare", 0.0),)
    assert not by_role(left.layers, "left-site")


def test_the_glides_map_has_its_footprint_under_the_way(shown: tuple[FlightSetup, DrawnReturns]) -> None:
    setup, drawn = shown
    chart = glide_chart(setup, drawn, None)
    assert chart is not None
    roles = [layer.role for layer in chart.panel.layers]
    assert roles.index("glide-near") < roles.index("landable") < roles.index("reach-home")
    assert {"reach-home", "reach-flat"} <= set(roles)
    (near,) = by_role(chart.panel.layers, "glide-near")
    # 150 m are 30 m above ground and 120 m to glide: some 1.3 km west of home; in the east the hill's top counts, too.
    assert np.nanmin(near.x) == pytest.approx(-1270.0, abs=150.0)
    entries = [entry.text for entry in legend_entries([chart.panel])]
    assert "home in reach from 150 m above ground" in entries


def test_lines_that_coincide_are_one_and_others_are_both_seen(shown: tuple[FlightSetup, DrawnReturns]) -> None:
    """A landing at home has the same altitude to spare as home; another place has its own line, below and wider."""
    setup, drawn = shown
    sites = (*drawn.glides.sites, drawn.glides.sites[0]._replace(kind="landing"))
    for shift, names in ((0.0, ["left-home", "left-flat"]), (10.0, ["left-site", "left-home", "left-flat"])):
        each = tuple(replace(one, site_altitude_left=one.home_altitude_left + shift) for one in drawn.glides.each)
        chart = return_heights_chart(setup, replace(drawn, glides=replace(drawn.glides, each=each, sites=sites)), None)
        assert chart is not None
        layers = chart.panels[1].layers
        assert [layer.role for layer in layers] == names
        assert ("and for a rally point or landing place there" in layers[0].name) is (shift == 0.0)
    assert theme.ROLE_STYLES["left-site"].width > 2.0 * theme.ROLE_STYLES["left-home"].width
    assert not theme.ROLE_STYLES["left-site"].dash


def test_a_flown_path_is_drawn_where_it_was_flown() -> None:
    """A track around a quarter of a circle of 100 m, with returns from its ends: its first half is the first's."""
    setup, track = make_setup(), make_track()
    angle = np.linspace(0.0, 0.5 * math.pi, len(track))
    circle = 100.0 * np.column_stack([np.sin(angle), np.cos(angle), np.full(len(track), 3.0)])
    flown = replace(track, position=circle)
    ends = [float(track.time[0]), float(track.time[-1])]
    (first, first_points), (second, second_points) = split_judged_path(setup, flown, ends, lambda time: time, str)
    assert (first, second) == (str(ends[0]), str(ends[1]))
    for points in (first_points, second_points):
        positions = np.array([point.position for point in points])
        assert np.hypot(positions[:, 0], positions[:, 1]) == pytest.approx(100.0)
    assert first_points[-1].time == pytest.approx(0.5 * sum(ends), abs=0.1)


def test_figures_that_have_no_data_are_left_out(shown: tuple[FlightSetup, DrawnReturns], tmp_path: Path) -> None:
    setup, drawn = shown
    views = return_views(setup, drawn, None)
    assert list(views) == ["returns", "worst-returns", "return-heights", "glide"]
    for view in views.values():
        assert len(json.dumps(view_json(view))) > 500
    none = DrawnReturns(drawn.returns, drawn.worst, drawn.min_safe_altitudes)
    assert list(return_views(setup, none, None)) == ["returns", "worst-returns", "return-heights"]
