"""The properties of JSBSim that are the same for every model, and its units: feet, slugs and pounds."""

import numpy as np

from flight.dynamics.state import S

FOOT = 0.3048
SLUG_FT3 = 515.3788183931961  # kg/m^3 in one slug/ft^3
POUND = 0.45359237

# The property behind each row of the state that is the same for all models, and its factor to SI.
STATE = {
    S.TIME: ("simulation/sim-time-sec", 1.0),
    S.LATITUDE: ("position/lat-geod-rad", 1.0),
    S.LONGITUDE: ("position/long-gc-rad", 1.0),
    # Above the ellipsoid along its radius: within 3 cm of the geodetic height up to 4000 m.
    S.AMSL: ("position/h-sl-ft", FOOT),
    S.V_NORTH: ("velocities/v-north-fps", FOOT),
    S.V_EAST: ("velocities/v-east-fps", FOOT),
    S.V_DOWN: ("velocities/v-down-fps", FOOT),
    S.ROLL: ("attitude/phi-rad", 1.0),
    S.PITCH: ("attitude/theta-rad", 1.0),
    S.YAW: ("attitude/psi-rad", 1.0),
    S.P: ("velocities/p-rad_sec", 1.0),
    S.Q: ("velocities/q-rad_sec", 1.0),
    S.R: ("velocities/r-rad_sec", 1.0),
    S.AIRSPEED: ("velocities/vt-fps", FOOT),
    S.ALPHA: ("aero/alpha-rad", 1.0),
    S.BETA: ("aero/beta-rad", 1.0),
    S.ACCEL_N: ("accelerations/Nz", 1.0),
    S.WIND_NORTH: ("atmosphere/total-wind-north-fps", FOOT),
    S.WIND_EAST: ("atmosphere/total-wind-east-fps", FOOT),
    S.WIND_DOWN: ("atmosphere/total-wind-down-fps", FOOT),
}
# The rows that each model has properties of its own for, in the order of `aircraft.jsbsim_model.Model.readings`.
OWN = (S.ELEVATOR, S.AILERON, S.RUDDER, S.THROTTLE, S.CURRENT, S.POWER)
WIND = tuple(f"atmosphere/wind-{axis}-fps" for axis in ("north", "east", "down"))
GUST = tuple(f"atmosphere/gust-{axis}-fps" for axis in ("north", "east", "down"))
IC_PLACE = ("ic/lat-geod-deg", "ic/long-gc-deg", "ic/terrain-elevation-ft", "ic/h-sl-ft")
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
