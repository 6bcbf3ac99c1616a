"""Dense algebra of kernels - products of any rank, parts of tensors, QR, eigenvalues.

`array_axpy` works on whole arrays.
"""

from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.types import AnyArray


@wp.func
def symmetric_part(x: Any):
    """Symmetric part of a square matrix."""
    return x.dtype(0.5) * (x + wp.transpose(x))


@wp.func
def skew_part(x: wp.types.matrix((2, 2), wp.Scalar)):
    """Angle of the skew part of a matrix."""
    return x.dtype(0.5) * (x[1, 0] - x[0, 1])


@wp.func
def skew_part(x: wp.types.matrix((3, 3), wp.Scalar)):
    """Vector of the skew part of a matrix."""
    half = x.dtype(0.5)
    return type(x[0])(
        half * (x[2, 1] - x[1, 2]), half * (x[0, 2] - x[2, 0]), half * (x[1, 0] - x[0, 1])
    )


@wp.func
def spherical_part(x: wp.types.matrix((2, 2), wp.Scalar)):
    """Multiple of the identity with the trace of a matrix."""
    return (x.dtype(0.5) * wp.trace(x)) * wp.identity(n=2, dtype=x.dtype)


@wp.func
def spherical_part(x: wp.types.matrix((3, 3), wp.Scalar)):
    """Multiple of the identity with the trace of a matrix."""
    return (wp.trace(x) / x.dtype(3.0)) * wp.identity(n=3, dtype=x.dtype)


@wp.func
def _smallest_step(x: wp.float16):
    return wp.float16(9.765625e-4)


@wp.func
def _smallest_step(x: wp.bfloat16):
    return wp.bfloat16(7.8125e-3)


@wp.func
def _smallest_step(x: wp.float32):
    return wp.float32(1.1920929e-7)


@wp.func
def _smallest_step(x: wp.float64):
    return wp.float64(2.220446049250313e-16)


@wp.func
def symmetric_eigenvalues_qr(A: Any, tol: Any):
    """Eigenvalues and eigenvectors of a symmetric matrix of any size, by Jacobi's rotations.

    Args:
        A: the matrix; its upper triangle counts.
        tol: off-diagonal elements may be as large, relative to the roots of their diagonal
            elements' product; at least the spacing of the numbers at 1.

    Returns:
        Eigenvalues d, in no order, and a rotation P with an eigenvector per row:
        A = P^T diag(d) P.
    """
    n = len(A)
    one, zero = A.dtype(1.0), A.dtype(0.0)
    limit = wp.max(A.dtype(tol), _smallest_step(one))
    work = A
    P = wp.identity(n=len(A), dtype=A.dtype)
    rotations = int(1)
    sweep = int(0)
    while rotations > 0 and sweep < 24:
        rotations = 0
        for p in range(n - 1):
            for q in range(p + 1, n):
                x = work[p, q]
                a, b = work[p, p], work[q, q]
                if wp.abs(x) > limit * wp.sqrt(wp.abs(a)) * wp.sqrt(wp.abs(b)):
                    rotations += 1
                    # The smaller of the two angles that make this element zero.
                    slope = (b - a) / (A.dtype(2.0) * x)
                    t = one / (wp.abs(slope) + wp.sqrt(one + slope * slope))
                    if slope < zero:
                        t = -t
                    c = one / wp.sqrt(one + t * t)
                    s = t * c
                    for k in range(n):
                        if k != p and k != q:
                            u = work[wp.min(k, p), wp.max(k, p)]
                            v = work[wp.min(k, q), wp.max(k, q)]
                            work[wp.min(k, p), wp.max(k, p)] = c * u - s * v
                            work[wp.min(k, q), wp.max(k, q)] = s * u + c * v
                        g, h = P[p, k], P[q, k]
                        P[p, k] = c * g - s * h
                        P[q, k] = s * g + c * h
                    work[p, p] = a - t * x
                    work[q, q] = b + t * x
                    work[p, q] = zero
        sweep += 1
    return wp.get_diag(work), P


@wp.func
def generalized_outer(x: wp.Scalar, y: wp.Scalar):
    """x y^T of vectors; the product if one is a number."""
    return x * y


@wp.func
def generalized_outer(x: wp.Scalar, y: wp.types.vector(Any, wp.Scalar)):
    """x y^T of vectors; the product if one is a number."""
    return x * y


@wp.func
def generalized_outer(x: wp.types.vector(Any, wp.Scalar), y: wp.Scalar):
    """x y^T of vectors; the product if one is a number."""
    return x * y


@wp.func
def generalized_outer(x: wp.types.vector(Any, wp.Scalar), y: wp.types.vector(Any, wp.Scalar)):
    """x y^T of vectors; the product if one is a number."""
    return wp.outer(x, y)


@wp.func
def generalized_outer(x: wp.quatf, y: wp.types.vector(Any, wp.Scalar)):
    """x y^T of the four numbers of a quaternion and a vector."""
    return wp.outer(wp.vec4(x[0], x[1], x[2], x[3]), y)


@wp.func
def generalized_inner(x: wp.Scalar, y: wp.Scalar):
    """Sum of products over the last index of y and the first of x that match."""
    return x * y


@wp.func
def generalized_inner(x: wp.types.vector(Any, wp.Scalar), y: wp.types.vector(Any, wp.Scalar)):
    """Sum of products over the last index of y and the first of x that match."""
    return wp.dot(x, y)


