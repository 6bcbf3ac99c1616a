"""Kernels that sum contributions into the values of blocks, for any shape of blocks.

One thread per number of a block. They are ordinary kernels, so tapes differentiate them.
"""

import functools

import warp as wp


def kernel_for(scalar):
    """Decorator of kernels for values of a type."""

    def decorate(function):
        name = f"sparse_{function.__name__}_{scalar.__name__}"
        return wp.kernel(function, name=name, module=__name__)

    return decorate


@functools.cache
def _sum_of_entries(scalar):
    """The sum of one number of several blocks."""

    @wp.func
    def sum_of_entries(
        source: wp.array3d(dtype=scalar),
        order: wp.array(dtype=int),
        begin: int,
        end: int,
        i: int,
        j: int,
    ) -> scalar:
        total = scalar(0.0)
        # A single contribution is copied, with the sign of a zero.
        if begin < end:
            total = source[order[begin], i, j]
        for entry in range(begin + 1, end):
            total += source[order[entry], i, j]
        return total

    return sum_of_entries


@functools.cache
def gather_kernel(scalar):
    """Sums of one array of blocks."""
    values = wp.array3d(dtype=scalar)
    sum_of_entries = _sum_of_entries(scalar)

    @kernel_for(scalar)
    def gather(
        source: values,
        order: wp.array(dtype=int),
        begins: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        dest: values,
    ):
        slot, i, j = wp.tid()
        dest[slot, i, j] = sum_of_entries(source, order, begins[slot], ends[slot], i, j)

    return gather


@functools.cache
def transpose_kernel(scalar):
    """The same, with rows and columns of blocks swapped and a factor."""
    values = wp.array3d(dtype=scalar)
    sum_of_entries = _sum_of_entries(scalar)

    @kernel_for(scalar)
    def gather_transposed(
        source: values,
        factor: scalar,
        order: wp.array(dtype=int),
        begins: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        dest: values,
    ):
        slot, i, j = wp.tid()
        total = sum_of_entries(source, order, begins[slot], ends[slot], j, i)
        dest[slot, i, j] = factor * total

    return gather_transposed


@functools.cache
def add_kernel(scalar):
    """Sums of two arrays of blocks with factors; numbers of the second follow the first's."""
    values = wp.array3d(dtype=scalar)

    @kernel_for(scalar)
    def gather_sum(
        x: values,
        alpha: scalar,
        x_count: int,
        y: values,
        beta: scalar,
        order: wp.array(dtype=int),
        begins: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        dest: values,
    ):
        slot, i, j = wp.tid()
        total = scalar(0.0)
        for entry in range(begins[slot], ends[slot]):
            number = order[entry]
            if number < x_count:
                total += alpha * x[number, i, j]
            else:
                total += beta * y[number - x_count, i, j]
        dest[slot, i, j] = total

    return gather_sum


@functools.cache
def scatter_kernel(scalar):
    """Adds every contribution to its block with an atomic operation."""
    values = wp.array3d(dtype=scalar)

    @kernel_for(scalar)
    def scatter(source: values, slots: wp.array(dtype=int), dest: values):
        number, i, j = wp.tid()
        if slots[number] >= 0:
            wp.atomic_add(dest, slots[number], i, j, source[number, i, j])

    return scatter


@functools.cache
def product_kernel(scalar, depth):
    """Sums of products of blocks, whose numbers are in `lefts` and `rights`, and of blocks of z."""
    values = wp.array3d(dtype=scalar)

    @wp.kernel(name=f"sparse_gather_products_{scalar.__name__}_{depth}", module=__name__)
    def gather_products(
        x: values,
        y: values,
        alpha: scalar,
        z: values,
        beta: scalar,
        products: int,
        lefts: wp.array(dtype=int),
        rights: wp.array(dtype=int),
        order: wp.array(dtype=int),
        begins: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        dest: values,
    ):
        slot, i, j = wp.tid()
        total = scalar(0.0)
        for entry in range(begins[slot], ends[slot]):
            number = order[entry]
            if number < products:
                left = lefts[number]
                right = rights[number]
                for k in range(depth):
                    total += alpha * (x[left, i, k] * y[right, k, j])
            else:
                total += beta * z[number - products, i, j]
        dest[slot, i, j] = total

    return gather_products


@functools.cache
def cast_kernel(source_type, target_type):
    """Blocks of another shape or type: the part of each contribution that lies in the block."""
    name = f"sparse_reshape_{source_type.__name__}_{target_type.__name__}"

    @wp.kernel(name=name, module=__name__)
    def reshape(
        source: wp.array3d(dtype=source_type),
        factor: target_type,
        source_rows: wp.array(dtype=int),
        source_columns: wp.array(dtype=int),
        pieces: int,
        dest_rows: wp.array(dtype=int),
        dest_columns: wp.array(dtype=int),
        order: wp.array(dtype=int),
        begins: wp.array(dtype=int),
        ends: wp.array(dtype=int),
        dest: wp.array3d(dtype=target_type),
    ):
        slot, i, j = wp.tid()
        total = target_type(0.0)
        for entry in range(begins[slot], ends[slot]):
            block = order[entry] // pieces
            row = dest_rows[slot] * dest.shape[1] + i - source_rows[block] * source.shape[1]
            column = (
                dest_columns[slot] * dest.shape[2] + j - source_columns[block] * source.shape[2]
            )
            inside = row >= 0 and row < source.shape[1]
            if inside and column >= 0 and column < source.shape[2]:
                total += factor * target_type(source[block, row, column])
        dest[slot, i, j] = total

    return reshape


def launch(kernel, dest, *inputs) -> None:
    """Runs a kernel for the numbers of all blocks of a matrix, its last argument."""
    rows, cols = dest.block_shape
    if dest.nnz:
        inputs = [*inputs, dest.scalar_values]
        wp.launch(kernel, (dest.nnz, rows, cols), inputs, device=dest.device)
