"""The lines of a verdict on a flight of the field: the answer, what was judged and what not, and what the log is."""

from collections.abc import Sequence
from datetime import UTC, datetime
from math import isfinite

from flight.simulation.field_source import Damage, FieldSource, RowFaults, VerticalDatum
from flight.simulation.flight_setup import FlightSetup
from logs.verdict.field.flown_legs import FlownLegs
from logs.verdict.findings import RULES, Finding
from logs.verdict.levels import LevelAnswer

_DATUMS: dict[VerticalDatum, str] = {
    "amsl": "above mean sea level, as the log has it",
    "ellipsoid": "above the WGS 84 ellipsoid",
    "pressure": "by pressure, above the level of 1013.25 hPa",
    "unstated": "above what the log does not say",
}
# Jumps of the clock whose times are listed.
_LISTED = 4


def field_lines(
    findings: Sequence[Finding], setup: FlightSetup, own: LevelAnswer, flown: Sequence[FlownLegs]
) -> tuple[str, ...]:
    """Lines of the summary, the headline first."""
    source = setup.source
    if source is None:
        return (own.headline,)
    lines = [own.headline, *_judged_lines(source, flown), *_unjudged_lines(findings)]
    lines.append(f"Flown by: {source.program or 'not stated'} ({source.format} {source.file}{_when(source)})")
    if source.mission:
        lines.append(f"Mission: {source.mission}")
    lines.append(f"Heights: {heights_text(source)}")
    wind = setup.scenario.wind
    if source.wind:
        lines.append(f"Wind: {wind.speed:.1f} m/s on average, {source.wind}")
    lines.append(f"Rows: {rows_text(source.faults, len(source.gaps))}")
    if source.damage.lossy or source.damage.cut:
        lines.append(f"Lost: {damage_text(source.damage)}")
    lines += [f"Note: {note}" for note in source.notes]
    if setup.route.notes:
        lines.append(f"Not flown as written: {'; '.join(setup.route.notes)}")
    return tuple(lines)


def _judged_lines(source: FieldSource, flown: Sequence[FlownLegs]) -> list[str]:
    """What is judged: each stretch, with its time and its legs."""
    if not source.stretches:
        return ["Judged: nothing, for no stretch followed the mission"]
    by_start = {legs.stretch.start: legs for legs in flown}
    lines = []
    for stretch in source.stretches:
        name = stretch.mode or "the flight (the log knows no modes)"
        times = f"{name} from {stretch.start:.1f} s to {stretch.end:.1f} s"
        legs = by_start.get(stretch.start)
        if legs is None:
            lines.append(f"Judged: nothing of {times}: it passed no two waypoints in order")
            continue
        part = f", leg {legs.last - 1} in part" if legs.partial else ""
        begins = float(legs.aligned.track.time[0])
        lines.append(f"Judged: {times}, legs {legs.first} to {legs.last - 1}{part}, from {begins:.1f} s on")
    return lines


def _unjudged_lines(findings: Sequence[Finding]) -> list[str]:
    """Which rules were not judged, and why, one line each; on which legs, where others were."""
    lines = []
    for rule, title in RULES.items():
        mine = [item for item in findings if item.rule == rule]
        silent = [item for item in mine if item.ok is None]
        if not silent:
            continue
        where = "" if len(silent) == len(mine) else f" on {len(silent)} of {len(mine)}"
        lines.append(f"Not judged: {title}{where} ({silent[0].brief})")
    return lines


def heights_text(source: FieldSource) -> str:
    """Which height was taken, its datum, and how far off the others were at the start.

    >>> from flight.simulation.field_source import HeightOffset, Heights
    >>> heights_text(FieldSource("a.BIN", "", "", heights=Heights("POS", "amsl", (HeightOffset("GPS.Alt", -0.1),))))
    'POS, above mean sea level, as the log has it; at the start GPS.Alt -0.1 m of it'
    """
    offsets = ", ".join(f"{one.name} {one.offset:+.1f} m" for one in source.heights.offsets)
    beside = f"; at the start {offsets} of it" if offsets else ""
    return f"{source.heights.source}, {_DATUMS[source.heights.datum]}{beside}"


def rows_text(faults: RowFaults, gaps: int) -> str:
    """What was wrong with a log's rows, in words.

    >>> rows_text(RowFaults(doubled=2, clock_jumps=(12.5,)), 1)
    '1 gap, 2 doubled, 1 jump of the clock (at 12.5 s)'
    >>> rows_text(RowFaults(), 0)
    'in order, without gaps'
    """
    counted = (
        (gaps, "gap" if gaps == 1 else "gaps"),
        (faults.doubled, "doubled"),
        (faults.unordered, "out of order"),
        (faults.unusable, "without a place"),
        (faults.glitches, "glitches of position"),
    )
    words = [f"{count} {name}" for count, name in counted if count]
    if faults.clock_jumps:
        count = len(faults.clock_jumps)
        times = ", ".join(f"{time:.1f} s" for time in faults.clock_jumps[:_LISTED])
        words.append(f"{count} {'jump' if count == 1 else 'jumps'} of the clock (at {times})")
    return ", ".join(words) or "in order, without gaps"


def damage_text(damage: Damage) -> str:
    """What of a file could not be read, in words.

    >>> damage_text(Damage(places=2, size=40, cut=True))
    '2 places in the file (40 bytes) cannot be read; it ends within a message'
    """
    words = []
    if damage.places:
        size = f" ({damage.size:,} bytes)" if damage.size else ""
        words.append(f"{damage.places} {'place' if damage.places == 1 else 'places'} in the file{size} cannot be read")
    if damage.unreadable:
        words.append(f"{damage.unreadable} messages hold nothing that can be used")
    if damage.cut:
        words.append("it ends within a message")
    return "; ".join(words) or "nothing"


def _when(source: FieldSource) -> str:
    if not isfinite(source.utc_start) or not 0.0 <= source.utc_start < 4.1e9:
        return ""
    return f", its time 0 is {datetime.fromtimestamp(source.utc_start, UTC):%Y-%m-%d %H:%M:%S} UTC"
