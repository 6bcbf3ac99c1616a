"""Gives the operators of matrices what they do."""

from warp._src.sparse.addition import bsr_axpy, bsr_scale
from warp._src.sparse.assignment import bsr_copy
from warp._src.sparse.expressions import Operations
from warp._src.sparse.product import bsr_mm
from warp._src.sparse.transposition import bsr_transposed
from warp._src.sparse.vector_product import bsr_mv, multiply

Operations.axpy, Operations.copy, Operations.transposed = bsr_axpy, bsr_copy, bsr_transposed
Operations.product, Operations.vector_product = bsr_mm, bsr_mv
Operations.multiply, Operations.scale = multiply, bsr_scale
