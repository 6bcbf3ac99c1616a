"""Sparse matrices of blocks (BSR), and of numbers (CSR) as the case of blocks of one.

Made of triplets of row, column and block; then sums, products, transposed matrices, diagonals.
Operations leave new topologies on the device; `BsrMatrix.nnz_sync` waits for the number of blocks.
"""

from warp._src.sparse import operations as _operations  # noqa: F401 (operators of matrices)
from warp._src.sparse.addition import bsr_axpy as bsr_axpy
from warp._src.sparse.addition import bsr_axpy_work_arrays as bsr_axpy_work_arrays
from warp._src.sparse.addition import bsr_scale as bsr_scale
from warp._src.sparse.assignment import bsr_assign as bsr_assign
from warp._src.sparse.assignment import bsr_compress as bsr_compress
from warp._src.sparse.assignment import bsr_copy as bsr_copy
from warp._src.sparse.diagonal import bsr_diag as bsr_diag
from warp._src.sparse.diagonal import bsr_get_diag as bsr_get_diag
from warp._src.sparse.diagonal import bsr_identity as bsr_identity
from warp._src.sparse.diagonal import bsr_set_diag as bsr_set_diag
from warp._src.sparse.diagonal import bsr_set_identity as bsr_set_identity
from warp._src.sparse.lookup import bsr_block_index as bsr_block_index
from warp._src.sparse.lookup import bsr_row_index as bsr_row_index
from warp._src.sparse.matrix import (
    BSR_STATUS_ROW_CAPACITY_EXCEEDED as BSR_STATUS_ROW_CAPACITY_EXCEEDED,
)
from warp._src.sparse.matrix import BSR_STATUS_SUCCESS as BSR_STATUS_SUCCESS
from warp._src.sparse.matrix import BsrMatrix as BsrMatrix
from warp._src.sparse.matrix import bsr_matrix_t as bsr_matrix_t
from warp._src.sparse.product import bsr_mm as bsr_mm
from warp._src.sparse.product import bsr_mm_work_arrays as bsr_mm_work_arrays
from warp._src.sparse.storage import bsr_set_zero as bsr_set_zero
from warp._src.sparse.storage import bsr_zeros as bsr_zeros
from warp._src.sparse.transposition import bsr_set_transpose as bsr_set_transpose
from warp._src.sparse.transposition import bsr_transposed as bsr_transposed
from warp._src.sparse.triplets import BsrTripletMap as BsrTripletMap
from warp._src.sparse.triplets import bsr_from_triplets as bsr_from_triplets
from warp._src.sparse.triplets import bsr_set_from_mapped_values as bsr_set_from_mapped_values
from warp._src.sparse.triplets import bsr_set_from_triplets as bsr_set_from_triplets
from warp._src.sparse.vector_product import bsr_mv as bsr_mv
