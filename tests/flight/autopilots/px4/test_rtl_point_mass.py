"""PX4's return on a point mass flies at the heights of PX4's `rtl.cpp`, by plain sums."""

import math

import numpy as np
import pytest

from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.autopilots.px4.rtl_point_mass import fly_returns
from flight.autopilots.simulated_returns import RETURN_ARRIVED, RETURN_GROUND_IMPACT, RETURN_TIMEOUT, SimulatedReturns
from flight.mission.return_path import LandingStart, ReturnPoint, choose_target
from tests.flight.autopilots.arduplane.test_rtl_point_mass import aerosonde, flat, start, uav
from world.wind import Wind

# Home is 8 km north of the start, at 0 m.
HOME = ReturnPoint(0.0, 8000.0, 0.0)
# Tolerance of a height, m: a climb is over within NAV_FW_ALT_RAD, 10 m.
NEAR_M = 11.0


def parameters(**values: float) -> Px4Parameters:
    return Px4Parameters.load(uav().aircraft).changed(**values)


def returned(
    up: float, landings: tuple[LandingStart, ...] = (), wind: Wind | None = None, ground: float = -50.0, **values: float
) -> SimulatedReturns:
    """The return from a place that is flown through eastwards, level, over flat ground."""
    made = parameters(**values)
    target = choose_target(Px4(made).returns.rules, (0.0, 0.0, up), HOME, (), landings)
    begin = start(up=up, velocity_east=26.0)
    return fly_returns(made, begin, [target], aerosonde(wind or Wind()), flat(ground), store_positions=True)


@pytest.mark.parametrize(
    ("up", "returns_at", "descends_to", "transit", "end"),
    [
        # max(own height, RTL_RETURN_ALT), and at the end RTL_DESCEND_ALT, but no higher than it flew.
        (400.0, 100.0, 100.0, 400.0, 100.0),
        (150.0, 300.0, 100.0, 300.0, 100.0),
        (150.0, 300.0, 300.0, 300.0, 300.0),
        (150.0, 50.0, 120.0, 150.0, 120.0),
        (90.0, 50.0, 120.0, 90.0, 90.0),
    ],
)
def test_it_climbs_first_flies_level_and_descends_at_home(
    up: float, returns_at: float, descends_to: float, transit: float, end: float
) -> None:
    found = returned(up, RTL_RETURN_ALT=returns_at, RTL_DESCEND_ALT=descends_to)
    (way,) = found.tracks
    result = found.results[0]
    assert result["outcome"] == RETURN_ARRIVED
    assert way[:, 2].max() == pytest.approx(transit, abs=NEAR_M)
    assert way[-1, 2] == pytest.approx(end, abs=NEAR_M)
    assert result["clearance"] == pytest.approx(min(up, end) + 50.0, abs=NEAR_M)
    from_start, from_home = np.hypot(*way[:, :2].T), np.hypot(*(way[:, :2] - HOME[:2]).T)
    level = (from_start > 600.0) & (from_home > 600.0)
    assert np.abs(way[level, 2] - transit).max() < NEAR_M
    # It climbs in a circle of 80 m, or of the 119 m that 30 degrees of bank allow, beside its start.
    climbing = (way[:, 2] < transit - NEAR_M) & (from_home > 600.0)
    assert not climbing.any() or from_start[climbing].max() < 3.0 * 119.0


def test_a_climb_costs_its_height_in_energy_at_least() -> None:
    low, high = (returned(150.0, RTL_RETURN_ALT=height).results[0]["energy"] for height in (100.0, 300.0))
    # 11 kg are lifted by 150 m, without the losses of motor and propeller.
    assert high - low > uav().aircraft.mass * 9.81 * 150.0 / 3600.0


def test_a_hill_on_the_way_is_hit_at_the_return_altitude() -> None:
    assert returned(400.0, ground=390.0, RTL_RETURN_ALT=100.0).results[0]["outcome"] == RETURN_GROUND_IMPACT


def test_against_a_wind_above_its_airspeed_it_does_not_arrive() -> None:
    result = returned(400.0, wind=Wind(45.0, 0.0)).results[0]
    assert result["outcome"] in (RETURN_TIMEOUT, 3)
    assert math.isnan(result["arrival_time"])


def sequence(to_altitude: bool) -> LandingStart:
    """A landing sequence that begins 6 km north at 80 m, and lands 7 km north at 0 m."""
    place = (0.0, 6000.0, 80.0)
    return LandingStart(
        5, place, place, to_altitude, 100.0, to_altitude=to_altitude, landing=(0.0, 7000.0, 0.0), exits_on_course=True
    )


@pytest.mark.parametrize("to_altitude", [True, False])
def test_it_goes_to_the_landing_sequence_from_above_its_landing(to_altitude: bool) -> None:
    """RTL_TYPE 1 climbs to RTL_RETURN_ALT over the landing; a loiter to an altitude is left at that altitude."""
    found = returned(150.0, (sequence(to_altitude),), RTL_TYPE=1.0, RTL_RETURN_ALT=300.0)
    (way,) = found.tracks
    assert found.results[0]["outcome"] == RETURN_ARRIVED
    assert way[:, 2].max() == pytest.approx(300.0, abs=NEAR_M)
    assert way[-1, 2] == pytest.approx(80.0, abs=NEAR_M)
    # It ends beside the first stop: on its circle of 100 m or 119 m, or by the switch distance of the waypoint.
    assert np.hypot(*(way[-1, :2] - (0.0, 6000.0))) < 200.0
    # To a loiter it keeps its height until the circle.
    halfway = way[np.argmin(np.abs(way[:, 1] - 3000.0)), 2]
    assert bool(halfway > 289.0) is to_altitude


def test_to_the_first_waypoint_of_a_landing_it_sinks_at_once_if_it_begins_higher() -> None:
    """Without a climb PX4 has no line to fly: the height of the waypoint applies from the start, at 2 m/s."""
    (way,) = returned(400.0, (sequence(to_altitude=False),), RTL_TYPE=1.0, RTL_RETURN_ALT=100.0).tracks
    assert way[60, 2] == pytest.approx(400.0 - 2.0 * 60.0, abs=20.0)


def test_without_an_engine_it_is_not_simulated() -> None:
    behaviour = Px4(parameters()).returns
    assert behaviour.fly is not None
    assert not behaviour.flies_without_engine
    target = choose_target(behaviour.rules, (0.0, 0.0, 400.0), HOME, ())
    with pytest.raises(ValueError, match="without an engine is not simulated"):
        behaviour.fly(start(up=400.0, velocity_east=26.0), [target], aerosonde(Wind()), flat(), engine_out=True)
