"""Finite-element examples - meshes of grids, iterative solvers, saddle points, pictures."""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

import warp as wp
from warp import fem
from warp.examples.fem.plots import Plot as Plot
from warp.optim import linear
from warp.sparse import BsrMatrix, bsr_get_diag, bsr_mv, bsr_transposed

__all__ = [
    "Plot",
    "SaddleSystem",
    "bsr_cg",
    "bsr_solve_saddle",
    "gen_hexmesh",
    "gen_quadmesh",
    "gen_tetmesh",
    "gen_trimesh",
    "gen_volume",
    "invert_diagonal_bsr_matrix",
    "progress_bar",
]


def progress_bar(num_frames, quiet=False):
    """Iterates over frames and prints how far it is.

    Args:
        num_frames: number of frames.
        quiet: prints nothing.

    Yields:
        the frame's number, and a function `set_info(name, value)` for numbers to show.
    """
    start, shown = time.perf_counter(), {}
    for frame in range(num_frames):
        yield frame, shown.__setitem__
        if quiet:
            continue
        spent, done = time.perf_counter() - start, frame + 1
        numbers = "  ".join(
            f"{k}={v:.4g}" if isinstance(v, float) else f"{k}={v}" for k, v in shown.items()
        )
        left = spent / done * (num_frames - done)
        end = "\n" if done == num_frames else ""
        sys.stdout.write(f"\r{done}/{num_frames}  {numbers}  {left:5.1f} s left{end}")
        sys.stdout.flush()


def _grid_positions(res, low, high, dtype):
    dim = len(res)
    low = np.zeros(dim) if low is None else np.array(low)
    high = np.ones(dim) if high is None else np.array(high)
    axes = [np.linspace(low[k], high[k], res[k] + 1) for k in range(dim)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, dim)
    return wp.array(grid, dtype=dtype)


def gen_trimesh(res, bounds_lo=None, bounds_hi=None):
    """Triangles of a grid, two a cell: positions of vertices, and their numbers."""
    cells = fem.utils.grid_to_tris(res[0], res[1])
    return _grid_positions(res[:2], bounds_lo, bounds_hi, wp.vec2), wp.array(cells, dtype=int)


def gen_quadmesh(res, bounds_lo=None, bounds_hi=None):
    """Squares of a grid: positions of vertices, and their numbers."""
    cells = fem.utils.grid_to_quads(res[0], res[1])
    return _grid_positions(res[:2], bounds_lo, bounds_hi, wp.vec2), wp.array(cells, dtype=int)


def gen_tetmesh(res, bounds_lo=None, bounds_hi=None):
    """Tetrahedra of a grid, five a cell: positions of vertices, and their numbers."""
    cells = fem.utils.grid_to_tets(res[0], res[1], res[2])
    return _grid_positions(res[:3], bounds_lo, bounds_hi, wp.vec3), wp.array(cells, dtype=int)


def gen_hexmesh(res, bounds_lo=None, bounds_hi=None):
    """Hexahedra of a grid: positions of vertices, and their numbers."""
    cells = fem.utils.grid_to_hexes(res[0], res[1], res[2])
    return _grid_positions(res[:3], bounds_lo, bounds_hi, wp.vec3), wp.array(cells, dtype=int)


def gen_volume(res, bounds_lo=None, bounds_hi=None, device=None) -> wp.Volume:
    """A volume with the voxels of a dense grid.

    Args:
        res: numbers of voxels.
        bounds_lo, bounds_hi: corners of the grid, 0 and 1 by default.
        device: where the volume lives.
    """
    low = np.zeros(3) if bounds_lo is None else np.array(bounds_lo)
    high = np.ones(3) if bounds_hi is None else np.array(bounds_hi)
    size = (high - low) / np.array([res[0], res[1], res[2]])
    axes = (np.arange(res[k], dtype=np.int32) for k in range(3))
    voxels = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    return wp.Volume.allocate_by_voxels(
        wp.array(voxels, dtype=wp.vec3i, device=device),
        voxel_size=wp.vec3(*size),
        translation=wp.vec3(*(low + 0.5 * size)),
        device=device,
    )


