"""The option that has a real autopilot fly."""

import argparse
import contextlib
import signal
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def autopilot_program(args: argparse.Namespace) -> Iterator[Path | None]:
    """The program that ``--autopilot`` names, None without it.  Raises FlightError for what cannot be run.

    While there is one, SIGTERM ends the command as Ctrl-C does, so that neither the program nor its files are left.
    """
    if args.autopilot is None:
        yield None
        return
    # Imported here: nobody else needs MAVLink.
    from flight.real_autopilot.autopilot_process import check_binary

    program = Path(args.autopilot)
    check_binary(program)
    kept = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield program
    finally:
        signal.signal(signal.SIGTERM, kept)
