"""Copies of matrices, also to other types and shapes of blocks, and compression."""

import warp as wp
from warp._src.sparse import sums
from warp._src.sparse.checks import check_contents, check_storage
from warp._src.sparse.entries import (
    check_topology,
    collect,
    fresh_values,
)
from warp._src.sparse.expressions import matrix_and_factor
from warp._src.sparse.matrix import BsrMatrix, new_matrix
from warp._src.sparse.storage import bsr_set_zero
from warp._src.sparse.triplets import nonzero_blocks
from warp.extend import checked
from warp.extend.kinds import FLAG, MATRIX, PAIR, SPARSE, TEXT


@wp.kernel(enable_backward=False)
def _place_pieces(
    source_rows: wp.array(dtype=int),
    source_columns: wp.array(dtype=int),
    source_shape: wp.vec2i,
    dest_shape: wp.vec2i,
    down: int,
    across: int,
    rows: wp.array(dtype=int),
    columns: wp.array(dtype=int),
):
    """Rows and columns of the pieces that blocks of another shape are made of."""
    block, piece = wp.tid()
    number = block * down * across + piece
    rows[number] = -1
    columns[number] = -1
    if source_rows[block] >= 0:
        row = source_rows[block] * source_shape[0] + piece // across * (source_shape[0] // down)
        column = source_columns[block] * source_shape[1] + piece % across * (
            source_shape[1] // across
        )
        rows[number] = row // dest_shape[0]
        columns[number] = column // dest_shape[1]


