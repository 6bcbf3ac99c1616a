"""Number formats without a ctypes type, and divisions as kernels define them."""

from __future__ import annotations

import ctypes
import math
import struct


def half_to_bits(value: float) -> int:
    """Bits of the nearest float16; values out of range become infinite."""
    value = float(value)
    try:
        return struct.unpack("<H", struct.pack("<e", value))[0]
    except OverflowError:
        return 0x7C00 if value > 0.0 else 0xFC00


def half_from_bits(bits: int) -> float:
    return struct.unpack("<e", struct.pack("<H", bits & 0xFFFF))[0]


def bfloat16_to_bits(value: float) -> int:
    """Bits of the nearest bfloat16, ties to even."""
    value = float(value)
    if math.isnan(value):
        return 0x7FC0
    bits = ctypes.c_uint32.from_buffer(ctypes.c_float(value)).value
    return ((bits + 0x7FFF + ((bits >> 16) & 1)) >> 16) & 0xFFFF


def bfloat16_from_bits(bits: int) -> float:
    return ctypes.c_float.from_buffer(ctypes.c_uint32((bits & 0xFFFF) << 16)).value


def divide(a, b):
    """Quotient with the rules of kernels: ints truncate, an int divided by zero is zero."""
    if isinstance(a, int) and isinstance(b, int):
        if b == 0:
            return 0
        quotient = abs(a) // abs(b)
        return quotient if (a < 0) == (b < 0) else -quotient
    if b == 0:
        if a == 0 or math.isnan(a):
            return math.nan
        return math.copysign(math.inf, a) * math.copysign(1.0, b)
    return a / b


def power(a, b):
    """`a**b` of floats as C has it: infinite beyond the range, NaN where it is not real."""
    try:
        result = a**b
    except OverflowError:
        result = math.inf
    except ZeroDivisionError:
        return math.copysign(math.inf, a) if b % 2 == 1 else math.inf
    if isinstance(result, complex):
        return math.nan
    return -result if result == math.inf and a < 0 and b % 2 == 1 else result


def floor_divide(a, b):
    if isinstance(a, int) and isinstance(b, int):
        return a // b if b else 0
    quotient = divide(a, b)
    return float(math.floor(quotient)) if math.isfinite(quotient) else quotient


def remainder(a, b):
    """C remainder: the sign is that of the dividend."""
    if isinstance(a, int) and isinstance(b, int):
        return a - b * divide(a, b) if b else 0
    if b == 0 or math.isinf(a):
        return math.nan
    return math.fmod(a, b)
