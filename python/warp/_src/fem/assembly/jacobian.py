"""Jacobians of interpolation - the matrix of values at points or nodes by a trial function."""

from __future__ import annotations

import functools

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.assembly.gather import with_scalar
from warp._src.fem.assembly.matrix import Options, fill, padded, set_structure
from warp._src.fem.assembly.pattern import Pattern
from warp._src.fem.forms.jacobian import JacobianPlan
from warp._src.fem.types import IntTable
from warp.sparse import bsr_assign, bsr_compress, bsr_zeros

_LINEAR = ("weighted_average", "mean", "sum", "first")


def interpolate_jacobian(form, place, dest, reduction, bsr_options) -> None:
    """Sets a matrix to the derivative of interpolated values by the trial function.

    Raises:
        ValueError: the reduction is not linear, or the matrix has another size.
    """
    if place.restriction is None and place.quadrature is None:
        raise ValueError("a 'BsrMatrix' as 'dest' expects a quadrature, or a space with nodes")
    if place.restriction is not None and reduction not in _LINEAR:
        raise ValueError(
            f"'reduction' expects one of {_LINEAR} for a matrix, but got {reduction!r}"
        )
    rows = Rows(form, place, reduction)
    options = Options(bsr_options, True, False)
    columns = form.trial.space_partition.node_count()
    if (dest.nrow, dest.ncol) != (rows.count, columns):
        raise RuntimeError(
            f"'dest' matrix must have {rows.count} rows and {columns} columns of blocks, but has "
            f"{dest.nrow} and {dest.ncol}"
        )
    block = rows.block_dtype
    shape = getattr(block, "_shape_", ()) or (1, 1)
    if dest.block_shape != shape:
        raise RuntimeError(f"'dest' expects blocks of shape {shape}, but has {dest.block_shape}")
    size = wp.types.type_size_in_bytes(block)
    pattern = Pattern(rows.table, form.trial_table(), rows.count, columns, size)
    target, wants = dest, dest.requires_grad
    if options.topology != "compact":
        scalar = extend.canonical(dest.scalar_type)
        target = bsr_zeros(rows.count, columns, with_scalar(block, scalar), device=form.device)
    keeps_room = options.capacity == "reuse"
    if target is not dest:
        options.capacity = "auto"
    set_structure(target, pattern, options)
    if wants and not target.requires_grad:
        target.values.requires_grad = True
    fill(rows, pattern, target.values)
    if options.prune or not (keeps_room or wants):
        bsr_compress(target, prune_numerical_zeros=True)
    if options.topology == "padded":
        # Rows of another restriction need room of their own.
        padded(target, dest, options, pattern)
    elif target is not dest:
        bsr_assign(dest=dest, src=target, topology=options.topology)


@functools.cache
def _kernel_of_unused(real):
    def drop_unused(factors: wp.array2d(dtype=real), table: IntTable):
        e, i = wp.tid()
        if factors[e, i] == real(0.0):
            table[e, i] = -1

    return wp.kernel(drop_unused, enable_backward=False)


class Rows:
    """The rows of a Jacobian, as a form that writes blocks.

    Attributes:
        table: number of the row of each point or node of each element, -1 for none.
        count: number of rows. block_dtype: type of a block.
    """

    def __init__(self, form, place, reduction):
        self.form, self.device = form, form.device
        self.plan = JacobianPlan.of(form.record, place.restriction and place.node_record)
        self.block_dtype = self.plan.block_dtype
        self.topology = self.factors = 0
        elements = form.domain.element_count()
        if place.restriction is not None:
            restriction = place.restriction
            self.table = restriction.element_table(self.device)
            self.count = restriction.space_partition.node_count()
            self.topology = restriction.space_topology.topo_arg_value(self.device)
            self.factors = self._factors(form, restriction, reduction)
            if reduction == "first":
                # Other elements of a node have no entries.
                self.table = wp.clone(self.table)
                kernel, inputs = _kernel_of_unused(self.factors.dtype), [self.factors, self.table]
                wp.launch(kernel, self.table.shape, inputs, device=self.device)
            return
        points = place.quadrature.points_per_element
        if points is None:
            raise ValueError("a 'BsrMatrix' as 'dest' expects as many points in each element")
        numbers = np.arange(elements * points, dtype=np.int32).reshape(elements, points)
        self.table = wp.array(numbers, dtype=wp.int32, device=self.device)
        self.count = elements * points
        self.factors = wp.ones((elements, points), dtype=form.record.scalar, device=self.device)

    def _factors(self, form, restriction, reduction):
        """Weight of the value of each element at each of its nodes."""
        incidence, width = restriction.incidence, self.table.shape[1]
        factors = wp.zeros(self.table.shape, dtype=form.record.scalar, device=self.device)
        kernel = self.plan.factors(reduction)
        inputs = [
            incidence.begins,
            incidence.positions,
            width,
            self.topology,
            *form.arguments(self.plan),
        ]
        wp.launch(kernel, incidence.begins.shape[0] - 1, inputs, [factors], device=self.device)
        return factors

    def blocks(self, first, count, blocks) -> None:
        """Writes the blocks of elements [first, first + count)."""
        inputs = [first, self.topology, self.factors, *self.form.arguments(self.plan)]
        shape = count, self.table.shape[1]
        wp.launch(self.plan.blocks, shape, inputs, [blocks], device=self.device)
