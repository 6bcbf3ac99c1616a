"""Diagonal matrices - bilinear forms evaluated at nodes, one block per node."""

from __future__ import annotations

import warp as wp
from warp import extend
from warp._src.fem.assembly.gather import with_scalar
from warp._src.fem.assembly.vector import assemble_vector
from warp.sparse import bsr_axpy, bsr_diag


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
