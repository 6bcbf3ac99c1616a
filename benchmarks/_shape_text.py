"""Kernels of shapes.py over text: counts, searches, check sums, numbers."""

import numpy as np

import warp as wp
from _shape_data import Case, case, forward_only


@forward_only
def words_kernel(text: wp.array(dtype=wp.uint8), counts: wp.array(dtype=int)):
    i = wp.tid()
    c = text[i]
    before = wp.uint8(32)
    if i > 0:
        before = text[i - 1]
    if c != wp.uint8(32) and before == wp.uint8(32):
        wp.atomic_add(counts, 0, 1)
    if c == wp.uint8(10):
        wp.atomic_add(counts, 1, 1)
    if c >= wp.uint8(97) and c <= wp.uint8(122):
        wp.atomic_add(counts, 2, 1)


@case
def words(data):
    """Words, lines and small letters of a text."""
    n = data.size(1 << 20, 1 << 26)
    text = data.random.choice(np.frombuffer(b"abcdefgh ABC \n", np.uint8), n)
    return Case(words_kernel, n, [data.given(text, wp.uint8)], [data.out(3, int, False)], n, "byte")


@forward_only
def find_kernel(
    text: wp.array(dtype=wp.uint8), key: wp.array(dtype=wp.uint8), out: wp.array(dtype=int)
):
    i = wp.tid()
    same = int(0)
    for k in range(key.shape[0]):
        if text[i + k] != key[k]:
            break
        same += 1
    if same == key.shape[0]:
        wp.atomic_add(out, 0, 1)
        wp.atomic_max(out, 1, i)


@case
def find(data):
    """Places where a text has a short word."""
    n = data.size(1 << 19, 1 << 25)
    text = data.random.choice(np.frombuffer(b"ab", np.uint8), n + 8)
    arrays = [data.given(text, wp.uint8), data.given(np.frombuffer(b"abbab", np.uint8), wp.uint8)]
    return Case(find_kernel, n, arrays, [data.out(2, int, False)], n, "place")


@forward_only
def crc_kernel(
    rows: wp.array2d(dtype=wp.uint8),
    table: wp.array(dtype=wp.uint32),
    out: wp.array(dtype=wp.uint32),
):
    i = wp.tid()
    c = wp.uint32(0xFFFFFFFF)
    for k in range(rows.shape[1]):
        c = table[int((c ^ wp.uint32(rows[i, k])) & wp.uint32(255))] ^ (c >> wp.uint32(8))
    out[i] = c ^ wp.uint32(0xFFFFFFFF)


@case
def crc(data):
    """Check sums of rows of bytes, by a table."""
    n, m = data.size(4096, 1 << 18), 64
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, 0xEDB88320 ^ (table >> 1), table >> 1).astype(np.uint32)
    arrays = [data.integers((n, m), 0, 256, wp.uint8), data.given(table, wp.uint32)]
    return Case(crc_kernel, n, arrays, [data.out(n, wp.uint32, False)], n * m, "byte")


@forward_only
def parse_kernel(text: wp.array2d(dtype=wp.uint8), out: wp.array(dtype=wp.float64)):
    i = wp.tid()
    k = int(0)
    sign = wp.float64(1.0)
    if text[i, 0] == wp.uint8(45):
        sign = wp.float64(-1.0)
        k = 1
    value = wp.float64(0.0)
    scale = wp.float64(1.0)
    point = bool(False)
    while k < text.shape[1]:
        c = text[i, k]
        if c == wp.uint8(46):
            point = True
        elif c >= wp.uint8(48) and c <= wp.uint8(57):
            value = value * wp.float64(10.0) + wp.float64(int(c) - 48)
            if point:
                scale = scale * wp.float64(10.0)
        else:
            break
        k += 1
    out[i] = sign * value / scale


@case
def parse(data):
    """Numbers out of text, one per row."""
    n = data.size(1 << 14, 1 << 20)
    rows = [f"{x:.6f}".ljust(12)[:12] for x in data.random.uniform(-1000.0, 1000.0, 4096)]
    text = np.frombuffer("".join(rows).encode(), np.uint8).reshape(-1, 12)
    text = np.tile(text, (n // 4096, 1))
    return Case(
        parse_kernel, n, [data.given(text, wp.uint8)], [data.out(n, wp.float64, False)], n, "number"
    )
