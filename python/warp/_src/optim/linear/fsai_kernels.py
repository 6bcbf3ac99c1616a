"""Kernels of factorized sparse approximate inverses: a thread per row of the factor.

A row has a support: columns in the order in which they joined, the row itself first. All is about
the matrix scaled to a diagonal of ones, of which a row and column without a positive finite
diagonal are no part (their scale is zero).

Arrays that are shared by kernels, with `m` entries in a row at most:

    support     m x rows, the columns of each row in the order of joining
    counts      how many there are
    lower       m (m + 1) / 2 x threads, the Cholesky factor of the matrix on the support, packed
    forward     m x threads, the solution with that factor of the first unit vector
    solution    m x threads, the solution with the matrix itself
"""

import functools

import warp as wp


@functools.cache
def functions(scalar, wide):
    """Steps of the factorization of the scaled matrix on a support, and a solution."""

    @wp.func
    def element(
        blocks: wp.array3d(dtype=scalar),
        starts: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        scale: wp.array(dtype=wide),
        row: int,
        column: int,
    ):
        size = blocks.shape[1]
        result = wide(0.0)
        end = ends[row // size]
        slot = wp.lower_bound(columns, starts[row // size], end, column // size)
        usable = scale[row] != wide(0.0) and scale[column] != wide(0.0)
        if slot < end and usable:  # noqa: SIM102 (both sides of `and` are computed)
            if columns[slot] == column // size:
                value = wide(blocks[slot, row % size, column % size])
                result = value * scale[row] * scale[column]
        return result

    @wp.func
    def join(
        blocks: wp.array3d(dtype=scalar),
        starts: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        scale: wp.array(dtype=wide),
        support: wp.array2d(dtype=int),
        row: int,
        lower: wp.array2d(dtype=wide),
        thread: int,
        k: int,
        column: int,
    ):
        """Writes row k of the Cholesky factor except its pivot, whose square is returned."""
        first = (k * (k + 1)) // 2
        pivot = wide(1.0)
        for j in range(k):
            total = element(blocks, starts, ends, columns, scale, support[j, row], column)
            above = (j * (j + 1)) // 2
            for p in range(j):
                total -= lower[first + p, thread] * lower[above + p, thread]
            total /= lower[above + j, thread]
            lower[first + j, thread] = total
            pivot -= total * total
        return pivot

    @wp.func
    def settle(
        lower: wp.array2d(dtype=wide),
        forward: wp.array2d(dtype=wide),
        thread: int,
        k: int,
        pivot: wide,
    ):
        """Writes the pivot of row k and the forward solution there."""
        first = (k * (k + 1)) // 2
        root = wp.sqrt(pivot)
        lower[first + k, thread] = root
        total = wp.where(k == 0, wide(1.0), wide(0.0))
        for j in range(k):
            total -= lower[first + j, thread] * forward[j, thread]
        forward[k, thread] = total / root

    @wp.func
    def solve(
        lower: wp.array2d(dtype=wide),
        forward: wp.array2d(dtype=wide),
        solution: wp.array2d(dtype=wide),
        thread: int,
        count: int,
    ):
        """Writes the solution for the first unit vector; returns its first number."""
        for step in range(count):
            k = count - 1 - step
            total = forward[k, thread]
            for j in range(k + 1, count):
                total -= lower[(j * (j + 1)) // 2 + k, thread] * solution[j, thread]
            solution[k, thread] = total / lower[(k * (k + 1)) // 2 + k, thread]
        return solution[0, thread]

    return join, settle, solve


@functools.cache
def refit_kernel(scalar, wide, stored):
    """Computes the numbers of the factor on supports that are given, into `values`."""
    join, settle, solve = functions(scalar, wide)

    @wp.kernel(
        name=f"fsai_refit_{scalar.__name__}_{stored.__name__}",
        module=__name__,
        enable_backward=False,
    )
    def refit(
        blocks: wp.array3d(dtype=scalar),
        starts: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        scale: wp.array(dtype=wide),
        first: int,
        floor: wide,
        regularize: bool,
        lower: wp.array2d(dtype=wide),
        forward: wp.array2d(dtype=wide),
        solution: wp.array2d(dtype=wide),
        support: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        offsets: wp.array(dtype=int),
        values: wp.array(dtype=stored),
        status: wp.array(dtype=int),
    ):
        thread = wp.tid()
        row = first + thread
        count = counts[row]
        good = scale[row] != wide(0.0)
        raised = bool(False)
        settle(lower, forward, thread, 0, wide(1.0))
        for k in range(1, count):
            if good:
                column = support[k, row]
                pivot = join(
                    blocks, starts, ends, columns, scale, support, row, lower, thread, k, column
                )
                if not (pivot > floor):
                    if regularize and wp.isfinite(pivot):
                        pivot = floor
                        raised = True
                    else:
                        good = False
                if good:
                    settle(lower, forward, thread, k, pivot)
        if good:
            energy = solve(lower, forward, solution, thread, count)
            root = wp.sqrt(energy)
            for k in range(count):
                column = support[k, row]
                rank = int(0)
                for j in range(count):
                    if support[j, row] < column:
                        rank += 1
                value = stored(solution[k, thread] / root * scale[column])
                if not wp.isfinite(value) or (k == 0 and not (value > stored(0.0))):
                    good = False
                values[offsets[row] + rank] = value
        if not good:
            wp.atomic_add(status, 2, 1)
            # The rest is the diagonal, or a one where that is of no use.
            for k in range(count):
                values[offsets[row] + k] = stored(0.0)
            last = stored(scale[row])
            if not wp.isfinite(last) or not (last > stored(0.0)):
                last = stored(1.0)
            values[offsets[row] + count - 1] = last
        elif raised:
            wp.atomic_add(status, 3, 1)

    return refit


@functools.cache
def scale_kernel(scalar, wide):
    """Scales of rows: one over the root of the diagonal, zero for those of no use."""

    @wp.kernel(name=f"fsai_scale_{scalar.__name__}", module=__name__, enable_backward=False)
    def set_scale(
        blocks: wp.array3d(dtype=scalar),
        starts: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        scale: wp.array(dtype=wide),
        status: wp.array(dtype=int),
    ):
        row = wp.tid()
        size = blocks.shape[1]
        block = row // size
        slot = wp.lower_bound(columns, starts[block], ends[block], block)
        result = wide(0.0)
        if slot < ends[block]:  # noqa: SIM102
            if columns[slot] == block:
                value = wide(blocks[slot, row % size, row % size])
                if wp.isfinite(value) and value > wide(0.0):
                    result = wide(1.0) / wp.sqrt(value)
        if result == wide(0.0):
            wp.atomic_add(status, 1, 1)
        scale[row] = result

    return set_scale
