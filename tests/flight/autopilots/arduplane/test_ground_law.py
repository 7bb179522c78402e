"""Take-offs and landings by ArduPlane's law, beside those that ArduPlane itself flew, and those that fail."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.catalog import find_logged_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.ground_law import (
    APPROACHING,
    ARDUPLANE_GROUND,
    FLARING,
    GROUND_STATE,
    ON_GLIDE,
    _begin_first_leg,
    _demand_glide,
    _demand_heading,
    _is_leveled,
    _limit_rotation_pitch,
    _set_landing_parameters,
    _set_take_off_parameters,
    _tick_landing,
    _update_stage,
)
from flight.dynamics.state import STATE
from flight.guidance.path import PIECE
from flight.simulation.tick import ENDS, GROUND, NO_MOTOR, WORKSPACE
from tests.flight.autopilots.arduplane.flown_grounds import (
    FLIGHTS,
    HOME,
    LATER_M,
    Flown,
    circuit,
    fly,
    fly_kept,
    kept,
    make_ground_setup,
)
from tests.flight.autopilots.arduplane.laws import flying, memory, parameters, record, waypoints
from tests.soak import SOAK
from world.airfield import LandingStrip, Launch
from world.scenario_tables import ArduPlaneVersion

# In every run those whose slope, flare and wind differ most.
ALWAYS = ("a", "b", "d")
STRIP = LandingStrip(500.0, 600.0, length=600.0)
RAIL = Launch("catapult", math.radians(90.0), 20.0, 6.0, math.radians(12.0))
flights = pytest.mark.parametrize("flight", [name for name in FLIGHTS if SOAK or name in ALWAYS])


def touch(flown: Flown) -> int:
    """The row of the touch-down: where the aircraft is first as low as it stands."""
    track = flown.track
    return int(np.argmax((track.time > 60.0) & (track.clearance < track.clearance[-1] + 0.02)))


@flights
def test_take_offs_are_those_of_arduplane(flight: str) -> None:
    """Place within 10 m of 280 m and height within 2.5 m of 65 m after 14 s; airspeed and pitch all along."""
    flown, real = fly_kept(flight).track, kept(flight, "takeoff")
    # Times count from the first kept row, which is a tenth of a second after the rail.
    first = np.interp(-real["east_m"][0], -flown.position[:60, 0], flown.time[:60])
    rows = np.searchsorted(flown.time, first + real["time_s"])
    aside = np.hypot(flown.position[rows, 0] - real["east_m"], flown.position[rows, 1] - real["north_m"])
    assert aside.max() < 10.0
    assert np.abs(flown.position[rows, 2] - real["amsl_m"]).max() < 2.5
    # Into the first second the motor of the real one came a tenth later.
    assert np.abs(flown.airspeed[rows] - real["tas_mps"])[1:].max() < 1.3
    assert np.abs(flown.attitude[rows, 1] - real["pitch_rad"])[3:].max() < math.radians(2.0)


@flights
def test_landings_are_those_of_arduplane(flight: str) -> None:
    """Slope within 0.2 degrees, flare within 2 m and 25 m; the touch-down later by the flare that 4.6.0-dev lacked."""
    flown, real = fly_kept(flight), kept(flight, "landing")
    approach, track = flown.approach, flown.track
    glide = flown.setup.autopilot.ground.glide(
        approach.start_altitude - approach.point[2], approach.length, approach.tail_wind, float(approach.point[2])
    )
    assert flown.flight.ended == "completed"
    along, aside = approach.distances_from_landing_point(np.stack([real["east_m"], real["north_m"]], axis=1))
    over = real["amsl_m"] - approach.point[2]
    final = (along < -glide.flare_distance - 10.0) & (along > -approach.length + 100.0)
    way, off = approach.distances_from_landing_point(np.asarray(track.position, dtype=np.float64))
    if flight != "d":  # where the last descent was too steep to be flown straight
        # As far before the point as ArduPlane's is kept.
        own = (way < -glide.flare_distance - 10.0) & (way > along[final][0]) & (np.abs(off) < 20.0)
        own &= track.time > track.time[-1] - 60.0
        for run, up in ((along[final], over[final]), (way[own], track.position[own, 2])):
            slope = -np.polyfit(run, up, 1)[0]
            assert math.degrees(abs(math.atan(slope) - math.atan(glide.slope))) < 0.2
    # The flare begins where the motor is cut.
    # As fast as it may be closed, for a fifth of a second.
    closing = track.commands[12:, 3] < track.commands[:-12, 3] - 0.19
    k = int(np.argmax((track.time[:-12] > 60.0) & (way[:-12] > -200.0) & closing))
    began = float(approach.distances_from_landing_point(np.asarray(track.position[k], dtype=np.float64))[0])
    assert -began == pytest.approx(glide.flare_distance, abs=25.0)
    assert track.position[k, 2] - approach.point[2] == pytest.approx(glide.flare_height, abs=2.0)
    mine = approach.distances_from_landing_point(np.asarray(track.position[touch(flown)], dtype=np.float64))
    down = int(np.argmax(real["amsl_m"] - real["ground_m"] < 0.35))
    assert -16.0 * (flight == "d") < float(mine[0]) - along[down] < LATER_M
    assert float(mine[1]) == pytest.approx(aside[down], abs=1.0)
    rest = approach.distances_from_landing_point(np.asarray(track.position[-1], dtype=np.float64))
    assert -20.0 < float(rest[0]) - along[-1] < LATER_M


def test_a_launch_below_minacc_never_gets_its_motor() -> None:
    """10 m/s over 6 m: it glides down from the rail, and ends on the ground within 30 m."""
    slow = Launch("catapult", math.radians(90.0), 10.0, 6.0, math.radians(8.0))
    flown = fly(circuit(slow, None, TKOFF_THR_MINACC=15.0))
    assert flown.flight.ended == ENDS[GROUND]
    assert flown.track.controls[:, 3].max() == 0.0
    assert flown.track.position[-1, 0] < 30.0


def test_a_motor_that_runs_on_the_rail_climbs_at_the_highest_pitch() -> None:
    """ArduPlane 4.6.3 (low10, g3): TECS_PITCH_MAX 15 and PTCH_TRIM_DEG 3.3, where the item states 12 and 10 degrees.

    With TKOFF_THR_MINACC 15 the motor starts later, and the kept flights climb at the item's pitch.
    """
    for least, pitch in ((0.0, 15.0), (15.0, 10.0)):
        track = fly(circuit(RAIL, None, wind=(0.0, 0.0), TKOFF_THR_MINACC=least)).track
        rows = (track.time > 5.0) & (track.time < 6.0)
        assert math.degrees(float(track.attitude[rows, 1].mean())) == pytest.approx(pitch + 3.3, abs=0.7)


def test_a_runway_is_left_at_rotate_speed_and_the_climb_is_steep_only_then() -> None:
    """The real one lifted off after 37 m at 22 m/s in this wind."""
    runway = Launch("runway", math.radians(90.0))
    flown = fly(circuit(runway, None, TKOFF_ROTATE_SPD=19.0))
    track = flown.track
    lifted = int(np.argmax(track.clearance > 0.6))
    assert track.position[lifted, 0] == pytest.approx(37.0, abs=8.0)
    assert track.airspeed[lifted] == pytest.approx(22.0, abs=1.5)
    assert track.airspeed[int(np.argmax(track.attitude[:, 1] > math.radians(8.0)))] > 19.0
    assert flown.flight.ended == "completed"


def test_on_a_runway_minacc_is_never_felt() -> None:
    flown = fly(circuit(Launch("runway"), None, TKOFF_THR_MINACC=5.0))
    assert flown.flight.ended == ENDS[NO_MOTOR]


@pytest.mark.parametrize(("aircraft", "speed"), [("zagi", None), ("ultrastick25e", None)])
def test_small_aircraft_are_thrown_and_land(aircraft: str, speed: float | None) -> None:
    """From a hand at the usual 10 m/s, in a light wind, to rest on the strip."""
    hand = Launch("hand", math.radians(90.0), speed, None, math.radians(10.0))
    flown = fly(circuit(hand, STRIP, wind=(2.0, 60.0), aircraft=aircraft))
    assert flown.flight.ended == "completed"
    along, aside = flown.approach.distances_from_landing_point(np.asarray(flown.track.position[-1], dtype=np.float64))
    assert abs(float(along)) < 150.0
    assert abs(float(aside)) < 15.0


def test_the_heading_is_held_that_the_launch_had_and_the_climb_ends_above_its_height() -> None:
    """In calm air the course is the launch's: 20 degrees off the first leg it stays so until 60 m over home."""
    launch = Launch("catapult", math.radians(70.0), 20.0, 6.0, 0.2)
    # Without TKOFF_PLIM_SEC it does not level off before.
    flown = fly(circuit(launch, None, wind=(0.0, 0.0), TKOFF_PLIM_SEC=0.0))
    track = flown.track
    end = int(np.argmax(track.position[:, 2] > 60.0))
    course = math.atan2(*(track.position[end, :2] - track.position[0, :2]).tolist())
    assert math.degrees(course) == pytest.approx(70.0, abs=1.5)
    # Level until 5 m, and no bank to speak of in calm air; then it turns to the leg.
    assert np.abs(track.attitude[:end, 0]).max() < math.radians(4.0)
    assert math.degrees(math.atan2(*track.velocity[end + 900, :2].tolist())) > 90.0


