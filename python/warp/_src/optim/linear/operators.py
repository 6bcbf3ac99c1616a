"""Linear operators: matrices of any kind by what they do to a vector."""

import copy
import functools

import warp as wp
from warp.extend import checked, is_array, shown, type_scalar_type, type_size
from warp.extend.kinds import ARRAY, CALLABLE, COUNT, PAIR, SPARSE
from warp.sparse import BsrMatrix, bsr_get_diag


class LinearOperator:
    """A linear operator, for the left-hand side or as a preconditioner.

    Args:
        shape: numbers of rows and columns.
        dtype: type of the elements, a scalar or a block.
        device: where it works.
        matvec: `matvec(x, y, z, alpha, beta)` sets `z` to `alpha * A x + beta * y`; `y` may be
            `z`, and is not to be read if `beta` is zero.
        batch_offsets: int32, where each of several independent systems begins and the last one
            ends, in numbers. The rest belongs to none and is ignored.
        max_batch_length: upper bound of the numbers of one system.

    Raises:
        ValueError: `max_batch_length` is negative or comes without `batch_offsets`.
    """

    # False for a symmetric operator with eigenvalues of both signs.
    is_definite = True
    # The stream of the last application that used memory of the operator.
    _stream = None

    @checked(shape=PAIR, matvec=CALLABLE, batch_offsets=ARRAY, max_batch_length=COUNT)
    def __init__(self, shape, dtype, device, matvec, batch_offsets=None, max_batch_length=None):
        if max_batch_length is not None:
            if batch_offsets is None:
                raise ValueError("max_batch_length requires batch_offsets")
            if max_batch_length < 0:
                raise ValueError("max_batch_length must be non-negative")
        self._shape, self._dtype, self._device = tuple(shape), dtype, device
        self._matvec = matvec
        self._batch_offsets, self._max_batch_length = batch_offsets, max_batch_length
        # The matrix, where there is one: gradients and preconditioners ask for it.
        self.matrix = None

    @property
    def shape(self):
        """Rows and columns of numbers."""
        return self._shape

    @property
    def dtype(self):
        """The type of the vectors' elements."""
        return self._dtype

    @property
    def device(self):
        """The device of the vectors."""
        return self._device

    @property
    def matvec(self):
        """`matvec(x, y, z, alpha, beta)` sets `z` to `alpha A x + beta y`."""
        return self._matvec

    @property
    def scalar_type(self):
        """The type of the numbers."""
        return type_scalar_type(self._dtype)

    @property
    def batch_offsets(self):
        """Offsets of several systems, with the end of the last one; None for one system."""
        return self._batch_offsets

    @property
    def batch_count(self) -> int:
        """The number of independent systems."""
        return 1 if self._batch_offsets is None else self._batch_offsets.shape[0] - 1

    @property
    def max_batch_length(self):
        """Upper bound of the rows of one system, or None."""
        return self._max_batch_length

    def _wait_for_other_streams(self) -> None:
        """Lets an application that shares memory with the last one wait for its stream."""
        if self.device.is_cpu:
            return
        stream = wp.get_stream(self.device)
        last, self._stream = self._stream, stream
        if last is None or last._handle == stream._handle:
            return
        if not stream.is_capturing and not last.is_capturing:
            stream.wait_stream(last)


def numbers(array):
    """The numbers of a packed vector, as one dimension.

    Raises:
        ValueError: it is not packed.
    """
    if not array.is_contiguous:
        raise ValueError("Array is not contiguous along its last dimension")
    array = array.flatten()
    scalar = type_scalar_type(array.dtype)
    return array if array.dtype is scalar else array.view(scalar).flatten()


def blocks_of(values):
    """An array of numbers or matrices as one of three dimensions: block, row, column."""
    blocks = values.view(type_scalar_type(values.dtype))
    return blocks if type_size(values.dtype) > 1 else blocks.reshape((values.size, 1, 1))


def diagonal_blocks(A):
    """The diagonal of a matrix or an operator, as blocks (count, n, n) of which only the diagonals
    count; None where it is not known."""
    if hasattr(A, "diagonal"):
        # A part of a matrix over several ranks.
        return blocks_of(A.diagonal())
    if isinstance(A, LinearOperator):
        A = A.matrix
    if isinstance(A, BsrMatrix):
        return blocks_of(bsr_get_diag(A))
    if is_array(A) and A.ndim == 2:
        step = sum(A.strides)
        return A._view(0, (min(A.shape), 1, 1), (step, step, step))
    if is_array(A) and A.ndim == 1:
        return blocks_of(numbers(A))
    return None


