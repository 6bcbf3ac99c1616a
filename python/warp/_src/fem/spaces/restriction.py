"""Space restrictions - the nodes of a space that the elements of a domain have."""

import warp as wp
from warp import extend
from warp._src.fem.geometry.base import PerDevice
from warp._src.fem.spaces.partition import make_space_partition
from warp._src.fem.spaces.partition_kernels import table_kernel
from warp._src.fem.types import Ints


@wp.struct
class NodeArg:
    """Nodes of a restriction, with their elements."""

    width: int
    begins: Ints
    positions: Ints
    nodes: Ints


@wp.struct
class NodeElementIndex:
    """An element of a node, by its number in the domain, and the node's number in it."""

    domain_element_index: int
    node_index_in_element: int


@wp.func
def _node_partition_index(arg: NodeArg, index: int):
    return arg.nodes[index]


@wp.func
def _node_element_range(arg: NodeArg, node: int):
    return arg.begins[node], arg.begins[node + 1]


@wp.func
def _node_element_index(arg: NodeArg, place: int):
    position = arg.positions[place]
    return NodeElementIndex(position // arg.width, position % arg.width)


class SpaceRestriction:
    """The nodes of a partition that the elements of a domain have, with those elements.

    Attributes:
        space_partition: the nodes and their numbers.
        space_topology: numbers of the nodes of elements of the domain's kind.
        domain: the elements.
    """

    def __init__(self, space_partition, domain, device=None, temporary_store=None):
        topology = space_partition.space_topology
        if domain.dimension == topology.dimension - 1:
            topology = topology.trace()
        if domain.dimension != topology.dimension:
            raise ValueError(
                f"elements of dimension {domain.dimension} do not fit a space of dimension "
                f"{topology.dimension}"
            )
        if domain.geometry is not topology.geometry:
            raise ValueError(
                f"domain {domain.name!r} and space {topology.name!r} have different geometries"
            )
        self.space_partition, self.space_topology, self.domain = space_partition, topology, domain
        self._device = device
        self.rebuild()

    def rebuild(self, device=None, temporary_store=None) -> None:
        """Takes over a geometry, partition or domain that changed."""
        self._device = wp.get_device(self._device if device is None else device)
        self._kept = PerDevice()

    def element_table(self, device=None):
        """Partition numbers of the nodes of each element, int32 (elements, n); -1 for none."""
        device = wp.get_device(self._device if device is None else device)
        key = ("table", device.alias)
        if key not in self._kept:
            self._kept[key] = self._make_table(device)
        return self._kept[key]

    def _make_table(self, device):
        domain, topology, partition = self.domain, self.space_topology, self.space_partition
        shape = (domain.element_count(), topology.nodes_per_element)
        table = wp.empty(shape, dtype=wp.int32, device=device)
        kernel = table_kernel(domain.record, topology.record, partition.record)
        inputs = [
            domain.element_arg_value(device),
            domain.element_index_arg_value(device),
            topology.topo_arg_value(device),
            partition.partition_arg_value(device),
            table,
        ]
        with extend.unrecorded():
            wp.launch(kernel, shape, inputs, device=device)
        return table

    @property
    def incidence(self):
        """Positions in the table of each node, in element order, see `Incidence`."""
        if "incidence" not in self._kept:
            from warp._src.fem.assembly.incidence import find_incidence

            with extend.unrecorded():
                self._kept["incidence"] = find_incidence(
                    self.element_table(), self.space_partition.node_count()
                )
        return self._kept["incidence"]

    def partition_element_offsets(self):
        """First position of each node of the partition, int32 (nodes + 1,)."""
        return self.incidence.begins

    def total_node_element_count(self) -> int:
        """Number of pairs of an element and one of its nodes."""
        return self.element_table().size

    def node_partition_indices(self):
        """Partition numbers of the nodes that elements have, ascending, int32 (nodes,)."""
        if "indices" not in self._kept:
            from warp._src.fem.assembly.incidence import mark_used
            from warp._src.fem.geometry.indices import masked_indices

            begins = self.incidence.begins
            mask = wp.empty(begins.shape[0] - 1, dtype=wp.int32, device=begins.device)
            with extend.unrecorded():
                wp.launch(mark_used, mask.shape[0], [begins, mask], device=begins.device)
            self._kept["indices"] = masked_indices(mask)[0]
        return self._kept["indices"]

    def node_arg_value(self, device=None) -> NodeArg:
        """Argument of the functions of kernels of this class."""
        device = wp.get_device(self._device if device is None else device)
        arg = NodeArg()
        arg.width = self.space_topology.nodes_per_element
        arg.begins = self.incidence.begins.to(device)
        arg.positions = self.incidence.positions.to(device)
        arg.nodes = self.node_partition_indices().to(device)
        return arg

    NodeArg = NodeArg
    node_partition_index = staticmethod(_node_partition_index)
    node_element_range = staticmethod(_node_element_range)
    node_element_index = staticmethod(_node_element_index)

    def node_count(self) -> int:
        """Number of nodes that elements have."""
        return self.node_partition_indices().shape[0]

    def node_count_sync(self) -> int:
        """Number of nodes that elements have."""
        return self.node_count()


def make_space_restriction(
    space_partition=None, domain=None, space_topology=None, device=None, temporary_store=None
) -> SpaceRestriction:
    """The nodes of a partition, or of a space, that the elements of a domain have.

    Args:
        space_partition: the nodes to take.
        domain: the elements; all cells if not given.
        space_topology: numbers of the nodes of a space, if there is no partition.
        device: where the nodes are worked out.

    Raises:
        ValueError: there is neither a partition nor a topology, or the domain does not fit.
    """
    from warp._src.fem.domains import Cells

    if space_partition is None:
        if space_topology is None:
            raise ValueError("One of `space_partition` or `space_topology` must be provided")
        domain = Cells(space_topology.geometry) if domain is None else domain
        space_partition = make_space_partition(
            space_topology=space_topology, geometry_partition=domain.geometry_partition
        )
    elif domain is None:
        domain = Cells(space_partition.geo_partition)
    return SpaceRestriction(space_partition, domain, device=device)
