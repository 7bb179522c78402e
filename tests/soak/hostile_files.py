"""Hostile files by number: a valid file, its structure damaged in one to three places, the same for the same seed."""

import copy
import json
import random
import re
import struct
import xml.etree.ElementTree as ET
import zlib
from collections.abc import Callable

import zstandard

NUMBERS = (
    "nan",
    "-nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-320",
    "0",
    "-0",
    "-1",
    "1",
    "91",
    "-181",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "-2147483649",
    "18446744073709551616",
    "0x10",
    "1_000",
    "1e5",
    ".5",
    "5.",
    "--1",
    "1,5",
    "٣",
    "½",
    "",
    " ",
    "true",
    "null",
    "9" * 400,
    "0." + "1" * 3000,
)
WORDS = (
    "",
    " ",
    "x" * 70_000,
    "\0",
    "\x1b[2J",
    "../../etc/passwd",
    "/vsicurl/http://127.0.0.1:9/x",
    "\u202egnp.exe",
    "%s%n",
)
JSON_VALUES = (
    None,
    True,
    False,
    0,
    -1,
    2**63,
    -(2**31),
    1e308,
    float("nan"),
    float("inf"),
    91.0,
    -181.0,
    "",
    "x" * 5000,
    "\ud800",
    [],
    {},
    [[]],
    [None] * 7,
    {"a": {"a": {}}},
    [0] * 5000,
)
MAGIC = b"\x89MCAP0\r\n"


def damaged_lines(text: str, rng: random.Random) -> bytes:
    """A file of lines and fields, of which some are replaced, dropped, doubled, swapped, cut or joined."""
    lines = text.split("\n")
    for _ in range(rng.randint(1, 3)):
        k = rng.randrange(len(lines))
        fields = re.split(r"([\t ,=]+)", lines[k])
        how = rng.randrange(8)
        if how <= 2:
            fields[rng.randrange(len(fields))] = rng.choice(NUMBERS + WORDS)
            lines[k] = "".join(fields)
        elif how == 3:
            del lines[k]
        elif how == 4:
            lines[k:k] = [lines[k]] * rng.choice((1, 2, 300))
        elif how == 5:
            rng.shuffle(fields)
            lines[k] = "".join(fields)
        elif how == 6:
            lines[k] = lines[k][: rng.randrange(len(lines[k]) + 1)]
        else:
            lines[k] = lines[k].replace("\n", "") + rng.choice(("\r", "\f", "\x85", "\u2028", "#", '"', "[", "]]"))
        lines = lines or [""]
    return damaged_bytes("\n".join(lines).encode("utf-8", "surrogatepass"), rng, often=0.15)


def damaged_bytes(data: bytes, rng: random.Random, often: float) -> bytes:
    """Some files with bytes that are cut, flipped or added, or in another encoding."""
    if rng.random() >= often or not data:
        return data
    at = rng.randrange(len(data))
    return rng.choice(
        (
            data[:at],
            data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :],
            data[:at] + rng.randbytes(5) + data[at:],
            b"\xef\xbb\xbf" + data,
            data.decode("utf-8", "replace").encode("utf-16"),
            data.replace(b"\n", b"\r\n"),
        )
    )


def damaged_json(text: str, rng: random.Random) -> bytes:
    """A JSON file, of whose values some are replaced, dropped, doubled, moved or nested."""
    try:
        return _damaged_json(text, rng)
    except RecursionError:
        return b"[" * 100_000


def _damaged_json(text: str, rng: random.Random) -> bytes:
    whole = {"": json.loads(text)}
    for _ in range(rng.randint(1, 3)):
        places = list(_places(whole))
        holder, key = rng.choice(places)
        how = rng.randrange(6)
        if how <= 2:
            # A copy: what is put into it later is this file's.
            holder[key] = copy.deepcopy(rng.choice(JSON_VALUES))
        elif how == 3 and holder is not whole:
            del holder[key]
        elif how == 4:
            other, place = rng.choice(places)
            holder[key] = copy.deepcopy(other[place])
        else:
            for _ in range(rng.choice((1, 40, 2000))):
                holder[key] = [holder[key]]
    return damaged_bytes(json.dumps(whole[""]).encode("utf-8", "surrogatepass"), rng, often=0.1)


def _places(value: object) -> "list[tuple[object, object]]":
    found, todo = [], [value]
    while todo:
        one = todo.pop()
        if isinstance(one, dict | list):
            for key in one if isinstance(one, dict) else range(len(one)):
                found.append((one, key))
                todo.append(one[key])
    return found


def damaged_xml(text: str, rng: random.Random) -> bytes:
    """An XML file, of whose elements, attributes and texts some are replaced, dropped, doubled, moved or nested."""
    root = ET.fromstring(text)
    for _ in range(rng.randint(1, 3)):
        parents = [item for item in root.iter() if len(item)]
        parent = rng.choice(parents)
        child = parent[rng.randrange(len(parent))]
        how = rng.randrange(7)
        if how <= 1:
            rng.choice(list(root.iter())).text = rng.choice(
                NUMBERS + WORDS[:1] + ("x" * 70_000, "%s%n", "1 2", "1 nan\n2 3")
            )
        elif how == 2:
            parent.remove(child)
        elif how == 3:
            parent.append(copy.deepcopy(child))
        elif how == 4:
            holders = [item for item in root.iter() if item.attrib] or [root]
            holder = rng.choice(holders)
            if holder.attrib:
                holder.set(rng.choice(list(holder.attrib)), rng.choice((*NUMBERS, "../../x", "no/such/property")))
        elif how == 5:
            child.tag = rng.choice(("function", "property", "table", "system", "channel", "output", "include", "x"))
        else:
            for _ in range(rng.choice((1, 30, 400))):
                inner = ET.Element(rng.choice(("sum", "product", "abs")))
                inner.append(copy.deepcopy(child) if len(inner) < 1 and rng.random() < 0.1 else ET.Element("value"))
                child.append(inner)
                child = inner
    text = ET.tostring(root, encoding="unicode").replace("\0", "")
    if rng.random() < 0.1:
        text = '<!DOCTYPE a [<!ENTITY x "y"><!ENTITY z SYSTEM "file:///etc/passwd">]>' + text
    return damaged_bytes(text.encode("utf-8", "replace"), rng, often=0.1)


