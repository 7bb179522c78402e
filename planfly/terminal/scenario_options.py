"""Options that make another scenario of the one given: aircraft, airspeed, who steers, and the wind."""

import argparse
import math
from collections.abc import Callable

from world.scenario import Scenario
from world.scenario_variants import with_flight, with_wind


def scenario_change(args: argparse.Namespace) -> Callable[[Scenario], Scenario]:
    """What the options given change in a scenario; a command without wind or guidance options changes none of these."""

    def change(scenario: Scenario) -> Scenario:
        given = {
            "aircraft": args.aircraft,
            "airspeed_mps": args.airspeed,
            "guidance": getattr(args, "guidance", None),
            "nav": getattr(args, "nav", None),
        }
        speed, from_deg = getattr(args, "wind", None) or (None, None)
        from_course = None if from_deg is None else math.radians(from_deg)
        return with_wind(with_flight(scenario, **given), speed, from_course, getattr(args, "turbulence", None))

    return change
