"""Options that make another scenario of the one given: aircraft, airspeed, who flies, and the wind."""

import argparse
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

from planfly.flight_limits import FlightLimits
from world.scenario import Scenario
from world.scenario_variants import with_flight, with_wind
from world.text_files import whole_path


def flight_entries(args: argparse.Namespace) -> dict[str, str | float | None]:
    """Entries of a scenario's [flight] that the options state; None for those that were not given."""
    params = getattr(args, "params", None)
    return {
        "aircraft": getattr(args, "aircraft", None),
        "airspeed_mps": getattr(args, "airspeed", None),
        # A real one is an ArduPlane.
        "autopilot": None if getattr(args, "autopilot", None) is None else "ardupilot",
        "guidance": getattr(args, "guidance", None),
        "nav": getattr(args, "nav", None),
        # Whatever folder the scenario is in.
        "params": None if params is None else whole_path(Path(params)),
    }


def flight_limits(args: argparse.Namespace) -> FlightLimits:
    """How long a flight may take, and how large its log may grow."""
    return FlightLimits(args.max_hours, args.max_log)


def scenario_change(args: argparse.Namespace) -> Callable[[Scenario], Scenario]:
    """What the options given change in a scenario; options that a command does not have change nothing."""
    return partial(_changed, args)


def _changed(args: argparse.Namespace, scenario: Scenario) -> Scenario:
    speed, from_deg = getattr(args, "wind", None) or (None, None)
    from_course = None if from_deg is None else math.radians(from_deg)
    flown = with_flight(scenario, **flight_entries(args))
    return with_wind(flown, speed, from_course, getattr(args, "turbulence", None))
