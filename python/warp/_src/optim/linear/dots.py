"""Inner products of vectors, on the device and in a fixed order.

Each of several systems (batches) has its own. A product is made in two or three launches: sums of
every n-th number by many threads, in 64 bits, and the sum of those.
"""

import functools

import warp as wp


@functools.cache
def _kernels(scalar, result_type):
    kernel = functools.partial(wp.kernel, module=__name__, enable_backward=False)
    suffix = f"{scalar.__name__}_{result_type.__name__}"

    @kernel(name=f"linear_dot_{suffix}")
    def multiply(
        a: wp.array2d(dtype=scalar),
        b: wp.array2d(dtype=scalar),
        offsets: wp.array(dtype=int),
        partial: wp.array3d(dtype=wp.float64),
    ):
        column, batch, thread = wp.tid()
        total = wp.float64(0.0)
        for i in range(offsets[batch] + thread, offsets[batch + 1], partial.shape[2]):
            total += wp.float64(a[column, i]) * wp.float64(b[column, i])
        partial[column, batch, thread] = total

    @kernel(name=f"linear_dot_three_{suffix}")
    def multiply_three(
        r: wp.array(dtype=scalar),
        u: wp.array(dtype=scalar),
        w: wp.array(dtype=scalar),
        offsets: wp.array(dtype=int),
        partial: wp.array3d(dtype=wp.float64),
    ):
        """r.u, w.u and r.r in one pass, each in the order of `multiply`."""
        batch, thread = wp.tid()
        ru = wp.float64(0.0)
        wu = wp.float64(0.0)
        rr = wp.float64(0.0)
        for i in range(offsets[batch] + thread, offsets[batch + 1], partial.shape[2]):
            a = wp.float64(r[i])
            b = wp.float64(u[i])
            ru += a * b
            wu += wp.float64(w[i]) * b
            rr += a * a
        partial[0, batch, thread] = ru
        partial[1, batch, thread] = wu
        partial[2, batch, thread] = rr

    @kernel(name=f"linear_dot_end_{suffix}")
    def finish(
        partial: wp.array3d(dtype=wp.float64), first: int, result: wp.array2d(dtype=result_type)
    ):
        column, batch = wp.tid()
        total = wp.float64(0.0)
        for i in range(partial.shape[2]):
            total += partial[column, batch, i]
        result[first + column, batch] = result_type(total)

    return multiply, multiply_three, finish


@wp.kernel(enable_backward=False)
def _add_partials(partial: wp.array3d(dtype=wp.float64), sums: wp.array3d(dtype=wp.float64)):
    column, batch, thread = wp.tid()
    total = wp.float64(0.0)
    for i in range(thread, partial.shape[2], sums.shape[2]):
        total += partial[column, batch, i]
    sums[column, batch, thread] = total


class Dots:
    """Inner products of up to `columns` pairs of vectors of one length.

    Args:
        offsets: where each batch begins and the last one ends.
        length: upper bound of the numbers of one batch.
        scalar: type of the numbers of the vectors.
        columns: how many pairs at once.
        result_type: type of the results.

    Attributes:
        results: columns x batches.
    """

    def __init__(self, offsets, length, scalar, columns=1, result_type=wp.float64):
        self.offsets, self.device = offsets, offsets.device
        self.batches = offsets.size - 1
        self.kernels = _kernels(scalar, result_type)
        threads, few = self._widths(length)
        shape = (columns, self.batches)
        self.partial = wp.empty((*shape, threads), dtype=wp.float64, device=self.device)
        self.sums = self.partial
        if few < threads:
            self.sums = wp.empty((*shape, few), dtype=wp.float64, device=self.device)
        self.results = wp.zeros(shape, dtype=result_type, device=self.device)

    def _widths(self, length) -> tuple[int, int]:
        """How many threads sum the numbers, and how many sum their sums."""
        if self.device.is_cpu:
            threads = min(16, max(1, length // 1024))
            return threads, threads
        threads = 32
        while threads < 65536 and threads * 16 < length:
            threads *= 4
        return threads, min(threads, max(32, int(threads**0.5)))

    def compute(self, a, b, first=0):
        """Multiplies rows of `a` and `b`, or two vectors; results go to `results[first:]`."""
        if a.ndim == 1:
            a, b = a.reshape((1, a.size)), b.reshape((1, b.size))
        columns = a.shape[0]
        partial = self.partial[:columns]
        multiply, *_ = self.kernels
        wp.launch(multiply, partial.shape, [a, b, self.offsets, partial], device=self.device)
        self._finish(columns, first)

    def _finish(self, columns, first) -> None:
        """Adds up the sums that threads have found."""
        *_, finish = self.kernels
        partial, sums = self.partial[:columns], self.sums[:columns]
        if self.sums is not self.partial:
            wp.launch(_add_partials, sums.shape, [partial, sums], device=self.device)
        inputs = [sums, first, self.results]
        wp.launch(finish, (columns, self.batches), inputs, device=self.device)

    def compute_all(self, pairs):
        """Multiplies pairs of vectors; over ranks with one sum for all."""
        for k, (a, b) in enumerate(pairs):
            self.compute(a, b, first=k)

    def compute_three(self, r, u, w):
        """The products r.u, w.u and r.r in rows 0, 1 and 2; over ranks with one sum for all."""
        _, multiply, _ = self.kernels
        inputs = [r, u, w, self.offsets, self.partial[:3]]
        wp.launch(multiply, self.partial.shape[1:], inputs, device=self.device)
        self._finish(3, 0)

    def row(self, column=0):
        """The results of a column, one per batch."""
        return self.results[column]
