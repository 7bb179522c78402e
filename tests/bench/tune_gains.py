"""Choose an aircraft's gains by coordinate search on one set of missions, and report on others.

``python -m tests.bench.tune_gains [AIRCRAFT] [--rounds N] [--seed N] [--write]`` takes what can be read off the linear
model from there, searches the rest from `STARTS`, prints each improvement and, at the end, how the chosen gains fly the
standard mission and random missions that the search has not seen.  ``--write`` puts the result into
``aircraft/<name>/gains.toml``; limits that are not searched stay as they stand there.  The missions come from the seed;
the standard mission is none of them.  Two to five minutes on one core.
"""

import argparse
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from aircraft.catalog import Aircraft, load_aircraft
from flight import simulate as simulation
from flight.fdm import JSBSIM_VERSION, Fdm, Variation
from flight.gains import Gains, load_gains
from flight.setup import FlightSetup
from flight.simulate import Flown, simulate
from flight.trim import linearise, straight
from tests.bench.flight import Errors, errors_of, flown_with, straight_rms
from tests.flight.conftest import MakeSetup, setup_maker, standard

# Where the search starts: where those before it ended.  The Aerosonde's turn lead, sideslip gain, side lag and push
# smoothing were then set by hand, as the search gave up corners in wind for straight legs; its gains stand there,
# without a round of search since (--rounds 0).
STARTS = {
    "aerosonde": {
        "cross_track_frequency": 2.2,
        "cross_track_damping": 0.803,
        "cross_track_integral": 0.14,
        "turn_lead": 0.205,
        "turn_smoothing": 0.2,
        "aside_frequency": 2.54,
        "side_gain": 0.95,
        "side_lag": 0.06,
        "push_lead": 0.092,
        "push_smoothing": 0.07,
        "roll_frequency": 9.23,
        "roll_gain": 2.04,
        "roll_rate_gain": 0.08,
        "roll_disturbance_lag": 0.0269,
        "aileron_lead": 0.0385,
        "yaw_rate_gain": 0.325,
        "sideslip_gain": 0.85,
        "height_frequency": 2.3,
        "height_damping": 1.49,
        "height_integral": 1.11,
        "slope_lead": 0.2,
        "load_lead": 0.13,
        "pitch_rate_gain": 0.373,
        "speed_gain": 0.092,
        "speed_integral": 0.01,
        "throttle_per_slope": 1.3,
    },
    "c172x": {
        "cross_track_frequency": 0.9,
        "cross_track_damping": 0.923,
        "cross_track_integral": 0.065,
        "turn_lead": 0.35,
        "turn_smoothing": 0.65,
        "aside_frequency": 0.615,
        "side_gain": 0.601,
        "side_lag": 0.178,
        "push_lead": 0.1,
        "push_smoothing": 0.15,
        "roll_frequency": 6.0,
        "roll_gain": 2.03,
        "roll_rate_gain": 0.172,
        "roll_disturbance_lag": 0.178,
        "aileron_lead": 0.02,
        "yaw_rate_gain": 0.507,
        "sideslip_gain": 0.507,
        "height_frequency": 1.82,
        "height_damping": 2.03,
        "height_integral": 0.104,
        "slope_lead": 0.308,
        "load_lead": 0.115,
        "pitch_rate_gain": 0.455,
        "speed_gain": 0.101,
        "speed_integral": 0.0069,
        "throttle_per_slope": 2.4,
    },
}
SEARCHED = tuple(STARTS["aerosonde"])
# Missions that are searched on and reported on, numbered apart under the one seed.
TRAINED, REPORTED = {"aerosonde": range(8), "c172x": range(4)}, range(1000, 1020)
FIRST_STEP = 1.3
# Steepest climb and dive in calm air, in those that the aircraft can.
SLOPES = (0.5, 0.6)
# What a figure counts as one: the aims in wind, of the cross-track's RMS in calm air; and, of the aircraft that
# the aims are for, of its largest too.
SCALES = {"aerosonde": (0.05, 0.4, 0.2, 0.8), "c172x": (0.05, 0.6, 0.2, 0.8)}
# What the cross-track's RMS on straight legs counts as one, m, and how far from corners, m, at 25 m/s.
STRAIGHT, CLEAR = 0.02, 250.0
# Weights of the surfaces' mean rate as a share of what they can, and of each degree of bank beyond the command's limit.
EFFORT, BEYOND = 0.5, 0.2
FAILED = 1000.0
# Bank that guidance may add in what is searched and reported here, rad; flights have `flight.simulate.BANK_RESERVE`.
RESERVE = math.radians(2.7)
DIGITS = 3