@wp.func
def generalized_inner(
    x: wp.types.matrix((Any, Any), wp.Scalar), y: wp.types.vector(Any, wp.Scalar)
):
    """y^T x."""
    return y @ x


@wp.func
def generalized_inner(
    x: wp.types.vector(Any, wp.Scalar), y: wp.types.matrix((Any, Any), wp.Scalar)
):
    """x^T y."""
    return x @ y


@wp.func
def generalized_inner(
    x: wp.types.matrix((Any, Any), wp.Scalar), y: wp.types.matrix((Any, Any), wp.Scalar)
):
    """Sum of products of all elements."""
    return wp.ddot(x, y)


@wp.func
def _reflector(column: Any, pivot: int):
    """Vector v and factor f so that (1 - f v v^T) maps a column to its pivot."""
    v = column
    size = wp.max(wp.abs(v))
    factor = v.dtype(0.0)
    # Scaled by the largest number, so that squares neither overflow nor vanish.
    if size > v.dtype(0.0):
        v = v / size
        norm = wp.length(v)
        if v[pivot] < v.dtype(0.0):
            norm = -norm
        v[pivot] += norm
        factor = v.dtype(2.0) / wp.length_sq(v)
    return v, factor


@wp.func
def _lower_column(A: Any, column: int, first: int):
    v = type(A[0])()
    for k in range(type(v).length):
        v[k] = wp.where(k < first, v.dtype(0.0), A[k, column])
    return v


@wp.func
def householder_qr_decomposition(A: Any):
    """Q and R with Q R = A: Q orthogonal, R upper triangular, by Householder reflections."""
    n = type(A[0]).length
    Q = wp.identity(n=type(A[0]).length, dtype=A.dtype)
    R = A
    for i in range(n):
        v, factor = _reflector(_lower_column(R, i, i), i)
        R -= wp.outer(factor * v, v @ R)
        Q -= wp.outer(Q @ v, factor * v)
    return Q, R


@wp.func
def householder_make_hessenberg(A: Any):
    """Q and H with Q H Q^T = A: Q orthogonal, H zero below its first lower diagonal.

    H of a symmetric matrix is tridiagonal.
    """
    n = type(A[0]).length
    Q = wp.identity(n=type(A[0]).length, dtype=A.dtype)
    H = A
    for i in range(1, n):
        v, factor = _reflector(_lower_column(H, i - 1, i), i)
        H -= wp.outer(factor * v, v @ H)
        H -= wp.outer(H @ v, factor * v)
        Q -= wp.outer(Q @ v, factor * v)
    return Q, H


@wp.func
def solve_triangular(R: Any, b: Any):
    """x with R x = b for an upper triangular R; 0 in rows whose diagonal is 0."""
    x = type(b)(b.dtype(0.0))
    for i in range(b.length, 0, -1):
        j = i - 1
        rest = b[j] - wp.dot(R[j], x)
        if R[j, j] != b.dtype(0.0):
            x[j] = rest / R[j, j]
    return x


@wp.func
def inverse_qr(A: Any):
    """The inverse of a square matrix, by a QR decomposition."""
    Q, R = householder_qr_decomposition(A)
    columns = type(A)()
    for i in range(type(A[0]).length):
        columns[i] = solve_triangular(R, Q[i])
    return wp.transpose(columns)


@wp.func
def tridiagonal_symmetric_eigenvalues_qr(D: Any, L: Any, Q: Any, tol: Any):
    """Eigenvalues and eigenvectors of a symmetric tridiagonal matrix.

    Args:
        D: its diagonal.
        L: its lower diagonal, L[i] = A[i + 1, i].
        Q: rows that the rotations are applied to; the identity for the vectors of the matrix.
        tol: as in `symmetric_eigenvalues_qr`.

    Returns:
        Eigenvalues d, in no order, and P with an eigenvector per row: A = P^T diag(d) P for Q = 1.
    """
    A = wp.diag(D)
    for i in range(type(D).length - 1):
        A[i, i + 1] = L[i]
        A[i + 1, i] = L[i]
    d, P = symmetric_eigenvalues_qr(A, tol)
    return d, P @ Q


@wp.kernel(enable_backward=False)
def _axpy(x: AnyArray, y: AnyArray, alpha: Any, beta: Any):
    i = wp.tid()
    y[i] = alpha * y.dtype(x[i]) + beta * y[i]


def array_axpy(x, y, alpha: float = 1.0, beta: float = 1.0) -> None:
    """Computes y = alpha x + beta y, on the arrays' device; tapes record it.

    Args:
        x, y: arrays of one shape; numbers of `x` are converted to those of `y`.
        alpha, beta: factors.

    Raises:
        ValueError: the arrays differ in shape or device.
    """
    if x.shape != y.shape or x.device != y.device:
        raise ValueError(
            f"expects arrays of one shape and device, but got {x.shape} on '{x.device}' and "
            f"{y.shape} on '{y.device}'"
        )
    scalar = extend.type_scalar_type(y.dtype)
    with extend.unrecorded():
        wp.launch(_axpy, x.shape, [x, y, scalar(alpha), scalar(beta)], device=y.device)
    if extend.is_recording() and y.requires_grad:

        def backward():
            if x.requires_grad:
                array_axpy(y.grad, x.grad, alpha, 1.0)
            array_axpy(y.grad, y.grad, 0.0, beta)

        extend.record_adjoint(backward, [x, y])
