"""Define the allowed numbers and words of arguments, for keywords of the API and command-line options."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from flight.autopilots.catalog import autopilot_names
from planfly.workflow.output_paths import MAX_BY_PROGRAM
from world.errors import ArgumentError


class Range(NamedTuple):
    """Range of allowed values of a number.

    low, high: minimum and maximum, both allowed unless `above` or `below` excludes them.
    expected: text that an error states, such as "expected a share from 0 to 1".
    integer: True if only whole numbers are allowed.
    above: True if the value must be above ``low``.
    below: True if the value must be below ``high``.
    """

    low: float
    high: float
    expected: str
    integer: bool = False
    above: bool = False
    below: bool = False

    def allows(self, value: Any) -> bool:
        """Return True if a value is a number in the range; True, False and texts are not numbers.

        >>> Range(0, 20, "a whole number", integer=True).allows(3), Range(0, 1, "a share").allows(float("nan"))
        (True, False)
        >>> Range(0, 20, "a number").allows("3")
        False
        """
        try:
            number = int(value) if self.integer else float(value)
        except (TypeError, ValueError, OverflowError):
            return False
        if isinstance(value, bool | str) or (self.integer and number != value):
            return False
        is_inside = self.low <= number <= self.high
        return is_inside and not (self.above and number == self.low) and not (self.below and number == self.high)


# Range of times, s.
_TIME_RANGE_S = Range(0.0, 1e7, "expected a time from 0 to 10,000,000 s")
# Range of positive numbers.
_POSITIVE_RANGE = Range(0.0, 1e6, "expected a number above 0, up to 1,000,000", above=True)
# Range of numbers of items.
_COUNT_RANGE = Range(1, 1000, "expected a whole number from 1 to 1,000", integer=True)
# Range of probabilities to prove.
_PROBABILITY_RANGE = Range(0.5, 1.0, "expected at least 0.5 and below 1", below=True)

# Range for each keyword.  Values that a scenario file also limits (wind, turbulence, airspeed, guidance) are checked
# there.
RANGES: Mapping[str, Range] = {
    "seed": Range(0, 2**63 - 1, "expected a whole number from 0 to 2^63 - 1", integer=True),
    "refine": Range(0, 20, "expected a whole number from 0 to 20", integer=True),
    "budget": Range(4, 10**10, "expected a whole number of evaluations, 4..10^10", integer=True),
    "generations": Range(1, 10**9, "expected a whole number of generations, 1 or more", integer=True),
    "evaluations": Range(1, 10**10, "expected a whole number of evaluations, 1 or more", integer=True),
    "seconds": Range(0.0, 1e6, "expected a number of seconds above 0, up to 1,000,000", above=True),
    "front": Range(2, 100, "expected a whole number of plans, 2 to 100", integer=True),
    "at_leg": Range(0, 10_000, "expected the number of a leg, 0 or more", integer=True),
    "airspeed": _POSITIVE_RANGE,
    "until": _TIME_RANGE_S,
    "max_hours": _POSITIVE_RANGE,
    "max_log": _POSITIVE_RANGE,
    "speed": _POSITIVE_RANGE,
    "served_speed": Range(0.1, 100.0, "expected a number from 0.1 to 100"),
    "wait": _POSITIVE_RANGE,
    "start": _TIME_RANGE_S,
    "end": _TIME_RANGE_S,
    "port": Range(0, 65535, "expected a port 0..65535", integer=True),
    "flight": _COUNT_RANGE,
    "runs": _COUNT_RANGE,
    "jobs": _COUNT_RANGE,
    "workers": _COUNT_RANGE,
    "prove": _PROBABILITY_RANGE,
    "at_least": _PROBABILITY_RANGE,
    "confidence": _PROBABILITY_RANGE,
    "probability": _PROBABILITY_RANGE,
    "sample_flights": Range(20, 100_000, "expected a whole number from 20 to 100,000", integer=True),
    "max_speed": Range(1.0, 300.0, "expected a speed from 1 to 300 m/s"),
    "window_flights": Range(10, 10_000, "expected a whole number from 10 to 10,000", integer=True),
    "reserve": Range(0.0, 0.9, "expected a fraction of the battery from 0 to 0.9"),
    "specific_energy": Range(20.0, 2000.0, "expected an energy per battery mass from 20 to 2,000 Wh/kg"),
    "flights": Range(1, 10_000_000, "expected a whole number from 1 to 10,000,000", integer=True),
    "index": Range(0, 10**9 - 1, "expected the number of a flight, 0 or more", integer=True),
    "directions": Range(4, 72, "expected a whole number from 4 to 72", integer=True),
    "points": Range(1, MAX_BY_PROGRAM, f"expected 1 to {MAX_BY_PROGRAM} returns", integer=True),
    "every": Range(0.1, 3600.0, "expected a time from 0.1 to 3,600 s"),
    "frequency": Range(30.0, 15_000.0, "expected a frequency from 30 to 15,000 MHz"),
    "power": Range(-30.0, 60.0, "expected a power from -30 to 60 dBm"),
    "sensitivity": Range(-150.0, 0.0, "expected a power from -150 to 0 dBm"),
    "antenna": Range(0.5, 500.0, "expected a height above ground from 0.5 to 500 m"),
    "station_gain": Range(-20.0, 60.0, "expected a gain from -20 to 60 dBi"),
    "aircraft_gain": Range(-20.0, 60.0, "expected a gain from -20 to 60 dBi"),
    "cable_loss": Range(0.0, 60.0, "expected a loss from 0 to 60 dB"),
    "fade_margin": Range(0.0, 60.0, "expected a margin from 0 to 60 dB"),
    "max_outage": Range(0.0, 3600.0, "expected a time from 0 to 3,600 s"),
    "most": Range(1.0, 40.0, "expected a speed from 1 to 40 m/s"),
    "margin": Range(0.0, 100.0, "expected a distance from 0 to 100 km"),
    "height": Range(1.0, 5000.0, "expected a height above ground from 1 to 5,000 m"),
    "width": Range(1, 10_000, "expected a whole number of characters, 1 to 10,000", integer=True),
    "population": Range(4, 10**6, "expected an even whole number from 4 to 1,000,000", integer=True),
}
# Allowed words for each keyword.
CHOICES: Mapping[str, tuple[Any, ...]] = {
    "turbulence": ("none", "light", "moderate"),
    "guidance": ("path", "l1", "vector-field"),
    "autopilot": autopilot_names(),
    "nav": ("perfect", "rtk", "gnss"),
    "engine": ("auto", "jsbsim"),
    "log_hz": (60, 30, 20, 10),
    "datum": ("amsl", "ellipsoid"),
    "population_unit": ("per-cell", "per-km2"),
    "use": ("telemetry", "control"),
    "problems": (7, 15, 30, 60),
}


def check_arguments(**arguments: Any) -> None:
    """Raise ArgumentError for the first argument that is outside its range or not an allowed word.

    arguments: value of each argument, keyed by its name in `RANGES` or `CHOICES`; None if it was not given.  For a name
        in `CHOICES`, the value may also be a tuple of several allowed words.

    >>> check_arguments(seed=3, log_hz=60, max_hours=None)
    >>> check_arguments(directions=3)
    Traceback (most recent call last):
    world.errors.ArgumentError: directions 3: expected a whole number from 4 to 72
    """
    for name, value in arguments.items():
        if value is None:
            continue
        if name in CHOICES:
            values = value if isinstance(value, tuple) else (value,)
            if values and all(choice in CHOICES[name] for choice in values):
                continue
            allowed = f"expected {', '.join(map(str, CHOICES[name]))}"
        elif RANGES[name].allows(value):
            continue
        else:
            allowed = RANGES[name].expected
        shown = repr(value) if isinstance(value, str) and name in RANGES else None
        raise ArgumentError.of_argument(_KEYWORDS_IN_MESSAGES.get(name, name), value, allowed, shown=shown)


# Keywords in messages, for entries of `RANGES` whose keyword has another range in other calls.
_KEYWORDS_IN_MESSAGES = {"served_speed": "speed", "front": "count", "sample_flights": "flights"}


# Largest sensor size across and along the track, and longest focal length, mm.
_MAX_CAMERA_SIZES_MM = (1000.0, 1000.0, 10_000.0)
# Description of the numbers of a camera, in messages.
CAMERA_FORMAT = (
    "the sensor's size across and along the track and the focal length, mm, and optionally the overlaps along and"
    " across, %"
)


def is_valid_wind(speed: float, from_deg: float) -> bool:
    """Return True if the speed and the direction of a wind are allowed; NaN is not allowed.

    speed: wind speed, allowed from 0 to 40 m/s.
    from_deg: direction from which the wind blows, allowed from -360 to 360 degrees.

    >>> is_valid_wind(8.0, 270.0), is_valid_wind(float("nan"), 0.0)
    (True, False)
    """
    return 0.0 <= speed <= 40.0 and -360.0 <= from_deg <= 360.0


def is_valid_position(lat: float, lon: float) -> bool:
    """Return True if a latitude (-89 to 89 degrees) and a longitude (-180 to 180 degrees) are allowed.

    >>> is_valid_position(-33.9, 18.4), is_valid_position(91.0, 0.0)
    (True, False)
    """
    return -89.0 <= lat <= 89.0 and -180.0 <= lon <= 180.0


def parse_position(keyword: str, coordinates: Sequence[float]) -> tuple[float, float]:
    """Return a latitude and a longitude as two numbers, degrees.

    keyword: name of the argument, for the message.
    coordinates: latitude and longitude, as numbers or as texts of numbers.
    Raises ArgumentError for other input, and for a position that is not allowed.

    >>> parse_position("station", ["46", 8])
    (46.0, 8.0)
    >>> parse_position("station", (46.0,))
    Traceback (most recent call last):
    world.errors.ArgumentError: station (46.0,): expected latitude -89..89 and longitude -180..180
    """
    try:
        if isinstance(coordinates, str | bytes):
            raise TypeError
        lat, lon = (float(value) for value in coordinates)
    except (TypeError, ValueError):
        lat = lon = math.nan
    if not is_valid_position(lat, lon):
        raise ArgumentError.of_argument(keyword, coordinates, "expected latitude -89..89 and longitude -180..180")
    return lat, lon


def is_valid_camera(numbers: Sequence[float]) -> bool:
    """Return True if three or five numbers describe a camera within the allowed ranges.

    The numbers are the sensor size across and along the track (mm), the focal length (mm), and optionally the overlaps
    with the next photo and with the next line (percent).

    >>> is_valid_camera((23.5, 15.6, 16.0)), is_valid_camera((23.5, 15.6, 16.0, 75.0, 60.0))
    (True, True)
    >>> is_valid_camera((23.5, 15.6, 0.0))
    False
    """
    if len(numbers) not in (3, 5) or not all(
        0.0 < number <= limit for number, limit in zip(numbers, _MAX_CAMERA_SIZES_MM, strict=False)
    ):
        return False
    return all(0.0 <= number < 100.0 for number in numbers[3:])
