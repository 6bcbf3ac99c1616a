"""Conjugate gradients with fused inner products: one sum over ranks in an iteration.

After Chronopoulos and Gear, "s-step iterative methods for symmetric linear systems" (1989): A p
follows from A u by the recurrence of p, so all products are of vectors that are there at once.
Rounding lets r drift from b - A x. Where the residual has become so small that the drift may show,
r and A p are computed anew and the direction stays ("flying restart" of Sleijpen and van der Vorst,
"Reliable updated residuals", 1996).
"""

import functools

import numpy as np

import warp as wp
from warp._src.optim.linear.conjugate import (
    _Restartable,
    note_sign,
    quotient,
    step_length,
    watch,
)
from warp._src.optim.linear.operators import numbers, numbers_like

# A residual that is so much smaller than the largest one since it was computed may have drifted:
# the square root of the precision.
_DRIFT = {wp.float16: 3e-2, wp.float32: 3e-4, wp.float64: 1.5e-8}


@functools.cache
def _factor_kernels():
    kernel = functools.partial(wp.kernel, module=__name__, enable_backward=False)

    @kernel(name="linear_fused_factors")
    def set_factors(
        products: wp.array2d(dtype=wp.float64),
        mode: int,
        residuals: wp.array(dtype=wp.float64),
        limits: wp.array(dtype=wp.float64),
        progress: wp.array(dtype=int),
        broken: wp.array(dtype=int),
        least: wp.array(dtype=wp.float64),
        shortest: wp.array(dtype=wp.float64),
        signs: wp.array2d(dtype=wp.float64),
        gammas: wp.array2d(dtype=wp.float64),
        alphas: wp.array2d(dtype=wp.float64),
        beta: wp.array(dtype=wp.float64),
    ):
        """Mode 0: the first step, 1: the next one, 2: the last one again, from a new residual.

        Rows of `gammas` and `alphas`: of the step at hand, and of the one before it.
        """
        i = wp.tid()
        gamma = products[0, i]
        delta = products[1, i]
        if mode == 1:
            gammas[1, i] = gammas[0, i]
            alphas[1, i] = alphas[0, i]
        if mode != 0 and alphas[1, i] != wp.float64(0.0):
            # A system at rest keeps its residual.
            residuals[i] = products[2, i]
            watch(residuals[i], least, progress[0], broken, i)
        turn = wp.float64(0.0)
        below = delta
        if mode != 0 and alphas[1, i] != wp.float64(0.0) and gammas[1, i] != wp.float64(0.0):
            turn = gamma / gammas[1, i]
            below = delta - turn * gamma / alphas[1, i]
        length = quotient(gamma, below, residuals[i], limits[i], progress[0], broken, i)
        if length != wp.float64(0.0):
            note_sign(gamma, signs[0], i)
            note_sign(below, signs[1], i)
        gammas[0, i] = gamma
        alphas[0, i] = step_length(length, shortest, progress[0], broken, i)
        beta[i] = turn

    @kernel(name="linear_fused_drift")
    def find_drift(
        residuals: wp.array(dtype=wp.float64),
        limits: wp.array(dtype=wp.float64),
        broken: wp.array(dtype=int),
        ratio: wp.float64,
        largest: wp.array(dtype=wp.float64),
        due: wp.array(dtype=int),
    ):
        """Sets `due` if a system that goes on may have drifted."""
        found = int(0)
        for i in range(residuals.shape[0]):
            largest[i] = wp.max(largest[i], residuals[i])
            if broken[i] < 0 and residuals[i] > limits[i] and residuals[i] < ratio * largest[i]:
                found = 1
        if found == 1:
            for i in range(residuals.shape[0]):
                largest[i] = residuals[i]
        due[0] = found

    return set_factors, find_drift


