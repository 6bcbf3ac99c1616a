"""Arithmetic with matrices: the operators of a matrix and of a matrix times a number."""

from __future__ import annotations

from warp._src.types.dtypes import is_array


class Operations:
    """What operators do, which is made of matrices: put here by `sparse.operations`."""

    axpy = copy = product = vector_product = transposed = None


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
        matrix, factor = self.scaled
        return Scaled(matrix, factor * y)

    def __rmul__(self, x):
        return self.__mul__(x)

    def __truediv__(self, y):
        return self.__mul__(1.0 / y)

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
    """The matrix and the factor of an operand.

    Raises:
        ValueError: it is neither a matrix nor a matrix times a number.
    """
    if isinstance(x, Operators):
        return x.scaled
    raise ValueError(f"Argument cannot be interpreted as a BsrMatrix, got '{type(x).__name__}'")
