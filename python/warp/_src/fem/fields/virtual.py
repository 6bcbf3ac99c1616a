"""Test and trial functions - the unknown arguments that a form is linear in."""

from __future__ import annotations

import warp as wp
from warp._src.fem.fields.discrete import SpaceField
from warp._src.fem.fields.spaces import node_arg_value


class VirtualField(SpaceField):
    """Base of test and trial functions.

    Attributes:
        domain: elements on which it is defined.
    """

    role = ""

    def __init__(self, space, space_partition, domain):
        if domain.dimension == space.geometry.dimension - 1 and not domain.is_cells:
            space = space.trace()
        super().__init__(space, space_partition)
        self.domain = domain

    def arg_value(self, device):
        """The struct of topology and partition."""
        return node_arg_value(self.space, self.space_partition, None, device)

    def partition_node_count(self) -> int:
        """Number of nodes in the partition."""
        return self.space_partition.node_count()

    @property
    def name(self) -> str:
        """Role in messages."""
        return f"{self.role} function"


class TestField(VirtualField):
    """A test function: rows of vectors and matrices."""

    __test__ = False
    role = "test"

    def __init__(self, space_restriction, space):
        super().__init__(space, space_restriction.space_partition, space_restriction.domain)
        self.space_restriction = space_restriction

    def rebind(self, space, space_restriction) -> None:
        """Gives it another space and restriction of the same kind."""
        self.__init__(space_restriction, space)


class LocalTestField(TestField):
    """A view of a test function, as NVIDIA Warp's assembly makes one; forms take it as they do the
    test function.

    Attributes:
        global_field: the test function.
    """

    def __init__(self, test_field: TestField):
        super().__init__(test_field.space_restriction, test_field.space)
        self.global_field = test_field


class TrialField(VirtualField):
    """A trial function: columns of matrices."""

    role = "trial"

    def rebind(self, space, space_partition, domain=None) -> None:
        """Gives it another space and partition of the same kind."""
        self.__init__(space, space_partition, domain or self.domain)


def make_test(
    space, space_restriction=None, space_partition=None, domain=None, device=None
) -> TestField:
    """A test function over a function space.

    Args:
        space: the space.
        space_restriction: nodes and elements; by default those of `space_partition` and `domain`.
        space_partition: nodes; by default all.
        domain: elements; by default all cells.
    """
    if space_restriction is None:
        from warp._src.fem.spaces.restriction import make_space_restriction

        space_restriction = make_space_restriction(
            space_topology=space.topology,
            space_partition=space_partition,
            domain=domain,
            device=wp.get_device(device),
        )
    return TestField(space_restriction, space)


def make_trial(space, space_restriction=None, space_partition=None, domain=None) -> TrialField:
    """A trial function over a function space; arguments are those of `make_test`."""
    from warp._src.fem.domains import Cells
    from warp._src.fem.spaces.partition import make_space_partition

    if space_restriction is not None:
        domain, space_partition = space_restriction.domain, space_restriction.space_partition
    if space_partition is None:
        domain = Cells(space.geometry) if domain is None else domain
        space_partition = make_space_partition(
            space_topology=space.topology, geometry_partition=domain.geometry_partition
        )
    elif domain is None:
        domain = Cells(space_partition.geo_partition)
    return TrialField(space, space_partition, domain)
