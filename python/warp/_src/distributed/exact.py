"""Exact sums over ranks: the same bits for any number of ranks and any partition.

A float is a whole multiple of the least subnormal number. A sum is kept as digits of 28 bits in
words of 64 (include/warp/ExactSums.h), which are added over threads and ranks as integers without
carrying, and rounded once.
"""

from __future__ import annotations

from typing import Any

import warp as wp
from warp._src.distributed.communicator import flat

BITS = 28
# Digits of sums of float32 and float64; three words behind count infinities and NaN.
_DIGITS = {wp.float32: 11, wp.float64: 76}
FORMATS = {dtype: count + 3 for dtype, count in _DIGITS.items()}
# Elements whose digits are there at a time, when arrays are reduced.
_CHUNK = 1 << 20
_THREADS = 64

_Words32 = wp.types.vector(14, wp.int64)
_Words64 = wp.types.vector(79, wp.int64)
_MASK = wp.constant(wp.int64((1 << BITS) - 1))


@wp.func
def add_float32(words: _Words32, value: wp.float32):
    bits = wp.int64(wp.cast(value, wp.uint32))
    exponent = int((bits >> wp.int64(23)) & wp.int64(255))
    mantissa = bits & wp.int64(8388607)
    sign = wp.int64(1) - wp.int64(2) * (bits >> wp.int64(31))
    if exponent == 255:
        at = 13
        if mantissa == wp.int64(0):
            at = wp.where(sign > wp.int64(0), 11, 12)
        words[at] = words[at] + wp.int64(1)
    else:
        if exponent > 0:
            mantissa = mantissa + wp.int64(8388608)
        shift = wp.max(exponent, 1) - 1
        at = shift // 28
        whole = mantissa << wp.int64(shift - 28 * at)
        words[at] = words[at] + sign * (whole & _MASK)
        words[at + 1] = words[at + 1] + sign * (whole >> wp.int64(28))
    return words


@wp.func
def add_float64(words: _Words64, value: wp.float64):
    bits = wp.cast(value, wp.int64)
    exponent = int((bits >> wp.int64(52)) & wp.int64(2047))
    mantissa = bits & wp.int64(4503599627370495)
    sign = wp.where(bits < wp.int64(0), wp.int64(-1), wp.int64(1))
    if exponent == 2047:
        at = 78
        if mantissa == wp.int64(0):
            at = wp.where(sign > wp.int64(0), 76, 77)
        words[at] = words[at] + wp.int64(1)
    else:
        if exponent > 0:
            mantissa = mantissa + wp.int64(4503599627370496)
        shift = wp.max(exponent, 1) - 1
        at = shift // 28
        rest = wp.int64(shift - 28 * at)
        low = (mantissa & _MASK) << rest
        high = ((mantissa >> wp.int64(28)) << rest) + (low >> wp.int64(28))
        words[at] = words[at] + sign * (low & _MASK)
        words[at + 1] = words[at + 1] + sign * (high & _MASK)
        words[at + 2] = words[at + 2] + sign * (high >> wp.int64(28))
    return words


@wp.func
def _add_to(digits: wp.array(dtype=wp.int64), words: Any):
    for k in range(len(words)):
        if words[k] != wp.int64(0):
            wp.atomic_add(digits, k, words[k])


@wp.kernel(module="warp.distributed", enable_backward=False)
def _sum_float32(x: wp.array(dtype=wp.float32), chunk: int, digits: wp.array(dtype=wp.int64)):
    first = wp.tid() * chunk
    words = _Words32()
    for i in range(first, wp.min(first + chunk, x.shape[0])):
        words = add_float32(words, x[i])
    _add_to(digits, words)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _sum_float64(x: wp.array(dtype=wp.float64), chunk: int, digits: wp.array(dtype=wp.int64)):
    first = wp.tid() * chunk
    words = _Words64()
    for i in range(first, wp.min(first + chunk, x.shape[0])):
        words = add_float64(words, x[i])
    _add_to(digits, words)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _dot_float32(
    x: wp.array(dtype=wp.float32),
    y: wp.array(dtype=wp.float32),
    chunk: int,
    digits: wp.array(dtype=wp.int64),
):
    first = wp.tid() * chunk
    words = _Words64()
    for i in range(first, wp.min(first + chunk, x.shape[0])):
        # A product of two float32 is a float64.
        words = add_float64(words, wp.float64(x[i]) * wp.float64(y[i]))
    _add_to(digits, words)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _dot_float64(
    x: wp.array(dtype=wp.float64),
    y: wp.array(dtype=wp.float64),
    chunk: int,
    digits: wp.array(dtype=wp.int64),
):
    first = wp.tid() * chunk
    words = _Words64()
    for i in range(first, wp.min(first + chunk, x.shape[0])):
        words = add_float64(words, x[i] * y[i])
    _add_to(digits, words)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _split_float32(x: wp.array(dtype=wp.float32), digits: wp.array2d(dtype=wp.int64)):
    i = wp.tid()
    words = add_float32(_Words32(), x[i])
    for k in range(14):
        digits[k, i] = words[k]


@wp.kernel(module="warp.distributed", enable_backward=False)
def _split_float64(x: wp.array(dtype=wp.float64), digits: wp.array2d(dtype=wp.int64)):
    i = wp.tid()
    words = add_float64(_Words64(), x[i])
    for k in range(79):
        digits[k, i] = words[k]


