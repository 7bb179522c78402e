"""Describe the bank limit of a flight and its source."""

import math

from flight.simulation.setup import FlightSetup

# Tolerance for equal bank limits, rad.
_SAME_BANK_RAD = 1e-6


def bank_limit_text(setup: FlightSetup) -> str:
    """Return a text on a setup's bank limit and its source, such as "the aircraft's bank limit of 29°".

    The source is the aircraft, the autopilot or the scenario: the first one that has this limit.  If none has it, the
    text names no source: "a bank limit of 29°".  A guessed limit of the aircraft is marked as a guess.  It is named
    only if neither the autopilot nor the scenario has the same limit.

    >>> from logs.recording.example_log import example_log
    >>> bank_limit_text(example_log().setup)
    'a bank limit of 29°'
    """
    limits = [
        ("the aircraft's", setup.envelope.max_bank),
        (f"{setup.autopilot.title}'s", setup.autopilot.turns.max_bank),
    ]
    if (stated_bank := setup.scenario.flight.max_bank_deg) is not None:
        limits.append(("the scenario's", math.radians(stated_bank)))
    if setup.envelope.bank_guessed:
        limits = [*limits[1:], limits[0]]
    owner = next((owner for owner, limit in limits if abs(limit - setup.max_bank) <= _SAME_BANK_RAD), "a")
    guess_text = " (a guess: state --bank)" if setup.envelope.bank_guessed and owner == "the aircraft's" else ""
    return f"{owner} bank limit of {math.degrees(setup.max_bank):.0f}°{guess_text}"
