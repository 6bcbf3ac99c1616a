"""Direct solvers: a matrix is factored once and solved with many times, with gradients.

The adjoint of A x = b is a solution with the same factors, transposed; that of a least-squares
problem min |A x - b| has w = (A^T A)^-1 g, the gradient A w of b, and r w^T - A w x^T of A, r being
the residual b - A x (G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10, 1973).
"""

import numpy as np

import warp as wp
from warp._src.optim.linear.adjoint import _kernels
from warp._src.optim.linear.direct_factors import Factors
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
        self.kind, self.matrix = kind, A
        if A.device.is_cuda:
            notice(f"{kind}: the matrix is factored on the host, from a copy of {A.device}")
        self._factors = Factors(kind, A, self._scalar)
        self._residuals = kind == "qr" and self.shape[0] != self.shape[1]

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
        self._factors.factorize(self.matrix)

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
        rows = self._rows(b, self.shape[0], "b")
        if x is None:
            x = self._new(b)
        self._rows(x, self.shape[1], "x")
        if len(rows) * self.shape[1] != x.size * type_size(x.dtype):
            raise ValueError(f"expects 'x' for {len(rows)} right-hand sides, but got {x.shape}")
        found = self._factors.solve(rows)
        factors, matrix = self._factors, self.matrix
        values = matrix.values if isinstance(matrix, BsrMatrix) else matrix
        if x.requires_grad and (b.requires_grad or values.requires_grad):
            left = rows.copy()
            record_adjoint(
                lambda: self._backward(factors, matrix, b, x, left, found), [b, values, x]
            )
        with unrecorded():
            note_writes("solve", x)
            _assign(x, found)
        return x

    def _new(self, b):
        """An array for the solution, like the right-hand side."""
        grad = b.requires_grad or getattr(self.matrix, "requires_grad", False)
        shape, dtype = b.shape, b.dtype
        if self.shape[0] != self.shape[1]:
            dtype = type_scalar_type(b.dtype)
            shape = (self.shape[1],) if b.ndim == 1 else (b.shape[0], self.shape[1])
        return wp.zeros(shape, dtype=dtype, device=b.device, requires_grad=grad)

    def _rows(self, array, width, name):
        """An array's numbers, one right-hand side in each row."""
        if type_scalar_type(array.dtype) not in _SCALARS:
            raise TypeError(f"expects '{name}' of floats, but got '{array.dtype}'")
        length = array.shape[-1] * type_size(array.dtype) if array.ndim in (1, 2) else -1
        if length != width:
            raise ValueError(
                f"expects '{name}' with {width} numbers for each right-hand side, but got shape "
                f"{array.shape} of '{array.dtype}'"
            )
        return array.numpy().astype(np.float64).reshape(-1, width)

    def _backward(self, factors, matrix, b, x, rows, found):
        seeds = self._rows(x.grad, self.shape[1], "the gradient of 'x'")
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
            _add(b.grad, left)
        if values.requires_grad:
            for one, other in pairs:
                for row, column in zip(one, other, strict=True):
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


def _array(row, like):
    scalar = type_scalar_type(like.dtype)
    return wp.array(row.reshape(-1), dtype=scalar, device=like.device)


def _assign(x, rows):
    scalar = type_scalar_type(x.dtype)
    dtype = np.dtype(wp.dtype_to_numpy(scalar))
    vector = x.shape if type_size(x.dtype) == 1 else (*x.shape, type_size(x.dtype))
    x.assign(rows.astype(dtype).reshape(vector))


def _add(grad, rows):
    add, *_ = _kernels(type_scalar_type(grad.dtype), type_scalar_type(grad.dtype))
    flat = numbers(grad.flatten())
    wp.launch(add, flat.size, [_array(rows, grad), flat], device=grad.device)


def _subtract_outer(matrix, values, row, column):
    """Subtracts an outer product from the gradient of a matrix, where it stores numbers."""
    scalar = type_scalar_type(values.grad.dtype)
    _, add_dense, _, add_sparse = _kernels(scalar, scalar)
    left, right = _array(row, values), _array(column, values)
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
