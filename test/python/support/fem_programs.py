"""Geometries, forms and dense algebra that tests of `warp.fem` share.

Systems are solved in float64 by NumPy, so that no solver of the package hides an error.
"""

import math

import numpy as np

import warp as wp
from warp import fem
from warp.optim import linear

PI = wp.constant(math.pi)


def points_of_grid(n, dim):
    x = np.linspace(0.0, 1.0, n + 1)
    return np.stack(np.meshgrid(*[x] * dim, indexing="ij"), -1).reshape(-1, dim)


def warped(points, size=0.08):
    """Interior points moved by a smooth field that vanishes on the boundary."""
    bump = np.prod(np.sin(np.pi * points), axis=1, keepdims=True)
    return points + size * bump * np.array([[1.0, -0.7, 0.4][: points.shape[1]]])


def shaken(points, n, size=0.2, seed=0):
    """Interior points moved at random, by a part of the size of cells."""
    rng = np.random.default_rng(seed)
    inside = ~on_boundary(points)
    return points + inside[:, None] * rng.uniform(-size / n, size / n, points.shape)


def grid(dim, n, scalar=wp.float32):
    if dim == 2:
        return fem.Grid2D(res=wp.vec2i(n, n), scalar_type=scalar)
    return fem.Grid3D(res=wp.vec3i(n, n, n), scalar_type=scalar)


_MESHES = {
    "tri": (2, "Trimesh2D", "grid_to_tris"),
    "quad": (2, "Quadmesh2D", "grid_to_quads"),
    "tet": (3, "Tetmesh", "grid_to_tets"),
    "hex": (3, "Hexmesh", "grid_to_hexes"),
}


def geometry(name, n, scalar=wp.float64, move=None, **options):
    """A geometry of the unit square or cube: grid2, grid3, tri, quad, tet, hex."""
    if name.startswith("grid"):
        return grid(int(name[4]), n, scalar)
    dim, kind, cells = _MESHES[name]
    points = points_of_grid(n, dim)
    points = points if move is None else move(points)
    positions = wp.array(
        points,
        dtype=wp.types.vector(length=dim, dtype=scalar),
        requires_grad=options.pop("requires_grad", False),
    )
    indices = wp.array(getattr(fem.utils, cells)(*[n] * dim), dtype=int)
    return getattr(fem, kind)(indices, positions, **options)


def fields_of(space, domain=None):
    domain = domain or fem.Cells(space.geometry)
    trial, test = fem.make_trial(space, domain=domain), fem.make_test(space, domain=domain)
    return {"u": trial, "v": test}


def dense(matrix):
    """The dense float64 matrix of a sparse one."""
    offsets = matrix.offsets.numpy()[: matrix.nrow + 1]
    nnz = int(offsets[-1])
    rows, columns = matrix.block_shape
    out = np.zeros((matrix.nrow, matrix.ncol, rows, columns))
    row = np.repeat(np.arange(matrix.nrow), np.diff(offsets))
    blocks = matrix.values.numpy()[:nnz].reshape(nnz, rows, columns)
    np.add.at(out, (row, matrix.columns.numpy()[:nnz]), blocks)
    return out.transpose(0, 2, 1, 3).reshape(matrix.nrow * rows, matrix.ncol * columns)


def on_boundary(points):
    return np.any((points < 1e-5) | (points > 1.0 - 1e-5), axis=1)


def solve(a, b, fixed, values):
    """x with A x = b where it is free, and given values where it is fixed."""
    x = np.where(fixed, values, 0.0)
    free = ~fixed
    x[free] = np.linalg.solve(a[np.ix_(free, free)], b[free] - a[np.ix_(free, fixed)] @ x[fixed])
    return x


def field_of(space, values):
    field = space.make_field()
    shaped = np.asarray(values).reshape(field.dof_values.numpy().shape)
    field.dof_values = wp.array(shaped, dtype=field.dof_values.dtype)
    return field


def norm(form, fields, order, domain, **options):
    """The root of an integral."""
    rule = fem.RegularQuadrature(domain, order=order)
    return math.sqrt(abs(float(fem.integrate(form, quadrature=rule, fields=fields, **options))))


