"""Products of a matrix and a vector."""

import functools

import warp as wp
from warp._src.sparse import checked_products, number_product, sums
from warp._src.sparse.checks import check_contents, check_storage
from warp._src.sparse.expressions import unchecked
from warp.extend import checked, is_recording, type_repr, type_scalar_type, type_size, types_equal
from warp.extend.kinds import ARRAY, FLAG, INTEGER, SPARSE


@functools.cache
def _put(scalar):
    """Adds a row of the product to the result."""

    @wp.func(name=f"sparse_mv_put_{scalar.__name__}")
    def put(
        y: wp.array2d(dtype=scalar), row: int, i: int, alpha: scalar, total: scalar, beta: scalar
    ):
        # An unwanted entry need not be a number.
        if beta == scalar(0.0):
            y[row, i] = alpha * total
        else:
            y[row, i] = alpha * total + beta * y[row, i]

    return put


@functools.cache
def _row_kernel(scalar, rows, cols):
    """One thread per row of numbers; the extents of blocks are constants."""
    name = f"sparse_mv_{scalar.__name__}_{rows}_{cols}"
    put = _put(scalar)

    @wp.kernel(name=name, module=__name__)
    def multiply(
        alpha: scalar,
        offsets: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        values: wp.array3d(dtype=scalar),
        x: wp.array2d(dtype=scalar),
        beta: scalar,
        y: wp.array2d(dtype=scalar),
    ):
        number = wp.tid()
        row = number // rows
        i = number % rows
        total = scalar(0.0)
        for block in range(offsets[row], ends[row]):
            column = columns[block]
            for j in range(cols):
                total += values[block, i, j] * x[column, j]
        put(y, row, i, alpha, total, beta)

    return multiply


# Threads of a block of a GPU, blocks of a row from which on several threads share it, and how often
# each of these may go on before the whole block works on the row.
_BLOCK = 256
_LONG = 16
_MOST_ROUNDS = 32


@functools.cache
def _terms(scalar, cols):
    """The share of a thread in a row of the product: the products of every `step`-th block."""

    @wp.func(name=f"sparse_mv_terms_{scalar.__name__}_{cols}")
    def terms(
        columns: wp.array(dtype=int),
        values: wp.array3d(dtype=scalar),
        x: wp.array2d(dtype=scalar),
        i: int,
        first: int,
        end: int,
        step: int,
    ):
        total = scalar(0.0)
        for block in range(first, end, step):
            column = columns[block]
            for j in range(cols):
                total += values[block, i, j] * x[column, j]
        return total

    return terms


