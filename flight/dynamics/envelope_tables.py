"""Compute an aircraft's envelope from JSBSim trims, and cache it in the user's cache folder."""

import contextlib
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from platformdirs import user_cache_dir

from aircraft.catalog import Aircraft, model_hash
from aircraft.envelope import POWERS, TABLES, Envelope
from aircraft.uncertainty import SHEET_SOURCE, read_uncertainty
from flight.dynamics.fdm import JSBSIM_VERSION, Fdm
from flight.dynamics.trim import (
    QUANTITIES,
    Trim,
    fastest_level_flight,
    full_throttle_climb,
    idle_descent,
    slowest_level_flight,
    steady_flight,
)
from world.arrays import Floats
from world.errors import FlightError
from world.files import write_atomically

# Version of the file format; increase it with any change of the contents or of their computation.
_SCHEMA_VERSION = 7
# Number of airspeeds in the grid.
_AIRSPEED_COUNT = 11
# Altitudes of the grid, m AMSL.
_GRID_AMSL_M = np.arange(0.0, 9001.0, 1000.0)
# A command that changes accelerations by less has no effect, m/s^2 or rad/s^2; an engine settles to 1e-8.
_MIN_RESPONSE = 1e-5
# Names of all tables in the file.
_TABLE_NAMES = (*TABLES, *POWERS)


def load_envelope(aircraft: Aircraft, *, motor_braking: bool = False) -> Envelope:
    """Return the aircraft's envelope from the cache; compute and cache it first if necessary.

    The cached and the computed envelope are identical. A cache file is replaced if it is unreadable or damaged, or if
    it is for another model, JSBSim or schema. It is not replaced if its folder is not writable. The uncertainty in the
    aircraft's folder is added. For a model made from a data sheet, the lowest airspeeds are raised so that sea level
    has at least the stated stall speed.

    motor_braking: True if the motor may brake the propeller.

    Raises FlightError for a model that JSBSim cannot load.

    >>> from aircraft.catalog import load_aircraft
    >>> climb, descent = load_envelope(load_aircraft("aerosonde")).air_angles(25.0, 500.0)
    >>> print(f"{math.degrees(climb):.1f} degrees up, {math.degrees(descent):.1f} down")
    13.6 degrees up, 7.7 down
    """
    file = cache_file(aircraft, motor_braking)
    # The tables depend on these values; a cache file must contain the same values.
    key = {
        "schema": _SCHEMA_VERSION,
        "aircraft": aircraft.name,
        "model_hash": model_hash(aircraft),
        "motor_braking": motor_braking,
        "jsbsim": JSBSIM_VERSION,
    }
    airspeeds = _grid_airspeeds(aircraft)
    grid = (airspeeds.size, _GRID_AMSL_M.size)
    shapes = dict.fromkeys(("climb", "descent", *POWERS), grid) | {"airspeed": airspeeds.shape}
    tables = read_tables(file, key, {name: shapes.get(name, _GRID_AMSL_M.shape) for name in _TABLE_NAMES})
    if tables is None or not (
        np.array_equal(tables["airspeed"], airspeeds) and np.array_equal(tables["amsl"], _GRID_AMSL_M)
    ):
        tables = compute_tables(aircraft, motor_braking)
        write_tables(file, key, tables)
    uncertainty = read_uncertainty(aircraft.folder)
    if uncertainty is not None and uncertainty.source == SHEET_SOURCE:
        # A model made from a data sheet can fly a few per cent slower than the stall speed of the sheet: scale the
        # lowest airspeeds so that sea level has at least the stated one, up to the highest airspeed of level flight.
        model_speeds = tables["level_speed_min"]
        factor = max(1.0, aircraft.stall_speed / float(model_speeds[0])) if model_speeds[0] > 0.0 else 1.0
        tables["level_speed_min"] = np.asarray(np.minimum(factor * model_speeds, tables["level_speed_max"]).round(9))
    return Envelope(
        source="" if uncertainty is None else uncertainty.source,
        climb_sd=0.0 if uncertainty is None else uncertainty.climb_sd,
        descent_sd=0.0 if uncertainty is None else uncertainty.descent_sd,
        fastest_sd=0.0 if uncertainty is None else uncertainty.max_speed_sd,
        power_sd=0.0 if uncertainty is None else uncertainty.power_sd,
        battery_guessed=uncertainty is not None and uncertainty.battery_guessed,
        climb_guessed=uncertainty is not None and uncertainty.climb_guessed,
        bank_guessed=uncertainty is not None and uncertainty.bank_guessed,
        climb_shortfall=0.0 if uncertainty is None else uncertainty.climb_shortfall,
        aircraft=aircraft.name,
        model_hash=model_hash(aircraft),
        motor_braking=motor_braking,
        max_bank=aircraft.max_bank,
        volts=aircraft.battery_voltage,
        **tables,
    )


