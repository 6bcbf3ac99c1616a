"""Families of elements: nodes, unity, derivatives, kernels, and continuity of vector families."""

import itertools

import numpy as np
import pytest
from test_elements import check_gradients, evaluate, name, points_in
from test_mesh_spaces import check_continuity

import warp as wp
from warp._src.fem.cells.cell import CUBE, LINE, SQUARE, TET, TRIANGLE
from warp._src.fem.cells.element import make_element
from warp._src.fem.cells.families import spline
from warp._src.fem.cells.functions import element_functions
from warp._src.fem.cells.layout import ElementBasis as Basis
from warp._src.fem.cells.polynomial import Polynomial
from warp._src.fem.cells.rules import rule
from warp._src.fem.geometry.grid import Grid2D, Grid3D
from warp._src.fem.spaces.make import make_polynomial_space

SCALARS = [make_element(c, d, Basis.SERENDIPITY) for c in (SQUARE, CUBE) for d in (2, 3)]
SCALARS += [
    make_element(c, d, Basis.NONCONFORMING_POLYNOMIAL)
    for c in (TRIANGLE, SQUARE, TET, CUBE)
    for d in (1, 2, 3, 4)
]
SPLINES = [make_element(c, d, Basis.BSPLINE) for c in (SQUARE, CUBE) for d in (1, 2, 3, 4)]
VECTORS = [
    make_element(c, d, basis)
    for basis in (Basis.NEDELEC_FIRST_KIND, Basis.RAVIART_THOMAS)
    for c in (TRIANGLE, SQUARE, TET, CUBE)
    for d in (1, 2, 3)
]


@pytest.mark.parametrize("element", SCALARS, ids=name)
def test_nodes_and_unity(element):
    values, _ = element.tabulate(element.node_coords)
    np.testing.assert_allclose(values, np.eye(element.node_count), atol=1e-11)
    assert element.node_weights.sum() == pytest.approx(1.0, abs=1e-13)
    assert (element.node_weights > 0.0).all()


@pytest.mark.parametrize("element", SCALARS + SPLINES, ids=name)
def test_unity(element):
    values, gradients = element.tabulate(points_in(element.cell))
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(gradients.sum(axis=1), 0.0, atol=1e-11)


@pytest.mark.parametrize("element", SCALARS + SPLINES + VECTORS, ids=name)
def test_gradients_are_differences(element):
    check_gradients(element, 1e-6, 1e-8)


@pytest.mark.parametrize("element", SCALARS + SPLINES + VECTORS, ids=name)
def test_kernels_agree(element, device):
    coords = points_in(element.cell, count=3)
    values, gradients = element.tabulate(coords)
    found, slopes, places = evaluate(element, coords, device)
    np.testing.assert_allclose(found, values, atol=1e-11)
    np.testing.assert_allclose(slopes, gradients, atol=1e-9)
    np.testing.assert_allclose(places, element.node_coords, atol=1e-15)


@pytest.mark.parametrize("orientation", [0, 5, 23])
def test_orientations_in_kernels(orientation, device):
    element = make_element(TET, 2, Basis.NEDELEC_FIRST_KIND)
    functions = element_functions(element, wp.float64)
    value, gradient = functions.oriented_value, functions.oriented_gradient
    coords, shape = points_in(TET, count=2), (2, element.node_count)

    @wp.kernel(module="unique")
    def fill(
        x: wp.array(dtype=wp.vec3d),
        values: wp.array2d(dtype=wp.vec3d),
        slopes: wp.array2d(dtype=wp.mat33d),
    ):
        i, k = wp.tid()
        values[i, k] = value(x[i], k, orientation)
        slopes[i, k] = gradient(x[i], k, orientation)

    x = wp.array(coords, dtype=wp.vec3d, device=device)
    values, slopes = wp.zeros(shape, wp.vec3d, device), wp.zeros(shape, wp.mat33d, device)
    wp.launch(fill, shape, [x, values, slopes], device=device)
    expected, gradients = element.tabulate(coords, orientation)
    np.testing.assert_allclose(values.numpy(), expected, atol=1e-10)
    np.testing.assert_allclose(slopes.numpy(), gradients, atol=1e-9)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_splines(degree):
    """Splines are smooth, sum to 1 and their support has a length of degree + 1."""
    x = np.linspace(-3.0, 3.0, 601)
    value, slope = spline(degree, x)
    outside = np.abs(x) >= 0.5 * (degree + 1)
    np.testing.assert_array_equal(value[outside], 0.0)
    np.testing.assert_allclose(np.trapezoid(value, x), 1.0, atol=1e-4)
    if degree > 1:
        assert np.abs(np.diff(slope)).max() <= 0.011 * degree


def _polynomials(element, degree):
    """Vector fields whose components are monomials of total degree below that of the element."""
    d = element.cell.dimension
    for powers in itertools.product(range(degree), repeat=d):
        if sum(powers) < degree:
            for axis in range(d):
                yield lambda x, p=powers, a=axis: np.eye(d)[a] * np.prod(x**p, axis=1)[:, None]


@pytest.mark.parametrize("element", VECTORS, ids=name)
def test_degrees_of_freedom_of_vectors(element):
    """Components along the duals at nodes are the degrees of freedom, so polynomials below the
    degree of the element come back."""
    values, _ = element.tabulate(element.node_coords)
    products = np.einsum("nkd,nd->nk", values, element.node_duals)
    np.testing.assert_allclose(products, np.eye(element.node_count), atol=1e-10)
    x = points_in(element.cell)
    basis, _ = element.tabulate(x)
    places = element.cell.parameters(element.node_coords)
    for field in _polynomials(element, element.degree):
        dofs = (field(places) * element.node_duals).sum(axis=1)
        made = np.tensordot(basis, dofs, axes=(1, 0))
        np.testing.assert_allclose(made, field(element.cell.parameters(x)), atol=1e-10)


