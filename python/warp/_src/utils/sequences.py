"""Prefix sums, sorts of pairs, and runs of equal values.

On the CPU they are C++ on all threads (lib/Runtime), on CUDA kernels (lib/DeviceLib/cuda) that are
queued on the current stream; both go into graphs.
"""

from __future__ import annotations

import operator

import warp as wp
from warp import _native
from warp._src.utils.overlaps import check_apart, overlap
from warp.extend import (
    checked,
    errors,
    note_writes,
    type_is_vector,
    type_repr,
    type_scalar_type,
    type_size,
    types_equal,
)
from warp.extend.kinds import ARRAY, COUNT
from warp.types import (
    float32,
    float64,
    int32,
    int64,
    type_is_scalar,
    type_size_in_bytes,
    uint32,
    uint64,
)

_SCANNED = (int32, int64, float32, float64, uint32, uint64)
_KEYS = (int32, uint32, float32, int64, uint64, float64)
_MOST = 2**31 - 1
# Fewer segments than this do not keep a GPU busy with a block for each, where they are long.
_FEW, _LONG = 64, 16384


def _kind(dtype) -> str:
    return type_scalar_type(dtype).__name__


@checked(in_array=ARRAY, out_array=ARRAY)
def array_scan(in_array, out_array, inclusive: bool = True) -> None:
    """Writes the sums of all elements up to each one.

    The components of vectors are summed on their own. On the CPU sums of float32 are kept in 64
    bits and rounded once; the result does not depend on the number of threads.

    Args:
        in_array: scalars or vectors of int32, uint32, int64, uint64, float32 or float64;
            contiguous or of one dimension.
        out_array: as many of the same type; may be `in_array` itself.
        inclusive: whether an element counts for its own sum.

    Raises:
        RuntimeError: devices, sizes or types do not fit, or the arrays overlap in part.
    """
    if in_array.device != out_array.device:
        raise errors.WarpError(
            "In and out array storage devices do not match "
            f"({in_array.device} vs {out_array.device})"
        )
    if in_array.size != out_array.size:
        raise errors.WarpError(
            f"In and out array storage sizes do not match ({in_array.size} vs {out_array.size})"
        )
    if not types_equal(in_array.dtype, out_array.dtype):
        raise errors.WarpError(
            "In and out array data types do not match "
            f"({type_repr(in_array.dtype)} vs {type_repr(out_array.dtype)})"
        )
    if in_array.size == 0:
        return
    for name, array in (("Input", in_array), ("Output", out_array)):
        if not array.is_contiguous and array.ndim != 1:
            raise errors.WarpError(f"{name} array must be contiguous or one-dimensional")
    dtype = in_array.dtype
    if not (type_is_scalar(dtype) or type_is_vector(dtype)) or (
        type_scalar_type(dtype) not in _SCANNED
    ):
        raise errors.WarpError(f"Unsupported data type: {type_repr(dtype)}")
    if overlap(in_array, out_array):
        raise errors.WarpError("In and out array overlap; use the same array or different memory")
    note_writes("array_scan", out_array)
    _native.scan_numbers(
        in_array, out_array, _kind(dtype), type_size(dtype), in_array.size, bool(inclusive)
    )


def _check_pairs(what, keys, values, count) -> None:
    if keys.size < 2 * count or values.size < 2 * count:
        raise errors.WarpError(f"{what} must be large enough to contain 2*count elements")


