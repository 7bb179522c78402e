"""Airspeed against the stall in a bank: the slowest level flight times the root of the load factor."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.envelope import Envelope
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.places import FLIGHT
from logs.verdict.rules.stall_rule import min_level_airspeed, planned_bank, stall_findings
from logs.verdict.tolerances import STALL_TOLERANCE_MPS
from tests.logs.verdict.judging import failing, of, suggested
from tests.synthetic import copied, envelope, fly_path, make_scenario, make_setup

CORNER = [[0, 0, 300], [0, 2000, 300], [2000, 2000, 300]]
# By hand: 16 m/s is the slowest level flight of the table; in 30 degrees of bank 1 / cos(30) = 1.1547 g, of which the
# root is 1.0746.
LEVEL, BANKED = 16.0, 17.193


def corner(speed: float, turn_deg: float = 90.0, **how: object) -> FlightSetup:
    turn = math.radians(turn_deg)
    return make_setup([*CORNER[:2], [2000 * math.sin(turn), 2000 + 2000 * math.cos(turn), 300]], airspeed=speed, **how)


@pytest.mark.parametrize(("speed", "ok"), [(BANKED - 0.01, False), (BANKED + 0.01, True)])
def test_a_planned_turn_just_below_and_just_above_the_stall_in_its_bank(speed: float, ok: bool) -> None:
    verdict = judge_geometry(corner(speed))
    item = of(verdict, "stall", FLIGHT)
    assert item.ok is ok
    assert failing(verdict) == (set() if ok else {("stall", FLIGHT)})
    assert item.limit == pytest.approx(BANKED, abs=1e-3)
    assert item.margin == pytest.approx(speed - BANKED, abs=1e-3)
    # The decimals that show the difference.
    assert f"airspeed {speed:.2f} m/s at waypoint 1; the stall speed is {BANKED:.2f} m/s in 30° of bank" in item.reason
    assert item.reason.endswith(" and 16.0 m/s in level flight (true airspeeds)")
    if not ok:
        # 3 % above the limit, up to a whole tenth.
        assert suggested(item, "airspeed").wanted == pytest.approx(17.8)


def test_a_stall_speed_at_height_is_a_true_airspeed() -> None:
    # One that rises with height as the air thins: 16 m/s at the sea, 19 at 3,000 m.
    table = replace(envelope(), amsl=np.array([0.0, 3000.0, 4000.0]), level_speed_min=np.array([16.0, 19.0, 20.0]))
    for amsl, least in ((0.0, 16.0), (1500.0, 17.5), (3000.0, 19.0)):
        way = [[east, north, amsl] for east, north, _ in CORNER]
        setup = make_setup(way, airspeed=25.0, table=table, terrain={"kind": "none"})
        assert min_level_airspeed(route_requirements(setup), amsl) == pytest.approx(least)
        assert of(judge_geometry(setup), "stall").limit == pytest.approx(least * math.sqrt(1.0 / math.cos(math.pi / 6)))


def test_an_equivalent_airspeed_that_is_commanded_is_a_higher_true_one() -> None:
    """At 1,000 m the standard atmosphere has 1.1116 of 1.225 kg/m^3: true airspeed is 1.0498 times the equivalent."""
    setup = make_setup([[east, north, 1000] for east, north, _ in CORNER], airspeed=16.5)
    equivalent = replace(setup, autopilot=ArduPlane(ArduPilotParameters.defaults()))
    true = 16.5 * math.sqrt(1.225 / 1.1116)
    for flown, speed in ((setup, 16.5), (equivalent, true)):
        item = of(judge_geometry(flown), "stall", FLIGHT)
        assert item.planned == pytest.approx(speed, abs=2e-3)
        assert item.limit == pytest.approx(BANKED, abs=1e-3)
        assert item.ok is (speed > BANKED)
    # What is asked for is what is commanded: 17.193 and 3 % are 17.71 m/s true, which are 16.87 equivalent.
    slow = replace(equivalent, route=setup.route.with_fields(airspeed=16.0))
    assert suggested(of(judge_geometry(slow), "stall"), "airspeed").wanted == pytest.approx(16.9)


def test_the_bank_of_a_turn_is_that_of_its_radius_and_of_what_there_is_time_for() -> None:
    requirements = route_requirements(corner(25.0))
    assert planned_bank(requirements, 1, 25.0) == pytest.approx(math.radians(30.0))
    # The slower of two legs on the arc of the faster: tan b = v^2 / (g R), R = 25^2 / (g tan 30).
    slower = math.atan(math.tan(math.radians(30.0)) * (20.0 / 25.0) ** 2)
    mixed = route_requirements(make_setup(CORNER, speeds=[20.0, 25.0]))
    assert planned_bank(mixed, 1, 20.0) == pytest.approx(slower)
    assert planned_bank(mixed, 1, 25.0) == pytest.approx(math.radians(30.0))
    # 2 degrees are over before 30 of bank are reached: (v / g) turn / 0.8 s is the square of what is.
    slight = route_requirements(corner(25.0, 2.0))
    assert planned_bank(slight, 1, 25.0) == pytest.approx(math.sqrt(math.radians(2.0) * 25.0 / (9.80665 * 0.8)))
    assert planned_bank(route_requirements(corner(25.0, 0.0)), 1, 25.0) == 0.0


def test_a_circle_wider_than_the_bank_limits_takes_less_bank() -> None:
    setup = corner(25.0)
    wide = replace(setup, route=setup.route.with_fields(arc_radius=np.array([0.0, 300.0, 0.0])))
    assert planned_bank(route_requirements(wide), 1, 25.0) == pytest.approx(math.atan(25.0**2 / (9.80665 * 300.0)))


def slowed(setup: FlightSetup, speed: float, *, bank_deg: float = 0.0, load: float = 1.0) -> Track:
    """The setup's flight with three seconds at another airspeed, bank and load factor."""
    columns = copied(fly_path(setup))
    columns["airspeed"][1000:1180] = speed
    columns["attitude"][1000:1180, 0] = math.radians(bank_deg)
    columns["load_factor"][1000:1180] = load
    return Track(**columns)


