"""Saved modules, saved graphs and cached code with other bytes and checksums that fit."""

import struct

_MASK = 2**64 - 1
# magic | format version | length | hash; in the kernel cache a key of 64 characters before length.
HEADER, KEY = 28, 64


def _mix(a, b):
    product = a * b
    return (product ^ (product >> 64)) & _MASK


def hash_bytes(data, seed=0):
    """The checksum of lib/Runtime/Support.cpp."""
    k0, k1 = 0x9E3779B97F4A7C15, 0xD6E8FEB86659FD93
    whole = len(data) // 8 * 8
    found = _mix(seed ^ k0, len(data) ^ k1)
    for (word,) in struct.iter_unpack("<Q", data[:whole]):
        turned = (found << 23 | found >> 41) & _MASK
        found = (_mix(found ^ k0, word ^ k1) + (word ^ turned)) & _MASK
    word = int.from_bytes(data[whole:], "little")
    found ^= (_mix(found ^ k1, word ^ k0) + word) & _MASK
    found ^= found >> 29
    found = found * k0 & _MASK
    return found ^ found >> 32


def resealed(data):
    """A file with the length and the checksum of the payload that it has."""
    start = HEADER + (KEY if data[:8] in (b"WARPCODE", b"WARPKERN") else 0)
    payload = data[start:]
    return data[: start - 16] + struct.pack("<QQ", len(payload), hash_bytes(payload)) + payload


def damaged(choose, data, others=()):
    """Bytes with one random change; `choose` is a `random.Random`."""
    size = len(data)
    at = choose.randrange(size)
    kind = choose.randrange(9)
    if kind == 0:
        return data[:at]
    if kind == 1:
        return data[:at] + data[at + choose.randint(1, 16) :]
    if kind == 2:
        return data[:at] + choose.randbytes(choose.randint(1, 16)) + data[at:]
    if kind == 3:
        end = min(size, at + choose.choice([1, 4, 8, 64, 512]))
        return data[:at] + bytes([choose.choice([0, 255])]) * (end - at) + data[end:]
    if kind == 4:
        value = choose.choice([0, 1, -1, 2**31 - 1, -(2**31), 7, 1000, 65536])
        return data[:at] + struct.pack("<i", value) + data[at + 4 :]
    if kind == 5:
        value = choose.choice([0, 1, 2**64 - 1, 2**63, 2**31, 2**32, 2**40, size, size - at])
        return data[:at] + struct.pack("<Q", value) + data[at + 8 :]
    if kind == 6 and others:
        return data[:at] + choose.choice(others)[at:]
    changed = bytearray(data)
    for _ in range(choose.choice([1, 1, 2, 5, 30])):
        changed[choose.randrange(size)] ^= 1 << choose.randrange(8)
    return bytes(changed)
