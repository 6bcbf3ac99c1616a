"""Products of a matrix and a vector on the CPU, which do not follow places outside of the matrix.

Tapes record the kernels that do, after a look at the whole matrix (`checks.check_contents`), and
solvers use them after such a look at the beginning.
"""

import ctypes
import functools

import warp as wp
from warp._src.sparse.checks import check_contents, check_storage
from warp.extend import is_differentiating


class Outside:
    """Kernels that note a row or column that leads out of a matrix.

    Attributes:
        array: one number for kernels to set.
        number: the same for Python to read.
    """

    def __init__(self):
        self.array = wp.zeros(1, dtype=int, device="cpu")
        self.number = ctypes.c_int32.from_address(self.array.ptr)

    def __reduce__(self):
        return (Outside, ())

    def report(self, matrix) -> None:
        """Raises what is wrong with the matrix.

        Raises:
            ValueError, IndexError: an array is too short, or a row or column leads out of them.
        """
        self.number.value = 0
        check_storage(matrix)
        check_contents(matrix)


def outside_of(matrix) -> Outside:
    """The notes of a matrix."""
    found = matrix._outside
    if found is None:
        found = matrix._outside = Outside()
    return found


def watches(matrix) -> bool:
    """True if kernels here are to be used: on the CPU, if nobody differentiates."""
    return matrix.values.device_index < 0 and not is_differentiating()


@wp.func
def is_outside(begin: int, end: int, room: wp.uint32) -> bool:
    """True if a row is no part of as many blocks as there are."""
    return wp.uint32(begin) > wp.uint32(end) or wp.uint32(end) > room


@functools.cache
def number_kernel(scalar):
    """One thread per row of numbers."""

    @wp.kernel(name=f"sparse_mv_checked_{scalar.__name__}", module=__name__, enable_backward=False)
    def multiply(
        alpha: scalar,
        offsets: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        values: wp.array(dtype=scalar),
        x: wp.array(dtype=scalar),
        beta: scalar,
        y: wp.array(dtype=scalar),
        room: wp.uint32,
        ncol: wp.uint32,
        outside: wp.array(dtype=int),
    ):
        row = wp.tid()
        total = scalar(0.0)
        begin = offsets[row]
        end = offsets[row + 1]
        leads_out = is_outside(begin, end, room)
        if leads_out:
            end = begin
        for entry in range(begin, end):
            column = columns[entry]
            if wp.uint32(column) < ncol:
                total += values[entry] * x[column]
            else:
                leads_out = True
        if leads_out:
            outside[0] = 1
        # An unwanted entry need not be a number.
        if beta == scalar(0.0):
            y[row] = alpha * total
        else:
            y[row] = alpha * total + beta * y[row]

    return multiply


@functools.cache
def row_kernel(scalar, rows, cols, put):
    """One thread per row of numbers of blocks."""

    @wp.kernel(
        name=f"sparse_mv_checked_{scalar.__name__}_{rows}_{cols}",
        module=__name__,
        enable_backward=False,
    )
    def multiply(
        alpha: scalar,
        offsets: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        values: wp.array3d(dtype=scalar),
        x: wp.array2d(dtype=scalar),
        beta: scalar,
        y: wp.array2d(dtype=scalar),
        room: wp.uint32,
        ncol: wp.uint32,
        outside: wp.array(dtype=int),
    ):
        number = wp.tid()
        row = number // rows
        i = number % rows
        total = scalar(0.0)
        begin = offsets[row]
        end = ends[row]
        leads_out = is_outside(begin, end, room)
        if leads_out:
            end = begin
        for block in range(begin, end):
            column = columns[block]
            if wp.uint32(column) < ncol:
                for j in range(cols):
                    total += values[block, i, j] * x[column, j]
            else:
                leads_out = True
        if leads_out:
            outside[0] = 1
        put(y, row, i, alpha, total, beta)

    return multiply


@functools.cache
def column_kernel(scalar, rows, cols):
    """One thread per column of numbers of a block, which adds to the result."""

    @wp.kernel(
        name=f"sparse_mv_checked_transposed_{scalar.__name__}_{rows}_{cols}",
        module=__name__,
        enable_backward=False,
    )
    def multiply(
        alpha: scalar,
        offsets: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        values: wp.array3d(dtype=scalar),
        x: wp.array2d(dtype=scalar),
        y: wp.array2d(dtype=scalar),
        room: wp.uint32,
        ncol: wp.uint32,
        outside: wp.array(dtype=int),
    ):
        row, j = wp.tid()
        begin = offsets[row]
        end = ends[row]
        leads_out = is_outside(begin, end, room)
        if leads_out:
            end = begin
        for block in range(begin, end):
            column = columns[block]
            if wp.uint32(column) < ncol:
                total = scalar(0.0)
                for i in range(rows):
                    total += values[block, i, j] * x[row, i]
                wp.atomic_add(y, column, j, alpha * total)
            else:
                leads_out = True
        if leads_out:
            outside[0] = 1

    return multiply


def launch(kernel, dim, inputs, matrix) -> None:
    """Launches one of them.

    Raises:
        IndexError: a row or column leads out of the matrix.
    """
    outside = matrix._outside or outside_of(matrix)
    room = min(matrix.columns.size, matrix.values.size)
    wp.launch(kernel, dim, [*inputs, room, matrix.ncol, outside.array], device=matrix.device)
    if outside.number.value:
        outside.report(matrix)
