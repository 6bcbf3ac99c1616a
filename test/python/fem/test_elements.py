"""Finite elements: nodes, unity, derivatives by differences, and the same numbers in kernels."""

import numpy as np
import pytest

import warp as wp
from warp._src.fem.cells.cell import CUBE, LINE, SQUARE, TET, TRIANGLE
from warp._src.fem.cells.element import ElementBasis, make_element
from warp._src.fem.cells.functions import element_functions
from warp._src.fem.cells.polynomial import Polynomial
from warp._src.fem.cells.rules import rule

CELLS = [LINE, TRIANGLE, SQUARE, TET, CUBE]


def elements():
    made = [make_element(cell, degree) for cell in CELLS for degree in range(6)]
    gauss = Polynomial.GAUSS_LEGENDRE
    made += [make_element(cell, d, variant=gauss) for cell in (SQUARE, CUBE) for d in (1, 2)]
    return made


def name(element):
    return f"{element.cell}-{element.basis.value}{element.degree}-{element.variant}"


def points_in(cell, seed=1, count=7):
    """Random points of a cell, (count, 3) coordinates."""
    x = np.random.default_rng(seed).dirichlet(np.ones(cell.dimension + 1), size=count)[:, 1:]
    return cell.coords(x)


@pytest.mark.parametrize("element", elements(), ids=name)
def test_nodes(element):
    """Basis functions are 1 at their node and 0 at the others, and sum to 1."""
    values, _ = element.tabulate(element.node_coords)
    np.testing.assert_allclose(values, np.eye(element.node_count), atol=1e-12)
    values, gradients = element.tabulate(points_in(element.cell))
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(gradients.sum(axis=1), 0.0, atol=1e-11)
    assert element.node_weights.sum() == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("element", elements(), ids=name)
def test_gradients_are_differences(element):
    check_gradients(element, 1e-6, 1e-8)


def check_gradients(element, step, tolerance):
    cell = element.cell
    x = cell.parameters(points_in(cell))
    _, gradients = element.tabulate(cell.coords(x))
    for axis, move in enumerate(step * np.eye(cell.dimension)):
        ahead, _ = element.tabulate(cell.coords(x + move))
        behind, _ = element.tabulate(cell.coords(x - move))
        scale = max(1.0, np.abs(gradients).max())
        difference = (ahead - behind) / (2 * step)
        assert np.abs(difference - gradients[..., axis]).max() <= tolerance * scale


def evaluate(element, coords, device):
    """Values and gradients of all basis functions by a kernel, in float64."""
    functions = element_functions(element, wp.float64)
    value, gradient, place = functions.value, functions.gradient, functions.node_coords
    shape, d = (len(coords), element.node_count), element.cell.dimension
    is_scalar = not element.value_shape
    dtype = wp.float64 if is_scalar else wp.types.vector(d, wp.float64)
    slope = wp.types.vector(d, wp.float64) if is_scalar else wp.types.matrix((d, d), wp.float64)

    @wp.kernel(module="unique")
    def fill(
        x: wp.array(dtype=wp.vec3d),
        values: wp.array2d(dtype=dtype),
        slopes: wp.array2d(dtype=slope),
        places: wp.array(dtype=wp.vec3d),
    ):
        i, k = wp.tid()
        values[i, k] = value(x[i], k)
        slopes[i, k] = gradient(x[i], k)
        places[k] = place(k)

    x = wp.array(coords, dtype=wp.vec3d, device=device)
    values, slopes = wp.zeros(shape, dtype, device), wp.zeros(shape, slope, device)
    places = wp.zeros(shape[1], wp.vec3d, device)
    wp.launch(fill, shape, [x, values, slopes, places], device=device)
    return values.numpy(), slopes.numpy(), places.numpy()