@dataclass(frozen=True, slots=True)
class Case:
    """A mission and the aircraft that flies it, which guidance takes for the model."""

    setup: FlightSetup
    variation: Variation | None


def model_gains(aircraft: Aircraft) -> dict[str, float]:
    """The gains that are the airframe's own, off its linearisation in level cruise at 500 m."""
    fdm = Fdm(aircraft)
    level = straight(fdm, aircraft.airspeed, 500.0)
    if level is None:
        raise SystemExit(f"{aircraft.name} holds no level flight at cruise")
    a, b = linearise(fdm, level)
    speed = aircraft.airspeed
    _, v, w, p, q, r = range(6)
    elevator, aileron, rudder = range(3)
    # Steady yaw rate without sideslip: ailerons and rudder balance its rolling and yawing moments.
    hold = np.linalg.solve(b[np.ix_([p, r], [aileron, rudder])], -a[[p, r], r])
    return {
        "reference_airspeed": speed,
        "alpha_per_g": -9.80665 / (a[w, w] * speed),
        "elevator_per_alpha": -a[q, w] * speed / b[q, elevator],
        "elevator_per_pitch_rate": -a[q, q] / b[q, elevator],
        "aileron_per_roll_rate": -a[p, p] / b[p, aileron],
        "aileron_per_roll_acceleration": 1.0 / b[p, aileron],
        "rudder_per_yaw_rate": -float(hold[1]),
        "side_per_sideslip": -a[v, v] * speed,
        "side_per_aileron": b[v, aileron],
    }


def cases(aircraft: Aircraft, make: MakeSetup, seed: int, numbers: Iterable[int]) -> list[Case]:
    """Missions of seven legs with turns, slopes, wind and turbulence of their own, every fourth at 30 Hz."""
    # Its mass moves a light single's climb by as much as two tenths of the Aerosonde's.
    variations: list[Variation | None] = [None, Variation(mass=0.95), Variation(mass=1.05)]
    if aircraft.name == "aerosonde":
        variations = [
            *(None, Variation(control=0.75), Variation(control=1.25)),
            *(Variation(mass=0.9), Variation(mass=1.1, drag=1.3)),
        ]
    # A turn's radius grows with the square of the speed.
    scale = (aircraft.airspeed / 25.0) ** 2
    climb, dive = make(standard()).envelope.air_angles(aircraft.airspeed, 1000.0)
    steepest = (-SLOPES[1] * abs(dive), min(math.radians(6.0), SLOPES[0] * climb))
    found = []
    for number in numbers:
        random = np.random.default_rng([seed, number])
        way, course = [np.array([0.0, 0.0, 1000.0])], random.uniform(0.0, 6.0)
        for leg in range(7):
            run = scale * random.uniform(700.0, 1500.0)
            # Half of the legs at the steepest: where the slope changes in a turn, the turn is hardest.
            slope = float(np.clip(2.0 * random.uniform(*steepest), *steepest))
            # What has sunk far climbs: not into the ground.
            slope = min(abs(slope), steepest[1]) if way[-1][2] < 700.0 else slope
            turn = math.copysign(random.uniform(0.3, 0.85), random.uniform(-1.0, 1.0))
            course += turn if leg else 0.0
            way.append(way[-1] + run * np.array([math.sin(course), math.cos(course), math.tan(slope)]))
        wind = (float(random.uniform(0.0, 10.0)), float(random.uniform(0.0, 360.0)))
        setup = make(
            np.array(way),
            speeds=aircraft.airspeed,
            seed=seed * 10_000 + number,
            wind=wind,
            turbulence=("none", "moderate", "light", "moderate")[number % 4],
        )
        setup = replace(setup, guidance_hz=30 if number % 4 == 3 else 60)
        found.append(Case(setup, variations[number % len(variations)]))
    return found


