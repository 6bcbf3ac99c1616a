"""Gather - sums of element contributions in element order, without atomics.

A plan kernel writes the blocks of a batch of elements to scratch memory; a thread per target
(a nonzero of a matrix, a node of a vector) then adds its contributions in element order. The bits
do not depend on threads. A batch has at most 64 MiB of blocks.
"""

import functools

import warp as wp
from warp import extend
from warp._src.fem.assembly.pattern import Batch
from warp._src.fem.types import Ints


@functools.cache
def _gather_kernel(block, wide, out, index, is_scattered: bool, has_heads, has_carries: bool):
    """Sums contributions of type `block` as `wide` into values of type `out`."""

    def gather(
        blocks: wp.array(dtype=block),
        begins: Ints,
        entries: wp.array(dtype=index),
        heads: wp.array(dtype=index),
        targets: Ints,
        carries: Ints,
        sums: wp.array(dtype=wide),
        adds: int,
        values: wp.array(dtype=out),
    ):
        k = wp.tid()
        begin, end = begins[k], begins[k + 1]
        target = k
        if wp.static(is_scattered):
            target = targets[k]
        total = wide()
        if adds != 0:
            total = wide(values[target])
        carry = int(-1)
        if wp.static(has_carries):
            carry = carries[k]
            if carry >= 0:
                total += sums[carry]
        if wp.static(has_heads):
            total += wide(blocks[int(heads[k])])
            begin += 1
        for at in range(begin, end):
            total += wide(blocks[int(entries[at])])
        if wp.static(has_carries):
            if carry >= 0:
                sums[carry] = total
        values[target] = out(total)

    return wp.kernel(gather, enable_backward=False)


@functools.cache
def _scatter_kernel(block, out, is_scattered: bool):
    """Copies the adjoint of each value to its contributions."""

    def scatter(
        adjoints: wp.array(dtype=out),
        begins: Ints,
        entries: Ints,
        targets: Ints,
        block_adjoints: wp.array(dtype=block),
    ):
        k = wp.tid()
        target = k
        if wp.static(is_scattered):
            target = targets[k]
        adjoint = block(adjoints[target])
        for at in range(begins[k], begins[k + 1]):
            block_adjoints[entries[at]] = adjoint

    return wp.kernel(scatter, enable_backward=False)


@functools.cache
def with_scalar(dtype, scalar):
    """The type of as many numbers of another scalar type."""
    if extend.type_is_matrix(dtype):
        return wp.types.matrix(shape=dtype._shape_, dtype=scalar)
    if extend.type_is_vector(dtype):
        return wp.types.vector(length=dtype._length_, dtype=scalar)
    return scalar


def wide_type(blocks, accumulate=wp.float64):
    """The type of the sums of blocks in a scalar type."""
    return with_scalar(extend.canonical(blocks.dtype), accumulate)


def add_blocks(
    batch: Batch, blocks, values, adds: bool, accumulate=wp.float64, sums=None, width: int = 0
) -> None:
    """Sums the blocks of a batch into values.

    Args:
        batch: the batch.
        blocks: contributions, of one dimension: by element, local row, local column.
        width: number of blocks of an element if `blocks` has those of one element, which are those
            of all; else 0.
        values: one element per target.
        adds: if the values are added to; set otherwise.
        accumulate: scalar type of sums.
        sums: of targets that several batches add to, zero before the first one, so that results
            are rounded once whatever the batches are.
    """
    wide = wide_type(blocks, accumulate)
    entries, heads = batch.places(width) if width else (batch.entries, batch.heads)
    targets, carries = batch.targets, batch.carries if sums is not None else None
    given = (one is not None for one in (targets, heads, carries))
    kernel = _gather_kernel(blocks.dtype, wide, values.dtype, entries.dtype, *given)
    inputs = [blocks, batch.begins, entries, heads, targets, carries, sums]
    wp.launch(kernel, batch.target_count, [*inputs, int(adds), values], device=values.device)


def spread_adjoint(batch: Batch, adjoints, block_adjoints) -> None:
    """Sets the adjoints of a batch's blocks from those of the values: transpose of `add_blocks`."""
    kernel = _scatter_kernel(block_adjoints.dtype, adjoints.dtype, batch.targets is not None)
    inputs = [adjoints, batch.begins, batch.entries, batch.targets, block_adjoints]
    wp.launch(kernel, batch.target_count, inputs, device=adjoints.device)
