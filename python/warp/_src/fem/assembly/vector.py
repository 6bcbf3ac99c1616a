"""Vectors - values of linear forms by node in element order, and diagonal matrices of forms."""

from __future__ import annotations

import dataclasses

import warp as wp
from warp import extend
from warp._src.fem.assembly.gather import with_scalar
from warp._src.fem.assembly.matrix import fill, kept_pattern
from warp._src.fem.assembly.pattern import Batch, node_batches
from warp._src.fem.linalg import array_axpy
from warp.sparse import bsr_axpy, bsr_diag


@dataclasses.dataclass
class NodePattern:
    """Contributions to nodes: `batches` of elements with `width` nodes."""

    batches: list[Batch]
    width: int
    node_count: int


def node_pattern_of(form) -> NodePattern:
    """The pattern of a linear form."""
    count = form.test.space_partition.node_count()

    def make(size):
        table = form.test_table(form.device)
        return NodePattern(node_batches(table, count, size), table.shape[1], count)

    return kept_pattern(form, (form.test,), make)


def as_vector(output, block, count: int):
    """A view of an output with an element for each node.

    Args:
        output: blocks, or their numbers in one or two dimensions; at least those of the nodes.
        block: type of a node's value.
        count: number of nodes.
    """
    size = extend.type_size(block)
    if extend.type_size(output.dtype) == 1 and (size > 1 or output.ndim > 1):
        output = _grouped(output, block, count, size)
    if output.ndim != 1 or extend.type_size(output.dtype) != size:
        raise RuntimeError(
            f"'output' expects a one-dimensional array of elements of {size} numbers, but got one "
            f"of {output.ndim} dimensions of '{extend.type_repr(output.dtype)}'"
        )
    if output.shape[0] < count:
        raise RuntimeError(
            f"'output' must have at least {count} entries, but got {output.shape[0]}"
        )
    return output[:count] if output.shape[0] > count else output


def _grouped(output, block, count, size):
    """Numbers as blocks."""
    if output.ndim > 2:
        raise RuntimeError(
            f"'output' of numbers must be one- or two-dimensional, but has {output.ndim} dimensions"
        )
    if not output.is_contiguous:
        raise RuntimeError("'output' of numbers must be contiguous")
    if output.ndim == 2 and output.shape[1] != size:
        raise RuntimeError(
            f"'output': its last dimension must be of size {size}, but is {output.shape[1]}"
        )
    if output.ndim == 1:
        if output.shape[0] < count * size:
            raise RuntimeError(
                f"'output' must have at least {count * size} entries, but got {output.shape[0]}"
            )
        output = output[: output.shape[0] // size * size].reshape((-1, size))
    if size == 1:
        return output.flatten()
    return output.view(with_scalar(block, extend.canonical(output.dtype)))


def assemble_vector(
    form, output, accumulate_dtype=wp.float64, add=False, temporary_store=None
) -> None:
    """Sets or adds the vector of a linear form.

    Args:
        form: the form; `blocks(first, count, array)` writes a value per element and local node.
        output: one element of as many numbers as `form.block_dtype` has, for each node.
        accumulate_dtype: scalar type of sums over elements.
        add: if the result is added to `output`.
        temporary_store: where element vectors come from.
    """
    pattern = node_pattern_of(form)
    if output.shape != (pattern.node_count,):
        raise RuntimeError(
            f"'output' expects shape ({pattern.node_count},), but got {output.shape}"
        )
    if extend.type_size(output.dtype) != extend.type_size(form.block_dtype):
        raise RuntimeError(
            f"'output' expects elements of {extend.type_size(form.block_dtype)} numbers, but got "
            f"{extend.type_repr(output.dtype)}"
        )
    target = wp.empty_like(output) if add else output
    if not pattern.batches:
        target.zero_()
    fill(form, pattern, target, accumulate_dtype, temporary_store)
    if add:
        array_axpy(x=target, y=output)


def assemble_diagonal(form, output, output_dtype, accumulate_dtype=wp.float64, add=False):
    """The diagonal matrix of a form at the nodes of its test function.

    Raises:
        ValueError: test and trial function have different nodes.
    """
    rows, columns = form.test.space_partition, form.trial.space_partition
    if rows.space_topology != columns.space_topology or rows.node_count() != columns.node_count():
        raise ValueError(
            "assembly='nodal' expects test and trial functions with the same nodes, but got "
            f"'{form.test.space.name}' and '{form.trial.space.name}'"
        )
    scalar = output_dtype or extend.type_scalar_type(form.block_dtype)
    if output is not None:
        scalar = output.scalar_type
    block = with_scalar(form.block_dtype, extend.canonical(scalar))
    wants = form.requires_grad and extend.is_recording()
    values = wp.empty(rows.node_count(), dtype=block, device=form.device, requires_grad=wants)
    assemble_vector(form, values, accumulate_dtype)
    diagonal = bsr_diag(values)
    if output is None:
        return diagonal
    bsr_axpy(x=diagonal, y=output, beta=1.0 if add else 0.0)
    return output
