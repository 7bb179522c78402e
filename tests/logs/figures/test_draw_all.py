"""The figures: the same bytes each time, nothing cut off, and every mark where the data puts it."""

import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight.simulation.track import COLUMNS, Track
from logs.figures.draw_all import draw_map, draw_profile, write_png
from logs.figures.elements.failures import failures, paths_differ, route_distance, track_distance
from logs.figures.elements.style import FAIL, FLOWN, nice_step, outline_rows, png_bytes
from logs.figures.elements.threats import sphere_cuts
from logs.verdict.findings import Finding, Verdict
from logs.verdict.places import Place
from world.scenario import Scenario, from_spec

# A right angle and a climb, in round numbers: legs of 1,000, 800 and 600 m.
ROUTE = np.array([[-900.0, -400.0, 300.0], [100.0, -400.0, 340.0], [100.0, 400.0, 380.0], [700.0, 400.0, 360.0]])


def make_scenario(**changes: Any) -> Scenario:
    spec: dict[str, Any] = {
        "name": "small",
        "terrain": {"kind": "peaks", "peak": [{"east_m": 0, "north_m": 0, "height_m": 250, "sigma_m": 400}]},
        "area": {"east_m": [-1200, 1200], "north_m": [-800, 800], "ceiling_amsl_m": 500},
        "start": {"east_m": -900, "north_m": -400, "amsl_m": 300},
        "destination": {"east_m": 700, "north_m": 400, "amsl_m": 360},
        "threats": [
            {"name": "M one", "east_m": 300, "north_m": 0, "kill_radius_m": 250, "kill_scale_m": 50},
            {"name": "R one", "east_m": -500, "north_m": 200, "detection_radius_m": 700, "detection_scale_m": 90},
        ],
        "wind": {"speed_mps": 5, "from_deg": 250, "turbulence": "light"},
    }
    external = changes.pop("external", False)
    return from_spec(spec | changes, "test", external=external)


def make_track(route: np.ndarray = ROUTE, rate: float = 2.0) -> Track:
    at = route_distance(route)
    count = int(at[-1] / 25.0 * rate)
    along = np.linspace(0.0, at[-1], count)
    position = np.column_stack([np.interp(along, at, route[:, axis]) for axis in range(3)])
    values: dict[str, np.ndarray] = {
        name: np.zeros((count, width)) if width > 1 else np.zeros(count) for name, width in COLUMNS.items()
    }
    values |= {"time": np.arange(count) / rate, "position": position, "airspeed": np.full(count, 25.0)}
    values["leg"] = np.clip(np.searchsorted(at, along, side="right") - 1, 0, len(route) - 2)
    return Track(**values)  # type: ignore[arg-type]  # the track gives each column its type


def make_verdict(*bad: tuple[str, Place]) -> Verdict:
    findings = [Finding("slope", Place("leg", 0), 2.0, 2.0, 8.0, "aircraft", 0.1, 6.0, "deg", "fit", True, "")]
    findings += [
        Finding(rule, place, 9.0, 9.0, 8.0, "aircraft", 0.1, -1.0, "deg", "fit", False, "") for rule, place in bad
    ]
    return Verdict(tuple(findings), not bad, True, ("flyable" if not bad else "not flyable",), "flown")


DRAWERS = [draw_map, draw_profile]
ALL = {"plan_waypoints": ROUTE, "route_waypoints": ROUTE}
NONE_TERRAIN = {"terrain": {"kind": "none"}, "threats": []}
FAILED = make_verdict(("slope", Place("leg", 1)), ("turn", Place("waypoint", 2, 3)))


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
    """Whatever is missing, it draws, and no word is cut off or lies under the legend."""
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


def test_labels_do_not_cover_each_other() -> None:
    crowd = [
        {"name": f"unit {k}", "east_m": 40 * (k % 3), "north_m": 40 * (k // 3), "kill_radius_m": 90, "kill_scale_m": 9}
        for k in range(9)
    ]
    figure = draw_map(make_scenario(threats=crowd), **ALL, track=make_track(), verdict=FAILED)
    renderer = figure.canvas.get_renderer()
    boxes = [text.get_window_extent(renderer) for text in figure.axes[0].texts if text.get_zorder() == 9]
    assert len(boxes) == 15  # two ends, two inner waypoints, two failures, nine threats
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])


