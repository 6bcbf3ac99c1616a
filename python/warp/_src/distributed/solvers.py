"""Sparse products and linear operators whose vectors have a part on each rank."""

from __future__ import annotations

import typing

import numpy as np

import warp as wp
from warp._src.distributed import exact as exact_sums
from warp._src.distributed.communicator import flat, resolve
from warp._src.distributed.failures import DistributedError, DistributedValueError
from warp._src.distributed.graphs import numbers_of
from warp._src.distributed.operations import _plan, _reduce, checked
from warp._src.distributed.plans import run_or_record
from warp._src.distributed.reductions import is_exact
from warp._src.optim.linear import operators
from warp._src.optim.linear.dots import Dots
from warp._src.types import dtypes
from warp.sparse import bsr_from_triplets
from warp.sparse import bsr_mv as multiply


class RankDots(Dots):
    """Inner products over all ranks; exact where the configuration asks for deterministic sums."""

    def __init__(self, comm, offsets, length, scalar, columns=1, result_type=wp.float64):
        super().__init__(offsets, length, scalar, columns, result_type)
        self.comm = comm
        self.exact = is_exact(None) and scalar in exact_sums.FORMATS
        common = f"of {scalar.__name__}{', exact' if self.exact else ''}"
        _plan(comm, ("dots", common), "dots", common)
        if self.exact:
            words = exact_sums.FORMATS[wp.float64]
            self.digits = wp.empty((columns, words), dtype=wp.int64, device=self.device)
            self.rounded = wp.empty(columns, dtype=wp.float64, device=self.device)

    def compute(self, a, b, first=0):
        columns = 1 if a.ndim == 1 else a.shape[0]
        if not self.exact:
            super().compute(a, b, first)
            self._sum_rows(first, columns)
            return
        rows = [(a, b)] if a.ndim == 1 else [(a[k], b[k]) for k in range(columns)]
        self._sum_exactly(rows, first)

    def compute_all(self, pairs):
        if self.exact:
            self._sum_exactly(pairs, 0)
            return
        for k, (a, b) in enumerate(pairs):
            super().compute(a, b, k)
        self._sum_rows(0, len(pairs))

    def compute_three(self, r, u, w):
        if self.exact:
            self._sum_exactly([(r, u), (w, u), (r, r)], 0)
            return
        super().compute_three(r, u, w)
        self._sum_rows(0, 3)

    def _sum_rows(self, first, columns) -> None:
        found = self.results[first : first + columns]
        run_or_record(self.comm, "dots", lambda: self._sum(found))

    def _sum_exactly(self, pairs, first) -> None:
        """One sum over ranks of the digits of all products, each of which is rounded once."""
        columns = len(pairs)
        digits = self.digits[:columns]
        digits.zero_()
        for k, pair in enumerate(pairs):
            exact_sums.add_digits(list(pair), digits[k])
        run_or_record(self.comm, "dots", lambda: self._sum(digits))
        for k in range(columns):
            table = digits[k].reshape((digits.shape[1], 1))
            target = self.rounded[k : k + 1]
            kernel = exact_sums._ROUND[wp.float64]
            wp.launch(kernel, 1, [table, target], device=self.device)
        found = self.results[first : first + columns]
        if found.dtype is wp.float64:
            wp.copy(found.flatten(), self.rounded[:columns])
        else:
            wp.utils.array_cast(self.rounded[:columns], found.flatten())

    def _sum(self, array) -> None:
        if self.comm.size > 1:
            self.comm.all_reduce(flat(array))


class LinearOperator(operators.LinearOperator):
    """A rank's part of a linear operator, for the solvers of `warp.optim.linear`.

    Args:
        A: a `Matrix`, an operator, or what `aslinearoperator` takes for a block of its own.
        rows: of the whole operator; by default summed over ranks.
        comm: by default that of the matrix, or of `wd.init`.

    Attributes:
        comm: ranks that have a part each.
        rows: of the whole operator.
        first: the first row of this rank, in the order of ranks.
    """

    def __init__(self, A, rows=None, comm=None):
        if isinstance(A, Matrix):
            shape, matvec, dtype = A.shape, A.matvec, A.scalar
            self.comm = A.graph.comm
        else:
            own = operators.aslinearoperator(A)
            if own.batch_offsets is not None:
                raise DistributedValueError(
                    "LinearOperator over ranks: expects one system, but got several batches"
                )
            shape, matvec, dtype = own.shape, own.matvec, own.dtype
            self.comm = resolve(comm)
        super().__init__(shape, dtype, self.comm.device, matvec)
        counts = np.zeros(self.comm.size, np.int64)
        counts[self.comm.rank] = shape[0]
        counts = self.comm.check_sum(counts)
        self.rows = int(counts.sum()) if rows is None else int(rows)
        self.first = int(counts[: self.comm.rank].sum())
        if isinstance(A, Matrix):
            # Preconditioners ask for it.
            self.diagonal = A.diagonal

    def make_dots(self, offsets, length, scalar, columns, result_type):
        """Inner products over all ranks."""
        return RankDots(self.comm, offsets, length, scalar, columns, result_type)

    def agree(self, broken) -> None:
        """Lets all ranks know of a breakdown on one."""
        if self.comm.size > 1:
            run_or_record(self.comm, "breakdown", lambda: _reduce(self.comm, broken, "max"))