@wp.func
def power_of_two(k: int):
    """2^k in float64, for k from -1022 to 1023."""
    return wp.cast(wp.int64(k + 1023) << wp.int64(52), wp.float64)


@wp.func
def digit_of(digits: wp.array2d(dtype=wp.int64), k: int, count: int, i: int):
    if k < 0 or k >= count:
        return wp.int64(0)
    return digits[k, i]


@wp.func
def rounded(digits: wp.array2d(dtype=wp.int64), i: int, count: int, low: int, precision: int):
    """Carries the digits of a number, in place, and rounds it to nearest, ties to even."""
    if digits[count + 2, i] != wp.int64(0) or (
        digits[count, i] != wp.int64(0) and digits[count + 1, i] != wp.int64(0)
    ):
        return wp.float64(wp.nan)
    if digits[count, i] != wp.int64(0):
        return wp.float64(wp.inf)
    if digits[count + 1, i] != wp.int64(0):
        return -wp.float64(wp.inf)
    carry = wp.int64(0)
    for k in range(count):
        carry = (digits[k, i] + carry) >> wp.int64(28)
    sign = wp.where(carry < wp.int64(0), wp.int64(-1), wp.int64(1))
    carry = wp.int64(0)
    top = int(-1)
    for k in range(count):
        value = sign * digits[k, i] + carry
        carry = value >> wp.int64(28)
        digits[k, i] = value & _MASK
        if digits[k, i] != wp.int64(0):
            top = k
    if carry != wp.int64(0):
        # Beyond the largest finite number.
        return wp.float64(sign) * wp.float64(wp.inf)
    if top < 0:
        return wp.float64(0.0)
    first = digits[top, i]
    width = int(0)
    while (first >> wp.int64(width)) != wp.int64(0):
        width = width + 1
    third = digit_of(digits, top - 2, count, i)
    whole = (first << wp.int64(28)) | digit_of(digits, top - 1, count, i)
    whole = (whole << wp.int64(28 - width)) | (third >> wp.int64(width))
    sticky = (third & ((wp.int64(1) << wp.int64(width)) - wp.int64(1))) != wp.int64(0)
    for k in range(top - 2):
        sticky = sticky or digits[k, i] != wp.int64(0)
    exponent = low + 28 * (top - 2) + width
    drop = wp.max(56 - precision, low - exponent)
    kept = whole >> wp.int64(drop)
    rest = whole - (kept << wp.int64(drop))
    half = wp.int64(1) << wp.int64(drop - 1)
    odd = (kept & wp.int64(1)) != wp.int64(0)
    if rest > half or (rest == half and (sticky or odd)):
        kept = kept + wp.int64(1)
    power = exponent + drop
    result = wp.float64(sign) * wp.float64(kept)
    if power > 971:
        return result * wp.float64(wp.inf)
    if power < -900:
        return result * power_of_two(power + 200) * power_of_two(-200)
    return result * power_of_two(power)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _round_float32(digits: wp.array2d(dtype=wp.int64), x: wp.array(dtype=wp.float32)):
    i = wp.tid()
    x[i] = wp.float32(rounded(digits, i, 11, -149, 24))


@wp.kernel(module="warp.distributed", enable_backward=False)
def _round_float64(digits: wp.array2d(dtype=wp.int64), x: wp.array(dtype=wp.float64)):
    i = wp.tid()
    x[i] = rounded(digits, i, 76, -1074, 53)


_SUM = {wp.float32: _sum_float32, wp.float64: _sum_float64}
_DOT = {wp.float32: _dot_float32, wp.float64: _dot_float64}
_SPLIT = {wp.float32: _split_float32, wp.float64: _split_float64}
_ROUND = {wp.float32: _round_float32, wp.float64: _round_float64}


def reduce(comm, x) -> None:
    """Sums arrays of all ranks in place; each element is rounded once."""
    packed = x if x.is_contiguous else x.contiguous()
    numbers = flat(packed)
    dtype = numbers.dtype
    for first in range(0, numbers.size, _CHUNK):
        part = numbers[first : min(first + _CHUNK, numbers.size)]
        digits = wp.empty((FORMATS[dtype], part.size), dtype=wp.int64, device=x.device)
        wp.launch(_SPLIT[dtype], part.size, [part, digits], device=x.device)
        comm.all_reduce(flat(digits))
        wp.launch(_ROUND[dtype], part.size, [digits, part], device=x.device)
    if packed is not x:
        wp.copy(x, packed)


def _threads(count) -> tuple[int, int]:
    chunk = max(-(-count // _THREADS), 64)
    return -(-count // chunk), chunk


def add_digits(arrays, digits) -> None:
    """Adds the digits of a sum of one array, or of a product of two, to words."""
    x = arrays[0]
    if x.size:
        threads, chunk = _threads(x.size)
        kernel = (_SUM if len(arrays) == 1 else _DOT)[x.dtype]
        wp.launch(kernel, threads, [*arrays, chunk, digits], device=x.device)


def words_of(dtype, products=False) -> int:
    """How many words a sum of numbers of a type has; products of float32 have those of float64."""
    return FORMATS[wp.float64 if products else dtype]
