"""Measure how well flying wings of known truth are identified from logs of their elevons.

    python -m benchmarks.identification_wings --first 7301 --count 3 --out build/wings.json

The bases are the X8, the Zagi, and a wing of 2.1 kg from its data sheet.  The truth of a variant is drawn from 0.8 of
the priors, for the factors of its base's model, with another mass.  It flies twelve minutes of manoeuvres by
the model of ArduPlane in light turbulence, and its log is identified from the base, once without and once with the
battery's current.  The performance of the truth and of the result is computed with JSBSim.
"""

import argparse
import json
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import planfly
from aircraft.catalog import Aircraft, load_aircraft, read_aircraft
from aircraft.identification.draws import draw_aircraft, sample_power_factors
from aircraft.identification.estimate import estimate_model
from aircraft.identification.parameters import INDEX, NAMES, PARAMETERS, prior_means
from aircraft.identification.performance import performance
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import full_throttle_climb, idle_descent, steady_flight
from planfly.identification.base_numbers import base_model, scale_base_model
from planfly.identification.folder import AMSL, DENSITY, make_folder_files, make_identification
from planfly.identification.model_text import format_identified_model
from planfly.identification.records import flight_records, log_outputs
from planfly.identification.servos import read_servos
from tests.instrumented_flights import drawn_sensors
from tests.instrumented_wings import MASS, TORQUE, changed_wing, fly_wing, log_of_elevons
from world.errors import FlightError, LogError

# Width of the draws as a fraction of the priors.
_PRIOR_FRACTION = 0.8
# Names of the bases.
BASES = ("x8", "zagi", "foam")
# Factors that all three models have.
_DRAWN = (
    "zero-lift-drag",
    "induced-drag",
    "thrust",
    "motor-speed",
    "lift-slope",
    "pitch-stiffness",
    "pitch-damping",
    "elevator-power",
    "roll-damping",
    "aileron-power",
)


def base_aircraft(name: str, folder: Path) -> Aircraft:
    """Load the X8 or the Zagi, or make the foam wing of the docs from its data sheet."""
    if name != "foam":
        return load_aircraft(name)
    return planfly.new_aircraft(folder / "foam", mass=2.1, span=1.6, cruise=15.0, stall=10.0, layout="wing")


def flown_like(aircraft: Aircraft) -> tuple[float, float, float] | None:
    """Return climb and descent limits, degrees, and power of level flight, W, at cruise.

    None if it cannot fly.
    """
    fdm = Fdm(aircraft)
    level = steady_flight(fdm, aircraft.airspeed, AMSL)
    up, down = (steepest(fdm, aircraft.airspeed, AMSL, level) for steepest in (full_throttle_climb, idle_descent))
    if level is None or up is None or down is None:
        return None
    fdm.apply_trim(level.vector())
    return math.degrees(up.climb), -math.degrees(down.climb), float(fdm.read().power)


def drawn_wing(base: Aircraft, folder: Path, seed: int) -> tuple[Aircraft, dict[str, float]]:
    """Draw a stable wing that climbs 4 to 16 degrees at cruise, with its truth."""
    for attempt in range(100):
        draw = np.random.default_rng([seed, attempt, 8])
        truth = {MASS: float(np.clip(draw.normal(1.0, 0.12), 0.8, 1.25))}
        for name in (*_DRAWN, TORQUE):
            sd = PARAMETERS[INDEX[name]].sd
            truth[name] = max(0.25, 1.0 + float(np.clip(draw.normal(), -2.0, 2.0)) * _PRIOR_FRACTION * sd)
        if truth["pitch-stiffness"] < 0.5 or truth["roll-damping"] < 0.5:
            continue
        made = changed_wing(base, folder / f"v{seed}-{attempt}", truth)
        flown = flown_like(made)
        if flown is not None and 4.0 < flown[0] < 16.0:
            return made, truth
    raise RuntimeError(f"seed {seed}: no wing that flies")