def test_missiles_are_filled_as_far_as_they_reach_at_the_height_of_the_path() -> None:
    """Over level ground at 100 m, the path passes 220 m above the first unit and 260 m above the second."""
    units = [{"east_m": -400, "north_m": -400}, {"east_m": 100, "north_m": 0}]
    threats = [{**unit, "kill_radius_m": 250, "kill_scale_m": 50} for unit in units]
    scenario = make_scenario(terrain={"kind": "flat", "amsl_m": 100}, threats=threats)
    fills, outlines = draw_map(scenario, **ALL, track=None, verdict=None).axes[0].collections
    reach = [path.get_extents().width / 2 for path in fills.get_paths()]
    assert reach == [pytest.approx(np.sqrt(250.0**2 - 220.0**2), rel=0.01)]
    assert [path.get_extents().width / 2 for path in outlines.get_paths()] == [pytest.approx(250.0, rel=0.001)] * 2


@pytest.mark.parametrize("draw", DRAWERS)
def test_failing_places_are_marked_and_only_those(draw: Any) -> None:
    def marks(verdict: Verdict | None) -> int:
        figure = draw(make_scenario(), **ALL, track=None, verdict=verdict)
        lines = figure.axes[0].lines
        marked = [line for line in lines if line.get_gid() != "leader"]
        return sum(FAIL in (line.get_color(), line.get_markeredgecolor()) for line in marked)

    assert marks(None) == 0
    assert marks(make_verdict()) == 0
    assert marks(make_verdict(("slope", Place("leg", 1)))) == 1
    assert marks(FAILED) == 2
    assert marks(make_verdict(("turn", Place("waypoint", 99)), ("energy", Place("flight")))) == 0


def test_map_shows_the_track_where_it_was_flown() -> None:
    track = make_track()
    figure = draw_map(make_scenario(), **ALL, track=track, verdict=None)
    (line,) = [line for line in figure.axes[0].lines if line.get_label() == "flown track"]
    assert line.get_color() == FLOWN
    np.testing.assert_allclose(line.get_xydata()[0], track.position[0, :2])
    np.testing.assert_allclose(line.get_xydata()[-1], track.position[-1, :2])
    assert figure.axes[0].get_aspect() == 1.0


def test_map_widens_to_a_flight_that_left_the_area() -> None:
    outside = ROUTE.copy()
    outside[2] = [3000.0, 900.0, 400.0]
    figure = draw_map(
        make_scenario(), plan_waypoints=ROUTE, route_waypoints=ROUTE, track=make_track(outside), verdict=None
    )
    axes = figure.axes[0]
    assert axes.get_xlim()[0] < -1200
    assert axes.get_xlim()[1] > 3000
    assert axes.get_ylim()[1] > 900


def test_profile_shows_ground_and_heights_along_the_route() -> None:
    scenario = make_scenario()
    track = make_track()
    axes = draw_profile(scenario, **ALL, track=track, verdict=None).axes[0]
    plan, flown = (
        next(line for line in axes.lines if line.get_label() == label) for label in ("planned heights", "flown heights")
    )
    np.testing.assert_allclose(plan.get_xydata(), np.column_stack([[0.0, 1.0, 1.8, 2.4], ROUTE[:, 2]]))
    # The track lies on the route, so both heights agree everywhere.
    np.testing.assert_allclose(
        flown.get_ydata(), np.interp(flown.get_xdata(), [0.0, 1.0, 1.8, 2.4], ROUTE[:, 2]), atol=1e-6
    )
    ground = next(line for line in axes.lines if line.get_color() == "#6b5a3a")
    middle = np.argmin(np.abs(ground.get_xdata() - 1.4))  # at (100, 0): 250 exp(-100^2 / (2 400^2)) m
    assert ground.get_ydata()[middle] == pytest.approx(250.0 * np.exp(-(0.25**2) / 2), abs=0.3)


def test_settings_of_the_caller_come_back_and_do_not_matter(tmp_path: Path) -> None:
    def picture() -> bytes:
        return png_bytes(draw_profile(make_scenario(), **ALL, track=None, verdict=None))

    plain = picture()
    with mpl.rc_context({"lines.linewidth": 9.0, "font.size": 20.0, "savefig.facecolor": "red"}):
        assert picture() == plain
        assert mpl.rcParams["font.size"] == 20.0
    figure = draw_profile(make_scenario(), **ALL, track=None, verdict=None)
    write_png(figure, tmp_path / "profile.png")
    assert (tmp_path / "profile.png").read_bytes() == plain
    assert [path.name for path in tmp_path.iterdir()] == ["profile.png"]


