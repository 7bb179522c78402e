"""Choose an aircraft's gains by coordinate search on one set of missions, and report on others.

``python -m benchmarks.tuning.tune_gains [AIRCRAFT] [--rounds N] [--seed N] [--write]`` computes some gains from the
linear model, searches the others from round figures (`START`), and prints the result of each round.  At the end it
prints how the chosen gains fly the standard mission and random missions that the search has not seen.  ``--write``
writes the result to ``aircraft/<name>/gains.toml``, and keeps the limits in it that are not searched.  The missions
depend on the seed (`benchmarks.tuning.tuning_missions`); the standard mission is not among them.  A round takes two
minutes on two cores.
"""

import argparse
import math
import multiprocessing
import re
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from aircraft.catalog import Aircraft, load_aircraft
from benchmarks.flight import Errors, errors_of, flown_with, straight_rms
from benchmarks.tuning.tuning_missions import Case, cases
from flight.dynamics.fdm import JSBSIM_VERSION
from flight.guidance.gains import Gains, load_gains
from flight.guidance.model_gains import TYPICAL_GAINS, airframe_gains, gains_at_airspeed
from flight.simulation import simulate as simulation
from flight.simulation.simulate import Flight, SimulatedFlight, fly_to_end
from tests.setups import MakeSetup, setup_maker, standard

# Start of every search: round figures, of the size that earlier searches of the Aerosonde found.
START = TYPICAL_GAINS
# Names of the gains that are searched.
SEARCHED = tuple(START)
# Numbers of the missions of the search, by aircraft.
TRAINED = {"aerosonde": range(16), "c172x": range(8)}
# Numbers of the missions of the report, distinct from the missions of the search.
REPORTED = range(1000, 1024)
# First factor by which a gain is changed.
FIRST_STEP = 1.5
# Smallest reduction of the cost for which a change is kept, as a fraction.
WORTH_TAKING = 0.001
# Scales of the errors in the cost, m: the aims of `benchmarks.flight` in wind; for the RMS of the cross-track error in
# calm air, and for the Aerosonde, to which the aims apply, also of the largest error.
SCALES = {"aerosonde": (0.05, 0.4, 0.2, 0.8), "c172x": (0.05, 0.6, 0.2, 0.8)}
# Scale of the RMS cross-track error on straight legs, m.
STRAIGHT = 0.02
# Distance from corners from which a leg is straight, m, at 25 m/s.
CLEAR = 250.0
# Scale of the airspeed error over the second halves of legs, m/s, which is the tolerance of the verdict.
SPEED = 1.0
# Weight of the surfaces' mean rate as a fraction of their maximum rate.
EFFORT = 0.5
# Weight of each degree of bank beyond the limit of the command.
BEYOND = 0.2
# Cost of a failed flight.
FAILED = 1000.0
# Bank that guidance may add in the search and the report, rad; flights use
# `flight.simulation.simulate.BANK_RESERVE_RAD`.
RESERVE = math.radians(2.7)
# Significant digits of the gains.
DIGITS = 3
# Shortest lag or smoothing: a tick at 60 Hz, s.
TICK = 0.017


def fly(aircraft: Aircraft, gains: Gains, case: Case) -> SimulatedFlight:
    """Fly a case with these gains, and with slightly less bank reserve than flights have.

    Flights with the usual reserve then have some bank left.
    """
    module: Any = simulation
    usual = module.BANK_RESERVE_RAD
    module.BANK_RESERVE_RAD = RESERVE
    try:
        with flown_with(gains):
            return fly_to_end(Flight(case.setup, aircraft, variation=case.variation))
    finally:
        module.BANK_RESERVE_RAD = usual


def cost(aircraft: Aircraft, gains: Gains, case: Case) -> float:
    """Return the cost of a flight; `FAILED` if it fails.

    The cost includes the errors in units of their aims, the errors on straight legs once more, the airspeed error, the
    rates of the surfaces, and the bank beyond the limit of the command.
    """
    flown = fly(aircraft, gains, case)
    if flown.ended != "completed":
        return FAILED
    errors = errors_of(flown)
    values = (errors.cross_rms, errors.cross_max, errors.height_rms, errors.height_max)
    found = sum(value / scale for value, scale in zip(values, SCALES[aircraft.name], strict=True))
    if case.straight:
        found += straight_rms(case.setup, flown, CLEAR * (aircraft.airspeed / 25.0) ** 2) / STRAIGHT
    found += speed_error(case, flown) / SPEED
    track = flown.track
    rates = np.diff(track.commands[:, :3].astype(np.float64), axis=0) / float(track.time[1] - track.time[0])
    found += EFFORT * math.sqrt(float((rates**2).mean())) / aircraft.surface_rate
    return found + BEYOND * max(0.0, errors.peak_bank - math.degrees(aircraft.max_bank) - 3.0)


