"""The least heights of a glide against closed forms: a plane in wind, over a wall, around one, out of a sphere."""

import math

import numpy as np
import pytest

from logs.verdict.returns.glide_map import (
    GlideAltitudes,
    GlideMap,
    glide_slopes,
    glide_steps,
    landable_cells,
    make_glide_map,
    search_glide_altitudes,
)
from tests.logs.verdict.returns.gliders import (
    AIRSPEED,
    NO_RADII,
    NO_SPHERES,
    SINK,
    glider,
    ground,
    height_needed,
    map_of,
    plane,
    true_airspeed,
)
from tests.soak import scaled, some
from world.terrain import Terrain

MARGIN = 30.0
TOP = 2500.0
MIDDLE = np.zeros((1, 2))


def searched(terrain: Terrain, made: GlideMap | None = None, margin: float = MARGIN, **wind: float) -> GlideAltitudes:
    """What it takes to get to the middle of a ground."""
    made = made or map_of(terrain, margin)
    return search_glide_altitudes(
        made, np.array([made.cell_at(0.0, 0.0)]), glide_slopes(glider(**wind), AIRSPEED, 0.0, TOP), TOP
    )


def need_at(found: GlideAltitudes, east: float, north: float) -> float:
    return float(found.min_altitude[found.grid.cell_at(east, north)])


@pytest.mark.parametrize(
    ("wind", "blows_to"), [(0.0, 0.0), (5.0, 0.0), (5.0, 40.0), (10.0, 0.0), (10.0, 8.0), (10.0, 45.0), (10.0, 250.0)]
)
def test_on_a_plane_it_is_the_straight_way(wind: float, blows_to: float) -> None:
    """In every direction and at 20 to 115 cells: by 2 % at the most too high, and never too low (issue 35)."""
    found = searched(plane(), wind=wind, blows_to=blows_to)
    middle, compared = found.grid.cell_center(*found.grid.cell_at(0.0, 0.0)), 0
    for bearing in range(0, 360, 4):
        for distance in (1000.0, 2500.0, 5700.0):
            cell = found.grid.cell_at(*(distance * f(math.radians(bearing)) for f in (math.sin, math.cos)))
            east, north = (a - b for a, b in zip(found.grid.cell_center(*cell), middle, strict=True))
            true = height_needed(east, north, MARGIN, wind, blows_to)
            if true < 0.95 * TOP:
                assert 0.9985 <= (found.min_altitude[cell] - MARGIN) / (true - MARGIN) <= 1.02, (bearing, distance)
                compared += 1
    assert compared > 250


@pytest.mark.parametrize("course", [0.0, 90.0, 180.0, 270.0])
def test_of_several_possible_winds_the_worst_on_each_course_counts(course: float) -> None:
    # 8 m/s to the east, and 5 m/s to the north: by the wind triangle on each course, at 600 m.
    blowing = [(8.0, 0.0), (0.0, 5.0)]
    found = glide_slopes(
        glider(3.0, 180.0),
        AIRSPEED,
        0.0,
        TOP,
        lambda altitudes: np.repeat(np.array(blowing)[:, None], len(altitudes), 1),
    )
    level = math.sqrt(true_airspeed(600.0) ** 2 - SINK**2)
    sin, cos = math.sin(math.radians(course)), math.cos(math.radians(course))
    speeds = [
        math.sqrt(level**2 - (east * cos - north * sin) ** 2) + east * sin + north * cos for east, north in blowing
    ]
    row = int(np.argmin(np.abs(np.degrees(glide_steps()[0]["course"]) % 360.0 - course)))
    assert found.table[row, 6] == pytest.approx(SINK / min(speeds), rel=1e-3)


def test_there_are_32_steps_and_each_knows_what_it_crosses() -> None:
    made, between = glide_steps()
    assert len(made) == 32
    assert {(-int(one.east), -int(one.north)) for one in made} == {(int(one.east), int(one.north)) for one in made}
    gaps = np.diff(np.sort(made["course"]), append=np.sort(made["course"])[0] + 2.0 * math.pi)
    assert math.degrees(gaps.max()) == pytest.approx(math.degrees(math.atan(0.25)), abs=1e-6)
    for one in made:
        cells = between[one.first : one.last]
        # A cell between is no further from the line than half its diagonal, and none is left out.
        off = np.abs(-cells["east"] * one.north + cells["north"] * one.east) / one.length
        assert (off <= math.sqrt(0.5) + 1e-9).all()
        assert len(cells) >= one.length - 1.5


