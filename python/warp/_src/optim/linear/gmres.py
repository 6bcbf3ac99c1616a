"""Restarted generalised minimal residuals, after Saad, "Iterative methods for sparse linear
systems", algorithm 6.9, with classical Gram-Schmidt done twice.

The least-squares problem of a cycle is solved on the device by rotations, a thread per system.
"""

import functools
import typing

import warp as wp
from warp._src.optim.linear.operators import numbers
from warp._src.optim.linear.state import LinearSolverState
from warp.extend import checked
from warp.extend.kinds import ARRAY, FLAG, INTEGER, SOLVER


@functools.cache
def _kernels(scalar):
    kernel = functools.partial(wp.kernel, module=__name__, enable_backward=False)
    suffix = scalar.__name__
    vector, basis = wp.array(dtype=scalar), wp.array2d(dtype=scalar)
    squares, counters = wp.array2d(dtype=wp.float64), wp.array(dtype=int)
    hessenberg = wp.array3d(dtype=wp.float64)

    @kernel(name=f"gmres_normalize_{suffix}")
    def normalize(w: vector, norms: wp.array(dtype=wp.float64), batch_of: counters, result: vector):
        i = wp.tid()
        batch = batch_of[i]
        if batch >= 0:
            result[i] = scalar(0.0)
            if norms[batch] > wp.float64(0.0):
                result[i] = scalar(wp.float64(w[i]) / norms[batch])

    @kernel(name=f"gmres_subtract_{suffix}")
    def subtract(V: basis, factors: squares, count: int, batch_of: counters, w: vector):
        i = wp.tid()
        batch = batch_of[i]
        if batch >= 0:
            total = wp.float64(w[i])
            for k in range(count):
                total -= factors[k, batch] * wp.float64(V[k, i])
            w[i] = scalar(total)

    @kernel(name=f"gmres_combine_{suffix}")
    def combine(V: basis, y: squares, batch_of: counters, w: vector):
        i = wp.tid()
        batch = batch_of[i]
        total = wp.float64(0.0)
        if batch >= 0:
            for k in range(y.shape[0]):
                total += y[k, batch] * wp.float64(V[k, i])
        w[i] = scalar(total)

    @kernel(name=f"gmres_add_{suffix}")
    def add(w: vector, batch_of: counters, x: vector):
        i = wp.tid()
        if batch_of[i] >= 0:
            x[i] = scalar(wp.float64(x[i]) + wp.float64(w[i]))

    @kernel(name=f"gmres_note_{suffix}")
    def note(factors: squares, column: int, H: hessenberg):
        """Adds to a column of H."""
        row, batch = wp.tid()
        H[batch, row, column] = H[batch, row, column] + factors[row, batch]

    @kernel(name=f"gmres_note_norm_{suffix}")
    def note_norm(
        square: wp.array(dtype=wp.float64),
        column: int,
        H: hessenberg,
        norms: wp.array(dtype=wp.float64),
        exhausted: counters,
    ):
        """The norm of what is left of a vector, zero if that is rounding only."""
        batch = wp.tid()
        norm = wp.sqrt(square[batch])
        whole = norm * norm
        for row in range(column + 1):
            whole += H[batch, row, column] * H[batch, row, column]
        if not norm > wp.float64(wp.static(4e-16 if scalar is wp.float64 else 2e-7)) * wp.sqrt(
            whole
        ):
            norm = wp.float64(0.0)
            exhausted[batch] = 1
        norms[batch] = norm
        H[batch, column + 1, column] = norm

    @kernel(name=f"gmres_root_{suffix}")
    def root(square: wp.array(dtype=wp.float64), norms: wp.array(dtype=wp.float64)):
        batch = wp.tid()
        norms[batch] = wp.sqrt(square[batch])

    @kernel(name=f"gmres_solve_{suffix}")
    def solve(H: hessenberg, first: wp.array(dtype=wp.float64), rhs: squares, y: squares):
        """Least squares of H y = first e_0, by rotations and substitution."""
        batch = wp.tid()
        size = y.shape[0]
        rhs[0, batch] = first[batch]
        for k in range(size):
            rhs[k + 1, batch] = wp.float64(0.0)
        for k in range(size):
            length = wp.sqrt(
                H[batch, k, k] * H[batch, k, k] + H[batch, k + 1, k] * H[batch, k + 1, k]
            )
            if length > wp.float64(0.0):
                c = H[batch, k, k] / length
                s = H[batch, k + 1, k] / length
                for j in range(k, size):
                    upper = H[batch, k, j]
                    lower = H[batch, k + 1, j]
                    H[batch, k, j] = c * upper + s * lower
                    H[batch, k + 1, j] = c * lower - s * upper
                top = rhs[k, batch]
                rhs[k, batch] = c * top
                rhs[k + 1, batch] = -s * top
        largest = wp.float64(0.0)
        for k in range(size):
            largest = wp.max(largest, wp.abs(H[batch, k, k]))
        for back in range(size):
            k = size - 1 - back
            total = rhs[k, batch]
            for j in range(k + 1, size):
                total -= H[batch, k, j] * y[j, batch]
            y[k, batch] = wp.float64(0.0)
            if wp.abs(H[batch, k, k]) > wp.float64(1e-15) * largest:
                y[k, batch] = total / H[batch, k, k]

    @kernel(name=f"gmres_judge_{suffix}")
    def judge(
        before: wp.array(dtype=wp.float64),
        residuals: wp.array(dtype=wp.float64),
        limits: wp.array(dtype=wp.float64),
        exhausted: counters,
        progress: counters,
        broken: counters,
    ):
        """A cycle that got nowhere in a space that cannot be extended is a breakdown."""
        i = wp.tid()
        rest = residuals[i]
        unsolved = broken[i] < 0 and not rest <= limits[i]
        if unsolved and exhausted[i] != 0 and not rest < wp.float64(0.999999) * before[i]:
            broken[i] = progress[0]
        before[i] = rest

    return normalize, subtract, combine, add, note, note_norm, root, solve, judge


