"""Rules on an interval, and factors of Lagrange polynomials."""

from warp._src.fem.cells.polynomial import lagrange_scales as lagrange_scales
from warp._src.fem.cells.polynomial import quadrature_1d as quadrature_1d
