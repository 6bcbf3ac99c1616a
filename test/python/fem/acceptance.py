"""Prints the acceptance cases of finite elements beside their limits, as rows of a table.

Run it as a program; it is no test. It uses the problems that the tests next to it solve.
"""

import contextlib
import itertools
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent / "support")]

import test_discontinuous  # noqa: E402
import test_elasticity  # noqa: E402
import test_lookup  # noqa: E402
import test_orders  # noqa: E402
import test_poisson  # noqa: E402
import test_rules  # noqa: E402
import test_sparse_grids  # noqa: E402
import test_stokes  # noqa: E402

import fem_programs as programs  # noqa: E402
import warp as wp  # noqa: E402
from warp import fem  # noqa: E402
from warp._src.fem.cells.cell import LINE, TET, TRIANGLE  # noqa: E402
from warp._src.fem.cells.polynomial import Polynomial  # noqa: E402
from warp._src.fem.cells.rules import rule  # noqa: E402

Basis = fem.ElementBasis


def worst(pairs):
    """The pair of the largest number, as text."""
    number, name = max(pairs)
    return f"{number:.2g} ({name})"


def c1():
    """Poisson's equation: order degree + 1; error of scikit-fem."""
    orders, ratios = [], []
    for name, degree, n, reference in test_poisson.CASES:
        move = programs.warped if name in ("hex", "quad") else None
        errors = [
            programs.poisson_error(
                programs.geometry(name, k, wp.float64, move), degree, sparse=True
            )
            for k in (n, 2 * n)
        ]
        orders.append((abs(programs.order_of(errors) - degree - 1), f"{name} {degree}"))
        if reference:
            ratios.append((errors[1] / reference, f"{name} {degree}"))
    yield "order degree + 1, off by", "0.1", worst(orders)
    yield "error over scikit-fem's", "1.02", f"{max(ratios)[0]:.6f}"


def c2():
    for degree, expected in ((4, 8.97e-5), (6, 3.23e-7), (8, 6.85e-10)):
        error = programs.poisson_error(programs.geometry("grid3", 2, wp.float64), degree)
        yield f"Q{degree} on 2 x 2 x 2 cells", f"{expected} ± 2 %", f"{error:.3e}"


def c3():
    single, double = [], []
    for name, degree in itertools.product(("grid3", "tet", "hex", "tri", "quad"), (1, 2)):
        n = 2 if degree == 2 else 3
        if degree == 2 and name in ("tri", "quad", "hex"):
            continue
        move = None if "grid" in name else (lambda x, n=n: programs.shaken(x, n))
        geo = programs.geometry(name, n, wp.float64, move)
        error = test_elasticity.patch_error(geo, degree, test_elasticity.elasticity, wp.float64)
        double.append((error, f"{name} {degree}"))
        if degree == 1:
            geo = programs.geometry(name, n, wp.float32, move)
            form = test_elasticity.elasticity_f32
            single.append((test_elasticity.patch_error(geo, 1, form, wp.float32), name))
    yield "patch test, float32", "2e-6", worst(single)
    yield "patch test, float64", "1e-13", worst(double)


def c4():
    velocity, pressure = [], []
    for name, sizes, options in test_stokes.MANUFACTURED:
        make = programs.geometry
        errors = [
            test_stokes.manufactured_errors(
                test_stokes.tetrahedra(n) if name == "tet" else make(name, n, wp.float64), options
            )
            for n in sizes
        ]
        of_velocity, of_pressure = (programs.order_of(e) for e in zip(*errors, strict=True))
        velocity.append((abs(of_velocity - 3.0), name))
        pressure.append((2.0 - of_pressure, name))
    yield "order of velocity 3, off by", "0.15", worst(velocity)
    yield "order of pressure below 2 by", "0.15", worst(pressure)


def c5():
    for (name, word), expected in {
        ("grid2", "Q2-Q1"): "0.475 0.463 0.455",
        ("tri", "P2-P1"): "0.368 0.366 0.366",
    }.items():
        seen = " ".join(f"{test_stokes.inf_sup(name, 2, 1, n)[1]:.4f}" for n in (4, 8, 16))
        yield f"inf-sup constant of {word}", f"{expected} ± 0.005", seen
    values = [test_stokes.inf_sup("grid2", 1, 1, n) for n in (4, 8, 16)]
    least = [one[one > 1e-6][0] for one in values]
    seen = " ".join(f"{b / a:.3f}" for a, b in itertools.pairwise(least))
    yield "of Q1-Q1, ratio of two meshes", "halves", seen


def c6():
    orders = []
    for name, degree, n in test_discontinuous.CASES:
        errors = [test_discontinuous.penalty_error(name, degree, k) for k in (n, 2 * n)]
        orders.append((abs(programs.order_of(errors) - degree - 1), f"{name} {degree}"))
    yield "interior penalty, order degree + 1, off by", "0.15", worst(orders)


