"""Read the quantities that vary in a campaign and their distributions, and draw them for each flight.

Dispersions are read from a TOML file with one table per quantity, named as in `QUANTITIES`.  `distribution` is the name
of a distribution of `scipy.stats`, the other keys are its parameters, and `source` states the source of the numbers:

    [wind_speed]
    distribution = "norm"
    scale = 1.5
    source = "two years of the airfield's records"

``[aircraft] draws = "mine/draws.csv"`` names a file of draws of the whole aircraft, relative to the dispersions file:
each flight uses one of its rows, chosen by the flight's own seed, instead of factors on drag and control power.
"""

import hashlib
import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from aircraft.uncertainty import Draws, read_draws
from world.arrays import Floats
from world.errors import PlanflyError
from world.files import read_small_file, toml_table, utf8_text

# ----------------------------------------------------------------------
# Quantities that may vary between the flights of a campaign, with their unit, effect on the flight, and range.


class Quantity(NamedTuple):
    """Quantity that is drawn once per flight.

    name: name of the quantity's table in a dispersions file, and of its column in the table of flights.
    combine: "added" if the drawn number is added to the scenario's value, "factor" if it multiplies that value.
    unit: unit of an added value; "" for a factor.
    low, high: minimum and maximum value that may be drawn; values outside this range are unrealistic.
    integer: True for a whole number of steps, which needs a discrete distribution.
    title: name shown to the user.
    """

    name: str
    combine: Literal["added", "factor"]
    unit: str
    low: float
    high: float
    title: str
    integer: bool = False

    @property
    def nominal(self) -> float:
        """Value that leaves the flight unchanged."""
        return 1.0 if self.combine == "factor" else 0.0


# All numbers of a flight are drawn in this order, even if they do not vary, so that no quantity affects another.
QUANTITIES = (
    Quantity("wind_speed", "added", "m/s", -40.0, 40.0, "wind speed"),
    Quantity("wind_from", "added", "deg", -180.0, 180.0, "wind direction"),
    Quantity("wind_gradient", "added", "1/s", -0.05, 0.05, "wind gradient"),
    Quantity("turbulence", "added", "levels", -2.0, 2.0, "turbulence", integer=True),
    Quantity("mass", "factor", "", 0.5, 2.0, "mass"),
    Quantity("drag", "factor", "", 0.3, 3.0, "drag"),
    Quantity("control_power", "factor", "", 0.25, 2.0, "control power"),
    Quantity("battery", "factor", "", 0.05, 1.5, "battery"),
    Quantity("terrain_height", "added", "m", -100.0, 100.0, "terrain height"),
    Quantity("start_east", "added", "m", -200.0, 200.0, "start position east"),
    Quantity("start_north", "added", "m", -200.0, 200.0, "start position north"),
    Quantity("start_up", "added", "m", -100.0, 100.0, "start altitude"),
)
# Quantities by name.
QUANTITY_BY_NAME = {quantity.name: quantity for quantity in QUANTITIES}
# Names of the quantities, in the order of the draws.
NAMES = tuple(QUANTITY_BY_NAME)


# Quantities that draws of the whole aircraft replace.
QUANTITIES_OF_DRAWS = ("drag", "control_power")
# Name of the table with the file of draws.
_DRAWS_TABLE = "aircraft"
# Minimum fraction of a distribution within the range of its quantity; the rest of the distribution is never drawn.
MIN_FRACTION_INSIDE = 0.99
# Maximum size of a dispersions file, bytes.
MAX_DISPERSIONS_BYTES = 100_000
# Name of the default dispersions in messages and reports.
DEFAULT_DISPERSIONS_NAME = "planfly's default dispersions"


class SpreadError(PlanflyError):
    """Raised for dispersions that cannot be used."""