def order_of(errors, factor=2.0):
    return math.log(errors[-2] / errors[-1]) / math.log(factor)


def warped_geometry(name, n):
    """A geometry in float64 whose cells are not affine, except those of grids."""
    return geometry(name, n, move=None if "grid" in name else warped)


def curved(base, move, degree=2):
    """A geometry with the nodes of a polynomial map at other places."""
    vector = wp.types.vector(base.dimension, wp.float64)
    space = fem.make_polynomial_space(base, degree=degree, dtype=vector)
    field = field_of(space, move(space.node_positions().numpy()))
    return field.make_deformed_geometry(relative=False)


def two_levels():
    """Cells of two sizes in the unit cube."""
    levels = ((np.ndindex(2, 4, 4), 0.25), ([(1, j, k) for j, k in np.ndindex(2, 2)], 0.5))
    grids = [
        wp.Volume.allocate_by_voxels(
            wp.array(np.array(list(voxels)), dtype=wp.vec3i), size, translation=(0.5 * size,) * 3
        )
        for voxels, size in levels
    ]
    made = fem.adaptive_nanogrid_from_hierarchy(grids)
    return fem.AdaptiveNanogrid(
        made.cell_grid, made.cell_level, made.level_count, scalar_type=wp.float64
    )


def matrix_of(form, fields, domain=None, order=None, **values):
    """The dense matrix of a bilinear form, by the rule of an order or by the default one."""
    rule = None if order is None else fem.RegularQuadrature(domain, order=order)
    domain = None if rule else domain
    return dense(fem.integrate(form, domain=domain, quadrature=rule, fields=fields, values=values))


def spectrum(a, m, free):
    """The eigenvalues of a generalised symmetric problem, ascending."""
    lower = np.linalg.cholesky(m[np.ix_(free, free)])
    half = np.linalg.solve(lower, a[np.ix_(free, free)])
    return np.linalg.eigvalsh(np.linalg.solve(lower, half.T))


@fem.integrand
def diffusion(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def load_2d(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    x = fem.position(domain, s)
    return 2.0 * PI * PI * wp.sin(PI * x[0]) * wp.sin(PI * x[1]) * v(s)


@fem.integrand
def load_3d(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    x = fem.position(domain, s)
    return 3.0 * PI * PI * wp.sin(PI * x[0]) * wp.sin(PI * x[1]) * wp.sin(PI * x[2]) * v(s)


@fem.integrand
def error_2d(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    x = fem.position(domain, s)
    e = u(s) - wp.sin(PI * x[0]) * wp.sin(PI * x[1])
    return e * e


@fem.integrand
def error_3d(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    x = fem.position(domain, s)
    e = u(s) - wp.sin(PI * x[0]) * wp.sin(PI * x[1]) * wp.sin(PI * x[2])
    return e * e


def poisson_error(geo, degree, sparse=False, **options):
    """L2 error of the product of sines by a space of some degree.

    sparse: conjugate gradients solve the system, to 12 digits, as NumPy would take too long.
    """
    dim = geo.dimension
    load, error = (load_2d, error_2d) if dim == 2 else (load_3d, error_3d)
    space = fem.make_polynomial_space(geo, degree=degree, dtype=geo.scalar_type, **options)
    fields, domain = fields_of(space), fem.Cells(geo)
    a = fem.integrate(diffusion, fields=fields, output_dtype=wp.float64)
    rule = fem.RegularQuadrature(domain, order=2 * degree + 2)
    b = fem.integrate(load, quadrature=rule, fields={"v": fields["v"]})
    if sparse:
        fem.dirichlet(space).project(a, b)
        field = space.make_field()
        M = linear.preconditioner(a, "diag")
        linear.cg(a, b, field.dof_values, tol=1e-12, maxiter=5000, M=M)
        return norm(error, {"u": field}, 2 * degree + 4, domain)
    a, b = dense(a), b.numpy()
    fixed = on_boundary(space.node_positions().numpy())
    x = solve(a, b.astype(np.float64), fixed, 0.0)
    return norm(error, {"u": field_of(space, x)}, 2 * degree + 4, domain)
