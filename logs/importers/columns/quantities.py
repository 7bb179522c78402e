"""Define the quantities in a table of columns, with their units, frames and plausible ranges."""

import math
from typing import NamedTuple

# Factor of each unit to SI units and radians, by dimension.
UNITS: dict[str, dict[str, float]] = {
    "angle": {"rad": 1.0, "deg": math.pi / 180.0, "cdeg": math.pi / 18_000.0, "degE7": math.pi / 1.8e9},
    "angular rate": {"rad/s": 1.0, "deg/s": math.pi / 180.0},
    "acceleration": {"m/s2": 1.0, "g": 9.80665, "ft/s2": 0.3048, "cm/s2": 0.01},
    "speed": {"m/s": 1.0, "km/h": 1.0 / 3.6, "kt": 1852.0 / 3600.0, "ft/s": 0.3048, "mph": 0.44704, "cm/s": 0.01},
    "length": {"m": 1.0, "ft": 0.3048, "km": 1000.0, "cm": 0.01, "mm": 0.001},
    "deflection": {"rad": 1.0, "deg": math.pi / 180.0, "fraction": 1.0, "%": 0.01},
    "fraction": {"fraction": 1.0, "%": 0.01, "us": 0.001},
    "voltage": {"V": 1.0, "cV": 0.01, "mV": 0.001},
    "current": {"A": 1.0, "cA": 0.01, "mA": 0.001},
    "pressure": {"Pa": 1.0, "hPa": 100.0, "mbar": 100.0, "kPa": 1000.0},
    "temperature": {"degC": 1.0, "K": 1.0},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "iso": 1.0},
    "ratio": {"": 1.0},
    "mode": {"": 1.0},
}
# Value in the base unit at the zero of a unit; a throttle is idle (0) at a pulse of 1000 us, and full (1) at 2000 us.
UNIT_ZEROS = {"K": -273.15, "us": -1.0}
# Units of a deflection that state a fraction of full travel instead of an angle.
FRACTION_UNITS = ("fraction", "%")


class Quantity(NamedTuple):
    """A quantity of a flight that a table of columns can name.

    dimension: key of `UNITS`, which has the allowed units.
    meaning: description for the documentation, with the positive direction.
    low, high: plausible range of almost all values, in SI units and radians.
    frames: allowed values of `frame`, the default first; () if the quantity has no frame.
    """

    dimension: str
    meaning: str
    low: float
    high: float
    frames: tuple[str, ...] = ()


