"""Volumes from the rows of flights by hand, the class over made populations, and the areas of real flights."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely.geometry.base import BaseGeometry

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from planfly.campaigns.campaign_base import CampaignBase, GivenWind, open_campaign
from planfly.campaigns.dispersions import default_dispersions, draw_flight
from planfly.campaigns.find_ground_risk import (
    ExcursionRow,
    GroundRiskGoal,
    GroundRiskResult,
    areas_between,
    find_ground_risk,
    fly_for_excursions,
    make_volumes,
    nominal_path,
    turn_areas,
    turn_of_return,
    with_ground_class,
)
from planfly.campaigns.ground_risk_text import DISCLAIMER, answer_line, risk_lines, table_text
from planfly.campaigns.worker_pool import Workers
from tests.world.made.elevation_files import from_origin, write_raster
from world.arrays import Floats
from world.errors import ArgumentError, PlanflyError

# Wing span (m) and highest airspeed (m/s) of the aerosonde, as in its data.
SPAN_M = 2.8956
SPEED_MPS = 31.0
PATH = shapely.LineString([(0.0, 0.0), (1000.0, 0.0)])


@pytest.fixture(scope="module")
def base() -> CampaignBase:
    return open_campaign("tight", default_dispersions(), {"seed": 1})


def row(
    deviation: float,
    north: float,
    impact_north: float,
    height: float = 80.0,
    ended: str = "completed",
    turn: float = 0.0,
) -> ExcursionRow:
    """Make the row of a flight that reaches so far north with its returns, in their turns, and with its falls."""
    flown, fallen = shapely.box(0.0, 0.0, 1000.0, north), shapely.box(0.0, 0.0, 1000.0, impact_north)
    return ExcursionRow(
        draw=draw_flight(default_dispersions(), 1, 0),
        outcome="flyable",
        ended=ended,
        deviation=deviation,
        turn_deviation=max(deviation, turn),
        height=height,
        return_height=height + 20.0,
        ground_speed=28.0,
        flown=shapely.to_wkb(flown),
        fallen=shapely.to_wkb(fallen),
    )


def volumes(
    base: CampaignBase, rows: list[ExcursionRow], glide_ratio: float | None = None, **goal: object
) -> GroundRiskResult:
    question = GroundRiskGoal(flights=len(rows), glide=glide_ratio is not None, **goal)  # type: ignore[arg-type]
    return make_volumes(base, question, PATH, tuple(rows), glide_ratio)


def test_the_flight_geography_holds_the_quantile_of_the_flights(base: CampaignBase) -> None:
    rows = [row(float(k), 10.0, 20.0, height=float(k)) for k in range(1, 101)]
    result = volumes(base, rows)
    # Position n p + (p + 1) / 3 of the sorted values 1 to 100 (Hyndman and Fan 1996, definition 8).
    assert result.flown.deviation == pytest.approx(95.65)
    assert result.flown.height == pytest.approx(95.65)
    # A corridor of 1,000 m with half circles at its ends, which shapely makes of 32 corners.
    assert result.geography.area == pytest.approx(2.0 * 95.65 * 1000.0 + math.pi * 95.65**2, rel=2e-3)


def test_a_narrow_flight_geography_is_three_spans_wide(base: CampaignBase) -> None:
    result = volumes(base, [row(1.0, 10.0, 20.0)] * 20)
    assert result.half_width == pytest.approx(1.5 * SPAN_M)


def test_flown_widths_are_measured_beyond_the_volume_inside(base: CampaignBase) -> None:
    result = volumes(base, [row(50.0, 400.0, 600.0, turn=300.0), *[row(50.0, 40.0, 60.0)] * 19])
    assert result.flown.contingency_width == pytest.approx(250.0)
    assert result.flown.return_distance == pytest.approx(350.0)
    assert result.flown.contingency_height == pytest.approx(100.0)
    assert result.flown.buffer_width == pytest.approx(200.0)


def test_the_larger_of_flights_and_formula_counts(base: CampaignBase) -> None:
    # By formula: 7 + 31 + 31^2 / (9.81 tan 30 degrees) = 207.7 m; 80 + 1 + 21.9 + 29.4 = 132.3 m, and 1.4 m more.
    narrow = volumes(base, [row(50.0, 40.0, 60.0)] * 20)
    assert narrow.volume_height == pytest.approx(132.3, abs=0.05)
    assert narrow.volume.bounds[3] == pytest.approx(50.0 + 207.7, abs=0.05)
    assert narrow.footprint.bounds[3] == pytest.approx(50.0 + 207.7 + 133.8, abs=0.1)
    far = volumes(base, [replace(row(50.0, 400.0, 900.0), return_height=200.0)] * 20)
    assert far.volume_height == 200.0
    assert far.volume.bounds[3] == pytest.approx(400.0)
    assert far.one_to_one_buffer == pytest.approx(200.0 + 0.5 * SPAN_M)
    # The falls reach 500 m beyond the returns, and so far around the whole volume.
    assert far.footprint.bounds[3] == pytest.approx(900.0)
    assert far.footprint.bounds[1] == pytest.approx(-50.0 - 207.7 - 500.0, abs=0.05)


def test_the_largest_turn_counts_along_the_whole_path(base: CampaignBase) -> None:
    """Returns turn 300 m to the north of the path; the volume is as wide to the south and beyond both ends."""
    result = volumes(base, [row(50.0, 40.0, 60.0, turn=300.0)] * 20)
    assert result.contingency_width == pytest.approx(250.0)
    assert result.volume.bounds == pytest.approx((-300.0, -300.0, 1300.0, 300.0), abs=0.5)
    table = table_text(result)
    assert "| **width along the whole flight geography** | **250.0 m** |" in table
    assert f"| **width around the operational volume** | **{result.one_to_one_buffer:.1f} m** |" in table


def test_a_glide_widens_the_buffer(base: CampaignBase) -> None:
    result = volumes(base, [row(50.0, 40.0, 60.0)] * 20, glide_ratio=10.0)
    assert result.buffer_width == pytest.approx(10.0 * result.volume_height)
    assert "a glide of 10.0 : 1 requires" in "\n".join(risk_lines(result))


def write_density(path: Path, density: float, half_width: float = 0.03, nodata_from: int = 999) -> Path:
    """A raster of people per km2 about the origin of the scenario, without data from a column on."""
    cells = round(2.0 * half_width * 1200.0)
    people = np.full((cells, cells), density, dtype=np.float32)
    people[:, nodata_from:] = -1.0
    transform = from_origin(8.0 - half_width, 46.0 + half_width, 1 / 1200.0, 1 / 1200.0)
    return write_raster(path, people, "EPSG:4326", transform, nodata=-1.0)


@pytest.mark.parametrize(
    ("density", "speed", "ground_class"),
    [(3.0, None, 3), (312.0, None, 5), (312.0, 36.0, 6), (60_000.0, None, 8), (60_000.0, 36.0, None)],
)
def test_the_class_over_a_population(
    base: CampaignBase, tmp_path: Path, density: float, speed: float | None, ground_class: int | None
) -> None:
    raster = write_density(tmp_path / "density.tif", density)
    rows = [row(50.0, 40.0, 60.0)] * 20
    result = with_ground_class(volumes(base, rows, population=raster, unit="per-km2", speed=speed))
    assert result.is_judged
    assert result.ground_class == ground_class
    expected = "not part of SORA" if ground_class is None else f"intrinsic ground risk class {ground_class}: "
    assert answer_line(result).startswith(expected)


def test_a_partial_cover_is_not_judged(base: CampaignBase, tmp_path: Path) -> None:
    # The footprint reaches 1,400 m east, which is 22 cells of 64.5 m east of the raster's centre at column 36.
    raster = write_density(tmp_path / "density.tif", 312.0, nodata_from=50)
    result = with_ground_class(volumes(base, [row(50.0, 40.0, 60.0)] * 20, population=raster, unit="per-km2"))
    assert not result.is_judged
    assert result.ground_class is None
    assert answer_line(result).startswith(f"class not judged: {raster} has data for ")


def test_a_dense_population_is_written_in_full(base: CampaignBase, tmp_path: Path) -> None:
    raster = write_density(tmp_path / "density.tif", 30_000.0)
    result = with_ground_class(volumes(base, [row(50.0, 40.0, 60.0)] * 20, population=raster, unit="per-km2"))
    assert answer_line(result).endswith(", at most 30,000 people/km²")
    assert "| highest population density | 30,000 people/km² |" in table_text(result)


def test_without_a_population_the_class_is_open(base: CampaignBase) -> None:
    result = with_ground_class(volumes(base, [row(50.0, 40.0, 60.0)] * 20))
    assert not result.is_judged
    assert answer_line(result) == "class not judged: no population raster was named (--population)"


def test_a_controlled_ground_area_needs_no_population(base: CampaignBase) -> None:
    result = with_ground_class(volumes(base, [row(50.0, 40.0, 60.0)] * 20, controlled=True))
    assert result.is_judged
    assert result.ground_class == 1


def test_lines_and_table_say_what_counts_and_what_it_is_not(base: CampaignBase) -> None:
    rows = [row(50.0, 40.0, 60.0)] * 19 + [row(50.0, 40.0, 60.0, ended="ground contact")]
    result = replace(volumes(base, rows), goal=GroundRiskGoal(flights=22))
    lines = risk_lines(result)
    assert lines[-1] == DISCLAIMER
    assert "2 of 22 flights could not be simulated and are left out" in lines
    assert any(line.startswith("1 of 20 flights do not complete the mission") for line in lines)
    table = table_text(result)
    assert "| width S_CV by formula | 207.7 m |" in table
    assert "3 + 3 + 1 + 31.0 + 169.7 m" in table
    assert DISCLAIMER in table


def test_the_autopilot_whose_returns_count_is_named(base: CampaignBase) -> None:
    rows = [row(50.0, 40.0, 60.0)] * 20
    assert any(
        "a return to launch by ArduPlane's rules starts every 10 s" in line for line in risk_lines(volumes(base, rows))
    )
    autopilot = Px4(Px4Parameters.load(base.uav.aircraft))
    px4 = replace(base, uav=replace(base.uav, autopilot=autopilot))
    lines = risk_lines(volumes(px4, rows, glide_ratio=10.0))
    assert any("a return to launch by PX4's rules starts every 10 s" in line for line in lines)
    assert "engine-out glides follow ArduPlane's rules, because PX4's are not simulated" in lines
    assert any(line.startswith("RTL_TYPE 1: a return goes to ") for line in lines)
    assert not any("ArduPlane" in line for line in risk_lines(volumes(px4, rows)))


def test_flights_faster_than_the_stated_speed_are_told(base: CampaignBase) -> None:
    result = volumes(base, [row(50.0, 40.0, 60.0)] * 20, speed=20.0)
    assert any("flights reach a ground speed of 28.0 m/s" in line for line in risk_lines(result))


def test_a_highest_speed_below_the_commanded_airspeed_is_refused(base: CampaignBase) -> None:
    """`tight` is flown at 25 m/s: with 24 m/s the class would be that of a slower column."""
    goal = GroundRiskGoal(flights=1, speed=24.0)
    with pytest.raises(ArgumentError, match=r"max_speed 24.0: expected at least 25.0 m/s, the highest true airspeed"):
        find_ground_risk(base, goal, Workers(1), lambda *_: None)


def test_a_highest_speed_below_the_true_airspeed_of_an_equivalent_command_is_refused(base: CampaignBase) -> None:
    """ArduPlane's 25 m/s of equivalent airspeed at the highest mean altitude of a leg, by the standard atmosphere."""
    arduplane = ArduPlane(ArduPilotParameters.defaults())
    faster = replace(base, uav=replace(base.uav, autopilot=arduplane))
    altitudes = base.nominal_setup().route.positions[:, 2]
    amsl = float((0.5 * (altitudes[1:] + altitudes[:-1])).max())
    true = 25.0 / math.sqrt((1.0 - 2.25577e-5 * amsl) ** 4.25588)
    assert true > 25.05
    with pytest.raises(ArgumentError, match=rf"max_speed 25.0: expected at least {true:.1f} m/s"):
        find_ground_risk(faster, GroundRiskGoal(flights=1, speed=25.0), Workers(1), lambda *_: None)


