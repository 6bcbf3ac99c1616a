"""Factorized sparse approximate inverses (FSAI) of symmetric positive definite matrices.

G is lower triangular and sparse, and G^T G approximates the inverse. Row i of G has a support S, i
the last of it: with z = A[S, S]^-1 e_i it is z / sqrt(z_i), which makes the diagonal of G A G^T
one. Supports grow step by step where the residual A z is largest (Janna, Ferronato: Adaptive
pattern research for block FSAI preconditioning, SIAM J. Sci. Comput. 33, 2011).
"""

from __future__ import annotations

import warp as wp
from warp._src.optim.linear import fsai_pattern
from warp._src.optim.linear.fsai_plan import Plan
from warp._src.optim.linear.operators import LinearOperator, numbers
from warp.extend import canonical, checked, type_repr, unrecorded
from warp.extend.kinds import INTEGER, NUMBER, OPERATOR
from warp.sparse import BsrMatrix

_FLOORS = {wp.float16: 1e-3, wp.float32: 1e-6, wp.float64: 1e-12}
_MOST = 64


def _check_count(name, value) -> int:
    if not hasattr(value, "__index__") or isinstance(value, bool) or not 1 <= value <= _MOST:
        raise ValueError(f"{name} must be an integer in [1, {_MOST}], got {value!r}")
    return int(value)


def _check_fraction(name, value, zero) -> float:
    value = float(value)
    if not (0.0 <= value < 1.0 if zero else 0.0 < value < 1.0):
        interval = "[0, 1)" if zero else "(0, 1)"
        raise ValueError(f"{name} must be in {interval}, got {value}")
    return value


def _check_matrix(A) -> None:
    if not isinstance(A, BsrMatrix) or A.nrow != A.ncol or A.block_shape[0] != A.block_shape[1]:
        raise ValueError(f"FSAI requires a square BSR matrix of square blocks, got {A!r}")
    if A.scalar_type not in _FLOORS:
        raise TypeError(
            f"FSAI requires numbers of type float16, float32 or float64, got "
            f"'{type_repr(A.scalar_type)}'"
        )


