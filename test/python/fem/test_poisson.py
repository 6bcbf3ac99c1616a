"""Poisson's equation: order of convergence, and errors of high degrees, for every cell."""

import pytest

import fem_programs as programs
import warp as wp

CASES = [
    ("grid2", 1, (4, 8)),
    ("grid2", 2, (3, 6)),
    ("grid3", 1, (3, 6)),
    ("grid3", 2, (2, 4)),
    ("tri", 1, (6, 12)),
    ("tri", 2, (4, 8)),
    ("tri", 3, (3, 6)),
    ("tri", 4, (2, 4)),
    ("quad", 1, (4, 8)),
    ("quad", 2, (3, 6)),
    ("tet", 1, (4, 8)),
    ("tet", 2, (2, 4)),
    ("tet", 3, (3, 4)),
    ("hex", 1, (3, 6)),
    ("hex", 2, (3, 6)),
]


@pytest.mark.parametrize(("name", "degree", "sizes"), CASES)
def test_order_of_convergence(name, degree, sizes):
    move = programs.warped if name in ("hex", "quad") else None
    errors = [
        programs.poisson_error(programs.geometry(name, n, wp.float64, move), degree) for n in sizes
    ]
    order = programs.order_of(errors, sizes[1] / sizes[0])
    # On coarse meshes the order is not yet that of small cells.
    assert order > degree + 1 - 0.25, errors
    assert errors[-1] < 0.12


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
