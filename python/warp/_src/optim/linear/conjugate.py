"""Conjugate gradients and conjugate residuals.

After Saad, "Iterative methods for sparse linear systems", 2nd edition, algorithms 6.20 and 9.1,
with a preconditioner. Factors of vectors stay on the device, one per system, in 64 bits.
"""

import functools
import operator
import typing

import warp as wp
from warp._src.optim.linear.operators import numbers, numbers_like
from warp._src.optim.linear.state import LinearSolverState
from warp.extend import checked
from warp.extend.kinds import ARRAY, INTEGER, SOLVER

# In place of the sign of products that had both.
INDEFINITE = wp.constant(2.0)


@wp.func
def quotient(
    above: wp.float64,
    below: wp.float64,
    residual: wp.float64,
    limit: wp.float64,
    iteration: int,
    broken: wp.array(dtype=int),
    batch: int,
) -> wp.float64:
    """`above / below`, or zero for a system that has converged or broken down; the latter is noted.

    A denominator that is zero or no number is a breakdown.
    """
    if broken[batch] >= 0 or residual <= limit:
        return wp.float64(0.0)
    result = above / below
    if below == wp.float64(0.0) or not wp.isfinite(result):
        broken[batch] = iteration
        return wp.float64(0.0)
    return result


@wp.func
def note_sign(value: wp.float64, signs: wp.array(dtype=wp.float64), batch: int):
    """Leaves the sign of a product in `signs`, or `INDEFINITE` once it has changed.

    For a definite matrix, positive or negative, p^T A p has one sign for all p. Iterations go on
    where it has not, as they solve many such systems.
    """
    before = signs[batch]
    if before == wp.float64(INDEFINITE) or before * value < wp.float64(0.0):
        signs[batch] = wp.float64(INDEFINITE)
    else:
        signs[batch] = wp.sign(value)


@wp.func
def step_length(
    length: wp.float64,
    shortest: wp.array(dtype=wp.float64),
    iteration: int,
    broken: wp.array(dtype=int),
    batch: int,
) -> wp.float64:
    """`length`, or zero if it is out of proportion, which is noted as a breakdown.

    Lengths of steps are the reciprocals of averages of eigenvalues: if one is 1e14 times another,
    the matrix is as good as singular, and the step would ruin the solution.
    """
    size = wp.abs(length)
    if size > wp.float64(1e14) * shortest[batch]:
        if broken[batch] < 0:
            broken[batch] = iteration
        return wp.float64(0.0)
    if size > wp.float64(0.0):
        shortest[batch] = wp.min(shortest[batch], size)
    return length


@wp.func
def watch(
    residual: wp.float64,
    least: wp.array(dtype=wp.float64),
    iteration: int,
    broken: wp.array(dtype=int),
    batch: int,
):
    """Notes a system whose residual has become 1e8 times what it was, or no number."""
    if not residual <= wp.float64(1e16) * least[batch] and broken[batch] < 0:
        broken[batch] = iteration
    least[batch] = wp.min(least[batch], residual)


@functools.cache
def _factor_kernels():
    kernel = functools.partial(wp.kernel, module=__name__, enable_backward=False)

    @kernel(name="linear_step_length")
    def set_step(
        above: wp.array(dtype=wp.float64),
        below: wp.array(dtype=wp.float64),
        definite: bool,
        residuals: wp.array(dtype=wp.float64),
        limits: wp.array(dtype=wp.float64),
        progress: wp.array(dtype=int),
        broken: wp.array(dtype=int),
        shortest: wp.array(dtype=wp.float64),
        signs: wp.array2d(dtype=wp.float64),
        alpha: wp.array(dtype=wp.float64),
    ):
        i = wp.tid()
        length = quotient(above[i], below[i], residuals[i], limits[i], progress[0], broken, i)
        if definite and length != wp.float64(0.0):
            note_sign(above[i], signs[0], i)
            note_sign(below[i], signs[1], i)
        alpha[i] = step_length(length, shortest, progress[0], broken, i)

    @kernel(name="linear_turn")
    def set_turn(
        squares: wp.array(dtype=wp.float64),
        product: wp.array(dtype=wp.float64),
        before: wp.array(dtype=wp.float64),
        alpha: wp.array(dtype=wp.float64),
        residuals: wp.array(dtype=wp.float64),
        progress: wp.array(dtype=int),
        broken: wp.array(dtype=int),
        least: wp.array(dtype=wp.float64),
        beta: wp.array(dtype=wp.float64),
    ):
        i = wp.tid()
        beta[i] = wp.float64(0.0)
        # A system at rest keeps its residual.
        if alpha[i] != wp.float64(0.0):
            residuals[i] = squares[i]
            watch(squares[i], least, progress[0], broken, i)
            if before[i] != wp.float64(0.0):
                beta[i] = product[i] / before[i]
        before[i] = product[i]

    return set_step, set_turn


