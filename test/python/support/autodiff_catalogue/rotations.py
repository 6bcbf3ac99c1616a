"""T32 to T44: quaternions, and functions of singular and eigenvalues."""

import numpy as np

import warp as wp

from .problem import kernel, kernel_of, only, setting
from .registry import Mismatch, case
from .singular import reported

IDENTITY = np.eye(3)[None]


def of_matrices(p, function):
    """The kernel y[i] = function(a[i]) of 3 by 3 matrices."""
    R, M = p.real, p.mat33

    @kernel_of(function)
    def unary(a: wp.array(dtype=M), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = function(a[i])

    return unary


@case("T32", "a rotation by a quaternion that is not quite a unit")
def rotated(p):
    def build(q):
        Q, V = q.quat, q.vec3

        @kernel
        def rotate(r: wp.array(dtype=Q), x: wp.array(dtype=V), y: wp.array(dtype=V)):
            i = wp.tid()
            y[i] = wp.quat_rotate(r[i], x[i])

        turn = np.array([[0.3, -0.5, 0.2, 0.8]])
        turn *= 1.1 / np.linalg.norm(turn)
        inputs = [q.array(turn, q.quat), q.array([[1.0, 2.0, -0.5]], q.vec3)]
        return rotate, 1, inputs, [q.zeros(1, q.vec3)]

    p.finite_differences(build)


@case("T33", "the logarithm of a multiple of the identity rotation")
def logarithm(p):
    Q, V = p.quat, p.vec3

    @kernel
    def log(q: wp.array(dtype=Q), y: wp.array(dtype=V)):
        i = wp.tid()
        y[i] = wp.quat_log(q[i])

    scales = np.array([1.0, -1.0, 2.0, -2.0])
    q = np.zeros((4, 4))
    q[:, 3] = scales
    w = p.random(4, 3)
    (got,) = p.pullback(log, 4, [p.array(q, p.quat)], [p.zeros(4, p.vec3)], [w])
    p.close(got[:, :3], 2.0 / scales[:, None] * w)
    p.same(got[:, 3], np.zeros(4))


@case("T35", "interpolation between a rotation and itself stands still")
def interpolation(p):
    R, Q = p.real, p.quat

    @kernel
    def blend(
        a: wp.array(dtype=Q), b: wp.array(dtype=Q), t: wp.array(dtype=R), y: wp.array(dtype=Q)
    ):
        i = wp.tid()
        y[i] = wp.quat_slerp(a[i], b[i], t[i])

    a = np.array([[0.5, 0.5, 0.5, 0.5]] * 2)
    b = a * np.array([[1.0], [-1.0]])
    inputs = [p.array(a, p.quat), p.array(b, p.quat), p.array([0.25, 0.25])]
    da, db, dt = p.pullback(blend, 2, inputs, [p.zeros(2, p.quat)], [p.random(2, 4)])
    p.same(dt, [0.0, 0.0])
    p.holds(np.isfinite(da).all() and np.isfinite(db).all(), f"got {da} and {db}")


@case("T36", "a quaternion from a matrix, in each of the four branches")
def from_matrix(p):
    def turned(axis, angle):
        axis = np.array(axis) / np.linalg.norm(axis)
        k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k

    def build(q):
        M, Q = q.mat33, q.quat

        @kernel
        def convert(a: wp.array(dtype=M), y: wp.array(dtype=Q)):
            i = wp.tid()
            y[i] = wp.quat_from_matrix(a[i])

        axes = [[1.0, 2.0, 3.0], [9.0, 1.0, 2.0], [1.0, 9.0, 2.0], [2.0, 1.0, 9.0]]
        turns = np.stack([turned(a, t) for a, t in zip(axes, (0.5, 2.9, 2.9, 2.9))])
        return convert, 4, [q.array(turns, q.mat33)], [q.zeros(4, q.quat)]

    p.finite_differences(build)


@case("T37", "the sum of the singular values of the identity grows by the trace")
def nuclear_norm(p):
    M = p.mat33

    @wp.func
    def total(a: M):
        u, s, v = wp.svd3(a)
        return s[0] + s[1] + s[2]

    (got,) = p.pullback(of_matrices(p, total), 1, [p.array(IDENTITY, p.mat33)], [p.zeros(1)])
    p.close(got, IDENTITY)


def rotation_part(p):
    """The function from a matrix to its rotation: `polar`, or by singular values without it."""
    M = p.mat33

    @wp.func
    def by_svd(a: M):
        u, s, v = wp.svd3(a)
        return u * wp.transpose(v)

    if not hasattr(wp, "polar"):
        return by_svd

    @wp.func
    def by_polar(a: M):
        r = M()
        s = M()
        wp.polar(a, r, s)
        return r

    return by_polar


@case("T38", "the rotation next to the identity turns with the skew part")
def polar(p):
    rotation = rotation_part(p)

    @wp.func
    def twist(a: p.mat33):
        r = rotation(a)
        return r[0, 1] - r[1, 0]

    expected = np.array([[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]])
    (got,) = p.pullback(of_matrices(p, twist), 1, [p.array(IDENTITY, p.mat33)], [p.zeros(1)])
    p.close(got, expected)
    small = 1e-4 * np.diag([3.0, 2.0, 1.0])[None]
    (got,) = p.pullback(of_matrices(p, twist), 1, [p.array(small, p.mat33)], [p.zeros(1)])
    p.close(got, 4000.0 * expected)


@case("T41", "the square root of a multiple of the identity")
def matrix_root(p):
    @wp.func
    def trace_of_root(a: p.mat33):
        return wp.trace(wp.sym_fn3(a, wp.sqrt))

    inputs = [p.array(2.0 * IDENTITY, p.mat33)]
    (got,) = p.pullback(of_matrices(p, trace_of_root), 1, inputs, [p.zeros(1)])
    p.close(got, IDENTITY / (2.0 * np.sqrt(2.0)))


@case("T42", "a singular vector of the identity follows the policy")
def singular_vector(p):
    @wp.func
    def entry(a: p.mat33):
        u, s, v = wp.svd3(a)
        return u[0, 1]

    # There is no derivative, so forward mode has none to agree with.
    p.dot = False

    def run():
        inputs = [p.array(IDENTITY, p.mat33)]
        return p.pullback(of_matrices(p, entry), 1, inputs, [p.zeros(1)])[0]

    p.same(run(), np.zeros((1, 3, 3)))
    with setting(singular="strict"):
        p.holds(np.isnan(run()).any(), "'strict' gives no NaN")
    reported(p, run, np.zeros((1, 3, 3)))


@case("T43", "a neo-Hookean energy is stress-free at rest")
def neo_hookean(p):
    def function(q):
        R = q.real

        @wp.func
        def energy(f: q.mat33):
            j = wp.log(wp.determinant(f))
            i1 = wp.trace(wp.transpose(f) * f)
            return R(0.5) * (i1 - R(3.0)) - j + R(2.5) * j * j

        return energy

    (got,) = p.pullback(of_matrices(p, function(p)), 1, [p.array(IDENTITY, p.mat33)], [p.zeros(1)])
    p.near(got + IDENTITY, IDENTITY, 16 * p.eps)

    data = np.eye(3) + p.random(3, 3, 3, low=-0.2, high=0.2)

    def build(q):
        return of_matrices(q, function(q)), 3, [q.array(data, q.mat33)], [q.zeros(3)]

    p.finite_differences(build)


@case("T44", "a corotated energy at rest has the tensor of linear elasticity")
def corotated(p):
    R, M = p.real, p.mat33
    rotation = rotation_part(p)

    @kernel
    def energy(f: wp.array(dtype=M), e: wp.array(dtype=R)):
        r = rotation(f[0])
        d = f[0] - r
        t = wp.trace(wp.transpose(r) * f[0]) - R(3.0)
        e[0] = R(2.0) * wp.ddot(d, d) + R(1.5) * t * t

    def total(f):
        e = p.zeros(1)
        p.launch(energy, 1, [f], [e])
        return e

    h = p.random(1, 3, 3, low=-1.0, high=1.0)
    expected = 2.0 * (h + h.transpose(0, 2, 1)) + 3.0 * np.trace(h[0]) * IDENTITY
    if not hasattr(wp.autograd, "hvp"):
        raise Mismatch("there is no second derivative")
    made = wp.autograd.hvp(total, [p.array(IDENTITY, p.mat33)], [p.array(h, p.mat33, False)])
    p.close(only(made).numpy(), expected)
