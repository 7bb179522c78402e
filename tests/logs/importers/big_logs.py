"""Logs as large as wanted: a flight's own messages again and again, each time later."""

import binascii
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

from tests.logs.importers.pymavlink_rows import FLIGHTS
from tests.logs.importers.written_logs import px4, telemetry

# Bytes of a message that states a format.
FMT = 89
# Bytes of messages that are not read, for each of those that are.
BESIDE = {".BIN": 3.0, ".tlog": 9.0, ".ulg": 9.0}


class Stamp(NamedTuple):
    """A time in a log: where, its form, its units in a second."""

    at: int
    form: str
    unit: float


def big_log(path: Path, size: int) -> Path:
    """Write a log of at least so many bytes, in the format that the path's suffix says."""
    match path.suffix:
        case ".BIN":
            data = (FLIGHTS / "ridge-10mps.BIN").read_bytes()
            begin, stamps, later = *_dataflash_stamps(data), 420.0
            data += b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", 250, 35, b"IMU", b"Qffffff", b"TimeUS,a,b,c,d,e,f")
            beside = b"\xa3\x95\xfa" + bytes(32)
        case ".tlog":
            data = telemetry(path).read_bytes()
            begin, stamps, later = *_telemetry_stamps(data), 100.0
            packet = dialect.MAVLink_raw_imu_message(1, *range(1, 10)).pack(dialect.MAVLink(None, 1, 1))
            beside = data[begin : begin + 8] + packet
        case _:
            data = px4(path).read_bytes()
            form = b"sensor_combined:uint64_t timestamp;float[7] all;"
            first_use = data.index(b"A\x00\x00\x00vehicle") - 2
            used = struct.pack("<HcBH", 3 + 15, b"A", 0, 99) + b"sensor_combined"
            data = data[:first_use] + struct.pack("<Hc", len(form), b"F") + form + used + data[first_use:]
            begin, stamps, later = *_px4_stamps(data), 100.0
            beside = struct.pack("<HcH", 38, b"D", 99) + bytes(36)
    part = bytearray(data[begin : len(data) - (FMT if path.suffix == ".BIN" else 0)])
    # What logs hold most of, and none of it is read: of each megabyte some 1,000 places are left, as of real ones.
    rest = beside * round(BESIDE[path.suffix] * len(part) / len(beside))
    stamps = [Stamp(at - begin, form, unit) for at, form, unit in stamps]
    first = [struct.unpack_from(one.form, part, one.at)[0] for one in stamps]
    with path.open("wb") as file:
        file.write(data)
        lap = 0
        while file.tell() < size:
            lap += 1
            for one, value in zip(stamps, first, strict=True):
                struct.pack_into(one.form, part, one.at, round(value + lap * later * one.unit))
            if path.suffix == ".tlog":
                _sum_again(part)
            file.write(part)
            file.write(rest)
    return path


def _dataflash_stamps(data: bytes) -> tuple[int, list[Stamp]]:
    """From the first place on; what stands before it, the formats, parameters and items, is not doubled."""
    lengths, names, at, begin = {128: 89}, {}, 0, 0
    stamps = []
    while at + 3 < len(data):
        kind = data[at + 2]
        if kind == 128:
            lengths[data[at + 3]], names[data[at + 3]] = data[at + 4], data[at + 5 : at + 9].strip(b"\0")
        begin = begin or (at if names.get(kind) == b"POS" else 0)
        if begin and kind != 128:
            stamps.append(Stamp(at + 3, "<Q", 1e6))
        at += lengths[kind]
    return begin, stamps


def _packets(data: bytes | bytearray) -> Iterator[int]:
    return (one.start() for one in re.finditer(rb"\x00[\x05\x06].{6}\xfd", data, re.DOTALL))


def _number(data: bytes | bytearray, at: int) -> int:
    return int.from_bytes(data[at + 15 : at + 18], "little")


# Messages that begin with the time since the vehicle was switched on.
_TURNED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_OWN_TIME = (dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, dialect.MAVLINK_MSG_ID_ATTITUDE)


def _telemetry_stamps(data: bytes) -> tuple[int, list[Stamp]]:
    stamps, begin = [], 0
    for at in _packets(data):
        own = _number(data, at) in _OWN_TIME
        begin = begin or (at if own else 0)
        if begin:
            stamps.append(Stamp(at, ">Q", 1e6))
            stamps += [Stamp(at + 18, "<I", 1e3)] if own else []
    return begin, stamps


def _sum_again(part: bytearray) -> None:
    """The checksums of packets whose times were changed."""
    for at in _packets(part):
        if _number(part, at) in _OWN_TIME:
            length = part[at + 9]
            summed = bytes(part[at + 9 : at + 18 + length]) + bytes([dialect.mavlink_map[_number(part, at)].crc_extra])
            # CRC-16/MCRF4XX is CRC-CCITT with the bits of each byte, and of the sum, the other way round.
            total = binascii.crc_hqx(summed.translate(_TURNED), 0xFFFF)
            struct.pack_into("<H", part, at + 18 + length, int(f"{total:016b}"[::-1], 2))


def _px4_stamps(data: bytes) -> tuple[int, list[Stamp]]:
    at, rows = 16, []
    while at + 3 <= len(data):
        if data[at + 2 : at + 3] == b"D":
            rows.append(at)
        at += 3 + int.from_bytes(data[at : at + 2], "little")
    return rows[0], [Stamp(at + 5, "<Q", 1e6) for at in rows]


def claims(path: Path, size: int) -> Path:
    """A log that claims a size, and takes no room for it."""
    with path.open("wb") as file:
        file.write((FLIGHTS / "tight.BIN").read_bytes()[:4096])
        file.truncate(size)
    assert np.isclose(path.stat().st_size, size)
    return path
