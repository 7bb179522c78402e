"""The end of a campaign, in a process of its own."""

from pathlib import Path

from planfly.campaigns.engine.own_process import in_own_process
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.report.campaign_files import write_files
from planfly.campaigns.report.summary import CampaignSummary, summarise
from planfly.campaigns.statistics.decision import Estimate, Goal
from planfly.pipeline import Advance


def finish_campaign(
    base: CampaignBase, goal: Goal, estimate: Estimate, folder: Path, command: str, advance: Advance | None = None
) -> CampaignSummary:
    """Sum a campaign up from the table in its folder, which nobody holds, and write its files.

    command: the line that repeats it, for the report.
    Raises what the other process raised: a `world.errors.PlanflyError`, or OSError for a full disk.
    """
    return in_own_process(_finish, base, goal, estimate, folder, command, advance=advance)


def _finish(
    base: CampaignBase, goal: Goal, estimate: Estimate, folder: Path, command: str, advance: Advance
) -> CampaignSummary:
    with open_store(base, goal, folder, resume=True) as store:
        summary = summarise(base, goal, estimate, store)
        write_files(folder, base, summary, store, command, advance)
    return summary
