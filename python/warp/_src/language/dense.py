"""Small dense matrices in arrays, row by row, worked on by one thread each: `wp.dense_gemm` etc.

Old programs have them; `wp.tile_matmul` and `wp.tile_cholesky` are what new ones take. They are
functions of the kernel language, so derivatives go through them as through any other code. All
arrays are of `float32`; those named in `starts` of the batched ones give, for each matrix, the
index of its first element.
"""

from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types import scalars
from warp._src.types.native import ArrayType

_NAN = float("nan")
_FLOATS, _INTS = ArrayType(scalars.float32), ArrayType(scalars.int32)


# fmt: off
def _gemm_at(
    m: int, n: int, p: int, t1: int, t2: int, a: int, b: int, c: int,
    A: _FLOATS, B: _FLOATS, C: _FLOATS,
):
    for i in range(m):
        for j in range(n):
            sum = float(0.0)
            for k in range(p):
                left = i * p + k
                right = k * n + j
                if t1 != 0:
                    left = k * m + i
                if t2 != 0:
                    right = j * p + k
                sum += A[a + left] * B[b + right]
            C[c + i * n + j] = sum


def _factor_at(n: int, a: int, A: _FLOATS, regularization: float, L: _FLOATS):
    for j in range(n):
        s = A[a + j * n + j] + regularization
        for k in range(j):
            r = L[a + j * n + k]
            s -= r * r
        # Nothing has a root that is not positive, and what follows is NaN, too.
        s = wp.sqrt(wp.where(s > 0.0, s, _NAN))
        L[a + j * n + j] = s
        for i in range(j + 1, n):
            t = A[a + i * n + j]
            for k in range(j):
                t -= L[a + i * n + k] * L[a + j * n + k]
            L[a + i * n + j] = t / s


def _substitute_at(n: int, a: int, v: int, L: _FLOATS, b: _FLOATS, x: _FLOATS):
    for i in range(n):
        s = b[v + i]
        for j in range(i):
            s -= L[a + i * n + j] * x[v + j]
        x[v + i] = s / L[a + i * n + i]
    for back in range(n):
        i = n - 1 - back
        s = x[v + i]
        for j in range(i + 1, n):
            s -= L[a + j * n + i] * x[v + j]
        x[v + i] = s / L[a + i * n + i]


def dense_gemm(
    m: int, n: int, p: int, t1: int, t2: int, A: _FLOATS, B: _FLOATS, C: _FLOATS
):
    """C = A B of m x p and p x n numbers; with `t1`, `t2` A and B are stored transposed."""
    gemm_at(m, n, p, t1, t2, 0, 0, 0, A, B, C)


def dense_gemm_batched(
    m: _INTS, n: _INTS, p: _INTS, t1: int, t2: int,
    A_start: _INTS, B_start: _INTS, C_start: _INTS, A: _FLOATS, B: _FLOATS, C: _FLOATS,
):
    """`dense_gemm` of the matrices whose number is that of the thread in the launch."""
    i = wp.tid()
    gemm_at(m[i], n[i], p[i], t1, t2, A_start[i], B_start[i], C_start[i], A, B, C)


def dense_chol(n: int, A: _FLOATS, regularization: float, L: _FLOATS):
    """The Cholesky factor of A + regularization I, n x n; above its diagonal L is left alone.

    From the first pivot on that is not positive, it is NaN.
    """
    factor_at(n, 0, A, regularization, L)


def dense_chol_batched(
    A_start: _INTS, A_dim: _INTS, A: _FLOATS, regularization: float, L: _FLOATS
):
    """`dense_chol` of the matrix whose number is that of the thread in the launch."""
    i = wp.tid()
    factor_at(A_dim[i], A_start[i], A, regularization, L)


def dense_subs(n: int, L: _FLOATS, b: _FLOATS, x: _FLOATS):
    """Solves L L^T x = b for a factor by `dense_chol`."""
    substitute_at(n, 0, 0, L, b, x)


def dense_solve(n: int, A: _FLOATS, L: _FLOATS, b: _FLOATS, x: _FLOATS):
    """Solves A x = b by the factor L of A."""
    substitute_at(n, 0, 0, L, b, x)


def dense_solve_batched(
    b_start: _INTS, A_start: _INTS, A_dim: _INTS, A: _FLOATS, L: _FLOATS, b: _FLOATS, x: _FLOATS
):
    """`dense_solve` of the system whose number is that of the thread in the launch."""
    i = wp.tid()
    substitute_at(A_dim[i], A_start[i], b_start[i], L, b, x)
# fmt: on


gemm_at = Function(_gemm_at, "gemm_at")
factor_at = Function(_factor_at, "factor_at")
substitute_at = Function(_substitute_at, "substitute_at")


def _public(function) -> Function:
    made = Function(function)
    made.__module__ = "warp"
    return made


FUNCTIONS = {
    function.__name__: _public(function)
    for function in (
        *(dense_gemm, dense_gemm_batched, dense_chol, dense_chol_batched),
        *(dense_subs, dense_solve, dense_solve_batched),
    )
}
