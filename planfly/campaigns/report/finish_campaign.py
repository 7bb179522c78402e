"""The end of a campaign, in a process of its own: the one that leads it stays small, whatever drawing takes."""

import multiprocessing
from multiprocessing.connection import Connection
from pathlib import Path

from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.report.campaign_files import write_files
from planfly.campaigns.report.summary import CampaignSummary, summarise
from planfly.campaigns.statistics.decision import Estimate, Goal
from planfly.pipeline import Advance
from world.interruption import deaf_children, end_children, end_when_told


def finish_campaign(
    base: CampaignBase, goal: Goal, estimate: Estimate, folder: Path, command: str, advance: Advance | None = None
) -> CampaignSummary:
    """Sum a campaign up from the table in its folder, which nobody holds, and write its files.

    command: the line that repeats it, for the report.
    Raises what the other process raised: a `world.errors.PlanflyError`, or OSError for a full disk.
    """
    here, there = multiprocessing.get_context("spawn").Pipe(duplex=False)
    child = multiprocessing.get_context("spawn").Process(
        target=_finish, args=(there, base, goal, estimate, folder, command), daemon=True
    )
    with deaf_children():
        child.start()
    there.close()
    try:
        while True:
            told = here.recv()
            if isinstance(told, CampaignSummary):
                return told
            if isinstance(told, BaseException):
                raise told
            if advance is not None:
                advance(*told)
    except EOFError:
        raise OSError(0, "the process that writes the report was lost", str(folder)) from None
    finally:
        here.close()
        end_children([child])


def _finish(tell: Connection, base: CampaignBase, goal: Goal, estimate: Estimate, folder: Path, command: str) -> None:
    end_when_told()

    def advance(done: float, whole: float, remark: str) -> None:
        tell.send((done, whole, remark))

    try:
        with open_store(base, goal, folder, resume=True) as store:
            summary = summarise(base, goal, estimate, store)
            write_files(folder, base, summary, store, command, advance)
        tell.send(summary)
    except Exception as error:
        tell.send(error)
