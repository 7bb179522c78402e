"""``planfly compare``: compare two flights in a table and in pictures, or two campaigns."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from planfly.terminal.command_parser import FLYABLE, INCOMPLETE, LineParser
from planfly.terminal.options import add_log_argument, add_result_options
from planfly.terminal.output import warn_about_incomplete_log, write_json_if_requested
from planfly.workflow.output_paths import COMPARE_FILES
from world.errors import PlanflyError

if TYPE_CHECKING:
    from planfly import CampaignComparison, Comparison


def add_compare_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly compare``."""
    parser = command_line.add_command(
        "compare",
        "compare two flights: a table of differences, and pictures; or two campaigns: how likely their flights succeed",
        "planfly compare calm.mcap windy.mcap --out both",
        "planfly compare runs/calm-campaign runs/windy-campaign",
        details="  For two campaigns the exit code is 0 for every answer; --json states the answer.",
    )
    add_log_argument(parser, "first", "A", "a flight log (.mcap), or the folder of a campaign")
    add_log_argument(parser, "second", "B", "another log, or the folder of another campaign")
    parser.add_argument("--svg", action="store_true", help="also write the pictures as SVG")
    add_result_options(parser, "folder for pictures and compare.html (default: no files, only the table)")


def compare(args: argparse.Namespace) -> int:
    """Print the differences of two logs or two campaigns.

    The differences of logs are drawn if a folder is named.

    Returns the exit code: 3 if one of the logs is incomplete, otherwise 0.
    """
    from logs.recording.reader import read_log
    from planfly.api import reporting
    from planfly.campaigns.compare_campaigns import campaign_table

    paths = (Path(args.first), Path(args.second))
    if any((path.is_dir() or path.suffix == ".sqlite") and campaign_table(path) is not None for path in paths):
        from planfly.api import campaigns
        from planfly.campaigns.compare_campaigns import comparison_lines

        for option, value in (("--out", args.out), ("--svg", args.svg)):
            if value:
                message = f"{option}: allowed only with two flight logs, not with campaigns"
                raise PlanflyError(message, field=option, value=value)
        campaign_comparison = campaigns.compare_campaigns(args.first, args.second)
        print("\n".join(comparison_lines(campaign_comparison)))
        write_json_if_requested(args, lambda: _campaigns_answer(campaign_comparison))
        return FLYABLE
    from logs.views.report.compare import difference_lines

    logs = [read_log(path) for path in paths]
    comparison = reporting.compare(logs[0], logs[1], args.out, svg=args.svg, overwrite=args.overwrite)
    target_files = [] if args.out is None else [Path(args.out) / name for name in COMPARE_FILES]
    files = [file for file in target_files if file.exists()]
    print("\n".join(difference_lines(comparison)))
    for file in files:
        print(f"compare   {file}")
    incomplete_logs = [log for log in logs if not log.complete]
    for log in incomplete_logs:
        warn_about_incomplete_log(log)
    code = INCOMPLETE if incomplete_logs else FLYABLE
    write_json_if_requested(args, lambda: _json_answer(comparison, files, code))
    return code


def _campaigns_answer(comparison: "CampaignComparison") -> object:
    """Return the answer of ``planfly compare`` on two campaigns for --json."""
    from planfly.terminal.answers import ChangedRule, CompareCampaignsAnswer, ComparedCampaignEntry

    return CompareCampaignsAnswer(
        exit_code=FLYABLE,
        answer=comparison.answer,
        campaigns=[
            ComparedCampaignEntry(
                name=campaign.name,
                flights=campaign.tally.flown,
                flyable=campaign.tally.flyable,
                probability=campaign.tally.share,
                interval=list(campaign.interval),
            )
            for campaign in (comparison.first, comparison.second)
        ],
        difference=comparison.difference.value,
        interval=list(comparison.difference.interval),
        p_value=comparison.difference.p_value,
        pairs=comparison.pairs,
        only_first=comparison.only_first,
        only_second=comparison.only_second,
        rules=[ChangedRule(rule=rule, first=first, second=second) for rule, first, second in comparison.rules],
        inputs=list(comparison.inputs),
        notes=list(comparison.notes),
    )


def _json_answer(comparison: "Comparison", files: list[Path], code: int) -> object:
    """Return the answer of ``planfly compare`` for --json."""
    from planfly.terminal.answers import CompareAnswer, QuantityPair

    def number_or_none(value: float) -> float | None:
        """Return a finite number unchanged, and None for NaN and infinity."""
        return value if math.isfinite(value) else None

    return CompareAnswer(
        exit_code=code,
        names=list(comparison.names),
        flyable=[verdict.flyable for verdict in comparison.verdicts],
        quantities=[
            QuantityPair(
                name=difference.name,
                unit=difference.unit,
                first=number_or_none(difference.first),
                second=number_or_none(difference.second),
            )
            for difference in comparison.differences
        ],
        notes=list(comparison.notes),
        files=[str(file) for file in files],
    )
