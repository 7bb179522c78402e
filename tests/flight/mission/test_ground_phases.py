"""Which take-offs and landings are flown, where they begin and end, and why others are not."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.mission.ground_phases import DEFAULT_CLIMB_PITCH, airborne_route
from flight.mission.items import Command, Frame, Mission, MissionItem
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_geometry import judge_geometry
from tests.flight.autopilots.arduplane.flown_grounds import circuit, make_ground_setup
from world.airfield import LandingStrip, Launch

RAIL = Launch("catapult", math.radians(90.0), 20.0, 6.0, math.radians(30.0))
STRIP = LandingStrip(500.0, 600.0)


def with_items(setup: FlightSetup, *items: MissionItem) -> FlightSetup:
    mission = setup.mission
    return make_ground_setup(setup.scenario, Mission(mission.home, items))


def test_a_catapult_lets_go_at_its_end_and_a_hand_where_it_stands() -> None:
    """6 m of rail at 30 degrees lead 5.196 m ahead and 3 m up, from a metre over the ground."""
    take_off = circuit(RAIL, None).ground_phases.take_off
    assert take_off is not None
    place, velocity = take_off.release_state()
    assert place == pytest.approx([5.196, 0.0, 4.0], abs=1e-3)
    assert velocity == pytest.approx([17.321, 0.0, 10.0], abs=1e-3)
    assert take_off.acceleration == pytest.approx(33.33, abs=0.01)
    hand = circuit(replace(RAIL, method="hand"), None).ground_phases.take_off
    assert hand is not None
    assert hand.release_state()[0] == pytest.approx([0.0, 0.0, 1.8])
    runway = circuit(replace(RAIL, method="runway", speed=None), None).ground_phases.take_off
    assert runway is not None
    assert runway.release_state()[0] == pytest.approx([0.0, 0.0, 0.0])
    assert not runway.release_state()[1].any()


def test_without_a_course_it_is_launched_along_the_first_leg_and_without_a_pitch_at_four_degrees() -> None:
    take_off = circuit(replace(RAIL, course=None), None, pitch=0.0).ground_phases.take_off
    assert take_off is not None
    assert take_off.course == pytest.approx(math.radians(90.0), abs=1e-3)
    assert take_off.pitch == DEFAULT_CLIMB_PITCH
    assert (take_off.end_altitude, take_off.home_altitude) == pytest.approx((60.0, 0.0))


def test_the_landing_is_that_of_the_last_leg_and_its_wind() -> None:
    approach = circuit(None, STRIP).ground_phases.approach
    assert approach is not None
    assert (approach.leg, approach.item) == (3, 5)
    assert approach.point == pytest.approx([500.0, 600.0, 0.0], abs=0.02)
    assert approach.length == pytest.approx(600.0, abs=0.05)
    # From 60 degrees at 5 m/s, to the west: cos 30 of it from behind.
    assert approach.tail_wind == pytest.approx(4.33, abs=0.01)
    along, aside = approach.distances_from_landing_point(np.array([[450.0, 610.0, 0.0], [520.0, 595.0, 0.0]]))
    assert along == pytest.approx([50.0, -20.0], abs=0.1)
    assert aside == pytest.approx([10.0, -5.0], abs=0.1)


def test_pictures_show_the_ends_that_are_flown_on_the_ground() -> None:
    heights = circuit(RAIL, STRIP).display_waypoints[:, 2].tolist()
    assert heights == pytest.approx([0.0, 80.0, 70.0, 54.0, 0.0], abs=0.02)
    # The landing leg itself is level, and begins the flight where nothing else is flown.
    for launch, strip, ends in ((RAIL, None, (0.0, 54.0)), (None, STRIP, (60.0, 0.0)), (None, None, (60.0, 54.0))):
        heights = circuit(launch, strip).display_waypoints[:, 2].tolist()
        assert (heights[0], heights[-1]) == pytest.approx(ends, abs=0.02)


def test_pictures_climb_from_home_to_a_take_off_item_with_a_place_of_its_own() -> None:
    """The item is 60 m over home and on the way to the next; the path begins on the ground."""
    setup = circuit(RAIL, STRIP)
    takeoff, *way = setup.mission.items
    first = way[0]
    home = setup.mission.home
    assert home is not None
    lat, lon = (
        getattr(home, name) + 0.4 * (getattr(first, name) - getattr(home, name)) for name in ("lat_deg", "lon_deg")
    )
    placed = with_items(setup, replace(takeoff, lat_deg=lat, lon_deg=lon), *way)
    assert placed.ground_phases.take_off is not None
    assert placed.ground_phases.take_off.waypoint == 1
    assert placed.display_waypoints[:3, 2].tolist() == pytest.approx([0.0, 60.0, 80.0], abs=0.02)


def test_what_a_mission_does_not_hold_is_not_flown_and_says_why() -> None:
    setup = circuit(RAIL, STRIP)
    takeoff, *way, land = setup.mission.items
    no_takeoff = with_items(setup, *way, land).ground_phases
    assert no_takeoff.take_off is None
    assert no_takeoff.approach is not None
    assert "does not begin with a NAV_TAKEOFF" in no_takeoff.notes[0]
    no_landing = with_items(setup, takeoff, *way).ground_phases
    assert no_landing.approach is None
    assert "a NAV_LAND at a third" in no_landing.notes[0]
    low = with_items(setup, takeoff, *way[:-1], replace(way[-1], alt=-5.0), land)
    assert "does not begin above the landing point" in low.ground_phases.notes[0]
    homeless = make_ground_setup(setup.scenario, Mission(None, setup.mission.items))
    assert homeless.ground_phases.take_off is None


def test_a_scenario_without_launch_and_strip_flies_in_the_air_as_ever() -> None:
    setup = circuit(None, None)
    assert not setup.ground_phases
    assert setup.started == setup.route.started
    assert any("not flown to the ground" in note for note in setup.notes)


def test_the_route_in_the_air_begins_where_the_take_off_ended_and_ends_before_the_landing() -> None:
    setup = circuit(RAIL, STRIP)
    begun = np.array([300.0, 40.0, 60.5])
    route = airborne_route(setup.route, setup.ground_phases, begun)
    assert route.positions[0].tolist() == begun.tolist()
    assert route.items.tolist() == [1, 2, 3, 4]
    assert np.array_equal(route.positions[1:], setup.route.positions[1:4])
    assert not any("not flown to the ground" in note for note in route.notes)


def test_a_rally_point_of_another_continent_keeps_nobody_on_the_ground() -> None:
    """Notes beside the verdict name it; what is launched does not depend on it."""
    setup = circuit(RAIL, STRIP)
    far = MissionItem(1, int(Command.NAV_RALLY_POINT), int(Frame.GLOBAL), (0.0,) * 4, -36.5, 84.2, 100.0)
    moved = make_ground_setup(setup.scenario, replace(setup.mission, rally=(far,)))
    before, after = setup.ground_phases.take_off, moved.ground_phases.take_off
    assert before is not None
    assert after is not None
    assert after.home.tolist() == before.home.tolist()
    assert any("km from the map's origin" in note for note in moved.route.notes)
    assert [item.rule for item in judge_geometry(moved).findings].count("go_around") == 1


def test_a_take_off_item_with_a_place_of_its_own_goes_on_from_there() -> None:
    """ArduPlane does not fly to the item's place: the leg that follows begins where the take-off ends."""
    setup = circuit(RAIL, None)
    takeoff, *rest = setup.mission.items
    away = replace(takeoff, lon_deg=takeoff.lon_deg + 0.004)
    take_off = with_items(setup, away, *rest).ground_phases.take_off
    assert takeoff.command == Command.NAV_TAKEOFF
    assert take_off is not None
    assert take_off.waypoint == 1