def test_a_landing_point_below_the_ground_is_no_reason_to_fly_into_it_far_from_it() -> None:
    """A point 20 m under the ground: the glide meets it some 200 m before, which is no landing."""
    flown = fly(circuit(RAIL, STRIP, point=-20.0))
    assert flown.flight.ended == ENDS[GROUND]


def test_gusts_do_not_lead_the_nose_in_the_flare() -> None:
    """The pitch goes by the sink: by an airspeed in light turbulence it came down at 3.5 m/s here, and not below 3."""
    setup = circuit(None, STRIP, wind=(5.0, 270.0))
    wind = replace(setup.scenario.wind, turbulence="light")
    flown = fly(replace(setup, scenario=replace(setup.scenario, wind=wind), seed=3))
    track = flown.track
    flare = int(np.argmax((track.time > 60.0) & (track.position[:, 0] < 600.0) & (track.commands[:, 3] == 0.0)))
    assert flown.flight.ended == "completed"
    assert -track.velocity[flare:, 2].min() < 3.0


def test_a_throttle_without_a_limit_is_closed_at_once_in_the_flare() -> None:
    """THR_SLEWRATE 0 limits nothing: against the wind the motor runs on the glide, and not through the slide."""
    flown = fly(circuit(None, STRIP, wind=(6.0, 270.0), THR_SLEWRATE=0.0))
    track, down = flown.track, touch(flown)
    assert flown.flight.ended == "completed"
    assert track.commands[down - 600 : down, 3].max() > 0.05
    assert track.commands[down:, 3].max() == 0.0


