"""Simulated returns and go-arounds in a wind that varies by place, height and time, against sums of small steps."""

import math

import numpy as np
import pytest

from flight.autopilots.arduplane.go_around_point_mass import fly_go_arounds, make_abort_start
from flight.autopilots.arduplane.rtl_point_mass import fly_returns
from flight.autopilots.parts import FlyReturns
from flight.autopilots.point_mass import PointMass, make_point_mass
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.autopilots.simulated_returns import RETURN_ARRIVED, RETURN_TIMEOUT
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.mission.return_path import LandingStart, ReturnTarget
from tests.flight.autopilots.arduplane.test_rtl_point_mass import flat, parameters, start, uav
from world.arrays import Floats
from world.forecast.wind_field import MeanProfile, WindField, subtract_profile
from world.frames import fit_polymap
from world.kernels import Record
from world.wind import Wind

# Degrees of longitude per metre to the east, around 8 E, 46 N.
LONGITUDE_DEG_PER_M = 1.3e-5
# Degrees of latitude per metre to the north.
LATITUDE_DEG_PER_M = 9e-6
GEO_MAP = fit_polymap(
    lambda east, north: (8.0 + LONGITUDE_DEG_PER_M * east, 46.0 + LATITUDE_DEG_PER_M * north),
    [[-9000.0, 9000.0]] * 2,
    1e-9,
)
# Altitude of a level return, m AMSL.
UP_M = 300.0
# Target of a return.
HOME = ReturnTarget((0.0, 0.0, UP_M), "home", "", 0.0)
# Distance from the target at which a return starts, m.
DISTANCE_M = 6000.0
# Distance from its target at which it has arrived, m.
ARRIVAL_M = 200.0


def wind_of(speeds: Floats, mean: float = 0.0) -> Wind:
    """Return a wind from the west whose speed is given at 2 times, 2 longitudes and 2 levels.

    speeds: (2, 2, 2) m/s after 0 and 400 s, at 0 and 6000 m east, and at 200 and 400 m AMSL.
    mean: speed of its mean wind, m/s.
    """
    eastward = np.broadcast_to(speeds[:, np.newaxis], (2, 2, 2, 2))
    field = WindField(
        np.array([0.0, 400.0]),
        np.array([45.5, 46.5]),
        8.0 + LONGITUDE_DEG_PER_M * np.array([0.0, DISTANCE_M]),
        np.broadcast_to([200.0, 400.0], (2, 2, 2, 2)).copy(),
        np.stack([eastward, np.zeros_like(eastward)], axis=-1),
    )
    from_course = math.radians(270.0)
    profile = MeanProfile(mean, from_course, 0.0)
    return Wind(mean, from_course, reference_amsl=UP_M, field=subtract_profile(field, profile, UP_M))


def speed_of(speeds: Floats, time: float, east: float, up: float) -> float:
    """Return the speed of such a wind by numpy."""
    by_place = [np.interp(up, [200.0, 400.0], levels) for levels in speeds.reshape(4, 2)]
    by_time = [np.interp(east, [0.0, DISTANCE_M], by_place[k : k + 2]) for k in (0, 2)]
    return float(np.interp(time, [0.0, 400.0], by_time))


def aerosonde(wind: Wind) -> PointMass:
    one = uav()
    return make_point_mass(one.aircraft, one.limits.envelope, one.airspeed, wind, GEO_MAP)


def true_airspeed() -> float:
    return uav().airspeed * float(eas_to_tas_ratio(UP_M))


def fly_arduplane(begin: Record, aircraft: PointMass) -> Record:
    return fly_returns(parameters(RTL_RADIUS=120.0), begin, [HOME], aircraft, flat()).results[0]


def fly_px4(begin: Record, aircraft: PointMass) -> Record:
    target = ReturnTarget((0.0, 0.0, UP_M), "home", "", DISTANCE_M, transit_altitude=UP_M)
    fly: FlyReturns | None = Px4(Px4Parameters.load(uav().aircraft)).returns.fly
    assert fly is not None
    return fly(begin, [target], aircraft, flat()).results[0]


# Calm where and when it starts; wind that rises on the way home, with time, or at its height only.
RISES_WITH_PLACE = np.array([[[12.0, 12.0], [0.0, 0.0]]] * 2)
RISES_WITH_TIME = np.array([[[0.0, 0.0]] * 2, [[14.0, 14.0]] * 2])
RISES_WITH_HEIGHT = np.array([[[0.0, 20.0]] * 2] * 2)


