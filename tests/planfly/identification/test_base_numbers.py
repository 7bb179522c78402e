"""Numbers off a JSBSim model are those of the book that it was written from."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

import planfly
from aircraft.catalog import Aircraft, load_aircraft, read_aircraft
from aircraft.identification.electric_motor import ElectricMotor
from aircraft.identification.motor_table import MotorTable
from aircraft.identification.parameters import prior_means
from aircraft.identification.performance import performance
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import steady_flight
from planfly.identification.base_numbers import base_model, is_flying_wing, scale_base_model
from planfly.identification.model_text import format_identified_model
from tests.instrumented_flights import Truth, changed_aerosonde

# Beard and McLain, Small Unmanned Aircraft, second edition, appendix E.2.
BOOK = {
    "drag_zero": 0.043,
    "drag_elevator": 0.0135,
    "lift_zero": 0.23,
    "lift_alpha": 5.61,
    "lift_rate": 7.95,
    "lift_elevator": 0.13,
    "side_beta": -0.98,
    "side_aileron": 0.075,
    "side_rudder": 0.19,
    "roll_beta": -0.13,
    "roll_roll": -0.51,
    "roll_yaw": 0.25,
    "roll_aileron": 0.17,
    "roll_rudder": 0.0024,
    "pitch_zero": 0.0135,
    "pitch_alpha": -2.74,
    "pitch_rate": -38.21,
    "pitch_elevator": -0.99,
    "yaw_beta": 0.073,
    "yaw_roll": 0.069,
    "yaw_yaw": -0.095,
    "yaw_aileron": -0.011,
    "yaw_rudder": -0.069,
}


def test_the_aerosondes_are_the_books() -> None:
    numbers = base_model(load_aircraft("aerosonde"))
    for name, value in BOOK.items():
        assert getattr(numbers.coefficients, name) == pytest.approx(value, rel=1e-4), name
    assert numbers.inertia == pytest.approx((0.8244, 1.135, 1.759, 0.1204), rel=1e-4)
    motor = numbers.motor
    assert isinstance(motor, ElectricMotor)
    assert (motor.resistance, motor.idle_current) == (pytest.approx(0.042), pytest.approx(1.5))
    assert motor.back_voltage == pytest.approx(60.0 / (2.0 * 3.14159265 * 145.0), rel=1e-6)


def test_a_changed_aircraft_gives_changed_numbers(tmp_path: Path) -> None:
    truth = Truth(lift_slope=0.9, lift_offset=0.05, thrust=0.8, motor_speed=1.1, zero_lift_drag=1.5, pitch_offset=0.01)
    numbers = base_model(changed_aerosonde(tmp_path / "own", truth))
    c = numbers.coefficients
    assert (c.lift_alpha, c.lift_zero) == (pytest.approx(5.049, rel=1e-3), pytest.approx(0.28, rel=1e-3))
    assert (c.drag_zero, c.pitch_zero) == (pytest.approx(0.0645, rel=1e-3), pytest.approx(0.0235, rel=1e-3))
    assert isinstance(numbers.motor, ElectricMotor)
    assert numbers.motor.back_voltage == pytest.approx(0.0658572 / 1.1, rel=1e-5)
    assert (numbers.motor.resistance, numbers.motor.idle_current) == (pytest.approx(0.042), pytest.approx(1.5))


def test_scaling_takes_mass_and_lengths() -> None:
    base = base_model(load_aircraft("aerosonde"))
    made = scale_base_model(base, 22.0, 2.0 * base.span, 2.0 * base.area)
    assert made.inertia[0] == pytest.approx(8.0 * base.inertia[0], rel=1e-6)
    assert made.chord == pytest.approx(base.chord)


def test_a_stubbier_wing_has_more_induced_drag() -> None:
    """Over pi e AR: twice the area at the same span is half the aspect ratio, and twice the drag; not at twice both."""
    base = base_model(load_aircraft("aerosonde"))
    own = base.coefficients.drag_induced
    assert scale_base_model(base, 11.0, base.span, 2.0 * base.area).coefficients.drag_induced == pytest.approx(
        2.0 * own
    )
    assert scale_base_model(base, 11.0, 2.0 * base.span, 4.0 * base.area).coefficients.drag_induced == pytest.approx(
        own
    )
    assert scale_base_model(base, 11.0, base.span, base.area).coefficients == base.coefficients


@pytest.mark.parametrize("name", ["ultrastick25e", "c172x"])
def test_a_motor_of_another_form_becomes_tables(name: str) -> None:
    """In level flight at cruise, the thrust of the tables carries the drag, and their power is JSBSim's."""
    aircraft = load_aircraft(name)
    numbers = base_model(aircraft)
    assert isinstance(numbers.motor, MotorTable)
    fdm = Fdm(aircraft)
    trim = steady_flight(fdm, aircraft.airspeed, 500.0)
    assert trim is not None
    fdm.apply_trim(trim.vector())
    flow = np.full(1, aircraft.airspeed), np.full(1, trim.throttle), np.full(1, numbers.motor.density)
    thrust, current = numbers.motor.thrust_and_current(*flow)
    pounds = sum(fdm.properties.getter(f"forces/fb{axis}-aero-lbs")() * weight for axis, weight in _along(trim.alpha))
    # Linear interpolation in the tables is within 2 %.
    assert float(thrust[0]) * math.cos(trim.alpha) == pytest.approx(-pounds * 4.448222, rel=0.02)
    assert float(current[0]) * max(1.0, numbers.motor.voltage) == pytest.approx(float(fdm.read().power), rel=0.02)


def _along(alpha: float) -> tuple[tuple[str, float], ...]:
    """Return the shares of the body axes' forces along the path of level flight."""
    return ("x", math.cos(alpha)), ("z", math.sin(alpha))


