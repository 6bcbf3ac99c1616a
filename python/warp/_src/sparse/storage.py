"""Empty matrices, and the room that rows have."""

import warp as wp
from warp._src.sparse.entries import check_topology, make_compact
from warp._src.sparse.matrix import BsrMatrix, new_matrix
from warp.extend import checked, is_array
from warp.extend.kinds import ARRAY, COUNT, MATRIX, TEXT


@wp.kernel(enable_backward=False)
def _spread(capacity: int, offsets: wp.array(dtype=int)):
    row = wp.tid()
    offsets[row] = row * capacity


@wp.kernel(enable_backward=False)
def _keep_rows(old: wp.array(dtype=int), rows: int, offsets: wp.array(dtype=int)):
    row = wp.tid()
    offsets[row] = old[wp.min(row, rows)]


def _set_room(bsr, row_capacity, nnz_capacity) -> None:
    """Sets where rows begin and how many blocks there is room for."""
    device = bsr.device
    if not is_array(row_capacity):
        if row_capacity < 0:
            raise ValueError("row_capacity must be nonnegative")
        bsr.offsets = wp.empty(bsr.nrow + 1, dtype=int, device=device)
        wp.launch(_spread, bsr.nrow + 1, [int(row_capacity), bsr.offsets], device=device)
        bsr.nnz = bsr.nrow * int(row_capacity)
        return
    if row_capacity.shape != (bsr.nrow,):
        raise ValueError(
            f"row_capacity array must have shape ({bsr.nrow},), got {row_capacity.shape}"
        )
    if row_capacity.dtype is not wp.int32:
        raise TypeError("row_capacity array must have dtype int32")
    if row_capacity.device != device:
        raise ValueError(f"row_capacity array must reside on {device}, got {row_capacity.device}")
    bsr.offsets = wp.zeros(bsr.nrow + 1, dtype=int, device=device)
    if bsr.nrow:
        wp.copy(bsr.offsets, row_capacity.contiguous(), dest_offset=1, count=bsr.nrow)
        wp.utils.array_scan(bsr.offsets, bsr.offsets)
    if nnz_capacity is not None:
        bsr.nnz = int(nnz_capacity)
    elif device.is_capturing:
        raise RuntimeError(
            "a row_capacity array needs nnz_capacity in a graph: its sum would be a "
            "device-to-host readback"
        )
    else:
        bsr.nnz_sync()


def _make_padded(bsr, row_capacity, nnz_capacity, kept_rows) -> None:
    if row_capacity is not None:
        _set_room(bsr, row_capacity, nnz_capacity)
    elif kept_rows != bsr.nrow:
        old, rows = bsr.offsets, min(kept_rows, bsr.nrow)
        bsr.offsets = wp.empty(bsr.nrow + 1, dtype=int, device=bsr.device)
        wp.launch(_keep_rows, bsr.nrow + 1, [old, rows, bsr.offsets], device=bsr.device)
    bsr.row_counts = wp.zeros(bsr.nrow, dtype=int, device=bsr.device)
    bsr._ensure_status()
    bsr._fit(max(bsr.nnz, nnz_capacity or 0))


@checked(
    bsr=MATRIX,
    rows_of_blocks=COUNT,
    cols_of_blocks=COUNT,
    topology=TEXT,
    row_capacity=COUNT | ARRAY,
    nnz_capacity=COUNT,
)
def bsr_set_zero(
    bsr: BsrMatrix,
    rows_of_blocks: int | None = None,
    cols_of_blocks: int | None = None,
    *,
    topology: str = "compact",
    row_capacity=None,
    nnz_capacity: int | None = None,
) -> None:
    """Makes a matrix zero, possibly of another size.

    Args:
        bsr: the matrix.
        rows_of_blocks, cols_of_blocks: its size from now on, by default what it was.
        topology: "compact": no blocks; "padded": rows with room for blocks and none in use;
            "masked": the blocks that there are, with zeros.
        row_capacity: how many blocks each row has room for, a number or an int32 array of one
            number per row; by default what it had. Only for "padded".
        nnz_capacity: upper bound of the sum of `row_capacity`, needed in graphs.

    Raises:
        ValueError, TypeError: arguments do not fit.
    """
    check_topology(bsr, topology)
    if row_capacity is not None and topology != "padded":
        raise ValueError("row_capacity requires topology='padded'")
    if nnz_capacity is not None and nnz_capacity < 0:
        raise ValueError("nnz_capacity must be nonnegative")
    nrow = bsr.nrow if rows_of_blocks is None else int(rows_of_blocks)
    ncol = bsr.ncol if cols_of_blocks is None else int(cols_of_blocks)
    if topology == "masked":
        if (nrow, ncol) != (bsr.nrow, bsr.ncol):
            raise ValueError("Cannot resize a matrix with topology='masked'")
        bsr.values.zero_()
        return
    kept_rows, bsr.nrow, bsr.ncol = bsr.nrow, nrow, ncol
    if topology == "padded":
        _make_padded(bsr, row_capacity, nnz_capacity, kept_rows)
        return
    make_compact(bsr, 0)
    bsr.offsets.zero_()
    bsr._fit(nnz_capacity or 0)


@checked(
    rows_of_blocks=COUNT,
    cols_of_blocks=COUNT,
    topology=TEXT,
    row_capacity=COUNT | ARRAY,
    nnz_capacity=COUNT,
)
def bsr_zeros(
    rows_of_blocks: int,
    cols_of_blocks: int,
    block_type,
    device=None,
    *,
    topology: str | None = None,
    row_capacity=None,
    nnz_capacity: int | None = None,
) -> BsrMatrix:
    """A matrix of zeros.

    Args:
        rows_of_blocks, cols_of_blocks: its size in blocks.
        block_type: a scalar type, or a matrix type.
        device: where it is to be.
        topology, row_capacity, nnz_capacity: as for `bsr_set_zero`; "padded" is the default if
            there is a `row_capacity`.

    Raises:
        ValueError: there is no such topology, or a size is negative.
    """
    result = new_matrix(rows_of_blocks, cols_of_blocks, block_type, device)
    if topology is None:
        topology = "compact" if row_capacity is None else "padded"
    if topology not in ("compact", "padded"):
        raise ValueError(f"Unsupported topology policy: {topology}")
    if topology == "padded" and row_capacity is None:
        row_capacity = 0
    bsr_set_zero(result, topology=topology, row_capacity=row_capacity, nnz_capacity=nnz_capacity)
    return result