@pytest.mark.parametrize("mean", [0.0, 7.0])
@pytest.mark.parametrize("fly", [fly_arduplane, fly_px4])
@pytest.mark.parametrize("speeds", [RISES_WITH_PLACE, RISES_WITH_TIME, RISES_WITH_HEIGHT, -RISES_WITH_PLACE])
@pytest.mark.parametrize("begins", [0.0, 150.0])
def test_a_straight_return_takes_the_time_and_the_energy_of_the_wind_on_its_way(
    begins: float, speeds: Floats, fly: object, mean: float
) -> None:
    airspeed = true_airspeed()
    ground_speed = airspeed - speed_of(speeds, begins, DISTANCE_M, UP_M)
    begin = start(east=DISTANCE_M, up=UP_M, velocity_east=-ground_speed, time=begins)
    assert callable(fly)
    flown = fly(begin, aerosonde(wind_of(speeds, mean)))
    east, seconds, step = DISTANCE_M, 0.0, 0.05
    while east > ARRIVAL_M:
        east -= (airspeed - speed_of(speeds, begins + seconds, east, UP_M)) * step
        seconds += step
    assert flown["outcome"] == RETURN_ARRIVED
    # Within 3 s, while the wind of the start would be wrong by up to 100 s.
    assert flown["arrival_time"] == pytest.approx(seconds, abs=3.0)
    # Its power is that of level flight, also while it circles at the end.
    power = uav().limits.envelope.power(airspeed, UP_M, 0.0)
    assert flown["energy"] == pytest.approx(power * flown["end_time"] / 3600.0, rel=0.05)


@pytest.mark.parametrize("fly", [fly_arduplane, fly_px4])
def test_no_return_arrives_behind_a_wind_that_is_faster_than_the_aircraft(fly: object) -> None:
    # PX4 flies faster against a strong wind, up to 32.5 m/s here.
    speeds = RISES_WITH_PLACE * (40.0 / 12.0)
    assert callable(fly)
    flown = fly(start(east=DISTANCE_M, up=UP_M, velocity_east=-true_airspeed()), aerosonde(wind_of(speeds)))
    assert flown["outcome"] == RETURN_TIMEOUT
    assert math.isnan(flown["arrival_time"])


def test_the_time_of_a_return_allows_for_the_strongest_wind_on_its_way() -> None:
    # With 3 m/s over the ground, 5,800 m take 1,933 s; 600 s and three times 6 km in calm air would be 1,320 s.
    speeds = np.full((2, 2, 2), true_airspeed() - 3.0)
    flown = fly_arduplane(start(east=DISTANCE_M, up=UP_M, velocity_east=-3.0), aerosonde(wind_of(speeds)))
    assert flown["outcome"] == RETURN_ARRIVED
    assert flown["arrival_time"] == pytest.approx((DISTANCE_M - ARRIVAL_M) / 3.0, rel=0.05)


def test_a_field_of_no_deviation_changes_nothing() -> None:
    uniform = wind_of(np.full((2, 2, 2), 9.0), 4.0)
    stated = Wind(9.0, uniform.from_course, reference_amsl=UP_M)
    begin = start(east=3000.0, north=800.0, up=UP_M + 60.0, velocity_east=20.0, velocity_north=12.0)
    ways = [
        fly_returns(parameters(RTL_RADIUS=120.0), begin, [HOME], aerosonde(wind), flat(), store_positions=True).tracks[
            0
        ]
        for wind in (uniform, stated)
    ]
    assert len(ways[0]) == len(ways[1])
    assert np.abs(ways[0] - ways[1]).max() < 1e-3


def test_a_go_around_climbs_through_the_wind_of_each_height() -> None:
    # 10 m/s of tailwind 200 m above the abort, and none at it.
    speeds = np.array([[[0.0, 20.0]] * 2] * 2)
    aircraft, slope = aerosonde(wind_of(speeds)), math.radians(10.0)
    begin = make_abort_start((0.0, 0.0, 200.0), 0.5 * math.pi, 0.06, 22.0, (0.0, 0.0))
    landing = LandingStart(3, (6000.0, 0.0, 380.0), (6000.0, 0.0, 380.0))
    (way,) = fly_go_arounds(begin, 380.0, slope, [landing], parameters(), aircraft, flat()).tracks
    calm = aircraft._replace(field=np.zeros(0))
    (calm_way,) = fly_go_arounds(begin, 380.0, slope, [landing], parameters(), calm, flat()).tracks
    rows = min(len(way), len(calm_way), 60)
    # The climb is the same in both, and the drift is the sum of the wind at its heights.
    drift = np.concatenate([[0.0], np.cumsum((np.minimum(way[: rows - 1, 2], 400.0) - 200.0) * 0.1)])
    climbs = way[:rows, 2] < 370.0
    assert climbs.sum() > 15
    assert np.abs(way[:rows, 2] - calm_way[:rows, 2])[climbs].max() < 1.0
    assert np.abs(way[:rows, 0] - calm_way[:rows, 0] - drift)[climbs].max() < 0.05 * drift[climbs].max() + 8.0
