"""Matrices - values of bilinear forms, gathered into a pattern that is made once.

A form has `test` and `trial` fields with `space_partition`, a `domain`, a `device`, the type
`block_dtype` of its element blocks, tables of nodes and `blocks(first, count, array)`, which
writes the blocks of a range of elements.
"""

from __future__ import annotations

import warp as wp
from warp import extend
from warp._src.fem.assembly.gather import add_blocks, spread_adjoint, wide_type, with_scalar
from warp._src.fem.assembly.pattern import Pattern
from warp._src.fem.geometry.base import PerDevice
from warp._src.fem.temporaries import borrow_temporary
from warp._src.fem.types import Ints
from warp.sparse import bsr_assign, bsr_axpy, bsr_compress, bsr_set_zero, bsr_zeros

_CONSTRUCTIONS = ("auto", "triplets", "row_compress", "mapped", "mapped_atomic")
_TOPOLOGIES = ("compact", "masked", "padded")


class Options:
    """How a sparse matrix is filled; every construction gives the same bits.

    Attributes:
        capacity: "auto", or "reuse": nothing is allocated, `output` has to have room.
        topology: "compact", "masked" (the blocks that `output` has) or "padded".
        prune: drops blocks of zeros.
    """

    def __init__(self, bsr_options, has_output: bool, adds: bool):
        options = dict(bsr_options or {})
        self.capacity = _choice(options, "capacity", ("auto", "reuse"))
        self.construction = _choice(options, "construction", _CONSTRUCTIONS)
        self.topology = _choice(options, "topology", _TOPOLOGIES)
        self.prune = bool(options.pop("prune_numerical_zeros", False))
        self.rest = options
        if self.prune and self.construction.startswith("mapped"):
            raise ValueError(
                f"bsr_options 'construction'={self.construction!r}: Mapped FEM assembly requires "
                "'prune_numerical_zeros'=False"
            )
        unknown = options.keys() - {"row_capacity", "nnz_capacity", "masked"}
        if options.pop("masked", False):
            self.topology = "masked"
        if unknown:
            raise ValueError(
                f"'bsr_options' has no option {sorted(unknown)[0]!r}; there are 'capacity', "
                "'construction', 'prune_numerical_zeros' and 'topology'"
            )
        if self.capacity == "reuse" and adds:
            raise RuntimeError("bsr_options 'capacity'='reuse' cannot be combined with add=True")
        if self.capacity == "reuse" and not has_output:
            raise RuntimeError("bsr_options 'capacity'='reuse' requires an 'output' matrix")
        if self.topology == "masked" and not has_output:
            raise ValueError("bsr_options 'topology'='masked' requires an 'output' matrix")
        if self.construction.startswith("mapped") and self.topology != "compact":
            raise ValueError(
                f"bsr_options 'construction'={self.construction!r}: Mapped FEM assembly requires "
                f"'topology'='compact', but got {self.topology!r}"
            )


def _choice(options, name, choices):
    value = options.pop(name, choices[0])
    if value not in choices:
        expected = ", ".join(map(repr, choices))
        raise ValueError(f"bsr_options {name!r} expects one of {expected}, but got {value!r}")
    return value


def _kept_patterns(form, fields) -> dict:
    """The cache of a form's patterns; an empty dictionary for one that may change unseen.

    Patterns of whole spaces on whole static geometries are kept by the topology of the test
    function, those of other domains and partitions by its restriction until that is rebuilt.
    Points of quadratures move without notice, so bases at them keep nothing.
    """
    topologies = [field.space_partition.space_topology for field in fields]
    records = [getattr(topology, "record", None) for topology in topologies]
    if any(getattr(record, "quadrature", None) is not None for record in records):
        return {}
    restriction = getattr(form.test, "space_restriction", None)
    is_whole = restriction is None or (
        form.domain.is_whole and all(f.space_partition.record.is_whole for f in fields)
    )
    owner = vars(topologies[0]) if is_whole else restriction._kept
    return owner.setdefault("patterns", PerDevice())


def kept_pattern(form, fields, make):
    """The pattern that `make` finds, given the size of a block: made once for the partitions of
    fields and a domain, until nodes are numbered anew."""
    kept, partitions = _kept_patterns(form, fields), [field.space_partition for field in fields]
    size = wp.types.type_size_in_bytes(form.block_dtype)
    revisions = tuple(getattr(p.space_topology, "revision", 0) for p in partitions)
    key = (*partitions, form.domain, form.device.alias, size)
    found = kept.get(key)
    if found is None or found[0] != revisions:
        with extend.unrecorded():
            found = (revisions, make(size))
        # A pattern that a graph finds belongs to the graph.
        if not form.device.is_capturing:
            kept[key] = found
    return found[1]


def pattern_of(form) -> Pattern:
    """The pattern of a bilinear form."""
    fields = form.test, form.trial

    def make(size):
        tables = form.test_table(form.device), form.trial_table(form.device)
        return Pattern(*tables, *(f.space_partition.node_count() for f in fields), size)

    return kept_pattern(form, fields, make)


def _check_output(output, pattern, block) -> None:
    if (output.nrow, output.ncol) != pattern.shape:
        raise RuntimeError(
            f"'output' expects {pattern.row_count} rows and {pattern.column_count} columns of "
            f"blocks, but got {output.nrow} and {output.ncol}"
        )
    shape = getattr(block, "_shape_", ()) or (1, 1)
    if output.block_shape != shape:
        raise RuntimeError(
            f"'output' expects blocks of shape {shape}, but got {output.block_shape}"
        )