# Body axes: forward, right, down; or forward, left, up.
_BODY = ("FRD", "FLU")
# Axes of the world: north, east, down; or east, north, up.
_WORLD = ("NED", "ENU")
# Direction to which, or from which, the wind blows.
_WIND = ("to", "from")
# Largest plausible course, rad: two turns.
_TURN = math.pi * 4.02
QUANTITIES: dict[str, Quantity] = {
    "latitude": Quantity("angle", "geographic latitude", -1.5708, 1.5708),
    "longitude": Quantity("angle", "geographic longitude", -3.1416, 6.2832),
    "altitude": Quantity(
        "length",
        "altitude above mean sea level, the ellipsoid or the first row",
        -500,
        20_000,
        ("amsl", "ellipsoid", "start"),
    ),
    "velocity_north": Quantity("speed", "ground velocity to the north", -150, 150),
    "velocity_east": Quantity("speed", "ground velocity to the east", -150, 150),
    "velocity_down": Quantity("speed", "vertical velocity, down (NED) or up (ENU)", -60, 60, _WORLD),
    "ground_speed": Quantity(
        "speed", "ground speed; with `ground_course` it replaces `velocity_north` and `velocity_east`", -1, 150
    ),
    "ground_course": Quantity("angle", "ground course, clockwise from north", -_TURN, _TURN),
    "roll": Quantity("angle", "bank to the right", -3.2, 3.2),
    "pitch": Quantity("angle", "nose up (NED) or nose down (ENU)", -1.6, 1.6, _WORLD),
    "yaw": Quantity(
        "angle", "heading clockwise from north (NED) or counterclockwise from east (ENU)", -_TURN, _TURN, _WORLD
    ),
    "quaternion_w": Quantity(
        "ratio",
        "real part of the attitude quaternion (body to earth), in place of roll, pitch and yaw",
        -1.01,
        1.01,
        _WORLD,
    ),
    **{
        f"quaternion_{axis}": Quantity("ratio", f"{axis} component of the attitude quaternion", -1.01, 1.01)
        for axis in "xyz"
    },
    "roll_rate": Quantity("angular rate", "rotation about the forward axis", -12, 12, _BODY),
    "pitch_rate": Quantity("angular rate", "rotation about the axis to the right (FRD) or left (FLU)", -12, 12, _BODY),
    "yaw_rate": Quantity("angular rate", "rotation about the axis that points down (FRD) or up (FLU)", -12, 12, _BODY),
    "acceleration_forward": Quantity("acceleration", "specific force forward", -100, 100, _BODY),
    "acceleration_right": Quantity("acceleration", "specific force to the right (FRD) or left (FLU)", -100, 100, _BODY),
    "acceleration_down": Quantity(
        "acceleration", "specific force down (FRD), -9.8 m/s2 at rest, or up (FLU)", -100, 100, _BODY
    ),
    "airspeed": Quantity("speed", "airspeed, indicated or true", -20, 150, ("indicated", "true")),
    "wind_north": Quantity("speed", "wind that blows to the north, or from the north", -40, 40, _WIND),
    "wind_east": Quantity("speed", "wind that blows to the east, or from the east", -40, 40, _WIND),
    "wind_speed": Quantity(
        "speed", "wind speed; with `wind_direction` it replaces `wind_north` and `wind_east`", -0.1, 40
    ),
    "wind_direction": Quantity(
        "angle", "direction from which (or to which) the wind blows", -_TURN, _TURN, ("from", "to")
    ),
    "static_pressure": Quantity("pressure", "static pressure of the air", 20_000, 110_000),
    "temperature": Quantity("temperature", "temperature of the air", -60, 60),
    "elevator": Quantity("deflection", "elevator, trailing edge down", -1.2, 1.2),
    "elevator_left": Quantity("deflection", "left half of the elevator, trailing edge down", -1.2, 1.2),
    "elevator_right": Quantity("deflection", "right half of the elevator, trailing edge down", -1.2, 1.2),
    "aileron": Quantity("deflection", "ailerons, roll to the right (left trailing edge down)", -1.2, 1.2),
    "aileron_left": Quantity("deflection", "left aileron, trailing edge down", -1.2, 1.2),
    "aileron_right": Quantity("deflection", "right aileron, trailing edge down", -1.2, 1.2),
    "elevon_left": Quantity("deflection", "left elevon, trailing edge down", -1.2, 1.2),
    "elevon_right": Quantity("deflection", "right elevon, trailing edge down", -1.2, 1.2),
    "rudder": Quantity("deflection", "rudder, trailing edge to the left", -1.2, 1.2),
    "throttle": Quantity("fraction", "throttle, 0 to 1", -0.3, 1.3),
    "voltage": Quantity("voltage", "voltage of the battery", -0.5, 900),
    "current": Quantity("current", "current from the battery", -50, 1000),
    "mode": Quantity("mode", "flight mode, a number or a text (`[modes]`)", -math.inf, math.inf),
}
# Angles of the attitude, and the components of the quaternion that can take their place.
ANGLES = ("roll", "pitch", "yaw")
QUATERNION = ("quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z")
# Quantities that change their sign when they are converted from this frame to their default frame.
_NEGATED_BY_FRAME = {
    **dict.fromkeys(("pitch_rate", "yaw_rate", "acceleration_right", "acceleration_down"), "FLU"),
    **dict.fromkeys(("velocity_down", "pitch"), "ENU"),
    **dict.fromkeys(("wind_north", "wind_east"), "from"),
}


def to_default_frame(quantity: str, frame: str) -> tuple[float, float]:
    """Return the factor and the offset that convert a quantity from a frame to its default frame.

    The converted value is factor * value + offset, in SI units and radians.

    >>> to_default_frame("velocity_down", "ENU"), to_default_frame("velocity_down", "NED")
    ((-1.0, 0.0), (1.0, 0.0))
    """
    if quantity == "yaw" and frame == "ENU":
        return -1.0, 0.5 * math.pi
    if quantity == "wind_direction" and frame == "to":
        return 1.0, math.pi
    return (-1.0 if _NEGATED_BY_FRAME.get(quantity) == frame else 1.0), 0.0


def find_likelier_unit(quantity: str, unit: str, magnitude: float) -> str:
    """Return the first other unit in which the numbers of a quantity would be plausible.

    Return "" if there is none.

    unit: unit in which the numbers were read.
    magnitude: size of a typical number in the data.

    >>> find_likelier_unit("roll", "rad", 179.0), find_likelier_unit("throttle", "fraction", 85.0)
    ('deg', '%')
    >>> find_likelier_unit("roll", "deg", 9e9)
    ''
    """
    entry = QUANTITIES[quantity]
    for candidate in UNITS[entry.dimension]:
        value = magnitude * UNITS[entry.dimension][candidate] + UNIT_ZEROS.get(candidate, 0.0)
        if candidate != unit and entry.low <= value <= entry.high:
            return candidate
    return ""
