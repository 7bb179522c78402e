"""Imported flights set into their world without a file: the example's, changed by each test."""

from dataclasses import replace
from pathlib import Path

from logs.importers.raw_log import RawLog, example_raw_log
from planfly.flight_options import LogOptions
from planfly.workflow import imported_flights
from planfly.workflow.imported_flights import ImportedFlight


def judged(
    folder: Path, raw: RawLog | None = None, options: LogOptions | None = None, name: str = "example.BIN"
) -> ImportedFlight:
    """Import a log as its reader would give it."""
    given = replace(example_raw_log() if raw is None else raw)
    path = folder / name
    path.write_bytes(b"stands for the log")
    reader = imported_flights.open_log
    imported_flights.open_log = lambda _: given
    try:
        return imported_flights.import_flight(path, options or LogOptions())
    finally:
        imported_flights.open_log = reader


def outcome(flight: ImportedFlight, rule: str) -> list[bool | None]:
    """What a rule says at each of its places."""
    return [item.ok for item in flight.verdict.findings if item.rule == rule]


def reasons(flight: ImportedFlight, rule: str) -> set[str]:
    """Why a rule was not judged."""
    return {item.brief for item in flight.verdict.findings if item.rule == rule and item.ok is None}
