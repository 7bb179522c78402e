"""``planfly paper``: section V of the paper planned again, as tables and figures."""

import argparse
from dataclasses import asdict
from pathlib import Path

from planfly.paper import PROBLEMS, file_names, plan_section, table, table_text, write_figures, write_tables
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE
from planfly.terminal.output import progress
from planfly.terminal.results import RESULTS, prepare_folder, refuse_folder
from world.files import hold


def paper(args: argparse.Namespace) -> int:
    """Plan, write and print; 0 whatever the table holds: no path in it is an answer too."""
    folder = Path(args.out) if args.out else RESULTS / "paper"
    if args.out:
        refuse_folder(folder, args.overwrite)
    with progress("planning") as advance:
        plans = plan_section(args.problems, args.runs, args.algorithm, args.jobs, advance)
    rows = table(plans)
    folder.mkdir(parents=True, exist_ok=True)
    with hold(folder):
        prepare_folder(folder, tuple(file_names(PROBLEMS)))
        write_tables(folder, rows, plans)
        with progress("drawing"):
            write_figures(folder, plans)
    print(table_text(rows))
    print(f"results   {folder}/ (table.csv, runs.csv, runs.json, times.csv, paths-, encodings-, convergence.png)")

    def answer() -> object:
        from planfly.terminal.answers.answer_data import PaperAnswer, PaperRow

        return PaperAnswer(exit_code=FLYABLE, folder=str(folder), rows=[PaperRow(**asdict(row)) for row in rows])

    give_answer(args, answer)
    return FLYABLE