@pytest.mark.parametrize("element", elements(), ids=name)
def test_kernels_agree(element, device):
    coords = points_in(element.cell, count=3)
    values, gradients = element.tabulate(coords)
    found, slopes, places = evaluate(element, coords, device)
    np.testing.assert_allclose(found, values, atol=1e-12)
    np.testing.assert_allclose(slopes, gradients, atol=1e-10)
    np.testing.assert_array_equal(places, element.node_coords)


@pytest.mark.parametrize("cell", CELLS, ids=str)
def test_counts_of_layouts(cell):
    """Nodes per entity add up; nodes of an entity lie in the span of its vertices."""
    element = make_element(cell, 4)
    entities = np.array(element.layout.entities)
    places = cell.parameters(element.node_coords)
    for dimension in range(cell.dimension + 1):
        for number, vertices in enumerate(cell.entities(dimension)):
            rows = (entities[:, 0] == dimension) & (entities[:, 1] == number)
            kind = 3 if dimension == cell.dimension else dimension
            assert rows.sum() == element.layout.counts[kind]
            corners = cell.vertices[list(vertices)]
            basis = (corners[1:] - corners[0]).T
            offsets = (places[rows] - corners[0]).T
            rank = np.linalg.matrix_rank(np.hstack((basis, offsets)), tol=1e-9)
            assert rank <= dimension


def test_mass_of_quadratic_tets():
    """The integral of a basis function is 1/20 of the volume in edges and -1/20 at vertices."""
    element, made = make_element(TET, 2), rule(TET, 2)
    values, _ = element.tabulate(made.points)
    expected = [-0.05] * 4 + [0.2] * 6
    np.testing.assert_allclose(made.weights @ values, expected, atol=1e-15)


def test_errors():
    with pytest.raises(ValueError, match="degree of 0 or more, but got -1"):
        make_element(TET, -1)
    with pytest.raises(ValueError, match="expects an 'ElementBasis', but got 'P'"):
        make_element(TET, 1, "P")


def test_records_are_equal_by_value():
    assert make_element(TET, 2) == make_element(TET, 2, ElementBasis.LAGRANGE)
    assert make_element(TET, 2) != make_element(TET, 3)
    assert hash(make_element(CUBE, 2)) == hash(make_element(CUBE, 2))


def mass_matrix(element, order):
    made = rule(element.cell, order)
    values, _ = element.tabulate(made.points)
    return np.einsum("q,qi,qj->ij", made.weights, values, values)


def test_mass_matrices():
    """Matrices of textbooks: linear simplices, quadratic triangles, bilinear squares."""
    linear = np.ones((3, 3)) + np.eye(3)
    np.testing.assert_allclose(mass_matrix(make_element(TRIANGLE, 1), 2), linear / 12, atol=1e-15)
    linear = np.ones((4, 4)) + np.eye(4)
    np.testing.assert_allclose(mass_matrix(make_element(TET, 1), 2), linear / 20, atol=1e-15)
    line = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
    square = mass_matrix(make_element(SQUARE, 1), 2)
    np.testing.assert_allclose(square, np.kron(line, line), atol=1e-15)
    # Vertices, then edges 01, 12, 20.
    quadratic = [[6, -1, -1, 0, -4, 0], [-1, 6, -1, 0, 0, -4], [-1, -1, 6, -4, 0, 0]]
    quadratic += [[0, 0, -4, 32, 16, 16], [-4, 0, 0, 16, 32, 16], [0, -4, 0, 16, 16, 32]]
    found = mass_matrix(make_element(TRIANGLE, 2), 4)
    np.testing.assert_allclose(found, np.array(quadratic) / 180, atol=1e-15)


def test_stiffness_of_triangles():
    """The matrix of a right-angled triangle: halves of [[2, -1, -1], [-1, 1, 0], [-1, 0, 1]]."""
    _, gradients = make_element(TRIANGLE, 1).tabulate([[0.2, 0.3, 0.5]])
    found = 0.5 * gradients[0] @ gradients[0].T
    np.testing.assert_allclose(found, [[1, -0.5, -0.5], [-0.5, 0.5, 0], [-0.5, 0, 0.5]])