def _pieces(source: int, dest: int) -> int:
    """Into how many pieces a block is cut along one dimension.

    Raises:
        ValueError: neither extent divides the other.
    """
    if source % dest and dest % source:
        raise ValueError(
            f"Incompatible dest and src block shapes: of {dest} and {source} numbers along a "
            "dimension one must be a multiple of the other"
        )
    return max(1, source // dest)


@checked(dest=MATRIX, src=SPARSE, topology=TEXT)
def bsr_assign(
    dest: BsrMatrix, src, structure_only: bool = False, topology: str | None = None
) -> None:
    """Copies a matrix to another one, converting numbers and shapes of blocks.

    Differentiable.

    Args:
        dest: the target; its blocks may have another type, and their extents be multiples or
            divisors of those of `src`.
        src: the matrix to copy.
        structure_only: do not copy values.
        topology: "compact", "masked" (the blocks that `dest` has) or "padded" (within the room
            of its rows; `dest.status_sync()` says whether it sufficed).

    Raises:
        ValueError: shapes or devices do not fit.
    """
    src, factor = matrix_and_factor(src)
    if dest.device != src.device:
        raise ValueError("Source and destination matrices must reside on the same device")
    topology = check_topology(dest, topology)
    check_storage(dest)
    down = _pieces(src.block_shape[0], dest.block_shape[0])
    across = _pieces(src.block_shape[1], dest.block_shape[1])
    _fit_shape(dest, src, topology)
    rows, columns = src.uncompress_rows(), src.columns[: src.nnz]
    pieces = down * across
    source_columns = columns
    if src.block_shape != dest.block_shape:
        source_rows, count = rows, src.nnz * pieces
        rows, columns = (wp.empty(count, dtype=int, device=src.device) for _ in range(2))
        shapes = [wp.vec2i(*src.block_shape), wp.vec2i(*dest.block_shape)]
        inputs = [source_rows, source_columns, *shapes, down, across, rows, columns]
        wp.launch(_place_pieces, (src.nnz, pieces), inputs, device=src.device)
    else:
        source_rows = rows
    if src is dest or columns.ptr == dest.columns.ptr:
        # The source must not be the destination.
        columns = source_columns = wp.clone(columns)
    values, source_values = src.scalar_values, src.values
    entries = collect(dest, rows, columns, topology)
    if structure_only:
        return
    fresh_values(dest, [source_values])
    kernel = sums.cast_kernel(src.scalar_type, dest.scalar_type)
    inputs = (values, factor, source_rows, source_columns, pieces)
    places = (dest.uncompress_rows(), dest.columns)
    order = (entries.order, entries.begins, entries.ends)
    sums.launch(kernel, dest, *inputs, *places, *order)


def _fit_shape(dest, src, topology) -> None:
    """Gives `dest` the size of `src`.

    Raises:
        ValueError: its blocks do not divide it, or it keeps its own and that differs.
    """
    for extent, block in zip(src.shape, dest.block_shape, strict=True):
        if extent % block:
            raise ValueError(
                "The requested block shape does not evenly divide the source matrix: "
                f"{dest.block_shape} and {src.shape}"
            )
    nrow, ncol = (n // block for n, block in zip(src.shape, dest.block_shape, strict=True))
    if (nrow, ncol) == (dest.nrow, dest.ncol):
        return
    if topology != "compact":
        raise ValueError(
            f"Incompatible dest and src matrix shapes, {dest.shape} and {src.shape}, for "
            f"topology '{topology}'"
        )
    dest.nrow, dest.ncol = nrow, ncol


@checked(A=SPARSE, block_shape=PAIR, topology=TEXT)
def bsr_copy(
    A,
    scalar_type=None,
    block_shape: tuple[int, int] | None = None,
    structure_only: bool = False,
    topology: str = "compact",
) -> BsrMatrix:
    """A copy of a matrix, possibly with other numbers or blocks.

    Args:
        A: the matrix.
        scalar_type: type of the numbers, by default that of `A`.
        block_shape: shape of the blocks, whose extents are multiples or divisors of those of `A`.
        structure_only: leave values undefined.
        topology: "compact", or "padded" to keep the room of each row.

    Raises:
        ValueError: shapes do not fit.
    """
    source, _ = matrix_and_factor(A)
    if topology not in ("compact", "padded"):
        raise ValueError(f"Unsupported topology policy: {topology}")
    scalar = source.scalar_type if scalar_type is None else scalar_type
    shape = source.block_shape if block_shape is None else tuple(block_shape)
    for extent, block, own in zip(source.shape, shape, source.block_shape, strict=True):
        _pieces(own, block)
        if extent % block:
            raise ValueError(
                f"The requested block shape {shape} does not evenly divide the source matrix of "
                f"total size {source.shape}"
            )
    dtype = source.dtype
    if scalar is not source.scalar_type or shape != source.block_shape:
        dtype = scalar if shape == (1, 1) else wp.types.matrix(shape, scalar)
    nrow, ncol = (n // block for n, block in zip(source.shape, shape, strict=True))
    result = new_matrix(nrow, ncol, dtype, source.device)
    result.values.requires_grad = source.requires_grad
    if topology == "padded":
        check_contents(source, columns=False)
        _copy_room(result, source)
    bsr_assign(result, A, structure_only, topology)
    return result


@wp.kernel(enable_backward=False)
def _gather_room(
    offsets: wp.array(dtype=int),
    down: int,
    up: int,
    factor: int,
    room: wp.array(dtype=int),
):
    """The room of a row of smaller blocks is that of its row times `factor`; of a row of larger
    ones, the sum over its rows times `factor`."""
    row = wp.tid()
    first = row * up // down
    room[row] = (offsets[first + up] - offsets[first]) * factor


def _copy_room(result, source) -> None:
    down = max(1, source.block_shape[0] // result.block_shape[0])
    up = max(1, result.block_shape[0] // source.block_shape[0])
    factor = max(1, source.block_shape[1] // result.block_shape[1])
    room = wp.empty(result.nrow, dtype=int, device=source.device)
    inputs = [source.offsets, down, up, factor, room]
    wp.launch(_gather_room, result.nrow, inputs, device=source.device)
    capacity = source.nnz * down * factor
    bsr_set_zero(result, topology="padded", row_capacity=room, nnz_capacity=capacity)


@checked(src=MATRIX, inplace=FLAG, topology=TEXT)
def bsr_compress(
    src: BsrMatrix,
    prune_numerical_zeros: bool = True,
    inplace: bool = False,
    topology: str | None = None,
    structure_only: bool = False,
) -> BsrMatrix:
    """Orders the blocks of each row, sums those of one column, and drops the rest; returns `src`.

    Blocks whose column lies outside of the matrix are dropped, too. Differentiable.

    Args:
        src: the matrix, changed in place.
        prune_numerical_zeros: drop blocks of zeros before.
        inplace: accepted for compatibility; the result is the same.
        topology: "compact" (default), or "padded" to keep the room of each row.
        structure_only: only the columns matter, values are undefined afterwards.

    Raises:
        ValueError: it is no matrix, or there is no such topology.
    """
    if not isinstance(src, BsrMatrix):
        raise ValueError("bsr_compress() requires a concrete BsrMatrix")
    topology = "compact" if topology is None else topology
    check_topology(src, topology, ("compact", "padded"))
    check_storage(src)
    rows = src.uncompress_rows()
    columns = wp.clone(src.columns[: src.nnz])
    blocks, values = src.scalar_values, src.values
    kept = None
    if prune_numerical_zeros and not structure_only:
        kept = nonzero_blocks(blocks[: src.nnz]) if src.nnz else None
    entries = collect(src, rows, columns, topology, None, kept)
    if not structure_only:
        fresh_values(src, [values])
        kernel = sums.gather_kernel(src.scalar_type)
        sums.launch(kernel, src, blocks, entries.order, entries.begins, entries.ends)
    return src
