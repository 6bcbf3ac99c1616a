"""Sparse factors on a GPU by NVIDIA cuDSS, where its library is installed.

The library is found at run time. Matrices of both triangles are symmetric if the kind of factor is;
the general ones are factored a second time, transposed, when a gradient asks for it. cuDSS replaces
small pivots instead of looking for large ones, so a system with a known solution is solved before
factors are trusted.
"""

import ctypes
import functools
import glob
import os
import re
import sys
import weakref

import numpy as np

import warp as wp
from warp import _native
from warp._src.optim.linear.direct_factors import UntrustedFactorsError, check_matrix, rows_of
from warp._src.optim.linear.operators import numbers
from warp.extend import type_scalar_type, unrecorded

KINDS = ("ldlt", "cholesky", "lu")
# The library's numbers of types, matrices, phases and fields, which versions from 0.7 share.
_DOUBLE, _INT = 1, 10
_MATRICES = {"lu": 0, "ldlt": 1, "cholesky": 3}
_FULL, _UPPER = 0, 2
_ANALYSIS, _FACTOR, _REFACTOR, _SOLVE = 3, 4, 8, 1008
_FACTOR_SIZE = 1
_STATUSES = (
    *("success", "not initialised", "out of memory", "invalid value", "not supported"),
    *("execution failed", "internal error", "refinement failed"),
)
# A known solution comes back with an error of this size from matrices that are singular in double
# precision; that of the largest condition number which the host accepts is below.
_LOST = 0.05


def _candidates():
    yield from ("libcudss.so.1", "libcudss.so.0")
    driver = wp.get_cuda_driver_version() or (0, 0)
    for folder in sys.path:
        found = glob.glob(os.path.join(folder, "nvidia", "cu*", "lib", "libcudss.so*"))
        for path in sorted(found, reverse=True):
            toolkit = re.search(r"[\\/]cu(\d+)[\\/]lib", path)
            if toolkit and int(toolkit[1]) <= driver[0]:
                yield path


@functools.cache
def library():
    """The library and its version.

    Raises:
        ImportError: it is not there, or older than 0.7; the message has the command to run.
    """
    major = (wp.get_cuda_driver_version() or (13, 0))[0]
    install = f"pip install nvidia-cudss-cu{13 if major >= 13 else 12}"
    problem = ""
    for name in _candidates():
        try:
            found = ctypes.CDLL(name)
        except OSError as error:
            if os.path.exists(name):
                problem = f" ({error})"
            continue
        version = _version(found)
        if version >= (0, 7):
            return _declared(found, version), version
        problem = f" (version {version[0]}.{version[1]} of '{name}' is older than 0.7)"
    raise ImportError(f"NVIDIA cuDSS cannot be loaded{problem}: {install}")


def _version(found):
    number, version = ctypes.c_int(), []
    for part in (0, 1):
        found.cudssGetProperty(part, ctypes.byref(number))
        version.append(number.value)
    return tuple(version)


def _declared(found, version):
    """The functions of a library with the types of their arguments."""
    pointer, size, number = ctypes.c_void_p, ctypes.c_int64, ctypes.c_int
    # Offsets of rows have a type of their own from 0.8 on.
    types = [number] * (3 if version >= (0, 8) else 2)
    arguments = {
        "cudssCreate": [pointer],
        "cudssSetStream": [pointer, pointer],
        "cudssConfigCreate": [pointer],
        "cudssDataCreate": [pointer, pointer],
        "cudssDataDestroy": [pointer, pointer],
        "cudssDataGet": [pointer, pointer, number, pointer, ctypes.c_size_t, pointer],
        "cudssExecute": [pointer, number, pointer, pointer, pointer, pointer, pointer],
        "cudssMatrixCreateDn": [pointer, size, size, size, pointer, number, number],
        "cudssMatrixCreateCsr": [pointer, *[size] * 3, *[pointer] * 4, *types, *[number] * 3],
        "cudssMatrixDestroy": [pointer],
    }
    for name, kinds in arguments.items():
        getattr(found, name).argtypes = kinds
    return found


class _Engine:
    """The library on a device: its handle and a configuration, which live with the process."""

    def __init__(self, device):
        self.device = device
        self.library, self.version = library()
        _native.share_with_others()
        self.handle = self.made("cudssCreate")
        self.settings = self.made("cudssConfigCreate")

    def call(self, name, *arguments):
        """Calls a function with the device's context as the current one."""
        if self.device.is_cuda:
            former = _native.current_context()
            _native.set_current_context(self.device.context)
            try:
                status = getattr(self.library, name)(*arguments)
            finally:
                _native.set_current_context(former)
        else:
            # The host, where the library of a test works, has no context.
            status = getattr(self.library, name)(*arguments)
        if status:
            text = _STATUSES[status] if status < len(_STATUSES) else f"status {status}"
            error = MemoryError if text == "out of memory" else RuntimeError
            raise error(f"{name}: cuDSS says '{text}'")

    def made(self, name, *arguments):
        """The object that a function makes, whose place is its first argument."""
        made = ctypes.c_void_p()
        self.call(name, ctypes.byref(made), *arguments)
        return made

    def made_data(self):
        """An object for factors."""
        data = ctypes.c_void_p()
        self.call("cudssDataCreate", self.handle, ctypes.byref(data))
        return data

    def free(self, data, matrix):
        """Frees factors and their matrix."""
        self.call("cudssDataDestroy", self.handle, data)
        self.call("cudssMatrixDestroy", matrix)


