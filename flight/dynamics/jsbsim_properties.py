"""Access the JSBSim properties that all models have, and convert JSBSim's feet, slugs and pounds."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from aircraft.jsbsim_model import CommandProperty
from world.errors import FlightError

# Meters in one foot.
FOOT = 0.3048
# kg/m^3 in one slug/ft^3.
SLUG_FT3 = 515.3788183931961
# Kilograms in one pound.
POUND = 0.45359237

# Properties that are the same for all models, with their factors to SI, by the fields of the state.
STATE_PROPERTIES = {
    "time": ("simulation/sim-time-sec", 1.0),
    "latitude": ("position/lat-geod-rad", 1.0),
    "longitude": ("position/long-gc-rad", 1.0),
    # Above the ellipsoid along the radius: within 3 cm of the geodetic altitude up to 4000 m.
    "amsl": ("position/h-sl-ft", FOOT),
    "velocity_north": ("velocities/v-north-fps", FOOT),
    "velocity_east": ("velocities/v-east-fps", FOOT),
    "velocity_down": ("velocities/v-down-fps", FOOT),
    "roll": ("attitude/phi-rad", 1.0),
    "pitch": ("attitude/theta-rad", 1.0),
    "yaw": ("attitude/psi-rad", 1.0),
    "roll_rate": ("velocities/p-rad_sec", 1.0),
    "pitch_rate": ("velocities/q-rad_sec", 1.0),
    "yaw_rate": ("velocities/r-rad_sec", 1.0),
    "airspeed": ("velocities/vt-fps", FOOT),
    "alpha": ("aero/alpha-rad", 1.0),
    "beta": ("aero/beta-rad", 1.0),
    "load_factor": ("accelerations/Nz", 1.0),
    "wind_north": ("atmosphere/total-wind-north-fps", FOOT),
    "wind_east": ("atmosphere/total-wind-east-fps", FOOT),
    "wind_down": ("atmosphere/total-wind-down-fps", FOOT),
}
# Fields for which each model has its own properties, in the order of `aircraft.jsbsim_model.Model.readings`.
MODEL_FIELDS = ("elevator", "aileron", "rudder", "throttle", "current", "power")
# Mean wind, ft/s.
WIND = tuple(f"atmosphere/wind-{axis}-fps" for axis in ("north", "east", "down"))
# Gust, ft/s.
GUST = tuple(f"atmosphere/gust-{axis}-fps" for axis in ("north", "east", "down"))
# Initial position, ground and altitude.
IC_POSITION = ("ic/lat-geod-deg", "ic/long-gc-deg", "ic/terrain-elevation-ft", "ic/h-sl-ft")
# Initial attitude, velocity and rotation rates.
IC_MOTION = (
    *("ic/phi-rad", "ic/theta-rad", "ic/psi-true-rad"),
    *("ic/vn-fps", "ic/ve-fps", "ic/vd-fps"),
    *("ic/p-rad_sec", "ic/q-rad_sec", "ic/r-rad_sec"),
)
# Accelerations, and rates of roll and pitch angle.
RATES = (
    *(f"accelerations/{axis}dot-ft_sec2" for axis in "uvw"),
    *(f"accelerations/{axis}dot-rad_sec2" for axis in "pqr"),
    *("velocities/phidot-rad_sec", "velocities/thetadot-rad_sec"),
)
# Factors of `RATES` to SI units.
RATE_FACTORS = np.array([FOOT] * 3 + [1.0] * 5)
# All forces on the aircraft except gravity along the body axes, lbf.
FORCES = tuple(f"forces/fb{axis}-total-lbs" for axis in "xyz")
# Mass of the aircraft, slugs.
MASS = "inertia/mass-slugs"
# Altitude of the ground, ft.
TERRAIN = "position/terrain-elevation-asl-ft"
# Height above ground, ft.
HEIGHT = "position/h-agl-ft"
# A sphere large enough to be flat, without rotation: the world of the textbook, for validation.
FLAT_PLANET = """<planet name="flat">
  <semimajor_axis unit="M">1e9</semimajor_axis>
  <semiminor_axis unit="M">1e9</semiminor_axis>
  <rotation_rate unit="RAD/SEC">0</rotation_rate>
  <GM unit="M3/SEC2">9.81e18</GM>
  <J2>0</J2>
</planet>
"""
# Air density on the flat planet, kg/m^3.
FLAT_DENSITY = 1.2682


# ----------------------------------------------------------------------
# JSBSim properties by name, bound to functions that read and set them.

# Function that reads a property.
Getter = Callable[[], float]
# Function that sets a property.
Setter = Callable[[float], object]


class PropertyAccess:
    """Access by name to the properties of one JSBSim instance with a model.

    manager: property manager of the instance.
    model_file: file named in errors.
    """

    def __init__(self, manager: Any, model_file: Path) -> None:
        self._manager, self._model_file = manager, model_file

    def _node(self, name: str) -> Any:
        """Return JSBSim's node of a property. Raises FlightError if the property is undefined."""
        # Reading a missing node would create it, so check for it first.
        node = self._manager.get_node(name) if self._manager.hasNode(name) else None
        if node is None:
            raise FlightError(
                f"{self._model_file}: the model does not define the property {name}, which planfly needs",
                file=self._model_file,
                field=name,
            )
        return node

    def getter(self, name: str) -> Getter:
        """Return a function that reads a property, or returns zero if the name is "".

        Raises FlightError if the property is undefined.
        """
        if not name:
            return lambda: 0.0
        return self._node(name).get_double_value

    def setter(self, name: str) -> Setter:
        """Return a function that sets a property. Raises FlightError if it is undefined."""
        return self._node(name).set_double_value

    def command_setter(self, command: CommandProperty) -> Setter:
        """Return a function that sets a command (rad, or throttle), scaled to the units of the property."""
        set_value, above, below = self.setter(command.name), command.above, command.below
        if above == below == 1.0:
            return set_value
        return lambda value: set_value(value * (above if value > 0.0 else below))

    def read(self, name: str) -> float:
        """Return the current value of a property. Raises FlightError if it is undefined."""
        return self.getter(name)()

    def set(self, name: str, value: float) -> None:
        """Set a property. Raises FlightError if it is undefined."""
        self.setter(name)(value)

    def set_optional(self, name: str, value: float, default: float) -> None:
        """Set a property; do nothing if the model lacks it and the value is its default.

        Raises FlightError if the model lacks the property and the value is not its default.
        """
        if value != default or self._manager.hasNode(name):
            self.set(name, value)
