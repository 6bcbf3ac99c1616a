"""L-BFGS for many small problems at once, one in each row of an array.

Nocedal and Wright, Numerical Optimization (2006), algorithm 7.4, with backtracking. Each row has
its own step, history and end; one launch after each evaluation decides for all rows, and nothing is
read on the host before the last one.
"""

import functools

import warp as wp
from warp._src.optim.batched_rows import Rows
from warp.extend import checked
from warp.extend.kinds import ARRAY, CALLABLE, COUNT, NUMBER

ACTIVE, CONVERGED, STUCK = 0, 1, 2
_HALVINGS = wp.constant(30)


@functools.cache
def _kernel(scalar):
    grid, row = wp.array2d(dtype=scalar), wp.array(dtype=scalar)
    cube, whole = wp.array3d(dtype=scalar), wp.array(dtype=int)

    @wp.func
    def dot(a: grid, b: grid, i: int):
        total = scalar(0.0)
        for k in range(a.shape[1]):
            total += a[i, k] * b[i, k]
        return total

    @wp.func
    def direct(g: grid, s: cube, y: cube, rho: grid, alpha: grid, used: int, i: int, d: grid):
        """The two loops over the history, newest first in its slots."""
        n = g.shape[1]
        for k in range(n):
            d[i, k] = -g[i, k]
        for h in range(used):
            a = scalar(0.0)
            for k in range(n):
                a += s[i, h, k] * d[i, k]
            a = a * rho[i, h]
            alpha[i, h] = a
            for k in range(n):
                d[i, k] = d[i, k] - a * y[i, h, k]
        if used > 0:
            squares = scalar(0.0)
            for k in range(n):
                squares += y[i, 0, k] * y[i, 0, k]
            scale = scalar(1.0) / (rho[i, 0] * squares)
            for k in range(n):
                d[i, k] = d[i, k] * scale
        for j in range(used):
            h = used - 1 - j
            b = scalar(0.0)
            for k in range(n):
                b += y[i, h, k] * d[i, k]
            b = alpha[i, h] - b * rho[i, h]
            for k in range(n):
                d[i, k] = d[i, k] + b * s[i, h, k]

    @wp.func
    def remember(
        x: grid, g: grid, xa: grid, ga: grid, s: cube, y: cube, rho: grid, used: int, i: int
    ):
        """Puts the last change first, if the curvature along it is positive; gives the number."""
        n = x.shape[1]
        curved = scalar(0.0)
        squares = scalar(0.0)
        for k in range(n):
            change = g[i, k] - ga[i, k]
            curved += (x[i, k] - xa[i, k]) * change
            squares += change * change
        count = used
        if curved > scalar(1.0e-10) * squares and squares > scalar(0.0):
            count = wp.min(used + 1, s.shape[1])
            for j in range(count - 1):
                h = count - 1 - j
                rho[i, h] = rho[i, h - 1]
                for k in range(n):
                    s[i, h, k] = s[i, h - 1, k]
                    y[i, h, k] = y[i, h - 1, k]
            rho[i, 0] = scalar(1.0) / curved
            for k in range(n):
                s[i, 0, k] = x[i, k] - xa[i, k]
                y[i, 0, k] = g[i, k] - ga[i, k]
        return count

    @wp.kernel(name=f"batched_lbfgs_{scalar.__name__}", module=__name__, enable_backward=False)
    def advance(
        first: bool,
        tolerance: scalar,
        loss: row,
        x: grid,
        g: grid,
        best: row,
        xa: grid,
        ga: grid,
        d: grid,
        s: cube,
        y: cube,
        rho: grid,
        alpha: grid,
        step: row,
        slope: row,
        used: whole,
        halved: whole,
        status: whole,
    ):
        """Judges the last trial of each row and makes the next one."""
        i = wp.tid()
        n = x.shape[1]
        total = scalar(0.0)
        most = scalar(0.0)
        for k in range(n):
            total += wp.abs(g[i, k])
            most = wp.max(most, wp.abs(g[i, k]))
        good = wp.isfinite(loss[i]) and wp.isfinite(total)
        if status[i] == ACTIVE:
            renew = bool(False)
            if good and (first or loss[i] <= best[i] + scalar(1.0e-4) * step[i] * slope[i]):
                if not first:
                    used[i] = remember(x, g, xa, ga, s, y, rho, used[i], i)
                best[i] = loss[i]
                for k in range(n):
                    xa[i, k] = x[i, k]
                    ga[i, k] = g[i, k]
                if most <= tolerance:
                    status[i] = CONVERGED
                renew = True
            elif first:
                best[i] = loss[i]
                status[i] = STUCK
                for k in range(n):
                    xa[i, k] = x[i, k]
            else:
                step[i] = scalar(0.5) * step[i]
                halved[i] = halved[i] + 1
                if halved[i] > _HALVINGS:
                    # Once more along the steepest descent, then no more.
                    if used[i] == 0:
                        status[i] = STUCK
                    used[i] = 0
                    renew = True
            if renew and status[i] == ACTIVE:
                halved[i] = 0
                direct(ga, s, y, rho, alpha, used[i], i, d)
                slope[i] = dot(ga, d, i)
                if not (slope[i] < scalar(0.0)):
                    used[i] = 0
                    direct(ga, s, y, rho, alpha, 0, i, d)
                    slope[i] = dot(ga, d, i)
                step[i] = scalar(1.0)
                if used[i] == 0:
                    sum_now = scalar(0.0)
                    for k in range(n):
                        sum_now += wp.abs(ga[i, k])
                    step[i] = wp.min(scalar(1.0), scalar(1.0) / wp.max(sum_now, scalar(1.0e-30)))
        for k in range(n):
            if status[i] == ACTIVE:
                x[i, k] = xa[i, k] + step[i] * d[i, k]
            else:
                x[i, k] = xa[i, k]

    return advance


