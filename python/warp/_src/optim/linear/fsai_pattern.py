"""Kernels about where the numbers of a sparse approximate inverse are, and who may see them."""

import functools

import warp as wp


@wp.kernel(enable_backward=False)
def list_entries(
    support: wp.array2d(dtype=int),
    counts: wp.array(dtype=int),
    keys: wp.array(dtype=int),
    places: wp.array(dtype=int),
):
    """Columns in ascending order, row after row with room for all; the last key where none is."""
    row, k = wp.tid()
    most, rows = support.shape[0], counts.shape[0]
    count = counts[row]
    key = int(rows)
    rank = int(k)
    if k < count:
        key = support[k, row]
        rank = 0
        for j in range(count):
            if support[j, row] < key:
                rank += 1
    keys[row * most + rank] = key
    places[row * most + rank] = row * most + rank


@wp.kernel(enable_backward=False)
def fill_rows(
    keys: wp.array(dtype=int),
    most: int,
    counts: wp.array(dtype=int),
    offsets: wp.array(dtype=int),
    status: wp.array(dtype=int),
    fatal: int,
    ready: wp.array(dtype=int),
    columns: wp.array(dtype=int),
    row_counts: wp.array(dtype=int),
):
    """Writes the columns of the factor from the keys before they are sorted."""
    row, k = wp.tid()
    if ready[0] != 0 or refused(status, fatal):
        return
    if k < counts[row]:
        columns[offsets[row] + k] = keys[row * most + k]
    if k == 0 and row_counts.shape[0] > 0:
        row_counts[row] = counts[row]


@wp.func
def refused(status: wp.array(dtype=int), fatal: int) -> bool:
    """True if one of the first `fatal` counts says that the numbers are not to be used."""
    result = bool(False)
    for i in range(fatal):
        if status[i] != 0:
            result = True
    return result


@wp.kernel(enable_backward=False)
def fill_transposed(
    keys: wp.array(dtype=int),
    places: wp.array(dtype=int),
    most: int,
    offsets: wp.array(dtype=int),
    status: wp.array(dtype=int),
    fatal: int,
    ready: wp.array(dtype=int),
    columns: wp.array(dtype=int),
    sources: wp.array(dtype=int),
):
    """Writes the columns of the transposed factor, and where its numbers come from, from the
    sorted keys; what is behind them comes from nowhere."""
    i = wp.tid()
    if ready[0] != 0 or refused(status, fatal):
        return
    row = places[i] // most
    if keys[i] < offsets.shape[0] - 1:
        columns[i] = row
        sources[i] = offsets[row] + places[i] % most
    elif i < sources.shape[0]:
        sources[i] = -1


@wp.kernel(enable_backward=False)
def fill_offsets(
    keys: wp.array(dtype=int),
    count: int,
    status: wp.array(dtype=int),
    fatal: int,
    ready: wp.array(dtype=int),
    offsets: wp.array(dtype=int),
):
    """Offsets of the rows of the transposed factor, from the sorted keys."""
    column = wp.tid()
    if ready[0] == 0 and not refused(status, fatal):
        place = int(count)
        if count > 0:
            place = wp.lower_bound(keys, 0, count, column)
            # The last one where there is none so large.
            if keys[place] < column:
                place = count
        offsets[column] = place


@functools.cache
def commit_kernel(stored):
    """Publishes numbers in the factor and its transposed one, unless they are refused."""

    @wp.kernel(name=f"fsai_commit_{stored.__name__}", module=__name__, enable_backward=False)
    def commit(
        values: wp.array(dtype=stored),
        sources: wp.array(dtype=int),
        status: wp.array(dtype=int),
        fatal: int,
        factor: wp.array(dtype=stored),
        transposed: wp.array(dtype=stored),
    ):
        i = wp.tid()
        if not refused(status, fatal):
            factor[i] = values[i]
            source = sources[i]
            if source >= 0:
                transposed[i] = values[source]

    return commit


@wp.kernel(enable_backward=False)
def make_ready(
    status: wp.array(dtype=int),
    fatal: int,
    ready: wp.array(dtype=int),
    pattern_status: wp.array(dtype=int),
):
    """Says that a pattern is there from now on."""
    if ready[0] == 0:
        pattern_status[2] = status[2]
        if not refused(status, fatal):
            ready[0] = 1


@wp.kernel(enable_backward=False)
def compare_topology(
    kept: wp.array(dtype=int), given: wp.array(dtype=int), status: wp.array(dtype=int)
):
    """Counts what differs from a matrix that was there before."""
    i = wp.tid()
    if kept[i] != given[i]:
        wp.atomic_add(status, 0, 1)


@wp.kernel(enable_backward=False)
def clear_pattern(ready: wp.array(dtype=int), pattern_status: wp.array(dtype=int)):
    """Forgets counts of a search for supports that is about to be repeated."""
    if ready[0] == 0:
        for i in range(3):
            pattern_status[i] = 0


@functools.cache
def product_kernel(stored, given, wide, result):
    """Products of the factor with a vector, and what is added to them."""
    names = "_".join(t.__name__ for t in (stored, given, wide, result))

    @wp.kernel(name=f"fsai_product_{names}", module=__name__, enable_backward=False)
    def multiply(
        starts: wp.array(dtype=int),
        row_counts: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        values: wp.array(dtype=stored),
        x: wp.array(dtype=given),
        alpha: wp.float64,
        y: wp.array(dtype=result),
        beta: wp.float64,
        z: wp.array(dtype=result),
    ):
        row = wp.tid()
        total = wide(0.0)
        # A vector with weight zero is not read.
        if alpha != wp.float64(0.0):
            begin = starts[row]
            end = starts[row + 1]
            if row_counts.shape[0] > 0:
                end = begin + row_counts[row]
            for i in range(begin, end):
                total += wide(values[i]) * wide(x[columns[i]])
            total *= wide(alpha)
        if beta != wp.float64(0.0):
            total += wide(beta) * wide(y[row])
        z[row] = result(total)

    return multiply
