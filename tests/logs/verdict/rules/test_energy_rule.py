"""Energy: predicted from the envelope's power, flown from the record, both against the battery less its reserve."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.envelope import Envelope
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.dynamics.envelope_tables import load_envelope
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import steady_flight
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from logs.verdict.findings import Finding, make_finding
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.measures.route_requirements import air_climb_angle, predicted_energy, route_requirements
from logs.verdict.places import FLIGHT
from logs.verdict.suggestions import suggest_using_less_energy
from tests.logs.verdict.judging import failing, judge, of
from tests.mission_lines import setup_of, wp
from tests.synthetic import bank_radius, edited, fly_path, make_scenario, make_setup
from world.scenario import Scenario

AEROSONDE = load_aircraft("aerosonde")
ROUTE = [[0, 0, 500], [0, 3000, 500], [2000, 5000, 800], [2000, 8000, 500]]


def real_setup(*, table: Envelope | None = None, scenario: Scenario | None = None) -> FlightSetup:
    return make_setup(ROUTE, table=table or load_envelope(AEROSONDE), scenario=scenario)


@pytest.mark.parametrize("airspeed", [20.0, 25.0, 29.0])
@pytest.mark.parametrize("angle_deg", [-4.0, -2.0, 0.0, 2.0, 4.0])
def test_the_parabola_through_three_trims_is_the_trims_between_them(airspeed: float, angle_deg: float) -> None:
    fdm = Fdm(AEROSONDE)
    found = steady_flight(fdm, airspeed, 700.0, math.radians(angle_deg))
    assert found is not None
    fdm.apply_trim(found.vector())
    known = load_envelope(AEROSONDE).power(airspeed, 700.0, math.radians(angle_deg))
    # Idle is less than full by 300 to 800 W.
    assert known == pytest.approx(float(fdm.read().power), abs=10.0)


def test_prediction_and_flight_agree() -> None:
    setup = real_setup()
    predicted, peak = predicted_energy(route_requirements(setup))
    flown = fly_to_end(Flight(setup, AEROSONDE))
    item = of(judge_flight(setup, flown.track, flown.ended), "energy")
    assert item.planned == pytest.approx(predicted, abs=1e-5)
    assert item.flown is not None
    assert predicted == pytest.approx(item.flown, rel=0.06)
    assert peak == pytest.approx(float(np.percentile(flown.track.current, 95)), rel=0.1)
    assert "; predicted: " in item.reason


@pytest.mark.parametrize(("stop", "is_cut_short"), [(None, False), (4000.0, True)])
def test_a_flight_that_was_cut_short_is_compared_with_the_energy_of_the_whole_mission(
    stop: float | None, is_cut_short: bool
) -> None:
    setup = real_setup()
    item = of(judge(setup, fly_path(setup, stop=stop)), "energy")
    assert ("Wh for the whole mission" in item.reason) is is_cut_short


@pytest.mark.parametrize(("share", "action", "ok"), [(1.01, 1, True), (0.99, 1, False), (0.99, 0, True)])
def test_a_charge_at_which_arduplane_leaves_the_mission_fails(share: float, action: int, ok: bool) -> None:
    """BATT_LOW_MAH remains of BATT_CAPACITY (`AP_BattMonitor_Backend::update_failsafes`); 0 does nothing."""
    setup = replace(real_setup(), autopilot=ArduPlane(ArduPilotParameters.defaults()))
    needed, _ = predicted_energy(route_requirements(setup))
    charge = 1000.0 * needed / setup.envelope.volts
    text = f"BATT_CAPACITY {share * charge + 1500.0:.1f}\nBATT_LOW_MAH 1500\nBATT_FS_LOW_ACT {action}\n"
    # The second failsafe acts 100 mAh later.
    for later in ("", "BATT_CRT_MAH 1400\nBATT_FS_CRT_ACT 1\n"):
        law = ArduPlane(ArduPilotParameters.from_text(text + later, "mine.param"))
        item = of(judge_geometry(replace(setup, autopilot=law)), "energy")
        assert item.ok is ok
        assert (", but the flight needs" in item.reason) is not ok
        if action:
            assert item.limit == pytest.approx(share * needed, rel=1e-4)


@pytest.mark.parametrize(("share", "source"), [(0.99, "autopilot"), (1.01, "aircraft")])
def test_a_failsafe_that_acts_after_the_reserve_is_reached_is_no_limit(share: float, source: str) -> None:
    setup = real_setup()
    reserve_charge = 1000.0 * 0.8 * setup.battery / setup.envelope.volts
    text = f"BATT_CAPACITY {share * reserve_charge + 1500.0:.1f}\nBATT_LOW_MAH 1500\nBATT_FS_LOW_ACT 1\n"
    law = ArduPlane(ArduPilotParameters.from_text(text, "mine.param"))
    item = of(judge_geometry(replace(setup, autopilot=law)), "energy")
    assert item.limit_source == source
    assert item.limit == pytest.approx(min(share, 1.0) * 0.8 * setup.battery, rel=1e-4)


def test_a_voltage_at_which_arduplane_leaves_the_mission_is_said_not_to_be_judged() -> None:
    law = ArduPlane(ArduPilotParameters.from_text("BATT_LOW_VOLT 21\nBATT_FS_LOW_ACT 2\n", "mine.param"))
    item = of(judge_geometry(replace(real_setup(), autopilot=law)), "energy")
    assert item.ok
    assert "it is not judged whether BATT_LOW_VOLT 21 ends the mission" in item.reason


def test_a_battery_that_is_too_small_fails_before_the_flight_too() -> None:
    predicted, _ = predicted_energy(route_requirements(real_setup()))
    for battery, ok in ((predicted / 0.8 * 1.01, True), (predicted / 0.8 * 0.99, False)):
        item = of(judge_geometry(replace(real_setup(), battery=battery)), "energy")
        assert item.ok is ok
        assert item.limit == pytest.approx(0.8 * battery)
        assert ("battery" in [change.what for one in item.suggestions for change in one]) is not ok
        assert "peak current" in item.reason


def test_a_battery_with_less_than_its_reserve_left_fails(setup: FlightSetup) -> None:
    small = replace(setup, battery=30.0)
    verdict = judge(small, fly_path(small))
    assert failing(verdict) == {("energy", FLIGHT)}
    assert of(verdict, "energy").limit == pytest.approx(24.0)


@pytest.mark.parametrize(("flown", "ratio"), [(12.0, 1.25), (9.9, 1.04), (12.5, 1.57)])
def test_a_flight_that_ends_with_an_empty_battery_needs_what_is_predicted(flown: float, ratio: float) -> None:
    """The battery has 12.5 Wh, and 9.6 Wh are the limit; only an empty battery leaves the prediction of 15 Wh."""
    finding = make_finding(
        "energy", FLIGHT, ok=False, reason="", planned=15.0, flown=flown, limit=9.6, margin=9.6 - flown
    )
    requirements = route_requirements(replace(real_setup(), battery=12.5))
    [[_], [battery]] = suggest_using_less_energy(requirements, None, finding)
    assert (battery.what, battery.wanted) == ("battery", ratio)


def test_a_suggested_battery_holds_the_energy_that_may_be_needed() -> None:
    """A logarithm with a deviation of 0.25: 1.25 times exp(1.645 x 0.25) is 1.886; 0.8 times it is 1.207."""
    unsure = replace(load_envelope(AEROSONDE), source="a data sheet", power_sd=0.25)
    requirements = route_requirements(replace(real_setup(table=unsure), battery=12.5))
    for energy, ok, ratio in ((12.0, False, 1.89), (7.68, None, 1.21)):
        finding = make_finding("energy", FLIGHT, ok=ok, reason="", planned=energy, limit=9.6, margin=9.6 - energy)
        [[_], [battery]] = suggest_using_less_energy(requirements, None, finding)
        assert battery.wanted == ratio
    finding = make_finding("energy", FLIGHT, ok=None, reason="", planned=6.3, limit=9.6, margin=3.3)
    assert suggest_using_less_energy(requirements, None, finding) == ()


@pytest.mark.parametrize(("energy", "percents"), [(960.0, [99.0]), (970.0, [])])
def test_no_flight_is_shortened_to_nothing(energy: float, percents: list[float]) -> None:
    """100 times the limit of 9.6 Wh leave 1 % of the flight; 101 times round up to 100 %."""
    requirements = route_requirements(replace(real_setup(), battery=12.5))
    finding = make_finding("energy", FLIGHT, ok=False, reason="", planned=energy, limit=9.6, margin=9.6 - energy)
    *shorter_flights, [battery] = suggest_using_less_energy(requirements, None, finding)
    assert [change.wanted for [change] in shorter_flights] == percents
    assert battery.what == "battery"


def test_a_guessed_battery_is_not_judged() -> None:
    guess = replace(load_envelope(AEROSONDE), battery_guessed=True)
    # Neither a battery that would do nor one that would not.
    for battery in (1.0, 5000.0):
        setup = replace(real_setup(table=guess), battery=battery)
        flown = [judge(setup, fly_path(setup)), judge_geometry(setup)]
        for item in (of(verdict, "energy") for verdict in flown):
            assert (item.ok, item.margin) == (None, None)
            assert item.reason.startswith("the battery's capacity is a guess: give --battery")
    stated = make_scenario(ROUTE, battery_wh=1.0)
    assert of(judge_geometry(replace(real_setup(table=guess, scenario=stated), battery=1.0)), "energy").ok is False


@pytest.mark.parametrize(("share", "ok"), [(0.79 / 1.50871, True), (0.81 / 1.50871, None), (0.79, None), (0.81, False)])
def test_energy_within_what_is_not_known_is_undecided(share: float, ok: bool | None) -> None:
    """A logarithm with a deviation of 0.25: exp(1.645 x 0.25) is 1.50871."""
    unsure = replace(load_envelope(AEROSONDE), source="a data sheet", power_sd=0.25)
    setup = real_setup(table=unsure)
    used, _ = predicted_energy(route_requirements(setup))
    verdict = judge_geometry(replace(setup, battery=used / share))
    item = of(verdict, "energy")
    assert (item.ok, verdict.undecided) == (ok, ok is None)
    # The pessimistic end is always stated: a suggested battery holds it, also where the limit itself is exceeded.
    assert f"at most {1.50871 * used:.1f} Wh with 95 % probability, because the power is uncertain (from" in item.reason
    if ok is None:
        assert verdict.headline.startswith(
            "not judged in full: energy is too close to the limit to judge, because the aircraft's limits are uncertain"
        )


def test_a_headwind_takes_longer_and_a_slope_over_the_ground_is_steeper_in_it() -> None:
    calm, _ = predicted_energy(route_requirements(real_setup()))
    scenario = make_scenario(ROUTE, wind={"speed_mps": 8.0, "from_deg": 20.0})
    against, _ = predicted_energy(route_requirements(real_setup(scenario=scenario)))
    assert against > 1.2 * calm
    requirements = route_requirements(real_setup())
    assert air_climb_angle(requirements, 1, 25.0, 650.0) == pytest.approx(float(requirements.slopes[1]), abs=1e-3)


def test_what_is_not_known_is_not_judged() -> None:
    assert of(judge_geometry(make_setup(ROUTE)), "energy").ok is None
    fast = replace(real_setup(), route=real_setup().route.with_fields(airspeed=60.0))
    assert of(judge_geometry(fast), "energy").ok is None


def test_a_jump_without_end_needs_more_than_any_battery() -> None:
    """A square of 2 km flown 1, 2, 3, 4, 2, 3, 4: its round goes from 4 to 2, 3 and 4 again."""
    square = [[0, 0, 500], [0, 2000, 500], [2000, 2000, 500], [2000, 0, 500]]
    setup = make_setup([*square, *square[1:]], table=load_envelope(AEROSONDE))
    items = np.array([1, 2, 3, 4, 2, 3, 4])
    endless = replace(setup, route=replace(setup.route.with_fields(item=items), endless_jump=5), battery=1000.0)
    bounded = replace(setup, route=setup.route.with_fields(item=items), battery=1000.0)
    assert of(judge_geometry(bounded), "energy").ok
    item = of(judge_geometry(endless), "energy", FLIGHT)
    assert item.ok is False
    # Its legs are 2000 sqrt 2, 2000 and 2000 m, less what arcs of radius R cut off, 2 R tan(turn / 2) - R turn: of the
    # 135 degrees at 4, where it begins, half, of those at 2 and of the 90 at 3 all.
    radius, sharp, right = bank_radius(), math.radians(135.0), math.radians(90.0)
    cut = 1.5 * (2.0 * math.tan(sharp / 2.0) - sharp) + 2.0 * math.tan(right / 2.0) - right
    power = endless.envelope.power(25.0, 500.0, 0.0)
    round_energy = power * (2000.0 * math.sqrt(2.0) + 4000.0 - cut * radius) / 25.0 / 3600.0
    # The first round comes from 1, so that its first leg is 2000 m long, and its turn at 2 is a right angle.
    first_cut = 0.5 * (2.0 * math.tan(sharp / 2.0) - sharp) + 2.0 * (2.0 * math.tan(right / 2.0) - right)
    first_energy = power * (6000.0 - first_cut * radius) / 25.0 / 3600.0
    # Of 1000 Wh, 20 % are the reserve.
    repeats = math.floor((800.0 - first_energy) / round_energy)
    assert f" usable Wh, enough for {repeats + 1} rounds. Set its repeat count to {repeats}. Details: " in item.reason
    assert item.brief.startswith("the jump at item 5 repeats indefinitely")


def test_the_rounds_of_an_endless_jump_leave_the_rest_of_the_mission_and_the_reserve() -> None:
    """A mission with the stated count passes, and with one more it does not; its last leg is longer than a round."""

    def energy(count: int) -> Finding:
        square = [wp(0, 500), wp(0, 1500), wp(1000, 1500), wp(1000, 500)]
        setup = setup_of(*square, f"0 177 2 {count} 0 0 0 0 0", wp(-4000, -4000), home="36.5 -84.2 300")
        return of(judge_geometry(replace(setup, battery=200.0)), "energy")

    words = energy(-1).brief.split()
    count = int(words[-1])
    assert words[words.index("rounds.") - 1] == str(count + 1)
    assert count > 2
    assert energy(count).ok
    assert energy(count + 1).ok is False


def test_an_aircraft_that_burns_fuel_has_no_current() -> None:
    envelope = replace(load_envelope(AEROSONDE), volts=0.0)
    for verdict in (
        judge_geometry(real_setup(table=envelope)),
        judge_flight(real_setup(table=envelope), fly_to_end(Flight(real_setup(), AEROSONDE)).track, "completed"),
    ):
        reason = of(verdict, "energy").reason
        assert "of the fuel used" in reason
        assert "peak current" not in reason


def _energy_with(text: str, share: float = 0.5) -> Finding:
    """Judge the energy with parameters, of a battery whose share the flight needs."""
    setup = replace(real_setup(), autopilot=ArduPlane(ArduPilotParameters.from_text(text, "mine.param")))
    needed, _ = predicted_energy(route_requirements(setup))
    return of(judge_geometry(replace(setup, battery=needed / share)), "energy")


@pytest.mark.parametrize(("monitor", "ok"), [(3, True), (4, False), (6, True), (8, False)])
def test_a_monitor_of_the_voltage_alone_never_acts_by_the_charge(monitor: int, ok: bool) -> None:
    """`check_failsafe_types` asks `has_current`; 3 is "Analog Voltage Only", 6 the Bebop's."""
    text = f"BATT_MONITOR {monitor}\nBATT_CAPACITY 1000\nBATT_LOW_MAH 999\nBATT_FS_LOW_ACT 1\n"
    assert _energy_with(text).ok is ok


