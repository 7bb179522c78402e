"""What is not flown as a mission has it, a note a reason, with the items that it is about."""

from dataclasses import dataclass, field


@dataclass(slots=True)
class Notes:
    """Notes by text, each with the items it is about, in the order they came up.

    >>> notes = Notes()
    >>> for seq in (9, 3, 4, 5):
    ...     notes.add("DO_SET_SERVO: not flown", seq)
    >>> notes.lines()
    ('items 3-5, 9: DO_SET_SERVO: not flown',)
    """

    _items: dict[str, list[int]] = field(default_factory=dict)

    def add(self, text: str, seq: int | None = None) -> None:
        """Note something, about an item or the whole mission; the same note twice counts once."""
        items = self._items.setdefault(text, [])
        if seq is not None and seq not in items[-1:]:
            items.append(seq)

    def lines(self) -> tuple[str, ...]:
        """One line a note: "items 3-5, 9: DO_SET_SERVO: not flown"."""
        found = []
        for text, items in self._items.items():
            numbers = sorted(set(items))
            label = f"item{'s' if len(numbers) > 1 else ''} {_ranges(numbers)}: " if numbers else ""
            found.append(label + text)
        return tuple(found)


def _ranges(numbers: list[int]) -> str:
    """Sorted numbers as "3-5, 9"."""
    parts: list[list[int]] = []
    for number in numbers:
        if not parts or number > parts[-1][1] + 1:
            parts.append([number, number])
        parts[-1][1] = number
    return ", ".join(str(low) if low == high else f"{low}-{high}" for low, high in parts)
