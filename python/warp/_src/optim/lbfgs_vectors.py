"""The vectors of L-BFGS, and its kernels.

All parameters together are one vector on their device, in 64 bits if one of them has that many. The
history is a ring of rows: `s`, changes of the parameters, and `y`, those of the gradient. Inner
products come in two launches, partial sums by `threads` threads and their sum by one, in 64 bits
and in a fixed order, so that equal runs give equal results. Factors stay on the device: the
two-loop recursion (Nocedal and Wright, algorithm 7.4) never waits for the host.
"""

import functools
import itertools
import math
from types import SimpleNamespace

import warp as wp
from warp._src.optim import parameters

# Places in `factors`.
_STEP, _ONE, _SCALE = wp.constant(0), wp.constant(1), wp.constant(2)


@wp.kernel(enable_backward=False)
def _finish_dot(
    partial: wp.array2d(dtype=wp.float64),
    row: int,
    first_loop: bool,
    rho: wp.array(dtype=wp.float64),
    alpha: wp.array(dtype=wp.float64),
    factors: wp.array(dtype=wp.float64),
):
    """Turns an inner product into the factor of the next vector of the recursion."""
    total = wp.float64(0.0)
    for i in range(partial.shape[1]):
        total += partial[0, i]
    if first_loop:
        alpha[row] = rho[row] * total
        factors[_STEP] = -alpha[row]
    else:
        factors[_STEP] = alpha[row] - rho[row] * total


@wp.kernel(enable_backward=False)
def _finish_sums(
    partial: wp.array2d(dtype=wp.float64), added: int, sums: wp.array(dtype=wp.float64)
):
    """Adds each of the first rows, and takes the maxima of the others."""
    k = wp.tid()
    total = wp.float64(0.0)
    for i in range(partial.shape[1]):
        if k < added:
            total += partial[k, i]
        else:
            total = wp.max(total, partial[k, i])
    sums[k] = total


@wp.kernel(enable_backward=False)
def _set_curvature(
    sums: wp.array(dtype=wp.float64),
    row: int,
    rho: wp.array(dtype=wp.float64),
    factors: wp.array(dtype=wp.float64),
):
    rho[row] = wp.float64(1.0) / sums[0]
    factors[_SCALE] = sums[0] / sums[1]


@functools.cache
def _vector_kernels(real):
    """The kernels over whole vectors of type `real`."""
    vector = wp.array(dtype=real)
    zero = wp.float64(0.0)

    def kernel(function):
        name = f"lbfgs_{function.__name__}_{real.__name__}"
        return wp.kernel(function, name=name, module=__name__, enable_backward=False)

    @kernel
    def move(x: vector, d: vector, step: real, out: vector):
        i = wp.tid()
        out[i] = x[i] + step * d[i]

    @kernel
    def negate(x: vector, out: vector):
        i = wp.tid()
        out[i] = -x[i]

    @kernel
    def advance(
        d: vector,
        added: vector,
        factors: wp.array(dtype=wp.float64),
        factor: int,
        scale: int,
        other: vector,
        partial: wp.array2d(dtype=wp.float64),
    ):
        """Replaces d by scale * (d + factor * added) and multiplies it with `other`."""
        thread = wp.tid()
        step, scaling = real(0.0), real(factors[scale])
        if factor >= 0:
            step = real(factors[factor])
        total = zero
        for i in range(thread, d.shape[0], partial.shape[1]):
            d[i] = scaling * (d[i] + step * added[i])
            total += wp.float64(d[i]) * wp.float64(other[i])
        partial[0, thread] = total

    @kernel
    def measure(g: vector, d: vector, partial: wp.array2d(dtype=wp.float64)):
        """Sums of g * d and |g|, largest |g| and |d|."""
        thread = wp.tid()
        slope, total, most, longest = zero, zero, zero, zero
        for i in range(thread, g.shape[0], partial.shape[1]):
            size = wp.abs(wp.float64(g[i]))
            slope += wp.float64(g[i]) * wp.float64(d[i])
            total += size
            most = wp.max(most, size)
            longest = wp.max(longest, wp.abs(wp.float64(d[i])))
        partial[0, thread] = slope
        partial[1, thread] = total
        partial[2, thread] = most
        partial[3, thread] = longest

    @kernel
    def remember(
        d: vector,
        step: real,
        new: vector,
        old: vector,
        s: vector,
        y: vector,
        partial: wp.array2d(dtype=wp.float64),
    ):
        """Fills a row of the history; sums of s * y, y * y and s * s."""
        thread = wp.tid()
        curvature, square, length = zero, zero, zero
        for i in range(thread, d.shape[0], partial.shape[1]):
            s[i] = step * d[i]
            y[i] = new[i] - old[i]
            curvature += wp.float64(s[i]) * wp.float64(y[i])
            square += wp.float64(y[i]) * wp.float64(y[i])
            length += wp.float64(s[i]) * wp.float64(s[i])
        partial[0, thread] = curvature
        partial[1, thread] = square
        partial[2, thread] = length

    return SimpleNamespace(
        move=move, negate=negate, advance=advance, measure=measure, remember=remember
    )


