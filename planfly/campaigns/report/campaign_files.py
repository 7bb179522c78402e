"""The files of a campaign's folder: what is cleared there, and summary, report, and the logs of its worst flights."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import FlightRow, fly_one
from planfly.campaigns.report.summary import CampaignSummary, log_name, summary_json
from planfly.campaigns.storage.held_table import refuse_held
from planfly.campaigns.storage.row_values import same_flight
from planfly.campaigns.storage.store import DATABASE, Store
from planfly.campaigns.storage.winds_store import WINDS_DATABASE
from planfly.pipeline import Advance
from world.atomic_files import write_whole
from world.errors import PlanflyError

# What a campaign or a search for winds writes into its folder, and clears where it is replaced.
CAMPAIGN_FILES = (
    *(f"{table}{ending}" for table in (DATABASE, WINDS_DATABASE) for ending in ("", "-wal", "-shm")),
    "summary.json", "report.html", "winds.json", "winds.png", "winds.html", "plan.json",
)  # fmt: skip


@contextmanager
def campaign_folder(out: Path | str | None, *, resume: bool) -> Iterator[Path]:
    """A campaign's folder, cleared unless it is gone on with; out: None for one that is removed at the end.

    Raises ValueError for a campaign to resume without a folder.
    """
    if out is not None:
        if not resume:
            clear_campaign(Path(out))
        yield Path(out)
        return
    if resume:
        raise ValueError("resume: out is missing: the folder of what is to be gone on with")
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


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
