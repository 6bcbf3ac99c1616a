"""Sums of gradients whose elements are structs."""

from __future__ import annotations

import functools

from warp._src.arrays.array import array
from warp._src.arrays.gradients import has_gradient
from warp._src.kernels.function import Function
from warp._src.kernels.map_functions import define
from warp._src.kernels.maps import map
from warp._src.types import dtypes


def add_structs(target: array, source: array) -> None:
    """Adds the floating-point fields of one array's elements to those of another's."""
    map(_sum_of(target.dtype), target, source, out=target)


@functools.cache
def _sum_of(dtype) -> Function:
    """A function for kernels that adds two structs; fields without derivative are the first's."""
    lines = [f"def add_{dtype.__name__}(x: Struct, y: Struct):", "    result = x"]
    lines += [f"    result{path} = x{path} + y{path}" for path in _paths(dtype)]
    lines.append("    return result")
    name = f"add_{dtype.__name__}"
    function = define(name, "\n".join(lines) + "\n", {"Struct": dtype})
    function.__annotations__ = {"x": dtype, "y": dtype}
    return Function(function, name)


def _paths(dtype) -> list[str]:
    """The fields that have gradients, those of structs in structs included."""
    found: list[str] = []
    for name, field in dtype._wp_fields_.items():
        if dtypes.is_struct(field):
            found += [f".{name}{path}" for path in _paths(field)]
        elif has_gradient(field):
            found.append(f".{name}")
    return found
