"""Small dense matrices: R1 to R7, R14."""

import functools
import types

import numpy as np

import warp as wp
from warp.report.stability._case import case
from warp.report.stability.rotations import BOTH, wide


@functools.cache
def make_factors(real):
    """The factorizations as functions that `p.map` takes."""
    mat33 = wp.types.matrix((3, 3), real)

    @wp.func
    def svd(a: mat33):
        u, s, v = wp.svd3(a)
        return u, s, v

    @wp.func
    def eig(a: mat33):
        q, d = wp.eig3(a)
        return q, d

    @wp.func
    def qr(a: mat33):
        q, r = wp.qr3(a)
        return q, r

    @wp.func
    def polar(a: mat33):
        r, s = wp.polar(a)
        return r, s

    return types.SimpleNamespace(svd=svd, eig=eig, qr=qr, polar=polar)


@functools.cache
def make_solve(real):
    mat33, vec3 = wp.types.matrix((3, 3), real), wp.types.vector(3, real)

    @wp.func
    def solve(a: mat33, b: vec3):
        return wp.solve3(a, b)

    @wp.func
    def inverse(a: mat33):
        return wp.inverse(a), wp.determinant(a)

    return solve, inverse


def largest(a):
    return np.abs(a).max(axis=(1, 2))


def departure(q):
    """How far matrices are from orthogonal ones."""
    q = wide(q)
    return largest(np.einsum("nki,nkj->nij", q, q) - np.eye(3))


def judge_svd(p, a, limit, what):
    u, s, v = p.map(make_factors(p.real).svd, p.array(a, p.matrix(3, 3)))
    scale = np.maximum(largest(a).astype(np.longdouble), np.finfo(np.float64).tiny)
    product = np.einsum("nik,nk,njk->nij", wide(u), wide(s), wide(v))
    p.check(f"{what}: A - U S V^T", largest(product - wide(a)) / scale, limit, A=a)
    p.check(f"{what}: U^T U - 1", departure(u), limit, A=a)
    p.check(f"{what}: V^T V - 1", departure(v), limit, A=a)
    size = np.abs(s)
    p.check(f"{what}: out of order", np.diff(size).max(1).clip(0) / scale, p.u, A=a)
    p.holds(f"{what}: signs", (s[:, :2] >= 0).all(1), A=a)


@case("R1", "svd3 of 2e4 random matrices", BOTH)
def random_svd(p):
    a = p.random.normal(size=(20000, 3, 3)).astype(p.dtype)
    judge_svd(p, a, 2e-6 if p.dtype == "float32" else 34 * p.u, "random")


@case("R2", "svd3 near the identity, of rank one, of zero, of reflections", BOTH)
def special_svd(p):
    near = np.eye(3) + 1e-4 * p.random.normal(size=(1000, 3, 3))
    rank_one = np.einsum("ni,nj->nij", *p.random.normal(size=(2, 1000, 3)))
    given = [np.eye(3), np.ones((3, 3)), np.zeros((3, 3)), np.diag([1.0, 1.0, 0.0])]
    given += [np.diag([1.0, 1.0, -1.0]), np.diag([-1.0, -1.0, -1.0]), np.diag([-1.0, 2.0, -2.0])]
    limit = 2e-6 if p.dtype == "float32" else 34 * p.u
    for what, a in (("near I", near), ("rank 1", rank_one), ("special", np.array(given))):
        judge_svd(p, a.astype(p.dtype), limit, what)


@case("R3", "svd3 of very small and very large matrices", BOTH)
def scaled_svd(p):
    base = p.random.normal(size=(4000, 3, 3))
    powers = (-20, -10, 12, 19, 37) if p.dtype == "float32" else (-160, -20, 19, 160, 305)
    for power in powers:
        a = (base * 10.0**power).astype(p.dtype)
        judge_svd(p, a, 2e-6 if p.dtype == "float32" else 34 * p.u, f"1e{power}")


@case("R4", "svd3 in double precision: 34 u")
def double_svd(p):
    judge_svd(p, p.random.normal(size=(20000, 3, 3)), 34 * p.u, "random")