def test_a_mission_without_a_home_has_no_class(base: CampaignBase, tmp_path: Path) -> None:
    """Its returns, which enlarge the volumes, are unknown."""
    homeless = replace(base, mission=replace(base.mission, home=None))
    result = volumes(homeless, [row(50.0, 40.0, 60.0)] * 20, controlled=True)
    assert not result.is_judged
    assert answer_line(result).startswith("class not judged: the mission has no home")
    assert not any("returns to launch by" in line for line in risk_lines(result))


def test_no_known_ground_is_refused(base: CampaignBase) -> None:
    with pytest.raises(PlanflyError, match="no ground is known below some flights"):
        volumes(base, [row(50.0, 40.0, 60.0, height=-math.inf)] * 20)


# ----------------------------------------------------------------------
# Real flights.


@pytest.fixture(scope="module")
def path(base: CampaignBase) -> BaseGeometry:
    return nominal_path(base)


def test_the_areas_of_a_flight_hold_it_its_returns_and_its_falls(base: CampaignBase, path: BaseGeometry) -> None:
    flown_row = fly_for_excursions(base, 0, path=path, interval=30.0, glide=False)
    flown, fallen = shapely.from_wkb(flown_row.flown), shapely.from_wkb(flown_row.fallen)
    assert flown_row.ended == "completed"
    # The flight without variations lies within the corridor of the largest deviation.
    assert flown.buffer(flown_row.deviation + 1.0).covers(path.geoms[0])
    # Home, around which the returns loiter, is where the flight starts; the loiter of 100 m or more is in the area.
    home = shapely.Point(*base.scenario.start[:2])
    assert flown.distance(home) <= 150.0
    assert flown_row.return_height >= flown_row.height > 60.0
    # A fall at the flown speed from the flown height goes about v sqrt(2 h / g) ahead.
    reach = flown_row.ground_speed * math.sqrt(2.0 * flown_row.return_height / 9.81)
    beyond = shapely.distance(shapely.points(shapely.get_coordinates(fallen)), flown).max()
    assert 0.4 * reach < beyond <= reach + SPAN_M