def assemble_matrix(
    form,
    output=None,
    output_dtype=None,
    accumulate_dtype=wp.float64,
    add=False,
    bsr_options=None,
    temporary_store=None,
):
    """The matrix of a bilinear form.

    Args:
        form: the form.
        output: matrix to set or add to.
        output_dtype: scalar type of a new matrix, by default that of the form.
        accumulate_dtype: scalar type of sums over elements.
        add: if the result is added to `output`.
        bsr_options: see `Options`.
        temporary_store: where element blocks come from.
    """
    options = Options(bsr_options, output is not None, add)
    if output is not None:
        output_dtype = output.scalar_type
    scalar = extend.canonical(output_dtype or extend.type_scalar_type(form.block_dtype))
    block = with_scalar(form.block_dtype, scalar)
    pattern = pattern_of(form)
    if output is not None:
        _check_output(output, pattern, block)
    target = output
    is_direct = options.topology == "compact" and not add
    if output is None or not is_direct:
        target = bsr_zeros(*pattern.shape, block, device=form.device)
        wants = getattr(form, "requires_grad", False) and extend.is_recording()
        target.values.requires_grad = wants or (output is not None and output.requires_grad)
    set_structure(target, pattern, options)
    fill(form, pattern, target.values, accumulate_dtype, temporary_store)
    # Functions of points are zero at the other points of a cell.
    is_of_points = all(_is_of_points(field) for field in (form.test, form.trial))
    if options.prune or (is_of_points and not options.construction.startswith("mapped")):
        bsr_compress(target, prune_numerical_zeros=True)
    if add:
        bsr_axpy(x=target, y=output, topology=options.topology)
        return output
    if options.topology == "masked":
        bsr_assign(dest=output, src=target, topology="masked")
        return output
    if options.topology == "padded":
        return padded(target, output, options)
    return target


def _is_of_points(field) -> bool:
    record = getattr(getattr(field, "space", None), "record", None)
    return record is not None and record.element is None


def padded(source, output, options, room_of=None):
    """The matrix with room in its rows: that of `room_of`, a matrix or pattern; by default the room
    that rows of `output` have, or else that of `source`."""
    if output is None:
        output = bsr_zeros(source.nrow, source.ncol, source.dtype, device=source.device)
        output.values.requires_grad = source.requires_grad
    if output.row_counts is None or room_of is not None:
        of = room_of or source
        counts = wp.empty(source.nrow, dtype=int, device=source.device)
        wp.launch(_row_sizes, source.nrow, [of.offsets, counts], device=source.device)
        room = options.rest or {"row_capacity": counts, "nnz_capacity": of.nnz}
        bsr_set_zero(output, topology="padded", **room)
    bsr_assign(dest=output, src=source, topology="padded")
    return output


@wp.kernel(enable_backward=False)
def _row_sizes(offsets: Ints, sizes: Ints):
    r = wp.tid()
    sizes[r] = offsets[r + 1] - offsets[r]


def set_structure(matrix, pattern, options) -> None:
    """Copies the pattern: later operations may change the matrix in place."""
    nnz = pattern.nnz
    is_direct = options.topology == "compact"
    room = min(matrix.columns.size, matrix.values.size)
    if options.capacity == "reuse" and is_direct and room < nnz:
        raise RuntimeError(
            f"bsr_options 'capacity'='reuse' expects room for {nnz} blocks, but 'output' has "
            f"room for {room}"
        )
    with extend.unrecorded():
        matrix.row_counts = None
        wp.copy(matrix.offsets, pattern.offsets)
        matrix.notify_nnz_changed(nnz=nnz)
        wp.copy(matrix.columns, pattern.columns, count=nnz)


def fill(form, pattern, values, accumulate_dtype=wp.float64, temporary_store=None) -> None:
    """Sets values of a pattern from the blocks of elements, batch by batch.

    Args:
        form: the form.
        pattern: with `batches` and `width`, the number of blocks of an element.
        values: one element per target.
        accumulate_dtype: scalar type of sums.
        temporary_store: where element blocks come from.
    """
    is_recorded = extend.is_recording() and values.requires_grad
    # One block stands for all where elements do not differ.
    repeats = not is_recorded and getattr(form, "repeats", False)
    most = 1 if repeats else max((batch.count for batch in pattern.batches), default=0)
    shared = sums = None
    # Batches of vectors have all nodes as targets.
    adds = len(pattern.batches) > 1 and pattern.batches[0].targets is None
    if adds:
        with extend.unrecorded():
            values.zero_()
    for number, batch in enumerate(pattern.batches):
        if shared is None or is_recorded:
            shared = borrow_temporary(
                temporary_store,
                most * pattern.width,
                form.block_dtype,
                device=form.device,
                requires_grad=is_recorded,
            )
        count = min(batch.count, most)
        blocks = shared[: count * pattern.width]
        if number == 0 or not repeats:
            form.blocks(batch.first, count, blocks)
        if is_recorded:
            _record(batch, blocks, values, number == 0)
        with extend.unrecorded():
            if sums is None and batch.carries is not None:
                wide = wide_type(blocks, accumulate_dtype)
                sums = wp.zeros(pattern.carry_count, dtype=wide, device=form.device)
            width = pattern.width if repeats else 0
            add_blocks(batch, blocks, values, adds, accumulate_dtype, sums, width)
    if shared is not None and not is_recorded:
        shared.release()


def _record(batch, blocks, values, is_first) -> None:
    def backward():
        spread_adjoint(batch, values.grad, blocks.grad)
        # The values before were overwritten: they have no gradient.
        if is_first:
            values.grad.zero_()

    extend.record_adjoint(backward, [blocks, values])
