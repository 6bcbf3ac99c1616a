"""The solvers as functions: make the state, and run it."""

import typing

from warp._src.optim.linear.bicgstab import BiCGSTAB
from warp._src.optim.linear.conjugate import CG, CR
from warp._src.optim.linear.fused import FusedCG
from warp._src.optim.linear.gmres import GMRES
from warp.extend import checked
from warp.extend.kinds import FLAG, INTEGER, SOLVER


def _over_ranks(A, comm):
    """The operator as a part of one over ranks."""
    if comm is None:
        return A
    from warp.distributed import LinearOperator

    return A if isinstance(A, LinearOperator) else LinearOperator(A, comm=comm)


@checked(**SOLVER, restart=INTEGER, run=FLAG, fused=FLAG)
def cg(
    A,
    b,
    x,
    tol=None,
    atol=None,
    maxiter=0,
    M=None,
    callback=None,
    check_every=10,
    use_cuda_graph=True,
    run: bool = True,
    *,
    restart: int | None = None,
    comm=None,
    fused: bool = False,
) -> typing.Any:
    """Solves A x = b for a symmetric definite matrix by conjugate gradients.

    It may be positive or negative definite. One that turns out to be neither is warned of if the
    iterations do not solve it. An operator that says so by `is_definite = False` is solved by
    conjugate residuals.

    Arguments: see `LinearSolverState`.

    Args:
        run: False returns the solver, a `CG`, to be called again and again.
        restart: after how many iterations to begin anew.
        comm: ranks that have a part of the system each (`warp.distributed`); `A` then computes the
            rank's part of a product, and has exchanged what it needs of others.
        fused: compute the inner products of an iteration together, so that there is one sum over
            ranks in place of two, for two more vectors.

    Returns:
        Iterations, norm of the residual b - A x, and absolute tolerance; arrays on the device, the
        last two squared, if `check_every` is zero.
    """
    A = _over_ranks(A, comm)
    method = FusedCG if fused else CG
    if not getattr(A, "is_definite", True):
        method = CR
    solver = method(
        A, b, x, tol, atol, maxiter, M, callback, check_every, use_cuda_graph, restart=restart
    )
    return solver() if run else solver


@checked(**SOLVER, restart=INTEGER, run=FLAG)
def cr(
    A,
    b,
    x,
    tol=None,
    atol=None,
    maxiter=0,
    M=None,
    callback=None,
    check_every=10,
    use_cuda_graph=True,
    run: bool = True,
    *,
    restart: int | None = None,
    comm=None,
) -> typing.Any:
    """Solves A x = b for a symmetric matrix by conjugate residuals; see `cg`."""
    A = _over_ranks(A, comm)
    solver = CR(
        A, b, x, tol, atol, maxiter, M, callback, check_every, use_cuda_graph, restart=restart
    )
    return solver() if run else solver


@checked(**SOLVER, run=FLAG, is_left_preconditioner=FLAG)
def bicgstab(
    A,
    b,
    x,
    tol=None,
    atol=None,
    maxiter=0,
    M=None,
    callback=None,
    check_every=10,
    use_cuda_graph=True,
    is_left_preconditioner=False,
    run: bool = True,
    *,
    comm=None,
) -> typing.Any:
    """Solves A x = b by stabilised biconjugate gradients; see `cg` and `BiCGSTAB`."""
    options = (tol, atol, maxiter, M, callback, check_every, use_cuda_graph, is_left_preconditioner)
    A = _over_ranks(A, comm)
    solver = BiCGSTAB(A, b, x, *options)
    return solver() if run else solver


@checked(**SOLVER, restart=INTEGER, run=FLAG, is_left_preconditioner=FLAG)
def gmres(
    A,
    b,
    x,
    tol=None,
    atol=None,
    restart=31,
    maxiter=0,
    M=None,
    callback=None,
    check_every=31,
    use_cuda_graph=True,
    is_left_preconditioner=False,
    run: bool = True,
    *,
    comm=None,
) -> typing.Any:
    """Solves A x = b by generalised minimal residuals; see `cg` and `GMRES`."""
    options = (tol, atol, restart, maxiter, M, callback, check_every, use_cuda_graph)
    A = _over_ranks(A, comm)
    solver = GMRES(A, b, x, *options, is_left_preconditioner)
    return solver() if run else solver