def test_a_wind_carries_falls_away(base: CampaignBase, path: BaseGeometry) -> None:
    homeless = replace(base, mission=replace(base.mission, home=None))

    def beyond_to_south(from_deg: float) -> float:
        """Area of falls to the south of the flight minus that to its north, m2, in a wind of 10 m/s."""
        flown_row = fly_for_excursions(homeless, 3, GivenWind(10.0, from_deg), path=path, interval=1000.0, glide=False)
        flown, fallen = shapely.from_wkb(flown_row.flown), shapely.from_wkb(flown_row.fallen)
        aside = shapely.difference(fallen, flown)
        south = shapely.box(-5000.0, -5000.0, 5000.0, float(flown.centroid.y))
        return float(2.0 * aside.intersection(south).area - aside.area)

    # From some 80 m a wing across the air sinks for 5 s and drifts, along 2,600 m of path.
    assert beyond_to_south(0.0) > 5_000.0
    assert beyond_to_south(180.0) < -5_000.0


def test_glides_reach_the_ground_beyond_the_flight(base: CampaignBase, path: BaseGeometry) -> None:
    without = shapely.from_wkb(fly_for_excursions(base, 0, path=path, interval=30.0, glide=False).fallen)
    with_glides = shapely.from_wkb(fly_for_excursions(base, 0, path=path, interval=30.0, glide=True).fallen)
    assert with_glides.area > without.area