def test_an_identified_ultra_stick_without_a_log_flies_as_its_base(tmp_path: Path) -> None:
    """The tables in the identified model give the base's throttle and power in level flight."""
    base = load_aircraft("ultrastick25e")
    folder = tmp_path / "own"
    shutil.copytree(base.folder, folder)
    text = format_identified_model(base, "own", base_model(base), prior_means())
    (folder / "ultrastick25e.xml").unlink()
    (folder / "own.xml").write_text(text, encoding="utf-8")
    (folder / "ultrastick25e.toml").rename(folder / "own.toml")
    powers = []
    for aircraft in (base, read_aircraft(folder)):
        fdm = Fdm(aircraft)
        trim = steady_flight(fdm, base.airspeed, 500.0)
        assert trim is not None
        fdm.apply_trim(trim.vector())
        powers.append((trim.throttle, float(fdm.read().power)))
    assert powers[1] == pytest.approx(powers[0], rel=0.02)


# Beard and McLain, first edition, appendix E.1, with a span efficiency of 0.9, and Gryte et al. 2018 (x8_param.mat).
WINGS = {
    "zagi": {
        "drag_zero": 0.0254,
        "drag_induced": 1.0 / (math.pi * 0.9 * 1.4224**2 / 0.2589),
        "lift_least_drag": 0.0,
        "lift_zero": 0.09167,
        "lift_alpha": 3.5016,
        "lift_rate": 2.8932,
        "lift_elevator": 0.2724,
        "pitch_zero": -0.02338,
        "pitch_alpha": -0.5675,
        "pitch_rate": -1.399,
        "pitch_elevator": -0.3254,
        "roll_roll": -0.3209,
        "roll_aileron": 0.1682,
        "side_beta": -0.07359,
        "side_roll": 0.0,
    },
    "x8": {
        "lift_zero": 0.0867,
        "lift_alpha": 4.0203,
        "lift_rate": 3.87,
        "lift_elevator": 0.2781,
        "pitch_zero": 0.0227,
        "pitch_alpha": -0.4629,
        "pitch_rate": -1.3012,
        "pitch_elevator": -0.2292,
        "side_beta": -0.2239,
        "side_roll": -0.1374,
        "side_yaw": 0.0839,
        "roll_roll": -0.4042,
        "roll_aileron": 0.1202,
    },
}


@pytest.mark.parametrize("name", WINGS)
def test_the_published_wings_are_bases_with_their_sources_numbers(name: str) -> None:
    aircraft = load_aircraft(name)
    numbers = base_model(aircraft)
    for field, value in WINGS[name].items():
        assert getattr(numbers.coefficients, field) == pytest.approx(value, rel=3e-3, abs=1e-6), field
    assert is_flying_wing(aircraft)
    assert not numbers.has_torque_reaction
    # Full throttle at cruise and sea level, N: 0.5 rho S C (20^2 - 15^2), and 0.5 rho S C 37.42 (37.42 - 18).
    disc = {"zagi": 0.0314 * 175.0, "x8": 0.1017876 * 0.248 * 37.42 * 19.42}[name]
    thrust, _ = numbers.motor.thrust_and_current(np.full(1, aircraft.airspeed), np.ones(1), np.full(1, 1.225))
    assert thrust[0] == pytest.approx(0.5 * 1.225 * disc, rel=1e-5)


def test_a_flying_wing_from_a_data_sheet_is_a_base_without_the_propellers_torque(tmp_path: Path) -> None:
    wing = planfly.new_aircraft(tmp_path / "foam", mass=2.1, span=1.6, cruise=15.0, stall=10.0, layout="wing")
    assert is_flying_wing(wing)
    assert not is_flying_wing(load_aircraft("aerosonde"))
    numbers = base_model(wing)
    assert not numbers.has_torque_reaction
    assert base_model(load_aircraft("aerosonde")).has_torque_reaction
    # The model that an estimate makes of it has none either, and flies level as the wing does.
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "mine.xml").write_text(
        format_identified_model(wing, "mine", numbers, prior_means()), encoding="utf-8"
    )
    shutil.copy(wing.folder / "foam.toml", tmp_path / "mine" / "mine.toml")
    before, after = (steady_flight(Fdm(one), 15.0, 500.0) for one in (wing, read_aircraft(tmp_path / "mine")))
    assert before is not None
    assert after is not None
    assert after.vector() == pytest.approx(before.vector(), abs=2e-3)


def test_the_battery_power_of_a_data_sheet_is_kept(tmp_path: Path) -> None:
    """Losses of a small drive and the avionics are in the numbers, and in the model written from them, as in JSBSim."""
    sheet = planfly.new_aircraft(tmp_path / "foam", mass=2.1, span=1.6, cruise=15.0, stall=10.0)
    numbers = base_model(sheet)
    motor = numbers.motor
    assert isinstance(motor, ElectricMotor)
    assert motor.power_ratio > 1.1
    assert motor.avionics > 1.0

    def power(aircraft: Aircraft) -> float:
        fdm = Fdm(aircraft)
        level = steady_flight(fdm, 15.0, 500.0)
        assert level is not None
        fdm.apply_trim(level.vector())
        return float(fdm.read().power)

    found = float(performance(numbers, prior_means(), 15.0, 1.1673).power[0])
    assert found == pytest.approx(power(sheet), rel=0.02)
    folder = tmp_path / "mine"
    shutil.copytree(sheet.folder, folder)
    (folder / "foam.toml").rename(folder / "mine.toml")
    (folder / "foam.xml").unlink()
    (folder / "mine.xml").write_text(format_identified_model(sheet, "mine", numbers, prior_means()), encoding="utf-8")
    assert power(read_aircraft(folder)) == pytest.approx(power(sheet), rel=0.02)
