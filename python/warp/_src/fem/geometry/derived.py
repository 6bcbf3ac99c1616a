"""Derived functions of geometries: measures, normals, inverse gradients, quantities of sides."""

from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.geometry.shapes import DIMENSIONS, MEASURES, side_name
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


def _by_type(name: str, functions: dict) -> wp.Function:
    """A function of kernels of a gradient of any type, of functions by (dimension of space,
    dimension of cells)."""
    made = None
    for real in (wp.float32, wp.float64):
        for (d, k), of in functions.items():
            Gradient = wp.types.vector(d, real) if k == 1 else wp.types.matrix((d, k), real)

            text = f"def {name}(F: Gradient):\n    return of(F)\n"
            one = extend.function_from_text(text, {"Gradient": Gradient, "of": of}, module=__name__)
            if made is None:
                made = wp.func(one)
            else:
                made.add_overload(one)
    return made


def element_functions() -> tuple:
    """Measure and normal of an element by its deformation gradient, of any type."""
    solids = dict.fromkeys(((2, 2), (3, 3)), stretch)
    curves = dict.fromkeys(((2, 1), (3, 1)), curve_stretch)
    measure = _by_type("element_measure", {**solids, **curves, (3, 2): surface_stretch})
    return measure, _by_type("element_normal", {(2, 1): curve_normal, (3, 2): surface_normal})


def of_gradient(cell_dimension: int, dimension: int):
    """Functions of a deformation gradient: stretch, normal (or None), inverse."""
    if cell_dimension == dimension:
        return stretch, no_normal, square_inverse
    if cell_dimension == 1:
        return curve_stretch, curve_normal if dimension == 2 else None, curve_inverse
    return surface_stretch, surface_normal, surface_inverse


def _of_element(functions, kind: str, Arg, Sample, cell: str, dimension: int, real) -> dict:
    """Measure, normal and inverse gradient of cells or of sides."""
    gradient = getattr(functions, f"{kind}_deformation_gradient")
    stretch_of, normal_of, inverse_of = of_gradient(DIMENSIONS[cell], dimension)
    reference_measure = real(MEASURES[cell])

    @wp.func
    def measure(arg: Arg, s: Sample):
        return stretch_of(gradient(arg, s)) * reference_measure

    @wp.func
    def inverse_deformation_gradient(arg: Arg, s: Sample):
        return inverse_of(gradient(arg, s))

    made = {
        # Edges of surfaces have no normal.
        f"{kind}_normal": None,
        f"{kind}_measure": measure,
        f"{kind}_inverse_deformation_gradient": inverse_deformation_gradient,
    }
    if normal_of is not None:

        @wp.func
        def normal(arg: Arg, s: Sample):
            return normal_of(gradient(arg, s))

        made[f"{kind}_normal"] = normal
    return made


def only_environment(Arg, Sample) -> wp.Function:
    """Function of kernels that gives environment 0 for all elements and samples."""

    @wp.func
    def environment_index(arg: Arg, element: int):
        return 0

    @wp.func
    def environment_index(arg: Arg, s: Sample):
        return 0

    return environment_index


def add_listed_environments(f: SimpleNamespace, Sample) -> None:
    """Adds environments of cells and sides, where `cell_env` lists them for the cells."""
    CellArg, SideArg = f.CellArg, f.SideArg

    @wp.func
    def cell_environment_index(arg: CellArg, cell: int):
        return wp.where(cell < 0, -1, arg.cell_env[wp.max(cell, 0)])

    @wp.func
    def cell_environment_index(arg: CellArg, s: Sample):
        return cell_environment_index(arg, s.element_index)

    @wp.func
    def side_environment_index(arg: SideArg, side: int):
        if side < 0:
            return -1
        return arg.cell_arg.cell_env[arg.side_cells[side][0]]

    @wp.func
    def side_environment_index(arg: SideArg, s: Sample):
        return side_environment_index(arg, s.element_index)

    f.cell_environment_index = cell_environment_index
    f.side_environment_index = side_environment_index


def _samples_of_cells(f: SimpleNamespace, Sample) -> dict:
    """Samples in the cells on both sides of a side."""
    SideArg = f.SideArg
    inner_cell, inner_coords = f.side_inner_cell_index, f.side_inner_cell_coords
    outer_cell, outer_coords = f.side_outer_cell_index, f.side_outer_cell_coords

    @wp.func
    def inner_sample(arg: SideArg, s: Sample):
        coords = inner_coords(arg, s.element_index, s.element_coords)
        return make_free_sample(inner_cell(arg, s.element_index), coords)

    @wp.func
    def outer_sample(arg: SideArg, s: Sample):
        coords = outer_coords(arg, s.element_index, s.element_coords)
        return make_free_sample(outer_cell(arg, s.element_index), coords)

    return {"side_inner_sample": inner_sample, "side_outer_sample": outer_sample}


def _by_cells(f: SimpleNamespace, Sample) -> dict:
    """Quantities of sides that are those of the cells on both."""
    SideArg, to_cell = f.SideArg, f.side_to_cell_arg
    inner_sample, outer_sample = f.side_inner_sample, f.side_outer_sample
    inverse, position = f.cell_inverse_deformation_gradient, f.cell_position

    @wp.func
    def side_inner_inverse_deformation_gradient(arg: SideArg, s: Sample):
        return inverse(to_cell(arg), inner_sample(arg, s))

    @wp.func
    def side_outer_inverse_deformation_gradient(arg: SideArg, s: Sample):
        return inverse(to_cell(arg), outer_sample(arg, s))

    @wp.func
    def side_position(arg: SideArg, s: Sample):
        return position(to_cell(arg), inner_sample(arg, s))

    return {
        "side_inner_inverse_deformation_gradient": side_inner_inverse_deformation_gradient,
        "side_outer_inverse_deformation_gradient": side_outer_inverse_deformation_gradient,
        "side_position": side_position,
    }


def _measure_ratio(f: SimpleNamespace, Sample) -> dict:
    SideArg, to_cell = f.SideArg, f.side_to_cell_arg
    inner_sample, outer_sample = f.side_inner_sample, f.side_outer_sample
    cell_measure, side_measure = f.cell_measure, f.side_measure

    @wp.func
    def side_measure_ratio(arg: SideArg, s: Sample):
        inner = cell_measure(to_cell(arg), inner_sample(arg, s))
        outer = cell_measure(to_cell(arg), outer_sample(arg, s))
        return side_measure(arg, s) / wp.min(inner, outer)

    return {"side_measure_ratio": side_measure_ratio}


def add_derived(record, f: SimpleNamespace) -> None:
    """Adds the functions that follow from others, where a geometry has none of its own."""
    real, dimension = record.scalar, record.dimension
    Sample = sample_type(real)
    CellArg = f.CellArg

    @wp.func
    def cell_measure_ratio(arg: CellArg, s: Sample):
        return real(1.0)

    _add(f, {"cell_measure_ratio": cell_measure_ratio})
    _add(f, {"cell_environment_index": only_environment(CellArg, Sample)})
    _add(f, {"side_environment_index": only_environment(f.SideArg, Sample)})
    _add(f, _of_element(f, "cell", CellArg, Sample, record.cell, dimension, real))
    _add(f, _samples_of_cells(f, Sample))
    _add(f, _by_cells(f, Sample))
    _add(f, _of_element(f, "side", f.SideArg, Sample, side_name(record.cell), dimension, real))
    _add(f, _measure_ratio(f, Sample))


def _add(functions: SimpleNamespace, made: dict) -> None:
    for name, value in made.items():
        if not hasattr(functions, name):
            setattr(functions, name, value)