@checked(keys=ARRAY, values=ARRAY, begin_bit=COUNT, end_bit=COUNT)
def radix_sort_pairs(
    keys, values, count: int, begin_bit: int = 0, end_bit: int | None = None
) -> None:
    """Sorts pairs by their keys, ascending; pairs with equal keys keep their order.

    Every NaN comes after +infinity, and -0 equals +0. Bits are those of the key as an unsigned
    number of the same order.

    Args:
        keys: int32, uint32, float32, int64, uint64 or float64, contiguous, of at least
            `2 * count` elements; the second half is overwritten.
        values: elements of 4 or 8 bytes, as many.
        count: number of pairs.
        begin_bit, end_bit: the bits of the keys to sort by, by default all.

    Raises:
        RuntimeError: devices, sizes, types or bits do not fit.
    """
    if keys.device != values.device:
        raise errors.WarpError(
            f"Keys and values array storage devices do not match ({keys.device} vs {values.device})"
        )
    if count == 0:
        return
    if count < 0:
        raise errors.WarpError(f"count must be non-negative, got {count}")
    _check_pairs("Keys and values array storage", keys, values, count)
    types = f"data types: {type_repr(keys.dtype)}, {type_repr(values.dtype)}"
    if type_size_in_bytes(values.dtype) not in (4, 8) or keys.dtype not in _KEYS:
        raise errors.WarpError(f"Unsupported keys and values {types}")
    for name, array in (("keys", keys), ("values", values)):
        if not array.is_contiguous:
            raise errors.WarpError(
                f"radix_sort_pairs() requires a contiguous {name} array, got non-contiguous "
                f"{name} with {types}"
            )
    width = 8 * type_size_in_bytes(keys.dtype)
    end_bit = width if end_bit is None else end_bit
    if not isinstance(begin_bit, int) or not isinstance(end_bit, int):
        raise errors.WarpError("begin_bit and end_bit must be integers")
    if not 0 <= begin_bit <= end_bit <= width:
        raise errors.WarpError(
            f"Invalid radix sort bit range [{begin_bit}, {end_bit}) for {width}-bit keys"
        )
    check_apart("radix_sort_pairs", (keys, 2 * count), (values, 2 * count))
    note_writes("radix_sort_pairs", keys, values)
    _native.sort_pairs(keys, values, _kind(keys.dtype), count, begin_bit, end_bit)


def _count(count) -> int:
    if isinstance(count, bool):
        raise TypeError("count must be an integer")
    try:
        count = operator.index(count)
    except TypeError:
        raise TypeError("count must be an integer") from None
    if count < 0:
        raise ValueError(f"count must be non-negative, got {count}")
    if count > _MOST:
        raise ValueError(f"count must not exceed {_MOST}, got {count}")
    return count


def _check_bounds(name, array) -> None:
    if array.dtype is not int32:
        raise errors.WarpError(f"{name} array must be of type int32")
    if array.ndim != 1:
        raise errors.WarpError(f"{name} must be one-dimensional")
    # Strides tell of one element as well.
    if not array.is_contiguous or array.strides[0] != array.item_size:
        raise errors.WarpError(f"segmented_sort_pairs() requires a contiguous {name} array")


@checked(keys=ARRAY, values=ARRAY, segment_start_indices=ARRAY, segment_end_indices=ARRAY)
def segmented_sort_pairs(
    keys, values, count: int, segment_start_indices, segment_end_indices=None
) -> None:
    """Sorts the pairs of each segment by their keys, as `radix_sort_pairs` does.

    Pairs outside of the segments stay where they are.

    Args:
        keys: int32 or float32, contiguous, of at least `2 * count` elements; the second half is
            overwritten.
        values: int32, as many.
        count: number of pairs.
        segment_start_indices: int32, where each segment begins; without ends, one more: a segment
            ends where the next one begins.
        segment_end_indices: int32, where each segment ends. Segments must not overlap.

    Raises:
        TypeError: `count` is no integer.
        ValueError: `count` is negative or needs more than 31 bits; on the CPU, a segment does not
            satisfy 0 <= start <= end <= count. On CUDA such a segment is left as it is.
        RuntimeError: devices, sizes or types do not fit.
    """
    count = _count(count)
    bounds = [a for a in (segment_start_indices, segment_end_indices) if a is not None]
    if any(array.device != keys.device for array in (values, *bounds)):
        raise errors.WarpError("Keys, values, and segment index array storage devices must match")
    if count == 0:
        return
    _check_pairs("Array storage", keys, values, count)
    for name, array in (("keys", keys), ("values", values)):
        if not array.is_contiguous:
            raise errors.WarpError(f"segmented_sort_pairs() requires a contiguous {name} array")
    _check_bounds("segment_start_indices", segment_start_indices)
    if segment_end_indices is not None:
        _check_bounds("segment_end_indices", segment_end_indices)
        if segment_start_indices.size != segment_end_indices.size:
            raise errors.WarpError(
                "segment_start_indices and segment_end_indices must have the same size "
                f"({segment_start_indices.size} vs {segment_end_indices.size})"
            )
    elif segment_start_indices.size > 1:
        segment_start_indices, segment_end_indices = (
            segment_start_indices[:-1],
            segment_start_indices[1:],
        )
    else:
        return
    if segment_start_indices.size == 0:
        return
    if keys.dtype not in (int32, float32) or values.dtype is not int32:
        raise errors.WarpError(f"Unsupported data type: {type_repr(keys.dtype)}")
    check_apart("segmented_sort_pairs", (keys, 2 * count), (values, 2 * count))
    note_writes("segmented_sort_pairs", keys, values)
    ends, segments = segment_end_indices, segment_start_indices.size
    if keys.device.is_cuda and segments < _FEW and count > _FEW * _LONG:
        from warp._src.utils.cuda_sequences import sort_segments

        sort_segments(keys, values, count, segment_start_indices, ends)
    else:
        kind = _kind(keys.dtype)
        _native.sort_segments(keys, values, kind, count, segment_start_indices, ends, segments)


