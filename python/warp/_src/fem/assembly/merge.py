"""Sorted entries - sparse rows with the origins of each nonzero, by stable radix sorts.

Entries are triples (row, column, origin). Sorted by column, then by row with a stable sort, equal
pairs are neighbours and their origins keep their order. Runs of equal pairs are the nonzeros.
"""

import dataclasses

import numpy as np

import warp as wp
from warp._src.fem.types import Ints


@dataclasses.dataclass
class Rows:
    """Sparse rows with the origins of each nonzero.

    Attributes:
        offsets: int32, rows + 1.
        columns: int32, ascending in each row.
        begins: int32, nonzeros + 1: origins of each nonzero.
        origins: int32, in the order of the entries.
    """

    offsets: wp.array
    columns: wp.array
    begins: wp.array
    origins: wp.array


@wp.kernel(enable_backward=False)
def _mark_runs(rows: Ints, columns: Ints, row_count: int, marks: Ints):
    at = wp.tid()
    row = rows[at]
    mark = wp.where(row < row_count, 1, 0)
    if at > 0 and rows[at - 1] == row and columns[at - 1] == columns[at]:
        mark = 0
    marks[at] = mark


@wp.kernel(enable_backward=False)
def _write_runs(
    rows: Ints,
    columns: Ints,
    numbers: Ints,
    size: int,
    first_row: int,
    offsets: Ints,
    run_columns: Ints,
    begins: Ints,
):
    at = wp.tid()
    row_count = offsets.shape[0] - 1
    row, before, number, last = row_count, int(-1), int(0), int(-1)
    if at > 0:
        number = numbers[at - 1]
        before = rows[at - 1] - first_row
        last = columns[at - 1]
    if at < size:
        row = wp.min(rows[at] - first_row, row_count)
    if row < row_count and (row != before or columns[at] != last):
        run_columns[number] = columns[at]
        begins[number] = at
    # The number of runs before the entry is where its row begins, and all empty rows before it.
    for r in range(before + 1, row + 1):
        offsets[r] = number
    if row == row_count and before < row_count:
        begins[number] = at


@wp.kernel(enable_backward=False)
def _end_runs(numbers: Ints, begins: Ints):
    """Gives runs that there are not no origins."""
    k = wp.tid()
    count = numbers[numbers.shape[0] - 1]
    if k > count:
        begins[k] = begins[count]


def find_runs(rows, columns, origins, size, first_row, row_count) -> Rows:
    """Nonzeros of sorted entries.

    In a capture, where their number cannot be read, there is room for as many as entries.

    Args:
        rows, columns, origins: int32, of at least `size` entries; rows beyond the last are unused.
        size: number of entries.
        first_row, row_count: the rows that they are of.
    """
    device = rows.device
    numbers = wp.empty(size, dtype=int, device=device)
    wp.launch(_mark_runs, size, [rows, columns, first_row + row_count, numbers], device=device)
    wp.utils.array_scan(numbers, numbers)
    is_captured = device.is_capturing
    nnz = size if is_captured or not size else int(numbers[size - 1 :].numpy()[0])
    offsets = wp.empty(row_count + 1, dtype=int, device=device)
    result = Rows(
        offsets,
        wp.empty(nnz, dtype=int, device=device),
        wp.empty(nnz + 1, dtype=int, device=device),
        origins,
    )
    outputs = [offsets, result.columns, result.begins]
    inputs = [rows, columns, numbers, size, first_row]
    wp.launch(_write_runs, size + 1, [*inputs, *outputs], device=device)
    if is_captured and size:
        wp.launch(_end_runs, size + 1, [numbers, result.begins], device=device)
    return result


def find_few_runs(tests, trials, row_count, device) -> Rows:
    """Nonzeros of the elements of small tables, (elements, n), by NumPy."""
    elements, test_width, trial_width = *tests.shape, trials.shape[1]
    shape = (elements, trial_width, test_width)
    rows, columns = (np.broadcast_to(t, shape) for t in (tests[:, None], trials[:, :, None]))
    origins = np.arange(rows.size).reshape(elements, test_width, trial_width).transpose(0, 2, 1)
    is_used = (rows >= 0) & (rows < row_count) & (columns >= 0)
    rows, columns, origins = (one[is_used] for one in (rows, columns, origins))
    stride = int(columns.max(initial=0)) + 1
    keys = rows.astype(np.int64) * stride + columns
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    begins = np.flatnonzero(np.diff(keys, prepend=-1))
    offsets = np.searchsorted(keys[begins], np.arange(row_count + 1) * stride)
    found = offsets, columns[order[begins]], np.append(begins, len(keys)), origins[order]
    return Rows(*(wp.array(one, dtype=wp.int32, device=device) for one in found))


def sort_pairs(keys, values, size: int, end: int) -> None:
    """Sorts pairs by keys from 0 to `end`, stably; arrays have room for twice as many."""
    wp.utils.radix_sort_pairs(keys, values, size, end_bit=max(int(end).bit_length(), 1))
