"""PX4 as an autopilot: its settings from a scenario, what a verdict asks of it, and a flight that ends at the gate."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import Aircraft
from flight.autopilots.catalog import load_autopilot
from flight.autopilots.parts import MissionParts
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.autopilots.px4_sitl.autopilot import Px4Sitl
from flight.autopilots.px4_sitl.parameters import FLYING
from flight.mission.return_path import ReturnPoint, choose_target
from flight.simulation.simulate import Flight, fly_to_end
from tests.setups import MakeSetup
from world.errors import ScenarioError
from world.scenario import load_scenario, with_flight
from world.scenario_tables import Px4Version


def test_a_scenario_names_it_and_its_version(aerosonde: Aircraft) -> None:
    tight = load_scenario("tight")
    newest = load_autopilot(with_flight(tight, autopilot="px4"), aerosonde)
    older = load_autopilot(with_flight(tight, autopilot="px4", px4_version="1.16"), aerosonde)
    assert newest.turns.acceptance_radius == 10.0
    assert older.turns.acceptance_radius == pytest.approx(56.0)
    assert "the simulated PX4 1.17 with its default parameters (NAV_ACC_RAD 10 m" in newest.describe("aerosonde")
    with pytest.raises(ScenarioError, match='px4_version: only a key of autopilot = "px4", not of "planfly"'):
        with_flight(tight, px4_version="1.16")


def test_a_plan_states_the_version_that_it_is_for() -> None:
    stated = with_flight(load_scenario("tight"), autopilot="px4").to_json()["flight"]
    assert (stated["autopilot"], stated["px4_version"]) == ("px4", "1.17")
    assert "px4_version" not in load_scenario("jacksboro-air").to_json()["flight"]


def test_parameters_alone_are_of_the_autopilot_that_the_scenario_names(aerosonde: Aircraft, tmp_path: Path) -> None:
    file = tmp_path / "mine.params"
    file.write_text("NAV_ACC_RAD 40\n", encoding="utf-8")
    named = with_flight(load_scenario("tight"), autopilot="px4", px4_version="1.16")
    made = load_autopilot(with_flight(named, params=str(file)), aerosonde)
    assert isinstance(made, Px4)
    assert (made.parameters["NAV_ACC_RAD"], made.parameters.version) == (40.0, "1.16")


NEAREST = "the nearest available release"


@pytest.mark.parametrize(
    ("version", "named", "flown", "note"),
    [
        ("1.16.0 ", None, "1.16", ""),
        ("1.16.1 stable", None, "1.16", ""),
        ("1.17.0", None, "1.17", ""),
        (
            "1.15.4 stable",
            None,
            "1.16",
            f"was written for PX4 1.15 (Version: 1.15), but PX4 1.16 is simulated, {NEAREST}",
        ),
        ("1.18.0 dev", None, "1.17", f"was written for PX4 1.18 (Version: 1.18), but PX4 1.17 is simulated, {NEAREST}"),
        ("1.16.0", "1.17", "1.17", "was written for PX4 1.16 (Version: 1.16), but PX4 1.17 is simulated, as requested"),
        ("unknown", None, "1.17", ""),
    ],
)
def test_the_head_of_a_parameter_file_selects_the_release(
    version: str, named: Px4Version | None, flown: str, note: str, aerosonde: Aircraft, tmp_path: Path
) -> None:
    """As QGroundControl writes it."""
    file = tmp_path / "mine.params"
    head = f"# Onboard parameters for Vehicle 1\n#\n# Stack: PX4 Pro\n# Vehicle: Fixed Wing\n# Version: {version}\n"
    file.write_text(f"{head}1\t1\tNAV_ACC_RAD\t20\t9\n", encoding="utf-8")
    scenario = with_flight(load_scenario("tight"), autopilot="px4", params=str(file), px4_version=named)
    made = load_autopilot(scenario, aerosonde)
    assert made.version == flown
    assert isinstance(made, Px4)
    program = Px4Sitl.with_model(made, Path("px4"))
    for copy in (made, made.with_parameters(NAV_ACC_RAD=30.0), made.with_release("1.17"), program, program.model):
        assert copy.checks.parameter_notes == ((f"{file} {note}",) if note else ())
    # A plan states the release only if the file does not decide it.
    assert scenario.flight.with_stated_defaults().px4_version == named


def test_it_turns_earlier_in_thin_air_up_to_1_16(aerosonde: Aircraft) -> None:
    older, newer = (Px4(Px4Parameters.load(aerosonde, None, version)) for version in ("1.16", "1.17"))
    # 2.24 s of the true airspeed, which at 2,000 m is 1.1029 of the equivalent one (ISO 2533: 1.0066 kg/m^3).
    assert older.turns.distance(1.0, 2000.0) == pytest.approx(56.0 * (1.2250 / 1.0066) ** 0.5, rel=1e-3)
    assert newer.turns.distance(1.0, 2000.0) == 10.0


def test_its_acceptance_radius_grows_with_the_ground_speed_up_to_1_16() -> None:
    """2.24 s (0.32 of a period of 10 s damped by 0.7): at 27.3 and 7.4 m/s, and never below NAV_ACC_RAD."""
    older, newer = (
        Px4(Px4Parameters.defaults(version)).with_parameters(NAV_ACC_RAD=15.0) for version in ("1.16", "1.17")
    )
    assert older.turns.radii_at is not None
    assert older.turns.radii_at(np.array([27.3, 7.4, 2.0])).tolist() == pytest.approx([61.152, 16.576, 15.0])
    assert newer.turns.radii_at is None


def test_speeds_beyond_its_limits_are_flown_at_them() -> None:
    made = Px4(
        Px4Parameters.from_text("FW_AIRSPD_MIN 18\nFW_AIRSPD_MAX 31\nFW_AIRSPD_TRIM 25\nFW_R_LIM 40\n", "a.params")
    )
    assert made.speeds.flown_airspeeds(np.array([10.0, 20.0, 40.0]), 25.0).tolist() == [18.0, 20.0, 31.0]
    assert made.speeds.limits is not None
    assert made.speeds.limits.nearest
    assert made.checks.dialect == "px4"
    assert made.stated_value(made.speeds.cruise_parameter) == 25.0
    assert made.stated_value(made.turns.bank_parameter) == 40.0
    assert made.turns.max_bank == pytest.approx(np.radians(40.0))
    assert (made.returns.rules.height, made.returns.rules.radius) == (100.0, 80.0)


@pytest.mark.parametrize(
    ("kind", "name", "up"),
    [
        # Home is 1 km away at 300 m, the rally point 3 km at 450 m; RTL_RETURN_ALT 120 is over either.
        ("", "rally point 1", 450.0),
        ("RTL_TYPE 0", "home", 300.0),
        ("RTL_TYPE 1", "rally point 1", 450.0),
        ("RTL_TYPE 5", "rally point 1", 450.0),
        ("RTL_TYPE 3", "home", 300.0),
    ],
)
def test_where_it_returns_to_is_by_its_type(kind: str, name: str, up: float) -> None:
    rules = Px4(Px4Parameters.from_text(f"RTL_RETURN_ALT 120\n{kind}\n", "a.params")).returns.rules
    home, rally = ReturnPoint(0.0, 0.0, 300.0), ReturnPoint(0.0, 4000.0, 450.0)
    # It begins lower, and climbs first; it begins higher, and stays there until it descends to RTL_DESCEND_ALT 100.
    low, high = (choose_target(rules, (0.0, 1000.0, begin), home, [rally]) for begin in (350.0, 800.0))
    assert (low.name, low.transit_altitude, low.position[2]) == (name, up + 120.0, up + 100.0)
    assert (high.name, high.transit_altitude, high.position[2]) == (name, 800.0, up + 100.0)
    assert choose_target(rules, (0.0, 1000.0, 800.0), home, []).name == "home"
    assert bool(rules.deviation_note) is (kind == "RTL_TYPE 3")


def test_what_px4s_own_program_flies_leaves_no_verdict_open() -> None:
    values = {"FW_T_F_ALT_ERR": 20.0, "WEIGHT_BASE": 2.0, "RTL_LAND_DELAY": 5.0, "MIS_COMMAND_TOUT": 5.0}
    others = {"COM_FLT_TIME_MAX": 60.0, "ASPD_PRIMARY": 0.0, "NAV_MIN_GND_DIST": 9.0}
    made = Px4Parameters.defaults().changed(**values, **others)
    mission = MissionParts(returns=True, moves_payload=True)
    # It gets what begins with `FLYING`, and planfly's physics have no distance sensor.
    assert all(name.startswith(FLYING) for name in values)
    assert [text.split()[0] for text in Px4Sitl(made).checks.describe_unsimulated_settings(mission)] == [*others]
    left = [text.split()[0] for text in Px4(made).checks.describe_unsimulated_settings(mission)]
    assert sorted(left) == sorted(values | others)


@pytest.mark.parametrize(
    ("values", "fence_at_home", "words"),
    [
        # `GeofenceChecks::checkAndReport`: any action other than none, by default 2.
        (
            {},
            "outside an inclusion polygon",
            ["GF_ACTION 2 prevents arming, because home is outside an inclusion polygon"],
        ),
        ({"GF_ACTION": 1.0}, "outside", ["GF_ACTION 1 prevents arming, because home is outside"]),
        ({"GF_ACTION": 0.0}, "outside", []),
        ({}, "", []),
    ],
)
def test_a_home_beyond_the_missions_fence_leaves_the_verdict_open(
    values: dict[str, float], fence_at_home: str, words: list[str]
) -> None:
    made = Px4(Px4Parameters.defaults().changed(**values))
    mission = MissionParts(has_fence=True, fence_at_home=fence_at_home)
    assert made.checks.describe_unsimulated_settings(mission) == words


@pytest.mark.parametrize(
    ("values", "has_fence", "opens"),
    [
        ({"GF_PREDICT": 1.0}, True, True),
        ({"GF_PREDICT": 1.0}, False, False),
        ({"GF_PREDICT": 1.0, "GF_ACTION": 1.0}, True, False),  # a warning
        ({}, True, False),
    ],
)
def test_a_predicted_breach_of_the_missions_fence_leaves_the_verdict_open(
    values: dict[str, float], has_fence: bool, opens: bool
) -> None:
    """`Navigator::geofence_breach_check` up to 1.17."""
    made = Px4(Px4Parameters.defaults().changed(**values))
    assert [
        text.split()[0] for text in made.checks.describe_unsimulated_settings(MissionParts(has_fence=has_fence))
    ] == ["GF_PREDICT"] * opens


@pytest.mark.parametrize(
    ("values", "used"),
    [
        ({}, None),
        ({"COM_LOW_BAT_ACT": 2.0, "BAT1_CAPACITY": 4000.0, "BAT_CRIT_THR": 0.25}, 3000.0),
        ({"COM_LOW_BAT_ACT": 3.0}, float("nan")),  # by the voltage
        ({"COM_LOW_BAT_ACT": 0.0, "BAT1_CAPACITY": 4000.0}, None),
        # `Battery::determineWarning` tests the emergency threshold first.
        ({"COM_LOW_BAT_ACT": 3.0, "BAT1_CAPACITY": 4000.0, "BAT_EMERGEN_THR": 0.5}, 2000.0),
    ],
)
def test_a_critical_charge_leaves_the_mission_by_com_low_bat_act(values: dict[str, float], used: float | None) -> None:
    """`Failsafe::fromBatteryWarningActParam`: 2 lands and 3 returns at BAT_CRIT_THR."""
    found = Px4(Px4Parameters.defaults().changed(**values)).checks.battery_failsafes
    assert [one.used_charge for one in found] == pytest.approx([] if used is None else [used], nan_ok=True)


@pytest.mark.parametrize(
    ("version", "values", "acts"),
    [
        ("1.16", {"BAT1_CAPACITY": 5000.0}, True),
        ("1.17", {"BAT1_CAPACITY": 5000.0}, False),
        ("1.17", {"BAT1_CAPACITY": 5000.0, "COM_FLTT_LOW_ACT": 3.0}, True),
        ("1.16", {"BAT1_CAPACITY": 5000.0, "COM_FLTT_LOW_ACT": 1.0}, False),
        ("1.17", {"COM_FLTT_LOW_ACT": 3.0}, False),
    ],
)
def test_a_low_remaining_time_returns_by_default_in_1_16(
    version: Px4Version, values: dict[str, float], acts: bool
) -> None:
    """COM_FLTT_LOW_ACT is 3 by default in 1.16 and 0 in 1.17; without a capacity no remaining time is known."""
    failsafe = Px4(Px4Parameters.defaults(version).changed(**values)).checks.return_time_failsafe
    assert (failsafe is not None) is acts
    if failsafe is not None:
        assert (failsafe.time_factor, failsafe.time_margin, failsafe.initial_current) == (1.1, 100.0, 15.0)


def test_a_return_of_type_3_may_be_to_the_missions_landing() -> None:
    """`RTL::findRtlDestination` counts it for types 1 and 3."""
    for kind, may in ((0, False), (1, True), (3, True), (5, False)):
        made = Px4(Px4Parameters.defaults().changed(RTL_TYPE=float(kind)))
        assert made.returns.rules.may_use_landing == may


def test_too_high_at_the_last_waypoint_it_circles_down_to_it(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    # 100 m down in 1,000 m: 40 s at 25 m/s, in which 2 m/s take it 80 m; within 10 m it has arrived.
    setup = make_setup([[0, 0, 600.0], [0, 1000, 500.0]])
    law = Px4(Px4Parameters.load(aerosonde, None, "1.16"))
    flown = fly_to_end(Flight(replace(setup, autopilot=law), aerosonde))
    track = flown.track
    assert flown.ended == "completed"
    assert track.position[-1, 2] == pytest.approx(510.0, abs=0.5)
    # 90 m at 2 m/s, and some seconds behind the reference.
    assert 45.0 < track.time[-1] < 60.0
    assert np.degrees(np.abs(track.attitude[:, 0])).max() > 25.0
    quick = Px4(Px4Parameters.load(aerosonde, None, "1.16").changed(FW_T_SINK_R_SP=4.0, FW_T_HRATE_FF=1.0))
    down = fly_to_end(Flight(replace(setup, autopilot=quick), aerosonde)).track
    assert np.degrees(np.abs(down.attitude[:, 0])).max() < 5.0


def test_it_does_not_circle_at_the_end_for_ever(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    # 800 m down at 2 m/s take 400 s; it is over 300 s after it came there.
    setup = make_setup([[0, -11000, 1200.0], [0, 0, 1200.0], [0, 1000, 400.0]])
    flown = fly_to_end(Flight(replace(setup, autopilot=Px4(Px4Parameters.load(aerosonde, None, "1.16"))), aerosonde))
    assert flown.ended == "completed"
    assert flown.track.time[-1] == pytest.approx((12_000.0 - 60.0) / 26.4 + 300.0, abs=6.0)
    assert flown.track.position[-1, 2] > 500.0


def test_it_holds_a_leg_in_wind(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    setup = make_setup([[0, 0, 500.0], [0, 3000, 500.0]], wind=(8.0, 270.0))
    track = fly_to_end(Flight(replace(setup, autopilot=Px4(Px4Parameters.load(aerosonde))), aerosonde)).track
    late = track.time > 40.0
    assert np.abs(track.position[late, 0]).max() < 5.0


@pytest.mark.parametrize(("version", "least", "most"), [("1.16", 0.0, 0.5), ("1.17", 3.0, 8.0)])
def test_the_wind_is_held_by_the_true_airspeed_and_from_1_17_on_by_the_equivalent_one(
    make_setup: MakeSetup, aerosonde: Aircraft, version: Px4Version, least: float, most: float
) -> None:
    # At 3,000 m 25 m/s are 29.0 true.  Of a wind of 12 m/s across asin(12 / 25) = 28.7 degrees are held, not 24.4: the
    # track is off by what brings 4.2 degrees back, some 5 m.
    setup = make_setup([[0, 0, 3000.0], [0, 4000, 3000.0]], wind=(12.0, 270.0))
    track = fly_to_end(
        Flight(replace(setup, autopilot=Px4(Px4Parameters.load(aerosonde, None, version))), aerosonde)
    ).track
    off = abs(float(np.median(track.position[track.time > 60.0, 0])))
    assert least <= off < most
