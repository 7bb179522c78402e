"""Measure how well aircraft of known truth are identified from their logs, flown by the model of ArduPlane.

    python -m benchmarks.identification --first 1001 --count 10 --repeats 2 --out build/identification.json
    python -m benchmarks.identification --first 4001 --count 3 --missions --shorts 0 --out build/missions.json

The truth of each variant is drawn from 0.8 of the priors, including the parameters that identification keeps fixed.  It
flies the mission of manoeuvres in light turbulence, `tests.instrumented_flights` simulates its sensors and clocks, and
the log is identified, once without and once with the battery's current.  With ``--missions`` it flies missions A and B
of the project's shared flights instead (27 minutes), and both logs are identified together.  ``--sensors 2`` draws the
errors of airspeed, level and accelerometers from twice the usual deviations.
"""

import argparse
import json
import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

import planfly
from aircraft.catalog import Aircraft, load_aircraft
from aircraft.identification.base_model import BaseModel
from aircraft.identification.draws import draw_aircraft, sample_power_factors
from aircraft.identification.estimate import Estimate, estimate_model
from aircraft.identification.parameters import NAMES, PARAMETERS
from aircraft.identification.performance import performance
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import steady_flight
from flight.simulation.track import Track
from planfly.identification.base_numbers import base_model, scale_base_model
from planfly.identification.folder import AMSL, DENSITY, make_folder_files, make_identification
from planfly.identification.records import flight_records
from planfly.identification.servos import read_servos
from tests.instrumented_flights import (
    HOME,
    Sensors,
    Truth,
    changed_aerosonde,
    drawn_sensors,
    fly_identification,
    sensed,
)
from world.arrays import Floats
from world.errors import FlightError, LogError

# Width of the draws as a fraction of the priors.
_PRIOR_FRACTION = 0.8
# Cruise airspeed, m/s.
_CRUISE_MPS = 25.0
# Standard deviations of the parameters that identification keeps fixed.
_FIXED_SIGMAS = {"side_force": 0.25, "lift_of_rate": 0.4, "lift_of_elevator": 0.4}
# Standard deviations of the moments of inertia.
_INERTIA_SIGMAS = {"roll_inertia": 0.15, "pitch_inertia": 0.12, "yaw_inertia": 0.12}
# Slope of the too steep leg, as a factor on the true climb.
_STEEP_SLOPE_RATIO = 1.2
# Shortest complete flight of a mission, s.
_MIN_MISSION_S = 600.0
# Folder of the missions.
MISSIONS = Path(__file__).parent / "identification_missions"


def drawn_truth(seed: int) -> Truth:
    """Draw a truth that climbs at least 4 degrees, flies level below full throttle, and trims in JSBSim."""
    numbers = base_model(load_aircraft("aerosonde"))
    for attempt in range(100):
        draw = np.random.default_rng([seed, attempt])
        values: dict[str, float] = {"mass": float(np.clip(draw.normal(1.0, 0.12), 0.8, 1.25))}
        for parameter in PARAMETERS:
            field = parameter.name.replace("-", "_")
            off = float(np.clip(draw.normal(), -2.0, 2.0)) * _PRIOR_FRACTION * parameter.sd
            values[field] = max(0.25, parameter.prior + off) if parameter.kind == "factor" else 0.5 * off
        for field, sd in (_FIXED_SIGMAS | _INERTIA_SIGMAS).items():
            values[field] = float(np.clip(draw.normal(1.0, sd), 1.0 - 2.0 * sd, 1.0 + 2.0 * sd))
        truth = Truth(**values)
        base = scale_base_model(numbers, 11.0 * truth.mass, numbers.span, numbers.area)
        flown = performance(base, true_values(truth), _CRUISE_MPS, DENSITY)
        stable = truth.pitch_stiffness > 0.5 and truth.weathercock > 0.4 and truth.roll_damping > 0.5
        if math.radians(4.0) < flown.climb[0] < math.radians(16.0) and flown.throttle[0] < 0.93 and stable:
            with tempfile.TemporaryDirectory() as name:
                if steady_flight(Fdm(changed_aerosonde(Path(name) / "tried", truth)), _CRUISE_MPS, AMSL) is not None:
                    return truth
    raise RuntimeError(f"seed {seed}: no aircraft that flies")


def true_values(truth: Truth) -> Floats:
    """Return the true parameters (n,)."""
    true = truth.parameters()
    return np.array([true[name] for name in NAMES])


def worse_sensors(seed: int, factor: float, *, battery: bool) -> Sensors:
    """Draw sensors, with the errors of airspeed, level and accelerometers scaled by a factor."""
    usual = drawn_sensors(seed, battery=battery)
    ahead, right, down = usual.bias
    return replace(
        usual,
        bias=(factor * ahead, factor * right, factor * down),
        level=factor * usual.level,
        airspeed=1.0 + factor * (usual.airspeed - 1.0),
    )


