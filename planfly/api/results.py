"""What the verbs give: frozen data, short to print, a table in a notebook."""

from dataclasses import dataclass
from pathlib import Path

from flight.mission.items import Mission
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import LogEvent
from logs.verdict.findings import Verdict
from planner.plan import Plan
from world.notebooks.html_table import html_table


@dataclass(frozen=True, slots=True, repr=False)
class FlownMission:
    """What `planfly.fly` returns.

    setup: everything that decided the flight.
    track: its rows; none of a flight that could not begin.
    verdict: whether it flies, with a finding for every rule and place.
    ended: how it ended, "completed" or the reason why not.
    events: what the log holds beside the rows.
    log: the file that it is recorded in; None where none was asked for, or nothing flown.
    """

    setup: FlightSetup
    track: Track
    verdict: Verdict
    ended: str
    events: tuple[LogEvent, ...] = ()
    log: Path | None = None

    @property
    def mission(self) -> Mission:
        """Its items, as read or made of a plan."""
        return self.setup.mission

    @property
    def plan(self) -> Plan | None:
        """The plan that it is of; None for a mission that a person brought."""
        return self.setup.plan

    @property
    def flyable(self) -> bool:
        """The verdict's answer."""
        return self.verdict.flyable

    def __repr__(self) -> str:
        return f"<FlownMission {self.setup.scenario.name}: {self.ended}; {self.track!r}, {self.verdict!r}>"

    def _repr_html_(self) -> str:
        """How a notebook shows it."""
        return self.verdict._repr_html_() + self.track._repr_html_()


@dataclass(frozen=True, slots=True)
class WrittenReport:
    """What `planfly.report` and `planfly.compare` wrote.

    page: the HTML page, which needs no other file.  files: it and the pictures beside it.
    """

    page: Path
    files: tuple[Path, ...]

    def _repr_html_(self) -> str:
        """How a notebook shows it."""
        return html_table(f"Report {self.page}", [(file.name,) for file in self.files])


@dataclass(frozen=True, slots=True)
class ExportedFiles:
    """What `planfly.export` wrote.

    files: in the order asked for.  notes: what of the source they do not hold, a line each.
    """

    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()
