"""Energies of materials and their derivatives: F2, F3, F5 to F8."""

import functools

import numpy as np

import warp as wp
from warp.report.stability._case import case
from warp.report.stability.rotations import BOTH, wide


@functools.cache
def make_energies(real):
    mat33 = wp.types.matrix((3, 3), real)

    @wp.kernel
    def barrier(F: wp.array(dtype=mat33), out: wp.array(dtype=real)):
        i = wp.tid()
        j = wp.determinant(F[i])
        log = wp.log(j)
        out[i] = wp.ddot(F[i], F[i]) - real(3.0) - real(2.0) * log + log * log

    @wp.kernel
    def neo_hookean(F: wp.array(dtype=mat33), out: wp.array(dtype=real)):
        # Smith, de Goes, Kim 2018, with mu = lambda = 1.
        i = wp.tid()
        squares, gap = wp.ddot(F[i], F[i]), wp.determinant(F[i]) - real(1.75)
        out[i] = real(0.5) * (squares - real(3.0) + gap * gap - wp.log(squares + real(1.0)))

    @wp.kernel
    def corotated(F: wp.array(dtype=mat33), out: wp.array(dtype=real)):
        i = wp.tid()
        _, s = wp.polar(F[i])
        e = s - wp.identity(3, real)
        t = wp.trace(e)
        out[i] = wp.ddot(e, e) + real(0.5) * t * t

    return {"barrier": barrier, "neo-Hookean": neo_hookean, "corotated": corotated}


def stress(p, kernel, f):
    """Energy, and its derivative by reverse mode, of deformation gradients."""
    given = p.array(f, p.matrix(3, 3), requires_grad=True)
    energy = p.zeros(len(f), requires_grad=True)
    tape = wp.Tape()
    with tape:
        p.launch(kernel, len(f), given, energy)
    tape.backward(grads={energy: wp.ones_like(energy, requires_grad=False)})
    return energy.numpy(), given.grad.numpy()


def rotations(random, count):
    q = np.linalg.qr(random.normal(size=(count, 3, 3)))[0]
    return q * np.linalg.det(q)[:, None, None]


@case("F2", "a block pressed flat and inside out: barrier diagnosed, stable energy smooth", BOTH)
def inversion(p):
    s = np.array([1.0, 0.5, 1e-3, 1e-10, 0.0, -1e-3, -1.0])
    f = np.tile(np.eye(3), (s.size, 1, 1))
    f[:, 0, 0] = s
    energy, slope = stress(p, make_energies(p.real)["neo-Hookean"], f)
    squares, gap = s * s + 2, s - 1.75
    exact = 0.5 * (squares - 3 + gap * gap - np.log(squares + 1))
    p.check("stable energy", energy - exact, 8 * p.u, stretch=s)
    p.check(
        "its derivative", slope[:, 0, 0] - (s * (1 - 1 / (squares + 1)) + gap), 16 * p.u, stretch=s
    )
    energy, _ = stress(p, make_energies(p.real)["barrier"], f)
    p.holds(
        "barrier: finite, infinite at 0, NaN beyond",
        [np.isfinite(energy[:4]).all(), np.isinf(energy[4]), np.isnan(energy[5:]).all()],
    )

    def check_outputs():
        wp.config.verify_fp = True
        try:
            p.launch(
                make_energies(p.real)["barrier"], 1, p.array(f[-1:], p.matrix(3, 3)), p.zeros(1)
            )
        finally:
            wp.config.verify_fp = False

    p.diagnosed("barrier under verify_fp", check_outputs, "barrier", "not finite")


@case(
    "F3",
    "at rest and under rotations: no energy, no stress, the Hessian of linear elasticity",
    BOTH,
)
def rest_state(p):
    f = np.concatenate([np.eye(3)[None], rotations(p.random, 500)]).astype(p.dtype)
    energy, slope = stress(p, make_energies(p.real)["corotated"], f)
    p.check("corotated energy", energy, 8 * p.u, F=f)
    # Rounded rotations are stretched by their last digits; Young's modulus is of order 5.
    strain = (np.einsum("nki,nkj->nij", wide(f), wide(f)) - np.eye(3)) / 2
    trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
    exact = np.einsum("nik,nkj->nij", wide(f), 2 * strain + trace * np.eye(3))
    p.check("corotated stress", np.abs(slope - exact).max(axis=(1, 2)), 8 * p.u * 5, F=f)
    near = (np.eye(3) + np.array([1e-3, -1e-3])[:, None, None] * np.ones((3, 3))).astype(p.dtype)
    _, slope = stress(p, make_energies(p.real)["corotated"], near)
    h = (wide(near[0]) - wide(near[1]))[0, 1]
    second = (wide(slope[0]) - wide(slope[1])) / h
    # 2 mu e + lambda tr e for the strain of ones: mu = 1, lambda = 1.
    exact = 2 * np.ones((3, 3)) + 3 * np.eye(3)
    p.check("corotated second derivative", np.abs(second - exact).max(), 1e-2)


@functools.cache
def make_gradients(real):
    mat33 = wp.types.matrix((3, 3), real)

    @wp.func
    def deformation(edges: mat33, rest: mat33):
        return edges * wp.inverse(rest), wp.determinant(rest)

    return deformation