@functools.cache
def vector_kernels(scalar):
    """Sums of vectors with a factor for each system; numbers of no system stay as they are."""
    kernel = functools.partial(wp.kernel, module=__name__, enable_backward=False)
    vector = wp.array(dtype=scalar)

    @kernel(name=f"linear_move_{scalar.__name__}")
    def move(
        factor: wp.array(dtype=wp.float64),
        batch_of: wp.array(dtype=int),
        p: vector,
        q: vector,
        x: vector,
        r: vector,
    ):
        """x += factor p, r -= factor q."""
        i = wp.tid()
        batch = batch_of[i]
        if batch >= 0:
            x[i] = scalar(wp.float64(x[i]) + factor[batch] * wp.float64(p[i]))
            r[i] = scalar(wp.float64(r[i]) - factor[batch] * wp.float64(q[i]))

    @kernel(name=f"linear_turn_to_{scalar.__name__}")
    def turn(
        factor: wp.array(dtype=wp.float64), batch_of: wp.array(dtype=int), z: vector, p: vector
    ):
        """p = z + factor p."""
        i = wp.tid()
        batch = batch_of[i]
        if batch >= 0:
            p[i] = scalar(wp.float64(z[i]) + factor[batch] * wp.float64(p[i]))

    return move, turn


class _Restartable(LinearSolverState):
    """A method that may begin anew after every `restart` iterations.

    Raises:
        TypeError, ValueError: `restart` is no positive integer.
    """

    symmetric = True

    own_options: typing.ClassVar[dict] = {"restart": "restart"}

    @checked(**SOLVER, restart=INTEGER)
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
        *,
        restart: int | None = None,
    ):
        if restart is not None:
            try:
                restart = None if isinstance(restart, bool) else operator.index(restart)
            except TypeError:
                restart = None
            if restart is None:
                raise TypeError("restart must be an integer or None")
            if restart <= 0:
                raise ValueError("restart must be positive")
            self.cycle_size = restart
        self.restart = restart
        super().__init__(A, b, x, tol, atol, maxiter, M, callback, check_every, use_cuda_graph)

    def _allocate(self):
        super()._allocate()
        self.alpha, self.beta, self.before = (
            wp.zeros(self.batches, dtype=wp.float64, device=self.device) for _ in range(3)
        )
        # Signs of the denominators and numerators of steps, for methods that need one sign.
        self.signs = wp.zeros((2, self.batches), dtype=wp.float64, device=self.device)

    def prepare(self):
        self.signs.zero_()

    def indefinite_systems(self):
        """Mask of the systems whose matrix or preconditioner has shown to be indefinite."""
        return (self.signs.numpy() == INDEFINITE).any(axis=0)

    def cycle(self):
        for _ in range(self.cycle_size):
            self.iterate()
        if self.restart is not None:
            self.start()

    def iterate(self) -> None:
        """One iteration."""
        raise NotImplementedError

    @checked()
    def set_step(self, above, below, definite):
        kernel, _ = _factor_kernels()
        state = (self.r_norm_sq, self.atol_sq, self.progress, self.broken, self.shortest)
        self.launch(kernel, self.batches, above, below, definite, *state, self.signs, self.alpha)

    @checked()
    def set_turn(self, squares, product):
        _, kernel = _factor_kernels()
        arrays = (squares, product, self.before, self.alpha, self.r_norm_sq)
        state = (self.progress, self.broken, self.least, self.beta)
        self.launch(kernel, self.batches, *arrays, *state)

    @checked(p=ARRAY, q=ARRAY, x=ARRAY, r=ARRAY)
    def move(self, p, q, x, r):
        kernel, _ = vector_kernels(self.scalar)
        vectors = numbers_like(self.count, p=p, q=q, x=x, r=r)
        self.launch(kernel, self.count, self.alpha, self.batch_of, *vectors)

    @checked(z=ARRAY, p=ARRAY)
    def turn(self, z, p):
        _, kernel = vector_kernels(self.scalar)
        vectors = numbers_like(self.count, z=z, p=p)
        self.launch(kernel, self.count, self.beta, self.batch_of, *vectors)


