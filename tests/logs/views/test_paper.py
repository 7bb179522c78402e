"""The paper's figures: paths by whether they are safe, and convergence by counting."""

from typing import Any

import numpy as np
import pytest

from logs.views.paper import PaperPath, draw_convergence, draw_encodings, draw_paths
from tests.logs.views.figure_data import ROUTE, make_scenario


def legend(figure: Any) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_safe_paths_and_others_are_counted_apart() -> None:
    paths = [PaperPath(ROUTE, 1.1, True), PaperPath(ROUTE + 20.0, 1.25, True), PaperPath(ROUTE - 20.0, 0.9, False)]
    figure = draw_paths(make_scenario(), "umda", paths)
    axes = figure.axes[0]
    assert axes.get_title(loc="left") == "small: 3 runs of umda, 2 safe"
    entries = legend(figure)
    assert "2 paths safe\nPLR 1.100 to 1.250" in entries
    assert "1 path not safe\nPLR 0.900" in entries
    drawn = [line.get_xydata() for line in axes.lines if len(line.get_xdata()) == len(ROUTE)]
    assert [any(np.array_equal(data, path.waypoints[:, :2]) for data in drawn) for path in paths] == [True] * 3


def test_each_encoding_has_its_path_and_its_ratio() -> None:
    chosen = {"umda": PaperPath(ROUTE, 1.05, True), "umda-polar": PaperPath(ROUTE + 30.0, 1.4, False)}
    entries = legend(draw_encodings(make_scenario(), chosen, seed=3))
    assert {"umda\nsafe, PLR 1.050", "umda-polar\nnot safe, PLR 1.400", "start", "destination"} <= set(entries)


def test_convergence_counts_the_searches_that_hold_a_safe_path() -> None:
    """Length ratio, kill exposure, violations: the first search is safe from generation 1, the second from 2."""
    first = np.array([[1.5, 0.0, 2.0], [1.4, 0.0, 0.0]])
    second = np.array([[1.9, 0.1, 0.0], [1.8, 0.1, 0.0], [1.2, 0.0, 0.0], [1.1, 0.0, 0.0]])
    figure = draw_convergence({7: {"umda": [first, second]}, 60: {"umda": [first[:1]]}})
    upper, lower, _, empty = figure.axes
    # A search that ended keeps its last value.
    np.testing.assert_array_equal(upper.lines[0].get_xydata(), [[0, 0], [1, 1], [2, 2], [3, 2]])
    assert lower.lines[0].get_xdata().tolist() == [1, 2, 3]
    assert lower.lines[0].get_ydata() == pytest.approx([1.4, 1.3, 1.25])
    assert [text.get_text() for text in empty.texts] == ["no run has\na safe path"]
    assert [axes.get_title(loc="left") for axes in (upper, figure.axes[2])] == ["7 threats", "60 threats"]
