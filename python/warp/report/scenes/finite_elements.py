"""Finite elements: orders of convergence over degrees and cells."""

import math

import numpy as np

import warp as wp
import warp.report as report
from warp import fem
from warp.optim import linear

PI = wp.constant(math.pi)


@fem.integrand
def diffusion(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    x = fem.position(domain, s)
    return 2.0 * PI * PI * wp.sin(PI * x[0]) * wp.sin(PI * x[1]) * v(s)


@fem.integrand
def squared_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    x = fem.position(domain, s)
    e = u(s) - wp.sin(PI * x[0]) * wp.sin(PI * x[1])
    return e * e


def mesh_of(case):
    """Squares, or two triangles for each."""
    n = int(case.cells)
    if case.mesh == "squares":
        return fem.Grid2D(res=wp.vec2i(n, n), scalar_type=case.real)
    x = np.linspace(0.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(x, x, indexing="ij"), -1).reshape(-1, 2)
    cells = wp.array(fem.utils.grid_to_tris(n, n), dtype=int, device=case.device)
    vector = wp.types.vector(2, case.real)
    return fem.Trimesh2D(cells, wp.array(points, dtype=vector, device=case.device))


@report.scene(
    sweep=report.Sweep("cells", values=(4, 8, 16, 32), quick=3),
    curves=(
        report.Sweep("degree", values=(1, 2, 3)),
        report.Sweep("mesh", values=("squares", "triangles")),
    ),
    dtypes=("float64",),
)
def poisson(case):
    """Poisson's equation by Galerkin's method: the order is the degree + 1."""
    with wp.ScopedDevice(case.device):
        geometry, degree = mesh_of(case), int(case.degree)
        space = fem.make_polynomial_space(geometry, degree=degree, dtype=case.real)
        cells = fem.Cells(geometry)
        u, v = fem.make_trial(space, domain=cells), fem.make_test(space, domain=cells)
        rule = fem.RegularQuadrature(cells, order=2 * degree + 4)
        fixed, field = fem.dirichlet(space), space.make_field()

        def run():
            A = fem.integrate(diffusion, fields={"u": u, "v": v})
            b = fem.integrate(load, quadrature=rule, fields={"v": v})
            fixed.project(A, b)
            M = linear.preconditioner(A, "diag")
            linear.cg(A, b, field.dof_values, tol=1e-12, M=M, check_every=50)

    def quantities():
        square = fem.integrate(
            squared_error, quadrature=rule, fields={"u": field}, device=case.device
        )
        return {"L2": report.Error(math.sqrt(square))}

    return report.Program(run, quantities, field.dof_values.zero_, work=space.node_count())