def cache_file(aircraft: Aircraft, motor_braking: bool) -> Path:
    """Return the path of the cache file for an aircraft's envelope.

    motor_braking: True if the motor may brake the propeller.
    """
    kind = "braking" if motor_braking else "coasting"
    name = f"envelope-{aircraft.name}-{model_hash(aircraft)[:16]}-{kind}-v{_SCHEMA_VERSION}.json"
    return Path(user_cache_dir("planfly")) / name


def compute_tables(aircraft: Aircraft, motor_braking: bool) -> dict[str, Floats]:
    """Return the tables of `aircraft.envelope.Envelope` by name, with a trim at each grid point.

    The trims are in still standard atmosphere, at 45 degrees latitude, on a course due north.
    motor_braking: True if the motor may brake the propeller.

    Raises FlightError for a model whose elevator or throttle has no effect, because it has no trims.
    """
    fdm = Fdm(aircraft, motor_braking=motor_braking)
    # Elevator and throttle must change an acceleration.
    fdm.move_to(0.0)
    values = fdm.first_guess()
    for name, limit in (("elevator", fdm.surface_limits()[0]), ("throttle", 1.0)):
        index = QUANTITIES.index(name)
        accelerations = []
        for command in (0.5 * limit, limit):
            values[index] = command
            accelerations.append(fdm.apply_trim(values))
        if float(np.abs(accelerations[1] - accelerations[0]).max()) < _MIN_RESPONSE:
            property_name = aircraft.model.commands[index - QUANTITIES.index("elevator")].name
            raise FlightError(
                f"{aircraft.model_file}: the {name} command {property_name} has no effect: it changes no force and no"
                " moment, so level flight cannot be trimmed",
                file=aircraft.model_file,
                field=f"model.command.{name}",
            )
    airspeeds = _grid_airspeeds(aircraft)
    climb = np.full((airspeeds.size, _GRID_AMSL_M.size), math.nan)
    descent = climb.copy()
    powers = {name: climb.copy() for name in POWERS}
    min_level_speed, max_level_speed = np.full(_GRID_AMSL_M.size, math.nan), np.full(_GRID_AMSL_M.size, math.nan)
    for altitude_index, amsl in enumerate(_GRID_AMSL_M.tolist()):
        last_climb: Trim | None = None
        last_descent: Trim | None = None
        level_trims: list[Trim] = []
        # From fast to slow, because the slowest airspeed may have no trim, and each trim starts from its neighbor.
        for airspeed_index in reversed(range(airspeeds.size)):
            airspeed = float(airspeeds[airspeed_index])
            if trim := full_throttle_climb(fdm, airspeed, amsl, last_climb):
                last_climb, climb[airspeed_index, altitude_index] = trim, trim.climb
                powers["power_full"][airspeed_index, altitude_index] = _battery_power(fdm, trim)
            if trim := idle_descent(fdm, airspeed, amsl, last_descent):
                last_descent, descent[airspeed_index, altitude_index] = trim, -trim.climb
                powers["power_idle"][airspeed_index, altitude_index] = _battery_power(fdm, trim)
            if trim := steady_flight(fdm, airspeed, amsl, initial_trim=level_trims[-1] if level_trims else None):
                level_trims.append(trim)
                powers["power_level"][airspeed_index, altitude_index] = _battery_power(fdm, trim)
        min_level_speed[altitude_index], max_level_speed[altitude_index] = _level_speed_range(fdm, amsl, level_trims)
    # A trim is accurate to about 1e-11; nine decimals are the same on every machine.
    return {
        "airspeed": airspeeds,
        "amsl": _GRID_AMSL_M,
        "climb": climb.round(9),
        "descent": descent.round(9),
        "level_speed_min": min_level_speed.round(9),
        "level_speed_max": max_level_speed.round(9),
        **{name: table.round(6) for name, table in powers.items()},
    }