def test_the_flare_is_the_same_on_a_field_lower_or_higher_than_home() -> None:
    """Up to 4.6.2 ArduPlane mixed heights over home and over the field: its flare rose on lower fields."""
    setup, flares = circuit(None, STRIP, wind=(3.0, 270.0)), []
    for lower in (0.0, 60.0, -40.0):
        home = setup.mission.home
        assert home is not None
        items = tuple(replace(item, alt=item.alt - lower) for item in setup.mission.items)
        mission = replace(setup.mission, home=replace(home, alt=home.alt + lower), items=items)
        track = fly(make_ground_setup(setup.scenario, mission)).track
        flare = int(np.argmax((track.time > 60.0) & (track.position[:, 0] < 600.0) & (track.commands[:, 3] == 0.0)))
        flares.append(track.position[flare : flare + 300, 2])
    assert flares[0].max() - flares[0][0] < 0.5
    for other in flares[1:]:
        assert np.abs(other - flares[0]).max() < 0.1


@pytest.mark.parametrize("after_loiter", [False, True])
def test_after_a_loiter_to_an_altitude_the_approach_begins_at_once(after_loiter: bool) -> None:
    """`AP_Landing::type_slope_verify_land`: otherwise lined up, below the waypoint before, or past half of the leg."""
    ground = record(GROUND_STATE, stage=ON_GLIDE, glide_start_altitude=500.0, approaches_at_once=after_loiter)
    own = memory()
    # 900 m before the point, at a tenth of the leg, 40 degrees and 80 m off the line.
    _update_stage(flying(up=500.0), parameters(), ground, own, (900.0, 0.1, math.radians(40.0), 80.0))
    assert ground.stage == (APPROACHING if after_loiter else ON_GLIDE)