def test_a_further_battery_that_leaves_the_mission_leaves_the_energy_open() -> None:
    """The share of the charge that comes from each battery is not known."""
    text = "BATT_MONITOR 4\n{0}_MONITOR 4\n{0}_CAPACITY 1000\n{0}_CRT_MAH 999\n{0}_FS_CRT_ACT 1\n"
    for monitor in ("BATT2", "BATT3", "BATTA"):
        item = _energy_with(text.format(monitor))
        assert (item.ok, item.check) == (None, "not flown")
        assert f"{monitor}_CRT_MAH 999 acts after 1 mAh" in item.reason
    # The same values of a battery without a monitor, or without an action.
    assert _energy_with(text.format("BATT2").replace("BATT2_MONITOR 4", "BATT2_MONITOR 0")).ok
    assert _energy_with(text.format("BATT2").replace("ACT 1", "ACT 0")).ok


@pytest.mark.parametrize(
    ("values", "ok"),
    [
        # 44.4 V are 12 cells of 3.7 V: 3.6 V in each are 43.2 V.
        ("BATT_LOW_VOLT 42\nBATT_FS_LOW_ACT 1", True),
        ("BATT_LOW_VOLT 43.2\nBATT_FS_LOW_ACT 1", True),
        ("BATT_LOW_VOLT 43.8\nBATT_FS_LOW_ACT 1", None),
        ("BATT_LOW_VOLT 43.8\nBATT_FS_LOW_ACT 0", True),
        ("BATT_CRT_VOLT 43.8\nBATT_FS_CRT_ACT 2", None),
        # `update_failsafes` asks for a timer above 0.
        ("BATT_LOW_VOLT 43.8\nBATT_FS_LOW_ACT 1\nBATT_LOW_TIMER 0", True),
        ("BATT_MONITOR 3\nBATT_LOW_VOLT 43.8\nBATT_FS_LOW_ACT 1", None),
    ],
)
def test_a_voltage_that_a_healthy_battery_may_reach_leaves_the_energy_open(values: str, ok: bool | None) -> None:
    assert real_setup().envelope.volts == 44.4
    item = _energy_with(values + "\n")
    assert (item.ok, item.check) == (ok, "" if ok else "not flown")


