"""The properties of JSBSim that are the same for every model, and its units: feet, slugs and pounds."""

import numpy as np

FOOT = 0.3048
SLUG_FT3 = 515.3788183931961  # kg/m^3 in one slug/ft^3
POUND = 0.45359237

# The property behind each field of the state that is the same for all models, and its factor to SI.
STATE_PROPERTIES = {
    "time": ("simulation/sim-time-sec", 1.0),
    "latitude": ("position/lat-geod-rad", 1.0),
    "longitude": ("position/long-gc-rad", 1.0),
    # Above the ellipsoid along its radius: within 3 cm of the geodetic height up to 4000 m.
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
# The fields that each model has properties of its own for, in the order of `aircraft.jsbsim_model.Model.readings`.
MODEL_FIELDS = ("elevator", "aileron", "rudder", "throttle", "current", "power")
WIND = tuple(f"atmosphere/wind-{axis}-fps" for axis in ("north", "east", "down"))
GUST = tuple(f"atmosphere/gust-{axis}-fps" for axis in ("north", "east", "down"))
IC_POSITION = ("ic/lat-geod-deg", "ic/long-gc-deg", "ic/terrain-elevation-ft", "ic/h-sl-ft")
IC_MOTION = (
    *("ic/phi-rad", "ic/theta-rad", "ic/psi-true-rad"),
    *("ic/vn-fps", "ic/ve-fps", "ic/vd-fps"),
    *("ic/p-rad_sec", "ic/q-rad_sec", "ic/r-rad_sec"),
)
RATES = (
    *(f"accelerations/{axis}dot-ft_sec2" for axis in "uvw"),
    *(f"accelerations/{axis}dot-rad_sec2" for axis in "pqr"),
    *("velocities/phidot-rad_sec", "velocities/thetadot-rad_sec"),
)
RATE_FACTORS = np.array([FOOT] * 3 + [1.0] * 5)
# All that acts on the aircraft but gravity, in pounds along the body's axes, and its mass in slugs.
FORCES = tuple(f"forces/fb{axis}-total-lbs" for axis in "xyz")
MASS = "inertia/mass-slugs"
TERRAIN = "position/terrain-elevation-asl-ft"
HEIGHT = "position/h-agl-ft"
# A sphere so large that it is flat, and does not turn: the book's world, for validation.
FLAT_PLANET = """<planet name="flat">
  <semimajor_axis unit="M">1e9</semimajor_axis>
  <semiminor_axis unit="M">1e9</semiminor_axis>
  <rotation_rate unit="RAD/SEC">0</rotation_rate>
  <GM unit="M3/SEC2">9.81e18</GM>
  <J2>0</J2>
</planet>
"""
FLAT_DENSITY = 1.2682
