"""Functions of kernels of bases - basis functions of a cell or on both sides of a side."""

from types import SimpleNamespace

import warp as wp
from warp._src.fem.cells.functions import element_functions
from warp._src.fem.geometry.base import geometry_functions
from warp._src.fem.types import coords_type


def basis_functions(record) -> SimpleNamespace:
    """Functions of kernels of a basis, see `BasisRecord`."""
    if record.topology.kind == "trace":
        return _trace(record)
    if record.element is None:
        from warp._src.fem.spaces.point_functions import point_basis_functions

        return point_basis_functions(record)
    made = _of_element(record)
    made.outer_weight, made.outer_weight_gradient = made.weight, made.weight_gradient
    return made


def value_types(record) -> tuple:
    """Types of a basis function and of its gradient by parameters."""
    real, cell = record.topology.geometry.scalar, record.cell
    vector = wp.types.vector(length=cell.dimension, dtype=real)
    if record.element is None or not record.element.value_shape:
        return real, vector
    return vector, wp.types.matrix(shape=(cell.dimension, cell.dimension), dtype=real)


def _of_element(record):
    topology, element = record.topology, record.element
    real = topology.geometry.scalar
    CellArg = geometry_functions(topology.geometry).CellArg
    of_topology = topology.functions
    TopologyArg = of_topology.TopologyArg
    functions = element_functions(element, real)
    coords_of, weight_of = functions.node_coords, functions.node_weight
    make = _oriented if topology.is_oriented else _direct
    weight, weight_gradient = make(functions, topology, real)

    @wp.func
    def node_coords(cell_arg: CellArg, topo_arg: TopologyArg, element: int, node: int):
        return coords_of(node)

    @wp.func
    def node_weight(cell_arg: CellArg, topo_arg: TopologyArg, element: int, node: int):
        return weight_of(node)

    return SimpleNamespace(
        weight=weight,
        weight_gradient=weight_gradient,
        node_coords=node_coords,
        node_weight=node_weight,
        trace_weight=functions.trace_weight,
    )


def _direct(functions, topology, real):
    """Basis functions that the element alone gives."""
    CellArg = geometry_functions(topology.geometry).CellArg
    TopologyArg, Coords = topology.functions.TopologyArg, coords_type(real)
    value_of, gradient_of = functions.value, functions.gradient

    @wp.func
    def weight(cell_arg: CellArg, topo_arg: TopologyArg, element: int, coords: Coords, node: int):
        return value_of(coords, node)

    @wp.func
    def weight_gradient(
        cell_arg: CellArg, topo_arg: TopologyArg, element: int, coords: Coords, node: int
    ):
        return gradient_of(coords, node)

    return weight, weight_gradient


def _oriented(functions, topology, real):
    """Basis functions that depend on the order of the cell's vertices."""
    CellArg = geometry_functions(topology.geometry).CellArg
    TopologyArg, Coords = topology.functions.TopologyArg, coords_type(real)
    value_of, gradient_of = functions.oriented_value, functions.oriented_gradient
    orientation_of = topology.functions.element_orientation

    @wp.func
    def weight(cell_arg: CellArg, topo_arg: TopologyArg, element: int, coords: Coords, node: int):
        orientation = orientation_of(cell_arg, topo_arg, element)
        return value_of(coords, node, orientation)

    @wp.func
    def weight_gradient(
        cell_arg: CellArg, topo_arg: TopologyArg, element: int, coords: Coords, node: int
    ):
        orientation = orientation_of(cell_arg, topo_arg, element)
        return gradient_of(coords, node, orientation)

    return weight, weight_gradient


def _trace(record):
    """Functions of a basis on sides: `weight` is that in the inner cell, 0 for nodes of the outer
    one, and `outer_weight` the other way round."""
    topology = record.topology
    base = record.base.functions
    geometry = geometry_functions(topology.geometry)
    real, SideArg = topology.geometry.scalar, geometry.SideArg
    of_topology = topology.functions
    TopologyArg, find = of_topology.TopologyArg, of_topology.neighbor_cell_index
    to_cell, from_cell = geometry.side_to_cell_arg, geometry.side_from_cell_coords
    coords_of = base.node_coords
    is_constant = record.element is not None and record.element.degree == 0
    Coords = coords_type(real)
    center = Coords(*record.cell.side.center)
    trace_weight_of = getattr(base, "trace_weight", None)
    value_type, gradient_type = value_types(record)
    sides = {
        "": (of_topology.inner_cell_index, geometry.side_inner_cell_coords),
        "outer_": (of_topology.outer_cell_index, geometry.side_outer_cell_coords),
    }
    made = SimpleNamespace()
    for prefix, (cell_of, to_coords) in sides.items():
        for name, dtype in (("weight", value_type), ("weight_gradient", gradient_type)):
            of_cell = getattr(base, prefix + name)
            parts = (
                SideArg,
                TopologyArg,
                Coords,
                cell_of,
                to_coords,
                to_cell,
                of_cell,
                dtype,
                real,
            )
            setattr(made, prefix + name, _on_side(*parts))

    @wp.func
    def node_coords(side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int):
        if wp.static(is_constant):
            # The only node of a cell counts as one of each side.
            return center
        else:
            cell, place = find(side_arg, topo_arg, side, node)
            coords = coords_of(to_cell(side_arg), topo_arg, cell, place)
            return from_cell(side_arg, side, cell, coords)

    @wp.func
    def node_weight(side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int):
        if wp.static(trace_weight_of is None):
            return real(0.0)
        else:
            _cell, place = find(side_arg, topo_arg, side, node)
            return trace_weight_of(place)

    made.node_coords, made.node_weight = node_coords, node_weight
    return made


def _on_side(SideArg, TopologyArg, Coords, cell_of, to_coords, to_cell, of_cell, dtype, real):
    @wp.func
    def side_weight(side_arg: SideArg, topo_arg: TopologyArg, side: int, coords: Coords, node: int):
        cell, place = cell_of(side_arg, topo_arg, side, node)
        value = dtype(real(0.0))
        if cell >= 0:
            inside = to_coords(side_arg, side, coords)
            value = of_cell(to_cell(side_arg), topo_arg, cell, inside, place)
        return value

    return side_weight
