"""Damaged copies of a file, from a seed: bits turned over, pieces cut out, doubled, moved, overwritten."""

import numpy as np


def damaged(data: bytes, seed: int) -> bytes:
    """One damaged copy."""
    random = np.random.default_rng([14, seed])
    out = bytearray(data)
    for _ in range(int(random.integers(1, 6))):
        if len(out) < 64:
            break
        at = int(random.integers(0, len(out) - 32))
        size = int(random.integers(1, min(4000, len(out) - at)))
        match int(random.integers(0, 7)):
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
                out[at : at + 4] = b"\x00\x00\xc0\x7f"
    return bytes(out)