def slivers(random, count, height):
    """Edge matrices of tetrahedra with edges near 1 and one height."""
    rest = np.tile(np.eye(3), (count, 1, 1)) + 0.2 * random.uniform(-1, 1, (count, 3, 3))
    rest[:, 2, 2] = height
    rest[:, 2, :2] *= height
    return rest


@case("F5", "sliver tetrahedra: error within the condition number, no volume is seen", BOTH)
def sliver_gradients(p):
    for height in (1e-2, 1e-4, 1e-6, 1e-9, 1e-12):
        rest = slivers(p.random, 500, height).astype(p.dtype)
        edges = p.random.normal(size=(500, 3, 3)).astype(p.dtype)
        f, _ = p.map(
            make_gradients(p.real), p.array(edges, p.matrix(3, 3)), p.array(rest, p.matrix(3, 3))
        )
        residual = np.einsum("nik,nkj->nij", wide(f), wide(rest)) - wide(edges)
        scale = np.abs(wide(f)).max(axis=(1, 2)) * np.abs(rest).max(axis=(1, 2))
        p.check(f"height {height:g}", np.abs(residual).max(axis=(1, 2)) / scale, 8 * p.u, rest=rest)
    flat = np.zeros((1, 3, 3), p.dtype)
    flat[0, 0, 0] = flat[0, 1, 1] = 1.0
    f, volume = p.map(
        make_gradients(p.real), p.array(flat, p.matrix(3, 3)), p.array(flat, p.matrix(3, 3))
    )
    p.holds("no volume: determinant 0 and nothing infinite", [volume[0] == 0, np.isfinite(f).all()])


@case("F6", "a linear displacement on slivers", BOTH)
def patch(p):
    a = np.array([[1.1, 0.2, 0.0], [0.1, 0.9, 0.3], [0.0, -0.2, 1.2]]).astype(p.dtype)
    for height in (1e-2, 1e-4):
        rest = slivers(p.random, 500, height).astype(p.dtype)
        edges = np.einsum("ij,njk->nik", a, rest).astype(p.dtype)
        f, _ = p.map(
            make_gradients(p.real), p.array(edges, p.matrix(3, 3)), p.array(rest, p.matrix(3, 3))
        )
        condition = np.linalg.cond(rest.astype(float))
        error = np.abs(f - a).max(axis=(1, 2)) / condition
        p.check(f"height {height:g}, over the condition number", error, 8 * p.u, rest=rest)


@functools.cache
def make_projection(real):
    mat33 = wp.types.matrix((3, 3), real)

    @wp.func
    def positive(x: real):
        return wp.max(x, real(0.0))

    @wp.func
    def project(a: mat33):
        return wp.sym_fn3(a, positive)

    return project


@case("F7", "projection to positive matrices near repeated eigenvalues", BOTH)
def projection(p):
    q = rotations(p.random, 2000)
    d = np.array([1.0, 1.0, -1.0]) + 1e-7 * p.random.normal(size=(2000, 3))
    a = np.einsum("nik,nk,njk->nij", q, d, q).astype(p.dtype)
    a = (a + np.swapaxes(a, 1, 2)) / 2
    found = p.map(make_projection(p.real), p.array(a, p.matrix(3, 3))).astype(float)
    least = np.linalg.eigvalsh((found + np.swapaxes(found, 1, 2)) / 2)[:, 0]
    p.check("negative eigenvalue", -least.clip(None, 0), 8 * p.u, A=a)
    values, vectors = np.linalg.eigh(a.astype(float))
    exact = np.einsum("nik,nk,njk->nij", vectors, values.clip(0), vectors)
    p.check("projection", np.abs(found - exact).max(axis=(1, 2)), 40 * p.u, A=a)


@functools.cache
def make_bending(real):
    vec3 = wp.types.vector(3, real)

    @wp.kernel
    def fold(d: wp.array(dtype=vec3), a: vec3, b: vec3, c: vec3, out: wp.array(dtype=real)):
        i = wp.tid()
        edge = b - a
        first, second = wp.cross(edge, c - a), wp.cross(d[i] - a, edge)
        sine = wp.dot(wp.cross(first, second), wp.normalize(edge))
        out[i] = wp.atan2(sine, wp.dot(first, second))

    return fold


@case("F8", "bending flat, folded over, and about an edge without length", BOTH)
def bending(p):
    # The last is folded over; the flat one lies at a kink of no formula.
    angle = np.array([0.0, 1e-7, 1e-3, 1.0, 3.1])
    d = np.stack([0.5 + 0 * angle, -np.cos(angle), np.sin(angle)], 1)
    vec3 = p.vector(3)
    for length, what in ((1.0, "edge"), (0.0, "no edge")):
        given = p.array(d, vec3, requires_grad=True)
        out = p.zeros(angle.size, requires_grad=True)
        corners = vec3(0.0, 0.0, 0.0), vec3(length, 0.0, 0.0), vec3(0.5, 1.0, 0.0)
        tape = wp.Tape()
        with tape:
            p.launch(make_bending(p.real), angle.size, given, *corners, out)
        tape.backward(grads={out: wp.ones_like(out, requires_grad=False)})
        p.holds(f"{what}: gradient is finite", np.isfinite(given.grad.numpy()).all(1), d=d)
        if length:
            found = np.abs(out.numpy())
            p.check("angle", found - angle, 8 * p.u * np.pi, d=d)
