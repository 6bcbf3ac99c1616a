"""Assembly of matrices from contributions, shared by all operations.

An operation lists what goes where: row, column and number of each contribution. `collect` sorts
them by place (stably, so that sums are made in the order of the list), gives the destination its
blocks, and notes for each block which contributions it is the sum of. The operation then only
says how the number of a contribution becomes a value: one kernel over blocks.

Topologies: "compact" makes the blocks that there are contributions to; "padded" does so in the
room that each row has, and sets the status of the matrix where it does not suffice; "masked" keeps
the blocks that there are. Contributions to rows or columns outside of the matrix are left out.
"""

import functools
from dataclasses import dataclass

import warp as wp
from warp._src.sparse.checks import check_contents

TOPOLOGIES = ("compact", "masked", "padded")


@dataclass
class Entries:
    """The contributions of blocks.

    Attributes:
        order: numbers of contributions, by block.
        begins, ends: the part of `order` that belongs to each block; none for those not in use.
    """

    order: object
    begins: object
    ends: object


@functools.cache
def _kernels(key):
    """The kernels for keys of a type, which count places row by row."""
    kernel = functools.partial(wp.kernel, module=__name__, enable_backward=False)
    suffix = key.__name__
    keys_type = wp.array(dtype=key)

    @wp.func
    def first_not_below(keys: keys_type, value: key) -> int:
        low = int(0)
        high = int(keys.shape[0])
        while low < high:
            middle = low + (high - low) // 2
            if keys[middle] < value:
                low = middle + 1
            else:
                high = middle
        return low

    @kernel(name=f"sparse_encode_{suffix}")
    def encode(
        rows: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        limit: wp.array(dtype=int),
        kept: wp.array(dtype=int),
        nrow: int,
        ncol: int,
        keys: keys_type,
        order: wp.array(dtype=int),
    ):
        """Keys of places; those that do not count come last."""
        i = wp.tid()
        counts = rows[i] >= 0 and rows[i] < nrow and columns[i] >= 0 and columns[i] < ncol
        if limit.shape[0] > 0:
            counts = counts and i < limit[0]
        if kept.shape[0] > 0:
            counts = counts and kept[i] != 0
        if counts:
            keys[i] = key(rows[i]) * key(ncol) + key(columns[i])
        else:
            keys[i] = key(nrow) * key(ncol)
        order[i] = i

    @kernel(name=f"sparse_mark_{suffix}")
    def mark(keys: keys_type, last: key, marks: wp.array(dtype=int)):
        """1 where a new place begins."""
        i = wp.tid()
        new = keys[i] != last
        if i > 0:
            new = new and keys[i] != keys[i - 1]
        marks[i] = wp.where(new, 1, 0)

    @kernel(name=f"sparse_offsets_{suffix}")
    def offsets_of(
        keys: keys_type, places: wp.array(dtype=int), ncol: int, offsets: wp.array(dtype=int)
    ):
        row = wp.tid()
        before = first_not_below(keys, key(row) * key(ncol))
        offsets[row] = 0
        if before > 0:
            offsets[row] = places[before - 1]

    @kernel(name=f"sparse_place_{suffix}")
    def place(
        keys: keys_type,
        places: wp.array(dtype=int),
        last: key,
        ncol: int,
        starts: wp.array(dtype=int),
        offsets: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        begins: wp.array(dtype=int),
        ends: wp.array(dtype=int),
    ):
        """Puts each place where its row begins; `starts` is the offsets without spare room."""
        i = wp.tid()
        if keys[i] == last:
            return
        row = int(keys[i] // key(ncol))
        slot = places[i] - 1 - starts[row] + offsets[row]
        if slot >= offsets[row + 1]:
            return
        first = i == 0
        if not first:
            first = keys[i] != keys[i - 1]
        if first:
            columns[slot] = int(keys[i] % key(ncol))
            begins[slot] = i
        final = i == keys.shape[0] - 1
        if not final:
            final = keys[i + 1] != keys[i]
        if final:
            ends[slot] = i + 1

    @kernel(name=f"sparse_find_{suffix}")
    def find(
        keys: keys_type,
        rows: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        ncol: int,
        begins: wp.array(dtype=int),
        ends: wp.array(dtype=int),
    ):
        """The contributions to blocks that there are already."""
        slot = wp.tid()
        begins[slot] = 0
        ends[slot] = 0
        if rows[slot] >= 0 and columns[slot] >= 0 and columns[slot] < ncol:
            wanted = key(rows[slot]) * key(ncol) + key(columns[slot])
            begins[slot] = first_not_below(keys, wanted)
            ends[slot] = first_not_below(keys, wanted + key(1))

    return encode, mark, offsets_of, place, find


@wp.kernel(enable_backward=False)
def _count_rows(
    starts: wp.array(dtype=int),
    offsets: wp.array(dtype=int),
    keeps_parts: wp.bool,
    row_counts: wp.array(dtype=int),
    status: wp.array(dtype=int),
):
    row = wp.tid()
    count = starts[row + 1] - starts[row]
    room = offsets[row + 1] - offsets[row]
    if count > room:
        status[0] = 1
        count = wp.where(keeps_parts, room, 0)
    row_counts[row] = count


class _Sorted:
    """Contributions in the order of their places."""

    def __init__(self, nrow, ncol, rows, columns, limit, kept, device):
        self.device, self.nrow, self.ncol = device, nrow, ncol
        self.count, self.last = rows.size, nrow * ncol
        self.key = wp.uint32 if self.last < 2**31 else wp.uint64
        n = self.count
        self.encode, self.mark, self.offsets_of, self.place, self.find = _kernels(self.key)
        # A sort needs as much room again.
        keys = wp.empty(2 * n, dtype=self.key, device=device)
        order = wp.empty(2 * n, dtype=int, device=device)
        none = order[:0]
        limit, kept = (none if a is None else a for a in (limit, kept))
        self.launch(self.encode, n, rows, columns, limit, kept, nrow, ncol, keys, order)
        bits = self.last.bit_length()
        if n > 1 and bits:
            wp.utils.radix_sort_pairs(keys, order, n, 0, bits)
        self.keys, self.order = keys[:n], order[:n]

    def launch(self, kernel, dim, *inputs):
        if dim:
            wp.launch(kernel, dim, inputs, device=self.device)

    def number_places(self):
        """For each contribution the number of its place, from 1."""
        places = wp.empty(self.count, dtype=int, device=self.device)
        self.launch(self.mark, self.count, self.keys, self.key(self.last), places)
        if self.count:
            wp.utils.array_scan(places, places)
        return places

    def put(self, places, starts, offsets, columns, capacity) -> Entries:
        begins = wp.zeros(capacity, dtype=int, device=self.device)
        ends = wp.zeros(capacity, dtype=int, device=self.device)
        last = self.key(self.last)
        inputs = (places, last, self.ncol, starts, offsets, columns, begins, ends)
        self.launch(self.place, self.count, self.keys, *inputs)
        return Entries(self.order, begins, ends)


def collect(dest, rows, columns, topology, limit=None, kept=None, keeps_parts=True) -> Entries:
    """Gives a matrix the blocks for some contributions; its values are left to the caller.

    Args:
        dest: the matrix, with its numbers of rows and columns.
        rows, columns: int32, the place of each contribution.
        topology: which blocks `dest` gets.
        limit: an int32, how many of the first contributions count, or None for all.
        kept: int32 for each contribution, zero for those that do not count, or None.
        keeps_parts: whether a row without enough room gets the first blocks, or none.
    """
    if topology != "compact":
        check_contents(dest, columns=False, most=dest.nnz)
    sorted_ = _Sorted(dest.nrow, dest.ncol, rows, columns, limit, kept, dest.device)
    if topology == "masked":
        slots = dest.nnz
        begins = wp.empty(slots, dtype=int, device=dest.device)
        ends = wp.empty(slots, dtype=int, device=dest.device)
        inputs = (dest.uncompress_rows(), dest.columns, dest.ncol, begins, ends)
        sorted_.launch(sorted_.find, slots, sorted_.keys, *inputs)
        return Entries(sorted_.order, begins, ends)
    places = sorted_.number_places()
    compact = topology == "compact"
    if compact:
        make_compact(dest, rows.size)
    starts = dest.offsets if compact else wp.empty_like(dest.offsets)
    sorted_.launch(sorted_.offsets_of, dest.nrow + 1, sorted_.keys, places, dest.ncol, starts)
    if not compact:
        make_padded(dest)
        inputs = (starts, dest.offsets, keeps_parts, dest.row_counts, dest._ensure_status())
        sorted_.launch(_count_rows, dest.nrow, *inputs)
    return sorted_.put(places, starts, dest.offsets, dest.columns, dest.nnz)


def make_compact(dest, nnz) -> None:
    """Prepares a matrix for at most `nnz` blocks without spare room between rows."""
    if dest.offsets.size < dest.nrow + 1:
        dest.offsets = wp.empty(dest.nrow + 1, dtype=int, device=dest.device)
    dest.row_counts = None
    dest.nnz = nnz
    dest._fit(nnz)


def make_padded(dest) -> None:
    """Gives a matrix counts of the blocks in use of each row."""
    if dest.row_counts is None or dest.row_counts.size < dest.nrow:
        dest.row_counts = wp.zeros(dest.nrow, dtype=int, device=dest.device)


def check_topology(dest, topology, allowed=TOPOLOGIES) -> str:
    """The topology to use: by default the one that the matrix has.

    Raises:
        ValueError: there is no such topology.
    """
    if topology is None:
        return "compact" if dest is None or dest.row_counts is None else "padded"
    if topology not in allowed:
        raise ValueError(f"Unsupported topology policy: {topology}")
    return topology


def fresh_values(dest, sources) -> None:
    """Gives a matrix other memory for its values if it is read from, or lacks a gradient."""
    wanted = any(source.requires_grad for source in sources)
    shared = any(source.ptr == dest.values.ptr for source in sources) and dest.values.size
    if shared or (wanted and not dest.values.requires_grad):
        size = max(dest.values.size, dest.nnz)
        dest.values = wp.empty(
            size, dtype=dest.dtype, device=dest.device, requires_grad=wanted or dest.requires_grad
        )
