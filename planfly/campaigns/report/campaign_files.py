"""The files of a campaign's folder: what is cleared there, and summary, report, and the logs of its worst flights."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import FlightRow, fly_one
from planfly.campaigns.report.summary import CampaignSummary, log_name, summary_json
from planfly.campaigns.storage.held_table import refuse_held
from planfly.campaigns.storage.row_values import same_flight
from planfly.campaigns.storage.store import DATABASE, Store
from planfly.campaigns.storage.winds_store import WINDS_DATABASE
from planfly.pipeline import Advance
from planner.plan import plan_json
from world.atomic_files import write_whole
from world.errors import PlanflyError

# What a campaign or a search for winds writes into its folder, and clears where it is replaced.
CAMPAIGN_FILES = (
    *(f"{table}{ending}" for table in (DATABASE, WINDS_DATABASE) for ending in ("", "-wal", "-shm")),
    "summary.json", "report.html", "winds.json", "winds.png", "winds.html", "plan.json",
)  # fmt: skip


@dataclass(frozen=True)
class AskedFolder:
    """A campaign's folder, and what may be done with what lies in it.

    table: name of the file of flights.
    resume: go on with the campaign that is there.  overwrite: replace it.
    asks: how either is asked for, for the lines that refuse.
    """

    folder: Path
    table: str
    resume: bool
    overwrite: bool
    asks: tuple[str, str] = ("resume=True", "overwrite=True")

    def refuse(self) -> None:
        """Refuse a folder that is a file, or has other contents than were asked for.  Raises PlanflyError."""
        folder, (resume, overwrite) = self.folder, self.asks
        if self.resume:
            if not (folder / self.table).is_file():
                raise PlanflyError(f"{folder / self.table}: no campaign there to go on with", file=folder / self.table)
            return
        if folder.exists() and not folder.is_dir():
            raise PlanflyError(f"{folder}: is a file; a folder is expected", file=folder)
        if self.overwrite or not folder.is_dir() or not any(folder.iterdir()):
            return
        if (folder / self.table).exists():
            raise PlanflyError(
                f"{folder}: holds a campaign; {resume} goes on with it, {overwrite} replaces it", file=folder
            )
        if any((folder / name).exists() for name in CAMPAIGN_FILES):
            raise PlanflyError(f"{folder}: holds another campaign; {overwrite} replaces it", file=folder)
        raise PlanflyError(f"{folder}: exists and is not empty; {overwrite} replaces its results", file=folder)

    def open(self, opened: Callable[[Path | None], CampaignBase]) -> CampaignBase:
        """The mission, and the folder ready for it: cleared, or with what is to be gone on with.

        opened: gives the mission, with its plan from a file where it is gone on with.
        A scenario's plan is kept in the folder, for those that go on.
        Raises PlanflyError; a folder that was not ready is as it was then.
        """
        self.refuse()
        kept = self.folder / "plan.json"
        base = opened(kept if self.resume else None)
        if not self.resume:
            clear_campaign(self.folder)
        if base.plan is not None and not kept.exists():
            write_whole(kept, plan_json(base.plan))
        return base


@contextmanager
def campaign_folder(out: Path | str | None, table: str, *, resume: bool, overwrite: bool) -> Iterator[AskedFolder]:
    """A campaign's folder; out: None for one that is removed at the end.

    Raises ValueError for a campaign to resume without a folder.
    """
    if out is not None:
        yield AskedFolder(Path(out), table, resume, overwrite)
        return
    if resume:
        raise ValueError("resume: out is missing: the folder of what is to be gone on with")
    with tempfile.TemporaryDirectory() as name:
        yield AskedFolder(Path(name), table, resume=False, overwrite=False)


def clear_campaign(folder: Path) -> None:
    """Make a folder, and clear what an earlier campaign or search left there; anything else stays.

    Raises StoreError, and clears nothing, where another process holds it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for table in (DATABASE, WINDS_DATABASE):
        refuse_held(folder / table)
    for path in (*(folder / name for name in CAMPAIGN_FILES), *_logs(folder)):
        path.unlink(missing_ok=True)


def _logs(folder: Path) -> list[Path]:
    return sorted((folder / "worst").glob("flight-[0-9]*.mcap"))


def write_files(
    folder: Path,
    base: CampaignBase,
    summary: CampaignSummary,
    store: Store,
    command: str,
    advance: Advance | None = None,
) -> None:
    """Write ``summary.json``, ``report.html`` and the worst flights' logs; logs of flights that are none stay not."""
    from planfly.campaigns.report.page import campaign_page

    (folder / "worst").mkdir(exist_ok=True)
    kept = {folder / log_name(row) for row in summary.worst}
    for path in _logs(folder):
        if path not in kept:
            path.unlink()
    for count, row in enumerate(summary.worst):
        path = folder / log_name(row)
        if row.duration > 0.0 and not path.exists():
            fly_row_again(base, row, path)
        if advance is not None:
            advance(count + 1.0, float(len(summary.worst)), f"flight {row.draw.index}")
    write_whole(folder / "summary.json", summary_json(summary))
    write_whole(folder / "report.html", campaign_page(base, summary, store, command))


def fly_row_again(base: CampaignBase, row: FlightRow, log: Path) -> FlightRow:
    """Fly a flight of the table once more, into a log.

    Raises PlanflyError where it does not come out as the table has it: the machine that flew it computes otherwise.
    """
    again = fly_one(base, row.draw.index, log=log)
    if not same_flight(row, again):
        message = f"{log}: flight {row.draw.index} comes out otherwise here than where it was flown"
        raise PlanflyError(message, file=log, field="flight", value=row.draw.index)
    return again
