"""Spaces on grids: numbers and positions of nodes, traces, restrictions, mappers, errors."""

import numpy as np
import pytest

import warp as wp
from warp._src.fem.cells.element import ElementBasis
from warp._src.fem.cells.polynomial import Polynomial
from warp._src.fem.domains import BoundarySides, Cells, Sides
from warp._src.fem.geometry.grid import Grid2D, Grid3D
from warp._src.fem.spaces.make import make_polynomial_basis_space, make_polynomial_space
from warp._src.fem.spaces.mappers import (
    Mapping,
    SkewSymmetricTensorMapper,
    SymmetricTensorMapper,
)
from warp._src.fem.spaces.partition import make_space_partition
from warp._src.fem.spaces.restriction import make_space_restriction


def grids(environments=1):
    return [
        Grid2D((3, 2), bounds_hi=(3.0, 2.0), env_count=environments),
        Grid3D((3, 2, 4), bounds_hi=(3.0, 2.0, 4.0), env_count=environments),
    ]


def lattice_nodes(grid, degree):
    """Numbers of the nodes of each cell of one environment, by their places in a regular grid."""
    res = list(grid.res)
    numbers = np.arange(np.prod([degree * n + 1 for n in res]))
    numbers = numbers.reshape([degree * n + 1 for n in res])
    cells = []
    for place in np.ndindex(*res):
        cut = tuple(slice(degree * p, degree * p + degree + 1) for p in place)
        cells.append(numbers[cut].ravel())
    return np.array(cells), numbers.size


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("environments", [1, 2])
@pytest.mark.parametrize("axes", [0, 1])
def test_numbers_of_lagrange_nodes(axes, environments, degree):
    grid = grids(environments)[axes]
    space = make_polynomial_space(grid, degree=degree)
    cells, count = lattice_nodes(grid, degree)
    expected = np.concatenate([cells + env * count for env in range(environments)])
    assert space.node_count() == environments * count
    np.testing.assert_array_equal(space.topology.element_node_indices().numpy(), expected)
    positions = space.node_positions().numpy()[:count]
    mesh = np.stack(space.node_grid(), axis=-1).reshape(count, -1)
    np.testing.assert_allclose(positions, mesh, atol=1e-6)


@pytest.mark.parametrize("axes", [0, 1])
@pytest.mark.parametrize("degree", [2, 3])
def test_tables_agree_with_arithmetic(axes, degree):
    """Lagrange nodes by entity have the positions of those by arithmetic, cell by cell."""
    from warp._src.fem.spaces.basis import ShapeBasisSpace
    from warp._src.fem.spaces.tables import TableTopology

    grid = grids()[axes]
    basis = make_polynomial_basis_space(grid, degree)
    table = ShapeBasisSpace(TableTopology(grid, basis.element), basis.element)
    assert table.node_count() == basis.node_count()
    found = table.node_positions().numpy()[table.topology.element_node_indices().numpy()]
    expected = basis.node_positions().numpy()[basis.topology.element_node_indices().numpy()]
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert len(np.unique(np.round(table.node_positions().numpy(), 4), axis=0)) == basis.node_count()


def test_discontinuous_nodes():
    grid = grids()[0]
    space = make_polynomial_space(grid, degree=2, discontinuous=True)
    assert space.node_count() == 9 * grid.cell_count()
    numbers = space.topology.element_node_indices().numpy()
    np.testing.assert_array_equal(numbers, np.arange(54).reshape(6, 9))
    assert make_polynomial_space(grid, degree=0).node_count() == grid.cell_count()
    gauss = Polynomial.GAUSS_LEGENDRE
    with pytest.raises(ValueError, match="do not lie on sides"):
        make_polynomial_space(grid, degree=2, family=gauss)


