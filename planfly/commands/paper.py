"""``planfly paper``: repeat the plans of section V of the paper, as tables and figures."""

import argparse
from dataclasses import asdict
from pathlib import Path

from planfly.arguments import CHOICES
from planfly.terminal.arguments import number_parser, parse_problems
from planfly.terminal.command_parser import FLYABLE, LineParser
from planfly.terminal.options import add_result_options
from planfly.terminal.output import write_json_if_requested
from planfly.workflow.output_paths import RESULTS


def add_paper_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly paper``."""
    parser = command_line.add_command(
        "paper",
        "reproduce section V of the paper: tables and figures of seeded plans in three encodings",
        "planfly paper --problems 7,60 --runs 5 --out my-paper",
    )
    parser.add_argument(
        "--problems",
        metavar="N,...",
        type=parse_problems,
        default=CHOICES["problems"],
        help="numbers of threats (default: 7,15,30,60)",
    )
    parser.add_argument(
        "--runs",
        metavar="N",
        type=number_parser("runs"),
        default=15,
        help="number of runs of each problem, with seeds 1 to N (default: 15)",
    )
    parser.add_argument(
        "--algorithm",
        metavar="A",
        default="umda",
        help="algorithm to compare with the two baselines (default: umda, the paper's)",
    )
    parser.add_argument(
        "--jobs", metavar="N", type=number_parser("jobs"), help="number of processes (default: one per core)"
    )
    add_result_options(parser, "folder for tables and figures (default: runs/paper; an existing one is replaced)")


def paper(args: argparse.Namespace) -> int:
    """Plan the problems of the paper, write the tables, and print the main table.

    The exit code is 0 for every result, because "no path" is also an answer.
    """
    from planfly.planning.paper import paper_tables

    folder = Path(args.out) if args.out else RESULTS / "paper"
    tables = paper_tables(**args.options | {"out": folder, "overwrite": args.overwrite or args.out is None})
    from planfly.planning.paper import table_text

    print(table_text(tables.rows))
    print(f"results   {folder}/ (table.csv, runs.csv, runs.json, times.csv, paths-, encodings-, convergence.png)")

    def json_answer() -> object:
        """Return the answer of ``planfly paper`` for --json."""
        from planfly.terminal.answers import PaperAnswer, PaperRow

        return PaperAnswer(exit_code=FLYABLE, folder=str(folder), rows=[PaperRow(**asdict(row)) for row in tables.rows])

    write_json_if_requested(args, json_answer)
    return FLYABLE
