"""Shared parts of all solvers: arguments, tolerances, the loop, and reports of the result.

A solver is a `start`, which computes the residual for the vector at hand, and a `cycle` of one or
more iterations. Convergence is judged by each system's own tolerance. When the residual that the
iterations carry along has converged, it is computed anew from its definition; if that one has not,
the solver starts again from where it is, as long as that makes a difference.
"""

import functools
import math
import typing

import warp as wp
from warp._src.optim.linear.adjoint import record
from warp._src.optim.linear.dots import Dots
from warp._src.optim.linear.loops import Loops
from warp._src.optim.linear.operators import aslinearoperator, numbers, numbers_like, trusted
from warp.extend import checked, is_recording, type_repr, type_scalar_type, types_equal, unrecorded
from warp.extend.kinds import ARRAY, DIM, INTEGER, OPERATOR
from warp.sparse import BsrMatrix

_EPSILON = {wp.float64: 1e-16, wp.float32: 1e-8, wp.float16: 1e-4}


def tolerances(epsilon, tol, atol) -> tuple[float, float]:
    """Relative and absolute tolerance; one stands for the other where it is not given."""
    if tol is None and atol is None:
        tol = atol = epsilon ** (3 / 4)
    tol = atol if tol is None else tol
    atol = tol if atol is None else atol
    if not (tol >= 0 and atol >= 0):
        raise ValueError(f"expects tolerances >= 0, got tol={tol} and atol={atol}")
    return tol, atol


def _made(method, A, b, x, given):
    """A solver of pickled parts."""
    return method(A, b, x, **given)


@wp.kernel(enable_backward=False)
def _set_tolerance(
    norms: wp.array(dtype=wp.float64),
    tol: wp.float64,
    atol: wp.float64,
    least: wp.float64,
    result: wp.array(dtype=wp.float64),
):
    i = wp.tid()
    own = wp.max(tol * wp.sqrt(norms[i]), atol)
    if own == wp.float64(0.0):
        own = least
    # Nothing solves a system whose right-hand side is no number or infinite.
    if not wp.isfinite(norms[i]):
        own = wp.float64(wp.NAN)
    result[i] = own * own


@wp.kernel(enable_backward=False)
def _set_condition(
    residuals: wp.array(dtype=wp.float64),
    limits: wp.array(dtype=wp.float64),
    broken: wp.array(dtype=int),
    most: int,
    step: int,
    state: wp.array(dtype=int),
):
    """Counts iterations; goes on while a system that has not broken down has not converged."""
    state[0] = state[0] + step
    going = int(0)
    for i in range(residuals.shape[0]):
        if broken[i] < 0 and not residuals[i] <= limits[i]:
            going = 1
    if state[0] >= most:
        going = 0
    state[1] = going


@functools.cache
def _finite_kernel(scalar):
    @wp.kernel(name=f"linear_finite_{scalar.__name__}", module=__name__, enable_backward=False)
    def note_not_finite(
        x: wp.array(dtype=scalar),
        batch_of: wp.array(dtype=int),
        progress: wp.array(dtype=int),
        residuals: wp.array(dtype=wp.float64),
        broken: wp.array(dtype=int),
    ):
        """The residual of a vector that is not finite is no number, whatever the matrix has."""
        i = wp.tid()
        batch = batch_of[i]
        if batch >= 0 and not wp.isfinite(x[i]):
            residuals[batch] = wp.float64(wp.NAN)
            if broken[batch] < 0:
                broken[batch] = progress[0]

    return note_not_finite


