"""Entered threats are marked and named where they stand, on the map and over the flight's heights."""

from typing import Any

import numpy as np
import pytest
from matplotlib.patches import Circle

from logs.figures.elements import style
from logs.figures.elements.failure_labels import inside_threats, radius_of, write_fail_labels
from logs.figures.elements.failures import Failures, failures
from logs.figures.elements.labels import LabelPlacer
from logs.figures.map import draw_map
from logs.figures.profile import draw_profile
from logs.verdict.places import Place
from tests.logs.figures.figure_data import ALL, ROUTE, make_scenario, make_track, make_verdict

# The second leg runs north along east 100 m at 340 to 380 m: the missile's centre is 200 m beside its middle, at 300 m.
UNIT = {"name": "post 25", "east_m": 300, "north_m": 0, "amsl_m": 300, "kill_radius_m": 250, "kill_scale_m": 50}
SCENARIO = make_scenario(threats=[UNIT])
MISSILE = Place("missile", 0, name="post 25")
ENTERED = make_verdict(("threat", MISSILE), ("slope", Place("leg", 1, to_item=9)))


def inside_rows() -> Any:
    track = make_track()
    away = track.position - [300.0, 0.0, 300.0]
    return track, np.sqrt((away**2).sum(axis=1)) < 250.0


def texts(figure: Any) -> set[str]:
    return {text.get_text() for text in figure.axes[0].texts}


def broad_line(figure: Any) -> Any:
    return next(line for line in figure.axes[0].lines if line.get_color() == style.FAIL and line.get_linewidth() == 3.6)


def test_an_entered_missile_is_ringed_and_named_on_the_map() -> None:
    track, inside = inside_rows()
    figure = draw_map(SCENARIO, **ALL, track=track, verdict=ENTERED)
    (ring,) = [patch for patch in figure.axes[0].patches if isinstance(patch, Circle) and patch.get_linewidth() == 2.2]
    assert (ring.center, ring.radius) == ((300.0, 0.0), 250.0)
    assert {"post 25 (missile): threat", "leg 1, to item 9: slope"} <= texts(figure)
    assert "post 25" not in texts(figure)
    assert 4 < inside.sum() < len(track) // 2
    np.testing.assert_array_equal(np.isfinite(broad_line(figure).get_xdata()), inside)
    shown = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"threat that is entered", "flown inside a threat's reach"} <= set(shown)


def test_an_entered_missile_stands_over_the_flown_heights() -> None:
    track, inside = inside_rows()
    figure = draw_profile(SCENARIO, **ALL, track=track, verdict=ENTERED)
    assert {"post 25 (missile): threat", "leg 1, to item 9: slope"} <= texts(figure)
    np.testing.assert_array_equal(np.isfinite(broad_line(figure).get_ydata()), inside)
    # Its foot and its top over the path, 200 m beside the centre: 300 m less and more of sqrt(250^2 - 200^2) = 150 m.
    edges = [line.get_ydata() for line in figure.axes[0].lines if line.get_color() == style.FAIL]
    edges = [line for line in edges if len(line) == len(track)]
    assert np.nanmin(edges[0]) == pytest.approx(150.0, abs=1.0)
    assert np.nanmax(edges[1]) == pytest.approx(450.0, abs=1.0)


def test_a_plan_that_was_not_flown_shows_its_own_entry() -> None:
    figure = draw_profile(SCENARIO, **ALL, track=None, verdict=ENTERED)
    assert "post 25 (missile): threat" in texts(figure)
    assert not texts(draw_profile(SCENARIO, **ALL, track=None, verdict=make_verdict())) & {"post 25 (missile): threat"}


def test_a_sphere_is_the_one_that_the_place_names() -> None:
    both = make_scenario(threats=[{**UNIT, "detection_radius_m": 700, "detection_scale_m": 90}]).threats
    assert radius_of(both, MISSILE) == 250.0
    assert radius_of(both, Place("radar", 0)) == 700.0
    track, inside = inside_rows()
    assert inside_threats(failures(ENTERED, 4), both, track).tolist() == inside.tolist()
    assert not inside_threats(Failures({}, {}), both, track).any()


def test_threats_without_a_place_in_the_picture_get_no_label() -> None:
    axes = style.new_figure(4.0).add_axes((0.1, 0.1, 0.8, 0.8))
    axes.set(xlim=(-1000.0, 1000.0), ylim=(-1000.0, 1000.0))
    write_fail_labels(failures(ENTERED, 4), ROUTE[:, :2], {}, LabelPlacer(axes), 10.0)
    assert [text.get_text() for text in axes.texts] == ["leg 1, to item 9: slope"]
