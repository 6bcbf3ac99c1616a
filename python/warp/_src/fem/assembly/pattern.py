"""Symbolic sparsity - exact columns of each row, and the contributions to every nonzero.

The columns of row r are the union of the trial nodes of the elements that have r as a test node.
Both tables come from spaces. Positions of trial nodes, sorted by node, are expanded by the test
nodes of their elements and sorted by row, in batches of elements with bounded scratch memory. A
single batch is the result; several are merged, a range of rows at a time.
"""

import dataclasses
import functools
import itertools

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.assembly.incidence import find_incidence, is_small
from warp._src.fem.assembly.merge import Rows, find_few_runs, find_runs, sort_pairs
from warp._src.fem.types import Ints, IntTable, Longs

# Bytes of the blocks of one batch of elements, and entries whose sort takes as much.
BLOCK_BYTES = 64 << 20
ENTRIES = 4 << 20
# Entries that a capture sorts at once, whatever memory that takes, as it cannot join batches.
CAPTURED_ENTRIES = 1 << 28
# Bytes for matrices of large blocks on CPUs, whose caches keep blocks until they are gathered. For
# numbers, lists of targets cost as much as is saved.
CACHED_BYTES = 3 << 20
_FEWEST_ELEMENTS, _LARGE_BLOCK = 256, 16


@dataclasses.dataclass
class Batch:
    """The contributions of a range of elements.

    Attributes:
        first, count: the elements.
        targets: int32, the targets of this batch; None if target k has number k.
        begins: int32, one more: contributions of a target.
        entries: int32, positions in the blocks of the batch, in element order.
        heads: int32, the first entry of each target, which threads read side by side; None if
            most targets have others, or the number of targets is not known.
        carries: int32, where targets of several batches keep their sums, -1 for others; None if
            there is one batch.
    """

    first: int
    count: int
    targets: wp.array | None
    begins: wp.array
    entries: wp.array
    heads: wp.array | None = None
    carries: wp.array | None = None
    _places: tuple | None = None

    def places(self, width: int) -> tuple:
        """Entries and heads as positions in the blocks of their element, `width` each."""
        if self._places is None:
            with extend.unrecorded():
                self._places = tuple(_modulo(one, width) for one in (self.entries, self.heads))
        return self._places

    @property
    def target_count(self) -> int:
        """Number of targets."""
        return self.begins.shape[0] - 1


def _modulo(positions, width):
    """Remainders of positions, in 16 bits where those have room."""
    if positions is None:
        return None
    dtype = wp.uint16 if width <= 1 << 16 else wp.int32
    made = wp.empty(positions.shape, dtype=dtype, device=positions.device)
    inputs = [positions, width, made]
    wp.launch(_modulo_kernel(dtype), positions.shape, inputs, device=positions.device)
    return made


@functools.cache
def _modulo_kernel(dtype):
    def modulo(positions: Ints, width: int, made: wp.array(dtype=dtype)):
        at = wp.tid()
        made[at] = dtype(positions[at] % width)

    return wp.kernel(modulo, enable_backward=False)


@wp.kernel(enable_backward=False)
def _expand(
    trial_positions: Ints,
    test_table: IntTable,
    trial_table: IntTable,
    first: int,
    unused: int,
    rows: Ints,
    origins: Ints,
):
    q, i = wp.tid()
    position = trial_positions[q]
    trial_width = trial_table.shape[1]
    test_width = test_table.shape[1]
    e = position // trial_width
    j = position - e * trial_width
    row = test_table[first + e, i]
    if row < 0 or trial_table[first + e, j] < 0:
        row = unused
    rows[q * test_width + i] = row
    origins[q * test_width + i] = (e * test_width + i) * trial_width + j


