"""Fit the prior of drag and power to real aircraft, and predict the power of each from all the others.

``python -m benchmarks.real_power``.  Powers in level flight are those of `examples/real/aircraft.csv`.  Four measured
least drags separate drag from efficiency.  Each coefficient has a wide prior of its own, which keeps it physical.
"""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aircraft.data_sheet import CLASSES, SHEET_DENSITY, VISCOSITY
from aircraft.envelope import GRAVITY
from aircraft.model_writer import Layout
from aircraft.power_prior import MIN_DRAG_LOG_SD, POWER_PRIOR, PowerPrior, power_log_sd
from world.arrays import Floats

# Published facts of real aircraft.
TABLE = Path(__file__).parent.parent / "examples" / "real" / "aircraft.csv"
# Half width of the interval of 95 % of a normal distribution, in standard deviations.
INTERVAL_SIGMAS = 1.96
# Logarithmic step of the derivatives.
STEP = 1e-4
# Medians of the coefficients before the fit: a wetted area of 5 times the wing's with a skin friction of 0.007, two
# thirds of it for a flying wing; small foam aircraft have an efficiency of 0.25 to 0.45; autopilot, radios and servos
# take 3 to 6 W.
PRIOR = PowerPrior(tail_drag=0.036, wing_drag=0.024, aspect_power=-0.4, loss_mass=1.5, avionics=4.0)
# Standard deviations of these coefficients: of the logarithm, or of the power of the aspect ratio.
PRIOR_SD = PowerPrior(tail_drag=1.0, wing_drag=1.0, aspect_power=0.5, loss_mass=0.7, avionics=0.4)


@dataclass(frozen=True, slots=True)
class RealAircraft:
    """Aircraft of the table, in SI units.

    power: measured or published battery power in level flight at cruise, W.
    kind: class in the table, such as "foam<3kg".
    """

    name: str
    layout: Layout
    mass: float
    span: float
    area: float
    cruise: float
    power: float
    kind: str


@dataclass(frozen=True, slots=True)
class MeasuredDrag:
    """Least drag coefficient of an aircraft, from a glide or a wind tunnel."""

    name: str
    layout: Layout
    aspect: float
    reynolds: float
    drag: float


# BYU's wing: drag powers at 10.6 to 24.6 m/s, 0.95 kg (Ostler et al. 2009); T-28: sinks 1.70 m/s at 13.5 m/s with its
# wheels down and the propeller stopped or windmilling (ALFA data set); Ultra Stick 25e and X8: wind tunnels
# (`aircraft/ultrastick25e`, `aircraft/x8`).
DRAGS = (
    MeasuredDrag("byuwing", "wing", 3.5, 2.9e5, 0.0149),
    MeasuredDrag("t28", "tail", 6.7, 2.7e5, 0.0571),
    MeasuredDrag("ultrastick25e", "tail", 5.2, 2.9e5, 0.0434),
    MeasuredDrag("x8adelaide", "wing", 6.0, 4.4e5, 0.0182),
)


def read_table() -> list[RealAircraft]:
    """Read the electric aircraft whose power in level flight is known."""
    with TABLE.open(encoding="utf-8", newline="") as opened:
        rows = [row for row in csv.DictReader(opened) if row["real_power_W"] and row["class"] != "fuel"]
    layouts: dict[str, Layout] = {"tail": "tail", "wing": "wing", "vtail": "vtail"}
    return [
        RealAircraft(
            name=row["id"],
            layout=layouts[row["layout"]],
            mass=float(row["mass_kg"]),
            span=float(row["span_m"]),
            area=float(row["area_m2"]),
            cruise=float(row["cruise_mps"]),
            power=float(row["real_power_W"]),
            kind=row["class"],
        )
        for row in rows
    ]


def predict_power(prior: PowerPrior, real: RealAircraft) -> tuple[float, float]:
    """Predict the power in level flight, W, and the standard deviation of its logarithm."""
    pressure, aspect = 0.5 * SHEET_DENSITY * real.cruise**2, real.span**2 / real.area
    lift = real.mass * GRAVITY / (pressure * real.area)
    least = prior.min_drag_coefficient(real.layout, aspect, real.cruise * real.area / real.span / VISCOSITY)
    induced = lift**2 / (math.pi * CLASSES[real.layout].oswald * aspect)
    drag_power = pressure * real.area * (least + induced) * real.cruise
    power = drag_power / prior.propulsive_efficiency(real.mass) + prior.avionics
    return power, power_log_sd(least / (least + induced), prior.avionics / power)


# ----------------------------------------------------------------------
# The fit: maximum a posteriori by Gauss-Newton steps.

# Coefficients that are positive, so that their logarithm is fitted.
_POSITIVE = ("tail_drag", "wing_drag", "loss_mass", "avionics")
# All coefficients.
_NAMES = ("tail_drag", "wing_drag", "aspect_power", "loss_mass", "avionics")