def _level_speed_range(fdm: Fdm, amsl: float, level_trims: Sequence[Trim]) -> tuple[float, float]:
    """Return the lowest and the highest airspeed of level flight at an altitude, m/s; NaN if not found.

    amsl: altitude, m.
    level_trims: level flights at the airspeeds of the grid, fastest first.

    A search that fails, or that ends at an airspeed below the fastest level flight of the grid, is repeated from the
    nearest level flight of the grid. If the wing stalls before the elevator reaches its stop, no search finds the
    slowest flight; the result is then the slowest level flight of the grid.
    """
    slowest_trim, fastest_trim = slowest_level_flight(fdm, amsl), fastest_level_flight(fdm, amsl)
    if level_trims:
        if fastest_trim is None or fastest_trim.airspeed < level_trims[0].airspeed:
            fastest_trim = fastest_level_flight(fdm, amsl, level_trims[0]) or level_trims[0]
        slowest_trim = slowest_trim or slowest_level_flight(fdm, amsl, level_trims[-1]) or level_trims[-1]
    if slowest_trim is None or fastest_trim is None:
        return math.nan, math.nan
    return slowest_trim.airspeed, fastest_trim.airspeed


def _battery_power(fdm: Fdm, trim: Trim) -> float:
    """Return the battery power in a trim, W; for a fuel engine, the heat of the fuel per second."""
    fdm.apply_trim(trim.vector())
    return float(fdm.read().power)


def _grid_airspeeds(aircraft: Aircraft) -> Floats:
    """Return the airspeeds of the grid, m/s, (v,).

    They extend from the stall speed to 5 m/s above the maximum commanded airspeed; both speeds are rounded up.
    """
    return np.linspace(math.ceil(aircraft.stall_speed), math.ceil(aircraft.airspeed_max) + 5.0, _AIRSPEED_COUNT)


# ----------------------------------------------------------------------
# Tables of an aircraft in the user's cache folder, bit for bit equal to the computed tables.


def read_tables(file: Path, key: dict[str, Any], shapes: Mapping[str, tuple[int, ...]]) -> dict[str, Floats] | None:
    """Return the tables that `write_tables` wrote, or None for a damaged file or another key.

    key: values that identify the tables, and that JSON reproduces exactly.
    shapes: shape of each table by its name.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        if {name: content[name] for name in key} != key:
            return None
        # A missing trim is stored as null, because JSON has no NaN; numpy reads it back as NaN.
        tables = {name: np.array(content["tables"][name], dtype=np.float64) for name in shapes}
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return tables if all(tables[name].shape == shape for name, shape in shapes.items()) else None


def write_tables(file: Path, key: dict[str, Any], tables: Mapping[str, Floats]) -> None:
    """Write a cache file completely or not at all; do nothing if disk space or permission is missing.

    key: entries that must agree when the file is read, such as versions.
    tables: tables by name; NaN is written as null.
    """
    values: dict[str, object] = {}
    for name, table in tables.items():
        entries = table.astype(object)
        entries[np.isnan(table)] = None
        values[name] = entries.tolist()
    text = json.dumps(key | {"tables": values}, allow_nan=False)
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(file, text)
