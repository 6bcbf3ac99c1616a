"""Factors of matrices in the component `libwarp_eigen.so`, in double precision on the host."""

import ctypes
import functools
import pathlib
import weakref

import numpy as np

import warp as wp
from warp import _native
from warp.extend import type_scalar_type, type_size
from warp.sparse import BsrMatrix

KINDS = ("ldlt", "cholesky", "lu", "qr")
_SYMMETRIC = ("ldlt", "cholesky")
# Asymmetry that rounding of the numbers explains, in units of the largest number.
_ROUNDING = {wp.float64: 1.0e-13, wp.float32: 1.0e-5, wp.float16: 1.0e-2}


class FactorError(ValueError):
    """A matrix that has no factors.

    Attributes:
        index: row or column of numbers where the factorisation ends, or -1.
        pivot: the number found there.
    """

    def __init__(self, message, index=-1, pivot=0.0):
        super().__init__(message)
        self.index, self.pivot = index, pivot


class UntrustedFactorsError(ArithmeticError):
    """Factors that do not solve a system whose solution is known."""


@functools.cache
def library():
    """The component.

    Raises:
        ImportError: it is not there.
    """
    path = pathlib.Path(wp.__file__).parent / "libwarp_eigen.so"
    try:
        found = ctypes.CDLL(str(path))
    except OSError as error:
        raise ImportError(
            "direct solvers need the component 'libwarp_eigen.so', which is built where Eigen's "
            "headers are installed: apt-get install libeigen3-dev"
        ) from error
    size, pointer = ctypes.c_int64, ctypes.c_void_p
    found.warp_direct_new.argtypes = [ctypes.c_int, size, size, size, pointer, pointer, pointer]
    found.warp_direct_new.restype = pointer
    found.warp_direct_refactor.argtypes = [pointer, size, pointer, pointer, pointer]
    found.warp_direct_refactor.restype = None
    found.warp_direct_solve.argtypes = [pointer, ctypes.c_int, size, pointer, pointer]
    found.warp_direct_error.argtypes = [pointer]
    found.warp_direct_error.restype = ctypes.c_char_p
    found.warp_direct_info.argtypes = [pointer] * 5
    found.warp_direct_info.restype = None
    found.warp_direct_free.argtypes = [pointer]
    found.warp_direct_free.restype = None
    return found


def rows_of(A):
    """A matrix in compressed rows: shape, offsets, columns and values as NumPy arrays."""
    if isinstance(A, BsrMatrix):
        return _rows_of_blocks(A)
    values = A.numpy().astype(np.float64)
    if values.ndim != 2:
        raise ValueError(f"expects a matrix of two dimensions, but got shape {values.shape}")
    rows, columns = np.nonzero(values)
    offsets = np.searchsorted(rows, np.arange(values.shape[0] + 1)).astype(np.int32)
    return values.shape, offsets, columns.astype(np.int32), values[rows, columns]