def _to_vector(prior: PowerPrior) -> Floats:
    """Return the coefficients as a vector; positive ones as logarithms."""
    values = {name: getattr(prior, name) for name in _NAMES}
    return np.array([math.log(value) if name in _POSITIVE else value for name, value in values.items()])


def _from_vector(values: Floats) -> PowerPrior:
    """Return the coefficients from a vector; the inverse of `_to_vector`."""
    pairs = zip(_NAMES, values.tolist(), strict=True)
    return PowerPrior(**{name: math.exp(value) if name in _POSITIVE else value for name, value in pairs})


def fit_prior(known: list[RealAircraft], drags: tuple[MeasuredDrag, ...] = DRAGS) -> PowerPrior:
    """Fit the coefficients to powers and drags of known aircraft."""
    mean, deviations = _to_vector(PRIOR), np.array([getattr(PRIOR_SD, name) for name in _NAMES])

    def residuals(values: Floats) -> Floats:
        """Return the errors of powers, drags and coefficients, in standard deviations."""
        prior = _from_vector(values)
        predicted = [predict_power(prior, real) for real in known]
        power_errors = [math.log(power / real.power) / sd for (power, sd), real in zip(predicted, known, strict=True)]
        drag_errors = [
            math.log(prior.min_drag_coefficient(one.layout, one.aspect, one.reynolds) / one.drag) / MIN_DRAG_LOG_SD
            for one in drags
        ]
        return np.concatenate([power_errors, drag_errors, (values - mean) / deviations])

    values = mean
    for _ in range(20):
        slopes = np.array(
            [(residuals(values + step) - residuals(values - step)) / (2.0 * STEP) for step in STEP * np.eye(mean.size)]
        ).T
        values = values - np.linalg.lstsq(slopes, residuals(values), rcond=None)[0]
    return _from_vector(values)


def fit_without(name: str) -> PowerPrior:
    """Fit the coefficients to all aircraft but one."""
    others = [other for other in read_table() if other.name != name]
    return fit_prior(others, tuple(one for one in DRAGS if one.name != name))


@dataclass(frozen=True, slots=True)
class Prediction:
    """Power of an aircraft as predicted, W, with its interval of 95 %."""

    real: RealAircraft
    power: float
    low: float
    high: float

    @property
    def inside(self) -> bool:
        """True if the interval contains the real power."""
        return self.low <= self.real.power <= self.high


def predictions(*, leave_out: bool) -> list[Prediction]:
    """Predict all aircraft of the table.  leave_out: fit each prediction's prior to all other aircraft."""
    found = []
    for real in read_table():
        power, sd = predict_power(fit_without(real.name) if leave_out else POWER_PRIOR, real)
        ratio = math.exp(INTERVAL_SIGMAS * sd)
        found.append(Prediction(real, power, power / ratio, power * ratio))
    return found


def geometric_mean_ratio(found: list[Prediction]) -> float:
    """Return the geometric mean of predicted by real power."""
    return math.exp(sum(math.log(one.power / one.real.power) for one in found) / len(found))


def summary_lines(found: list[Prediction]) -> list[str]:
    """Describe how many intervals contain the real power, their median width, and the bias."""
    foam = [one for one in found if one.real.kind == "foam<3kg"]
    errors = [math.log(one.power / one.real.power) for one in found]
    return [
        f"inside the stated 95 %: {sum(one.inside for one in found)} of {len(found)};"
        f" median width {np.median([one.high / one.low for one in found]):.2f}",
        f"predicted / real: geometric mean {geometric_mean_ratio(found):.2f},"
        f" root mean square of the logarithm {math.sqrt(sum(error**2 for error in errors) / len(errors)):.2f}",
        f"foam under 3 kg: {sum(one.inside for one in foam)} of {len(foam)} inside;"
        f" geometric mean {geometric_mean_ratio(foam):.2f}",
    ]


def main() -> None:
    """Print the fit, each aircraft predicted from the others, and the counts."""
    print("fit to all aircraft; shipped prior:")
    fitted = fit_prior(read_table())
    for name in _NAMES:
        print(f"  {name:<14} {getattr(fitted, name):8.4f} {getattr(POWER_PRIOR, name):8.4f}")
    found = predictions(leave_out=True)
    print("power in level flight, W, each aircraft predicted from the others:")
    for one in found:
        inside = "inside" if one.inside else "OUTSIDE"
        print(
            f"  {one.real.name:<14} {one.real.power:6.1f} predicted {one.power:6.1f} ({one.low:.0f} to {one.high:.0f}),"
            f" ratio {one.power / one.real.power:.2f}: {inside}"
        )
    print("\n".join(summary_lines(found)))


if __name__ == "__main__":
    main()