def fly(aircraft: Aircraft, gains: Gains, flown: Iterable[Case]) -> list[Flown]:
    """Fly each case with these gains, and a little less bank than flights have, not to lean on the last of it."""
    module: Any = simulation
    usual = module.BANK_RESERVE
    module.BANK_RESERVE = RESERVE
    try:
        with flown_with(gains):
            return [simulate(case.setup, aircraft, variation=case.variation) for case in flown]
    finally:
        module.BANK_RESERVE = usual


def cost(aircraft: Aircraft, found: Iterable[tuple[Case, Flown]]) -> float:
    """Mean of what the flights cost and what the worst of them does; `FAILED` for one that fails.

    A flight costs its errors in units of their aims, those on straight legs once more, its surfaces' rates, and its
    bank beyond the command's limit.
    """
    costs = []
    clear = CLEAR * (aircraft.airspeed / 25.0) ** 2
    for case, flown in found:
        errors = errors_of(flown)
        if not errors.completed:
            return FAILED
        values = (errors.cross_rms, errors.cross_max, errors.height_rms, errors.height_max)
        one = sum(value / scale for value, scale in zip(values, SCALES[aircraft.name], strict=True))
        one += straight_rms(case.setup, flown, clear) / STRAIGHT
        track = flown.track
        rates = np.diff(track.commands[:, :3].astype(np.float64), axis=0) / float(track.time[1] - track.time[0])
        one += EFFORT * math.sqrt(float((rates**2).mean())) / aircraft.surface_rate
        bank = math.degrees(float(np.abs(track.attitude[:, 0]).max()))
        costs.append(one + BEYOND * max(0.0, bank - math.degrees(aircraft.max_bank) - 3.0))
    return float(np.mean(costs) + np.max(costs))


def rounded(gains: Gains) -> Gains:
    """The gains as the file will hold them."""
    return replace(gains, **{name: float(f"{getattr(gains, name):.{DIGITS}g}") for name in SEARCHED})


def search(aircraft: Aircraft, gains: Gains, trained: Sequence[Case], rounds: int, seed: int) -> Gains:
    """Change one gain at a time, in a seeded order, by a factor that shrinks where neither way helps."""
    best = rounded(gains)
    lowest = cost(aircraft, zip(trained, fly(aircraft, best, trained), strict=True))
    print(f"start: {lowest:.4f}", flush=True)
    steps = dict.fromkeys(SEARCHED, FIRST_STEP)
    random = np.random.default_rng([seed, 1])
    for _ in range(rounds):
        for name in random.permutation(SEARCHED).tolist():
            for factor in (steps[name], 1.0 / steps[name]):
                tried = rounded(replace(best, **{name: getattr(best, name) * factor}))
                found = cost(aircraft, zip(trained, fly(aircraft, tried, trained), strict=True))
                if found < 0.999 * lowest:
                    best, lowest = tried, found
                    # The way that helped comes first the next time.
                    steps[name] = factor
                    print(f"{name} = {getattr(best, name):.3g}: {lowest:.4f}", flush=True)
                    break
            else:
                steps[name] = 1.0 + 0.5 * (steps[name] - 1.0)
    return best


