"""Derived functions of geometries: measures, normals, inverse gradients, quantities of sides."""

from typing import Any

import warp as wp
from warp._src.fem.geometry.shapes import DIMENSIONS, SIDES, cell_of
from warp._src.fem.kept import Functions
from warp._src.fem.types import make_free_sample, sample_type


@wp.func
def stretch(F: Any):
    """Ratio of a measure in space to that in reference coordinates; F is square."""
    return wp.abs(wp.determinant(F))


@wp.func
def curve_stretch(F: Any):
    return wp.length(F)


@wp.func
def surface_stretch(F: Any):
    Ft = wp.transpose(F)
    return wp.length(wp.cross(Ft[0], Ft[1]))


@wp.func
def element_measure(F: wp.types.matrix((2, 2), wp.Scalar)):
    """Ratio of measures by the deformation gradient of any element."""
    return stretch(F)


@wp.func
def element_measure(F: wp.types.matrix((3, 3), wp.Scalar)):
    return stretch(F)


@wp.func
def element_measure(F: wp.types.vector(Any, wp.Scalar)):
    return curve_stretch(F)


@wp.func
def element_measure(F: wp.types.matrix((3, 2), wp.Scalar)):
    return surface_stretch(F)


@wp.func
def no_normal(F: Any):
    return F[0] - F[0]


@wp.func
def curve_normal(F: Any):
    n = type(F)(F[1], -F[0])
    return n / wp.length(n)


@wp.func
def surface_normal(F: Any):
    Ft = wp.transpose(F)
    n = wp.cross(Ft[0], Ft[1])
    return n / wp.length(n)


@wp.func
def element_normal(F: wp.types.vector(Any, wp.Scalar)):
    """Unit normal by the deformation gradient of a side."""
    return curve_normal(F)


@wp.func
def element_normal(F: wp.types.matrix((3, 2), wp.Scalar)):
    return surface_normal(F)


@wp.func
def square_inverse(F: Any):
    return wp.inverse(F)


@wp.func
def curve_inverse(F: Any):
    return wp.matrix_from_rows(F / wp.dot(F, F))


@wp.func
def surface_inverse(F: Any):
    """Rows are the dual basis of the columns of F, without the squares of a normal matrix."""
    Ft = wp.transpose(F)
    n = wp.cross(Ft[0], Ft[1])
    area_sq = wp.dot(n, n)
    return wp.matrix_from_rows(wp.cross(Ft[1], n) / area_sq, wp.cross(n, Ft[0]) / area_sq)


def of_gradient(cell_dimension: int, dimension: int):
    """Functions of a deformation gradient: stretch, normal (or None), inverse."""
    if cell_dimension == dimension:
        return stretch, no_normal, square_inverse
    if cell_dimension == 1:
        return curve_stretch, curve_normal if dimension == 2 else None, curve_inverse
    return surface_stretch, surface_normal, surface_inverse


def _add_of_element(f: Functions, kind, Arg, Sample, cell: str, dimension: int, real) -> None:
    """Adds measure, normal and inverse gradient of cells or of sides."""
    gradient = getattr(f, f"{kind}_deformation_gradient")
    stretch_of, normal_of, inverse_of = of_gradient(DIMENSIONS[cell], dimension)
    reference_measure = real(cell_of(cell).measure)

    @wp.func
    def measure(arg: Arg, s: Sample):
        return stretch_of(gradient(arg, s)) * reference_measure

    @wp.func
    def inverse_deformation_gradient(arg: Arg, s: Sample):
        return inverse_of(gradient(arg, s))

    @wp.func
    def normal(arg: Arg, s: Sample):
        return normal_of(gradient(arg, s))

    for one in (measure, inverse_deformation_gradient, normal):
        # Edges of surfaces have no normal.
        found = None if one is normal and normal_of is None else one
        vars(f).setdefault(f"{kind}_{one.key}", found)


@wp.func
def _only_environment(arg: Any, element: int):
    return 0


def add_listed_environments(f: Functions) -> None:
    """Adds environments of cells and sides, where `cell_env` lists them for the cells."""
    CellArg, SideArg = f.CellArg, f.SideArg

    @wp.func
    def environment_of_cell(arg: CellArg, cell: int):
        return wp.where(cell < 0, -1, arg.cell_env[wp.max(cell, 0)])

    @wp.func
    def environment_of_side(arg: SideArg, side: int):
        if side < 0:
            return -1
        return arg.cell_arg.cell_env[arg.side_cells[side][0]]

    add_environments(f, environment_of_cell, environment_of_side)


