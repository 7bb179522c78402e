"""Airspeed: commanded within the envelope; what was flown, and what a leg has no room for, is told."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import ROUTE, failing, judge, leg, of
from tests.mission_lines import setup_of, wp
from tests.synthetic import (
    envelope,
    fly_path,
    make_setup,
)

STRAIGHT = [[0, 0, 300], [0, 3000, 300], [0, 6000, 300]]


@pytest.mark.parametrize(
    ("speed", "ok", "limit"), [(31.9, True, 32.0), (32.1, False, 32.0), (16.1, True, 16.0), (15.9, False, 16.0)]
)
def test_the_commanded_speed_is_within_level_flight(speed: float, ok: bool, limit: float) -> None:
    setup = make_setup(STRAIGHT, airspeed=speed)
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        item = of(verdict, "speed", leg(0))
        assert (item.ok, item.limit, item.limit_source) == (ok, limit, "aircraft")
        assert item.margin == pytest.approx(min(speed - 16.0, 32.0 - speed))


@pytest.mark.parametrize(("off", "shown"), [(0.9, False), (-0.9, False), (1.1, True), (-1.1, True)])
def test_a_speed_off_its_command_is_told_and_no_fault(off: float, shown: bool) -> None:
    setup = make_setup(STRAIGHT)
    track = fly_path(setup, airspeed=lambda s: 0.0 * s + off)
    item = of(judge(setup, track), "speed", leg(0))
    assert item.ok
    assert item.flown == pytest.approx(25.0 + off, abs=0.01)
    assert [(fact.what, fact.unit) for fact in item.facts] == [("speed error", "m/s")]
    assert item.facts[0].value == pytest.approx(off, abs=0.01)
    assert ("off the commanded 25.0 m/s" in item.reason) is shown
    # It shows a limit only where the aircraft's are left out.
    assert (("speed", leg(0)) in failing(judge(setup, track, envelope=False))) is shown


def test_where_there_is_no_level_flight_no_speed_is_one_of_it() -> None:
    """As above an aircraft's ceiling, whether its limits are certain or not."""
    for sd in (0.0, 2.0):
        none = replace(envelope(), level_speed_max=np.full(3, np.nan), fastest_sd=sd)
        item = of(judge_geometry(make_setup(STRAIGHT, table=none)), "speed", leg(0))
        assert (item.ok, item.check) == (False, "")
        assert item.reason.startswith("the aircraft cannot fly level at 300 m AMSL")


def test_a_leg_that_climbs_to_where_there_is_no_level_flight_has_none() -> None:
    low = replace(envelope(), level_speed_max=np.array([32.0, 32.0, np.nan]))
    climb = [[0.0, 0.0, 900.0], [0.0, 9000.0, 1500.0]]
    item = of(judge_geometry(make_setup(climb, table=low)), "speed", leg(0))
    assert item.ok is False
    assert item.reason.startswith("the aircraft cannot fly level at 1500 m AMSL")


@pytest.mark.parametrize(("speed", "ok"), [(28.0, True), (30.0, None), (32.5, False), (16.5, True)])
def test_a_speed_within_what_is_not_known_is_undecided(speed: float, ok: bool | None) -> None:
    """32 m/s at most ± 2: 1.645 of those less is 28.7."""
    unsure = replace(envelope(), source="a data sheet", fastest_sd=2.0)
    setup = make_setup(STRAIGHT, airspeed=speed, table=unsure)
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        item = of(verdict, "speed", leg(0))
        assert (item.ok, item.check) == (ok, "unknown aircraft" if ok is None else "")
        assert verdict.undecided is (ok is None)
        if ok is None:
            told = "the maximum level speed according to a data sheet is 32.0 m/s TAS ± 2.0 m/s"
            assert item.reason.startswith(f"30.0 m/s TAS is commanded; {told}")
            assert (
                "airspeeds on 2 legs are too close to the limit to judge, because the aircraft's limits are uncertain"
                in verdict.headline
            )
            # What is suggested is sure: below 28.71 m/s by what suggestions keep clear of limits.
            ((change,),) = item.suggestions
            assert change.what == "airspeed"
            assert change.most is not None
            assert 27.5 < change.most < 28.71


def test_arduplane_takes_a_command_for_equivalent_airspeed() -> None:
    """At 1,000 m, 1.225 by 1.112 kg/m^3 (US Standard Atmosphere, 1976): 31 m/s are 32.5, above the fastest 32."""
    for up, ok in ((0.0, True), (1000.0, False)):
        points = [[e, n, up] for e, n, _ in STRAIGHT]
        made = make_setup(points, airspeed=31.0, terrain={"kind": "flat", "amsl_m": -400.0})
        setup = replace(made, autopilot=ArduPlane(ArduPilotParameters.defaults()))
        item = of(judge_geometry(setup), "speed", leg(0))
        true = 31.0 * math.sqrt(1.225 / (1.225 if up == 0.0 else 1.112))
        assert (item.ok, item.planned) == (ok, pytest.approx(true, rel=1e-3))
        assert of(judge_geometry(made), "speed", leg(0)).ok
        assert (f"31.0 m/s EAS ({true:.1f} m/s TAS) is commanded" in item.reason) is not ok