def test_no_pyplot_and_no_matplotlib_before_a_drawing() -> None:
    code = (
        "import sys, logs.report.page; assert 'matplotlib' not in sys.modules; "
        "import logs.figures.draw_all; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parents[3])


@given(
    st.lists(st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)), min_size=1, max_size=20),
    st.floats(1.0, 5e3),
    st.floats(-100.0, 900.0),
)
def test_cuts_lie_on_the_sphere(places: list[tuple[float, float]], radius: float, up: float) -> None:
    centre = np.array([120.0, -40.0, up])
    points = np.array([[east, north, 0.0] for east, north in places])
    lower, upper = sphere_cuts(centre, radius, points)
    for (east, north), low, high in zip(places, lower, upper, strict=True):
        beside = np.hypot(east - 120.0, north + 40.0)
        assert np.isnan(low) == np.isnan(high) == (beside**2 > radius**2) or beside == pytest.approx(radius)
        if not np.isnan(high):
            assert np.hypot(beside, high - up) == pytest.approx(radius, rel=1e-9)
            assert low + high == pytest.approx(2 * up, abs=1e-6)


@given(st.lists(st.floats(-1e6, 1e6) | st.just(float("nan")), min_size=1, max_size=400), st.integers(1, 40))
def test_thinning_keeps_the_extremes(values: list[float], count: int) -> None:
    series = np.array(values)
    rows = outline_rows(series, count)
    assert (np.diff(rows) > 0).all()
    assert len(rows) <= max(2 * count + 2, 1)
    assert rows[0] == 0
    assert rows[-1] == len(series) - 1
    if np.isfinite(series).any():
        assert np.nanmax(series[rows]) == np.nanmax(series)
        assert np.nanmin(series[rows]) == np.nanmin(series)


@given(st.floats(1e-3, 1e7), st.integers(2, 30))
def test_steps_are_round_and_fine_enough(span: float, parts: int) -> None:
    step = nice_step(span, parts)
    assert span / step <= parts * (1 + 1e-9)
    assert span / step > parts / 2.6
    lead = step / 10 ** np.floor(np.log10(step) + 1e-9)
    assert min(abs(lead - nice) for nice in (1.0, 2.0, 5.0)) < 1e-6


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 200.0))
def test_progress_never_falls_and_finds_the_legs(seed: int, spread: float) -> None:
    track = make_track()
    rng = np.random.default_rng(seed)
    position = track.position + np.column_stack([rng.normal(0.0, spread, (len(track), 2)), np.zeros(len(track))])
    position[rng.integers(0, len(track), 3)] = np.nan
    columns = {name: getattr(track, name) for name in COLUMNS} | {"position": position}
    noisy = Track(**columns)
    progress = track_distance(ROUTE, noisy)
    at = route_distance(ROUTE)
    assert (np.diff(progress) >= 0.0).all()
    known = np.isfinite(position[:, 0])
    assert (progress[known] >= at[noisy.leg][known]).all()
    assert (progress <= at[noisy.leg + 1]).all()
    if spread == 0.0:
        straight = np.linspace(0.0, at[-1], len(track))
        np.testing.assert_allclose(progress[known], straight[known], atol=1e-6)


def test_paths_that_lie_on_each_other_do_not_differ() -> None:
    more_points = np.insert(ROUTE, 2, 0.5 * (ROUTE[1] + ROUTE[2]), axis=0)
    assert not paths_differ(ROUTE, more_points, 1.0)
    assert not paths_differ(np.repeat(ROUTE, 2, axis=0), ROUTE, 1.0)
    moved = ROUTE.copy()
    moved[1, 0] += 1.5
    assert paths_differ(ROUTE, moved, 1.0)
    assert paths_differ(ROUTE, ROUTE[:-1], 1.0)


def test_failures_lie_at_the_places_of_findings() -> None:
    bad = ("slope", Place("leg", 1)), ("clearance", Place("leg", 1)), ("turn", Place("waypoint", 3, 7))
    found = failures(make_verdict(*bad), 4)
    assert found.legs == {1: ("slope", "clearance")}
    assert found.waypoints == {3: ("turn",)}
    assert not failures(make_verdict(("slope", Place("leg", 3)), ("turn", Place("waypoint", 4))), 4)
