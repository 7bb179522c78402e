"""Parse the periods in which a zone is active, and decide if it may be active during a flight.

A period is one line of text, in universal time (UTC): ``START/END``, then days of the week and hours of the day if it
is not active throughout.  ``..`` is an unknown start or end, and BY NOTAM means a zone that a notice activates.

    2026-05-01T00:00Z/2026-10-01T00:00Z
    2026-05-01T00:00Z/.. SAT,SUN 07:00/20:00
    BY NOTAM
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta

# In the order of datetime.weekday(), from 0.
WEEKDAYS = ("MON", "TUE", "WED", "THU", "FRI", "SAT", "SUN")
# A zone activated by a notice; no file contains the notice, so the zone is treated as active.
BY_NOTAM = "BY NOTAM"
# Unknown start or end of a period.
OPEN = ".."
# Duration of a flight of which only the start is given.
DEFAULT_SPAN = timedelta(hours=1)
# Longest duration of a flight with a given start and end.
LONGEST_SPAN = timedelta(days=7)
_HOURS = re.compile(r"([01]\d|2[0-4]):([0-5]\d)/([01]\d|2[0-4]):([0-5]\d)")
_DAY = timedelta(days=1)


@dataclass(frozen=True, slots=True)
class Period:
    """One period of a zone's activity, in UTC.

    start, end: None if unknown.
    days: days of the week, 0 for Monday; empty for all.
    first, last: minutes of the day, None for the whole day; a last minute that is not after the first is on the next
        day.
    """

    start: datetime | None = None
    end: datetime | None = None
    days: frozenset[int] = frozenset()
    first: int | None = None
    last: int | None = None

    def text(self) -> str:
        """Return the period as the line that `parse_period` reads.

        >>> Period(days=frozenset({5, 6}), first=420, last=1200).text()
        '../.. SAT,SUN 07:00/20:00'
        """
        parts = ["/".join(OPEN if moment is None else f"{moment:%Y-%m-%dT%H:%M}Z" for moment in (self.start, self.end))]
        if self.days:
            parts.append(",".join(WEEKDAYS[day] for day in sorted(self.days)))
        if self.first is not None and self.last is not None:
            parts.append("/".join(f"{minutes // 60:02d}:{minutes % 60:02d}" for minutes in (self.first, self.last)))
        return " ".join(parts)


def parse_period(text: str) -> Period | None:
    """Parse the period in a line of text; return None for the text `BY_NOTAM`.

    Raises ValueError for an invalid period.

    >>> parse_period("2026-05-01T00:00Z/.. SAT,SUN 07:00/20:00").days == {5, 6}
    True
    """
    if text.upper() == BY_NOTAM:
        return None
    allowed = 'allowed "START/END [DAYS] [HH:MM/HH:MM]" in UTC, .. for an open end, or "BY NOTAM"'
    span, *fields = text.split()
    ends = span.split("/")
    if len(ends) != 2 or len(fields) > 2:
        raise ValueError(f"{text[:60]!r}: {allowed}")
    try:
        start, end = (None if end_text == OPEN else _parse_part(end_text) for end_text in ends)
        days: frozenset[int] = frozenset()
        if fields and ":" not in fields[0]:
            days = frozenset(WEEKDAYS.index(day) for day in fields.pop(0).upper().split(","))
        first = last = None
        if fields:
            hours = _HOURS.fullmatch(fields.pop(0))
            if hours is None:
                raise ValueError
            first, last = (int(hours[k]) * 60 + int(hours[k + 1]) for k in (1, 3))
        if fields or max(first or 0, last or 0) > 24 * 60:
            raise ValueError
    except ValueError:
        raise ValueError(f"{text[:60]!r}: {allowed}") from None
    if start is not None and end is not None and end < start:
        raise ValueError(f"{text[:60]!r}: ends before it starts")
    return Period(start, end, days, first, last)


def parse_time(text: str) -> datetime:
    """Parse an ISO 8601 time with a UTC offset, and return it in UTC; 24:00 is 00:00 of the next day.

    Raises ValueError for any other text. The message does not repeat the text.

    >>> parse_time("2026-05-01T24:00+02:00").isoformat()
    '2026-05-01T22:00:00+00:00'
    """
    text_at_midnight = re.sub(r"T24:00(:00(\.0+)?)?", "T00:00", text)
    try:
        moment = datetime.fromisoformat(text_at_midnight)
    except ValueError:
        raise ValueError("expected a time in ISO 8601 format, such as 2026-05-01T10:00+02:00") from None
    if moment.tzinfo is None:
        raise ValueError("no offset from UTC: write Z, or +02:00")
    try:
        return (moment + (_DAY if text_at_midnight != text else timedelta())).astimezone(UTC)
    except OverflowError as error:
        raise ValueError("out of range") from error


def _parse_part(text: str) -> datetime:
    """Parse a time that is a part of a longer text.

    Unlike `parse_time`, it names this part in the error message.
    """
    try:
        return parse_time(text)
    except ValueError as error:
        raise ValueError(f"{text[:40]!r}: {error}") from error


def parse_span(text: str) -> tuple[datetime, datetime]:
    """Parse the time span of a flight; return its start and end.

    text: ``START`` or ``START/END``, with UTC offsets.

    A span without an end lasts `DEFAULT_SPAN`. Raises ValueError for any other text, for an end before the start, and
    for more than `LONGEST_SPAN`.

    >>> [f"{time:%H:%M}" for time in parse_span("2026-05-01T10:00+02:00")]
    ['08:00', '09:00']
    """
    start_text, separator, end_text = text.partition("/")
    start_time = _parse_part(start_text) if separator else parse_time(start_text)
    end_time = _parse_part(end_text) if separator else start_time + DEFAULT_SPAN
    if not start_time <= end_time <= start_time + LONGEST_SPAN:
        raise ValueError(f"the end must not be before the start, nor more than {LONGEST_SPAN.days} days after it")
    return start_time, end_time


def is_active(times: Sequence[str], start: datetime, end: datetime) -> bool:
    """Return True if a zone may be active at any time from `start` to `end`, both included.

    times: periods as `parse_period` reads them. A zone without periods, or with BY NOTAM, is always active.

    >>> start, end = parse_span("2026-05-02T06:30Z")  # a Saturday
    >>> is_active(["../.. SAT 07:00/20:00"], start, end), is_active(["../.. SUN"], start, end)
    (True, False)
    """
    periods = [parse_period(text) for text in times]
    return not periods or any(period is None or _may_overlap(period, start, end) for period in periods)


def _may_overlap(period: Period, start: datetime, end: datetime) -> bool:
    """Return True if a period may include a time from `start` to `end`, both included.

    Each day of this time is tested with the hours and the days of the week of the period.
    """
    start = start if period.start is None else max(start, period.start)
    end = end if period.end is None else min(end, period.end)
    if start > end:
        return False
    first_minute, last_minute = (
        (0, 24 * 60) if period.first is None or period.last is None else (period.first, period.last)
    )
    last_minute += 24 * 60 if last_minute <= first_minute else 0
    # Start two days earlier, because evening hours may continue past midnight.
    day = datetime.combine(start.date(), time(), UTC) - 2 * _DAY
    while day <= end:
        is_within = day + timedelta(minutes=first_minute) <= end and day + timedelta(minutes=last_minute) >= start
        if is_within and (not period.days or day.weekday() in period.days):
            return True
        day += _DAY
    return False
