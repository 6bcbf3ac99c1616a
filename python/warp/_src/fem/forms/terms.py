"""Terms - products of coefficients of slots with basis functions, as degrees of freedom."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.fields.nodes import scaled

# Most numbers of an array in the memory of a thread.
MOST_LOCAL = 1024


def components(dtype) -> list[str]:
    """Subscripts of the components of a slot's type; an empty one for a number."""
    if extend.type_is_matrix(dtype):
        rows, columns = dtype._shape_
        return [f"[{i}, {j}]" for i in range(rows) for j in range(columns)]
    if extend.type_is_vector(dtype):
        return [f"[{i}]" for i in range(dtype._length_)]
    return [""]


def dof_count(dtype) -> int:
    """Number of components of a degree of freedom."""
    return extend.type_size(dtype)


def fits_thread(count: int, dtype) -> bool:
    """True if an array of `count` elements fits into the memory of a thread."""
    return count * dof_count(dtype) <= MOST_LOCAL


@wp.func
def _dot(basis: Any, coefficient: Any):
    return wp.dot(basis, coefficient)


@wp.func
def _ddot(basis: Any, coefficient: Any):
    return wp.ddot(basis, coefficient)


@wp.func
def _times(basis: Any, coefficient: Any):
    return coefficient * basis


@functools.cache
def term_functions(values) -> SimpleNamespace:
    """Functions of (basis function, coefficient), for the value and the gradient of a field.

    They give the derivative of the form by a degree of freedom.
    """
    if values.map != "identity":
        return SimpleNamespace(value=_dot, gradient=_ddot)
    if extend.type_is_matrix(values.dof):
        Dof, (rows, columns) = values.dof, values.dof._shape_

        @wp.func
        def of_matrix(basis: Any, coefficient: Any):
            flat = coefficient * basis
            dof = Dof()
            for i in range(rows):
                for j in range(columns):
                    dof[i, j] = flat[i * columns + j]
            return dof

        return SimpleNamespace(value=scaled, gradient=of_matrix)
    gradient = _times if extend.type_is_vector(values.dof) else _dot
    return SimpleNamespace(value=scaled, gradient=gradient)