def c7():
    orders = []
    for kind, basis, degree in test_orders.SCALARS:
        errors = [
            test_orders.norm(
                test_orders.wave_error,
                (geometry := test_orders.box(kind, n)),
                test_orders.interpolated(test_orders.wave, geometry, degree, basis),
            )
            for n in ((8, 16) if kind in ("grid3", "tet") else (16, 32))
        ]
        off = abs(test_orders.order_of(errors, 2.0) - degree - 1)
        orders.append((off, f"{basis.name} {kind} {degree}"))
    yield "order degree + 1, off by", "0.1", worst(orders)
    jumps, splines = [], []
    for degree in (2, 3):
        grid = test_orders.box("grid2", 6)
        field = test_orders.projected(
            test_orders.mass, test_orders.load, grid, degree, Basis.BSPLINE
        )
        jumps.append((programs.norm(slope_jump, {"u": field.trace()}, 6, fem.Sides(grid)), degree))
        errors = []
        for n in (16, 32):
            grid = test_orders.box("grid2", n)
            field = test_orders.projected(
                test_orders.mass, test_orders.load, grid, degree, Basis.BSPLINE
            )
            errors.append(test_orders.norm(test_orders.wave_error, grid, field))
        splines.append((abs(test_orders.order_of(errors, 2.0) - degree - 1), degree))
    yield "B-splines, order degree + 1, off by", "0.1", worst(splines)
    yield "jump of slopes of B-splines", "1e-6", worst(jumps)


@fem.integrand
def slope_jump(s: fem.Sample, u: fem.Field):
    return wp.length_sq(fem.grad_jump(u, s))


def c8():
    values, slopes = [], []
    for basis, kind, degree in itertools.product(
        (Basis.NEDELEC_FIRST_KIND, Basis.RAVIART_THOMAS), ("tri", "grid2"), (1, 2, 3)
    ):
        is_curl = basis is Basis.NEDELEC_FIRST_KIND
        forms = (test_orders.curl_product, test_orders.curl_load)
        forms = forms if is_curl else (test_orders.div_product, test_orders.div_load)
        error = test_orders.rotation_error if is_curl else test_orders.divergence_error
        pairs = []
        for n in (8, 16):
            geometry = test_orders.box(kind, n)
            field = test_orders.projected(*forms, geometry, degree, basis)
            norms = (test_orders.norm(e, geometry, field) for e in (test_orders.flow_error, error))
            pairs.append(tuple(norms))
        for found, errors in zip((values, slopes), zip(*pairs, strict=True), strict=True):
            off = abs(test_orders.order_of(errors, 2.0) - degree)
            found.append((off, f"{basis.name} {kind} {degree}"))
    yield "order degree of values, off by", "0.1", worst(values)
    yield "of rotation or divergence, off by", "0.1", worst(slopes)


def q1():
    off = []
    for cell, order, family in itertools.product(
        (LINE, TRIANGLE, TET), range(21), (None, *Polynomial)
    ):
        if cell is TET and family is not None and order % 4:
            continue
        made = rule(cell, order, family)
        x, w = cell.parameters(made.points), made.weights
        assert (w > 0.0).all() and (x >= 0.0).all()
        powers = np.array(test_rules.monomials(cell, order))
        found = w @ np.prod(x[:, None] ** powers, axis=2)
        exact = np.array([test_rules.moment(cell, p) for p in powers])
        error = np.abs(found - exact).max() / test_rules.ULP
        off.append((float(error), f"{cell} {order} {family.name if family else 'default'}"))
    yield "monomials, units of the last place", "4 (tests sum exactly)", worst(off)


def a3():
    same, parts = [], []
    for name, degree in (("grid3", 2), ("tri", 2), ("tet", 2), ("hex", 2), ("quad", 3)):
        move = None if "grid" in name else programs.warped
        geo = programs.geometry(name, 3, wp.float32, move)
        space = fem.make_polynomial_space(geo, degree=degree)
        for form in (programs.diffusion, programs.mass):
            a = programs.dense(fem.integrate(form, fields=programs.fields_of(space)))
            same.append(np.array_equal(a, a.T))
            mask = np.random.default_rng(1).integers(0, 2, geo.cell_count()).astype(np.int32)
            total = 0.0
            for part in (mask, 1 - mask):
                chosen = fem.Subdomain(fem.Cells(geo), element_mask=wp.array(part, dtype=int))
                fields = programs.fields_of(space, chosen)
                total = total + programs.dense(fem.integrate(form, fields=fields))
            parts.append((np.abs(total - a).max() / np.abs(a).max(), name))
    yield "symmetric to the bit", "all", f"{sum(same)} of {len(same)}"
    yield "sum over parts, relative", "3e-6", worst(parts)