@dataclass(frozen=True)
class VaryingQuantity:
    """Quantity with its distribution.

    distribution: name in `scipy.stats`.
    parameters: keyword arguments of the distribution in `scipy.stats`.
    source: where the numbers come from, as stated in the dispersions file.
    """

    quantity: Quantity
    distribution: str
    parameters: tuple[tuple[str, float], ...]
    source: str

    @cached_property
    def _scipy_distribution(self) -> Any:
        """Distribution of scipy.stats with the quantity's parameters."""
        from scipy import stats

        return getattr(stats, self.distribution)(**dict(self.parameters))

    @cached_property
    def _range_probabilities(self) -> tuple[float, float]:
        """Cumulative probability of the distribution below, and up to the end of, the quantity's range."""
        min_value = self.quantity.low - (0.5 if self.quantity.integer else 0.0)
        return float(self._scipy_distribution.cdf(min_value)), float(self._scipy_distribution.cdf(self.quantity.high))

    @property
    def fraction_inside(self) -> float:
        """Fraction of the distribution within the quantity's range, 0 to 1; NaN for invalid parameters."""
        lower_probability, upper_probability = self._range_probabilities
        return upper_probability - lower_probability

    def value(self, fraction: float) -> float:
        """Return a quantile of the distribution truncated to the quantity's range.

        fraction: cumulative probability of the quantile, 0 to 1.

        >>> mass = VaryingQuantity(QUANTITY_BY_NAME["mass"], "uniform", (("loc", 0.9), ("scale", 0.2)), "by hand")
        >>> round(mass.value(0.25), 6)
        0.95
        """
        return float(self.values(np.array([fraction]))[0])

    def values(self, fractions: Floats) -> Floats:
        """Return the quantiles of cumulative probabilities (n,), as `value` does, (n,)."""
        lower_probability, upper_probability = self._range_probabilities
        values = self._scipy_distribution.ppf(lower_probability + fractions * (upper_probability - lower_probability))
        return np.clip(values, self.quantity.low, self.quantity.high)


@dataclass(frozen=True)
class Dispersions:
    """All varying quantities, in the order of `QUANTITIES`.

    name: source of the dispersions, in messages.
    draws: draws of the whole aircraft, one for each flight; None if drag and control power vary separately.
    """

    varying: tuple[VaryingQuantity, ...]
    name: str
    draws: Draws | None = None

    def without(self, names: tuple[str, ...]) -> "Dispersions":
        """Return the dispersions without the quantities that have one of the names."""
        return replace(self, varying=tuple(varying for varying in self.varying if varying.quantity.name not in names))

    def with_draws(self, draws: Draws) -> "Dispersions":
        """Return the dispersions with draws of the aircraft instead of drag and control power.

        >>> import numpy as np
        >>> made = default_dispersions().with_draws(Draws(("ident/thrust",), np.array([[1.1]]), "mine/draws.csv"))
        >>> [one.quantity.name for one in made.varying][3:5], made.to_json()["aircraft"]["rows"]
        (['mass', 'battery'], 1)
        """
        return replace(self.without(QUANTITIES_OF_DRAWS), draws=draws)

    def to_json(self) -> dict[str, dict[str, Any]]:
        """Return plain data with a table for each quantity, and one for the aircraft's draws.

        The latter is left out without such draws.
        """
        tables: dict[str, dict[str, Any]] = {
            varying.quantity.name: {
                "distribution": varying.distribution,
                **dict(varying.parameters),
                "source": varying.source,
            }
            for varying in self.varying
        }
        if self.draws is not None:
            tables[_DRAWS_TABLE] = {
                "draws": Path(self.draws.source).name,
                "rows": len(self.draws.values),
                "properties": list(self.draws.names),
                "sha256": hashlib.sha256(self.draws.values.tobytes()).hexdigest(),
            }
        return tables


def default_dispersions() -> Dispersions:
    """Return the default dispersions of campaigns.

    >>> [one.quantity.name for one in default_dispersions().varying][:3]
    ['wind_speed', 'wind_from', 'wind_gradient']
    """
    text = (resources.files("planfly.campaigns") / "default_dispersions.toml").read_text(encoding="utf-8")
    return parse_dispersions(text, DEFAULT_DISPERSIONS_NAME)


def read_dispersions(path: Path) -> Dispersions:
    """Read a dispersions file. Raises SpreadError for a file that cannot be read or used."""
    return parse_dispersions(
        utf8_text(read_small_file(path, MAX_DISPERSIONS_BYTES, "dispersions", SpreadError), path, SpreadError),
        str(path),
    )


