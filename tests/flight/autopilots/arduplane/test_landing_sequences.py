"""Returns that go on to a landing, and a landing that is aborted, beside those that ArduPlane itself flew."""

import math

import numpy as np
import pytest

from flight.autopilots.arduplane.go_around_point_mass import fly_go_arounds, make_abort_start
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.simulated_returns import RETURN_GROUND_IMPACT, RETURN_START
from flight.mission.ground_phases import Approach
from flight.mission.placing import landing_sequence
from logs.verdict.returns.judge_returns import make_return_world
from tests.flight.autopilots.arduplane.flown_grounds import LATER_M, Flown
from tests.flight.autopilots.arduplane.kept_sequences import flown_sequence, kept_sequence, kept_setup
from world.arrays import Floats
from world.kernels import Records

# Time after which the end of the take-off no longer matters, s.
TAKE_OFF_DIFFERS_S = 30.0
returns = pytest.mark.parametrize("flight", ["autoland-1", "autoland-2"])


def since_return(flown: Flown, flight: str) -> tuple[Floats, Floats]:
    """Times from where the return begins, and places (n, 3) m, of a flight by the law."""
    real, track = kept_sequence(flight), flown.track
    begin = np.array([real["east_m"][0], real["north_m"][0]])
    first = int(np.argmin(np.hypot(*(track.position[:3600, :2] - begin).T)))
    return track.time[first:] - track.time[first], np.asarray(track.position[first:], dtype=np.float64)


@returns
def test_returns_go_on_to_the_landing_as_arduplane_does(flight: str) -> None:
    """Place within 15 m to the glide, and height within 2 m once it flies level: the begins differ.

    4.6.0-dev ended a take-off at its height alone, and not TKOFF_PLIM_SEC after leveling off began.
    """
    flown, real = flown_sequence(flight), kept_sequence(flight)
    assert flown.flight.ended == "completed"
    time, position = since_return(flown, flight)
    on_way = real["amsl_m"] > flown.approach.start_altitude - 1.0
    # The way at the same places: one is up to 2 s ahead of the other.
    aside, higher = [], []
    for t, east, north, up in zip(*(real[name] for name in ("time_s", "east_m", "north_m", "amsl_m")), strict=True):
        near = np.where(np.abs(time - t) < 5.0, np.hypot(position[:, 0] - east, position[:, 1] - north), np.inf)
        k = int(np.argmin(near))
        aside.append(float(near[k]))
        higher.append(float(position[k, 2] - up))
    assert np.array(aside)[on_way & (real["time_s"] > TAKE_OFF_DIFFERS_S)].max() < 15.0
    assert np.abs(higher)[on_way & (real["time_s"] > 8.0)].max() < 2.0


@returns
def test_returns_touch_down_where_arduplane_does(flight: str) -> None:
    """Slope within 0.2 degrees, and the touch-down later by the flare that 4.6.0-dev lacked on a field above home."""
    flown, real = flown_sequence(flight), kept_sequence(flight)
    approach, track = flown.approach, flown.track
    there = np.stack([real["east_m"], real["north_m"]], axis=1)
    along, aside = approach.distances_from_landing_point(there)
    down = int(np.argmax((real["amsl_m"] - real["ground_m"] < 0.35) & (along > -200.0)))
    touched = int(np.argmax((track.time > 60.0) & (track.clearance < track.clearance[-1] + 0.02)))
    mine = approach.distances_from_landing_point(np.asarray(track.position[touched], dtype=np.float64))
    assert 0.0 < float(mine[0]) - along[down] < LATER_M
    assert float(mine[1]) == pytest.approx(aside[down], abs=1.0)
    slopes = [
        on_glide(approach, there, real["amsl_m"]),
        on_glide(approach, np.asarray(track.position[3600:, :2], dtype=np.float64), track.position[3600:, 2]),
    ]
    assert abs(slopes[0] - slopes[1]) < 0.2


def on_glide(approach: Approach, places: Floats, up: Floats) -> float:
    """Slope of the straight part of a glide, degrees; places (n, 2) and heights (n,), m."""
    along, aside = approach.distances_from_landing_point(places)
    final = (along < -120.0) & (along > -approach.length + 100.0) & (np.abs(aside) < 20.0)
    return math.degrees(math.atan(-float(np.polyfit(along[final], up[final], 1)[0])))


