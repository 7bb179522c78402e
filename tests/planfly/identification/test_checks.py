"""What an estimate may not be, by name and in one line."""

from dataclasses import replace

import numpy as np
import pytest

from aircraft.identification.estimate import Estimate, estimate_model
from aircraft.identification.parameters import INDEX
from planfly.identification.checks import (
    check_battery,
    check_commands,
    check_estimate,
    check_power,
    estimate_mass_change,
)
from planfly.identification.records import flight_records
from planfly.identification.servos import read_servos
from tests.aircraft.identification.flown_truth import flown_truth
from tests.planfly.identification.test_records import PRIOR, changed
from world.errors import LogError

OUTPUTS = {"aileron": 1, "elevator": 2, "throttle": 3, "rudder": 4}


def refused(estimate: Estimate) -> str:
    with pytest.raises(LogError) as error:
        check_estimate(estimate, flown_truth().base, OUTPUTS, "a.BIN")
    assert "\n" not in str(error.value)
    return str(error.value)


def with_value(name: str, value: float) -> Estimate:
    estimate = flown_truth().estimate
    values = estimate.values.copy()
    values[INDEX[name]] = value
    return replace(estimate, values=values)


def test_a_good_estimate_passes() -> None:
    check_estimate(flown_truth().estimate, flown_truth().base, OUTPUTS, "a.BIN")


def test_a_servo_the_other_way_round_is_named_by_its_output() -> None:
    """The log of an aircraft whose SERVO1_REVERSED does not say what its linkage does."""
    flown = flown_truth()
    servos = dict(read_servos(PRIOR.folder / "ardupilot.toml"))
    servos["aileron"] = servos["aileron"].reversed
    records = [record.central_part(60.0) for record in flight_records(changed(), PRIOR, servos)]
    assert "output 1 seems reversed" in refused(estimate_model(records, flown.base))


def test_a_voltage_that_the_battery_does_not_have_is_refused() -> None:
    """The log has 44.4 V: 12 cells of 3.7 V. In tenths of a volt, or of one cell alone, it is another battery's."""
    record = flown_truth().records[0]
    check_battery([record], 44.4)
    check_battery([replace(record, voltage=np.full_like(record.voltage, np.nan))], 44.4)
    for factor, said in ((0.1, "4.44 V in flight"), (1.0 / 12.0, "3.7 V in flight"), (10.0, "444 V in flight")):
        with pytest.raises(LogError, match=f"v3-3.BIN: voltage: {said}: a battery of 44.4 V has 33.3..53.3 V"):
            check_battery([replace(record, voltage=factor * record.voltage)], 44.4)


def test_a_throttle_that_never_moves_is_refused() -> None:
    """A glider's throttle is 0 in all rows; a frozen column has another value."""
    record = flown_truth().records[0]
    check_commands([record])
    for throttle, said in (
        (0.0, "0 in all rows of the flight: the log holds no powered flight"),
        (0.6, "0.6 in all rows of the flight: it never moves"),
    ):
        controls = record.controls.copy()
        controls[:, 3] = throttle
        with pytest.raises(LogError, match=f"v3-3.BIN: throttle: {said}"):
            check_commands([replace(record, controls=controls)])


@pytest.mark.parametrize("name", ["elevator", "aileron"])
def test_a_surface_that_hardly_moves_in_turns_is_refused(name: str) -> None:
    """Radians read as degrees are 57 times too small; without turns, surfaces may rest."""
    record = flown_truth().records[0]
    controls = record.controls.copy()
    controls[:, ("elevator", "aileron").index(name)] *= np.pi / 180.0
    radians = replace(record, controls=controls)
    with pytest.raises(LogError, match=rf"v3-3.BIN: {name}: moves by \d\.?\d* deg in all: .*\(radians\?\)"):
        check_commands([radians])
    check_commands([replace(radians, attitude=np.zeros_like(record.attitude))])


def test_a_current_ten_times_too_large_or_too_small_is_refused() -> None:
    """The logged current is that of the aircraft; times 10, it is 10 times the current of the estimate."""
    flown = flown_truth()
    check_power(flown.estimate, flown.records, flown.base)
    for factor, said in ((10.0, r"(9\.\d|10|11) times"), (0.1, r"0\.(09\d?|1|11) times")):
        records = [replace(record, current=factor * record.current) for record in flown.records]
        with pytest.raises(LogError, match=rf"v3-3.BIN: current: .* A on average, {said} the current of"):
            check_power(flown.estimate, records, flown.base)


def test_an_estimate_at_its_bound_is_named() -> None:
    assert "thrust (thrust) = 2.10 is at its bound: allowed 0.3..2" in refused(with_value("thrust", 2.1))


def test_a_lift_curve_that_no_wing_has_is_refused() -> None:
    assert "lift slope 8.41 per rad: expected 3..7" in refused(with_value("lift-slope", 1.5))


def test_a_mass_that_changes_within_the_logs_is_refused() -> None:
    """By a plain sum: of a tenth less mass the angle from zero lift is a tenth less."""
    estimate, base = flown_truth().estimate, flown_truth().base
    lift, *others = estimate.equations
    c = base.coefficients
    slope = c.lift_alpha * estimate.values[INDEX["lift-slope"]]
    zero = -(c.lift_zero + estimate.values[INDEX["lift-offset"]]) / slope
    share = np.linspace(0.0, -0.3, len(lift.predicted))
    lighter = replace(lift, measured=lift.predicted + share * (lift.predicted - zero))
    changing = replace(estimate, equations=(lighter, *others))
    change, sd = estimate_mass_change(changing, base)
    assert change == pytest.approx(-0.3, abs=0.02)
    assert sd < 0.01
    assert "the mass seems to change by -29 % within the logs" in refused(changing)
    # This log of five and a half minutes tells no change of its own mass.
    change, sd = estimate_mass_change(estimate, base)
    assert abs(change) < 4.0 * sd


def test_under_10_hz_the_performance_alone_is_estimated() -> None:
    flown = flown_truth()
    slow = estimate_model([record.central_part(60.0) for record in flown.records], flown.base, dynamics=False)
    assert not slow.dynamics
    for name in ("roll-damping", "elevator-power", "yaw-damping", "pitch-offset"):
        assert slow.log_fractions()[INDEX[name]] == pytest.approx(0.0, abs=1e-9)
    assert slow.log_fractions()[INDEX["thrust"]] > 0.5
