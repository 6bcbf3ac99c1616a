"""Rotations and norms: R8 to R13."""

import functools

import numpy as np

import warp as wp
from warp.report.stability._case import case

BOTH = ("float32", "float64")


def wide(values):
    """Values in the widest precision that the host has."""
    return np.asarray(values, np.longdouble)


def quaternion_product(a, b):
    v = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    w = a[:, 3] * b[:, 3] - (a[:, :3] * b[:, :3]).sum(-1)
    return np.concatenate([v, w[:, None]], 1)


def units(random, count):
    v = random.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@functools.cache
def make_exponential(real):
    vec3, quat = wp.types.vector(3, real), wp.types.quaternion(real)

    @wp.func
    def exponential(v: vec3):
        return wp.quat_exp(v)

    @wp.func
    def logarithm(q: quat):
        return wp.quat_log(q)

    return exponential, logarithm


@case("R8", "exponential and logarithm of rotations, angles from 1e-12 to pi - 1e-7", BOTH)
def rotation_logarithm(p):
    angle = np.concatenate([np.geomspace(1e-12, 3.0, 400), np.pi - np.geomspace(0.14, 1e-7, 400)])
    vectors = (units(p.random, 800) * angle[:, None]).astype(p.dtype)
    exponential, logarithm = make_exponential(p.real)
    q = p.map(exponential, p.array(vectors, p.vector(3)))
    size = np.sqrt((wide(vectors) ** 2).sum(1))
    exact = np.concatenate(
        [wide(vectors) * (np.sin(size / 2) / size)[:, None], np.cos(size / 2)[:, None]], 1
    )
    error = np.abs(q - exact).max(1) / np.abs(exact).max(1)
    p.check("quat_exp, of the largest component", error, 8 * p.u, v=vectors)
    error = np.abs(q - exact)[:, :3].max(1) / np.abs(exact[:, :3]).max(1)
    p.check("quat_exp, of its vector part", error, 8 * p.u, v=vectors)
    back = p.map(logarithm, p.array(q, p.quat))
    error = np.linalg.norm(back - vectors, axis=1) / np.linalg.norm(vectors, axis=1)
    p.check("quat_log of it", error, 8 * p.u, v=vectors)


@functools.cache
def make_twist(real):
    vec3, quat = wp.types.vector(3, real), wp.types.quaternion(real)

    @wp.func
    def twist(axis: vec3, q: quat):
        return wp.quat_twist_angle(axis, q)

    return twist


@case("R9", "twist angle of small and large rotations", BOTH)
def twist_angle(p):
    angle = np.concatenate([np.geomspace(1e-10, 1.0, 200), np.pi - np.geomspace(1.0, 1e-3, 50)])
    axis = units(p.random, angle.size).astype(p.dtype)
    q = np.concatenate([axis * np.sin(angle / 2)[:, None], np.cos(angle / 2)[:, None]], 1)
    q = q.astype(p.dtype)
    found = p.map(make_twist(p.real), p.array(axis, p.vector(3)), p.array(q, p.quat))
    along = (wide(q[:, :3]) * wide(axis)).sum(1)
    exact = 2 * np.arctan2(np.abs(along), np.abs(wide(q[:, 3])))
    p.check("quat_twist_angle", (found - exact) / exact, 8 * p.u, axis=axis, q=q)


@functools.cache
def make_integration(real):
    vec3, quat = wp.types.vector(3, real), wp.types.quaternion(real)

    @wp.kernel
    def integrate(w: vec3, h: real, steps: int, exponential: bool, out: wp.array(dtype=quat)):
        q = wp.quaternion(real(0.0), real(0.0), real(0.0), real(1.0))
        small = wp.quat_exp(w * h)
        for _ in range(steps):
            if exponential:
                q = wp.normalize(small * q)
            else:
                rate = wp.quaternion(w[0], w[1], w[2], real(0.0)) * q
                q = wp.normalize(q + rate * (real(0.5) * h))
        out[0] = q

    return integrate


@case("R10", "a constant spin integrated for 1e6 steps: exponential map and first order", BOTH)
def spin_integration(p):
    h, steps, w = 1e-3, 1_000_000, np.array([0.3, -0.5, 0.8])
    h, w = float(np.asarray(h, p.dtype)), w.astype(p.dtype)
    out = p.zeros(1, p.quat)
    for exponential in (True, False):
        p.launch(make_integration(p.real), 1, p.vector(3)(*w), h, steps, exponential, out)
        speed = np.sqrt((wide(w) ** 2).sum())
        half = speed * h * steps / 2
        exact = np.append(wide(w) / speed * np.sin(half), np.cos(half))
        q = wide(out.numpy()[0])
        error = 2 * np.arcsin(min(1.0, float(min(np.abs(q - exact).max(), 1.0))))
        p.check("length", abs(np.sqrt((q * q).sum()) - 1), 4 * p.u)
        if exponential:
            p.check("angle, exponential map", error, steps * p.u)
        else:
            # arctan(h |w| / 2) in place of h |w| / 2 in each step.
            lost = steps * float(speed * h) ** 3 / 12
            p.check("angle, first order", error, 2 * lost + 2 * steps * p.u)


