"""One small change of a source file."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True, slots=True)
class Mutant:
    """A piece of a file replaced by another.

    part: "limits", "rules", "measures" or "physics".
    file: relative to the repository.
    start, stop: bytes of the file that are replaced.
    old, new: the text there, and what stands in its place.
    """

    part: str
    file: str
    start: int
    stop: int
    old: str
    new: str

    def applied(self, source: bytes) -> bytes:
        """The file's bytes with the change.  Raises ValueError where the old text does not stand there."""
        if source[self.start : self.stop] != self.old.encode():
            raise ValueError(f"{self.file}: {self.old!r} does not stand at byte {self.start}")
        return source[: self.start] + self.new.encode() + source[self.stop :]

    def line(self, source: bytes) -> int:
        """Its line, from 1 on."""
        return source[: self.start].count(b"\n") + 1

    def order(self, source: bytes) -> str:
        """A key that shuffles mutants alike each time, by the line that one changes and not by that line's number."""
        head, tail = source[: self.start].rsplit(b"\n", 1)[-1], source[self.stop :].split(b"\n", 1)[0]
        place = b"|".join((self.file.encode(), head, self.old.encode(), self.new.encode(), tail))
        return hashlib.sha256(place).hexdigest()


def replacing(part: str, file: str, old: str, new: str) -> Mutant:
    """The mutant that puts ``new`` in place of ``old``.  Raises ValueError unless the file has ``old`` exactly once."""
    source = (ROOT / file).read_bytes()
    if source.count(old.encode()) != 1:
        raise ValueError(f"{file}: {source.count(old.encode())} times instead of once: {old!r}")
    start = source.index(old.encode())
    return Mutant(part, file, start, start + len(old.encode()), old, new)
