"""What options say of a log of the field."""

import argparse
from pathlib import Path

from planfly.field.field_flights import FieldOptions
from planfly.named_fences import read_named_fences
from world.errors import ScenarioError


def field_options(args: argparse.Namespace) -> FieldOptions:
    """Plan, world and aircraft of the options.

    Raises ScenarioError for one that a flown log cannot take, and as `read_named_fences` does.
    """
    source = args.log if hasattr(args, "target") else args.file
    for name in ("params", "guidance", "airspeed"):
        if (value := getattr(args, name, None)) is not None:
            allowed = "a flight of the field is judged by the autopilot and the speeds of its log"
            raise ScenarioError.at(source, f"--{name}", value, allowed, shown="")
    return FieldOptions(
        plan=Path(args.plan) if args.plan else None,
        scenario=args.scenario,
        terrain=args.terrain,
        aircraft=args.aircraft,
        datum=args.datum,
        number=args.flight,
        wind_given=args.wind is not None,
        fences=read_named_fences(args.fence),
    )