def bsr_cg(
    A,
    x: wp.array,
    b: wp.array,
    max_iters: int = 0,
    tol: float = 0.0001,
    check_every=10,
    use_diag_precond=True,
    mv_routine=None,
    quiet=False,
    method: str = "cg",
    M=None,
    mv_routine_uses_multiple_cuda_contexts: bool = False,
) -> tuple[float, int]:
    """Solves A x = b by an iterative method.

    Args:
        A: matrix or linear operator.
        x: first guess, and result.
        b: right-hand side.
        max_iters: most iterations; 0 is the size of the system.
        tol: residual to stop at, relative to b.
        check_every: iterations between two looks at the residual.
        use_diag_precond: preconditions with the diagonal, if there is neither `M` nor `mv_routine`.
        mv_routine: `mv_routine(x, y, z, alpha, beta)` in place of the product with A.
        quiet: prints nothing.
        method: "cg", "cr", "bicgstab" or "gmres".
        M: preconditioner.
        mv_routine_uses_multiple_cuda_contexts: no graph is captured then.

    Returns:
        norm of the residual, number of iterations.
    """
    if M is not None:
        M = linear.aslinearoperator(M)
    elif mv_routine is not None:
        A = linear.LinearOperator(A.shape, A.dtype, A.device, matvec=mv_routine)
    elif use_diag_precond:
        M = linear.preconditioner(A, "diag")
    solve = getattr(linear, method if method in ("bicgstab", "gmres", "cr") else "cg")
    iterations, residual, limit = solve(
        A=A,
        b=b,
        x=x,
        maxiter=max_iters,
        tol=tol,
        check_every=check_every,
        M=M,
        callback=None if quiet else _print_residual,
        use_cuda_graph=A.device.is_cuda and not mv_routine_uses_multiple_cuda_contexts,
    )
    if isinstance(iterations, wp.array):
        iterations = int(iterations.numpy()[0])
        residual, limit = (float(np.sqrt(v.numpy()[0])) for v in (residual, limit))
    if not quiet:
        state = "converged" if residual <= limit else "not converged"
        print(f"{method}: {iterations} iterations, residual {residual:.3e} ({state})")
    return residual, iterations


def _print_residual(iteration, residual, limit):
    print(f"iteration {iteration}: residual {residual:.3e}, limit {limit:.3e}")


class SaddleSystem(linear.LinearOperator):
    """The operator [A B^T; B 0] on vectors of both unknowns, one after the other.

    Args:
        A: matrix of the first unknown, symmetric.
        B: constraint, one row per element of the second unknown.
        Bt: its transpose, by default made here.
        use_diag_precond: `preconditioner` is that of diag(A) and of the diagonal of
            B diag(A)^-1 B^T; None otherwise.
    """

    is_definite = False

    def __init__(self, A: BsrMatrix, B: BsrMatrix, Bt=None, use_diag_precond: bool = True):
        self._A, self._B = A, B
        self._Bt = bsr_transposed(B) if Bt is None else Bt
        size = A.shape[0] + B.shape[0]
        super().__init__((size, size), A.scalar_type, A.device, matvec=self._multiply)
        self._preconditioner = self._diagonal() if use_diag_precond else None

    @property
    def preconditioner(self):
        """The preconditioner, or None."""
        return self._preconditioner

    def _part(self, a, start, matrix):
        rows, block = matrix.nrow, matrix.block_shape[0]
        dtype = wp.types.vector(length=block, dtype=matrix.scalar_type)
        size = wp.types.type_size_in_bytes(matrix.scalar_type)
        return wp.array(
            ptr=a.ptr + start * size, shape=(rows,), dtype=dtype, device=a.device, copy=False
        )

    def u_slice(self, a: wp.array) -> wp.array:
        """The first unknown of a vector, as an array over its memory."""
        return self._part(a, 0, self._A)

    def p_slice(self, a: wp.array) -> wp.array:
        """The second unknown of a vector, as an array over its memory."""
        return self._part(a, self._A.shape[0], self._B)

    def _multiply(self, x, y, z, alpha, beta):
        if y.ptr != z.ptr and beta != 0.0:
            wp.copy(src=y, dest=z)
        u, p = self.u_slice(z), self.p_slice(z)
        bsr_mv(self._A, self.u_slice(x), u, alpha=alpha, beta=beta)
        bsr_mv(self._Bt, self.p_slice(x), u, alpha=alpha, beta=1.0)
        bsr_mv(self._B, self.u_slice(x), p, alpha=alpha, beta=beta)

    def _diagonal(self):
        A, B = self._A, self._B
        block = wp.types.matrix(shape=(B.block_shape[0],) * 2, dtype=B.scalar_type)
        inverses = wp.empty(B.nrow, dtype=block, device=self.device)
        inputs = [B.offsets, B.columns, _as_matrices(B), _as_matrices(A, bsr_get_diag(A))]
        wp.launch(_schur_inverses, B.nrow, [*inputs, inverses], device=self.device)
        if B.block_shape[0] == 1:
            inverses = inverses.view(B.scalar_type).flatten()
        parts = linear.preconditioner(A, "diag"), linear.aslinearoperator(inverses)

        def multiply(x, y, z, alpha, beta):
            for part, cut in zip(parts, (self.u_slice, self.p_slice), strict=True):
                part.matvec(cut(x), cut(y), cut(z), alpha=alpha, beta=beta)

        return linear.LinearOperator(self.shape, self.dtype, self.device, matvec=multiply)


