"""The kernel that finds supports of sparse approximate inverses; arrays as in `fsai_kernels`."""

import functools

import warp as wp
from warp._src.optim.linear.fsai_kernels import functions


@functools.cache
def select_kernel(scalar, wide):
    """Chooses supports: those off them join on which the residual is largest, step by step."""
    join, settle, solve = functions(scalar, wide)

    @wp.kernel(name=f"fsai_select_{scalar.__name__}", module=__name__, enable_backward=False)
    def select(
        blocks: wp.array3d(dtype=scalar),
        starts: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        scale: wp.array(dtype=wide),
        first: int,
        step_size: int,
        tolerance: wide,
        floor: wide,
        ready: wp.array(dtype=int),
        lower: wp.array2d(dtype=wide),
        forward: wp.array2d(dtype=wide),
        solution: wp.array2d(dtype=wide),
        places: wp.array2d(dtype=int),
        scores: wp.array2d(dtype=wide),
        ranked: wp.array2d(dtype=int),
        support: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        status: wp.array(dtype=int),
    ):
        thread = wp.tid()
        row = first + thread
        # A pattern once published stays.
        if ready[0] != 0:
            return
        size = blocks.shape[1]
        most = support.shape[0]
        count = int(1)
        support[0, row] = row
        settle(lower, forward, thread, 0, wide(1.0))
        energy = solve(lower, forward, solution, thread, 1)
        growing = scale[row] != wide(0.0)
        while growing and count < most:
            wanted = wp.min(step_size, most - count)
            found = int(0)
            for s in range(count):
                places[s, thread] = 0
            column = int(-1)
            # The rows of the support side by side, column by column below the diagonal.
            while column < row:
                column = row
                for s in range(count):
                    r = support[s, row] // size
                    place = places[s, thread]
                    slot = starts[r] + place // size
                    if slot < ends[r]:
                        column = wp.min(column, columns[slot] * size + place % size)
                if column < row:
                    score = wide(0.0)
                    member = bool(False)
                    for s in range(count):
                        other = support[s, row]
                        place = places[s, thread]
                        slot = starts[other // size] + place // size
                        if slot < ends[other // size]:  # noqa: SIM102
                            if columns[slot] * size + place % size == column:
                                places[s, thread] = place + 1
                                usable = scale[other] != wide(0.0)
                                if usable and scale[column] != wide(0.0):
                                    value = wide(blocks[slot, other % size, place % size])
                                    value = value * scale[other] * scale[column]
                                    score += value * solution[s, thread]
                        if other == column:
                            member = True
                    score = wp.abs(score)
                    if not member and score > wide(0.0):
                        place = int(found)
                        shifting = bool(True)
                        while shifting and place > 0:
                            if scores[place - 1, thread] < score:
                                if place < wanted:
                                    scores[place, thread] = scores[place - 1, thread]
                                    ranked[place, thread] = ranked[place - 1, thread]
                                place -= 1
                            else:
                                shifting = False
                        if place < wanted:
                            scores[place, thread] = score
                            ranked[place, thread] = column
                            found = wp.min(found + 1, wanted)
            growing = found > 0
            for q in range(found):
                if growing:
                    new = ranked[q, thread]
                    pivot = join(
                        blocks,
                        starts,
                        ends,
                        columns,
                        scale,
                        support,
                        row,
                        lower,
                        thread,
                        count,
                        new,
                    )
                    if pivot > floor:
                        settle(lower, forward, thread, count, pivot)
                        support[count, row] = new
                        count += 1
                    else:
                        growing = False
                        wp.atomic_add(status, 1, 1)
            if growing:
                before = energy
                energy = solve(lower, forward, solution, thread, count)
                if tolerance > wide(0.0) and wide(1.0) - before / energy <= tolerance:
                    growing = False
        counts[row] = count

    return select
