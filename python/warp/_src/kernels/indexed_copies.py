"""Copies from and to indexed arrays, by kernels: a tape records and differentiates them."""

from __future__ import annotations

import typing

from warp._src.arrays.array import array
from warp._src.arrays.copies import copy
from warp._src.arrays.index_checks import check_indices_lie_in
from warp._src.arrays.indexed import indexedarray
from warp._src.kernels.decorator import kernel
from warp._src.kernels.launch import launch
from warp._src.language import namespace as wp
from warp._src.types import dtypes


@kernel
def copy1(src: typing.Any, dest: typing.Any):
    i = wp.tid()
    dest[i] = src[i]


@kernel
def copy2(src: typing.Any, dest: typing.Any):
    i, j = wp.tid()
    dest[i, j] = src[i, j]


@kernel
def copy3(src: typing.Any, dest: typing.Any):
    i, j, k = wp.tid()
    dest[i, j, k] = src[i, j, k]


@kernel
def copy4(src: typing.Any, dest: typing.Any):
    i, j, k, m = wp.tid()
    dest[i, j, k, m] = src[i, j, k, m]


_KERNELS = {1: copy1, 2: copy2, 3: copy3, 4: copy4}


def copy_elements(dest, src, stream=None) -> None:
    """Copies all elements between arrays of one shape, of which one is indexed at least.

    Raises:
        IndexError: on the CPU, an index is out of bounds.
    """
    for one in (dest, src):
        if isinstance(one, indexedarray):
            check_indices_lie_in(one.data, one.indices)
    if dest.device_index != src.device_index:
        # Indexed arrays are gathered and scattered where they live.
        if isinstance(src, indexedarray):
            src = src.contiguous()
        if isinstance(dest, indexedarray):
            src = src.to(dest.device)
        else:
            copy(dest, src, stream=stream)
            return
    if dtypes.is_struct(dest.dtype) and not src.requires_grad:
        # Kernels know of a struct's arrays what they use, not all of its bytes.
        words, odd = divmod(dest.item_size, 4)
        raw = (
            dtypes.vector(dest.item_size, dtypes.uint8)
            if odd
            else dtypes.vector(words, dtypes.uint32)
        )
        dest = _viewed(dest, raw)
    if dest.dtype is not src.dtype:
        src = _viewed(src, dest.dtype)
    launch(_KERNELS[dest.ndim], dest.shape, [src], [dest], device=dest.device, stream=stream)


def _viewed(source, dtype):
    """The same memory as elements of another type of equal size."""
    if isinstance(source, array):
        return source.view(dtype)
    return source.over(source.data.view(dtype))
