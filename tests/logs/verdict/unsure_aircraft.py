"""A flight of an aircraft whose bank limit is a guess of its data sheet."""

from dataclasses import replace

from flight.simulation.setup import FlightSetup


def with_guessed_bank(setup: FlightSetup) -> FlightSetup:
    """The setup's bank limit is the aircraft's own, and a guess."""
    envelope = replace(setup.limits.envelope, max_bank=setup.max_bank, bank_guessed=True)
    return replace(setup, limits=replace(setup.limits, envelope=envelope))
