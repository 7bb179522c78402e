"""A photo line flown just within what a photo bears, and just outside it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.mission.items import Home
from flight.mission.surveys import LineAxis
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures import photo_lines
from logs.verdict.measures.photo_lines import LineMeasure, _line_steps, heights_over_ground, line_distances
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.rules.survey_rule import _is_too_tight, unusable_parts_text
from tests.logs.verdict.judging import judge
from tests.synthetic import bank_radius, fly_path, make_setup
from world.terrain import make_gridded_terrain


@pytest.mark.parametrize(("off", "lost"), [(4.9, 0.0), (5.1, 20.0), (-4.9, 0.0), (-5.1, 20.0)])
def test_low_over_ground_a_photo_may_be_five_metres_off(off: float, lost: float) -> None:
    """A tenth of 30 m would be 3 m.  Three lines of 1,000 m, off from 400 m to 600 m on the first."""
    ways = [
        [(200.0 * k, north) for north in (-300.0, 0.0, 1000.0, 1300.0)][:: 1 if k % 2 == 0 else -1] for k in range(3)
    ]
    setup = make_setup([[*place, 30.0] for way in ways for place in way], limits={"surveys": "lines"})
    track = fly_path(setup, up=lambda s: np.where((s > 700.0) & (s < 900.0), off, 0.0))
    first = next(item for item in judge(setup, track).findings if item.rule == "survey")
    assert first.flown == pytest.approx(100.0 - lost, abs=1.0)


def test_a_line_is_looked_at_metre_by_metre() -> None:
    along = np.arange(0.0, 12.25, 0.25)
    taken = _line_steps(along, along <= 7.0, 12.0)
    assert (len(taken), np.count_nonzero(taken)) == (12, 7)


@pytest.mark.parametrize(
    ("length", "step", "count"), [(12.0, 1.0, 13), (12.1, 1.0, 14), (12.0, 4.0, 4), (0.5, 1.0, 2), (0.0, 1.0, 2)]
)
def test_a_planned_line_is_judged_in_steps_from_end_to_end(
    length: float, step: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(photo_lines, "PHOTO_STEP_M", step)
    along = line_distances(LineAxis(np.array([[0.0, 0.0], [0.0, length]])))
    assert along == pytest.approx(length * np.arange(count) / (count - 1))


@pytest.mark.parametrize(("share", "told"), [(0.0049, ""), (0.0051, "1 % with the camera off")])
def test_half_a_percent_of_a_line_is_told(share: float, told: str) -> None:
    measure = LineMeasure(1000.0, 1.0 - share, 0.0, 0.0, 0.0, share, 0.0, 0.0, 0.0, 0.0, 0, 0, 50.0, 10.0)
    assert unusable_parts_text(measure) == told


@pytest.mark.parametrize(("over", "tight"), [(0.009, False), (0.011, True)])
def test_a_corner_may_be_a_hundredth_of_a_degree_too_sharp(over: float, tight: bool) -> None:
    """Flown by with an arc of radius R that takes R tan(turn / 2) of each leg: of legs of 300 m, all of them."""
    turn = 2.0 * math.atan(300.0 / bank_radius()) + math.radians(over)
    ends = [[0.0, 0.0], [0.0, 300.0], [300.0 * math.sin(turn), 300.0 + 300.0 * math.cos(turn)]]
    setup = make_setup([[*place, 100.0] for place in ends])
    assert _is_too_tight(route_requirements(setup), 1) is tight


@pytest.mark.parametrize(("home", "up"), [(None, [0.0, 20.0]), (70.0, [10.0, 30.0])])
def test_without_terrain_heights_are_over_home_or_the_lowest_waypoint(home: float | None, up: list[float]) -> None:
    setup = make_setup([[0.0, 0.0, 80.0], [0.0, 900.0, 100.0]])
    place = None if home is None else Home(46.0, 8.0, home)
    bare = replace(setup, scenario=replace(setup.scenario, terrain=None), mission=replace(setup.mission, home=place))
    assert heights_over_ground(route_requirements(bare), setup.route.positions).tolist() == up


@pytest.mark.parametrize(("known_to", "ok"), [(950.5, True), (949.5, None)])
def test_a_planned_line_over_unknown_ground_is_looked_at_metre_by_metre(known_to: float, ok: bool | None) -> None:
    """Of 1,000 m a twentieth may be unknown: 49.5 m are 50 of 1,001 places, less than 5 %, and 50.5 m are 51."""
    ways = [
        [(200.0 * k, north) for north in (-300.0, 0.0, 1000.0, 1300.0)][:: 1 if k % 2 == 0 else -1] for k in range(3)
    ]
    east, north = np.arange(-1000.0, 1501.0, 50.0), known_to + np.arange(-2000.0, 1.0, 50.0)
    heights = np.zeros((north.size, east.size))
    ground = make_gridded_terrain(heights, east, north, source="level", sha256="", datum="mean sea level")
    setup = make_setup([[*place, 100.0] for way in ways for place in way], limits={"surveys": "lines"}, ground=ground)
    first = next(item for item in judge_geometry(setup).findings if item.rule == "survey")
    assert first.ok is ok
