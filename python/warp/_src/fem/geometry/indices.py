"""Index tables - selected elements by masks, elements sorted by a key."""

from __future__ import annotations

import warp as wp
from warp import extend
from warp._src.fem.types import Ints


@wp.kernel(enable_backward=False)
def _mark(mask: Ints, ones: Ints):
    i = wp.tid()
    ones[i] = wp.where(mask[i] != 0, 1, 0)


@wp.kernel(enable_backward=False)
def _number(offsets: Ints, ones: Ints, local_to_global: Ints, global_to_local: Ints):
    i = wp.tid()
    place = offsets[i] - 1
    chosen = ones[i] != 0 and place < local_to_global.shape[0]
    global_to_local[i] = wp.where(chosen, place, -1)
    if chosen:
        local_to_global[place] = i


def masked_indices(mask, max_count: int = -1, local_to_global=None, global_to_local=None):
    """Numbers of the elements whose mask is not 0.

    Args:
        mask: array (n,) of int32.
        max_count: size of the first result, -1 to have it counted (which waits for the device).
            Numbers beyond the count are -1.
        local_to_global, global_to_local: arrays of a former call to use again where they fit.

    Returns:
        (local_to_global, global_to_local): numbers of the chosen elements, in order; for each
        element its place among them, or -1.
    """
    device, n = mask.device, mask.shape[0]
    with extend.unrecorded():
        ones = wp.empty(n, dtype=wp.int32, device=device)
        offsets = wp.empty(n, dtype=wp.int32, device=device)
        wp.launch(_mark, n, [mask], [ones], device=device)
        if n:
            wp.utils.array_scan(ones, offsets, inclusive=True)
        count = max_count
        if count < 0:
            count = int(offsets[n - 1 :].numpy()[0]) if n else 0
        if local_to_global is None or local_to_global.shape != (count,):
            local_to_global = wp.empty(count, dtype=wp.int32, device=device)
        if global_to_local is None or global_to_local.shape != (n,):
            global_to_local = wp.empty(n, dtype=wp.int32, device=device)
        local_to_global.fill_(-1)
        outputs = [local_to_global, global_to_local]
        wp.launch(_number, n, [offsets, ones], outputs, device=device)
    return local_to_global, global_to_local