class LinearSolverState(Loops):
    """A solver with all the memory that it needs, to be called again and again.

    Made by `CG`, `CR`, `BiCGSTAB`, `GMRES`, or by `cg(..., run=False)` and the like.

    Args:
        A: the matrix: see `aslinearoperator`.
        b: the right-hand side.
        x: the first guess, and the solution.
        tol: tolerance of the residual relative to the norm of `b`.
        atol: absolute tolerance; the larger one counts.
        maxiter: most iterations, by default the number of rows.
        M: preconditioner.
        callback: `callback(iteration, residual, tolerance)`, called at every check; a kernel of
            arrays of these (squared) if `check_every` is zero.
        check_every: how many iterations lie between checks by the host; 0: none, the device
            decides, and the solver can be captured in a graph.
        use_cuda_graph: on CUDA, replay iterations as a graph.

    Attributes:
        breakdown: the iteration in which the method could not go on for a singular or unsuitable
            matrix, None if it did not happen. Known after a call with checks by the host.
    """

    name = "solver"
    # True if the transposed system is solved by the same method with the same matrix.
    symmetric = False
    cycle_size = 1
    # Further arguments of a method, by name, with the attributes that have them.
    own_options: typing.ClassVar[dict] = {}

    @checked(A=OPERATOR, b=ARRAY, x=ARRAY, maxiter=INTEGER, M=OPERATOR, check_every=INTEGER)
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
    ):
        if type(self) is LinearSolverState:
            raise NotImplementedError("use CG, CR, BiCGSTAB or GMRES")
        self._source, self._source_M = A, M
        self.A, self.M = trusted(aslinearoperator(A)), aslinearoperator(M)
        self.b, self.x = b, x
        self._check(b, x)
        # An operator may be a part of one over several ranks.
        self.comm = getattr(self.A, "comm", None)
        if self.comm is not None and b.device.is_cuda:
            # Messages of the host are in no graph of a GPU.
            use_cuda_graph = use_cuda_graph and self.comm.supports(wp.float32, capture=True)
        self.options = (tol, atol, callback, check_every, use_cuda_graph)
        self.maxiter = int(maxiter) or getattr(self.A, "rows", self.A.shape[0])
        self.scalar = type_scalar_type(b.dtype)
        self.device, self.breakdown = b.device, None
        self._plan()
        self._allocate()

    def __reduce__(self):
        # Vectors of the method share memory, which copies of them would not.
        names = ("tol", "atol", "callback", "check_every", "use_cuda_graph")
        given = dict(zip(names, self.options, strict=True), maxiter=self.maxiter, M=self._source_M)
        given |= {name: getattr(self, place) for name, place in self.own_options.items()}
        return _made, (type(self), self._source, self.b, self.x, given)

    def _check(self, b, x) -> None:
        A = self.A
        if A.shape[0] != A.shape[1]:
            raise ValueError(f"expects a square matrix, got shape {A.shape}")
        for name, vector in (("b", b), ("x", x)):
            if vector.device != A.device:
                raise ValueError(
                    f"Incompatible {name}.device: expected {A.device}, got {vector.device}"
                )
            if not types_equal(type_scalar_type(vector.dtype), A.scalar_type):
                raise ValueError(
                    f"Incompatible {name}.dtype: expected numbers of type "
                    f"{A.scalar_type.__name__}, got {type_repr(vector.dtype)}"
                )
            if numbers(vector).size != A.shape[0]:
                raise ValueError(
                    f"Incompatible {name}.shape: expected {A.shape[0]} numbers, got "
                    f"{numbers(vector).size}"
                )
        if type_scalar_type(b.dtype) not in (wp.float16, wp.float32, wp.float64):
            raise ValueError(f"expects vectors of floats, got {b.dtype}")

    def _plan(self) -> None:
        """The batches: where they begin, and the batch of each number."""
        offsets = self.A.batch_offsets
        self.count = self.A.shape[0]
        length = self.A.max_batch_length or self.count
        self.batches = self.A.batch_count
        if offsets is None:
            offsets = wp.array([0, self.count], dtype=int, device=self.device)
        self.offsets, self.length = offsets, length
        self.batch_of = wp.empty(self.count, dtype=int, device=self.device)
        inputs = [offsets, self.batch_of]
        wp.launch(_find_batches, self.count, inputs, device=self.device)

    def _allocate(self) -> None:
        # In 64 bits: squares of numbers of 32 bits need twice their range.
        self.r_norm_sq, self.atol_sq = (
            wp.zeros(self.batches, dtype=wp.float64, device=self.device) for _ in range(2)
        )
        # The reported systems.
        self.told = (self.r_norm_sq, self.atol_sq)
        if self.scalar is not wp.float64:
            self.told = tuple(
                wp.zeros(self.batches, dtype=wp.float32, device=self.device) for _ in range(2)
            )
        self.broken = wp.empty(self.batches, dtype=int, device=self.device)
        # The smallest residual so far, squared, and the shortest step.
        self.least, self.shortest = (
            wp.empty(self.batches, dtype=wp.float64, device=self.device) for _ in range(2)
        )
        # Iterations so far, and whether there shall be more.
        self.progress = wp.zeros(2, dtype=int, device=self.device)
        self.dots = self.make_dots(2)
        self.r = self.vector()

    def make_dots(self, columns, result_type=wp.float64):
        """Inner products of so many pairs of vectors, over the ranks of the operator."""
        make = Dots if self.comm is None else self.A.make_dots
        return make(self.offsets, self.length, self.scalar, columns, result_type)

    def vector(self):
        """A vector like the right-hand side."""
        return wp.zeros_like(self.b, requires_grad=False)

    @checked(dim=DIM)
    def launch(self, kernel, dim, *inputs) -> None:
        """Launches a kernel on the solver's device."""
        wp.launch(kernel, dim, list(inputs), device=self.device)

    @checked(target=ARRAY)
    def residual(self, target, norm=True) -> None:
        """`target = b - A x`, and the squares of its norms, NaN where `x` is not finite."""
        numbers_like(self.count, target=target)
        self.A.matvec(self.x, self.b, target, -1.0, 1.0)
        if norm:
            self.dots.compute(numbers(target), numbers(target))
            wp.copy(self.r_norm_sq, self.dots.row())
            self.look_at_solution()

    def look_at_solution(self) -> None:
        """Notes systems whose solution is not finite as broken down, without a residual."""
        state = (self.progress, self.r_norm_sq, self.broken)
        kernel = _finite_kernel(self.scalar)
        self.launch(kernel, self.count, numbers(self.x), self.batch_of, *state)
        if self.comm is not None:
            # All ranks go on, or none.
            self.A.agree(self.broken)

    @checked(source=ARRAY, target=ARRAY)
    def precondition(self, source, target):
        """The vector that `M` makes of `source`: `target`, or `source` itself without `M`."""
        if self.M is None:
            return source
        self.M.matvec(source, target, target, 1.0, 0.0)
        return target

    def prepare(self) -> None:
        """Forgets what the method knows of the last system."""

    def start(self) -> None:
        """Computes the residual `r` and its norm, and what else the first cycle needs.

        Raises:
            NotImplementedError: the method has none.
        """
        raise NotImplementedError

    def cycle(self) -> None:
        """Goes on by `cycle_size` iterations.

        Raises:
            NotImplementedError: the method has none.
        """
        raise NotImplementedError

    @checked(A=OPERATOR, b=ARRAY, x=ARRAY, M=OPERATOR)
    def __call__(self, A=None, b=None, x=None, M=None):
        """Solves the system, or one of the same sizes and types.

        Returns:
            The number of iterations, the norm of the residual (computed from its definition, the
            largest of all batches) and the absolute tolerance; as arrays, the last two squared,
            if `check_every` is zero.

        Raises:
            ValueError: an argument does not have the size, type, device or batches of the first.
        """
        self._replace(A, b, x, M)
        self._check(self.b, self.x)
        if is_recording():
            record(self)
        with unrecorded():
            return self._solve()

    def _replace(self, A, b, x, M) -> None:
        if A is not None:
            self._source, own = A, aslinearoperator(A)
            for name in ("shape", "dtype", "device", "batch_count"):
                mine, other = getattr(self.A, name), getattr(own, name)
                if mine != other:
                    raise ValueError(f"Incompatible A.{name}: expected {mine}, got {other}")
            if own.batch_offsets is not self.A.batch_offsets:
                raise ValueError("A.batch_offsets must be the same array as at construction")
            if own.max_batch_length != self.A.max_batch_length:
                raise ValueError(
                    "For batched systems, A.max_batch_length must match the value used at "
                    "construction"
                )
            self.A = trusted(own)
        if M is not None:
            own = aslinearoperator(M)
            if own.shape != self.A.shape:
                raise ValueError(f"Incompatible M.shape: expected {self.A.shape}, got {own.shape}")
            if not types_equal(own.scalar_type, self.scalar):
                raise ValueError(
                    f"Incompatible M.dtype: expected {self.scalar}, got {own.scalar_type}"
                )
            self._source_M, self.M = M, own
        for name, vector in (("b", b), ("x", x)):
            if vector is None:
                continue
            held = getattr(self, name)
            for what in ("shape", "dtype", "device"):
                mine, other = getattr(held, what), getattr(vector, what)
                if mine != other:
                    raise ValueError(f"Incompatible {name}.{what}: expected {mine}, got {other}")
            setattr(self, name, vector)

    def _solve(self):
        if isinstance(self.A.matrix, BsrMatrix):
            self.A.matrix.check()
        tol, atol, callback, check_every, use_graph = self.options
        epsilon = _EPSILON.get(self.scalar, 1e-8)
        tol, atol = tolerances(epsilon, tol, atol)
        limits = (tol, atol, epsilon ** (9 / 4), self.atol_sq)
        self.broken.fill_(-1)
        self.least.fill_(math.inf)
        self.shortest.fill_(math.inf)
        self.breakdown = None
        self.dots.compute(numbers(self.b), numbers(self.b))
        self.launch(_set_tolerance, self.batches, self.dots.row(), *limits)
        self.progress.zero_()
        self.prepare()
        self.start()
        if check_every > 0:
            return self._loop_on_host(callback, check_every, use_graph and self.device.is_cuda)
        self._loop_on_device(callback, use_graph, _set_condition)
        return self.progress[0:1], *self._tell()

    def _tell(self) -> tuple:
        """The squares of residuals and tolerances in the arrays that others get."""
        if self.told[0] is not self.r_norm_sq:
            wp.utils.array_cast(self.r_norm_sq, self.told[0])
            wp.utils.array_cast(self.atol_sq, self.told[1])
        return self.told


@wp.kernel(enable_backward=False)
def _find_batches(offsets: wp.array(dtype=int), batch_of: wp.array(dtype=int)):
    """The batch of each number, -1 for those behind the last one."""
    i = wp.tid()
    low = int(0)
    high = int(offsets.shape[0] - 1)
    if i < offsets[0] or i >= offsets[high]:
        batch_of[i] = -1
    else:
        while high - low > 1:
            middle = low + (high - low) // 2
            if offsets[middle] <= i:
                low = middle
            else:
                high = middle
        batch_of[i] = low
