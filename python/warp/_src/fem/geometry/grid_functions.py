"""Functions of kernels of regular grids: positions, sides, neighbours."""

from types import SimpleNamespace

import warp as wp
from warp import extend
from warp._src.fem.geometry.derived import add_environments
from warp._src.fem.geometry.grid_lookup import add_lookup
from warp._src.fem.geometry.grid_sides import add_sides
from warp._src.fem.kept import Functions
from warp._src.fem.types import NULL_ELEMENT_INDEX, coords_type, sample_type


def _structs(d: int, real) -> SimpleNamespace:
    vector, counts = wp.types.vector(d, real), wp.types.vector(d, wp.int32)
    word = f"{d}D" if real is wp.float32 else f"{d}D_f64"
    cell = {"res": counts, "cell_size": vector, "origin": vector}
    CellArg = extend.struct_from_fields(f"Grid{word}CellArg", cell, module=__name__)
    side = {"cell_count": wp.int32, "axis_offsets": counts, "cell_arg": CellArg}
    SideArg = extend.struct_from_fields(f"Grid{word}SideArg", side, module=__name__)
    # A side across `axis`: the position along the axis, then along the other axes in turn.
    at = {"axis": wp.int32, "origin": counts}
    Side = extend.struct_from_fields(f"Grid{d}DSide", at, module=__name__)
    return Functions(CellArg=CellArg, SideArg=SideArg, SideIndexArg=SideArg, Side=Side)


def _numbering(f: SimpleNamespace, d: int) -> None:
    """Adds the numbers of cells along the axes, and turns between axes of space and of a side."""
    counts = wp.types.vector(d, wp.int32)

    @f.add
    def cells_of(res: counts):
        n = res[0]
        for k in range(1, d):
            n *= res[k]
        return n

    @f.add
    def sides_of(arg: f.SideArg):
        n = arg.axis_offsets[d - 1] + d * arg.cell_count
        res = arg.cell_arg.res
        return n + arg.cell_count // res[d - 1]

    @f.add
    def cell_number(res: counts, at: counts):
        n = at[0]
        for k in range(1, d):
            n = n * res[k] + at[k]
        return n

    @f.add
    def cell_at(res: counts, cell: int):
        at = counts()
        rest = cell
        for k in range(1, d):
            axis = d - k
            at[axis] = rest % res[axis]
            rest = rest // res[axis]
        at[0] = rest
        return at


def grid_functions(record) -> SimpleNamespace:
    """The functions of kernels of a grid."""
    d, real = record.dimension, record.scalar
    f = _structs(d, real)
    _numbering(f, d)
    if record.environments:
        _add_environments(f)
    else:
        add_environments(f)
    _add_cells(f, record)
    add_sides(f, record)
    add_lookup(f, record)
    return f


def _add_environments(f: SimpleNamespace) -> None:
    """Adds environments, whose cells and sides follow each other."""
    cells_of, sides_of, CellArg, SideArg = f.cells_of, f.sides_of, f.CellArg, f.SideArg

    @wp.func
    def environment_of_cell(arg: CellArg, cell: int):
        return wp.where(cell < 0, NULL_ELEMENT_INDEX, cell // cells_of(arg.res))

    @wp.func
    def environment_of_side(arg: SideArg, side: int):
        return wp.where(side < 0, NULL_ELEMENT_INDEX, side // sides_of(arg))

    add_environments(f, environment_of_cell, environment_of_side)


def _add_cells(f: SimpleNamespace, record) -> None:
    d, real, several = record.dimension, record.scalar, record.environments
    vector, CellArg, Sample = wp.types.vector(d, real), f.CellArg, sample_type(real)
    cells_of, cell_at = f.cells_of, f.cell_at
    Coords = coords_type(real)

    @f.add
    def grid_cell(arg: CellArg, cell: int):
        """Numbers of a cell along the axes."""
        local = cell
        if wp.static(several):
            local = cell % cells_of(arg.res)
        return cell_at(arg.res, local)

    @f.add
    def cell_position(arg: CellArg, s: Sample):
        at = grid_cell(arg, s.element_index)
        x = vector()
        for k in range(d):
            x[k] = arg.origin[k] + (real(at[k]) + s.element_coords[k]) * arg.cell_size[k]
        return x

    @f.add
    def cell_deformation_gradient(arg: CellArg, s: Sample):
        return wp.diag(arg.cell_size)

    @f.add
    def cell_inverse_deformation_gradient(arg: CellArg, s: Sample):
        return wp.diag(wp.cw_div(vector(real(1.0)), arg.cell_size))

    @f.add
    def cell_measure(arg: CellArg, s: Sample):
        size = arg.cell_size[0]
        for k in range(1, d):
            size *= arg.cell_size[k]
        return size

    @f.add
    def cell_coordinates(arg: CellArg, cell: int, x: vector):
        at = grid_cell(arg, cell)
        coords = Coords()
        for k in range(d):
            coords[k] = (x[k] - arg.origin[k]) / arg.cell_size[k] - real(at[k])
        return coords

    @f.add
    def cell_closest_point(arg: CellArg, cell: int, x: vector):
        coords = cell_coordinates(arg, cell, x)
        distance_sq = real(0.0)
        for k in range(d):
            inside = wp.clamp(coords[k], real(0.0), real(1.0))
            gap = (coords[k] - inside) * arg.cell_size[k]
            distance_sq += gap * gap
            coords[k] = inside
        return coords, distance_sq