_engine = functools.cache(_Engine)


@functools.cache
def _kernels():
    kernel = functools.partial(wp.kernel, module=__name__, enable_backward=False)
    doubles, integers = wp.array(dtype=wp.float64), wp.array(dtype=wp.int32)

    @kernel(name="linear_csr_residual")
    def residual(
        offsets: integers,
        columns: integers,
        values: doubles,
        x: wp.array2d(dtype=wp.float64),
        rest: wp.array2d(dtype=wp.float64),
    ):
        k, i = wp.tid()
        total = rest[k, i]
        for at in range(offsets[i], offsets[i + 1]):
            total -= values[at] * x[k, columns[at]]
        rest[k, i] = total

    @kernel(name="linear_add_rows")
    def add(source: wp.array2d(dtype=wp.float64), x: wp.array2d(dtype=wp.float64)):
        k, i = wp.tid()
        x[k, i] = x[k, i] + source[k, i]

    return residual, add


_owners: dict = {}


def _release(key):
    _, engine, *owned = _owners.pop(key, (None, None))
    if engine is not None:
        engine.free(*owned)


class _System:
    """A matrix in compressed rows on a device, and its factors."""

    def __init__(self, kind, device, offsets, columns, values):
        self.kind, self.count, self.engine = kind, len(offsets) - 1, _engine(device)
        place = {"device": device}
        self.offsets = wp.array(offsets, dtype=wp.int32, **place)
        self.columns = wp.array(columns, dtype=wp.int32, **place)
        self.values = wp.array(values, dtype=wp.float64, **place)
        self.kept = np.ones(len(values), bool)
        given = (self.offsets, self.columns, self.values)
        if kind != "lu":
            # The library reads one triangle.
            rows = np.repeat(np.arange(self.count), np.diff(offsets))
            self.kept = columns >= rows
            starts = np.concatenate([[0], np.cumsum(self.kept)])[offsets]
            given = (
                wp.array(starts.astype(np.int32), dtype=wp.int32, **place),
                wp.array(columns[self.kept], dtype=wp.int32, **place),
                wp.array(values[self.kept], dtype=wp.float64, **place),
            )
        self.given = given
        pointers = [ctypes.c_void_p(one.ptr) for one in given]
        types = [_INT] * (2 if self.engine.version >= (0, 8) else 1)
        self.matrix = self.engine.made(
            *("cudssMatrixCreateCsr", self.count, self.count, given[2].size),
            *(pointers[0], None, pointers[1], pointers[2], *types, _DOUBLE),
            *(_MATRICES[kind], _FULL if kind == "lu" else _UPPER, 0),
        )
        self.data = self.engine.made_data()
        key = self.data.value
        finalizer = _native.Finalizer(functools.partial(_release, key))
        _owners[key] = (weakref.ref(self, finalizer), self.engine, self.data, self.matrix)
        # Phases before the solution name vectors, too, which they do not read.
        self.blank = wp.zeros((1, self.count), dtype=wp.float64, device=device)
        self._execute(_ANALYSIS, self.blank, self.blank)
        self._execute(_FACTOR, self.blank, self.blank)

    def refactor(self, values):
        """Factors other numbers in the same places."""
        self.values.assign(values)
        if self.given[2] is not self.values:
            self.given[2].assign(values[self.kept])
        self._execute(_REFACTOR, self.blank, self.blank)

    def _execute(self, phase, x, b):
        engine, vectors = self.engine, []
        if engine.device.is_cuda:
            stream = wp.get_stream(engine.device).cuda_stream
            engine.call("cudssSetStream", engine.handle, ctypes.c_void_p(stream))
        try:
            for rows in (x, b):
                shape = (self.count, rows.shape[0], self.count)
                pointer = ctypes.c_void_p(rows.ptr)
                vectors.append(engine.made("cudssMatrixCreateDn", *shape, pointer, _DOUBLE, 0))
            work = (engine.handle, phase, engine.settings, self.data, self.matrix)
            engine.call("cudssExecute", *work, *vectors)
        finally:
            for one in vectors:
                engine.call("cudssMatrixDestroy", one)

    def size(self):
        """Numbers in the factors."""
        count, written = ctypes.c_int64(), ctypes.c_size_t()
        fields = [ctypes.addressof(count), 8, ctypes.addressof(written)]
        self.engine.call("cudssDataGet", self.engine.handle, self.data, _FACTOR_SIZE, *fields)
        return count.value

    def residual(self, x, rest):
        """Subtracts the matrix times each row of `x` from `rest`."""
        inputs = [self.offsets, self.columns, self.values, x, rest]
        wp.launch(_kernels()[0], rest.shape, inputs, device=rest.device)

    def solve(self, rows):
        """Solutions for rows, with one step of refinement."""
        x, step, rest = wp.empty_like(rows), wp.empty_like(rows), wp.clone(rows)
        self._execute(_SOLVE, x, rows)
        self.residual(x, rest)
        self._execute(_SOLVE, step, rest)
        wp.launch(_kernels()[1], x.shape, [step, x], device=x.device)
        return x


