"""Direct solvers: a matrix is factored once and solved with many times, with gradients.

The adjoint of A x = b is a solution with the same factors, transposed; that of a least-squares
problem min |A x - b| has w = (A^T A)^-1 g, the gradient A w of b, and r w^T - A w x^T of A, r being
the residual b - A x (G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10, 1973).
"""

import numpy as np

import warp as wp
from warp._src.optim.linear.adjoint import _kernels
from warp._src.optim.linear.direct_factors import Factors, UntrustedFactorsError
from warp._src.optim.linear.operators import blocks_of, numbers
from warp.extend import (
    checked,
    is_array,
    note_writes,
    notice,
    record_adjoint,
    type_scalar_type,
    type_size,
    unrecorded,
)
from warp.extend.kinds import ARRAY
from warp.sparse import BsrMatrix

_SCALARS = (wp.float16, wp.float32, wp.float64)


def _is_on_gpu(A):
    return A.device.is_cuda


class DirectSolver:
    """A factored matrix, made by `ldlt`, `cholesky`, `lu` or `qr`.

    Attributes:
        kind: of the factors.
        shape: rows and columns of numbers.
        condition: an estimate of the condition number in the one-norm, 0 for one that is not
            square.
        nnz: numbers that the factors store.
    """

    def __init__(self, kind, A):
        if not isinstance(A, BsrMatrix) and not is_array(A):
            raise TypeError(f"expects a BsrMatrix or an array, but got '{type(A).__name__}'")
        self._scalar = type_scalar_type(A.dtype)
        if self._scalar not in _SCALARS:
            raise TypeError(f"expects a matrix of floats, but got '{A.dtype}'")
        self.kind, self.matrix, self._is_recorded = kind, A, False
        self._factors = self._factored(A)
        self._residuals = kind == "qr" and self.shape[0] != self.shape[1]

    def __reduce__(self):
        # Factors stay in their process; the matrix is factored anew.
        return DirectSolver, (self.kind, self.matrix)

    def _factored(self, A):
        """Factors on a GPU where cuDSS is installed and finds them, else on the host."""
        if _is_on_gpu(A):
            from warp._src.optim.linear import direct_cudss

            reason = "cuDSS has no factors for least squares"
            try:
                if self.kind in direct_cudss.KINDS:
                    direct_cudss.library()
                    return direct_cudss.CudssFactors(self.kind, A, self._scalar)
            except ImportError as error:
                reason = str(error)
            except UntrustedFactorsError as error:
                reason = f"cuDSS: {error}"
            notice(
                f"{self.kind}: the matrix is factored on the host, from a copy of {A.device}; "
                f"{reason}"
            )
        return Factors(self.kind, A, self._scalar)

    @property
    def shape(self):
        """Rows and columns of numbers."""
        return self._factors.shape

    @property
    def condition(self) -> float:
        """An estimate of the condition number; 0 for a matrix that is not square."""
        return self._factors.condition

    @property
    def nnz(self) -> int:
        """Numbers that the factors store."""
        return self._factors.nnz

    def refactor(self, A=None) -> None:
        """Factors the matrix again, or another one; one of the same pattern is not analysed anew.

        Raises:
            FactorError: the matrix has no factors; this solver has none then.
        """
        self.matrix = self.matrix if A is None else A
        if self._is_recorded:
            # A tape needs the factors of now for its adjoint.
            self._factors, self._is_recorded = self._factored(self.matrix), False
            return
        try:
            self._factors.factorize(self.matrix)
        except UntrustedFactorsError:
            self._factors = self._factored(self.matrix)

    @checked(b=ARRAY, x=ARRAY)
    def solve(self, b, x=None):
        """Solves A x = b, or minimises |A x - b| for more rows than columns.

        Args:
            b: one right-hand side, of numbers or of vectors that together have as many; or an
                array of two dimensions with one in each row.
            x: array for the solution; a new one if None.

        Returns:
            `x`. A tape records the solution: its gradient goes to `b` and to the matrix.

        Raises:
            ValueError: sizes or devices do not fit.
            TypeError: the arrays are not of floats.
        """
        self._check(b, self.shape[0], "b")
        if x is None:
            x = self._new(b)
        self._check(x, self.shape[1], "x")
        count = b.size * type_size(b.dtype) // self.shape[0]
        if count * self.shape[1] != x.size * type_size(x.dtype):
            raise ValueError(f"expects 'x' for {count} right-hand sides, but got {x.shape}")
        rows = self._factors.take(b, self.shape[0])
        found = self._factors.solve(rows)
        factors, matrix = self._factors, self.matrix
        values = matrix.values if isinstance(matrix, BsrMatrix) else matrix
        if x.requires_grad and (b.requires_grad or values.requires_grad):
            self._is_recorded |= record_adjoint(
                lambda: self._backward(factors, matrix, b, x, rows, found), [b, values, x]
            )
        with unrecorded():
            note_writes("solve", x)
            factors.give(found, x)
        return x

    def _new(self, b):
        """An array for the solution, like the right-hand side."""
        grad = b.requires_grad or getattr(self.matrix, "requires_grad", False)
        shape, dtype = b.shape, b.dtype
        if self.shape[0] != self.shape[1]:
            dtype = type_scalar_type(b.dtype)
            shape = (self.shape[1],) if b.ndim == 1 else (b.shape[0], self.shape[1])
        return wp.zeros(shape, dtype=dtype, device=b.device, requires_grad=grad)

    def _check(self, array, width, name):
        """Refuses an array that does not have whole right-hand sides of floats."""
        if type_scalar_type(array.dtype) not in _SCALARS:
            raise TypeError(f"expects '{name}' of floats, but got '{array.dtype}'")
        length = array.shape[-1] * type_size(array.dtype) if array.ndim in (1, 2) else -1
        if length != width:
            raise ValueError(
                f"expects '{name}' with {width} numbers for each right-hand side, but got shape "
                f"{array.shape} of '{array.dtype}'"
            )

    def _backward(self, factors, matrix, b, x, rows, found):
        seeds = factors.take(x.grad, self.shape[1])
        x.grad.zero_()
        values = matrix.values if isinstance(matrix, BsrMatrix) else matrix
        if self._residuals:
            small = factors.solve(seeds, 2)
            left = _times(matrix, small)
            pairs = [(left, found), (_times(matrix, found) - rows, small)]
        else:
            left = factors.solve(seeds, 1)
            pairs = [(left, found)]
        if b.requires_grad:
            _add(b.grad, factors.cast(left, b.grad))
        if values.requires_grad:
            for one, other in pairs:
                flat = (factors.cast(rows, values) for rows in (one, other))
                for row, column in zip(*map(_split, flat, self.shape), strict=True):
                    _subtract_outer(matrix, values, row, column)