@case("R5", "eig3 of symmetric matrices, also scaled and with repeated eigenvalues", BOTH)
def symmetric_eigenvalues(p):
    b = p.random.normal(size=(4000, 3, 3))
    q = np.linalg.qr(b)[0]
    twice = np.einsum("nik,k,njk->nij", q, [2.0, 2.0, -1.0], q)
    limit = 2e-6 if p.dtype == "float32" else 34 * p.u
    cases = {"random": b, "1e10": b * 1e10, "1e-10": b * 1e-10, "repeated": twice}
    cases["1 + 1e-6"] = np.eye(3) + 1e-6 * b
    for what, a in cases.items():
        a = a.astype(p.dtype)
        a = (a + np.swapaxes(a, 1, 2)) / 2
        q, d = p.map(make_factors(p.real).eig, p.array(a, p.matrix(3, 3)))
        product = np.einsum("nik,nk,njk->nij", wide(q), wide(d), wide(q))
        p.check(f"{what}: A - Q D Q^T", largest(product - wide(a)) / largest(a), limit, A=a)
        p.check(f"{what}: Q^T Q - 1", departure(q), limit, A=a)
        exact = np.linalg.eigvalsh(a.astype(np.float64))[:, ::-1]
        p.check(f"{what}: values", np.abs(d - exact).max(1) / largest(a), limit, A=a)


@case("R6", "QR and polar factors of matrices without full rank", BOTH)
def deficient_factors(p):
    base = p.random.normal(size=(2000, 3, 3))
    rank_two = base.copy()
    rank_two[:, :, 2] = rank_two[:, :, 0] + rank_two[:, :, 1]
    rank_one = np.einsum("ni,nj->nij", base[:, 0], base[:, 1])
    zero = np.zeros((4, 3, 3))
    factors = make_factors(p.real)
    for what, a in (("full", base), ("rank 2", rank_two), ("rank 1", rank_one), ("zero", zero)):
        a = a.astype(p.dtype)
        scale = np.maximum(largest(a), np.finfo(p.dtype).tiny)
        given = p.array(a, p.matrix(3, 3))
        for name, function in (("qr3", factors.qr), ("polar", factors.polar)):
            q, r = p.map(function, given)
            error = largest(np.einsum("nik,nkj->nij", wide(q), wide(r)) - wide(a)) / scale
            p.check(f"{what}: {name} residual", error, 20 * p.u, A=a)
            p.check(f"{what}: {name} orthogonality", departure(q), 36 * p.u, A=a)


@case("R7", "solve3 and inverse with condition numbers to 1e8, and at the ends of the range", BOTH)
def solve_and_inverse(p):
    solve, inverse = make_solve(p.real)
    for power in (1, 3, 6, 8):
        u = np.linalg.qr(p.random.normal(size=(2000, 3, 3)))[0]
        v = np.linalg.qr(p.random.normal(size=(2000, 3, 3)))[0]
        a = np.einsum("nik,k,njk->nij", u, [1.0, 10.0 ** (-power / 2), 10.0**-power], v)
        a, b = a.astype(p.dtype), p.random.normal(size=(2000, 3)).astype(p.dtype)
        x = p.map(solve, p.array(a, p.matrix(3, 3)), p.array(b, p.vector(3)))
        residual = np.abs(np.einsum("nij,nj->ni", wide(a), wide(x)) - wide(b)).max(1)
        scale = largest(a) * np.abs(x).max(1) + np.abs(b).max(1)
        p.check(f"backward error, condition 1e{power}", residual / scale, 8 * p.u, A=a, b=b)
    ends = (1e-15, 1e20) if p.dtype == "float32" else (1e-150, 1e200)
    for scale in ends:
        a = (scale * np.eye(3))[None].astype(p.dtype)
        found, _ = p.map(inverse, p.array(a, p.matrix(3, 3)))
        p.check(f"inverse of {scale:g} I", largest(found * wide(scale) - np.eye(3)), 4 * p.u, A=a)


@case("R14", "determinant and inverse of a Hilbert matrix", BOTH)
def hilbert(p):
    a = np.array([[[1 / (i + j + 1) for i in range(3)] for j in range(3)]]).astype(p.dtype)
    found, determinant = p.map(make_solve(p.real)[1], p.array(a, p.matrix(3, 3)))
    exact = np.linalg.inv(a[0].astype(np.float64))
    # Condition number 524; the rounded matrix is the operand.
    p.check("inverse", np.abs(found[0] - exact).max() / np.abs(exact).max(), 524 * 4 * p.u, A=a)
    p.check("determinant", determinant[0] * np.linalg.det(exact) - 1, 524 * 4 * p.u, A=a)