def identify(
    tracks: Sequence[Track], changed: Aircraft, base: BaseModel, seed: int, sensors: Sensors
) -> tuple[Estimate, Any, float]:
    """Identify an aircraft from simulated logs; return the estimate, the last log, and the CPU time, s.

    tracks: tracks of its flights, all with the same sensors.
    changed: the aircraft that flew.
    base: base model of the identification.
    """
    prior = load_aircraft("aerosonde")
    logs = [sensed(track, changed, sensors, seed + 100_000 * k) for k, track in enumerate(tracks)]
    began = time.process_time()
    servos = read_servos(prior.folder / "ardupilot.toml")
    records = [record for log in logs for record in flight_records(log, prior, servos)]
    estimate = estimate_model(records, base)
    return estimate, logs[-1], time.process_time() - began


class NotFlown(Exception):
    """Raised for an aircraft that does not fly missions A and B to their ends."""


def fly_missions(folder: Path, truth: Truth, seed: int) -> tuple[list[Track], Aircraft]:
    """Fly missions A and B by the model of ArduPlane, each in its own wind and light turbulence.

    Raises NotFlown.
    """
    aircraft = changed_aerosonde(folder / f"v{seed}", truth)
    tracks = []
    for k, file in enumerate(sorted(MISSIONS.glob("*.waypoints"))):
        draw = np.random.default_rng([seed, 6, k])
        made = planfly.fly(
            str(file),
            aircraft=str(aircraft.folder),
            seed=seed + k,
            turbulence="light",
            wind=(float(draw.uniform(1.0, 7.0)), float(draw.uniform(0.0, 360.0))),
            params=str(aircraft.folder / "ardupilot.parm"),
        )
        tracks.append(made.track)
        if made.track.time[-1] < _MIN_MISSION_S:
            raise NotFlown(f"seed {seed}: {file.name} ended after {made.track.time[-1] / 60.0:.1f} min")
    return tracks, aircraft


def errors(base: BaseModel, truth: Floats, estimate: Estimate) -> dict[str, Any]:
    """Return the errors of climb, sink, power and drag, and if the true values are in their intervals."""
    best = performance(base, np.vstack([truth, estimate.values]), _CRUISE_MPS, DENSITY)
    drawn = performance(base, draw_aircraft(estimate), _CRUISE_MPS, DENSITY)
    low, high = np.degrees(np.percentile(drawn.climb, [2.5, 97.5]))
    climb, found = np.degrees(best.climb)

    def within(true: Floats, draws: Floats) -> bool:
        """Return True if the true value is within the 95 % interval of the draws."""
        low, high = np.percentile(draws, [2.5, 97.5])
        return bool(low <= true[0] <= high)

    off = np.abs(estimate.values - truth) / estimate.sds
    return {
        "climb_deg": found - climb,
        "climb_interval_deg": 0.5 * (high - low),
        "climb_inside": bool(low <= climb <= high),
        "sink_percent": 100.0 * (best.sink[1] / best.sink[0] - 1.0),
        "power_percent": 100.0 * (best.power[1] / best.power[0] - 1.0),
        "sink_inside": within(best.sink, drawn.sink),
        "power_inside": within(best.power, drawn.power * sample_power_factors(estimate)),
        "drag_percent": 100.0 * (best.drag[1] / best.drag[0] - 1.0),
        "inside": int((off < 1.96).sum()),
        "outside": [name for name, one in zip(NAMES, off, strict=True) if one >= 1.96],
        "true_climb_deg": climb,
    }


def verdict_of_too_steep(folder: Path, climb: float, estimate: Estimate, base: BaseModel, log: Any) -> str:
    """Return the identified model's verdict on a leg a fifth steeper than the true climb; climb: rad.

    "refused", "undecided" or "flyable".
    """
    prior = load_aircraft("aerosonde")
    found = make_identification(prior, base, estimate, [log], read_servos(prior.folder / "ardupilot.toml"))
    place = folder / "mine"
    place.mkdir()
    for name, text in make_folder_files(found, "mine", (prior.battery_voltage, prior.battery_energy)).items():
        (place / name).write_text(text, encoding="utf-8")
    rise = 2000.0 * math.tan(_STEEP_SLOPE_RATIO * climb)
    lat, lon, ground = HOME
    rows = [
        ("0 1 0 16", lat, lon, ground),
        ("1 0 3 16", lat, lon, 150.0),
        ("2 0 3 16", lat + 2000.0 / 111_000.0, lon, 150.0 + rise),
    ]
    lines = [f"{head} 0 0 0 0 {y:.6f} {x:.6f} {up:.1f} 1" for head, y, x, up in rows]
    file = folder / "steep.waypoints"
    file.write_text("\n".join(["QGC WPL 110", *lines]) + "\n", encoding="utf-8")
    verdict = planfly.judge(str(file), aircraft=str(place)).verdict
    return "undecided" if verdict.undecided else "flyable" if verdict.flyable else "refused"