def a2():
    equal = []
    for name in ("grid3", "tet", "hex", "tri"):
        space = fem.make_polynomial_space(programs.geometry(name, 4, wp.float32), degree=2)
        found = []
        for threads in (1, 2):
            wp.config.num_threads = threads
            matrix = fem.integrate(programs.diffusion, fields=programs.fields_of(space))
            found.append(matrix.values.numpy())
        equal.append(np.array_equal(*found))
    yield "same bits by 1 and 2 threads", "all", f"{sum(equal)} of {len(equal)}"


def segment_distance(x, a, b):
    t = np.clip(((x - a) @ (b - a)) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(x - a - t[:, None] * (b - a), axis=1)


def triangle_distance(x, a, b, c):
    edges = [segment_distance(x, *pair) for pair in ((a, b), (b, c), (c, a))]
    n = np.cross(b - a, c - a)
    st = np.linalg.lstsq(np.stack((b - a, c - a), 1), (x - a).T, rcond=None)[0]
    inside = (st >= 0.0).all(axis=0) & (st.sum(axis=0) <= 1.0)
    return np.where(inside, np.abs((x - a) @ n) / np.linalg.norm(n), np.min(edges, axis=0))


def l1():
    off = []
    for cell, real, (scale, offset) in itertools.product(
        ("triangle", "square", "tet"), (wp.float32, wp.float64), test_lookup.SCALES
    ):
        mesh, _, positions = test_lookup.make(cell, real, scale, offset, 2)
        x = test_lookup.sample(positions, real, 2000, 0.4)
        _, _, near = test_lookup.find(mesh, x)
        sides = mesh._sides.vertices.numpy()[mesh._sides.boundary.numpy()]
        distance = triangle_distance if cell == "tet" else segment_distance
        expected = np.min([distance(x, *corners) for corners in positions[sides]], axis=0)
        got = np.linalg.norm(near - x, axis=1)
        outside = got > 1e-3 * scale
        error = np.abs(got - expected)[outside].max() / (scale / 2.0)
        off.append((float(error), f"{cell} {real.__name__} {scale} {offset}"))
    yield "distance outside, cells' sizes", "1e-5", worst(o for o in off if "32" not in o[1])
    near = [o for o in off if "float32" in o[1] and not o[1].endswith(" 1000.0")]
    far = [o for o in off if "float32" in o[1] and o[1].endswith(" 1000.0")]
    yield "the same in float32, at any scale", "1e-5", worst(near)
    yield "the same 1000 cells away (spacing 6e-5)", "1e-5", worst(far)


@fem.integrand
def value_of(s: fem.Sample, u: fem.Field):
    return u(s)


def l2():
    off = []
    for scale in (1e-5, 1e-3, 1.0, 1e3):
        inner = fem.Grid2D(wp.vec2i(4), wp.vec2(0.25 * scale), wp.vec2(0.75 * scale))
        outer = fem.Grid2D(wp.vec2i(8), wp.vec2(0.0), wp.vec2(scale))
        one = fem.make_polynomial_space(inner, degree=1).make_field()
        one.dof_values.fill_(1.0)
        cells = fem.Cells(outer)
        field = fem.NonconformingField(cells, one)
        area = fem.integrate(
            value_of, quadrature=fem.RegularQuadrature(cells, order=2), fields={"u": field}
        )
        off.append((abs(area / (0.25 * scale * scale) - 1.0), f"scale {scale}"))
    yield "indicator of a quarter, relative", "1e-5", worst(off)


def m2():
    one, two = fem.Grid3D(wp.vec3i(3)), fem.Grid3D(wp.vec3i(3), env_count=2)
    found = []
    for grid in (one, two):
        space = fem.make_polynomial_space(grid, degree=2)
        fields = programs.fields_of(space)
        found.append(programs.dense(fem.integrate(programs.diffusion, fields=fields)))
    n = len(found[0])
    blocks = [found[1][:n, :n], found[1][n:, n:]]
    same = all(np.array_equal(block, found[0]) for block in blocks) and not found[1][:n, n:].any()
    yield "blocks of environments", "equal bits", "equal" if same else "not equal"


def m1():
    for form, degree in itertools.product(
        (test_sparse_grids.mass, test_sparse_grids.stiffness), (1, 2)
    ):
        test_sparse_grids.test_matrices_are_those_of_a_dense_grid(form, degree)
    yield "matrix of a Nanogrid and of Grid3D", "equal bits", "equal"


CASES = [c1, c2, c3, c4, c5, c6, c7, c8, q1, a2, a3, l1, l2, m1, m2]


def main(names):
    wp.config.quiet = True
    print("| case | what | limit | seen |\n| --- | --- | --- | --- |")
    for case in CASES:
        if names and case.__name__ not in names:
            continue
        with contextlib.suppress(BrokenPipeError):
            for what, limit, seen in case():
                print(f"| {case.__name__.upper()} | {what} | {limit} | {seen} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
