"""Linear systems of elements: F4, F9, F10."""

import functools

import numpy as np

import warp as wp
import warp.optim.linear
from warp.report.stability._case import case


def strain_matrix(points):
    """Strains of a triangle from its six displacements, and its area."""
    (ax, ay), (bx, by), (cx, cy) = points
    area = 0.5 * ((bx - ax) * (cy - ay) - (cx - ax) * (by - ay))
    dx = np.array([by - cy, cy - ay, ay - by]) / (2 * area)
    dy = np.array([cx - bx, ax - cx, bx - ax]) / (2 * area)
    b = np.zeros((3, 6))
    b[0, 0::2], b[1, 1::2] = dx, dy
    b[2, 0::2], b[2, 1::2] = dy, dx
    return b, area


def cantilever(poisson, nx=16, ny=4):
    """Stiffness of a clamped plate in plane strain, load at its end, and its tip's unknown."""
    e = 1.0 / ((1 + poisson) * (1 - 2 * poisson))
    law = e * np.array([[1 - poisson, poisson, 0], [poisson, 1 - poisson, 0],
                        [0, 0, 0.5 - poisson]])  # fmt: skip
    points = np.array([(i * 0.25, j * 0.25) for i in range(nx + 1) for j in range(ny + 1)])
    size = 2 * len(points)
    k, load = np.zeros((size, size)), np.zeros(size)
    for i in range(nx):
        for j in range(ny):
            a, b = i * (ny + 1) + j, (i + 1) * (ny + 1) + j
            for face in ((a, b, b + 1), (a, b + 1, a + 1)):
                strain, area = strain_matrix(points[list(face)])
                index = np.ravel([(2 * n, 2 * n + 1) for n in face])
                k[np.ix_(index, index)] += area * strain.T @ law @ strain
    load[2 * nx * (ny + 1) + 1 :: 2] = -1e-3
    free = slice(2 * (ny + 1), None)
    return k[free, free], load[free], size - 2 * (ny + 1) - 1


@case("F4", "Poisson ratios to 0.499999: iterations, locking, the residual that is reported")
def locking(p):
    first = None
    for poisson in (0.3, 0.49, 0.4999, 0.499999):
        k, load, tip = cantilever(poisson)
        x = p.zeros(load.size)
        count, error, tolerance = wp.optim.linear.cg(
            p.array(k), p.array(load), x, tol=1e-8, maxiter=20000
        )
        residual = np.linalg.norm(load - k @ x.numpy())
        p.check(f"{poisson}: true residual over the tolerance", residual / tolerance, 1.01)
        p.check(f"{poisson}: reported residual", (error - residual) / tolerance, 0.01)
        exact = np.linalg.solve(k, load)
        relative = np.linalg.norm(x.numpy() - exact) / np.linalg.norm(exact)
        p.check(f"{poisson}: displacement", relative, 1e-8 * np.linalg.cond(k))
        first = first or exact[tip]
        p.note(
            f"{poisson}: iterations, sqrt of the condition number, tip over that of 0.3",
            f"{int(count)}, {np.sqrt(np.linalg.cond(k)):.0f}, {exact[tip] / first:.2f}",
        )


@case("F9", "solvers for condition numbers to 1e14, singular systems and no load")
def solvers(p):
    n = 64
    q = np.linalg.qr(p.random.normal(size=(n, n)))[0]
    known = {name: getattr(wp.optim.linear, name) for name in ("cg", "bicgstab", "gmres")}
    for power in (0, 4, 8, 14):
        a = q @ np.diag(np.geomspace(1.0, 10.0**-power, n)) @ q.T
        a = (a + a.T) / 2
        b = a @ p.random.normal(size=n)
        for name, solve in known.items():
            x = p.zeros(n)
            _, error, _ = solve(p.array(a), p.array(b), x, tol=1e-8, maxiter=2000)
            residual = np.linalg.norm(b - a @ x.numpy())
            scale = np.linalg.norm(b)
            p.holds(f"{name}, 1e{power}: finite", np.isfinite(x.numpy()).all())
            p.check(
                f"{name}, 1e{power}: reported - true residual", (error - residual) / scale, 1e-8
            )
    singular = np.diag([1.0] * (n - 1) + [0.0])
    b = np.append(np.ones(n - 1), 0.0)
    for name, solve in known.items():
        x = p.zeros(n)
        solve(p.array(singular), p.array(b), x, tol=1e-10, maxiter=100)
        p.check(f"{name}: singular, consistent", np.abs(singular @ x.numpy() - b).max(), 1e-8)
        solve(p.array(singular), p.zeros(n), x.zero_() or x, tol=1e-10, maxiter=100)
        p.check(f"{name}: no load", np.abs(x.numpy()).max(), 0.0)


@functools.cache
def make_bar(real):
    @wp.kernel
    def bar(n: int, c: wp.array(dtype=real), u: wp.array(dtype=real)):
        # -u'' = pi^2 sin(pi x), u = 0 at both ends, by elimination.
        h = real(1.0) / real(n + 1)
        pi = real(3.14159265358979)
        before, d = real(0.0), real(0.0)
        for i in range(n):
            f = h * h * pi * pi * wp.sin(pi * real(i + 1) * h)
            m = real(2.0) + before
            d = (f + d) / m
            before = real(-1.0) / m
            c[i] = before
            u[i] = d
        for k in range(1, n):
            i = n - 1 - k
            u[i] -= c[i] * u[i + 1]

    return bar


@case(
    "F10",
    "a bar of up to 1e6 cells: the error is least where rounding meets the cell",
    ("float32",),
)
def rounding_floor(p):
    counts, errors = (9, 31, 99, 999, 9999, 99_999, 999_999), []
    for n in counts:
        c, u = p.zeros(n), p.zeros(n)
        p.launch(make_bar(p.real), 1, n, c, u)
        exact = np.sin(np.pi * np.arange(1, n + 1) / (n + 1))
        errors.append(float(np.abs(u.numpy() - exact).max()))
    best = counts[int(np.argmin(errors))]
    # (pi h)^2 / 12 = u / h^2 at most: n of about 1e2; the rounding may be far below its bound.
    p.holds("least error between 30 and 1000 cells", 30 < best < 1000)
    for n, error in zip(counts[:3], errors):
        h = 1.0 / (n + 1)
        p.check(f"{n} cells", error, 1.1 * (np.pi * h) ** 2 / 12 + p.u / h**2)
    p.note("error of 1e6 cells", errors[-1])