@functools.cache
def make_rotate(real):
    vec3, quat = wp.types.vector(3, real), wp.types.quaternion(real)

    @wp.func
    def rotate(q: quat, v: vec3):
        return wp.quat_rotate(q, v), wp.quat_rotate_inv(q, v)

    return rotate


@case("R11", "quat_rotate by quaternions that are not of unit length: q v q*", BOTH)
def non_unit_rotation(p):
    n = 2000
    v = p.random.normal(size=(n, 3)).astype(p.dtype)
    q = p.random.normal(size=(n, 4))
    q *= (p.random.uniform(0.5, 2.0, n) / np.linalg.norm(q, axis=1))[:, None]
    q = q.astype(p.dtype)
    forth, back = p.map(make_rotate(p.real), p.array(q, p.quat), p.array(v, p.vector(3)))
    for name, found, sign in (("quat_rotate", forth, 1.0), ("quat_rotate_inv", back, -1.0)):
        u, w = sign * wide(q[:, :3]), wide(q[:, 3:])
        turned = np.cross(u, wide(v))
        square = (wide(q) ** 2).sum(1)
        exact = square[:, None] * wide(v) + 2 * w * turned + 2 * np.cross(u, turned)
        scale = np.linalg.norm(v, axis=1) * square
        error = np.abs(found - exact).max(1) / scale
        p.check(name, error, 8 * p.u, q=q, v=v)


@functools.cache
def make_norms(real):
    vec2, vec3 = wp.types.vector(2, real), wp.types.vector(3, real)

    @wp.func
    def norms(v: vec2):
        return wp.length(v), wp.normalize(v)

    @wp.func
    def angle(a: vec3, b: vec3):
        return wp.angle_between(a, b)

    return norms, angle


@case("R13", "length and normalize of very long and very short vectors", BOTH)
def extreme_norms(p):
    scales = 10.0 ** np.array([-25, -23, -20, -10, 0, 10, 19, 25])
    if p.dtype == "float64":
        scales = scales**6
    v = np.concatenate([scales[:, None] * np.array(base) for base in ((3, 4), (1, 0), (1, -1))])
    v = v.astype(p.dtype)
    length, unit = p.map(make_norms(p.real)[0], p.array(v, p.vector(2)))
    exact = np.sqrt((wide(v) ** 2).sum(1))
    p.check("length", length / exact - 1, 2 * p.u, v=v)
    p.check("normalize", np.abs(unit - wide(v) / exact[:, None]).max(1), 2 * p.u, v=v)


@case("R15", "the angle between nearly parallel vectors", BOTH)
def small_angles(p):
    angle = np.concatenate([np.geomspace(1e-12, 1.0, 300), np.pi - np.geomspace(1.0, 1e-9, 300)])
    a = units(p.random, angle.size)
    b = np.cross(a, units(p.random, angle.size))
    b /= np.linalg.norm(b, axis=1)[:, None]
    b = (a * np.cos(angle)[:, None] + b * np.sin(angle)[:, None]).astype(p.dtype)
    a = (a * 3.0).astype(p.dtype)
    found = p.map(make_norms(p.real)[1], p.array(a, p.vector(3)), p.array(b, p.vector(3)))
    exact = exact_angle(a, b)
    error = np.abs(found - exact) / np.where(exact > 0, exact, 1.0)
    p.check("angle_between", error, 8 * p.u, a=a, b=b)


def exact_angle(a, b):
    """Angles from exact cross and dot products (rational arithmetic)."""
    from fractions import Fraction
    from math import atan2, isqrt

    def root(x):
        scale = 1 << 400
        return Fraction(isqrt(int(x * scale * scale)), scale)

    found = []
    for u, v in zip(a.tolist(), b.tolist()):
        u, v = [Fraction(x) for x in u], [Fraction(x) for x in v]
        c = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        sine, cosine = root(sum(x * x for x in c)), sum(x * y for x, y in zip(u, v))
        found.append(atan2(float(sine), float(cosine)))
    return np.array(found)
