"""Preconditioners: inverses of diagonals and of blocks on the diagonal."""

import functools

import warp as wp
from warp._src.optim.linear.chebyshev import Chebyshev
from warp._src.optim.linear.fsai import FSAI
from warp._src.optim.linear.operators import (
    LinearOperator,
    diagonal_blocks,
    diagonal_matvec,
    evaluated,
    numbers,
)
from warp.extend import checked, type_repr, unrecorded
from warp.extend.kinds import OPERATOR, TEXT
from warp.sparse import BsrMatrix


@functools.cache
def _inverse_kernel(scalar):
    """Inverses of the numbers on the diagonals of blocks; zeros count as ones."""

    @wp.kernel(name=f"linear_inverse_{scalar.__name__}", module=__name__, enable_backward=False)
    def invert(blocks: wp.array3d(dtype=scalar), absolute: bool, result: wp.array2d(dtype=scalar)):
        block, i = wp.tid()
        value = blocks[block, i, i]
        if absolute:
            value = wp.abs(value)
        if value == scalar(0.0):
            value = scalar(1.0)
        result[block, i] = scalar(1.0) / value

    return invert


@functools.cache
def _block_inverse_kernel(scalar):
    """Inverses of blocks by elimination with complete pivoting, identities for singular ones.

    `factor` holds a block, then nothing of use; `columns` the order of its columns. For
    `symmetric`, blocks that are not symmetric and positive definite count as singular.
    """
    wide = wp.float32 if scalar is wp.float16 else scalar
    epsilon = 2.0**-52 if scalar is wp.float64 else (2.0**-10 if scalar is wp.float16 else 2.0**-23)

    @wp.kernel(
        name=f"linear_block_inverse_{scalar.__name__}", module=__name__, enable_backward=False
    )
    def invert(
        blocks: wp.array3d(dtype=scalar),
        symmetric: bool,
        factor: wp.array3d(dtype=wide),
        columns: wp.array2d(dtype=int),
        solution: wp.array3d(dtype=wide),
        result: wp.array3d(dtype=scalar),
    ):
        block = wp.tid()
        n = blocks.shape[1]
        largest = wide(0.0)
        usable = bool(True)
        for i in range(n):
            columns[block, i] = i
            for j in range(n):
                value = wide(blocks[block, i, j])
                factor[block, i, j] = value
                solution[block, i, j] = wp.where(i == j, wide(1.0), wide(0.0))
                largest = wp.max(largest, wp.abs(value))
                if not wp.isfinite(value):
                    usable = False
        tiny = wide(n) * wide(epsilon) * largest
        if largest == wide(0.0):
            usable = False
        if symmetric:
            for i in range(n):
                for j in range(i):
                    difference = wp.abs(factor[block, i, j] - factor[block, j, i])
                    if difference > wide(8.0) * wide(epsilon) * largest:
                        usable = False
        for step in range(n):
            if not usable:
                break
            row = int(step)
            column = int(step)
            # Pivots of a symmetric block stay on the diagonal, where their signs tell.
            if not symmetric:
                for i in range(step, n):
                    for j in range(step, n):
                        if wp.abs(factor[block, i, j]) > wp.abs(factor[block, row, column]):
                            row = i
                            column = j
            pivot = factor[block, row, column]
            if wp.abs(pivot) <= tiny or (symmetric and pivot <= wide(0.0)):
                usable = False
                break
            for j in range(n):
                held = factor[block, step, j]
                factor[block, step, j] = factor[block, row, j]
                factor[block, row, j] = held
                kept = solution[block, step, j]
                solution[block, step, j] = solution[block, row, j]
                solution[block, row, j] = kept
            for i in range(n):
                held = factor[block, i, step]
                factor[block, i, step] = factor[block, i, column]
                factor[block, i, column] = held
            order = columns[block, step]
            columns[block, step] = columns[block, column]
            columns[block, column] = order
            for j in range(n):
                factor[block, step, j] = factor[block, step, j] / pivot
                solution[block, step, j] = solution[block, step, j] / pivot
            for i in range(n):
                if i != step:
                    times = factor[block, i, step]
                    for j in range(n):
                        factor[block, i, j] = factor[block, i, j] - times * factor[block, step, j]
                        solution[block, i, j] = (
                            solution[block, i, j] - times * solution[block, step, j]
                        )
        for i in range(n):
            for j in range(n):
                if usable:
                    result[block, columns[block, i], j] = scalar(solution[block, i, j])
                else:
                    result[block, i, j] = wp.where(i == j, scalar(1.0), scalar(0.0))

    return invert


