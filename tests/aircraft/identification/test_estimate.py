"""An aircraft of known truth, flown and sensed, is found within its stated intervals."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.identification.draws import draw_aircraft
from aircraft.identification.estimate import (
    MIN_EXPLAINED,
    Equation,
    Estimate,
    _noise_bias,
    aligned_signals,
    fit_all,
    total_covariance,
)
from aircraft.identification.parameters import INDEX, NAMES, PARAMETERS
from aircraft.identification.performance import performance
from planfly.identification.base_numbers import scale_model
from tests.aircraft.identification.flown_truth import TRUTH, flown_truth

TRUE = np.array([TRUTH.parameters()[name] for name in NAMES])
DENSITY = 1.1695


def test_nearly_all_parameters_lie_within_two_standard_deviations_and_all_within_three() -> None:
    estimate = flown_truth().estimate
    off = np.abs(estimate.values - TRUE) / estimate.sds
    assert (off < 1.96).sum() >= 18, dict(zip(NAMES, off.round(1), strict=True))
    assert off.max() < 3.0, dict(zip(NAMES, off.round(1), strict=True))


def test_what_the_log_shows_is_found_closely() -> None:
    """Errors that a changed sign of any term, or clocks not aligned, would exceed.

    The rudder does what the ailerons do, times KFF_RDDRMIX: whose yaw it is, the log hardly tells.
    """
    estimate = flown_truth().estimate
    most = {
        "lift-slope": 0.15,
        "thrust": 0.06,
        "motor-speed": 0.05,
        "pitch-stiffness": 0.2,
        "elevator-power": 0.1,
        "roll-damping": 0.1,
        "aileron-power": 0.1,
        "weathercock": 0.15,
        "yaw-damping": 0.2,
        "rudder-power": 0.6,
        "yaw-from-roll": 0.3,
        "roll-from-yaw": 0.15,
        "dihedral-effect": 0.2,
    }
    off = {name: abs(float(estimate.values[INDEX[name]] - TRUE[INDEX[name]])) for name in most}
    assert {name: error for name, error in off.items() if error > most[name]} == {}
    assert all(equation.explained > 0.9 for equation in estimate.equations[1:])


def test_performance_is_found_with_the_batterys_current() -> None:
    flown = flown_truth()
    assert flown.estimate.with_current
    found = performance(flown.base, np.vstack([TRUE, flown.estimate.values]), 25.0, DENSITY)
    assert math.degrees(abs(found.climb[1] - found.climb[0])) < 0.7
    assert found.sink[1] == pytest.approx(found.sink[0], rel=0.08)
    assert found.power[1] == pytest.approx(found.power[0], rel=0.06)


def test_six_minutes_of_log_tell_the_climb_to_a_degree_and_a_half() -> None:
    """What is not known of battery and motor is in the thrust that was measured, and does not widen the climb's."""
    flown = flown_truth()
    drawn = performance(flown.base, draw_aircraft(flown.estimate), 25.0, DENSITY)
    low, high = np.degrees(np.percentile(drawn.climb, [2.5, 97.5]))
    truth = math.degrees(float(performance(flown.base, TRUE, 25.0, DENSITY).climb[0]))
    assert low < truth < high
    assert 0.2 < 0.5 * (high - low) < 1.2


def test_without_the_current_a_battery_that_is_not_the_stated_one_leaves_climb_and_sink() -> None:
    """Motor and voltage are seen together alone: what matters is the thrust that they make."""
    flown = flown_truth()
    unknown = np.full(len(flown.records[0].time), np.nan)
    records = [
        replace(record, current=unknown[: len(record.time)], voltage=unknown[: len(record.time)])
        for record in flown.records
    ]
    signals = aligned_signals(records, flown.estimate.clocks, flown.base)
    found = []
    for volts in (0.94, 1.0, 1.06):
        motor = replace(flown.base.motor, voltage=volts * flown.base.motor.voltage)
        base = replace(flown.base, motor=motor)
        values = fit_all(signals, base, dynamics=False).values
        found.append(performance(base, values, 25.0, DENSITY))
    for one in (found[0], found[2]):
        assert math.degrees(abs(float(one.climb[0] - found[1].climb[0]))) < 0.1
        assert one.sink[0] == pytest.approx(float(found[1].sink[0]), rel=0.02)


# Each with the standard deviation that it is changed by: one that goes is an interval that is too narrow.
REFITTED = {
    "lift of the elevator (50 %)",
    "lift of the pitch rate (50 %)",
    "side force of sideslip (30 %)",
    "side force of the rudder (50 %)",
    "side force of the ailerons (100 %)",
    "roll of the rudder (100 %)",
    "product of inertia (50 %)",
    "clock of the accelerometers (15 ms)",
    "clock of the servos (15 ms)",
    "airspeed (as the wind triangle has it)",
    "level of the autopilot (0.2 deg)",
    "mean vertical air (0.04 m/s)",
    "downward accelerometer (0.03 m/s2)",
    "noise of the accelerometers",
    "scale of the current (2 %)",
    "lift curve, axis 1",
    "lift curve, axis 2",
}