def wall(east: float, _north: float = 0.0, height: float = 500.0) -> object:
    """A wall across the map, from 1,950 to 2,050 m east."""
    return np.where(np.abs(np.asarray(east) - 2000.0) <= 50.0, height, 0.0)


def test_behind_a_wall_it_is_the_wall_and_the_way_from_there() -> None:
    found = searched(ground(wall))
    # Bilinear ground begins to rise 50 m before the wall; a cell has the highest of itself.
    per_metre = SINK / math.sqrt(true_airspeed(700.0) ** 2 - SINK**2)
    for behind in (500.0, 1500.0, 3500.0):
        expected = 500.0 + MARGIN + per_metre * behind
        assert need_at(found, 2050.0 + behind, 0.0) == pytest.approx(expected, abs=12.0)
    # Before it, it is the plane.
    assert need_at(found, 1500.0, 0.0) == pytest.approx(height_needed(1500.0, 0.0, MARGIN), rel=0.02)


def test_a_long_step_does_not_fly_through_a_wall() -> None:
    """A wall one cell wide, however thin: nobody gets through below its top."""
    terrain = ground(lambda east, _north: np.where(np.abs(east - 1000.0) < 1.0, 700.0, 0.0))
    found = searched(terrain)
    beyond = found.min_altitude[:, found.grid.cell_at(1200.0, 0.0)[1] :]
    assert float(beyond.min()) > 700.0
    assert math.isfinite(need_at(found, 3000.0, 0.0))


def test_around_a_wall_that_ends_it_goes_around() -> None:
    """A wall of 1,500 m that ends 1,000 m north: from behind it by its end, two sides of a triangle."""
    terrain = ground(lambda east, north: np.where((np.abs(east - 2000.0) <= 50.0) & (north < 1000.0), 1500.0, 0.0))
    found = searched(terrain)
    around = math.hypot(1950.0, 1050.0) + math.hypot(1950.0, 1050.0) + 100.0
    assert need_at(found, 4000.0, 0.0) == pytest.approx(height_needed(around, 0.0, MARGIN), rel=0.03)


def test_more_margin_or_a_higher_wall_never_makes_it_lower() -> None:
    plain = searched(ground(wall))
    higher = searched(ground(lambda east, north: wall(east, north, 650.0)))
    wider = searched(ground(wall), margin=60.0)
    known = np.isfinite(higher.min_altitude) & np.isfinite(wider.min_altitude)
    assert (higher.min_altitude[known] >= plain.min_altitude[known] - 1e-9).all()
    assert (wider.min_altitude[known] >= plain.min_altitude[known] + 30.0 - 5.0).all()


def test_a_sphere_is_flown_over_or_around() -> None:
    """At its middle the least is its top; behind it, it is around it: 2 tangents and an arc, or less by flying over."""
    radius, middle = 400.0, (1500.0, 0.0, 250.0)
    made = make_glide_map(plane(), MIDDLE, MARGIN, np.array([middle]), np.array([radius]), 5900.0)
    assert made is not None
    found = searched(plane(), made)
    assert need_at(found, 1500.0, 0.0) == pytest.approx(650.0, abs=5.0)
    # 100 m inside its rim: its top there is sqrt(400^2 - 300^2) over its middle.
    assert need_at(found, 1500.0, 300.0) == pytest.approx(250.0 + math.sqrt(400.0**2 - 300.0**2), abs=20.0)
    behind = math.hypot(1500.0, 0.0)
    tangent = math.sqrt(behind**2 - radius**2)
    arc = radius * (math.pi - 2.0 * math.acos(radius / behind))
    longest = height_needed(2.0 * tangent + arc, 0.0, MARGIN)
    assert height_needed(3000.0, 0.0, MARGIN) + 1.0 < need_at(found, 3000.0, 0.0) < 1.03 * longest


def test_against_too_much_wind_no_way_leads_anywhere() -> None:
    """In 19 m/s an aircraft at 18 m/s comes to what lies down the wind alone."""
    found = searched(plane(), wind=19.0, blows_to=90.0)
    assert math.isfinite(need_at(found, -2000.0, 0.0))
    assert math.isinf(need_at(found, 2000.0, 0.0))