@pytest.mark.parametrize(("threshold", "ok"), [(0.45, True), (0.55, None)])
def test_px4_without_a_capacity_reads_the_charge_from_the_voltage(threshold: float, ok: bool | None) -> None:
    """Half of the battery is left at the end."""
    made = Px4(Px4Parameters.defaults().changed(COM_LOW_BAT_ACT=3.0, BAT_CRIT_THR=threshold))
    setup = replace(real_setup(), autopilot=made)
    needed, _ = predicted_energy(route_requirements(setup))
    assert of(judge_geometry(replace(setup, battery=needed / 0.5)), "energy").ok is ok


def test_a_small_battery_is_said_with_its_digits(setup: FlightSetup) -> None:
    small = replace(setup, battery=5.55)
    assert " Wh of 5.55 Wh used" in of(judge(small, fly_path(small)), "energy").reason


def test_an_empty_battery_is_said_and_what_is_needed_follows_from_the_prediction(setup: FlightSetup) -> None:
    """At most 1.50871 times the prediction (a logarithm with a deviation of 0.25), not times what the battery had."""
    unsure = replace(load_envelope(AEROSONDE), source="a data sheet", power_sd=0.25)
    small = replace(real_setup(table=unsure), battery=20.0)
    predicted, _ = predicted_energy(route_requirements(small))
    track = fly_path(small)
    for used, is_empty in ((20.0005, True), (19.9, False)):
        energy = np.linspace(0.0, used, len(track), dtype=np.float32)
        item = of(judge(small, edited(track, energy=energy)), "energy")
        assert item.ok is False
        assert ("Wh of 20 Wh used, peak current" in item.reason, ": the battery is empty; " in item.reason) == (
            True,
            is_empty,
        )
        assert f"at most {1.50871 * (predicted if is_empty else used):.1f} Wh with 95 % probability" in item.reason


