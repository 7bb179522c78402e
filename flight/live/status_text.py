"""Texts for ground stations: one line with a MAV_SEVERITY, and the STATUSTEXT messages that carry it."""

from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

# MAV_SEVERITY.
INFO, NOTICE, WARNING, CRITICAL = 6, 5, 4, 2
# Bytes of one STATUSTEXT, and of a whole text.
_PIECE, _LONGEST = 50, 400


class StatusText(NamedTuple):
    """A line for every station; severity: MAV_SEVERITY."""

    text: str
    severity: int = INFO


def status_texts(text: str, severity: int, number: int) -> list[Any]:
    """STATUSTEXT messages of any text, in pieces of 50 bytes that stations join again.

    number: 1..65535, new for each text.  Ground stations show ASCII: any other character becomes "?", a degree sign
    " deg", and what is beyond 400 bytes is left out.

    >>> [message.text for message in status_texts("climb of 9° at leg 3", 4, 1)]
    ['climb of 9 deg at leg 3']
    >>> [(message.id, message.chunk_seq, len(message.text)) for message in status_texts("x" * 120, 6, 7)]
    [(7, 0, 50), (7, 1, 50), (7, 2, 20)]
    """
    data = text.replace("°", " deg").encode("ascii", "replace")[:_LONGEST]
    pieces = [data[at : at + _PIECE] for at in range(0, len(data), _PIECE)]
    if len(pieces) <= 1:
        return [mavlink.MAVLink_statustext_message(severity, data)]
    # A text ends with the first piece that is not full.
    if len(pieces[-1]) == _PIECE:
        pieces.append(b"")
    return [mavlink.MAVLink_statustext_message(severity, piece, number, k) for k, piece in enumerate(pieces)]
