"""Functions of kernels of points - nodes at quadrature points, and radial functions around them."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.kept import Functions
from warp._src.fem.spaces.topology_functions import add_constants
from warp._src.fem.types import NULL_NODE_INDEX, coords_type, make_free_sample


@dataclass(frozen=True)
class PointsRecord:
    """Facts of points that functions of kernels depend on.

    Attributes:
        quadrature: record of the quadrature.
        value, gradient: functions of (squared distance, point, ...) of kernels, or None.
        values: names and types of the arguments that follow.
        in_space: distances are those in space, not those of coordinates.
        is_unique: nodes are (element, point) pairs, not points that elements share.
    """

    quadrature: object
    value: object
    gradient: object
    values: tuple
    in_space: bool
    is_unique: bool


@wp.func
def dirac(squared_distance: Any):
    """1 at the point itself."""
    real = type(squared_distance)
    return wp.where(squared_distance < real(1.0e-6), real(1.0), real(0.0))


def point_functions(record) -> SimpleNamespace:
    """The struct and the functions of a topology of points, see `topology_functions`."""
    points = record.quadrature
    quadrature = points.quadrature.functions
    part = points.quadrature.domain.partition.functions
    CellArg = record.geometry.functions.CellArg
    values = extend.struct_from_fields("RadialValues", dict(points.values), module=__name__)
    fields = {"quadrature": quadrature.Arg, "part": part.CellArg, "values": values}
    TopologyArg = extend.struct_from_fields("PointNodesArg", fields, module=__name__)
    place_of, count_of = part.partition_cell_index, quadrature.point_count
    index_of, most = quadrature.point_index, record.nodes
    if points.is_unique:
        index_of = quadrature.point_evaluation_index

    made = Functions(TopologyArg=TopologyArg, place_of=place_of)

    @made.add
    def element_node_count(cell_arg: CellArg, topo_arg: TopologyArg, element: int):
        place = place_of(topo_arg.part, element)
        count = int(0)
        if place >= 0:
            count = wp.min(most, count_of(cell_arg, topo_arg.quadrature, place, element))
        return count

    @made.add
    def element_node_index(cell_arg: CellArg, topo_arg: TopologyArg, element: int, node: int):
        number = int(NULL_NODE_INDEX)
        if node < element_node_count(cell_arg, topo_arg, element):
            place = place_of(topo_arg.part, element)
            number = index_of(cell_arg, topo_arg.quadrature, place, element, node)
        return number

    add_constants(made, record, CellArg)
    return made


def _radial(function, values, TopologyArg, real):
    """A function of kernels of (squared distance, point, topology argument)."""
    kind = next(iter(function.func.__annotations__.values()))
    names = {"radial": function, "TopologyArg": TopologyArg, "kind": kind, "real": real}
    rest = "".join(f", topo_arg.values.{name}" for name, _ in values)
    text = (
        "def radial_value(squared: real, point: int, topo_arg: TopologyArg):\n"
        f"    return radial(kind(squared), point{rest})\n"
    )
    return wp.func(extend.function_from_text(text, names, module=__name__))


def _offsets(record, geometry):
    """Functions of (cell argument, element, coordinates, point's coordinates): the squared distance
    and its gradient by parameters."""
    real, cell = record.topology.geometry.scalar, record.cell
    CellArg, Coords = geometry.CellArg, coords_type(real)
    Vector = wp.types.vector(length=cell.dimension, dtype=real)
    first, dimension = 1 if cell.name == "triangle" else 0, cell.dimension
    position_of, gradient_of = geometry.cell_position, geometry.cell_deformation_gradient

    @wp.func
    def parameters(a: Coords, b: Coords):
        x = Vector(real(0.0))
        for axis in range(dimension):
            x[axis] = a[first + axis] - b[first + axis]
        return x

    @wp.func
    def squared(cell_arg: CellArg, element: int, coords: Coords, point: Coords):
        return wp.length_sq(parameters(coords, point))

    @wp.func
    def slope(cell_arg: CellArg, element: int, coords: Coords, point: Coords):
        return real(2.0) * parameters(coords, point)

    if not record.topology.quadrature.in_space:
        return squared, slope

    @wp.func
    def squared_in_space(cell_arg: CellArg, element: int, coords: Coords, point: Coords):
        x = position_of(cell_arg, make_free_sample(element, coords))
        return wp.length_sq(x - position_of(cell_arg, make_free_sample(element, point)))

    @wp.func
    def slope_in_space(cell_arg: CellArg, element: int, coords: Coords, point: Coords):
        s = make_free_sample(element, coords)
        x = position_of(cell_arg, s) - position_of(cell_arg, make_free_sample(element, point))
        return real(2.0) * (wp.transpose(gradient_of(cell_arg, s)) * x)

    return squared_in_space, slope_in_space


def point_basis_functions(record) -> SimpleNamespace:
    """Functions of kernels of a basis of points, see `BasisRecord`."""
    points, topology = record.topology.quadrature, record.topology.functions
    real, cell = record.topology.geometry.scalar, record.cell
    geometry = record.topology.geometry.functions
    quadrature, place_of = points.quadrature.functions, topology.place_of
    CellArg, TopologyArg, Coords = geometry.CellArg, topology.TopologyArg, coords_type(real)
    coords_of, index_of = quadrature.point_coords, quadrature.point_index
    weight_of = quadrature.point_weight
    Vector = wp.types.vector(length=cell.dimension, dtype=real)
    squared, slope = _offsets(record, geometry)
    is_dirac, has_gradient = points.value is None, points.gradient is not None
    value = None if is_dirac else _radial(points.value, points.values, TopologyArg, real)
    gradient = _radial(points.gradient, points.values, TopologyArg, real) if has_gradient else None

    count_of, made = topology.element_node_count, Functions()

    @made.add
    def node_coords(cell_arg: CellArg, topo_arg: TopologyArg, element: int, node: int):
        coords = Coords(real(0.0))
        if node < count_of(cell_arg, topo_arg, element):
            place = place_of(topo_arg.part, element)
            coords = coords_of(cell_arg, topo_arg.quadrature, place, element, node)
        return coords

    @made.add
    def node_weight(cell_arg: CellArg, topo_arg: TopologyArg, element: int, node: int):
        weight = real(0.0)
        if node < count_of(cell_arg, topo_arg, element):
            place = place_of(topo_arg.part, element)
            weight = weight_of(cell_arg, topo_arg.quadrature, place, element, node)
        return weight

    @made.add
    def weight(cell_arg: CellArg, topo_arg: TopologyArg, element: int, coords: Coords, node: int):
        made = real(0.0)
        if node < count_of(cell_arg, topo_arg, element):
            point = node_coords(cell_arg, topo_arg, element, node)
            distance = squared(cell_arg, element, coords, point)
            if wp.static(is_dirac):
                made = dirac(distance)
            else:
                place = place_of(topo_arg.part, element)
                index = index_of(cell_arg, topo_arg.quadrature, place, element, node)
                made = real(value(distance, index, topo_arg))
        return made

    @made.add
    def weight_gradient(
        cell_arg: CellArg, topo_arg: TopologyArg, element: int, coords: Coords, node: int
    ):
        made = Vector(real(0.0))
        if wp.static(has_gradient):
            if node < count_of(cell_arg, topo_arg, element):
                point = node_coords(cell_arg, topo_arg, element, node)
                distance = squared(cell_arg, element, coords, point)
                place = place_of(topo_arg.part, element)
                index = index_of(cell_arg, topo_arg.quadrature, place, element, node)
                change = slope(cell_arg, element, coords, point)
                made = real(gradient(distance, index, topo_arg)) * change
        return made

    made.outer_weight, made.outer_weight_gradient = weight, weight_gradient
    return made
