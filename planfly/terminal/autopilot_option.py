"""The option that has a real autopilot fly."""

import argparse
from pathlib import Path


def autopilot_program(args: argparse.Namespace) -> Path | None:
    """The program that ``--autopilot`` names, None without it.  Raises FlightError for what cannot be run."""
    if args.autopilot is None:
        return None
    # Imported here: nobody else needs MAVLink.
    from flight.real_autopilot.autopilot_process import check_binary

    program = Path(args.autopilot)
    check_binary(program)
    return program
