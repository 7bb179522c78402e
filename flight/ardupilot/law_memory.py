"""What ArduPlane's laws keep from tick to tick."""

import numpy as np

from world.kernels import record_dtype

ARDUPILOT_MEMORY = record_dtype(
    "clock",  # s until the navigation's next turn
    ("begun", np.bool_),  # whether a tick was flown
    # Lateral.
    ("leg", np.int64),  # that is flown, from waypoint `leg` to `leg + 1`
    "from_east",  # m, where the leg's line begins
    "from_north",
    "from_up",  # m, where its slope begins
    "cross_track_sum",  # rad, L1's integral
    ("on_circle", np.bool_),  # whether a loiter's circle is followed, not just approached
    "side_acceleration",  # m/s^2 to the right, as last demanded
    "roll_demand",  # rad
    # Height.
    "height_asked",  # m, of the leg, or as it was when the aircraft could follow it no longer
    "height_limited",  # m, the same within its rate limits
    "height_demand",  # m, and after its lag
    "height_rate",  # m/s, of the height demand
    "climb_share",  # 0..1, of the greatest rates that are demanded
    "sink_share",
    ("held", np.int64),  # 1 with throttle or pitch at its upper limit, -1 at its lower
    # Airspeed.
    ("flown", np.bool_),  # whether there is a velocity of before
    "last_velocity_east",  # m/s, when it navigated last
    "last_velocity_north",
    "last_velocity_up",
    "airspeed_read",  # m/s, smoothed
    "airspeed",  # m/s, of the measured one and the acceleration
    "airspeed_drift",  # m/s^2, what the acceleration leaves out
    "acceleration",  # m/s^2, along the nose, without its mean
    "acceleration_mean",
    "airspeed_demand",  # m/s, within its rate limits
    # Energy.
    "energy_rate_error",  # m^2/s^3, smoothed
    "throttle_before",  # 0..1, the last without its integral
    "throttle_sum",  # 0..1, integral of the total energy that is missing
    "balance_sum",  # m^2/s^3, integral of what is amiss in the balance
    "speed_sum",  # m^2/s^3, integral of the kinetic energy that is too much
    "pitch_demand",  # rad, without the trim
    "throttle_demand",  # 0..1
)
