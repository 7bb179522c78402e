"""Read and write the uncertainty of an aircraft.

It consists of factors of its model with standard deviations, and random draws.

Next to the model there is ``uncertainty.toml`` (from a data sheet) or ``posterior.toml`` (from flight logs), and
``draws.csv``. A draw is a random sample of all uncertain properties, and one row of ``draws.csv``; the columns are the
model's properties, such as ``ident/thrust``.
"""

import csv
import io
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from world.arrays import Floats
from world.errors import FlightError, PlanflyError
from world.files import did_you_mean, read_small_file, read_toml, utf8_text

# Files with uncertainties; the first of them that exists is read.
UNCERTAINTY_FILES = ("posterior.toml", "uncertainty.toml")
# Source of a model that was made from a data sheet.
SHEET_SOURCE = "a data sheet"
# File of draws.
DRAWS_FILE = "draws.csv"
# Number of draws in a file.
DRAW_COUNT = 512
# Standard deviation of the logarithm of the power of an aircraft from a data sheet whose file states none: the root
# mean square error of `benchmarks/real_power.py`.
POWER_SD = 0.35
# Largest file of draws, bytes.
MAX_BYTES = 4 * 2**20
# Prefix of the properties.
_PREFIX = "ident/"
# Required keys.
_REQUIRED_KEYS = frozenset({"climb_sd_deg", "descent_sd_deg"})
# Optional keys.
_OPTIONAL_KEYS = frozenset(
    {
        "source",
        "quantity",
        "battery_guessed",
        "climb_guessed",
        "bank_guessed",
        "fastest_sd_mps",
        "power_sd",
        "climb_shortfall_deg",
    }
)
# Further keys of `posterior.toml`, about the logs.
_LOG_KEYS = frozenset(
    {
        "base",
        "mass_kg",
        "seconds",
        "battery_current",
        "airspeed_factor",
        "airspeed_factor_sd",
        "dynamics",
        "held_fixed",
        "log",
        "correlation",
    }
)