def test_beyond_the_data_and_above_the_top_it_leads_nowhere() -> None:
    found = searched(ground(lambda east, _north: np.where(east > 3000.0, np.nan, 0.0)))
    assert math.isfinite(need_at(found, 2800.0, 0.0))
    assert math.isinf(need_at(found, 3500.0, 0.0))
    low = searched(plane())
    made = low.grid
    capped = search_glide_altitudes(
        made, np.array([made.cell_at(0.0, 0.0)]), glide_slopes(glider(), AIRSPEED, 0.0, 200.0), 200.0
    )
    assert math.isfinite(need_at(capped, 1500.0, 0.0))
    assert math.isinf(need_at(capped, 2500.0, 0.0))
    assert (
        search_glide_altitudes(
            made, np.array([(-5, 3)]), glide_slopes(glider(), AIRSPEED, 0.0, TOP), TOP
        ).destination.max()
        == -1
    )


def test_each_cell_knows_its_nearest_place() -> None:
    made = map_of(plane())
    ends = [made.cell_at(-2000.0, 0.0), made.cell_at(2000.0, 0.0)]
    found = search_glide_altitudes(made, np.array(ends), glide_slopes(glider(), AIRSPEED, 0.0, TOP), TOP)
    columns = made.floor.shape[1]
    for east, end in ((-2500.0, 0), (-200.0, 0), (200.0, 1), (4000.0, 1)):
        assert found.destination[made.cell_at(east, 300.0)] == ends[end][0] * columns + ends[end][1]
    assert found.next_step[ends[0]] == -1


@pytest.mark.parametrize(
    ("heights", "flat"),
    [
        (lambda east, _north: 0.04 * east, True),
        (lambda east, _north: 0.06 * east, False),
        (lambda east, north: 0.045 * (east + north) / math.sqrt(2.0), True),
        (lambda east, north: 0.055 * (east + north) / math.sqrt(2.0), False),
        # Every other row of a grid of 50 m higher, in cells of 25 m: 0, h/2, h ... are 0.35 h from their mean.
        (lambda _east, north: 2.0 * (np.round(north / 50.0) % 2.0), True),
        (lambda _east, north: 8.0 * (np.round(north / 50.0) % 2.0), False),
    ],
)
def test_ground_is_flat_by_its_slope_and_its_roughness(heights: object, flat: bool) -> None:
    made = make_glide_map(ground(heights, 1500.0), MIDDLE, MARGIN, NO_SPHERES, NO_RADII, 800.0)
    assert made is not None
    assert made.cell == 25.0
    inside = landable_cells(made)[5:-5, 5:-5]
    assert inside.all() if flat else not inside.any()


def test_ground_in_a_sphere_or_beyond_the_data_is_none_to_land_on() -> None:
    terrain = ground(lambda east, _north: np.where(east > 600.0, np.nan, 0.0), 1500.0)
    made = make_glide_map(terrain, MIDDLE, MARGIN, np.array([[0.0, 0.0, 0.0]]), np.array([200.0]), 800.0)
    assert made is not None
    found = landable_cells(made)
    places = {(0.0, 0.0): False, (300.0, 0.0): True, (0.0, -150.0): False, (590.0, 300.0): False, (450.0, 300.0): True}
    assert {place: bool(found[made.cell_at(*place)]) for place in places} == places


def test_a_map_that_would_hide_what_lies_in_its_cells_is_none() -> None:
    far = np.array([[0.0, 0.0], [400_000.0, 400_000.0]])
    assert make_glide_map(ground(wall), far, MARGIN, NO_SPHERES, NO_RADII) is None


@pytest.mark.parametrize("shift", some([17.0, 0.0, -8.0], 3))
def test_over_a_crest_of_one_row_of_pixels_it_is_the_crest(shift: float) -> None:
    """Pixels of 30 m, the crest 60 m over its neighbours, and cells of 45 m: nobody gets across lower than its top."""
    terrain = ground(
        lambda east, _north: np.where(np.abs(east - 1500.0 - shift) < 1.0, 560.0, 500.0), 18_000.0, 30.0, shift
    )
    made = make_glide_map(terrain, MIDDLE, MARGIN, NO_SPHERES, NO_RADII, 17_900.0)
    assert made is not None
    assert 40.0 < made.cell < 50.0
    column = made.cell_at(1500.0 + shift, 0.0)[1]
    assert made.floor[50:-50, column] == pytest.approx(560.0 + MARGIN, abs=1e-3)
    found = searched(terrain, made)
    assert float(found.min_altitude[:, column + 1 :].min()) >= 560.0 + MARGIN - 1e-3