@pytest.mark.parametrize(
    ("bank_deg", "load", "stall"),
    [
        (0.0, 1.0, 16.0),
        (25.0, 1.0, 16.0 / math.sqrt(math.cos(math.radians(25.0)))),
        # Beyond the bank limit guidance corrects for a moment: what it has to carry is the limit's.
        (33.0, 1.0, BANKED),
        (0.0, 1.3, 16.0 * math.sqrt(1.3)),
    ],
)
@pytest.mark.parametrize(("beyond", "ok"), [(-0.02, False), (0.02, True)])
def test_a_flown_airspeed_just_below_and_just_above_the_stall(
    bank_deg: float, load: float, stall: float, beyond: float, ok: bool
) -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300]])
    track = slowed(setup, stall - 0.2 + beyond, bank_deg=bank_deg, load=load)
    item = of(judge_flight(setup, track, "completed"), "stall", FLIGHT)
    assert item.ok is ok
    assert item.limit == pytest.approx(stall, abs=1e-3)
    assert item.flown == pytest.approx(stall - 0.2 + beyond, abs=1e-3)
    assert STALL_TOLERANCE_MPS == 0.2


def test_a_gust_of_a_moment_is_no_stall_and_turbulence_has_its_own() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300]])
    columns = copied(fly_path(setup))
    columns["airspeed"][1000:1006] = 14.9  # a tenth of a second of 60 rows
    assert of(judge_flight(setup, Track(**columns), "completed"), "stall").ok
    # Light turbulence: 15 % of the 7.7 m/s (15 kn) at 6 m more.
    gusty = make_setup([[0, 0, 300], [0, 2000, 300]], wind={"turbulence": "light"})
    for speed, ok in ((16.0 - 0.2 - 0.15 * 7.7 - 0.05, False), (16.0 - 0.2 - 0.15 * 7.7 + 0.05, True)):
        assert of(judge_flight(gusty, slowed(gusty, speed), "completed"), "stall").ok is ok


def test_what_is_not_known_is_not_said() -> None:
    unknown: Envelope = replace(envelope(), level_speed_min=np.full(3, math.nan))
    setup = corner(25.0, table=unknown)
    assert stall_findings(route_requirements(setup), None, geometric=True) == []
    assert stall_findings(route_requirements(setup), None) == []
    straight = make_setup([[0, 0, 300], [0, 2000, 300]])
    assert stall_findings(route_requirements(straight), None, geometric=True) == []
    # By flown evidence alone the aircraft's envelope says nothing.
    judged = judge_flight(straight, slowed(straight, 15.2), "completed", envelope=False)
    assert "stall" not in {item.rule for item in judged.findings}


def test_in_wind_the_bank_limit_holds_on_the_way_downwind() -> None:
    scenario = make_scenario(CORNER, wind={"speed_mps": 8.0, "from_deg": 180.0})
    requirements = route_requirements(make_setup(CORNER, scenario=scenario))
    assert planned_bank(requirements, 1, 25.0) == pytest.approx(math.radians(30.0))


@pytest.mark.parametrize(("speeds", "at"), [([18.0, 20.0, 25.0, 25.0], 1), ([25.0, 25.0, 20.0, 18.0], 3)])
def test_the_turn_with_the_least_margin_is_told(speeds: list[float], at: int) -> None:
    """Three right angles: each at the slower of its legs' airspeeds, on the arc of the faster."""
    square = [[0, 0, 300], [0, 2000, 300], [2000, 2000, 300], [2000, 4000, 300], [4000, 4000, 300]]
    item = of(judge_geometry(make_setup(square, speeds=speeds)), "stall", FLIGHT)
    bank = math.atan(math.tan(math.radians(30.0)) * (18.0 / 20.0) ** 2)
    assert item.planned == 18.0
    assert item.limit == pytest.approx(16.0 / math.sqrt(math.cos(bank)), abs=1e-3)
    assert f"18.0 m/s at waypoint {at}; the stall speed" in item.reason


def test_the_moment_of_the_least_margin_is_told() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300]])
    columns = copied(fly_path(setup))
    columns["airspeed"][1000:1180] = 20.0
    columns["airspeed"][3000:3120] = 17.0
    item = of(judge_flight(setup, Track(**columns), "completed"), "stall")
    assert (item.flown, item.margin) == (pytest.approx(17.0), pytest.approx(1.0))
    # The first mean that lies within rows 3,000 to 3,119; half of its rows later is its middle.
    moment = float(item.reason.split("at ")[1].split(" s")[0])
    assert 3000 / 60.0 <= moment <= 3120 / 60.0
