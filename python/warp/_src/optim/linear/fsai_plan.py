"""Sparse approximate inverses on the device: finds supports, computes, publishes."""

from __future__ import annotations

import warp as wp
from warp._src.optim.linear import fsai_kernels, fsai_pattern
from warp._src.optim.linear.fsai_select import select_kernel
from warp.sparse import bsr_matrix_t

# Numbers in the triangles of all threads of a launch together.
_ROOM = 1 << 24


class Plan:
    """The memory and the launches of a factor. A launch is for all rows, or a chunk of them.

    Args:
        A: the matrix.
        wide, stored: types to compute in and of the factor.
        most, step_size, tolerance, floor: `max_row_size`, `max_step_size`, `kap_tolerance` and
            `pivot_floor`.
        kept: the plan outlives the construction, and has the topology of the matrix as its own,
            so that no later matrix leads out of bounds.

    Attributes:
        G, GT: the factors, once `make_factors` or `start_as_identity` has been called.
        status: places that differ, diagonals of no use, rows that failed, rows regularized.
        ready: whether there are supports.
        search: unused, rows that a pivot stopped, rows that failed, of the last search.
    """

    def __init__(self, A, wide, stored, most, step_size, tolerance, floor, kept):
        n = self.size = A.shape[0]
        m = self.most = min(most, max(1, n))
        self.device, self.scalar, self.wide, self.stored = A.device, A.scalar_type, wide, stored
        self.step_size, self.tolerance, self.floor = min(step_size, m), tolerance, floor
        self.status, self.search, self.ready = (self._integers(k) for k in (4, 3, 1))
        self.support, self.counts = self._integers(m, n), self._integers(n)
        self.counts.fill_(1)
        self.keys, self.places = self._integers(n * m), self._integers(n * m)
        self.pairs = [self._integers(2 * n * m) for _ in range(2)]
        self.scale = self._numbers(n)
        triangle = m * (m + 1) // 2
        self.chunk = max(1, min(n, max(1024, _ROOM // triangle)))
        self.room = [self._numbers(rows, self.chunk) for rows in (triangle, m, m)]
        self.choice = [
            self._integers(m, self.chunk),
            self._numbers(self.step_size, self.chunk),
            self._integers(self.step_size, self.chunk),
        ]
        self.blocks, self.starts, self.columns = None, A.offsets, A.columns
        if kept:
            self.blocks = A.nnz_sync()
            self.starts = wp.clone(A.offsets)
            self.columns = wp.clone(A.columns[: self.blocks])
        self.ends = self.starts[1 : A.nrow + 1] if A.row_counts is None else A._row_ends()

    def _integers(self, *shape):
        return wp.zeros(shape, dtype=int, device=self.device)

    def _numbers(self, *shape):
        return wp.empty(shape, dtype=self.wide, device=self.device)

    def _launch(self, kernel, dim, inputs) -> None:
        wp.launch(kernel, dim, inputs, device=self.device)

    def _launch_chunks(self, kernel, inputs_from) -> None:
        for first in range(0, self.size, self.chunk):
            self._launch(kernel, min(self.chunk, self.size - first), inputs_from(first))

    def _matrix(self, blocks) -> list:
        return [blocks, self.starts, self.ends, self.columns, self.scale]

    # Storage of the factors.

    def _new_factor(self, capacity, offsets):
        factor = bsr_matrix_t(self.stored)(self.stored, self.size, self.size, self.device)
        factor.notify_nnz_changed(nnz=capacity)
        factor.offsets = offsets
        return factor

    def _set_factors(self, capacity, offsets, transposed_offsets) -> None:
        self.G = self._new_factor(capacity, offsets)
        self.GT = self._new_factor(capacity, transposed_offsets)
        self.sources = self._integers(capacity)
        self.sources.fill_(-1)
        self.values = wp.empty(capacity, dtype=self.stored, device=self.device)

    def start_as_identity(self) -> None:
        """Makes factors with room for any supports."""
        n, m = self.size, self.most
        rows = wp.array(range(n + 1), dtype=int, device=self.device)
        self._set_factors(n * m, rows * m, rows)
        self.G.row_counts = wp.full(n, 1, dtype=int, device=self.device)
        for factor, step in ((self.G, m), (self.GT, 1)):
            factor.columns.zero_()
            factor.values.zero_()
            if n:
                wp.copy(factor.columns[::step][:n], rows[:n])
                factor.values[::step][:n].fill_(1.0)

    def make_factors(self) -> None:
        """Makes factors that fit the supports."""
        offsets = self._integers(self.size + 1)
        count = 0
        if self.size:
            wp.copy(offsets, self.counts, dest_offset=1, count=self.size)
            wp.utils.array_scan(offsets, offsets)
            count = int(offsets[self.size :].numpy()[0])
        self._set_factors(count, offsets, wp.empty_like(offsets))

    # The steps of a construction or an update, all of which a graph can hold.

    def compare(self, A) -> None:
        """Counts the places of blocks that differ from those of the first matrix."""
        kernel = fsai_pattern.compare_topology
        inputs = [self.starts, A.offsets, self.status]
        self._launch(kernel, self.starts.size, inputs)
        count = min(self.blocks, A.columns.size)
        self._launch(kernel, count, [self.columns, A.columns, self.status])

    def set_scale(self, blocks) -> None:
        """Scales the diagonal to ones, and counts where that cannot be done."""
        kernel = fsai_kernels.scale_kernel(self.scalar, self.wide)
        self._launch(kernel, self.size, [*self._matrix(blocks), self.status])

    def select(self, blocks) -> None:
        """Finds supports, unless there are some."""
        kernel = select_kernel(self.scalar, self.wide)
        self._launch(fsai_pattern.clear_pattern, 1, [self.ready, self.search])
        options = [self.step_size, self.tolerance, self.floor, self.ready]
        rest = [*options, *self.room, *self.choice, self.support, self.counts, self.search]
        self._launch_chunks(kernel, lambda first: [*self._matrix(blocks), first, *rest])
        inputs = [self.support, self.counts, self.keys, self.places]
        self._launch(fsai_pattern.list_entries, (self.size, self.most), inputs)
        count = self.size * self.most
        if count:
            # Sorting leaves the pairs of the rows alone, which the factor needs.
            for pair, listed in zip(self.pairs, (self.keys, self.places), strict=True):
                wp.copy(pair, listed, count=count)
            wp.utils.radix_sort_pairs(*self.pairs, count)

    def refit(self, blocks, regularize) -> None:
        """Computes the numbers of the factor on the supports, and counts what goes wrong."""
        kernel = fsai_kernels.refit_kernel(self.scalar, self.wide, self.stored)
        options = [self.floor, regularize, *self.room]
        pattern = [self.support, self.counts, self.G.offsets, self.values, self.status]
        self._launch_chunks(
            kernel, lambda first: [*self._matrix(blocks), first, *options, *pattern]
        )

    def publish_pattern(self, fatal) -> None:
        """Gives the factors the supports, unless they have some or a count refuses."""
        n, m, G, GT = self.size, self.most, self.G, self.GT
        guard = [self.status, fatal, self.ready]
        inputs = [self.keys, m, self.counts, G.offsets, *guard, G.columns, G._counts()]
        self._launch(fsai_pattern.fill_rows, (n, m), inputs)
        inputs = [*self.pairs, m, G.offsets, *guard, GT.columns, self.sources]
        self._launch(fsai_pattern.fill_transposed, n * m, inputs)
        inputs = [self.pairs[0], n * m, *guard, GT.offsets]
        self._launch(fsai_pattern.fill_offsets, n + 1, inputs)

    def publish_values(self, fatal) -> None:
        """Gives the factors the numbers, unless a count refuses."""
        kernel = fsai_pattern.commit_kernel(self.stored)
        inputs = [self.values, self.sources, self.status, fatal, self.G.values, self.GT.values]
        self._launch(kernel, self.values.size, inputs)

    def make_ready(self, fatal) -> None:
        """Says that there are supports, unless a count refuses."""
        inputs = [self.status, fatal, self.ready, self.search]
        self._launch(fsai_pattern.make_ready, 1, inputs)
