"""What may vary between the flights of a campaign: each quantity's unit, how it changes the flight, and its range."""

from typing import Literal, NamedTuple


class Quantity(NamedTuple):
    """One number that is drawn once a flight.

    name: its table in a spread file, and its column in the campaign's.
    combine: "added" to what the scenario has, or "factor" on it.
    unit: of what is added; "" for a factor.
    low, high: the least and the largest that may be drawn; a draw beyond them is none of this aircraft or world.
    whole: whether it counts steps, so that its distribution is a discrete one.
    title: for a person.
    """

    name: str
    combine: Literal["added", "factor"]
    unit: str
    low: float
    high: float
    title: str
    whole: bool = False

    @property
    def nominal(self) -> float:
        """The value that changes nothing."""
        return 1.0 if self.combine == "factor" else 0.0


# In this order a flight's numbers are drawn, whether they vary or not: what one quantity does leaves the others alone.
QUANTITIES = (
    Quantity("wind_speed", "added", "m/s", -40.0, 40.0, "wind speed"),
    Quantity("wind_from", "added", "deg", -180.0, 180.0, "wind direction"),
    Quantity("wind_gradient", "added", "1/s", -0.05, 0.05, "wind gradient"),
    Quantity("turbulence", "added", "levels", -2.0, 2.0, "turbulence", whole=True),
    Quantity("mass", "factor", "", 0.5, 2.0, "mass"),
    Quantity("drag", "factor", "", 0.3, 3.0, "drag"),
    Quantity("control_power", "factor", "", 0.25, 2.0, "control power"),
    Quantity("battery", "factor", "", 0.05, 1.5, "battery"),
    Quantity("terrain_height", "added", "m", -100.0, 100.0, "terrain height"),
    Quantity("start_east", "added", "m", -200.0, 200.0, "start, east"),
    Quantity("start_north", "added", "m", -200.0, 200.0, "start, north"),
    Quantity("start_up", "added", "m", -100.0, 100.0, "start, height"),
)
BY_NAME = {quantity.name: quantity for quantity in QUANTITIES}
NAMES = tuple(BY_NAME)