def test_the_area_between_two_returns_counts() -> None:
    """Two returns from places 100 m apart to a home 1,000 m away, and a third that crosses the second."""
    home = [1000.0, 0.0, 50.0]
    first, second = np.array([[0.0, 0.0, 90.0], home]), np.array([[0.0, 100.0, 90.0], home])
    (between,) = areas_between([first, second])
    assert between.area == pytest.approx(50_000.0)
    third = np.array([[0.0, 0.0, 90.0], [500.0, 100.0, 90.0], home])
    crossed = areas_between([first, second, third])[1]
    # The lines meet at east 333.3 m, north 66.7 m: triangles with bases of 100 m and of the rest on either side.
    assert crossed.is_valid
    assert crossed.contains(shapely.Point(10.0, 50.0))
    assert crossed.contains(shapely.Point(500.0, 75.0))


# ----------------------------------------------------------------------
# Returns from a straight flight to the north at 25 m/s, that turn by a circle and head for its start.

TURN_RADIUS_M = 100.0
TIMES = np.arange(0.0, 121.0)
NORTHBOUND = np.column_stack([np.zeros(121), 25.0 * TIMES, np.full(121, 90.0)])


def straight_return(start: float, side: float = 1.0) -> Floats:
    """Return at 25 m/s: half a circle to the east (side 1) or west (-1), and straight on to the south."""
    angle = np.arange(0.0, math.pi, 25.0 / TURN_RADIUS_M)
    turn = TURN_RADIUS_M * np.column_stack([side * (1.0 - np.cos(angle)), np.sin(angle)])
    south = np.column_stack([np.full(201, side * 2.0 * TURN_RADIUS_M), -25.0 * np.arange(201.0)])
    path = np.concatenate([turn, south])
    path[:, 1] += 25.0 * start
    return np.column_stack([path, np.full(len(path), 90.0)])