def speed_error(case: Case, flown: SimulatedFlight) -> float:
    """Return the RMS over the legs of the mean airspeed error in the second half of a leg, m/s."""
    track, errors = flown.track, []
    for leg, command in enumerate(case.setup.route.leg_airspeeds):
        airspeed = track.airspeed[track.leg == leg].astype(np.float64)
        errors.append(float(airspeed[airspeed.size // 2 :].mean()) - command if airspeed.size else 0.0)
    return math.sqrt(float(np.mean(np.square(errors))))


class Trial:
    """Cost of gains on the missions of the search, flown on all processors."""

    def __init__(self, aircraft: Aircraft, trained: Sequence[Case]) -> None:
        """Start the processes.  Each receives all missions at the start; a task names one of them."""
        self._count = len(trained)
        self._pool = multiprocessing.Pool(initializer=_begin, initargs=(aircraft, trained))

    def __enter__(self) -> "Trial":
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the processes."""
        self._pool.terminate()

    def __call__(self, gains: Gains) -> float:
        """Return the root mean square of the flights' costs.

        It weights bad flights without letting one decide.
        """
        costs = self._pool.map(_cost, [(gains, k) for k in range(self._count)], chunksize=1)
        return math.sqrt(float(np.mean(np.square(costs))))


_missions: list[tuple[Aircraft, Case]] = []


def _begin(aircraft: Aircraft, trained: Sequence[Case]) -> None:
    """Store the missions in a worker process."""
    _missions[:] = [(aircraft, case) for case in trained]


def _cost(task: tuple[Gains, int]) -> float:
    """Return the cost of one mission with some gains, in a worker process."""
    gains, number = task
    aircraft, case = _missions[number]
    return cost(aircraft, gains, case)


def rounded(gains: Gains) -> Gains:
    """Return the gains rounded as in the file, with lags and smoothing no shorter than a tick."""
    least = {name: TICK for name in SEARCHED if name.endswith(("lag", "smoothing"))}
    values = {name: max(least.get(name, 0.0), getattr(gains, name)) for name in SEARCHED}
    return replace(gains, **{name: float(f"{value:.{DIGITS}g}") for name, value in values.items()})


def search(gains: Gains, trial: Callable[[Gains], float], rounds: int, seed: int) -> Gains:
    """Change one gain at a time, in a seeded order, by a factor that shrinks if neither direction helps."""
    best = rounded(gains)
    lowest = trial(best)
    print(f"start: {lowest:.4f}", flush=True)
    steps = dict.fromkeys(SEARCHED, FIRST_STEP)
    random = np.random.default_rng([seed, 0, 1])
    for number in range(rounds):
        for name in random.permutation(SEARCHED).tolist():
            for factor in (steps[name], 1.0 / steps[name]):
                tried = rounded(replace(best, **{name: getattr(best, name) * factor}))
                found = trial(tried)
                if found < (1.0 - WORTH_TAKING) * lowest:
                    best, lowest = tried, found
                    # Try the successful direction first the next time.
                    steps[name] = factor
                    break
            else:
                steps[name] = 1.0 + 0.5 * (steps[name] - 1.0)
        print(f"round {number + 1}: {lowest:.4f}", flush=True)
    return best


def write(aircraft: Aircraft, gains: Gains, rounds: int, seed: int) -> None:
    """Write the numbers to the existing keys of the aircraft's gains file.

    A comment in the file states their origin.
    """
    file = aircraft.folder / "gains.toml"
    chosen = "# Chosen by "
    said = (
        f"{chosen}`python -m benchmarks.tuning.tune_gains {aircraft.name} --rounds {rounds} --seed {seed} --write`"
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
    """Print one line: medians of the RMS errors, 95th percentiles of the largest errors."""
    rms = [float(np.median([getattr(item, key) for item in found])) for key in ("cross_rms", "height_rms")]
    most = [float(np.percentile([getattr(item, key) for item in found], 95)) for key in ("cross_max", "height_max")]
    done = sum(item.completed for item in found)
    print(
        f"  {name:<28} {done} of {len(found)} complete; cross-track {rms[0]:.3f} / {most[0]:.3f},"
        f" height {rms[1]:.3f} / {most[1]:.3f} m"
    )


def report(aircraft: Aircraft, make: MakeSetup, gains: Gains, fresh: Sequence[Case]) -> None:
    """Print how the gains fly missions that the search has not seen.

    They are the standard mission and fresh random missions.
    """
    waypoints = standard() * np.array([1.0, 1.0, 1.0])
    waypoints[:, :2] *= (aircraft.airspeed / 25.0) ** 2
    if aircraft.name != "aerosonde":
        # Half the slopes, as the standard mission is made for the Aerosonde.
        waypoints[:, 2] = 500.0 + 0.5 * (aircraft.airspeed / 25.0) ** 2 * (waypoints[:, 2] - 500.0)
    winds: list[dict[str, Any]] = [{}] + [{"wind": (10.0, 45.0 * k), "turbulence": "moderate"} for k in range(8)]
    known = [Case(make(waypoints, speeds=aircraft.airspeed, **wind), None, True) for wind in winds]
    print("reported on (median RMS / 95th percentile of the largest):")
    print_errors("standard mission, calm", [errors_of(fly(aircraft, gains, item)) for item in known[:1]])
    print_errors("standard mission, windy", [errors_of(fly(aircraft, gains, item)) for item in known[1:]])
    print_errors("fresh random missions", [errors_of(fly(aircraft, gains, item)) for item in fresh])


def main() -> None:
    """Search, report, and write the gains if requested."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tuning.tune_gains")
    parser.add_argument("aircraft", nargs="?", default="aerosonde", choices=sorted(TRAINED))
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    aircraft = load_aircraft(args.aircraft)
    make = setup_maker(aircraft)
    own = {name: float(f"{value:.4g}") for name, value in airframe_gains(aircraft).items()}
    print("off the model: " + ", ".join(f"{name} {value:.4g}" for name, value in own.items()))
    gains = replace(load_gains(aircraft), **own, **gains_at_airspeed(aircraft.airspeed))
    trained = cases(aircraft, make, args.seed, TRAINED[aircraft.name])
    fresh = cases(aircraft, make, args.seed, REPORTED)
    with Trial(aircraft, trained) as trial:
        gains = search(gains, trial, args.rounds, args.seed)
    print(gains)
    if args.write:
        write(aircraft, gains, args.rounds, args.seed)
    report(aircraft, make, gains, fresh)


if __name__ == "__main__":
    main()
