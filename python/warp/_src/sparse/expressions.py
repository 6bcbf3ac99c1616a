"""Arithmetic with matrices: the operators of a matrix and of a matrix times a number."""

from __future__ import annotations

import numbers

from warp._src.sparse.checks import check_storage
from warp.extend import errors, is_array, shown
from warp.types import scalar_base


def _reciprocal(y):
    """The factor of a matrix that is divided by a number.

    Raises:
        ZeroDivisionError: the number is zero.
        OverflowError: no float holds it.
    """
    if y == 0:
        raise ZeroDivisionError("division by zero of a sparse matrix")
    try:
        return 1.0 / y
    except OverflowError:
        raise errors.WarpOverflowError(
            f"cannot divide a sparse matrix by {shown(y)}, expects a finite number"
        ) from None


class Operations:
    """The operators of matrices: put here by `sparse.operations`."""

    axpy = copy = multiply = product = scale = vector_product = transposed = None


def _factor(value):
    """A number that a matrix is multiplied by; None if it is none.

    Raises:
        TypeError: it is a complex number.
    """
    if isinstance(value, scalar_base):
        value = value.value
    if isinstance(value, numbers.Real):
        return value
    if isinstance(value, numbers.Complex):
        raise TypeError(f"expects a real number as factor of a matrix, but got {value!r}")
    # Arrays of NumPy with one number and no dimension.
    is_single = getattr(value, "shape", None) == () and hasattr(value, "item")
    return _factor(value.item()) if is_single else None


class Operators:
    """Operators of what has `scaled`, a pair of a matrix and a factor.

    `+`, `-` and `@` make a new matrix, products with numbers are put off until they are used.
    """

    # Arrays leave products to what has this.
    _wp_multiplies_vectors_ = True

    def __add__(self, y):
        return Operations.axpy(y, Operations.copy(self))

    def __radd__(self, x):
        return self.__add__(x)

    def __sub__(self, y):
        return Operations.axpy(y, Operations.copy(self), alpha=-1.0)

    def __rsub__(self, x):
        return Operations.axpy(self, Operations.copy(x), alpha=-1.0)

    def __mul__(self, y):
        y = _factor(y)
        if y is None:
            return NotImplemented
        matrix, factor = self.scaled
        try:
            return Scaled(matrix, factor * y)
        except (OverflowError, TypeError):
            raise errors.WarpOverflowError(
                f"cannot multiply a sparse matrix by {shown(y)}, expects a finite number"
            ) from None

    def __rmul__(self, x):
        return self.__mul__(x)

    def __truediv__(self, y):
        y = _factor(y)
        return NotImplemented if y is None else self.__mul__(_reciprocal(y))

    def __neg__(self):
        return self.__mul__(-1.0)

    def __matmul__(self, y):
        return Operations.vector_product(self, y) if is_array(y) else Operations.product(self, y)

    def __rmatmul__(self, x):
        return (
            Operations.vector_product(self, x, transpose=True)
            if is_array(x)
            else Operations.product(x, self)
        )

    def eval(self):
        """The matrix, multiplied by its factor if there is one."""
        matrix, factor = self.scaled
        return matrix if factor == 1.0 else Operations.copy(self)

    def transpose(self):
        """A transposed copy."""
        return Operations.transposed(self)


class InPlaceOperators:
    """`+=`, `-=`, `*=`, `/=` and `@=` change the matrix itself, under all its names.

    The result keeps the type, block shape and size of the matrix; what does not fit is an error
    and leaves it as it was. Differentiable, as the functions are.
    """

    def __iadd__(self, y):
        return Operations.axpy(y, self)

    def __isub__(self, y):
        return Operations.axpy(y, self, alpha=-1.0)

    def __imul__(self, y):
        y = _factor(y)
        return NotImplemented if y is None else Operations.scale(self, y)

    def __itruediv__(self, y):
        y = _factor(y)
        return NotImplemented if y is None else Operations.scale(self, _reciprocal(y))

    def __imatmul__(self, y):
        return Operations.product(self, y, self)


class Scaled(Operators):
    """A matrix times a number, and otherwise like the matrix."""

    def __init__(self, matrix, factor):
        self.scaled = (matrix, factor)

    def __getattr__(self, name):
        if name in (
            *("nrow", "ncol", "nnz", "offsets", "row_counts", "columns", "scalar_type", "dtype"),
            *("block_shape", "block_size", "shape", "requires_grad", "device"),
        ):
            return getattr(self.scaled[0], name)
        raise AttributeError(f"a matrix times a number has no attribute '{name}'")


def matrix_and_factor(x):
    """The matrix and the factor of an operand, whose arrays are as long as they have to be.

    Raises:
        ValueError: it is neither a matrix nor a matrix times a number, or too short.
    """
    matrix, factor = unchecked(x)
    check_storage(matrix)
    return matrix, factor


def unchecked(x):
    """The same, for those that look at the arrays themselves."""
    if isinstance(x, Operators):
        return x.scaled
    raise ValueError(f"Argument cannot be interpreted as a BsrMatrix, got '{type(x).__name__}'")
