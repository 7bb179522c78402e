"""Bound the information of logs of missions A and B on sink and power without the battery's current.

    python -m benchmarks.identification_information --seeds 7001 7002 7003

The Cramer-Rao bound with the priors of the identification (van Trees 1968, section 2.4.3): no estimate with these
priors can be more certain, by any method.  It is computed at the truth, for the forward force at each log's own
airspeeds and throttles, for three kinds of noise: of the accelerometers alone, with exactly known airspeed and angle of
attack; with the noise of the airspeed sensor; and with the model error that identification assumes.  Then with added
glides at idle
at cruise speed, and with the battery's current.
"""

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from aircraft.catalog import load_aircraft
from aircraft.identification.base_model import BaseModel
from aircraft.identification.drag import (
    FLOOR_SECONDS,
    FORCE_FLOOR,
    FORCE_THINNING,
    NUISANCES,
    AlphaUncertainty,
    ForwardForces,
    drag_priors,
    forward_forces,
)
from aircraft.identification.draws import draw_aircraft
from aircraft.identification.electric_motor import ElectricMotor
from aircraft.identification.estimate import Estimate, estimate_model, make_aligned_signals
from aircraft.identification.flight_record import GRID_HZ
from aircraft.identification.flow import flow_from_forces
from aircraft.identification.parameters import PARAMETERS
from aircraft.identification.performance import GRAVITY, performance
from benchmarks.identification import drawn_truth, fly_missions, true_values
from planfly.identification.base_numbers import base_model, scale_base_model
from planfly.identification.folder import DENSITY
from planfly.identification.records import flight_records
from planfly.identification.servos import read_servos
from tests.instrumented_flights import drawn_sensors, sensed
from world.arrays import Flags, Floats

# Cruise airspeed, m/s.
_CRUISE_MPS = 25.0
# Standard deviations of a two-sided 95 % interval.
_INTERVAL_SIGMAS = 1.96
# True for the parameters of drag.
_IS_DRAG_PARAMETER = np.array([parameter.group == "drag" for parameter in PARAMETERS])
# Noise of the accelerometers of `tests.instrumented_flights`, m/s^2 at 50 Hz.
_ACCELEROMETER_NOISE_MPS2 = 0.05
# Noise of the airspeed sensor, m/s at 10 Hz.
_AIRSPEED_NOISE_MPS = 0.08
# Noise of the current, A at 5 Hz.
_CURRENT_NOISE_A = 0.3
# Durations of the added glides, s.
GLIDES = (0, 20, 60, 120, 300)


def flown_as(base: BaseModel, values: Floats, unknown: Floats) -> Floats:
    """Return sink (rad), power (W) and climb (rad) at cruise for these unknowns.

    The unknowns include nuisance parameters.
    """
    own = int(_IS_DRAG_PARAMETER.sum())
    resistance, idle, voltage, elevator = unknown[own + 1 : own + 5]
    motor = base.motor.with_factors(resistance=1.0 + resistance, idle=1.0 + idle)
    assert isinstance(motor, ElectricMotor)
    c = base.coefficients
    changed = replace(
        base,
        motor=replace(motor, voltage=motor.voltage * (1.0 + voltage)),
        coefficients=replace(c, drag_elevator=c.drag_elevator * (1.0 + elevator)),
    )
    every = values.copy()
    every[_IS_DRAG_PARAMETER] = unknown[:own]
    made = performance(changed, every, _CRUISE_MPS, DENSITY)
    return np.concatenate([made.sink, made.power, made.climb])


def gradients(base: BaseModel, values: Floats, unknown: Floats) -> Floats:
    """Return the gradients (3, p) of `flown_as`, relative to sink and power, and of the climb in degrees."""
    step = 1e-4
    at = flown_as(base, values, unknown)
    rows = [(flown_as(base, values, unknown + step * one) - at) / step for one in np.eye(len(unknown))]
    units = np.array([at[0], at[1], np.radians(1.0)])
    return np.asarray(np.array(rows).T / units[:, np.newaxis])


def glide(base: BaseModel, values: Floats, seconds: float) -> ForwardForces:
    """Make a steady glide at idle and cruise speed, at the row rate of thinned signals."""
    count = max(2, round(seconds * GRID_HZ / FORCE_THINNING))
    flat = np.ones(count)
    signals: Any = SimpleNamespace(
        airspeed=_CRUISE_MPS * flat, throttle=0.0 * flat, density=DENSITY * flat, smooth=lambda series, band: series
    )
    c, pressure = base.coefficients, 0.5 * DENSITY * _CRUISE_MPS**2 * base.area
    lift = base.mass * GRAVITY / pressure * flat
    uncertainty = AlphaUncertainty()
    tilts = (
        pressure * lift * np.vstack([uncertainty.angle * flat, uncertainty.by_lift * (lift - uncertainty.mean_lift)])
    )
    drags = -pressure * np.vstack([c.drag_zero * flat, c.drag_induced * np.square(lift - c.lift_least_drag)])
    del values
    return ForwardForces(signals, base, 0.0 * flat, tilts, drags, 0.0 * flat, base.motor.voltage)