class CG(_Restartable):
    """The method of conjugate gradients, for symmetric matrices that are definite.

    They may be positive or negative definite; a preconditioner has to be definite, too. Others are
    tried, with a warning if they are not solved.
    Arguments as for `LinearSolverState`, and `restart`: after how many iterations to begin anew,
    with the residual as it is by definition; checks lie between such cycles.
    """

    name = "cg"

    def _allocate(self):
        super()._allocate()
        self.p, self.q = self.vector(), self.vector()
        self.z = self.vector()

    def start(self):
        self.residual(self.r)
        z = self.precondition(self.r, self.z)
        self.dots.compute(numbers(self.r), numbers(z))
        wp.copy(self.before, self.dots.row())
        wp.copy(self.p, z)

    def iterate(self):
        """One iteration."""
        self.A.matvec(self.p, self.q, self.q, 1.0, 0.0)
        self.dots.compute(numbers(self.p), numbers(self.q))
        self.set_step(self.before, self.dots.row(), True)
        self.move(self.p, self.q, self.x, self.r)
        z = self.precondition(self.r, self.z)
        r = numbers(self.r)
        pairs = [(r, r)] if self.M is None else [(r, r), (r, numbers(z))]
        self.dots.compute_all(pairs)
        self.set_turn(self.dots.row(), self.dots.row(len(pairs) - 1))
        self.turn(z, self.p)


class CR(_Restartable):
    """The method of conjugate residuals, for symmetric matrices; arguments as for `CG`.

    The residual never grows for a positive definite matrix.
    """

    name = "cr"

    def _allocate(self):
        super()._allocate()
        self.p, self.Ap, self.Az = (self.vector() for _ in range(3))
        self.z, self.MAp, self.unused = (self.vector() for _ in range(3))

    def start(self):
        self.residual(self.r)
        z = self.precondition(self.r, self.z)
        wp.copy(self.p, z)
        self.A.matvec(z, self.Az, self.Az, 1.0, 0.0)
        wp.copy(self.Ap, self.Az)
        self.dots.compute(numbers(z), numbers(self.Az))
        wp.copy(self.before, self.dots.row())

    def iterate(self):
        """One iteration."""
        MAp = self.precondition(self.Ap, self.MAp)
        self.dots.compute(numbers(self.Ap), numbers(MAp))
        self.set_step(self.before, self.dots.row(), False)
        self.move(self.p, self.Ap, self.x, self.r)
        z = self.r
        if self.M is not None:
            z = self.z
            self.move(MAp, MAp, self.unused, z)
        self.A.matvec(z, self.Az, self.Az, 1.0, 0.0)
        r = numbers(self.r)
        self.dots.compute_all([(r, r), (numbers(z), numbers(self.Az))])
        self.set_turn(self.dots.row(), self.dots.row(1))
        self.turn(z, self.p)
        self.turn(self.Az, self.Ap)