def test_each_thing_held_fixed_is_refitted_and_counts() -> None:
    shifts = flown_truth().estimate.shifts
    assert set(shifts) == REFITTED
    assert all(np.abs(shift).max() > 1e-3 for shift in shifts.values()), shifts


def test_refits_shift_by_what_plain_sums_say() -> None:
    """Sideslip is side force over its slope: 30 % more slope is 1 / 1.3 of the sideslip, and 1.3 times the dihedral."""
    estimate = flown_truth().estimate
    value, shift = estimate.values, estimate.shifts["side force of sideslip (30 %)"]
    for name in ("dihedral-effect", "weathercock"):
        assert shift[INDEX[name]] == pytest.approx(0.3 * value[INDEX[name]], rel=0.25), name
    # Faster by 1 %: 2 % more pressure, 2 % less of the coefficient of what it makes.
    faster = estimate.shifts["airspeed (as the wind triangle has it)"]
    _, sd = estimate.airspeed
    assert faster[INDEX["aileron-power"]] == pytest.approx(-2.0 * sd * value[INDEX["aileron-power"]], rel=0.5)
    for name in ("dihedral-effect", "weathercock"):
        assert estimate.sds[INDEX[name]] > 0.25 * value[INDEX[name]]


def test_what_noise_hides_is_what_as_much_again_hides_where_the_axis_is_still_explained() -> None:
    n, flat = len(PARAMETERS), np.zeros(2)

    def made(value: float, roll: float) -> Estimate:
        names = (("pitch acceleration", 0.9), ("roll acceleration", roll), ("yaw acceleration", 0.9))
        equations = tuple(Equation(name, "rad/s2", 25.0, flat, flat, share, 1.0) for name, share in names)
        return Estimate(np.full(n, value), np.eye(n), (), equations)

    hidden = _noise_bias(made(1.0, 0.7), made(0.8, MIN_EXPLAINED - 0.01))
    expected = {"pitch": -0.2, "yaw": -0.2, "roll": 0.0, "lift": 0.0, "drag": 0.0}
    assert hidden == pytest.approx([expected[parameter.group] for parameter in PARAMETERS])
    assert not _noise_bias(replace(made(1.0, 0.7), dynamics=False), made(0.8, 0.9)).any()


def test_what_noise_hides_is_given_back_to_the_moments() -> None:
    flown = flown_truth()
    nominal = fit_all(aligned_signals(flown.records, flown.estimate.clocks, flown.base), flown.base).values
    given = flown.estimate.values - nominal
    moments = np.array([parameter.group in ("pitch", "roll", "yaw") for parameter in PARAMETERS])
    shift = flown.estimate.shifts["noise of the accelerometers"]
    assert given == pytest.approx(np.where(moments, -shift, 0.0), abs=1e-9)
    assert np.abs(shift[moments]).max() > 1e-3


def test_an_interval_is_of_fit_and_shifts_and_none_wider_than_the_prior() -> None:
    n = len(PARAMETERS)
    shift = np.zeros(n)
    shift[INDEX["thrust"]] = 0.04
    shift[INDEX["adverse-yaw"]] = 9.0
    shift[INDEX["roll-damping"]] = 0.04
    sds = np.sqrt(np.diag(total_covariance(np.diag(np.full(n, 0.03**2)), {"one": shift})))
    assert sds[INDEX["thrust"]] == pytest.approx(0.05)
    assert sds[INDEX["roll-damping"]] == pytest.approx(0.1)  # a fast motion: twice
    assert sds[INDEX["adverse-yaw"]] == pytest.approx(0.6)  # the prior's
    assert sds[INDEX["lift-slope"]] == pytest.approx(0.03)


def test_a_mass_that_is_wrong_by_10_percent_leaves_the_climb() -> None:
    """Only thrust and drag over mass are seen: the angle stays, and the drag in newtons goes with the mass."""
    flown = flown_truth()
    heavy = scale_model(flown.base, 1.1 * flown.base.mass, flown.base.span, flown.base.area)
    changed = fit_all(aligned_signals(flown.records, flown.estimate.clocks, heavy), heavy)
    before = performance(flown.base, flown.estimate.values, 25.0, DENSITY)
    after = performance(heavy, changed.values, 25.0, DENSITY)
    assert math.degrees(abs(float(after.climb[0] - before.climb[0]))) < 0.4
