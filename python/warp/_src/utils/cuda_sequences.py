"""Sorts of segments and runs on CUDA, made of scans, sorts and kernels. Nothing waits for them."""

import functools

import warp as wp
from warp import _native
from warp._src.arrays.create import empty, zeros


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
        # What lies in no segment keeps its order: equal keys.
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
    marks = zeros(count, dtype=wp.vec2i, device=device)
    wp.launch(_mark_segments, begins.size, [begins, ends, count, marks], device=device)
    _native.scan_numbers(marks, marks, "int32", 2, count, True)
    ranked = empty(2 * count, dtype=wp.uint64, device=device)
    pairs = empty(2 * count, dtype=wp.vec2i, device=device)
    wp.launch(pack, count, [keys, values, marks, ranked, pairs], device=device)
    bits = 32 + (2 * begins.size).bit_length()
    _native.sort_pairs(ranked, pairs, "uint64", count, 0, bits)
    wp.launch(unpack, count, [pairs, keys, values], device=device)


@functools.cache
def _run_kernels(bits):
    """Kernels for numbers of a type."""

    @wp.kernel(name=f"mark_runs_{bits.__name__}", module=__name__, enable_backward=False)
    def mark(numbers: wp.array(dtype=bits), marks: wp.array(dtype=int)):
        i = wp.tid()
        first = i == 0
        if not first:
            first = numbers[i] != numbers[i - 1]
        marks[i] = wp.where(first, 1, 0)

    @wp.kernel(name=f"place_runs_{bits.__name__}", module=__name__, enable_backward=False)
    def place(
        numbers: wp.array(dtype=bits),
        marks: wp.array(dtype=int),
        begins: wp.array(dtype=int),
        run_numbers: wp.array(dtype=bits),
        total: wp.array(dtype=int),
    ):
        i = wp.tid()
        first = i == 0
        if not first:
            first = marks[i] != marks[i - 1]
        if first:
            run_numbers[marks[i] - 1] = numbers[i]
            begins[marks[i] - 1] = i
        if i == numbers.shape[0] - 1:
            total[0] = marks[i]

    return mark, place


@wp.kernel(enable_backward=False)
def _measure_runs(
    begins: wp.array(dtype=int), total: wp.array(dtype=int), run_lengths: wp.array(dtype=int)
):
    i = wp.tid()
    if i < total[0]:
        end = begins.shape[0]
        if i + 1 < total[0]:
            end = begins[i + 1]
        run_lengths[i] = end - begins[i]


def find_runs(numbers, count, run_numbers, run_lengths, total) -> None:
    """What `_native.find_runs` does on the CPU."""
    device = numbers.device
    bits = wp.uint32 if numbers.item_size == 4 else wp.uint64
    mark, place = _run_kernels(bits)
    numbers = numbers.flatten().view(bits)[:count]
    marks = empty(count, dtype=int, device=device)
    begins = empty(count, dtype=int, device=device)
    wp.launch(mark, count, [numbers, marks], device=device)
    _native.scan_numbers(marks, marks, "int32", 1, count, True)
    run_numbers = run_numbers.flatten().view(bits)
    wp.launch(place, count, [numbers, marks, begins, run_numbers, total], device=device)
    wp.launch(_measure_runs, count, [begins, total, run_lengths], device=device)
