"""Chebyshev polynomials of a matrix: preconditioners and smoothers that need no inner products.

With D the diagonal and [a, b] an interval of eigenvalues of D^-1 A, an application multiplies the
error by the polynomial of D^-1 A that is one at zero and smallest on [a, b] among those of its
degree (Saad: Iterative Methods for Sparse Linear Systems, algorithm 12.1). The interval comes from
a few steps of the Lanczos process, whose tridiagonal matrix is read off conjugate gradients with D
as preconditioner.
"""

import functools
import math
import operator

import numpy as np

import warp as wp
from warp._src.optim.linear.dots import Dots
from warp._src.optim.linear.operators import (
    LinearOperator,
    aslinearoperator,
    diagonal_blocks,
    numbers,
    numbers_like,
)
from warp.extend import checked, type_repr, unrecorded
from warp.extend.kinds import ARRAY, BETAS, INTEGER, NUMBER, OPERATOR

# Lanczos finds the largest eigenvalue from below.
_MARGIN = 1.1


@functools.cache
def _kernels(scalar):
    kernel = functools.partial(wp.kernel, module=__name__, enable_backward=False)
    vector = wp.array(dtype=scalar)

    @kernel(name=f"chebyshev_invert_{scalar.__name__}")
    def invert(diagonal: vector, inverse: vector, bad: vector):
        i = wp.tid()
        good = diagonal[i] > scalar(0.0) and wp.isfinite(diagonal[i])
        bad[i] = wp.where(good, scalar(0.0), scalar(1.0))
        inverse[i] = wp.where(good, scalar(1.0) / diagonal[i], scalar(1.0))

    @kernel(name=f"chebyshev_seed_{scalar.__name__}")
    def seed(first: int, x: vector):
        """Numbers in [-1, 1), by the row in the whole matrix."""
        i = wp.tid()
        state = wp.rand_init(1, first + i)
        x[i] = scalar(wp.randf(state, -1.0, 1.0))

    @kernel(name=f"chebyshev_step_{scalar.__name__}")
    def step(inverse: vector, rest: vector, a: scalar, b: scalar, direction: vector, total: vector):
        i = wp.tid()
        moved = b * (inverse[i] * rest[i])
        if a != scalar(0.0):
            moved += a * direction[i]
        direction[i] = moved
        total[i] = total[i] + moved

    @kernel(name=f"chebyshev_end_{scalar.__name__}")
    def end(total: vector, y: vector, z: vector, alpha: scalar, beta: scalar):
        i = wp.tid()
        result = alpha * total[i]
        if beta != scalar(0.0):
            result += beta * y[i]
        z[i] = result

    @kernel(name=f"chebyshev_scale_{scalar.__name__}")
    def scale(inverse: vector, x: vector, y: vector):
        i = wp.tid()
        y[i] = inverse[i] * x[i]

    @kernel(name=f"chebyshev_combine_{scalar.__name__}")
    def combine(a: scalar, x: vector, b: scalar, y: vector):
        i = wp.tid()
        y[i] = a * x[i] + b * y[i]

    return invert, seed, step, end, scale, combine


def _diagonal(A):
    """The diagonal of an operator's matrix, one number a row, or None where it is not known."""
    blocks = diagonal_blocks(A)
    if blocks is None:
        return None
    steps = blocks.strides[0], blocks.strides[1] + blocks.strides[2]
    return blocks._view(0, blocks.shape[:2], steps).contiguous().flatten()


