"""What the speed rule says of a leg as flown, and which of a leg's two heights limits its speed."""

import math
from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.slopes import Ability
from logs.verdict.rules import speed_rule
from tests.logs.verdict.judging import judge, leg, of
from tests.synthetic import envelope, fly_path, make_setup


def straight(slope_deg: float, *, before_deg: float = 0.0, run: float = 2000.0) -> list[list[float]]:
    """Three legs of 1,000 m, ``run`` and 1,000 m; the last is level."""
    first = 1000.0 * math.tan(math.radians(before_deg))
    top = first + run * math.tan(math.radians(slope_deg))
    return [[0, 0, 600], [0, 1000, 600 + first], [0, 1000 + run, 600 + top], [0, 2000 + run, 600 + top]]


def test_the_slowest_second_is_told() -> None:
    """Two seconds at 22 m/s, and half a second at 20, which is in a mean of 22.5 m/s over its second."""
    setup = make_setup(straight(0.0))
    for seconds, slow, least in ((2.0, 3.0, 22.0), (0.5, 5.0, 22.5)):
        run = seconds * (25.0 - slow)

        def dip(s: np.ndarray, run: float = run, slow: float = slow) -> np.ndarray:
            return -slow * ((s > 2000.0) & (s < 2000.0 + run))

        item = of(judge(setup, fly_path(setup, airspeed=dip)), "speed", leg(1))
        mean = 2000.0 / ((2000.0 - run) / 25.0 + seconds)
        assert item.flown == pytest.approx(mean, abs=0.01)
        told = float(item.reason.split("average, ")[1].split(" m/s")[0])
        assert told == pytest.approx(least, abs=0.11)


def test_going_on_at_the_slope_of_the_leg_before_takes_up_nothing() -> None:
    for before, tolerance in ((3.0, 0.0), (0.0, 10.0 / 80.0), (-3.0, 10.0 / 80.0)):
        setup = make_setup(straight(3.0, before_deg=before))
        item = of(judge(setup, fly_path(setup)), "speed", leg(1))
        assert item.tolerance == pytest.approx(tolerance, rel=0.01, abs=1e-9)


def test_a_short_legs_mean_may_have_all_of_a_gust() -> None:
    """In 12 s, less than twice a gust's ten: two standard deviations of 0.15 times 7.7 m/s."""
    setup = make_setup(straight(0.0, run=300.0), wind={"turbulence": "light"})
    item = of(judge(setup, fly_path(setup)), "speed", leg(1))
    assert item.tolerance == pytest.approx(2.0 * 0.15 * 7.7, rel=1e-6)


@pytest.mark.parametrize(
    ("slope", "shown", "off", "ok"),
    [
        (6.0, 9.0, -2.0, True),  # sinking air, in a climb that the aircraft can exceed
        (6.0, 5.0, -2.0, False),
        (6.0, 9.0, 2.0, False),
        (-4.0, 6.0, 2.0, True),  # rising air, in a dive
        (-4.0, 3.0, 2.0, False),
        (-4.0, 6.0, -2.0, False),
        (0.0, 9.0, -2.0, False),
        (6.0, None, -2.0, False),
    ],
)
def test_speed_that_the_air_took_is_not_the_aircrafts(
    slope: float, shown: float | None, off: float, ok: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    ability = None if shown is None else Ability(math.radians(shown), math.radians(0.1), 20.0)
    monkeypatch.setattr(speed_rule, "measure_ability", lambda *_: ability)
    setup = make_setup(straight(slope))
    track = fly_path(setup, airspeed=lambda s: 0.0 * s + off)
    assert of(judge(setup, track, envelope=False), "speed", leg(1)).ok is ok
    assert ("off the commanded" in of(judge(setup, track), "speed", leg(1)).reason) is not ok


@pytest.mark.parametrize(
    ("speed", "rise", "limit", "ok"),
    [
        # From 600 to 800 m the slowest rises from 17.2 to 17.6 m/s, the fastest falls from 30.8 to 30.4 m/s.
        (17.5, 200.0, 17.6, False),
        (17.7, 200.0, 17.6, True),
        (30.5, 200.0, 30.4, False),
        (30.3, 200.0, 30.4, True),
        # Down to 400 m the leg's start counts.
        (17.1, -200.0, 17.2, False),
        (17.3, -200.0, 17.2, True),
        (30.9, -200.0, 30.8, False),
        (30.7, -200.0, 30.8, True),
    ],
)
def test_the_higher_end_of_a_leg_limits_its_speed(speed: float, rise: float, limit: float, ok: bool) -> None:
    heights = np.array([0.0, 1000.0, 4000.0])
    table = replace(
        envelope(), amsl=heights, level_speed_min=16.0 + 0.002 * heights, level_speed_max=32.0 - 0.002 * heights
    )
    points = [[0, 0, 600], [0, 4000, 600 + rise], [0, 8000, 600 + rise]]
    item = of(judge_geometry(make_setup(points, airspeed=speed, table=table)), "speed", leg(0))
    assert item.ok is ok
    assert item.limit == pytest.approx(limit)
    assert item.margin == pytest.approx(-abs(speed - limit) if not ok else abs(speed - limit))
    if not ok:
        which = "below the minimum" if speed < 20.0 else "above the maximum"
        top = max(600.0, 600.0 + rise)
        assert f"{speed} m/s TAS is {which} level speed, {limit} m/s TAS at {top:.0f} m" in item.reason


def test_what_is_told_of_a_leg_that_was_not_flown_and_of_the_route_alone() -> None:
    setup = make_setup(straight(0.0))
    item = of(judge(setup, fly_path(setup, stop=900.0)), "speed", leg(2))
    assert "the leg was not flown" in item.reason
    assert (item.ok, item.facts) == (None, ())
    bare = of(judge_geometry(setup), "speed", leg(2))
    assert "not flown" not in bare.reason
    assert (bare.ok, bare.facts, bare.tolerance) == (True, (), 0.0)