def _count(element):
    """Dimensions of the spaces (Nedelec 1980)."""
    k, d = element.degree, element.cell.dimension
    is_curl = element.map == "covariant"
    if not element.cell.is_simplex:
        return d * k * (k + 1) ** (d - 1) if is_curl else d * (k + 1) * k ** (d - 1)
    if d == 2:
        return k * (k + 2)
    return k * (k + 2) * (k + 3) // 2 if is_curl else k * (k + 1) * (k + 3) // 2


@pytest.mark.parametrize("element", VECTORS, ids=name)
def test_counts_of_vectors(element):
    assert element.node_count == _count(element)


@pytest.mark.parametrize("cell", [TRIANGLE, TET], ids=str)
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_divergence_theorem(cell, degree):
    """The integral of the divergence is the flux through the sides, in Raviart-Thomas elements."""
    element = make_element(cell, degree, Basis.RAVIART_THOMAS)
    inside = rule(cell, degree)
    _, gradients = element.tabulate(inside.points)
    divergence = inside.weights @ np.einsum("qndd->qn", gradients) * cell.measure
    flux = np.zeros(element.node_count)
    of_side = rule(cell.side, degree)
    for vertices in cell.sides:
        corners = cell.vertices[list(vertices)]
        y = cell.side.parameters(of_side.points)
        axes = corners[1:] - corners[0]
        normal = np.cross(*axes) if len(axes) == 2 else np.array([axes[0][1], -axes[0][0]])
        outside = corners.mean(axis=0) - cell.vertices.mean(axis=0)
        normal = normal * np.sign(normal @ outside) * cell.side.measure
        values, _ = element.tabulate(cell.coords(corners[0] + y @ axes))
        flux += of_side.weights @ (values @ normal)
    np.testing.assert_allclose(divergence, flux, atol=1e-11)


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("cell", [TRIANGLE, SQUARE, TET, CUBE], ids=str)
def test_tangential_continuity(cell, degree):
    def tangential(value, normal):
        return value - (value @ normal) * normal

    check_continuity(cell, tangential, degree=degree, element_basis=Basis.NEDELEC_FIRST_KIND)


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("cell", [TRIANGLE, SQUARE, TET, CUBE], ids=str)
def test_normal_continuity(cell, degree):
    def across(value, normal):
        return value @ normal

    check_continuity(cell, across, degree=degree, element_basis=Basis.RAVIART_THOMAS)


@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize("cell", [SQUARE, CUBE], ids=str)
def test_serendipity_is_continuous(cell, degree):
    check_continuity(cell, degree=degree, element_basis=Basis.SERENDIPITY)


@pytest.mark.parametrize("basis", [Basis.NEDELEC_FIRST_KIND, Basis.RAVIART_THOMAS])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("grid", [Grid2D((2, 3)), Grid3D((2, 1, 3))], ids=lambda g: g.name)
def test_vector_spaces_on_grids(grid, degree, basis):
    """Nodes at one place with one direction are one node, and there is no other one."""
    space = make_polynomial_space(grid, degree=degree, element_basis=basis)
    numbers = space.topology.element_node_indices().numpy()
    assert sorted(set(numbers.ravel())) == list(range(space.node_count()))
    positions = space.node_positions().numpy()
    directions = np.zeros_like(positions)
    directions[numbers] = space.element.node_duals
    both = np.round(np.hstack((positions, directions)), 5)
    assert len(np.unique(both, axis=0)) == space.node_count()
    assert not space.topology.record.is_signed


def test_errors():
    with pytest.raises(ValueError, match="serendipity elements have degree 2 or 3"):
        make_element(CUBE, 4, Basis.SERENDIPITY)
    with pytest.raises(ValueError, match="need nodes at vertices"):
        make_element(SQUARE, 2, Basis.SERENDIPITY, Polynomial.GAUSS_LEGENDRE)
    with pytest.raises(ValueError, match="B-splines need a square or cube"):
        make_element(TRIANGLE, 2, Basis.BSPLINE)
    with pytest.raises(ValueError, match="needs a cell of 2 or 3 axes"):
        make_element(LINE, 1, Basis.RAVIART_THOMAS)
    with pytest.raises(ValueError, match="collocated"):
        from warp._src.fem.spaces.make import make_collocated_function_space
        from warp._src.fem.spaces.make import make_polynomial_basis_space as basis

        make_collocated_function_space(basis(Grid2D((2, 2)), 1, Basis.RAVIART_THOMAS), wp.vec2)


def test_mass_of_raviart_thomas():
    """The matrix of the right-angled triangle, whose functions are x minus the opposite vertex."""
    element, made = make_element(TRIANGLE, 1, Basis.RAVIART_THOMAS), rule(TRIANGLE, 2)
    values, _ = element.tabulate(made.points)
    found = np.einsum("q,qid,qjd->ij", made.weights, values, values) * TRIANGLE.measure
    opposite = TRIANGLE.vertices[[2, 0, 1]]
    # Integrals of x x, x y and x over the triangle.
    xx, x = (1 / 12 + 1 / 12), np.full(2, 1 / 6)
    expected = [[xx - a @ x - b @ x + a @ b / 2 for b in opposite] for a in opposite]
    np.testing.assert_allclose(found, expected, atol=1e-15)
