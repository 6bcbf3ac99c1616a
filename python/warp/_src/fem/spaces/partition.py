"""Space partitions - the nodes of a space that a part of a geometry has, and their numbers."""

from warp._src.fem.geometry.partition import WholeGeometryPartition
from warp._src.fem.spaces.node_numbers import SpacePartition, WholeSpacePartition


def make_space_partition(
    space_topology,
    geometry_partition=None,
    with_halo: bool = True,
    max_node_count: int = -1,
    environment_first: bool = False,
    *,
    device=None,
    temporary_store=None,
) -> SpacePartition:
    """The nodes of a space that a part of its geometry has.

    Args:
        space_topology: numbers of the nodes of the space.
        geometry_partition: the part of the geometry; all of it if not given.
        with_halo: take the nodes of neighbour cells beyond the frontier, too.
        max_node_count: a capacity, so that nothing is read back from the device; -1 to count.
        environment_first: number nodes environment by environment.
        device: where numbers are worked out.

    Raises:
        ValueError: a halo is asked for with nodes by environment.
    """
    topology = space_topology.full_space_topology()
    is_whole = geometry_partition is None or isinstance(geometry_partition, WholeGeometryPartition)
    if is_whole and not environment_first:
        return WholeSpacePartition(topology)
    from warp._src.fem.spaces.listed_partitions import EnvironmentSpacePartition, NodePartition

    if environment_first:
        if is_whole:
            geometry_partition = WholeGeometryPartition(topology.geometry)
        elif with_halo:
            raise ValueError(
                "'environment_first' has no halo for a part of a geometry; pass 'with_halo=False'"
            )
        return EnvironmentSpacePartition(topology, geometry_partition, max_node_count, device)
    return NodePartition(topology, geometry_partition, with_halo, max_node_count, device)
