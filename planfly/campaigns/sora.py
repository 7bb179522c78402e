"""Formulas and table of SORA 2.5: the ground risk class, and the volumes of a fixed-wing aircraft.

Sources, with their names below:
- SORA 2.5: JARUS guidelines on SORA, main body, edition 2.5 (JAR-DEL-SRM-SORA-MB-2.5), table 2; annex F, table 2, has
  the same classes.
- Annex A: its annex A, edition 2.5, on the dimensions of the volumes.
- LBA: guide of the German Luftfahrt-Bundesamt to the dimensions of flight geography, contingency volume and ground
  risk buffer, which states the formulas of a fixed-wing aircraft with their values.
- FOCA: guide of the Swiss Federal Office of Civil Aviation, "How to apply SORA", part 1, with the same formulas.
"""

import math
from dataclasses import dataclass

from world.population import density_band

# Gravity in the formulas of LBA and FOCA, m/s2.
_GRAVITY = 9.81

# Largest dimension (m) and highest speed (m/s) of each column of SORA 2.5's table 2.
IGRC_COLUMNS = ((1.0, 25.0), (3.0, 35.0), (8.0, 75.0), (20.0, 120.0), (40.0, 200.0))
# Classes for a controlled ground area.
_CONTROLLED_ROW: tuple[int | None, ...] = (1, 1, 2, 3, 3)
# Classes by the bands of density below 5, 50, 500, 5,000 and 50,000 people per km2, and above; None for an operation
# that is not part of SORA.
_DENSITY_ROWS: tuple[tuple[int | None, ...], ...] = (
    (2, 3, 4, 5, 6),
    (3, 4, 5, 6, 7),
    (4, 5, 6, 7, 8),
    (5, 6, 7, 8, 9),
    (6, 7, 8, 9, 10),
    (7, 8, None, None, None),
)
# Mass (kg) and speed (m/s) up to which the class is 1 over any population.
_HARMLESS_MASS_KG = 0.25
_HARMLESS_SPEED_MPS = 25.0

# Accuracy of the position by GNSS, m (LBA and FOCA: 3 m unless a better one is shown).
_GNSS_ERROR_M = 3.0
# Error of position holding, m (LBA, FOCA).
_POSITION_ERROR_M = 3.0
# Error of the map, m (LBA, FOCA).
_MAP_ERROR_M = 1.0
# Time until the contingency manoeuvre begins, s (LBA, FOCA).
_REACTION_TIME_S = 1.0
# Bank of the turn by 180 degrees, rad (LBA, FOCA: 30 degrees).
_TURN_BANK_RAD = math.radians(30.0)
# Error of a barometric altitude, m (LBA: 1 m, or 4 m for an altitude by GNSS; FOCA: 4 m).
_BARO_ERROR_M = 1.0
# Slope at which the aircraft leaves the flight geography upwards, rad (LBA, FOCA: 45 degrees).
_CLIMB_SLOPE_RAD = math.radians(45.0)
# Height of the arc from this slope to level flight, in v^2 / g (LBA, FOCA: 0.3, which is 1 - cos 45 degrees rounded).
_LEVEL_OFF_FACTOR = 0.3
# Minimum width of the flight geography, in characteristic dimensions of the aircraft (LBA).
_MIN_GEOGRAPHY_DIMENSIONS = 3.0


def min_geography_half_width(dimension: float) -> float:
    """Return half of the minimum width of a flight geography, m.

    dimension: largest dimension of the aircraft, m.

    >>> min_geography_half_width(2.9)
    4.35
    """
    return 0.5 * _MIN_GEOGRAPHY_DIMENSIONS * dimension


def ground_risk_class(
    density: float, dimension: float, speed: float, mass: float, *, controlled: bool = False
) -> int | None:
    """Return the intrinsic ground risk class by SORA 2.5, table 2.

    Return None if the operation is not part of SORA.

    The column of the table is the first whose limits of dimension and speed are both kept.

    density: highest population density in operational volume and ground risk buffer, people per km2.
    dimension: largest dimension of the aircraft, m.
    speed: highest speed of the aircraft, m/s.
    mass: take-off mass, kg.
    controlled: True for a controlled ground area, in which only involved people stay.

    >>> ground_risk_class(312.0, 2.9, 33.0, 13.5), ground_risk_class(0.0, 2.9, 36.0, 13.5)
    (5, 4)
    """
    if mass <= _HARMLESS_MASS_KG and speed <= _HARMLESS_SPEED_MPS:
        return 1
    row = _CONTROLLED_ROW if controlled else _DENSITY_ROWS[density_band(density)]
    columns = zip(IGRC_COLUMNS, row, strict=True)
    return next((entry for (widest, fastest), entry in columns if dimension <= widest and speed <= fastest), None)


