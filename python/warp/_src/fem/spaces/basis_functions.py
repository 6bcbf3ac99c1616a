"""Functions of kernels of bases - basis functions of a cell or on both sides of a side, and the
kernel of positions of nodes."""

import functools
from types import SimpleNamespace

import warp as wp
from warp._src.fem.cells.functions import element_functions
from warp._src.fem.kept import Functions
from warp._src.fem.types import coords_type, make_free_sample


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
    CellArg = topology.geometry.functions.CellArg
    of_topology = topology.functions
    TopologyArg = of_topology.TopologyArg
    functions = element_functions(element, real)
    coords_of, weight_of = functions.node_coords, functions.node_weight
    names = (
        ("oriented_value", "oriented_gradient") if topology.is_oriented else ("value", "gradient")
    )
    weight, weight_gradient = (_in_cell(getattr(functions, n), topology, real) for n in names)

    made = Functions(
        weight=weight, weight_gradient=weight_gradient, trace_weight=functions.trace_weight
    )

    @made.add
    def node_coords(cell_arg: CellArg, topo_arg: TopologyArg, element: int, node: int):
        return coords_of(node)

    @made.add
    def node_weight(cell_arg: CellArg, topo_arg: TopologyArg, element: int, node: int):
        return weight_of(node)

    return made


def _in_cell(function, topology, real):
    """A basis function or its gradient in a cell; some depend on the order of its vertices."""
    CellArg = topology.geometry.functions.CellArg
    TopologyArg, Coords = topology.functions.TopologyArg, coords_type(real)
    orientation_of, is_oriented = topology.functions.element_orientation, topology.is_oriented

    @wp.func
    def weight(cell_arg: CellArg, topo_arg: TopologyArg, element: int, coords: Coords, node: int):
        if wp.static(is_oriented):
            return function(coords, node, orientation_of(cell_arg, topo_arg, element))
        else:
            return function(coords, node)

    return weight


def _trace(record):
    """Functions of a basis on sides: `weight` is that in the inner cell, 0 for nodes of the outer
    one, and `outer_weight` the other way round."""
    topology = record.topology
    base = record.base.functions
    geometry = topology.geometry.functions
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
    made = Functions()

    def on_side(of_cell, cell_of, to_coords, dtype):
        @wp.func
        def side_weight(
            side_arg: SideArg, topo_arg: TopologyArg, side: int, coords: Coords, node: int
        ):
            cell, place = cell_of(side_arg, topo_arg, side, node)
            value = dtype(real(0.0))
            if cell >= 0:
                inside = to_coords(side_arg, side, coords)
                value = of_cell(to_cell(side_arg), topo_arg, cell, inside, place)
            return value

        return side_weight

    for prefix, places in sides.items():
        for name, dtype in (("weight", value_type), ("weight_gradient", gradient_type)):
            made_of = on_side(getattr(base, prefix + name), *places, dtype)
            setattr(made, prefix + name, made_of)

    @made.add
    def node_coords(side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int):
        if wp.static(is_constant):
            # The only node of a cell counts as one of each side.
            return center
        else:
            cell, place = find(side_arg, topo_arg, side, node)
            coords = coords_of(to_cell(side_arg), topo_arg, cell, place)
            return from_cell(side_arg, side, cell, coords)

    @made.add
    def node_weight(side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int):
        if wp.static(trace_weight_of is None):
            return real(0.0)
        else:
            _cell, place = find(side_arg, topo_arg, side, node)
            return trace_weight_of(place)

    return made


@functools.cache
def positions_kernel(record):
    """A kernel over cells that writes the positions of their nodes; all cells of a node agree."""
    geometry = record.topology.geometry.functions
    CellArg, position_of = geometry.CellArg, geometry.cell_position
    topology, basis = record.topology.functions, record.functions
    TopologyArg, count_of = topology.TopologyArg, topology.element_node_count
    index_of, coords_of = topology.element_node_index, basis.node_coords
    vector = wp.types.vector(
        length=record.topology.geometry.dimension, dtype=record.topology.geometry.scalar
    )

    @wp.kernel(enable_backward=False)
    def fill_positions(cell_arg: CellArg, topo_arg: TopologyArg, out: wp.array(dtype=vector)):
        cell = wp.tid()
        for k in range(count_of(cell_arg, topo_arg, cell)):
            sample = make_free_sample(cell, coords_of(cell_arg, topo_arg, cell, k))
            out[index_of(cell_arg, topo_arg, cell, k)] = position_of(cell_arg, sample)

    return fill_positions