@functools.cache
def _vector_kernel(scalar):
    vector = wp.array(dtype=scalar)

    @wp.kernel(name=f"linear_fused_{scalar.__name__}", module=__name__, enable_backward=False)
    def advance(
        alpha: wp.array(dtype=wp.float64),
        beta: wp.array(dtype=wp.float64),
        batch_of: wp.array(dtype=int),
        u: vector,
        w: vector,
        p: vector,
        s: vector,
        x: vector,
        r: vector,
    ):
        """p = u + beta p, s = w + beta s, x += alpha p, r -= alpha s."""
        i = wp.tid()
        batch = batch_of[i]
        if batch >= 0:
            a = alpha[batch]
            b = beta[batch]
            p[i] = scalar(wp.float64(u[i]) + b * wp.float64(p[i]))
            s[i] = scalar(wp.float64(w[i]) + b * wp.float64(s[i]))
            x[i] = scalar(wp.float64(x[i]) + a * wp.float64(p[i]))
            r[i] = scalar(wp.float64(r[i]) - a * wp.float64(s[i]))

    return advance


class FusedCG(_Restartable):
    """Conjugate gradients whose inner products of an iteration are one sum; arguments as for `CG`.

    Made by `cg(..., fused=True)`.
    """

    name = "cg"

    def _allocate(self):
        super()._allocate()
        self.dots = self.make_dots(3)
        self.u, self.w, self.p, self.s = (self.vector() for _ in range(4))
        self.gammas, self.alphas = (
            wp.zeros((2, self.batches), dtype=wp.float64, device=self.device) for _ in range(2)
        )
        self.largest = wp.zeros(self.batches, dtype=wp.float64, device=self.device)
        self.due = wp.zeros(1, dtype=int, device=self.device)
        self._highest = None

    def start(self):
        self.residual(self.r)
        self.p.zero_()
        self.s.zero_()
        self._find_factors(0)
        wp.copy(self.largest, self.r_norm_sq)
        self._highest = None

    def _find_factors(self, mode):
        u = self.precondition(self.r, self.u)
        self.A.matvec(u, self.w, self.w, 1.0, 0.0)
        r, u, w = numbers(self.r), numbers(u), numbers(self.w)
        self.dots.compute_three(r, u, w)
        kernel, _ = _factor_kernels()
        state = (self.r_norm_sq, self.atol_sq, self.progress, self.broken, self.least)
        factors = (self.shortest, self.signs, self.gammas, self.alphas, self.beta)
        self.launch(kernel, self.batches, self.dots.results, mode, *state, *factors)

    def iterate(self):
        """One iteration."""
        u = self.r if self.M is None else self.u
        vectors = numbers_like(self.count, u=u, w=self.w, p=self.p, s=self.s, x=self.x, r=self.r)
        kernel = _vector_kernel(self.scalar)
        self.launch(kernel, self.count, self.alphas[0], self.beta, self.batch_of, *vectors)
        self._find_factors(1)

    def refresh(self) -> None:
        """Computes the residual and A p anew, and goes on in the same direction."""
        self.A.matvec(self.x, self.b, self.r, -1.0, 1.0)
        self.A.matvec(self.p, self.s, self.s, 1.0, 0.0)
        self._find_factors(2)

    def has_drifted(self, squares, limits) -> bool:
        """True if a residual may have drifted, by the squares that the host has read."""
        if self.restart is not None:
            # Each cycle ends with a new residual; a graph of it does not run `start` here.
            return False
        highest = squares if self._highest is None else np.maximum(self._highest, squares)
        ratio = _DRIFT[self.scalar] ** 2
        due = bool(((squares > limits) & (squares < ratio * highest)).any())
        self._highest = squares if due else highest
        return due

    def guard(self) -> None:
        """The same in a loop of the device."""
        _, kernel = _factor_kernels()
        state = (self.r_norm_sq, self.atol_sq, self.broken)
        ratio = wp.float64(_DRIFT[self.scalar] ** 2)
        self.launch(kernel, 1, *state, ratio, self.largest, self.due)
        wp.capture_if(self.due, self.refresh)