class BatchedLBFGS(Rows):
    """Minimises a smooth function in each row of an array; rows do not influence each other.

    Args:
        x: array of two dimensions of float32 or float64, a problem in each row, with gradients.
        history_size: changes that the approximation of the curvature of a row is made from.
        tolerance_grad: a row ends when no component of its gradient is larger.

    Attributes:
        losses: the loss of each row at `x`, after `step`.
        status: 0 for rows that go on, 1 for those that have converged, 2 for those that no step
            improves.

    Example:
        >>> import numpy as np
        >>> import warp as wp
        >>> x = wp.array([[3.0, -2.0], [1.0, 5.0]], dtype=wp.float64, device="cpu")
        >>> x.requires_grad = True
        >>> losses = wp.zeros(2, dtype=wp.float64, device="cpu")
        >>> def closure():
        ...     x.grad.assign(x.numpy() * [2.0, 200.0])
        ...     losses.assign((x.numpy() ** 2 * [1.0, 100.0]).sum(axis=1))
        ...     return losses
        >>> float(wp.optim.BatchedLBFGS(x).step(closure, 60).numpy().max()) < 1e-12
        True
    """

    @checked(x=ARRAY, history_size=COUNT, tolerance_grad=NUMBER)
    def __init__(self, x, history_size=8, tolerance_grad=1e-7):
        super().__init__(x)
        if history_size < 1:
            raise ValueError(f"expects a positive history_size, but got {history_size}")
        self.tolerance_grad = float(tolerance_grad)
        rows, columns = x.shape
        self.losses = self.zeros(rows)
        self._kept, self._gradients, self._direction = (self.zeros(x.shape) for _ in range(3))
        self._changes = [self.zeros((rows, history_size, columns)) for _ in range(2)]
        self._factors = [self.zeros((rows, history_size)) for _ in range(2)]
        self._steps = [self.zeros(rows) for _ in range(2)]
        self._counts = [self.zeros(rows, int) for _ in range(2)]
        self.status = self.zeros(rows, int)

    @checked(closure=CALLABLE, evaluations=COUNT)
    def step(self, closure, evaluations=100):
        """Evaluates so many times, and leaves `x` at the best point of each row.

        Args:
            closure: called without arguments, returns the array of the rows' losses at `x` and adds
                their gradient to `x.grad`, which is zero when it is called.

        Returns:
            the array of losses.
        """
        for array in (self.status, *self._counts):
            array.zero_()
        kernel = _kernel(self.scalar)
        for number in range(evaluations):
            self.x.grad.zero_()
            losses = self.check_losses(closure())
            inputs = [number == 0, self.tolerance_grad, losses, self.x, self.x.grad, self.losses]
            inputs += [self._kept, self._gradients, self._direction, *self._changes]
            inputs += [*self._factors, *self._steps, *self._counts, self.status]
            self.launch(kernel, inputs)
        if evaluations:
            wp.copy(self.x, self._kept)
        return self.losses
