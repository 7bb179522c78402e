"""An aircraft of known truth, flown and sensed, is found within its stated intervals."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.identification.draws import draw_aircraft
from aircraft.identification.estimate import (
    combine_with_prior,
    fit_parameters,
    make_aligned_signals,
    total_covariance,
)
from aircraft.identification.parameters import INDEX, NAMES, PARAMETERS, prior_means
from aircraft.identification.performance import performance
from aircraft.identification.refinement import IS_MOMENT
from planfly.identification.base_numbers import scale_base_model
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
    signals = make_aligned_signals(records, flown.estimate.clocks, flown.base)
    found = []
    for volts in (0.94, 1.0, 1.06):
        motor = replace(flown.base.motor, voltage=volts * flown.base.motor.voltage)
        base = replace(flown.base, motor=motor)
        values = fit_parameters(signals, base, dynamics=False).values
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
    "lag of the servos (15 ms, at the same total delay)",
    "time ahead of the predictions (0.06 to 0.2 s shorter)",
    "time ahead of the predictions (0.1 to 0.2 s longer)",
    "lift curve, axis 1",
    "lift curve, axis 2",
}


def test_each_thing_held_fixed_is_refitted_and_counts() -> None:
    shifts = flown_truth().estimate.shifts
    assert set(shifts) == REFITTED
    assert all(np.abs(shift).max() > 1e-3 for shift in shifts.values()), shifts


def test_shifts_are_what_plain_sums_say() -> None:
    """Sideslip is side force over its slope: with 30 % more slope, to first order, 1 - 1 / 1.3 more of what it does."""
    estimate = flown_truth().estimate
    assert estimate.refinement is not None
    value, shift = estimate.values.copy(), estimate.shifts["side force of sideslip (30 %)"]
    value[IS_MOMENT] = estimate.refinement.values
    for name in ("dihedral-effect", "weathercock"):
        assert shift[INDEX[name]] == pytest.approx((1.0 - 1.0 / 1.3) * value[INDEX[name]], rel=0.1), name
    # Faster by 1 %: 2 % more pressure, 2 % less of the coefficient of what it makes.
    faster = estimate.shifts["airspeed (as the wind triangle has it)"]
    _, sd = estimate.airspeed
    assert faster[INDEX["aileron-power"]] == pytest.approx(-2.0 * sd * value[INDEX["aileron-power"]], rel=0.5)
    # Bayes' rule with the prior's deviation p leaves p s / hypot(p, s) of a deviation s, which includes the shift.
    # With a value of 1, a shift of 0.23 and a prior of 0.4, that is 0.20.
    for name in ("dihedral-effect", "weathercock"):
        k = INDEX[name]
        prior_sd, shifted = PARAMETERS[k].sd, abs(float(shift[k]))
        assert estimate.sds[k] >= 0.999 * prior_sd * shifted / np.hypot(prior_sd, shifted), name


def test_what_noise_hides_is_given_back_to_the_moments() -> None:
    flown = flown_truth()
    nominal = fit_parameters(make_aligned_signals(flown.records, flown.estimate.clocks, flown.base), flown.base)
    moments = np.array([parameter.group in ("pitch", "roll", "yaw") for parameter in PARAMETERS])
    shifts = flown.estimate.shifts
    shift = shifts["noise of the accelerometers"]
    covariance = total_covariance(nominal.covariance, shifts)
    given, _ = combine_with_prior(nominal.values - np.where(moments, shift, 0.0), covariance)
    assert flown.estimate.values == pytest.approx(given, abs=1e-9)
    assert np.abs(shift[moments]).max() > 1e-3


def test_an_interval_is_of_fit_and_shifts_and_none_wider_than_the_prior() -> None:
    n = len(PARAMETERS)
    shift = np.zeros(n)
    shift[INDEX["thrust"]] = 0.04
    shift[INDEX["roll-damping"]] = 0.04
    total = total_covariance(np.diag(np.full(n, 0.03**2)), {"one": shift})
    assert np.sqrt(total[INDEX["thrust"], INDEX["thrust"]]) == pytest.approx(0.05)
    assert np.sqrt(total[INDEX["roll-damping"], INDEX["roll-damping"]]) == pytest.approx(0.05)
    assert np.sqrt(total[INDEX["lift-slope"], INDEX["lift-slope"]]) == pytest.approx(0.03)


def test_moments_are_weighed_with_the_prior_by_the_whole_of_their_errors() -> None:
    """Two estimates of 0.4, one with an error of 0.1, one of 4, and a prior of 1 with 0.4 (Bayes' rule for numbers)."""
    n, sure, unsure = len(PARAMETERS), INDEX["roll-damping"], INDEX["aileron-power"]
    values, errors = prior_means(), np.full(n, 0.1)
    values[[sure, unsure]], errors[unsure] = 0.4, 4.0
    combined, covariance = combine_with_prior(values, np.diag(np.square(errors)))
    assert combined[sure] == pytest.approx(1.0 - 0.6 * 0.16 / 0.17)
    assert combined[unsure] == pytest.approx(1.0 - 0.6 * 0.16 / 16.16)
    assert np.sqrt(covariance[sure, sure]) == pytest.approx((1.0 / 0.1**2 + 1.0 / 0.4**2) ** -0.5)
    assert 0.39 < np.sqrt(covariance[unsure, unsure]) < 0.4
    # Drag and lift are not changed.
    assert covariance[INDEX["thrust"], INDEX["thrust"]] == pytest.approx(0.01)


def test_a_mass_that_is_wrong_by_10_percent_leaves_the_climb() -> None:
    """Only thrust and drag over mass are seen: the angle stays, and the drag in newtons goes with the mass."""
    flown = flown_truth()
    heavy = scale_base_model(flown.base, 1.1 * flown.base.mass, flown.base.span, flown.base.area)
    changed = fit_parameters(make_aligned_signals(flown.records, flown.estimate.clocks, heavy), heavy)
    before = performance(flown.base, flown.estimate.values, 25.0, DENSITY)
    after = performance(heavy, changed.values, 25.0, DENSITY)
    assert math.degrees(abs(float(after.climb[0] - before.climb[0]))) < 0.4
