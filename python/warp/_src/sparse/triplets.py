"""Matrices from lists of rows, columns and values."""

import functools

import warp as wp
from warp._src.sparse import sums
from warp._src.sparse.checks import check_storage
from warp._src.sparse.entries import check_topology, collect, fresh_values
from warp._src.sparse.matrix import BsrMatrix, as_blocks, new_matrix
from warp.extend import checked, errors, type_repr, type_scalar_type, type_size, types_equal
from warp.extend.kinds import ARRAY, COUNT, MATRIX, TEXT


class BsrTripletMap:
    """The triplets that make up each block of a matrix, to set new values without a new topology.

    Built by `bsr_set_from_triplets(..., build_mapping=...)`, used by `bsr_set_from_mapped_values`
    as long as the topology of the matrix does not change.

    Args:
        capacity: accepted for compatibility; memory is taken when the map is built.
        device: where it is to be.
    """

    @checked(capacity=COUNT)
    def __init__(self, capacity: int = 0, device=None):
        self._capacity = int(capacity)
        self._device = wp.get_device(device)
        self._dest = None
        self.triplet_count = 0

    @property
    def device(self):
        """The device of the matrix."""
        return self._device

    @property
    def capacity(self) -> int:
        """For how many triplets there is room."""
        return self._capacity

    def _build(self, dest, entries, count):
        self.entries, self.triplet_count = entries, count
        self._capacity = max(self._capacity, count)
        self._dest = (dest.nrow, dest.ncol, dest.offsets.ptr, dest.columns.ptr)
        self._kept = (dest.offsets, dest.columns)

    @checked(dest=MATRIX)
    def validate(self, dest: BsrMatrix) -> None:
        """Checks that a matrix is the one that the map was built for.

        Raises:
            ValueError: it is not, as far as dimensions and arrays tell.
        """
        if self._dest is None:
            raise ValueError(
                "The triplet map has not been built; pass it to bsr_set_from_triplets() first"
            )
        if self._dest != (dest.nrow, dest.ncol, dest.offsets.ptr, dest.columns.ptr):
            raise ValueError(
                "Destination BSR topology storage differs from that used to build the triplet map"
            )


@functools.cache
def _nonzero_kernel(scalar):
    @wp.kernel(name=f"sparse_nonzero_{scalar.__name__}", module=__name__, enable_backward=False)
    def nonzero(values: wp.array3d(dtype=scalar), kept: wp.array(dtype=int)):
        block = wp.tid()
        found = int(0)
        for i in range(values.shape[1]):
            for j in range(values.shape[2]):
                if values[block, i, j] != scalar(0):
                    found = 1
        kept[block] = found

    return nonzero


def nonzero_blocks(values):
    """1 for blocks (of an array of three dimensions) with a number that is not zero, or 0."""
    kept = wp.empty(values.shape[0], dtype=int, device=values.device)
    if kept.size:
        kernel = _nonzero_kernel(values.dtype)
        # No gradient goes through a choice of blocks.
        inputs = [values, kept]
        wp.launch(kernel, kept.size, inputs, device=values.device, record_tape=False)
    return kept


def _blocks(values, dest):
    """Values of triplets as blocks of numbers.

    Raises:
        ValueError: they do not fit the matrix.
    """
    rows, cols = dest.block_shape
    if values.ndim not in (1, 3):
        raise ValueError(
            f"Number of dimension for values array should be 1 or 3, got {values.ndim}"
        )
    if not values.is_contiguous:
        raise ValueError("Values array must be contiguous")
    if values.ndim == 3:
        if values.shape[1:] != (rows, cols) or values.dtype is not dest.scalar_type:
            raise ValueError(
                f"Values array must hold blocks of {rows} x {cols} numbers of type "
                f"{type_repr(dest.scalar_type)}, got shape {values.shape} and type "
                f"{type_repr(values.dtype)}"
            )
        return values
    if type_size(values.dtype) != rows * cols or not (
        types_equal(type_scalar_type(values.dtype), dest.scalar_type)
    ):
        raise ValueError(
            f"Values array type must correspond to that of the dest matrix, "
            f"{type_repr(dest.dtype)}, got {type_repr(values.dtype)}"
        )
    return as_blocks(values)


