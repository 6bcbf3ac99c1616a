"""Shared parts of the optimisers: parameters seen as lists of numbers, their state, checks.

A parameter is an array of floating-point scalars or of composites of them. Updates go component by
component, so kernels see a parameter as a flat array of scalars. State (momentum, moments) has at
least 32 bits, whatever the parameter has.
"""

from __future__ import annotations

import warp as wp
from warp import types as dtypes
from warp.extend import errors

_NARROW = (dtypes.float16, dtypes.bfloat16)


def scalar_of(dtype):
    """The scalar type of an element's components."""
    return getattr(dtype, "_wp_scalar_type_", dtype)


def state_dtype(dtype):
    """The type of an optimiser's state: that of the parameter, 16-bit components made 32 bits wide.

    Raises:
        WarpTypeError: the elements are not made of floating-point numbers.
    """
    scalar = scalar_of(dtype)
    if scalar not in dtypes.FLOAT_TYPES:
        raise errors.WarpTypeError(
            f"expects parameters made of floating-point numbers, but got "
            f"'{dtypes.type_repr(dtype)}'"
        )
    if scalar not in _NARROW:
        return dtype
    if dtype is scalar:
        return dtypes.float32
    if issubclass(dtype, dtypes.Quaternion):
        return dtypes.quaternion(dtypes.float32)
    if issubclass(dtype, dtypes.Transformation):
        return dtypes.transformation(dtypes.float32)
    make = dtypes.matrix if len(dtype._shape_) == 2 else dtypes.vector
    return make(dtype._shape_ if len(dtype._shape_) == 2 else dtype._length_, dtypes.float32)


def check_list(params, name):
    """The parameters as a list; None stays None.

    Raises:
        TypeError: they are no list of arrays.
    """
    if params is None:
        return None
    if not isinstance(params, (list, tuple)):
        raise TypeError(f"{name} expects a list of arrays, but got '{type(params).__name__}'")
    for position, param in enumerate(params):
        if not isinstance(param, wp.array):
            raise TypeError(
                f"{name}: parameter {position} is no array, but '{type(param).__name__}'"
            )
    return params


def fitting_state(held, params) -> list:
    """One array of zeros per parameter; those in `held` that fit are kept, moved if need be."""
    if len(held) != len(params):
        held = [None] * len(params)
    made = []
    for old, param in zip(held, params, strict=True):
        dtype = state_dtype(param.dtype)
        if old is None or old.shape != param.shape or old.dtype is not dtype:
            made.append(wp.zeros(param.shape, dtype, param.device))
        else:
            made.append(old.to(param.device))
    return made


def check_gradient(gradient, param, name) -> None:
    """Rejects a gradient that is not like its parameter, or like its state."""
    if gradient.dtype is not param.dtype and gradient.dtype is not state_dtype(param.dtype):
        raise TypeError(
            f"{name} gradient dtype must match parameter dtype {dtypes.type_repr(param.dtype)}, "
            f"got {dtypes.type_repr(gradient.dtype)}"
        )
    if gradient.shape != param.shape:
        raise ValueError(
            f"{name} gradient shape must match parameter shape {param.shape}, got {gradient.shape}"
        )


def check_gradients(gradients, params, name) -> None:
    """Rejects a list that does not have one gradient per parameter."""
    if params is None:
        raise RuntimeError(f"{name} parameters must be set before calling step(), got None")
    if not isinstance(gradients, (list, tuple)) or len(gradients) != len(params):
        found = len(gradients) if isinstance(gradients, (list, tuple)) else type(gradients).__name__
        raise ValueError(f"{name} expects a list of {len(params)} gradients, but got {found}")


def flat(packed):
    """The components of an array without gaps as a one-dimensional view."""
    scalar = scalar_of(packed.dtype)
    size = dtypes.type_size_in_bytes(scalar)
    return packed._view(0, (packed.capacity // size,), (size,), scalar)


def update(param, function) -> None:
    """Calls `function` on the flat components of a parameter, to be changed in place."""
    packed = param.contiguous()
    function(flat(packed))
    if packed is not param:
        wp.copy(param, packed)


def epsilon(dtype) -> float:
    """Distance from 1 to the next number of a floating-point type."""
    import numpy

    if dtype is dtypes.bfloat16:
        return 2.0**-7
    return float(numpy.finfo(wp.dtype_to_numpy(dtype)).eps)