def test_a_fine_elevation_file_gives_a_map_that_knows_each_pixel() -> None:
    """Pixels of 1 m and cells of 20 m: a mast of 90 m, one pixel wide."""
    terrain = ground(lambda east, north: np.where((east == 203.0) & (north == -118.0), 90.0, 0.0), 600.0, 1.0)
    made = make_glide_map(terrain, MIDDLE, MARGIN, NO_SPHERES, NO_RADII, 580.0)
    assert made is not None
    assert made.cell == 20.0
    assert made.floor[made.cell_at(203.0, -118.0)] == 90.0 + MARGIN
    assert float(np.median(made.floor)) == MARGIN


def flown(found: GlideAltitudes, row: int, column: int) -> np.ndarray:
    """The way (k, 3) of a glide from a cell's least height, m: straight from step to step, and looked at every 5 m."""
    moves, made, places = glide_steps()[0], found.grid, []
    while (m := found.next_step[row, column]) >= 0:
        i, j = row + int(moves[m].north), column + int(moves[m].east)
        begin, end = ((*made.cell_center(*at), float(found.min_altitude[at])) for at in ((row, column), (i, j)))
        # It begins where it has to, and what it loses ends at the next place or above it.
        loss = made.cell * moves[m].length * SINK / math.sqrt(true_airspeed(end[2]) ** 2 - SINK**2)
        share = np.linspace(0.0, 1.0, 2 + int(made.cell * moves[m].length / 5.0))[:, None]
        places.append(np.array(begin) + share * (np.array([end[0], end[1], begin[2] - loss]) - np.array(begin)))
        row, column = i, j
    return np.concatenate(places)


@pytest.mark.parametrize(
    ("far", "radius"), [(5900.0, 400.0), *some([(17_000.0, 28.0), (17_000.0, 90.0), (17_000.0, 900.0)], 3)]
)
def test_no_way_cuts_into_a_sphere(far: float, radius: float) -> None:
    """Ways from all around are laid over the sphere itself: they enter it by no more than a cell's loss of height.

    It is about the corner of four cells, where ways from behind it come by: one of 28 m holds none of their middles.
    """
    terrain = ground(lambda east, _north: 0.0 * east, 18_000.0)
    bare = make_glide_map(terrain, MIDDLE, MARGIN, NO_SPHERES, NO_RADII, far)
    assert bare is not None
    corner = np.array(bare.cell_center(*bare.cell_at(1510.0, 7.0))) + 0.5 * bare.cell
    middle = np.array([*corner, height_needed(*corner, MARGIN)])
    made = make_glide_map(terrain, MIDDLE, MARGIN, middle[None, :], np.array([radius]), far)
    assert made is not None
    found = searched(terrain, made)
    deepest, near = -math.inf, 0
    for bearing in range(0, 360, 3):
        away = (radius + 300.0) * np.array([math.sin(math.radians(bearing)), math.cos(math.radians(bearing))])
        way = flown(found, *made.cell_at(*(corner + away)))
        depth = radius - float(np.linalg.norm(way - middle, axis=1).min())
        deepest, near = max(deepest, depth), near + (depth > -50.0)
    assert near > 5
    assert deepest <= made.cell * math.sqrt(2.0) * SINK / AIRSPEED * 1.02


def test_no_step_flies_lower_than_what_it_crosses_or_than_what_comes_next() -> None:
    """Over hills of some 300 m: from its least height each cell's own step is flown, and looked at 50 times."""
    hills = ground(lambda east, north: 150.0 * (2.0 + np.sin(east / 170.0) + np.cos(north / 130.0)), 3000.0)
    made = make_glide_map(hills, MIDDLE, MARGIN, NO_SPHERES, NO_RADII, 2800.0)
    assert made is not None
    found = searched(hills, made)
    moves = glide_steps()[0]
    for row, column in np.random.default_rng(5).integers(60, 160, (scaled(3000, 600), 2)):
        move = moves[found.next_step[row, column]]
        begin, end = found.min_altitude[row, column], found.min_altitude[row + move.north, column + move.east]
        loss = made.cell * move.length * SINK / math.sqrt(true_airspeed(end) ** 2 - SINK**2)
        assert begin - loss >= end - 0.1
        for share in np.linspace(0.01, 0.99, 50):
            cell = round(row + share * move.north), round(column + share * move.east)
            # Cells of its ends have their highest ground for their middles; a sample further on it is 2 % lower.
            if cell not in ((row, column), (row + move.north, column + move.east)):
                assert begin - share * loss >= made.floor[cell] - 0.02 * loss
