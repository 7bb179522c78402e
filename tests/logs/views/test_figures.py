"""Map and profile are the same bytes each time, nothing is cut off, and failures are marked."""

import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

from logs import theme
from logs.verdict.places import Place
from logs.verdict.verdict import Verdict
from logs.views.drawing import new_figure, png_bytes, write_png
from tests.logs.views.figure_data import (
    ALL,
    FAILED,
    NONE_TERRAIN,
    ROUTE,
    drawn_map,
    drawn_profile,
    make_scenario,
    make_track,
    make_verdict,
)

DRAWERS = [drawn_map, drawn_profile]


@pytest.mark.parametrize("draw", DRAWERS)
def test_same_data_same_bytes_1500_px_wide(draw: Any) -> None:
    first, second = (
        png_bytes(draw(make_scenario(), **ALL, track=make_track(), verdict=make_verdict())) for _ in range(2)
    )
    assert first == second
    assert struct.unpack(">I", first[16:20])[0] == 1500
    for chunk in (b"tEXt", b"tIME", b"iTXt", b"zTXt"):
        assert chunk not in first


@pytest.mark.parametrize("draw", DRAWERS)
@pytest.mark.parametrize(
    ("changes", "paths", "flown"),
    [
        ({}, ALL, True),
        ({}, ALL, False),
        (NONE_TERRAIN, ALL, True),
        ({**NONE_TERRAIN, "external": True}, {"plan_waypoints": None, "route_waypoints": ROUTE}, True),
        ({"terrain": {"kind": "flat", "amsl_m": 100}}, ALL, True),
        ({}, {"plan_waypoints": None, "route_waypoints": None}, False),
        ({}, {"plan_waypoints": ROUTE, "route_waypoints": None}, False),
        ({"name": "a $\\frac{$ 山 name with <tags> " + "x" * 60}, ALL, True),
    ],
)
def test_everything_written_is_inside_the_picture(draw: Any, changes: Any, paths: Any, flown: bool) -> None:
    """Whatever data is missing, it draws, and no text is cut off or lies under the legend."""
    figure = draw(make_scenario(**changes), **paths, track=make_track() if flown else None, verdict=FAILED)
    if "name" in changes:
        assert png_bytes(figure)
    frame = figure.bbox
    renderer = figure.canvas.get_renderer()
    for thing in [*figure.axes, *figure.texts, *figure.legends]:
        box = thing.get_tightbbox(renderer) if thing in figure.axes else thing.get_window_extent(renderer)
        assert frame.x0 <= box.x0, thing
        assert box.x1 <= frame.x1, thing
        assert frame.y0 <= box.y0, thing
        assert box.y1 <= frame.y1, thing
    legend = figure.legends[0].get_window_extent(renderer)
    for axes in figure.axes:
        assert not axes.get_tightbbox(renderer).overlaps(legend)


@pytest.mark.parametrize("draw", DRAWERS)
def test_failing_places_are_marked_and_only_those(draw: Any) -> None:
    def marks(verdict: Verdict | None) -> int:
        figure = draw(make_scenario(), **ALL, track=None, verdict=verdict)
        lines = figure.axes[0].lines
        marked = [line for line in lines if line.get_gid() != "leader"]
        return sum(theme.colour("fail") in (line.get_color(), line.get_markeredgecolor()) for line in marked)

    assert marks(None) == 0
    assert marks(make_verdict()) == 0
    assert marks(make_verdict(("slope", Place("leg", 1)))) == 1
    assert marks(FAILED) == 2
    assert marks(make_verdict(("turn", Place("waypoint", 99)), ("energy", Place("flight")))) == 0


def test_settings_of_the_caller_come_back_and_do_not_matter(tmp_path: Path) -> None:
    def picture() -> bytes:
        return png_bytes(drawn_profile(make_scenario(), **ALL, track=None, verdict=None))

    plain = picture()
    with mpl.rc_context({"lines.linewidth": 9.0, "font.size": 20.0, "savefig.facecolor": "red"}):
        assert picture() == plain
        assert mpl.rcParams["font.size"] == 20.0
    figure = drawn_profile(make_scenario(), **ALL, track=None, verdict=None)
    write_png(figure, tmp_path / "profile.png")
    assert (tmp_path / "profile.png").read_bytes() == plain
    assert [path.name for path in tmp_path.iterdir()] == ["profile.png"]


def test_no_pyplot_and_no_matplotlib_before_a_drawing() -> None:
    code = (
        "import sys, logs.views.report.page; assert 'matplotlib' not in sys.modules; "
        "import logs.views.figures; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parents[3])


def test_a_notebook_shows_a_figure_as_its_picture() -> None:
    """Without pyplot, as IPython asks for it: by the method of its class."""
    figure = new_figure(1.0)
    assert type(figure)._repr_png_(figure) == png_bytes(figure)
    assert png_bytes(figure).startswith(b"\x89PNG")