class Chebyshev(LinearOperator):
    """A polynomial of a symmetric positive definite matrix near its inverse.

    It is an operator to be given as `M` to `cg` and others, also of matrices over several ranks: an
    application is `degree - 1` products and no inner product. `smooth` takes it as a smoother.

    Args:
        A: the matrix, or an operator, square.
        degree: products with the inverse of the diagonal in an application, at least 1.
        bounds: (a, b), an interval of eigenvalues of `D^-1 A`; by default estimated.
        ratio: the estimated interval begins at its end divided by this, or at the smallest
            eigenvalue that was found if that is larger. About 4 to 10 suits a smoother.
        diagonal: D, an array of positive numbers, one for each row of numbers; by default that of
            the matrix, and the identity for an operator whose matrix is not known.
        steps: steps of the Lanczos process, each with a product, at least 1.

    Attributes:
        A: the matrix as an operator.
        degree: as given.
        bounds: the interval, two floats.

    Raises:
        TypeError: the numbers of the matrix are no floats.
        ValueError: the matrix is not positive definite as far as its diagonal and the vectors of
            the Lanczos process tell, it has several batches, or an argument has no meaning.

    Example:
        >>> import numpy as np
        >>> import warp as wp
        >>> from warp.optim.linear import Chebyshev, cg
        >>> dense = 2 * np.eye(50) - np.eye(50, k=1) - np.eye(50, k=-1)
        >>> A = wp.array(dense, dtype=wp.float64, device="cpu")
        >>> b = wp.ones(50, dtype=wp.float64, device="cpu")
        >>> x = wp.zeros_like(b)
        >>> iterations, error, tolerance = cg(A, b, x, M=Chebyshev(A), tol=1e-8)
        >>> bool(error <= tolerance)
        True
    """

    @checked(A=OPERATOR, degree=INTEGER, bounds=BETAS, ratio=NUMBER, diagonal=ARRAY, steps=INTEGER)
    def __init__(
        self,
        A,
        degree: int = 4,
        bounds: tuple[float, float] | None = None,
        ratio: float = 30.0,
        diagonal=None,
        steps: int = 12,
    ):
        self._source = A
        self.A = A = aslinearoperator(A)
        if A.shape[0] != A.shape[1]:
            raise ValueError(f"Chebyshev requires a square matrix, got shape {A.shape}")
        if A.batch_offsets is not None:
            raise ValueError("Chebyshev requires one system, got several batches")
        if A.scalar_type not in (wp.float16, wp.float32, wp.float64):
            raise TypeError(f"Chebyshev requires a matrix of floats, got {type_repr(A.dtype)}")
        self.degree, self.steps = operator.index(degree), operator.index(steps)
        self.ratio = float(ratio)
        for name in ("degree", "steps", "ratio"):
            if not getattr(self, name) >= 1:
                raise ValueError(f"Chebyshev requires {name} >= 1, got {getattr(self, name)}")
        super().__init__(A.shape, A.dtype, A.device, self._apply)
        self._kernels = _kernels(self.scalar_type)
        self._vectors: dict = {}
        self._given, self._diagonal = bounds, diagonal
        self.update()

    def __reduce__(self):
        given = self._source, self.degree, self.bounds, self.ratio, self._diagonal, self.steps
        return Chebyshev, given

    def update(self) -> None:
        """Looks at the matrix anew, after its numbers have changed.

        Graphs that were captured before go on with the earlier interval and diagonal.

        Raises:
            ValueError: it is not positive definite any more.
        """
        A, diagonal = self.A, self._diagonal
        with unrecorded():
            offsets = wp.array([0, A.shape[0]], dtype=int, device=A.device)
            make = getattr(A, "make_dots", Dots)
            self._dots = make(offsets, A.shape[0], self.scalar_type, 1, wp.float64)
            self._inverse = self._inverted(_diagonal(A) if diagonal is None else diagonal)
            self.bounds = self._estimated() if self._given is None else self._checked(self._given)

    def _checked(self, bounds):
        a, b = (float(one) for one in bounds)
        if not 0 < a < b < math.inf:
            raise ValueError(f"Chebyshev requires bounds 0 < a < b, got {tuple(bounds)}")
        return a, b

    def _launch(self, kernel, *inputs) -> None:
        wp.launch(kernel, self.shape[0], list(inputs), device=self.device)

    def _dot(self, a, b) -> float:
        self._dots.compute(a, b)
        return float(self._dots.results.numpy()[0, 0])

    def _inverted(self, diagonal):
        """The inverse of the diagonal."""
        invert, inverse = self._kernels[0], self._vector()
        if diagonal is None:
            inverse.fill_(1.0)
            return inverse
        diagonal = numbers(diagonal)
        if diagonal.size != self.shape[0] or diagonal.dtype is not self.scalar_type:
            raise ValueError(
                f"Chebyshev requires a diagonal of {self.shape[0]} numbers of type "
                f"{self.scalar_type.__name__}, got {diagonal.size} of {diagonal.dtype.__name__}"
            )
        bad = self._vector()
        self._launch(invert, diagonal, inverse, bad)
        count = round(self._dot(bad, bad))
        if count:
            own = np.flatnonzero(bad.numpy())
            where = f", {diagonal.numpy()[own[0]]:g} in row {own[0]}" if len(own) else ""
            raise ValueError(
                "Chebyshev requires a positive definite matrix, got one whose diagonal is not "
                f"positive in {count} rows{where}: pass `-A` if it is negative definite"
            )
        return inverse

    def _estimated(self) -> tuple[float, float]:
        """An interval of eigenvalues by the Lanczos process."""
        _, seed, _, _, scale, combine = self._kernels
        r, q, p, z = (self._vector() for _ in range(4))
        self._launch(seed, int(getattr(self.A, "first", 0)), r)
        self._launch(scale, self._inverse, r, z)
        wp.copy(p, z)
        alphas: list[float] = []
        betas: list[float] = []
        begin = energy = self._dot(r, z)
        for _ in range(min(self.steps, max(getattr(self.A, "rows", self.shape[0]), 1))):
            self.A.matvec(p, q, q, 1.0, 0.0)
            curvature = self._dot(p, q)
            if not 0.0 < curvature < math.inf:
                if energy == 0.0:
                    break
                raise ValueError(
                    f"Chebyshev requires a positive definite matrix, got <p, A p> = {curvature:g} "
                    f"of a vector p after {len(alphas)} steps: pass `-A` if it is negative "
                    "definite, and use cr or gmres without it if it is indefinite"
                )
            alphas.append(energy / curvature)
            self._launch(combine, -alphas[-1], q, 1.0, r)
            self._launch(scale, self._inverse, r, z)
            energy, before = self._dot(r, z), energy
            if not energy > 1e-10 * begin:
                break
            betas.append(energy / before)
            self._launch(combine, 1.0, z, betas[-1], p)
        if not alphas:
            return 0.5, 1.0
        count = len(alphas)
        inner = np.array(betas[: count - 1])
        diagonal = 1.0 / np.array(alphas)
        diagonal[1:] += inner / np.array(alphas[:-1])
        off = np.sqrt(inner) / np.array(alphas[:-1])
        found = np.linalg.eigvalsh(np.diag(diagonal) + np.diag(off, 1) + np.diag(off, -1))
        end = _MARGIN * float(found[-1])
        return max(end / self.ratio, min(float(found[0]) / _MARGIN, 0.9 * end)), end

    def _vector(self):
        """A new vector, one number a row."""
        return wp.zeros(self.shape[0], dtype=self.scalar_type, device=self.device)

    def _room(self, like):
        """Vectors of the type of another one: the residual, the direction and the sum."""
        key = like.dtype, like.shape
        if key not in self._vectors:
            made = [wp.zeros_like(like, requires_grad=False) for _ in range(3)]
            self._vectors[key] = made, [numbers(one) for one in made]
        return self._vectors[key]

    def _improve(self, like) -> None:
        """Adds the polynomial of the residual to the sum, both in `_room`."""
        (rest, direction, _), (r, d, total) = self._room(like)
        step = self._kernels[2]
        a, b = self.bounds
        middle, half = (b + a) / 2, (b - a) / 2
        ratio = half / middle
        self._launch(step, self._inverse, r, 0.0, 1.0 / middle, d, total)
        for _ in range(self.degree - 1):
            self.A.matvec(direction, rest, rest, -1.0, 1.0)
            after = 1.0 / (2.0 * middle / half - ratio)
            self._launch(step, self._inverse, r, after * ratio, 2.0 * after / half, d, total)
            ratio = after

    def _apply(self, x, y, z, alpha, beta) -> None:
        given, y, z = numbers_like(self.shape[0], x=x, y=y, z=z)
        self._wait_for_other_streams()
        _, (r, _, total) = self._room(x)
        wp.copy(r, given)
        total.zero_()
        self._improve(x)
        self._launch(self._kernels[3], total, y, z, alpha, beta)

    @checked(b=ARRAY, x=ARRAY)
    def smooth(self, b, x) -> None:
        """Reduces the error of `x`, in place, in its parts along eigenvectors of the interval.

        Args:
            b: the right-hand side.
            x: an approximate solution, of the size and type of `b`.

        Raises:
            ValueError: a vector has another size or type than the matrix, or is not packed.
        """
        _, given = numbers_like(self.shape[0], b=b, x=x)
        if b.dtype is not x.dtype or given.dtype is not self.scalar_type:
            raise ValueError(
                f"Chebyshev.smooth() requires vectors of the matrix's {self.scalar_type.__name__}, "
                f"got b of {type_repr(b.dtype)} and x of {type_repr(x.dtype)}"
            )
        with unrecorded():
            self._wait_for_other_streams()
            (rest, _, _), (_, _, total) = self._room(b)
            self.A.matvec(x, b, rest, -1.0, 1.0)
            total.zero_()
            self._improve(b)
            self._launch(self._kernels[3], total, given, given, 1.0, 1.0)