class Matrix:
    """The rows of a sparse matrix that a rank owns.

    Rows that read own columns only are multiplied while the halo travels.

    Args:
        graph: of the pattern; the rank's rows are its own nodes.
        rows, columns, values: all entries, or those of own rows at least, by global numbers.
        dtype: of the values, by default float32.

    Attributes:
        shape: own rows of numbers, square: vectors of solvers have own values alone.
    """

    def __init__(self, graph, rows, columns, values, dtype: typing.Any = wp.float32):
        self.graph, comm = graph, graph.comm
        self.dtype = dtype
        self.scalar = getattr(dtype, "_wp_scalar_type_", dtype)
        who = f"rank {comm.rank}: Matrix"
        rows, columns = (numbers_of(who, one) for one in (rows, columns))
        values = np.asarray(values)
        if not rows.size == columns.size == len(values):
            raise DistributedValueError(
                f"{who} expects as many rows, columns and values, but got {rows.size}, "
                f"{columns.size} and {len(values)}"
            )
        beyond = (rows < 0) | (rows >= graph.count) | (columns < 0) | (columns >= graph.count)
        if beyond.any():
            k = int(beyond.argmax())
            raise DistributedValueError(
                f"{who} expects numbers of nodes from 0 to {graph.count - 1}, but its entry {k} is "
                f"in row {rows[k]} and column {columns[k]}"
            )
        own = graph.owners[rows] == comm.rank
        rows, columns, values = rows[own], columns[own], values[own]
        at = graph.local_of(columns)
        if (at < 0).any():
            missing = int(columns[at < 0][0])
            raise DistributedError(
                f"rank {comm.rank}: Matrix: column {missing} is no neighbour in its graph: make "
                "the graph of the same rows and columns"
            )
        local = graph.local_of(rows) - graph.first
        ghost = (at < graph.first) | (at >= graph.first + graph.owned)
        reads = np.zeros(graph.owned, bool)
        np.logical_or.at(reads, local, ghost)
        self.parts = []
        for chosen in (~reads[local], reads[local]):
            index = [
                wp.array(one[chosen].astype(np.int32), dtype=int, device=comm.device)
                for one in (local, at)
            ]
            data = wp.array(values[chosen], dtype=dtype, device=comm.device)
            self.parts.append(bsr_from_triplets(graph.owned, graph.local, *index, data))
        block = getattr(dtype, "_shape_", ()) or (1, 1)
        self.block = block
        self.shape = (graph.owned * block[0], graph.owned * block[1])
        kind = self.scalar if block == (1, 1) else wp.types.vector(block[1], self.scalar)
        self.x = graph.zeros(kind)
        self.kind = kind

    def csr(self):
        """Own rows as NumPy arrays, for other libraries.

        Returns:
            Offsets of rows, int32 (owned + 1,); columns by local numbers of the graph, in rising
            order in each row; and values, numbers or blocks.
        """
        rows, columns, values = [], [], []
        for part in self.parts:
            count = part.nnz_sync()
            rows.append(np.repeat(np.arange(self.graph.owned), np.diff(part.offsets.numpy())))
            columns.append(part.columns.numpy()[:count])
            values.append(part.values.numpy()[:count])
        row, column, value = (np.concatenate(one) for one in (rows, columns, values))
        order = np.lexsort((column, row))
        offsets = np.r_[0, np.cumsum(np.bincount(row, minlength=self.graph.owned))]
        return offsets.astype(np.int32), column[order], value[order]

    def diagonal(self):
        """The diagonal of own rows of numbers, one dimension."""
        offsets, columns, values = self.csr()
        row = np.repeat(np.arange(self.graph.owned), np.diff(offsets))
        blocks = np.zeros((self.graph.owned, *self.block), values.dtype)
        here = columns == row + self.graph.first
        blocks[row[here]] = values[here].reshape(-1, *self.block)
        numbers = np.ascontiguousarray(np.diagonal(blocks, axis1=1, axis2=2)).reshape(-1)
        return wp.array(numbers, dtype=self.scalar, device=self.graph.comm.device)

    def matvec(self, x, y, z, alpha, beta) -> None:
        """Sets `z` to `alpha * A x + beta * y`, vectors of own values."""
        wp.copy(self.graph.inner(self.x), _as(x, self.kind))
        z_own = _as(z, self.kind)
        if beta != 0.0 and y.ptr != z.ptr:
            wp.copy(z_own, _as(y, self.kind))
        travelling = self.graph.overlap(self.x)
        multiply(self.parts[0], self.x, z_own, alpha, beta)
        travelling.finish()
        multiply(self.parts[1], self.x, z_own, alpha, 1.0)


def _as(vector, kind):
    """A packed vector as one of another element type of the same numbers."""
    if vector.dtype is kind:
        return vector
    packed = operators.numbers(vector)
    size = dtypes.type_size_in_bytes(kind)
    return packed._view(0, (packed.size * packed.item_size // size,), (size,), kind)


def bsr_mv(A, x, y=None, alpha=1.0, beta=0.0):
    """`alpha * A x + beta * y` of a `Matrix`, vectors of own values; gives `y`."""
    if not isinstance(A, Matrix):
        raise DistributedError(
            f"wd.bsr_mv expects a `wd.Matrix`, but got '{type(A).__name__}': make one of a graph"
        )
    comm, bytes_ = A.graph.comm, A.shape[0] * dtypes.type_size_in_bytes(A.scalar)
    for name, one in (("x", x), *((("y", y),) if y is not None else ())):
        checked(comm, f"bsr_mv, {name}", one)
        if one.size * one.item_size != bytes_:
            raise DistributedValueError(
                f"rank {comm.rank}: bsr_mv, {name} expects {A.shape[0]} numbers of own rows, of "
                f"type {A.scalar.__name__}, but got {one!r}"
            )
    if y is None:
        y = wp.zeros(A.graph.owned, dtype=A.kind, device=x.device)
    A.matvec(x, y, y, alpha, beta)
    return y
