"""Partitions of nodes: by environment, and their numbers in restrictions."""

import numpy as np
import pytest

from warp._src.fem.domains import Cells
from warp._src.fem.geometry.grid import Grid2D
from warp._src.fem.spaces.make import make_polynomial_space
from warp._src.fem.spaces.partition import make_space_partition
from warp._src.fem.spaces.restriction import make_space_restriction


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
