"""Test aircraft made from data sheets: do random ones fly, and do the intervals contain published performance?

``python -m benchmarks.data_sheets [--sheets N] [--seed S]``.  Random sheets of all classes (0.5 to 25 kg; tail, V-tail,
flying wing; battery, fuel) are made into aircraft, each of which flies 5 km with turns, climbs and descents in wind and
light turbulence, with planfly's guidance and with ArduPlane's model.  Then the intervals of data sheets of published
aircraft are compared with the climb, sink and cruise power of the published models.
"""

import argparse
import math
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aircraft.catalog import Aircraft, load_aircraft
from aircraft.data_sheet import FUEL_HEAT, TAIL, WING, AircraftClass, DataSheet, check_sheet, size_aircraft
from aircraft.power_prior import POWER_PRIOR
from aircraft.uncertainty import read_draws
from benchmarks.flight import errors_of
from benchmarks.real_power import fit_without
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.trim import fastest_level_flight, full_throttle_climb, idle_descent, steady_flight
from flight.simulation.simulate import Flight, fly_to_end
from planfly.workflow.data_sheets import make_data_sheet_folder
from tests.setups import setup_maker
from world.arrays import Floats
from world.errors import FlightError

# Default number of random sheets.
SHEETS = 20
# Length of the mission, m.
LENGTH = 5000.0
# Altitude of the mission's start, m AMSL.
AMSL = 500.0
# Largest wind as a fraction of the cruise speed.
WIND = 0.3
# Largest slope as a fraction of the steepest climb and descent.
SLOPE = 0.5


def random_sheet(random: np.random.Generator) -> DataSheet:
    """Draw the data sheet of a small aircraft: log-uniform mass, and speeds and span typical of the mass.

    Wing loading and span are within a factor of 1.5 of typical aircraft of this mass.
    """
    mass = math.exp(random.uniform(math.log(0.5), math.log(25.0)))
    layout = ("tail", "wing", "vtail")[int(random.integers(3))]
    span = 1.25 * mass**0.38 * math.exp(random.uniform(-0.25, 0.25))
    loading = 6.0 * mass**0.4 * math.exp(random.uniform(-0.4, 0.4))  # kg/m^2
    stall = math.sqrt(loading * 9.81 / (0.5 * 1.225 * (1.05 if layout == "wing" else 1.25)))
    cruise = stall * random.uniform(1.3, 1.7)
    fuelled = mass > 6.0 and random.random() < 0.5
    more: dict[str, float] = {}
    if random.random() < 0.5:
        more["top"] = cruise * random.uniform(1.25, 1.6)
        more["climb"] = math.radians(random.uniform(8.0, 16.0))
    return DataSheet(
        mass=round(mass, 2),
        span=round(span, 2),
        cruise=round(cruise, 1),
        stall=round(stall, 1),
        layout=layout,
        fuel=round(0.15 * mass, 2) if fuelled else 0.0,
        **more,
    )


def sheets(count: int, seed: int) -> list[DataSheet]:
    """Draw random sheets; a sheet that is not a valid aircraft is drawn again."""
    random = np.random.default_rng(seed)
    found: list[DataSheet] = []
    while len(found) < count:
        sheet = random_sheet(random)
        try:
            check_sheet(sheet)
        except FlightError:
            continue
        found.append(sheet)
    return found


def route(aircraft: Aircraft, random: np.random.Generator, climb: float, descent: float) -> Floats:
    """Return waypoints (w, 3) of a route of 5 km.

    It has turns of 20 to 90 degrees, and slopes up to half of the aircraft's limits.
    """
    legs = 7
    runs = random.uniform(0.6, 1.4, legs)
    runs *= LENGTH / runs.sum()
    turns = random.uniform(math.radians(20.0), math.radians(90.0), legs) * random.choice((-1.0, 1.0), legs)
    courses = random.uniform(0.0, 2.0 * math.pi) + np.cumsum(turns)
    slopes = random.uniform(-SLOPE * descent, SLOPE * climb, legs)
    steps = np.column_stack([runs * np.sin(courses), runs * np.cos(courses), runs * np.tan(slopes)])
    waypoints: Floats = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]) + np.array([0.0, 0.0, AMSL])
    return waypoints