def numbers_like(count, **vectors):
    """The numbers of packed vectors, each of which has `count` of them.

    Raises:
        ValueError: one has more or fewer, or is not packed.
    """
    found = [numbers(vector) for vector in vectors.values()]
    for name, one in zip(vectors, found, strict=True):
        if one.size != count:
            raise ValueError(f"expects {count} numbers in '{name}', but got {one.size}")
    return found


@functools.cache
def _dense_kernel(scalar):
    # Sums of 16 bits would lose everything.
    wide = wp.float32 if scalar is wp.float16 else scalar

    @wp.kernel(name=f"linear_dense_{scalar.__name__}", module=__name__, enable_backward=False)
    def multiply(
        A: wp.array2d(dtype=scalar),
        x: wp.array(dtype=scalar),
        y: wp.array(dtype=scalar),
        z: wp.array(dtype=scalar),
        alpha: scalar,
        beta: scalar,
        transposed: bool,
    ):
        i = wp.tid()
        total = wide(0.0)
        if transposed:
            for j in range(A.shape[0]):
                total += wide(A[j, i]) * wide(x[j])
        else:
            for j in range(A.shape[1]):
                total += wide(A[i, j]) * wide(x[j])
        result = wide(alpha) * total
        if beta != scalar(0.0):
            result += wide(beta) * wide(y[i])
        z[i] = scalar(result)

    return multiply


@functools.cache
def _diagonal_kernel(scalar):
    @wp.kernel(name=f"linear_diagonal_{scalar.__name__}", module=__name__, enable_backward=False)
    def multiply(
        A: wp.array(dtype=scalar),
        x: wp.array(dtype=scalar),
        y: wp.array(dtype=scalar),
        z: wp.array(dtype=scalar),
        alpha: scalar,
        beta: scalar,
    ):
        i = wp.tid()
        result = alpha * (A[i] * x[i])
        if beta != scalar(0.0):
            result += beta * y[i]
        z[i] = result

    return multiply


# Actions are functions of this module with the matrix in front, so that operators can be pickled.


def _dense(A, transposed, x, y, z, alpha, beta):
    target = numbers(z)
    inputs = [A, numbers(x), numbers(y), target, alpha, beta, transposed]
    wp.launch(_dense_kernel(A.dtype), target.size, inputs, device=A.device)


def _diagonal(A, x, y, z, alpha, beta):
    target = numbers(z)
    inputs = [A, numbers(x), numbers(y), target, alpha, beta]
    wp.launch(_diagonal_kernel(A.dtype), target.size, inputs, device=A.device)


def _sparse(A, trusted, x, y, z, alpha, beta):
    if beta != 0.0 and y.ptr != z.ptr:
        wp.copy(z, y)
    A.multiply(x, z, alpha, beta, trusted)


def dense_matvec(A, transposed=False):
    """The action of a dense matrix, or of its transposed."""
    return functools.partial(_dense, A, transposed)


def diagonal_matvec(A):
    """The action of a diagonal matrix, given by its elements."""
    return functools.partial(_diagonal, numbers(A))


def sparse_matvec(A, trusted=False):
    """The action of a sparse matrix; `trusted`: its contents have been checked."""
    return functools.partial(_sparse, A, trusted)


def trusted(operator):
    """The same operator for one whose matrix is looked at before each solution."""
    if operator is None or not isinstance(operator.matrix, BsrMatrix):
        return operator
    result = copy.copy(operator)
    result._matvec = sparse_matvec(operator.matrix, trusted=True)
    return result


def evaluated(A):
    """A matrix times a number as a matrix, and anything else as it is."""
    return A.eval() if SPARSE.fits(A) and not isinstance(A, BsrMatrix) else A


@checked(batch_offsets=ARRAY, max_batch_length=COUNT)
def aslinearoperator(A, batch_offsets=None, max_batch_length=None) -> LinearOperator:
    """A matrix as an operator.

    Args:
        A: a sparse matrix, or one times a number as it is now; an array of two dimensions, dense;
            one of one dimension, the diagonal; or an operator, which is returned as it is.
        batch_offsets, max_batch_length: see `LinearOperator`.

    Raises:
        ValueError: it is none of these, or the other arguments do not fit.
    """
    if A is None or isinstance(A, LinearOperator):
        return A
    A = evaluated(A)
    if isinstance(A, BsrMatrix):
        shape, matvec = A.shape, sparse_matvec(A)
    elif is_array(A) and A.ndim == 2:
        shape, matvec = A.shape, dense_matvec(A)
    elif is_array(A) and A.ndim == 1:
        shape, matvec = (A.size * type_size(A.dtype),) * 2, diagonal_matvec(A)
    else:
        raise ValueError(f"Unable to create LinearOperator from {shown(A)}")
    operator = LinearOperator(shape, A.dtype, A.device, matvec, batch_offsets, max_batch_length)
    operator.matrix = A
    return operator
