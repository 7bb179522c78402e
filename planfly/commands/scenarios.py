"""``planfly scenarios``: the embedded scenarios, one line each."""

import argparse

from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE
from world.scenario import embedded_scenarios


def scenarios(args: argparse.Namespace) -> int:
    """Name and description of each embedded scenario, on standard output."""
    known = embedded_scenarios()
    for name, spec in known.items():
        print(f"{name:<12} {spec.description}")

    def answer() -> object:
        from planfly.terminal.answers.answer_data import ScenarioEntry, ScenariosAnswer

        entries = [ScenarioEntry(name=name, description=spec.description) for name, spec in known.items()]
        return ScenariosAnswer(exit_code=FLYABLE, scenarios=entries)

    give_answer(args, answer)
    return FLYABLE