def test_each_leg_has_its_own() -> None:
    changed = make_setup(ROUTE, speeds=[25.0, 20.0, 25.0, 25.0])
    assert of(judge(changed, fly_path(changed)), "speed", leg(1)).flown == pytest.approx(20.0, abs=0.1)


@pytest.mark.parametrize(("run", "room"), [(638.0, True), (636.0, False), (300.0, False)])
def test_a_speed_that_the_leg_has_no_room_for_is_told(run: float, room: bool) -> None:
    """From 18 to 31 m/s at 0.5 m/s^2 takes 26 s, at 24.5 m/s on average 637 m; after 300 m, sqrt(18^2 + 300) m/s."""
    setup = make_setup([[0, 0, 300], [0, 1000, 300], [0, 1000 + run, 300], [0, 3000, 300]], speeds=[18.0, 31.0, 31.0])
    track = fly_path(setup, airspeed=lambda s: -1.3 * ((s > 1000.0) & (s < 1000.0 + run)))
    for verdict in (judge_geometry(setup), judge(setup, track)):
        item = of(verdict, "speed", leg(1))
        assert item.ok
        assert ("takes about 26 s and 637 m, but the leg has" in item.reason) is not room
        if run == 300.0:
            assert "about 25.0 m/s are reached" in item.reason
    if run == 300.0:
        flown = of(judge(setup, track), "speed", leg(1))
        assert flown.flown == pytest.approx(29.7, abs=0.05)
        assert "29.7 m/s reached; the leg is too short to hold it" in flown.reason


def test_a_leg_that_was_not_flown_is_not_judged(setup: FlightSetup) -> None:
    verdict = judge(setup, fly_path(setup, stop=3000.0))
    assert [of(verdict, "speed", leg(k)).ok for k in range(4)] == [True, True, None, None]


def test_wind_that_leaves_no_way() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [2000, 2000, 300]], wind={"speed_mps": 30.0, "from_deg": 0.0})
    verdict = judge_geometry(setup)
    assert ("speed", leg(0)) in failing(verdict)
    assert "the wind is too strong to hold the course of leg 0 at 25 m/s" in of(verdict, "speed", leg(0)).reason


def test_a_commanded_speed_that_is_not_held_fails(setup: FlightSetup) -> None:
    setup = make_setup(STRAIGHT)
    item = of(judge(setup, fly_path(setup, airspeed=lambda s: 0.0 * s - 4.0)), "speed", leg(0))
    assert item.ok is False
    assert item.reason.startswith("21.0 m/s held instead of the commanded 25.0 m/s")
    # A tenth of 25 m/s may be missing.
    assert (item.planned, item.limit_source, item.unit) == (25.0, "mission", "m/s")
    assert item.flown == pytest.approx(21.0, abs=0.01)
    assert item.limit == pytest.approx(22.5, abs=0.01)
    assert item.margin == pytest.approx(-1.5, abs=0.01)


def test_a_speed_that_is_raised_for_a_minimum_ground_speed_is_held() -> None:
    """33 m/s instead of 25 on legs with a minimum ground speed, by the mission or MIN_GROUNDSPEED; 17 are too slow."""
    plain = make_setup(STRAIGHT)
    law = ArduPlane(ArduPilotParameters.defaults().changed(AIRSPEED_MAX=40.0, MIN_GROUNDSPEED=20.0))
    by_mission = replace(plain, route=plain.route.with_fields(min_ground_speed=20.0))
    for setup, fast in ((plain, False), (by_mission, True), (replace(plain, autopilot=law), True)):
        for off, ok in ((8.0, fast), (-8.0, False)):
            track = fly_path(setup, airspeed=lambda s, off=off: 0.0 * s + off)
            assert of(judge(setup, track), "speed", leg(0)).ok is ok


@pytest.mark.parametrize(("max_airspeed", "held"), [(26.0, True), (31.0, False)])
def test_a_held_airspeed_is_compared_with_the_one_that_arduplane_accepts(max_airspeed: float, held: bool) -> None:
    """ArduPlane ignores a DO_CHANGE_SPEED above AIRSPEED_MAX (`Plane::do_change_speed`) and keeps 25 m/s."""
    made = make_setup(STRAIGHT, speeds=[25.0, 30.0], terrain={"kind": "flat", "amsl_m": -400.0})
    parameters = ArduPilotParameters.defaults().changed(AIRSPEED_MIN=18.0, AIRSPEED_MAX=max_airspeed)
    setup = replace(made, autopilot=ArduPlane(parameters))
    at_25 = fly_path(made, airspeed=lambda s: np.where(s > 3000.0, -5.0, 0.0))
    assert of(judge(setup, at_25), "speed", leg(1)).ok is held