@pytest.mark.parametrize("axes", [0, 1])
def test_nodes_of_sides(axes):
    """A side has the nodes of its inner cell, then of its outer cell."""
    grid = grids()[axes]
    topology = make_polynomial_space(grid, degree=1).topology
    cells = topology.element_node_indices().numpy()
    sides = topology.trace().element_node_indices().numpy()
    assert sides.shape == (grid.side_count(), 2 * cells.shape[1])
    known = {tuple(c) for c in cells}
    n, shared = cells.shape[1], []
    for side in sides:
        assert tuple(side[:n]) in known
        assert tuple(side[n:]) in known
        shared.append(len(set(side[:n]) & set(side[n:])))
    assert shared.count(n) == grid.boundary_side_count()
    assert set(shared) == {n, n // 2}


@pytest.mark.parametrize("kind", [Cells, Sides, BoundarySides])
def test_restrictions(kind):
    grid = grids()[1]
    space = make_polynomial_space(grid, degree=2)
    domain = kind(grid)
    restriction = make_space_restriction(domain=domain, space_topology=space.topology)
    table = restriction.element_table().numpy()
    topology = space.topology if kind is Cells else space.topology.trace()
    nodes = topology.element_node_indices().numpy()
    if kind is not BoundarySides:
        np.testing.assert_array_equal(table, nodes)
    np.testing.assert_array_equal(restriction.node_partition_indices().numpy(), np.unique(table))
    begins = restriction.partition_element_offsets().numpy()
    positions = restriction.incidence.positions.numpy()
    for node in (0, 7, space.node_count() - 1):
        found = positions[begins[node] : begins[node + 1]]
        np.testing.assert_array_equal(found, np.flatnonzero(table.ravel() == node))


def test_elements_of_nodes_in_kernels(device):
    grid = grids()[0]
    topology = make_polynomial_space(grid, degree=1).topology
    restriction = make_space_restriction(space_topology=topology, device=device)
    spread, element_of = restriction.node_element_range, restriction.node_element_index
    number_of, NodeArg = restriction.node_partition_index, restriction.NodeArg

    @wp.kernel(module="unique")
    def mark(arg: NodeArg, found: wp.array2d(dtype=int)):
        node = number_of(arg, wp.tid())
        first, last = spread(arg, node)
        for place in range(first, last):
            at = element_of(arg, place)
            found[at.domain_element_index, at.node_index_in_element] = node

    cells = topology.element_node_indices().numpy()
    found = wp.full(cells.shape, -1, dtype=int, device=device)
    wp.launch(
        mark,
        restriction.node_count(),
        [restriction.node_arg_value(device), found],
        device=device,
    )
    np.testing.assert_array_equal(found.numpy(), cells)


def test_whole_partitions_are_equal_by_value():
    grid = grids()[0]
    first, second = (make_polynomial_space(grid, degree=2) for _ in range(2))
    assert first.topology is second.topology
    assert first == second
    partitions = [make_space_partition(s.topology) for s in (first, second)]
    assert partitions[0] == partitions[1]
    assert hash(partitions[0]) == hash(partitions[1])
    assert partitions[0].node_count() == first.node_count()


MAPPERS = [
    (SymmetricTensorMapper, (wp.mat22,), 3),
    (SymmetricTensorMapper, (wp.mat22d, Mapping.DB16), 3),
    (SymmetricTensorMapper, (wp.mat33d,), 6),
    (SymmetricTensorMapper, (wp.mat33, Mapping.DB16), 6),
    (SkewSymmetricTensorMapper, (wp.mat22d,), 1),
    (SkewSymmetricTensorMapper, (wp.mat33,), 3),
]


@pytest.mark.parametrize(("mapper", "arguments", "count"), MAPPERS)
def test_tensor_mappers(mapper, arguments, count, device):
    """Components are orthonormal in half of the product of Frobenius, and come back."""
    made = mapper(*arguments)
    assert made.DOF_SIZE == count
    to_value, to_dof, dof, value = (
        *(made.dof_to_value, made.value_to_dof),
        *(made.dof_dtype, made.value_dtype),
    )

    @wp.kernel(module="unique")
    def convert(x: wp.array(dtype=dof), y: wp.array(dtype=value), z: wp.array(dtype=dof)):
        i = wp.tid()
        y[i] = to_value(x[i])
        z[i] = to_dof(y[i])

    x = np.eye(count) if count > 1 else np.ones(1)
    x = wp.array(x, dtype=dof, device=device)
    y, z = wp.zeros(count, value, device), wp.zeros(count, dof, device)
    wp.launch(convert, count, [x, y, z], device=device)
    tensors = y.numpy()
    sign = -1.0 if mapper is SkewSymmetricTensorMapper else 1.0
    np.testing.assert_array_equal(tensors.transpose(0, 2, 1), sign * tensors)
    products = 0.5 * np.einsum("aij,bij->ab", tensors, tensors)
    np.testing.assert_allclose(products, np.eye(count), atol=1e-6)
    np.testing.assert_allclose(z.numpy(), x.numpy(), atol=1e-6)


def test_mapped_spaces():
    grid = grids()[1]
    space = make_polynomial_space(grid, dof_mapper=SymmetricTensorMapper(wp.mat33))
    assert (space.dtype, space.NODE_DOF_COUNT, space.VALUE_DOF_COUNT) == (wp.mat33, 6, 6)
    assert not space.gradient_valid()
    assert space.divergence_valid()
    assert space.trace().cell_space == space


def test_errors():
    grid = grids()[0]
    with pytest.raises(ValueError, match="do not fit a geometry of"):
        make_polynomial_space(grid, dtype=wp.vec2d)
    with pytest.raises(ValueError, match="expect a 2x2 or 3x3 matrix"):
        SymmetricTensorMapper(wp.vec3)
    with pytest.raises(ValueError, match="One of `space_partition` or `space_topology`"):
        make_space_restriction()
    with pytest.raises(ValueError, match="different geometries"):
        topology = make_polynomial_space(grid).topology
        make_space_restriction(domain=Cells(grids()[0]), space_topology=topology)
    with pytest.raises(ValueError, match="expects shape"):
        make_polynomial_space(grid).node_positions(out=wp.zeros(3, dtype=wp.vec2))
    with pytest.raises(ValueError, match="degree of 0 or more"):
        make_polynomial_space(grid, degree=-2, element_basis=ElementBasis.LAGRANGE)
