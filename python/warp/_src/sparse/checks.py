"""Checks of what matrices are made of: programs may replace their arrays, and write to them.

An attribute is checked when it is set, as far as it stands alone; sizes and devices where a matrix
is used. Contents are looked at where kernels would follow them to memory that is not the matrix's,
on the CPU: on a GPU that would be to wait for the device.
"""

import operator

from warp.extend import errors, is_array, type_repr, types_equal
from warp.types import int32


def _extent(matrix, name, value):
    is_whole = isinstance(value, float) and value.is_integer()
    try:
        number = int(value) if is_whole else operator.index(value)
    except TypeError:
        raise errors.WarpTypeError(
            f"expects an integer as '{name}' of a sparse matrix, but got {value!r}"
        ) from None
    if number < 0:
        raise errors.WarpShapeError(
            f"expects '{name}' of a sparse matrix to be 0 or more, but got {number}"
        )
    return number


def _array(name, value, expected, fits):
    if not is_array(value):
        raise errors.WarpTypeError(
            f"expects {expected} as '{name}' of a sparse matrix, but got "
            f"'{type(value).__name__}', use `wp.array(...)`"
        )
    if not fits(value.dtype) or value.ndim != 1 or not value.is_contiguous:
        packed = "" if value.is_contiguous else " that is not contiguous"
        raise errors.WarpTypeError(
            f"expects {expected} as '{name}' of a sparse matrix, but got an array of "
            f"'{type_repr(value.dtype)}' with shape {value.shape}{packed}"
        )
    return value


def _integers(matrix, name, value):
    expected = "a contiguous array of 'int32' with one dimension"
    return _array(name, value, expected, lambda dtype: dtype is int32)


def _counts(matrix, name, value):
    return None if value is None else _integers(matrix, name, value)


def _blocks(matrix, name, value):
    block = getattr(matrix, "_block_type", None)
    if block is None:
        return _array(name, value, "a contiguous array with one dimension", lambda dtype: True)
    expected = f"a contiguous array of '{type_repr(block)}' with one dimension"
    return _array(name, value, expected, lambda dtype: types_equal(dtype, block))


# By attribute, what checks a value and returns what is stored.
ATTRIBUTES = {
    **dict.fromkeys(("nrow", "ncol", "nnz"), _extent),
    **dict.fromkeys(("offsets", "columns"), _integers),
    "row_counts": _counts,
    "values": _blocks,
}


def check_storage(matrix) -> None:
    """Checks that the arrays of a matrix are long enough, and on one device.

    Raises:
        ValueError: they are not.
    """
    offsets, columns, values = matrix.offsets, matrix.columns, matrix.values
    counts, nnz = matrix.row_counts, matrix.nnz
    index = values.device_index
    if (
        offsets.size > matrix.nrow
        and columns.size >= nnz
        and values.size >= nnz
        and offsets.device_index == index
        and columns.device_index == index
        and (counts is None or (counts.size >= matrix.nrow and counts.device_index == index))
    ):
        return
    least = {"offsets": matrix.nrow + 1, "columns": nnz, "values": nnz, "row_counts": matrix.nrow}
    for name, size in least.items():
        array = getattr(matrix, name)
        if array is None:
            continue
        if array.size < size:
            raise errors.WarpShapeError(
                f"a sparse matrix of {matrix.nrow} x {matrix.ncol} blocks with nnz = {nnz} expects "
                f"at least {size} elements in '{name}', but got {array.size}"
            )
        if array.device_index != index:
            raise ValueError(
                f"expects '{name}' of a sparse matrix on '{values.device}' like its values, but it "
                f"is on '{array.device}'"
            )


def check_contents(matrix, columns=True, most=None) -> None:
    """Checks that the rows of a matrix lie in its arrays and, on demand, its columns in itself.

    `most`: the number of blocks that a matrix is about to get room for, if it is not that of now.

    Only on the CPU, and not while a graph is being captured, which reads them later.

    Raises:
        IndexError: they do not; names the first row and the numbers.
    """
    device = matrix.device
    if not device.is_cpu or device.is_capturing:
        return
    offsets = matrix.offsets._host_view()[: matrix.nrow + 1]
    begins = offsets[:-1]
    room = min(matrix.columns.size, matrix.values.size) if most is None else most
    ends = offsets[1:]
    if matrix.row_counts is not None:
        counts = matrix.row_counts._host_view()[: matrix.nrow]
        bad = (counts < 0) | (counts > ends.astype("int64") - begins)
        if bad.any():
            row = int(bad.argmax())
            raise errors.WarpIndexError(
                f"row {row} of a sparse matrix has room for {int(ends[row]) - int(begins[row])} "
                f"blocks, but row_counts[{row}] is {counts[row]}"
            )
    bad = (begins < 0) | (ends < begins) | (ends > room)
    if bad.any():
        row = int(bad.argmax())
        raise errors.WarpIndexError(
            f"row {row} of a sparse matrix has the blocks {begins[row]} to {ends[row]} by its "
            f"offsets, but there are {room}, and offsets must not decrease"
        )
    if not columns or matrix.nrow == 0:
        return
    first, last = int(offsets[0]), int(offsets[-1])
    bad = matrix.columns._host_view()[first:last].view("uint32") >= matrix.ncol
    if bad.any():
        blocks = first + bad.nonzero()[0]
        if matrix.row_counts is not None:
            # Room that is not in use may hold anything.
            rows = offsets.searchsorted(blocks, side="right") - 1
            blocks = blocks[blocks - begins[rows] < counts[rows]]
        if blocks.size:
            raise beyond(matrix, int(blocks[0]))


def beyond(matrix, block) -> errors.WarpIndexError:
    """The error of a block that lies in no column of its matrix."""
    column = int(matrix.columns._host_view()[block])
    return errors.WarpIndexError(
        f"block {block} of a sparse matrix is in column {column}, but there are {matrix.ncol} "
        "columns, see `wp.sparse.bsr_compress` to drop such blocks"
    )
