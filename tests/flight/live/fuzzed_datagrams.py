"""Datagrams of any content: noise, damaged frames, and whole frames of every message."""

import random
import struct

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.flight.live.fake_vehicle import packed
from tests.stations import item


def fuzzed(count: int, seed: int) -> list[bytes]:
    """Datagrams: noise, damaged frames, and whole frames of every message with any content."""
    rng = random.Random(seed)
    kinds = sorted(mavlink.mavlink_map)
    likely = [0, 11, 20, 21, 23, 39, 40, 41, 43, 44, 45, 47, 51, 66, 73, 75, 76, 4, 111]
    found = []
    for _ in range(count):
        kind = mavlink.mavlink_map[rng.choice(likely if rng.random() < 0.6 else kinds)]
        payload = bytearray(rng.randbytes(kind.unpacker.size))
        # Addressed to the vehicle more often than chance would have it.
        names, order = kind.fieldnames, kind.ordered_fieldnames
        if rng.random() < 0.9 and "target_system" in names:
            payload[_offset(kind, order.index("target_system"))] = rng.choice([0, 1])
        if rng.random() < 0.9 and "target_component" in names:
            payload[_offset(kind, order.index("target_component"))] = rng.choice([0, 1])
        if "command" in names and kind.id in (75, 76) and rng.random() < 0.7:
            at = _offset(kind, order.index("command"))
            payload[at : at + 2] = rng.choice([400, 176, 300, 511, 512, 510, 193, 224, 410]).to_bytes(2, "little")
        if "seq" in names and rng.random() < 0.5:
            at = _offset(kind, order.index("seq"))
            payload[at : at + 2] = rng.choice([0, 1, 2]).to_bytes(2, "little")
        if "count" in names and kind.id == 44 and rng.random() < 0.7:
            at = _offset(kind, order.index("count"))
            payload[at : at + 2] = rng.choice([0, 1, 2, 3]).to_bytes(2, "little")
        if "mission_type" in names and rng.random() < 0.8:
            payload[_offset(kind, order.index("mission_type"))] = rng.choice([0, 1, 2, 255])
        data = bytes(payload).rstrip(b"\0") or b"\0"
        head = bytes([0xFD, len(data), 0, 0, rng.randrange(256), rng.choice([255, 255, 255, 254, 1]), 190])
        body = head + kind.id.to_bytes(3, "little") + data
        crc = mavlink.x25crc(body[1:])
        crc.accumulate(bytes([kind.crc_extra]))
        frame = body + crc.crc.to_bytes(2, "little")
        if kind.id == 73 and rng.random() < 0.7:
            frame = packed(item(rng.choice([0, 1, 2]), rng.randrange(2**29), 80_000_000, 100.0))
        chance = rng.random()
        if chance < 0.1:
            frame = rng.randbytes(rng.randrange(300))
        elif chance < 0.2:
            damaged = bytearray(frame)
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
            frame = bytes(damaged[: rng.randrange(len(damaged) + 1)])
        found.append(frame)
    return found


def _offset(kind: object, index: int) -> int:
    """Bytes before a field on the wire."""
    codes = list(kind.native_format.decode().lstrip("<"))
    sizes = [
        struct.calcsize("<" + code) * max(1, length) for code, length in zip(codes, kind.array_lengths, strict=True)
    ]
    return sum(sizes[:index])
