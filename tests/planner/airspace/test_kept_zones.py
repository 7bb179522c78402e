"""The order of zones, those near a place, and margins that give way to fixed ends."""

import numpy as np
import pytest

from planner.airspace.kept_zones import ZoneMargins, first_near, keep_zones
from world.airspace.zones import Cylinder, Zone, ZoneLevel, make_polygon

FAR = np.zeros((0, 3))


def cylinders(*east_radius: tuple[float, float]) -> list[Zone]:
    return [Zone(f"zone {k}", "exclusion", Cylinder(east, 0.0, radius)) for k, (east, radius) in enumerate(east_radius)]


def test_inclusions_come_first_and_exclusions_from_west_to_east() -> None:
    zones = cylinders((500.0, 10.0), (-500.0, 10.0))
    zones.append(Zone("fence", "inclusion", Cylinder(0.0, 0.0, 5000.0)))
    kept = keep_zones(zones, FAR, None, ZoneMargins(10.0, 5.0, 1.0))
    assert kept.kept["number"].tolist() == [2, 1, 0]
    assert kept.inclusions == 1


def test_no_exclusion_near_a_place_comes_before_the_first_near_it() -> None:
    """Also behind a wide one that hides, by its western edge, how far east it reaches."""
    rng = np.random.default_rng(5)
    zones = cylinders((0.0, 900.0), *zip(rng.uniform(-3000.0, 3000.0, 60), rng.uniform(5.0, 200.0, 60), strict=True))
    kept = keep_zones(zones, FAR, None, ZoneMargins(10.0, 5.0, 1.0))
    for west in rng.uniform(-3500.0, 3500.0, 50):
        first = first_near(kept, west)
        assert (kept.records.zones["east"][:first] < west).all()
        assert first == len(zones) or kept.records.zones["east"][first] >= west


@pytest.mark.parametrize(("east", "beside"), [(211.0, 10.0), (206.0, 3.0), (199.0, 0.0)])
def test_an_end_beside_an_exclusion_leaves_half_of_what_it_keeps(east: float, beside: float) -> None:
    ends = np.array([[east, 0.0, 50.0]])
    kept = keep_zones(cylinders((0.0, 200.0)), ends, None, ZoneMargins(10.0, 5.0, 0.5)).kept
    assert (float(kept["beside"][0]), float(kept["beyond"][0])) == pytest.approx((beside, 5.0), abs=1e-9)


def test_an_end_below_a_floor_leaves_half_of_what_it_keeps_in_height() -> None:
    zone = Zone("city", "exclusion", Cylinder(0.0, 0.0, 200.0), floor=ZoneLevel(54.0, "amsl"))
    kept = keep_zones([zone], np.array([[0.0, 0.0, 50.0]]), None, ZoneMargins(10.0, 5.0, 0.5)).kept
    assert (float(kept["beside"][0]), float(kept["beyond"][0])) == (10.0, 2.0)


def test_an_end_near_the_edge_of_an_inclusion_leaves_half_of_what_it_keeps_there() -> None:
    square = make_polygon([[(0.0, 0.0), (900.0, 0.0), (900.0, 900.0), (0.0, 900.0)]])
    zone = Zone("fence", "inclusion", square, ceiling=ZoneLevel(52.0, "amsl"))
    kept = keep_zones([zone], np.array([[894.0, 450.0, 50.0]]), None, ZoneMargins(10.0, 5.0, 0.5)).kept
    assert (float(kept["beside"][0]), float(kept["beyond"][0])) == pytest.approx((3.0, 1.0))
