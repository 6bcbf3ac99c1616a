"""Spaces on sparse grids: numbers of nodes beside those of dense grids, and rebuilt ones."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem

Basis = fem.ElementBasis
RES = (3, 2, 4)
CASES = [
    (Basis.LAGRANGE, 1),
    (Basis.LAGRANGE, 2),
    (Basis.LAGRANGE, 3),
    (Basis.SERENDIPITY, 2),
    (Basis.NEDELEC_FIRST_KIND, 1),
    (Basis.NEDELEC_FIRST_KIND, 2),
    (Basis.RAVIART_THOMAS, 1),
    (Basis.RAVIART_THOMAS, 2),
    (Basis.BSPLINE, 1),
    (Basis.BSPLINE, 2),
    (Basis.BSPLINE, 3),
]


def volume(voxels, **options):
    points = wp.array(np.array(voxels), dtype=wp.vec3i)
    return wp.Volume.allocate_by_voxels(points, voxel_size=1.0, **options)


def both(basis, degree):
    """The same space on a sparse and on a dense grid of boxes of size 1."""
    voxels = list(np.ndindex(*RES))
    sparse = fem.Nanogrid(volume(voxels))
    dense = fem.Grid3D(wp.vec3i(RES), wp.vec3(0.0), wp.vec3(*map(float, RES)))
    spaces = [
        fem.make_polynomial_space(g, degree=degree, element_basis=basis) for g in (sparse, dense)
    ]
    order = np.ravel_multi_index(np.round(cell_places(sparse)).astype(int).T, RES)
    return (*spaces, order)


def cell_places(geometry):
    """Lower corners of the cells."""
    space = fem.make_polynomial_space(geometry, degree=0)
    middle = space.node_positions().numpy()
    return middle - middle.min(axis=0)


@pytest.mark.parametrize(("basis", "degree"), CASES)
def test_numbers_are_those_of_dense_grids(basis, degree):
    """Cells share the same nodes as in a dense grid, in the same places."""
    sparse, dense, order = both(basis, degree)
    assert sparse.node_count() == dense.node_count()
    numbers = sparse.topology.element_node_indices().numpy()
    others = dense.topology.element_node_indices().numpy()[order]
    renamed = np.full(sparse.node_count(), -1)
    renamed[numbers] = others
    np.testing.assert_array_equal(renamed[numbers], others)
    assert len(np.unique(renamed)) == dense.node_count()


@pytest.mark.parametrize(("basis", "degree"), [(Basis.LAGRANGE, 2), (Basis.BSPLINE, 2)])
def test_rebuilt_grids(basis, degree):
    """After `rebuild`, spaces number the nodes of the new voxels, within the same room."""
    first, second = [(0, 0, 0)], [(0, 0, 0), (1, 0, 0), (3, 0, 0)]
    grid = volume(first, rebuildable=True, max_active_voxels=4)
    sparse = fem.Nanogrid(grid, rebuildable=True)
    space = fem.make_polynomial_space(sparse, degree=degree, element_basis=basis)
    count = space.node_count()
    assert len(set(space.topology.element_node_indices().numpy()[0])) == space.element.node_count
    sparse.rebuild(wp.array(np.array(second), dtype=wp.vec3i))
    numbers = space.topology.element_node_indices().numpy()[:3]
    assert space.node_count() == count
    assert numbers.max() < count
    fresh = fem.make_polynomial_space(
        fem.Nanogrid(volume(second)), degree=degree, element_basis=basis
    )
    others = fresh.topology.element_node_indices().numpy()
    np.testing.assert_array_equal(np.unique(numbers).size, np.unique(others).size)
    shared = [len(set(numbers[i]) & set(numbers[j])) for i, j in ((0, 1), (0, 2), (1, 2))]
    fresh_shared = [len(set(others[i]) & set(others[j])) for i, j in ((0, 1), (0, 2), (1, 2))]
    assert shared == fresh_shared


def test_errors():
    mesh = fem.Trimesh2D(
        wp.array([[0, 1, 2]], dtype=wp.int32),
        wp.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], dtype=wp.vec2),
    )
    with pytest.raises(ValueError, match="B-splines need a square or cube"):
        fem.make_polynomial_space(mesh, degree=2, element_basis=Basis.BSPLINE)
