"""Define the estimated parameters, with their properties in the model, their priors and their bounds.

A parameter is a factor on a coefficient of the base model, 1 without logs, or an offset to the coefficient, 0 without
logs. Forces are absolute; moments are relative to the moment of inertia, because no log can separate the two.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from world.arrays import Floats

# Equations in which parameters are estimated.
Group = Literal["lift", "drag", "pitch", "roll", "yaw"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """Quantity of an aircraft that is estimated from logs, and its prior: the assumption without logs.

    name: name after ``ident/`` in the model.
    title: name in texts.
    kind: "factor" on the base model's coefficient, or "offset" to it.
    sd: standard deviation of the prior about its mean, 1 for a factor and 0 for an offset.
    group: equation in which the parameter is estimated.
    bounds: range of the values of all aircraft.
    show: maneuver or measurement that would determine the parameter.
    """

    name: str
    title: str
    kind: Literal["factor", "offset"]
    sd: float
    group: Group
    bounds: tuple[float, float]
    show: str = ""

    @property
    def property_name(self) -> str:
        """Name of the JSBSim property."""
        return f"ident/{self.name}"

    @property
    def prior(self) -> float:
        """Mean of the prior."""
        return 1.0 if self.kind == "factor" else 0.0


# Maneuver for lift, drag and pitch offset.
_SPEEDS = "level runs of 20 s at several speeds"
# Maneuver for pitch.
_PULLS = "elevator doublets of 1 s"
# Maneuver for roll.
_ROLLS = "aileron doublets of 1 s, or an AUTOTUNE flight"
# Maneuver for yaw.
_YAWS = "rudder doublets of 1 s"

# Priors: 1 standard deviation, for an aircraft scaled from another of its class; docs/from-your-log-to-your-verdict.md
# describes the data that they were tuned on.
PARAMETERS = (
    Parameter("lift-slope", "lift slope", "factor", 0.12, "lift", (0.5, 1.6), show=_SPEEDS),
    Parameter("lift-offset", "lift at zero angle of attack", "offset", 0.15, "lift", (-0.6, 0.6), show=_SPEEDS),
    Parameter("zero-lift-drag", "zero-lift drag", "factor", 0.4, "drag", (0.2, 3.0), show=_SPEEDS),
    Parameter("induced-drag", "induced drag", "factor", 0.3, "drag", (0.2, 3.0), show=_SPEEDS),
    Parameter("thrust", "thrust", "factor", 0.2, "drag", (0.3, 2.0), show="climbs at full throttle and glides at idle"),
    Parameter("motor-speed", "motor speed per volt", "factor", 0.07, "drag", (0.7, 1.35), show="steps of throttle"),
    Parameter("propeller-torque", "propeller torque", "factor", 0.1, "drag", (0.4, 2.0), show="battery current (BAT)"),
    Parameter("pitch-offset", "pitching moment at zero", "offset", 0.06, "pitch", (-0.4, 0.4), show=_SPEEDS),
    Parameter("pitch-stiffness", "pitch stiffness", "factor", 0.5, "pitch", (0.05, 3.5), show=_PULLS),
    Parameter("pitch-damping", "pitch damping", "factor", 0.4, "pitch", (-0.5, 4.0), show=_PULLS),
    Parameter("elevator-power", "elevator power", "factor", 0.4, "pitch", (0.1, 3.0), show=_PULLS),
    Parameter("dihedral-effect", "roll from sideslip", "factor", 0.5, "roll", (-1.5, 4.0), show=_YAWS),
    Parameter("roll-damping", "roll damping", "factor", 0.4, "roll", (0.1, 3.0), show=_ROLLS),
    Parameter("roll-from-yaw", "roll from yaw rate", "factor", 0.4, "roll", (-1.0, 3.5), show=_YAWS),
    Parameter("aileron-power", "aileron power", "factor", 0.4, "roll", (0.1, 3.0), show=_ROLLS),
    Parameter("weathercock", "weathercock stability", "factor", 0.4, "yaw", (0.0, 3.0), show=_YAWS),
    Parameter("yaw-from-roll", "yaw from roll rate", "factor", 0.6, "yaw", (-3.0, 4.5), show=_ROLLS),
    Parameter("yaw-damping", "yaw damping", "factor", 0.4, "yaw", (-1.0, 3.5), show=_YAWS),
    Parameter("adverse-yaw", "yaw from ailerons", "factor", 0.6, "yaw", (-3.0, 4.5), show=_ROLLS),
    Parameter("rudder-power", "rudder power", "factor", 0.4, "yaw", (0.1, 3.0), show=_YAWS),
)
# Names of the parameters.
NAMES = tuple(parameter.name for parameter in PARAMETERS)
# Index of each parameter by its name.
INDEX = {name: k for k, name in enumerate(NAMES)}


def prior_means() -> Floats:
    """Return the means (n,) of the priors of `PARAMETERS`."""
    return np.array([parameter.prior for parameter in PARAMETERS])


def prior_sds() -> Floats:
    """Return the standard deviations (n,) of the priors of `PARAMETERS`."""
    return np.array([parameter.sd for parameter in PARAMETERS])
