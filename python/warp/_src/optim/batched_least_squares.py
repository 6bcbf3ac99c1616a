"""Gauss-Newton and Levenberg-Marquardt for many small problems, one in each row of an array.

K. Madsen, H. B. Nielsen and O. Tingleff, Methods for non-linear least squares problems, 2004.
Jacobians come from a tape: residuals of different rows are independent, so one backward pass gives
a row of every Jacobian.
"""

import functools

import warp as wp
from warp._src.optim.batched_rows import Rows
from warp.extend import checked
from warp.extend.kinds import ARRAY, CALLABLE, COUNT, NUMBER


@functools.cache
def _kernels(scalar):
    grid, row = wp.array2d(dtype=scalar), wp.array(dtype=scalar)
    cube = wp.array3d(dtype=scalar)
    options = {"module": __name__, "enable_backward": False}

    @wp.kernel(name=f"batched_seed_{scalar.__name__}", **options)
    def seed(column: int, out: grid):
        i, k = wp.tid()
        out[i, k] = wp.where(k == column, scalar(1.0), scalar(0.0))

    @wp.kernel(name=f"batched_jacobian_{scalar.__name__}", **options)
    def keep(gradient: grid, number: int, out: cube):
        i, k = wp.tid()
        out[i, number, k] = gradient[i, k]

    @wp.kernel(name=f"batched_levenberg_{scalar.__name__}", **options)
    def advance(
        first: bool,
        last: bool,
        shrink: scalar,
        grow: scalar,
        r: grid,
        jacobian: cube,
        x: grid,
        xa: grid,
        best: row,
        damping: row,
        normal: cube,
        slope: grid,
        factor: cube,
        change: grid,
    ):
        """Judges the last step of each row, and makes the next one by a Cholesky factor."""
        i = wp.tid()
        n = x.shape[1]
        cost = scalar(0.0)
        for k in range(r.shape[1]):
            cost += scalar(0.5) * r[i, k] * r[i, k]
        if first or (wp.isfinite(cost) and cost <= best[i]):
            best[i] = cost
            if not first:
                damping[i] = damping[i] * shrink
            for a in range(n):
                xa[i, a] = x[i, a]
                s = scalar(0.0)
                for k in range(r.shape[1]):
                    s += jacobian[i, k, a] * r[i, k]
                slope[i, a] = s
                for b in range(a + 1):
                    t = scalar(0.0)
                    for k in range(r.shape[1]):
                        t += jacobian[i, k, a] * jacobian[i, k, b]
                    normal[i, a, b] = t
        else:
            damping[i] = wp.min(damping[i] * grow, scalar(1.0e20))
        if last or not wp.isfinite(best[i]):
            for a in range(n):
                x[i, a] = xa[i, a]
        else:
            for a in range(n):
                for b in range(a + 1):
                    t = normal[i, a, b]
                    if a == b:
                        t += damping[i] * wp.max(t, scalar(1.0e-12))
                    for k in range(b):
                        t -= factor[i, a, k] * factor[i, b, k]
                    if a == b:
                        # A pivot lost to rounding stops its variable.
                        lost = t <= scalar(1.0e-14) * normal[i, a, a] or t <= scalar(0.0)
                        factor[i, a, a] = wp.where(lost, scalar(1.0e15), wp.sqrt(t))
                    else:
                        factor[i, a, b] = t / factor[i, b, b]
            for a in range(n):
                t = -slope[i, a]
                for k in range(a):
                    t -= factor[i, a, k] * change[i, k]
                change[i, a] = t / factor[i, a, a]
            for c in range(n):
                a = n - 1 - c
                t = change[i, a]
                for k in range(a + 1, n):
                    t -= factor[i, k, a] * change[i, k]
                change[i, a] = t / factor[i, a, a]
            for a in range(n):
                x[i, a] = xa[i, a] + change[i, a]

    return seed, keep, advance