def one_variant(seed: int, repeats: int, shorts: int, factor: float, *, missions: bool) -> dict[str, Any]:
    """Return all rows of one variant; factor: factor on the errors of its sensors."""
    truth = drawn_truth(seed)
    values = true_values(truth)
    numbers = base_model(load_aircraft("aerosonde"))
    base = scale_base_model(numbers, 11.0 * truth.mass, numbers.span, numbers.area)
    made: dict[str, Any] = {
        "seed": seed,
        "truth": {one.name: round(getattr(truth, one.name), 3) for one in fields(truth)},
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if missions:
            tracks, changed = fly_missions(folder, truth, seed)
        else:
            track, changed = fly_identification(folder, truth, seed, repeats=repeats)
            tracks = [track]
        made["minutes"] = sum(float(track.time[-1]) for track in tracks) / 60.0
        climb = float(performance(base, values, _CRUISE_MPS, DENSITY).climb[0])
        for battery in (False, True):
            estimate, log, spent = identify(tracks, changed, base, seed, worse_sensors(seed, factor, battery=battery))
            own = folder / ("with" if battery else "without")
            own.mkdir()
            made["with_battery" if battery else "without_battery"] = errors(base, values, estimate) | {
                "cpu_s": spent,
                "too_steep": verdict_of_too_steep(own, climb, estimate, base, log),
            }
        made["five_minutes"] = []
        for other in range(1, shorts + 1):
            short, _ = fly_identification(folder, truth, seed, repeats=1, wind=2.0 + 3.0 * other)
            own_seed = seed + 10_000 * other
            estimate, _, _ = identify([short], changed, base, own_seed, worse_sensors(own_seed, factor, battery=False))
            made["five_minutes"].append(errors(base, values, estimate))
    return made


def main() -> None:
    """Identify drawn aircraft from simulated logs, and print the errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=1001)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--repeats", type=int, default=4)
    parser.add_argument("--shorts", type=int, default=2)
    parser.add_argument("--missions", action="store_true", help="fly A and B of the shared flights")
    parser.add_argument("--sensors", type=float, default=1.0, metavar="FACTOR", help="on the sensors' errors")
    parser.add_argument("--out", default="build/identification.json")
    args = parser.parse_args()
    rows: list[dict[str, Any]] = []
    Path(args.out).parent.mkdir(parents=True, exist_ok=True)
    seed = args.first
    while len(rows) < args.count:
        try:
            row = one_variant(seed, args.repeats, args.shorts, args.sensors, missions=args.missions)
        except NotFlown as error:
            # The next seed replaces it.
            print(error, flush=True)
            seed += 1
            continue
        except (LogError, FlightError) as error:
            # A refusal is a result: it is included, and not replaced by another seed.
            row = {"seed": seed, "refused": str(error)}
        rows.append(row)
        print(json.dumps(row), flush=True)
        Path(args.out).write_text(json.dumps(rows, indent=1), encoding="utf-8")
        seed += 1
    print(json.dumps(summary(rows), indent=1))


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the rows of the table, and the number of variants whose log was refused."""
    refused = [row["seed"] for row in rows if "refused" in row]
    made: dict[str, Any] = {"refused": refused}
    rows = [row for row in rows if "refused" not in row]
    if not rows:
        return made
    for kind in ("without_battery", "with_battery"):
        chosen = [row[kind] for row in rows]
        for name in ("climb_deg", "sink_percent", "power_percent"):
            sizes = np.abs([row[name] for row in chosen])
            made[f"{kind}.{name}"] = {"median": float(np.median(sizes)), "worst": float(sizes.max())}
        for name in ("climb_inside", "sink_inside", "power_inside"):
            made[f"{kind}.{name}"] = sum(row[name] for row in chosen)
        made[f"{kind}.climb_interval_deg"] = float(np.median([row["climb_interval_deg"] for row in chosen]))
        made[f"{kind}.coverage"] = sum(row["inside"] for row in chosen) / (len(NAMES) * len(chosen))
        for answer in ("refused", "undecided", "flyable"):
            made[f"{kind}.too_steep_{answer}"] = sum(row["too_steep"] == answer for row in chosen)
        made[f"{kind}.cpu_s"] = max(row["cpu_s"] for row in chosen)
    short = [one for row in rows for one in row["five_minutes"]]
    if not short:
        return made
    made["five_minutes.inside"] = f"{sum(one['climb_inside'] for one in short)} of {len(short)}"
    made["five_minutes.within_1.5_deg"] = int(sum(abs(one["climb_deg"]) < 1.5 for one in short))
    made["five_minutes.widest_deg"] = max(one["climb_interval_deg"] for one in short)
    made["five_minutes.interval_deg"] = float(np.median([one["climb_interval_deg"] for one in short]))
    return made


if __name__ == "__main__":
    main()