def _rows_of_blocks(A):
    A.check()
    offsets = A.offsets.numpy().astype(np.int64)
    counts = np.diff(offsets) if A.row_counts is None else A.row_counts.numpy().astype(np.int64)
    used = np.repeat(offsets[:-1] - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
    used = used + np.arange(counts.sum())
    columns, blocks = A.columns.numpy()[used], A.scalar_values.numpy()[used].astype(np.float64)
    height, width = A.block_shape
    # A row of numbers has a row of each block of its row of blocks.
    per_row = np.repeat(counts, height)
    fine = np.concatenate([[0], np.cumsum(per_row * width)])
    starts = np.concatenate([[0], np.cumsum(counts)])
    row = np.repeat(np.arange(A.nrow * height), per_row)
    first = np.repeat(np.cumsum(per_row) - per_row, per_row)
    block = starts[row // height] + np.arange(len(row)) - first
    values = blocks[block, row % height]
    inner = columns[block][:, None] * width + np.arange(width)
    if fine[-1] > np.iinfo(np.int32).max:
        raise ValueError(f"expects fewer than 2^31 numbers, but got {fine[-1]}")
    shape = (A.nrow * height, A.ncol * width)
    return shape, fine.astype(np.int32), inner.reshape(-1).astype(np.int32), values.reshape(-1)


_owners: dict = {}


def _release(handle):
    if _owners.pop(handle, None) is not None:
        library().warp_direct_free(handle)


class Factors:
    """The factors of a matrix; freed with this object."""

    def __init__(self, kind, A, scalar):
        self.kind, self.scalar, self._handle = kind, scalar, None
        self.factorize(A)

    def _keep(self, handle):
        """Frees a handle with this object, and the one before now."""
        former, self._handle = self._handle, handle
        _release(former)
        finalizer = _native.Finalizer(functools.partial(_release, handle))
        _owners[handle] = weakref.ref(self, finalizer)

    def factorize(self, A):
        """Factors a matrix, with the analysis of the last one if its pattern is the same."""
        shape, offsets, columns, values = rows_of(A)
        check_matrix(self.kind, self.scalar, shape, offsets, columns, values)
        pattern = (shape, offsets.tobytes(), columns.tobytes())
        rows = [offsets.ctypes.data, columns.ctypes.data, values.ctypes.data]
        if self._handle and pattern == self._pattern:
            library().warp_direct_refactor(self._handle, len(values), *rows)
        else:
            number = KINDS.index(self.kind)
            handle = library().warp_direct_new(number, *shape, len(values), *rows)
            if not handle:
                raise MemoryError(f"{self.kind} of a matrix of {len(values)} numbers")
            self._keep(handle)
        self._pattern, self.shape = pattern, shape
        self._read_info()

    def _read_info(self):
        index, count = ctypes.c_int64(), ctypes.c_int64()
        pivot, condition = ctypes.c_double(), ctypes.c_double()
        fields = [ctypes.addressof(field) for field in (index, pivot, condition, count)]
        library().warp_direct_info(self._handle, *fields)
        self.condition, self.nnz = condition.value, count.value
        message = library().warp_direct_error(self._handle).decode()
        if message:
            where = f" (row {index.value}, pivot {pivot.value:.3g})" if index.value >= 0 else ""
            hint = {"ldlt": "; use 'lu' or 'qr'", "cholesky": "; use 'ldlt' or 'lu'"}
            raise FactorError(
                f"{self.kind}: {message}{where}{hint.get(self.kind, '')}", index.value, pivot.value
            )

    def solve(self, b, mode=0):
        """Solutions for rows of `b`; modes are 0 A, 1 A^T, 2 A^T A."""
        b = np.ascontiguousarray(b, np.float64)
        width = self.shape[0] if mode == 1 else self.shape[1]
        x = np.empty((*b.shape[:-1], width))
        count = b.size // b.shape[-1] if b.size else 0
        if library().warp_direct_solve(self._handle, mode, count, b.ctypes.data, x.ctypes.data):
            raise MemoryError(f"{self.kind} solve for {count} right-hand sides")
        return x

    def take(self, array, width):
        """An array's numbers as doubles, one right-hand side in each row."""
        return array.numpy().astype(np.float64).reshape(-1, width)

    def cast(self, rows, like):
        """Rows as one list of the numbers that an array has, on its device."""
        scalar = type_scalar_type(like.dtype)
        return wp.array(rows.reshape(-1), dtype=scalar, device=like.device)

    def give(self, rows, x):
        """Writes rows to an array."""
        dtype = np.dtype(wp.dtype_to_numpy(type_scalar_type(x.dtype)))
        vector = x.shape if type_size(x.dtype) == 1 else (*x.shape, type_size(x.dtype))
        x.assign(rows.astype(dtype).reshape(vector))


def check_matrix(kind, scalar, shape, offsets, columns, values):
    """Refuses a matrix that a kind of factors does not exist for.

    Raises:
        FactorError: its shape, its numbers or its symmetry do not fit.
    """
    if not np.isfinite(values).all():
        raise FactorError("expects finite numbers, but the matrix has NaN or infinity")
    if min(shape) == 0 or (kind == "qr" and shape[0] < shape[1]):
        raise FactorError(f"expects one column or more and as many rows, but got {shape}")
    if kind != "qr" and shape[0] != shape[1]:
        raise FactorError(f"expects a square matrix, but got {shape}; 'qr' takes more rows")
    if kind in _SYMMETRIC:
        asymmetry = _asymmetry(shape, offsets, columns, values)
        if asymmetry > _ROUNDING.get(scalar, 1.0e-13):
            raise FactorError(
                f"expects a symmetric matrix, but got one with an asymmetry of "
                f"{asymmetry:.1e} of its largest number; use 'lu'"
            )


def _asymmetry(shape, offsets, columns, values):
    """The largest difference to the transposed matrix, over the largest number."""
    rows = np.repeat(np.arange(shape[0], dtype=columns.dtype), np.diff(offsets))
    most = np.abs(values).max(initial=0.0)
    mirror = np.argsort(columns, kind="stable")
    if np.array_equal(columns[mirror], rows) and np.array_equal(rows[mirror], columns):
        # Sorted rows of a pattern that is its own transposed.
        return float(np.abs(values - values[mirror]).max(initial=0.0) / most) if most else 0.0
    keys = rows.astype(np.int64) * shape[1] + columns
    others = columns.astype(np.int64) * shape[1] + rows
    ours, theirs = np.argsort(keys, kind="stable"), np.argsort(others, kind="stable")
    every = np.union1d(keys, others)
    a, b = np.zeros(len(every)), np.zeros(len(every))
    a[np.searchsorted(every, keys[ours])] = values[ours]
    b[np.searchsorted(every, others[theirs])] = values[theirs]
    return float(np.abs(a - b).max(initial=0.0) / most) if most else 0.0
