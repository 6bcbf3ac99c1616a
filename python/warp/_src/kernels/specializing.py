"""Types of launch arguments, by which native kernels are made once each."""

from __future__ import annotations

import re

from warp._src.arrays.array import array
from warp._src.arrays.indexed import indexedarray
from warp._src.forks import translating
from warp._src.types import dtypes
from warp._src.types.native import ArrayType


def argument_type(value):
    """The compiler's type of a launch argument; None where it cannot be told."""
    try:
        if isinstance(value, array):
            return dtypes.native_type(ArrayType(value.dtype, value.ndim))
        if isinstance(value, indexedarray):
            return dtypes.native_type(value.annotation(value.dtype, value.ndim))
        return dtypes.native_type(dtypes.canonical(type(value)))
    except TypeError:
        return None


def type_tag(types) -> str:
    """Native types as part of a name: "array1xf32_f32"."""
    texts = (str(one).replace("!warp.", "") for one in types)
    return "_".join(re.sub(r"\W+", "", text) for text in texts)


def once(known, key, make):
    """The entry of `known` for a key: the first of several threads makes it, the others find it."""
    found = known.get(key)
    if found is None:
        with translating:
            found = known.get(key)
            if found is None:
                found = known[key] = make()
    return found
