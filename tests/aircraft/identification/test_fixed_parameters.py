"""What a base leaves out is not certain for that: its doubt is the Aerosonde's at least."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.identification.alignment import align
from aircraft.identification.base_model import BaseModel
from aircraft.identification.fixed_parameters import ACCELEROMETER_NOISE, FIXED_PARAMETERS, FixedParameter
from planfly.identification.base_numbers import base_model
from tests.aircraft.identification.flown_truth import flown_truth
from tests.aircraft.identification.made_signals import steady

# Half, or all, of what Beard and McLain have for the Aerosonde (table E.2).
MIN_SHIFTS = {
    "side force of the rudder": ("side_rudder", 0.5 * 0.19),
    "side force of the ailerons": ("side_aileron", 0.075),
    "roll of the rudder": ("roll_rudder", 0.0024),
}


def changed(title: str, base: BaseModel) -> BaseModel:
    (held,) = (held for held in FIXED_PARAMETERS if held.name.startswith(title))
    signals: Any = None
    return held.change(signals, base)[1]


@pytest.mark.parametrize("title", MIN_SHIFTS)
def test_a_coefficient_of_0_is_in_doubt(title: str) -> None:
    name, least = MIN_SHIFTS[title]
    base = base_model(load_aircraft("aerosonde"))
    for value, expected in ((0.0, least), (1e-6, 1e-6 + least)):
        flat = replace(base, coefficients=replace(base.coefficients, **{name: value}))
        assert getattr(changed(title, flat).coefficients, name) == pytest.approx(expected)
    # A large one by its share.
    large = replace(base, coefficients=replace(base.coefficients, **{name: -1.0}))
    share = 1.5 if name == "side_rudder" else 2.0
    assert getattr(changed(title, large).coefficients, name) == pytest.approx(-share)


def test_no_product_of_inertia_is_in_doubt() -> None:
    base = replace(base_model(load_aircraft("aerosonde")), inertia=(1.0, 2.0, 4.0, 0.0))
    assert changed("product of inertia", base).inertia == pytest.approx((1.0, 2.0, 4.0, 0.1))


def test_of_noise_there_is_as_much_again() -> None:
    """White noise of 0.2 m/s^2 on a still accelerometer: as much is added to right and down, and none ahead."""
    flown = flown_truth()
    still = align(flown.records, flown.estimate.clocks, flown.base.motor_lag)
    noise = 0.2 * np.random.default_rng(7).standard_normal(still.acceleration.shape)
    (held,) = (held for held in FIXED_PARAMETERS if held.name == ACCELEROMETER_NOISE)
    noisier, base = held.change(replace(still, acceleration=noise), flown.base)
    added = noisier.acceleration - noise
    assert added.std(axis=0) == pytest.approx([0.0, 0.2, 0.2], rel=0.05)
    assert base is flown.base


def test_rising_air_tilts_a_slow_aircrafts_flow_more() -> None:
    """0.04 m/s are 0.09 degrees of the flow at 25 m/s, and 0.15 at 15."""
    flown = flown_truth()
    signals = align(flown.records, flown.estimate.clocks, flown.base.motor_lag)
    (held,) = (held for held in FIXED_PARAMETERS if held.name.startswith("mean vertical air"))
    for speed, degrees in ((25.0, 0.0917), (15.0, 0.1528)):
        at = replace(signals, airspeed=np.full_like(signals.airspeed, speed))
        assert np.degrees(held.tilt(at)) == pytest.approx(degrees, abs=1e-3)


def titled(title: str) -> FixedParameter:
    (held,) = (held for held in FIXED_PARAMETERS if held.name.startswith(title))
    return held


@pytest.mark.parametrize(
    ("title", "field", "factor"),
    [
        ("lift of the elevator", "lift_elevator", 1.5),
        ("lift of the pitch rate", "lift_rate", 1.5),
        ("side force of sideslip", "side_beta", 1.3),
        ("side force of the rudder", "side_rudder", 1.5),
        ("side force of the ailerons", "side_aileron", 2.0),
        ("roll of the rudder", "roll_rudder", 2.0),
    ],
)
def test_a_coefficient_is_in_doubt_by_the_share_that_is_said(title: str, field: str, factor: float) -> None:
    base = base_model(load_aircraft("aerosonde"))
    made = changed(title, base)
    assert getattr(made.coefficients, field) == pytest.approx(factor * getattr(base.coefficients, field))
    assert replace(made.coefficients, **{field: getattr(base.coefficients, field)}) == base.coefficients
    assert f"({100.0 * (factor - 1.0):.0f} %)" in titled(title).name


def test_a_product_of_inertia_is_in_doubt_by_half_of_it() -> None:
    base = replace(base_model(load_aircraft("aerosonde")), inertia=(1.0, 2.0, 4.0, -1.0))
    assert changed("product of inertia", base).inertia == pytest.approx((1.0, 2.0, 4.0, -1.5))


def test_sensors_are_in_doubt_by_what_is_said() -> None:
    base = base_model(load_aircraft("aerosonde"))
    still = replace(steady(current=10.0), airspeed_sd=0.013)
    moved = {one.name.split(" (")[0]: one.change(still, base)[0] for one in FIXED_PARAMETERS}
    assert moved["airspeed"].airspeed == pytest.approx(25.0 * 1.013)
    assert moved["scale of the current"].current == pytest.approx(10.2)
    assert moved["downward accelerometer"].acceleration[5].tolist() == pytest.approx([0.0, 0.0, 0.03])
    # The level's error shows as gravity ahead, too: 0.2 degrees of it.
    assert titled("level of").tilt(still) == pytest.approx(np.radians(0.2))
    assert moved["level of the autopilot"].acceleration[5, 0] == pytest.approx(9.80665 * np.radians(0.2))
    # A ramp of 1 a second, 15 ms late.
    ramp = np.arange(2000) / 50.0
    rising = replace(still, acceleration=np.column_stack([ramp] * 3), surfaces=np.column_stack([ramp] * 3))
    for title, name in (("clock of the accelerometers", "acceleration"), ("clock of the servos", "surfaces")):
        late = getattr(titled(title).change(rising, base)[0], name)
        assert late[100:, 1] == pytest.approx(ramp[100:] - 0.015)


def test_the_lag_of_the_servos_is_in_doubt_at_the_same_total_delay() -> None:
    base = base_model(load_aircraft("aerosonde"))
    still, time = steady(), np.arange(2000) / 50.0
    trade = titled("lag of the servos").change
    # A ramp of 1 a second is 50 ms late after a lag of 50 ms, and so it is after one of 65 ms 15 ms earlier.
    late = trade(replace(still, surfaces=np.column_stack([time] * 3)), base)[0].surfaces
    assert late[100:-10, 0] == pytest.approx(time[100:-10], abs=1e-3)
    # A step comes 1 - exp(-t / 0.05) after 50 ms of lag, and 1 - exp(-(t + 0.015) / 0.065) after the other.
    after = time - 10.0
    step = np.where(after > 0.0, 1.0 - np.exp(-np.clip(after, 0.0, None) / 0.05), 0.0)
    changed_step = trade(replace(still, surfaces=np.column_stack([step] * 3)), base)[0].surfaces[:, 2]
    rows = (after > 0.055) & (after < 0.3)
    assert changed_step[rows] == pytest.approx(1.0 - np.exp(-(after[rows] + 0.015) / 0.065), abs=0.02)
    assert np.abs(changed_step - step)[rows].max() > 0.03