def write(aircraft: Aircraft, gains: Gains, rounds: int, seed: int) -> None:
    """Put the numbers into the aircraft's gains file, at the keys that stand there, and say where they come from."""
    file = aircraft.folder / "gains.toml"
    chosen = "# Chosen by "
    said = (
        f"{chosen}`python -m tests.bench.tune_gains {aircraft.name} --rounds {rounds} --seed {seed} --write`"
        f" with JSBSim {JSBSIM_VERSION}."
    )
    lines = [line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith(chosen)]
    names = sorted((item.name for item in fields(Gains)), key=len, reverse=True)
    out = []
    for line in lines:
        key = line.partition(" =")[0]
        name = next((name for name in names if re.fullmatch(name + r"(_(deg|rad|mps|1|s)[a-z0-9_]*)?", key)), None)
        if name is None:
            out.append(line)
            continue
        value = getattr(gains, name)
        value = math.degrees(value) if "_deg" in key.removeprefix(name) else value
        out.append(f"{key} = {float(f'{value:.4g}')!r}")
    at = next(k for k, line in enumerate(out) if not line.startswith("#"))
    file.write_text("\n".join([*out[:at], said, *out[at:]]) + "\n", encoding="utf-8")


def print_errors(name: str, found: Sequence[Errors]) -> None:
    """One line: medians of the RMS, 95th percentiles of the largest."""
    rms = [float(np.median([getattr(item, key) for item in found])) for key in ("cross_rms", "height_rms")]
    most = [float(np.percentile([getattr(item, key) for item in found], 95)) for key in ("cross_max", "height_max")]
    done = sum(item.completed for item in found)
    print(
        f"  {name:<28} {done} of {len(found)} complete; cross-track {rms[0]:.3f} / {most[0]:.3f},"
        f" height {rms[1]:.3f} / {most[1]:.3f} m"
    )


def report(aircraft: Aircraft, make: MakeSetup, gains: Gains, seed: int) -> None:
    """How the gains fly what the search has not seen."""
    way = standard() * np.array([1.0, 1.0, 1.0])
    way[:, :2] *= (aircraft.airspeed / 25.0) ** 2
    if aircraft.name != "aerosonde":
        # Half the slopes: the standard mission's are the Aerosonde's.
        way[:, 2] = 500.0 + 0.5 * (aircraft.airspeed / 25.0) ** 2 * (way[:, 2] - 500.0)
    winds: list[dict[str, Any]] = [{}] + [{"wind": (10.0, 45.0 * k), "turbulence": "moderate"} for k in range(8)]
    known = [Case(make(way, speeds=aircraft.airspeed, **wind), None) for wind in winds]
    fresh = cases(aircraft, make, seed, REPORTED)
    print("reported on (median RMS / 95th percentile of the largest):")
    print_errors("standard mission, calm", [errors_of(item) for item in fly(aircraft, gains, known[:1])])
    print_errors("standard mission, windy", [errors_of(item) for item in fly(aircraft, gains, known[1:])])
    print_errors("fresh random missions", [errors_of(item) for item in fly(aircraft, gains, fresh)])


def main() -> None:
    """Search, report, and write if asked to."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.tune_gains")
    parser.add_argument("aircraft", nargs="?", default="aerosonde", choices=sorted(STARTS))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    aircraft = load_aircraft(args.aircraft)
    make = setup_maker(aircraft)
    own = {name: float(f"{value:.4g}") for name, value in model_gains(aircraft).items()}
    print("off the model: " + ", ".join(f"{name} {value:.4g}" for name, value in own.items()))
    gains = replace(load_gains(aircraft), **own, **STARTS[aircraft.name])
    trained = cases(aircraft, make, args.seed, TRAINED[aircraft.name])
    gains = search(aircraft, gains, trained, args.rounds, args.seed)
    print(gains)
    report(aircraft, make, gains, args.seed)
    if args.write:
        write(aircraft, gains, args.rounds, args.seed)


if __name__ == "__main__":
    main()
