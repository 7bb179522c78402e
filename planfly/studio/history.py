"""History of edits of a mission, for undo and redo."""

from dataclasses import dataclass, field

from flight.mission.items import Mission

# Greatest number of steps that are kept; the first mission always is.
MAX_STEPS = 1_000


@dataclass(slots=True)
class History:
    """Missions, each made from the previous one.

    first: the mission as opened.  steps: the result of each edit, with its description.
    at: number of steps that are in effect.

    >>> history = History(Mission(None, ()))
    >>> history.add(Mission(None, (), source="moved"), "move item 3")
    >>> history.undo(), history.mission.source, history.redo_text
    (True, 'mission', 'move item 3')
    """

    first: Mission
    steps: list[tuple[Mission, str]] = field(default_factory=list)
    at: int = 0

    @property
    def mission(self) -> Mission:
        """The mission at the present step."""
        return self.steps[self.at - 1][0] if self.at else self.first

    @property
    def undo_text(self) -> str:
        """Text of the next undo; "" for nothing."""
        return self.steps[self.at - 1][1] if self.at else ""

    @property
    def redo_text(self) -> str:
        """Text of the next redo; "" for nothing."""
        return self.steps[self.at][1] if self.at < len(self.steps) else ""

    def add(self, mission: Mission, text: str) -> None:
        """Record an edit and drop undone ones.  The oldest steps are dropped if there are too many."""
        self.steps = [*self.steps[: self.at], (mission, text)][-MAX_STEPS:]
        self.at = len(self.steps)

    def undo(self) -> bool:
        """Undo the last edit; return True if there was one."""
        self.at, before = max(0, self.at - 1), self.at
        return self.at != before

    def redo(self) -> bool:
        """Redo the last undone edit; return True if there was one."""
        self.at, before = min(len(self.steps), self.at + 1), self.at
        return self.at != before
