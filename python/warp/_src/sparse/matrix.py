"""The class of sparse matrices, and how empty ones are made."""

from __future__ import annotations

import functools

import warp as wp
from warp._src.sparse.checks import ATTRIBUTES, check_contents, check_storage
from warp._src.sparse.expressions import InPlaceOperators, Operations, Operators
from warp._src.sparse.lookup import _write_row_ends, _write_rows
from warp.extend import canonical, checked, type_is_matrix, type_repr, type_scalar_type, type_size
from warp.extend.kinds import ARRAY, COUNT, NUMBER
from warp.types import SCALAR_TYPES

BSR_STATUS_SUCCESS = 0
BSR_STATUS_ROW_CAPACITY_EXCEEDED = 1
_MESSAGES = {
    BSR_STATUS_SUCCESS: "success",
    BSR_STATUS_ROW_CAPACITY_EXCEEDED: "row capacity exceeded",
}


def as_blocks(values):
    """An array of numbers or matrices as one of three dimensions: block, row, column."""
    scalar = type_scalar_type(values.dtype)
    if type_size(values.dtype) > 1:
        return values.view(scalar)
    return values.view(scalar).reshape((values.size, 1, 1))


class BsrMatrix(InPlaceOperators, Operators):
    """A matrix of blocks of one shape, most of which are zero; made by `bsr_zeros` and others.

    Row r has the blocks `offsets[r]` to `offsets[r + 1]`, in ascending order of their columns. In
    a padded matrix (`row_counts` is not None) only the first `row_counts[r]` of them are in use.

    Attributes:
        nrow, ncol: number of rows and columns of blocks.
        nnz: upper bound of the number of blocks that the host knows of; see `nnz_sync`.
        offsets: int32, `nrow + 1` numbers.
        row_counts: int32, `nrow` numbers, or None.
        columns: int32, the column of each block.
        values: the blocks.

    The attributes can be set. One of the wrong type is an error then; arrays that are too short or
    on another device, and on the CPU contents that lead out of them, are where the matrix is used.
    """

    @checked(nrow=COUNT, ncol=COUNT)
    def __init__(self, dtype, nrow, ncol, device):
        if nrow < 0 or ncol < 0:
            raise ValueError(f"expects numbers of rows and columns >= 0, got {nrow} and {ncol}")
        self.nrow, self.ncol, self.nnz = nrow, ncol, 0
        self.offsets = wp.zeros(self.nrow + 1, dtype=int, device=device)
        self.columns = wp.empty(0, dtype=int, device=device)
        self.values = wp.empty(0, dtype=dtype, device=device)
        self.row_counts = None
        self._status = self._outside = None

    def __reduce__(self):
        # The class is made here, and so has no name that another process finds.
        return _restored, (self._block_type, {**vars(self), "_outside": None})

    def __setattr__(self, name, value):
        check = ATTRIBUTES.get(name)
        super().__setattr__(name, value if check is None else check(self, name, value))

    @property
    def scaled(self):
        """The matrix and its factor, as a product with a number has them."""
        return self, 1.0

    @property
    def scalar_type(self):
        """The type of the numbers."""
        return type_scalar_type(self.values.dtype)

    @property
    def block_shape(self) -> tuple[int, int]:
        """Rows and columns of a block."""
        return getattr(self.values.dtype, "_shape_", ()) or (1, 1)

    @property
    def block_size(self) -> int:
        """Numbers of a block."""
        rows, cols = self.block_shape
        return rows * cols

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of numbers."""
        rows, cols = self.block_shape
        return self.nrow * rows, self.ncol * cols

    @property
    def dtype(self):
        """The type of a block."""
        return self.values.dtype

    @property
    def device(self):
        """The device of the blocks."""
        return self.values.device

    @property
    def requires_grad(self) -> bool:
        """True if the blocks have gradients."""
        return self.values.requires_grad

    @property
    def scalar_values(self):
        """The blocks as an array of three dimensions: block, row, column."""
        return as_blocks(self.values)

    @checked()
    def check(self) -> None:
        """Checks the arrays of the matrix, which programs may replace and write to.

        Contents are checked on the CPU only, and not while a graph is being captured.

        Raises:
            ValueError: an array is too short, or on another device than the others.
            IndexError: a row or a column lies outside of the matrix.
        """
        check_storage(self)
        check_contents(self)

    @checked(x=ARRAY, y=ARRAY, alpha=NUMBER, beta=NUMBER)
    def multiply(self, x, y, alpha=1.0, beta=0.0, is_checked=False):
        """Sets `y` to `alpha A x + beta y` as `bsr_mv` does, for vectors of `x` and `y`.

        Args:
            x, y: `ncol` and `nrow` elements of as many numbers as a block has columns and rows.
            alpha, beta: factors.
            is_checked: True for a matrix that has not changed since its last `check`.

        Raises:
            ValueError: types, sizes or devices do not fit.
        """
        return Operations.multiply(self, x, y, alpha, beta, trusted=is_checked)

    def __repr__(self):
        return (
            f"<{type(self).__name__} of {self.nrow} x {self.ncol} blocks of "
            f"{type_repr(self.dtype)}, at most {self.nnz} of them stored, on '{self.device}'>"
        )

    def _counts(self):
        """`row_counts` for kernels: of no elements if all blocks are in use."""
        return self.columns[:0] if self.row_counts is None else self.row_counts

    def _row_ends(self):
        """The ends of the blocks in use of each row."""
        if self.row_counts is None:
            return self.offsets[1 : self.nrow + 1]
        ends = wp.empty(self.nrow, dtype=int, device=self.device)
        wp.launch(
            _write_row_ends, self.nrow, [self.offsets, self.row_counts, ends], device=self.device
        )
        return ends

    @checked(out=ARRAY)
    def uncompress_rows(self, out=None):
        """The row of each block, -1 for those that are not in use.

        Args:
            out: int32, of at least `nnz` elements; a new array by default.

        Raises:
            ValueError: `out` is no such array.
        """
        check_storage(self)
        if out is None:
            out = wp.empty(self.nnz, dtype=int, device=self.device)
        elif out.ndim != 1 or out.size < self.nnz or out.dtype is not wp.int32:
            raise ValueError(f"expects an int32 array of at least {self.nnz} elements, got {out!r}")
        inputs = [self.offsets, self.nrow, self._counts(), out]
        wp.launch(_write_rows, self.nnz, inputs, device=self.device)
        return out

    def nnz_sync(self) -> int:
        """Waits for the number of blocks, puts it in `nnz` and returns it.

        For padded matrices it is the number of blocks there is room for.

        Raises:
            RuntimeError: a graph is being captured.
        """
        if self.device.is_capturing:
            raise (NotImplementedError if self.device.is_cpu else RuntimeError)(
                "BsrMatrix.nnz_sync() needs a device-to-host readback, which a graph cannot hold: "
                "a topology update in it runs later; call it outside of the capture"
            )
        self.nnz = int(self.offsets[self.nrow : self.nrow + 1].numpy()[0])
        return self.nnz

    def copy_nnz_async(self) -> None:
        """Does nothing; `nnz_sync` gets the number."""

    @checked(nnz=COUNT, nnz_capacity=COUNT)
    def notify_nnz_changed(self, nnz: int | None = None, nnz_capacity: int | None = None) -> None:
        """Says that `offsets` has been changed from outside.

        Args:
            nnz: the number of blocks now, by default read from `offsets`.
            nnz_capacity: how many there shall be room for.
        """
        if nnz is not None:
            self.nnz = int(nnz)
        elif nnz_capacity is None:
            self.nnz_sync()
        else:
            self.nnz = int(nnz_capacity)
        self._fit(max(self.nnz, nnz_capacity or 0))

    def _fit(self, capacity: int) -> None:
        """Makes room for blocks; what there was is lost if it has to grow."""
        if self.columns.size < capacity:
            self.columns = wp.empty(capacity, dtype=int, device=self.device)
        if self.values.size < capacity:
            self.values = wp.empty(
                capacity, dtype=self.dtype, device=self.device, requires_grad=self.requires_grad
            )

    def status_sync(self) -> int:
        """Waits for the status: whether some operation found too little room in a row.

        Raises:
            RuntimeError: a graph is being captured.
        """
        if self._status is None:
            return BSR_STATUS_SUCCESS
        if self.device.is_capturing:
            raise (NotImplementedError if self.device.is_cpu else RuntimeError)(
                "BsrMatrix.status_sync() cannot read sparse status during a "
                f"{'CPU APIC' if self.device.is_cpu else 'live CUDA'} graph capture; call it "
                "afterwards"
            )
        return int(self._status.numpy()[0])

    def status_message(self) -> str:
        """The meaning of `status_sync`, in words."""
        status = self.status_sync()
        return _MESSAGES.get(status, f"unknown status {status}")

    def clear_status(self) -> None:
        """Forgets what went wrong."""
        if self._status is not None:
            self._status.zero_()

    def _ensure_status(self):
        if self._status is None:
            self._status = wp.zeros(1, dtype=int, device=self.device)
        return self._status


@functools.cache
def _class_for(dtype):
    name = type_repr(dtype)
    return type(f"BsrMatrix_{name}", (BsrMatrix,), {"_block_type": dtype})


def _restored(dtype, state):
    matrix = object.__new__(_class_for(dtype))
    vars(matrix).update(state)
    return matrix


@checked()
def bsr_matrix_t(dtype):
    """The class of matrices with blocks of a type, scalar or matrix.

    Raises:
        ValueError: it is something else.
    """
    dtype = canonical(dtype)
    if not type_is_matrix(dtype) and dtype not in SCALAR_TYPES:
        raise ValueError(
            f"BsrMatrix block type must be either warp matrix or scalar; got {type_repr(dtype)}"
        )
    return _class_for(dtype)


def new_matrix(nrow, ncol, dtype, device) -> BsrMatrix:
    """A matrix without blocks."""
    cls = bsr_matrix_t(dtype)
    return cls(cls._block_type, nrow, ncol, wp.get_device(device))
