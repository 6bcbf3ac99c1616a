"""Products of two matrices.

A contribution is the product of a block (i, k) of the left matrix and a block (k, j) of the right
one. They are counted, listed and collected like those of any other operation (`entries`).
"""

import functools

import warp as wp
from warp._src.sparse import sums
from warp._src.sparse.addition import _places, check_operands, joined
from warp._src.sparse.checks import check_contents, check_storage
from warp._src.sparse.entries import check_topology, collect, fresh_values
from warp._src.sparse.expressions import matrix_and_factor
from warp._src.sparse.lookup import bsr_block_index
from warp._src.sparse.matrix import BsrMatrix, new_matrix
from warp.extend import checked
from warp.extend.kinds import COUNT, INTEGER, MATRIX, SPARSE, TEXT


class bsr_mm_work_arrays:
    """The parts of a product that `bsr_mm` keeps for `reuse_topology`."""

    def __init__(self):
        self.plan = None


class _Plan:
    """The products of blocks, and those that each block of the result is the sum of."""

    def __init__(self, count, lefts, rights, entries=None):
        self.count, self.lefts, self.rights, self.entries = count, lefts, rights, entries


@wp.kernel(enable_backward=False)
def _count_products(
    x_rows: wp.array(dtype=int),
    x_columns: wp.array(dtype=int),
    y_offsets: wp.array(dtype=int),
    y_ends: wp.array(dtype=int),
    counts: wp.array(dtype=int),
):
    block = wp.tid()
    counts[block] = 0
    if x_rows[block] >= 0:
        column = x_columns[block]
        counts[block] = y_ends[column] - y_offsets[column]


@wp.kernel(enable_backward=False)
def _list_products(
    x_rows: wp.array(dtype=int),
    x_columns: wp.array(dtype=int),
    y_offsets: wp.array(dtype=int),
    y_columns: wp.array(dtype=int),
    ends: wp.array(dtype=int),
    lefts: wp.array(dtype=int),
    rights: wp.array(dtype=int),
    rows: wp.array(dtype=int),
    columns: wp.array(dtype=int),
):
    """Product n belongs to the first block of x up to which there are more than n products."""
    n = wp.tid()
    low = int(0)
    high = int(ends.shape[0])
    while low < high:
        middle = low + (high - low) // 2
        if ends[middle] <= n:
            low = middle + 1
        else:
            high = middle
    rows[n] = -1
    columns[n] = -1
    if low < ends.shape[0]:
        before = int(0)
        if low > 0:
            before = ends[low - 1]
        right = y_offsets[x_columns[low]] + n - before
        lefts[n] = low
        rights[n] = right
        rows[n] = x_rows[low]
        columns[n] = y_columns[right]


@wp.kernel(enable_backward=False)
def _check_count(ends: wp.array(dtype=int), most: int, status: wp.array(dtype=int)):
    if ends[ends.shape[0] - 1] > most:
        status[0] = 1


@functools.cache
def _masked_kernel(scalar, depth):
    """Products for the blocks that z has, found by searches in the rows of y."""

    @wp.kernel(name=f"sparse_mm_masked_{scalar.__name__}_{depth}", module=__name__)
    def multiply(
        x_offsets: wp.array(dtype=int),
        x_ends: wp.array(dtype=int),
        x_columns: wp.array(dtype=int),
        x: wp.array3d(dtype=scalar),
        y_offsets: wp.array(dtype=int),
        y_columns: wp.array(dtype=int),
        y_counts: wp.array(dtype=int),
        y: wp.array3d(dtype=scalar),
        alpha: scalar,
        beta: scalar,
        z_rows: wp.array(dtype=int),
        z_columns: wp.array(dtype=int),
        z: wp.array3d(dtype=scalar),
    ):
        slot, i, j = wp.tid()
        row = z_rows[slot]
        if row < 0:
            return
        total = scalar(0.0)
        for left in range(x_offsets[row], x_ends[row]):
            right = bsr_block_index(
                x_columns[left], z_columns[slot], y_offsets, y_columns, y_counts
            )
            if right >= 0:
                for k in range(depth):
                    total += x[left, i, k] * y[right, k, j]
        if beta == scalar(0.0):
            z[slot, i, j] = alpha * total
        else:
            z[slot, i, j] = alpha * total + beta * z[slot, i, j]

    return multiply


