"""The real autopilot that flew a flight, as a program of its own: what it is, and what it was set to."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AutopilotProgram:
    """Which program steered a flight.

    version: what it calls itself.
    sha256: of its file, hex.
    parameters: by name, what it was given over its own defaults, as it had them.
    changed: those of them that a person's file stated otherwise than the aircraft's.
    unused: names in the person's file that it does not know, or that belong to other hardware.
    """

    version: str
    sha256: str
    parameters: Mapping[str, float]
    changed: Mapping[str, float]
    unused: tuple[str, ...] = ()
