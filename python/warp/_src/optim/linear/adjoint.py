"""Gradients of solutions.

The adjoint of A x = b: with g the gradient of x, the transposed system A^T l = g gives the gradient
of b, l, and that of A, -l x^T at the numbers that A stores. It does not depend on how x was found,
and holds as far as both systems are solved.
"""

import functools

import warp as wp
from warp._src.optim.linear.operators import (
    LinearOperator,
    blocks_of,
    dense_matvec,
    numbers,
    sparse_matvec,
)
from warp.extend import record_adjoint, type_scalar_type
from warp.sparse import BsrMatrix, bsr_transposed


@functools.cache
def _kernels(scalar, target):
    """`scalar`: of the vectors; `target`: of the gradients."""
    kernel = functools.partial(wp.kernel, module=__name__, enable_backward=False)
    suffix = f"{scalar.__name__}_{target.__name__}"
    vector = wp.array(dtype=scalar)

    @kernel(name=f"linear_add_gradient_{suffix}")
    def add(source: vector, grad: wp.array(dtype=target)):
        i = wp.tid()
        grad[i] = grad[i] + target(source[i])

    @kernel(name=f"linear_dense_gradient_{suffix}")
    def add_dense(left: vector, x: vector, grad: wp.array2d(dtype=target)):
        i, j = wp.tid()
        grad[i, j] = grad[i, j] - target(left[i] * x[j])

    @kernel(name=f"linear_diagonal_gradient_{suffix}")
    def add_diagonal(left: vector, x: vector, grad: wp.array(dtype=target)):
        i = wp.tid()
        grad[i] = grad[i] - target(left[i] * x[i])

    @kernel(name=f"linear_sparse_gradient_{suffix}")
    def add_sparse(
        left: vector,
        x: vector,
        rows: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        grad: wp.array3d(dtype=target),
    ):
        block, i, j = wp.tid()
        row = rows[block]
        if row >= 0:
            a = left[row * grad.shape[1] + i]
            b = x[columns[block] * grad.shape[2] + j]
            grad[block, i, j] = grad[block, i, j] - target(a * b)

    return add, add_dense, add_diagonal, add_sparse


def _values(A):
    """The array that gradients of a matrix go to, or None."""
    if isinstance(A, LinearOperator):
        A = A.matrix
    if isinstance(A, BsrMatrix):
        return A.values
    return A


def _transposed(solver):
    """The operator of the transposed system.

    Raises:
        NotImplementedError: it is not known.
    """
    matrix, operator = solver.A.matrix, solver.A
    if solver.symmetric:
        return operator
    if isinstance(matrix, BsrMatrix):
        matvec = sparse_matvec(bsr_transposed(matrix))
    elif matrix is not None and matrix.ndim == 2:
        matvec = dense_matvec(matrix, transposed=True)
    elif matrix is not None:
        return operator
    else:
        raise NotImplementedError(
            "the gradient of a solution needs the transposed system, which is not known of a "
            "LinearOperator made by hand: pass the matrix, or use cg or cr for a symmetric one"
        )
    return LinearOperator(
        operator.shape,
        operator.dtype,
        operator.device,
        matvec,
        operator.batch_offsets,
        operator.max_batch_length,
    )


def _grad_scalar(array):
    return type_scalar_type(array.grad.dtype)


def record(solver) -> None:
    """Puts the gradient of a solution on the tape that records."""
    A, b, x = solver.A, solver.b, solver.x
    values = _values(A)
    arrays = [array for array in (b, values, x) if array is not None]
    if not x.requires_grad or not any(a.requires_grad for a in arrays if a is not x):
        return
    tol, atol, _, check_every, use_graph = solver.options

    def backward():
        matrix = A.matrix
        seed = wp.empty_like(x, requires_grad=False)
        wp.utils.array_cast(x.grad, seed)
        left = wp.zeros_like(seed)
        options = dict(tol=tol, atol=0.0 if atol is None else atol, maxiter=solver.maxiter)
        # A preconditioner for A is none for its transposed.
        M = solver.M if solver.symmetric else None
        again = type(solver)(
            _transposed(solver),
            seed,
            left,
            M=M,
            check_every=check_every,
            use_cuda_graph=use_graph,
            **options,
        )
        again()
        # The first guess has no influence.
        x.grad.zero_()
        source, solution = numbers(left), numbers(x)
        if b.requires_grad:
            add, *_ = _kernels(solver.scalar, _grad_scalar(b))
            wp.launch(add, source.size, [source, numbers(b.grad)], device=b.device)
        if values is None or not values.requires_grad:
            return
        _, add_dense, add_diagonal, add_sparse = _kernels(solver.scalar, _grad_scalar(values))
        if isinstance(matrix, BsrMatrix):
            grad = blocks_of(values.grad)[: matrix.nnz]
            inputs = [source, solution, matrix.uncompress_rows(), matrix.columns, grad]
            wp.launch(add_sparse, grad.shape, inputs, device=b.device)
        elif matrix.ndim == 2:
            inputs = [source, solution, values.grad]
            wp.launch(add_dense, values.shape, inputs, device=b.device)
        else:
            inputs = [source, solution, numbers(values.grad)]
            wp.launch(add_diagonal, source.size, inputs, device=b.device)

    record_adjoint(backward, arrays)