def parse_dispersions(text: str, name: str) -> Dispersions:
    r"""Parse the text of a dispersions file.  name: name of the file in messages.

    Raises SpreadError, with a one-line message, for a text that is not TOML, an unknown quantity, an unknown
    distribution, an unknown or invalid parameter of the distribution, and a distribution outside the quantity's range.

    >>> parse_dispersions('[mass]\ndistribution = "norm"\nloc = 9.0\nscale = 0.1\nsource = "a guess"', "mine.toml")
    Traceback (most recent call last):
    ...
    planfly.campaigns.dispersions.SpreadError: mine.toml: mass: norm(loc=9, scale=0.1): only 0.0 % ... 0.5..2 ...
    """
    try:
        tables = toml_table(text)
    except ValueError as error:
        raise SpreadError(f"{name}: {' '.join(str(error).split())}", file=name) from None
    aircraft = tables.pop(_DRAWS_TABLE, None)
    unknown_names = [key for key in tables if key not in QUANTITY_BY_NAME]
    if unknown_names:
        allowed = f"unknown; it is one of {', '.join((*NAMES, _DRAWS_TABLE))}"
        raise SpreadError.at(name, unknown_names[0], tables[unknown_names[0]], allowed, shown="")
    varying = tuple(_parse_quantity(QUANTITY_BY_NAME[key], tables[key], name) for key in NAMES if key in tables)
    if not varying and aircraft is None:
        raise SpreadError(f"{name}: nothing varies; give at least one of {', '.join(NAMES)}", file=name)
    if aircraft is None:
        return Dispersions(varying, name)
    for quantity_dispersion in varying:
        if quantity_dispersion.quantity.name in QUANTITIES_OF_DRAWS:
            raise SpreadError.at(
                name,
                quantity_dispersion.quantity.name,
                None,
                f"cannot be combined with [{_DRAWS_TABLE}] draws",
                shown="",
            )
    file_name = aircraft.get("draws") if isinstance(aircraft, dict) else None
    if not isinstance(file_name, str) or not file_name or (isinstance(aircraft, dict) and len(aircraft) > 1):
        allowed = 'expected only a file of draws, such as draws = "mine/draws.csv"'
        raise SpreadError.at(name, f"{_DRAWS_TABLE}.draws", aircraft, allowed, shown="")
    return Dispersions(varying, name, read_draws(Path(name).parent / Path(file_name).expanduser(), SpreadError))


def _parse_quantity(quantity: Quantity, quantity_table: Any, name: str) -> VaryingQuantity:
    """Parse the table of a quantity into its distribution.

    name: file name for error messages.

    Raises SpreadError for an invalid table.
    """
    from scipy import stats

    if not isinstance(quantity_table, dict):
        allowed = "expected a table, with distribution, its parameters, and source"
        raise SpreadError.at(name, quantity.name, quantity_table, allowed, shown="")
    parameters = dict(quantity_table)
    distribution = parameters.pop("distribution", None)
    source = parameters.pop("source", None)
    if not isinstance(distribution, str):
        allowed = "missing; expected the name of one of scipy.stats' distributions"
        raise SpreadError.at(name, f"{quantity.name}.distribution", distribution, allowed, shown="")
    # A quantity of whole numbers needs a discrete distribution.
    scipy_distribution: Any = getattr(stats, distribution, None)
    if not isinstance(scipy_distribution, stats.rv_discrete if quantity.integer else stats.rv_continuous):
        kind_text = "a discrete" if quantity.integer else "a continuous"
        example = "randint" if quantity.integer else "norm"
        allowed = f"expected {kind_text} distribution of scipy.stats, such as {example}"
        raise SpreadError.at(name, f"{quantity.name}.distribution", distribution, allowed, shown=repr(distribution))
    if not isinstance(source, str) or not source.strip():
        allowed = "missing; state the source of the numbers"
        raise SpreadError.at(name, f"{quantity.name}.source", source, allowed, shown="")
    shape_names = scipy_distribution.shapes.replace(",", " ").split() if scipy_distribution.shapes else []
    parameter_names = [*shape_names, "loc", *(() if quantity.integer else ("scale",))]
    for key, value in parameters.items():
        if key not in parameter_names:
            allowed = f"not a parameter of {distribution}, which has {', '.join(parameter_names)}"
            raise SpreadError.at(name, f"{quantity.name}.{key}", value, allowed, shown="")
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise SpreadError.at(name, f"{quantity.name}.{key}", value, "expected a finite number", shown=repr(value))
    missing_names = [key for key in shape_names if key not in parameters]
    if missing_names:
        allowed = f"missing; {distribution} needs {', '.join(shape_names)}"
        raise SpreadError.at(name, f"{quantity.name}.{missing_names[0]}", None, allowed, shown="")
    varying = VaryingQuantity(
        quantity, distribution, tuple((key, float(value)) for key, value in parameters.items()), source
    )
    fraction = varying.fraction_inside
    if math.isnan(fraction):
        allowed = f"these parameters are invalid for {varying.distribution}"
        raise SpreadError.at(name, varying.quantity.name, _call_text(varying), allowed)
    if not fraction >= MIN_FRACTION_INSIDE:
        allowed = (
            f"only {100.0 * fraction:.1f} % of the distribution lies within {quantity.low:g}..{quantity.high:g}"
            f" {quantity.unit or 'times the nominal value'}; at least {100.0 * MIN_FRACTION_INSIDE:.0f} % must lie"
            " there"
        )
        raise SpreadError.at(name, quantity.name, _call_text(varying), allowed)
    return varying