@pytest.mark.parametrize(("by_demand", "entry_sink"), [(False, 3.0), (True, 1.5)])
def test_the_flare_begins_with_the_flown_sink_rate_and_in_47_with_the_demanded_one(
    by_demand: bool, entry_sink: float
) -> None:
    """`AP_TECS::_update_height_demand` begins with `_climb_rate` in 4.6.3 and with `_hgt_rate_dem` in 4.7."""
    ground = record(GROUND_STATE, stage=APPROACHING, flares_by_demand=by_demand)
    own = memory(climb_rate_demand=-1.5)
    # 2 m over the point, below LAND_FLARE_ALT of 3 m; it sinks at 3 m/s where 1.5 m/s are demanded.
    _update_stage(flying(up=2.0, climb=-3.0), parameters(), ground, own, (50.0, 0.9, 0.0, 0.0))
    assert (ground.stage, ground.entry_sink, ground.entry_height) == (FLARING, entry_sink, 2.0)


@pytest.mark.parametrize("field", [0.0, -60.0, 400.0])
def test_the_flares_demand_fades_from_the_glides_to_the_flown_height_on_any_field(field: float) -> None:
    """`AP_TECS::_update_height_demand` since 4.6.3: both heights count from one datum, wherever the field lies.

    The flare begins at 3 m, 1 m over the glide's demand, with 2 m/s of sink; 1 s later, at 2 m, half of it is done down
    to TECS_FLARE_HGT of 1 m.  The sink of ten updates of 0.1 s is taken off both heights.
    """
    ground, own, settings = record(GROUND_STATE, up=field, stage=APPROACHING), memory(), parameters()
    own.altitude_demand = field + 2.0
    _update_stage(flying(up=field + 3.0, climb=-2.0), settings, ground, own, (30.0, 0.95, 0.0, 0.0))
    assert ground.stage == FLARING
    adjusted, ideal = field + 2.0, field + 3.0
    for update in range(1, 11):
        height = 3.0 - 0.1 * update
        _demand_glide(flying(up=field + height), settings, ground, own, 30.0 - 2.5 * update)
        fraction = (3.0 - height) / (3.0 - 1.0)
        sink = 2.0 * (1.0 - fraction) + 0.25 * fraction
        adjusted, ideal = adjusted - 0.1 * sink, ideal - 0.1 * sink
    assert fraction == pytest.approx(0.5)
    assert own.climb_rate_demand == pytest.approx(-sink)
    assert own.altitude_demand == pytest.approx(0.5 * (adjusted + ideal))