class GMRES(LinearSolverState):
    """Restarted generalised minimal residuals, for any matrix.

    Arguments as for `LinearSolverState`; `restart`: iterations of a cycle, whose vectors are all
    kept; `is_left_preconditioner`: minimise the residual as `M` sees it. Checks lie between cycles.
    """

    name = "gmres"

    own_options: typing.ClassVar[dict] = {"restart": "cycle_size", "is_left_preconditioner": "left"}

    @checked(**SOLVER, restart=INTEGER, is_left_preconditioner=FLAG)
    def __init__(
        self,
        A,
        b,
        x,
        tol=None,
        atol=None,
        restart=31,
        maxiter=0,
        M=None,
        callback=None,
        check_every=31,
        use_cuda_graph=True,
        is_left_preconditioner=False,
    ):
        if restart <= 0:
            raise ValueError(f"restart must be positive, got {restart}")
        self.cycle_size = int(restart)
        self.left = is_left_preconditioner
        super().__init__(A, b, x, tol, atol, maxiter, M, callback, check_every, use_cuda_graph)

    def _allocate(self):
        # All ranks of an operator have cycles of one length, whatever their part.
        rows = getattr(self.A, "rows", self.A.shape[0])
        self.cycle_size = max(1, min(self.cycle_size, rows))
        super()._allocate()
        size, device = self.cycle_size, self.device
        length = self.b.size
        self.V = wp.zeros((size + 1, length), dtype=self.b.dtype, device=device)
        self.basis = numbers(self.V).reshape((size + 1, self.count))
        self.H = wp.zeros((self.batches, size + 1, size), dtype=wp.float64, device=device)
        self.rhs = wp.zeros((size + 1, self.batches), dtype=wp.float64, device=device)
        self.y = wp.zeros((size, self.batches), dtype=wp.float64, device=device)
        self.norms, self.first = (
            wp.zeros(self.batches, dtype=wp.float64, device=device) for _ in range(2)
        )
        self.before = wp.zeros_like(self.r_norm_sq)
        self.exhausted = wp.zeros_like(self.broken)
        self.projections = self.make_dots(size + 1)
        self.kernels = _kernels(self.scalar)
        self.w, self.u = (wp.zeros(length, dtype=self.b.dtype, device=device) for _ in range(2))

    def start(self):
        self.residual(self.r)
        wp.copy(self.before, self.r_norm_sq)

    @checked(source=ARRAY, target=ARRAY)
    def apply(self, source, target) -> None:
        """The operator of the Krylov space: A M, or M A."""
        if self.M is None:
            self.A.matvec(source, target, target, 1.0, 0.0)
        elif self.left:
            self.A.matvec(source, self.u, self.u, 1.0, 0.0)
            self.M.matvec(self.u, target, target, 1.0, 0.0)
        else:
            self.M.matvec(source, self.u, self.u, 1.0, 0.0)
            self.A.matvec(self.u, target, target, 1.0, 0.0)

    def cycle(self):
        normalize, _, combine, add, _, _, root, solve, judge = self.kernels
        self.H.zero_()
        self.exhausted.zero_()
        z = self.r.flatten()
        if self.left and self.M is not None:
            self.M.matvec(z, self.w, self.w, 1.0, 0.0)
            z = self.w
        self.dots.compute(numbers(z), numbers(z))
        self.launch(root, self.batches, self.dots.row(), self.first)
        self.launch(normalize, self.count, numbers(z), self.first, self.batch_of, self.basis[0])
        for k in range(self.cycle_size):
            self._extend(k)
        self.launch(solve, self.batches, self.H, self.first, self.rhs, self.y)
        w = numbers(self.w)
        self.launch(combine, self.count, self.basis, self.y, self.batch_of, w)
        step = self.w
        if self.M is not None and not self.left:
            self.M.matvec(self.w, self.u, self.u, 1.0, 0.0)
            step = self.u
        self.launch(add, self.count, numbers(step), self.batch_of, numbers(self.x))
        self.residual(self.r)
        state = (self.before, self.r_norm_sq, self.atol_sq, self.exhausted, self.progress)
        self.launch(judge, self.batches, *state, self.broken)

    def _extend(self, k) -> None:
        """Finds the next vector of the basis."""
        normalize, subtract, _, _, note, note_norm, *_ = self.kernels
        self.apply(self.V[k], self.w)
        w = numbers(self.w)
        columns = self.basis[: k + 1]
        repeated = w._view(0, (k + 1, self.count), (0, w.item_size))
        for _ in range(2):
            self.projections.compute(columns, repeated)
            factors = self.projections.results
            self.launch(subtract, self.count, self.basis, factors, k + 1, self.batch_of, w)
            self.launch(note, (k + 1, self.batches), factors, k, self.H)
        self.dots.compute(w, w)
        arrays = (self.H, self.norms, self.exhausted)
        self.launch(note_norm, self.batches, self.dots.row(), k, *arrays)
        self.launch(normalize, self.count, w, self.norms, self.batch_of, self.basis[k + 1])