@functools.cache
def _block_kernel(scalar):
    """Products of the blocks on the diagonal with a vector."""
    wide = wp.float32 if scalar is wp.float16 else scalar

    @wp.kernel(name=f"linear_blocks_{scalar.__name__}", module=__name__, enable_backward=False)
    def multiply(
        blocks: wp.array3d(dtype=scalar),
        x: wp.array(dtype=scalar),
        y: wp.array(dtype=scalar),
        z: wp.array(dtype=scalar),
        alpha: scalar,
        beta: scalar,
    ):
        block, i = wp.tid()
        n = blocks.shape[1]
        total = wide(0.0)
        for j in range(n):
            total += wide(blocks[block, i, j]) * wide(x[block * n + j])
        total = total * wide(alpha)
        if beta != scalar(0.0):
            total += wide(beta) * wide(y[block * n + i])
        z[block * n + i] = scalar(total)

    return multiply


def _jacobi(A, absolute) -> LinearOperator:
    blocks = diagonal_blocks(A)
    if blocks is None:
        raise ValueError("Unsupported source matrix type for building diagonal preconditioner")
    shape = blocks.shape[:2]
    inverse = wp.empty(shape, dtype=blocks.dtype, device=blocks.device)
    kernel = _inverse_kernel(blocks.dtype)
    wp.launch(kernel, shape, [blocks, absolute, inverse], device=blocks.device)
    matvec = diagonal_matvec(inverse.flatten())
    dtype = A.dtype if not isinstance(A, BsrMatrix) else A.scalar_type
    return LinearOperator((inverse.size,) * 2, dtype, blocks.device, matvec)


def _block_jacobi(A, kind) -> LinearOperator:
    if isinstance(A, LinearOperator) and A.matrix is not None:
        A = A.matrix
    if not isinstance(A, BsrMatrix):
        raise ValueError("Block-Jacobi preconditioner requires a warp.sparse.BsrMatrix input")
    if A.block_shape[0] != A.block_shape[1]:
        raise ValueError(
            f"Block-Jacobi preconditioner requires square matrix blocks, got shape {A.block_shape}"
        )
    if A.nrow != A.ncol:
        raise ValueError(
            f"Block-Jacobi preconditioner requires a square matrix, got {A.nrow} x {A.ncol} blocks"
        )
    tiled = kind == "block_jacobi_tile"
    if tiled and A.scalar_type not in (wp.float32, wp.float64):
        raise ValueError(
            f"'{kind}' requires numbers of type float32 or float64, got {type_repr(A.scalar_type)}"
        )
    if A.block_size == 1:
        return _jacobi(A, False)
    scalar, device, shape = A.scalar_type, A.device, (A.nrow, *A.block_shape)
    wide = wp.float32 if scalar is wp.float16 else scalar
    factor, solution = (wp.empty(shape, dtype=wide, device=device) for _ in range(2))
    columns = wp.empty(shape[:2], dtype=int, device=device)
    inverse = wp.empty(shape, dtype=scalar, device=device)
    symmetric = kind != "block_jacobi_direct"
    inputs = [diagonal_blocks(A), symmetric, factor, columns, solution, inverse]
    wp.launch(_block_inverse_kernel(scalar), A.nrow, inputs, device=device)
    return LinearOperator(A.shape, scalar, device, functools.partial(_blocks, inverse))


def _blocks(inverse, x, y, z, alpha, beta):
    arrays = [inverse, numbers(x), numbers(y), numbers(z)]
    kernel, rows = _block_kernel(inverse.dtype), inverse.shape[:2]
    wp.launch(kernel, rows, [*arrays, alpha, beta], device=inverse.device)


@checked(A=OPERATOR, ptype=TEXT)
def preconditioner(A, ptype: str = "diag") -> LinearOperator | None:
    """An approximation of the inverse of a matrix.

    Args:
        A: a sparse matrix, or an array as for `aslinearoperator`.
        ptype: "diag": the inverse of the diagonal, where it is not zero; "diag_abs": of its
            absolute values; "block_jacobi_direct", "block_jacobi_sequential" and
            "block_jacobi_tile": the inverses of the blocks on the diagonal, for the last two of
            symmetric positive definite ones, and the identity for any other; "fsai": see `FSAI`;
            "chebyshev": see `Chebyshev`; "id": None.

    Raises:
        TypeError: "fsai" of numbers of another type.
        ValueError: there is no such kind, or it does not fit the matrix.
    """
    if ptype == "id":
        return None
    # Solutions do not depend on the preconditioner.
    with unrecorded():
        A = evaluated(A)
        if ptype in ("diag", "diag_abs"):
            return _jacobi(A, ptype == "diag_abs")
        if ptype in ("block_jacobi_direct", "block_jacobi_sequential", "block_jacobi_tile"):
            return _block_jacobi(A, ptype)
    if ptype == "fsai":
        return FSAI(A.matrix if isinstance(A, LinearOperator) else A)
    if ptype == "chebyshev":
        return Chebyshev(A)
    raise ValueError(f"Unsupported preconditioner type '{ptype}'")