def areas_of_turns(interval: float, sides: tuple[float, ...] = (1.0,)) -> BaseGeometry:
    starts = np.arange(0.0, 120.1, interval)
    returns = [straight_return(start, sides[k % len(sides)]) for k, start in enumerate(starts)]
    turns = [turn_of_return(path, (0.0, -5000.0, 90.0), 0.0) for path in returns]
    return shapely.union_all(turn_areas(TIMES, NORTHBOUND, starts, turns, interval))


def test_the_turn_of_a_return_ends_where_it_heads_for_its_target() -> None:
    path = straight_return(60.0)
    turn = turn_of_return(path, (0.0, -5000.0, 90.0), 0.0)
    # The half circle takes 12.6 s; after it the course is south, and the target 1.8 degrees to its right.
    assert 12 <= len(turn) <= 14
    assert np.array_equal(turn_of_return(NORTHBOUND, (0.0, 50_000.0, 90.0), 0.0), NORTHBOUND[:1])
    # Due south it passes a target at east 90 m at 110 m, which a loiter of 111 m meets, and one of 109 m does not.
    near = (90.0, 1300.0, 90.0)
    assert len(turn_of_return(path, near, 111.0)) <= 14
    assert np.array_equal(turn_of_return(path, near, 109.0), path)
    loiter = 100.0 * np.column_stack([np.cos(0.2 * TIMES), np.sin(0.2 * TIMES), TIMES])
    assert np.array_equal(turn_of_return(loiter, (0.0, 0.0, 90.0), 90.0), loiter)


@pytest.mark.parametrize("interval", [5.0, 30.0, 60.0, 120.0])
def test_turns_between_the_starts_of_returns_count(interval: float) -> None:
    """A place 190 m beside the path lies in the turn of a return that begins some 5 s earlier, at any interval."""
    area = areas_of_turns(interval)
    beside = [shapely.Point(side * 190.0, north) for side in (1.0, -1.0) for north in (40.0, 700.0, 1300.0, 2900.0)]
    assert all(area.contains(place) for place in beside)
    assert area.bounds[0] == pytest.approx(-200.0, abs=2.0)
    assert area.bounds[2] == pytest.approx(200.0, abs=2.0)


def test_a_longer_interval_does_not_shrink_the_areas() -> None:
    fine = areas_of_turns(10.0)
    for interval in (30.0, 60.0):
        assert areas_of_turns(interval).buffer(1.0).covers(fine)
        assert areas_of_turns(interval, sides=(1.0, -1.0)).buffer(1.0).covers(fine)


def test_the_larger_of_two_neighbouring_turns_counts() -> None:
    starts = np.array([0.0, 60.0])
    turns = [NORTHBOUND[:2], np.array([[0.0, 1500.0, 90.0], [80.0, 1500.0, 90.0]])]
    first, last = turn_areas(TIMES, NORTHBOUND, starts, turns, 20.0)
    assert first.bounds == pytest.approx((-80.0, -80.0, 80.0, 1580.0))
    # The last one ends 20 s after its start.
    assert last.bounds == pytest.approx((-80.0, 1420.0, 80.0, 2080.0))


def test_without_returns_there_are_no_turns() -> None:
    assert not turn_areas(TIMES, NORTHBOUND, np.zeros(0), [], 10.0)