@dataclass(frozen=True, slots=True)
class UncertainQuantity:
    """Uncertain property of the model.

    name: name of the property.
    unit: "factor", or the unit of an offset.
    estimate, sd: estimate and standard deviation; for a factor, the median and the standard deviation of its logarithm.
    reason: why the property is uncertain, as a text for users.
    """

    name: str
    unit: str
    estimate: float
    sd: float
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Uncertainty of an aircraft.

    source: where the model comes from: "a data sheet" or "flight logs".
    climb_sd, descent_sd: standard deviations of the steepest climb and descent at cruise, rad.
    quantities: uncertain properties of the model.
    power_sd: standard deviation of the logarithm of the power in flight.
    max_speed_sd: standard deviation of the fastest level flight, m/s.
    battery_guessed: True if the battery's energy was not stated.
    climb_guessed: True if the steepest climb was not stated.
    bank_guessed: True if the bank limit was not stated.
    climb_shortfall: climb stated at the throttle limit minus the model's climb, rad; 0 if the model reaches it.
    """

    source: str
    climb_sd: float
    descent_sd: float
    quantities: tuple[UncertainQuantity, ...] = ()
    power_sd: float = 0.0
    battery_guessed: bool = False
    max_speed_sd: float = 0.0
    climb_guessed: bool = False
    bank_guessed: bool = False
    climb_shortfall: float = 0.0


def read_uncertainty(folder: Path) -> Uncertainty | None:
    """Read the uncertainty in an aircraft's folder; return None if the folder has no such file.

    Raises FlightError if the file cannot be read or used.

    >>> from aircraft.catalog import load_aircraft
    >>> read_uncertainty(load_aircraft("aerosonde").folder) is None
    True
    """
    file = next((folder / name for name in UNCERTAINTY_FILES if (folder / name).is_file()), None)
    if file is None:
        return None
    try:
        table = read_toml(file, "uncertainty")
    except OSError as error:
        raise FlightError(f"{file}: {error.strerror}", file=file) from None
    except ValueError as error:
        raise FlightError(f"{file}: {' '.join(str(error).split())}", file=file) from None
    source = table.get("source", "flight logs" if file.name == UNCERTAINTY_FILES[0] else SHEET_SOURCE)
    if not isinstance(source, str) or not source.strip():
        raise FlightError.at(str(file), "source", source, "expected a text", shown=repr(source))
    # If a required key were missing, the model would seem certain.
    known_keys = _REQUIRED_KEYS | _OPTIONAL_KEYS | (_LOG_KEYS if file.name == UNCERTAINTY_FILES[0] else frozenset())
    missing, unknown = sorted(_REQUIRED_KEYS - table.keys()), sorted(table.keys() - known_keys)
    suggestion = did_you_mean(unknown[0], sorted(known_keys - table.keys())) if unknown else ""
    # A misspelled key is missing, too: in this case report the spelling.
    if missing and not suggestion:
        raise FlightError(f"{file}: missing {', '.join(missing)}", file=file, field=missing[0])
    if unknown:
        message = f"{file}: unknown key {', '.join(unknown)}{suggestion}"
        raise FlightError(message, file=file, field=unknown[0], value=table[unknown[0]])
    climb_sd, descent_sd = (
        math.radians(_read_number(table, key, file, 0.0, 45.0)) for key in ("climb_sd_deg", "descent_sd_deg")
    )
    guesses = {name: table.get(name, False) for name in ("battery_guessed", "climb_guessed", "bank_guessed")}
    for name, value in guesses.items():
        if not isinstance(value, bool):
            raise FlightError.at(str(file), name, value, "expected true or false", shown=repr(value))
    entries = table.get("quantity", [])
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise FlightError.at(str(file), "quantity", entries, "expected [[quantity]] tables", shown=repr(entries)[:60])
    quantities = []
    for entry in entries:
        name = entry.get("property")
        _check_name(name, str(file), "property")
        estimate, sd = (_read_number(entry, key, file, low, 1e6) for key, low in (("estimate", -1e6), ("sd", 0.0)))
        unit, reason = str(entry.get("unit", "factor")), str(entry.get("reason", ""))
        quantities.append(UncertainQuantity(str(name), unit, estimate, sd, reason))
    power_sd = POWER_SD if file.name == UNCERTAINTY_FILES[1] else 0.0
    if "power_sd" in table:
        power_sd = _read_number(table, "power_sd", file, 0.0, 1.0)
    # Older folders have no fastest_sd_mps.
    max_speed_sd = _read_number(table, "fastest_sd_mps", file, 0.0, 100.0) if "fastest_sd_mps" in table else 0.0
    shortfall = _read_number(table, "climb_shortfall_deg", file, 0.0, 125.0) if "climb_shortfall_deg" in table else 0.0
    return Uncertainty(
        source,
        climb_sd,
        descent_sd,
        tuple(quantities),
        power_sd,
        max_speed_sd=max_speed_sd,
        climb_shortfall=math.radians(shortfall),
        **guesses,
    )


def _read_number(table: dict[str, Any], key: str, file: Path, min_value: float, max_value: float) -> float:
    """Return a number in a table. Raises FlightError if it is missing or out of range."""
    value = table.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not min_value <= value <= max_value:
        raise FlightError.at(
            str(file), key, value, f"expected a number from {min_value:g} to {max_value:g}", shown=repr(value)
        )
    return float(value)


def _check_name(name: object, file: str, key: str, error: type[PlanflyError] = FlightError) -> None:
    """Raise `error` unless a name has the form ``ident/NAME`` of a property."""
    # JSBSim aborts the process on a name with a space in it.
    if not isinstance(name, str) or not name.startswith(_PREFIX) or not name.isascii() or len(name.split()) != 1:
        raise error.at(file, key, name, f"expected a property {_PREFIX}NAME", shown=repr(name))


def uncertainty_text(uncertainty: Uncertainty) -> str:
    """Return an uncertainty as the text of an ``uncertainty.toml``."""
    lines = [
        "# Uncertain properties of this aircraft.  Each property is a factor in the model; 1 is the estimate.",
        "",
        f'source = "{uncertainty.source}"',
        f"climb_sd_deg = {math.degrees(uncertainty.climb_sd):.2f}    # of the steepest climb at cruise, one standard"
        " deviation",
        f"descent_sd_deg = {math.degrees(uncertainty.descent_sd):.2f}  # of the steepest descent",
        f"fastest_sd_mps = {uncertainty.max_speed_sd:.2f}  # of the fastest level flight",
        f"power_sd = {uncertainty.power_sd:.3g}  # of the logarithm of the power in flight",
    ]
    if uncertainty.climb_shortfall:
        shortfall = math.degrees(uncertainty.climb_shortfall)
        lines.append(
            f"climb_shortfall_deg = {shortfall:.2f}  # the climb stated at the throttle limit is steeper by this"
        )
    if uncertainty.climb_guessed:
        lines.append("climb_guessed = true  # state the true value with --climb")
    if uncertainty.bank_guessed:
        lines.append("bank_guessed = true  # of max_bank_deg; state the true value with --bank")
    if uncertainty.battery_guessed:
        lines.append("battery_guessed = true  # to judge energy, state battery_wh and remove this line")
    for quantity in uncertainty.quantities:
        reason = quantity.reason.replace("\\", "/").replace('"', "'")
        lines += [
            "",
            "[[quantity]]",
            f'property = "{quantity.name}"',
            f'unit = "{quantity.unit}"',
            f"estimate = {quantity.estimate:.6g}",
            f"sd = {quantity.sd:.4g}",
            f'reason = "{reason}"',
        ]
    return "\n".join(lines) + "\n"


# ----------------------------------------------------------------------
# Draws: whole aircraft, each a row of values.


@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """Draws (random samples) of an aircraft's properties.

    names: names of the p properties.
    values: one draw per row, (n, p).
    source: path of the file.
    """

    names: tuple[str, ...]
    values: Floats = field(compare=False)
    source: str = ""

    def row(self, seed: int) -> int:
        """Return the row number of the draw for a flight with a seed."""
        return seed % len(self.values)

    def properties(self, seed: int) -> tuple[tuple[str, float], ...]:
        """Return the names and values of the properties in the draw for a flight with a seed."""
        return tuple(zip(self.names, self.values[self.row(seed)].tolist(), strict=True))


def draw_quantities(quantities: tuple[UncertainQuantity, ...], count: int = DRAW_COUNT, seed: int = 1) -> Draws:
    """Draw each quantity independently, `count` times.

    A factor is drawn from a log-normal distribution with its estimate as the median, any other value from a normal
    distribution.

    >>> one = UncertainQuantity("ident/thrust", "factor", 1.0, 0.2)
    >>> drawn = draw_quantities((one,)).values
    >>> bool(drawn.min() > 0.0), round(float(np.median(drawn)), 1), round(float(np.log(drawn).std()), 1)
    (True, 1.0, 0.2)
    """
    normals = np.random.default_rng(seed).standard_normal((count, len(quantities)))
    values = np.empty_like(normals)
    for k, quantity in enumerate(quantities):
        if quantity.unit == "factor":
            values[:, k] = quantity.estimate * np.exp(quantity.sd * normals[:, k])
        else:
            values[:, k] = quantity.estimate + quantity.sd * normals[:, k]
    return Draws(tuple(quantity.name for quantity in quantities), values.round(6))


def draws_text(draws: Draws) -> str:
    """Return draws as the text of a ``draws.csv``."""
    lines = [",".join(draws.names), *(",".join(f"{value:.9g}" for value in row) for row in draws.values.tolist())]
    return "\n".join(lines) + "\n"


def read_draws(path: Path, error: type[PlanflyError] = FlightError) -> Draws:
    """Read random samples of an aircraft's properties from a ``draws.csv``, for a Monte Carlo campaign.

    The first line names the properties; each further line holds one value for each of them.
    Raises ``error``, with the line number, if the file cannot be read or used.
    """
    text = utf8_text(read_small_file(path, MAX_BYTES, "draws", error), path, error)
    reader = csv.reader(io.StringIO(text))
    try:
        rows = [(reader.line_num, row) for row in reader if row]
    except csv.Error:
        allowed = f"lines end with LF or CR LF, and a field has at most {csv.field_size_limit()} characters"
        raise error(f"{path}:{reader.line_num}: {allowed}", file=path, allowed=allowed) from None
    if len(rows) < 2:
        message = f"{path}: expected a line of properties and at least one of values"
        raise error(message, file=path)
    header_line, header = rows[0]
    names = tuple(name.strip() for name in header)
    for name in names:
        _check_name(name, f"{path}:{header_line}", "property", error)
    values = []
    for line_number, row in rows[1:]:
        try:
            numbers = [float(value) for value in row]
        except ValueError:
            numbers = []
        if len(numbers) != len(names) or not all(map(math.isfinite, numbers)):
            allowed = f"expected {len(names)} finite numbers"
            raise error(f"{path}:{line_number}: {','.join(row)[:60]}: {allowed}", file=path, value=row, allowed=allowed)
        values.append(numbers)
    return Draws(names, np.array(values), str(path))