def one_variant(name: str, seed: int, repeats: int) -> dict[str, Any]:
    """Return all figures of one variant.  Raises LogError or FlightError for a refused log or estimate."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        base = base_aircraft(name, folder)
        wing, truth = drawn_wing(base, folder, seed)
        true = flown_like(wing)
        assert true is not None
        draw = np.random.default_rng([seed, 3])
        wind = (float(draw.uniform(1.0, 5.0)), float(draw.uniform(0.0, 360.0)))
        track = fly_wing(wing, folder, seed, repeats=repeats, wind=wind)
        numbers = scale_base_model(base_model(base), wing.mass, base.wing_span, base.wing_area)
        made: dict[str, Any] = {
            "base": name,
            "seed": seed,
            "minutes": float(track.time[-1]) / 60.0,
            "truth": {key: round(value, 3) for key, value in truth.items()},
            "true": true,
        }
        before = folder / "before"
        before.mkdir()
        text = format_identified_model(base, "before", numbers, prior_means())
        (before / "before.xml").write_text(text, encoding="utf-8")
        table = (wing.folder / f"{wing.name}.toml").read_text(encoding="utf-8")
        (before / "before.toml").write_text(table, encoding="utf-8")
        made["base_model"] = _errors(flown_like(read_aircraft(before)), true)
        for battery in (False, True):
            log = log_of_elevons(track, wing, drawn_sensors(seed, battery=battery), seed)
            records = flight_records(log, base, log_outputs(log, base))
            estimate = estimate_model(records, numbers)
            found = make_identification(base, numbers, estimate, [log], read_servos(base.folder / "ardupilot.toml"))
            own = folder / ("with" if battery else "without")
            own.mkdir()
            files = make_folder_files(found, own.name, (base.battery_voltage, base.battery_energy))
            (own / f"{own.name}.xml").write_text(files[f"{own.name}.xml"], encoding="utf-8")
            (own / f"{own.name}.toml").write_text(table, encoding="utf-8")
            drawn = performance(numbers, draw_aircraft(estimate), wing.airspeed, DENSITY)
            spans = (np.degrees(drawn.climb), np.degrees(drawn.sink), drawn.power * sample_power_factors(estimate))
            ends = [np.percentile(values, [2.5, 97.5]) for values in spans]
            values = np.array([truth.get(key, prior) for key, prior in zip(NAMES, prior_means(), strict=True)])
            off = np.abs(estimate.values - values) / estimate.sds
            made["with_battery" if battery else "without_battery"] = _errors(flown_like(read_aircraft(own)), true) | {
                "within": [bool(low <= one <= high) for one, (low, high) in zip(true, ends, strict=True)],
                "half_climb_deg": float(0.5 * (ends[0][1] - ends[0][0])),
                "inside": int((off < 1.96).sum()),
                "of": len(NAMES),
                "outside": [name for name, one in zip(NAMES, off, strict=True) if one >= 1.96],
                "explained": {one.name: round(one.explained, 3) for one in estimate.equations},
            }
    return made


def _errors(found: tuple[float, float, float] | None, true: tuple[float, float, float]) -> dict[str, float]:
    """Return the errors of climb (deg), sink and power (percent); NaN if the wing cannot fly."""
    if found is None:
        return {"climb_deg": math.nan, "sink_percent": math.nan, "power_percent": math.nan}
    return {
        "climb_deg": found[0] - true[0],
        "sink_percent": 100.0 * (found[1] / true[1] - 1.0),
        "power_percent": 100.0 * (found[2] / true[2] - 1.0),
    }


def main() -> None:
    """Identify drawn flying wings from simulated logs, and print the errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=7301)
    parser.add_argument("--count", type=int, default=3)
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--bases", nargs="+", choices=BASES, default=BASES)
    parser.add_argument("--out", default="build/wings.json")
    args = parser.parse_args()
    rows: list[dict[str, Any]] = []
    Path(args.out).parent.mkdir(parents=True, exist_ok=True)
    for name in args.bases:
        for seed in range(args.first, args.first + args.count):
            try:
                row = one_variant(name, seed, args.repeats)
            except (LogError, FlightError) as error:
                row = {"base": name, "seed": seed, "refused": str(error)}
            rows.append(row)
            print(json.dumps(row), flush=True)
            Path(args.out).write_text(json.dumps(rows, indent=1), encoding="utf-8")
    for name in args.bases:
        print(json.dumps({"base": name} | summary([row for row in rows if row["base"] == name]), indent=1))


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return worst and median errors, and the number of true values within their intervals."""
    flown = [row for row in rows if "refused" not in row]
    made: dict[str, Any] = {"refused": len(rows) - len(flown)}
    if not flown:
        return made
    for kind in ("base_model", "without_battery", "with_battery"):
        chosen = [row[kind] for row in flown]
        for key in ("climb_deg", "sink_percent", "power_percent"):
            sizes = np.abs([row[key] for row in chosen])
            made[f"{kind}.{key}"] = {"median": float(np.median(sizes)), "worst": float(sizes.max())}
        if kind != "base_model":
            within = np.array([row["within"] for row in chosen]).sum(axis=0).tolist()
            made[f"{kind}.within"] = dict(zip(("climb", "sink", "power"), within, strict=True))
            made[f"{kind}.inside"] = f"{sum(row['inside'] for row in chosen)} of {sum(row['of'] for row in chosen)}"
    return made


if __name__ == "__main__":
    main()