@functools.cache
def _shared_row_kernel(scalar, rows, cols, sharers):
    """Neighbouring threads share a row of numbers, and a block those that are too long for them.

    Which thread adds what, and in which order, depends on the matrix alone.
    """
    name = f"sparse_mv_shared_{scalar.__name__}_{rows}_{cols}_{sharers}"
    count = _BLOCK // sharers
    put, terms = _put(scalar), _terms(scalar, cols)

    @wp.kernel(name=name, module=__name__, enable_backward=False)
    def multiply(
        alpha: scalar,
        offsets: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        values: wp.array3d(dtype=scalar),
        x: wp.array2d(dtype=scalar),
        beta: scalar,
        y: wp.array2d(dtype=scalar),
    ):
        block, thread = wp.tid()
        number = block * count + thread // sharers
        begin = int(0)
        end = int(0)
        if number < y.shape[0] * rows:
            begin = offsets[number // rows]
            end = ends[number // rows]
        total = scalar(0.0)
        too_long = int(0)
        if end - begin > sharers * _MOST_ROUNDS:
            too_long = 1
        else:
            first = begin + thread % sharers
            total = terms(columns, values, x, number % rows, first, end, sharers)
        # `sharers`, or 1 for blocks of one thread.
        width = 1 + (sharers - 1) * (wp.block_dim() // _BLOCK)
        parts = wp.tile_reshape(wp.tile(total), shape=(-1, width))
        total = wp.tile_sum(parts, axis=1)[thread // sharers]
        if wp.tile_sum(wp.tile(too_long))[0] > 0:
            for i in range(count):
                other = block * count + i
                if other < y.shape[0] * rows:
                    first = offsets[other // rows]
                    last = ends[other // rows]
                    if last - first > sharers * _MOST_ROUNDS:
                        part = terms(columns, values, x, other % rows, first + thread, last, _BLOCK)
                        whole = wp.tile_sum(wp.tile(part))[0]
                        if thread // sharers == i:
                            total = whole
        if thread % sharers == 0 and number < y.shape[0] * rows:
            put(y, number // rows, number % rows, alpha, total, beta)

    return multiply


def _launch_rows(A, inputs, trusted) -> None:
    """A thread per row, or on GPUs several for long ones, unless a tape wants the adjoint."""
    rows, cols = A.block_shape
    count = A.nrow * rows
    mean = A.columns.size // A.nrow
    if not trusted:
        if checked_products.watches(A):
            kernel = checked_products.row_kernel(A.scalar_type, rows, cols, _put(A.scalar_type))
            checked_products.launch(kernel, count, inputs, A)
            return
        check_contents(A)
    if A.device.is_cpu or mean < _LONG or is_recording():
        wp.launch(_row_kernel(A.scalar_type, rows, cols), count, inputs, device=A.device)
        return
    sharers = 8
    while sharers < 32 and 3 * sharers < mean:
        sharers *= 2
    kernel = _shared_row_kernel(A.scalar_type, rows, cols, sharers)
    blocks = -(-count * sharers // _BLOCK)
    wp.launch_tiled(kernel, [blocks], inputs, block_dim=_BLOCK, device=A.device)


@functools.cache
def _column_kernel(scalar, rows, cols):
    """One thread per column of numbers of a block, which adds to the result."""
    name = f"sparse_mv_transposed_{scalar.__name__}_{rows}_{cols}"

    @wp.kernel(name=name, module=__name__)
    def multiply(
        alpha: scalar,
        offsets: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        values: wp.array3d(dtype=scalar),
        x: wp.array2d(dtype=scalar),
        y: wp.array2d(dtype=scalar),
    ):
        row, j = wp.tid()
        for block in range(offsets[row], ends[row]):
            total = scalar(0.0)
            for i in range(rows):
                total += values[block, i, j] * x[row, i]
            wp.atomic_add(y, columns[block], j, alpha * total)

    return multiply


@functools.cache
def _scale_vector_kernel(scalar):
    @sums.kernel_for(scalar)
    def scale_vector(factor: scalar, y: wp.array2d(dtype=scalar)):
        i, j = wp.tid()
        y[i, j] = factor * y[i, j]

    return scale_vector


def _vector(array, name, scalar, count, width):
    """A vector as `count` rows of `width` numbers.

    Raises:
        ValueError: it is not one.
    """
    why = None
    length = type_size(array.dtype)
    if not types_equal(type_scalar_type(array.dtype), scalar):
        why = (
            f"Incompatible scalar types, expected {type_repr(scalar)}, got {type_repr(array.dtype)}"
        )
    elif array.ndim not in (1, 2):
        why = f"Incompatible array number of dimensions, expected 1 or 2, got {array.ndim}"
    elif not array.is_contiguous:
        why = "Array must be contiguous"
    elif array.size * length != count * width:
        why = f"Invalid array scalar size, expected {count * width}, got {array.size * length}"
    if why is not None:
        raise ValueError(f"Incompatible '{name}' vector for bsr_mv: {why}")
    if array.ndim == 1 and array.dtype is not scalar:
        array = array.view(scalar)
    if array.dtype is not scalar:
        array = array.flatten().view(scalar)
    return array.reshape((count, width))


@checked(A=SPARSE, x=ARRAY, y=ARRAY, transpose=FLAG, work_buffer=ARRAY, tile_size=INTEGER)
def bsr_mv(
    A,
    x,
    y=None,
    alpha=1.0,
    beta=0.0,
    transpose: bool = False,
    work_buffer=None,
    tile_size: int = 0,
):
    """Sets `y` to `alpha * A x + beta * y` and returns it. Differentiable.

    Args:
        A: a matrix.
        x: a vector: numbers, or vectors of as many as a block has columns.
        y: the result; may be `x`; a new vector by default.
        alpha, beta: factors; `y` is not read if `beta` is zero.
        transpose: multiply with the transposed matrix, by atomic additions in any order.
        work_buffer: memory of the size of `y` if that is `x`.
        tile_size: accepted for compatibility.

    Raises:
        ValueError: shapes, types or devices do not fit.
    """
    return multiply(A, x, y, alpha, beta, transpose, work_buffer)


def multiply(A, x, y, alpha, beta, transpose=False, work_buffer=None, trusted=False):
    """The product of `bsr_mv`; `trusted`: the contents of `A` have been checked."""
    A, factor = unchecked(A)
    alpha = alpha * factor
    rows, cols = A.block_shape
    from_count, to_count = (A.nrow, A.ncol) if transpose else (A.ncol, A.nrow)
    from_width, to_width = (rows, cols) if transpose else (cols, rows)
    if y is None:
        scalar = A.scalar_type
        dtype = scalar if to_width == 1 else wp.types.vector(to_width, scalar)
        wanted = A.requires_grad or x.requires_grad
        y = wp.empty(to_count, dtype=dtype, device=A.device, requires_grad=wanted)
        beta = 0.0
    if not transpose and number_product.fits(A, x, y):
        number_product.multiply(A, x, y, alpha, beta, trusted)
        return y
    check_storage(A)
    for name, array in (("x", x), ("y", y)):
        if array.device != A.device:
            raise ValueError(
                f"A, x, and y must reside on the same device, got {A.device} and {name} on "
                f"{array.device}"
            )
    source = _vector(x, "x", A.scalar_type, from_count, from_width)
    target = _vector(y, "y", A.scalar_type, to_count, to_width)
    if x.ptr == y.ptr and x.size:
        source = _buffered(source, x, work_buffer)
    if transpose:
        _multiply_transposed(A, alpha, source, beta, target)
    elif to_count:
        matrix = (A.offsets, A._row_ends(), A.columns, A.scalar_values)
        _launch_rows(A, [alpha, *matrix, source, beta, target], trusted)
    return y


def _buffered(source, x, work_buffer):
    """A copy of `x`, which is the result, too.

    Raises:
        ValueError: the buffer for it is too small or has another type.
    """
    if work_buffer is None:
        return wp.clone(source)
    if work_buffer.size < x.size:
        raise ValueError(
            f"Work buffer size is insufficient, needs to be at least {x.size}, got "
            f"{work_buffer.size}"
        )
    if not types_equal(work_buffer.dtype, x.dtype):
        raise ValueError(
            f"Work buffer must have same data type as y, {type_repr(x.dtype)}, got "
            f"{type_repr(work_buffer.dtype)}"
        )
    part = work_buffer.flatten()[: x.size]
    wp.copy(part, x.flatten())
    return _vector(part, "x", type_scalar_type(x.dtype), *source.shape)


def _multiply_transposed(A, alpha, source, beta, target) -> None:
    rows, cols = A.block_shape
    if beta == 0.0:
        target.zero_()
    elif beta != 1.0 and target.size:
        kernel = _scale_vector_kernel(A.scalar_type)
        wp.launch(kernel, target.shape, [beta, target], device=A.device)
    if A.nrow:
        inputs = [alpha, A.offsets, A._row_ends(), A.columns, A.scalar_values, source, target]
        if checked_products.watches(A):
            kernel = checked_products.column_kernel(A.scalar_type, rows, cols)
            checked_products.launch(kernel, (A.nrow, cols), inputs, A)
            return
        check_contents(A)
        kernel = _column_kernel(A.scalar_type, rows, cols)
        wp.launch(kernel, (A.nrow, cols), inputs, device=A.device)
