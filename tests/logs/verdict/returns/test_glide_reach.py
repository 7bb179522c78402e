"""What is left of an aircraft's height when its engine stops, ahead and behind, by plain sums."""

import csv
import math

import numpy as np
import pytest

from flight.autopilots.simulated_returns import RETURN_START, ReturnEnvironment
from logs.verdict.returns.glide_map import glide_slopes, make_glide_map, search_glide_altitudes
from logs.verdict.returns.glide_reach import cell_position, remaining_glide_altitudes
from tests.flight.autopilots.arduplane.kept_flights import FOLDER, HOME, WIND, jacksboro
from tests.flight.autopilots.arduplane.test_rtl_point_mass import aerosonde
from tests.logs.verdict.returns.gliders import (
    AIRSPEED,
    BANK,
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
from world.forecast.wind_field import WindField
from world.frames import fit_polymap
from world.kernels import Records
from world.terrain import Terrain

MARGIN, TOP, CRUISE, REACTION = 30.0, 2000.0, 26.0, 3.0
# In a turn, at the same angle of attack: m/s; how long half a circle lasts, s.
FAST = CRUISE / math.sqrt(math.cos(BANK))
HALF = math.pi * FAST / (9.80665 * math.tan(BANK))


def left_of(
    terrain: Terrain,
    *,
    up: float = 800.0,
    course: float = 0.0,
    wind: float = 0.0,
    blows_to: float = 0.0,
    east: float = 0.0,
    north: float = 0.0,
    speed: float = CRUISE,
    sphere: tuple[float, ...] = (),
    fast_sink: float = SINK,
    induced: float = 0.0,
    growth: float = 0.0,
    bank: float = BANK,
) -> tuple[float, tuple[float, float, float]]:
    """What is left of a start's height to reach a place 3 km north of the middle, and which place that is."""
    spheres, radii = (np.array([sphere[:3]]), np.array([sphere[3]])) if sphere else (NO_SPHERES, NO_RADII)
    made = make_glide_map(terrain, np.zeros((1, 2)), MARGIN, spheres, radii, 5900.0) if sphere else map_of(terrain)
    assert made is not None
    aircraft = glider(wind, blows_to, fast_sink, induced, growth)
    needs = search_glide_altitudes(
        made, np.array([made.cell_at(0.0, 3000.0)]), glide_slopes(aircraft, AIRSPEED, 0.0, TOP), TOP
    )
    start: Records = np.zeros(1, RETURN_START)
    to = math.radians(blows_to)
    start["east"], start["north"], start["up"] = east, north, up
    start["velocity_east"] = speed * math.sin(math.radians(course)) + wind * math.sin(to)
    start["velocity_north"] = speed * math.cos(math.radians(course)) + wind * math.cos(to)
    around = ReturnEnvironment(terrain.heights, terrain.to_pixel.record, spheres, radii, True)
    left, reached = remaining_glide_altitudes(start, needs, aircraft, around, AIRSPEED, bank)
    return float(left[0]), cell_position(made, int(reached[0])) if reached[0] >= 0 else (math.nan,) * 3


def test_straight_ahead_it_costs_the_way_alone() -> None:
    left, place = left_of(plane())
    # 3 s at 1.8 m/s, 78 m on the way; then the glide.
    expected = 800.0 - REACTION * SINK - height_needed(0.0, 3000.0 - REACTION * CRUISE, MARGIN)
    assert left == pytest.approx(expected, abs=8.0)
    assert place[:2] == pytest.approx((0.0, 3000.0), abs=20.0)


def test_it_turns_in_the_wind_of_its_start_in_a_forecast() -> None:
    # 6 m/s from the south at 100 s and none at 0 s: as in that wind, whatever the mean wind is.
    velocities = np.zeros((2, 1, 1, 1, 2))
    velocities[1, ..., 1] = 6.0
    field = WindField(np.array([0.0, 100.0]), np.zeros(1), np.zeros(1), np.zeros((2, 1, 1, 1)), velocities)
    lefts = []
    for aircraft, time in ((glider(6.0, 0.0), 0.0), (glider()._replace(field=field.packed()), 100.0)):
        made = map_of(plane())
        slopes = glide_slopes(glider(), AIRSPEED, 0.0, TOP)
        needs = search_glide_altitudes(made, np.array([made.cell_at(0.0, 3000.0)]), slopes, TOP)
        start: Records = np.zeros(1, RETURN_START)
        start["up"], start["velocity_north"], start["velocity_east"], start["time"] = 800.0, 6.0, CRUISE, time
        around = ReturnEnvironment(plane().heights, plane().to_pixel.record, NO_SPHERES, NO_RADII, True)
        aircraft.record.geo_map = fit_polymap(lambda x, y: (0.0 * x, 0.0 * y), [[-1.0, 1.0]] * 2, 1e-9).record
        lefts.append(float(remaining_glide_altitudes(start, needs, aircraft, around, AIRSPEED, BANK)[0][0]))
    assert lefts[1] == pytest.approx(lefts[0], abs=0.01)


@pytest.mark.parametrize("course", [90.0, -90.0, 150.0, -150.0])
def test_behind_it_the_turn_costs_its_time_and_its_way(course: float) -> None:
    left, _ = left_of(plane(), course=course)
    rate = 9.80665 * math.tan(BANK) / FAST
    radius, turned = FAST / rate, math.radians(abs(course))
    # Ahead 78 m, then the arc: where it ends, beside and along the first course.
    along, beside = REACTION * CRUISE + radius * math.sin(turned), radius * (1.0 - math.cos(turned))
    to = math.radians(abs(course))
    north = along * math.cos(to) + beside * math.sin(to)
    east = along * math.sin(to) - beside * math.cos(to)
    needed = height_needed(east, 3000.0 - north, MARGIN)
    expected = 800.0 - SINK * (REACTION + turned / rate) - needed
    # It turns in parts of 10 degrees, and a little less than back to the course along which the place lies.
    assert left == pytest.approx(expected, abs=8.0)


def test_it_sinks_in_its_turn_as_it_does_at_its_airspeed() -> None:
    """5.4 m/s at 26 m/s, and 1.8 m/s in the glide: 3.6 m/s more for as long as it flies on and turns."""
    lasts = REACTION + HALF
    slow, fast = (left_of(plane(), course=180.0, fast_sink=sink)[0] for sink in (SINK, 3.0 * SINK))
    assert slow - fast == pytest.approx(2.0 * SINK * lasts, abs=6.0)


def turning_back(
    bank: float, fast: float, sink: float, speed: float = CRUISE, allowed: float = 0.0
) -> tuple[float, float]:
    """What is left where half a circle ends right below the place, and what would be by plain sums.

    bank: rad, fast: m/s, sink: m/s, in the turn.  allowed: bank, rad, where it is more.
    """
    rate = 9.80665 * math.tan(bank) / fast
    left, _ = left_of(
        plane(), course=180.0, east=2.0 * fast / rate, speed=speed, induced=120.0, growth=2.0, bank=max(bank, allowed)
    )
    needed = height_needed(0.0, 3000.0 + REACTION * speed, MARGIN)
    return left, 800.0 - SINK * REACTION - sink * math.pi / rate - needed


def test_a_turn_takes_the_time_and_the_induced_drag_of_its_load() -> None:
    """In 40 degrees 29.7 m/s instead of 26, of induced drag as much more as the load's square: 1.7 times it."""
    bank = math.radians(40.0)
    fast = CRUISE / math.sqrt(math.cos(bank))
    sink = SINK + 2.0 * (fast - CRUISE) + 120.0 / fast * math.tan(bank) ** 2
    left, expected = turning_back(bank, fast, sink)
    assert left == pytest.approx(expected, abs=4.0)


def test_a_turn_is_as_wide_as_the_airspeed_of_its_load_makes_it() -> None:
    """In 40 degrees 214 m, where 26 m/s would make 164 m: between slopes at 210 m it does not get around."""
    left = [
        left_of(
            ground(lambda east, _north, at=at: np.where(np.abs(east) > at, 1200.0, 0.0), pitch=10.0),
            course=180.0,
            bank=math.radians(40.0),
        )[0]
        for at in (210.0, 230.0)
    ]
    assert left[0] == -math.inf
    assert left[1] > 0.0


@pytest.mark.parametrize("speed", [CRUISE, true_airspeed(800.0)])
def test_it_banks_no_further_than_its_airspeed_bears_and_turns_no_faster_than_it_may(speed: float) -> None:
    """Of 80 degrees at 26 m/s 58.8 are left, at 30 m/s, the fastest; at its least airspeed 25 degrees."""
    bank = max(math.radians(25.0), math.acos((true_airspeed(800.0) / speed) ** 2))
    fast = min(30.0, speed / math.sqrt(math.cos(bank)))
    sink = SINK + 2.0 * max(0.0, fast - 26.0) + 120.0 / fast * math.tan(bank) ** 2
    left, expected = turning_back(bank, fast, sink, speed, math.radians(80.0))
    assert left == pytest.approx(expected, abs=4.0)


def test_in_wind_it_turns_with_the_wind() -> None:
    """It drifts 10 m/s times the turn's time, towards the place or away from it."""
    still = left_of(plane(), course=180.0)[0]
    time = REACTION + HALF
    for blows_to in (0.0, 180.0):
        sign = 1.0 if blows_to == 0.0 else -1.0
        away = 3000.0 + REACTION * CRUISE
        calm = height_needed(240.0, away, MARGIN)
        windy = height_needed(240.0, sign * 10.0 * time - away, MARGIN, 10.0, blows_to)
        assert left_of(plane(), course=180.0, wind=10.0, blows_to=blows_to)[0] - still == pytest.approx(
            calm - windy, abs=0.05 * windy + 5.0
        )


@pytest.mark.parametrize("blows_to", [90.0, 270.0])
def test_across_the_wind_it_turns_into_it(blows_to: float) -> None:
    """10 m/s from the side for 18.5 s: of the 276 m that a turn leads aside 185 m are taken back."""
    lasts = REACTION + HALF
    aside = 2.0 * FAST**2 / (9.80665 * math.tan(BANK)) - 10.0 * lasts
    away = 600.0 + REACTION * CRUISE
    needed = height_needed(math.copysign(aside, blows_to - 180.0), -away, MARGIN, 10.0, blows_to)
    # Between slopes it gets around into the wind alone: with it, it would be 461 m aside.
    slope = ground(lambda east, _north: np.where(np.abs(east) > 250.0, 1200.0, 0.0))
    left, _ = left_of(slope, course=180.0, wind=10.0, blows_to=blows_to, north=2400.0)
    assert left == pytest.approx(800.0 - SINK * lasts - needed, abs=9.0)


def test_a_turn_that_would_meet_the_ground_or_a_sphere_is_flown_to_the_other_side() -> None:
    """A slope to the right that begins 100 m beside it; the same as a sphere."""
    free = left_of(plane(), course=180.0)[0]
    hill = ground(lambda east, _north: np.where(east < -150.0, 1200.0, 0.0))
    assert left_of(hill, course=180.0)[0] == pytest.approx(free, abs=8.0)
    sphere = (-400.0, 0.0, 800.0, 320.0)
    assert left_of(plane(), course=180.0, sphere=sphere)[0] == pytest.approx(free, abs=8.0)
    both = ground(lambda east, _north: np.where(np.abs(east) > 150.0, 1200.0, 0.0))
    assert left_of(both, course=180.0)[0] == -math.inf


def test_too_low_or_beyond_the_map_nothing_is_left() -> None:
    assert left_of(plane(), up=MARGIN + 3.0)[0] == -math.inf
    missing = 100.0 - REACTION * SINK - height_needed(0.0, 3000.0 - REACTION * CRUISE, MARGIN)
    assert left_of(plane(), up=100.0)[0] == pytest.approx(missing, abs=8.0)
    assert left_of(plane(), east=20_000.0)[0] == -math.inf


def test_slower_than_the_glide_it_turns_at_the_glides_airspeed() -> None:
    least = true_airspeed(800.0)
    slow, fast = (left_of(plane(), course=180.0, speed=speed)[0] for speed in (10.0, least))
    # After 3 s it is nearer by so much, and turns alike.
    assert slow == pytest.approx(fast + REACTION * (least - 10.0) * SINK / least, abs=6.0)


def test_home_is_in_reach_from_where_arduplane_glided_to_it() -> None:
    """Eight of its flights turned home without a motor: two got there, six came down 3.6 to 18 km before it."""
    with (FOLDER / "glides.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["mode"] == "RTL"]
    starts: Records = np.zeros(len(rows), RETURN_START)
    columns = {"east": "east_m", "north": "north_m", "up": "amsl_m"}
    columns |= {f"velocity_{way}": f"velocity_{way}_mps" for way in ("east", "north", "up")}
    for name, column in columns.items():
        starts[name] = [float(row[column]) for row in rows]
    terrain = jacksboro().terrain
    assert terrain is not None
    places = np.concatenate([np.stack([starts["east"], starts["north"]], axis=1), [HOME[:2]]])
    made = make_glide_map(terrain, places, MARGIN, NO_SPHERES, NO_RADII)
    assert made is not None
    aircraft, top = aerosonde(WIND), float(starts["up"].max())
    slopes = glide_slopes(aircraft, AIRSPEED, float(np.nanmin(made.ground)), top)
    needs = search_glide_altitudes(made, np.array([made.cell_at(*HOME[:2])]), slopes, top)
    around = ReturnEnvironment(terrain.heights, terrain.to_pixel.record, NO_SPHERES, NO_RADII, True)
    left, _ = remaining_glide_altitudes(starts, needs, aircraft, around, AIRSPEED, BANK)
    assert (left >= 0.0).tolist() == [row["reaches_home"] == "1" for row in rows]
    # ArduPlane dives onto its slope, and comes over home lower than the best glide would, or as high.
    assert all(0.0 <= one < 300.0 for one in left[left >= 0.0])