def _as_matrices(matrix, values=None):
    """Blocks as matrices, those of numbers as of one row and one column."""
    values = matrix.values if values is None else values
    if wp.types.type_is_matrix(values.dtype):
        return values
    one = wp.types.matrix(shape=(1, 1), dtype=matrix.scalar_type)
    return values.reshape((values.shape[0], 1, 1)).view(one).flatten()


@wp.kernel(enable_backward=False)
def _schur_inverses(
    offsets: wp.array(dtype=int),
    columns: wp.array(dtype=int),
    blocks: wp.array(dtype=Any),
    diagonal: wp.array(dtype=Any),
    inverses: wp.array(dtype=Any),
):
    row = wp.tid()
    total = inverses.dtype(inverses.dtype.dtype(0.0))
    for k in range(offsets[row], offsets[row + 1]):
        B = blocks[k]
        total += B * fem.linalg.inverse_qr(diagonal[columns[k]]) * wp.transpose(B)
    inverses[row] = fem.linalg.inverse_qr(total)


def bsr_solve_saddle(
    saddle_system: SaddleSystem,
    x_u: wp.array,
    x_p: wp.array,
    b_u: wp.array,
    b_p: wp.array,
    max_iters: int = 0,
    tol: float = 0.0001,
    check_every=10,
    quiet=False,
    method: str = "cg",
) -> tuple[float, int]:
    """Solves [A B^T; B 0] (x_u, x_p) = (b_u, b_p); arguments as those of `bsr_cg`."""
    system = saddle_system
    x = wp.empty(system.shape[0], dtype=system.scalar_type, device=system.device)
    b = wp.empty_like(x)
    for whole, u, p in ((x, x_u, x_p), (b, b_u, b_p)):
        wp.copy(dest=system.u_slice(whole), src=u)
        wp.copy(dest=system.p_slice(whole), src=p)
    result = bsr_cg(
        system,
        x,
        b,
        max_iters,
        tol,
        check_every,
        quiet=quiet,
        method=method,
        M=system.preconditioner,
        use_diag_precond=False,
    )
    wp.copy(dest=x_u, src=system.u_slice(x))
    wp.copy(dest=x_p, src=system.p_slice(x))
    return result


def invert_diagonal_bsr_matrix(A: BsrMatrix) -> None:
    """Replaces each block of a block-diagonal matrix by its inverse."""
    blocks = _as_matrices(A)
    wp.launch(_invert_blocks, A.nrow, [blocks], device=A.device)


@wp.kernel(enable_backward=False)
def _invert_blocks(blocks: wp.array(dtype=Any)):
    i = wp.tid()
    blocks[i] = fem.linalg.inverse_qr(blocks[i])