@pytest.mark.parametrize(
    ("version", "stall", "stage", "least"),
    [
        ("4.7", 14.0, FLARING, 14.0),
        ("4.7", 14.0, APPROACHING, 18.0),
        ("4.7", 0.0, FLARING, 18.0),
        ("4.6", 14.0, FLARING, 18.0),
    ],
)
def test_in_the_flare_of_47_the_least_airspeed_is_that_of_the_stall(
    version: ArduPlaneVersion, stall: float, stage: int, least: float
) -> None:
    """`AP_TECS::_update_speed`: AIRSPEED_STALL on the final part of a landing."""
    settings, stage_parameters = parameters(version, AIRSPEED_MIN=18.0, AIRSPEED_STALL=stall), parameters()
    ground = record(GROUND_STATE, stage=stage, entry_height=3.0)
    _set_landing_parameters(flying(up=2.0), settings, stage_parameters, ground, 0.9)
    assert stage_parameters.airspeed_min == least


@pytest.mark.parametrize("version", ["4.6", "4.7"])
def test_each_release_flares_by_its_own_sink_rate(version: ArduPlaneVersion) -> None:
    setup = circuit(None, STRIP)
    aircraft = find_logged_aircraft(setup.aircraft, setup.scenario.flight.aircraft)
    assert isinstance(setup.autopilot, ArduPlane)
    own = record(ARDUPLANE_GROUND)
    ground_law = setup.autopilot.with_release(version).ground.control_law
    assert ground_law is not None
    ground_law(setup.ground_phases, aircraft, ()).initialise(record(WORKSPACE), own)
    assert own.ground.flares_by_demand == (version == "4.7")


@pytest.mark.parametrize(("version", "updates"), [("4.6", 21), ("4.7", 1)])
def test_a_take_off_holds_its_course_after_two_seconds_and_in_47_at_once(
    version: ArduPlaneVersion, updates: int
) -> None:
    """`Plane::verify_takeoff`: 4.6 waits two seconds above 5 m/s over the ground, 4.7 does not; at 10 Hz."""
    ground, own, settings = record(GROUND_STATE), memory(), parameters(version)
    state = record(STATE, yaw=0.0)
    count = 0
    while not ground.is_heading_held and count < 100:
        _demand_heading(state, flying(course=0.3), settings, ground, own)
        count += 1
    assert count in (updates, updates - 1)
    assert ground.heading == pytest.approx(0.3)


@pytest.mark.parametrize(("stage", "airspeed"), [(ON_GLIDE, 25.0), (APPROACHING, 20.0)])
def test_before_the_approach_stage_the_landing_leg_is_flown_at_cruise_airspeed(stage: int, airspeed: float) -> None:
    """`AP_Landing::type_slope_get_target_airspeed_cm`: AIRSPEED_CRUISE in the stage NORMAL."""
    own = record(ARDUPLANE_GROUND)
    own.memory = memory(time_to_update=0.0)
    own.parameters = parameters(AIRSPEED_CRUISE=25.0, AIRSPEED_MIN=15.0, AIRSPEED_MAX=30.0)
    own.stage_parameters = own.parameters
    own.ground.stage, own.ground.airspeed, own.ground.glide_start_altitude = stage, 20.0, 500.0
    # The point is 2 km to the north and 100 m lower; the aircraft is 200 m off the line and flies across it.
    own.ground.north, own.ground.up = 2000.0, -100.0
    work = record(WORKSPACE)
    work.timing.dt = 1.0 / 120.0
    work.state.airspeed = 25.0
    work.estimated = flying(east=200.0, north=100.0, up=0.0, course=1.2)
    _tick_landing(work, own, waypoints((0.0, 2000.0, 0.0))[0])
    assert own.ground.stage == stage
    assert work.memory.speed_command == pytest.approx(airspeed)


