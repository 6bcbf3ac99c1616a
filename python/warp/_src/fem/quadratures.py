"""Quadratures - points and weights in the elements of a domain."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.domains import DomainRecord
from warp._src.fem.geometry.base import RecordFunctions, per_device
from warp._src.fem.kept import Functions, Record
from warp._src.fem.types import OUTSIDE, coords_type


@dataclass(frozen=True)
class QuadratureRecord(Record):
    """Facts of a quadrature that its functions of kernels depend on.

    `kind` names the maker of functions, `rule` is the rule if all elements share one, `points`
    the number of points per element if it is one for all.
    """

    kind: str
    domain: DomainRecord
    rule: object = None
    points: int | None = None
    detail: object = None

    def make_functions(self) -> SimpleNamespace:
        """Makes the structs and functions of kernels of a quadrature."""
        return MAKERS[self.kind](self, self.domain.functions)


MAKERS: dict = {}


class Quadrature(RecordFunctions):
    """Base of quadratures.

    Functions of kernels take (element argument, quadrature argument, number of the element in the
    domain, number in the geometry[, point]): `point_count`, `point_coords`, `point_weight`,
    `point_index`.
    """

    record: QuadratureRecord
    rule = None

    def __init__(self, domain):
        self._domain = domain

    @property
    def domain(self):
        """Domain of the points."""
        return self._domain

    @property
    def points_per_element(self) -> int | None:
        """Number of points of each element, None if it varies."""
        return self.record.points

    def max_points_per_element(self) -> int | None:
        """Largest number of points of an element, None if it is not known."""
        return self.points_per_element

    def total_point_count(self) -> int:
        """Numbers of points, `qp_index`, are below this one."""
        raise NotImplementedError

    def evaluation_point_count(self) -> int:
        """Number of (element, point) pairs."""
        n = self.points_per_element
        return self.total_point_count() if n is None else n * self.domain.element_count()

    @property
    def name(self) -> str:
        """Class and domain in one word."""
        return f"{type(self).__name__}_{self.domain.name}"

    @per_device
    def arg_value(self, device):
        """Argument of the functions of points."""
        arg = self.Arg()
        self.fill_arg(arg, device)
        return arg


class RegularQuadrature(Quadrature):
    """The same points in each element.

    Args:
        domain: domain of the points.
        order: polynomials up to this degree are integrated exactly.
        family: family of the rule, None for the one with fewest points.
        halves: points of both halves of each axis of squares and cubes, for splines of even degree,
            which are polynomials there.
    """

    def __init__(self, domain, order: int, family=None, *, halves: bool = False):
        from warp._src.fem.cells.rules import rule

        super().__init__(domain)
        self.order, self.family = order, family
        self.rule = rule(domain.cell, order, family, halves)
        self._key = (domain.cell.name, order, family, halves)
        self._points = len(self.rule.weights)

    @property
    def record(self) -> QuadratureRecord:
        """Facts that functions of kernels depend on."""
        return QuadratureRecord("regular", self.domain.record, self._key, self._points)

    @property
    def name(self) -> str:
        """Class, domain, family and order in one word."""
        return f"{super().name}_{self.family}_{self.order}"

    @property
    def points(self) -> np.ndarray:
        """Coordinates of the points, (n, 3)."""
        return self.rule.points

    @property
    def weights(self) -> np.ndarray:
        """Weights of the points, (n,); their sum is 1."""
        return self.rule.weights

    def total_point_count(self) -> int:
        """Number of points in the domain."""
        return self._points * self.domain.element_count()

    def fill_arg(self, arg, device) -> None:
        """Fills an argument of the functions of points."""
        real = self.domain.geometry.scalar_type
        arg.points = wp.array(self.points, dtype=coords_type(real), device=device)
        arg.weights = wp.array(self.weights, dtype=real, device=device)


def _regular(record: QuadratureRecord, domain: SimpleNamespace) -> SimpleNamespace:
    real, n = record.domain.geometry.scalar, record.points
    ElementArg = domain.ElementArg
    fields = {"points": wp.array(dtype=coords_type(real)), "weights": wp.array(dtype=real)}
    Arg = extend.struct_from_fields("RegularArg", fields, module=__name__)

    @wp.func
    def point_coords(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return arg.points[k]

    @wp.func
    def point_weight(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return arg.weights[k]

    made = _same_count(ElementArg, Arg, n)
    made.point_coords, made.point_weight = point_coords, point_weight
    made.point_index = made.point_evaluation_index
    return made


class NodalQuadrature(Quadrature):
    """Nodes of a space as points, with the weights that are exact for its basis functions.

    Args:
        domain: domain of the points.
        space: space with the nodes, or
        basis_space: the basis of one.
        space_partition: partition whose numbers the points bear; the whole space if None.
    """

    def __init__(self, domain, space=None, basis_space=None, space_partition=None):
        from warp._src.fem.spaces.partition import WholeSpacePartition

        super().__init__(domain)
        if space is None and basis_space is None:
            raise ValueError("expects 'space' or 'basis_space', but both are None")
        self._basis = space.basis if basis_space is None else basis_space
        self._partition = space_partition or WholeSpacePartition(self._basis.topology)
        if self._basis.geometry is not domain.geometry.base and (
            self._basis.geometry is not domain.geometry
        ):
            raise ValueError(
                f"the space is of geometry '{self._basis.geometry.name}', but the domain is of "
                f"'{domain.geometry.name}', another one"
            )

    @property
    def record(self) -> QuadratureRecord:
        """Facts that functions of kernels depend on."""
        detail = (self._basis.record, self._partition.record)
        n = self._basis.topology.nodes_per_element
        return QuadratureRecord("nodal", self.domain.record, None, n, detail)

    def total_point_count(self) -> int:
        """Number of nodes."""
        return self._partition.node_count()

    def fill_arg(self, arg, device) -> None:
        """Fills an argument of the functions of points."""
        arg.topology = self._basis.topology.topo_arg_value(device)
        arg.partition = self._partition.partition_arg_value(device)


def _nodal(record: QuadratureRecord, domain: SimpleNamespace) -> SimpleNamespace:
    basis, partition = record.detail
    topology, n = basis.topology.functions, record.points
    fields = {"topology": topology.TopologyArg, "partition": partition.functions.PartitionArg}
    Arg = extend.struct_from_fields("NodalArg", fields, module=__name__)
    ElementArg = domain.ElementArg
    coords_of, weight_of = basis.functions.node_coords, basis.functions.node_weight
    node_of, number_of = topology.element_node_index, partition.functions.partition_node_index

    real, is_cells = record.domain.geometry.scalar, record.domain.is_cells
    outside = real(OUTSIDE)
    cell = basis.cell if is_cells else basis.cell.side
    center = coords_type(real)(*cell.center)

    # Nodes that do not lie on a side have no weight there, and no coordinates.
    @wp.func
    def point_coords(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        coords = coords_of(elements, arg.topology, element, k)
        if wp.static(not is_cells):
            if coords[0] == outside:
                coords = center
        return coords

    @wp.func
    def point_weight(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        weight = weight_of(elements, arg.topology, element, k)
        if wp.static(not is_cells):
            if coords_of(elements, arg.topology, element, k)[0] == outside:
                weight = real(0.0)
        return weight

    @wp.func
    def point_index(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return number_of(arg.partition, node_of(elements, arg.topology, element, k))

    made = _same_count(ElementArg, Arg, n)
    made.point_coords, made.point_weight, made.point_index = (
        *(point_coords, point_weight, point_index),
    )
    return made


def _same_count(ElementArg, Arg, n: int) -> SimpleNamespace:
    """Functions of quadratures with n points in each element."""

    made = Functions(Arg=Arg)

    @made.add
    def point_count(elements: ElementArg, arg: Arg, domain_element: int, element: int):
        return n

    @made.add
    def point_evaluation_index(
        elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int
    ):
        return n * domain_element + k

    return made


class ExplicitQuadrature(Quadrature):
    """Points and weights of each element, from arrays.

    Args:
        domain: domain of the points.
        points: coordinates, (elements, n), of the elements of the domain or of the geometry.
        weights: weights, (elements, n).

    Raises:
        ValueError: shapes or types do not fit.
    """

    def __init__(self, domain, points, weights):
        super().__init__(domain)
        real = domain.geometry.scalar_type
        for name, array, dtype in (
            ("points", points, coords_type(real)),
            ("weights", weights, real),
        ):
            if array.ndim != 2 or array.dtype is not dtype:
                raise ValueError(
                    f"'{name}' expects a 2-D array of {extend.type_repr(dtype)}, but got a "
                    f"{array.ndim}-D one of {extend.type_repr(array.dtype)}"
                )
        if points.shape != weights.shape:
            raise ValueError(
                f"'weights' expects the shape {points.shape} of 'points', but got {weights.shape}"
            )
        whole, part = domain.geometry_element_count(), domain.element_count()
        if points.shape[0] not in (whole, part):
            raise ValueError(
                f"'points' expects {part} rows, for the domain, or {whole}, for the geometry, "
                f"but got {points.shape[0]}"
            )
        self._points, self._weights, self._is_whole = points, weights, points.shape[0] == whole

    @property
    def record(self) -> QuadratureRecord:
        """Facts that functions of kernels depend on."""
        n = self._points.shape[1]
        return QuadratureRecord("explicit", self.domain.record, None, n, self._is_whole)

    def total_point_count(self) -> int:
        """Number of points in the arrays."""
        return self._weights.size

    def fill_arg(self, arg, device) -> None:
        """Fills an argument of the functions of points."""
        arg.points, arg.weights = self._points.to(device), self._weights.to(device)


def _explicit(record: QuadratureRecord, domain: SimpleNamespace) -> SimpleNamespace:
    real, n, is_whole = record.domain.geometry.scalar, record.points, record.detail
    points, ElementArg = wp.array2d(dtype=coords_type(real)), domain.ElementArg
    fields = {"points": points, "weights": wp.array2d(dtype=real)}
    Arg = extend.struct_from_fields("ExplicitArg", fields, module=__name__)

    @wp.func
    def point_coords(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return arg.points[wp.where(is_whole, element, domain_element), k]

    @wp.func
    def point_weight(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return arg.weights[wp.where(is_whole, element, domain_element), k]

    @wp.func
    def point_index(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return n * wp.where(is_whole, element, domain_element) + k

    made = _same_count(ElementArg, Arg, n)
    made.point_coords, made.point_weight, made.point_index = (
        *(point_coords, point_weight, point_index),
    )
    return made


MAKERS.update(regular=_regular, nodal=_nodal, explicit=_explicit)
