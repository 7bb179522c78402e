"""Record the edits of a mission, for undo and redo.

A step is an edit with the mission that it made.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

from flight.mission.items import Mission

# Maximum number of steps that are kept; the first mission is always kept.
MAX_STEPS = 1_000


class ParameterChange(NamedTuple):
    """Change of an autopilot parameter by an edit.

    old, new: values before and after the edit; None if the studio sets no value.
    """

    name: str
    old: float | None
    new: float | None


class Step(NamedTuple):
    """An edit: the mission that it made, its description, and the parameters that it changed."""

    mission: Mission
    text: str
    parameters: tuple[ParameterChange, ...] = ()


@dataclass(slots=True)
class History:
    """Edits of a mission, with the mission that each of them made.

    first: the mission as opened.
    saved: the mission in the file; the mission as opened or downloaded last if there is no file.
    steps: the edits, including undone edits at the end.
    position: number of steps that are in effect; the later steps are undone.

    >>> history = History(Mission(None, ()))
    >>> history.add(Mission(None, (), source="moved"), "move item 3")
    >>> history.undo(), history.mission.source, history.redo_text
    (True, 'mission', 'move item 3')
    """

    first: Mission
    steps: list[Step] = field(default_factory=list)
    position: int = 0
    saved: Mission = field(init=False)

    def __post_init__(self) -> None:
        self.saved = self.first

    @property
    def mission(self) -> Mission:
        """Mission at the current step."""
        return self.steps[self.position - 1].mission if self.position else self.first

    @property
    def undo_text(self) -> str:
        """Description of the edit that the next undo undoes; "" if there is nothing to undo."""
        return self.steps[self.position - 1].text if self.position else ""

    @property
    def redo_text(self) -> str:
        """Description of the edit that the next redo restores; "" if there is nothing to redo."""
        return self.steps[self.position].text if self.position < len(self.steps) else ""

    def add(self, mission: Mission, text: str, parameters: tuple[ParameterChange, ...] = ()) -> None:
        """Record an edit, and discard undone edits; keep at most the newest `MAX_STEPS` edits.

        mission: the mission that the edit made.
        text: description of the edit.
        parameters: autopilot parameters that the edit changed.
        """
        self.steps = [*self.steps[: self.position], Step(mission, text, parameters)][-MAX_STEPS:]
        self.position = len(self.steps)

    def undo(self) -> bool:
        """Undo the last edit; return True if there was one."""
        self.position, previous_position = max(0, self.position - 1), self.position
        return self.position != previous_position

    def redo(self) -> bool:
        """Redo the last undone edit; return True if there was one."""
        self.position, previous_position = min(len(self.steps), self.position + 1), self.position
        return self.position != previous_position