@pytest.mark.parametrize(
    ("share", "ok", "check"),
    [
        # exp(1.645 * 0.25) = 1.509: the flight may need so much more than predicted.
        (1.55, True, ""),
        (1.45, None, "unknown aircraft"),
        (0.95, False, ""),
    ],
)
def test_a_failsafe_that_an_uncertain_power_may_reach_leaves_the_energy_open(
    share: float, ok: bool | None, check: str
) -> None:
    """The limit is the charge of the failsafe, which acts before the reserve is reached."""
    unsure = replace(load_envelope(AEROSONDE), source="a data sheet", power_sd=0.25)
    setup = replace(real_setup(table=unsure), battery=4000.0, autopilot=ArduPlane(ArduPilotParameters.defaults()))
    needed, _ = predicted_energy(route_requirements(setup))
    capacity = 1500.0 + share * 1000.0 * needed / setup.envelope.volts
    text = f"BATT_CAPACITY {capacity:.3f}\nBATT_LOW_MAH 1500\nBATT_FS_LOW_ACT 1\n"
    law = ArduPlane(ArduPilotParameters.from_text(text, "mine.param"))
    item = of(judge_geometry(replace(setup, autopilot=law)), "energy")
    assert (item.ok, item.check) == (ok, check)
    assert item.limit == pytest.approx(share * needed, rel=1e-4)
    assert item.limit_source == "autopilot"
    # A larger battery changes nothing: the failsafe counts from BATT_CAPACITY.
    assert all(change.what == "duration" for suggestion in item.suggestions for change in suggestion)
    if ok is None:
        assert f"BATT_LOW_MAH 1500 acts after {share * needed:.1f} Wh" in item.reason
        assert item.suggestions
