"""The stabilised method of biconjugate gradients, after van der Vorst (1992), preconditioned."""

import functools
import typing

import warp as wp
from warp._src.optim.linear.conjugate import quotient, step_length, vector_kernels, watch
from warp._src.optim.linear.operators import numbers
from warp._src.optim.linear.state import LinearSolverState
from warp.extend import checked
from warp.extend.kinds import FLAG, SOLVER

# Rows of `factors`.
_RHO, _ALPHA, _OMEGA, _BETA = wp.constant(0), wp.constant(1), wp.constant(2), wp.constant(3)


@functools.cache
def _kernels(scalar):
    kernel = functools.partial(wp.kernel, module=__name__, enable_backward=False)
    suffix = scalar.__name__
    vector, factors_type = wp.array(dtype=scalar), wp.array2d(dtype=wp.float64)
    squares, counters = wp.array(dtype=wp.float64), wp.array(dtype=int)

    @kernel(name=f"bicgstab_alpha_{suffix}")
    def set_alpha(
        product: wp.array(dtype=wp.float64),
        residuals: squares,
        limits: squares,
        progress: counters,
        broken: counters,
        shortest: wp.array(dtype=wp.float64),
        factors: factors_type,
    ):
        i = wp.tid()
        residual, limit = residuals[i], limits[i]
        length = quotient(factors[_RHO, i], product[i], residual, limit, progress[0], broken, i)
        factors[_ALPHA, i] = step_length(length, shortest, progress[0], broken, i)

    @kernel(name=f"bicgstab_omega_{suffix}")
    def set_omega(
        products: wp.array2d(dtype=wp.float64),
        progress: counters,
        broken: counters,
        shortest: wp.array(dtype=wp.float64),
        factors: factors_type,
    ):
        i = wp.tid()
        omega = wp.float64(0.0)
        if products[1, i] > wp.float64(0.0) and factors[_ALPHA, i] != wp.float64(0.0):
            omega = products[0, i] / products[1, i]
        factors[_OMEGA, i] = step_length(omega, shortest, progress[0], broken, i)

    @kernel(name=f"bicgstab_beta_{suffix}")
    def set_beta(
        products: wp.array2d(dtype=wp.float64),
        residuals: squares,
        limits: squares,
        progress: counters,
        broken: counters,
        least: wp.array(dtype=wp.float64),
        factors: factors_type,
    ):
        """`products`: of the residual with itself, and with the first one."""
        i = wp.tid()
        if factors[_ALPHA, i] != wp.float64(0.0):
            residuals[i] = products[0, i]
            watch(products[0, i], least, progress[0], broken, i)
        residual, limit = residuals[i], limits[i]
        rho = products[1, i]
        factors[_BETA, i] = quotient(
            rho * factors[_ALPHA, i],
            factors[_RHO, i] * factors[_OMEGA, i],
            residual,
            limit,
            progress[0],
            broken,
            i,
        )
        factors[_RHO, i] = rho

    @kernel(name=f"bicgstab_turn_{suffix}")
    def turn(factors: factors_type, batch_of: counters, r: vector, v: vector, p: vector):
        i = wp.tid()
        batch = batch_of[i]
        if batch >= 0:
            rest = wp.float64(p[i]) - factors[_OMEGA, batch] * wp.float64(v[i])
            p[i] = scalar(wp.float64(r[i]) + factors[_BETA, batch] * rest)

    return set_alpha, set_omega, set_beta, turn


class BiCGSTAB(LinearSolverState):
    """The stabilised method of biconjugate gradients, for any matrix.

    Arguments as for `LinearSolverState`, and `is_left_preconditioner`: measure the second half of
    a step as `M` sees it. True if there is an `M` is settled by the first call.
    """

    name = "bicgstab"

    own_options: typing.ClassVar[dict] = {"is_left_preconditioner": "left"}

    @checked(**SOLVER, is_left_preconditioner=FLAG)
    def __init__(
        self,
        A,
        b,
        x,
        tol=None,
        atol=None,
        maxiter=0,
        M=None,
        callback=None,
        check_every=10,
        use_cuda_graph=True,
        is_left_preconditioner=False,
    ):
        self.left = is_left_preconditioner and M is not None
        super().__init__(A, b, x, tol, atol, maxiter, M, callback, check_every, use_cuda_graph)

    def _allocate(self):
        super()._allocate()
        self.factors = wp.zeros((4, self.batches), dtype=wp.float64, device=self.device)
        self.alpha, self.omega = self.factors[_ALPHA], self.factors[_OMEGA]
        move, _ = vector_kernels(self.scalar)
        self.kernels = (*_kernels(self.scalar), move)
        self.first, self.p, self.v, self.t = (self.vector() for _ in range(4))
        self.y = self.z = self.Mt = None
        if self.M is not None:
            self.y, self.z = self.vector(), self.vector()
            self.Mt = self.vector() if self.left else None

    def _replace(self, A, b, x, M):
        if M is not None and self.M is None:
            raise ValueError("Incompatible M: the solver was made without a preconditioner")
        super()._replace(A, b, x, M)

    def start(self):
        self.residual(self.r)
        wp.copy(self.first, self.r)
        wp.copy(self.p, self.r)
        self.dots.compute(numbers(self.r), numbers(self.r))
        wp.copy(self.factors[0], self.dots.row())

    def cycle(self):
        set_alpha, set_omega, set_beta, turn, move = self.kernels
        state = (self.r_norm_sq, self.atol_sq, self.progress, self.broken)
        r, x, v = numbers(self.r), numbers(self.x), numbers(self.v)

        y = self.precondition(self.p, self.y)
        self.A.matvec(y, self.v, self.v, 1.0, 0.0)
        self.dots.compute(numbers(self.first), v)
        lengths = (self.shortest, self.factors)
        self.launch(set_alpha, self.batches, self.dots.row(), *state, *lengths)
        self.launch(move, self.count, self.alpha, self.batch_of, numbers(y), v, x, r)

        z = self.precondition(self.r, self.z)
        self.A.matvec(z, self.t, self.t, 1.0, 0.0)
        seen, target = (self.r, self.t)
        if self.left:
            seen, target = z, self.precondition(self.t, self.Mt)
        self.dots.compute(numbers(target), numbers(seen))
        self.dots.compute(numbers(target), numbers(target), first=1)
        self.launch(set_omega, self.batches, self.dots.results, *state[2:], *lengths)
        # Without M, z is the residual, which is about to change.
        self.launch(move, self.count, self.omega, self.batch_of, numbers(z), numbers(self.t), x, r)

        self.dots.compute(r, r)
        self.dots.compute(numbers(self.first), r, first=1)
        self.launch(set_beta, self.batches, self.dots.results, *state, self.least, self.factors)
        self.launch(turn, self.count, self.factors, self.batch_of, r, v, numbers(self.p))
