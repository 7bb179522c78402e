"""``planfly scenarios``: the embedded scenarios, one line each."""

import argparse

from planfly.terminal.exit_codes import FLYABLE
from world.scenario import embedded_scenarios


def scenarios(_args: argparse.Namespace) -> int:
    """Name and description of each embedded scenario, on standard output."""
    for name, spec in embedded_scenarios().items():
        print(f"{name:<12} {spec.description}")
    return FLYABLE