def _times(matrix, rows):
    """The matrix times each row."""
    from warp._src.optim.linear.direct_factors import rows_of

    shape, offsets, columns, values = rows_of(matrix)
    owner = np.repeat(np.arange(shape[0]), np.diff(offsets))
    out = np.zeros((len(rows), shape[0]))
    for k, row in enumerate(rows):
        np.add.at(out[k], owner, values * row[columns])
    return out


def _split(flat, width):
    """The rows of a flat array."""
    return [flat[at : at + width] for at in range(0, flat.size, width)]


def _add(grad, source):
    add, *_ = _kernels(type_scalar_type(grad.dtype), type_scalar_type(grad.dtype))
    flat = numbers(grad.flatten())
    wp.launch(add, flat.size, [source, flat], device=grad.device)


def _subtract_outer(matrix, values, left, right):
    """Subtracts an outer product from the gradient of a matrix, where it stores numbers."""
    scalar = type_scalar_type(values.grad.dtype)
    _, add_dense, _, add_sparse = _kernels(scalar, scalar)
    if isinstance(matrix, BsrMatrix):
        grad = blocks_of(values.grad)[: matrix.nnz]
        inputs = [left, right, matrix.uncompress_rows(), matrix.columns, grad]
        wp.launch(add_sparse, grad.shape, inputs, device=values.device)
    else:
        wp.launch(add_dense, values.shape, [left, right, values.grad], device=values.device)


@checked()
def ldlt(A) -> DirectSolver:
    """Factors a symmetric matrix as L D L^T, without pivoting for size.

    It need not be definite, but its leading minors in the order of elimination must not vanish.

    Args:
        A: a `BsrMatrix`, or an array of two dimensions; of both triangles.

    Raises:
        FactorError: the matrix is not symmetric, or a pivot is zero up to rounding; `index` and
            `pivot` tell which.
        ImportError: the component `libwarp_eigen.so` is not there.

    Example:
        >>> import numpy as np
        >>> import warp as wp
        >>> import warp.optim.linear
        >>> A = wp.array([[2.0, 1.0], [1.0, -3.0]], dtype=wp.float64, device="cpu")
        >>> b = wp.array([4.0, -5.0], dtype=wp.float64, device="cpu")
        >>> np.round(wp.optim.linear.ldlt(A).solve(b).numpy(), 12).tolist()
        [1.0, 2.0]
    """
    return DirectSolver("ldlt", A)


@checked()
def cholesky(A) -> DirectSolver:
    """Factors a symmetric positive definite matrix; see `ldlt`.

    Raises:
        FactorError: the matrix is not symmetric or not positive definite.
    """
    return DirectSolver("cholesky", A)


@checked()
def lu(A) -> DirectSolver:
    """Factors a square matrix as L U with partial pivoting.

    Args:
        A: a `BsrMatrix`, or an array of two dimensions.

    Raises:
        FactorError: the matrix is singular up to rounding.
    """
    return DirectSolver("lu", A)


@checked()
def qr(A) -> DirectSolver:
    """Factors a matrix with at least as many rows as columns as Q R; `solve` is least squares.

    Args:
        A: a `BsrMatrix`, or an array of two dimensions.

    Raises:
        FactorError: the columns depend on each other; `index` is one that depends on others.
    """
    return DirectSolver("qr", A)