def damaged_tiff(data: bytes, rng: random.Random) -> bytes:
    """A little-endian GeoTIFF, of whose header and directory some fields are set to what no file has."""
    out = bytearray(data)
    (directory,) = struct.unpack_from("<I", out, 4)
    (entries,) = struct.unpack_from("<H", out, directory)
    for _ in range(rng.randint(1, 3)):
        at = directory + 2 + 12 * rng.randrange(entries)
        offset, size = rng.choice(((0, 2), (2, 2), (4, 4), (8, 4), (8, 4), (8, 4)))
        value = rng.choice((0, 1, 2, 3, 255, 256, 32768, 65535, 2**31 - 1, 2**31, 2**32 - 1, rng.randrange(2**32)))
        (where,) = struct.unpack_from("<I", out, at + 8)
        if rng.random() < 0.3 and where + 8 <= len(out):
            # What the entry points at: tie points, pixel sizes, keys.
            out[where : where + 8] = rng.choice(
                (b"\xff" * 8, bytes(8), struct.pack("<d", 1e308), struct.pack("<d", -1.0))
            )
        elif rng.random() < 0.1:
            struct.pack_into("<I", out, 4, value % 2**32)
        else:
            out[at + offset : at + offset + size] = (value % 256**size).to_bytes(size, "little")
    return damaged_bytes(bytes(out), rng, often=0.1)


def damaged_mcap(data: bytes, rng: random.Random) -> bytes:
    """A log whose records are dropped, doubled, swapped and changed, in chunks too, with CRCs that fit."""
    records = _records(data[len(MAGIC) : -len(MAGIC)])
    for _ in range(rng.randint(1, 3)):
        k = rng.randrange(len(records))
        opcode, content = records[k]
        how = rng.randrange(6)
        if how <= 2 and opcode == 6:
            records[k] = (6, _damaged_chunk(content, rng))
        elif how <= 2:
            records[k] = (opcode, damaged_bytes(content, rng, often=1.0))
            if opcode == 9 and len(records[k][1]) > 4:
                body = records[k][1][:-4]
                records[k] = (9, body + struct.pack("<I", zlib.crc32(body)))
        elif how == 3:
            del records[k]
        elif how == 4:
            records.insert(rng.randrange(len(records)), records[k])
        else:
            records[k] = (rng.choice((0, 3, 4, 5, 6, 9, 12, 15, 127, 128, 255)), content)
        records = records or [(1, bytes(8))]
    # No CRC of the whole: what is inside is to be looked at.
    records = [(15, bytes(4)) if opcode == 15 else (opcode, content) for opcode, content in records]
    body = b"".join(struct.pack("<BQ", opcode, len(content)) + content for opcode, content in records)
    return damaged_bytes(MAGIC + body + MAGIC, rng, often=0.05)


def _records(data: bytes) -> list[tuple[int, bytes]]:
    at, found = 0, []
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        found.append((opcode, data[at + 9 : at + 9 + length]))
        at += 9 + length
    return found


def _damaged_chunk(content: bytes, rng: random.Random) -> bytes:
    """The same chunk with records changed inside, and a CRC that fits them."""
    (name,) = struct.unpack_from("<I", content, 28)
    inside = zstandard.ZstdDecompressor().decompress(content[40 + name :], max_output_size=2**24)
    records = _records(inside)
    k = rng.randrange(len(records))
    opcode, body = records[k]
    how = rng.randrange(4)
    if how == 0:
        del records[k]
    elif how == 1:
        records.insert(rng.randrange(len(records)), records[k])
    else:
        out = bytearray(body)
        for _ in range(rng.choice((1, 8))):
            if out:
                out[rng.randrange(len(out))] = rng.choice((0, 1, 127, 128, 255))
        records[k] = (opcode, bytes(out))
    made = b"".join(struct.pack("<BQ", opcode, len(one)) + one for opcode, one in records)
    packed = zstandard.ZstdCompressor().compress(made)
    head = content[:16] + struct.pack("<QII", len(made), zlib.crc32(made), 4) + b"zstd"
    return head + struct.pack("<Q", len(packed)) + packed


Damage = Callable[[bytes, random.Random], bytes]
# How each format is damaged.
DAMAGE: dict[str, Damage] = {
    "wpl": lambda data, rng: damaged_lines(data.decode(), rng),
    "plan": lambda data, rng: damaged_json(data.decode(), rng),
    "toml": lambda data, rng: damaged_lines(data.decode(), rng),
    "geotiff": damaged_tiff,
    "mcap": damaged_mcap,
    "jsbsim": lambda data, rng: damaged_xml(data.decode(), rng),
    "parameters": lambda data, rng: damaged_lines(data.decode(), rng),
}


def hostile(kind: str, valid: bytes, seed: int) -> bytes:
    """The hostile file of a format with a number."""
    return DAMAGE[kind](valid, random.Random(f"{kind} {seed}"))
