"""The corridor about the legs of a path that a flight has to stay in."""

# m.  Half width where a scenario states none: the overshoot of an autopilot that follows the legs at ordinary corners,
# three times over.  The real ArduPlane overshot corners of up to 25 degrees in 5 m/s of wind by at most 10 m.
LEAST_CORRIDOR = 30.0
# Radii.  An autopilot that turns as soon as it is a radius from its waypoint cuts a right-angled corner by up to 0.7 of
# that, and swings out beyond the next leg by as much when it turns too late; the rest is for the wind.
CORRIDOR_RADII = 2.0


def corridor_half_width(stated: float | None, acceptance_radius: float | None) -> float:
    """Half width of the corridor, m: the scenario's, or what whoever flies needs.

    stated: of `[limits] corridor_m`, None where there is none.  acceptance_radius: at which the autopilot takes a
    waypoint as reached where the mission states nothing, m; None for a guidance that flies corners as it plans them.

    >>> corridor_half_width(None, None), corridor_half_width(None, 90.0), corridor_half_width(12.0, 90.0)
    (30.0, 180.0, 12.0)
    """
    if stated is not None:
        return stated
    return max(LEAST_CORRIDOR, CORRIDOR_RADII * (acceptance_radius or 0.0))
