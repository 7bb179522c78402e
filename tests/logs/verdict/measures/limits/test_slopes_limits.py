"""What a leg's fit leaves out at its ends, what is too short for one, and how sure each is."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.path_limits import BLEND_ACCELERATION
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.simulation.setup import FlightSetup
from flight.simulation.track import PITCH, Track
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.measures.slopes import (
    Ability,
    LegFit,
    SlopeMeasure,
    _fit_plane_at_origin,
    leg_course,
    leg_slope,
    measure_ability,
    measure_slope,
    steady_rows,
)
from logs.verdict.measures.track_alignment import AlignedTrack, align_track
from tests.synthetic import Profile, edited, fly_path, make_setup

# Metres between two rows at 25 m/s.
ROW = 25.0 / 60.0


def straight(*runs: float) -> list[list[float]]:
    """Level legs of these lengths, due north."""
    return [[0.0, sum(runs[:k]), 300.0] for k in range(len(runs) + 1)]


def flown(
    points: list[list[float]], across: Profile | None = None, **how: float
) -> tuple[RouteRequirements, AlignedTrack]:
    setup = make_setup(points, **how)
    requirements = route_requirements(setup)
    aligned = align_track(requirements, fly_path(setup, across=across))
    assert aligned is not None
    return requirements, aligned


def course_of(points: list[list[float]], leg: int, across: Profile | None = None) -> LegFit:
    found = leg_course(*flown(points, across), leg)
    assert found is not None
    return found


def slope_of(points: list[list[float]], leg: int, **how: float) -> LegFit:
    found = leg_slope(*flown(points, **how), leg)
    assert found is not None
    return found


@pytest.mark.parametrize(("leg", "left_out"), [(0, 20.0 + 100.0), (1, 100.0 + 100.0), (2, 100.0)])
def test_a_fit_leaves_out_what_is_near_a_turn_and_near_the_start(leg: int, left_out: float) -> None:
    points = straight(2000.0, 2000.0, 2000.0)
    assert course_of(points, leg).length == pytest.approx(2000.0 - left_out, abs=2 * ROW)
    assert slope_of(points, leg).length == pytest.approx(2000.0 - left_out, abs=2 * ROW)


def test_a_slopes_fit_leaves_out_the_blend_and_twenty_metres_more() -> None:
    # From level to 1 in 5 at 35 m/s: a parabola of 0.2 v^2 / (2 a) on either side of the waypoint.
    blend = 0.2 * 35.0**2 / (2.0 * BLEND_ACCELERATION)
    assert blend > 90.0
    found = slope_of([[0, 0, 300], [0, 3000, 300], [0, 6000, 900]], 0, airspeed=35.0)
    assert found.length == pytest.approx(3000.0 - 20.0 - (blend + 20.0), abs=2.0)


@pytest.mark.parametrize(("run", "fitted"), [(258.0, False), (262.0, True)])
def test_a_course_is_fitted_to_sixty_metres(run: float, fitted: bool) -> None:
    """Between two turns, a hundred metres from each."""
    assert course_of(straight(1000.0, run, 1000.0), 1).is_fitted is fitted


@pytest.mark.parametrize(("run", "fitted"), [(298.0, False), (302.0, True)])
def test_a_slope_is_fitted_to_a_hundred_metres(run: float, fitted: bool) -> None:
    assert slope_of(straight(1000.0, run, 1000.0), 1).is_fitted is fitted


def test_a_shorter_slope_is_measured_over_four_seconds() -> None:
    found = slope_of(straight(1000.0, 180.0, 1000.0), 1)
    assert found.length == pytest.approx(4.0 * 25.0, abs=2 * ROW)
    assert math.degrees(found.tolerance) == pytest.approx(0.5)


def test_a_shorter_course_is_known_to_three_quarters_of_a_degree() -> None:
    assert math.degrees(course_of(straight(1000.0, 180.0, 1000.0), 1).tolerance) == pytest.approx(0.75)


def test_a_straight_and_steady_legs_fit_has_the_tolerance_of_calm_air() -> None:
    points = straight(2000.0, 2000.0)
    assert math.degrees(course_of(points, 1).tolerance) == pytest.approx(0.02, abs=1e-4)
    assert math.degrees(slope_of(points, 1).tolerance) == pytest.approx(0.1, abs=1e-4)


def test_what_swings_about_the_line_widens_its_tolerance_up_to_half_a_degree() -> None:
    """A swing of amplitude a leaves an RMS of a over root 2; twice that at the ends of the run turns the line."""

    def swing(s: np.ndarray) -> np.ndarray:
        return np.sin(2.0 * math.pi * s / 20.0)

    long = course_of(straight(2000.0, 2000.0), 1, swing)
    added = math.degrees(math.atan2(2.0 * math.sqrt(0.5), long.length))
    assert math.degrees(long.tolerance) == pytest.approx(0.02 + added, abs=0.003)
    # Over 102 m it would be 0.8 degrees.
    assert math.degrees(course_of(straight(1000.0, 302.0, 1000.0), 1, swing).tolerance) == pytest.approx(0.5)


# ----------------------------------------------------------------------
# Which throttle counts as a limit, how long an ability takes to be seen, and how sure it is.

LEVEL = [[0, 0, 300], [0, 1000, 300], [0, 3000, 300], [0, 4000, 300]]
FALLING = [[0, 0, 600], [0, 1000, 600], [0, 3000, 500], [0, 4000, 500]]
# Where the throttle is moved, m along the path.
THERE = 1500.0
GRAVITY = 9.80665


def laid(setup: FlightSetup, track: Track) -> tuple[RouteRequirements, AlignedTrack]:
    requirements = route_requirements(setup)
    aligned = align_track(requirements, track)
    assert aligned is not None
    return requirements, aligned


def held(points: list[list[float]], throttle: float, power: float = 300.0) -> SlopeMeasure:
    """The middle leg with 20 s at this throttle."""

    def pushed(s: np.ndarray) -> np.ndarray:
        return (throttle - 0.6) * ((s > THERE) & (s < THERE + 500.0))

    setup = make_setup(points)
    return measure_slope(*laid(setup, fly_path(setup, throttle=pushed, power=power)), 1)


@pytest.mark.parametrize(("throttle", "seconds"), [(0.988, 0.0), (0.992, 20.0)])
def test_the_throttle_is_full_from_ninety_nine_hundredths_on(throttle: float, seconds: float) -> None:
    assert held(LEVEL, throttle).full_throttle_time == pytest.approx(seconds, abs=0.1)


@pytest.mark.parametrize(("throttle", "seconds"), [(0.012, 0.0), (0.009, 20.0)])
def test_the_throttle_is_idle_up_to_a_hundredth(throttle: float, seconds: float) -> None:
    assert held(FALLING, throttle).idle_throttle_time == pytest.approx(seconds, abs=0.1)


@pytest.mark.parametrize(("amperes", "idle"), [(0.022, False), (0.018, True)])
def test_a_motor_without_current_is_idle(amperes: float, idle: bool) -> None:
    assert (held(FALLING, 0.6, power=44.4 * amperes).idle_throttle_time > 10.0) is idle


@pytest.mark.parametrize(("below_deg", "seconds"), [(0.9, 20.0), (1.1, 0.0)])
def test_the_pitch_is_at_its_limit_up_to_a_degree_below_it(below_deg: float, seconds: float) -> None:
    """15 degrees by default: PTCH_LIM_MAX_DEG is 20, and TECS_PITCH_MAX 15."""
    setup = replace(make_setup(LEVEL), autopilot=ArduPlane(ArduPilotParameters.defaults()))
    track = fly_path(setup)
    attitude = np.array(track.attitude)
    north = track.position[:, 1]
    attitude[(north > THERE) & (north < THERE + 500.0), PITCH] = math.radians(15.0 - below_deg)
    measure = measure_slope(*laid(setup, edited(track, attitude=attitude)), 1)
    assert measure.pitch_limit_time == pytest.approx(seconds, abs=0.1)


def ability(
    seconds: float, *, throttle: float = 1.0, swing: float = 1.0, heave: float = 0.0
) -> tuple[Ability | None, float]:
    """What a level leg shows with so many seconds at a throttle, and the acceleration meanwhile (m/s^2).

    The airspeed rises evenly from ``swing`` below the command to as much above it.  heave: m/s of air that rises and
    sinks by turns, a row each.
    """
    run = 25.0 * seconds

    def there(s: np.ndarray) -> np.ndarray:
        return (s > THERE) & (s < THERE + run)

    setup = make_setup(LEVEL)
    track = fly_path(
        setup,
        throttle=lambda s: (throttle - 0.6) * there(s),
        airspeed=lambda s: swing * np.clip(2.0 * (s - THERE) / run - 1.0, -1.0, 1.0),
    )
    wind = track.wind.copy()
    wind[:, 2] = heave * np.where(np.arange(len(track)) % 2, 1.0, -1.0)
    return measure_ability(*laid(setup, edited(track, wind=wind)), 1), 25.0 * 2.0 * swing / run


@pytest.mark.parametrize(("throttle", "seen"), [(0.9985, False), (0.9995, True)])
def test_an_ability_is_seen_at_the_whole_throttle(throttle: float, seen: bool) -> None:
    assert (ability(10.0, throttle=throttle)[0] is not None) is seen


@pytest.mark.parametrize(("seconds", "seen"), [(0.5 + 1.4, False), (0.5 + 1.65, True)])
def test_an_ability_is_seen_over_a_second_and_a_half(seconds: float, seen: bool) -> None:
    """Half a second after the throttle came to its limit."""
    assert (ability(seconds)[0] is not None) is seen


def test_an_ability_has_the_standard_error_of_independent_half_seconds() -> None:
    """Its rate lies on a line over airspeed, so that all it is unsure of is the 0.02 m/s that rates are known to."""
    found, push = ability(10.0)
    assert found is not None
    assert found.duration == pytest.approx(9.5, abs=0.06)
    # The command is a twentieth off the middle of the speeds seen, whose variance is a third: 1 + 0.05^2 / 0.3.
    error = 0.02 * math.sqrt((1.0 + 0.05**2 / 0.3) / (9.5 / 0.5)) / 25.0
    assert found.error == pytest.approx(error, rel=0.06)
    assert found.slope == pytest.approx(math.asin(push / GRAVITY), rel=0.02)


@pytest.mark.parametrize(("degrees", "sure"), [(0.27, True), (0.33, False)])
def test_an_ability_with_a_large_error_says_nothing(degrees: float, sure: bool) -> None:
    """Of 2.5 s, one is known to be 5 independent ones: heave of w has a standard error of w over root 5."""
    heave = 25.0 * math.sin(math.radians(degrees)) * math.sqrt(5.0)
    found, _ = ability(3.0, heave=heave)
    assert (found is not None) is sure
    if found is not None:
        assert math.degrees(found.error) == pytest.approx(degrees, rel=0.1)


@pytest.mark.parametrize(("swing", "seen"), [(1e-2, True), (1e-4, False)])
def test_a_speed_that_hardly_changes_says_nothing_of_other_speeds(swing: float, seen: bool) -> None:
    """The variance of speed is a third of the swing's square: 3e4 or 3e8 is the moments' condition."""
    assert (ability(10.0, swing=swing)[0] is not None) is seen


@pytest.mark.parametrize(("condition", "is_fitted"), [(0.9e7, True), (1.1e7, False)])
def test_rates_are_fitted_up_to_a_condition_of_ten_million(condition: float, is_fitted: bool) -> None:
    """Speeds a above and below the command have the moments 1 and a^2, of the condition 1 / a^2."""
    excess_speed = np.tile([-1.0, 1.0], 500) / math.sqrt(condition)
    found = _fit_plane_at_origin(2.0 + 3.0 * excess_speed, excess_speed, np.zeros(1000), 10.0)
    assert (found is not None) is is_fitted
    if found is not None:
        assert found[0] == pytest.approx(2.0)


@pytest.mark.parametrize(("asked", "covered"), [(0.069, True), (0.071, False)])
def test_an_ability_covers_a_slope_beyond_three_standard_errors(asked: float, covered: bool) -> None:
    assert Ability(slope=0.10, error=0.01, duration=20.0).exceeds(asked) is covered


def test_a_leg_has_time_to_take_up_its_speed() -> None:
    """5 m/s at half a metre per second squared: ten seconds."""
    setup = make_setup(LEVEL, speeds=[20.0, 25.0, 25.0])
    requirements, aligned = laid(setup, fly_path(setup))
    rows = steady_rows(requirements, aligned, 1)
    begun = aligned.track.time[aligned.leg_rows(1).start]
    assert aligned.track.time[rows.start] - begun == pytest.approx(10.0, abs=0.02)


@pytest.mark.parametrize(("share", "counts"), [(0.77, False), (0.83, True)])
def test_a_window_with_four_fifths_at_the_limit_counts(share: float, counts: bool) -> None:
    setup = make_setup(LEVEL)
    # Full for a share of every 23 m, which is each second at 23 m/s, for 13 s.
    track = fly_path(
        setup,
        throttle=lambda s: 0.4 * ((s - THERE) % 23.0 < 23.0 * share) * ((s > THERE) & (s < THERE + 300.0)),
        airspeed=lambda s: 0.0 * s - 2.0,
    )
    measure = measure_slope(*laid(setup, track), 1)
    assert measure.speed_loss == pytest.approx(2.0 if counts else 0.0, abs=0.05)


@pytest.mark.parametrize(("seconds", "counts"), [(3.8, False), (4.2, True)])
def test_the_window_is_five_seconds_long(seconds: float, counts: bool) -> None:
    """Four of five seconds are four fifths."""
    setup = make_setup(LEVEL)
    track = fly_path(
        setup,
        throttle=lambda s: 0.4 * ((s > THERE) & (s < THERE + 23.0 * seconds)),
        airspeed=lambda s: 0.0 * s - 2.0,
    )
    assert measure_slope(*laid(setup, track), 1).speed_loss == pytest.approx(2.0 if counts else 0.0, abs=0.05)


# ----------------------------------------------------------------------
# Logs that lack the airspeed or the wind at some rows.

# Middle of the rows with the throttle at full.
MISSING_M = THERE + 150.0


@pytest.mark.parametrize("column", ["wind", "airspeed"])
def test_an_ability_is_measured_where_a_quantity_is_missing_at_some_rows(column: str) -> None:
    setup = make_setup(LEVEL)
    track = fly_path(
        setup,
        throttle=lambda s: 0.4 * ((s > THERE) & (s < THERE + 300.0)),
        airspeed=lambda s: np.clip((s - THERE) / 150.0 - 1.0, -1.0, 1.0),
    )
    whole = measure_ability(*laid(setup, track), 1)
    values = np.array(getattr(track, column))
    values[int(np.argmin(np.abs(track.position[:, 1] - MISSING_M)))] = math.nan
    holed = measure_ability(*laid(setup, edited(track, **{column: values})), 1)
    assert whole is not None
    assert holed is not None
    assert holed.slope == pytest.approx(whole.slope, abs=1e-3)


@pytest.mark.parametrize("column", ["wind", "airspeed"])
def test_a_speed_that_is_lost_is_seen_although_a_quantity_was_missing_before(column: str) -> None:
    setup = make_setup(LEVEL)
    track = fly_path(
        setup,
        throttle=lambda s: 0.4 * ((s > THERE) & (s < THERE + 300.0)),
        airspeed=lambda s: 0.0 * s - 2.0,
    )
    values = np.array(getattr(track, column))
    values[int(np.argmin(np.abs(track.position[:, 1] - (THERE - 200.0))))] = math.nan
    assert measure_slope(*laid(setup, edited(track, **{column: values})), 1).speed_loss == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize(("from_deg", "ground"), [(180.0, 33.0), (0.0, 17.0)])
def test_an_ability_is_that_of_flight_relative_to_the_air(from_deg: float, ground: float) -> None:
    """From 24 to 26 m/s within 200 m of a level leg: the rate v a / g, of the airspeed, at 25 m/s in the wind's slope.

    Over the ground its angle is atan of the rate over the ground speed.
    """
    setup = make_setup(LEVEL, wind={"speed_mps": 8.0, "from_deg": from_deg})

    def there(s: np.ndarray) -> np.ndarray:
        return (s > THERE) & (s < THERE + 300.0)

    track = fly_path(
        setup,
        throttle=lambda s: 0.4 * there(s),
        airspeed=lambda s: np.clip((s - THERE) / 150.0 - 1.0, -1.0, 1.0),
    )
    found = measure_ability(*laid(setup, track), 1)
    assert found is not None
    # dv/dt = dv/ds ds/dt: 1 m/s in each 150 m at the ground speed.
    rate = 25.0 * ground / 150.0 / GRAVITY
    level = math.sqrt(25.0**2 - rate**2) + ground - 25.0
    assert found.slope == pytest.approx(math.atan2(rate, level), rel=0.02)
