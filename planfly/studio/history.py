"""What was done to a mission, in order, so that it can be undone and done again."""

from dataclasses import dataclass, field

from flight.mission.items import Mission

# Steps that are kept; the first mission always is.
MAX_STEPS = 1_000


@dataclass(slots=True)
class History:
    """Missions, each made of the one before it.

    steps: the mission as opened, and what each edit made of it, with words for it.
    at: the one that is shown.

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
        """The mission as it is shown."""
        return self.steps[self.at - 1][0] if self.at else self.first

    @property
    def undo_text(self) -> str:
        """What would be undone; "" for nothing."""
        return self.steps[self.at - 1][1] if self.at else ""

    @property
    def redo_text(self) -> str:
        """What would be done again; "" for nothing."""
        return self.steps[self.at][1] if self.at < len(self.steps) else ""

    def add(self, mission: Mission, text: str) -> None:
        """Note an edit; what was undone before it is gone.  The oldest steps go where there are too many."""
        self.steps = [*self.steps[: self.at], (mission, text)][-MAX_STEPS:]
        self.at = len(self.steps)

    def undo(self) -> bool:
        """Take the last edit back; whether there was one."""
        self.at, before = max(0, self.at - 1), self.at
        return self.at != before

    def redo(self) -> bool:
        """Do the edit again that was undone; whether there was one."""
        self.at, before = min(len(self.steps), self.at + 1), self.at
        return self.at != before
