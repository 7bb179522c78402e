"""What ArduPlane strays by, against its law written down once more by plain sums, and against its own flights."""

import math

import pytest

from aircraft.catalog import load_aircraft
from aircraft.tracking import SPEED_RATIOS, TURNS, TrackingError
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane.tracking_error import MIN_ACCEPTANCE_M, WIND_SPREAD, tracking_error
from tests.soak import some
from world.wind import Turbulence

# s by which a bank follows its demand, as ArduPlane's flights show it; and by which it turns late on the mean: it looks
# ten times a second, and demands the next leg's bank at the look after that.
LAG, LATER = 0.38, 0.15


@pytest.fixture(scope="module")
def parameters() -> ArduPilotParameters:
    """Of the Aerosonde: 30 degrees of bank at most, L1 with a period of 17 s and a damping of 0.75."""
    return ArduPilotParameters.load(load_aircraft("aerosonde"))


@pytest.fixture(scope="module")
def error(parameters: ArduPilotParameters) -> TrackingError:
    return tracking_error(parameters, 25.0, "gnss")


def furthest(turn: float, acceptance: float, speed: float, period: float = 17.0, bank_deg: float = 30.0) -> float:
    """Furthest from the legs (m) of L1 about a corner: along north to the origin, then right by `turn`."""
    ahead, dt = period * 0.75 * speed / math.pi, 0.02
    most = 9.80665 * math.tan(math.radians(bank_deg))
    east, north, course, side, second, far = 0.0, -acceptance - 300.0, 0.0, 0.0, False, 0.0
    for _ in range(int((300.0 + acceptance + 900.0) / speed / dt)):
        second = second or math.hypot(east, north) <= acceptance - LATER * speed or north >= 0.0
        on = turn if second else 0.0
        cross = east * math.cos(on) - north * math.sin(on)
        aim = math.asin(max(-math.sqrt(0.5), min(math.sqrt(0.5), cross / ahead)))
        wanted = 4.0 * 0.75**2 * speed**2 / ahead * math.sin(max(-math.pi / 2, min(math.pi / 2, on - course - aim)))
        side += (max(-most, min(most, wanted)) - side) * dt / LAG
        course += side / speed * dt
        east, north = east + speed * math.sin(course) * dt, north + speed * math.cos(course) * dt
        away, along = math.hypot(east, north), east * math.sin(turn) + north * math.cos(turn)
        beside = abs(east * math.cos(turn) - north * math.sin(turn)) if along > 0.0 else away
        far = max(far, min(beside, abs(east) if north < 0.0 else away))
    return far


def still_air(error: TrackingError, turn_deg: float, share: int) -> tuple[float, float]:
    """Acceptance and excursion of the tables, without what is added for wind."""
    i = TURNS.tolist().index(pytest.approx(math.radians(turn_deg)))
    spread = WIND_SPREAD[0] + WIND_SPREAD[1] * (turn_deg / 90.0) ** 2
    return float(error.acceptance[i, share]), float(error.excursion[i, share]) / spread


@pytest.mark.parametrize("turn_deg", some([15.0, 30.0, 60.0, 90.0], 3))
@pytest.mark.parametrize("share", [0, 1, 2])
def test_a_corner_is_turned_at_where_it_strays_least(error: TrackingError, turn_deg: float, share: int) -> None:
    acceptance, excursion = still_air(error, turn_deg, share)
    speed, turn = float(SPEED_RATIOS[share]) * 25.0, math.radians(turn_deg)
    assert furthest(turn, acceptance, speed) == pytest.approx(excursion, rel=0.15, abs=0.5)
    tried = [furthest(turn, other, speed) for other in range(15, 256, 8)]
    assert excursion <= 1.15 * min(tried) + 0.5
    # On to the waypoint it would stray twice as far.
    assert furthest(turn, 10.0, speed) > 1.9 * excursion


@pytest.mark.parametrize(("turn_deg", "overshoot"), [(20.04, 9.06), (24.94, 10.01), (13.27, 4.76), (20.96, 7.79)])
def test_plain_sums_are_what_arduplane_flew(turn_deg: float, overshoot: float) -> None:
    """ArduPlane V4.6 overshot these corners so, at acceptances of 11 to 13 m, in 5 m/s of wind from anywhere.

    20.8 to 30.8 m/s over the ground: overshoots go with the speed, a fifth either way, and gusts come on top.
    """
    assert furthest(math.radians(turn_deg), 12.0, 25.8) == pytest.approx(overshoot, rel=0.42)


def test_parameters_decide(parameters: ArduPilotParameters, error: TrackingError) -> None:
    at = 4, 1
    quick = tracking_error(parameters.changed(NAVL1_PERIOD=12.0), 25.0, "gnss")
    assert quick.excursion[2, 1] < 0.9 * error.excursion[2, 1]
    shallow = tracking_error(parameters.changed(ROLL_LIMIT_DEG=25.0), 25.0, "gnss")
    assert shallow.excursion[at] > 1.1 * error.excursion[at]
    late = tracking_error(parameters.changed(TECS_HDEM_TCONST=1.0, ALT_SLOPE_MIN=0.0), 25.0, "gnss")
    # 0 makes a step of every change of altitude.
    assert (late.lag, late.step) == (1.0, math.inf)
    climbs = tracking_error(parameters.changed(TECS_CLMB_MAX=4.0), 25.0, "gnss")
    assert climbs.climb_rate == pytest.approx(3.6)
    assert climbs.sink_rate == error.sink_rate


@pytest.mark.parametrize(
    ("turbulence", "climb", "sink"), [("none", 0.9, 0.9), ("light", 0.65, 0.81), ("moderate", 0.45, 0.72)]
)
def test_gusts_leave_less_to_climb_with(
    parameters: ArduPilotParameters, turbulence: Turbulence, climb: float, sink: float
) -> None:
    """Of the 5.6 m/s of climb and sink that the Aerosonde's parameters state."""
    left = tracking_error(parameters, 25.0, "gnss", turbulence=turbulence)
    assert left.climb_rate == pytest.approx(climb * 5.6)
    assert left.sink_rate == pytest.approx(sink * 5.6)


def test_navigation_takes_room(parameters: ArduPilotParameters, error: TrackingError) -> None:
    """Three standard deviations of 1.5 m beside 2 m: the root of 20.25 + 4."""
    assert error.across == pytest.approx(math.sqrt(24.25))
    assert tracking_error(parameters, 25.0, "perfect").across == pytest.approx(2.0)


def test_a_fly_over_turns_at_its_waypoint(parameters: ArduPilotParameters, error: TrackingError) -> None:
    over = tracking_error(parameters, 25.0, "gnss", fly_over=True)
    assert (over.before == 0.0).all()
    assert (over.acceptance == MIN_ACCEPTANCE_M).all()
    assert (over.excursion[1:] > 1.5 * error.excursion[1:])[:5].all()
    assert over.excursion[2, 1] == pytest.approx(1.16 * furthest(math.radians(30.0), 0.0, 25.0), rel=0.15)
