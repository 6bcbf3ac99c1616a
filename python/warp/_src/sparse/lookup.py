"""Searches in the topology of a matrix, for kernels."""

import warp as wp


@wp.func
def bsr_row_index(offsets: wp.array(dtype=int), row_count: int, block_index: int) -> int:
    """The row that a block lies in, -1 if there is none.

    Args:
        offsets: where the blocks of each row begin, `row_count + 1` numbers.
        row_count: number of rows.
        block_index: number of the block.
    """
    if block_index < 0 or block_index >= offsets[row_count]:
        return -1
    low = int(0)
    high = int(row_count)
    while high - low > 1:
        middle = low + (high - low) // 2
        if offsets[middle] <= block_index:
            low = middle
        else:
            high = middle
    return low


@wp.func
def bsr_row_index(  # noqa: F811 (an overload)
    offsets: wp.array(dtype=int),
    row_count: int,
    block_index: int,
    row_counts: wp.array(dtype=int),
) -> int:
    """The same for rows with room to spare, of whose blocks only `row_counts` are in use."""
    row = bsr_row_index(offsets, row_count, block_index)
    if row >= 0 and row_counts.shape[0] > 0:  # noqa: SIM102 (row_counts may have no elements)
        if block_index >= offsets[row] + row_counts[row]:
            row = -1
    return row


@wp.func
def _find_column(columns: wp.array(dtype=int), begin: int, end: int, column: int) -> int:
    low = int(begin)
    high = int(end)
    while low < high:
        middle = low + (high - low) // 2
        if columns[middle] < column:
            low = middle + 1
        else:
            high = middle
    if low < end:  # noqa: SIM102 (both sides of `and` are computed)
        if columns[low] == column:
            return low
    return -1


@wp.func
def bsr_block_index(
    row: int, col: int, bsr_offsets: wp.array(dtype=int), bsr_columns: wp.array(dtype=int)
) -> int:
    """The number of the block in a row and column, -1 if there is none.

    The columns of each row must be in ascending order, as all operations leave them.

    Args:
        row, col: where to look.
        bsr_offsets, bsr_columns: `offsets` and `columns` of the matrix.
    """
    if row < 0:
        return -1
    return _find_column(bsr_columns, bsr_offsets[row], bsr_offsets[row + 1], col)


@wp.func
def bsr_block_index(  # noqa: F811 (an overload)
    row: int,
    col: int,
    bsr_offsets: wp.array(dtype=int),
    bsr_columns: wp.array(dtype=int),
    bsr_row_counts: wp.array(dtype=int),
) -> int:
    """The same for rows with room to spare, of whose blocks only `bsr_row_counts` are in use."""
    if row < 0:
        return -1
    end = bsr_offsets[row + 1]
    if bsr_row_counts.shape[0] > 0:
        end = bsr_offsets[row] + bsr_row_counts[row]
    return _find_column(bsr_columns, bsr_offsets[row], end, col)


@wp.kernel(enable_backward=False)
def _write_rows(
    offsets: wp.array(dtype=int),
    row_count: int,
    row_counts: wp.array(dtype=int),
    rows: wp.array(dtype=int),
):
    block = wp.tid()
    rows[block] = bsr_row_index(offsets, row_count, block, row_counts)


@wp.kernel(enable_backward=False)
def _write_row_ends(
    offsets: wp.array(dtype=int), row_counts: wp.array(dtype=int), ends: wp.array(dtype=int)
):
    row = wp.tid()
    ends[row] = offsets[row] + row_counts[row]