@dataclass(frozen=True, slots=True)
class ContingencyFormula:
    """Contingency volume of a fixed-wing aircraft by formula (Annex A, LBA, FOCA), m.

    speed: highest speed, m/s.
    flight_height: height of the flight geography above ground, m.
    """

    speed: float
    flight_height: float

    @property
    def reaction_distance(self) -> float:
        """Distance flown until the contingency manoeuvre begins, m: S_RZ = v t."""
        return self.speed * _REACTION_TIME_S

    @property
    def turn_distance(self) -> float:
        """Radius of a turn by 180 degrees at 30 degrees of bank, m: S_CM = v^2 / (g tan 30 degrees)."""
        return self.speed**2 / (_GRAVITY * math.tan(_TURN_BANK_RAD))

    @property
    def width(self) -> float:
        """Width beyond the flight geography, m: S_CV = S_GPS + S_Pos + S_K + S_RZ + S_CM.

        The terms are the errors of GNSS, position holding and map, the reaction distance, and the turn radius.
        """
        return _GNSS_ERROR_M + _POSITION_ERROR_M + _MAP_ERROR_M + self.reaction_distance + self.turn_distance

    @property
    def reaction_height(self) -> float:
        """Height gained until the manoeuvre begins, m: H_RZ = v sin 45 degrees t (LBA rounds the sine to 0.7)."""
        return self.speed * math.sin(_CLIMB_SLOPE_RAD) * _REACTION_TIME_S

    @property
    def level_off_height(self) -> float:
        """Height gained in levelling off, m: H_CM = 0.3 v^2 / g."""
        return _LEVEL_OFF_FACTOR * self.speed**2 / _GRAVITY

    @property
    def height(self) -> float:
        """Height of the contingency volume above ground, m: H_CV = H_FG + H_baro + H_RZ + H_CM.

        The terms are the height of the flight geography, the barometric error, and the heights gained before and while
        levelling off.
        """
        return self.flight_height + _BARO_ERROR_M + self.reaction_height + self.level_off_height

    @property
    def width_terms(self) -> str:
        """Sum of the terms of `width` as text, such as "3 + 3 + 1 + 25.0 + 110.3"."""
        errors = f"{_GNSS_ERROR_M:g} + {_POSITION_ERROR_M:g} + {_MAP_ERROR_M:g}"
        return f"{errors} + {self.reaction_distance:.1f} + {self.turn_distance:.1f}"

    @property
    def height_terms(self) -> str:
        """Sum of the terms of `height` as text, such as "120.0 + 1 + 17.7 + 19.1"."""
        gains = f"{self.reaction_height:.1f} + {self.level_off_height:.1f}"
        return f"{self.flight_height:.1f} + {_BARO_ERROR_M:g} + {gains}"


def one_to_one_buffer(height: float, dimension: float) -> float:
    """Return the width of the ground risk buffer by the 1:1 rule, m.

    It is S_GRB = H_CV + CD / 2 (Annex A, LBA, FOCA).

    height: height of the operational volume above ground, H_CV, m.
    dimension: largest dimension of the aircraft, CD, m.

    >>> one_to_one_buffer(150.0, 3.0)
    151.5
    """
    return height + 0.5 * dimension


def ballistic_buffer(height: float, dimension: float, speed: float) -> float:
    """Return the width of the ground risk buffer for a fall without drag, m.

    It is S_GRB = v sqrt(2 H_CV / g) + CD / 2.

    Annex A, LBA and FOCA use this formula for rotorcraft only.
    height, dimension: H_CV and CD as for `one_to_one_buffer`, m.
    speed: highest speed of the aircraft, v, m/s.

    >>> round(ballistic_buffer(78.48, 2.0, 25.0), 6)
    101.0
    """
    return speed * math.sqrt(2.0 * height / _GRAVITY) + 0.5 * dimension


def glide_buffer(height: float, glide_ratio: float) -> float:
    """Return the width of the ground risk buffer for an unpowered glide, S_GRB = E H_CV, m (Annex A, LBA).

    height: height of the operational volume above ground, H_CV, m.
    glide_ratio: best glide ratio of the aircraft, E.

    >>> glide_buffer(150.0, 12.0)
    1800.0
    """
    return glide_ratio * height
