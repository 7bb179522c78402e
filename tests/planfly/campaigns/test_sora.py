"""Ground risk class and volumes of SORA 2.5 against its table 2 and against its formulas by hand."""

import math

import pytest

from planfly.campaigns.sora import (
    ContingencyFormula,
    ballistic_buffer,
    glide_buffer,
    ground_risk_class,
    min_geography_half_width,
    one_to_one_buffer,
)

# Table 2 of the main body, edition 2.5 (annex F, table 2): the densities below which a row applies, and its classes for
# 1 m and 25 m/s, 3 m and 35 m/s, 8 m and 75 m/s, 20 m and 120 m/s, 40 m and 200 m/s.
TABLE_2: dict[float, tuple[int | None, ...]] = {
    5.0: (2, 3, 4, 5, 6),
    50.0: (3, 4, 5, 6, 7),
    500.0: (4, 5, 6, 7, 8),
    5000.0: (5, 6, 7, 8, 9),
    50_000.0: (6, 7, 8, 9, 10),
    math.inf: (7, 8, None, None, None),
}
CONTROLLED = (1, 1, 2, 3, 3)
COLUMNS = ((1.0, 25.0), (3.0, 35.0), (8.0, 75.0), (20.0, 120.0), (40.0, 200.0))


@pytest.mark.parametrize("limit", TABLE_2)
def test_every_class_of_table_2(limit: float) -> None:
    density = 60_000.0 if math.isinf(limit) else 0.999 * limit
    found = tuple(ground_risk_class(density, dimension, speed, 10.0) for dimension, speed in COLUMNS)
    assert found == TABLE_2[limit]


def test_a_controlled_ground_area_has_its_own_row() -> None:
    found = tuple(ground_risk_class(60_000.0, dimension, speed, 10.0, controlled=True) for dimension, speed in COLUMNS)
    assert found == CONTROLLED


@pytest.mark.parametrize(
    ("density", "dimension", "speed", "mass", "expected"),
    [
        # Just below, at and above the limit of a row.
        (4.99, 2.9, 33.0, 13.5, 3),
        (5.0, 2.9, 33.0, 13.5, 4),
        (49.9, 2.9, 33.0, 13.5, 4),
        (50.0, 2.9, 33.0, 13.5, 5),
        (499.9, 2.9, 33.0, 13.5, 5),
        (500.0, 2.9, 33.0, 13.5, 6),
        (5000.0, 2.9, 33.0, 13.5, 7),
        (50_000.0, 2.9, 33.0, 13.5, 8),
        (50_000.0, 3.1, 33.0, 13.5, None),
        # At and above the limit of a column: both dimension and speed have to be kept.
        (100.0, 1.0, 25.0, 2.0, 4),
        (100.0, 1.01, 25.0, 2.0, 5),
        (100.0, 1.0, 25.1, 2.0, 5),
        (100.0, 3.0, 35.1, 20.0, 6),
        (100.0, 8.1, 35.0, 90.0, 7),
        (100.0, 8.0, 120.1, 90.0, 8),
        (100.0, 40.1, 50.0, 5000.0, None),
        (100.0, 20.0, 200.1, 5000.0, None),
        # At most 250 g and 25 m/s: class 1 over any population.
        (60_000.0, 0.3, 25.0, 0.25, 1),
        (60_000.0, 0.3, 25.0, 0.251, 7),
        (60_000.0, 0.3, 25.1, 0.25, 8),
    ],
)
def test_twenty_operations(density: float, dimension: float, speed: float, mass: float, expected: int | None) -> None:
    assert ground_risk_class(density, dimension, speed, mass) == expected


def test_the_contingency_volume_of_a_fixed_wing_aircraft_by_hand() -> None:
    formula = ContingencyFormula(speed=30.0, flight_height=120.0)
    # 30 m/s for 1 s; 30^2 / (9.81 x 0.577350) = 158.9 m.
    assert formula.reaction_distance == 30.0
    assert formula.turn_distance == pytest.approx(158.904, abs=1e-3)
    assert formula.width == pytest.approx(3.0 + 3.0 + 1.0 + 30.0 + 158.904, abs=1e-3)
    # 30 x 0.707107 x 1 = 21.2 m; 0.3 x 900 / 9.81 = 27.5 m.
    assert formula.reaction_height == pytest.approx(21.213, abs=1e-3)
    assert formula.level_off_height == pytest.approx(27.523, abs=1e-3)
    assert formula.height == pytest.approx(120.0 + 1.0 + 21.213 + 27.523, abs=1e-3)
    assert formula.width_terms == "3 + 3 + 1 + 30.0 + 158.9"
    assert formula.height_terms == "120.0 + 1 + 21.2 + 27.5"


def test_the_ground_risk_buffers_by_hand() -> None:
    assert one_to_one_buffer(169.7, 2.9) == pytest.approx(171.15)
    # A fall of 176.58 m takes sqrt(2 x 176.58 / 9.81) = 6 s.
    assert ballistic_buffer(176.58, 3.0, 30.0) == pytest.approx(6.0 * 30.0 + 1.5)
    assert glide_buffer(169.7, 12.0) == pytest.approx(2036.4)


def test_the_flight_geography_is_at_least_three_dimensions_wide() -> None:
    assert min_geography_half_width(2.0) == 3.0