def test_a_speed_that_is_taken_up_late_is_held() -> None:
    """The second half of a leg counts: 8 m/s too slow over the first 1,300 m of 3,000 are over by then."""
    setup = make_setup(STRAIGHT)
    for until, ok in ((1300.0, True), (2500.0, False)):
        track = fly_path(setup, airspeed=lambda s, until=until: -8.0 * (s < until))
        assert of(judge(setup, track), "speed", leg(0)).ok is ok


def test_parameters_that_do_not_fit_are_open_without_a_flight() -> None:
    """TRIM_THROTTLE 60 below THR_MIN 74: the throttle never comes down to what the airspeed needs."""
    made = make_setup(STRAIGHT)
    for values, open_ in (({"THR_MIN": 74.0, "TRIM_THROTTLE": 60.0}, True), ({"THR_MIN": 40.0}, False)):
        parameters = replace(ArduPilotParameters.defaults().changed(AIRSPEED_MAX=32.0, **values), source="a.param")
        setup = replace(made, autopilot=ArduPlane(parameters))
        verdict = judge_geometry(setup)
        assert verdict.undecided is open_, verdict.summary
        assert ("TRIM_THROTTLE 60 of the file is below THR_MIN 74 of the file" in verdict.headline) is open_
        assert not judge(setup, fly_path(setup)).undecided


def test_a_leg_that_is_too_steep_fails_by_its_slope_alone() -> None:
    """20 degrees of climb, and 5 m/s less than commanded, as an aircraft flies it at full throttle."""
    setup = make_setup([[0, 0, 300], [0, 3000, 1392]])
    verdict = judge(setup, fly_path(setup, airspeed=lambda s: 0.0 * s - 5.0))
    assert of(verdict, "slope", leg(0)).ok is False
    assert of(verdict, "speed", leg(0)).ok is True


@pytest.mark.parametrize(("speed", "demanded"), [(12.0, 16.0), (60.0, 24.0)])
def test_the_speed_that_is_demanded_is_judged_not_the_command(speed: float, demanded: float) -> None:
    """`do_change_speed` ignores a speed outside AIRSPEED_MIN..MAX; PX4 flies the nearest of its own limits."""
    setup = make_setup(STRAIGHT, airspeed=22.0)
    commanded = replace(setup, route=setup.route.with_fields(airspeed=speed))
    assert of(judge_geometry(commanded), "speed", leg(0)).ok is False
    ignoring = ArduPlane(ArduPilotParameters.defaults().changed(AIRSPEED_MIN=16.0, AIRSPEED_MAX=24.0))
    limiting = Px4(Px4Parameters.defaults().changed(FW_AIRSPD_MIN=16.0, FW_AIRSPD_MAX=24.0))
    for law, flown in ((ignoring, 22.0), (limiting, demanded)):
        made = replace(commanded, autopilot=law)
        factor = law.speeds.true_airspeed_factor(float(made.route.positions[:2, 2].mean()))
        item = of(judge_geometry(made), "speed", leg(0))
        assert item.planned == pytest.approx(flown * factor, abs=1e-6)
        assert item.reason.startswith(f"the mission commands {speed:g} m/s; ")
        assert item.ok


@pytest.mark.parametrize(
    ("lines", "stated", "airspeed", "source", "flown"),
    [
        ((), 25.0, 25.0, "the scenario or --airspeed sets 25 m/s", 22.0),
        ((), None, 25.0, "the aircraft's cruise speed is 25 m/s", 22.0),
        ((), 8.0, 8.0, "the scenario or --airspeed sets 8 m/s", 9.0),
        (("3 178 0 30 -1 0 0 0 0",), 25.0, 25.0, "item 2 commands 30 m/s", 22.0),
        (("3 178 0 30 -1 0 0 0 0",), 15.0, 15.0, "item 2 commands 30 m/s", 15.0),
    ],
)
def test_what_sets_an_airspeed_beyond_the_limits_is_named_and_the_flown_one_is_stated(
    lines: tuple[str, ...], stated: float | None, airspeed: float, source: str, flown: float
) -> None:
    """AIRSPEED_MIN is 9 m/s, AIRSPEED_MAX 22 m/s, to which `Plane::calc_airspeed_errors` limits every demand."""
    tables = {} if stated is None else {"flight": {"airspeed_mps": stated}}
    setup = setup_of(wp(0, 500, 80.0), *lines, wp(0, 2500, 80.0), home="36.5 -84.2 100", **tables)
    route = setup.route if lines else setup.route.with_fields(airspeed=airspeed)
    setup = replace(
        setup,
        route=route,
        limits=replace(setup.limits, airspeed=airspeed),
        autopilot=ArduPlane(ArduPilotParameters.defaults().changed(AIRSPEED_MIN=9.0, AIRSPEED_MAX=22.0)),
    )
    reason = of(judge_geometry(setup), "speed", leg(0)).reason
    limits = "AIRSPEED_MIN 9 to AIRSPEED_MAX 22 m/s"
    assert f"{source}; ArduPlane accepts {limits}, and flies {flown:g} m/s" in reason