def _call_text(varying: VaryingQuantity) -> str:
    """Return a distribution with its parameters as text, such as "norm(loc=1, scale=0.05)"."""
    return f"{varying.distribution}({', '.join(f'{key}={value:g}' for key, value in varying.parameters)})"


# Number of quantiles used to compute the mean and standard deviation of a distribution.
_QUANTILE_COUNT = 4096


@dataclass(frozen=True, slots=True)
class Draw:
    """The random numbers of one flight of a campaign.

    index: number of the flight, from 0.
    seed: seed of the turbulence and the navigation error within the flight.
    values: values of all quantities, keyed by name; quantities that do not vary have their nominal value.
    """

    index: int
    seed: int
    values: dict[str, float] = field(hash=False)


def draw_flight(dispersions: Dispersions, seed: int, index: int) -> Draw:
    r"""Draw the values of all quantities for one flight.

    The random numbers are from ``SeedSequence(seed, spawn_key=(index,))``.  Each draw is independent of the others.
    The flights are therefore the same in any order, with any number of workers, and in any part of a campaign.

    seed: seed of the campaign.

    >>> from planfly.campaigns.dispersions import parse_dispersions
    >>> one = parse_dispersions('[mass]\ndistribution = "uniform"\nloc = 0.9\nscale = 0.2\nsource = "by hand"', "x")
    >>> first, again = draw_flight(one, 1, 7), draw_flight(one, 1, 7)
    >>> first == again, first.values["drag"], 0.9 < first.values["mass"] < 1.1
    (True, 1.0, True)
    """
    fractions, flight_seed = _draw_fractions(seed, index)
    varying = {quantity_dispersion.quantity.name: quantity_dispersion for quantity_dispersion in dispersions.varying}
    values = {
        quantity.name: varying[quantity.name].value(fraction) if quantity.name in varying else quantity.nominal
        for quantity, fraction in zip(QUANTITIES, fractions.tolist(), strict=True)
    }
    return Draw(index, flight_seed, values)


def standard_draws(dispersions: Dispersions, seed: int, start: int, stop: int) -> Floats:
    """Return the draws of flights in standard deviations from each quantity's mean, (stop - start, d).

    The flights are drawn as in `draw_flight`.  d is the number of varying quantities that have more than one value.

    seed: seed of the campaign.
    start, stop: index of the first flight, and of the flight after the last.

    >>> from planfly.campaigns.dispersions import default_dispersions
    >>> standard_draws(default_dispersions(), 1, 5, 7).shape
    (2, 11)
    """
    fractions = np.array([_draw_fractions(seed, index)[0] for index in range(start, stop)]).reshape(-1, len(QUANTITIES))
    columns = [QUANTITIES.index(varying.quantity) for varying in dispersions.varying]
    return _standardise(dispersions, fractions[:, columns])


def standard_population(dispersions: Dispersions, count: int) -> Floats:
    """Return evenly spread possible draws, in standard deviations as in `standard_draws`, (count, d).

    The cumulative probabilities are a Sobol sequence, with each point at the center of its cell.

    count: number of points, a power of two.

    >>> from planfly.campaigns.dispersions import default_dispersions
    >>> bool(abs(standard_population(default_dispersions(), 1024).mean(axis=0)).max() < 0.01)
    True
    """
    from scipy.stats import qmc

    quantity_count = len(dispersions.varying)
    fractions = qmc.Sobol(quantity_count, scramble=False).random(count) if quantity_count else np.zeros((count, 0))
    return _standardise(dispersions, fractions + 0.5 / count)


def _draw_fractions(seed: int, index: int) -> tuple[Floats, int]:
    """Draw a cumulative probability, 0 to 1, for each quantity, and the seed used within the flight.

    seed: seed of the campaign.
    index: number of the flight, from 0.
    """
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    return random.random(len(QUANTITIES)), int(random.integers(2**63))


def _standardise(dispersions: Dispersions, fractions: Floats) -> Floats:
    """Convert cumulative probabilities of the varying quantities, (n, v), to standardised values, (n, d).

    The values are in standard deviations from the mean.  A quantity with only one value has no column.

    fractions: a row for each flight, a column for each varying quantity.
    """
    quantiles = (np.arange(_QUANTILE_COUNT) + 0.5) / _QUANTILE_COUNT
    columns = []
    for column, varying in enumerate(dispersions.varying):
        values = varying.values(quantiles)
        if (deviation := float(values.std())) > 0.0:
            columns.append((varying.values(fractions[:, column]) - values.mean()) / deviation)
    return np.column_stack(columns) if columns else np.zeros((len(fractions), 0))