def fly_both(aircraft: Aircraft, seed: int) -> dict[str, tuple[str, float, float]]:
    """Fly one mission with planfly's guidance and with ArduPlane's model.

    Returns for each, by its name, how the flight ended, and its largest errors across and in altitude, m.
    """
    random = np.random.default_rng([seed, 7])
    make = setup_maker(aircraft)
    climb, descent = make(np.array([[0.0, 0.0, AMSL], [0.0, 500.0, AMSL]])).envelope.air_angles(aircraft.airspeed, AMSL)
    wind = (float(random.uniform(0.0, WIND * aircraft.airspeed)), float(random.uniform(0.0, 360.0)))
    setup = make(
        route(aircraft, random, climb, descent),
        wind=wind,
        turbulence="light",
        seed=seed,
        speeds=aircraft.airspeed,
        bank_deg=math.degrees(aircraft.max_bank),
    )
    setup = replace(setup, battery=aircraft.battery_energy / 3600.0)
    found = {}
    for name, flown_by in (("planfly", setup.autopilot), ("arduplane", ArduPlane(ArduPilotParameters.load(aircraft)))):
        flown = fly_to_end(Flight(replace(setup, autopilot=flown_by), aircraft))
        errors = errors_of(flown)
        found[name] = (flown.ended, errors.cross_max, errors.height_max)
    return found


def fly_random_sheets(count: int, seed: int) -> dict[str, int]:
    """Count the random sheets whose aircraft completes its mission, with each guidance.

    Each mission is flown with planfly's guidance, and with the model of ArduPlane's.
    """
    done = {"planfly": 0, "arduplane": 0}
    print(f"{count} random data sheets (seed {seed}), {LENGTH / 1000.0:g} km each:")
    with tempfile.TemporaryDirectory() as place:
        for k, sheet in enumerate(sheets(count, seed)):
            began = time.perf_counter()
            made = make_data_sheet_folder(Path(place) / f"sheet{k}", sheet)
            seconds = time.perf_counter() - began
            found = fly_both(made, k)
            what = f"{sheet.mass:5.2f} kg {sheet.span:.2f} m {sheet.cruise:4.1f} m/s {sheet.layout:5}"
            what += " fuel    " if sheet.burns_fuel else " electric"
            flights = []
            for name, (ended, across, height) in found.items():
                done[name] += ended == "completed"
                flights.append(f"{name} {ended}, off by {across:.1f} m across, {height:.1f} m in height")
            print(f"  {k:2} {what} ({seconds:.1f} s): {'; '.join(flights)}", flush=True)
    print(f"  completed: {done['planfly']} and {done['arduplane']} of {count}")
    return done


# ----------------------------------------------------------------------
# Data sheets of published aircraft.


@dataclass(frozen=True, slots=True)
class Performance:
    """Performance at 500 m: steepest climb at cruise, rad; sink without power, m/s.

    Power in level flight, W.
    """

    climb: float
    sink: float
    power: float


def performance(aircraft: Aircraft, variation: Variation | None = None) -> Performance:
    """Compute a model's performance at its cruise speed; NaN for a flight that it cannot trim."""
    fdm = Fdm(aircraft, variation=variation, is_tested=True)
    speed = aircraft.airspeed
    level = steady_flight(fdm, speed, AMSL)
    power = math.nan
    if level is not None:
        fdm.apply_trim(level.vector())
        power = float(fdm.read().power)
    up, down = full_throttle_climb(fdm, speed, AMSL, level), idle_descent(fdm, speed, AMSL, level)
    return Performance(
        math.nan if up is None else up.climb, math.nan if down is None else -speed * math.sin(down.climb), power
    )


