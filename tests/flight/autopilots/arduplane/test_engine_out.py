"""Without its engine an aircraft on a point mass is where ArduPlane's was, and as low; and glides as its polar says."""

import csv
import functools
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from flight.autopilots.arduplane.rtl_point_mass import fly_returns
from flight.autopilots.simulated_returns import RETURN_ARRIVED, RETURN_GROUND_IMPACT, SimulatedReturns
from flight.mission.return_path import LandingStart, ReturnTarget
from tests.flight.autopilots.arduplane.kept_flights import FOLDER, HOME, WIND
from tests.flight.autopilots.arduplane.test_rtl_point_mass import aerosonde, around, flat, parameters, start
from tests.soak import some
from world.kernels import Records
from world.wind import Wind


def _rows(name: str) -> list[dict[str, str]]:
    with (FOLDER / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


GLIDES = {row["flight"]: row for row in _rows("glides.csv")}
# Law less flight of ArduPlane, m (issue 35).
LOW, HIGH = -40.0, 15.0
# m.  The law's pitch integrators fade beyond a pitch limit, as in the source of 4.6.3: without that this one flight of
# 4.6.0-dev is within 150 m as well, with it 151.4 m.
ASIDE = 150.0
ASIDE_WITH_FADING_INTEGRATORS = {"glide-rtl2-02": 152.0}
# What a glide has to clear the ground by to count as one that gets there, m.
MARGIN = 30.0


def glide_track(flight: str) -> NDArray[np.float64]:
    """Times and places (n, 4): s since the motor stopped, m."""
    rows = [row for row in _rows("glide_tracks.csv") if row["flight"] == flight]
    return np.array([[float(row[name]) for name in ("time_s", "east_m", "north_m", "amsl_m")] for row in rows])


@functools.cache
def glided(flight: str) -> SimulatedReturns:
    row = {name: float(value) for name, value in GLIDES[flight].items() if name not in ("flight", "mode")}
    velocity = {f"velocity_{way}": row[f"velocity_{way}_mps"] for way in ("east", "north", "up")}
    begin = start(east=row["east_m"], north=row["north_m"], up=row["amsl_m"], **velocity)
    if GLIDES[flight]["mode"] == "RTL":
        home = ReturnTarget((HOME[0], HOME[1], HOME[2] + 100.0), "home", "", 0.0)
        made = parameters(RTL_RADIUS=parameters().loiter_radius)
        return fly_returns(made, begin, [home], aerosonde(WIND), around(), store_positions=True, engine_out=True)
    # On along its leg, which bends by no more than 25 degrees.
    over = math.hypot(velocity["velocity_east"], velocity["velocity_north"])
    far = tuple(
        here + 12_000.0 * speed / over
        for here, speed in zip((row["east_m"], row["north_m"], row["amsl_m"]), velocity.values(), strict=True)
    )
    on = straight_on((far[0], far[1], far[2]))
    return fly_returns(parameters(), begin, [on], aerosonde(WIND), flat(0.0), store_positions=True, engine_out=True)


def straight_on(place: tuple[float, float, float]) -> ReturnTarget:
    """The target of a return that flies straight to a landing sequence."""
    return ReturnTarget(place, "landing", "", 0.0, landing=LandingStart(1, place, place), straight=True)


@pytest.mark.parametrize("flight", some(GLIDES, 2))
def test_it_is_as_high_as_arduplane_was(flight: str) -> None:
    (way,) = glided(flight).tracks
    aside = ASIDE_WITH_FADING_INTEGRATORS.get(flight, ASIDE)
    seconds, compared = np.arange(len(way)), 0
    for time, east, north, up in glide_track(flight):
        if time < len(way) - 1:
            here = [float(np.interp(time, seconds, way[:, k])) for k in range(3)]
            assert LOW < here[2] - up < HIGH, time
            assert GLIDES[flight]["mode"] == "AUTO" or math.hypot(here[0] - east, here[1] - north) < aside
            compared += 1
    assert compared > 0.8 * len(glide_track(flight)) - 1


@pytest.mark.parametrize("flight", [name for name, row in GLIDES.items() if row["mode"] == "RTL"])
def test_it_gets_home_where_arduplane_did(flight: str) -> None:
    real, flown = GLIDES[flight], glided(flight).results[0]
    arrives = bool(flown["outcome"] == RETURN_ARRIVED and flown["clearance_before_arrival"] >= MARGIN)
    assert arrives == (real["reaches_home"] == "1")
    assert (flown["outcome"] == RETURN_GROUND_IMPACT) == (real["reaches_home"] == "0")
    if arrives:
        assert flown["arrival_time"] == pytest.approx(float(real["ends_s"]), abs=10.0)


# ----------------------------------------------------------------------
# By plain sums.


def straight(wind: Wind, north: float = 26.0) -> NDArray[np.float64]:
    """Places (t, 3) of a glide to the north from 2,000 m, a second apart."""
    begin = start(up=2000.0, velocity_north=north)
    on = straight_on((0.0, 13_000.0, 2000.0))
    flown = fly_returns(parameters(), begin, [on], aerosonde(wind), flat(0.0), store_positions=True, engine_out=True)
    return flown.tracks[0]


@pytest.mark.parametrize(("head", "ratio"), [(0.0, 1.0), (6.0, 1.0 - 6.0 / 19.4), (-6.0, 1.0 + 6.0 / 19.4)])
def test_it_glides_at_its_least_airspeed(head: float, ratio: float) -> None:
    """AIRSPEED_MIN of 18 m/s is 19.4 m/s at 1,550 m; ArduPlane's Aerosonde glided 10.4 to 10.8 : 1 at it."""
    way = straight(Wind(abs(head), 0.0 if head > 0.0 else math.pi), 26.0 - head)
    run, fall = way[320, 1] - way[120, 1], way[120, 2] - way[320, 2]
    assert way[220, 2] == pytest.approx(1550.0, abs=100.0)
    assert run / 200.0 == pytest.approx(19.4 - head, abs=0.3)
    assert 10.3 * ratio < run / fall < 10.9 * ratio


def glide_to(place: tuple[float, float, float], begin: Records, *, engine_out: bool = True) -> SimulatedReturns:
    """A return in calm air to a circle of 120 m, without its engine."""
    target = ReturnTarget(place, "home", "", 0.0)
    made = parameters(RTL_RADIUS=120.0)
    return fly_returns(made, begin, [target], aerosonde(Wind()), flat(), store_positions=True, engine_out=engine_out)


def test_it_flies_on_before_it_turns_back() -> None:
    """For 3 s, to the north; then it turns to what lies behind it."""
    begin = start(up=900.0, velocity_north=26.0)
    (way,) = glide_to((0.0, -5000.0, 500.0), begin).tracks
    assert way[3, 0] == pytest.approx(0.0, abs=0.5)
    assert way[3, 1] == pytest.approx(3.0 * 25.0, abs=2.5)
    assert abs(way[8, 0]) > 10.0
    # Half a circle at 26 m/s and 30 degrees: 14.5 s, at 3.4 to 4.5 m/s.
    assert 40.0 < way[3, 2] - way[18, 2] < 75.0


def test_above_its_slope_it_dives_onto_it() -> None:
    """500 m down over 9 km, 18 : 1, where it glides 10.5 : 1: below it; over 4 km, 8 : 1: on it, and fast."""
    begin = start(up=900.0, velocity_north=26.0)
    far, near = (glide_to((0.0, away, 400.0), begin).tracks[0] for away in (9000.0, 4000.0))
    assert near[60, 2] == pytest.approx(900.0 - 500.0 * near[60, 1] / 4000.0, abs=25.0)
    assert near[60, 1] - near[59, 1] > 22.0
    assert far[200, 1] - far[199, 1] < 19.5
    assert far[200, 2] < 900.0 - 500.0 * far[200, 1] / 9000.0 - 50.0


def test_with_its_engine_it_does_not_come_down() -> None:
    begin = start(up=900.0, velocity_north=26.0)
    on, off = (glide_to((0.0, 9000.0, 900.0), begin, engine_out=out).results[0] for out in (False, True))
    assert on["clearance_before_arrival"] > 890.0
    # 8.8 km at 10.5 : 1, and what it takes to slow down.
    assert off["arrival_altitude"] == pytest.approx(900.0 - 8800.0 / 10.5, abs=40.0)