class CudssFactors:
    """The factors of a matrix on its device; see `direct_factors.Factors`.

    Raises:
        UntrustedFactorsError: pivots have lost the matrix.
    """

    def __init__(self, kind, A, scalar):
        self.kind, self.scalar, self.device = kind, scalar, A.device
        self._pattern = None
        self.factorize(A)

    def factorize(self, A):
        """Factors a matrix, with the analysis of the last one if its pattern is the same."""
        shape, offsets, columns, values = rows_of(A)
        check_matrix(self.kind, self.scalar, shape, offsets, columns, values)
        rows = np.repeat(np.arange(shape[0]), np.diff(offsets))
        if (np.diff(rows * shape[1] + columns) <= 0).any():
            order = np.lexsort((columns, rows))
            columns, values = columns[order], values[order]
        pattern = (shape, offsets.tobytes(), columns.tobytes())
        self._condition, self._other = None, None
        with unrecorded():
            if pattern == self._pattern:
                self._system.refactor(values)
            else:
                self._system = _System(self.kind, self.device, offsets, columns, values)
            self._pattern, self.shape = pattern, shape
            self._check()
        self.nnz = self._system.size()

    def _check(self):
        """Solves for a known vector."""
        known = np.sin(1.0 + 12.9898 * np.arange(self.shape[0]))
        x = self._rows(known[None])
        b = wp.zeros_like(x)
        self._system.residual(x, b)
        found = -self._system.solve(b).numpy()[0]
        error = np.abs(found - known).max()
        if not error < _LOST:
            self._pattern = None
            raise UntrustedFactorsError(f"a known solution comes back with an error of {error:.1e}")

    def _rows(self, values):
        return wp.array(values, dtype=wp.float64, device=self.device)

    def _transposed(self):
        if self.kind != "lu":
            return self._system
        if self._other is None:
            one = self._system
            offsets, columns, values = (a.numpy() for a in (one.offsets, one.columns, one.values))
            rows = np.repeat(np.arange(one.count), np.diff(offsets))
            order = np.lexsort((rows, columns))
            starts = np.searchsorted(columns[order], np.arange(one.count + 1)).astype(np.int32)
            inner = rows[order].astype(np.int32)
            self._other = _System("lu", self.device, starts, inner, values[order])
        return self._other

    def solve(self, rows, mode=0):
        """Solutions for rows of an array of doubles; modes are 0 A, 1 A^T."""
        if not rows.size:
            return wp.empty_like(rows)
        with unrecorded():
            return (self._transposed() if mode else self._system).solve(rows)

    @property
    def condition(self):
        """N. J. Higham's estimate of the condition number in the one-norm."""
        if self._condition is None:
            self._condition = self._estimate()
        return self._condition

    def _estimate(self):
        one, n = self._system, self.shape[0]
        columns, values = one.columns.numpy(), one.values.numpy()
        norm = np.bincount(columns, np.abs(values), n).max()

        def solved(vector, mode):
            return self.solve(self._rows(vector[None]), mode).numpy()[0]

        x, estimate = np.full(n, 1.0 / n), 0.0
        for _ in range(5):
            y = solved(x, 0)
            if not np.abs(y).sum() > estimate:
                break
            estimate = np.abs(y).sum()
            z = solved(np.where(y < 0, -1.0, 1.0), 1)
            if np.abs(z).max() <= z @ x:
                break
            x = np.eye(1, n, np.abs(z).argmax())[0]
        signs = np.where(np.arange(n) % 2, -1.0, 1.0)
        other = solved(signs * (1.0 + np.arange(n) / max(n - 1, 1)), 0)
        return float(norm * max(estimate, 2.0 * np.abs(other).sum() / (3.0 * n)))

    def take(self, array, width):
        """An array's numbers as doubles, one right-hand side in each row, on the device."""
        with unrecorded():
            flat = numbers(array.contiguous())
            rows = wp.empty(flat.size, dtype=wp.float64, device=flat.device)
            wp.utils.array_cast(flat, rows)
            return rows.to(self.device).reshape((-1, width))

    def cast(self, rows, like):
        """Rows as one list of the numbers that an array has, on its device."""
        flat = rows.flatten().to(like.device)
        scalar = type_scalar_type(like.dtype)
        if scalar is wp.float64:
            return flat
        out = wp.empty(flat.size, dtype=scalar, device=like.device)
        wp.utils.array_cast(flat, out)
        return out

    def give(self, rows, x):
        """Writes rows to an array."""
        packed = x if x.is_contiguous else wp.empty(x.shape, dtype=x.dtype, device=x.device)
        wp.copy(numbers(packed), self.cast(rows, x))
        if packed is not x:
            wp.copy(x, packed)