def information(forces: ForwardForces, unknown: Floats, noise: str, *, current: bool = False) -> Floats:
    """Return the Fisher information of a log about the p unknowns of `fit_drag`, (p, p).

    It is the information of the forward force, and of the current if `current` is True.

    noise: assumed noise: "accelerometers" alone; "sensors", with the airspeed sensor; or "model", with the model error
        that identification assumes.
    """
    rows, amperes = forces.slopes(unknown)
    step = 0.05
    signals: Any = forces.signals
    shifted: Any = SimpleNamespace(
        airspeed=signals.airspeed + step, throttle=signals.throttle, density=signals.density, smooth=signals.smooth
    )
    by_speed = replace(forces, signals=shifted).predict(unknown)[0] - forces.predict(unknown)[0]
    # Includes the drag of a gust: twice the relative change of the speed.
    drag = np.array(unknown[:2]) @ forces.drags / forces.base.mass
    by_speed = by_speed / step + 2.0 * drag / signals.airspeed
    variance = np.full(len(rows), _ACCELEROMETER_NOISE_MPS2**2)
    if noise != "accelerometers":
        variance += np.square(by_speed * _AIRSPEED_NOISE_MPS) * GRID_HZ / 10.0
    if noise == "model":
        variance += FORCE_FLOOR**2 * FLOOR_SECONDS * GRID_HZ
    made = FORCE_THINNING * (rows / variance[:, np.newaxis]).T @ rows
    if current:
        floor = _CURRENT_NOISE_A**2 * (FLOOR_SECONDS * GRID_HZ / FORCE_THINNING if noise == "model" else 1.0)
        made = made + amperes.T @ amperes / floor
    return np.asarray(made)


def halves(precision: Floats, slopes: Floats, known: Flags) -> dict[str, float]:
    """Return half the 95 % interval of sink and power, percent, and of the climb, degrees.

    precision: information with the prior, (p, p).
    slopes: gradients of sink, power and climb, (3, p), as from `gradients`.
    known: mask of the unknowns that are fixed at the truth, (p,).
    """
    inverse = np.zeros_like(precision)
    free = np.flatnonzero(~known)
    inverse[np.ix_(free, free)] = np.linalg.inv(precision[np.ix_(free, free)])
    sink, power, climb = _INTERVAL_SIGMAS * np.sqrt(np.einsum("ij,jk,ik->i", slopes, inverse, slopes))
    return {"sink_percent": 100.0 * sink, "power_percent": 100.0 * power, "climb_deg": float(climb)}


def stated(base: BaseModel, estimate: Estimate) -> dict[str, float]:
    """Return half the widths of the intervals that an estimate states."""
    best = performance(base, estimate.values, _CRUISE_MPS, DENSITY)
    drawn = performance(base, draw_aircraft(estimate), _CRUISE_MPS, DENSITY)
    ends = [np.percentile(values, [2.5, 97.5]) for values in (drawn.sink, drawn.power, np.degrees(drawn.climb))]
    sink, power, climb = (0.5 * float(high - low) for low, high in ends)
    return {
        "sink_percent": 100.0 * sink / float(best.sink[0]),
        "power_percent": 100.0 * power / float(best.power[0]),
        "climb_deg": climb,
    }


def one_seed(seed: int) -> dict[str, Any]:
    """Compute the intervals of one drawn aircraft for each kind of noise."""
    truth = drawn_truth(seed)
    values = true_values(truth)
    prior = load_aircraft("aerosonde")
    numbers = base_model(prior)
    base = scale_base_model(numbers, 11.0 * truth.mass, numbers.span, numbers.area)
    with tempfile.TemporaryDirectory() as place:
        tracks, changed = fly_missions(Path(place), truth, seed)
        logs = [sensed(track, changed, drawn_sensors(seed), seed + 100_000 * k) for k, track in enumerate(tracks)]
        servos = read_servos(prior.folder / "ardupilot.toml")
        records = [record for log in logs for record in flight_records(log, prior, servos)]
    estimate = estimate_model(records, base)
    signals = make_aligned_signals(records, estimate.clocks, base)
    forces = forward_forces(signals, base, values, flow_from_forces(signals, base, values), AlphaUncertainty())
    _, sds = drag_priors(with_current=False)
    unknown = np.concatenate([values[_IS_DRAG_PARAMETER], np.zeros(len(NUISANCES))])
    before, slopes = np.diag(1.0 / np.square(sds)), gradients(base, values, unknown)
    nothing, nuisances = np.zeros(len(sds), np.bool_), np.arange(len(sds)) >= int(_IS_DRAG_PARAMETER.sum())
    throttle = forces.signals.throttle
    made: dict[str, Any] = {
        "seed": seed,
        "minutes": sum(record.seconds for record in records) / 60.0,
        "throttle_below": {f"{level:g}": float((throttle < level).mean()) for level in (0.2, 0.4, 0.55)},
        "prior": halves(before, slopes, nothing),
        "stated": stated(base, estimate),
    }
    for noise in ("accelerometers", "sensors", "model"):
        known = before + information(forces, unknown, noise)
        made[f"bound: {noise}"] = halves(known, slopes, nothing)
        made[f"bound: {noise}, battery, motor, elevator and angles known"] = halves(known, slopes, nuisances)
    torque = np.zeros(len(sds), np.bool_)
    torque[4] = True
    made["bound: model, propeller's torque known"] = halves(
        before + information(forces, unknown, "model"), slopes, torque
    )
    for seconds in GLIDES:
        more = information(glide(base, values, seconds), unknown, "model") if seconds else 0.0
        made[f"bound: model, {seconds} s of glide"] = halves(
            before + information(forces, unknown, "model") + more, slopes, nothing
        )
    made["bound: model, with current"] = halves(
        before + information(forces, unknown, "model", current=True), slopes, nothing
    )
    return made


def main() -> None:
    """Print the intervals for each seed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[7001, 7002, 7003])
    parser.add_argument("--out", default="build/information.json")
    args = parser.parse_args()
    Path(args.out).parent.mkdir(parents=True, exist_ok=True)
    rows = []
    for seed in args.seeds:
        rows.append(one_seed(seed))
        print(json.dumps(rows[-1], indent=1), flush=True)
        Path(args.out).write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
