"""Products of a vector and a matrix of numbers, the most common case, with as little as can be.

Blocks of one number need no views of three dimensions, so most of what a small product costs, which
is Python, is not there.
"""

import functools

import warp as wp
from warp import _native
from warp._src.sparse import checked_products
from warp._src.sparse.checks import check_contents, check_storage
from warp.extend import is_differentiating, note_writes
from warp.types import SCALAR_TYPES

# Numbers of a row from which on the blocks of a GPU share the matrix, whatever rows have; rows of
# less have a thread each.
_SHARED_FROM = 8


@functools.cache
def _row_kernel(scalar):
    """One thread per row."""

    @wp.kernel(name=f"sparse_mv_{scalar.__name__}", module=__name__)
    def multiply(
        alpha: scalar,
        offsets: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        values: wp.array(dtype=scalar),
        x: wp.array(dtype=scalar),
        beta: scalar,
        y: wp.array(dtype=scalar),
    ):
        row = wp.tid()
        total = scalar(0.0)
        for entry in range(offsets[row], offsets[row + 1]):
            total += values[entry] * x[columns[entry]]
        # An unwanted entry need not be a number.
        if beta == scalar(0.0):
            y[row] = alpha * total
        else:
            y[row] = alpha * total + beta * y[row]

    return multiply


def fits(A, x, y) -> bool:
    """True if a matrix has numbers side by side, and both vectors of its type are other memory."""
    values = A.values
    dtype = values.dtype
    return (
        dtype in SCALAR_TYPES
        and A.row_counts is None
        and x.dtype is dtype
        and y.dtype is dtype
        and x.ndim == 1
        and y.ndim == 1
        and x.is_contiguous
        and y.is_contiguous
        and x.size == A.ncol
        and y.size == A.nrow
        and x.device == values.device
        and y.device == values.device
        and x.ptr != y.ptr
        and A.nrow > 0
        and A.offsets.size > A.nrow
    )


def multiply(A, x, y, alpha, beta, trusted) -> None:
    """Sets `y` to `alpha * A x + beta * y`, for what fits.

    The blocks of a GPU share long rows, unless a tape records or forward mode runs. `trusted`:
    somebody has looked at the contents of `A`.
    """
    values = A.values
    dtype, device = values.dtype, values.device
    inputs = [alpha, A.offsets, A.columns, values, x, beta, y]
    if not trusted:
        if checked_products.watches(A):
            kernel = checked_products.number_kernel(dtype)
            checked_products.launch(kernel, A.nrow, inputs, A)
            return
        check_storage(A)
        check_contents(A)
    if (
        device.is_cuda
        and A.columns.size >= _SHARED_FROM * A.nrow
        and not is_differentiating()
        and dtype in (wp.float32, wp.float64)
    ):
        note_writes("bsr_mv", y)
        _native.multiply_rows(
            dtype.__name__, A.offsets, A.columns, values, x, y, float(alpha), float(beta)
        )
        return
    wp.launch(_row_kernel(dtype), A.nrow, inputs, device=device)