@checked(values=ARRAY, run_values=ARRAY, run_lengths=ARRAY, run_count=ARRAY)
def runlength_encode(values, run_values, run_lengths, run_count=None, value_count=None):
    """Finds runs of equal neighbours.

    `[1, 1, 1, 2, 2, 3]` has the values `[1, 2, 3]` and the lengths `[3, 2, 1]`.

    Args:
        values: int32, uint32, int64 or uint64.
        run_values: gets the value of each run; of at least `value_count` elements, contiguous.
        run_lengths: int32, gets the length of each run; as many, contiguous.
        run_count: int32, gets the number of runs, if given.
        value_count: number of elements to look at, by default all.

    Returns:
        The number of runs, or `run_count` if it was given.

    Raises:
        RuntimeError: devices, sizes or types do not fit, or elements that are read or may be
            written overlap.
        NotImplementedError: a graph is being captured and there is no `run_count` to write to.
    """
    if run_values.device != values.device or run_lengths.device != values.device:
        raise errors.WarpError("run_values, run_lengths and values storage devices do not match")
    if value_count is None:
        value_count = values.size
    if value_count < 0:
        raise errors.WarpError(f"value_count must be non-negative, got {value_count}")
    if value_count > values.size:
        raise errors.WarpError(f"value_count ({value_count}) exceeds the size of values")
    if run_values.size < value_count or run_lengths.size < value_count:
        raise errors.WarpError(
            f"Output array storage sizes must be at least equal to value_count ({value_count})"
        )
    if not types_equal(values.dtype, run_values.dtype):
        raise errors.WarpError(
            "values and run_values data types do not match "
            f"({type_repr(values.dtype)} vs {type_repr(run_values.dtype)})"
        )
    if run_lengths.dtype is not int32:
        raise errors.WarpError("run_lengths array must be of type int32")
    total = run_count
    if run_count is not None:
        if run_count.device != values.device:
            raise errors.WarpError("run_count storage device does not match other arrays")
        if run_count.dtype is not int32 or run_count.size == 0:
            raise errors.WarpError("run_count array must be of type int32")
        if value_count == 0:
            run_count.zero_()
            return run_count
    elif value_count == 0:
        return 0
    elif values.device.is_capturing:
        raise NotImplementedError("a graph needs an explicit run_count array to write to")
    else:
        total = wp.empty(1, dtype=int32, device=values.device)
    if values.dtype not in (int32, uint32, int64, uint64):
        raise errors.WarpError(f"Unsupported data type: {type_repr(values.dtype)}")
    if not (run_values.is_contiguous and run_lengths.is_contiguous):
        raise errors.WarpError("run_values and run_lengths must be contiguous")
    used = [(array, value_count) for array in (values, run_values, run_lengths)]
    check_apart("runlength_encode", *used, (total, 1))
    note_writes("runlength_encode", run_values, run_lengths, total)
    values = values.contiguous()
    _native.find_runs(values, value_count, run_values, run_lengths, total)
    return total if run_count is not None else int(total.numpy()[0])