def test_it_leaves_its_circle_for_the_landing_within_10_m_of_its_height_and_only_with_1() -> None:
    one, two = flown_sequence("autoland-1"), flown_sequence("autoland-2")
    home = np.array([9500.0, -5000.0])
    assert np.hypot(*(one.track.position[3600:, :2] - home).T).min() < 200.0
    assert np.hypot(*(two.track.position[3600:, :2] - home).T).min() > 400.0
    route = one.setup.route
    assert (route.rtl_loiter is not None, two.setup.route.rtl_loiter) == (True, None)
    # With a circle 100 m higher it climbs there first.
    assert route.items[route.rtl_end] == 5
    high = kept_setup("autoland-1", RTL_ALTITUDE=200.0).route
    assert high.positions[high.rtl_end - 1, 2] == pytest.approx(535.0, abs=1.0)


def test_without_autoland_a_return_ends_in_its_circle() -> None:
    for autoland in (0.0, 3.0, 4.0):
        route = kept_setup("autoland-1", RTL_AUTOLAND=autoland).route
        assert route.rtl_end == len(route.points)
        assert route.landing_ground is None
        assert any("never reached" in note for note in route.notes)
        assert any("which is not simulated. The simulated RTL ends in its loiter" in note for note in route.notes) is (
            autoland == 4.0
        )


def aborted(pitch: float = math.radians(10.0), height: float = 50.0) -> tuple[Records, Floats]:
    """The kept abort on the point mass: what it comes to, and its way."""
    setup, real = kept_setup("abort"), kept_sequence("abort")
    world = make_return_world(setup)
    start = np.zeros(1, RETURN_START)
    for name in ("east", "north", "amsl"):
        start["up" if name == "amsl" else name] = real[f"{name}_m"][0]
    for name in ("east", "north", "up"):
        start[f"velocity_{name}"] = real[f"velocity_{name}_mps"][0]
    places = landing_sequence(setup.mission, setup.scenario.origin, setup.scenario.terrain, 6)
    landing = places[0]._replace(next_stops=places[1:])
    top = world.home.up + height
    parameters = world.autopilot.parameters
    assert isinstance(parameters, ArduPilotParameters)
    found = fly_go_arounds(start, top, pitch, [landing], parameters, world.aircraft, world.environment)
    return found.results[0], found.tracks[0]


def test_the_abort_flies_into_the_hill_as_arduplane_did() -> None:
    """It is already at this height, turns at once, and meets the hillside: place within 10 m and height within 6 m."""
    real = kept_sequence("abort")
    flown, way = aborted()
    assert flown["outcome"] == RETURN_GROUND_IMPACT
    seconds = np.arange(10.0)
    for axis, name in enumerate(("east_m", "north_m", "amsl_m")):
        there = np.interp(seconds, real["time_s"], real[name])
        assert np.abs(way[:10, axis] - there).max() < (6.0 if name == "amsl_m" else 10.0)


def test_an_abort_that_has_to_climb_holds_its_course_until_it_is_above_its_height() -> None:
    flown, way = aborted(height=120.0)
    assert flown["outcome"] != RETURN_GROUND_IMPACT
    top = kept_setup("abort").mission.home.alt + 120.0
    k = int(np.argmax(way[:, 2] > top))
    courses = np.degrees(np.arctan2(*np.diff(way[:k, :2], axis=0).T)) % 360.0
    assert np.abs(courses - 240.0).max() < 4.0
    # 10 degrees of pitch, with the throttle open: ArduPlane's take-off climbs so at 0.23.
    rise = (way[k, 2] - way[5, 2]) / np.hypot(*(way[k, :2] - way[5, :2]))
    assert rise == pytest.approx(0.23, abs=0.05)


def test_the_speed_where_it_is_aborted_is_the_glides_in_the_wind() -> None:
    world = make_return_world(kept_setup("abort"))
    real = kept_sequence("abort")
    place = (8333.66, -4151.17, 392.3)
    start = make_abort_start(place, math.radians(240.0), 0.098, 22.9, world.scenario.wind_velocity(place))
    for name in ("east", "north"):
        assert float(start[f"velocity_{name}"][0]) == pytest.approx(real[f"velocity_{name}_mps"][0], abs=0.3)
    assert float(start["velocity_up"][0]) == pytest.approx(-1.75, abs=0.1)