def _check_places(dest, rows, columns, count) -> None:
    for name, array in (("rows", rows), ("columns", columns), ("count", count)):
        if array is None:
            continue
        if array.dtype is not wp.int32:
            kind = "Count array" if name == "count" else "Rows and columns arrays"
            raise TypeError(f"{kind} must be of type int32")
        if array.device != dest.device:
            raise ValueError(
                "All arguments must reside on the same device, got "
                f"{name} on {array.device} and the matrix on {dest.device}"
            )
    if rows.ndim != 1 or rows.shape != columns.shape:
        raise ValueError(
            "Rows and columns arrays must have one dimension and the same length, got shapes "
            f"{rows.shape} and {columns.shape}"
        )
    if count is not None and count.shape != (1,):
        raise ValueError(f"Count array must be a single-element array, got {count.shape}")


@wp.kernel(enable_backward=False)
def _find_beyond(
    rows: wp.array(dtype=int),
    columns: wp.array(dtype=int),
    count: wp.array(dtype=int),
    nrow: int,
    ncol: int,
    found: wp.array(dtype=int),
):
    i = wp.tid()
    if (count.shape[0] == 0 or i < count[0]) and (rows[i] >= nrow or columns[i] >= ncol):
        wp.atomic_min(found, 0, i)
        wp.atomic_add(found, 1, 1)


def _check_range(dest, rows, columns, count) -> None:
    """Waits for the device to say whether a place lies beyond the matrix."""
    found = wp.array([rows.size, 0], dtype=int, device=dest.device)
    count = wp.empty(0, dtype=int, device=dest.device) if count is None else count
    inputs = [rows, columns, count, dest.nrow, dest.ncol, found]
    wp.launch(_find_beyond, rows.size, inputs, device=dest.device, record_tape=False)
    first, number = found.numpy()
    if number:
        place = [one[int(first) : int(first) + 1].numpy()[0] for one in (rows, columns)]
        raise errors.WarpIndexError(
            f"triplet {first} is at row {place[0]} and column {place[1]}, beyond a matrix of "
            f"{dest.nrow} x {dest.ncol} blocks, and so are {number - 1} others: such triplets are "
            "left out outside of debug mode"
        )


def _map_for(build_mapping, topology, prune, device):
    """The map to build, or None."""
    if build_mapping is None or build_mapping is False:
        return None
    if build_mapping is not True and not isinstance(build_mapping, BsrTripletMap):
        raise TypeError(
            f"build_mapping must be None, a bool or a BsrTripletMap, got {type(build_mapping)}"
        )
    if topology != "compact":
        raise ValueError('build_mapping requires topology="compact"')
    if prune:
        raise ValueError("build_mapping requires prune_numerical_zeros=False")
    if build_mapping is True:
        return BsrTripletMap(device=device)
    if build_mapping.device != device:
        raise ValueError(
            f"The triplet map and the matrix must reside on the same device, got "
            f"{build_mapping.device} and {device}"
        )
    return build_mapping


@checked(dest=MATRIX, rows=ARRAY, columns=ARRAY, values=ARRAY, count=ARRAY, topology=TEXT)
def bsr_set_from_triplets(
    dest: BsrMatrix,
    rows,
    columns,
    values=None,
    count=None,
    prune_numerical_zeros: bool = True,
    topology: str | None = None,
    build_mapping=None,
):
    """Sets a matrix to the sum of triplets of row, column and block; it had other blocks before.

    Triplets with a negative row or column are left out, and so are those with one beyond the
    matrix, which is an error in debug mode. Equal places are summed in the order of the list.
    Differentiable with respect to `values`.

    Args:
        dest: the matrix.
        rows, columns: int32, of one length.
        values: the blocks, or their numbers as an array of three dimensions; None for blocks of
            undefined values.
        count: an int32 on the device: how many of the first triplets count.
        prune_numerical_zeros: leave out blocks of zeros.
        topology: "compact", "masked" (blocks that `dest` has already) or "padded" (within the
            room of each row; `dest.status_sync()` says whether it sufficed).
        build_mapping: True or a `BsrTripletMap`, to set other values later.

    Returns:
        The `BsrTripletMap`, if one was asked for.

    Raises:
        ValueError, TypeError: arguments do not fit.
        WarpIndexError: in debug mode (`wp.config.mode = "debug"`), a row or column lies beyond the
            matrix; names the first such triplet. Captures are not checked.
    """
    topology = check_topology(dest, topology)
    check_storage(dest)
    _check_places(dest, rows, columns, count)
    if wp.config.mode == "debug" and not dest.device.is_capturing:
        _check_range(dest, rows, columns, count)
    prune = prune_numerical_zeros and values is not None
    mapping = _map_for(build_mapping, topology, prune_numerical_zeros, dest.device)
    blocks = None
    if values is not None:
        if values.device != dest.device:
            raise ValueError(
                "Values and the matrix must reside on the same device, got "
                f"{values.device} and {dest.device}"
            )
        if values.shape[0] != rows.shape[0]:
            raise ValueError(
                f"Values and rows must have the same length, got {values.shape[0]} and "
                f"{rows.shape[0]}"
            )
        blocks = _blocks(values, dest)
    kept = nonzero_blocks(blocks) if prune else None
    entries = collect(dest, rows, columns, topology, count, kept)
    if mapping is not None:
        mapping._build(dest, entries, rows.size)
    if blocks is not None:
        fresh_values(dest, [values])
        _gather(dest, blocks, entries)
    return mapping


