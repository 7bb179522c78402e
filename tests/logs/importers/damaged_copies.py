"""Damaged copies of a log, from a seed: bytes turned over, cut, doubled and overwritten, and whole records of its
format doubled, left out, made of another length, or without a place."""

import re
import struct

import numpy as np

NAN = struct.pack("<f", float("nan"))
_TEXTS = (".gpx", ".igc", ".kml")


def damaged(data: bytes, seed: int, suffix: str) -> bytes:
    """One damaged copy of a log whose file name ends with ``suffix``."""
    random = np.random.default_rng([14, seed])
    out = bytearray(data)
    for _ in range(int(random.integers(1, 6))):
        if len(out) < 64:
            break
        # Damage to its bytes leaves a text that is no XML any more: that is refused, and tries nothing else.
        kind = int(random.integers(7 if suffix in (".gpx", ".kml") and random.random() < 0.95 else 0, 11))
        if kind < 7:
            _damage_bytes(out, kind, random)
        else:
            _damage_records(out, kind - 7, suffix, random)
    return bytes(out)


def _damage_bytes(out: bytearray, kind: int, random: np.random.Generator) -> None:
    at = int(random.integers(0, len(out) - 32))
    size = int(random.integers(1, min(4000, len(out) - at)))
    match kind:
        case 0:
            out[at] ^= 1 << int(random.integers(0, 8))
        case 1:
            del out[at : at + size]
        case 2:
            out[at:at] = out[at : at + size]
        case 3:
            del out[at:]
        case 4:
            # What block-wise storage leaves where it was never written.
            out[at : at + size] = b"\xff" * size
        case 5:
            out[at : at + size] = random.integers(0, 256, size, dtype=np.uint8).tobytes()
        case 6:
            # A float that is no number, wherever it comes to lie.
            out[at : at + 4] = NAN


def _damage_records(out: bytearray, kind: int, suffix: str, random: np.random.Generator) -> None:
    """Doubled, left out, a wrong length, no place: of one record or of as many as are some seconds."""
    edges = record_edges(bytes(out), suffix)
    if len(edges) < 40:
        return
    first = int(random.integers(0, len(edges) - 30))
    count = 1 if random.random() < 0.5 else int(random.integers(2, min(len(edges) - first - 1, 400)))
    begin, end = edges[first], edges[first + count]
    match kind:
        case 0:
            out[end:end] = out[begin:end]
        case 1:
            del out[begin:end]
        case 2:
            _wrong_length(out, begin, suffix, random)
        case 3:
            for at in edges[first : first + count]:
                _no_place(out, at, suffix)


def record_edges(data: bytes, suffix: str) -> list[int]:
    """Where the records of a log begin, as far as they can be told."""
    if suffix in _TEXTS:
        mark = {".gpx": b"<trkpt", ".igc": b"\nB", ".kml": b"<when>"}[suffix]
        return [found.start() + (suffix == ".igc") for found in re.finditer(mark, data)]
    if suffix == ".BIN":
        return [found.start() for found in re.finditer(b"\xa3\x95", data)]
    if suffix == ".tlog":
        # The high bytes of a time of these years, and MAVLink's first.
        return [found.start() for found in re.finditer(rb"\x00[\x05\x06].{6}[\xfd\xfe]", data, re.DOTALL)]
    edges, at = [], 16
    while at + 3 <= len(data):
        edges.append(at)
        at += 3 + int.from_bytes(data[at : at + 2], "little")
    return edges


def _wrong_length(out: bytearray, at: int, suffix: str, random: np.random.Generator) -> None:
    """A length byte of another value; in a text, and in a dataflash message, a byte too few or too many."""
    if suffix == ".ulg":
        out[at] = int(random.integers(0, 256))
    elif suffix == ".tlog":
        out[at + 9] = int(random.integers(0, 256))
    else:
        # Within the first number of a point; a time's seconds.
        at += {".gpx": 14, ".kml": 23}.get(suffix, 5)
        if random.random() < 0.5:
            del out[at]
        else:
            out.insert(at, int(random.integers(48, 58)))


def _no_place(out: bytearray, at: int, suffix: str) -> None:
    """Where numbers of this record lie: none."""
    if suffix in (".gpx", ".kml"):
        found = re.compile(rb'(?<=lat=")[^"]*|(?<=<gx:coord>)\S+').search(out, at)
        if found:
            # As long as the number was, so that other records stay where they are.
            out[found.start() : found.end()] = b"NaN".ljust(found.end() - found.start())
        return
    place = {".BIN": 11, ".tlog": 22, ".ulg": 13, ".igc": 7}[suffix]
    text = b"NaN" if suffix == ".igc" else NAN + NAN
    if at + place + len(text) < len(out):
        out[at + place : at + place + len(text)] = text
