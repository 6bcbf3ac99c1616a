"""Sorts of a few long segments on CUDA, made of a scan, a sort and kernels. Nothing waits."""

import functools

import warp as wp
from warp import _native


@wp.kernel(enable_backward=False)
def _mark_segments(
    begins: wp.array(dtype=int),
    ends: wp.array(dtype=int),
    count: int,
    marks: wp.array(dtype=wp.vec2i),
):
    """Counts where something begins or ends, and how many segments begin less those that end."""
    i = wp.tid()
    begin, end = begins[i], ends[i]
    if begin >= 0 and begin < end and end <= count:
        wp.atomic_add(marks, begin, wp.vec2i(1, 1))
        if end < count:
            wp.atomic_add(marks, end, wp.vec2i(1, -1))


@functools.cache
def _segment_kernels(kind):
    """Kernels that make pairs sortable by region and key, and that put them back."""
    name = f"{kind.__name__}_segments"

    @wp.kernel(name=f"pack_{name}", module=__name__, enable_backward=False)
    def pack(
        keys: wp.array(dtype=kind),
        values: wp.array(dtype=int),
        marks: wp.array(dtype=wp.vec2i),
        ranked: wp.array(dtype=wp.uint64),
        pairs: wp.array(dtype=wp.vec2i),
    ):
        i = wp.tid()
        key = wp.uint32(0)
        bits = wp.cast(keys[i], wp.uint32)
        sign = wp.uint32(0x80000000)
        # Elements outside of all segments keep their order: equal keys.
        if marks[i][1] > 0:
            key = bits ^ sign
            if wp.static(kind is wp.float32):
                if (bits & ~sign) > wp.uint32(0x7F800000):
                    key = ~wp.uint32(0)
                elif bits == sign:
                    key = sign
                elif (bits & sign) != wp.uint32(0):
                    key = ~bits
        ranked[i] = (wp.uint64(marks[i][0]) << wp.uint64(32)) | wp.uint64(key)
        pairs[i] = wp.vec2i(wp.cast(keys[i], wp.int32), values[i])

    @wp.kernel(name=f"unpack_{name}", module=__name__, enable_backward=False)
    def unpack(
        pairs: wp.array(dtype=wp.vec2i), keys: wp.array(dtype=kind), values: wp.array(dtype=int)
    ):
        i = wp.tid()
        keys[i] = wp.cast(pairs[i][0], kind)
        values[i] = pairs[i][1]

    return pack, unpack


def sort_segments(keys, values, count, begins, ends) -> None:
    """Sorts all pairs by the region that they are in and then by their key.

    A region is what lies between two neighbouring ends of segments, within a segment or not.
    """
    device = keys.device
    pack, unpack = _segment_kernels(keys.dtype)
    keys, values = keys.flatten()[:count], values.flatten()[:count]
    marks = wp.zeros(count, dtype=wp.vec2i, device=device)
    wp.launch(_mark_segments, begins.size, [begins, ends, count, marks], device=device)
    _native.scan_numbers(marks, marks, "int32", 2, count, True)
    ranked = wp.empty(2 * count, dtype=wp.uint64, device=device)
    pairs = wp.empty(2 * count, dtype=wp.vec2i, device=device)
    wp.launch(pack, count, [keys, values, marks, ranked, pairs], device=device)
    bits = 32 + (2 * begins.size).bit_length()
    _native.sort_pairs(ranked, pairs, "uint64", count, 0, bits)
    wp.launch(unpack, count, [pairs, keys, values], device=device)