def add_environments(f: Functions, of_cell=_only_environment, of_side=_only_environment):
    """Adds environments of cells and sides, by number or at a sample."""
    for name, Arg, of in (("cell", f.CellArg, of_cell), ("side", f.SideArg, of_side)):
        setattr(f, f"{name}_environment_index", _by_sample(Arg, of))


def _by_sample(Arg, of_element) -> wp.Function:
    @wp.func
    def environment_index(arg: Arg, element: int):
        return of_element(arg, element)

    @wp.func
    def environment_index(arg: Arg, s: Any):
        return of_element(arg, s.element_index)

    return environment_index


def add_listed_sides(f: Functions) -> None:
    """Adds the cells of sides, and sides of the boundary, where `side_cells` and `boundary` list
    them."""
    SideArg = f.SideArg

    @f.add
    def side_inner_cell_index(arg: SideArg, side: int):
        return wp.where(side < 0, -1, arg.side_cells[wp.max(side, 0)][0])

    @f.add
    def side_outer_cell_index(arg: SideArg, side: int):
        return wp.where(side < 0, -1, arg.side_cells[wp.max(side, 0)][1])

    @f.add
    def boundary_side_index(arg: SideArg, boundary_side: int):
        return arg.boundary[boundary_side]


@wp.func
def cell_arg_of(side_arg: Any):
    """Argument of cells in that of sides, of all geometries."""
    return side_arg.cell_arg


def _add_by_cells(f: Functions, Sample) -> None:
    """Adds the samples in the cells on both sides of a side, and quantities of those."""
    SideArg = f.SideArg
    inner_cell, inner_coords = f.side_inner_cell_index, f.side_inner_cell_coords
    outer_cell, outer_coords = f.side_outer_cell_index, f.side_outer_cell_coords
    inverse, position = f.cell_inverse_deformation_gradient, f.cell_position

    @f.add_missing
    def side_inner_sample(arg: SideArg, s: Sample):
        coords = inner_coords(arg, s.element_index, s.element_coords)
        return make_free_sample(inner_cell(arg, s.element_index), coords)

    @f.add_missing
    def side_outer_sample(arg: SideArg, s: Sample):
        coords = outer_coords(arg, s.element_index, s.element_coords)
        return make_free_sample(outer_cell(arg, s.element_index), coords)

    @f.add_missing
    def side_inner_inverse_deformation_gradient(arg: SideArg, s: Sample):
        return inverse(arg.cell_arg, side_inner_sample(arg, s))

    @f.add_missing
    def side_outer_inverse_deformation_gradient(arg: SideArg, s: Sample):
        return inverse(arg.cell_arg, side_outer_sample(arg, s))

    @f.add_missing
    def side_position(arg: SideArg, s: Sample):
        return position(arg.cell_arg, side_inner_sample(arg, s))


def add_derived(record, f: Functions) -> None:
    """Adds the functions that follow from others, where a geometry has none of its own."""
    real, dimension = record.scalar, record.dimension
    Sample = sample_type(real)
    CellArg, SideArg = f.CellArg, f.SideArg

    @f.add_missing
    def cell_measure_ratio(arg: CellArg, s: Sample):
        return real(1.0)

    f.side_to_cell_arg = cell_arg_of
    if not hasattr(f, "cell_environment_index"):
        add_environments(f)
    _add_of_element(f, "cell", CellArg, Sample, record.cell, dimension, real)
    _add_by_cells(f, Sample)
    _add_of_element(f, "side", SideArg, Sample, SIDES[record.cell], dimension, real)
    inner_sample, outer_sample = f.side_inner_sample, f.side_outer_sample
    cell_measure, side_measure = f.cell_measure, f.side_measure

    @f.add_missing
    def side_measure_ratio(arg: SideArg, s: Sample):
        inner = cell_measure(arg.cell_arg, inner_sample(arg, s))
        outer = cell_measure(arg.cell_arg, outer_sample(arg, s))
        return side_measure(arg, s) / wp.min(inner, outer)
