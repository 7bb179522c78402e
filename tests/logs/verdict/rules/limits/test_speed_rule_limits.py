"""What gusts and a new slope may add to a leg's mean airspeed, and how long it takes to have one."""

import math
from dataclasses import replace

import pytest

from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import judge, leg, of
from tests.synthetic import envelope, fly_path, make_setup


def middle_leg(
    points: list[list[float]], speeds: list[float] | None = None, off: float = 0.0, **world: object
) -> Finding:
    setup = make_setup(points, speeds=speeds, **world)
    track = fly_path(setup, airspeed=lambda s: 0.0 * s + off)
    return of(judge(setup, track, envelope=False), "speed", leg(1))


def straight(run: float, rise: float = 0.0) -> list[list[float]]:
    return [[0, 0, 300], [0, 1000, 300], [0, 1000 + run, 300 + rise], [0, 2000 + run, 300 + rise]]


@pytest.mark.parametrize(
    ("turbulence", "w20", "off", "ok"),
    [
        ("light", 7.7, 2.1, True),
        ("light", 7.7, 2.3, False),
        ("moderate", 15.4, 3.4, True),
        ("moderate", 15.4, 3.55, False),
    ],
)
def test_two_standard_deviations_of_a_legs_gusts_may_be_in_its_mean(
    turbulence: str, w20: float, off: float, ok: bool
) -> None:
    """0.15 W20 along the track (MIL-F-8785C), less in the mean of a leg that outlasts a gust's 10 s twice."""
    item = middle_leg(straight(2000.0), off=off, wind={"turbulence": turbulence})
    lasts = 2000.0 / (25.0 + off)
    assert item.tolerance == pytest.approx(2.0 * 0.15 * w20 * math.sqrt(2.0 * 10.0 / lasts), rel=0.01)
    assert item.ok is ok


@pytest.mark.parametrize(("degrees", "metres"), [(0.48, 0.0), (0.52, 10.0)])
def test_taking_up_another_slope_puts_the_aircraft_ahead_by_ten_metres(degrees: float, metres: float) -> None:
    """From half a degree on, in the 80 s of the leg."""
    item = middle_leg(straight(2000.0, 2000.0 * math.tan(math.radians(degrees))))
    assert item.tolerance == pytest.approx(metres / 80.0, rel=0.01, abs=1e-6)


@pytest.mark.parametrize(("seconds", "measured"), [(4.9, False), (5.1, True)])
def test_a_mean_takes_five_seconds_at_a_steady_speed(seconds: float, measured: bool) -> None:
    """From 25 to 23 m/s takes four seconds first."""
    item = middle_leg(straight(23.0 * (4.0 + seconds)), [25.0, 23.0, 23.0])
    assert ("on average" in item.reason) is measured


@pytest.mark.parametrize(("run", "measured"), [(128.0, False), (139.0, True)])
def test_or_half_of_the_time_that_a_shorter_leg_takes_at_the_slowest(run: float, measured: bool) -> None:
    """From 25 to 24.5 m/s takes one second; run / 24.5 - 1 is half of run / 15 at 134 m."""
    item = middle_leg(straight(run), [25.0, 24.5, 24.5])
    assert ("on average" in item.reason) is measured


@pytest.mark.parametrize(("speed", "ok"), [(29.5, True), (29.6, None), (32.0, None), (32.1, False)])
def test_a_speed_is_decided_up_to_1_645_deviations_from_the_fastest(speed: float, ok: bool | None) -> None:
    """32 less 1.645 x 1.5 is 29.53 m/s."""
    table = replace(envelope(), source="a data sheet", fastest_sd=1.5)
    setup = make_setup(straight(2000.0), airspeed=speed, table=table)
    assert of(judge_geometry(setup), "speed", leg(1)).ok is ok


@pytest.mark.parametrize(("speed", "off", "ok"), [(25.0, 2.45, True), (25.0, -2.55, False), (17.0, 1.65, True)])
def test_an_airspeed_is_held_to_a_tenth_of_its_command(speed: float, off: float, ok: bool) -> None:
    """2.5 m/s of 25, 1.7 m/s of 17."""
    for sign in (1.0, -1.0):
        setup = make_setup(straight(2000.0), airspeed=speed)
        track = fly_path(setup, airspeed=lambda s, sign=sign: 0.0 * s + sign * off)
        assert of(judge(setup, track), "speed", leg(1)).ok is ok


@pytest.mark.parametrize(("wind", "ok"), [(19.95, False), (20.05, True)])
def test_a_speed_above_its_command_is_allowed_below_five_metres_a_second_of_ground_speed(wind: float, ok: bool) -> None:
    """25 m/s against the wind leave 5.05 and 4.95 m/s (FW_GND_SPD_MIN)."""
    setup = make_setup(straight(2000.0), wind={"speed_mps": wind, "from_deg": 0.0})
    for off, passes in ((4.0, ok), (-2.6, False)):
        track = fly_path(setup, airspeed=lambda s, off=off: 0.0 * s + off)
        assert of(judge(setup, track), "speed", leg(1)).ok is passes