@checked(x=SPARSE, y=SPARSE, z=MATRIX, topology=TEXT, tile_size=INTEGER, max_new_nnz=COUNT)
def bsr_mm(
    x,
    y,
    z: BsrMatrix | None = None,
    alpha=1.0,
    beta=0.0,
    work_arrays: bsr_mm_work_arrays | None = None,
    reuse_topology: bool = False,
    tile_size: int = 0,
    max_new_nnz: int | None = None,
    topology: str | None = None,
) -> BsrMatrix:
    """Sets `z` to `alpha * x y + beta * z` and returns it. Differentiable.

    The number of products of blocks is read from the device, except with `reuse_topology`, topology
    "masked", or in a graph, where `max_new_nnz` stands for it.

    Args:
        x, y: matrices.
        z: the other operand and the result, which may be `x` or `y`; a new matrix, as if of zeros,
            by default.
        alpha, beta: factors.
        work_arrays: keeps the topology of this product.
        reuse_topology: the topology of all matrices is that of the call that `work_arrays` is
            from.
        tile_size: accepted for compatibility.
        max_new_nnz: in a graph, upper bound of the number of products of blocks. If it does not
            suffice, products are missing and `z.status_sync()` says so.
        topology: "compact", "masked" (the blocks of `z`) or "padded" (within the room of its
            rows; `z.status_sync()` says whether it sufficed).

    Raises:
        ValueError: shapes, types or devices do not fit.
        RuntimeError: in a graph, the number of products is not known.
    """
    x, x_factor = matrix_and_factor(x)
    y, y_factor = matrix_and_factor(y)
    alpha = alpha * x_factor * y_factor
    topology = check_topology(z, topology)
    if reuse_topology and topology != "compact":
        raise ValueError("reuse_topology is only supported with topology='compact'")
    if z is None:
        if topology != "compact":
            raise ValueError("Left-hand-side 'z' matrix must be provided for this topology policy")
        z, beta = _result(x, y), 0.0
    _check_shapes(x, y, z)
    check_storage(z)
    for matrix in (x, y):
        check_contents(matrix)
    if topology == "masked":
        return _multiply_masked(x, y, z, alpha, beta)
    plan = work_arrays.plan if work_arrays is not None and reuse_topology else None
    if reuse_topology and plan is None:
        raise ValueError(
            "`work_arrays` must not be ``None`` in order to reuse matrix-matrix product topology"
        )
    x_values, y_values, old = (matrix.scalar_values for matrix in (x, y, z))
    sources = [x.values, y.values] + ([z.values] if beta else [])
    if plan is None:
        plan = _list(x, y, z, beta, max_new_nnz, topology)
        if work_arrays is not None:
            work_arrays.plan = plan
    fresh_values(z, sources)
    order = (plan.entries.order, plan.entries.begins, plan.entries.ends)
    kernel = sums.product_kernel(z.scalar_type, x.block_shape[1])
    products = (plan.count, plan.lefts, plan.rights)
    sums.launch(kernel, z, x_values, y_values, alpha, old, beta, *products, *order)
    return z


def _result(x, y) -> BsrMatrix:
    shape = x.block_shape[0], y.block_shape[1]
    dtype = x.scalar_type if shape == (1, 1) else wp.types.matrix(shape, x.scalar_type)
    result = new_matrix(x.nrow, y.ncol, dtype, x.device)
    result.values.requires_grad = x.requires_grad or y.requires_grad
    return result


def _check_shapes(x, y, z) -> None:
    check_operands(z, x, y)
    shapes = x.block_shape[0], y.block_shape[1]
    if x.block_shape[1] != y.block_shape[0] or shapes != z.block_shape:
        raise ValueError(
            "Incompatible block sizes for matrix multiplication, got "
            f"{x.block_shape} times {y.block_shape} into {z.block_shape}"
        )
    if x.ncol != y.nrow or (z.nrow, z.ncol) != (x.nrow, y.ncol):
        raise ValueError(
            "Incompatible number of rows/columns for matrix multiplication, got "
            f"({x.nrow}, {x.ncol}) times ({y.nrow}, {y.ncol}) into ({z.nrow}, {z.ncol})"
        )


def _number_of_products(ends, max_new_nnz, z) -> int:
    if ends.size == 0:
        return 0
    if not z.device.is_capturing:
        return int(ends[ends.size - 1 :].numpy()[0])
    if max_new_nnz is None:
        raise RuntimeError(
            "`max_new_nnz` or `reuse_topology` is required to compute the product of matrices in "
            "a graph, which cannot read the number of products"
        )
    inputs = [ends, int(max_new_nnz), z._ensure_status()]
    wp.launch(_check_count, 1, inputs, device=z.device)
    return int(max_new_nnz)


def _list(x, y, z, beta, max_new_nnz, topology) -> _Plan:
    """Finds the products and gives `z` their blocks."""
    device = z.device
    x_rows, x_columns = _places(x)
    y_ends = y._row_ends()
    ends = wp.empty(x.nnz, dtype=int, device=device)
    if x.nnz:
        inputs = [x_rows, x_columns, y.offsets, y_ends, ends]
        wp.launch(_count_products, x.nnz, inputs, device=device)
        wp.utils.array_scan(ends, ends)
    count = _number_of_products(ends, max_new_nnz, z)
    lefts, rights, rows, columns = (wp.empty(count, dtype=int, device=device) for _ in range(4))
    if count:
        inputs = [x_rows, x_columns, y.offsets, y.columns, ends, lefts, rights, rows, columns]
        wp.launch(_list_products, count, inputs, device=device)
    if beta:
        z_rows, z_columns = _places(z)
        rows, columns = joined([rows, z_rows]), joined([columns, z_columns])
    return _Plan(count, lefts, rights, collect(z, rows, columns, topology))


def _multiply_masked(x, y, z, alpha, beta) -> BsrMatrix:
    if z is x or z is y:
        raise ValueError("topology='masked' is not supported for aliased inputs")
    kernel = _masked_kernel(z.scalar_type, x.block_shape[1])
    left = (x.offsets, x._row_ends(), x.columns, x.scalar_values)
    right = (y.offsets, y.columns, y._counts(), y.scalar_values)
    rows = z.uncompress_rows()
    sums.launch(kernel, z, *left, *right, alpha, beta, rows, z.columns)
    return z
