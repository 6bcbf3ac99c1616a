"""Partitions of nodes: by environment, and their numbers in restrictions."""

import numpy as np
import pytest

import warp as wp
from warp._src.fem.domains import Cells
from warp._src.fem.geometry.grid import Grid2D
from warp._src.fem.spaces.make import make_polynomial_space
from warp._src.fem.spaces.partition import make_space_partition
from warp._src.fem.spaces.restriction import make_space_restriction
from warp.fem import ExplicitGeometryPartition


def test_nodes_by_environment():
    grid = Grid2D((3, 2), env_count=3)
    topology = make_polynomial_space(grid, degree=2).topology
    partition = make_space_partition(topology, environment_first=True)
    count = topology.node_count()
    assert partition.node_count() == count
    np.testing.assert_array_equal(partition.space_node_indices().numpy(), np.arange(count))
    np.testing.assert_array_equal(partition.env_offsets.numpy(), [0, 35, 70, 105])


@pytest.mark.parametrize("capacity", [50, 200])
def test_capacities(capacity):
    grid = Grid2D((3, 2), env_count=2)
    topology = make_polynomial_space(grid, degree=2).topology
    partition = make_space_partition(topology, environment_first=True, max_node_count=capacity)
    kept = min(capacity, 70)
    assert partition.node_count() == kept
    restriction = make_space_restriction(partition, Cells(grid))
    table, nodes = restriction.element_table().numpy(), topology.element_node_indices().numpy()
    np.testing.assert_array_equal(table, np.where(nodes < kept, nodes, -1))


def expected_kinds(topology, grid, part, number):
    """Sets of the nodes of a partition's cells: the ones of it alone, and the ones shared."""
    nodes = topology.element_node_indices().numpy()
    own = set(nodes[part == number].ravel())
    shared = own & set(nodes[part != number].ravel())
    return own - shared, shared


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("with_halo", [False, True])
def test_kinds_of_nodes(degree, with_halo):
    """Interior nodes come first, then the ones on the frontier, then the halo."""
    grid = Grid2D((4, 5))
    topology = make_polynomial_space(grid, degree=degree).topology
    part = np.arange(20) * 3 // 20
    for number in range(3):
        mask = wp.array((part == number).astype(np.int32))
        cells = ExplicitGeometryPartition(grid, mask)
        partition = make_space_partition(topology, cells, with_halo=with_halo)
        interior, shared = expected_kinds(topology, grid, part, number)
        kept = partition.space_node_indices().numpy()
        assert len(kept) == partition.node_count() == len(set(kept))
        owned = interior | shared
        if with_halo:
            first, last = partition.interior_node_count(), partition.owned_node_count()
            # All nodes of the cells along the frontier belong to it.
            assert set(kept[:first]) | set(kept[first:last]) == owned
            assert set(kept[:first]) <= interior
            assert set(kept[last:]).isdisjoint(owned)
            assert partition.node_count() > last
        else:
            assert set(kept) == owned
        restriction = make_space_restriction(partition, Cells(cells))
        table = restriction.element_table().numpy()
        nodes = topology.element_node_indices().numpy()[part == number]
        np.testing.assert_array_equal(kept[table], nodes)
