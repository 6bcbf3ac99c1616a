"""Poisson's equation: order of convergence, and errors of high degrees, for every cell."""

import pytest

import fem_programs as programs
import warp as wp
from warp import fem
from warp.examples.fem import utils

# The finer mesh's error by scikit-fem 12.0.2 on the same vertices and cells, if it has the element.
CASES = [
    ("grid2", 1, 16, None),
    ("grid2", 2, 8, None),
    ("grid3", 1, 8, None),
    ("grid3", 2, 4, None),
    ("tri", 1, 16, 1.350436e-03),
    ("tri", 2, 8, 6.873916e-05),
    ("tri", 3, 8, 1.215895e-06),
    ("tri", 4, 8, 2.441793e-08),
    ("quad", 1, 16, 5.522965e-04),
    ("quad", 2, 8, 3.975998e-05),
    ("tet", 1, 8, 4.384978e-03),
    ("tet", 2, 4, 7.683100e-04),
    ("tet", 3, 3, None),
    ("hex", 1, 8, 1.629739e-03),
    ("hex", 2, 4, 2.544590e-04),
]


@pytest.mark.parametrize(("name", "degree", "n", "reference"), CASES)
def test_order_of_convergence(name, degree, n, reference):
    """The order is the degree + 1, and the error that of scikit-fem (case C1 of the design)."""
    move = programs.warped if name in ("hex", "quad") else None
    errors = [
        programs.poisson_error(programs.geometry(name, k, wp.float64, move), degree, sparse=True)
        for k in (n, 2 * n)
    ]
    assert programs.order_of(errors) == pytest.approx(degree + 1, abs=0.1), errors
    if reference:
        assert errors[1] == pytest.approx(reference, rel=1e-4)


def test_sparse_grids_have_the_error_of_dense_ones():
    """A Nanogrid of float32 has the error of a grid of float64, up to rounding."""
    dense = programs.poisson_error(programs.geometry("grid3", 8, wp.float64), 1)
    volume = utils.gen_volume(wp.vec3i(8))
    assert programs.poisson_error(fem.Nanogrid(volume), 1) == pytest.approx(dense, rel=1e-3)


@pytest.mark.parametrize(("degree", "expected"), [(4, 8.97e-5), (6, 3.23e-7), (8, 6.85e-10)])
def test_high_degrees_in_float64(degree, expected):
    error = programs.poisson_error(programs.geometry("grid3", 2, wp.float64), degree)
    assert error == pytest.approx(expected, rel=0.02)


def test_float32_agrees_with_float64():
    for name in ("grid3", "tet", "hex"):
        single, double = (
            programs.poisson_error(programs.geometry(name, 4, t), 1)
            for t in (wp.float32, wp.float64)
        )
        assert single == pytest.approx(double, rel=1e-4)
