"""Forms over meshes: F11 to F15."""

import math
import warnings

import numpy as np

import warp as wp
from warp import fem
from warp.report.stability._case import case

BOTH = ("float32", "float64")


@fem.integrand
def gradients(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.ddot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def diffusion(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def divergence(s: fem.Sample, u: fem.Field, q: fem.Field):
    return q(s) * fem.div(u, s)


@fem.integrand
def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def elasticity(s: fem.Sample, u: fem.Field, v: fem.Field):
    e = fem.D(u, s)
    return fem.div(u, s) * fem.div(v, s) + 2.0 * wp.ddot(e, fem.D(v, s))


@fem.integrand
def shear(s: fem.Sample, u: fem.Field, v: fem.Field):
    return 2.0 * wp.ddot(fem.D(u, s), fem.D(v, s))


@fem.integrand
def dilation(s: fem.Sample, u: fem.Field, v: fem.Field):
    return fem.div(u, s) * fem.div(v, s)


@fem.integrand
def push(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    """A pressure of 6 on the wall inside of r = 0.6."""
    x = fem.position(domain, s)
    across = wp.dot(v(s), fem.normal(domain, s))
    return wp.where(wp.length(x) < 0.6, -6.0 * across, 0.0 * across)


def dense(matrix):
    """The matrix of numbers, in float64."""
    out = np.zeros((matrix.nrow, matrix.ncol, *matrix.block_shape))
    offsets = matrix.offsets.numpy()[: matrix.nrow + 1]
    nnz, rows = int(offsets[-1]), np.repeat(np.arange(matrix.nrow), np.diff(offsets))
    values = matrix.values.numpy()[:nnz].reshape(nnz, *matrix.block_shape)
    out[rows, matrix.columns.numpy()[:nnz]] = values
    return out.transpose(0, 2, 1, 3).reshape(matrix.shape)


def integral(p, form, first, second=None, names=("u", "v")):
    """The dense matrix of a form over two spaces; the second has the test function."""
    second = second or first
    fields = {names[0]: fem.make_trial(first), names[1]: fem.make_test(second)}
    return dense(fem.integrate(form, fields=fields, device=p.device))


def boundary(points):
    """Points on the boundary of the unit box."""
    return np.any((points < 1e-5) | (points > 1.0 - 1e-5), axis=1)


def box(p, name, n, move=0.0, offset=0.0, scale=1.0):
    """A mesh of the unit box: its inner vertices are moved at random, then all by an offset."""
    d = 2 if name in ("tri", "quad") else 3
    x = np.linspace(0.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(*[x] * d, indexing="ij"), -1).reshape(-1, d)
    inside = ~boundary(points)
    points[inside] += p.random.uniform(-move / n, move / n, (inside.sum(), d))
    kind, cells = {
        "tri": ("Trimesh2D", "grid_to_tris"),
        "quad": ("Quadmesh2D", "grid_to_quads"),
        "tet": ("Tetmesh", "grid_to_tets"),
        "hex": ("Hexmesh", "grid_to_hexes"),
    }[name]
    cells = p.array(getattr(fem.utils, cells)(*[n] * d), dtype=int)
    return getattr(fem, kind)(cells, p.array(scale * (points + offset), dtype=p.vector(d)))


@case("F11", "inf-sup constants of pairs for incompressible flow: bounded, or not")
def pairs(p):
    known = {("square", 2): (0.475, 0.463), ("square", 1): None}
    for (_, degree), constants in known.items():
        least = []
        for n in (4, 8):
            grid = fem.Grid2D(res=wp.vec2i(n, n), scalar_type=wp.float64)
            velocity = fem.make_polynomial_space(grid, degree=degree, dtype=wp.vec2d)
            pressure = fem.make_polynomial_space(grid, degree=1, dtype=wp.float64)
            a, m = integral(p, gradients, velocity), integral(p, mass, pressure)
            b = integral(p, divergence, velocity, pressure, ("u", "q"))
            free = ~np.repeat(boundary(velocity.node_positions().numpy()), 2)
            schur = b[:, free] @ np.linalg.solve(a[np.ix_(free, free)], b[:, free].T)
            root = np.linalg.inv(np.linalg.cholesky(m))
            values = np.linalg.eigvalsh(root @ schur @ root.T)
            # The constant pressure, which walls do not see, is the first.
            least.append(np.sqrt(max(values[1], 0.0)))
        if constants:
            p.check("degrees 2 and 1", np.array(least) - constants, 0.005)
        else:
            p.check("degrees 1 and 1: no bound", least, 1e-6)


@case("F12", "linear displacements on meshes distorted by 30 % of a cell", BOTH)
def patch(p):
    for name in ("tri", "quad", "tet", "hex"):
        d = 2 if name in ("tri", "quad") else 3
        geometry = box(p, name, 3, move=0.3)
        space = fem.make_polynomial_space(geometry, degree=1, dtype=p.vector(d))
        a, x = integral(p, elasticity, space), space.node_positions().numpy().astype(np.float64)
        exact = (x @ p.random.normal(size=(d, d))).ravel()
        free = ~np.repeat(boundary(x), d)
        found = np.linalg.solve(a[np.ix_(free, free)], -a[np.ix_(free, ~free)] @ exact[~free])
        condition = np.linalg.cond(a[np.ix_(free, free)])
        p.check(name, np.abs(found - exact[free]).max(), 8.0 * condition * p.u)


@case(
    "F13", "matrices of meshes far from the origin, and tiny ones: digits that positions have", BOTH
)
def offsets(p):
    for name in ("tri", "tet", "hex"):
        n = 4
        near = integral(
            p, diffusion, fem.make_polynomial_space(box(p, name, n), degree=1, dtype=p.real)
        )
        for power in (4, 8):
            # Vertices of the grid are floats there, too.
            far = box(p, name, n, offset=2.0**power)
            found = integral(p, diffusion, fem.make_polynomial_space(far, degree=1, dtype=p.real))
            p.check(f"{name}: 2^{power} boxes off", np.abs(found - near).max(), 0.0)
        factor = 2.0**-30
        d = 2 if name == "tri" else 3
        tiny = integral(
            p,
            diffusion,
            fem.make_polynomial_space(box(p, name, n, scale=factor), degree=1, dtype=p.real),
        )
        p.check(f"{name}: scaled", np.abs(tiny / factor ** (d - 2) - near).max(), 0.0)


@case("F14", "flat tetrahedra: exact up to their quality, and a warning that names them", BOTH)
def slivers(p):
    root = math.sqrt(2.0 * p.u)
    for height in (1e-2, 1e-3, 0.1 * root):
        points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.5, 0.5, height)])
        points = p.array(points, dtype=p.vector(3))
        mesh = fem.Tetmesh(p.array([[0, 1, 2, 3]], dtype=int), points)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            k = integral(p, diffusion, fem.make_polynomial_space(mesh, degree=1, dtype=p.real))
        x = points.numpy().astype(np.float64)
        slopes = np.linalg.inv(x[1:] - x[0])
        slopes = np.column_stack((-slopes.sum(axis=1), slopes))
        exact = slopes.T @ slopes * np.linalg.det(x[1:] - x[0]) / 6.0
        error = np.abs(k - exact).max() / np.abs(exact).max()
        p.check(f"height {height:.0e}: matrix", error, 16.0 * p.u / height)
        wanted = height < root
        p.holds(f"height {height:.0e}: a warning if it is below", bool(caught) == wanted)


