"""Bases of points - nodes at quadrature points with radial functions around them."""

from __future__ import annotations

import inspect

import warp as wp
from warp import extend
from warp._src.fem.spaces.basis import BasisRecord, BasisSpace
from warp._src.fem.spaces.point_functions import PointsRecord
from warp._src.fem.spaces.topologies import SpaceTopology, TopologyRecord


class PointTopology(SpaceTopology):
    """Nodes of a cell that are its quadrature points."""

    def __init__(self, quadrature, record: TopologyRecord):
        super().__init__(quadrature.domain.geometry, record)
        self._quadrature = quadrature
        self.kernel_values: dict = {}

    def node_count(self) -> int:
        """Number of points, or of (element, point) pairs."""
        if self.record.quadrature.is_unique:
            return self._quadrature.evaluation_point_count()
        return self._quadrature.total_point_count()

    # Points may change from one use to the next.
    _keeps_arguments = False

    def fill_topo_arg(self, arg, device) -> None:
        """Fills an argument of the functions of kernels."""
        self._quadrature.fill_arg(arg.quadrature, device)
        self._quadrature.domain.fill_element_index_arg(arg.part, device)
        for name, value in self.kernel_values.items():
            setattr(arg.values, name, value)

    def __eq__(self, other) -> bool:
        if not isinstance(other, SpaceTopology):
            return NotImplemented
        same = isinstance(other, PointTopology) and self._quadrature is other._quadrature
        return same and self.record == other.record

    def __hash__(self) -> int:
        return hash((id(self._quadrature), self.record))


def _arguments(function, real) -> tuple:
    """Names and types of the arguments of a radial function after the first two.

    Raises:
        TypeError: the first two are no squared distance and no point.
    """
    parameters = list(inspect.signature(function.func).parameters.values())
    types = [p.annotation for p in parameters]
    known = [extend.canonical(t) for t in types[:2] if isinstance(t, type)]
    fits = len(known) == 2 and known[0] in (wp.float32, real) and known[1] is wp.int32
    if not fits:
        expected = " or ".join(dict.fromkeys(extend.type_repr(t) for t in (wp.float32, real)))
        shown = [extend.type_repr(t) if isinstance(t, type) else "unavailable" for t in types[:2]]
        shown += ["unavailable"] * (2 - len(shown))
        raise TypeError(
            f"Radial kernel '{function.func.__name__}' argument types must be "
            f"({expected}, {extend.type_repr(wp.int32)}), got ({', '.join(shown)})"
        )
    return tuple((p.name, p.annotation) for p in parameters[2:])


class PointBasisSpace(BasisSpace):
    """Basis functions around quadrature points; each counts in the point's cell alone.

    Args:
        quadrature: the points, on all cells of a geometry or of a partition.
        kernel_func: function of kernels of (squared distance, number of the point, ...); 1 at the
            point itself and 0 elsewhere if not given.
        kernel_grad_func: its derivative by the squared distance, with the same arguments; gradients
            are 0 if not given.
        kernel_values: values of the arguments that follow.
        distance_space: "reference" or "world": distances of coordinates or in space.
        max_nodes_per_element: the most points of a cell that count.
        use_evaluation_point_index: nodes are (cell, point) pairs; else points that several cells
            have are one node.

    Raises:
        ValueError: the domain is none of all cells, or the number of points is not known.
        TypeError: arguments of a radial function have other types.
    """

    def __init__(
        self,
        quadrature,
        kernel_func=None,
        kernel_grad_func=None,
        kernel_values: dict | None = None,
        distance_space: str = "reference",
        max_nodes_per_element: int = -1,
        use_evaluation_point_index: bool = False,
    ):
        domain = quadrature.domain
        if not domain.is_cells or (
            domain.element_count() != domain.geometry_partition.cell_count()
        ):
            raise ValueError(
                f"nodes at points need a domain of all cells of a geometry or of a partition, but "
                f"got {domain.name!r}"
            )
        if distance_space not in ("reference", "world"):
            raise ValueError(
                f"'distance_space' expects 'reference' or 'world', but got {distance_space!r}"
            )
        if max_nodes_per_element < 0:
            max_nodes_per_element = quadrature.max_points_per_element()
            if max_nodes_per_element is None:
                raise ValueError(
                    "the quadrature does not know its most points in a cell; pass "
                    "'max_nodes_per_element'"
                )
        real = domain.geometry.scalar_type
        values = () if kernel_func is None else _arguments(kernel_func, real)
        points = PointsRecord(
            quadrature.record,
            kernel_func,
            kernel_grad_func,
            values,
            distance_space == "world",
            use_evaluation_point_index,
        )
        record = TopologyRecord(
            "points", domain.geometry.record, max_nodes_per_element, quadrature=points
        )
        topology = PointTopology(quadrature, record)
        super().__init__(topology, BasisRecord(record))
        self.kernel_func, self.kernel_grad_func = kernel_func, kernel_grad_func
        self.kernel_values = {} if kernel_values is None else kernel_values

    @property
    def kernel_values(self) -> dict:
        """Values of the further arguments of the radial functions."""
        return self.topology.kernel_values

    @kernel_values.setter
    def kernel_values(self, values: dict) -> None:
        known = {name for name, _ in self.record.topology.quadrature.values}
        if set(values) != known:
            raise ValueError(
                f"'kernel_values' expects {sorted(known)}, as the radial function has, but got "
                f"{sorted(values)}"
            )
        self.topology.kernel_values = dict(values)