@pytest.mark.parametrize(
    ("fastest", "ground_speed", "degrees"),
    [
        # Below TKOFF_ROTATE_SPD of 15 m/s: TKOFF_GND_PITCH.
        (14.0, 14.0, 2.0),
        # Then the item's 12 degrees times the ground speed over AIRSPEED_CRUISE of 25 m/s, at least 5 degrees.
        (16.0, 20.0, 9.6),
        (16.0, 8.0, 5.0),
        # Above AIRSPEED_CRUISE over the ground: as without a rotation.
        (26.0, 25.1, 12.0),
    ],
)
def test_a_rotation_raises_the_pitch_with_the_ground_speed(fastest: float, ground_speed: float, degrees: float) -> None:
    """`Plane::takeoff_calc_pitch`."""
    ground = record(GROUND_STATE, max_airspeed=fastest, takeoff_pitch=math.radians(12.0))
    own = memory(pitch_demand=math.radians(12.0))
    settings = parameters(TKOFF_ROTATE_SPD=15.0, TKOFF_GND_PITCH=2.0, AIRSPEED_CRUISE=25.0, AIRSPEED_MAX=30.0)
    estimated = flying()
    estimated.velocity_east, estimated.velocity_north = ground_speed, 0.0
    _limit_rotation_pitch(estimated, settings, ground, own)
    assert math.degrees(own.pitch_demand) == pytest.approx(degrees)
    # Once the rotation is complete, a gust does not begin it again.
    estimated.velocity_east = 10.0
    own.pitch_demand = math.radians(12.0)
    _limit_rotation_pitch(estimated, settings, ground, own)
    assert ground.rotation_complete == (degrees == 12.0)


@pytest.mark.parametrize(
    ("error", "prevents", "degrees"), [(0.0, 1.0, 12.0), (45.0, 1.0, 6.0), (120.0, 1.0, 0.0), (45.0, 0.0, 12.0)]
)
def test_a_take_off_pitches_less_while_its_bank_is_not_as_demanded(
    error: float, prevents: float, degrees: float
) -> None:
    """`Plane::takeoff_calc_pitch`: by the square of the cosine of the roll's error, with STALL_PREVENTION."""
    ground = record(GROUND_STATE, takeoff_pitch=math.radians(12.0), takeoff_end_altitude=600.0)
    settings, stage = parameters(STALL_PREVENTION=prevents), parameters()
    _set_take_off_parameters(flying(), settings, stage, ground, math.radians(error))
    assert math.degrees(stage.pitch_limit_min) == pytest.approx(degrees, abs=1e-9)
    assert stage.pitch_limit_max == stage.pitch_limit_min


@pytest.mark.parametrize(("seconds", "is_over"), [(1.9, False), (2.1, True)])
def test_a_take_off_ends_when_it_has_leveled_off_for_its_seconds(seconds: float, is_over: bool) -> None:
    """`Plane::check_takeoff_timeout_level_off`: TKOFF_PLIM_SEC, 2 s, after leveling off began, at any height."""
    ground = record(GROUND_STATE, leveling_height=8.0, leveling_start=10.0, time=10.0 + seconds)
    assert bool(_is_leveled(parameters(), ground)) == is_over
    ground.leveling_height = 0.0
    assert not _is_leveled(parameters(), ground)


def test_the_first_leg_after_a_take_off_has_no_line() -> None:
    """`Plane::verify_takeoff` clears `next_wp_crosstrack`: only the first leg is flown from the aircraft itself."""
    legs = waypoints((0.0, 0.0, 500.0), (0.0, 1000.0, 500.0), (1000.0, 1000.0, 500.0))
    work, ground, own = record(WORKSPACE), record(GROUND_STATE), memory()
    _begin_first_leg(flying(), legs, np.zeros(1, PIECE), work.memory, ground, own)
    assert legs["without_crosstrack"].tolist() == [False, True, False]


def test_home_is_where_kept_flights_began() -> None:
    take_off = fly_kept("a").setup.ground_phases.take_off
    assert take_off is not None
    assert take_off.home == pytest.approx(HOME, abs=0.05)