@wp.kernel(enable_backward=False)
def _read_columns(origins: Ints, trial_table: IntTable, first: int, block: int, columns: Ints):
    at = wp.tid()
    origin = origins[at]
    columns[at] = trial_table[first + origin // block, origin % trial_table.shape[1]]


@wp.kernel(enable_backward=False)
def _add_row_sizes(offsets: Ints, sizes: Longs):
    r = wp.tid()
    sizes[r] += wp.int64(offsets[r + 1] - offsets[r])


@wp.kernel(enable_backward=False)
def _list_rows(
    offsets: Ints,
    columns: Ints,
    first_row: int,
    at: int,
    shift: int,
    row_list: Ints,
    column_list: Ints,
    origins: Ints,
):
    r = first_row + wp.tid()
    for k in range(offsets[r], offsets[r + 1]):
        to = at + k - offsets[first_row]
        row_list[to] = r
        column_list[to] = columns[k]
        origins[to] = shift + k


@wp.kernel(enable_backward=False)
def _read(source: Ints, order: Ints, dest: Ints):
    at = wp.tid()
    dest[at] = source[order[at]]


@wp.kernel(enable_backward=False)
def _number_targets(begins: Ints, origins: Ints, first: int, targets: Ints):
    k = wp.tid()
    for at in range(begins[k], begins[k + 1]):
        targets[origins[at]] = first + k


@wp.kernel(enable_backward=False)
def _read_heads(begins: Ints, entries: Ints, heads: Ints):
    k = wp.tid()
    heads[k] = entries[begins[k]]


def _heads(found):
    count, device = found.begins.shape[0] - 1, found.begins.device
    if found.origins.shape[0] >= 2 * count or device.is_capturing:
        return None
    heads = wp.empty(count, dtype=int, device=device)
    inputs = [found.begins, found.origins, heads]
    wp.launch(_read_heads, count, inputs, device=device)
    return heads


@wp.kernel(enable_backward=False)
def _count(targets: Ints, counts: Ints):
    # A batch has a target once.
    counts[targets[wp.tid()]] += 1


@wp.kernel(enable_backward=False)
def _mark_shared(counts: Ints, marks: Ints):
    k = wp.tid()
    marks[k] = wp.where(counts[k] > 1, 1, 0)


@wp.kernel(enable_backward=False)
def _read_carries(targets: Ints, counts: Ints, numbers: Ints, carries: Ints):
    k = wp.tid()
    target = targets[k]
    carries[k] = wp.where(counts[target] > 1, numbers[target] - 1, -1)


@wp.kernel(enable_backward=False)
def _shift(values: Ints, by: int):
    i = wp.tid()
    values[i] += by


class Pattern:
    """Blocks that a bilinear form fills, and where they come from.

    Args:
        test_table, trial_table: int32 (elements, n) and (elements, m), rows and columns of the
            local nodes of each element, negative if they take no part.
        row_count, column_count: size of the matrix, in blocks.
        block_bytes: size of a block of an element's matrix.

    Attributes:
        offsets: int32, `row_count + 1`.
        columns: int32, ascending in each row.
        nnz: number of blocks.
        batches: contributions, by ranges of elements.
        carry_count: number of blocks that several batches add to.
    """

    def __init__(self, test_table, trial_table, row_count, column_count, block_bytes=4):
        elements, test_width = test_table.shape
        if trial_table.shape[0] != elements:
            raise ValueError(
                f"expects tables of one number of elements, but got {elements} and "
                f"{trial_table.shape[0]}"
            )
        self.device = test_table.device
        self.row_count, self.column_count = row_count, column_count
        self.width = test_width * trial_table.shape[1]
        limit = min(batch_size(self.width * block_bytes), max(1, ENTRIES // max(self.width, 1)))
        is_cached = block_bytes >= _LARGE_BLOCK and not self.device.is_cuda
        if self.device.is_capturing:
            # The sizes of several batches are not known then.
            limit = max(limit, CAPTURED_ENTRIES // max(self.width, 1))
        elif is_cached:
            cached = batch_size(self.width * block_bytes * (BLOCK_BYTES // CACHED_BYTES))
            limit = min(limit, max(cached, _FEWEST_ELEMENTS))
        ranges = [(i, min(limit, elements - i)) for i in range(0, elements, limit)] or [(0, 0)]
        found = [self._sorted(test_table, trial_table, first, count) for first, count in ranges]
        targets = [None] * len(found)
        rows = found[0]
        if len(found) > 1:
            if self.device.is_capturing:
                raise RuntimeError(
                    f"the sparsity of {elements} elements is found in {len(found)} parts, whose "
                    "sizes a capture cannot read; call `integrate` once before it, or "
                    "`fem.pattern(test, trial)`"
                )
            rows, targets = self._union(found)
        self.batches = [
            Batch(*r, t, f.begins, f.origins, _heads(f))
            for r, t, f in zip(ranges, targets, found, strict=True)
        ]
        self.offsets, self.columns = rows.offsets, rows.columns
        self.nnz = self.columns.shape[0]
        self.carry_count = self._find_carries() if len(found) > 1 else 0

    def _find_carries(self) -> int:
        """Numbers the targets that several batches add to; gives how many they are."""
        device = self.device
        counts = wp.zeros(self.nnz, dtype=int, device=device)
        numbers = wp.empty(self.nnz, dtype=int, device=device)
        for batch in self.batches:
            wp.launch(_count, batch.target_count, [batch.targets, counts], device=device)
        wp.launch(_mark_shared, self.nnz, [counts, numbers], device=device)
        wp.utils.array_scan(numbers, numbers)
        for batch in self.batches:
            batch.carries = wp.empty(batch.target_count, dtype=int, device=device)
            inputs = [batch.targets, counts, numbers, batch.carries]
            wp.launch(_read_carries, batch.target_count, inputs, device=device)
        return int(numbers[self.nnz - 1 :].numpy()[0]) if self.nnz else 0

    def _sorted(self, test_table, trial_table, first, count) -> Rows:
        """Rows of a range of elements."""
        device, size = self.device, count * self.width
        if is_small(test_table.shape[0] * self.width, device):
            tables = (table.numpy()[first : first + count] for table in (test_table, trial_table))
            return find_few_runs(*tables, self.row_count, device)
        positions = find_incidence(trial_table, self.column_count, first, count).positions
        rows, origins = (wp.empty(2 * size, dtype=int, device=device) for _ in range(2))
        inputs = [positions, test_table, trial_table, first, self.row_count, rows, origins]
        wp.launch(_expand, (positions.shape[0], test_table.shape[1]), inputs, device=device)
        sort_pairs(rows, origins, size, self.row_count)
        columns = wp.empty(size, dtype=int, device=device)
        inputs = [origins, trial_table, first, self.width, columns]
        wp.launch(_read_columns, size, inputs, device=device)
        origins = wp.clone(origins[:size])
        return find_runs(rows, columns, origins, size, 0, self.row_count)

    def _union(self, found):
        """Rows of all batches, and the number of each of their nonzeros."""
        device = self.device
        sizes = wp.zeros(self.row_count, dtype=wp.int64, device=device)
        for part in found:
            wp.launch(_add_row_sizes, self.row_count, [part.offsets, sizes], device=device)
        bounds = np.concatenate([[0], np.cumsum(sizes.numpy())])
        shifts = np.concatenate([[0], np.cumsum([part.columns.shape[0] for part in found])])
        if shifts[-1] >= 2**31:
            raise ValueError("expects fewer than 2^31 blocks; integrate over subdomains")
        targets = wp.empty(int(shifts[-1]), dtype=int, device=device)
        starts = [part.offsets.numpy() for part in found]
        parts, first, total = [], 0, 0
        while first < self.row_count:
            last = int(np.searchsorted(bounds, bounds[first] + ENTRIES, side="right")) - 1
            last = min(max(last, first + 1), self.row_count)
            size = int(bounds[last] - bounds[first])
            part = self._union_of_rows(found, starts, shifts, first, last, size)
            nnz = part.columns.shape[0]
            inputs = [part.begins, part.origins, total, targets]
            wp.launch(_number_targets, nnz, inputs, device=device)
            wp.launch(_shift, last - first + 1, [part.offsets, total], device=device)
            parts.append(part)
            first, total = last, total + nnz
        offsets = _concatenated([p.offsets[:-1] for p in parts] + [parts[-1].offsets[-1:]])
        rows = Rows(offsets, _concatenated([p.columns for p in parts]), None, None)
        return rows, [targets[a:b] for a, b in itertools.pairwise(shifts)]

    def _union_of_rows(self, found, starts, shifts, first, last, size) -> Rows:
        device = self.device
        row_list, columns, origins = (wp.empty(size, dtype=int, device=device) for _ in range(3))
        at = 0
        for part, start, shift in zip(found, starts, shifts, strict=False):
            count = int(start[last] - start[first])
            if count:
                outputs = [row_list, columns, origins]
                inputs = [part.offsets, part.columns, first, at, int(shift), *outputs]
                wp.launch(_list_rows, last - first, inputs, device=device)
            at += count
        order = wp.array(np.tile(np.arange(size, dtype=np.int32), 2), dtype=int, device=device)
        for values, end in ((columns, self.column_count), (row_list, last)):
            keys = wp.empty(2 * size, dtype=int, device=device)
            wp.launch(_read, size, [values, order, keys], device=device)
            sort_pairs(keys, order, size, end)
        result = []
        for values in (columns, origins):
            result.append(wp.empty(size, dtype=int, device=device))
            wp.launch(_read, size, [values, order, result[-1]], device=device)
        return find_runs(keys, *result, size, first, last - first)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns of blocks."""
        return self.row_count, self.column_count


def batch_size(block_bytes: int) -> int:
    """Number of elements of a batch, for so many bytes of blocks an element."""
    return max(1, BLOCK_BYTES // max(block_bytes, 1))


def _concatenated(arrays):
    """One array of the numbers of several."""
    result = wp.empty(sum(a.size for a in arrays), dtype=int, device=arrays[0].device)
    at = 0
    for array in arrays:
        wp.copy(result, array, dest_offset=at, count=array.size)
        at += array.size
    return result


def node_batches(table, node_count: int, block_bytes=4) -> list[Batch]:
    """Contributions to each node from element vectors.

    Args:
        table: int32 (elements, n) of node numbers, negative if unused.
        node_count: number of nodes.
        block_bytes: size of an element of the vector.
    """
    elements, limit = table.shape[0], batch_size(table.shape[1] * block_bytes)
    batches = []
    for first in range(0, elements, limit):
        count = min(limit, elements - first)
        found = find_incidence(table, node_count, first, count)
        batches.append(Batch(first, count, None, found.begins, found.positions))
    return batches
