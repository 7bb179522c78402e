"""Environments of Darlan and others: generator, objectives, hypervolumes and routes, by hand."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from benchmarks.planning.public_environments import (
    Environment,
    make_city,
    make_environments,
    make_mountains,
    make_suburb,
    path_heights,
    place_buildings,
    read_environment,
    score_tracks,
    spline_basis,
    zone_cells,
)
from benchmarks.planning.public_fronts import (
    BUDGET,
    BudgetSpentError,
    CountedScores,
    gain_shares,
    make_methods,
    published_hypervolume,
    route_vectors,
    run,
)


def flat() -> Environment:
    """Return level ground at 10, with a safe height of 5 and an end at 15."""
    return Environment("flat", np.full((200, 200), 10.0), 15.0, 5.0, 7)


def test_spline_of_four_points_is_a_bezier_curve() -> None:
    basis = spline_basis(4)
    assert basis.shape == (201, 4)
    assert basis[[0, 100, 200]] == pytest.approx(np.array([[1, 0, 0, 0], [0.125, 0.375, 0.375, 0.125], [0, 0, 0, 1]]))


def test_objectives_of_the_straight_path() -> None:
    """200 steps along the diagonal; the first one climbs 5, from the ground to the safe height."""
    places = np.linspace(1.0, 200.0, 201)
    objectives, excess = flat().score(np.column_stack([places, places])[None])
    step = 199.0 * math.sqrt(2.0) / 200.0
    assert objectives[0] == pytest.approx([199.0 * step + math.hypot(step, 5.0), (10.0 + 200.0 * 15.0) / 201.0])
    assert excess.tolist() == [0.0]


def test_path_climbs_60_degrees_to_a_tower() -> None:
    """A tower of 100 at the fifth of nine places, one cell apart: each place before and after is tan 60 lower."""
    ground = np.zeros((9, 9))
    ground[4, 4] = 100.0
    track = np.column_stack([np.arange(1.0, 10.0), np.full(9, 5.0)])
    ramp = [105.0 - k * math.sqrt(3.0) for k in (3, 2, 1, 0, 1, 2, 3)]
    assert path_heights(track, ground, 5.0, 7.0) == pytest.approx([0.0, *ramp, 7.0])


def test_height_is_that_of_the_highest_of_four_cells() -> None:
    """Between cells (2, 2) and (3, 3); the cell of 8 is north-west, at east 2 and north 3."""
    ground = np.zeros((4, 4))
    ground[2, 1] = 8.0
    track = np.array([[1.0, 1.0], [2.5, 2.5], [4.0, 4.0]])
    assert path_heights(track, ground, 1.0, 0.0).tolist() == [0.0, 9.0, 0.0]


@pytest.mark.parametrize(("back", "excess_deg"), [((4.0, 2.0), 0.0), ((3.0, 1.0), 75.0)])
def test_turn_of_more_than_105_degrees(back: tuple[float, float], excess_deg: float) -> None:
    """East for three steps, then north (90 degrees) or back west (180)."""
    track = np.array([[1.0, 1.0], [2.0, 1.0], [3.0, 1.0], [4.0, 1.0], back, back])
    row = score_tracks(track[None], np.zeros((9, 9)), 1.0, 1.0)[0]
    assert math.degrees(row[2]) == pytest.approx(excess_deg)


def test_ground_of_a_city_is_a_sum_of_four_waves() -> None:
    def wave(east: int, north: int) -> float:
        return sum(math.sin(0.1 * k * east) * math.sin(0.1 * k * north) * 0.5 ** (k - 1) for k in (1, 2, 3, 4))

    ground = make_city(0, -1.0, np.random.default_rng(1), name="c").ground
    assert (ground.min(), ground.max()) == (0.0, pytest.approx(30.5))
    expected = (wave(40, 7) - wave(1, 1)) / (wave(120, 60) - wave(1, 1))
    assert (ground[6, 39] - ground[0, 0]) / (ground[59, 119] - ground[0, 0]) == pytest.approx(expected)


def test_ground_of_a_suburb() -> None:
    def wave(east: int, north: int) -> float:
        slow = math.sin(0.005 * east) + math.sin(0.005 * north)
        return slow + 0.5 * math.sin(0.03 * east) * math.sin(0.03 * north)

    ground = make_suburb(0, -1.0, np.random.default_rng(1), name="s").ground
    assert (ground.min(), ground.max()) == (0.0, pytest.approx(40.0))
    expected = (wave(40, 7) - wave(1, 1)) / (wave(120, 60) - wave(1, 1))
    assert (ground[6, 39] - ground[0, 0]) / (ground[59, 119] - ground[0, 0]) == pytest.approx(expected)


def test_building_stands_on_the_mean_height_of_its_cells() -> None:
    """Only 3 x 3 cells are free, one at 6 and eight at 0: mean 2/3, building 4 higher."""
    ground, zone = np.zeros((200, 200)), np.ones((200, 200), dtype=bool)
    ground[51, 81], zone[50:53, 80:83] = 6.0, False
    place_buildings(ground, zone, 1, (3, 3), (4, 4), np.random.default_rng(1))
    assert ground[50:53, 80:83] == pytest.approx(np.full((3, 3), 4.0 + 2.0 / 3.0))
    assert ground.sum() == pytest.approx(9.0 * (4.0 + 2.0 / 3.0))


def test_zone_of_radius_2() -> None:
    """13 cells: the middle, 4 at 1, 4 at the square root of 2, 4 at 2."""
    zone = zone_cells(100.0, 50.0, 2.0)
    assert zone.sum() == 13
    assert zone[49, 101]
    assert not zone[50, 101]


def test_mountains() -> None:
    """Heights from 0 to 300, or to 400 with a zone, which is 10 higher."""
    ground = make_mountains(1, -1.0, np.random.default_rng(1), name="m").ground
    assert (ground.min(), ground.max()) == (0.0, 300.0)
    zoned = make_mountains(30, 25.0, np.random.default_rng(1), name="m").ground
    middle = 100.0 + 200.0 / 3.5
    cells = np.arange(1, 201)
    inside = (cells[None, :] - middle) ** 2 + (cells[:, None] - middle) ** 2 <= 625.0
    assert (zoned[inside] == 410.0).all()
    assert zoned[~inside].max() <= 400.0


def test_environments_have_the_published_numbers() -> None:
    made = {one.name: (one.end_height, one.safe_height, one.control_count) for one in make_environments(1)}
    assert made["city"] == made["city, zone"] == (100.0, 90.0, 7)
    assert (made["suburb"], made["suburb, zone"]) == ((40.0, 5.0, 7), (40.0, 5.0, 10))
    assert made["mountains"] == made["mountains, zone"] == (1.0, 10.0, 7)


def test_published_map_is_read(tmp_path: Path) -> None:
    file = tmp_path / "terrainStruct_x_1.mat"
    table = {"H": np.eye(200), "end": np.array([[200], [200], [40]]), "safeH": 5, "n": 10}
    savemat(file, {"terrainStruct": table})
    one = read_environment(file)
    assert (one.name, one.end_height, one.safe_height, one.control_count) == ("x_1", 40.0, 5.0, 10)
    assert np.array_equal(one.ground, np.eye(200))


def test_hypervolumes() -> None:
    """A quarter of the square; beside it a point that adds (4400 - 3300) (2200 - 1100), a sixteenth of the square."""
    middle, low = [2200.0, 2200.0], [3300.0, 1100.0]
    assert published_hypervolume(np.array([middle, [5000.0, 1.0]])) == pytest.approx(1.0 / 4.0)
    assert published_hypervolume(np.array([middle, low])) == pytest.approx(5.0 / 16.0)


def test_gain_shares() -> None:
    """The straight path covers 1/16, the fronts 4/16 and 3/16, both together 5/16: gains of 3 and 2 out of 4."""
    fronts = [np.array([[2200.0, 2200.0]]), np.array([[3300.0, 1100.0]])]
    assert gain_shares(fronts, np.array([3300.0, 3300.0])) == pytest.approx([3.0 / 4.0, 2.0 / 4.0])


def test_paths_after_the_budget_and_sharp_turns_do_not_count() -> None:
    """Three paths with two evaluations left: one goes back along the diagonal; the last is shorter but too late."""
    scores = CountedScores(flat(), spent=BUDGET - 2)
    back, bent, straight = [200.0] * 4 + [1.0] * 6, [90.0, 40.0] * 5, np.repeat(np.linspace(34.0, 167.0, 5), 2)
    values = scores.allowed([back, bent, straight])
    assert np.isinf(values[0]).all()
    assert scores.front() == pytest.approx(values[1:2])
    with pytest.raises(BudgetSpentError):
        scores([straight])


def test_routes_on_level_ground_are_straight() -> None:
    points = route_vectors(flat()).reshape(20, 5, 2)
    assert points[:, :, 0] == pytest.approx(points[:, :, 1])


def test_first_vectors_advance_near_the_diagonal() -> None:
    points = flat().first_vectors(50, np.random.default_rng(1)).reshape(50, 5, 2)
    assert (np.diff(points, axis=1) >= 0.0).all()
    middle = 200.0 * np.arange(2, 7)[:, None] / 7.0
    assert (np.abs(points - middle) <= 20.0).all()


@pytest.mark.parametrize("name", ["front", "optimise partial, both", "optimise umda, 20 weights"])
def test_methods_find_the_way_around_a_hill(name: str) -> None:
    """A hill of 100 in the middle, 60 cells wide: the lowest path passes beside it, at 15 all the way."""
    environment = flat()
    environment.ground[70:130, 70:130] = 110.0
    made = run(make_methods()[name], environment, 1)
    front = np.array(made["front"])
    assert made["evaluations"] == BUDGET
    assert front[:, 1].min() == pytest.approx((10.0 + 200.0 * 15.0) / 201.0)
    # At least the two straight lines from the ends to a corner of the hill.
    corner = 2.0 * math.hypot(129.0, 70.0)
    assert corner < front[-1, 0] < 1.1 * corner