def _gather(dest, blocks, entries) -> None:
    kernel = sums.gather_kernel(dest.scalar_type)
    sums.launch(kernel, dest, blocks, entries.order, entries.begins, entries.ends)


@wp.kernel(enable_backward=False)
def _write_slots(
    order: wp.array(dtype=int),
    begins: wp.array(dtype=int),
    ends: wp.array(dtype=int),
    slots: wp.array(dtype=int),
):
    slot = wp.tid()
    for entry in range(begins[slot], ends[slot]):
        slots[order[entry]] = slot


@checked(dest=MATRIX, values=ARRAY, reduction=TEXT)
def bsr_set_from_mapped_values(
    dest: BsrMatrix, mapping: BsrTripletMap, values, reduction: str = "gather"
) -> None:
    """Sets the values of a matrix from those of its triplets, whose places are known.

    Args:
        dest: the matrix that the map was built for.
        mapping: what `bsr_set_from_triplets` returned.
        values: the block of each triplet, zeros included.
        reduction: "gather" sums in the order of the triplets; "atomic" in any order.

    Raises:
        ValueError, TypeError: arguments do not fit.
    """
    if not isinstance(mapping, BsrTripletMap):
        raise TypeError("Mapping must be a BsrTripletMap")
    mapping.validate(dest)
    check_storage(dest)
    if values.device != dest.device or mapping.device != dest.device:
        raise ValueError(
            "Values, map and matrix must reside on the same device, got "
            f"{values.device}, {mapping.device} and {dest.device}"
        )
    if values.shape[0] != mapping.triplet_count:
        raise ValueError(
            f"Values must contain {mapping.triplet_count} triplets, got first dimension "
            f"{values.shape[0]}"
        )
    blocks, entries = _blocks(values, dest), mapping.entries
    if reduction == "gather":
        fresh_values(dest, [values])
        _gather(dest, blocks, entries)
    elif reduction == "atomic":
        fresh_values(dest, [values])
        slots = wp.full(mapping.triplet_count, -1, dtype=int, device=dest.device)
        inputs = [entries.order, entries.begins, entries.ends, slots]
        wp.launch(_write_slots, entries.begins.size, inputs, device=dest.device)
        dest.values.zero_()
        kernel = sums.scatter_kernel(dest.scalar_type)
        wp.launch(kernel, blocks.shape, [blocks, slots, dest.scalar_values], device=dest.device)
    else:
        raise ValueError(
            f"Unsupported mapped reduction '{reduction}', expected 'gather' or 'atomic'"
        )


@checked(rows_of_blocks=COUNT, cols_of_blocks=COUNT, rows=ARRAY, columns=ARRAY, values=ARRAY)
def bsr_from_triplets(
    rows_of_blocks: int,
    cols_of_blocks: int,
    rows,
    columns,
    values,
    prune_numerical_zeros: bool = True,
) -> BsrMatrix:
    """A matrix that is the sum of triplets; see `bsr_set_from_triplets`.

    The type of blocks is that of `values`, or a matrix of the last two of its three dimensions.
    """
    block_type = values.dtype
    if values.ndim == 3:
        block_type = wp.types.matrix(values.shape[1:], values.dtype)
    result = new_matrix(rows_of_blocks, cols_of_blocks, block_type, values.device)
    result.values.requires_grad = values.requires_grad
    bsr_set_from_triplets(result, rows, columns, values, None, prune_numerical_zeros)
    return result