@functools.cache
def _convert_kernel(source, target):
    def convert(x: wp.array(dtype=source), out: wp.array(dtype=target)):
        i = wp.tid()
        out[i] = target(x[i])

    name = f"lbfgs_convert_{source.__name__}_{target.__name__}"
    return wp.kernel(convert, name=name, module=__name__, enable_backward=False)


class Vectors:
    """The state of L-BFGS on a device, and what is computed with it.

    Args:
        params: the parameters, all on one device.
        rows: changes to remember.
    """

    def __init__(self, params, rows):
        self.device = params[0].device
        scalars = [parameters.scalar_of(parameters.state_dtype(p.dtype)) for p in params]
        self.real = wp.float64 if wp.float64 in scalars else wp.float32
        self.precision = parameters.epsilon(self.real)
        self.kernels = _vector_kernels(self.real)
        components = [p.size * getattr(p.dtype, "_length_", 1) for p in params]
        self.starts = [0, *itertools.accumulate(components)]
        self.size = self.starts[-1]
        self.threads = max(1, min(self.size // 64, 1024))
        self.x, self.trial, self.direction = (self.vector() for _ in range(3))
        self.s, self.y = (self.zeros((rows, self.size), self.real) for _ in range(2))
        self.rho, self.alpha = self.zeros(rows), self.zeros(rows)
        self.partial = self.zeros((4, self.threads))
        self.sums = self.zeros(4)
        self.factors = wp.array([0.0, 1.0, 1.0], dtype=wp.float64, device=self.device)
        # Rows of the history in use, oldest first.
        self.used: list[int] = []

    def zeros(self, shape, dtype=wp.float64):
        return wp.zeros(shape, dtype=dtype, device=self.device)

    def vector(self):
        return self.zeros(self.size, self.real)

    def launch(self, kernel, dim, *inputs) -> None:
        wp.launch(kernel, dim, inputs, device=self.device, record_tape=False)

    def gather(self, arrays, out) -> None:
        """Packs arrays into a vector."""
        for values, start in zip(arrays, self.starts, strict=False):
            source = parameters.flat(values.contiguous())
            part = _convert_kernel(source.dtype, self.real)
            self.launch(part, source.size, source, out[start : start + source.size])

    def scatter(self, vector, arrays) -> None:
        """Unpacks a vector into arrays."""
        for values, start in zip(arrays, self.starts, strict=False):

            def write(target, start=start):
                part = _convert_kernel(self.real, target.dtype)
                self.launch(part, target.size, vector[start : start + target.size], target)

            parameters.update(values, write)

    def read(self, added) -> list[float]:
        """Sums of the first rows of the partial results, maxima of the others."""
        self.launch(_finish_sums, 4, self.partial, added, self.sums)
        return self.sums.numpy().tolist()

    def measure(self, gradient) -> list[float]:
        """Slope along the direction, sum and maximum of |gradient|, maximum of |direction|."""
        inputs = gradient, self.direction, self.partial
        self.launch(self.kernels.measure, self.threads, *inputs)
        return self.read(2)

    def move(self, step) -> None:
        """Sets `trial` to the point at a step along the direction."""
        self.launch(self.kernels.move, self.size, self.x, self.direction, step, self.trial)

    def forget(self) -> None:
        self.used.clear()

    def remember(self, step, new, old) -> None:
        """Adds a change to the history, unless it shows no positive curvature."""
        rows = self.s.shape[0]
        row = (self.used[-1] + 1) % rows if self.used else 0
        if len(self.used) == rows:
            self.used.pop(0)
        inputs = self.direction, step, new, old, self.s[row], self.y[row], self.partial
        self.launch(self.kernels.remember, self.threads, *inputs)
        curvature, square, length, _ = self.read(3)
        if curvature > self.precision * math.sqrt(square * length):
            self.launch(_set_curvature, 1, self.sums, row, self.rho, self.factors)
            self.used.append(row)

    def find_direction(self, gradient) -> None:
        """Sets the direction to minus the approximate inverse Hessian times the gradient."""
        d = self.direction
        self.launch(self.kernels.negate, self.size, gradient, d)
        if not self.used:
            return
        self.advance(d, -1, _ONE, self.s[self.used[-1]])
        self.finish(self.used[-1], True)
        for row, older in zip(self.used[:0:-1], self.used[-2::-1], strict=True):
            self.advance(self.y[row], _STEP, _ONE, self.s[older])
            self.finish(older, True)
        oldest = self.used[0]
        self.advance(self.y[oldest], _STEP, _SCALE, self.y[oldest])
        self.finish(oldest, False)
        for row, newer in zip(self.used, self.used[1:], strict=False):
            self.advance(self.s[row], _STEP, _ONE, self.y[newer])
            self.finish(newer, False)
        self.advance(self.s[self.used[-1]], _STEP, _ONE, gradient)

    def advance(self, added, factor, scale, other) -> None:
        inputs = self.direction, added, self.factors, factor, scale, other, self.partial
        self.launch(self.kernels.advance, self.threads, *inputs)

    def finish(self, row, first_loop) -> None:
        inputs = self.partial, row, first_loop, self.rho, self.alpha, self.factors
        self.launch(_finish_dot, 1, *inputs)