# Published aircraft, whose data sheets state mass, span, area, speeds and bank, as their makers would print them;
# climb, sink and power are estimated.  No aircraft contributes to its own estimate: the class of a flying wing is taken
# from the other flying wing, that of an aircraft with a tail from the other one.  Of these aircraft only the X8 is in
# the data of the prior of drag and power, which is therefore fitted without it.
_OTHER_WING = {
    "zagi": {"lift_slope": 0.893, "oswald": 0.829},
    "x8": {"lift_slope": 0.717, "oswald": 0.9},
}
_OTHER_TAIL = {"aerosonde": {"oswald": 0.75}}
SHEETS_OF: dict[str, AircraftClass] = {
    "aerosonde": replace(TAIL, **_OTHER_TAIL["aerosonde"]),  # of the Ultra Stick
    "zagi": replace(WING, **_OTHER_WING["zagi"]),
    "x8": replace(WING, **_OTHER_WING["x8"]),
    "c172x": TAIL,
}
# Stall speed, m/s, from the Cessna's handbook (48 knots without flaps), as JSBSim's Cessna flies level more slowly.
STALL = {"c172x": 24.7}
# Two-sided probability of the intervals of `Performance`.
INSIDE = 0.95


def sheet_of(name: str) -> DataSheet:
    """Return the data sheet of one of `SHEETS_OF`.

    They include a Cessna, although it is not a small aircraft.
    """
    known = load_aircraft(name)
    top = fastest_level_flight(Fdm(known), AMSL)
    return DataSheet(
        mass=known.mass,
        span=known.wing_span,
        area=known.wing_area,
        cruise=known.airspeed,
        stall=STALL.get(name, known.stall_speed),
        top=0.0 if top is None else top.airspeed,
        bank=known.max_bank,
        volts=known.battery_voltage,
        energy=known.battery_energy if known.battery_voltage else 0.0,
        fuel=known.battery_energy / FUEL_HEAT if not known.battery_voltage else 0.0,
        layout="wing" if name in ("zagi", "x8") else "tail",
    )


def check_intervals(draws: int) -> int:
    """Count the published values of climb, sink and power that are within their data sheet's intervals."""
    print(f"data sheets of published aircraft: intervals of {100.0 * INSIDE:.0f} %, {draws} draws each")
    inside = 0
    with tempfile.TemporaryDirectory() as place:
        for name, kind in SHEETS_OF.items():
            published = performance(load_aircraft(name))
            sheet = sheet_of(name)
            sized = size_aircraft(sheet, name, kind, fit_without("x8adelaide") if name == "x8" else POWER_PRIOR)
            made = make_data_sheet_folder(Path(place) / f"{name}-sheet", sheet, sized=sized)
            drawn = read_draws(made.folder / "draws.csv")
            found = [performance(made, Variation(properties=drawn.properties(k))) for k in range(draws)]
            for what, unit, factor in (("climb", "deg", 180.0 / math.pi), ("sink", "m/s", 1.0), ("power", "W", 1.0)):
                values = factor * np.array([getattr(one, what) for one in found])
                # A drawn aircraft that cannot fly level has no power; its climb is below the smallest.
                low, high = np.nanquantile(values, (0.5 - 0.5 * INSIDE, 0.5 + 0.5 * INSIDE)).tolist()
                true = factor * getattr(published, what)
                inside += (good := low <= true <= high)
                said = "inside" if good else "OUTSIDE"
                estimate = factor * getattr(performance(made), what)
                interval = f"{estimate:.3g} ({low:.3g} to {high:.3g})"
                print(f"  {name:<10} {what:<6} {true:8.3g} {unit:4} sheet {interval}: {said}")
    print(f"  {inside} of {3 * len(SHEETS_OF)} inside")
    return inside


def main() -> None:
    """Print both parts."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.data_sheets")
    parser.add_argument("--sheets", type=int, default=SHEETS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--draws", type=int, default=200)
    args = parser.parse_args()
    check_intervals(args.draws)
    fly_random_sheets(args.sheets, args.seed)


if __name__ == "__main__":
    main()