@case("F15", "a tube that hardly changes its volume: one method locks, one does not")
def tube(p):
    inner, errors = 0.5, {}
    flat = fem.Grid2D(res=wp.vec2i(4, 8), scalar_type=wp.float64)
    bent = fem.make_polynomial_space(flat, degree=2, dtype=wp.vec2d).make_field()
    r, angle = bent.space.node_positions().numpy().T * [[1.0 - inner], [0.5 * np.pi]]
    r += inner
    bent.dof_values.assign(np.stack([r * np.cos(angle), r * np.sin(angle)], -1))
    geometry = bent.make_deformed_geometry(relative=False)
    for degree, bulk in ((1, 1.0), (1, 1e6), (2, 1.0), (2, 1e6)):
        space = fem.make_polynomial_space(geometry, degree=degree, dtype=wp.vec2d)
        a = integral(p, shear, space)
        if degree == 2:
            pressure = fem.make_polynomial_space(geometry, degree=1, dtype=wp.float64)
            b = integral(p, divergence, space, pressure, ("u", "q"))
            a = a + bulk * b.T @ np.linalg.solve(integral(p, mass, pressure), b)
        else:
            a = a + bulk * integral(p, dilation, space)
        # Lame's solution for a pressure of 6 inside and a free outer wall.
        x = space.node_positions().numpy()
        radius = np.linalg.norm(x, axis=1)
        exact = ((1.0 / (bulk + 1.0) + 1.0 / radius**2)[:, None] * x).ravel()
        fixed = np.zeros(len(exact), bool)
        fixed[1::2] |= x[:, 1] < 1e-9
        fixed[0::2] |= x[:, 0] < 1e-9
        free = ~fixed
        test = fem.make_test(space, domain=fem.BoundarySides(geometry))
        f = fem.integrate(push, fields={"v": test}, device=p.device).numpy().ravel()
        found = np.linalg.solve(a[np.ix_(free, free)], f[free])
        errors[degree, bulk] = np.abs(found - exact[free]).max() / np.abs(exact).max()
    p.check("degrees 2 and 1, bulk modulus 1", errors[2, 1.0], 1e-3)
    p.check("degrees 2 and 1, bulk modulus 10^6", errors[2, 1e6], 1e-3)
    p.holds("degree 1 locks", errors[1, 1e6] > 10.0 * errors[1, 1.0])
    p.note("degree 1, bulk modulus 1 and 10^6", f"{errors[1, 1.0]:.1e}, {errors[1, 1e6]:.1e}")