class FSAI(LinearOperator):
    """An adaptive factorized sparse approximate inverse of a symmetric positive definite matrix.

    It is an operator that applies `G^T G`, to be given as `M` to `cg` and `cr`. All of it happens
    on the matrix's device, a thread per row; blocks are taken as the numbers they consist of.

    Args:
        A: a square sparse matrix of square blocks of float16, float32 or float64, both triangles
            of it stored. That it is symmetric and positive definite is not checked.
        max_row_size: numbers in a row of `G` at most, 1 to 64. One gives Jacobi's preconditioner.
        kap_tolerance: a support stops growing where a step improves the energy of its row by no
            more than this fraction; zero: it never stops for that.
        pivot_floor: smallest pivot, of the matrix scaled to a diagonal of ones, that a row accepts;
            by default 1e-3, 1e-6 or 1e-12 by the type of the numbers.
        factor_dtype: type of the numbers of `G`: that of the matrix, or float32 of one of float64.
        reuse_pattern: `update` shall be possible. Needs a matrix without padding.
        max_step_size: how many columns join a support in one step at most, 1 to 64.
        regularize_refit: `update` raises pivots that are too small to the floor, and replaces rows
            that fail all the same by their diagonal, instead of refusing the matrix.
        validate_topology: `update` compares the blocks' places with those of the first matrix.
        defer_pattern: the first successful `update` chooses the supports, from the matrix it
            finds; until then this is the identity. Needs `reuse_pattern`.

    Attributes:
        G, GT: the factor and its transposed one, as sparse matrices of numbers. With
            `defer_pattern` the rows of `G` are padded, and `GT` has room for all.
        truncated_rows: rows that a pivot stopped; None with `defer_pattern`.
        pattern_ready: with `defer_pattern` an int32 array: one as soon as there are supports.
        pattern_status: with `defer_pattern` an int32 array about the last search: unused, rows
            that a pivot stopped, rows that failed.
        source: the matrix of the last construction or update that succeeded.
        update_status: with `reuse_pattern` an int32 array about the last update: places that
            differ, diagonals of no use, rows that failed, rows regularized.

    Raises:
        TypeError: the numbers are of another type.
        ValueError: the matrix or an argument does not fit, a diagonal is missing, not positive or
            not finite, or a number does not fit `factor_dtype`.
    """

    @checked(
        A=OPERATOR,
        max_row_size=INTEGER,
        max_step_size=INTEGER,
        kap_tolerance=NUMBER,
        pivot_floor=NUMBER,
    )
    def __init__(
        self,
        A,
        max_row_size: int = 8,
        kap_tolerance: float = 1e-3,
        pivot_floor: float | None = None,
        factor_dtype=None,
        reuse_pattern: bool = False,
        max_step_size: int = 1,
        regularize_refit: bool = False,
        validate_topology: bool = True,
        defer_pattern: bool = False,
    ):
        _check_matrix(A)
        A.check()
        scalar = A.scalar_type
        most = _check_count("max_row_size", max_row_size)
        step_size = _check_count("max_step_size", max_step_size)
        tolerance = _check_fraction("kap_tolerance", kap_tolerance, True)
        floor = _FLOORS[scalar] if pivot_floor is None else pivot_floor
        floor = _check_fraction("pivot_floor", floor, False)
        stored = scalar if factor_dtype is None else canonical(factor_dtype)
        if stored is not scalar and (stored, scalar) != (wp.float32, wp.float64):
            raise ValueError(
                f"factor_dtype must be the matrix's '{type_repr(scalar)}', or float32 for float64, "
                f"got '{type_repr(stored)}'"
            )
        if defer_pattern and not reuse_pattern:
            raise ValueError("defer_pattern requires reuse_pattern")
        if reuse_pattern and A.row_counts is not None:
            raise ValueError(
                "reuse_pattern requires a compact matrix; use bsr_compress with "
                "prune_numerical_zeros=False first"
            )
        super().__init__(A.shape, scalar, A.device, self._apply)
        self._wide = wp.float32 if scalar is wp.float16 else scalar
        self._regularize, self._validate = bool(regularize_refit), bool(validate_topology)
        self.source, self.truncated_rows = A, None
        self.update_status = self.pattern_ready = self.pattern_status = None
        self._found = not defer_pattern
        with unrecorded():
            # The factor times a vector, between the two products of an application.
            self._held = wp.empty(A.shape[0], dtype=self._wide, device=A.device)
            options = (most, step_size, tolerance, floor, reuse_pattern)
            plan = Plan(A, self._wide, stored, *options)
            if defer_pattern:
                plan.start_as_identity()
                self.pattern_ready, self.pattern_status = plan.ready, plan.search
            else:
                self._build(plan, A.scalar_values)
        self.G, self.GT = plan.G, plan.GT
        self._plan = plan if reuse_pattern else None
        if reuse_pattern:
            self.update_status = plan.status

    def _build(self, plan, blocks) -> None:
        plan.set_scale(blocks)
        self._require_diagonals(plan.status.numpy())
        plan.select(blocks)
        plan.make_factors()
        plan.publish_pattern(0)
        plan.refit(blocks, False)
        failed = int(plan.status.numpy()[2])
        if failed:
            raise ValueError(
                f"FSAI: {failed} of {plan.size} rows have no factor of finite numbers with a "
                f"positive diagonal in '{type_repr(plan.stored)}'"
            )
        plan.publish_values(0)
        plan.make_ready(0)
        self.truncated_rows = int(plan.search.numpy()[1])

    def _require_diagonals(self, status) -> None:
        if status[1]:
            raise ValueError(
                f"FSAI requires finite positive diagonals, but {status[1]} of {self.shape[0]} "
                f"are not; of a negative definite matrix A pass -A"
            )

    @checked(A=OPERATOR)
    def update(self, A=None) -> FSAI:
        """Computes the factor of another matrix on the supports of the first one.

        In a graph nothing is checked on the host: `update_status` says what became of a replay.
        One update before the capture of an `update` with `defer_pattern` makes the graph smaller.

        Args:
            A: a matrix with the same blocks as the first one; by default `source`, whose numbers
                may be new.

        Returns:
            The preconditioner. The arrays of `G` and `GT` are those from before.

        Raises:
            ValueError: there is no `reuse_pattern`, the matrix differs by more than its numbers, or
                it has no factor on the supports; the factor is then the one from before.
        """
        plan = self._plan
        if plan is None:
            raise ValueError("FSAI.update() requires reuse_pattern=True")
        A = self.source if A is None else A
        self._check_source(A, plan)
        capturing = self.device.is_capturing
        fatal = 1 if self._regularize else 3
        with unrecorded():
            blocks = A.scalar_values
            plan.status.zero_()
            if self._validate:
                plan.compare(A)
            plan.set_scale(blocks)
            if not self._found:
                plan.select(blocks)
            plan.refit(blocks, self._regularize)
            if not self._found:
                plan.publish_pattern(fatal)
            plan.publish_values(fatal)
            if not self._found:
                plan.make_ready(fatal)
            certain = self._found and self._regularize and not self._validate
            if not capturing and not certain:
                self._require_success(plan.status.numpy())
                self._found = True
        self.source = A
        return self

    def _check_source(self, A, plan) -> None:
        if not isinstance(A, BsrMatrix):
            raise ValueError(f"FSAI.update() requires a BSR matrix, got {A!r}")
        A.check()
        first = self.source
        same = (A.shape, A.dtype, A.device) == (first.shape, first.dtype, first.device)
        room = min(A.columns.size, A.values.size)
        if not same or A.row_counts is not None or room < plan.blocks:
            raise ValueError(
                f"FSAI.update() requires a matrix of the same shape, dtype, device and number of "
                f"blocks as the first one, got {A!r} for {first!r}"
            )

    def _require_success(self, status) -> None:
        if status[0]:
            raise ValueError(
                f"FSAI.update() requires the sparsity of the first matrix, and {status[0]} "
                f"places of blocks differ"
            )
        if self._regularize:
            return
        self._require_diagonals(status)
        if status[2]:
            raise ValueError(
                f"FSAI.update(): {status[2]} of {self.shape[0]} rows have no factor: the matrix is "
                f"not SPD on their supports, or numbers do not fit; `regularize_refit` goes on"
            )

    def _apply(self, x, y, z, alpha, beta) -> None:
        with unrecorded():
            self._wait_for_other_streams()
            x, y, z = numbers(x), numbers(y), numbers(z)
            stored, scalar, wide = self.G.dtype, self.scalar_type, self._wide
            first = fsai_pattern.product_kernel(stored, scalar, wide, wide)
            then = fsai_pattern.product_kernel(stored, wide, wide, scalar)
            for kernel, factor, inputs in (
                (first, self.G, [x, float(alpha != 0), self._held, 0.0, self._held]),
                (then, self.GT, [self._held, alpha, y, beta, z]),
            ):
                matrix = [factor.offsets, factor._counts(), factor.columns, factor.values]
                wp.launch(kernel, self.shape[0], [*matrix, *inputs], device=self.device)