class BatchedLevenbergMarquardt(Rows):
    """Minimises half the sum of squared residuals in each row of an array.

    Args:
        x: array of two dimensions of float32 or float64, a problem in each row, with gradients.
        residuals: array of two dimensions of the same type, the residuals of each row, with
            gradients; `step`'s function writes it.
        damping: first factor of the normal matrix's diagonal that is added to it. 0 is the method
            of Gauss and Newton, which takes whole steps; one that fails ends a row.

    Attributes:
        losses: half the sum of squares of each row at `x`, after `step`.

    Example:
        >>> import warp as wp
        >>> @wp.kernel
        ... def circle(x: wp.array2d(dtype=wp.float64), r: wp.array2d(dtype=wp.float64)):
        ...     i = wp.tid()
        ...     r[i, 0] = x[i, 0] * x[i, 0] + x[i, 1] * x[i, 1] - wp.float64(4.0)
        ...     r[i, 1] = x[i, 0] - x[i, 1]
        >>> x = wp.array([[1.0, 3.0], [5.0, 0.1]], dtype=wp.float64, device="cpu")
        >>> x.requires_grad = True
        >>> r = wp.zeros((2, 2), dtype=wp.float64, device="cpu", requires_grad=True)
        >>> solver = wp.optim.BatchedLevenbergMarquardt(x, r)
        >>> losses = solver.step(lambda: wp.launch(circle, 2, [x], [r], device="cpu"), 20)
        >>> x.numpy().round(6).tolist()
        [[1.414214, 1.414214], [1.414214, 1.414214]]
    """

    @checked(x=ARRAY, residuals=ARRAY, damping=NUMBER)
    def __init__(self, x, residuals, damping=1e-3):
        super().__init__(x)
        rows, columns = x.shape
        if residuals.ndim != 2 or residuals.shape[0] != rows or residuals.shape[1] == 0:
            raise ValueError(f"expects residuals of shape ({rows}, m), but got {residuals.shape}")
        if residuals.dtype != self.scalar or not residuals.requires_grad:
            raise TypeError(
                f"expects residuals of '{self.scalar.__name__}' with `requires_grad=True`, but got "
                f"'{residuals.dtype}'"
            )
        if damping < 0.0:
            raise ValueError(f"expects a damping of 0 or more, but got {damping}")
        self.residuals, self.damping = residuals, float(damping)
        self.losses, self._damping = self.zeros(rows), self.zeros(rows)
        self._seed = self.zeros(residuals.shape)
        self._jacobian = self.zeros((rows, residuals.shape[1], columns))
        self._kept, self._slope, self._change = (self.zeros(x.shape) for _ in range(3))
        self._normal, self._factor = (self.zeros((rows, columns, columns)) for _ in range(2))

    @checked(forward=CALLABLE, iterations=COUNT)
    def step(self, forward, iterations=20):
        """Takes so many steps, and leaves `x` at the best point of each row.

        Args:
            forward: called without arguments, writes the residuals at `x` by launches.

        Returns:
            the array of losses.
        """
        self._damping.fill_(self.damping)
        _, _, advance = _kernels(self.scalar)
        for number in range(iterations + 1):
            self._differentiate(forward)
            inputs = [number == 0, number == iterations, 0.25, 8.0, self.residuals]
            inputs += [self._jacobian, self.x, self._kept, self.losses, self._damping]
            inputs += [self._normal, self._slope, self._factor, self._change]
            self.launch(advance, inputs)
        return self.losses

    def _differentiate(self, forward):
        """Residuals and their Jacobians at `x`."""
        seed, keep, _ = _kernels(self.scalar)
        with wp.Tape() as tape:
            forward()
        for number in range(self.residuals.shape[1]):
            tape.zero()
            self.x.grad.zero_()
            wp.launch(seed, self.residuals.shape, [number], [self._seed], device=self.device)
            tape.backward(grads={self.residuals: self._seed})
            inputs = [self.x.grad, number]
            wp.launch(keep, self.x.shape, inputs, [self._jacobian], device=self.device)
        tape.zero()
